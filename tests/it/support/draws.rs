//! Random colours, points and directions.

use opsr::math::{Rgb, UVec2, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

pub(crate) fn rng(seed: u64) -> Pcg32 {
    Pcg32::seed_from_u64(seed)
}

pub(crate) fn numbers(rng: &mut Pcg32) -> [f32; 3] {
    std::array::from_fn(|_| rng.random())
}

pub(crate) fn point(rng: &mut Pcg32, size: f32) -> Vec3 {
    let mut x = || (rng.random::<f32>() * 2.0 - 1.0) * size;
    Vec3::new(x(), x(), x())
}

pub(crate) fn direction(rng: &mut Pcg32) -> Vec3 {
    loop {
        let p = point(rng, 1.0);
        let r = p.length();
        if r > 0.1 && r < 1.0 {
            return p / r;
        }
    }
}

/// A cheap substitute for an estimator: uniform numbers that depend on pixel, sample, channel and seed.
pub(crate) fn noise(pixel: UVec2, sample: u32, seed: u32) -> Rgb {
    let pixel = u64::from(pixel.x) << 32 | u64::from(pixel.y);
    let state = scramble(scramble(pixel) ^ (u64::from(seed) << 32 | u64::from(sample)));
    Rgb::from_array(
        [1, 2, 3].map(|c| (scramble(state.wrapping_add(c)) >> 40) as f32 / (1u32 << 24) as f32),
    )
}

/// The generator splitmix64 started at `z`.
fn scramble(z: u64) -> u64 {
    let z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
