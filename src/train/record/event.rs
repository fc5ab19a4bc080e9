//! One evaluation of a lobe towards a visible light, kept so that it can be evaluated again at any roughness.
//!
//! An event's direction was drawn from the lobe at one or several roughness values (see [`drawn`](crate::train::record::proposals)), whose
//! densities add up to p₀, or by light sampling. With h(a) the integrand and p(a) the lobe's density (both from a
//! [`LobeQuery`](crate::bsdf::LobeQuery)) and p_l the light's, the *mixture form*
//!
//! ```text
//! x(a) = h(a) / (p_l + p₀)                        mean
//! y(a) = h(a)² / [(p_l + p(a)) (p_l + p₀)]        second moment
//! ```
//!
//! is unbiased for every a, is the renderer's own estimate where p₀ = p(a), and has no term for edges or visibility:
//! the samples stay where they are. How noisy the realised mean is at a depends on p₀, and a loss of absolute errors
//! sees it: p₀ must be large wherever the table goes.

use crate::bsdf::{DELTA_ALPHA, Distribution, LobeQuery, LobeShape};
use crate::integrator::{Event, Technique};
use crate::math::Rgb;
use crate::math::real::{Dual, Real};

/// An event, 60 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredEvent {
    /// Throughput and light times the part of f·|cos| that does not depend on the roughness.
    base: [f32; 3],
    /// Throughput and light times the factor of D·G2.
    scale: [f32; 3],
    base_pdf: f32,
    pdf_scale: f32,
    tan2_h: f32,
    tan2_o: f32,
    tan2_i: f32,
    pdf_light: f32,
    /// 1 / (p_l + p₀), times how many events it stands for.
    weight: f32,
    /// Which list of roughness values the path has, see [`RoughnessLists`](crate::train::record::lists::RoughnessLists).
    pub code: u32,
    distribution: Distribution,
    /// Whether the light has no area: only light sampling finds it.
    delta_light: bool,
    /// Whether the light was not sampled but found.
    pub found: bool,
}

const _: () = assert!(size_of::<StoredEvent>() == 60);

/// Mean and second moment of an event at one roughness.
#[derive(Clone, Copy, Debug)]
pub struct MeanAndSquare<T> {
    /// x, per channel.
    pub x: [T; 3],
    /// y, summed over the channels.
    pub y: T,
}

impl StoredEvent {
    /// Keeps an event of the path tracer; `drawn` is the density of all draws of its vertex's lobe. `None` for one that carries no light
    /// at any roughness.
    pub fn new(event: &Event, drawn: f32, draws: usize, code: u32) -> Option<Self> {
        let Event {
            query, radiance, ..
        } = event;
        let base = (*radiance * query.base).to_array();
        let scale = (*radiance * query.scale).to_array();
        let weight = if event.delta_light {
            1.0 / event.pdf_light
        } else {
            // A direction that every draw has counts for all of them.
            let times = if event.technique == Technique::Diffuse {
                draws
            } else {
                1
            };
            times as f32 / (event.pdf_light + drawn)
        };
        let finite = |v: [f32; 3]| v.iter().all(|x| x.is_finite());
        let dark = base == [0.0; 3] && scale == [0.0; 3];
        (!dark && finite(base) && finite(scale) && weight.is_finite()).then_some(Self {
            base,
            scale,
            base_pdf: query.base_pdf,
            pdf_scale: query.pdf_scale,
            tan2_h: query.tan2_h,
            tan2_o: query.tan2_o,
            tan2_i: query.tan2_i,
            pdf_light: event.pdf_light,
            weight,
            code,
            distribution: query.distribution,
            delta_light: event.delta_light,
            found: event.technique != Technique::Light,
        })
    }

    /// What it carries where its integrand is `value`, the sum of its channels.
    pub(in crate::train) fn size(&self, value: Rgb) -> f32 {
        value.element_sum() * self.weight
    }

    /// The event as one that stands for this many, none of which meet.
    pub(in crate::train) fn times(self, times: f32) -> Self {
        Self {
            weight: self.weight * times,
            ..self
        }
    }

    /// Mean and second moment at roughness `a`.
    #[inline]
    pub fn at<T: Real>(&self, a: T) -> MeanAndSquare<T> {
        // A Dirac lobe finds a light as often, and with as much, as the narrowest smooth one.
        let floor = T::constant(DELTA_ALPHA);
        let a = if a.value() < floor.value() { floor } else { a };
        let LobeShape { dg2, dg1 } = self.query().shape(a);
        let weight = T::constant(self.weight);
        let h = [0, 1, 2].map(|c| T::constant(self.base[c]) + T::constant(self.scale[c]) * dg2);
        let x = h.map(|h| h * weight);
        let squares = h[0] * h[0] + h[1] * h[1] + h[2] * h[2];
        let pdf = if self.delta_light {
            T::constant(self.pdf_light)
        } else {
            T::constant(self.pdf_light + self.base_pdf) + T::constant(self.pdf_scale) * dg1
        };
        let y = squares * weight / pdf;
        MeanAndSquare { x, y }
    }

    /// Mean and second moment with their derivatives: in single precision, but for what is beyond its range.
    #[inline]
    pub fn tangent(&self, a: Dual<f32>) -> MeanAndSquare<Dual<f32>> {
        let moment = self.at(a);
        let finite = |d: &Dual<f32>| d.v.is_finite() && d.d.is_finite();
        if moment.x.iter().all(finite) && finite(&moment.y) {
            return moment;
        }
        let narrow = |d: Dual| Dual {
            v: d.v as f32,
            d: d.d as f32,
        };
        let MeanAndSquare { x, y } = self.at(a.wide());
        MeanAndSquare {
            x: x.map(narrow),
            y: narrow(y),
        }
    }

    fn query(&self) -> LobeQuery {
        LobeQuery {
            base: self.base.into(),
            base_pdf: self.base_pdf,
            scale: self.scale.into(),
            pdf_scale: self.pdf_scale,
            tan2_h: self.tan2_h,
            tan2_o: self.tan2_o,
            tan2_i: self.tan2_i,
            distribution: self.distribution,
        }
    }
}

/// The light of a path as its events come in, in order of depth.
///
/// The draws of one vertex's lobe stand for a single one of the renderer's: no two of them are on one of its paths.
pub struct PathSum<T> {
    sum: [T; 3],
    /// What was found from the vertex at hand.
    found: [T; 3],
    code: Option<u32>,
}

impl<T: Real> PathSum<T> {
    /// A path that carries this besides its events.
    pub fn new(constant: [T; 3]) -> Self {
        Self {
            sum: constant,
            found: [T::constant(0.0); 3],
            code: None,
        }
    }

    /// Adds what an event carries; what it meets on its path.
    #[inline]
    pub fn meet(&mut self, event: &StoredEvent, x: [T; 3]) -> [T; 3] {
        if self.code != Some(event.code) {
            self.code = Some(event.code);
            for c in 0..3 {
                self.sum[c] = self.sum[c] + self.found[c];
                self.found[c] = T::constant(0.0);
            }
        }
        let met = self.sum;
        let side = if event.found {
            &mut self.found
        } else {
            &mut self.sum
        };
        for c in 0..3 {
            side[c] = side[c] + x[c];
        }
        met
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a light so bright that the square's derivative leaves the range of singles, but not what comes of it.
    #[test]
    fn what_overflows_on_the_way_is_evaluated_in_double_precision() {
        let event = StoredEvent {
            base: [0.0; 3],
            scale: [1e13, 2e13, 3e13],
            base_pdf: 0.1,
            pdf_scale: 1.0,
            tan2_h: 1e-6,
            tan2_o: 0.5,
            tan2_i: 0.6,
            pdf_light: 0.1,
            weight: 1e-6,
            code: 0,
            distribution: Distribution::Beckmann,
            delta_light: false,
            found: true,
        };
        let alpha = 2e-3f32;
        let single = event.at(Dual::variable(alpha));
        assert!(!single.y.d.is_finite(), "{single:?}");
        let tangent = event.tangent(Dual::variable(alpha));
        let double = event.at(Dual::variable(f64::from(alpha)));
        let parts = |m: MeanAndSquare<Dual>| [m.x[0], m.x[1], m.x[2], m.y];
        let wide = MeanAndSquare {
            x: tangent.x.map(Dual::wide),
            y: tangent.y.wide(),
        };
        for (a, b) in parts(wide).into_iter().zip(parts(double)) {
            assert!((a.v / b.v - 1.0).abs() < 1e-6, "{a:?} {b:?}");
            assert!((a.d / b.d - 1.0).abs() < 1e-6, "{a:?} {b:?}");
        }
    }
}
