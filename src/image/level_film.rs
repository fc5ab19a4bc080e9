//! Sums of several levels of roughening of the same paths, in batches, of the light that they share, and of features for
//! their blur.
//!
//! Sample number n belongs to batch n mod [`BATCHES`]: so batches are equally long, up to one sample, wherever a render
//! stops, and a render that is resumed goes on with the same batches. A sample with a level that is not finite is left out
//! at all levels, so that they stay averages over the same paths; the film of level 0 reports it.
//!
//! Sums are single precision: 12 bytes a level and batch, and as much for the shared light, 320 bytes a pixel for five
//! levels with counts and features. The film of level 0 beside them has double precision.

use super::Buffer;
use super::film::Window;
use crate::math::{Rgb, UVec2};
use std::io::{self, Write};

/// Independent batches.
pub const BATCHES: usize = 4;

/// Most levels of a film.
pub const MAX_LEVELS: usize = 8;

const MAGIC: &[u8; 8] = b"opsrlvl2";

/// Values of one path.
#[derive(Clone, Copy, Debug)]
pub struct PathLevels<'a> {
    /// Radiance at every level.
    pub levels: &'a [Rgb],
    /// Radiance that no level roughens.
    pub shared: Rgb,
    /// Normal of the first rough vertex and the path's length to it.
    pub features: [f32; 4],
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
    features: Vec<[f32; 4]>,
    /// Sums by pixel, batch and level, levels fastest, the shared light after the last.
    sums: Vec<Rgb>,
}

impl LevelFilm {
    /// An empty film of a window of the frame.
    pub fn new(size: UVec2, window: Window, levels: usize) -> Self {
        Self {
            size,
            window,
            levels,
            counts: vec![[0; BATCHES]; window.len()],
            features: vec![[0.0; 4]; window.len()],
            sums: vec![Rgb::ZERO; window.len() * BATCHES * (levels + 1)],
        }
    }

    /// Bytes that a film of so many pixels takes, beside the film of level 0.
    pub fn bytes(pixels: usize, levels: usize) -> u64 {
        let each = size_of::<[u32; BATCHES]>()
            + size_of::<[f32; 4]>()
            + BATCHES * (levels + 1) * size_of::<Rgb>();
        pixels as u64 * each as u64
    }

    /// Bytes before the pixels in [`LevelFilm::write`].
    pub const HEAD: u64 = 12;

    /// Numbers of a pixel in [`LevelFilm::sample`].
    pub fn sample_numbers(levels: usize) -> usize {
        3 * (levels + 1) + 4
    }

    /// Numbers of a sample in a film that has no other, by pixel: levels, shared light and features. Not numbers where it was
    /// left out.
    pub fn sample(&self, sample: u32) -> impl Iterator<Item = f32> + '_ {
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
    pub fn window(&self) -> Window {
        self.window
    }

    /// Adds the path of `sample` to the pixel with this index.
    #[inline]
    pub fn push(&mut self, index: usize, sample: u32, path: &PathLevels<'_>) {
        if !path.levels.iter().all(|v| v.is_finite()) || !path.shared.is_finite() {
            return;
        }
        let batch = sample as usize % BATCHES;
        let at = (index * BATCHES + batch) * (self.levels + 1);
        self.counts[index][batch] += 1;
        for (sum, value) in self.sums[at..at + self.levels].iter_mut().zip(path.levels) {
            *sum += *value;
        }
        self.sums[at + self.levels] += path.shared;
        for (sum, value) in self.features[index].iter_mut().zip(path.features) {
            *sum += value;
        }
    }

    /// Means by batch of a level, or of the shared light by the number of levels; black where a batch has no sample.
    pub fn batch_means(&self, level: usize) -> [Buffer; BATCHES] {
        std::array::from_fn(|batch| {
            let pixel = |index: usize| {
                let n = self.counts[index][batch].max(1) as f32;
                self.sums[(index * BATCHES + batch) * (self.levels + 1) + level] / n
            };
            Buffer {
                width: self.window.w as usize,
                height: self.window.h as usize,
                pixels: (0..self.window.len()).map(pixel).collect(),
            }
        })
    }

    /// Mean over all samples of a level, or of the shared light by the number of levels; black where there is none.
    pub fn mean(&self, level: usize) -> Buffer {
        let pixel = |index: usize| {
            let n: u32 = self.counts[index].iter().sum();
            let at = |b: usize| (index * BATCHES + b) * (self.levels + 1) + level;
            let sums = (0..BATCHES).map(|b| self.sums[at(b)]);
            sums.sum::<Rgb>() / n.max(1) as f32
        };
        Buffer {
            width: self.window.w as usize,
            height: self.window.h as usize,
            pixels: (0..self.window.len()).map(pixel).collect(),
        }
    }

    /// Means of the features: normal and length.
    pub fn features(&self) -> Vec<[f32; 4]> {
        let pairs = self.features.iter().zip(&self.counts);
        let mean = |(sum, counts): (&[f32; 4], &[u32; BATCHES])| {
            let n = counts.iter().sum::<u32>().max(1) as f32;
            sum.map(|s| s / n)
        };
        pairs.map(mean).collect()
    }

    /// The fewest samples that a batch of a pixel has.
    pub fn least_samples(&self) -> u32 {
        self.counts.iter().flatten().copied().min().unwrap_or(0)
    }

    // ── tiles ──

    /// A film of `tile` with this film's sums so far. Panics if the tile leaves the window.
    pub fn cut(&self, tile: Window) -> Self {
        let mut cut = Self::new(self.size, tile, self.levels);
        let stride = BATCHES * (self.levels + 1);
        for row in 0..tile.h {
            let (mine, theirs, w) = self.row(&tile, row);
            cut.counts[theirs..theirs + w].copy_from_slice(&self.counts[mine..mine + w]);
            cut.features[theirs..theirs + w].copy_from_slice(&self.features[mine..mine + w]);
            cut.sums[theirs * stride..(theirs + w) * stride]
                .copy_from_slice(&self.sums[mine * stride..(mine + w) * stride]);
        }
        cut
    }

    /// Puts a tile made by [`LevelFilm::cut`] back.
    pub fn paste(&mut self, tile: &Self) {
        let stride = BATCHES * (self.levels + 1);
        for row in 0..tile.window.h {
            let (mine, theirs, w) = self.row(&tile.window, row);
            self.counts[mine..mine + w].copy_from_slice(&tile.counts[theirs..theirs + w]);
            self.features[mine..mine + w].copy_from_slice(&tile.features[theirs..theirs + w]);
            self.sums[mine * stride..(mine + w) * stride]
                .copy_from_slice(&tile.sums[theirs * stride..(theirs + w) * stride]);
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

    /// Writes the sums; frame and window are those of the film of level 0.
    ///
    /// Little endian: the magic word, the number of levels, then by pixel four counts, four features and the sums, batch
    /// by batch.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        out.write_all(MAGIC)?;
        out.write_all(&(self.levels as u32).to_le_bytes())?;
        let sums = self.sums.chunks_exact(BATCHES * (self.levels + 1));
        for ((counts, features), sums) in self.counts.iter().zip(&self.features).zip(sums) {
            for count in counts {
                out.write_all(&count.to_le_bytes())?;
            }
            let sums = sums.iter().flat_map(|sum| sum.to_array());
            for x in features.iter().copied().chain(sums) {
                out.write_all(&x.to_le_bytes())?;
            }
        }
        Ok(())
    }

    /// Takes a film of this frame and window from the front of `bytes`.
    pub fn read(size: UVec2, window: Window, bytes: &mut &[u8]) -> Result<Self, &'static str> {
        let cut = || "the levels are cut short";
        let (magic, rest) = bytes.split_first_chunk::<8>().ok_or_else(cut)?;
        if magic != MAGIC {
            return Err("no levels, or of another version");
        }
        let (levels, rest) = rest.split_first_chunk::<4>().ok_or_else(cut)?;
        let levels = u32::from_le_bytes(*levels) as usize;
        if !(2..=MAX_LEVELS).contains(&levels) {
            return Err("a level is missing, or there are too many");
        }
        // Compared before memory is taken.
        let length = usize::try_from(Self::bytes(window.len(), levels)).map_err(|_| cut())?;
        let (pixels, rest) = rest.split_at_checked(length).ok_or_else(cut)?;
        let mut film = Self::new(size, window, levels);
        let stride = BATCHES * (levels + 1);
        let each = pixels.chunks_exact(4 * (BATCHES + 4 + 3 * stride));
        for (index, pixel) in each.enumerate() {
            let (words, _) = pixel.as_chunks::<4>();
            let (counts, rest) = words.split_at(BATCHES);
            let (features, sums) = rest.split_at(4);
            for (feature, word) in film.features[index].iter_mut().zip(features) {
                *feature = f32::from_le_bytes(*word);
            }
            for (count, word) in film.counts[index].iter_mut().zip(counts) {
                *count = u32::from_le_bytes(*word);
            }
            let (sums, _) = sums.as_chunks::<3>();
            for (sum, rgb) in film.sums[index * stride..].iter_mut().zip(sums) {
                *sum = Rgb::from_array(rgb.map(f32::from_le_bytes));
            }
        }
        *bytes = rest;
        Ok(film)
    }
}
