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
//! around; so is its variance, at half that weight.
//!
//! A level that has met nothing looks free of noise: V_k has the variance of what it has not met, too
//! (`coarse.rs`), as far as it was not to be expected.
//!
//! The picture is Σ_k tent_1(1[k* = k]) I_k, whose roughened light is brought to the energy of the best level at a coarse
//! scale by a smooth factor, so that what is given back has no shape of its own.
//!
//! Levels are chosen in tiles with as much around them as filters reach, sizes of hits and energy are taken on cells of
//! whole pictures: a film takes little memory beside its own.

mod blur;
mod coarse;
mod filter;
mod statement;

use crate::image::Buffer;
use crate::image::exr::Layer;
use crate::image::film::Window;
use crate::image::level_film::{BATCHES, LevelFilm};
use crate::integrator::Picture;
use crate::math::{Rgb, Vec3A};
use blur::{Blur, blur_radius};
use coarse::{Coarse, Missing};
use filter::{Size, tent};
use rayon::prelude::*;
use std::sync::Mutex;

pub use statement::{Statement, film_error, film_errors};

/// r: radius in pixels at which noise and bias are smoothed.
const RADIUS: usize = 1;

/// Radius in pixels at which light that a level has not met is looked for.
const MISSING_RADIUS: usize = 2;

/// Hits that must be expected where a pixel stays black that no level lights.
const DARKNESS: f32 = 4.0;

/// κ: share of the noise of the less roughened level that a difference must exceed.
const KAPPA: f32 = 0.25;

/// Share of the weight of the darkest pixel around that the noise of a blurred picture has at least.
const DARK: f32 = 0.5;

/// ε of relative errors, where the mean of the picture counts as 0.3.
const EPSILON: f32 = 0.01;

/// Radius in pixels of the filter of the shares of the levels.
const SHARE_RADIUS: usize = 1;

/// Pixels a side of the tiles that levels are chosen in.
const TILE: u32 = 64;

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

impl Resolve {
    /// Pixels around a tile that its picture depends on: shares of choices, which depend on noise and bias around, these
    /// on blurred pictures.
    fn reach(&self) -> u32 {
        let noise = 2 * RADIUS + blur_radius(self.sigma);
        (2 * SHARE_RADIUS + noise.max(2 * MISSING_RADIUS)) as u32
    }
}

/// The mean of all samples of a part of a picture, then those of the batches: colours in the registers of four numbers.
struct Means([Vec<Vec3A>; 1 + BATCHES]);

impl Means {
    /// Those of a level of a film, or of the shared light by the number of levels.
    fn of(film: &LevelFilm, level: usize) -> Self {
        let wide = |buffer: &Buffer| buffer.pixels.iter().copied().map(Vec3A::from).collect();
        let batches = film.batch_means(level);
        Self(std::array::from_fn(|i| match i {
            0 => wide(&film.mean(level)),
            _ => wide(&batches[i - 1]),
        }))
    }

    /// Mean of all samples.
    fn mean(&self) -> &[Vec3A] {
        &self.0[0]
    }

    /// Means of the batches at a pixel.
    fn batches(&self, pixel: usize) -> [Vec3A; BATCHES] {
        std::array::from_fn(|b| self.0[1 + b][pixel])
    }

    /// The same with everything but the shared light blurred. Pixels that are `dark` stay black.
    fn blurred(&self, shared: &Self, blur: &Blur, dark: &[bool]) -> Self {
        let mut pictures: [Vec<Vec3A>; 1 + BATCHES] = std::array::from_fn(|i| {
            let pairs = self.0[i].iter().zip(&shared.0[i]);
            pairs.map(|(whole, shared)| *whole - *shared).collect()
        });
        pictures = blur.apply(&pictures);
        for (picture, shared) in pictures.iter_mut().zip(&shared.0) {
            for (i, p) in picture.iter_mut().enumerate() {
                *p = if dark[i] { Vec3A::ZERO } else { shared[i] + *p };
            }
        }
        Self(pictures)
    }
}

/// A level, sharp or blurred.
struct Candidate {
    level: usize,
    blurred: bool,
    means: Means,
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

    /// Layers for EXR files: `level`; where a film had an estimate of its noise `bias2`, `variance` and `error` too.
    pub fn layers(&self) -> Vec<Layer> {
        let level = self.level.iter().map(|&k| f32::from(k)).collect();
        let mut layers = vec![Layer::scalar("level", level)];
        if self.variance.iter().all(|v| v.is_finite()) {
            layers.push(Layer::scalar("bias2", self.bias2.clone()));
            layers.push(Layer::scalar("variance", self.variance.clone()));
            layers.push(Layer::scalar("error", self.error()));
        }
        layers
    }

    /// What the picture states about its error: the root mean square of [`Resolved::error`], and 1 if it is black.
    pub fn statement(&self) -> Statement {
        if self.variance.contains(&f32::INFINITY) {
            return Statement::UNKNOWN;
        }
        if self.picture.pixels.iter().all(|p| *p == Rgb::ZERO) {
            return Statement::BLACK;
        }
        let pairs = self.bias2.iter().zip(&self.variance);
        Statement::of(pairs.map(|(b, v)| f64::from(b + v)))
    }

    /// [`Statement::error`] of the picture.
    pub fn relative_error(&self) -> f64 {
        self.statement().error
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
    resolve(film, settings, TILE)
}

/// What a picture states about its error with these settings of the choice: of several levels that of the best of every
/// pixel, else the noise of its film.
pub fn stated_error(picture: &Picture, settings: Resolve) -> Statement {
    match &picture.levels {
        Some(film) => resolve_film(film, settings).statement(),
        None => film_error(&picture.film),
    }
}

/// Error that a picture is stopped at: the stated one, and more where few bright samples decide it.
pub fn stopping_error(picture: &Picture) -> f64 {
    stated_error(picture, Resolve::default()).bound()
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

/// Chooses the level of every pixel in tiles of so many pixels a side; there is a sample in every batch.
fn resolve(film: &LevelFilm, settings: Resolve, edge: u32) -> Resolved {
    let window = film.window();
    let gain = gain(&film.mean(film.levels() - 1));
    let coarse = Coarse::roughened(film);
    let whole = Mutex::new(Choice::blank(window.len()));
    window.tiles(edge).into_par_iter().for_each(|tile| {
        let around = surroundings(&tile, settings.reach(), &window);
        let origin = (
            (around.x - window.x) as usize,
            (around.y - window.y) as usize,
        );
        let part = choose(&film.cut(around), origin, &coarse, gain, settings);
        let mut whole = whole.lock().expect("no thread panics");
        whole.paste(&window, &part, &around, &tile);
    });
    let choice = whole.into_inner().expect("no thread panics");
    choice.with_energy(film, &coarse, settings)
}

/// A tile and so many pixels on each side, within the window.
fn surroundings(tile: &Window, reach: u32, window: &Window) -> Window {
    let range = |start: u32, length: u32, first: u32, all: u32| {
        let from = start.saturating_sub(reach).max(first);
        let to = start.saturating_add(length).saturating_add(reach);
        (from, to.min(first + all) - from)
    };
    let (x, w) = range(tile.x, tile.w, window.x, window.w);
    let (y, h) = range(tile.y, tile.h, window.y, window.h);
    Window { x, y, w, h }
}

/// The choice of every pixel.
struct Choice {
    level: Vec<u8>,
    bias2: Vec<f32>,
    variance: Vec<f32>,
    /// Light of roughened vertices of the candidates, blended as they were chosen.
    roughened: Vec<Rgb>,
}

impl Choice {
    fn blank(pixels: usize) -> Self {
        Self {
            level: vec![0; pixels],
            bias2: vec![0.0; pixels],
            variance: vec![0.0; pixels],
            roughened: vec![Rgb::ZERO; pixels],
        }
    }

    /// Takes over a tile from a part of the window.
    fn paste(&mut self, window: &Window, part: &Self, part_window: &Window, tile: &Window) {
        let place =
            |of: &Window, y: u32| (y - of.y) as usize * of.w as usize + (tile.x - of.x) as usize;
        let w = tile.w as usize;
        for y in tile.y..tile.y + tile.h {
            let (to, from) = (place(window, y), place(part_window, y));
            let (to, from) = (to..to + w, from..from + w);
            self.roughened[to.clone()].copy_from_slice(&part.roughened[from.clone()]);
            self.bias2[to.clone()].copy_from_slice(&part.bias2[from.clone()]);
            self.variance[to.clone()].copy_from_slice(&part.variance[from.clone()]);
            self.level[to].copy_from_slice(&part.level[from]);
        }
    }

    /// The picture: what all levels share, and the roughened light with the energy of the best level at a coarse scale.
    fn with_energy(self, film: &LevelFilm, coarse: &Coarse, settings: Resolve) -> Resolved {
        let window = film.window();
        let mut picture = film.mean(film.levels());
        if settings.robust {
            // Without fireflies, whose light is given back to the surroundings.
            for (pixel, p) in picture.pixels.iter_mut().enumerate() {
                let batch = |b| film.batch_mean(pixel, b, film.levels()).into();
                *p = 0.5 * (*p + Rgb::from(median(std::array::from_fn(batch))));
            }
            let energy = Coarse::shared(film).energy(|pixel| picture.pixels[pixel].into());
            let pixels = picture.pixels.iter_mut().enumerate();
            pixels.for_each(|(pixel, p)| *p *= Rgb::from(energy.at(pixel)));
        }
        let energy = coarse.energy(|pixel| self.roughened[pixel].into());
        let pairs = picture.pixels.iter_mut().zip(&self.roughened);
        for (pixel, (p, light)) in pairs.enumerate() {
            *p += *light * Rgb::from(energy.at(pixel));
        }
        debug_assert_eq!(picture.pixels.len(), window.len());
        Resolved {
            picture,
            level: self.level,
            bias2: self.bias2,
            variance: self.variance,
        }
    }
}

/// Chooses the level of every pixel of a part of a film that begins at `origin`, where a brightness of 1 counts as `gain`.
/// Pixels at edges that are not the film's own are wrong.
fn choose(
    film: &LevelFilm,
    origin: (usize, usize),
    coarse: &Coarse,
    gain: f32,
    settings: Resolve,
) -> Choice {
    let levels: Vec<Means> = (0..film.levels()).map(|k| Means::of(film, k)).collect();
    let shared = Means::of(film, film.levels());
    let Window { w, h, .. } = film.window();
    let size = (w as usize, h as usize);
    let missing = missing(size, origin, coarse, &levels, &shared);
    let roughest = levels[levels.len() - 1].mean();
    let mut smooth = roughest.to_vec();
    tent(size, RADIUS, &mut smooth);
    let weights = [
        weights(gain, &smooth),
        weights(gain, &darkest(size, roughest)),
    ];
    let blur = (settings.sigma > 0.0).then(|| Blur::new(size, settings.sigma, &film.features()));
    let roughest = &missing[missing.len() - 1];
    let dark = |i: usize| roughest[i].expected >= DARKNESS;
    let candidates = candidates(levels, &shared, blur.as_ref(), dark);
    let noise: Vec<Vec<Vec3A>> = (candidates.iter())
        .map(|c| {
            // A blur of s pixels averages about 1 + s² of them.
            let times = if c.blurred {
                1.0 + settings.sigma.powi(2)
            } else {
                1.0
            };
            let mut noise = noise(size, &c.means);
            let pairs = noise.iter_mut().zip(&missing[c.level]);
            pairs.for_each(|(noise, missing)| *noise += missing.noise(times));
            noise
        })
        .collect();
    let [light, dark] = &weights;
    let variance: Vec<Vec<f32>> = noise.iter().map(|v| weighted(v, light)).collect();
    let bias2 = biases(size, &candidates, &weights, &variance);
    // Noise that a blur takes across an edge is seen on the dark side.
    let pairs = light.iter().zip(dark);
    let edges: Vec<Vec3A> = pairs.map(|(w, dark)| w.max(DARK * *dark)).collect();
    let of_blurred: Vec<Vec<f32>> = (candidates.iter().zip(&noise))
        .filter(|(c, _)| c.blurred)
        .map(|(_, v)| weighted(v, &edges))
        .collect();
    let judged: Vec<&Vec<f32>> = (variance[..film.levels()].iter())
        .chain(&of_blurred)
        .collect();
    let best = |i: usize| {
        let error = |k: usize| bias2[k][i] + judged[k][i];
        // The first of the best: the least roughened, and sharp.
        (1..candidates.len()).fold(0, |best, k| if error(k) < error(best) { k } else { best })
    };
    let chosen: Vec<usize> = (0..film.window().len()).map(best).collect();
    // The layers are relative as the metrics are, whatever the exposure.
    let grey = |v: Vec3A| v.element_sum();
    let stated: Vec<f32> = (light.iter().zip(&smooth))
        .map(|(w, i)| grey((*i * *i + EPSILON).recip()) / grey(*w))
        .collect();
    let of_chosen = |of: &[Vec<f32>]| -> Vec<f32> {
        let pairs = chosen.iter().zip(&stated).enumerate();
        pairs.map(|(i, (&k, stated))| of[k][i] * stated).collect()
    };
    let level = chosen.iter().map(|&k| candidates[k].level as u8);
    let blend = Blend::new(size, &candidates, &chosen);
    let mut roughened = blend.of(|c, i| c.means.mean()[i] - shared.mean()[i]);
    if settings.robust {
        // Without fireflies.
        let medians = blend.of(|c, i| {
            let (all, shared) = (c.means.batches(i), shared.batches(i));
            median(std::array::from_fn(|b| all[b] - shared[b]))
        });
        let pairs = roughened.iter_mut().zip(medians);
        pairs.for_each(|(mean, median)| *mean = 0.5 * (*mean + median));
    }
    Choice {
        level: level.collect(),
        bias2: of_chosen(&bias2),
        variance: of_chosen(&variance),
        roughened: roughened.into_iter().map(Rgb::from).collect(),
    }
}

/// What every level has not met, by level and pixel of a part of a picture that begins at `origin`.
fn missing(
    size: Size,
    origin: (usize, usize),
    coarse: &Coarse,
    levels: &[Means],
    shared: &Means,
) -> Vec<Vec<Missing>> {
    let smooth = |level: &Means| -> Vec<Vec3A> {
        let pairs = level.mean().iter().zip(shared.mean());
        let light = |(all, shared): (&Vec3A, &Vec3A)| (*all - *shared).max(Vec3A::ZERO);
        let mut light: Vec<Vec3A> = pairs.map(light).collect();
        tent(size, MISSING_RADIUS, &mut light);
        light
    };
    let light: Vec<Vec<Vec3A>> = levels.iter().map(smooth).collect();
    let mut missing: Vec<Vec<Missing>> =
        light.iter().map(|l| Vec::with_capacity(l.len())).collect();
    let pixels = (0..size.1).flat_map(|y| (0..size.0).map(move |x| (x, y)));
    for (i, (x, y)) in pixels.enumerate() {
        let pixel = (origin.0 + x, origin.1 + y);
        let here = coarse.missing(pixel, |level| light[level][i]);
        missing
            .iter_mut()
            .zip(here)
            .for_each(|(all, one)| all.push(one));
    }
    missing
}

/// A blend of candidates.
struct Blend<'a> {
    candidates: &'a [Candidate],
    /// Share of every pixel by candidate.
    shares: Vec<Vec<f32>>,
}

impl<'a> Blend<'a> {
    /// Blend of candidates as they were chosen, without hard edges.
    fn new(size: Size, candidates: &'a [Candidate], chosen: &[usize]) -> Self {
        let share = |k: usize| {
            let is = |&c: &usize| f32::from(u8::from(c == k));
            let mut share: Vec<f32> = chosen.iter().map(is).collect();
            tent(size, SHARE_RADIUS, &mut share);
            share
        };
        Self {
            candidates,
            shares: (0..candidates.len()).map(share).collect(),
        }
    }

    fn of(&self, value: impl Fn(&Candidate, usize) -> Vec3A) -> Vec<Vec3A> {
        let mut sum = vec![Vec3A::ZERO; self.shares[0].len()];
        for (candidate, shares) in self.candidates.iter().zip(&self.shares) {
            for (i, (sum, &share)) in sum.iter_mut().zip(shares).enumerate() {
                if share > 0.0 {
                    *sum += share * value(candidate, i);
                }
            }
        }
        sum
    }
}

/// The levels, then all but level 0 blurred, where there is a blur.
fn candidates(
    levels: Vec<Means>,
    shared: &Means,
    blur: Option<&Blur>,
    dark: impl Fn(usize) -> bool,
) -> Vec<Candidate> {
    let mut blurred = Vec::new();
    if let Some(blur) = blur {
        let lit = |i: usize| levels.iter().any(|level| level.mean()[i] != Vec3A::ZERO);
        let black = |i| !lit(i) && dark(i);
        let dark: Vec<bool> = (0..shared.mean().len()).map(black).collect();
        let one = |(level, means): (usize, &Means)| Candidate {
            level,
            blurred: true,
            means: means.blurred(shared, blur, &dark),
        };
        blurred.extend(levels.iter().enumerate().skip(1).map(one));
    }
    let sharp = |(level, means)| Candidate {
        level,
        blurred: false,
        means,
    };
    let sharp = levels.into_iter().enumerate().map(sharp);
    sharp.chain(blurred).collect()
}

/// The factor that makes the mean of a picture 0.3.
fn gain(picture: &Buffer) -> f32 {
    let sum: f64 = (picture.pixels.iter())
        .map(|p| f64::from(p.element_sum()))
        .sum();
    let mean = sum / (3 * picture.pixels.len()).max(1) as f64;
    if mean > 0.0 { (0.3 / mean) as f32 } else { 1.0 }
}

/// w of every pixel and channel for these brightnesses.
fn weights(gain: f32, brightness: &[Vec3A]) -> Vec<Vec3A> {
    let weight = |i: &Vec3A| {
        let i = *i * gain;
        Vec3A::splat(gain * gain) / (i * i + EPSILON)
    };
    brightness.iter().map(weight).collect()
}

/// The least of a pixel and its neighbours.
fn darkest((width, height): Size, values: &[Vec3A]) -> Vec<Vec3A> {
    let around = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
    let least = |i: usize| {
        let rows = around(i / width, height);
        let near = rows.flat_map(|y| around(i % width, width).map(move |x| values[y * width + x]));
        near.fold(values[i], Vec3A::min)
    };
    (0..values.len()).map(least).collect()
}

/// V of a candidate.
fn noise(size: Size, means: &Means) -> Vec<Vec3A> {
    let own = |i: usize| variance_of_mean(means.batches(i));
    let mut noise: Vec<Vec3A> = (0..means.mean().len()).map(own).collect();
    tent(size, RADIUS, &mut noise);
    noise
}

/// b of every candidate.
fn biases(
    size: Size,
    candidates: &[Candidate],
    [weights, dark]: &[Vec<Vec3A>; 2],
    variance: &[Vec<f32>],
) -> Vec<Vec<f32>> {
    let mut all = vec![vec![0.0f32; weights.len()]; candidates.len()];
    for (all, one) in all.iter_mut().zip(candidates) {
        for (anchor, noise) in candidates.iter().zip(variance) {
            if !one.judged_by(anchor) {
                continue;
            }
            let square = |i: usize| {
                let (ours, theirs) = (one.means.batches(i), anchor.means.batches(i));
                let square = squared_difference(std::array::from_fn(|b| ours[b] - theirs[b]));
                // Light that a blur takes across an edge is seen on the dark side.
                if one.blurred {
                    square * dark[i]
                } else {
                    square
                }
            };
            let mut smooth: Vec<Vec3A> = (0..weights.len()).map(square).collect();
            tent(size, RADIUS, &mut smooth);
            let bias: Vec<f32> = if one.blurred {
                smooth
                    .iter()
                    .map(|v| Rgb::from(*v).element_sum() / 3.0)
                    .collect()
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
fn squared_difference(d: [Vec3A; BATCHES]) -> Vec3A {
    let (sum, squares) = d.iter().fold((Vec3A::ZERO, Vec3A::ZERO), |(s, q), d| {
        (s + *d, q + *d * *d)
    });
    (sum * sum - squares) / (BATCHES * (BATCHES - 1)) as f32
}

/// Estimated variance of the mean of independent numbers.
fn variance_of_mean(x: [Vec3A; BATCHES]) -> Vec3A {
    let mean = x.iter().sum::<Vec3A>() / BATCHES as f32;
    let squares: Vec3A = x.iter().map(|x| (*x - mean) * (*x - mean)).sum();
    squares / (BATCHES * (BATCHES - 1)) as f32
}

/// Mean over the channels of values times their weights.
fn weighted(values: &[Vec3A], weights: &[Vec3A]) -> Vec<f32> {
    let pairs = values.iter().zip(weights);
    let mean = |(v, w): (&Vec3A, &Vec3A)| Rgb::from(*v).dot(Rgb::from(*w)) / 3.0;
    pairs.map(mean).collect()
}

/// Median of the batches: the mean of the middle two, by channel.
fn median(x: [Vec3A; BATCHES]) -> Vec3A {
    let channel = |c: usize| {
        let mut sorted = x.map(|x| x[c]);
        sorted.sort_by(f32::total_cmp);
        0.5 * (sorted[BATCHES / 2 - 1] + sorted[BATCHES / 2])
    };
    Vec3A::new(channel(0), channel(1), channel(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::level_film::PathLevels;
    use crate::sampler::{Independent, IndependentStream, SampleSource, Sampler, Seed};

    fn stream(n: u32) -> IndependentStream {
        Independent { seed: Seed(5) }.stream(crate::math::UVec2::ZERO, n)
    }

    /// A square film of one sample a batch, all of whose light is roughened.
    fn levels(size: usize, of: impl Fn(usize, usize, usize) -> Rgb, count: usize) -> LevelFilm {
        film(size, of, count, |_| Rgb::ZERO)
    }

    /// A square film of one sample a batch: the light by level, batch and pixel, and what no level roughens.
    fn film(
        size: usize,
        of: impl Fn(usize, usize, usize) -> Rgb,
        count: usize,
        shared: impl Fn(usize) -> Rgb,
    ) -> LevelFilm {
        let frame = crate::math::UVec2::splat(size as u32);
        let mut film = LevelFilm::new(frame, Window::full(frame), count);
        for i in 0..size * size {
            for b in 0..BATCHES {
                let levels: Vec<Rgb> = (0..count).map(|k| of(k, b, i)).collect();
                let path = PathLevels {
                    levels: &levels,
                    shared: shared(i),
                    features: [0.0; 4],
                };
                film.push(i, b as u32, &path);
            }
        }
        film
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
                    Vec3A::splat(hit - 1.0 + offset)
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
            let resolved = resolve_film(&levels, Resolve { robust, sigma });
            assert!(resolved.level.iter().all(|&k| k == 0));
            assert_eq!(resolved.picture, levels.mean(0));
            // Hits are expected, and their absence is told from darkness by exp(−e).
            assert!(resolved.relative_error() < 1e-6);
        }
    }

    #[test]
    fn white_noise_on_a_constant_resolves_to_the_roughest_level() {
        let value =
            |k: usize, b, i| Rgb::splat(1.0 + 0.2 * 0.25f32.powi(k as i32) * noise(k, b, i));
        let resolved = resolve_film(&levels(32, value, 3), SHARP);
        let count =
            |resolved: &Resolved, level| resolved.level.iter().filter(|&&k| k == level).count();
        // The estimate of a bias is noisy itself: 88 % by these numbers.
        let counts = [0, 1, 2].map(|k| count(&resolved, k));
        assert!(counts[2] > 800 && counts[0] < 80, "{counts:?}");
        // A level that adds light everywhere is not taken.
        let bright = |k: usize, b, i| value(k, b, i) + Rgb::splat(if k == 2 { 0.5 } else { 0.0 });
        let resolved = resolve_film(&levels(32, bright, 3), SHARP);
        let counts = [0, 1, 2].map(|k| count(&resolved, k));
        assert!(counts[2] == 0 && counts[1] > 850, "{counts:?}");
    }

    /// Light that the path finds anyhow, in a room under a sky: roughening the last vertex makes it noisier.
    #[test]
    fn noisier_levels_are_not_chosen() {
        let value = |k: usize, b, i| Rgb::splat(1.0 + [0.05, 0.6, 0.3][k] * noise(k, b, i));
        let resolved = resolve_film(&levels(32, value, 3), SHARP);
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
        let resolved = resolve_film(&levels(48, value, 2), SHARP);
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
        let resolved = resolve_film(&all, SHARP);
        for (i, (p, q)) in resolved
            .picture
            .pixels
            .iter()
            .zip(&all.mean(0).pixels)
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
        let resolved = resolve_film(&all, SHARP);
        assert!(resolved.level.iter().filter(|&&k| k == 1).count() > 2000);
        let mean = |b: &Buffer| b.pixels.iter().map(|p| p.x).sum::<f32>() / b.pixels.len() as f32;
        let (plain, rough) = (mean(&all.mean(0)), mean(&all.mean(1)));
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
        let shared = |i: usize| Rgb::splat(texture(i));
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
        for (spread, most) in [(0.2, 0.7), (0.002, 1.1)] {
            let all = film(size, value(spread), 2, shared);
            let sharp = error(&resolve_film(&all, SHARP));
            let blurred = error(&resolve_film(&all, blur));
            assert!(blurred < most * sharp, "{spread}: {blurred} {sharp}");
        }
    }

    /// Noise of one batch beside dark pixels without noise, which no difference of batches tells from bias.
    #[test]
    fn blur_leaves_dark_pixels_beside_noise_dark() {
        let (size, bright) = (32, |i: usize| i.is_multiple_of(8));
        let value = |k: usize, b: usize, i: usize| {
            let lit = bright(i) && b == (i / 8) % BATCHES;
            Rgb::splat(if lit { 8.0 - 0.1 * k as f32 } else { 0.01 })
        };
        let resolved = resolve_film(&levels(size, value, 3), Resolve::default());
        let pixels = resolved.picture.pixels.iter().enumerate();
        let dark: Vec<f32> = pixels
            .filter(|(i, _)| !bright(*i))
            .map(|(_, p)| p.x)
            .collect();
        let worst = dark.iter().fold(0.0f32, |most, p| most.max(*p));
        assert!(worst < 0.05, "{worst}");
    }

    #[test]
    fn gaussian_filter_keeps_constants_and_a_pixel_without_light_stays_black() {
        for (w, h) in [(1, 1), (2, 9), (7, 5)] {
            let blur = Blur::new((w, h), 0.7, &vec![[0.0; 4]; w * h]);
            let [ones] = blur.apply(&[vec![Vec3A::ONE; w * h]]);
            assert!(
                ones.iter()
                    .all(|v| (*v - Vec3A::ONE).abs().max_element() < 1e-6)
            );
        }
        let one = |i: usize| if i == 60 { Vec3A::ONE } else { Vec3A::ZERO };
        let spread = |features: &dyn Fn(usize) -> [f32; 4]| {
            let features: Vec<[f32; 4]> = (0..121).map(features).collect();
            let point: Vec<Vec3A> = (0..121).map(one).collect();
            let [blurred] = Blur::new((11, 11), 1.0, &features).apply(&[point]);
            blurred
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
        let resolved = resolve_film(
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
            let mut ones = vec![Rgb::ONE; w * h];
            tent((w, h), 1, &mut ones);
            assert!(
                ones.iter()
                    .all(|v| (*v - Rgb::ONE).abs().max_element() < 1e-6)
            );
        }
        let one = |i: usize| if i == 12 { Rgb::ONE } else { Rgb::ZERO };
        let mut spread: Vec<Rgb> = (0..25).map(one).collect();
        tent((5, 5), 1, &mut spread);
        assert!((spread[12].x - 1.0 / 9.0).abs() < 1e-6, "{}", spread[12]);
        assert!(spread.iter().all(|v| v.x > 0.0));
    }

    #[test]
    fn robust_levels_lose_a_firefly() {
        let value = |_, b, i| Rgb::splat(if (b, i) == (2, 40) { 1000.0 } else { 1.0 });
        let all = levels(9, value, 2);
        let (mean, robust) = (resolve_film(&all, SHARP), resolve_film(&all, ROBUST));
        let least = |r: &Resolved| r.picture.pixels[40].x;
        assert!(
            least(&robust) < 0.6 * least(&mean),
            "{} {}",
            least(&robust),
            least(&mean)
        );
    }

    /// Any light, noise and features: a tile knows as much of its surroundings as its pixels depend on.
    #[test]
    fn resolve_in_tiles_has_the_bytes_of_the_whole() {
        let frame = crate::math::UVec2::new(61, 38);
        let window = Window {
            x: 3,
            y: 5,
            w: 53,
            h: 31,
        };
        let mut film = LevelFilm::new(frame, window, 4);
        for index in 0..window.len() {
            for sample in 0..2 * BATCHES as u32 {
                let mut stream = stream(index as u32 * 16 + sample);
                let mut next = || stream.next_1d();
                let shared = Rgb::new(next(), next(), next());
                let bright =
                    |k: usize, u: f32| (0.5 - 0.1 * k as f32) / (u + 0.01 + 0.2 * k as f32);
                let levels: [Rgb; 4] = std::array::from_fn(|k| shared + bright(k, next()));
                let path = PathLevels {
                    levels: &levels,
                    shared,
                    features: [next(), 0.1 * next(), 0.9, 3.0 + 0.2 * next()],
                };
                film.push(index, sample, &path);
            }
        }
        for (robust, sigma) in [(false, 0.0), (true, 0.3), (false, 0.7), (true, 1.5)] {
            let settings = Resolve { robust, sigma };
            let whole = resolve(&film, settings, 64);
            assert!((0..4).filter(|k| whole.level.contains(k)).count() > 1);
            for edge in [1, 7, 32] {
                assert_eq!(resolve(&film, settings, edge), whole, "{settings:?} {edge}");
            }
        }
    }

    /// Level 0 finds light in one of 500 batches of a pixel, level 1 a little less light everywhere: in most windows level 0
    /// has met nothing, and looks free of noise.
    #[test]
    fn light_that_a_level_has_not_met_is_not_dark() {
        let rare = |b: usize, i: usize| {
            let hit = stream((i * 8 + b) as u32 + 90_000).next_1d() < 0.002;
            if hit { 500.0 } else { 0.0 }
        };
        for sigma in [0.0, 0.7] {
            let value = |k: usize, b, i| {
                Rgb::splat(match k {
                    0 => rare(b, i),
                    _ => 0.95 + 0.3 * noise(k, b, i),
                })
            };
            let settings = Resolve { sigma, ..SHARP };
            let resolved = resolve_film(&levels(64, value, 2), settings);
            let dark = resolved.picture.pixels.iter().filter(|p| p.x < 0.3).count();
            assert!(dark < 4096 / 50, "{sigma}: {dark} dark pixels");
            // No light is brought to the surroundings of a hit as a shape: the mean of every tile of 16 pixels is right.
            for tile in 0..16 {
                let (x, y) = (tile % 4 * 16, tile / 4 * 16);
                let pixels = (0..256).map(|i| (y + i / 16) * 64 + x + i % 16);
                let mut all: Vec<f32> = pixels.map(|i| resolved.picture.pixels[i].x).collect();
                all.sort_by(f32::total_cmp);
                assert!((0.5..1.9).contains(&all[128]), "{tile}: {}", all[128]);
            }
        }
    }

    /// A shadow that level 0 leaves dark and a rough level lights: where hits are as small as the light beside, darkness is
    /// what level 0 has seen.
    #[test]
    fn darkness_is_believed_where_hits_are_expected() {
        let shadow = |i: usize| i % 32 < 16;
        let value = |k: usize, b, i| {
            let light = match (k, shadow(i)) {
                (0, true) => 0.01,
                (_, true) => 0.1,
                (_, false) => 1.0,
            };
            Rgb::splat(light * (1.0 + 0.2 * noise(k, b, i)))
        };
        let resolved = resolve_film(&levels(32, value, 2), SHARP);
        let pixels = resolved.picture.pixels.iter().enumerate();
        // The edge itself is smoothed.
        let inner = pixels.filter(|(i, _)| (2..14).contains(&(i % 32)));
        let worst = inner.fold(0.0f32, |worst, (_, p)| worst.max(p.x));
        assert!(worst < 0.03, "{worst}");
    }

    /// A pixel that no level has lit, in a wall whose light comes in rare hits, gets the light around it.
    #[test]
    fn black_pixels_of_a_lit_wall_are_filled() {
        let value = |k: usize, b: usize, i: usize| {
            let hit = stream((i * 8 + b) as u32 + 70_000).next_1d() < 0.05;
            Rgb::splat(if hit && i != 24 * 49 {
                20.0 - 0.1 * k as f32
            } else {
                0.0
            })
        };
        let film = levels(48, value, 3);
        let black = |p: &&Rgb| **p == Rgb::ZERO;
        let plain = film.mean(0).pixels.iter().filter(black).count();
        let resolved = resolve_film(&film, Resolve::default());
        let left = resolved.picture.pixels.iter().filter(black).count();
        assert!(plain > 1500 && left < plain / 4, "{plain} {left}");
    }

    /// Light that comes in hits of known size, and the hits that a window expects of it.
    #[test]
    fn size_of_hits_and_expected_hits_are_known_ones() {
        let value = |k: usize, b: usize, i: usize| {
            let (chance, size) = [(0.01, 100.0), (0.25, 4.0)][k];
            let hit = stream((i * 8 + b) as u32 + 50_000 * k as u32).next_1d() < chance;
            Rgb::splat(if hit { size } else { 0.0 })
        };
        let coarse = Coarse::roughened(&levels(64, value, 2));
        let light = |level: usize| Vec3A::splat([0.25, 1.0][level]);
        let missing: Vec<Missing> = coarse.missing((31, 30), light).collect();
        // D M / B = 0.75 · 100 / 4, e = 12 · 4 · 1 / 100.
        assert!(
            (missing[0].variance.x - 18.75).abs() < 1e-3,
            "{}",
            missing[0].variance
        );
        assert!(
            (missing[0].expected - 0.48).abs() < 1e-4,
            "{}",
            missing[0].expected
        );
        assert_eq!(missing[1].variance, Vec3A::ZERO);
        assert!(
            (missing[1].expected - 12.0).abs() < 1e-3,
            "{}",
            missing[1].expected
        );
        let [sharp, blurred] = [1.0, 1.5].map(|times| missing[0].noise(times).x);
        assert!((sharp - 18.75 * (-0.48f32).exp()).abs() < 1e-3, "{sharp}");
        assert!(
            (blurred - 18.75 * (-0.72f32).exp()).abs() < 1e-3,
            "{blurred}"
        );
    }

    #[test]
    fn black_picture_states_an_error_of_1() {
        let film = levels(8, |_, _, _| Rgb::ZERO, 2);
        assert_eq!(
            resolve_film(&film, Resolve::default()).relative_error(),
            1.0
        );
    }

    #[test]
    fn film_without_a_noise_estimate_shows_level_0() {
        fn path(levels: &[Rgb]) -> PathLevels<'_> {
            PathLevels {
                levels,
                shared: Rgb::ZERO,
                features: [0.0; 4],
            }
        }
        let size = crate::math::UVec2::new(2, 1);
        let mut film = LevelFilm::new(size, crate::image::film::Window::full(size), 2);
        for sample in 0..BATCHES as u32 {
            let resolved = resolve_film(&film, SHARP);
            assert_eq!(resolved.picture, film.mean(0));
            assert_eq!(resolved.relative_error(), f64::INFINITY);
            let names: Vec<_> = (resolved.layers().into_iter()).map(|l| l.name).collect();
            assert_eq!(names, ["level"], "an error of which nothing is known");
            for index in 0..2 {
                film.push(index, sample, &path(&[Rgb::ONE, Rgb::splat(0.5)]));
            }
        }
        assert!(resolve_film(&film, SHARP).relative_error() < 1e-6);
        assert_eq!(resolve_film(&film, SHARP).layers().len(), 4);
        film.push(0, 4, &path(&[Rgb::ONE, Rgb::splat(f32::NAN)]));
        assert_eq!(film.mean(1).pixels[0], Rgb::splat(0.5));
    }
}
