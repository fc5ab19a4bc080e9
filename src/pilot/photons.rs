//! Small pictures by `vcm` as a witness of light that camera paths have missed.
//!
//! All levels of a path tracer can miss the same light: a lamp in glass, a sun under water. Photons find it with few samples. Each
//! of the small pictures is an independent estimate of the light of every region of the frame, so that their spread is the error of
//! their mean, whatever light their pixels share.

use super::witness::Missing;
use crate::image::film::{Film, Window};
use crate::integrator::bidirectional::Radius;
use crate::integrator::method::IntegratorKind;
use crate::integrator::{Amounts, Estimator, Picture, Settings, View};
use crate::math::UVec2;
use crate::regularise::Rule;
use crate::sampler::{Domain, SamplerKind, Seed};

/// Independent pictures.
const PICTURES: u32 = 16;

/// Edge of a region in pixels of such a picture.
const REGION: u32 = 4;

/// Fewest and most regions.
const REGIONS: (f64, f64) = (12.0, 192.0);

/// Share of the render's time that the pictures take, and most where this is too little for the fewest regions.
const SHARE: (f64, f64) = (0.04, 0.12);

/// Probability that chance alone raises one of the regions of a picture above the bound.
const CHANCE: f64 = 0.05;

/// Share of the light by which the picture must be darker beyond two standard errors, and a part beyond chance.
const LEAST: (f64, f64) = (0.01, 0.1);

/// Columns and rows of about `most` regions, as near to squares as they can be; `None` for a frame that is too narrow.
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

/// The regions of a witness beside a render with this number of samples per pixel; `None` where there is none: for other
/// estimators than the path tracer, for crops, for scenes without anything glossy or with contents that `vcm` does not know, and
/// for renders that are too short.
fn regions_beside(view: &View<'_>, settings: &Settings, samples: u32) -> Option<UVec2> {
    let frame = view.sensor.frame;
    let of_path = matches!(settings.estimator, Estimator::Path { .. });
    if !of_path
        || settings.strategy.is_some()
        || view.window != Window::full(frame)
        || !view.scene.features().lobes
        || witness(settings).check_scene(view.scene).is_err()
    {
        return None;
    }
    let traced = view.window.len() as f64 * f64::from(samples);
    let cost = witness(settings).estimator.cost(1.0) * f64::from(PICTURES * REGION * REGION);
    let most = (SHARE.0 * traced / cost).clamp(REGIONS.0, REGIONS.1);
    if most > SHARE.1 * traced / cost {
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

/// Looks for light that a whole frame by the path tracer misses after this number of samples.
pub(super) fn missing_light(
    view: &View<'_>,
    settings: &Settings,
    picture: &Picture,
    samples: u32,
) -> Option<Missing> {
    let grid = regions_beside(view, settings, samples)?;
    let small = grid * REGION;
    let beside = View {
        stop: view.stop,
        ..View::new(view.scene, view.sensor.camera, small, Window::full(small))
    };
    let mut integrator = witness(settings).integrator();
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

/// Means over the regions of a frame of a number for each of its pixels.
fn means(frame: UVec2, grid: UVec2, of: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = vec![(0.0, 0u32); (grid.x * grid.y) as usize];
    for y in 0..frame.y {
        let row = u64::from(y) * u64::from(grid.y) / u64::from(frame.y);
        for x in 0..frame.x {
            let column = u64::from(x) * u64::from(grid.x) / u64::from(frame.x);
            let (sum, count) = &mut sums[row as usize * grid.x as usize + column as usize];
            *sum += of((y * frame.x + x) as usize);
            *count += 1;
        }
    }
    let mean = |(sum, count): (f64, u32)| sum / f64::from(count.max(1));
    sums.into_iter().map(mean).collect()
}

/// Light of a picture in every region: that of its level with the most, which the choice takes if it is right.
fn light_in(picture: &Picture, grid: UVec2) -> Vec<f64> {
    let frame = picture.film.size;
    let mut most = means(frame, grid, |i| light_of(&picture.film, i));
    let levels = picture.levels.as_ref();
    for level in 1..levels.map_or(0, |levels| levels.levels()) {
        let pixels: Vec<f64> = (levels.into_iter())
            .flat_map(|levels| levels.means(level))
            .map(|light| f64::from(light.element_sum()))
            .collect();
        let light = means(frame, grid, |i| pixels[i]);
        most.iter_mut().zip(light).for_each(|(m, l)| *m = m.max(l));
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

/// Quantile of Student's distribution for the normal quantile `z` (Wallace: *Bounds on Normal Approximations to Student's and the
/// Chi-Square Distributions*, The Annals of Mathematical Statistics 30(4), 1959).
fn student(z: f64, freedom: f64) -> f64 {
    let scaled = z * (8.0 * freedom + 3.0) / (8.0 * freedom + 1.0);
    (freedom * (scaled * scaled / freedom).exp_m1()).sqrt()
}

/// The light that a picture misses, by the light of every region in independent pictures.
fn compared(lights: &[Vec<f64>], picture: &Picture, grid: UVec2) -> Option<Missing> {
    let frame = picture.film.size;
    let own = light_in(picture, grid);
    // Channels of one path rise and fall together. The error of a mean over n pixels has the mean of their variances over n.
    let of_pixel = |i: usize| {
        let moments = &picture.film.pixels[i];
        let variance = moments.variance_of_mean().max(Default::default());
        variance.powf(0.5).element_sum().powi(2)
    };
    let pixels = f64::from(frame.x * frame.y) / own.len() as f64;
    let noise = means(frame, grid, |i| of_pixel(i) / pixels);
    // Excess of the pictures, their light, and the variance of the excess, over some regions.
    let over = |regions: &[usize]| {
        let sum = |values: &[f64]| regions.iter().map(|&i| values[i]).sum::<f64>();
        let sums: Vec<f64> = lights.iter().map(|light| sum(light)).collect();
        let (light, variance) = estimate(&sums);
        (light - sum(&own), light, variance + sum(&noise))
    };
    let all: Vec<usize> = (0..own.len()).collect();
    let (excess, light, variance) = over(&all);
    let share = (excess - 2.0 * variance.sqrt()) / light;
    if share.is_nan() || share < LEAST.0 {
        return None;
    }
    let (columns, rows) = (grid.x as usize, grid.y as usize);
    let around = |i: usize| -> Vec<usize> {
        let (x, y) = (i % columns, i / columns);
        let row =
            |y: usize| (x.saturating_sub(1)..(x + 2).min(columns)).map(move |x| y * columns + x);
        (y.saturating_sub(1)..(y + 2).min(rows))
            .flat_map(row)
            .collect()
    };
    // A bound on the normal quantile.
    let normal = (2.0 * (own.len() as f64 / CHANCE).ln()).sqrt();
    let bound = student(normal, f64::from(PICTURES - 1));
    let parts: Vec<_> = all.iter().map(|&i| over(&around(i))).collect();
    let is_dark = |&i: &usize| {
        let (excess, light, variance) = parts[i];
        excess > bound * variance.sqrt() && excess > LEAST.1 * light
    };
    let dark: Vec<usize> = all.into_iter().filter(is_dark).collect();
    let darkest = (dark.iter().copied()).max_by(|&a, &b| parts[a].0.total_cmp(&parts[b].0))?;
    let mut squares = vec![0.0; own.len()];
    for i in dark {
        let (excess, light, variance) = parts[i];
        // As the share of the whole, what is missing at least.
        squares[i] = ((excess - 2.0 * variance.sqrt()) / light).powi(2);
    }
    let region = |i: usize| {
        let (x, y) = (i as u32 % frame.x, i as u32 / frame.x);
        (y * grid.y / frame.y * grid.x + x * grid.x / frame.x) as usize
    };
    let half = UVec2::new(darkest as u32 % grid.x, darkest as u32 / grid.x) * 2 + UVec2::ONE;
    Some(Missing {
        share,
        pixel: half * frame / (grid * 2),
        finder: IntegratorKind::Vcm,
        squares: (0..picture.film.pixels.len())
            .map(|i| squares[region(i)] as f32)
            .collect(),
    })
}

#[cfg(test)]
mod tests;
