//! Factors with which a recording samples its lobes.
//!
//! Directions sampled from a lobe at one roughness estimate the lobe at another one badly. For a large light, whose p_l
//! is small, an event sampled at γ₀ has many times the noise at 10 γ₀ that the renderer has there. So a recording
//! samples the lobe of every roughened vertex once with each of several factors, and weights all samples with the
//! balance heuristic (`[Veach97]` eq. 9.8): some samples were drawn near any factor that the table can have.

use opsr::bsdf::{BsdfEval, DELTA_ALPHA, LobeQuery};
use opsr::regularise::{ConstantGamma, PathRoughness, Roughening, Scattered};

/// Ratio of α′ below which two proposals count as one: the factors are chosen for a mirror, and most of them hardly
/// change the α′ of a surface that is rough by itself.
const MIN_RATIO: f32 = 1.7;

/// Constant factors with which lobes are sampled, ascending. As a [`Roughening`] they roughen by the first.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposals {
    gammas: Vec<f32>,
}

impl Proposals {
    /// Sorts `gammas`, at least one factor.
    pub fn new(gammas: &[f32]) -> Self {
        let mut gammas = gammas.to_vec();
        gammas.sort_by(f32::total_cmp);
        Self { gammas }
    }

    /// α′ of a vertex of roughness `last`.
    ///
    /// A roughened lobe is clamped to [`DELTA_ALPHA`] and kept above `last`, so that every factor records the same set
    /// of vertices.
    #[inline]
    fn alpha(path: &PathRoughness, last: f32, gamma: f32) -> f32 {
        if last >= 1.0 || path.values().iter().all(|&alpha| alpha <= 0.0) {
            return last;
        }
        let alpha = path.accumulate(last, &ConstantGamma(gamma), 1.0);
        alpha.max(DELTA_ALPHA).max(last.next_up())
    }

    /// Appends α′ of the last vertex of a path for every factor, without those closer than [`MIN_RATIO`].
    pub(crate) fn alphas(&self, list: &[f32], alphas: &mut Vec<f32>) {
        let (&last, before) = list.split_last().unwrap_or((&1.0, &[]));
        let mut widest = f32::NEG_INFINITY;
        for &gamma in &self.gammas {
            let path = PathRoughness::of(before, &ConstantGamma(gamma));
            let alpha = Self::alpha(&path, last, gamma);
            if alpha > widest * MIN_RATIO {
                alphas.push(alpha);
                widest = alpha;
            }
        }
    }

    /// Density of a direction summed over all proposals, and the largest value of the lobe over them.
    pub(crate) fn all(query: &LobeQuery, alphas: &[f32]) -> BsdfEval {
        let lobes = alphas.iter().map(|&alpha| query.at(alpha));
        lobes.fold(BsdfEval::default(), |all, lobe| BsdfEval {
            value: all.value.max(lobe.value),
            pdf_w: all.pdf_w + lobe.pdf_w,
        })
    }

    fn first(&self) -> f32 {
        self.gammas.first().copied().unwrap_or_default()
    }
}

impl Roughening for &Proposals {
    type Path = PathRoughness;

    fn start(&self, _: u32) -> PathRoughness {
        PathRoughness::default()
    }

    #[inline]
    fn roughen(&self, path: &PathRoughness, alpha: f32) -> f32 {
        Proposals::alpha(path, alpha, self.first())
    }

    #[inline]
    fn scatter(&self, path: &mut PathRoughness, vertex: Scattered) {
        path.push(vertex.alpha, &ConstantGamma(self.first()), 1.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn similar_proposals_are_sampled_once() {
        let drawn = Proposals::new(&[1e-3, 0.1, 0.2, 1.0]);
        let alphas = |list: &[f32]| {
            let mut alphas = Vec::new();
            drawn.alphas(list, &mut alphas);
            alphas
        };
        // A Dirac lobe after a rough vertex: α′ = γ · 0.5, clamped to DELTA_ALPHA.
        assert_eq!(alphas(&[0.5, 0.0]), [DELTA_ALPHA, 0.05, 0.1, 0.5]);
        // 0.20, 0.24, 0.28 and 0.6.
        assert_eq!(alphas(&[0.5, 0.2]).len(), 2);
        assert_eq!(alphas(&[0.5, 0.7]).len(), 1);
        // A change lost to rounding still counts as roughened.
        assert!(alphas(&[1e-6, 0.7])[0] > 0.7);
        // A specular prefix, direct light and diffuse vertices are not roughened.
        for list in [&[0.0, 0.0][..], &[0.0, 0.0, 0.2], &[0.2], &[0.5, 1.0]] {
            let last = list[list.len() - 1];
            assert_eq!(alphas(list), [last], "{list:?}");
        }
        // The path tracer roughens by the first.
        let rule = &drawn;
        let mut path = rule.start(7);
        assert_eq!(rule.roughen(&path, 0.3), 0.3);
        rule.scatter(
            &mut path,
            Scattered {
                alpha: 0.5,
                pdf_w: 1.0,
            },
        );
        assert_eq!(rule.roughen(&path, 0.0), DELTA_ALPHA);
        assert_eq!(rule.roughen(&path, 0.3), alphas(&[0.5, 0.3])[0]);
    }
}
