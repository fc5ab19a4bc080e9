//! A walk from the camera or from a light, with the partial sums of its MIS weights.

use super::vertex::{MergeRule, Vertex};
use super::weights::{Merging, Partial, Step, clamped};
use crate::bsdf::{Bsdf, BsdfSample, Lobe};
use crate::integrator::walk::shading_point::Continuation;
use crate::integrator::walk::{Arrival, Interaction, Origin, Walk};
use crate::math::{Rgb, Vec3};
use crate::sampler::Sampler;
use crate::scene::{EmissionDensity, EmissionSample, Scene};

/// Continuation of a walk from a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScatterKind {
    /// By a draw from a non-Dirac lobe.
    Smooth,
    /// By a Dirac lobe.
    Dirac,
    /// Straight through a pane: the edge continues behind it, since closing edges pass panes too.
    Straight,
}

impl ScatterKind {
    /// True for a draw from a non-Dirac lobe; `None` if the edge continues.
    #[inline]
    pub(super) fn smooth(self) -> Option<bool> {
        match self {
            Self::Smooth => Some(true),
            Self::Dirac => Some(false),
            Self::Straight => None,
        }
    }
}

/// Continuation of a walk of photon density estimation from a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SharpScatter {
    /// Along a direction of this density per steradian: 0 for a Dirac lobe.
    Drawn(f32),
    /// Straight through a pane.
    Straight,
}

/// A walk with the state of its MIS weights.
#[derive(Clone, Copy)]
pub(super) struct WeightedWalk<'a> {
    pub(super) base: Walk<'a>,
    pub(super) partial: Partial<f32>,
    pub(super) merging: Merging<f32>,
    /// True on an edge whose length changes no density: the first from a light at infinity or of a parallel camera.
    pub(super) parallel: bool,
    /// The light of a light walk on its first edge.
    pub(super) light: Option<u32>,
    /// True on the first edge.
    pub(super) first: bool,
    /// Length of the edge up to the last pane that it passed, and up to the last surface.
    pub(super) travelled: f32,
    pub(super) length: f32,
    /// Partial sums at the start of the edge, and at its end before merges at its start are added.
    pub(super) start: Partial<f32>,
    pub(super) arrived: Partial<f32>,
    pub(super) merge_rule: MergeRule,
    /// True if the start of the edge is sharp or the camera; `None` if it is a light without merges.
    pub(super) behind: Option<bool>,
    /// c_out / p_f of the vertex at the start of the edge if the vertex before allows merges there, else 0.
    pub(super) pending: f32,
}

impl<'a> WeightedWalk<'a> {
    /// A walk along a ray that a light emits.
    pub(super) fn light(
        scene: &'a Scene,
        start: &EmissionSample,
        merging: Merging<f32>,
        merge_rule: MergeRule,
    ) -> Self {
        let EmissionDensity {
            position,
            direction,
            infinite,
        } = start.pdf;
        let partial = Partial::light(position, direction, infinite, start.cos, &merging);
        Self {
            base: Walk::light(scene, start.ray, start.throughput, infinite),
            partial,
            merging,
            parallel: infinite,
            light: Some(start.light),
            first: true,
            travelled: 0.0,
            length: 0.0,
            start: partial,
            arrived: partial,
            merge_rule,
            behind: merge_rule.beside_lights.then_some(true),
            pending: 0.0,
        }
    }

    /// World direction of the current edge.
    pub(super) fn dir(&self) -> Vec3 {
        self.base.ray.dir
    }

    /// Throughput factor, on the first edge of a light walk, at a surface at distance `t` from its origin or its last
    /// pane: the window of a light of limited range.
    #[inline]
    pub(super) fn window(&self, start: &EmissionSample, t: f32) -> f32 {
        start.window(self.travelled + t) / start.window(self.travelled)
    }

    /// The end of the current edge.
    #[inline]
    pub(super) fn arrive(&mut self, numbers: &mut impl Sampler) -> Option<Arrival> {
        self.base.arrive(&mut (), numbers)
    }

    /// The `n`th vertex, where the walk has [arrived](WeightedWalk::arrive); `u` chooses between BSDFs of its material.
    #[inline]
    pub(super) fn vertex(&mut self, n: u32, arrival: &Arrival, u: f32) -> Vertex {
        let Arrival { hit, mut surface } = *arrival;
        let back = -self.dir();
        let cos = clamped(surface.ng.dot(back));
        self.length = self.travelled + hit.t;
        let distance2 = (!self.parallel).then_some(self.length * self.length);
        self.start = self.partial;
        self.partial.arrive(distance2, cos);
        if let Some(light) = self.light {
            let lights = self.base.scene.lights();
            let ratio = lights.sampling_over_emission(light, surface.position);
            self.partial.sampled(ratio);
        }
        let mut made = Bsdf::BLACK;
        let bsdf = *self.base.bsdf(&mut surface, u, &mut made);
        // Read after the call of `bsdf`: a dispersive interface leaves one channel.
        let throughput = match self.base.origin {
            Origin::Camera => self.base.throughput,
            Origin::Light => self.base.throughput / cos,
        };
        let Interaction {
            frame, wo, alpha, ..
        } = self.base.interaction(&surface, &bsdf);
        let allowed = |sharp| self.merge_rule.allows(sharp, self.length);
        let mut vertex = Vertex {
            n,
            first: self.first,
            hit,
            choice: u,
            surface,
            bsdf,
            alpha,
            back,
            frame,
            local: wo,
            throughput,
            partial: self.partial,
            merges: self.behind.is_some_and(allowed),
            around: *self.base.around(),
        };
        self.arrived = self.partial;
        if allowed(vertex.is_sharp()) {
            self.partial.add_merges(self.pending / cos, &self.merging);
            vertex.partial = self.partial;
        }
        vertex
    }

    /// Draws the next direction at a vertex; `None` where the walk ends.
    #[inline]
    pub(super) fn scatter(&mut self, vertex: &Vertex, u: [f32; 3]) -> Option<ScatterKind> {
        let sample = vertex.bsdf.sample(vertex.alpha, vertex.local, u)?;
        let out = vertex.frame.to_world(sample.wi);
        let leaves = match self.base.origin {
            Origin::Camera => vertex.surface.allows_direction(out, sample.wi.z),
            Origin::Light => out.dot(vertex.surface.ng) * sample.wi.z > 0.0,
        };
        if !leaves {
            return None;
        }
        if sample.delta && self.is_straight(vertex, sample.lobe) {
            let next = Continuation { wi: out, sample };
            self.base.pass(&vertex.surface, &next);
            self.partial = self.start;
            self.travelled = self.length;
            return (self.base.throughput != Rgb::ZERO).then_some(ScatterKind::Straight);
        }
        self.pending = 0.0;
        if sample.delta {
            self.dirac(vertex, &sample, out)?;
        } else {
            let cos_out = vertex.cos(out);
            // The density of the draw itself: rounding must not change it.
            let pdf = sample.pdf_w;
            let pdf_reverse = match self.base.origin {
                Origin::Camera => {
                    self.base.throughput *= sample.weight;
                    vertex.pdf_back(out)
                }
                Origin::Light => {
                    let eval = vertex.towards_camera(out)?;
                    self.base.throughput = vertex.throughput * eval.value * (cos_out / pdf);
                    eval.pdf_w
                }
            };
            let step = Step {
                cos_out,
                pdf,
                pdf_reverse,
            };
            self.partial.scatter(&step, &self.merging);
            if vertex.merges {
                self.pending = cos_out / pdf;
            }
        }
        self.leave(vertex, sample.lobe, out);
        let onward = if sample.delta {
            ScatterKind::Dirac
        } else {
            ScatterKind::Smooth
        };
        (self.base.throughput != Rgb::ZERO).then_some(onward)
    }

    /// True if this Dirac lobe passes a pane straight.
    #[inline]
    fn is_straight(&self, vertex: &Vertex, lobe: Lobe) -> bool {
        lobe == Lobe::Transmission
            && self.base.scene.is_pane(&vertex.surface)
            && matches!(vertex.bsdf, Bsdf::Thin(_))
    }

    /// Draws the next direction of a camera walk that merges at all rough lobes: `None` where a rough lobe was drawn,
    /// or the walk ends.
    pub(super) fn follow_sharp(&mut self, vertex: &Vertex, u: [f32; 3]) -> Option<SharpScatter> {
        let sample = vertex.bsdf.sample(vertex.alpha, vertex.local, u)?;
        let out = vertex.frame.to_world(sample.wi);
        let rough = !sample.delta && (sample.lobe == Lobe::Diffuse || vertex.merges_gloss());
        if rough || out.dot(vertex.surface.ng) * sample.wi.z <= 0.0 {
            return None;
        }
        if sample.delta && self.is_straight(vertex, sample.lobe) {
            let next = Continuation { wi: out, sample };
            self.base.pass(&vertex.surface, &next);
            return (self.base.throughput != Rgb::ZERO).then_some(SharpScatter::Straight);
        }
        let mut pdf_w = 0.0;
        self.base.throughput *= if sample.delta {
            sample.weight
        } else {
            let eval = vertex.sharp(out)?;
            pdf_w = eval.pdf_w;
            eval.value / eval.pdf_w
        };
        self.leave(vertex, sample.lobe, out);
        (self.base.throughput != Rgb::ZERO).then_some(SharpScatter::Drawn(pdf_w))
    }

    /// Starts the next edge from a vertex along `out`.
    #[inline]
    fn leave(&mut self, vertex: &Vertex, lobe: Lobe, out: Vec3) {
        self.parallel = false;
        self.first = false;
        self.travelled = 0.0;
        self.light = None;
        self.behind = Some(vertex.is_sharp());
        self.base.leave(&vertex.interaction(), lobe, out);
    }

    /// Continues along a Dirac lobe. A light walk's throughput changes by the ratio of the two measures: η²|cos ns| dω
    /// is equal on both sides of a refraction, so its flux keeps its η² and gains the cosines' ratio.
    #[inline]
    fn dirac(&mut self, vertex: &Vertex, sample: &BsdfSample, out: Vec3) -> Option<()> {
        // An interface between equal indices does not refract.
        let refracts = sample.lobe == Lobe::Transmission && !vertex.bsdf.is_delta_at(1.0);
        let refraction_scale = if refracts {
            vertex.bsdf.refraction_scale(vertex.local)
        } else {
            1.0
        };
        self.base.throughput *= sample.weight;
        if self.base.origin == Origin::Light {
            // Shading cosines in the frame for the camera's side, like the value.
            let frame = vertex.surface.frame_for(out);
            let (wi, wo) = (vertex.back.dot(frame.n), out.dot(frame.n));
            if vertex.back.dot(vertex.surface.ng) * wi <= 0.0 {
                return None;
            }
            let ng = vertex.surface.ng;
            let cosines = (wi * out.dot(ng)) / (wo * vertex.back.dot(ng));
            self.base.throughput *= refraction_scale * cosines.abs();
        }
        self.partial
            .dirac(vertex.cos(vertex.back), 1.0 / refraction_scale);
        Some(())
    }

    /// [`Walk::survive_with`]; `None` for a walk that ends.
    #[inline]
    pub(super) fn survive_with(&mut self, chance: f32, u: &mut f32) -> Option<()> {
        self.base.survive_with(chance, u, &mut ()).then_some(())
    }

    /// [`Walk::reset_roulette`].
    #[inline]
    pub(super) fn reset_roulette(&mut self) {
        self.base.reset_roulette();
    }

    /// Russian roulette; `None` for a walk that ends.
    #[inline]
    pub(super) fn survive(&mut self, u: f32) -> Option<()> {
        self.base.survive(Some(u), &mut ()).then_some(())
    }
}
