//! One evaluation of a lobe towards a visible light, kept so that it can be evaluated again at any roughness.
//!
//! An event was drawn at roughness a₀ with the lobe's density, or by light sampling. With h(a) the integrand and p(a)
//! the lobe's density (both from a [`LobeQuery`](crate::bsdf::LobeQuery)) and p_l the light's, the *mixture form*
//!
//! ```text
//! x(a) = h(a) / (p_l + p(a₀))                        mean
//! y(a) = h(a)² / [(p_l + p(a)) (p_l + p(a₀))]        second moment
//! ```
//!
//! is unbiased for every a, is the renderer's own estimate at a = a₀, and has no term for edges or visibility: the
//! samples stay where they are.

use crate::bsdf::{DELTA_ALPHA, Distribution, LobeQuery, LobeShape};
use crate::integrator::Event;
use crate::math::real::Real;

/// An event, 68 bytes.
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
    /// 1 / (p_l + p(a₀)).
    weight: f32,
    /// a₀.
    alpha: f32,
    /// Which list of roughness values the path has, see [`Codes`](super::codes::Codes).
    pub code: u32,
    distribution: Distribution,
    /// Whether the light has no area: only light sampling finds it.
    delta_light: bool,
}

/// Mean and second moment of an event at one roughness.
#[derive(Clone, Copy, Debug)]
pub struct Moment<T> {
    /// x, per channel.
    pub x: [T; 3],
    /// y, summed over the channels.
    pub y: T,
}

impl StoredEvent {
    /// Keeps an event of the path tracer. `None` for one that carries no light at any roughness.
    pub fn new(event: &Event, code: u32) -> Option<Self> {
        let Event {
            query, radiance, ..
        } = event;
        let base = (*radiance * query.base).to_array();
        let scale = (*radiance * query.scale).to_array();
        let pdf0 = query.at(event.alpha_reg).pdf_w;
        let weight = if event.delta_light {
            1.0 / event.pdf_light
        } else {
            1.0 / (event.pdf_light + pdf0)
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
            alpha: event.alpha_reg,
            code,
            distribution: query.distribution,
            delta_light: event.delta_light,
        })
    }

    /// Mean and second moment at roughness `a`.
    #[inline]
    pub fn at<T: Real>(&self, a: T) -> Moment<T> {
        // A Dirac lobe finds a light as often, and with as much, as the narrowest smooth one.
        let floor = T::constant(DELTA_ALPHA);
        let a = if a.value() < floor.value() { floor } else { a };
        let LobeShape { dg2, dg1 } = self.query().shape(a);
        let weight = T::constant(self.weight);
        let h = [0, 1, 2].map(|c| T::constant(self.base[c]) + T::constant(self.scale[c]) * dg2);
        let x = h.map(|h| h * weight);
        let squares = h[0] * h[0] + h[1] * h[1] + h[2] * h[2];
        let y = if self.delta_light {
            squares * weight * weight
        } else {
            let pdf =
                T::constant(self.pdf_light + self.base_pdf) + T::constant(self.pdf_scale) * dg1;
            squares * weight / pdf
        };
        Moment { x, y }
    }

    /// What the event contributed where it was recorded.
    #[inline]
    pub fn recorded(&self) -> [f32; 3] {
        self.at(self.alpha).x
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
