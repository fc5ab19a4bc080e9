//! The paper: how much to roughen the last surface of a path, given the roughness of the path so far.
//!
//! At next-event estimation the glossy lobe of the last vertex is evaluated at an *accumulated roughness* α′ₙ ≥ αₙ
//! `[OPSR (7)]`; the path itself continues with the original lobe. [`Accumulated`] computes α′ from a [`PathRoughness`]
//! and [`Factors`] (a learned table, or one constant γ). [`Rule`] is the user's choice, which includes rules of other
//! renderers; estimators are generic over [`Roughening`].
//!
//! The crate `opsr-table`, which other renderers can use alone, contains path roughness, tables, their files and their
//! export. This module contains the rules; it depends on no scene, light or trainer.

pub mod file;
pub(crate) mod rules;

pub use opsr_table::{
    Attenuation, AttenuationTable, BIN_EDGES, BINS, ConstantGamma, GammaIndex, LEN, Lookup,
    MAX_VERTICES, PathRoughness, bin, bin_coordinate, export,
};
pub use rules::Rule;

/// Attenuation factors of [`Accumulated`].
#[derive(Clone, Debug, PartialEq)]
pub enum Factors {
    /// One γ in [0, 1] for every path.
    Constant(f32),
    /// One learned γ for each class of path.
    Table(AttenuationTable),
}

impl Factors {
    /// True if no path is ever roughened.
    pub(crate) fn are_zero(&self) -> bool {
        match self {
            Self::Constant(gamma) => *gamma == 0.0,
            Self::Table(table) => table.scale == 0.0 || table.gammas.iter().all(|&g| g == 0.0),
        }
    }

    /// Multiplier of every factor.
    pub(crate) fn scale(&self) -> f32 {
        match self {
            Self::Constant(_) => 1.0,
            Self::Table(table) => table.scale,
        }
    }

    /// Factor of a path before multiplication by [`Factors::scale`].
    #[inline]
    pub(crate) fn unscaled(&self, prefix: &PathRoughness, last: f32) -> f32 {
        match self {
            Self::Constant(gamma) => *gamma,
            Self::Table(table) => table.unscaled(prefix, last),
        }
    }
}

impl Attenuation for Factors {
    #[inline]
    fn gamma(&self, prefix: &PathRoughness, last: f32) -> f32 {
        match self {
            Self::Constant(gamma) => *gamma,
            Self::Table(table) => table.gamma(prefix, last),
        }
    }
}

/// Data about the lobe from which a path continued, passed to [`Roughening::scatter`].
#[derive(Clone, Copy, Debug)]
pub struct Scattered {
    /// Own roughness of the sampled lobe: 0 for a perfectly smooth one, 1 for Lambert.
    pub alpha: f32,
    /// Density of the direction per steradian, infinity for a Dirac lobe.
    pub pdf_w: f32,
}

/// Computes the roughness of the last vertex of a path at next-event estimation.
pub trait Roughening: Sync {
    /// State of the path so far.
    type Path: Copy;
    /// False if no roughness ever changes, so that the compiler can remove look-ups and state.
    const ACTIVE: bool = true;

    /// State of an empty path of sample number `sample` (from 0) of a pixel.
    fn start(&self, sample: u32) -> Self::Path;

    /// Roughness α′ ≥ `alpha` at next-event estimation; `alpha` itself where the rule does not roughen.
    fn roughen(&self, path: &Self::Path, alpha: f32) -> f32;

    /// Appends a vertex to the state.
    fn scatter(&self, path: &mut Self::Path, vertex: Scattered);

    /// Radius of the kernel at lights without area, over half the diagonal of the scene; `None` for a rule that does
    /// not spread Dirac lobes towards such lights `[PSR]`.
    fn mollifier_radius(&self, _: &Self::Path) -> Option<f32> {
        None
    }
}

impl<R: Roughening> Roughening for &R {
    type Path = R::Path;
    const ACTIVE: bool = R::ACTIVE;

    #[inline]
    fn start(&self, sample: u32) -> R::Path {
        (**self).start(sample)
    }

    #[inline]
    fn roughen(&self, path: &R::Path, alpha: f32) -> f32 {
        (**self).roughen(path, alpha)
    }

    #[inline]
    fn scatter(&self, path: &mut R::Path, vertex: Scattered) {
        (**self).scatter(path, vertex)
    }

    #[inline]
    fn mollifier_radius(&self, path: &R::Path) -> Option<f32> {
        (**self).mollifier_radius(path)
    }
}

/// No regularisation: plain path tracing, without any state.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Unregularised;

impl Roughening for Unregularised {
    type Path = ();
    const ACTIVE: bool = false;

    fn start(&self, _: u32) {}

    #[inline]
    fn roughen(&self, (): &(), alpha: f32) -> f32 {
        alpha
    }

    #[inline]
    fn scatter(&self, (): &mut (), _: Scattered) {}
}

/// Path space regularisation by accumulated roughness `[OPSR (13), (14)]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Accumulated {
    /// The attenuation factors.
    pub factors: Factors,
    /// Exponent λ of the consistent variant, which multiplies the surplus α′ − α of sample n (from 1) by n^−λ
    /// `[OPSR §4.2]`; 0 for the fixed, biased estimator.
    pub lambda: f32,
}

/// State of [`Accumulated`].
#[derive(Clone, Copy, Debug, Default)]
pub struct AccumulatedPath {
    roughness: PathRoughness,
    /// n^−λ.
    shrink: f32,
}

impl AccumulatedPath {
    /// Roughness of the vertices so far.
    pub(crate) fn roughness(&self) -> &PathRoughness {
        &self.roughness
    }
}

impl Roughening for Accumulated {
    type Path = AccumulatedPath;

    fn start(&self, sample: u32) -> AccumulatedPath {
        let shrink = if self.lambda > 0.0 {
            ((f64::from(sample) + 1.0).powf(-f64::from(self.lambda))) as f32
        } else {
            1.0
        };
        AccumulatedPath {
            roughness: PathRoughness::default(),
            shrink,
        }
    }

    #[inline]
    fn roughen(&self, path: &AccumulatedPath, alpha: f32) -> f32 {
        path.roughness.accumulate(alpha, &self.factors, path.shrink)
    }

    #[inline]
    fn scatter(&self, path: &mut AccumulatedPath, vertex: Scattered) {
        path.roughness
            .push(vertex.alpha, &self.factors, path.shrink);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accumulated_roughness_shrinks_with_the_sample_number() {
        let scattered = |alpha| Scattered { alpha, pdf_w: 1.0 };
        // Sample 0 is the first, with the full surplus.
        for (lambda, sample, shrink) in [(0.0, 3, 1.0), (0.5, 0, 1.0), (0.5, 3, 0.5), (1.0, 4, 0.2)]
        {
            let rule = Accumulated {
                factors: Factors::Constant(0.25),
                lambda,
            };
            let mut path = rule.start(sample);
            assert_eq!(rule.roughen(&path, 0.1), 0.1);
            rule.scatter(&mut path, scattered(0.4));
            rule.scatter(&mut path, scattered(0.8));
            // 1 − (1 − γ 0.4)(1 − γ 0.8) = 0.28.
            let surplus = 0.9 * 0.28 * shrink;
            let got = rule.roughen(&path, 0.1);
            assert!(
                (got - 0.1 - surplus).abs() < 1e-6,
                "{lambda} {sample}: {got}"
            );
            assert_eq!(rule.roughen(&path, 1.0), 1.0);
        }
        assert_eq!(Unregularised.roughen(&(), 0.3), 0.3);
    }
}
