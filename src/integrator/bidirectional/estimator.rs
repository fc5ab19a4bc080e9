//! Settings of a bidirectional path tracer.

use super::{AimCache, Radius, Strategies};
use crate::regularise::Accumulated;
use crate::sampler::SamplerKind;

/// Most light paths of an iteration.
pub(crate) const MAX_LIGHT_PATHS: u32 = 1 << 20;

/// A bidirectional path tracer, or one of its strategies.
#[derive(Clone, Debug)]
pub(crate) struct Bidirectional {
    /// The strategies that contribute to the picture.
    pub strategies: Strategies,
    /// The merge radius; `None` for connections only.
    pub merging: Option<Radius>,
    /// Factors on that radius within which [`Strategies::Density`] counts the same photons, ascending from 1; empty for
    /// one radius.
    pub radii: Vec<f32>,
    /// True if the picture is stored in batches, with features that guide its blur.
    pub batched: bool,
    /// True if light samples are the only connections beside merges.
    pub light_sampling_only: bool,
    /// Kernel radius of sample 1 for paths that no strategy can sample, over half the diagonal of the scene; sample n
    /// has n^(−1/6) times it `[PSR (6)]`. Without merging only.
    pub mollifier: Option<f32>,
    /// Rule that roughens the last vertex of paths that no strategy samples well. Only [`Strategies::All`] adds the
    /// roughened light.
    pub split: Option<Accumulated>,
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Vertex (from 1) at which Russian roulette of camera walks begins, but not before the first draw from a lobe
    /// that is not Dirac; that of light walks begins three earlier.
    pub roulette_start: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Sampler of light paths, and of camera paths if the picture is stored in batches. Other camera paths have
    /// independent numbers, so that samples are independent and variance estimates of the film unbiased.
    pub sampler: SamplerKind,
    /// Cached aim of the last view.
    pub aim_cache: AimCache,
}
