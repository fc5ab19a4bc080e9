//! Radiance on a display: exposure, view, and automatic exposure.

use super::Buffer;
use crate::math::{DVec3, Rgb, luminance};
use glam::DMat3;

/// Curve from exposed radiance to linear display values in [0, 1], before the sRGB encoding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum ViewTransform {
    /// Values above 1 are cut.
    #[default]
    Srgb,
    /// Highlights roll off: the fit to the ACES curve by Narkowicz, *ACES Filmic Tone Mapping Curve*, 2015, per channel.
    Filmic,
    /// Blender's: strong colours turn white as they get brighter. AgX by Sobotka, in the fit by Wrensch, *Minimal AgX
    /// Implementation*, 2023.
    Agx,
}

/// Mapping of radiance to display values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// Factor on radiance, in stops.
    pub exposure: f32,
    /// Curve after the exposure.
    pub view: ViewTransform,
}

impl From<f32> for Display {
    /// This exposure in stops, without a curve.
    fn from(exposure: f32) -> Self {
        Self {
            exposure,
            view: ViewTransform::Srgb,
        }
    }
}

impl Display {
    /// Linear display values in [0, 1] of finite radiance.
    pub(crate) fn linear(&self, radiance: Rgb) -> Rgb {
        let exposed = radiance * self.exposure.exp2();
        let shown = match self.view {
            ViewTransform::Srgb => exposed,
            ViewTransform::Filmic => aces(exposed.as_dvec3()).as_vec3(),
            ViewTransform::Agx => agx(exposed.as_dvec3()).as_vec3(),
        };
        shown.clamp(Rgb::ZERO, Rgb::ONE)
    }
}

/// Share of the lit tiles that [`auto_exposure`] shows below [`BRIGHT`].
const SHARE: f64 = 0.9;

/// Exposed luminance of the tile at [`SHARE`].
const BRIGHT: f32 = 0.65;

/// Tiles along the shorter side of a picture.
const TILES: usize = 12;

/// Groups of a tile's pixels, spread over it.
const GROUPS: usize = 5;

/// Edge in pixels of the blocks of a tile; blocks that are entirely black are left out.
const BLOCK: usize = 4;

/// Luminances of the tiles that are not black: the median of the means of a tile's groups, without black blocks.
///
/// Means do not depend on noise, but a median of pixels does: rare light leaves most pixels dark. A few pixels that are
/// far too bright are in fewer than half of the groups.
fn tiles(picture: &Buffer) -> Vec<f32> {
    let edge = (picture.width.min(picture.height) / TILES).max(1);
    let part = |from: usize, edge: usize, end: usize| from..(from + edge).min(end);
    let brightness = |(x0, y0): (usize, usize)| {
        let (columns, rows) = (
            part(x0, edge, picture.width),
            part(y0, edge, picture.height),
        );
        let mut sums = [(0.0, 0u32); GROUPS];
        for y0 in rows.clone().step_by(BLOCK) {
            for x0 in columns.clone().step_by(BLOCK) {
                let block = (part(y0, BLOCK, rows.end))
                    .flat_map(|y| part(x0, BLOCK, columns.end).map(move |x| (x, y)));
                let seen = block.map(|(x, y)| ((3 * x + 7 * y) % GROUPS, picture.get(x, y)));
                let seen = seen.map(|(group, p)| (group, f64::from(luminance(p))));
                if !seen.clone().any(|(_, l)| l > 0.0 && l.is_finite()) {
                    continue;
                }
                for (group, l) in seen.filter(|(_, l)| l.is_finite()) {
                    sums[group].0 += l.max(0.0);
                    sums[group].1 += 1;
                }
            }
        }
        let filled = sums.iter().filter(|(_, pixels)| *pixels > 0);
        let mut means: Vec<f64> = filled.map(|&(sum, n)| sum / f64::from(n)).collect();
        means.sort_unstable_by(f64::total_cmp);
        means.get(means.len() / 2).map(|&mean| mean as f32)
    };
    let starts = |length: usize| (0..length).step_by(edge);
    (starts(picture.height).flat_map(|y| starts(picture.width).map(move |x| (x, y))))
        .filter_map(brightness)
        .filter(|l| *l > 0.0)
        .collect()
}

/// Exposure in stops that puts the 90th percentile of luminance at 65 % of white. The percentile is over lit tiles, or
/// over lit pixels if no tile is lit. Moderate noise changes it by about a tenth of a stop.
///
/// Rounded to a tenth, so that the number in a message reproduces the picture. Zero for a black picture.
pub fn auto_exposure(picture: &Buffer) -> f32 {
    let is_lit = |l: &f32| *l > 0.0 && l.is_finite();
    let mut lit = tiles(picture);
    if lit.is_empty() {
        let all = picture.pixels.iter().map(|&p| luminance(p));
        lit = all.filter(is_lit).collect();
    }
    if lit.is_empty() {
        return 0.0;
    }
    let at = (SHARE * (lit.len() - 1) as f64).round() as usize;
    let (_, &mut bright, _) = lit.select_nth_unstable_by(at, f32::total_cmp);
    // Clamped to powers of two that single precision can represent.
    let stops = (BRIGHT / bright).log2().clamp(-126.0, 126.0);
    // Adding 0.0 turns −0 into 0.
    (10.0 * stops).round() / 10.0 + 0.0
}

/// Coefficients k₀ … k₅ of (k₀x² + k₁x + k₂) / (k₃x² + k₄x + k₅), Narkowicz's fit to ACES at exposure 0.6.
pub const ACES: [f64; 6] = [
    0.6 * 0.6 * 2.51,
    0.6 * 0.03,
    0.0,
    0.6 * 0.6 * 2.43,
    0.6 * 0.59,
    0.14,
];

/// The curve of [`ACES`]; above 1 for very bright values.
pub fn aces(rgb: DVec3) -> DVec3 {
    let [k0, k1, k2, k3, k4, k5] = ACES;
    // The curve has a pole left of zero; light is not negative.
    let x = rgb.max(DVec3::ZERO);
    let curve = (x * (x * k0 + k1) + k2) / (x * (x * k3 + k4) + k5);
    // Beyond the square root of the largest number the quotient is ∞/∞; the curve is above 1 long before.
    DVec3::select(x.cmplt(DVec3::splat(1e100)), curve, DVec3::ONE)
}

/// Linear display values of AgX: mixed towards grey, on a curve over the logarithm of each channel, and back.
fn agx(rgb: DVec3) -> DVec3 {
    let inset = DMat3::from_cols_array(&[
        0.842_479_06,
        0.042_328_24,
        0.042_375_65,
        0.078_433_60,
        0.878_468_64,
        0.078_433_60,
        0.079_223_75,
        0.079_166_13,
        0.879_142_97,
    ]);
    /// Stops about 1 that the curve covers.
    const STOPS: [f64; 2] = [-12.473_93, 4.026_069];
    /// The curve's polynomial, from the sixth power down.
    const CURVE: [f64; 7] = [15.5, -40.14, 31.96, -6.868, 0.4298, 0.1191, -0.00232];
    let curve = |x: f64| {
        let stops = x.max(1e-30).log2().clamp(STOPS[0], STOPS[1]);
        let t = (stops - STOPS[0]) / (STOPS[1] - STOPS[0]);
        CURVE.iter().fold(0.0, |sum, k| sum * t + k)
    };
    let light = rgb.clamp(DVec3::ZERO, DVec3::splat(1e30));
    let shown = inset.inverse() * (inset * light).map(curve);
    shown.max(DVec3::ZERO).powf(2.2)
}

#[cfg(test)]
mod tests;
