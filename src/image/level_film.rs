//! Sums of several roughening levels over the same paths, in batches; of the light that no level changes; and of
//! features for blurs.
//!
//! Sample number n belongs to batch n mod [`BATCHES`]. So batches have equal lengths, up to one sample, wherever a
//! render stops, and a resumed render continues the same batches. A sample with a level that is not finite is left out
//! at all levels, so that they stay averages over the same paths; the film of level 0 reports it.
//!
//! Sums are in single precision: 12 bytes per level and batch, as much for the shared light, and 300 bytes per pixel
//! for four levels with counts and features. A sum of `CARRY` samples or more is a pair of numbers whose second is the
//! rounding error of the first: 0.7 added a million times to one number is off by 1 %. So a film takes nearly twice the
//! memory from sample [`BATCHES`] · (`CARRY` − 1) on. The film of level 0 beside it has double precision.

use super::Buffer;
use super::film::Window;
use crate::math::{Rgb, UVec2};
use rayon::prelude::*;
use std::borrow::Cow;
use std::io::{self, Write};
use std::ops::Range;

/// Number of independent batches.
pub const BATCHES: usize = 4;

/// Features of a path: normal of the first rough vertex and path length to it; normal, distance and reflectance of the
/// first vertex. Zero where there is none.
pub(crate) type Features = [f32; FEATURES];

/// Number of features per path or pixel.
pub const FEATURES: usize = 11;

/// Most levels of a film.
pub(crate) const MAX_LEVELS: usize = 8;

/// Samples of a batch after which its sums are carried over. It limits the error of a single-precision sum to 0.05 %,
/// and that of a sum of features over all batches to 0.2 %.
const CARRY: u32 = 1 << 14;

/// Sum of the weights of a pixel's neighbours up to which none counts as similar.
const MIN_WEIGHT: f32 = 0.01;

const MAGIC: &[u8; 8] = b"opsrlvl4";

/// Magic word of a film with carried sums.
const MAGIC_CARRIED: &[u8; 8] = b"opsrlvl5";

/// Values of one path.
#[derive(Clone, Copy, Debug)]
pub struct PathLevels<'a> {
    /// Radiance at every level.
    pub levels: &'a [Rgb],
    /// Radiance that no level changes.
    pub shared: Rgb,
    /// Features of the path.
    pub features: Features,
}

/// Sums over the samples of every pixel in a window of the frame, by batch and level.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelFilm {
    size: UVec2,
    window: Window,
    levels: usize,
    /// Samples by pixel and batch.
    counts: Vec<[u32; BATCHES]>,
    /// Sums of the features by pixel.
    features: Vec<Features>,
    /// Sums by pixel, batch and level, levels fastest, the shared light after the last.
    sums: Vec<Rgb>,
    /// High parts of the features and sums, once any are carried over.
    carried: Option<Carried>,
}

/// High parts of a film's sums. The film's own sums are then the low parts, and each sum is high plus low.
#[derive(Clone, Debug, PartialEq)]
struct Carried {
    features: Vec<Features>,
    sums: Vec<Rgb>,
}

/// True if all numbers are finite. Tests exponents without branches, so that it vectorises.
#[inline]
fn are_finite(values: &[f32]) -> bool {
    const EXPONENT: u32 = 0x7f80_0000;
    let infinite = |x: &f32| u32::from(x.to_bits() & EXPONENT == EXPONENT);
    values.iter().map(infinite).fold(0, |any, one| any | one) == 0
}

/// Adds values to sums.
#[inline]
fn add(sums: &mut [f32], values: &[f32]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += value;
    }
}

/// Adds `low` to `high`; `low` keeps the rounding error, so that the pair has the same sum as before (Knuth's two-sum).
fn carry(high: &mut f32, low: &mut f32) {
    let sum = *high + *low;
    let added = sum - *high;
    *low = (*high - (sum - added)) + (*low - added);
    *high = sum;
}

/// True if the sums of a batch are carried over before this sample is added. This depends on the sample's number, not
/// on the count, so that refused samples do not change whether a film carries.
fn carries(sample: u32) -> bool {
    (sample / BATCHES as u32 + 1).is_multiple_of(CARRY)
}

/// Rows of a film, so that several threads can add samples to different rows.
pub(crate) struct LevelBand<'a> {
    levels: usize,
    counts: &'a mut [[u32; BATCHES]],
    features: &'a mut [Features],
    sums: &'a mut [Rgb],
    carried: Option<(&'a mut [Features], &'a mut [Rgb])>,
}

impl LevelBand<'_> {
    /// Number of levels.
    pub(crate) fn levels(&self) -> usize {
        self.levels
    }

    /// [`LevelFilm::push`] by the index in the band.
    #[inline]
    pub(crate) fn push(&mut self, index: usize, sample: u32, path: &PathLevels<'_>) {
        let batch = sample as usize % BATCHES;
        if carries(sample) {
            self.carry(index, batch);
        }
        let levels: &[f32] = bytemuck::cast_slice(path.levels);
        if !are_finite(levels) || !path.shared.is_finite() {
            return;
        }
        let at = (index * BATCHES + batch) * (self.levels + 1);
        self.counts[index][batch] += 1;
        add(
            bytemuck::cast_slice_mut(&mut self.sums[at..at + self.levels]),
            levels,
        );
        self.sums[at + self.levels] += path.shared;
        add(&mut self.features[index], &path.features);
    }

    /// Carries the sums of a pixel's batch over; for the first batch those of the features, too.
    #[cold]
    fn carry(&mut self, index: usize, batch: usize) {
        let Some((features, sums)) = &mut self.carried else {
            return;
        };
        let at = (index * BATCHES + batch) * (self.levels + 1);
        let range = at..at + self.levels + 1;
        for (high, low) in (sums[range.clone()].iter_mut()).zip(&mut self.sums[range]) {
            carry(&mut high.x, &mut low.x);
            carry(&mut high.y, &mut low.y);
            carry(&mut high.z, &mut low.z);
        }
        if batch == 0 {
            let pairs = features[index].iter_mut();
            for (high, low) in pairs.zip(&mut self.features[index]) {
                carry(high, low);
            }
        }
    }
}

impl Carried {
    fn new(pixels: usize, levels: usize) -> Self {
        Self {
            features: vec![[0.0; FEATURES]; pixels],
            sums: vec![Rgb::ZERO; pixels * BATCHES * (levels + 1)],
        }
    }

    /// Copies `count` pixels of `from`, with `stride` sums each.
    fn copy(&mut self, to: usize, from: &Self, at: usize, count: usize, stride: usize) {
        self.features[to..to + count].copy_from_slice(&from.features[at..at + count]);
        self.sums[to * stride..(to + count) * stride]
            .copy_from_slice(&from.sums[at * stride..(at + count) * stride]);
    }
}

impl LevelFilm {
    /// An empty film of a window of the frame.
    pub fn new(size: UVec2, window: Window, levels: usize) -> Self {
        Self {
            size,
            window,
            levels,
            counts: vec![[0; BATCHES]; window.len()],
            features: vec![[0.0; FEATURES]; window.len()],
            sums: vec![Rgb::ZERO; window.len() * BATCHES * (levels + 1)],
            carried: None,
        }
    }

    /// Bytes of a film whose pixels have `samples` samples each, without the film of level 0.
    pub(crate) fn bytes_with(pixels: usize, levels: usize, samples: u32) -> u64 {
        let carried = samples > BATCHES as u32 * (CARRY - 1);
        let counts = (pixels * size_of::<[u32; BATCHES]>()) as u64;
        let plain = Self::bytes(pixels, levels);
        plain + if carried { plain - counts } else { 0 }
    }

    /// Bytes of a film of `pixels` pixels before sums are carried over, without the film of level 0.
    pub fn bytes(pixels: usize, levels: usize) -> u64 {
        let each = size_of::<[u32; BATCHES]>()
            + size_of::<Features>()
            + BATCHES * (levels + 1) * size_of::<Rgb>();
        pixels as u64 * each as u64
    }

    /// Bytes before the pixels in [`LevelFilm::write`].
    pub(crate) const HEAD: u64 = 12;

    /// Count of numbers per pixel in [`LevelFilm::sample`].
    pub(crate) fn sample_numbers(levels: usize) -> usize {
        3 * (levels + 1) + FEATURES
    }

    /// Numbers of a film's only sample, by pixel: levels, shared light and features. Levels and shared light are NaN
    /// where the sample was left out.
    pub(crate) fn sample(&self, sample: u32) -> impl Iterator<Item = f32> + '_ {
        let batch = sample as usize % BATCHES;
        let each = self.levels + 1;
        let pixels = self.sums.chunks_exact(BATCHES * each);
        let pixels = pixels.zip(&self.counts).zip(&self.features);
        pixels.flat_map(move |((sums, counts), features)| {
            let missing = counts[batch] == 0;
            let own = sums[batch * each..(batch + 1) * each].iter();
            own.flat_map(move |v| if missing { Rgb::NAN } else { *v }.to_array())
                .chain(*features)
        })
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.levels
    }

    /// The part of the frame that is recorded.
    pub(crate) fn window(&self) -> Window {
        self.window
    }

    /// Adds the path of `sample` to the pixel with this index.
    #[inline]
    pub fn push(&mut self, index: usize, sample: u32, path: &PathLevels<'_>) {
        if carries(sample) {
            self.begin_to_carry();
        }
        LevelBand {
            levels: self.levels,
            counts: &mut self.counts,
            features: &mut self.features,
            sums: &mut self.sums,
            carried: (self.carried.as_mut()).map(|c| (&mut c.features[..], &mut c.sums[..])),
        }
        .push(index, sample, path);
    }

    /// Allocates sums that are carried over.
    #[cold]
    fn begin_to_carry(&mut self) {
        let (pixels, levels) = (self.window.len(), self.levels);
        (self.carried).get_or_insert_with(|| Carried::new(pixels, levels));
    }

    /// The film in bands of `rows` rows, the last of which may have fewer, for these samples.
    pub(crate) fn bands(&mut self, rows: u32, samples: &Range<u32>) -> Vec<LevelBand<'_>> {
        if samples.clone().any(carries) {
            self.begin_to_carry();
        }
        let levels = self.levels;
        let pixels = self.window.w as usize * rows as usize;
        let stride = BATCHES * (levels + 1);
        let counts = self.counts.chunks_mut(pixels);
        let features = self.features.chunks_mut(pixels);
        let sums = self.sums.chunks_mut(pixels * stride);
        let mut carried = self.carried.as_mut().map(|carried| {
            let features = carried.features.chunks_mut(pixels);
            features.zip(carried.sums.chunks_mut(pixels * stride))
        });
        let band = |((counts, features), sums)| LevelBand {
            levels,
            counts,
            features,
            sums,
            carried: carried.as_mut().and_then(Iterator::next),
        };
        counts.zip(features).zip(sums).map(band).collect()
    }

    /// Sum of a level in a batch of a pixel; `level` = number of levels gives the shared light.
    fn sum(&self, index: usize, batch: usize, level: usize) -> Rgb {
        let at = (index * BATCHES + batch) * (self.levels + 1) + level;
        let carried = self.carried.as_ref().map_or(Rgb::ZERO, |c| c.sums[at]);
        carried + self.sums[at]
    }

    /// Means of a level by batch; `level` = number of levels gives the shared light. Black where a batch has no sample.
    #[cfg(test)]
    pub(crate) fn batch_means(&self, level: usize) -> [Buffer; BATCHES] {
        std::array::from_fn(|batch| {
            let pixel = |index: usize| self.batch_mean(index, batch, level);
            Buffer {
                width: self.window.w as usize,
                height: self.window.h as usize,
                pixels: (0..self.window.len()).map(pixel).collect(),
            }
        })
    }

    /// Mean of a level in a batch of the pixel `index`; `level` = number of levels gives the shared light. Black where
    /// the batch has no sample.
    #[inline]
    pub(crate) fn batch_mean(&self, index: usize, batch: usize, level: usize) -> Rgb {
        let n = self.counts[index][batch].max(1) as f32;
        self.sum(index, batch, level) / n
    }

    /// Mean of a level over all samples; `level` = number of levels gives the shared light. Black where there is none.
    pub fn mean(&self, level: usize) -> Buffer {
        Buffer {
            width: self.window.w as usize,
            height: self.window.h as usize,
            pixels: self.means(level).collect(),
        }
    }

    /// The pixels of [`LevelFilm::mean`], row by row.
    pub(crate) fn means(&self, level: usize) -> impl ExactSizeIterator<Item = Rgb> {
        (0..self.window.len()).map(move |index| self.mean_of(index, level))
    }

    /// The pixel `index` of [`LevelFilm::mean`].
    pub(crate) fn mean_of(&self, index: usize, level: usize) -> Rgb {
        let n: u32 = self.counts[index].iter().sum();
        let sums = (0..BATCHES).map(|batch| self.sum(index, batch, level));
        sums.sum::<Rgb>() / n.max(1) as f32
    }

    /// Means of the features.
    pub(crate) fn features(&self) -> Vec<Features> {
        self.features_of(&self.window)
    }

    /// Means of the features of a part of the window.
    pub(crate) fn features_of(&self, part: &Window) -> Vec<Features> {
        let mean = |index: usize| {
            let n = self.counts[index].iter().sum::<u32>().max(1) as f32;
            let carried = (self.carried.as_ref()).map_or([0.0; FEATURES], |c| c.features[index]);
            std::array::from_fn(|i| (carried[i] + self.features[index][i]) / n)
        };
        let rows = (0..part.h).map(|row| self.row(part, row));
        let pixels = rows.flat_map(|(first, _, w)| first..first + w);
        pixels.map(mean).collect()
    }

    /// Each batch's share of the samples of all pixels.
    pub(crate) fn shares(&self) -> [f32; BATCHES] {
        let mut sums = [0u64; BATCHES];
        for counts in &self.counts {
            let pairs = sums.iter_mut().zip(counts);
            pairs.for_each(|(sum, count)| *sum += u64::from(*count));
        }
        let all = sums.iter().sum::<u64>().max(1);
        sums.map(|sum| (sum as f64 / all as f64) as f32)
    }

    /// Number of leading batches that have samples: the number of samples, at most [`BATCHES`]. A batch counts if at
    /// most a hundredth of the pixels have no sample in it or in one before it.
    pub(crate) fn batches(&self) -> usize {
        let mut lacking = [0; BATCHES];
        for counts in &self.counts {
            let filled = counts.iter().take_while(|count| **count > 0).count();
            lacking[filled..]
                .iter_mut()
                .for_each(|lacking| *lacking += 1);
        }
        let enough = |lacking: &&usize| 100 * **lacking <= self.counts.len();
        lacking.iter().take_while(enough).count()
    }

    /// Moves the film out, and leaves one with the same levels and no pixels.
    pub(crate) fn take(&mut self) -> Self {
        let none = Window {
            h: 0,
            ..self.window
        };
        let blank = Self::new(self.size, none, self.levels);
        std::mem::replace(self, blank)
    }

    /// The first or second half of the batches, as a film of two. Its features are the means over all batches.
    pub(crate) fn half(&self, second: bool) -> Self {
        let first = if second { BATCHES / 2 } else { 0 };
        let each = self.levels + 1;
        let mut half = Self::new(self.size, self.window, self.levels);
        half.features = self.features();
        let sums = half.sums.chunks_exact_mut(BATCHES * each);
        let pixels = half.counts.iter_mut().zip(&mut half.features).zip(sums);
        for (index, ((counts, features), sums)) in pixels.enumerate() {
            for batch in 0..BATCHES / 2 {
                counts[batch] = self.counts[index][first + batch];
                for level in 0..each {
                    sums[batch * each + level] = self.sum(index, first + batch, level);
                }
            }
            // Means become sums over the half's samples.
            let count = counts.iter().sum::<u32>() as f32;
            features.iter_mut().for_each(|feature| *feature *= count);
        }
        half
    }

    /// The film with samples in the first `self.batches()` batches of every pixel and in no others. A batch of which
    /// all samples were refused gets the pixel's mean. `None` for fewer than two batches, as in films of one sample.
    pub(crate) fn complete(&self) -> Option<Cow<'_, Self>> {
        let batches = self.batches();
        if batches < 2 {
            return None;
        }
        let differs = |index: &usize| {
            let mut counts = self.counts[*index].iter().enumerate();
            counts.any(|(batch, count)| (batch < batches) != (*count > 0))
        };
        let different: Vec<usize> = (0..self.counts.len()).filter(differs).collect();
        if different.is_empty() {
            return Some(Cow::Borrowed(self));
        }
        let mut film = self.clone();
        let stride = self.levels + 1;
        for index in different {
            let n: u32 = self.counts[index].iter().sum();
            for batch in 0..BATCHES {
                let count = self.counts[index][batch];
                if (batch < batches) == (count > 0) {
                    continue;
                }
                film.counts[index][batch] = u32::from(batch < batches);
                for level in 0..stride {
                    let at = (index * BATCHES + batch) * stride + level;
                    let sums = (0..BATCHES).map(|batch| self.sum(index, batch, level));
                    film.sums[at] = match batch < batches {
                        true => sums.sum::<Rgb>() / n.max(1) as f32,
                        false => Rgb::ZERO,
                    };
                }
            }
        }
        Some(Cow::Owned(film))
    }

    /// Splits a film of one sample into two halves, as batches. Each has the light of every other pixel, as on one
    /// colour of a chessboard, and between them weighted means of the four neighbours. `weights` are for the pixels to
    /// the left, to the right, above and below. A pixel without similar neighbours has its own light in both halves.
    pub(crate) fn halves(&self, weights: &[[f32; 4]]) -> Self {
        let (stride, width) = (self.levels + 1, self.window.w as usize);
        let mut film = Self::new(self.size, self.window, self.levels);
        film.features.clone_from(&self.features);
        let count = |index: usize| self.counts[index].iter().sum::<u32>();
        let pixels = film.sums.par_chunks_mut(BATCHES * stride);
        let all = pixels.zip(&mut film.counts).zip(&mut film.features);
        all.enumerate()
            .for_each(|(index, ((sums, counts), features))| {
                let x = index % width;
                let near = [
                    (x > 0).then(|| index - 1),
                    (x + 1 < width).then_some(index + 1),
                    index.checked_sub(width),
                    Some(index + width).filter(|below| *below < self.counts.len()),
                ];
                let weights = weights[index];
                let near = || {
                    let pairs = near.iter().zip(weights);
                    let there = pairs.filter_map(|(near, weight)| Some(((*near)?, weight)));
                    there.filter(|(near, _)| count(*near) > 0)
                };
                let sum: f32 = near().map(|(_, weight)| weight).sum();
                let n = count(index).max(1) as f32;
                features.iter_mut().for_each(|feature| *feature *= 2.0 / n);
                let place = self.window.pixel(index);
                let first = ((place.x + place.y) % 2) as usize;
                for level in 0..stride {
                    let own = self.mean_of(index, level);
                    let beside = match sum > MIN_WEIGHT {
                        true => {
                            let light =
                                near().map(|(near, weight)| weight * self.mean_of(near, level));
                            light.sum::<Rgb>() / sum
                        }
                        false => own,
                    };
                    let own = if count(index) > 0 { own } else { beside };
                    sums[first * stride + level] = own;
                    sums[(1 - first) * stride + level] = beside;
                }
                counts[..2].fill(1);
            });
        film
    }

    // ── tiles ──

    /// Copies the sums of a tile. Panics if it leaves the window.
    pub(crate) fn paste(&mut self, tile: &Self) {
        let stride = BATCHES * (self.levels + 1);
        for row in 0..tile.window.h {
            let (mine, theirs, w) = self.row(&tile.window, row);
            self.counts[mine..mine + w].copy_from_slice(&tile.counts[theirs..theirs + w]);
            self.features[mine..mine + w].copy_from_slice(&tile.features[theirs..theirs + w]);
            self.sums[mine * stride..(mine + w) * stride]
                .copy_from_slice(&tile.sums[theirs * stride..(theirs + w) * stride]);
            if let Some(part) = &tile.carried {
                let (pixels, levels) = (self.window.len(), self.levels);
                let blank = || Carried::new(pixels, levels);
                let all = self.carried.get_or_insert_with(blank);
                all.copy(mine, part, theirs, w, stride);
            }
        }
    }

    /// First pixels of a row of `tile` in this film and in the tile, and its length.
    fn row(&self, tile: &Window, row: u32) -> (usize, usize, usize) {
        assert!(
            tile.inside(&self.window),
            "tile {tile:?} leaves {:?}",
            self.window
        );
        let y = (tile.y - self.window.y + row) as usize;
        let mine = y * self.window.w as usize + (tile.x - self.window.x) as usize;
        (mine, row as usize * tile.w as usize, tile.w as usize)
    }

    // ── bytes ──

    /// Writes the sums, without frame and window, which the film of level 0 stores.
    ///
    /// Little endian: the magic word, the number of levels, then by pixel four counts, eleven features and the sums,
    /// batch by batch. If sums were carried over, the magic word differs, and by pixel eleven features and the high
    /// parts follow.
    pub(crate) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let carried = self.carried.as_ref();
        out.write_all(carried.map_or(MAGIC, |_| MAGIC_CARRIED))?;
        out.write_all(&(self.levels as u32).to_le_bytes())?;
        let sums = self.sums.chunks_exact(BATCHES * (self.levels + 1));
        for ((counts, features), sums) in self.counts.iter().zip(&self.features).zip(sums) {
            for count in counts {
                out.write_all(&count.to_le_bytes())?;
            }
            write_sums(features, sums, out)?;
        }
        if let Some(Carried { features, sums }) = carried {
            let sums = sums.chunks_exact(BATCHES * (self.levels + 1));
            for (features, sums) in features.iter().zip(sums) {
                write_sums(features, sums, out)?;
            }
        }
        Ok(())
    }

    /// Reads a film of this frame and window from the front of `bytes`, and advances `bytes` past it.
    pub(crate) fn read(
        size: UVec2,
        window: Window,
        bytes: &mut &[u8],
    ) -> Result<Self, &'static str> {
        let cut = || "the levels are cut short";
        let (magic, rest) = bytes.split_first_chunk::<8>().ok_or_else(cut)?;
        let is_carried = magic == MAGIC_CARRIED;
        if magic != MAGIC && !is_carried {
            return Err("no levels, or of another version");
        }
        let (levels, rest) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
        let levels = u32::from_le_bytes(*levels) as usize;
        if !(1..=MAX_LEVELS).contains(&levels) {
            return Err("a level is missing, or there are too many");
        }
        // Checked before memory is allocated.
        let length = usize::try_from(Self::bytes(window.len(), levels)).map_err(|_| cut())?;
        let (pixels, mut rest) = rest.split_at_checked(length).ok_or_else(cut)?;
        let stride = BATCHES * (levels + 1);
        let mut carried_pixels: &[u8] = &[];
        if is_carried {
            let length = length - window.len() * size_of::<[u32; BATCHES]>();
            (carried_pixels, rest) = rest.split_at_checked(length).ok_or_else(cut)?;
        }
        let mut film = Self::new(size, window, levels);
        film.carried = is_carried.then(|| Carried::new(window.len(), levels));
        if let Some(Carried { features, sums }) = &mut film.carried {
            let each = carried_pixels.chunks_exact(4 * (FEATURES + 3 * stride));
            let pairs = features.iter_mut().zip(sums.chunks_exact_mut(stride));
            for ((features, sums), pixel) in pairs.zip(each) {
                read_sums(pixel.as_chunks::<4>().0, features, sums)?;
                check_light(sums)?;
            }
        }
        let each = pixels.chunks_exact(4 * (BATCHES + FEATURES + 3 * stride));
        for (index, pixel) in each.enumerate() {
            let (words, _) = pixel.as_chunks::<4>();
            let (counts, rest) = words.split_at(BATCHES);
            let sums = &mut film.sums[index * stride..(index + 1) * stride];
            read_sums(rest, &mut film.features[index], sums)?;
            // Low parts of carried sums are rounding errors of either sign.
            if !is_carried {
                check_light(sums)?;
            }
            for (count, word) in film.counts[index].iter_mut().zip(counts) {
                *count = u32::from_le_bytes(*word);
            }
        }
        *bytes = rest;
        Ok(film)
    }
}

/// Writes features and sums of a pixel.
fn write_sums(features: &Features, sums: &[Rgb], out: &mut impl Write) -> io::Result<()> {
    let sums = sums.iter().flat_map(|sum| sum.to_array());
    for x in features.iter().copied().chain(sums) {
        out.write_all(&x.to_le_bytes())?;
    }
    Ok(())
}

/// Reads features and sums as [`write_sums`] writes them.
fn read_sums(
    words: &[[u8; 4]],
    features: &mut Features,
    sums: &mut [Rgb],
) -> Result<(), &'static str> {
    let (first, rest) = words.split_at(FEATURES);
    for (feature, word) in features.iter_mut().zip(first) {
        *feature = f32::from_le_bytes(*word);
    }
    let (rest, _) = rest.as_chunks::<3>();
    for (sum, rgb) in sums.iter_mut().zip(rest) {
        *sum = Rgb::from_array(rgb.map(f32::from_le_bytes));
    }
    match are_finite(features) && sums.iter().all(|sum| sum.is_finite()) {
        true => Ok(()),
        false => Err("sums of the levels are not finite"),
    }
}

/// An error for light that is negative.
fn check_light(sums: &[Rgb]) -> Result<(), &'static str> {
    match sums.iter().all(|sum| sum.min_element() >= 0.0) {
        true => Ok(()),
        false => Err("sums of the levels are negative"),
    }
}

#[cfg(test)]
mod tests;
