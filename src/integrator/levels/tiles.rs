//! All paths of a film at several levels, tile by tile.

use super::packed::{Path, PathSums, max_words, pack, unpack};
use crate::image::film::{Film, FilmBand, Window};
use crate::image::level_film::{BATCHES, LevelBand, LevelFilm};
use crate::integrator::View;
use crate::integrator::pieces::Pieces;
use crate::integrator::walk::Walk;
use crate::integrator::walk::camera::CameraWalks;
use crate::integrator::walk::observer::{PathObserver, Recorder};
use crate::sampler::{CameraSource, Domain, SampleSource, Sampler};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Mutex;

/// Pixels per side of the tiles that threads take.
const TILE: u32 = 16;

/// Most words of several samples that are added together; one sample of a large picture may take more. Small pictures
/// thus get many samples at a time, which keeps threads busy.
const MAX_PACKED_WORDS: usize = 1 << 24;

/// Largest number of bytes that a pixel takes until a pass is added to its film.
pub(in crate::integrator) const fn pass_bytes(levels: usize) -> u64 {
    (size_of::<u32>() * max_words(levels)) as u64
}

/// A tracer of paths at up to `N` levels.
pub(in crate::integrator) trait LevelPaths<const N: usize>: Sync {
    /// Number of levels.
    fn levels(&self) -> usize;

    /// Light of a path at every level, along all ways of a camera walk; `turn` is odd in half of the samples of every
    /// batch.
    fn trace<S: Sampler + Clone, O: PathObserver>(
        &self,
        walk: Walk<'_>,
        sample: u32,
        turn: u32,
        sampler: &S,
        observer: &mut O,
    ) -> PathSums<N>;
}

/// Adds the samples with these numbers to every pixel: level 0 to `film`, all levels to `levels`; tiles in parallel,
/// joined in order. Returns how many were added, fewer than all where the render is stopped.
pub(in crate::integrator) fn estimate<const N: usize, T: LevelPaths<N>, O: Recorder>(
    tracer: &T,
    view: &View<'_>,
    source: &CameraSource,
    samples: Range<u32>,
    film: &mut Film,
    levels: &mut LevelFilm,
    recorder: &mut O,
) -> u32 {
    debug_assert_eq!(levels.levels(), tracer.levels());
    let most = MAX_PACKED_WORDS / (film.window.len() * max_words(tracer.levels())).max(1);
    let most = most.clamp(1, u32::MAX as usize) as u32;
    view.driver().samples(samples, most, |some| {
        add(tracer, view, source, some, film, levels, recorder)
    })
}

/// The same for samples that are added together; `None` if the render was stopped and the films are unchanged.
fn add<const N: usize, T: LevelPaths<N>, O: Recorder>(
    tracer: &T,
    view: &View<'_>,
    source: &CameraSource,
    samples: Range<u32>,
    film: &mut Film,
    levels: &mut LevelFilm,
    recorder: &mut O,
) -> Option<()> {
    let walks = CameraWalks::of(view);
    let windows = film.tiles(TILE);
    let most = max_words(tracer.levels()) * samples.len();
    // The system commits zeroed memory at the first write: words that no path needs take none.
    let mut words = vec![0; film.window.len() * most];
    let free = Mutex::new(&mut words[..]);
    let trace = |tile: Range<u32>, observer: &mut O| {
        let window = windows[tile.start as usize];
        let mut all = vec![0; window.len() * most];
        let (mut rest, mut values) = (&mut all[..], Path::NONE);
        for index in 0..window.len() {
            let pixel = window.pixel(index);
            let number = u64::from(pixel.y) << 32 | u64::from(pixel.x) << 2;
            // A second lobe is drawn in every other sample of a batch, with a random start: batches stay independent.
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
                let sums = tracer.trace(walk, sample, turn, &stream, observer);
                observer.finish(sums.levels[0]);
                values.set(&sums);
                pack(&mut values, tracer.levels(), &mut rest);
            }
        }
        let left = rest.len();
        let written = &all[..all.len() - left];
        let kept = cut(&mut free.lock().expect("no thread panics"), written.len());
        kept.copy_from_slice(written);
        &*kept
    };
    let pieces = Pieces::new(windows.len() as u32, 1);
    let traced = view.driver().run_recorded(pieces, recorder, trace)?;
    let blank = |window| Tile {
        window,
        words: None,
    };
    let mut tiles: Vec<_> = windows.iter().copied().map(blank).collect();
    for (tile, words) in traced.results {
        tiles[tile.start as usize].words = Some(words);
    }

    let columns = film.window.w.div_ceil(TILE) as usize;
    let bands: Vec<_> = (film.bands(TILE))
        .zip(levels.bands(TILE, &samples))
        .zip(tiles.chunks(columns))
        .collect();
    let refused: Vec<_> = (bands.into_par_iter())
        .map(|((mut film, mut levels), tiles)| {
            for tile in tiles {
                tile.add(&samples, &mut film, &mut levels);
            }
            film.rejected
        })
        .collect();
    refused.iter().for_each(|refused| film.refuse(refused));
    Some(())
}

/// Takes `count` words from the front.
fn cut<'a>(words: &mut &'a mut [u32], count: usize) -> &'a mut [u32] {
    let (own, rest) = std::mem::take(words).split_at_mut(count);
    *words = rest;
    own
}

/// Pixels that a thread traced.
struct Tile<'a> {
    window: Window,
    /// Paths by pixel and sample, samples fastest; none where the render was stopped before.
    words: Option<&'a [u32]>,
}

impl Tile<'_> {
    /// Adds the samples, if there are any, to the bands that contain the tile.
    fn add(&self, samples: &Range<u32>, film: &mut FilmBand<'_>, levels: &mut LevelBand<'_>) {
        let Some(mut words) = self.words else { return };
        let mut values = Path::NONE;
        for index in 0..self.window.len() {
            let at = film.window.index(self.window.pixel(index));
            for sample in samples.clone() {
                unpack(&mut values, levels.levels(), &mut words);
                values.add(at, sample, film, levels);
            }
        }
    }
}
