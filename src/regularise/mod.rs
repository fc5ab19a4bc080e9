//! The paper: how much to roughen the last surface of a path, given the roughness of the path so far.
//!
//! At next-event estimation the glossy lobe of the last vertex is evaluated at an *accumulated roughness*
//! α′ₙ ≥ αₙ `[OPSR (7)]`; the path itself goes on with the original lobe. [`Accumulated`] computes α′ from a
//! [`PathRoughness`] and an [`Attenuation`] (a learned table, or one constant γ). Rules that other renderers use
//! stand beside it behind the same small interface, [`Regulariser`]; [`Unregularised`] is a plain path tracer.
//!
//! Nothing here depends on scenes, lights or the trainer.

pub mod export;
pub mod file;
mod roughness;
pub mod rules;
mod table;

pub use roughness::{
    BIN_EDGES, BINS, GammaIndex, MAX_VERTICES, PathRoughness, bin, bin_coordinate,
};
pub use table::{AttenuationTable, LEN, Lookup, TableTuning};

/// Where the attenuation factor γ in [0, 1] of a path comes from.
pub trait Attenuation: Sync {
    /// γ for a path with this prefix whose last vertex has roughness `last`; the prefix is not empty.
    fn gamma(&self, prefix: &PathRoughness, last: f32) -> f32;
}

/// One γ for every path: the paper's naive variant.
#[derive(Clone, Copy, Debug)]
pub struct ConstantGamma(pub f32);

impl Attenuation for ConstantGamma {
    #[inline]
    fn gamma(&self, _: &PathRoughness, _: f32) -> f32 {
        self.0
    }
}

/// What a path scattered from, as a rule may want to remember it.
#[derive(Clone, Copy, Debug)]
pub struct Scattered {
    /// Own roughness of the lobe that was sampled: 0 for a perfectly smooth one, 1 for Lambert.
    pub alpha: f32,
    /// Density of the direction per steradian, infinity for a Dirac lobe.
    pub pdf_w: f32,
}

/// A rule that roughens the last vertex of a path.
pub trait Regulariser: Sync {
    /// What the rule remembers of the path so far.
    type Path: Copy;
    /// Whether the rule ever changes a roughness; `false` compiles it away.
    const ACTIVE: bool;
    /// Whether the path goes on with the roughened lobe too.
    const REUSE: bool;

    /// The memory of an empty path of sample number `sample` (from 0) of a pixel.
    fn start(&self, sample: u32) -> Self::Path;

    /// Roughness to use at next-event estimation, at least `alpha`; `alpha` itself where nothing changes.
    fn roughen(&self, path: &Self::Path, alpha: f32) -> f32;

    /// Appends a vertex to the memory.
    fn scatter(&self, path: &mut Self::Path, vertex: Scattered);

    /// Whether Dirac lobes are spread towards lights that nothing can find by way of them.
    const MOLLIFIES: bool = false;

    /// How far they are spread: radius of the kernel at the light over half the diagonal of the scene.
    fn bandwidth(&self, _: &Self::Path) -> f32 {
        0.0
    }
}

/// No regularisation: a plain path tracer.
#[derive(Clone, Copy, Debug, Default)]
pub struct Unregularised;

impl Regulariser for Unregularised {
    type Path = ();
    const ACTIVE: bool = false;
    const REUSE: bool = false;

    fn start(&self, _: u32) {}

    #[inline]
    fn roughen(&self, (): &(), alpha: f32) -> f32 {
        alpha
    }

    #[inline]
    fn scatter(&self, (): &mut (), _: Scattered) {}
}

/// Path space regularisation by accumulated roughness `[OPSR (13), (14)]`.
///
/// With `REUSE` the path goes on with the regularised lobe ("reuse" of section 5.1): as fast as a plain path tracer,
/// slightly more bias.
#[derive(Clone, Copy, Debug)]
pub struct Accumulated<A, const REUSE: bool = false> {
    /// The attenuation factors.
    pub attenuation: A,
    /// Exponent λ of the consistent variant, which multiplies the surplus α′ − α of sample n (from 1) by n^−λ
    /// `[OPSR §4.2]`; 0 for the fixed, biased estimator.
    pub lambda: f32,
}

/// Memory of [`Accumulated`].
#[derive(Clone, Copy, Debug)]
pub struct AccumulatedPath {
    roughness: PathRoughness,
    /// n^−λ.
    shrink: f32,
}

impl<A: Attenuation, const REUSE: bool> Regulariser for Accumulated<A, REUSE> {
    type Path = AccumulatedPath;
    const ACTIVE: bool = true;
    const REUSE: bool = REUSE;

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
        path.roughness
            .accumulate(alpha, &self.attenuation, path.shrink)
    }

    #[inline]
    fn scatter(&self, path: &mut AccumulatedPath, vertex: Scattered) {
        path.roughness
            .push(vertex.alpha, &self.attenuation, path.shrink);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_gathers_roughness_and_samples_shrink_it() {
        let scattered = |alpha| Scattered { alpha, pdf_w: 1.0 };
        // Sample 0 is the first, of which nothing is taken.
        for (lambda, sample, shrink) in [(0.0, 3, 1.0), (0.5, 0, 1.0), (0.5, 3, 0.5), (1.0, 4, 0.2)]
        {
            let rule = Accumulated::<_, false> {
                attenuation: ConstantGamma(0.25),
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
