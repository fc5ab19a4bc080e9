//! A film records independent estimates: each pixel holds the running [`Moments`] of its samples.
//!
//! Path tracing pushes one value per sample; an integrator that splats accumulates a pass and pushes one value per
//! pass. A tile is a film too, with a smaller window: [`Film::cut`] it out with the moments so far, push to it on
//! any thread, and put the tiles back in order. So a render is bitwise the same at any number of threads, and several
//! passes are bitwise one long pass.
//!
//! A sample that is not finite is never turned black: it is refused, counted by cause and listed.

use crate::image::Buffer;
use crate::image::batches::{BATCHES, Sharing};
use crate::math::moments::Moments;
use crate::math::{DVec3, Rgb, UVec2};

/// Pictures above this number of pixels are refused before memory is taken for them.
pub(crate) const MAX_PIXELS: usize = 1 << 28;

/// A rectangle of pixels in the full frame, rows from the top.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Window {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub w: u32,
    /// Rows.
    pub h: u32,
}

impl std::fmt::Display for Window {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { x, y, w, h } = self;
        write!(out, "{w}x{h} pixels at ({x}, {y})")
    }
}

impl Window {
    /// The whole frame.
    pub fn full(size: UVec2) -> Self {
        Self {
            x: 0,
            y: 0,
            w: size.x,
            h: size.y,
        }
    }

    /// True if the window is not empty and lies inside `outer`.
    pub fn inside(&self, outer: &Self) -> bool {
        let end = |a: u32, b: u32| u64::from(a) + u64::from(b);
        self.w > 0
            && self.h > 0
            && self.x >= outer.x
            && self.y >= outer.y
            && end(self.x, self.w) <= end(outer.x, outer.w)
            && end(self.y, self.h) <= end(outer.y, outer.h)
    }

    /// The pixels of both windows, if there are any.
    pub fn intersection(&self, other: &Self) -> Option<Self> {
        let (x, y) = (self.x.max(other.x), self.y.max(other.y));
        let end = |a: u32, b: u32, c: u32, d: u32| a.saturating_add(b).min(c.saturating_add(d));
        let w = end(self.x, self.w, other.x, other.w).saturating_sub(x);
        let h = end(self.y, self.h, other.y, other.h).saturating_sub(y);
        (w > 0 && h > 0).then_some(Self { x, y, w, h })
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.w as usize * self.h as usize
    }

    /// True if there is no pixel.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Full-frame pixel of the window's pixel `index`, which counts row by row.
    pub fn pixel(&self, index: usize) -> UVec2 {
        let w = self.w as usize;
        UVec2::new(self.x + (index % w) as u32, self.y + (index / w) as u32)
    }

    /// Index of a full-frame pixel that is in the window: the inverse of [`Window::pixel`].
    pub(crate) fn index(&self, pixel: UVec2) -> usize {
        (pixel.y - self.y) as usize * self.w as usize + (pixel.x - self.x) as usize
    }

    /// Cuts the window into tiles of at most `edge` pixels a side, row by row.
    pub fn tiles(&self, edge: u32) -> Vec<Self> {
        let edge = edge.max(1);
        let mut tiles = Vec::new();
        for dy in (0..self.h).step_by(edge as usize) {
            for dx in (0..self.w).step_by(edge as usize) {
                tiles.push(Self {
                    x: self.x + dx,
                    y: self.y + dy,
                    w: edge.min(self.w - dx),
                    h: edge.min(self.h - dy),
                });
            }
        }
        tiles
    }
}

/// Reason to refuse a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Cause {
    /// A channel is not a number.
    Nan,
    /// A channel is infinite and none is not a number.
    Infinite,
}

impl Cause {
    /// `None` for a finite value.
    pub(crate) fn of(value: Rgb) -> Option<Self> {
        if value.is_finite() {
            None
        } else if value.is_nan() {
            Some(Self::Nan)
        } else {
            Some(Self::Infinite)
        }
    }
}

/// A refused sample, enough to trace it again alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RejectedSample {
    /// Pixel in the full frame.
    pub pixel: UVec2,
    /// Number of the sample within the pixel.
    pub sample: u32,
    /// The reason.
    pub(crate) cause: Cause,
}

/// Refused samples of a film: counts by cause, and the first few by pixel and number.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Rejected {
    /// Samples with a channel that is not a number.
    pub nan: u64,
    /// Samples with an infinite channel.
    pub infinite: u64,
    /// The first `Rejected::REMEMBERED` refused samples.
    pub first: Vec<RejectedSample>,
}

impl Rejected {
    /// Number of refused samples that are listed.
    pub(crate) const REMEMBERED: usize = 8;

    /// All refused samples.
    pub fn total(&self) -> u64 {
        self.nan + self.infinite
    }

    /// Counts a refused sample, and lists it if it is among the first.
    pub(crate) fn add(&mut self, sample: RejectedSample) {
        match sample.cause {
            Cause::Nan => self.nan += 1,
            Cause::Infinite => self.infinite += 1,
        }
        if self.first.len() < Self::REMEMBERED {
            self.first.push(sample);
        }
    }

    fn append(&mut self, other: &Self) {
        self.nan += other.nan;
        self.infinite += other.infinite;
        let room = Self::REMEMBERED - self.first.len().min(Self::REMEMBERED);
        self.first.extend(other.first.iter().take(room));
    }
}

/// An invalid film, or two films that do not match.
#[derive(Debug, thiserror::Error)]
pub enum FilmError {
    /// The window is empty or not inside the frame.
    #[error("the window of {window} is empty or not inside the picture of {outer}")]
    Window {
        /// The requested window.
        window: Window,
        /// The window that must contain it.
        outer: Window,
    },
    /// A window of more than `MAX_PIXELS`.
    #[error("{}x{} pixels are more than {MAX_PIXELS}", window.w, window.h)]
    TooLarge {
        /// The requested window.
        window: Window,
    },
    /// Two films that should have the same frame and window do not.
    #[error("films differ in frame or window: {} of {}x{} and {} of {}x{}", a.1, a.0.x, a.0.y, b.1, b.0.x, b.0.y)]
    Differ {
        /// Frame and window of the first.
        a: (UVec2, Window),
        /// Frame and window of the second.
        b: (UVec2, Window),
    },
    /// Stored numbers that are not `Film::NUMBERS` for each pixel of the window.
    #[error("{numbers} numbers for the {}x{} pixels of a film", window.w, window.h)]
    Numbers {
        /// Count of stored numbers.
        numbers: usize,
        /// The window.
        window: Window,
    },
    /// Stored numbers that no samples give: negative, not finite, or a count that is not an integer.
    #[error("count, mean or variance of pixel {}, {} of the film are not numbers from 0 on", pixel.x, pixel.y)]
    InvalidMoments {
        /// Column and row within the frame.
        pixel: UVec2,
    },
}

/// Adds a value to a pixel's moments, or refuses it if it is not finite.
#[inline]
fn push(
    moments: &mut Moments,
    rejected: &mut Rejected,
    value: Rgb,
    sample: u32,
    pixel: impl FnOnce() -> UVec2,
) {
    match Cause::of(value) {
        None => moments.push(value.as_dvec3()),
        Some(cause) => rejected.add(RejectedSample {
            pixel: pixel(),
            sample,
            cause,
        }),
    }
}

/// Rows of a film, so that several threads can add samples to different rows.
pub(crate) struct FilmBand<'a> {
    /// The rows.
    pub(crate) window: Window,
    pixels: &'a mut [Moments],
    /// Samples that were refused.
    pub(crate) rejected: Rejected,
}

impl FilmBand<'_> {
    /// [`Film::push`] by the index in the band.
    #[inline]
    pub(crate) fn push(&mut self, index: usize, value: Rgb, sample: u32) {
        let pixel = || self.window.pixel(index);
        push(
            &mut self.pixels[index],
            &mut self.rejected,
            value,
            sample,
            pixel,
        );
    }
}

/// Largest single-precision number, the bound of pixels in a file.
pub(crate) const LARGEST: DVec3 = DVec3::splat(f32::MAX as f64);

/// Running moments of every pixel in a window of the frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Film {
    /// Full frame in pixels.
    pub size: UVec2,
    /// The part of the frame that is recorded.
    pub window: Window,
    /// `window.len()` pixels, row by row.
    pub pixels: Vec<Moments>,
    /// Samples that were refused.
    pub rejected: Rejected,
    /// Noise that is correlated between pixels.
    pub sharing: Sharing,
}

impl Film {
    /// An empty film of the whole frame.
    ///
    /// ```
    /// use opsr::image::film::Film;
    /// use opsr::math::{Rgb, UVec2};
    /// let mut film = Film::new(UVec2::new(4, 3));
    /// film.push(5, Rgb::ONE, 0);
    /// film.push(5, Rgb::splat(f32::NAN), 1);
    /// assert_eq!((film.pixels[5].n, film.rejected.nan), (1, 1));
    /// ```
    pub fn new(size: UVec2) -> Self {
        Self::empty(size, Window::full(size))
    }

    /// An empty film of a part of the frame.
    pub fn cropped(size: UVec2, window: Window) -> Result<Self, FilmError> {
        Self::check(size, window)?;
        Ok(Self::empty(size, window))
    }

    /// The checks of [`Film::cropped`].
    pub(crate) fn check(size: UVec2, window: Window) -> Result<(), FilmError> {
        let outer = Window::full(size);
        if !window.inside(&outer) {
            return Err(FilmError::Window { window, outer });
        }
        if window.len() > MAX_PIXELS {
            return Err(FilmError::TooLarge { window });
        }
        Ok(())
    }

    fn empty(size: UVec2, window: Window) -> Self {
        Self {
            size,
            window,
            pixels: vec![Moments::default(); window.len()],
            rejected: Rejected::default(),
            sharing: Sharing::None,
        }
    }

    /// Adds the value of `sample` to `pixels[index]`, or refuses it if it is not finite.
    #[inline]
    pub fn push(&mut self, index: usize, value: Rgb, sample: u32) {
        let pixel = || self.window.pixel(index);
        push(
            &mut self.pixels[index],
            &mut self.rejected,
            value,
            sample,
            pixel,
        );
    }

    /// [`Film::push`] for an estimator whose pixels share light paths: also adds the value to the batch of its sample.
    #[inline]
    pub(crate) fn push_shared(&mut self, index: usize, value: Rgb, sample: u32) {
        if let Sharing::None = self.sharing {
            self.sharing = Sharing::Batches(Box::default());
        }
        if let Sharing::Batches(batches) = &mut self.sharing
            && value.is_finite()
        {
            batches.add(value, sample);
        }
        self.push(index, value, sample);
    }

    /// Standard error of the mean of all pixels by channel: from the variances of independent pixels, or from sums over
    /// whole samples where pixels share light paths. `None` with too few samples, or if shared noise is unknown.
    /// Beside it the number of batches of samples from which shared noise is known.
    pub fn mean_error(&self) -> Option<(DVec3, usize)> {
        let samples = self.pixels.iter().map(|m| m.n as usize).max();
        let batches = samples.unwrap_or(0).min(BATCHES);
        let error = match &self.sharing {
            Sharing::None if self.pixels.iter().all(|m| m.n > 1) => {
                let variance: DVec3 = self.pixels.iter().map(Moments::variance_of_mean).sum();
                Some(variance.powf(0.5) / self.pixels.len() as f64)
            }
            Sharing::Batches(batches) => {
                let known = self.pixels.iter().map(|m| u64::from(m.n)).sum::<u64>();
                batches.error().filter(|_| batches.count() == known)
            }
            Sharing::Stated(error) => Some(*error),
            _ => None,
        };
        error.map(|error| (error, batches))
    }

    /// Norm of [`Film::mean_error`] over the norm of the mean, across channels: 0.01 for a mean known to 1 %.
    pub(crate) fn relative_mean_error(&self) -> Option<f64> {
        let sum: DVec3 = self.pixels.iter().map(|m| m.mean).sum();
        let mean = sum.length() / self.pixels.len() as f64;
        (self.mean_error())
            .filter(|_| mean > 0.0)
            .map(|(error, _)| error.length() / mean)
    }

    // ── tiles ──

    /// The window cut into tiles of at most `edge` pixels a side, row by row.
    pub(crate) fn tiles(&self, edge: u32) -> Vec<Window> {
        self.window.tiles(edge)
    }

    /// A film of `tile` with this film's moments so far and no refusals. Shared noise becomes [`Sharing::Unknown`].
    /// Panics if the tile leaves the window.
    pub fn cut(&self, tile: Window) -> Self {
        let mut cut = Self::empty(self.size, tile);
        if self.sharing != Sharing::None {
            cut.sharing = Sharing::Unknown;
        }
        for row in 0..tile.h {
            let (mine, theirs) = self.row_ranges(&tile, row);
            cut.pixels[theirs].copy_from_slice(&self.pixels[mine]);
        }
        cut
    }

    /// Puts a tile made by [`Film::cut`] back: replaces its pixels and adds its refusals. Ignores its shared noise.
    pub(crate) fn paste(&mut self, tile: &Self) {
        for row in 0..tile.window.h {
            let (mine, theirs) = self.row_ranges(&tile.window, row);
            self.pixels[mine].copy_from_slice(&tile.pixels[theirs]);
        }
        self.rejected.append(&tile.rejected);
    }

    /// Index ranges of one row of `tile` in this film and in the tile.
    fn row_ranges(
        &self,
        tile: &Window,
        row: u32,
    ) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        assert!(
            tile.inside(&self.window),
            "tile {tile:?} leaves {:?}",
            self.window
        );
        let w = tile.w as usize;
        let y = (tile.y - self.window.y + row) as usize;
        let start = y * self.window.w as usize + (tile.x - self.window.x) as usize;
        (start..start + w, row as usize * w..(row as usize + 1) * w)
    }

    /// The film in bands of `rows` rows; the last may have fewer. Pass the refusals of each to [`Film::refuse`].
    pub(crate) fn bands(&mut self, rows: u32) -> impl Iterator<Item = FilmBand<'_>> {
        let all = self.window;
        let pixels = self.pixels.chunks_mut(all.w as usize * rows as usize);
        let first = (0..all.h).step_by(rows as usize);
        pixels.zip(first).map(move |(pixels, row)| FilmBand {
            window: Window {
                y: all.y + row,
                h: rows.min(all.h - row),
                ..all
            },
            pixels,
            rejected: Rejected::default(),
        })
    }

    /// Adds the refusals of a band.
    pub(crate) fn refuse(&mut self, refused: &Rejected) {
        self.rejected.append(refused);
    }

    // ── checkpoints ──

    /// Count of numbers per pixel in [`Film::numbers`].
    pub(crate) const NUMBERS: usize = 7;

    /// The pixels as numbers, for a checkpoint: count, mean, sum of squared deviations. Refusals are not part of them.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> {
        self.pixels.iter().flat_map(|m| {
            let (a, b) = (m.mean, m.m2());
            [f64::from(m.n), a.x, a.y, a.z, b.x, b.y, b.z]
        })
    }

    /// The film of these [`Film::numbers`], without refusals.
    pub(crate) fn from_numbers(
        size: UVec2,
        window: Window,
        numbers: &[f64],
    ) -> Result<Self, FilmError> {
        let (pixels, rest) = numbers.as_chunks::<{ Self::NUMBERS }>();
        // Compared before memory is allocated: a damaged window could declare any size.
        if pixels.len() != window.len() || !rest.is_empty() {
            let numbers = numbers.len();
            return Err(FilmError::Numbers { numbers, window });
        }
        let mut film = Self::cropped(size, window)?;
        for (i, (m, &parts)) in film.pixels.iter_mut().zip(pixels).enumerate() {
            let [n, ax, ay, az, bx, by, bz] = parts;
            let counts = n <= f64::from(u32::MAX) && n.fract() == 0.0;
            if !counts || parts.iter().any(|x| !x.is_finite() || *x < 0.0) {
                let pixel = window.pixel(i);
                return Err(FilmError::InvalidMoments { pixel });
            }
            let (mean, m2) = (DVec3::new(ax, ay, az), DVec3::new(bx, by, bz));
            *m = Moments::from_parts(n as u32, mean, m2);
        }
        Ok(film)
    }

    // ── pictures ──

    /// The picture: the mean of each pixel; black where there is no sample.
    pub fn mean(&self) -> Buffer {
        self.picture(|m| m.mean)
    }

    /// Estimated variance of one sample. Variances above the largest single-precision number become that number; see
    /// [`Film::clipped_variances`].
    pub(crate) fn sample_variance(&self) -> Buffer {
        self.picture(|m| m.sample_variance().min(LARGEST))
    }

    /// Estimated variance of the mean: the squared error bar of the picture. Variances above the largest
    /// single-precision number become that number; see [`Film::clipped_variances`].
    pub fn variance_of_mean(&self) -> Buffer {
        self.picture(|m| m.variance_of_mean().min(LARGEST))
    }

    /// Number of pixels with a sample variance above the largest single-precision number.
    pub fn clipped_variances(&self) -> usize {
        let clipped = |m: &&Moments| m.sample_variance().cmpgt(LARGEST).any();
        self.pixels.iter().filter(clipped).count()
    }

    fn picture(&self, f: impl Fn(&Moments) -> DVec3) -> Buffer {
        Buffer {
            width: self.window.w as usize,
            height: self.window.h as usize,
            pixels: self.pixels.iter().map(|m| f(m).as_vec3()).collect(),
        }
    }
}
