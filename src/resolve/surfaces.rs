//! Restores light that was cut before blurs, on the surface that it was cut from.
//!
//! With means by Gaussians of 8 pixels on cells, stopped at edges, of D = R − R_chosen in each batch, R' the chosen
//! light and C the light of fireflies above their caps:
//!
//! ```text
//! m = mean of D,  at least 0 and at most C,  V = variance of the mean of D
//! f = 1 + m / R' · max(0, 1 − 2 V / m²)        at most 2½
//! ```
//!
//! A hit in only one batch restores nothing. A pixel takes f from the cells around on its surface: restored light adds
//! no structure, and does not light surfaces beside or behind.

use super::coarse::{CELL, Caps, Coarse, restoring_factor};
use super::filter::Size;
use super::guide::{Guide, Inner, Surface};
use super::layer::{Batches, variance_of_mean};
use super::only_light;
use crate::image::film::Window;
use crate::image::level_film::{BATCHES, FEATURES, Features, LevelFilm};
use crate::math::{Rgb, Vec3A};
use rayon::prelude::*;

/// Standard deviation in cells of the Gaussians.
const SIGMA: f32 = 2.0;

/// Largest factor.
const MAX_FACTOR: f32 = 2.5;

/// Rows of cells that are processed at once.
const BAND: usize = 4;

/// Factors that bring a picture of roughened light nearer to its only level, surface by surface.
pub(super) fn factors(film: &LevelFilm, light: &Coarse, caps: &Caps, picture: &[Rgb]) -> Vec<Rgb> {
    let window = film.window();
    let width = window.w as usize;
    let have = light.means(|pixel| picture[pixel].into());
    let cells = light.cells();
    let guide = Guide::new(cells, Surface::Rough, &features_of_cells(film, cells));
    let cut = light.means(|pixel| {
        let cap = caps.at((pixel % width, pixel / width));
        let above = |batch| (only_light(film, pixel, batch) - cap).max(Vec3A::ZERO);
        (0..light.count).map(above).sum::<Vec3A>() / light.count as f32
    });
    let of_cells = factors_of_cells(&guide, cells, light, [&have, &cut]);
    let mut factors = vec![Rgb::ONE; picture.len()];
    let bands = factors.par_chunks_mut(width * CELL * BAND).enumerate();
    bands.for_each(|(band, factors)| {
        let first = band * CELL * BAND;
        let rows = factors.len() / width;
        // Slopes need a row more on each side.
        let above = first.min(1);
        let outer = Window {
            y: window.y + (first - above) as u32,
            h: (rows + above + 1).min(window.h as usize - (first - above)) as u32,
            ..window
        };
        let features = film.features_of(&outer);
        let here = Guide::new((width, outer.h as usize), Surface::Rough, &features);
        for (y, factors) in factors.chunks_exact_mut(width).enumerate() {
            let means = here.of_cells(y + above, &guide, first + y, CELL, &of_cells);
            let pairs = factors.iter_mut().zip(means);
            pairs.for_each(|(factor, mean)| *factor = mean.into());
        }
    });
    factors
}

/// Means of the features in every cell.
fn features_of_cells(film: &LevelFilm, (columns, rows): Size) -> Vec<Features> {
    let window = film.window();
    let row = |row: usize| {
        let y = (row * CELL) as u32;
        let band = Window {
            y: window.y + y,
            h: (CELL as u32).min(window.h - y),
            ..window
        };
        let features = film.features_of(&band);
        let mut sums = vec![([0.0; FEATURES], 0.0f32); columns];
        for (i, features) in features.iter().enumerate() {
            let (sum, count) = &mut sums[i % window.w as usize / CELL];
            sum.iter_mut().zip(features).for_each(|(s, f)| *s += *f);
            *count += 1.0;
        }
        sums.into_iter().map(|(sum, count)| sum.map(|s| s / count))
    };
    (0..rows).into_par_iter().flat_map_iter(row).collect()
}

/// f of every cell, given the film's light there, the chosen light and the light that was cut.
fn factors_of_cells(
    guide: &Guide,
    cells: Size,
    light: &Coarse,
    [have, cut]: [&[Vec3A]; 2],
) -> Vec<Vec3A> {
    let inner = Inner {
        origin: (0, 0),
        size: cells,
        width: cells.0,
    };
    let lacks: Batches = (light.batches().iter().zip(have))
        .map(|(batches, have)| batches.map(|light| light - *have))
        .collect();
    let [have, cut] = [have, cut]
        .map(|light| -> Batches { light.iter().map(|light| [*light; BATCHES]).collect() });
    let blurred = guide.blur::<1>(SIGMA, &inner, &[&lacks, &have, &cut], light.count);
    let cells = 0..blurred[0].len();
    cells
        .map(|cell| {
            let [lacks, have, cut] = [0, 1, 2].map(|layer: usize| blurred[layer][cell]);
            let lacks = &lacks[..light.count];
            let mean = lacks.iter().sum::<Vec3A>() / light.count as f32;
            let more = mean.min(cut[0]).max(Vec3A::ZERO);
            restoring_factor(have[0], more, variance_of_mean(lacks)).min(Vec3A::splat(MAX_FACTOR))
        })
        .collect()
}
