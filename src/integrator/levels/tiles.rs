//! All paths of a film at several levels, tile by tile.

use super::{LevelTracer, SCALES};
use crate::image::film::{Film, Window};
use crate::image::level_film::{BATCHES, LevelFilm, MAX_LEVELS, PathLevels};
use crate::integrator::View;
use crate::integrator::walk::camera::CameraWalks;
use crate::integrator::walk::observer::Recorder;
use crate::sampler::{CameraSource, Domain, SampleSource};
use rayon::prelude::*;
use std::ops::Range;

/// Pixels a side of the tiles that threads take.
const TILE: u32 = 16;

impl LevelTracer {
    /// Adds the samples with these numbers to every pixel: level 0 to `film`, all levels to `levels`; tiles in parallel,
    /// joined in order. Returns how many were added, fewer than all where the render is stopped.
    pub(in crate::integrator) fn estimate<O: Recorder>(
        &self,
        view: &View<'_>,
        source: &CameraSource,
        samples: Range<u32>,
        film: &mut Film,
        levels: &mut LevelFilm,
        recorder: &mut O,
    ) -> u32 {
        if self.levels() <= SCALES.len() {
            self.estimate_in::<{ SCALES.len() }, O>(view, source, samples, film, levels, recorder)
        } else {
            self.estimate_in::<MAX_LEVELS, O>(view, source, samples, film, levels, recorder)
        }
    }

    /// The same with room for `N` levels: what is usual takes half the room of what is possible.
    fn estimate_in<const N: usize, O: Recorder>(
        &self,
        view: &View<'_>,
        source: &CameraSource,
        samples: Range<u32>,
        film: &mut Film,
        levels: &mut LevelFilm,
        recorder: &mut O,
    ) -> u32 {
        debug_assert_eq!(levels.levels(), self.levels());
        let walks = CameraWalks::of(view);
        let tile = |window: Window| {
            let mut film = film.cut(window);
            let mut levels = levels.cut(window);
            let mut observer = recorder.fork();
            for index in 0..film.pixels.len() {
                let pixel = film.pixel(index);
                let number = u64::from(pixel.y) << 32 | u64::from(pixel.x) << 2;
                // A second lobe is drawn in every other sample of a batch, from a random one on: batches stay independent of
                // one another.
                let seed = source.seed();
                let turns: [u32; BATCHES] = std::array::from_fn(|batch| {
                    seed.derive(Domain::Levels, number | batch as u64).0 as u32
                });
                for sample in samples.clone() {
                    let mut stream = source.stream(pixel, sample);
                    let walk = walks.start(pixel, &mut stream);
                    observer.begin(pixel, sample);
                    let turn = turns[sample as usize % BATCHES];
                    let turn = (turn >> 1).wrapping_add(sample / BATCHES as u32);
                    let mut path = self.radiance::<N, _, _>(walk, turn, &mut stream, &mut observer);
                    film.push(index, path.levels[0], sample);
                    path.levels[0] += path.unseen;
                    let values = PathLevels {
                        levels: &path.levels[..self.levels()],
                        shared: path.shared,
                        features: path.features.values(),
                    };
                    levels.push(index, sample, &values);
                }
            }
            (film, levels, observer)
        };
        let tiles = film.tiles(TILE).into_par_iter();
        let tiles: Vec<_> = tiles.filter(|_| !view.stopped()).map(tile).collect();
        if view.drops_pass() {
            return 0;
        }
        for (tile, tile_levels, observer) in tiles {
            film.paste(&tile);
            levels.paste(&tile_levels);
            recorder.join(observer);
        }
        view.added(&samples)
    }
}
