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

/// One level: its picture, and the same in independent batches.
#[derive(Clone, Debug)]
pub struct LevelMeans {
    /// Mean of all samples.
    pub mean: Buffer,
    /// Means of the batches.
    pub batches: [Buffer; BATCHES],
}

impl LevelMeans {
    /// The levels of a film, plain path tracing first.
    pub fn of(film: &LevelFilm) -> Vec<Self> {
        (0..film.levels())
            .map(|level| Self {
                mean: film.mean(level),
                batches: film.batch_means(level),
            })
            .collect()
    }
}

/// A picture whose level of roughening was chosen per pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Resolved {
    /// The picture.
    pub picture: Buffer,
    /// Chosen level of every pixel.
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
///
/// `robust` takes for each level the mean of its mean and of the median of its batches, which removes fireflies.
pub fn resolve_film(film: &LevelFilm, robust: bool) -> Resolved {
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
    resolve(&LevelMeans::of(film), robust)
}

/// Estimated relative error of a picture: of several levels that of the best of every pixel, else the noise of its film.
pub fn relative_error(picture: &Picture) -> f64 {
    match &picture.levels {
        Some(film) => resolve_film(film, false).relative_error(),
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
pub fn resolve(levels: &[LevelMeans], robust: bool) -> Resolved {
    let size = levels[0].mean.size();
    let weights = weights(size, &levels[levels.len() - 1].mean);
    let variance = variances(size, levels, &weights);
    let bias2 = biases(size, levels, &weights, &variance);
    let pixels = weights.len();
    let level: Vec<u8> = (0..pixels)
        .into_par_iter()
        .map(|i| {
            let error = |k: usize| bias2[k][i] + variance[k][i];
            // The least roughened of the best.
            let best =
                (1..levels.len()).fold(0, |best, k| if error(k) < error(best) { k } else { best });
            best as u8
        })
        .collect();
    let chosen = |of: &[Vec<f32>]| -> Vec<f32> {
        let one = |(i, &k): (usize, &u8)| of[usize::from(k)][i];
        level.iter().enumerate().map(one).collect()
    };
    Resolved {
        picture: picture(size, levels, &level, robust),
        bias2: chosen(&bias2),
        variance: chosen(&variance),
        level,
    }
}

/// Width and height.
type Size = (usize, usize);

/// w of every pixel and channel.
fn weights(size: Size, roughest: &Buffer) -> Vec<Rgb> {
    let sum: f64 = (roughest.pixels.iter())
        .map(|p| f64::from(p.element_sum()))
        .sum();
    let mean = sum / (3 * roughest.pixels.len()).max(1) as f64;
    let gain = if mean > 0.0 { (0.3 / mean) as f32 } else { 1.0 };
    let smooth = tent(size, RADIUS, &roughest.pixels);
    let weight = |i: &Rgb| {
        let i = *i * gain;
        Rgb::splat(gain * gain) / (i * i + EPSILON)
    };
    smooth.iter().map(weight).collect()
}

/// w V of every level.
fn variances(size: Size, levels: &[LevelMeans], weights: &[Rgb]) -> Vec<Vec<f32>> {
    levels
        .iter()
        .map(|level| {
            let noise: Vec<Rgb> = (0..weights.len())
                .into_par_iter()
                .map(|i| variance_of_mean(level.batches.each_ref().map(|b| b.pixels[i])))
                .collect();
            weighted(&tent(size, RADIUS, &noise), weights)
        })
        .collect()
}

/// b of every level.
fn biases(
    size: Size,
    levels: &[LevelMeans],
    weights: &[Rgb],
    variance: &[Vec<f32>],
) -> Vec<Vec<f32>> {
    let mut all = vec![vec![0.0f32; weights.len()]; levels.len()];
    for k in 1..levels.len() {
        for j in 0..k {
            let square: Vec<Rgb> = (0..weights.len())
                .into_par_iter()
                .map(|i| {
                    let d =
                        |b: usize| levels[k].batches[b].pixels[i] - levels[j].batches[b].pixels[i];
                    squared_difference(std::array::from_fn(d))
                })
                .collect();
            let bias = weighted(&tent(size, RADIUS, &square), weights);
            for (i, b) in all[k].iter_mut().enumerate() {
                *b = b.max(bias[i] - KAPPA * variance[j][i]);
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

/// The levels blended as they were chosen, with the energy that the choice lost.
fn picture(size: Size, levels: &[LevelMeans], chosen: &[u8], robust: bool) -> Buffer {
    let shares: Vec<Vec<Rgb>> = (0..levels.len())
        .map(|k| {
            let is = |&c: &u8| Rgb::splat(f32::from(u8::from(usize::from(c) == k)));
            tent(size, 1, &chosen.iter().map(is).collect::<Vec<Rgb>>())
        })
        .collect();
    let blend = |of: &(dyn Fn(usize, usize) -> Rgb + Sync)| -> Vec<Rgb> {
        let pixel = |i: usize| (0..levels.len()).map(|k| shares[k][i] * of(k, i)).sum();
        (0..chosen.len()).into_par_iter().map(pixel).collect()
    };
    let mut picture = blend(&|k, i| levels[k].mean.pixels[i]);
    // In proportion to this light is given back: shadows stay dark, and a pixel that no level lights stays black.
    let mut shape = picture.clone();
    if robust {
        // Without fireflies.
        shape = blend(&|k, i| median(levels[k].batches.each_ref().map(|b| b.pixels[i])));
        let pairs = picture.iter_mut().zip(&shape);
        pairs.for_each(|(mean, median)| *mean = 0.5 * (*mean + *median));
    }
    let lost = |plain: &Buffer, picture: &[Rgb]| {
        let pairs = plain.pixels.iter().zip(picture);
        let difference: Vec<Rgb> = pairs.map(|(a, b)| *a - *b).collect();
        tent(size, ENERGY_RADIUS, &difference)
    };
    let mu = lost(&levels[0].mean, &picture);
    let batches: [Vec<Rgb>; BATCHES] = std::array::from_fn(|b| {
        let part = blend(&|k, i| levels[k].batches[b].pixels[i]);
        lost(&levels[0].batches[b], &part)
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
    use crate::sampler::{Independent, IndependentStream, SampleSource, Sampler, Seed};

    fn stream(n: u32) -> IndependentStream {
        Independent { seed: Seed(5) }.stream(crate::math::UVec2::ZERO, n)
    }

    /// Levels of these batches, whose mean is the mean of the batches.
    fn levels(
        size: usize,
        of: impl Fn(usize, usize, usize) -> Rgb,
        count: usize,
    ) -> Vec<LevelMeans> {
        let picture =
            |f: &dyn Fn(usize) -> Rgb| Buffer::from_fn(size, size, |x, y| f(y * size + x));
        let level = |k: usize| {
            let batches = std::array::from_fn(|b| picture(&|i| of(k, b, i)));
            let all = |i: usize| (0..BATCHES).map(|b| of(k, b, i)).sum::<Rgb>() / BATCHES as f32;
            LevelMeans {
                mean: picture(&all),
                batches,
            }
        };
        (0..count).map(level).collect()
    }

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
        for robust in [false, true] {
            let resolved = resolve(&levels, robust);
            assert!(resolved.level.iter().all(|&k| k == 0));
            assert_eq!(resolved.picture, levels[0].mean);
            assert_eq!(resolved.relative_error(), 0.0);
        }
    }

    #[test]
    fn white_noise_on_a_constant_resolves_to_the_roughest_level() {
        let value =
            |k: usize, b, i| Rgb::splat(1.0 + 0.2 * 0.25f32.powi(k as i32) * noise(k, b, i));
        let resolved = resolve(&levels(32, value, 3), false);
        let count =
            |resolved: &Resolved, level| resolved.level.iter().filter(|&&k| k == level).count();
        // The estimate of a bias is noisy itself: 88 % by these numbers.
        let counts = [0, 1, 2].map(|k| count(&resolved, k));
        assert!(counts[2] > 800 && counts[0] < 80, "{counts:?}");
        // A level that adds light everywhere is not taken.
        let bright = |k: usize, b, i| value(k, b, i) + Rgb::splat(if k == 2 { 0.5 } else { 0.0 });
        let resolved = resolve(&levels(32, bright, 3), false);
        let counts = [0, 1, 2].map(|k| count(&resolved, k));
        assert!(counts[2] == 0 && counts[1] > 850, "{counts:?}");
    }

    /// Light that the path finds anyhow, in a room under a sky: roughening the last vertex makes it noisier.
    #[test]
    fn noisier_levels_are_not_chosen() {
        let value = |k: usize, b, i| Rgb::splat(1.0 + [0.05, 0.6, 0.3][k] * noise(k, b, i));
        let resolved = resolve(&levels(32, value, 3), false);
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
        let resolved = resolve(&levels(48, value, 2), false);
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
        let resolved = resolve(&all, false);
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
        let resolved = resolve(&all, false);
        assert!(resolved.level.iter().filter(|&&k| k == 1).count() > 2000);
        let mean = |b: &Buffer| b.pixels.iter().map(|p| p.x).sum::<f32>() / b.pixels.len() as f32;
        let (plain, rough) = (mean(&all[0].mean), mean(&all[1].mean));
        let lost = (mean(&resolved.picture) - plain).abs();
        assert!(lost < 0.35 * (plain - rough), "{plain} {rough} {lost}");
        for (i, p) in resolved.picture.pixels.iter().enumerate() {
            assert_eq!(*p == Rgb::ZERO, black(i), "{i}");
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
        let (mean, robust) = (resolve(&all, false), resolve(&all, true));
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
        let size = crate::math::UVec2::new(2, 1);
        let mut film = LevelFilm::new(size, crate::image::film::Window::full(size), 2);
        for sample in 0..BATCHES as u32 {
            let resolved = resolve_film(&film, false);
            assert_eq!(resolved.picture, film.mean(0));
            assert_eq!(resolved.relative_error(), f64::INFINITY);
            for index in 0..2 {
                film.push(index, sample, &[Rgb::ONE, Rgb::splat(0.5)]);
            }
        }
        assert_eq!(resolve_film(&film, false).relative_error(), 0.0);
        film.push(0, 4, &[Rgb::ONE, Rgb::splat(f32::NAN)]);
        assert_eq!(film.mean(1).pixels[0], Rgb::splat(0.5));
    }
}
