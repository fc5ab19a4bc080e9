//! The driver of pieces: tiles of a film, chunks of light paths, chains.
//!
//! An estimator cuts a sample into pieces. The driver runs them on all threads and adds their results in order, so that
//! a picture is bit-identical at any number of threads. Every piece has its own fork of the recorder, and the forks are
//! joined in the same order.
//!
//! The driver also ends a render in the middle of a sample ([`Stop`]): it skips the pieces that have not begun and
//! drops the results of the others. The results of the first sample are kept, and stand for those that were skipped.

use super::walk::observer::Recorder;
use super::{Stop, View};
use crate::image::film::{Film, Window};
use crate::math::Rgb;
use rayon::prelude::*;
use std::ops::Range;
use std::sync::Mutex;

/// Items such as light paths, cut into pieces that a thread takes at a time.
#[derive(Clone, Copy)]
pub(super) struct Pieces {
    items: u32,
    /// Items of a piece; the last one may have fewer.
    size: u32,
    /// Pieces whose results are added before the next pieces begin.
    batch: u32,
    /// Pieces of the first sample that run even if it is stopped.
    least: u32,
}

impl Pieces {
    /// Pieces of `size` items. In the first sample one runs even if it is stopped: a picture needs some pixel.
    pub(super) fn new(items: u32, size: u32) -> Self {
        Self {
            items,
            size,
            batch: u32::MAX,
            least: 1,
        }
    }

    /// Bounds the memory of the results: they are added `batch` pieces at a time.
    pub(super) fn in_batches(self, batch: u32) -> Self {
        Self { batch, ..self }
    }

    /// Runs `least` pieces in the first sample even if it is stopped.
    pub(super) fn at_least(self, least: u32) -> Self {
        Self { least, ..self }
    }

    fn count(&self) -> u32 {
        self.items.div_ceil(self.size)
    }

    /// The items of a piece.
    fn items(&self, piece: u32) -> Range<u32> {
        let first = piece * self.size;
        first..first.saturating_add(self.size).min(self.items)
    }
}

/// Results of the pieces that were finished, in order, each with its items.
pub(super) struct Finished<T> {
    pub(super) results: Vec<(Range<u32>, T)>,
    /// All items over those that were finished: 1 unless the first sample was stopped.
    pub(super) factor: f64,
}

/// Most values of several samples that are stored until they are added; one sample of a large picture may have more.
const MAX_STORED_VALUES: usize = 1 << 21;

/// Tiles of a film that are copied at once while values are added to it.
const COPIED: usize = 256;

/// A tile whose samples are traced. Values are stored until all tiles are complete: a stopped pass adds none.
pub(super) struct Tile<'a> {
    pub(super) window: Window,
    /// Room for values by pixel and sample, samples fastest.
    values: std::slice::IterMut<'a, Rgb>,
}

impl Tile<'_> {
    /// Samples that are added together to the tiles of a film.
    pub(super) fn samples_at_once(film: &Film) -> u32 {
        (MAX_STORED_VALUES / film.window.len().max(1)).clamp(1, u32::MAX as usize) as u32
    }

    /// Adds the value of the next sample.
    #[inline]
    pub(super) fn push(&mut self, value: Rgb) {
        *self.values.next().expect("room for every sample") = value;
    }
}

/// Runs pieces until a render is stopped.
#[derive(Clone, Copy, Default)]
pub(super) struct Driver<'a> {
    stop: Option<&'a Stop<'a>>,
    /// True during work on which the rest of a sample depends.
    shared: bool,
}

impl<'a> View<'a> {
    /// The driver of a pass.
    pub(super) fn driver(&self) -> Driver<'a> {
        Driver {
            stop: self.stop,
            shared: false,
        }
    }
}

impl Driver<'_> {
    /// Adds samples, at most `most` at a time, until the render is stopped. Returns the number of whole samples.
    ///
    /// `add` returns `None` if the driver dropped its results.
    pub(super) fn samples(
        &self,
        samples: Range<u32>,
        most: u32,
        mut add: impl FnMut(Range<u32>) -> Option<()>,
    ) -> u32 {
        let mut next = samples.start;
        while next < samples.end && (next == samples.start || !self.is_over()) {
            let end = next.saturating_add(most).min(samples.end);
            if add(next..end).is_none() || self.is_cut() {
                break;
            }
            if let Some(stop) = self.stop {
                stop.end_first_sample();
            }
            next = end;
        }
        next - samples.start
    }

    /// Runs work on which the rest of a sample depends, such as light paths that all pixels share. In the first sample
    /// it may take half of the time limit, and the rest gets at least as long as it took.
    pub(super) fn shared<T>(&self, work: impl FnOnce(&Self) -> T) -> T {
        let shared = true;
        let result = work(&Self { shared, ..*self });
        if let Some(stop) = self.stop {
            stop.extend_first_sample();
        }
        result
    }

    /// Runs pieces, and passes their results to `add` in order. Returns all items over those that were finished; `None`
    /// if the results are dropped.
    pub(super) fn run_batches<T: Send>(
        &self,
        pieces: Pieces,
        work: impl Fn(Range<u32>) -> T + Sync,
        mut add: impl FnMut(Range<u32>, T),
    ) -> Option<f64> {
        let count = pieces.count();
        let mut finished = 0;
        for first in (0..count).step_by(pieces.batch as usize) {
            let batch = first..first.saturating_add(pieces.batch).min(count);
            let results: Vec<_> = batch
                .into_par_iter()
                .filter(|&piece| !self.leaves_out(piece, pieces.least))
                .map(|piece| (pieces.items(piece), work(pieces.items(piece))))
                .collect();
            if self.drops() {
                return None;
            }
            for (items, result) in results {
                finished += items.len();
                add(items, result);
            }
        }
        Some(f64::from(pieces.items.max(1)) / finished.max(1) as f64)
    }

    /// Runs pieces; `None` if their results are dropped.
    pub(super) fn run<T: Send>(
        &self,
        pieces: Pieces,
        work: impl Fn(Range<u32>) -> T + Sync,
    ) -> Option<Finished<T>> {
        let mut results = Vec::new();
        let factor =
            self.run_batches(pieces, work, |items, result| results.push((items, result)))?;
        Some(Finished { results, factor })
    }

    /// Runs pieces, each with a fork of the recorder; `None` if their results are dropped.
    pub(super) fn run_recorded<T: Send, O: Recorder>(
        &self,
        pieces: Pieces,
        recorder: &mut O,
        work: impl Fn(Range<u32>, &mut O) -> T + Sync,
    ) -> Option<Finished<T>> {
        let blank = &*recorder;
        let finished = self.run(pieces, |items| {
            let mut observer = blank.fork();
            (work(items, &mut observer), observer)
        })?;
        let results = finished.results.into_iter().map(|(items, (result, fork))| {
            recorder.join(fork);
            (items, result)
        });
        Some(Finished {
            results: results.collect(),
            factor: finished.factor,
        })
    }

    /// Adds these samples to tiles of a film, which `work` traces, each with a fork of the recorder. Returns the
    /// results of `work`; `None` if the film is unchanged.
    pub(super) fn run_tiles<T: Send, O: Recorder>(
        &self,
        tiles: &[Window],
        samples: &Range<u32>,
        film: &mut Film,
        recorder: &mut O,
        work: impl Fn(&mut Tile<'_>, &mut O) -> T + Sync,
    ) -> Option<Vec<T>> {
        let each = samples.len();
        let pixels: usize = tiles.iter().map(Window::len).sum();
        // Zeroed memory is committed at the first write and returned at the end; threads' allocations stay in the heap.
        let mut values = vec![0.0f32; 3 * pixels * each];
        let mut rest: &mut [Rgb] = bytemuck::cast_slice_mut(&mut values);
        let room = tiles.iter().map(|window| {
            let (own, others) = std::mem::take(&mut rest).split_at_mut(window.len() * each);
            rest = others;
            Mutex::new(own)
        });
        let room: Vec<_> = room.collect();
        let lock = |tile: u32| room[tile as usize].lock().expect("no thread panics");
        let pieces = Pieces::new(tiles.len() as u32, 1);
        let finished = self.run_recorded(pieces, recorder, |items, observer| {
            let mut room = lock(items.start);
            let mut tile = Tile {
                window: tiles[items.start as usize],
                values: room.iter_mut(),
            };
            work(&mut tile, observer)
        })?;
        let traced = finished.results.into_iter();
        let (traced, results): (Vec<_>, Vec<_>) = traced.map(|(i, r)| (i.start, r)).unzip();
        for some in traced.chunks(COPIED) {
            let before = &*film;
            let added = some.par_iter().map(|&tile| {
                let mut copy = before.cut(tiles[tile as usize]);
                for (k, value) in lock(tile).iter().enumerate() {
                    copy.push(k / each, *value, samples.start + (k % each) as u32);
                }
                copy
            });
            let added: Vec<_> = added.collect();
            added.iter().for_each(|tile| film.paste(tile));
        }
        Some(results)
    }

    /// True if a piece must be skipped.
    fn leaves_out(&self, piece: u32, least: u32) -> bool {
        self.is_over() && !(piece < least && self.is_first())
    }

    /// True once the time of this work is over or a stop is requested.
    fn is_over(&self) -> bool {
        self.stop.is_some_and(|stop| match self.shared {
            true if stop.is_first() => stop.skips_shared(),
            _ => stop.skips_next(),
        })
    }

    /// True if pieces were skipped.
    fn is_cut(&self) -> bool {
        self.stop.is_some_and(Stop::is_cut)
    }

    /// True if the results of the current sample are dropped.
    fn drops(&self) -> bool {
        self.is_cut() && !self.is_first()
    }

    /// True while there is no whole sample.
    fn is_first(&self) -> bool {
        self.stop.is_some_and(Stop::is_first)
    }
}
