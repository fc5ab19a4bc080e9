//! Colours of spectra, as linear Rec. 709: other renderers' files give colours by wavelength.

use opsr::math::{DVec3, Rgb};

/// CIE 1931 2-degree observer from 360 nm on, every 10 nm: x, y, z (CIE 015:2018).
#[rustfmt::skip]
const OBSERVER: [[f64; 3]; 48] = [
    [0.00013, 4e-06, 0.000606],
    [0.000415, 1.2e-05, 0.001946],
    [0.001368, 3.9e-05, 0.00645],
    [0.004243, 0.00012, 0.02005],
    [0.01431, 0.000396, 0.06785],
    [0.04351, 0.00121, 0.2074],
    [0.13438, 0.004, 0.6456],
    [0.2839, 0.0116, 1.3856],
    [0.34828, 0.023, 1.74706],
    [0.3362, 0.038, 1.77211],
    [0.2908, 0.06, 1.6692],
    [0.19536, 0.09098, 1.28764],
    [0.09564, 0.13902, 0.81295],
    [0.03201, 0.20802, 0.46518],
    [0.0049, 0.323, 0.272],
    [0.0093, 0.503, 0.1582],
    [0.06327, 0.71, 0.07825],
    [0.1655, 0.862, 0.04216],
    [0.2904, 0.954, 0.0203],
    [0.43345, 0.99495, 0.00875],
    [0.5945, 0.995, 0.0039],
    [0.7621, 0.952, 0.0021],
    [0.9163, 0.87, 0.00165],
    [1.0263, 0.757, 0.0011],
    [1.0622, 0.631, 0.0008],
    [1.0026, 0.503, 0.00034],
    [0.85445, 0.381, 0.00019],
    [0.6424, 0.265, 5e-05],
    [0.4479, 0.175, 2e-05],
    [0.2835, 0.107, 0.0],
    [0.1649, 0.061, 0.0],
    [0.0874, 0.032, 0.0],
    [0.04677, 0.017, 0.0],
    [0.0227, 0.00821, 0.0],
    [0.011359, 0.004102, 0.0],
    [0.00579, 0.002091, 0.0],
    [0.002899, 0.001047, 0.0],
    [0.00144, 0.00052, 0.0],
    [0.00069, 0.000249, 0.0],
    [0.000332, 0.00012, 0.0],
    [0.000166, 6e-05, 0.0],
    [8.3e-05, 3e-05, 0.0],
    [4.2e-05, 1.5e-05, 0.0],
    [2.1e-05, 7e-06, 0.0],
    [1e-05, 4e-06, 0.0],
    [5e-06, 2e-06, 0.0],
    [3e-06, 1e-06, 0.0],
    [1e-06, 0.0, 0.0],
];

/// Illuminant D65 at the same wavelengths, in an arbitrary unit.
#[rustfmt::skip]
const D65: [f64; 48] = [
    0.4711, 0.5262, 0.5048, 0.552, 0.8359, 0.9241, 0.9438, 0.8756, 1.0593, 1.1819, 1.1901, 1.1602,
    1.171, 1.0991, 1.1046, 1.0889, 1.0585, 1.0878, 1.0546, 1.051, 1.0101, 0.9731, 0.9676, 0.8958,
    0.9092, 0.9051, 0.8859, 0.8413, 0.8455, 0.8084, 0.8103, 0.8311, 0.7908, 0.7043, 0.7233, 0.751,
    0.6223, 0.7059, 0.7585, 0.6424, 0.4689, 0.6748, 0.6402, 0.6496, 0.6005, 0.5249, 0.5802, 0.6092,
];

/// Sums of the observer's x, y and z over the wavelengths, weighted by a spectrum of wavelengths in nanometres.
fn xyz(spectrum: impl Fn(f64) -> f64) -> DVec3 {
    let at = |i: usize| DVec3::from(OBSERVER[i]) * spectrum(360.0 + 10.0 * i as f64);
    (0..OBSERVER.len()).map(at).sum()
}

/// Linear Rec. 709 of a colour in XYZ; negative channels become 0.
pub fn rec709(xyz: DVec3) -> Rgb {
    let rgb = DVec3::new(
        xyz.dot(DVec3::new(3.240_479, -1.537_150, -0.498_535)),
        xyz.dot(DVec3::new(-0.969_256, 1.875_991, 0.041_556)),
        xyz.dot(DVec3::new(0.055_648, -0.204_043, 1.057_311)),
    );
    rgb.max(DVec3::ZERO).as_vec3()
}

fn d65(wavelength: f64) -> f64 {
    let at = ((wavelength - 360.0) / 10.0).clamp(0.0, 46.999);
    let (i, part) = (at as usize, at.fract());
    D65[i] + (D65[i + 1] - D65[i]) * part
}

/// A spectrum: values at rising wavelengths in nanometres, linear between them and 0 outside.
#[derive(Clone, Debug, PartialEq)]
pub struct Spectrum(Vec<(f64, f64)>);

impl Spectrum {
    /// A spectrum of pairs (wavelength, value). `None` unless there are samples, all finite, in rising order.
    pub fn new(samples: Vec<(f64, f64)>) -> Option<Self> {
        let finite = samples.iter().all(|(w, v)| w.is_finite() && v.is_finite());
        let rising = samples.windows(2).all(|pair| pair[0].0 < pair[1].0);
        (finite && rising && !samples.is_empty()).then_some(Self(samples))
    }

    fn at(&self, wavelength: f64) -> f64 {
        let i = self.0.partition_point(|(w, _)| *w <= wavelength);
        let (Some(before), after) = (i.checked_sub(1), self.0.get(i)) else {
            return 0.0;
        };
        let (w, v) = self.0[before];
        match after {
            Some((next, value)) => v + (value - v) * (wavelength - w) / (next - w),
            None if wavelength <= w => v,
            None => 0.0,
        }
    }

    /// Colour under D65 of a surface of this spectral reflectance; also the three channels of an index of refraction.
    pub fn reflected(&self) -> Rgb {
        let white = xyz(d65).y;
        rec709(xyz(|w| d65(w) * self.at(w)) / white)
    }

    /// Colour of a lamp of this spectral radiance: white light of 1 per nanometre has a luminance of 1.
    pub fn emitted(&self) -> Rgb {
        rec709(xyz(|w| self.at(w)) / xyz(|_| 1.0).y)
    }

    /// Colour of this spectrum at a luminance of 1; black for a spectrum that is not visible.
    pub fn chromaticity(&self) -> Rgb {
        let seen = xyz(|w| self.at(w));
        if seen.y > 0.0 {
            rec709(seen / seen.y)
        } else {
            Rgb::ZERO
        }
    }

    /// Mean of the values, weighted by the observer's y: an index of refraction as one number.
    pub fn mean(&self) -> f32 {
        (xyz(|w| self.at(w)).y / xyz(|_| 1.0).y) as f32
    }
}

/// XYZ of a black body by Planck's law, in W/(m² sr nm); `None` unless the temperature in kelvin is positive.
fn planck(kelvin: f64) -> Option<DVec3> {
    if !(kelvin > 0.0 && kelvin.is_finite()) {
        return None;
    }
    // 2hc² and hc/k, for wavelengths in nanometres.
    let radiance =
        |nm: f64| 1.191_042_972e20 * nm.powi(-5) / ((1.438_776_877e7 / (nm * kelvin)).exp() - 1.0);
    Some(xyz(radiance))
}

/// Colour of a black body of this temperature in kelvin at a luminance of 1; black at 0 and below.
pub fn black_body(kelvin: f32) -> Rgb {
    let seen = planck(kelvin.into()).filter(|seen| seen.y > 0.0);
    let colour = seen.map_or(Rgb::ZERO, |seen| rec709(seen / seen.y));
    if colour.is_finite() {
        colour
    } else {
        Rgb::ZERO
    }
}

/// Colour of a lamp with the spectral radiance of a black body in W/(m² sr nm), on the scale of [`Spectrum::emitted`].
pub fn black_body_radiance(kelvin: f64) -> Rgb {
    planck(kelvin).map_or(Rgb::ZERO, |seen| rec709(seen / xyz(|_| 1.0).y))
}

/// Linear value of an sRGB-encoded channel in [0, 1].
pub fn linear(encoded: f32) -> f32 {
    match encoded <= 0.040_45 {
        true => encoded / 12.92,
        false => ((encoded + 0.055) / 1.055).powf(2.4),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_flat_spectra_are_grey_and_black_bodies_turn_from_red_to_blue() {
        let flat = Spectrum::new(vec![(300.0, 0.5), (900.0, 0.5)]).unwrap();
        assert!((flat.reflected() - Rgb::splat(0.5)).abs().max_element() < 3e-3);
        assert!((flat.mean() - 0.5).abs() < 1e-6);
        // The chromaticity of 6504 K on the Planckian locus lies close to D65's.
        let white = black_body(6504.0);
        assert!((white - Rgb::ONE).abs().max_element() < 0.06, "{white}");
        let (warm, cold) = (black_body(2700.0), black_body(15000.0));
        assert!(
            warm.x > 2.0 * warm.z && cold.z > 1.3 * cold.x,
            "{warm} {cold}"
        );
        assert_eq!(black_body(-1.0), Rgb::ZERO);
        // Green of the radiance in a spectral renderer: it grows by four orders of magnitude from 2000 K to 6500 K.
        for (kelvin, green) in [(2000.0, 4.12), (3000.0, 350.0), (6500.0, 41_443.0)] {
            let ratio = black_body_radiance(kelvin).y / green;
            assert!((ratio - 1.0).abs() < 0.02, "{kelvin} K: {ratio}");
        }
        assert!(Spectrum::new(vec![(2.0, 1.0), (1.0, 1.0)]).is_none());
    }
}
