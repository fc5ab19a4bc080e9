//! False colours for error maps: lightness grows evenly with the value, so twice the error looks twice as bright,
//! also in grey and to the colour-blind; hue runs from violet over red to yellow to tell places apart.

use std::f64::consts::PI;

use glam::DVec3;

use super::flip::colour::lab_to_rgb;
use opsr::image::Buffer;
use opsr::math::Rgb;

/// Linear RGB of a value in [0, 1]; below and above are clamped.
///
/// In CIELAB: L = 4 + 93 t, chroma 62 sin^0.8(π t) and hue 290° + 160° t.
pub(crate) fn false_colour(t: f32) -> Rgb {
    if t.is_nan() {
        return Rgb::NAN;
    }
    let t = f64::from(t.clamp(0.0, 1.0));
    let lightness = 4.0 + 93.0 * t;
    let chroma = 62.0 * (PI * t).sin().max(0.0).powf(0.8);
    let (sin, cos) = (290.0 + 160.0 * t).to_radians().sin_cos();
    let rgb = lab_to_rgb(DVec3::new(lightness, chroma * cos, chroma * sin));
    rgb.clamp(DVec3::ZERO, DVec3::ONE).as_vec3()
}

/// False colours of `width` · `height` values in [0, 1], row by row.
pub fn map(width: usize, height: usize, values: &[f32]) -> Buffer {
    Buffer {
        width,
        height,
        pixels: values.iter().map(|&v| false_colour(v)).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use opsr::math::luminance;

    #[test]
    fn false_colour_lightness_is_even() {
        // CIELAB lightness of what the display shows, after the clamp to its colours.
        let lightness = |t: f32| {
            let y = luminance(false_colour(t));
            if y > 0.008_856 {
                116.0 * y.cbrt() - 16.0
            } else {
                903.3 * y
            }
        };
        for i in 0..=100 {
            let t = i as f32 / 100.0;
            let even = 4.0 + 93.0 * t;
            assert!(
                (lightness(t) - even).abs() < 2.0,
                "at {t}: {} for {even}",
                lightness(t)
            );
            assert!(i == 0 || lightness(t) > lightness(t - 0.01), "at {t}");
        }
        assert!(false_colour(f32::NAN).is_nan());
        assert_eq!(false_colour(2.0), false_colour(1.0));
    }
}
