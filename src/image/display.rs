//! Radiance on a display: exposure, view, and the exposure that suits a picture.

use super::Buffer;
use crate::math::{DVec3, Rgb, luminance};

/// Curve from exposed radiance to linear display values in [0, 1], before the sRGB encoding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum ViewTransform {
    /// Values above 1 are cut.
    #[default]
    Srgb,
    /// Highlights roll off: the fit to the ACES curve by Narkowicz, *ACES Filmic Tone Mapping Curve*, 2015, per channel.
    Filmic,
}

/// Radiance to display values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// Factor on radiance, in stops.
    pub exposure: f32,
    /// Curve after the exposure.
    pub view: ViewTransform,
}

impl From<f32> for Display {
    /// This exposure, without a curve.
    fn from(exposure: f32) -> Self {
        Self {
            exposure,
            view: ViewTransform::Srgb,
        }
    }
}

impl Display {
    /// Linear display values in [0, 1] of finite radiance.
    pub fn linear(&self, radiance: Rgb) -> Rgb {
        let exposed = radiance * self.exposure.exp2();
        let shown = match self.view {
            ViewTransform::Srgb => exposed,
            ViewTransform::Filmic => aces(exposed.as_dvec3()).as_vec3(),
        };
        shown.clamp(Rgb::ZERO, Rgb::ONE)
    }
}

/// Share of the lit pixels that [`auto_exposure`] shows below [`BRIGHT`].
const SHARE: f64 = 0.95;

/// Exposed luminance of the pixel at [`SHARE`].
const BRIGHT: f32 = 0.8;

/// Exposure in stops that puts the 95th percentile of luminance, over the pixels that are not black, at 80 % of white.
///
/// In steps of a tenth, so that the number in a message makes the same picture again. Zero for a black picture.
pub fn auto_exposure(picture: &Buffer) -> f32 {
    let lit = |l: &f32| *l > 0.0 && l.is_finite();
    let mut lit: Vec<f32> = (picture.pixels.iter().map(|&p| luminance(p)))
        .filter(lit)
        .collect();
    if lit.is_empty() {
        return 0.0;
    }
    let at = (SHARE * (lit.len() - 1) as f64).round() as usize;
    let (_, &mut bright, _) = lit.select_nth_unstable_by(at, f32::total_cmp);
    // Within what single precision can multiply by.
    let stops = (BRIGHT / bright).log2().clamp(-126.0, 126.0);
    // Not minus zero.
    (10.0 * stops).round() / 10.0 + 0.0
}

/// Coefficients k₀ … k₅ of (k₀x² + k₁x + k₂) / (k₃x² + k₄x + k₅), Narkowicz's fit to ACES at exposure 0.6.
pub(super) const ACES: [f64; 6] = [
    0.6 * 0.6 * 2.51,
    0.6 * 0.03,
    0.0,
    0.6 * 0.6 * 2.43,
    0.6 * 0.59,
    0.14,
];

/// The curve of [`ACES`]; above 1 for very bright values.
pub(super) fn aces(rgb: DVec3) -> DVec3 {
    let [k0, k1, k2, k3, k4, k5] = ACES;
    // The curve has a pole left of zero; light is not negative.
    let x = rgb.max(DVec3::ZERO);
    let curve = (x * (x * k0 + k1) + k2) / (x * (x * k3 + k4) + k5);
    // Beyond the square root of the largest number the quotient is ∞/∞; the curve is above 1 long before.
    DVec3::select(x.cmplt(DVec3::splat(1e100)), curve, DVec3::ONE)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn auto_exposure_scales_with_radiance_and_ignores_black_and_non_finite_pixels() {
        let ramp = Buffer::from_fn(100, 2, |x, _| Rgb::splat(x as f32 / 99.0));
        let stops = auto_exposure(&ramp);
        assert!((stops.exp2() * 0.95 - BRIGHT).abs() < 0.06, "{stops}");
        for k in [-20, 7, 40] {
            let scaled = ramp.map(|p| p * (k as f32).exp2());
            assert!((auto_exposure(&scaled) - (stops - k as f32)).abs() < 1e-3);
        }
        let mut dark = ramp.clone();
        dark.pixels.extend([Rgb::ZERO; 1000]);
        dark.pixels.extend([Rgb::NAN, Rgb::INFINITY]);
        assert_eq!(auto_exposure(&dark), stops);
        assert_eq!(auto_exposure(&Buffer::filled(2, 2, Rgb::ZERO)), 0.0);
        assert!(
            auto_exposure(&Buffer::filled(2, 2, Rgb::splat(1e-45)))
                .exp2()
                .is_finite()
        );
    }

    #[test]
    fn filmic_view_is_monotone_and_keeps_highlights_apart() {
        let view = ViewTransform::Filmic;
        let show = |x: f32| {
            let display = Display {
                exposure: 0.0,
                view,
            };
            display.linear(Rgb::splat(x)).x
        };
        let steps: Vec<f32> = (0..400)
            .map(|i| show((0.05 * i as f32 - 15.0).exp2()))
            .collect();
        assert!(steps.is_sorted());
        assert_eq!((show(0.0), show(-1.0), show(f32::MAX)), (0.0, 0.0, 1.0));
        // Where plain sRGB is white: two stops that can be told apart.
        assert!(show(1.0) < 0.7 && show(4.0) > show(1.0) + 0.1 && show(4.0) < 1.0);
    }
}
