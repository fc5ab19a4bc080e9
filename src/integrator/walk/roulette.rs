//! Russian roulette `[Veach97 §10.4.1]`.

use crate::math::Rgb;
use crate::sampler::MIN_CHANCE;

/// Largest survival probability: a path of lossless reflections must end as well.
const LARGEST: f32 = 0.95;

/// The probability with which a path survived, by which its throughput is divided; `None` for a path that ends. `u` is
/// uniform in [0, 1).
///
/// `eta_scale` undoes the 1/η² with which refraction scales radiance: that scaling is no loss of light.
#[inline]
pub(in crate::integrator) fn survival(throughput: Rgb, eta_scale: f32, u: f32) -> Option<f32> {
    // A throughput that is not a number survives; the film rejects and reports it.
    let survival = (throughput * eta_scale).max_element().min(LARGEST);
    // The bits of `u` resolve no smaller probability; a path without throughput ends.
    let survival = if survival > 0.0 {
        survival.max(MIN_CHANCE)
    } else {
        survival
    };
    (u < survival).then_some(survival)
}
