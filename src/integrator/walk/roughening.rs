//! Roughness at next-event estimation, and the path state from which a rule computes it.

use super::observer::PathObserver;
use super::shading_point::ShadingPoint;
use crate::bsdf::{BsdfSample, DELTA_ALPHA, Lobe};
use crate::regularise::{Roughening, Scattered};

/// Roughness α′ at next-event estimation; a lobe that stays below the Dirac bound keeps its own.
#[inline]
pub(in crate::integrator) fn roughen<R: Roughening>(rule: &R, memory: &R::Path, alpha: f32) -> f32 {
    if !R::ACTIVE || alpha >= 1.0 {
        return alpha;
    }
    let alpha_reg = rule.roughen(memory, alpha);
    if alpha_reg < DELTA_ALPHA {
        alpha
    } else {
        alpha_reg
    }
}

/// The lobe from which a path continues, of own roughness `alpha`, in the form that rules store.
#[inline]
pub(in crate::integrator) fn scattered(alpha: f32, sample: &BsdfSample) -> Scattered {
    Scattered {
        alpha: if sample.lobe == Lobe::Diffuse {
            1.0
        } else {
            alpha
        },
        pdf_w: if sample.delta {
            f32::INFINITY
        } else {
            sample.pdf_w
        },
    }
}

/// Appends the lobe from which a path continues to the path state, and reports it to the observer.
#[inline]
pub(in crate::integrator) fn remember<R: Roughening, O: PathObserver>(
    rule: &R,
    memory: &mut R::Path,
    point: &ShadingPoint<'_>,
    sample: &BsdfSample,
    observer: &mut O,
) {
    let scattered = scattered(point.alpha, sample);
    if R::ACTIVE {
        rule.scatter(memory, scattered);
    }
    observer.sampled(sample.lobe);
    observer.scattered(scattered.alpha);
}
