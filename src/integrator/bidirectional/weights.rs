//! MIS weights of all strategies of a path, from three partial sums per walk: the balance heuristic `[Veach97 §9.2]`
//! over every way to find the path, in the recursive form of `[VCM-TR]`.
//!
//! A path has vertices x₀ on the camera, x₁ … x_k on surfaces, x_k on a light. Strategy (s, t) takes s of them from the
//! light walk and t from the camera walk: s = 0 is a light hit by the camera walk, s = 1 light sampling, t = 1 a light
//! walk connected to the camera. Where walks merge, a path is also sampled when both come within r of x_j: such a merge
//! has M = π r² N times the density of both walks at x_j `[UPS (6)]`, with N light paths; M = 0 without merging. Walks
//! merge at some vertices only (`vertex.rs`): m_j is 1 there, and 0 elsewhere. It depends on both neighbours of x_j, so
//! that a walk can compute it only at the next vertex.
//!
//! The weight of the strategy that closes the path is 1/(1 + w_l + w_c): w_l sums the densities of strategies with
//! fewer light vertices over this one's, w_c of those with more. Each walk stores its sum in a [`Partial`], updated at
//! every vertex; vc is relative to the density of a connection, vm to that of a merge:
//!
//! ```text
//! arrive          vcm *= d²  (not on the first edge from a light at infinity or of a parallel camera)
//!                 vcm, vc, vm /= c_in
//!                 vcm *= p_s / p_e  (on the first edge from a light)
//! smooth scatter  vc  <- (c_out / p_f) (p_r vc + vcm)
//!                 vm  <- (c_out / p_f) (p_r vm + vcm / M)          vcm <- 1 / p_f
//! after arrival   vc  += m c_out / (p_f c_in) M,  vm += m c_out / (p_f c_in), with m, c_out and p_f of the vertex before
//! Dirac scatter   vc, vm *= c_in (n_in / n_out)²                   vcm <- 0
//! ```
//!
//! p_s is the density with which light sampling at the first vertex draws the light's point, p_e that of emission.
//! c_in, c_out are the absolute cosines of the *geometric* normal with the directions to the previous and the next
//! vertex; p_f is the density per steradian with which this walk draws the next direction; p_r that with which the
//! other walk, coming from there, would draw the direction back to the previous vertex; n_in, n_out are the refractive
//! indices on the sides of the two directions. The Dirac factor is the exact ratio of the two densities on the
//! refraction manifold. Densities count non-Dirac ("smooth") lobes only, with their selection probabilities. Roulette
//! and opacity are left out: weights may be any function of the path that is the same from both sides.
//!
//! Everything here is pure and works in single and double precision; walks and tests call the same functions.

use std::ops::{Add, Div, Mul};

/// Arithmetic of the weights.
pub(crate) trait Real:
    Copy + From<f32> + PartialOrd + Add<Output = Self> + Mul<Output = Self> + Div<Output = Self>
{
}

impl Real for f32 {}
impl Real for f64 {}

/// Least cosine in a change of measure, so that nothing overflows at grazing angles. Both walks and all closings use
/// the same, so that the weights of a path still sum to 1.
pub(crate) const MIN_COS: f32 = 1e-6;

/// The partial sums of a walk.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Partial<T> {
    /// Reciprocal density of the last vertex; 0 if no connection can cut the last edge.
    pub vcm: T,
    /// Densities of all strategies that cut an earlier edge or merge before, over this walk's.
    pub vc: T,
    /// The same over M, for merges; without meaning where nothing merges.
    pub vm: T,
}

/// Parameters of merging and connecting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Merging<T> {
    /// M = π r² N; 0 if nothing merges.
    m: T,
    /// 1/M; 0 if nothing merges.
    inverse: T,
    /// 1 if edges of this walk are cut by connections, 0 if not.
    cut: T,
    /// 1 if edges after this walk's first are cut by connections, 0 if not.
    keep: T,
}

impl<T: Real> Merging<T> {
    /// No merging: connections only.
    pub(crate) fn none() -> Self {
        let (zero, one) = (T::from(0.0), T::from(1.0));
        Self {
            m: zero,
            inverse: zero,
            cut: one,
            keep: one,
        }
    }

    /// Merging with M = `m` > 0.
    pub(crate) fn new(m: T) -> Self {
        let one = T::from(1.0);
        Self {
            m,
            inverse: one / m,
            cut: one,
            keep: one,
        }
    }

    /// The same where light sampling is the only connection, for walks from the camera and for walks from a light: of a
    /// path only the edge at the light is cut, the first of a light walk and the last of a camera walk that hits it.
    pub(crate) fn light_sampling_only(self) -> [Self; 2] {
        let zero = T::from(0.0);
        [Self { cut: zero, ..self }, Self { keep: zero, ..self }]
    }
}

/// Densities at a non-Dirac vertex.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Step<T> {
    /// Absolute geometric cosine towards the next vertex.
    pub cos_out: T,
    /// Density per steradian with which this walk draws the next direction.
    pub pdf: T,
    /// Density per steradian with which the other walk, coming from there, draws the way back.
    pub pdf_reverse: T,
}

/// One end of a connecting edge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End<T> {
    /// Partial sums of the walk that ends here, after arrival.
    pub partial: Partial<T>,
    /// Density per area with which the *other* walk, drawing the edge from the other end, reaches this end.
    pub pdf_area: T,
    /// Density per steradian with which the other walk, having come along the edge, draws the direction to this walk's
    /// previous vertex.
    pub pdf_reverse: T,
    /// True if walks merge at this end on this path.
    pub merges: bool,
}

/// Clamps an absolute cosine to [`MIN_COS`].
#[inline]
pub(crate) fn clamped(cos: f32) -> f32 {
    cos.abs().max(MIN_COS)
}

impl<T: Real> Partial<T> {
    /// Sums of a camera path at its start, for N light paths: `pdf` is that of [`Sensor::pdf`].
    ///
    /// [`Sensor::pdf`]: crate::scene::Sensor::pdf
    #[inline]
    pub(crate) fn camera(pdf: T, light_paths: T) -> Self {
        Self {
            vcm: light_paths / pdf,
            vc: T::from(0.0),
            vm: T::from(0.0),
        }
    }

    /// Sums of a light path at its start: densities of its point and its direction, and the cosine at an area light (1
    /// for the environment, 0 for lights that no camera walk can hit).
    #[inline]
    pub(crate) fn light(
        pdf_position: T,
        pdf_direction: T,
        infinite: bool,
        cos: T,
        merging: &Merging<T>,
    ) -> Self {
        let one = T::from(1.0);
        let first = if infinite {
            pdf_position
        } else {
            pdf_direction
        };
        let vc = cos / (pdf_position * pdf_direction);
        Self {
            vcm: one / first,
            vc,
            vm: vc * merging.inverse,
        }
    }

    /// Updates the sums on arrival at the next vertex. `distance2` is the squared length of the edge, `None` on the
    /// first edge from a light at infinity or of a parallel camera.
    #[inline]
    pub(crate) fn arrive(&mut self, distance2: Option<T>, cos_in: T) {
        if let Some(distance2) = distance2 {
            self.vcm = self.vcm * distance2;
        }
        self.vcm = self.vcm / cos_in;
        self.vc = self.vc / cos_in;
        self.vm = self.vm / cos_in;
    }

    /// Updates the sums at the first vertex of a light walk, from which light sampling draws the light's point with
    /// `ratio` times the density of emission samples: only light sampling depends on that vertex.
    #[inline]
    pub(crate) fn sampled(&mut self, ratio: T) {
        self.vcm = self.vcm * ratio;
    }

    /// Updates the sums for a draw from a non-Dirac lobe.
    #[inline]
    pub(crate) fn scatter(&mut self, step: &Step<T>, merging: &Merging<T>) {
        let Self { vcm, vc, vm } = *self;
        let factor = step.cos_out / step.pdf;
        let vcm = merging.cut * vcm;
        self.vc = factor * (step.pdf_reverse * vc + vcm);
        self.vm = factor * (step.pdf_reverse * vm + vcm * merging.inverse);
        self.vcm = merging.keep / step.pdf;
    }

    /// Adds merges at the vertex before, after the walk has arrived at the next one: `factor` is c_out / (p_f c_in).
    #[inline]
    pub(crate) fn add_merges(&mut self, factor: T, merging: &Merging<T>) {
        self.vc = self.vc + factor * merging.m;
        self.vm = self.vm + factor;
    }

    /// Updates the sums for a Dirac lobe; `index2` is (n_in / n_out)², 1 for a reflection.
    #[inline]
    pub(crate) fn dirac(&mut self, cos_in: T, index2: T) {
        self.vc = self.vc * (cos_in * index2);
        self.vm = self.vm * (cos_in * index2);
        self.vcm = T::from(0.0);
    }
}

impl<T: Real> End<T> {
    /// Densities of the strategies that move the cut to this walk's side, over that of the cut here.
    #[inline]
    fn others(&self, merging: &Merging<T>) -> T {
        let cut = merging.cut * self.partial.vcm;
        let merges = if self.merges { merging.m } else { T::from(0.0) };
        self.pdf_area * (merges + cut + self.pdf_reverse * self.partial.vc)
    }
}

/// Weight of a light hit by the camera walk: `sampled` is the density with which light sampling from the walk's last
/// vertex draws it, per area for an area light and per steradian for the environment; `emitted` the density of emission
/// samples there, of position times direction. For an area light `partial` is taken after arrival, for the environment
/// before. A light that the camera ray itself hits has weight 1: no other strategy finds it.
#[inline]
pub(crate) fn hit<T: Real>(partial: &Partial<T>, sampled: T, emitted: T) -> T {
    let one = T::from(1.0);
    one / (one + sampled * partial.vcm + emitted * partial.vc)
}

/// Weight of a light sample, with the camera walk's merging. `pdf_hit` is the density of the camera walk's direction
/// over that of the light sample, 0 for lights without area; `camera` is the shading point, with the density of
/// emission samples that reach it over that of the light sample.
#[inline]
pub(crate) fn light_sample<T: Real>(pdf_hit: T, camera: &End<T>, merging: &Merging<T>) -> T {
    let one = T::from(1.0);
    one / (one + pdf_hit + camera.others(merging))
}

/// Weight of a connection of two walks.
#[inline]
pub(crate) fn connection<T: Real>(light: &End<T>, camera: &End<T>, merging: &Merging<T>) -> T {
    let one = T::from(1.0);
    one / (one + light.others(merging) + camera.others(merging))
}

/// Weight of a light walk's vertex that is connected to the camera; `light.pdf_area` is the density of one camera ray.
#[inline]
pub(crate) fn camera_sample<T: Real>(light: &End<T>, light_paths: T, merging: &Merging<T>) -> T {
    let one = T::from(1.0);
    one / (one + light.others(merging) / light_paths)
}

/// Weight of a merge of both walks at a vertex, with the sums of both after arrival there. `pdf` is the density per
/// steradian with which the camera walk continues along the light walk's last edge, `pdf_reverse` that with which the
/// light walk continues along the camera walk's; `merging` is the camera walk's.
#[inline]
pub(crate) fn merge<T: Real>(
    light: &Partial<T>,
    camera: &Partial<T>,
    pdf: T,
    pdf_reverse: T,
    merging: &Merging<T>,
) -> T {
    let one = T::from(1.0);
    let w_l = light.vcm * merging.inverse + pdf * light.vm;
    let w_c = merging.cut * camera.vcm * merging.inverse + pdf_reverse * camera.vm;
    one / (one + w_l + w_c)
}

#[cfg(test)]
mod tests;
