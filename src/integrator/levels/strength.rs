//! The rule of the levels, at the strength of each, and what it remembers of a path.

use crate::bsdf::DELTA_ALPHA;
use crate::image::level_film::MAX_LEVELS;
use crate::regularise::rules::filter_glossy;
use crate::regularise::{
    Accumulated, Attenuation, ConstantGamma, Factors, PathRoughness, Rule, Scattered,
};

/// A rule with a number that levels scale. Unlike in the renderers that some rules come from, the path goes on with its
/// own roughness.
#[derive(Clone, Debug)]
pub(super) struct Strength {
    rule: ScaledRule,
    /// Multipliers of the levels from 1 on.
    scales: Vec<f32>,
}

#[derive(Clone, Debug)]
enum ScaledRule {
    /// Accumulated roughness; the factors are scaled.
    Factors(Factors),
    /// Filter glossy; its filter value is scaled.
    FilterGlossy(f32),
    /// Roughness clamp; the roughness that it remembers is scaled.
    RoughnessClamp,
}

impl Strength {
    /// A rule at these scales; `None` for a rule without a number to scale.
    pub(super) fn new(rule: &Rule, scales: &[f32]) -> Option<Self> {
        let (rule, unit) = match rule {
            Rule::Accumulated(Accumulated { factors, .. }) => {
                (ScaledRule::Factors(factors.clone()), factors.scale())
            }
            Rule::FilterGlossy(filter) => (ScaledRule::FilterGlossy(*filter), 1.0),
            Rule::RoughnessClamp => (ScaledRule::RoughnessClamp, 1.0),
            Rule::Plain | Rule::Pbrt | Rule::Mollifier(_) => return None,
        };
        let scales = scales.iter().map(|scale| unit * scale).collect();
        Some(Self { rule, scales })
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

/// Memory of a path.
#[derive(Clone, Copy)]
pub(super) struct LevelMemory {
    /// Path roughness of all levels until it folds, since only the value that five vertices fold to depends on the factors.
    common: PathRoughness,
    folded: Option<[PathRoughness; MAX_LEVELS]>,
    /// The largest own roughness so far.
    roughest: f32,
    /// The smallest density so far.
    least_pdf_w: f32,
}

impl Default for LevelMemory {
    fn default() -> Self {
        Self {
            common: PathRoughness::default(),
            folded: None,
            roughest: 0.0,
            least_pdf_w: f32::INFINITY,
        }
    }
}

impl LevelMemory {
    /// Fills in α′ of the levels from 1 on; true if one of them is above α.
    #[inline]
    pub(super) fn roughen(&self, strength: &Strength, alpha: f32, alphas: &mut [f32]) -> bool {
        let Strength { rule, scales } = strength;
        let alphas = &mut alphas[1..];
        match (rule, &self.folded) {
            (ScaledRule::Factors(_), None) if self.common.values().is_empty() => false,
            (ScaledRule::Factors(factors), None) => {
                // Looked up once.
                let gamma = factors.unscaled(&self.common, alpha);
                fill(scales, alpha, alphas, |_, scale| {
                    let gamma = ConstantGamma((gamma * scale).min(1.0));
                    self.common.accumulate(alpha, &gamma, 1.0)
                })
            }
            (ScaledRule::Factors(factors), Some(paths)) => {
                fill(scales, alpha, alphas, |k, scale| {
                    paths[k].accumulate(alpha, &Scaled { factors, scale }, 1.0)
                })
            }
            (ScaledRule::FilterGlossy(filter), _) => fill(scales, alpha, alphas, |_, scale| {
                filter_glossy(filter * scale, self.least_pdf_w, alpha)
            }),
            (ScaledRule::RoughnessClamp, _) => fill(scales, alpha, alphas, |_, scale| {
                alpha.max((self.roughest * scale).min(1.0))
            }),
        }
    }

    /// Appends the vertex that the path continues from.
    #[inline]
    pub(super) fn push(&mut self, strength: &Strength, vertex: Scattered) {
        let ScaledRule::Factors(factors) = &strength.rule else {
            self.roughest = self.roughest.max(vertex.alpha);
            self.least_pdf_w = self.least_pdf_w.min(vertex.pdf_w);
            return;
        };
        if self.folded.is_none() && !self.common.is_full() {
            self.common.push(vertex.alpha, &NO_FACTOR, 1.0);
            return;
        }
        let paths = self.folded.get_or_insert([self.common; MAX_LEVELS]);
        for (path, &scale) in paths.iter_mut().zip(&strength.scales) {
            path.push(vertex.alpha, &Scaled { factors, scale }, 1.0);
        }
    }
}

/// Fills in α′ by level and scale; true if one of them is above α. A lobe that stays below the Dirac bound keeps its own
/// roughness.
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
