//! Test that two films show the same picture up to their noise, at three scales: pixels, tiles, the whole image.
//!
//! Each scale detects what the others cannot. A test of single pixels alone accepts a uniform error of 15 %, a test of
//! the whole image alone a small wrong part. At each place and channel Welch's t-test compares the means, with the
//! variance of the films themselves. Šidák's correction makes the chance that two equal pictures fail `SIGNIFICANCE`
//! for all tests together.
//!
//! Few samples with heavy tails, such as caustics, have means for which Welch's test does not hold. A pixel without a
//! rare hit has a wrong mean and a small variance. So two more tests must agree that a place differs:
//!
//! - Tiles and image: the differences dᵢ of pixels are independent, and symmetric about 0 where both films have the same
//!   estimator and number of samples. Then P(|Σ dᵢ| ≥ x √Σ dᵢ²) ≤ 2 exp(−x²/2), for any tails and any number of samples
//!   (Efron 1969, by Hoeffding's inequality over the signs).
//! - Pixels: Welch's test again with the mean variance of the pixel's tile.
//!
//! Measured on 300 pairs of equal renders of `cornell_caustics`, 64 × 64 pixels: none failed with 8, 16 or 64 samples.
//! A picture 10 % too bright failed in 21, 95 and 100 % of the pairs; a picture 2 % too bright in none. With Welch's
//! test alone, rare hits against films of the same mean without rare hits failed in every pair.

//!
//! Bidirectional estimators share light paths between pixels. The variance of each pixel is right, but sums of pixels
//! are noisier. The standard error of the image mean is 1.4 to 2.5 times that of independent pixels, and more for
//! photons of a large radius. For such a film the test of the image uses the standard error of its mean
//! ([`Film::mean_error`]). Tiles are not tested, because the covariance within them is unknown.

use std::fmt;

use super::student;
use opsr::image::batches::Sharing;
use opsr::image::film::{Film, FilmError, Window};
use opsr::math::DVec3;
use opsr::math::moments::Moments;

/// Chance that two films of the same picture fail [`agree`].
pub(crate) const SIGNIFICANCE: f64 = 0.01;

/// Edge of the tiles of the middle scale, in pixels.
pub(crate) const TILE: u32 = 8;

/// Relative rounding error by which two correct estimators may differ.
const ROUNDING: f64 = 1e-6;

/// One comparison of two means.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// Place in the full frame.
    pub window: Window,
    /// Colour channel.
    pub channel: usize,
    /// Mean in the first film.
    pub a: f64,
    /// Mean in the second.
    pub b: f64,
    /// Their difference in standard errors.
    pub t: f64,
    /// Chance of a deviation this large between equal pictures.
    pub p: f64,
}

/// All comparisons at one scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Scale {
    /// Number of comparisons.
    pub tests: usize,
    /// The smallest chance (p-value) at which a comparison passes.
    pub threshold: f64,
    /// The comparison with the least chance; none if there was nothing to compare.
    pub worst: Option<Deviation>,
}

impl Scale {
    /// True if there were comparisons and all pass.
    pub fn passed(&self) -> bool {
        self.worst.is_some_and(|w| w.p >= self.threshold)
    }
}

/// The outcome of [`agree`]. Its text shows the worst place of each scale.
#[derive(Clone, Debug, PartialEq)]
pub struct Agreement {
    /// Single pixels.
    pub pixels: Scale,
    /// Tiles of `TILE` pixels.
    pub tiles: Scale,
    /// The whole image.
    pub image: Scale,
    /// Pixels that are left out of all scales, with fewer than two samples in one of the films.
    pub untested: usize,
    /// True if pixels of a film share light paths: tiles then have more noise than their pixels imply.
    pub shared: bool,
    /// True if the errors of both means are known, so that the image is judged.
    pub mean_known: bool,
}

impl Agreement {
    /// True if the films agree at every scale, with at least half of the pixels tested.
    pub fn passed(&self) -> bool {
        let tested = self.pixels.tests / 3;
        let judged = |(_, scale, judged): (&str, &Scale, bool)| !judged || scale.passed();
        tested >= self.untested && self.scales().into_iter().all(judged)
    }

    /// Scales with their names; true for a scale that is judged.
    fn scales(&self) -> [(&'static str, &Scale, bool); 3] {
        [
            ("pixels", &self.pixels, true),
            ("tiles", &self.tiles, !self.shared),
            ("image", &self.image, self.mean_known),
        ]
    }
}

impl fmt::Display for Agreement {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, scale, judged) in self.scales() {
            let verdict = match scale.passed() {
                true => "agree",
                false if judged => "DIFFER",
                false => "differ by more than independent pixels would, not judged",
            };
            write!(out, "{name}: {verdict} in {} tests", scale.tests)?;
            if let Some(w) = scale.worst {
                let place = w.window;
                write!(out, "; worst at ({}, {})", place.x, place.y)?;
                write!(out, " channel {}: {:.6} and {:.6}", w.channel, w.a, w.b)?;
                write!(
                    out,
                    ", t = {:.2}, p = {:.1e} against {:.1e}",
                    w.t, w.p, scale.threshold
                )?;
            }
            writeln!(out)?;
        }
        write!(out, "untested pixels: {}", self.untested)
    }
}

/// Compares two films of independent samples at three scales, at `SIGNIFICANCE` for all together.
///
/// ```
/// use opsr::image::Film;
/// use opsr::math::{Rgb, UVec2};
/// use opsr_lab::stats::agreement::agree;
/// let film = |offset: f32| {
///     let mut film = Film::new(UVec2::new(16, 16));
///     for i in 0..256 {
///         for s in 0..64u32 {
///             let wave = ((i as u32 * 64 + s) as f32 * 0.618).fract();
///             film.push(i, Rgb::splat(offset + wave), s);
///         }
///     }
///     film
/// };
/// assert!(agree(&film(0.0), &film(0.0)).unwrap().passed());
/// assert!(!agree(&film(0.0), &film(0.1)).unwrap().passed());
/// ```
pub fn agree(a: &Film, b: &Film) -> Result<Agreement, FilmError> {
    let [a_place, b_place] = [a, b].map(|film| (film.size, film.window));
    match a_place == b_place {
        true => Ok(compare(a, b)),
        false => Err(FilmError::Differ {
            a: a_place,
            b: b_place,
        }),
    }
}

/// The known noise of a film's mean.
#[derive(Clone, Copy)]
enum Known {
    /// The noise of independent pixels.
    Pixels,
    /// The squared standard error, and its degrees of freedom.
    Whole(DVec3, f64),
    /// The noise is not known.
    Nothing,
}

impl Known {
    fn of(film: &Film) -> Self {
        if film.sharing == Sharing::None {
            return Self::Pixels;
        }
        match film.mean_error() {
            Some((error, batches)) if batches > 1 => {
                Self::Whole(error * error, (batches - 1) as f64)
            }
            _ => Self::Nothing,
        }
    }

    /// Replaces the noise computed from independent pixels.
    fn apply(self, sum: &mut Estimate, pixels: usize) {
        if let Self::Whole(square, degrees) = self {
            let pixels = pixels as f64;
            sum.variance = square * (pixels * pixels);
            sum.spread = sum.variance * sum.variance / degrees;
        }
    }
}

/// Sum of the means of one film's pixels at a place, and its error.
#[derive(Clone, Copy, Default)]
struct Estimate {
    sum: DVec3,
    /// Σ v, the squared standard error of `sum`.
    variance: DVec3,
    /// Σ v² / (n − 1), for Welch and Satterthwaite's degrees of freedom.
    spread: DVec3,
}

/// Least number of pixels at which the signs of their differences are a test.
const SIGNS: usize = (TILE * TILE) as usize;

impl Estimate {
    fn new(mean: DVec3, variance: DVec3, degrees: u32) -> Self {
        Self {
            sum: mean,
            variance,
            spread: variance * variance / f64::from(degrees),
        }
    }

    fn add(&mut self, other: &Self) {
        self.sum += other.sum;
        self.variance += other.variance;
        self.spread += other.spread;
    }

    /// Variance and spread in a channel if the true value is `other`'s.
    ///
    /// Samples of light are often rare hits. A pixel with few hits by chance has a low mean *and* a low variance, and
    /// so looks far too certain. The variance of hits grows with the mean, so the darker estimate gets the variance
    /// that it would have at the brighter value.
    fn at_least(&self, other: &Self, channel: usize) -> (f64, f64) {
        let (own, other) = (self.sum[channel], other.sum[channel]);
        let scale = if own > 0.0 && other > own {
            other / own
        } else {
            1.0
        };
        (
            self.variance[channel] * scale,
            self.spread[channel] * scale * scale,
        )
    }
}

/// Estimates of both films at one place.
#[derive(Clone, Copy, Default)]
struct Estimates {
    pixels: usize,
    a: Estimate,
    b: Estimate,
    /// Σ (a − b)² over the pixels.
    squares: DVec3,
}

impl Estimates {
    fn of(a: &Moments, b: &Moments) -> Self {
        let (mut va, mut vb) = (a.variance_of_mean(), b.variance_of_mean());
        // Two constant sets, such as four hits against four misses, do not prove a variance of zero. If they show the
        // same picture, the variance is that of their union.
        let flat = (va + vb).cmpeq(DVec3::ZERO);
        let mut both = *a;
        both.merge(b);
        va = DVec3::select(flat, both.sample_variance() / f64::from(a.n), va);
        vb = DVec3::select(flat, both.sample_variance() / f64::from(b.n), vb);
        Self {
            pixels: 1,
            a: Estimate::new(a.mean, va, a.n - 1),
            b: Estimate::new(b.mean, vb, b.n - 1),
            squares: (a.mean - b.mean) * (a.mean - b.mean),
        }
    }

    /// These means with the mean variance of their tile.
    fn with_variance_of(&self, around: &Self) -> Self {
        let pixels = around.pixels as f64;
        let with = |own: &Estimate, around: &Estimate| Estimate {
            sum: own.sum,
            variance: around.variance / pixels,
            spread: around.spread / (pixels * pixels),
        };
        Self {
            a: with(&self.a, &around.a),
            b: with(&self.b, &around.b),
            ..*self
        }
    }

    fn add(&mut self, other: &Self) {
        self.pixels += other.pixels;
        self.a.add(&other.a);
        self.b.add(&other.b);
        self.squares += other.squares;
    }

    /// Bound on the p-value of the sum of differences in a channel, given their squares; 0 for too few pixels.
    fn by_signs(&self, channel: usize) -> f64 {
        if self.pixels < SIGNS || self.squares[channel] == 0.0 {
            return 0.0;
        }
        let sum = self.a.sum[channel] - self.b.sum[channel];
        (2.0 * (-0.5 * sum * sum / self.squares[channel]).exp()).min(1.0)
    }

    fn deviations(&self, window: Window) -> impl Iterator<Item = Deviation> + '_ {
        (0..3).map(move |channel| {
            let (a, b) = (self.a.sum[channel], self.b.sum[channel]);
            let (va, sa) = self.a.at_least(&self.b, channel);
            let (vb, sb) = self.b.at_least(&self.a, channel);
            let rounding = ROUNDING * a.abs().max(b.abs());
            let variance = va + vb + rounding * rounding;
            let t = if a == b {
                0.0
            } else {
                (a - b) / variance.sqrt()
            };
            // Without spread only rounding is left, and its size is known: the degrees of freedom are infinite.
            let degrees = variance * variance / (sa + sb).max(f64::MIN_POSITIVE);
            Deviation {
                window,
                channel,
                a: a / self.pixels as f64,
                b: b / self.pixels as f64,
                t,
                p: student::two_sided(t, degrees).max(self.by_signs(channel)),
            }
        })
    }
}

fn compare(a: &Film, b: &Film) -> Agreement {
    let window = a.window;
    let means = [a, b].map(Known::of);
    let mut pixels: Vec<(Window, Estimates, Estimates)> = Vec::new();
    let mut tiles = Vec::new();
    let mut image = Estimates::default();
    for tile in window.tiles(TILE) {
        let mut sums = Estimates::default();
        let first = pixels.len();
        for i in 0..tile.len() {
            let pixel = tile.pixel(i);
            let index =
                (pixel.y - window.y) as usize * window.w as usize + (pixel.x - window.x) as usize;
            let (a, b) = (a.pixels[index], b.pixels[index]);
            if a.n < 2 || b.n < 2 {
                continue;
            }
            let one = Estimates::of(&a, &b);
            let place = Window {
                x: pixel.x,
                y: pixel.y,
                w: 1,
                h: 1,
            };
            pixels.push((place, one, one));
            sums.add(&one);
        }
        for (_, one, around) in &mut pixels[first..] {
            *around = one.with_variance_of(&sums);
        }
        if sums.pixels > 0 {
            tiles.push((tile, sums, sums));
            image.add(&sums);
        }
    }
    let untested = window.len() - pixels.len();
    let shared = !means.iter().all(|known| matches!(known, Known::Pixels));
    means[0].apply(&mut image.a, image.pixels);
    means[1].apply(&mut image.b, image.pixels);
    if shared {
        // Pixels with common noise do not have independent signs.
        image.squares = DVec3::ZERO;
    }
    let whole = if image.pixels > 0 {
        vec![(window, image, image)]
    } else {
        Vec::new()
    };
    Agreement {
        pixels: scale(&pixels),
        tiles: scale(&tiles),
        image: scale(&whole),
        untested,
        shared,
        mean_known: !means.iter().any(|known| matches!(known, Known::Nothing)),
    }
}

/// Judges each place by the estimate with the larger p-value.
fn scale(places: &[(Window, Estimates, Estimates)]) -> Scale {
    let less_certain = |(x, y): (Deviation, Deviation)| if x.p >= y.p { x } else { y };
    let deviations = places.iter().flat_map(|(window, own, around)| {
        let pairs = own.deviations(*window).zip(around.deviations(*window));
        pairs.map(less_certain)
    });
    let worst = deviations.min_by(|x, y| x.p.total_cmp(&y.p).then(y.t.abs().total_cmp(&x.t.abs())));
    let tests = 3 * places.len();
    // Šidák's 1 − (1 − α)^(1/m) for three scales of `tests` each, in a form without cancellation for small α.
    let threshold = -((-SIGNIFICANCE).ln_1p() / (3.0 * tests.max(1) as f64)).exp_m1();
    Scale {
        tests,
        threshold,
        worst,
    }
}
