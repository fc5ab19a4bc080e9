//! The level of roughening chosen per pixel, without a reference, from levels on the same paths in independent batches.
//!
//! Goldenshluger and Lepski's principle (*Bandwidth selection in kernel density estimation*, Annals of Statistics 39(3),
//! 2011): a level is biased where it differs from a less roughened one by more than that one's noise. With I_k the picture
//! of level k in B batches, D = I_k − I_j in each of them, and tent_r a box filter of radius r applied twice:
//!
//! ```text
//! V_k  = tent_r(variance of the mean of level k)
//! w    = 1 / (I~² + 0.01)        I~ the roughest level, smoothed by tent_r, where the mean of the picture counts as 0.3
//! U_kj = [(Σ D)² − Σ D²] / (B (B − 1))                     unbiased for the squared difference
//! b_k  = max over j < k of w tent_r(U_kj) − κ w V_j, at least 0
//! k*   = argmin b_k + w V_k
//! ```
//!
//! Rougher levels are not always less noisy: the variances are taken as they are.
//!
//! Every level but 0 is a second candidate with the light of roughened vertices blurred by a Gaussian, and the rest as it
//! is: P + G(I_k − P), where P is the light that all levels share. G stops at edges of the surface that the first rough
//! vertices lie on. Its bias is judged against the sharp levels up to its own, and weighted for the darkest of the pixels
//! around.
//!
//! The picture p is Σ_k tent_1(1[k* = k]) I_k. What light the choice lost is given back: μ = tent_R(I_0 − p), shrunk by
//! max(0, 1 − c Var(μ)/μ²) where it is not above its own noise, times p / tent_R(p): in proportion to the picture, so that
//! shadows stay dark. What the whole picture still lacks, shrunk likewise, makes all of it brighter or darker.

use crate::image::Buffer;
use crate::image::level_film::{BATCHES, LevelFilm};
use crate::integrator::Picture;
use crate::math::{DVec3, Rgb};
use rayon::prelude::*;

/// r: radius in pixels at which noise and bias are smoothed.
const RADIUS: usize = 1;

/// R: radius in pixels at which lost energy is given back.
const ENERGY_RADIUS: usize = 6;

/// κ: share of the noise of the less roughened level that a difference must exceed.
const KAPPA: f32 = 0.25;

/// c: multiple of its variance by which the energy correction is shrunk.
const SHRINKAGE: f32 = 1.0;

/// ε of relative errors, where the mean of the picture counts as 0.3.
const EPSILON: f32 = 0.01;

/// Settings of the choice.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resolve {
    /// Take the mean of the mean of each level and of the median of its batches, which removes fireflies.
    pub robust: bool,
    /// Standard deviation in pixels of the blur that roughened light may get, from 0 for none to [`MAX_SIGMA`].
    pub sigma: f32,
}

/// Largest standard deviation of the blur, in pixels.
pub const MAX_SIGMA: f32 = 1.5;

impl Default for Resolve {
    fn default() -> Self {
        Self {
            robust: false,
            sigma: 0.7,
        }
    }
}

/// A picture, and the same in independent batches.
#[derive(Clone, Debug)]
struct BatchMeans {
    /// Mean of all samples.
    mean: Buffer,
    /// Means of the batches.
    batches: [Buffer; BATCHES],
}

impl BatchMeans {
    /// Those of a level of a film, or of the shared light by the number of levels.
    fn of(film: &LevelFilm, level: usize) -> Self {
        Self {
            mean: film.mean(level),
            batches: film.batch_means(level),
        }
    }

    /// The same with everything but the shared light blurred. Pixels that are `dark` stay black.
    fn blurred(&self, shared: &Self, blur: &Blur, dark: &[bool]) -> Self {
        let one = |whole: &Buffer, shared: &Buffer| {
            let pairs = whole.pixels.iter().zip(&shared.pixels);
            let roughened: Vec<Rgb> = pairs.map(|(i, p)| *i - *p).collect();
            let mut pixels = blur.apply(&roughened);
            for (i, p) in pixels.iter_mut().enumerate() {
                *p = if dark[i] {
                    Rgb::ZERO
                } else {
                    shared.pixels[i] + *p
                };
            }
            Buffer {
                width: whole.width,
                height: whole.height,
                pixels,
            }
        };
        Self {
            mean: one(&self.mean, &shared.mean),
            batches: std::array::from_fn(|b| one(&self.batches[b], &shared.batches[b])),
        }
    }
}

/// A Gaussian filter that stops at edges: where normals differ, or lengths by more than a plane explains.
struct Blur {
    size: Size,
    radius: usize,
    /// Weights of the pixels around each pixel, row by row; 0 outside of the picture.
    weights: Vec<f32>,
}

impl Blur {
    /// Weights of this standard deviation in pixels. A guide is a normal and a length.
    fn new((width, height): Size, sigma: f32, guides: &[[f32; 4]]) -> Self {
        let radius = (2.0 * sigma).ceil() as usize;
        let length = |x: usize, y: usize| guides[y * width + x][3];
        let change = |x: usize, y: usize| {
            let across = (length((x + 1).min(width - 1), y) - length(x.saturating_sub(1), y)).abs();
            let along = (length(x, (y + 1).min(height - 1)) - length(x, y.saturating_sub(1))).abs();
            0.5 * across.max(along)
        };
        let around = |i: usize| {
            let (x, y) = (i % width, i / width);
            let [nx, ny, nz, z] = guides[i];
            let change = change(x, y);
            let weight = move |dx: usize, dy: usize| {
                let (u, v) = (x + dx, y + dy);
                let inside = radius..width + radius;
                if !inside.contains(&u) || !(radius..height + radius).contains(&v) {
                    return 0.0;
                }
                let [mx, my, mz, length] = guides[(v - radius) * width + u - radius];
                let d2 = (dx.abs_diff(radius).pow(2) + dy.abs_diff(radius).pow(2)) as f32;
                let turn = (nx - mx).powi(2) + (ny - my).powi(2) + (nz - mz).powi(2);
                let step = (length - z) / (0.02 * z + 0.5 * change * d2.sqrt() + f32::MIN_POSITIVE);
                (-0.5 * d2 / sigma / sigma - 10.0 * turn - 0.5 * step * step).exp()
            };
            let side = 0..2 * radius + 1;
            side.clone()
                .flat_map(move |dy| side.clone().map(move |dx| weight(dx, dy)))
        };
        let pixels = (0..guides.len()).into_par_iter();
        Self {
            size: (width, height),
            radius,
            weights: pixels.flat_map_iter(around).collect(),
        }
    }

    fn apply(&self, values: &[Rgb]) -> Vec<Rgb> {
        let ((width, _), radius) = (self.size, self.radius);
        let side = 2 * radius + 1;
        let pixel = |(i, weights): (usize, &[f32])| {
            let (mut sum, mut all) = (Rgb::ZERO, 0.0);
            for (at, &weight) in weights.iter().enumerate() {
                if weight > 0.0 {
                    let from = i + (at / side) * width + at % side;
                    sum += weight * values[from - radius * (width + 1)];
                    all += weight;
                }
            }
            sum / all
        };
        let pixels = self.weights.par_chunks(side * side).enumerate();
        pixels.map(pixel).collect()
    }
}

/// A level, sharp or blurred.
struct Candidate {
    level: usize,
    blurred: bool,
    means: BatchMeans,
}

impl Candidate {
    /// True if its bias is estimated against `other`: a sharp candidate, less roughened or of its own level.
    fn judged_by(&self, other: &Self) -> bool {
        !other.blurred && (other.level < self.level || self.blurred && other.level == self.level)
    }
}

/// A picture whose level of roughening was chosen per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// The picture.
    pub picture: Buffer,
    /// Chosen level of every pixel, sharp or blurred.
    pub level: Vec<u8>,
    /// Estimated squared bias of the chosen level, relative: over the squared picture + ε, mean of the channels.
    pub bias2: Vec<f32>,
    /// Estimated variance of the chosen level, relative likewise.
    pub variance: Vec<f32>,
}

impl Resolved {
    /// Estimated relative error of every pixel: the root of the relMSE to be expected, without a reference.
    pub fn error(&self) -> Vec<f32> {
        let pairs = self.bias2.iter().zip(&self.variance);
        pairs.map(|(b, v)| (b + v).sqrt()).collect()
    }

    /// Estimated relative error of the picture: the root mean square of [`Resolved::error`].
    pub fn relative_error(&self) -> f64 {
        let pairs = self.bias2.iter().zip(&self.variance);
        let sum: f64 = pairs.map(|(b, v)| f64::from(b + v)).sum();
        (sum / self.bias2.len().max(1) as f64).sqrt()
    }
}

/// Chooses the level of every pixel of a film. A film without a sample in every batch has no noise estimate: its picture
/// is level 0, its error infinite.
pub fn resolve_film(film: &LevelFilm, settings: Resolve) -> Resolved {
    if film.least_samples() == 0 {
        let picture = film.mean(0);
        let pixels = picture.pixels.len();
        return Resolved {
            picture,
            level: vec![0; pixels],
            bias2: vec![0.0; pixels],
            variance: vec![f32::INFINITY; pixels],
        };
    }
    let levels = (0..film.levels())
        .map(|k| BatchMeans::of(film, k))
        .collect();
    let shared = BatchMeans::of(film, film.levels());
    resolve(levels, &shared, &film.guides(), settings)
}

/// Estimated relative error of a picture: of several levels that of the best of every pixel, else the noise of its film.
pub fn relative_error(picture: &Picture) -> f64 {
    match &picture.levels {
        Some(film) => resolve_film(film, Resolve::default()).relative_error(),
        None => picture.film.relative_error(),
    }
}

/// Share of the light of a picture of several levels that plain path tracing cannot find: that of lights without area at
/// the end of Dirac lobes. 0 for one level.
pub fn unseen_share(picture: &Picture) -> f64 {
    let sum = |buffer: Buffer| -> f64 {
        let pixels = buffer.pixels.iter();
        pixels.map(|p| f64::from(p.element_sum())).sum()
    };
    let Some(film) = &picture.levels else {
        return 0.0;
    };
    let (all, plain) = (sum(film.mean(0)), sum(picture.film.mean()));
    if all > 0.0 { 1.0 - plain / all } else { 0.0 }
}

/// Chooses the level of every pixel. There is at least one level, level 0 is unbiased, and all pictures have one size.
fn resolve(
    levels: Vec<BatchMeans>,
    shared: &BatchMeans,
    guides: &[[f32; 4]],
    settings: Resolve,
) -> Resolved {
    let size = levels[0].mean.size();
    let roughest = &levels[levels.len() - 1].mean;
    let weights = [
        weights(roughest, &tent(size, RADIUS, &roughest.pixels)),
        weights(roughest, &darkest(size, &roughest.pixels)),
    ];
    let candidates = candidates(levels, shared, guides, settings.sigma);
    let variance: Vec<Vec<f32>> = (candidates.iter())
        .map(|c| variance(size, &c.means, &weights[0]))
        .collect();
    let bias2 = biases(size, &candidates, &weights, &variance);
    let pixels = weights[0].len();
    let chosen: Vec<u8> = (0..pixels)
        .into_par_iter()
        .map(|i| {
            let error = |k: usize| bias2[k][i] + variance[k][i];
            // The first of the best: the least roughened, and sharp.
            let best = (1..candidates.len())
                .fold(0, |best, k| if error(k) < error(best) { k } else { best });
            best as u8
        })
        .collect();
    let of_chosen = |of: &[Vec<f32>]| -> Vec<f32> {
        let one = |(i, &k): (usize, &u8)| of[usize::from(k)][i];
        chosen.iter().enumerate().map(one).collect()
    };
    let level = |&k: &u8| candidates[usize::from(k)].level as u8;
    Resolved {
        picture: picture(size, &candidates, &chosen, settings.robust),
        bias2: of_chosen(&bias2),
        variance: of_chosen(&variance),
        level: chosen.iter().map(level).collect(),
    }
}

/// The levels, then all but level 0 blurred.
fn candidates(
    levels: Vec<BatchMeans>,
    shared: &BatchMeans,
    guides: &[[f32; 4]],
    sigma: f32,
) -> Vec<Candidate> {
    let mut blurred = Vec::new();
    if sigma > 0.0 {
        let black = |i| levels.iter().all(|level| level.mean.pixels[i] == Rgb::ZERO);
        let dark: Vec<bool> = (0..shared.mean.pixels.len()).map(black).collect();
        let gaussian = Blur::new(shared.mean.size(), sigma, guides);
        let blur = |(level, means): (usize, &BatchMeans)| Candidate {
            level,
            blurred: true,
            means: means.blurred(shared, &gaussian, &dark),
        };
        blurred.extend(levels.iter().enumerate().skip(1).map(blur));
    }
    let sharp = |(level, means)| Candidate {
        level,
        blurred: false,
        means,
    };
    let sharp = levels.into_iter().enumerate().map(sharp);
    sharp.chain(blurred).collect()
}

/// Width and height.
type Size = (usize, usize);

/// w of every pixel and channel for these brightnesses, where the mean of a picture counts as 0.3.
fn weights(picture: &Buffer, brightness: &[Rgb]) -> Vec<Rgb> {
    let sum: f64 = (picture.pixels.iter())
        .map(|p| f64::from(p.element_sum()))
        .sum();
    let mean = sum / (3 * picture.pixels.len()).max(1) as f64;
    let gain = if mean > 0.0 { (0.3 / mean) as f32 } else { 1.0 };
    let weight = |i: &Rgb| {
        let i = *i * gain;
        Rgb::splat(gain * gain) / (i * i + EPSILON)
    };
    brightness.iter().map(weight).collect()
}

/// The least of a pixel and its neighbours.
fn darkest((width, height): Size, values: &[Rgb]) -> Vec<Rgb> {
    let around = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
    let least = |i: usize| {
        let rows = around(i / width, height);
        let near = rows.flat_map(|y| around(i % width, width).map(move |x| values[y * width + x]));
        near.fold(values[i], Rgb::min)
    };
    (0..values.len()).into_par_iter().map(least).collect()
}

/// w V of a candidate.
fn variance(size: Size, means: &BatchMeans, weights: &[Rgb]) -> Vec<f32> {
    let noise: Vec<Rgb> = (0..weights.len())
        .into_par_iter()
        .map(|i| variance_of_mean(means.batches.each_ref().map(|b| b.pixels[i])))
        .collect();
    weighted(&tent(size, RADIUS, &noise), weights)
}

/// b of every candidate.
fn biases(
    size: Size,
    candidates: &[Candidate],
    [weights, dark]: &[Vec<Rgb>; 2],
    variance: &[Vec<f32>],
) -> Vec<Vec<f32>> {
    let mut all = vec![vec![0.0f32; weights.len()]; candidates.len()];
    for (all, one) in all.iter_mut().zip(candidates) {
        for (anchor, noise) in candidates.iter().zip(variance) {
            if !one.judged_by(anchor) {
                continue;
            }
            let square: Vec<Rgb> = (0..weights.len())
                .into_par_iter()
                .map(|i| {
                    let of = |c: &Candidate, b: usize| c.means.batches[b].pixels[i];
                    let square =
                        squared_difference(std::array::from_fn(|b| of(one, b) - of(anchor, b)));
                    // Light that a blur takes across an edge is seen on the dark side.
                    let each = if one.blurred { dark[i] } else { Rgb::ONE };
                    square * each
                })
                .collect();
            let smooth = tent(size, RADIUS, &square);
            let bias: Vec<f32> = if one.blurred {
                smooth.iter().map(|v| v.element_sum() / 3.0).collect()
            } else {
                weighted(&smooth, weights)
            };
            for (i, b) in all.iter_mut().enumerate() {
                *b = b.max(bias[i] - KAPPA * noise[i]);
            }
        }
    }
    all
}

/// U: an unbiased estimate of the squared mean of independent numbers of one mean; below 0 by chance.
pub fn squared_difference(d: [Rgb; BATCHES]) -> Rgb {
    let (sum, squares) = d
        .iter()
        .fold((Rgb::ZERO, Rgb::ZERO), |(s, q), d| (s + *d, q + *d * *d));
    (sum * sum - squares) / (BATCHES * (BATCHES - 1)) as f32
}

/// Estimated variance of the mean of independent numbers.
fn variance_of_mean(x: [Rgb; BATCHES]) -> Rgb {
    let mean = x.iter().sum::<Rgb>() / BATCHES as f32;
    let squares: Rgb = x.iter().map(|x| (*x - mean) * (*x - mean)).sum();
    squares / (BATCHES * (BATCHES - 1)) as f32
}

/// Mean over the channels of values times their weights.
fn weighted(values: &[Rgb], weights: &[Rgb]) -> Vec<f32> {
    let pairs = values.par_iter().zip(weights);
    pairs.map(|(v, w)| v.dot(*w) / 3.0).collect()
}

/// The candidates blended as they were chosen, with the energy that the choice lost.
fn picture(size: Size, candidates: &[Candidate], chosen: &[u8], robust: bool) -> Buffer {
    let shares: Vec<Vec<f32>> = (0..candidates.len())
        .map(|k| {
            let is = |&c: &u8| Rgb::splat(f32::from(u8::from(usize::from(c) == k)));
            let share = tent(size, 1, &chosen.iter().map(is).collect::<Vec<Rgb>>());
            share.iter().map(|share| share.x).collect()
        })
        .collect();
    let blend = |of: &(dyn Fn(usize, usize) -> Rgb + Sync)| -> Vec<Rgb> {
        let pixel = |i: usize| (0..candidates.len()).map(|k| shares[k][i] * of(k, i)).sum();
        (0..chosen.len()).into_par_iter().map(pixel).collect()
    };
    let mut picture = blend(&|k, i| candidates[k].means.mean.pixels[i]);
    // In proportion to this light is given back: shadows stay dark, and a pixel that no level lights stays black.
    let mut shape = picture.clone();
    if robust {
        // Without fireflies.
        shape = blend(&|k, i| median(candidates[k].means.batches.each_ref().map(|b| b.pixels[i])));
        let pairs = picture.iter_mut().zip(&shape);
        pairs.for_each(|(mean, median)| *mean = 0.5 * (*mean + *median));
    }
    let lost = |plain: &Buffer, picture: &[Rgb]| {
        let pairs = plain.pixels.iter().zip(picture);
        let difference: Vec<Rgb> = pairs.map(|(a, b)| *a - *b).collect();
        tent(size, ENERGY_RADIUS, &difference)
    };
    let plain = &candidates[0].means;
    let mu = lost(&plain.mean, &picture);
    let batches: [Vec<Rgb>; BATCHES] = std::array::from_fn(|b| {
        let part = blend(&|k, i| candidates[k].means.batches[b].pixels[i]);
        lost(&plain.batches[b], &part)
    });
    let mean = |values: &[Rgb]| -> Rgb {
        let sum: DVec3 = values.iter().map(|v| v.as_dvec3()).sum();
        (sum / values.len().max(1) as f64).as_vec3()
    };
    let around = tent(size, ENERGY_RADIUS, &shape);
    let given: Vec<Rgb> = (0..picture.len())
        .map(|i| {
            let share = shape[i] / around[i].max(Rgb::splat(f32::MIN_POSITIVE));
            let noise = variance_of_mean(batches.each_ref().map(|b| b[i]));
            share * shrunk(mu[i], noise)
        })
        .collect();
    let left = shrunk(
        mean(&mu) - mean(&given),
        variance_of_mean(batches.each_ref().map(|b| mean(b))),
    );
    let gain = Rgb::ONE + left / mean(&picture).max(Rgb::splat(f32::MIN_POSITIVE));
    for (p, given) in picture.iter_mut().zip(given) {
        *p = (*p * gain + given).max(Rgb::ZERO);
    }
    Buffer {
        width: size.0,
        height: size.1,
        pixels: picture,
    }
}

/// μ, shrunk by its own noise.
fn shrunk(mu: Rgb, variance: Rgb) -> Rgb {
    let one = |mu: f32, v: f32| {
        let square = mu * mu;
        if square > SHRINKAGE * v {
            mu * (1.0 - SHRINKAGE * v / square)
        } else {
            0.0
        }
    };
    Rgb::new(
        one(mu.x, variance.x),
        one(mu.y, variance.y),
        one(mu.z, variance.z),
    )
}

/// Median of the batches: the mean of the middle two, by channel.
fn median(x: [Rgb; BATCHES]) -> Rgb {
    let channel = |c: usize| {
        let mut sorted = x.map(|x| x[c]);
        sorted.sort_by(f32::total_cmp);
        0.5 * (sorted[BATCHES / 2 - 1] + sorted[BATCHES / 2])
    };
    Rgb::new(channel(0), channel(1), channel(2))
}

/// A box filter applied twice: about a tent of radius 2 `radius`. At the border a mean over the pixels inside.
fn tent(size: Size, radius: usize, values: &[Rgb]) -> Vec<Rgb> {
    let once = boxed(size, radius, values);
    boxed(size, radius, &once)
}

/// Mean over the square of radius `radius` around every pixel.
fn boxed((width, height): Size, radius: usize, values: &[Rgb]) -> Vec<Rgb> {
    let around = |at: usize, end: usize| at.saturating_sub(radius)..(at + radius + 1).min(end);
    let mut rows = vec![Rgb::ZERO; values.len()];
    rows.par_chunks_mut(width.max(1))
        .zip(values.par_chunks(width.max(1)))
        .for_each(|(out, row)| {
            for (x, out) in out.iter_mut().enumerate() {
                let near = &row[around(x, width)];
                *out = near.iter().sum::<Rgb>() / near.len() as f32;
            }
        });
    let mut all = vec![Rgb::ZERO; values.len()];
    all.par_chunks_mut(width.max(1))
        .enumerate()
        .for_each(|(y, out)| {
            let near = around(y, height);
            let count = near.len() as f32;
            for y in near {
                let row = &rows[y * width..(y + 1) * width];
                out.iter_mut().zip(row).for_each(|(out, v)| *out += *v);
            }
            out.iter_mut().for_each(|out| *out /= count);
        });
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::level_film::PathLevels;
    use crate::sampler::{Independent, IndependentStream, SampleSource, Sampler, Seed};

    fn stream(n: u32) -> IndependentStream {
        Independent { seed: Seed(5) }.stream(crate::math::UVec2::ZERO, n)
    }

    /// Levels of these batches, whose mean is the mean of the batches.
    fn levels(
        size: usize,
        of: impl Fn(usize, usize, usize) -> Rgb,
        count: usize,
    ) -> Vec<BatchMeans> {
        let picture =
            |f: &dyn Fn(usize) -> Rgb| Buffer::from_fn(size, size, |x, y| f(y * size + x));
        let level = |k: usize| {
            let batches = std::array::from_fn(|b| picture(&|i| of(k, b, i)));
            let all = |i: usize| (0..BATCHES).map(|b| of(k, b, i)).sum::<Rgb>() / BATCHES as f32;
            BatchMeans {
                mean: picture(&all),
                batches,
            }
        };
        (0..count).map(level).collect()
    }

    /// The choice among levels whose light is all roughened.
    fn choose(levels: &[BatchMeans], settings: Resolve) -> Resolved {
        let size = levels[0].mean.width;
        let nothing = super::tests::levels(size, |_, _, _| Rgb::ZERO, 1);
        let flat = vec![[0.0; 4]; size * size];
        resolve(levels.to_vec(), &nothing[0], &flat, settings)
    }

    const SHARP: Resolve = Resolve {
        robust: false,
        sigma: 0.0,
    };

    const ROBUST: Resolve = Resolve {
        robust: true,
        sigma: 0.0,
    };

    /// Noise of mean 0 and variance 1 that depends on its place only.
    fn noise(k: usize, b: usize, i: usize) -> f32 {
        let mut stream = stream((i * 64 + k * 8 + b) as u32);
        (0..12).map(|_| stream.next_1d()).sum::<f32>() - 6.0
    }

    /// Heavy tails: a brightness of 1/p with probability p, whose mean is 1 whatever p.
    #[test]
    fn squared_difference_is_unbiased_under_heavy_tails() {
        for (p, offset) in [(0.5f32, 0.0f32), (0.05, 0.0), (0.05, 2.0), (0.01, 0.5)] {
            let (mut sum, mut squares, n) = (0.0f64, 0.0f64, 400_000);
            let mut stream = stream(7);
            for _ in 0..n {
                let d = std::array::from_fn(|_| {
                    let hit = if stream.next_1d() < p { 1.0 / p } else { 0.0 };
                    Rgb::splat(hit - 1.0 + offset)
                });
                let u = f64::from(squared_difference(d).x);
                sum += u;
                squares += u * u;
            }
            let mean = sum / f64::from(n);
            let error = ((squares / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
            let expected = f64::from(offset * offset);
            assert!(
                (mean - expected).abs() < 4.0 * error,
                "{p} {offset}: {mean} ± {error}"
            );
        }
    }

    #[test]
    fn noise_free_levels_resolve_to_level_0() {
        let ramp = |k: usize, _, i: usize| Rgb::splat(1.0 + i as f32 / 64.0 + k as f32 * 0.01);
        let levels = levels(8, ramp, 4);
        for (robust, sigma) in [(false, 0.0), (true, 0.0), (false, 0.7), (true, 1.5)] {
            let resolved = choose(&levels, Resolve { robust, sigma });
            assert!(resolved.level.iter().all(|&k| k == 0));
            assert_eq!(resolved.picture, levels[0].mean);
            assert_eq!(resolved.relative_error(), 0.0);
        }
    }

    #[test]
    fn white_noise_on_a_constant_resolves_to_the_roughest_level() {
        let value =
            |k: usize, b, i| Rgb::splat(1.0 + 0.2 * 0.25f32.powi(k as i32) * noise(k, b, i));
        let resolved = choose(&levels(32, value, 3), SHARP);
        let count =
            |resolved: &Resolved, level| resolved.level.iter().filter(|&&k| k == level).count();
        // The estimate of a bias is noisy itself: 88 % by these numbers.
        let counts = [0, 1, 2].map(|k| count(&resolved, k));
        assert!(counts[2] > 800 && counts[0] < 80, "{counts:?}");
        // A level that adds light everywhere is not taken.
        let bright = |k: usize, b, i| value(k, b, i) + Rgb::splat(if k == 2 { 0.5 } else { 0.0 });
        let resolved = choose(&levels(32, bright, 3), SHARP);
        let counts = [0, 1, 2].map(|k| count(&resolved, k));
        assert!(counts[2] == 0 && counts[1] > 850, "{counts:?}");
    }

    /// Light that the path finds anyhow, in a room under a sky: roughening the last vertex makes it noisier.
    #[test]
    fn noisier_levels_are_not_chosen() {
        let value = |k: usize, b, i| Rgb::splat(1.0 + [0.05, 0.6, 0.3][k] * noise(k, b, i));
        let resolved = choose(&levels(32, value, 3), SHARP);
        let rough = resolved.level.iter().filter(|&&k| k > 0).count();
        assert!(rough < 20, "{rough}");
    }

    /// Light that a bright surface lost is not given to the shadow beside it.
    #[test]
    fn energy_correction_leaves_shadows_dark() {
        let shadow = |i: usize| i % 8 < 4;
        let value = |k: usize, b, i| {
            let bright = [1.0, 0.93][k] + [0.6, 0.05][k] * noise(k, b, i);
            Rgb::splat(bright * if shadow(i) { 0.01 } else { 1.0 })
        };
        let resolved = choose(&levels(48, value, 2), SHARP);
        let pixels = resolved.picture.pixels.iter().enumerate();
        let dark: Vec<f32> = pixels
            .filter(|(i, _)| shadow(*i))
            .map(|(_, p)| p.x)
            .collect();
        let mean = dark.iter().sum::<f32>() / dark.len() as f32;
        assert!((mean - 0.01).abs() < 0.002, "{mean}");
    }

    /// Equal levels keep their picture, black pixels stay black, and what a rough level loses is given back.
    #[test]
    fn energy_correction_keeps_equal_levels_and_black_pixels() {
        let black = |i: usize| i.is_multiple_of(7);
        let equal = |_, b, i| {
            if black(i) {
                Rgb::ZERO
            } else {
                Rgb::splat(1.0 + 0.3 * noise(0, b, i))
            }
        };
        let all = levels(16, equal, 3);
        let resolved = choose(&all, SHARP);
        for (i, (p, q)) in resolved
            .picture
            .pixels
            .iter()
            .zip(&all[0].mean.pixels)
            .enumerate()
        {
            assert!((*p - *q).abs().max_element() < 1e-6, "{i}: {p} {q}");
        }
        let darker = |k: usize, b, i| {
            let spread = [0.6, 0.05][k];
            if black(i) {
                Rgb::ZERO
            } else {
                Rgb::splat([1.0, 0.93][k] + spread * noise(k, b, i))
            }
        };
        let all = levels(48, darker, 2);
        let resolved = choose(&all, SHARP);
        assert!(resolved.level.iter().filter(|&&k| k == 1).count() > 2000);
        let mean = |b: &Buffer| b.pixels.iter().map(|p| p.x).sum::<f32>() / b.pixels.len() as f32;
        let (plain, rough) = (mean(&all[0].mean), mean(&all[1].mean));
        let lost = (mean(&resolved.picture) - plain).abs();
        assert!(lost < 0.35 * (plain - rough), "{plain} {rough} {lost}");
        for (i, p) in resolved.picture.pixels.iter().enumerate() {
            assert_eq!(*p == Rgb::ZERO, black(i), "{i}");
        }
    }

    /// Error of noise on a smooth picture falls by blur, that of a texture does not: neither the texture of the light that
    /// all levels share nor a sharp edge of roughened light is blurred.
    #[test]
    fn blur_lowers_noise_and_keeps_texture_and_edges() {
        let blur = Resolve {
            sigma: 0.7,
            ..SHARP
        };
        let size = 32;
        let texture = |i: usize| {
            if (i + i / size).is_multiple_of(2) {
                2.0
            } else {
                0.2
            }
        };
        let edge = |i: usize| if i % size < 16 { 1.0f32 } else { 0.1 };
        let shared = levels(size, |_, _, i| Rgb::splat(texture(i)), 1);
        let value = |spread: f32| {
            move |k: usize, b, i| {
                let noise = 1.0 + spread * [4.0, 1.0][k] * noise(k, b, i);
                Rgb::splat(texture(i) + edge(i) * noise)
            }
        };
        let error = |resolved: &Resolved| -> f32 {
            let pixels = resolved.picture.pixels.iter().enumerate();
            let square = |(i, p): (usize, &Rgb)| (p.x / (texture(i) + edge(i)) - 1.0).powi(2);
            pixels.map(square).sum()
        };
        let flat = vec![[0.0; 4]; size * size];
        for (spread, most) in [(0.2, 0.7), (0.002, 1.1)] {
            let all = levels(size, value(spread), 2);
            let sharp = error(&resolve(all.clone(), &shared[0], &flat, SHARP));
            let blurred = error(&resolve(all, &shared[0], &flat, blur));
            assert!(blurred < most * sharp, "{spread}: {blurred} {sharp}");
        }
    }

    #[test]
    fn gaussian_filter_keeps_constants_and_a_pixel_without_light_stays_black() {
        for (w, h) in [(1, 1), (2, 9), (7, 5)] {
            let ones = Blur::new((w, h), 0.7, &vec![[0.0; 4]; w * h]).apply(&vec![Rgb::ONE; w * h]);
            assert!(
                ones.iter()
                    .all(|v| (*v - Rgb::ONE).abs().max_element() < 1e-6)
            );
        }
        let one = |i: usize| if i == 60 { Rgb::ONE } else { Rgb::ZERO };
        let spread = |guide: &dyn Fn(usize) -> [f32; 4]| {
            let guides: Vec<[f32; 4]> = (0..121).map(guide).collect();
            let point = (0..121).map(one).collect::<Vec<Rgb>>();
            Blur::new((11, 11), 1.0, &guides).apply(&point)
        };
        let flat = spread(&|_| [0.0, 0.0, 1.0, 5.0]);
        let (beside, far) = (flat[61].x / flat[60].x, flat[62].x / flat[60].x);
        assert!((beside - (-0.5f32).exp()).abs() < 1e-6, "{beside}");
        assert!((far - (-2.0f32).exp()).abs() < 1e-6, "{far}");
        // A wall that meets the floor, and a surface far behind; a tilted plane has no edge.
        let left = |i: usize| i % 11 <= 5;
        let corner = spread(&|i| {
            if left(i) {
                [0.0, 0.0, 1.0, 5.0]
            } else {
                [0.0, 1.0, 0.0, 5.0]
            }
        });
        let behind = spread(&|i| [0.0, 0.0, 1.0, if left(i) { 5.0 } else { 9.0 }]);
        let tilted = spread(&|i| [0.0, 0.0, 1.0, 5.0 + 0.3 * (i % 11) as f32]);
        for (edge, expected) in [(corner, 0.0..0.01), (behind, 0.0..0.1), (tilted, 0.7..1.4)] {
            let ratio = edge[61].x / edge[59].x;
            assert!(expected.contains(&ratio), "{ratio} {expected:?}");
        }
        let value = |k: usize, b, i: usize| {
            let light = if i.is_multiple_of(7) { 0.0 } else { 1.0 };
            Rgb::splat(light * (1.0 + 0.3 * noise(k, b, i)))
        };
        let resolved = choose(
            &levels(16, value, 3),
            Resolve {
                sigma: 1.0,
                ..SHARP
            },
        );
        for (i, p) in resolved.picture.pixels.iter().enumerate() {
            assert_eq!(*p == Rgb::ZERO, i.is_multiple_of(7), "{i}");
        }
    }

    #[test]
    fn tent_keeps_constants_and_shares_sum_to_one() {
        for (w, h) in [(1, 1), (2, 9), (7, 5)] {
            let ones = tent((w, h), 1, &vec![Rgb::ONE; w * h]);
            assert!(
                ones.iter()
                    .all(|v| (*v - Rgb::ONE).abs().max_element() < 1e-6)
            );
        }
        let one = |i: usize| if i == 12 { Rgb::ONE } else { Rgb::ZERO };
        let spread = tent((5, 5), 1, &(0..25).map(one).collect::<Vec<Rgb>>());
        assert!((spread[12].x - 1.0 / 9.0).abs() < 1e-6, "{}", spread[12]);
        assert!(spread.iter().all(|v| v.x > 0.0));
    }

    #[test]
    fn robust_levels_lose_a_firefly() {
        let value = |_, b, i| Rgb::splat(if (b, i) == (2, 40) { 1000.0 } else { 1.0 });
        let all = levels(9, value, 2);
        let (mean, robust) = (choose(&all, SHARP), choose(&all, ROBUST));
        let least = |r: &Resolved| r.picture.pixels[40].x;
        assert!(
            least(&robust) < 0.6 * least(&mean),
            "{} {}",
            least(&robust),
            least(&mean)
        );
    }

    #[test]
    fn film_without_a_noise_estimate_shows_level_0() {
        fn path(levels: &[Rgb]) -> PathLevels<'_> {
            PathLevels {
                levels,
                shared: Rgb::ZERO,
                guide: [0.0; 4],
            }
        }
        let size = crate::math::UVec2::new(2, 1);
        let mut film = LevelFilm::new(size, crate::image::film::Window::full(size), 2);
        for sample in 0..BATCHES as u32 {
            let resolved = resolve_film(&film, SHARP);
            assert_eq!(resolved.picture, film.mean(0));
            assert_eq!(resolved.relative_error(), f64::INFINITY);
            for index in 0..2 {
                film.push(index, sample, &path(&[Rgb::ONE, Rgb::splat(0.5)]));
            }
        }
        assert_eq!(resolve_film(&film, SHARP).relative_error(), 0.0);
        film.push(0, 4, &path(&[Rgb::ONE, Rgb::splat(f32::NAN)]));
        assert_eq!(film.mean(1).pixels[0], Rgb::splat(0.5));
    }
}
