//! Learned roughening `[OPSR]` of the last vertex of paths that no strategy samples well.
//!
//! The value at the last vertex x_n is f = f_base + f_gloss(α); only the glossy (or Dirac) lobe f_gloss is roughened.
//! The integrand is a function of the path, never of the strategy that finds it:
//!
//! ```text
//! f* = f_base + (1 − h) f_gloss(α) + h f_gloss(α′)        h = 1 − smoothstep(0.1, 0.3, Q)
//! ```
//!
//! Q measures how well connections sample the path: it is the greatest roughness of an edge, and an edge has the
//! smaller roughness of its two ends. Camera and light have roughness 1, x_n that of its glossy lobe, a Dirac event 0,
//! other vertices the mean of their lobes weighted by value. Where walks merge, a vertex counts like an edge. h does
//! not depend on the direction from x_n to the light, so that the glossy lobe's energy is kept; α′ follows from the
//! same roughness values. Where x₁ … xₙ₋₁ all are Dirac, α′ = α and h = 0.
//!
//! The *easy part* is every contribution of the unregularised estimator, with its weights, times 1 − g h, where g is
//! the share of the glossy lobe in the value at x_n. The *hard part* h f_gloss(α′) is estimated by the camera walk
//! alone, as in the path tracer: light sampling and a separate ray. Since each has one integrand, the sum has the
//! expectation ∫ f* whatever the weights; roughening in every strategy would count light twice.

use super::iteration::Iteration;
use super::vertex::Vertex;
use crate::bsdf::{Bsdf, SharedNumbers};
use crate::integrator::walk::roughening::roughen;
use crate::integrator::walk::shading_point::ShadingPoint;
use crate::math::{Rgb, Vec3, luminance};
use crate::regularise::{Accumulated, AccumulatedPath, Roughening, Scattered};
use crate::sampler::VertexU;

/// Roughness Q of the best edge up to which the glossy lobe is roughened in full, and from which not at all.
const SHARP: f32 = 0.1;
const ROUGH: f32 = 0.3;

/// Share h of the glossy lobe that is roughened.
pub(super) fn share(best: f32) -> f32 {
    let x = ((best - SHARP) / (ROUGH - SHARP)).clamp(0.0, 1.0);
    1.0 - x * x * (3.0 - 2.0 * x)
}

/// Lobes that scatter at a vertex between two directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Event {
    /// Mean roughness of the lobes, weighted by their values.
    pub(super) roughness: f32,
    /// Share g of the glossy lobe in the value.
    pub(super) gloss: Rgb,
}

impl Event {
    /// A Dirac lobe.
    pub(super) const DIRAC: Self = Self {
        roughness: 0.0,
        gloss: Rgb::ONE,
    };

    /// Non-Dirac lobes of a BSDF of roughness `alpha` between local directions to the camera and to the light.
    pub(super) fn between(bsdf: &Bsdf, alpha: f32, directions: Option<(Vec3, Vec3)>) -> Self {
        const BASE: Event = Event {
            roughness: 1.0,
            gloss: Rgb::ZERO,
        };
        let base = match bsdf {
            // The coat dims both lobes of its base alike.
            Bsdf::Covered(coated) => return Self::between(&coated.base(), alpha, directions),
            Bsdf::Diffuse(_) | Bsdf::Sheen(_) => return BASE,
            _ => bsdf.base_albedo(),
        };
        if base == Rgb::ZERO {
            return Self {
                roughness: alpha,
                gloss: Rgb::ONE,
            };
        }
        let Some(query) = directions.and_then(|(wo, wi)| bsdf.query(wo, wi)) else {
            return BASE;
        };
        let (whole, gloss) = (query.at(alpha).value, query.gloss().at(alpha).value);
        let of = |part: f32, whole: f32| if whole > 0.0 { part / whole } else { 0.0 };
        let roughness = 1.0 - (1.0 - alpha) * of(luminance(gloss), luminance(whole));
        let (gloss, whole) = (gloss.to_array(), whole.to_array());
        Self {
            roughness,
            gloss: Rgb::from_array(std::array::from_fn(|c| of(gloss[c], whole[c]))),
        }
    }
}

impl Vertex {
    /// Lobes of a vertex of a camera walk towards the light.
    #[inline]
    pub(super) fn event_to_light(&self, out: Vec3) -> Event {
        let directions = (self.local, self.frame.to_local(out));
        Event::between(&self.bsdf, self.alpha, Some(directions))
    }

    /// Lobes of a vertex of a light walk towards the camera.
    #[inline]
    pub(super) fn event_to_camera(&self, out: Vec3) -> Event {
        Event::between(&self.bsdf, self.alpha, self.seen_from(out))
    }

    /// Easy part of light from `out`: the factor 1 − g h on the value.
    #[inline]
    pub(super) fn easy_part(&self, out: Vec3, h: f32) -> Rgb {
        if h == 0.0 {
            return Rgb::ONE;
        }
        Rgb::ONE - self.event_to_light(out).gloss * h
    }
}

/// Roughness of the edges of a walk so far.
#[derive(Clone, Copy, Debug)]
struct EdgeRoughness {
    /// Roughness of the best edge.
    best: f32,
    /// Roughness of the last vertex.
    last: f32,
}

impl EdgeRoughness {
    /// The camera or a light.
    const END: Self = Self {
        best: 0.0,
        last: 1.0,
    };

    /// One more vertex of this roughness; `merges` if walks merge at it.
    #[inline]
    fn with(self, roughness: f32, merges: bool) -> Self {
        let edge = if merges {
            roughness
        } else {
            self.last.min(roughness)
        };
        Self {
            best: self.best.max(edge),
            last: roughness,
        }
    }

    /// Roughness of the best edge of a path closed by an edge between two walks.
    #[inline]
    fn join(&self, other: &Self) -> f32 {
        self.best.max(other.best).max(self.last.min(other.last))
    }
}

/// Summary of a light walk before a stored vertex.
#[derive(Clone, Copy, Debug)]
pub(super) struct LightSummary {
    reach: EdgeRoughness,
    /// Share of the glossy lobe at the path's last vertex, the first of the light walk.
    gloss: Rgb,
}

const _: () = assert!(size_of::<LightSummary>() == 20);

impl LightSummary {
    /// The light itself.
    pub(super) const START: Self = Self {
        reach: EdgeRoughness::END,
        gloss: Rgb::ZERO,
    };

    /// The summary after a vertex with these lobes.
    #[inline]
    fn with(self, vertex: &Vertex, event: Event, merges: bool) -> Self {
        if vertex.first {
            // The path's last vertex has the roughness of its glossy lobe, whatever the direction to the light.
            Self {
                reach: self.reach.with(vertex.alpha, merges),
                gloss: event.gloss,
            }
        } else {
            Self {
                reach: self.reach.with(event.roughness, merges),
                gloss: self.gloss,
            }
        }
    }
}

/// Summary of a camera walk so far.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraSummary<'a> {
    rule: Option<&'a Accumulated>,
    memory: AccumulatedPath,
    reach: EdgeRoughness,
    /// True if the walk has followed a non-Dirac lobe.
    smooth: bool,
    merges: bool,
    /// Easy part of emission at the end of the walk's current edge.
    pub(super) easy_emission: Rgb,
}

impl CameraSummary<'_> {
    /// Share h of the glossy lobe that is roughened if this vertex is the path's last.
    #[inline]
    pub(super) fn share(&self, vertex: &Vertex) -> f32 {
        let best = self.reach.best.max(vertex.alpha);
        if self.rule.is_none() || !self.smooth || best >= ROUGH || vertex.bsdf.is_diffuse() {
            return 0.0;
        }
        share(best)
    }

    /// Easy part of a connection to a vertex of a light walk.
    #[inline]
    pub(super) fn connected(&self, vertex: &Vertex, light: &Vertex, summary: &LightSummary) -> Rgb {
        if self.rule.is_none() || self.reach.best.max(summary.reach.best) >= ROUGH {
            return Rgb::ONE;
        }
        let dir = (light.surface.position - vertex.surface.position).normalize();
        let here = vertex.event_to_light(dir);
        let there = summary.with(light, light.event_to_camera(-dir), self.merges);
        let reach = self.reach.with(here.roughness, self.merges);
        Rgb::ONE - there.gloss * share(reach.join(&there.reach))
    }

    /// Easy part of a merge at this vertex with a light walk from `back`; `first` if straight from its light.
    #[inline]
    pub(super) fn merged(
        &self,
        vertex: &Vertex,
        first: bool,
        back: Vec3,
        summary: &LightSummary,
    ) -> Rgb {
        if self.rule.is_none() || self.reach.best.max(summary.reach.best) >= ROUGH {
            return Rgb::ONE;
        }
        if first {
            return vertex.easy_part(back, self.share(vertex));
        }
        let event = vertex.event_to_light(back);
        let best = (self.reach.best.max(summary.reach.best)).max(event.roughness);
        Rgb::ONE - summary.gloss * share(best)
    }

    /// Appends a vertex left along `out`, by a Dirac lobe unless `smooth`; `h` is its [share](CameraSummary::share).
    #[inline]
    pub(super) fn scatter(&mut self, vertex: &Vertex, out: Vec3, smooth: bool, h: f32) {
        let Some(rule) = self.rule else {
            return;
        };
        self.easy_emission = Rgb::ONE;
        if self.reach.best >= ROUGH {
            return;
        }
        let event = if smooth {
            vertex.event_to_light(out)
        } else {
            Event::DIRAC
        };
        self.easy_emission -= event.gloss * h;
        self.smooth |= smooth;
        self.reach = self.reach.with(event.roughness, self.merges);
        let scattered = Scattered {
            alpha: event.roughness,
            // Not used by this rule.
            pdf_w: f32::INFINITY,
        };
        rule.scatter(&mut self.memory, scattered);
    }
}

impl<'a> Iteration<'a> {
    /// The camera itself.
    pub(super) fn prefix(&self) -> CameraSummary<'a> {
        CameraSummary {
            rule: self.rule,
            memory: (self.rule).map_or_else(AccumulatedPath::default, |r| r.start(self.sample)),
            reach: EdgeRoughness::END,
            smooth: false,
            merges: self.radius > 0.0,
            easy_emission: Rgb::ONE,
        }
    }

    /// A light walk's summary after a vertex that it leaves along `out`, by a Dirac lobe unless `smooth`.
    #[inline]
    pub(super) fn summary(
        &self,
        summary: LightSummary,
        vertex: &Vertex,
        out: Vec3,
        smooth: bool,
    ) -> LightSummary {
        if self.rule.is_none() || summary.reach.best >= ROUGH {
            return summary;
        }
        let event = if smooth {
            vertex.event_to_camera(out)
        } else {
            Event::DIRAC
        };
        summary.with(vertex, event, self.radius > 0.0)
    }

    /// Easy part of a light walk's vertex connected to the camera along `out`.
    #[inline]
    pub(super) fn seen_part(&self, vertex: &Vertex, summary: &LightSummary, out: Vec3) -> Rgb {
        // A path of one vertex has no prefix.
        if self.rule.is_none() || vertex.first || summary.reach.best >= ROUGH {
            return Rgb::ONE;
        }
        let there = summary.with(vertex, vertex.event_to_camera(out), self.radius > 0.0);
        Rgb::ONE - there.gloss * share(EdgeRoughness::END.join(&there.reach))
    }

    /// Hard part at a vertex of the camera walk: the share `h` of light through its glossy lobe at roughness α′.
    pub(super) fn hard_part(
        &self,
        prefix: &CameraSummary<'_>,
        vertex: &Vertex,
        h: f32,
        u: &VertexU,
    ) -> Rgb {
        let Some(rule) = prefix.rule.filter(|_| h > 0.0) else {
            return Rgb::ZERO;
        };
        let bsdf = vertex.bsdf.without_diffuse();
        let point = ShadingPoint {
            scene: self.view.scene,
            surface: &vertex.surface,
            frame: vertex.frame,
            bsdf: &bsdf,
            wo: vertex.local,
            alpha: vertex.alpha,
            alpha_reg: roughen(rule, &prefix.memory, vertex.alpha),
            throughput: vertex.throughput * h,
            around: &vertex.around,
            panes: self.left(vertex.n),
        };
        let lobe = SharedNumbers::new(u.lobe);
        point.direct_light(u.light, &mut ()) + point.roughened_emission(&lobe, &mut ())
    }
}
