//! Settings of a bidirectional path tracer.

use super::{Aimed, Radius, Strategies};
use crate::regularise::Accumulated;
use crate::sampler::SamplerKind;

/// Most light paths of an iteration.
pub(crate) const MAX_LIGHT_PATHS: u32 = 1 << 20;

/// A bidirectional path tracer, or one of its strategies.
#[derive(Clone, Debug)]
pub struct Bidirectional {
    /// The strategies that count.
    pub strategies: Strategies,
    /// The radius of merges; `None` for connections only.
    pub merging: Option<Radius>,
    /// Factors on that radius at which [`Strategies::Density`] counts the same photons, ascending from 1; empty for the radius
    /// alone.
    pub radii: Vec<f32>,
    /// True if the picture is kept in batches, with guides for its blur.
    pub batched: bool,
    /// No connections but light samples, beside merges.
    pub light_sampling_only: bool,
    /// Radius of the kernel for paths that no strategy can sample, over half the diagonal of the scene: that of sample 1,
    /// for sample n times n^(−1/6) `[PSR (6)]`. Without merging only.
    pub mollifier: Option<f32>,
    /// Accumulated roughness of the last vertex, where no strategy finds the path well. With [`Strategies::Only`] the
    /// picture lacks what is roughened.
    pub split: Option<Accumulated>,
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Vertex (from 1) at which Russian roulette of camera walks begins, that of light walks three before.
    pub roulette_start: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Random numbers of light paths, and of camera paths where the picture is kept in batches. Elsewhere those are independent, so
    /// that samples are, and the variances of a film are unbiased.
    pub sampler: SamplerKind,
    /// Aim of the last view.
    pub aimed: Aimed,
}
