//! Windows of a pixel, and the choice among them.
//!
//! With v_g the radiance of a surface in frame g, w_g its visible share there, and t_g the variance of the frame (by its
//! squared errors; for raw means by its error map),
//!
//! ```text
//! s_g  = ¾ t_g + ¼ Σ w_h t_h / Σ w_h                    over the frames h of the widest window
//! W_r  = Σ w_g v_g / Σ w_g                              over the frames within r of this one; w = 1 for its own
//! V_r  = tent(u Σ w_g² s_g / (Σ w_g)²)                  u = 1 / (I² + 0.01 mean²), I the widest average, smoothed
//! b_r  = max over narrower j of tent(u ((W_r − W_j)² − variance of W_r − W_j)), at least 0
//! c_r  = 4 (region(√u (W_r − W_0))² − its variance), at least 0
//! r*   = argmin b_r + c_r + V_r
//! ```
//!
//! and the picture is Σ tent(1[r* = r]) W_r, so that windows of neighbouring pixels blend. tent is a box of three pixels
//! a side, applied twice; region a box of half the shorter side, applied twice. Regions find changes such as that of a
//! dimming lamp, which changes every pixel by less than its noise.
//!
//! A bright sample has a large t in its own frame only. By t alone that frame would take a wide window and its
//! neighbours windows without it, so that its light was lost. The mean over the frames is the same for all of them.

use crate::frame::{Averaged, Frame};
use crate::reproject::{Reprojected, Reprojection};
use opsr::image::Buffer;
use opsr::math::{Vec2, Vec3};
use opsr::resolve::error_of_less_noise;
use rayon::prelude::*;

/// Frames to each side of the windows.
pub(crate) const WINDOWS: [usize; 4] = [0, 1, 2, 4];

/// Frames to each side of the widest window.
pub(crate) const WIDEST: usize = WINDOWS[WINDOWS.len() - 1];

/// Variance of a frame over the square of the error that it states. Measured in docs/lab/films.md.
const NOISE: f32 = 3.0;

/// Share of the mean over the frames in the variance of each. Measured in docs/lab/films.md, too.
const COMMON: f32 = 0.25;

/// Largest relative error, also that of a frame without an error map.
const UNKNOWN: f32 = 2.0;

/// Shorter side of the picture over the radius of the regions that are compared.
const REGION: usize = 4;

/// Factor on the squared difference of a region: a difference that many pixels share is more visible than noise.
const REGION_WEIGHT: f32 = 4.0;

/// Pixels of a resolved picture that together have the noise of one: they share blurs and photons.
const CORRELATED: f32 = 16.0;

/// Share of the picture's mean whose square is added to squared brightness.
const DARK: f32 = 0.1;

/// A scalar image, row by row.
#[derive(Clone)]
struct Plane {
    width: usize,
    values: Vec<f32>,
}

impl Plane {
    /// Mean over the pixels around each, up to `radius` columns and rows away, within the picture.
    fn box_filtered(&self, radius: usize) -> Self {
        let (w, h) = (self.width, self.values.len() / self.width);
        let mut across = vec![0.0; w * h];
        let rows = across.par_chunks_mut(w).zip(self.values.par_chunks(w));
        rows.for_each(|(out, row)| box_means(radius, row.iter().copied(), out.iter_mut()));
        let columns = (0..w).into_par_iter().map(|x| {
            let mut column = vec![0.0; h];
            let from = across[x..].iter().step_by(w).copied();
            box_means(radius, from, column.iter_mut());
            column
        });
        let columns: Vec<Vec<f32>> = columns.collect();
        Self {
            width: w,
            values: (0..w * h).map(|i| columns[i % w][i / w]).collect(),
        }
    }

    fn tent(&self) -> Self {
        self.box_filtered(1).box_filtered(1)
    }
}

/// Mean over the numbers of a line around each, up to `radius` places away.
fn box_means<'a>(
    radius: usize,
    line: impl Iterator<Item = f32>,
    out: impl Iterator<Item = &'a mut f32>,
) {
    let mut sum = 0.0;
    let sums = line.map(|x| {
        sum += f64::from(x);
        sum
    });
    let sums: Vec<f64> = std::iter::once(0.0).chain(sums).collect();
    let count = sums.len() - 1;
    for (i, out) in out.enumerate() {
        let (from, to) = (i.saturating_sub(radius), (i + radius + 1).min(count));
        *out = ((sums[to] - sums[from]) / (to - from) as f64) as f32;
    }
}

/// Mean of the channels.
fn grey(light: Vec3) -> f32 {
    light.element_sum() / 3.0
}

fn mean(picture: &Buffer) -> f32 {
    let sum: f64 = picture.pixels.iter().map(|p| f64::from(grey(*p))).sum();
    (sum / picture.pixels.len() as f64) as f32
}

/// Variance of every pixel of a frame, mean of the channels, in units of the picture.
fn variance(frame: &Frame) -> Vec<f32> {
    let dark = DARK * mean(&frame.picture);
    let brightness = Plane {
        width: frame.picture.width,
        values: frame.picture.pixels.iter().map(|p| grey(*p)).collect(),
    };
    let brightness = brightness.box_filtered(1).values;
    // The error map is the second choice: it contains more than noise, and smooths bright samples.
    let square = |i: usize| match frame.squares.get(i) {
        Some(square) => square.min(UNKNOWN * UNKNOWN),
        None => (frame.error.get(i))
            .map_or(UNKNOWN, |e| e.min(UNKNOWN))
            .powi(2),
    };
    let pixels = brightness.iter().enumerate();
    pixels
        .map(|(i, light)| NOISE * square(i) * (light * light + dark * dark))
        .collect()
}

/// Sums over the frames of a window.
#[derive(Clone, Copy, Default)]
struct Sums {
    light: Vec3,
    weight: f32,
    /// Sum of weights times variances.
    stated: f32,
    /// Sum of squared weights.
    squares: f32,
    /// Sum of squared weights times variances.
    noise: f32,
}

impl Sums {
    fn add(&mut self, seen: &Reprojected) {
        self.light += seen.weight * seen.light;
        self.weight += seen.weight;
        self.stated += seen.weight * seen.variance;
        self.squares += seen.weight * seen.weight;
        self.noise += seen.weight * seen.weight * seen.variance;
    }

    fn mean(&self) -> Vec3 {
        self.light / self.weight
    }

    fn variance(&self) -> f32 {
        self.noise / (self.weight * self.weight)
    }

    /// Variance of the difference of the means of this window and a narrower one, which is a part of it.
    fn variance_of_difference(&self, narrower: &Self) -> f32 {
        let common = narrower.noise / (self.weight * narrower.weight);
        (self.variance() - 2.0 * common + narrower.variance()).max(0.0)
    }
}

/// A frame among others, with the variances of its pixels in place of its squared errors.
pub(crate) struct Held {
    pub(crate) frame: Frame,
    variance: Vec<f32>,
    /// True of a picture that was chosen among levels and blurs: some of its error is bias.
    biased: bool,
}

impl Held {
    pub(crate) fn new(mut frame: Frame) -> Self {
        let (variance, squares) = (variance(&frame), std::mem::take(&mut frame.squares));
        Self {
            frame,
            variance,
            biased: !squares.is_empty(),
        }
    }

    /// Drops the error map and the layers, which only the frame's own average needs.
    pub(crate) fn forget_own(&mut self) {
        (self.frame.error, self.frame.layers) = Default::default();
    }
}

/// The sums of every window at a pixel of frame `f`; `dark` is the light of the faintest lamp that counts.
fn windows(frames: &[&Held], f: usize, pixel: usize, dark: f32) -> [Sums; WINDOWS.len()] {
    let Held {
        frame, variance, ..
    } = frames[f];
    let mut sums = Sums::default();
    sums.add(&Reprojected {
        light: frame.picture.pixels[pixel],
        variance: variance[pixel],
        weight: 1.0,
    });
    let mut all = [sums; WINDOWS.len()];
    let mut reprojections = [false, true].map(|forward| (forward, Reprojection::new(frame, pixel)));
    for steps in 0..WIDEST {
        for (forward, reprojection) in &mut reprojections {
            let at = |steps: usize| match *forward {
                true => frames.get(f + steps),
                false => f.checked_sub(steps).and_then(|g| frames.get(g)),
            };
            let (Some(from), Some(to)) = (at(steps), at(steps + 1)) else {
                continue;
            };
            reprojection.step(&from.frame, steps, *forward);
            if let Some(seen) = reprojection.light(&to.frame, &to.variance, dark) {
                sums.add(&seen);
            }
        }
        for (own, radius) in all.iter_mut().zip(WINDOWS) {
            if radius > steps {
                *own = sums;
            }
        }
    }
    // The last sums are those of the widest window.
    let common = sums.stated / sums.weight;
    for own in &mut all {
        own.noise += COMMON * (common * own.squares - own.noise);
    }
    all
}

/// Motion to the previous or to the next frame; 0 where there is none.
fn motion(frames: &[&Held], f: usize, forward: bool) -> Vec<Vec2> {
    let frame = &frames[f].frame;
    let other = match forward {
        true => frames.get(f + 1),
        false => f.checked_sub(1).and_then(|g| frames.get(g)),
    };
    let way = |pixel| match other {
        Some(other) => {
            let mut reprojection = Reprojection::new(frame, pixel);
            reprojection.step(frame, 0, forward);
            reprojection.motion(&other.frame)
        }
        None => Vec2::ZERO,
    };
    let pixels = (0..frame.picture.pixels.len()).into_par_iter();
    pixels.map(way).collect()
}

/// Pairs of a window and a narrower one.
const PAIRS: [(usize, usize); 6] = [(1, 0), (2, 0), (2, 1), (3, 0), (3, 1), (3, 2)];

/// The error map of the average, and its sum over that of the frame alone. `ratio` is the ratio of a pixel's variances.
fn reduced_error(own: &Held, ratio: impl Fn(usize) -> f32) -> (Vec<f32>, f64) {
    let reduced = |(i, error): (usize, &f32)| {
        error * error_of_less_noise(f64::from(ratio(i)), own.biased) as f32
    };
    let error: Vec<f32> = own.frame.error.iter().enumerate().map(reduced).collect();
    let total = |errors: &[f32]| errors.iter().map(|&e| f64::from(e)).sum::<f64>();
    let reduced = match total(&own.frame.error) {
        before if before > 0.0 && before.is_finite() => total(&error) / before,
        _ => 1.0,
    };
    (error, reduced)
}

/// Squared bias of regions times [`REGION_WEIGHT`], from the differences between a window and the frame itself.
fn squared_bias(differences: Plane, noise: Plane, radius: usize) -> Plane {
    let width = differences.width;
    // Two passes of a box have the noise of one box of 9/4 of its area.
    let independent = 2.25 * ((2 * radius + 1) as f32).powi(2) / CORRELATED;
    let region = |plane: Plane| plane.box_filtered(radius).box_filtered(radius).values;
    let pairs = region(differences).into_iter().zip(region(noise));
    let square = |(difference, noise): (f32, f32)| difference.powi(2) - noise / independent;
    Plane {
        width,
        values: pairs
            .map(|pair| REGION_WEIGHT * square(pair).max(0.0))
            .collect(),
    }
}

/// The average of the frame at place `f` among frames one after another.
pub(crate) fn average(frames: &[&Held], f: usize, wants_motion: bool) -> Averaged {
    let frame = &frames[f].frame;
    let (width, count) = (frame.picture.width, frame.picture.pixels.len());
    let dark = (DARK * mean(&frame.picture)).max(f32::MIN_POSITIVE);
    let sums: Vec<[Sums; WINDOWS.len()]> = (0..count)
        .into_par_iter()
        .map(|pixel| windows(frames, f, pixel, dark))
        .collect();
    let plane = |value: &(dyn Fn(usize) -> f32 + Sync)| Plane {
        width,
        values: (0..count).into_par_iter().map(value).collect(),
    };
    let widest = |i: usize| grey(sums[i][WINDOWS.len() - 1].mean());
    let light = plane(&widest).box_filtered(2);
    let weight = |i: usize| 1.0 / (light.values[i].powi(2) + dark * dark).max(f32::MIN_POSITIVE);
    let noise: Vec<Plane> = (0..WINDOWS.len())
        .map(|k| plane(&|i| weight(i) * sums[i][k].variance()).tent())
        .collect();
    let bias = PAIRS.map(|(k, j)| {
        let beyond = |i: usize| {
            let (wide, narrow) = (&sums[i][k], &sums[i][j]);
            let difference = (wide.mean() - narrow.mean()).length_squared() / 3.0;
            weight(i) * (difference - wide.variance_of_difference(narrow))
        };
        plane(&beyond).tent()
    });
    let radius = (width.min(frame.picture.height) / REGION).max(2);
    let of_region: Vec<Plane> = (1..WINDOWS.len())
        .map(|k| {
            let pair = |i: usize| (&sums[i][k], &sums[i][0]);
            let differences = plane(&|i| {
                let (wide, own) = pair(i);
                weight(i).sqrt() * grey(wide.mean() - own.mean())
            });
            let noise = plane(&|i| {
                let (wide, own) = pair(i);
                weight(i) * wide.variance_of_difference(own)
            });
            squared_bias(differences, noise, radius)
        })
        .collect();
    let squared_error = |i: usize, k: usize| {
        let pairs = PAIRS.iter().zip(&bias).filter(|((wide, _), _)| *wide == k);
        let bias = pairs.map(|(_, plane)| plane.values[i]).fold(0.0, f32::max);
        let of_region = k.checked_sub(1).map_or(0.0, |k| of_region[k].values[i]);
        bias + of_region + noise[k].values[i]
    };
    let best = |i: usize| {
        let errors = (0..WINDOWS.len()).map(|k| squared_error(i, k));
        let first = errors.enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        first.map_or(0, |(k, _)| k)
    };
    let chosen: Vec<usize> = (0..count).into_par_iter().map(best).collect();
    let shares: Vec<Plane> = (0..WINDOWS.len())
        .map(|k| plane(&|i| f32::from(u8::from(chosen[i] == k))).tent())
        .collect();
    let mixed = |i: usize| -> Vec3 {
        let parts = shares.iter().zip(&sums[i]);
        (parts.map(|(share, sums)| share.values[i] * sums.mean())).sum()
    };
    let ratio = |i: usize| match noise[0].values[i] {
        own if own > 0.0 => (squared_error(i, chosen[i]) / own).min(1.0),
        _ => 1.0,
    };
    let (error, error_ratio) = reduced_error(frames[f], ratio);
    Averaged {
        picture: Buffer {
            width,
            height: frame.picture.height,
            pixels: (0..count).into_par_iter().map(mixed).collect(),
        },
        error,
        window: chosen.iter().map(|k| WINDOWS[*k] as u8).collect(),
        motion: [false, true].map(|forward| match wants_motion {
            true => motion(frames, f, forward),
            false => Vec::new(),
        }),
        error_ratio,
    }
}
