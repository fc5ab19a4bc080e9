//! Random numbers of a path: a stream keyed by (seed, pixel, sample), drawn in whole vertices.
//!
//! All numbers of a vertex are drawn before any branch, so that switching a feature on or off shifts no other number.
//! So pictures rendered with different tables share path prefixes, and finite differences have little noise.
//!
//! Each use of random numbers has its own [`Seed`]: [`Seed::derive`] keeps the streams of different uses apart.

mod sobol;
#[cfg(test)]
mod tests;

use crate::math::{UVec2, Vec2};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;
use serde::{Deserialize, Serialize};

/// Use of random numbers. The numbers of the variants determine the streams of a seed: never change or reuse one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Domain {
    /// Camera paths of a render.
    Camera = 0,
    /// Light paths of a render.
    Light = 1,
    /// Markov chains.
    Chain = 2,
    /// Pilot renders that choose the tuning of a table.
    Pilot = 3,
    /// Recorded paths of the training crops.
    Recording = 6,
    /// Recorded paths of the validation crops.
    Validation = 7,
    /// Russian roulette over recorded events.
    EventRoulette = 9,
    /// Choice of the samples in which levels of roughening draw a second lobe.
    Levels = 10,
    /// Sequences of Sobol points.
    Sobol = 11,
    /// Light paths by which the targets of aimed emission are chosen.
    Aim = 12,
    /// Probes of the surface around merges.
    Probes = 13,
    /// Pilot renders that estimate the light that a picture does not contain.
    Witness = 14,
    /// Choice of lights and casters in manifold sampling.
    Manifold = 15,
}

/// Seed of a set of random streams.
///
/// ```
/// use opsr::sampler::{Domain, Seed};
/// let user = Seed(7);
/// assert_eq!(user.derive(Domain::Camera, 0), user);
/// assert_ne!(user.derive(Domain::Light, 0), user.derive(Domain::Light, 1));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seed(pub u64);

impl Seed {
    /// Seed number `n` < 2⁵⁶ of a use. Seeds derived from one seed are distinct for distinct (`domain`, `n`), except
    /// for a chance of 2⁻⁶⁴ to equal the seed itself, which is that of camera paths, number 0.
    pub fn derive(self, domain: Domain, n: u64) -> Self {
        debug_assert!(n >> 56 == 0, "seed number {n} is too large");
        let key = ((domain as u64) << 56) | n;
        if key == 0 {
            return self;
        }
        // A bijection of the key. The xor of two hashes would give the same seed for derivations in different orders.
        Self(mix(key ^ mix(self.0.wrapping_add(0xa076_1d64_78bd_642f))))
    }
}

/// Least probability that one number of [`Sampler::next_1d`] may decide: `u < p` holds with probability p to a relative
/// 2⁻¹² from here on. For smaller p, 24 bits are too few; a p of 1e-9 would act as 6e-8.
pub const MIN_CHANCE: f32 = 1.0 / 4096.0;

/// Uniform random numbers in [0, 1) that draw a light and a point on it.
#[derive(Clone, Copy, Debug)]
pub struct LightU {
    /// Choice of the light. It has 53 bits, since a scene may have a million lights whose powers differ by a factor of
    /// a million.
    pub pick: f64,
    /// Point on the light.
    pub at: Vec2,
}

impl From<[f32; 3]> for LightU {
    /// Numbers in the order in which a vertex draws them; the choice then has only 24 bits.
    fn from([pick, x, y]: [f32; 3]) -> Self {
        Self {
            pick: pick.into(),
            at: Vec2::new(x, y),
        }
    }
}

/// Uniform random numbers in [0, 1) that start a light path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EmissionU {
    /// Choice of the light and of the target of aimed emission; with 53 bits.
    pub pick: f64,
    /// Point on the light, or across the scene for a light at infinity.
    pub point: Vec2,
    /// Direction, whether aimed or not.
    pub direction: Vec2,
    /// Choice of the side that emits.
    pub side: f32,
}

/// Uniform random numbers in [0, 1) of one scattering vertex, named by use.
#[derive(Clone, Copy, Debug)]
pub struct VertexU {
    /// Choice between the BSDFs of one material (partial transmission).
    pub material: f32,
    /// Choice of a light, and point on it.
    pub light: LightU,
    /// Lobe and direction, for the original and the regularised lobe alike.
    pub lobe: [f32; 3],
    /// Russian roulette.
    pub roulette: f32,
}

/// Source of uniform numbers in [0, 1) for one path.
pub trait Sampler {
    /// Next 32 random bits.
    fn next_bits(&mut self) -> u32;

    /// Next number.
    #[inline]
    fn next_1d(&mut self) -> f32 {
        unit(self.next_bits())
    }

    /// Next number, with 53 bits: for choices among many outcomes.
    fn next_pick(&mut self) -> f64 {
        let bits = u64::from(self.next_bits()) << 32 | u64::from(self.next_bits());
        (bits >> 11) as f64 * (0.5 * f64::EPSILON)
    }

    /// Numbers that start a light path.
    fn emission(&mut self) -> EmissionU {
        let pick = self.next_pick();
        let [x, y, u, v, side] = std::array::from_fn(|_| self.next_1d());
        EmissionU {
            pick,
            point: Vec2::new(x, y),
            direction: Vec2::new(u, v),
            side,
        }
    }

    /// Position in the pixel at which the path starts, in [0, 1)².
    fn film(&mut self) -> Vec2 {
        Vec2::new(self.next_1d(), self.next_1d())
    }

    /// Point on the lens through which the path starts, in [0, 1)²; drawn after [`Sampler::film`], if at all.
    fn lens(&mut self) -> Vec2 {
        Vec2::new(self.next_1d(), self.next_1d())
    }

    /// Number in [0, 1) that decides which partly opaque surfaces the next edge hits; `None` for a hash of its ray.
    fn opacity(&mut self) -> Option<f64> {
        None
    }

    /// Numbers of the next vertex.
    #[inline]
    fn vertex(&mut self) -> VertexU {
        // Each of the eight numbers leaves eight bits unused, which refine the choice of a light.
        let mut spare = 0u64;
        let mut next = || {
            let bits = self.next_bits();
            spare = spare << 8 | u64::from(bits & 0xff);
            unit(bits)
        };
        let material = next();
        let [pick, x, y] = std::array::from_fn(|_| next());
        let lobe = std::array::from_fn(|_| next());
        let roulette = next();
        VertexU {
            material,
            light: LightU {
                pick: f64::from(pick) + (spare >> 35) as f64 * (0.5 * f64::EPSILON),
                at: Vec2::new(x, y),
            },
            lobe,
            roulette,
        }
    }
}

/// Factory of the streams of all paths.
pub trait SampleSource: Sync {
    /// Stream of one path.
    type Stream: Sampler + Clone;
    /// Stream of sample number `sample` of a pixel, in coordinates of the full frame.
    fn stream(&self, pixel: UVec2, sample: u32) -> Self::Stream;
}

/// Independent uniform numbers from PCG32.
#[derive(Clone, Copy, Debug)]
pub struct Independent {
    /// Seed of all streams.
    pub seed: Seed,
}

/// Stream of [`Independent`].
#[derive(Clone, Debug)]
pub struct IndependentStream(Pcg32);

/// A number in [0, 1) from the upper 24 bits: every value is representable and below 1.
#[inline]
fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Finaliser of SplitMix64, a bijection in which every input bit affects every output bit.
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

impl SampleSource for Independent {
    type Stream = IndependentStream;

    fn stream(&self, pixel: UVec2, sample: u32) -> IndependentStream {
        let place = (u64::from(pixel.y) << 32) | u64::from(pixel.x);
        let key = mix(place ^ mix(self.seed.0.wrapping_add(0x9e37_79b9_7f4a_7c15)));
        let state = mix(key ^ mix(u64::from(sample).wrapping_add(0xd1b5_4a32_d192_ed03)));
        IndependentStream(Pcg32::new(state, key))
    }
}

impl Sampler for IndependentStream {
    #[inline]
    fn next_bits(&mut self) -> u32 {
        self.0.next_u32()
    }
}

/// Kind of random numbers of paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum SamplerKind {
    /// Independent samples.
    #[default]
    Independent,
    /// Owen-scrambled Sobol points: samples of a pixel that cover it, lights and lobes evenly, and light paths of neighbouring
    /// pixels that leave lights evenly.
    Sobol,
}

impl SamplerKind {
    /// True for independent samples.
    pub(crate) fn is_independent(&self) -> bool {
        *self == Self::Independent
    }
}

/// Numbers of camera paths.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraSource {
    /// Numbers after those of the Sobol sequences, or all numbers without sequences.
    independent: Independent,
    /// Number of Sobol sequences of a pixel, used in turn by its samples; 0 for independent samples.
    sequences: u32,
    /// Seed of all sequences.
    seed: Seed,
}

impl CameraSource {
    /// Numbers of a render with this seed. Samples n, n + `batches`, n + 2 `batches`, … are independent of all others.
    pub(crate) fn new(kind: SamplerKind, seed: Seed, batches: u32) -> Self {
        let independent = Independent {
            seed: seed.derive(Domain::Camera, 0),
        };
        let sequences = match kind {
            SamplerKind::Independent => 0,
            SamplerKind::Sobol => batches,
        };
        Self {
            independent,
            sequences,
            seed: seed.derive(Domain::Sobol, 0),
        }
    }

    /// Seed of the render.
    pub(crate) fn seed(&self) -> Seed {
        self.independent.seed
    }
}

/// Numbers of light paths.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSource {
    /// Numbers after those of the Sobol sequences, or all numbers without sequences.
    independent: Independent,
    /// Seed of the Sobol sequences, of which each sample has one; `None` for independent samples.
    sequences: Option<Seed>,
    /// Number of pixels in a line of the frame.
    columns: u32,
}

impl LightSource {
    /// Numbers of a render with this seed, one light path for each pixel of a frame with lines of `columns` pixels.
    pub(crate) fn new(kind: SamplerKind, seed: Seed, columns: u32) -> Self {
        Self {
            independent: Independent {
                seed: seed.derive(Domain::Light, 0),
            },
            sequences: (!kind.is_independent()).then(|| seed.derive(Domain::Sobol, 1)),
            columns,
        }
    }

    /// Stream of a light path of sample number `sample`. Points of a sequence follow a Z-curve through the pixels, so
    /// that aligned squares of 2^m x 2^m pixels have aligned runs of points. Samples are independent.
    pub(crate) fn stream(&self, path: u32, sample: u32) -> PathStream {
        let sequence = self.sequences.map(|seed| {
            let (x, y) = (path % self.columns, path / self.columns);
            let block = u64::from(y >> 16) << 48 | u64::from(x >> 16) << 32;
            let key = mix(seed.0 ^ block ^ u64::from(sample));
            sobol::SobolPoint::new(key, interleaved(x, y))
        });
        PathStream {
            rest: self.independent.stream(UVec2::new(path, 0), sample),
            sequence,
            drawn: 0,
            edges: 0,
            independent_lens: true,
        }
    }
}

/// Morton code of the lower 16 bits of two numbers; the lowest bit is that of `x`.
fn interleaved(x: u32, y: u32) -> u32 {
    let spread = |n: u32| {
        let n = n & 0xffff;
        let n = (n | n << 8) & 0x00ff_00ff;
        let n = (n | n << 4) & 0x0f0f_0f0f;
        let n = (n | n << 2) & 0x3333_3333;
        (n | n << 1) & 0x5555_5555
    };
    spread(x) | spread(y) << 1
}

/// Stream of a camera path or of a light path: Sobol points if there is a sequence, then independent numbers.
#[derive(Clone, Debug)]
pub struct PathStream {
    rest: IndependentStream,
    sequence: Option<sobol::SobolPoint>,
    /// Vertices drawn from the sequence.
    drawn: u32,
    /// Edges whose opacity was drawn from the sequence.
    edges: u8,
    /// True if points on the lens are independent numbers, as for light paths: each of their vertices draws one.
    independent_lens: bool,
}

impl Sampler for PathStream {
    #[inline]
    fn next_bits(&mut self) -> u32 {
        self.rest.next_bits()
    }

    fn emission(&mut self) -> EmissionU {
        match &self.sequence {
            Some(sequence) => sequence.emission(),
            None => self.rest.emission(),
        }
    }

    fn film(&mut self) -> Vec2 {
        match &self.sequence {
            Some(sequence) => sequence.film(),
            None => self.rest.film(),
        }
    }

    fn lens(&mut self) -> Vec2 {
        match &self.sequence {
            Some(sequence) if !self.independent_lens => sequence.lens(),
            _ => self.rest.lens(),
        }
    }

    fn opacity(&mut self) -> Option<f64> {
        let sequence = self.sequence.as_ref()?;
        let number = sequence.opacity(self.edges)?;
        self.edges += 1;
        Some(number)
    }

    #[inline]
    fn vertex(&mut self) -> VertexU {
        match &self.sequence {
            Some(sequence) if self.drawn < sobol::VERTICES => {
                self.drawn += 1;
                sequence.vertex(self.drawn - 1)
            }
            _ => self.rest.vertex(),
        }
    }
}

impl SampleSource for CameraSource {
    type Stream = PathStream;

    fn stream(&self, pixel: UVec2, sample: u32) -> PathStream {
        let sequence = (self.sequences > 0).then(|| {
            let (index, batch) = (sample / self.sequences, sample % self.sequences);
            let place = u64::from(batch) << 60 | u64::from(pixel.y) << 30 | u64::from(pixel.x);
            sobol::SobolPoint::new(mix(place ^ self.seed.0), index)
        });
        PathStream {
            rest: self.independent.stream(pixel, sample),
            sequence,
            drawn: 0,
            edges: 0,
            independent_lens: false,
        }
    }
}
