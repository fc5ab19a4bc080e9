//! The choice in tiles, with the margins that filters reach.

use super::coarse::{Caps, Coarse, Missing};
use super::filter::{Size, tent};
use super::guide::{Guide, Inner, Surface, reach};
use super::layer::{
    Batches, COMMON_RADIUS, Candidate, Choice, RADIUS, SHARE_RADIUS, WIDE_RADIUS, Weights,
};
use crate::image::film::Window;
use crate::image::level_film::{BATCHES, Features, LevelFilm, MAX_LEVELS};
use crate::math::{Rgb, Vec3A};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Mutex;

/// Edges of the tiles in pixels: large tiles, whose margins are relatively small, if there are enough for all threads.
/// Tiles of 160 take 0.96 of the time, and more memory.
const EDGES: [u32; 2] = [128, 64];

/// Largest picture in pixels that a single thread takes as one tile.
const SMALL: usize = 1 << 16;

/// The edge of the tiles of a film.
pub(super) fn edge(window: &Window) -> u32 {
    let threads = rayon::current_num_threads();
    if threads == 1 && window.len() <= SMALL {
        return window.w.max(window.h);
    }
    let busy = |edge: &u32| window.tiles(*edge).len() >= 2 * threads;
    EDGES.into_iter().find(busy).unwrap_or(EDGES[1])
}

/// Radius in pixels over which light that a level has missed is estimated.
const MISSING_RADIUS: usize = 2;

/// ε of relative errors, for a picture scaled to a mean of 0.3.
const EPSILON: f32 = 0.01;

/// Light above which a batch of the only level is a glint and not blurred, for a picture scaled to a mean of 0.3.
const GLINT: f32 = 1.2;

/// Margin in pixels around a tile whose candidates its choice depends on: blended shares depend on the choices around,
/// these on noise and bias around, and these on one more pixel.
const AROUND: usize = 2 * (SHARE_RADIUS + WIDE_RADIUS) + COMMON_RADIUS + 1;

/// Smoothing that a picture of several levels may get.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Resolve {
    /// None: the means of all samples as they are, of several levels those of level 0, plain path tracing.
    None,
    /// Every pixel gets the level with the least error.
    Sharp,
    /// Every pixel gets the level with the least error, and blurs where they make it less.
    #[default]
    Default,
}

/// Candidates of the choice, and the bound for their bias.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Largest number of levels.
    pub(super) levels: usize,
    /// Standard deviations in pixels of blurs of both layers, ascending; one layer also has [`WIDE`].
    pub(super) blurs: &'static [f32],
    /// κ: share of the noise of a sharper candidate that a difference must exceed; below 0 noise counts as bias.
    pub(super) kappa: f32,
}

impl Limits {
    /// Limits of a setting, measured in docs/lab/resolve.md, and for one level in docs/lab/photons.md.
    pub(super) fn of(settings: Resolve, levels: usize) -> Self {
        let (most, blurs): (usize, &[f32]) = match settings {
            Resolve::None => (1, &[]),
            Resolve::Sharp => (MAX_LEVELS, &[]),
            Resolve::Default => (MAX_LEVELS, &[0.7, BASE, 3.0]),
        };
        Self {
            levels: most,
            blurs,
            // One level has edges of shadows and textures, and no other level distinguishes noise from them.
            kappa: if levels == 1 { -0.25 } else { 0.25 },
        }
    }
}

/// Data of a film that all tiles share.
pub(super) struct Shared<'a> {
    pub(super) film: &'a LevelFilm,
    pub(super) roughened: Coarse,
    pub(super) caps: Caps,
    /// Each batch's share of the samples.
    pub(super) shares: [f32; BATCHES],
    /// Factor that makes the mean of the picture 0.3.
    pub(super) gain: f32,
    pub(super) limits: Limits,
}

impl Shared<'_> {
    /// Margin in pixels around a tile that its picture depends on.
    fn reach(&self) -> u32 {
        let blur = match self.limits.blurs {
            [] => 0,
            _ => reach(rest(WIDE)) + reach(BASE),
        };
        (AROUND + blur.max(2 * MISSING_RADIUS)) as u32
    }

    /// Chooses in tiles with `edge` pixels a side; at least two batches must have samples.
    pub(super) fn choose(&self, edge: u32) -> Chosen {
        let window = self.film.window();
        let whole = Mutex::new(Chosen::blank((window.w as usize, window.h as usize)));
        window.tiles(edge).into_par_iter().for_each(|tile| {
            let chosen = TileData::new(self, &tile).choose();
            let mut whole = whole.lock().expect("no thread panics");
            whole.paste(window.w as usize, chosen);
        });
        whole.into_inner().expect("no thread panics")
    }
}

/// Standard deviation in pixels of the widest blur, for the layer with most of the light: the only level, or the light
/// that all levels share.
pub(super) const WIDE: f32 = 6.0;

/// Standard deviation in pixels of the blur that the wide one is built from.
pub(super) const BASE: f32 = 1.5;

/// Step in pixels of a wide blur: two standard deviations of [`BASE`], so that all pixels have nearly equal weights.
pub(super) const STEP: usize = 3;

/// Standard deviation of the blur that widens [`BASE`] to `sigma`.
pub(super) fn rest(sigma: f32) -> f32 {
    (sigma * sigma - BASE * BASE).sqrt()
}

/// The choice of every pixel.
pub(super) struct Chosen {
    /// Level of the roughened light.
    pub(super) level: Vec<u8>,
    /// Relative squared bias and variance, estimated.
    pub(super) bias2: Vec<f32>,
    pub(super) variance: Vec<f32>,
    /// Mean absolute noise of both layers together, before their energy is restored.
    pub(super) noise: Vec<f32>,
    /// The layers: shared light, roughened light.
    pub(super) layers: [Vec<Rgb>; 2],
}

impl Chosen {
    fn blank((width, height): Size) -> Self {
        let pixels = width * height;
        Self {
            level: vec![0; pixels],
            bias2: vec![0.0; pixels],
            variance: vec![0.0; pixels],
            noise: vec![0.0; pixels],
            layers: [(); 2].map(|()| vec![Rgb::ZERO; pixels]),
        }
    }

    /// Copies a tile into the whole.
    fn paste(&mut self, width: usize, tile: TileChoice) {
        let (x, y) = tile.origin;
        let (w, h) = tile.size;
        for row in 0..h {
            let to = (y + row) * width + x;
            let (to, from) = (to..to + w, row * w..(row + 1) * w);
            for (whole, layer) in self.layers.iter_mut().zip(&tile.layers) {
                whole[to.clone()].copy_from_slice(&layer[from.clone()]);
            }
            self.bias2[to.clone()].copy_from_slice(&tile.bias2[from.clone()]);
            self.variance[to.clone()].copy_from_slice(&tile.variance[from.clone()]);
            self.noise[to.clone()].copy_from_slice(&tile.noise[from.clone()]);
            self.level[to].copy_from_slice(&tile.level[from]);
        }
    }
}

/// The choice of a tile's pixels.
struct TileChoice {
    origin: Size,
    size: Size,
    level: Vec<u8>,
    bias2: Vec<f32>,
    variance: Vec<f32>,
    noise: Vec<f32>,
    layers: [Vec<Rgb>; 2],
}

/// A tile and `reach` pixels on each side, within the window.
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

/// A tile with its margins. Pixels near edges of the margins are invalid, except at the film's own edges.
struct TileData<'a> {
    whole: &'a Shared<'a>,
    /// The tile with its margins, in the film.
    outer: Window,
    size: Size,
    /// The pixels that have candidates, in `outer`.
    inner: Inner,
    /// The tile, in `inner`.
    tile: Inner,
    /// First pixel of `inner`, in the film.
    origin: Size,
}

impl<'a> TileData<'a> {
    fn new(whole: &'a Shared<'a>, tile: &Window) -> Self {
        let window = whole.film.window();
        let outer = surroundings(tile, whole.reach(), &window);
        let inner = surroundings(tile, AROUND as u32, &window);
        let place = |x: u32, y: u32| (x as usize, y as usize);
        Self {
            whole,
            outer,
            size: place(outer.w, outer.h),
            inner: Inner {
                origin: place(inner.x - outer.x, inner.y - outer.y),
                size: place(inner.w, inner.h),
                width: outer.w as usize,
            },
            tile: Inner {
                origin: place(tile.x - inner.x, tile.y - inner.y),
                size: place(tile.w, tile.h),
                width: inner.w as usize,
            },
            origin: place(inner.x - window.x, inner.y - window.y),
        }
    }

    /// Batches of the light of every pixel of a level; `level` = number of levels gives the shared light.
    fn light(&self, level: usize) -> Batches {
        let film = self.whole.film;
        let window = film.window();
        let own = |pixel: usize| {
            let pixel = window.index(self.outer.pixel(pixel));
            std::array::from_fn(|batch| film.batch_mean(pixel, batch, level).into())
        };
        (0..self.outer.len()).map(own).collect()
    }

    /// Batches of the light of every pixel of a level, minus the shared light.
    fn roughened(&self, level: usize, shared: &Batches) -> Batches {
        let mut light = self.light(level);
        for (light, shared) in light.iter_mut().zip(shared) {
            light.iter_mut().zip(shared).for_each(|(l, s)| *l -= *s);
        }
        light
    }

    fn mean(&self, light: &[Vec3A; BATCHES]) -> Vec3A {
        let pairs = light.iter().zip(self.whole.shares);
        pairs.map(|(light, share)| *light * share).sum()
    }

    fn choose(&self) -> TileChoice {
        let count = self.whole.film.levels();
        let shared = self.light(count);
        let level = |level| self.roughened(level, &shared);
        let all: Vec<Batches> = (0..count).map(level).collect();
        let features = self.whole.film.features_of(&self.outer);
        let weights = self.weights(&shared, &all[count - 1]);
        let size = self.inner.size;
        let batches = self.whole.roughened.count;

        // Without blurs there is no vote among similar pixels.
        let alike = |guide: Option<Guide>| {
            move |pixel: usize, step: [isize; 2]| {
                let alike = |guide: &Guide| guide.alike(self.inner.number(pixel), step);
                guide.as_ref().map_or(1.0, alike)
            }
        };
        let choose = |candidates: &[Candidate], guide| {
            let kappa = self.whole.limits.kappa;
            Choice::of(size, candidates, &weights.0, kappa, batches, alike(guide))
        };

        let (candidates, guide) = self.of_shared(shared, &features);
        let p = choose(&candidates, guide);
        let mean = |light: &[Vec3A; BATCHES]| self.mean(light);
        let (shared, shared_batches) = p.blend(size, &candidates, mean);
        drop(candidates);

        let (candidates, guide) = self.of_roughened(all, features);
        let r = choose(&candidates, guide);
        let (roughened, rough_batches) = r.blend(size, &candidates, mean);
        let noise = |i: usize| {
            let batch = |b: usize| shared_batches[i][b] + rough_batches[i][b];
            noise_of_halves(std::array::from_fn(batch), self.whole.shares, batches)
        };

        let level = |k: u8| candidates[usize::from(k)].level;
        let sums = |a: &[f32], b: &[f32]| -> Vec<f32> {
            let pixels = self.tile.pixels();
            pixels.map(|i| (a[i] + b[i]) * weights.1[i]).collect()
        };
        TileChoice {
            level: self.tile.pixels().map(|i| level(r.chosen[i])).collect(),
            bias2: sums(&p.bias2, &r.bias2),
            variance: sums(&p.variance, &r.variance),
            noise: self.tile.pixels().map(noise).collect(),
            layers: [shared, roughened].map(|layer| {
                let pixels = self.tile.pixels();
                pixels.map(|i| layer[i].into()).collect()
            }),
            origin: (
                self.origin.0 + self.tile.origin.0,
                self.origin.1 + self.tile.origin.1,
            ),
            size: self.tile.size,
        }
    }

    /// The weights, independent of exposure, and factors from weighted errors to relative errors of the metrics.
    fn weights(&self, shared: &Batches, roughest: &Batches) -> (Weights, Vec<f32>) {
        let gain = self.whole.gain;
        let pairs = shared.iter().zip(roughest);
        let light: Vec<Vec3A> = pairs
            .map(|(shared, light)| self.mean(shared) + self.mean(light))
            .collect();
        let mut smooth = light.clone();
        tent(self.size, RADIUS, &mut smooth);
        let smooth = self.inner.of(&smooth);
        let weight = |i: &Vec3A| {
            let i = *i * gain;
            Vec3A::splat(gain * gain) / (i * i + EPSILON)
        };
        let own: Vec<Vec3A> = smooth.iter().map(weight).collect();
        let dark = self.inner.of(&darkest(self.size, &light));
        let grey = |v: Vec3A| v.element_sum();
        let stated = own.iter().zip(&smooth);
        let stated = stated.map(|(w, i)| grey((*i * *i + EPSILON).recip()) / grey(*w));
        let stated = stated.collect();
        let dark = dark.iter().map(weight).collect();
        (Weights { own, dark }, stated)
    }

    /// Candidates of the light that all levels share, sharp, and blurred without fireflies; and the guide of the blurs,
    /// if any. With one level these fireflies are glints of lamps, which stay in their pixels.
    fn of_shared(&self, light: Batches, features: &[Features]) -> (Vec<Candidate>, Option<Guide>) {
        let keeps_glints = self.whole.film.levels() == 1;
        let widest = match self.whole.limits.blurs.len() {
            0 => 0,
            blurs => blurs + usize::from(!keeps_glints),
        };
        let candidate = |number: usize, light: Batches| Candidate {
            level: 0,
            light,
            sharper: (0..number).collect(),
            missing: None,
            blur: number,
            wider: (number < widest).then_some(number + 1),
            doubted: number > 0,
            dark_side: number > 0,
        };
        let mut all = vec![candidate(0, self.inner.of(&light))];
        // Black light needs no blurs.
        if widest == 0 || light.iter().flatten().all(|light| *light == Vec3A::ZERO) {
            return (all, None);
        }
        let mut capped = light.clone();
        if keeps_glints {
            let most = Vec3A::splat(GLINT / self.whole.gain);
            let batches = capped.iter_mut().flatten();
            batches.for_each(|light| *light = light.min(most));
        } else {
            self.cap(&mut capped);
        }
        let guide = Guide::new(self.size, Surface::First, features);
        for (_, mut blurred) in self.blurs(&guide, &[&capped], !keeps_glints) {
            let mut blurred = blurred.remove(0);
            if keeps_glints {
                for (blurred, i) in blurred.iter_mut().zip(self.inner.pixels()) {
                    for batch in 0..BATCHES {
                        blurred[batch] += light[i][batch] - capped[i][batch];
                    }
                }
            }
            all.push(candidate(all.len(), blurred));
        }
        (all, Some(guide))
    }

    /// Cuts light above the caps, which counts as fireflies.
    fn cap(&self, light: &mut Batches) {
        let corner = (
            self.origin.0 - self.inner.origin.0,
            self.origin.1 - self.inner.origin.1,
        );
        for (i, light) in light.iter_mut().enumerate() {
            let pixel = (corner.0 + i % self.size.0, corner.1 + i / self.size.0);
            let cap = self.whole.caps.at(pixel);
            light.iter_mut().for_each(|light| *light = light.min(cap));
        }
    }

    /// Candidates of roughened light: every level, and blurs of all but the first of several; and their guide, if any.
    fn of_roughened(
        &self,
        levels: Vec<Batches>,
        features: Vec<Features>,
    ) -> (Vec<Candidate>, Option<Guide>) {
        let count = levels.len();
        let missing = self.missing(&levels);
        let noise = |level: usize, times: f32| {
            let of = missing[level].iter();
            Some(of.map(|missing| missing.noise(times)).collect())
        };
        let guide = match self.whole.limits.blurs {
            [] => None,
            _ => Some(Guide::new(self.size, Surface::Rough, &features)),
        };
        drop(features);
        let blurs = guide.as_ref().map_or(Vec::new(), |guide| match &*levels {
            [only] => {
                let mut only = only.clone();
                self.cap(&mut only);
                self.blurs(guide, &[&only], true)
            }
            _ => self.blurs(guide, &levels.iter().skip(1).collect::<Vec<_>>(), false),
        });
        let widest = blurs.len();
        // The first of several levels is too noisy for a blur; of an only level, just the fireflies are.
        let first = usize::from(count > 1);
        let sharp = count.min(self.whole.limits.levels);
        // Frees the light of the margins before more candidates are allocated.
        let mut all: Vec<Candidate> = (levels.into_iter().enumerate())
            .take(sharp)
            .map(|(level, light)| Candidate {
                level: level as u8,
                light: self.inner.of(&light),
                sharper: (0..level).collect(),
                missing: noise(level, 1.0),
                blur: 0,
                wider: (widest > 0).then_some(sharp + level.saturating_sub(first)),
                doubted: false,
                dark_side: false,
            })
            .collect();
        for (blur, (sigma, blurred)) in (1..).zip(blurs) {
            for (number, light) in blurred.into_iter().enumerate() {
                let level = number + first;
                // Narrower blurs have less noise, so that they show a bias better than the sharp picture does.
                let sharper = match count {
                    1 => 0..all.len(),
                    _ => 0..level + 1,
                };
                all.push(Candidate {
                    level: level as u8,
                    light,
                    sharper: sharper.collect(),
                    // A blur of s pixels averages about 1 + s² times as many.
                    missing: noise(level, 1.0 + sigma * sigma),
                    blur,
                    wider: (blur < widest).then_some(all.len() + count - first),
                    doubted: count == 1,
                    dark_side: false,
                });
            }
        }
        (all, guide)
    }

    /// Blurs of light by ascending standard deviation; with `wide` also that of [`WIDE`], of the first light.
    fn blurs(&self, guide: &Guide, light: &[&Batches], wide: bool) -> Vec<(f32, Vec<Batches>)> {
        let batches = self.whole.roughened.count;
        let base = wide.then(|| self.base(guide, light[0]));
        let blur = |&sigma: &f32| match &base {
            Some(base) if sigma == BASE => (sigma, vec![self.inner.of(base)]),
            _ => (sigma, guide.blur::<1>(sigma, &self.inner, light, batches)),
        };
        let mut blurs: Vec<_> = self.whole.limits.blurs.iter().map(blur).collect();
        if let Some(base) = &base {
            let wide = guide.blur::<STEP>(rest(WIDE), &self.inner, &[base], batches);
            blurs.push((WIDE, wide));
        }
        blurs
    }

    /// A blur of [`BASE`] of all pixels that a blur of [`WIDE`] uses.
    fn base(&self, guide: &Guide, light: &Batches) -> Batches {
        let around = self.inner.grown(reach(rest(WIDE)), self.size.1);
        let batches = self.whole.roughened.count;
        let base = guide.blur::<1>(BASE, &around, &[light], batches).remove(0);
        let mut blurred = light.clone();
        for (i, light) in around.pixels().zip(base) {
            blurred[i] = light;
        }
        blurred
    }

    /// Light that every level has missed, by level and pixel.
    fn missing(&self, levels: &[Batches]) -> Vec<Vec<Missing>> {
        let smooth = |level: &Batches| -> Vec<[Vec3A; 2]> {
            let light = level.iter().map(|light| self.mean(light).max(Vec3A::ZERO));
            let mut wide: Vec<Vec3A> = light.collect();
            let mut narrow = wide.clone();
            tent(self.size, MISSING_RADIUS, &mut wide);
            tent(self.size, RADIUS, &mut narrow);
            let pixels = self.inner.pixels();
            pixels.map(|i| [wide[i], narrow[i]]).collect()
        };
        let light: Vec<Vec<[Vec3A; 2]>> = levels.iter().map(smooth).collect();
        let mut missing: Vec<Vec<_>> = light.iter().map(|l| Vec::with_capacity(l.len())).collect();
        let (w, h) = self.inner.size;
        let pixels = (0..h).flat_map(|y| (0..w).map(move |x| (x, y)));
        for (i, (x, y)) in pixels.enumerate() {
            let pixel = (self.origin.0 + x, self.origin.1 + y);
            let here = self.whole.roughened.missing(pixel, |level| light[level][i]);
            let pairs = missing.iter_mut().zip(here);
            pairs.for_each(|(all, one)| all.push(one));
        }
        missing
    }
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

/// Mean absolute noise of a picture, summed over channels, from differences between halves of its batches: the mean
/// over the three ways to halve four batches, which pair the first with each of the others; of two batches the first
/// alone is a half. For normal samples it equals the noise of the mean of all batches.
fn noise_of_halves(batches: [Vec3A; BATCHES], shares: [f32; BATCHES], count: usize) -> f32 {
    let halved = |with: usize| {
        let (mut light, mut share) = ([Vec3A::ZERO; 2], [0.0; 2]);
        for batch in 0..count {
            let half = usize::from(batch != 0 && batch != with);
            light[half] += shares[batch] * batches[batch];
            share[half] += shares[batch];
        }
        let apart = light[0] / share[0] - light[1] / share[1];
        apart.abs().element_sum() / (1.0 / share[0] + 1.0 / share[1]).sqrt()
    };
    let ways = if count > 2 { 1..count } else { 0..1 };
    let number = ways.len() as f32;
    ways.map(halved).sum::<f32>() / number
}
