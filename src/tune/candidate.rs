//! Pictures of a candidate in independent batches, and their tiles.

use crate::image::film::{Film, FilmError, Window};
use crate::integrator::{Integrator, Picture, Settings, View};
use crate::pilot::window::{TILE, inside};
use std::ops::Range;

/// Independent batches.
pub(super) const BATCHES: usize = 4;

/// Tiles of a candidate: mean radiance by batch, and variance of one sample.
pub(super) struct Tiles {
    pub(super) means: [Vec<[f64; 3]>; BATCHES],
    pub(super) variance: Vec<f64>,
}

/// Pictures of a candidate, one per batch.
pub(super) struct CandidatePictures {
    integrator: Box<dyn Integrator>,
    pictures: Vec<Picture>,
}

impl CandidatePictures {
    /// No samples yet.
    pub(super) fn new(settings: &Settings, view: &View<'_>) -> Result<Self, FilmError> {
        let picture = Picture {
            film: Film::cropped(view.sensor.frame, view.window)?,
            aovs: None,
            levels: None,
        };
        Ok(Self {
            integrator: settings.integrator(),
            pictures: vec![picture; BATCHES],
        })
    }

    /// Adds some of the `spp` samples per pixel of every batch.
    pub(super) fn trace(&mut self, view: &View<'_>, spp: u32, samples: Range<u32>) {
        for (batch, picture) in (0..).zip(&mut self.pictures) {
            let first = batch * spp;
            let range = first + samples.start..first + samples.end;
            (self.integrator).pass(view, range, picture);
        }
    }

    /// The pictures as tiles of a window.
    pub(super) fn tiles(&self, window: Window) -> Tiles {
        let windows = window.tiles(TILE);
        let means = std::array::from_fn(|batch| {
            let mean = self.pictures[batch].film.mean();
            let tile = |w: &Window| -> [f64; 3] {
                let mut sum = [0.0; 3];
                for pixel in inside(w, &window) {
                    for (s, v) in sum.iter_mut().zip(mean.pixels[pixel].to_array()) {
                        *s += f64::from(v) / w.len() as f64;
                    }
                }
                sum
            };
            windows.iter().map(tile).collect()
        });
        let mut variance = vec![0.0; windows.len()];
        for picture in &self.pictures {
            let of = picture.film.sample_variance();
            for (sum, w) in variance.iter_mut().zip(&windows) {
                let total: f64 = inside(w, &window)
                    .map(|pixel| {
                        of.pixels[pixel]
                            .to_array()
                            .iter()
                            .map(|v| f64::from(*v))
                            .sum::<f64>()
                    })
                    .sum();
                *sum += total / (3 * w.len() * BATCHES) as f64;
            }
        }
        Tiles { means, variance }
    }
}
