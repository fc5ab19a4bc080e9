//! Hard numerical cases, tried on the machine at hand.
//!
//! A renderer that regularises lives at roughness near zero, where single precision has few digits to spare and where
//! another processor or mathematics library may round otherwise. Each [`Case`] tries one kind of trouble and reports
//! the worst that it met beside the bound that this program promises. The checks take what they check as an argument,
//! so that tests can hand them something wrong and see that they find it.

pub mod lights;
pub mod lobes;
pub mod roughness;
pub mod transport;
pub mod weights;

use crate::math::{UVec2, Vec3};
use crate::sampler::{Independent, IndependentStream, SampleSource, Sampler};

/// What one check found.
#[derive(Clone, Debug)]
pub struct Finding {
    /// What was tried, and what `worst` is.
    pub tried: String,
    /// The worst value met.
    pub worst: f64,
    /// What it may be at most.
    pub bound: f64,
}

impl Finding {
    /// A finding from the worst of some values; one that is not a number stays.
    fn new(tried: impl Into<String>, bound: f64, values: impl IntoIterator<Item = f64>) -> Self {
        let worse = |a: f64, b: f64| if b > a || b.is_nan() { b } else { a };
        let worst = values
            .into_iter()
            .fold(0.0f64, |a, b| if a.is_nan() { a } else { worse(a, b) });
        Self {
            tried: tried.into(),
            worst,
            bound,
        }
    }

    /// Whether the bound holds; never for a worst value that is not a number.
    pub fn holds(&self) -> bool {
        self.worst <= self.bound
    }
}

/// A kind of trouble.
pub struct Case {
    /// Its name.
    pub name: &'static str,
    run: fn() -> Vec<Finding>,
}

impl Case {
    /// Tries it.
    pub fn run(&self) -> Vec<Finding> {
        (self.run)()
    }
}

/// All cases; together they take some seconds.
pub const CASES: [Case; 11] = [
    Case {
        name: "path roughness",
        run: roughness::all,
    },
    Case {
        name: "the Dirac bound",
        run: lobes::dirac,
    },
    Case {
        name: "lobes at the ends",
        run: lobes::ends,
    },
    Case {
        name: "interfaces",
        run: lobes::interfaces,
    },
    Case {
        name: "weights of densities",
        run: weights::balances,
    },
    Case {
        name: "running moments",
        run: weights::moments,
    },
    Case {
        name: "lights near and far",
        run: lights::all,
    },
    Case {
        name: "closed bodies",
        run: transport::leaks,
    },
    Case {
        name: "scale of the scene",
        run: transport::scales,
    },
    Case {
        name: "Russian roulette",
        run: transport::roulette,
    },
    Case {
        name: "scenes without anything",
        run: transport::nothing,
    },
];

/// Uniform random numbers of the renderer's own kind.
struct Numbers(IndependentStream);

impl Numbers {
    fn new(seed: u64) -> Self {
        Self(Independent { seed }.stream(UVec2::ZERO, 0))
    }

    /// In [0, 1).
    fn next(&mut self) -> f32 {
        self.0.next_1d()
    }

    /// One of 0..count.
    fn below(&mut self, count: usize) -> usize {
        ((self.next() * count as f32) as usize).min(count - 1)
    }

    /// From `low` to `high`, even in the logarithm.
    fn logarithmic(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(f64::from(self.next()))
    }

    /// Three numbers, often at the ends of their range.
    fn ends(&mut self) -> [f32; 3] {
        std::array::from_fn(|_| match self.below(16) {
            0 => 0.0,
            1 => 1.0 - f32::EPSILON / 2.0,
            2 => f32::EPSILON / 2.0,
            _ => self.next(),
        })
    }

    /// A direction above the plane z = 0, half of them ever closer to the horizon.
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
