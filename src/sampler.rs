//! Random numbers of a path: a stream keyed by (seed, pixel, sample), drawn in whole vertices.
//!
//! All numbers of a vertex are drawn before any branch, so switching a feature on or off shifts no other number:
//! pictures made with different tables share their path prefixes, and finite differences are clean.

use crate::math::{UVec2, Vec2};
use rand::Rng;
use rand_pcg::Pcg32;

/// The random numbers of one scattering vertex, named by use.
#[derive(Clone, Copy, Debug)]
pub struct VertexU {
    /// Choice between closures of one material (partial transmission).
    pub material: f32,
    /// Which light, and where on it.
    pub light: [f32; 3],
    /// Lobe and direction, for the original and for the regularised lobe alike.
    pub lobe: [f32; 3],
    /// Russian roulette.
    pub roulette: f32,
}

/// A source of uniform numbers in [0, 1) for one path.
pub trait Sampler {
    /// The next number.
    fn next_1d(&mut self) -> f32;

    /// Where in the pixel the path starts, in [0, 1)².
    fn film(&mut self) -> Vec2 {
        Vec2::new(self.next_1d(), self.next_1d())
    }

    /// The numbers of the next vertex.
    fn vertex(&mut self) -> VertexU {
        VertexU {
            material: self.next_1d(),
            light: std::array::from_fn(|_| self.next_1d()),
            lobe: std::array::from_fn(|_| self.next_1d()),
            roulette: self.next_1d(),
        }
    }
}

/// Makes the stream of each path.
pub trait SampleSource: Sync {
    /// The stream.
    type Stream: Sampler;
    /// The stream of sample number `sample` of a pixel (full-frame coordinates).
    fn stream(&self, pixel: UVec2, sample: u32) -> Self::Stream;
}

/// Independent uniform numbers from PCG32.
#[derive(Clone, Copy, Debug)]
pub struct Independent {
    /// Seed of the whole picture.
    pub seed: u64,
}

/// A stream of [`Independent`].
#[derive(Clone, Debug)]
pub struct IndependentStream(Pcg32);

/// Finaliser of SplitMix64: every input bit reaches every output bit.
fn mix(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

impl SampleSource for Independent {
    type Stream = IndependentStream;

    fn stream(&self, pixel: UVec2, sample: u32) -> IndependentStream {
        let place = (u64::from(pixel.y) << 32) | u64::from(pixel.x);
        let key = mix(place ^ mix(self.seed.wrapping_add(0x9e37_79b9_7f4a_7c15)));
        let state = mix(key ^ mix(u64::from(sample).wrapping_add(0xd1b5_4a32_d192_ed03)));
        IndependentStream(Pcg32::new(state, key))
    }
}

impl Sampler for IndependentStream {
    #[inline]
    fn next_1d(&mut self) -> f32 {
        // 24 bits: every value is exactly representable and below 1.
        (self.0.next_u32() >> 8) as f32 * (1.0 / 16_777_216.0)
    }
}
