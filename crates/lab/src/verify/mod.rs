//! Hard numerical cases, checked on the current machine.
//!
//! Regularisation works at roughness near zero, where single precision has few digits to spare and where another
//! processor or mathematics library may round differently. A [`Case`] runs checks of one kind; each reports its worst
//! value and the bound. A check takes the function under test as an argument, so that tests can pass a faulty one and
//! require a failure. The cases are listed in `docs/numerics.md`.

pub mod bsdfs;
pub mod chaos;
pub mod chi_square;
pub mod density;
mod finding;
pub mod images;
#[cfg(feature = "train")]
pub mod learning;
pub mod lights;
pub mod lobes;
pub mod modes;
pub mod repeat;
pub mod roughness;
pub mod sampling;
pub mod simple;
pub mod soak;
pub mod transport;
pub mod weights;

pub use finding::Finding;
use opsr::math::{UVec2, Vec3};
use opsr::sampler::{Independent, IndependentStream, SampleSource, Sampler, Seed};

/// Amount of work of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Size {
    /// A second, for tests of the program.
    Tiny,
    /// Tens of seconds for all checks together.
    Small,
    /// Minutes.
    Thorough,
}

impl Size {
    /// The value for this size.
    pub fn of<T>(self, tiny: T, small: T, thorough: T) -> T {
        match self {
            Self::Tiny => tiny,
            Self::Small => small,
            Self::Thorough => thorough,
        }
    }
}

/// Checks of one kind.
pub struct Case {
    /// Name, as `opsr verify` prints it.
    pub name: &'static str,
    run: fn(Size) -> Vec<Finding>,
}

impl Case {
    /// Runs the checks.
    pub fn run(&self, size: Size) -> Vec<Finding> {
        (self.run)(size)
    }
}

const fn case(name: &'static str, run: fn(Size) -> Vec<Finding>) -> Case {
    Case { name, run }
}

/// Numerical cases. Only the last three depend on the size.
pub const NUMERIC: [Case; 14] = [
    case("path roughness", |_| roughness::all()),
    case("Dirac bound", |_| lobes::dirac()),
    case("lobe sampling", |_| lobes::sampling()),
    case("interfaces", |_| lobes::interfaces()),
    case("MIS weights", |_| weights::balances()),
    case("running moments", |_| weights::moments()),
    case("lights near and far", |_| lights::all()),
    case("closed bodies", |_| transport::leaks()),
    case("scale of the scene", |_| transport::scales()),
    case("Russian roulette", |_| transport::roulette()),
    case("empty scenes", |_| transport::empty_scenes()),
    case("chi-square", sampling::chi_square),
    case("white furnace", sampling::furnace),
    case("invariants", sampling::invariants),
];

/// A thread pool for one check.
fn pool(threads: usize) -> rayon::ThreadPool {
    let builder = rayon::ThreadPoolBuilder::new().num_threads(threads);
    builder.build().expect("threads")
}

/// Random numbers from the renderer's generator.
struct Numbers(IndependentStream);

impl Numbers {
    fn new(seed: u64) -> Self {
        Self(Independent { seed: Seed(seed) }.stream(UVec2::ZERO, 0))
    }

    /// Uniform number in [0, 1).
    fn next(&mut self) -> f32 {
        self.0.next_1d()
    }

    /// Uniform integer in 0..count.
    fn below(&mut self, count: usize) -> usize {
        ((self.next() * count as f32) as usize).min(count - 1)
    }

    /// At most `count` different integers in 1..end, ascending.
    fn places(&mut self, end: u32, count: usize) -> Vec<u32> {
        let mut all: Vec<u32> = (1..end).collect();
        while all.len() > count {
            all.remove(self.below(all.len()));
        }
        all
    }

    /// Number from `low` to `high`, uniform in the logarithm.
    fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(f64::from(self.next()))
    }

    /// Three numbers in [0, 1), often at the ends of the range.
    fn ends(&mut self) -> [f32; 3] {
        std::array::from_fn(|_| match self.below(16) {
            0 => 0.0,
            1 => 1.0 - f32::EPSILON / 2.0,
            2 => f32::EPSILON / 2.0,
            _ => self.next(),
        })
    }

    /// Direction above the plane z = 0; half of them logarithmic in the angle to the horizon, at least 1e-5 radians.
    fn above(&mut self) -> Vec3 {
        let from_horizon = if self.next() < 0.5 {
            90.0 * self.next()
        } else {
            self.logarithmic(1e-3, 1.0) as f32
        };
        let (cos, sin) = from_horizon.to_radians().max(1e-5).sin_cos();
        let (y, x) = (std::f32::consts::TAU * self.next()).sin_cos();
        Vec3::new(sin * x, sin * y, cos)
    }
}
