//! Factors at the scales of the levels, and the path state of the levels.

use crate::bsdf::DELTA_ALPHA;
use crate::regularise::{Accumulated, Attenuation, ConstantGamma, Factors, PathRoughness, Rule};

/// A table or a constant factor, and the multipliers of the levels from 1 on.
#[derive(Clone, Debug)]
pub(super) struct ScaledFactors {
    factors: Factors,
    scales: Vec<f32>,
}

impl ScaledFactors {
    /// The factors of a rule at these scales; `None` for a rule without factors.
    pub(super) fn new(rule: &Rule, scales: &[f32]) -> Option<Self> {
        let Rule::Accumulated(Accumulated { factors, .. }) = rule else {
            return None;
        };
        let unit = factors.scale();
        Some(Self {
            factors: factors.clone(),
            scales: scales.iter().map(|scale| unit * scale).collect(),
        })
    }

    /// Number of levels, that of plain path tracing included.
    pub(super) fn levels(&self) -> usize {
        self.scales.len() + 1
    }
}

/// Factors at the scale of a level.
struct Scaled<'a> {
    factors: &'a Factors,
    scale: f32,
}

impl Attenuation for Scaled<'_> {
    #[inline]
    fn gamma(&self, prefix: &PathRoughness, last: f32) -> f32 {
        (self.factors.unscaled(prefix, last) * self.scale).min(1.0)
    }
}

/// Path state of the rule at all levels.
#[derive(Clone, Copy, Default)]
pub(super) struct LevelMemory<const N: usize> {
    /// Path roughness, common to all levels until it folds: only the folded value of five vertices depends on factors.
    common: PathRoughness,
    folded: Option<[PathRoughness; N]>,
}

impl<const N: usize> LevelMemory<N> {
    /// Fills in α′ of the levels from 1 on; true if one of them is above α.
    #[inline]
    pub(super) fn roughen(&self, scaled: &ScaledFactors, alpha: f32, alphas: &mut [f32]) -> bool {
        let ScaledFactors { factors, scales } = scaled;
        let alphas = &mut alphas[1..];
        match &self.folded {
            None if self.common.values().is_empty() => false,
            None => {
                // One look-up for all levels.
                let gamma = factors.unscaled(&self.common, alpha);
                fill(scales, alpha, alphas, |_, scale| {
                    let gamma = ConstantGamma((gamma * scale).min(1.0));
                    self.common.accumulate(alpha, &gamma, 1.0)
                })
            }
            Some(paths) => fill(scales, alpha, alphas, |k, scale| {
                paths[k].accumulate(alpha, &Scaled { factors, scale }, 1.0)
            }),
        }
    }

    /// Appends a vertex from which the path continues by a lobe of roughness `alpha`.
    #[inline]
    pub(super) fn push(&mut self, scaled: &ScaledFactors, alpha: f32) {
        if self.folded.is_none() && !self.common.is_full() {
            self.common.push(alpha, &NO_FACTOR, 1.0);
            return;
        }
        let ScaledFactors { factors, scales } = scaled;
        let paths = self.folded.get_or_insert([self.common; N]);
        for (path, &scale) in paths.iter_mut().zip(scales) {
            path.push(alpha, &Scaled { factors, scale }, 1.0);
        }
    }
}

/// Fills in α′ by level and scale; true if one of them is above α. A lobe that stays below the Dirac bound keeps its
/// own roughness.
#[inline]
fn fill(
    scales: &[f32],
    alpha: f32,
    alphas: &mut [f32],
    roughened: impl Fn(usize, f32) -> f32,
) -> bool {
    let mut any = false;
    for (k, (&scale, out)) in scales.iter().zip(alphas).enumerate() {
        let roughened = roughened(k, scale);
        if roughened >= DELTA_ALPHA {
            *out = roughened;
            any |= roughened > alpha;
        }
    }
    any
}

/// Factor of a push that does not fold.
const NO_FACTOR: ConstantGamma = ConstantGamma(0.0);
