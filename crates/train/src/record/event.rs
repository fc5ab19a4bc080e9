//! Events: evaluations of a lobe towards a visible light, stored so that they can be evaluated again at any roughness
//! (`docs/method.md` section 5).
//!
//! The direction of an event was sampled from the light, or from the lobe at one or several roughness values (see
//! [`Proposals`](crate::record::proposals::Proposals)) whose densities add up to p₀. With the integrand h(a),
//! the lobe's density p(a) (both from a [`LobeQuery`]) and the light's density p_l, the *mixture form*
//!
//! ```text
//! x(a) = h(a) / (p_l + p₀)                        mean
//! y(a) = h(a)² / [(p_l + p(a)) (p_l + p₀)]        second moment
//! ```
//!
//! is unbiased for every roughness a and equals the renderer's own estimate where p₀ = p(a). It needs no term for edges
//! or visibility, since the samples stay fixed. The variance of the realised mean at a depends on p₀ and raises a loss
//! of absolute errors: p₀ must be large at all roughness values that the table can give.

use opsr::bsdf::{DELTA_ALPHA, Distribution, LobeQuery, LobeReal, LobeShape};
use opsr::integrator::{Event, Technique};
use opsr::math::Rgb;
use opsr::math::real::Dual;

/// An event. A recording holds millions, so each has only 60 bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StoredEvent {
    /// Throughput times emitted radiance times the part of f·|cos| that does not depend on the roughness.
    base: [f32; 3],
    /// Throughput times emitted radiance times the factor of D·G2.
    scale: [f32; 3],
    base_pdf: f32,
    pdf_scale: f32,
    tan2_h: f32,
    tan2_o: f32,
    tan2_i: f32,
    pdf_light: f32,
    /// 1 / (p_l + p₀), times the number of events that this one stands for.
    weight: f32,
    /// Index of the path's roughness values in [`RoughnessLists`](crate::record::lists::RoughnessLists).
    pub code: u32,
    distribution: Distribution,
    /// True if the light has no area, so that only light sampling finds it.
    delta_light: bool,
    /// True if a lobe sample hit the light; `false` for a light sample.
    pub from_lobe: bool,
}

const _: () = assert!(size_of::<StoredEvent>() == 60);

/// Contribution of an event to mean and second moment at one roughness.
#[derive(Clone, Copy, Debug)]
pub struct MeanAndSquare<T> {
    /// x, per channel.
    pub mean: [T; 3],
    /// y, summed over the channels.
    pub square: T,
}

impl StoredEvent {
    /// Stores an event of the path tracer. `drawn` is the density of its direction, summed over all `draws` samples of
    /// the vertex's lobe. `None` for an event that is dark at every roughness or not finite.
    pub fn new(event: &Event, drawn: f32, draws: usize, code: u32) -> Option<Self> {
        let Event {
            query, radiance, ..
        } = event;
        let base = (*radiance * query.base).to_array();
        let scale = (*radiance * query.scale).to_array();
        let weight = if event.delta_light {
            1.0 / event.pdf_light
        } else {
            // Every draw has the direction of the continuation, so one event counts for all draws.
            let times = if event.technique == Technique::Continuation {
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
            from_lobe: event.technique != Technique::Light,
        })
    }

    /// Contribution to the mean, summed over the channels, where the integrand is `value`.
    pub(crate) fn size(&self, value: Rgb) -> f32 {
        value.element_sum() * self.weight
    }

    /// The event with its weight multiplied. Both moments are linear in the weight.
    pub(crate) fn times(self, times: f32) -> Self {
        Self {
            weight: self.weight * times,
            ..self
        }
    }

    /// Mean and second moment at roughness `a`.
    #[inline]
    pub fn at<T: LobeReal>(&self, a: T) -> MeanAndSquare<T> {
        // A Dirac lobe contributes as the narrowest lobe that can be evaluated.
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
        MeanAndSquare { mean: x, square: y }
    }

    /// Mean and second moment with derivatives, in single precision; in double precision where singles overflow.
    #[inline]
    pub fn tangent(&self, a: Dual<f32>) -> MeanAndSquare<Dual<f32>> {
        let single = self.at(a);
        let finite = |d: &Dual<f32>| d.v.is_finite() && d.d.is_finite();
        if single.mean.iter().all(finite) && finite(&single.square) {
            return single;
        }
        let narrow = |d: Dual| Dual {
            v: d.v as f32,
            d: d.d as f32,
        };
        let double = self.at(a.wide());
        MeanAndSquare {
            mean: double.mean.map(narrow),
            square: narrow(double.square),
        }
    }

    /// Bytes of an event in a file.
    pub(crate) const BYTES: usize = 57;

    /// The event as little-endian numbers: 13 of single precision, the code, and a byte of flags.
    pub(crate) fn to_bytes(self) -> [u8; Self::BYTES] {
        let ggx = self.distribution == Distribution::Ggx;
        let phase = self.distribution == Distribution::HenyeyGreenstein;
        let flags = u8::from(ggx)
            | u8::from(self.delta_light) << 1
            | u8::from(self.from_lobe) << 2
            | u8::from(phase) << 3;
        let mut bytes = [flags; Self::BYTES];
        let numbers = [
            self.base[0],
            self.base[1],
            self.base[2],
            self.scale[0],
            self.scale[1],
            self.scale[2],
            self.base_pdf,
            self.pdf_scale,
            self.tan2_h,
            self.tan2_o,
            self.tan2_i,
            self.pdf_light,
            self.weight,
        ];
        let words = numbers.map(f32::to_bits).into_iter().chain([self.code]);
        for (four, word) in bytes.as_chunks_mut::<4>().0.iter_mut().zip(words) {
            *four = word.to_le_bytes();
        }
        bytes
    }

    /// The event of these bytes; `None` for one with a number that is not finite.
    pub(crate) fn from_bytes(bytes: &[u8; Self::BYTES]) -> Option<Self> {
        let (words, flags) = bytes.as_chunks::<4>();
        let word = |i: usize| u32::from_le_bytes(words[i]);
        let number = |i: usize| f32::from_bits(word(i));
        let flag = |bit: u8| flags[0] & 1 << bit != 0;
        let finite = (0..13).all(|i| number(i).is_finite());
        finite.then(|| Self {
            base: [0, 1, 2].map(number),
            scale: [3, 4, 5].map(number),
            base_pdf: number(6),
            pdf_scale: number(7),
            tan2_h: number(8),
            tan2_o: number(9),
            tan2_i: number(10),
            pdf_light: number(11),
            weight: number(12),
            code: word(13),
            distribution: match (flag(0), flag(3)) {
                (_, true) => Distribution::HenyeyGreenstein,
                (true, _) => Distribution::Ggx,
                _ => Distribution::Beckmann,
            },
            delta_light: flag(1),
            from_lobe: flag(2),
        })
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

/// Sum of a path's contributions, to which its events are added in order of depth.
///
/// The lobe samples of one vertex are alternatives: each stands for the renderer's single sample, so no two of them lie
/// on one path and their products do not enter the second moment.
pub struct PathSum<T> {
    sum: [T; 3],
    /// Lobe samples of the current vertex.
    from_lobe: [T; 3],
    code: Option<u32>,
}

impl<T: LobeReal> PathSum<T> {
    /// A path whose contribution without events is `constant`.
    pub fn new(constant: [T; 3]) -> Self {
        Self {
            sum: constant,
            from_lobe: [T::constant(0.0); 3],
            code: None,
        }
    }

    /// Adds the contribution `x` of an event, and returns the sum S of the earlier contributions that share a path with
    /// it: the second moment grows by y + 2 S x.
    #[inline]
    pub fn add(&mut self, event: &StoredEvent, x: [T; 3]) -> [T; 3] {
        if self.code != Some(event.code) {
            self.code = Some(event.code);
            for c in 0..3 {
                self.sum[c] = self.sum[c] + self.from_lobe[c];
                self.from_lobe[c] = T::constant(0.0);
            }
        }
        let before = self.sum;
        let side = if event.from_lobe {
            &mut self.from_lobe
        } else {
            &mut self.sum
        };
        for c in 0..3 {
            side[c] = side[c] + x[c];
        }
        before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The light is so bright that intermediate values of the square's derivative overflow singles, though the result
    /// does not.
    #[test]
    fn overflow_of_singles_is_evaluated_in_double_precision() {
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
            from_lobe: true,
        };
        let alpha = 2e-3f32;
        let single = event.at(Dual::variable(alpha));
        assert!(!single.square.d.is_finite(), "{single:?}");
        let tangent = event.tangent(Dual::variable(alpha));
        let double = event.at(Dual::variable(f64::from(alpha)));
        let parts = |m: MeanAndSquare<Dual>| [m.mean[0], m.mean[1], m.mean[2], m.square];
        let wide = MeanAndSquare {
            mean: tangent.mean.map(Dual::wide),
            square: tangent.square.wide(),
        };
        for (a, b) in parts(wide).into_iter().zip(parts(double)) {
            assert!((a.v / b.v - 1.0).abs() < 1e-6, "{a:?} {b:?}");
            assert!((a.d / b.d - 1.0).abs() < 1e-6, "{a:?} {b:?}");
        }
    }
}
