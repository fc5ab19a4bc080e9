//! Small pictures by `vcm` as a witness: they reveal light that camera paths have missed.
//!
//! All levels of a path tracer can miss the same light: a lamp in glass, a sun under water. Photons find it with few
//! samples. Each small picture is an independent estimate of the light of every region of the frame. Their spread is
//! therefore the error of their mean, although pixels of one picture share light paths.

use super::witness::{MIN_SHARES, MissingLight, Part, SHARE, around, normal_bound, squared_error};
use crate::image::film::{Film, Window};
use crate::integrator::bidirectional::Radius;
use crate::integrator::method::IntegratorKind;
use crate::integrator::{Amounts, Estimator, Picture, Settings, View};
use crate::math::{Rgb, UVec2};
use crate::regularise::Rule;
use crate::sampler::{Domain, SamplerKind, Seed};

/// Number of independent pictures.
const PICTURES: u32 = 16;

/// Edge of a region in pixels of a small picture.
const REGION: u32 = 4;

/// Fewest and most regions.
const REGIONS: (f64, f64) = (12.0, 192.0);

/// Most of the render's time that the pictures take, where [`SHARE`] is too little for the fewest regions.
const MAX_TIME_SHARE: f64 = 0.12;

/// Probability that chance alone raises one of the regions of a picture above the bound.
const CHANCE: f64 = 0.05;

/// A grid of about `most` regions, as square as possible; `None` for a frame that is too narrow.
fn grid(frame: UVec2, most: f64) -> Option<UVec2> {
    let aspect = f64::from(frame.x) / f64::from(frame.y);
    let of = |rows: u32| UVec2::new((f64::from(rows) * aspect).round() as u32, rows);
    let counts = 0.5 * most..1.3 * most;
    (1..frame.y.min(64))
        .map(of)
        .filter(|grid| counts.contains(&f64::from(grid.x * grid.y)))
        .min_by(|a, b| {
            let uneven = |g: &UVec2| (f64::from(g.x) / (f64::from(g.y) * aspect)).ln().abs();
            uneven(a).total_cmp(&uneven(b))
        })
}

/// The regions of a witness for a render with this number of samples per pixel. `None` if there is no witness: for
/// estimators other than the path tracer, crops, scenes without glossy lobes or with contents that `vcm` does not
/// support, and renders that are too short.
fn regions_beside(
    view: &View<'_>,
    settings: &Settings,
    witness: &Settings,
    samples: u32,
) -> Option<UVec2> {
    let frame = view.sensor.frame;
    let of_path = matches!(settings.estimator, Estimator::Path { .. });
    if !of_path
        || settings.strategy.is_some()
        || view.window != Window::full(frame)
        || !view.scene.features().lobes
        || witness.check_scene(view.scene).is_err()
    {
        return None;
    }
    let traced = view.window.len() as f64 * f64::from(samples);
    let cost = witness.estimator.cost(1.0) * f64::from(PICTURES * REGION * REGION);
    let most = (SHARE * traced / cost).clamp(REGIONS.0, REGIONS.1);
    if most > MAX_TIME_SHARE * traced / cost {
        return None;
    }
    grid(frame, most)
}

/// Settings of the small pictures.
fn witness(settings: &Settings) -> Settings {
    Settings {
        estimator: Estimator::Vcm(Radius::default()),
        rule: Rule::Plain,
        amounts: Amounts::Raw,
        sampler: SamplerKind::Independent,
        seed: Seed(settings.seed).derive(Domain::Witness, 0).0,
        ..settings.clone()
    }
}

/// Looks for light that the path tracer misses in a whole frame after this number of samples per pixel.
pub(super) fn missing_light(
    view: &View<'_>,
    settings: &Settings,
    picture: &Picture,
    samples: u32,
) -> Option<MissingLight> {
    let witness = witness(settings);
    let grid = regions_beside(view, settings, &witness, samples)?;
    let small = grid * REGION;
    let beside = View {
        stop: view.stop,
        ..View::new(view.scene, view.sensor.camera, small, Window::full(small))
    };
    let mut integrator = witness.integrator();
    let mut lights = Vec::new();
    for number in 0..PICTURES {
        let mut one = Picture::new(Film::new(small));
        if integrator.pass(&beside, number..number + 1, &mut one) == 0 {
            return None;
        }
        lights.push(means(small, grid, |i| light_of(&one.film, i)));
    }
    compared(&lights, picture, grid)
}

fn light_of(film: &Film, pixel: usize) -> f64 {
    film.pixels[pixel].mean.element_sum()
}

/// Index of a pixel's region.
fn region(frame: UVec2, grid: UVec2, pixel: usize) -> usize {
    let (x, y) = (pixel as u32 % frame.x, pixel as u32 / frame.x);
    (y * grid.y / frame.y * grid.x + x * grid.x / frame.x) as usize
}

/// Means by region of a value for each pixel of a frame.
fn means(frame: UVec2, grid: UVec2, of: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = vec![(0.0, 0u32); grid.element_product() as usize];
    for pixel in 0..frame.element_product() as usize {
        let (sum, count) = &mut sums[region(frame, grid, pixel)];
        *sum += of(pixel);
        *count += 1;
    }
    let mean = |(sum, count): (f64, u32)| sum / f64::from(count.max(1));
    sums.into_iter().map(mean).collect()
}

/// Light of a picture by region, at the brightest level of each, which a correct choice takes.
fn light_in(picture: &Picture, grid: UVec2) -> Vec<f64> {
    let frame = picture.film.size;
    let mut most = means(frame, grid, |i| light_of(&picture.film, i));
    if let Some(levels) = &picture.levels {
        for level in 1..levels.levels() {
            let pixels: Vec<Rgb> = levels.means(level).collect();
            let light = means(frame, grid, |i| f64::from(pixels[i].element_sum()));
            let pairs = most.iter_mut().zip(light);
            pairs.for_each(|(most, light)| *most = most.max(light));
        }
    }
    most
}

/// Mean of independent numbers, and the variance of this mean.
fn estimate(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
    (mean, squares / (n * (n - 1.0)))
}

/// Quantile of Student's distribution for the normal quantile `z` (Wallace: *Bounds on Normal Approximations to
/// Student's and the Chi-Square Distributions*, The Annals of Mathematical Statistics 30(4), 1959).
fn student(z: f64, freedom: f64) -> f64 {
    let scaled = z * (8.0 * freedom + 3.0) / (8.0 * freedom + 1.0);
    (freedom * (scaled * scaled / freedom).exp_m1()).sqrt()
}

/// The light that a picture misses, given the light of every region in independent pictures.
fn compared(lights: &[Vec<f64>], picture: &Picture, grid: UVec2) -> Option<MissingLight> {
    let frame = picture.film.size;
    let own = light_in(picture, grid);
    // The squared error of a mean over n pixels is the mean of theirs over n.
    let pixels = f64::from(frame.x * frame.y) / own.len() as f64;
    let noise = means(frame, grid, |i| {
        squared_error(&picture.film.pixels[i]) / pixels
    });
    let over = |regions: &[usize]| {
        let sum = |values: &[f64]| regions.iter().map(|&i| values[i]).sum::<f64>();
        let sums: Vec<f64> = lights.iter().map(|light| sum(light)).collect();
        let (light, variance) = estimate(&sums);
        Part {
            light,
            excess: light - sum(&own),
            variance: variance + sum(&noise),
        }
    };
    let all: Vec<usize> = (0..own.len()).collect();
    let share = over(&all).share();
    if share.is_nan() || share < MIN_SHARES.0 {
        return None;
    }
    let (columns, rows) = (grid.x as usize, grid.y as usize);
    let with_those_around = |i| over(&around(i, columns, rows).collect::<Vec<_>>());
    let parts: Vec<Part> = all.into_iter().map(with_those_around).collect();
    let normal = normal_bound(parts.len(), CHANCE);
    let bound = student(normal, f64::from(PICTURES - 1));
    let dark = (0..parts.len()).filter(|&i| parts[i].is_dark(bound));
    let darkest = dark.max_by(|&a, &b| parts[a].excess.total_cmp(&parts[b].excess))?;
    // A lower bound of the missing light, as for the whole.
    let square = |part: &Part| match part.is_dark(bound) {
        true => part.share().powi(2) as f32,
        false => 0.0,
    };
    let squares: Vec<f32> = parts.iter().map(square).collect();
    let half = UVec2::new(darkest as u32 % grid.x, darkest as u32 / grid.x) * 2 + UVec2::ONE;
    Some(MissingLight {
        share,
        pixel: half * frame / (grid * 2),
        finder: IntegratorKind::Vcm,
        squares: (0..picture.film.pixels.len())
            .map(|pixel| squares[region(frame, grid, pixel)])
            .collect(),
    })
}

#[cfg(test)]
mod tests;
