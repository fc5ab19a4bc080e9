//! The choice among levels and blurs, mixed with a denoiser's picture.
//!
//! A filter of pictures is any function, so that no bound on its error is known. But independent samples judge it. With F
//! the filtered mean of two of the four batches of a level, and x, y the other two batches of level 1,
//!
//! ```text
//! E[(F − x) (F − y)] = E[(F − I)²]           I what x and y have for their mean
//! ```
//!
//! whatever the filter does. Its mean over the picture says which level the filter is fed with.
//!
//! D is all batches of that level, filtered together. Each pixel blends D with S, the choice among levels and blurs, weighted
//! by their errors d and e:
//!
//! ```text
//! b = max(0, tent₁(w (D − S)²) − 8 tent₁(w V_S))        w V_S, b_S what S states of itself
//! d = b + tent₁(w (F − F')²) / 4                        F, F' the filtered halves
//! e = tent₁(b_S + w V_S)
//! m = tent₄(e)
//! D (e + m) / (e + d + 2 m) + S (d + m) / (e + d + 2 m)
//! ```
//!
//! The error estimates of single pixels are noisy: m, a local mean of e, moves both weights towards one half. Fine light that the
//! filter has taken stays where it is more than noise, and many samples leave S alone. The picture is brought to the energy of S by a
//! smooth factor.

use super::coarse::Energy;
use super::filter::{Size, tent};
use super::{Resolved, gain};
use crate::image::Buffer;
use crate::image::level_film::{BATCHES, LevelFilm};
use crate::math::{Rgb, Vec3A};

/// Radius in pixels at which differences and noise are smoothed.
const RADIUS: usize = 1;

/// Radius in pixels of m.
const DOUBT: usize = 4;

/// Multiple of the noise of S that a difference from it must exceed: where light is rare S states too little.
const KAPPA: f32 = 8.0;

/// ε of relative errors, as in [`Resolved`].
const EPSILON: f32 = 0.01;

/// A choice that is mixed with a denoiser's picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Denoised {
    /// The picture, the level that was chosen for every pixel, and the error of both together.
    pub resolved: Resolved,
    /// Level that the denoiser was fed with.
    pub fed: usize,
}

/// Mixes the choice among the levels of a film with the picture of a denoiser, any function of a picture; fails where that
/// does. A film of fewer than four samples has no batches to judge by: its samples are denoised, and nothing is known of the error.
pub(crate) fn denoise_film<E>(
    film: &LevelFilm,
    resolved: Resolved,
    denoise: impl Fn(&Buffer) -> Result<Buffer, E>,
) -> Result<Denoised, E> {
    let complete = film.complete().filter(|film| film.batches() == BATCHES);
    let Some(film) = complete else {
        let mut resolved = Resolved::unknown(film);
        resolved.picture = denoise(&resolved.picture)?;
        return Ok(Denoised { resolved, fed: 0 });
    };
    let film = film.as_ref();
    let judge = Judge::new(film);
    let mut best: Option<(f64, usize, Halves)> = None;
    // Those between gain nothing.
    let ends = [0, film.levels() - 1];
    for &level in &ends[..film.levels().min(2)] {
        let halves = Halves::of(film, level, &denoise)?;
        let error = judge.error(&halves);
        if best.as_ref().is_none_or(|(least, ..)| error < *least) {
            best = Some((error, level, halves));
        }
    }
    let (_, fed, halves) = best.expect("level 0 is judged");
    let filtered = denoise(&film.mean(fed))?;
    let resolved = judge.mix(resolved, &filtered, &halves);
    Ok(Denoised { resolved, fed })
}

/// Returns the error that the judge gives a filter of level 0.
#[cfg(test)]
pub(super) fn judged(film: &LevelFilm, filter: impl Fn(&Buffer) -> Buffer) -> f64 {
    let halves = Halves::of(film, 0, |picture| Ok::<_, ()>(filter(picture)));
    Judge::new(film).error(&halves.expect("no failure"))
}

/// Filtered means of the first two batches, and of the others.
struct Halves([Buffer; 2]);

impl Halves {
    fn of<E>(
        film: &LevelFilm,
        level: usize,
        denoise: impl Fn(&Buffer) -> Result<Buffer, E>,
    ) -> Result<Self, E> {
        let window = film.window();
        let half = |first: usize| Buffer {
            width: window.w as usize,
            height: window.h as usize,
            pixels: (0..window.len())
                .map(|pixel| {
                    let [a, b] =
                        [first, first + 1].map(|batch| film.batch_mean(pixel, batch, level));
                    0.5 * (a + b)
                })
                .collect(),
        };
        Ok(Self([denoise(&half(0))?, denoise(&half(BATCHES / 2))?]))
    }
}

/// Judges pictures of a film by its batches.
struct Judge<'a> {
    film: &'a LevelFilm,
    size: Size,
    /// Weight of squared differences: they are relative, where the mean of the picture counts as 0.3.
    weights: Vec<Vec3A>,
    /// Scales of relative errors, as in [`Resolved`], which make them independent of the exposure.
    stated: Vec<f32>,
}

impl<'a> Judge<'a> {
    fn new(film: &'a LevelFilm) -> Self {
        let roughest = film.mean(film.levels() - 1);
        let size = roughest.size();
        let mut light: Vec<Vec3A> = roughest.pixels.iter().map(|p| Vec3A::from(*p)).collect();
        tent(size, RADIUS, &mut light);
        let gain = gain(roughest.pixels.iter().copied());
        let weight = |light: &Vec3A| {
            let light = *light * gain;
            gain * gain * (light * light + EPSILON).recip()
        };
        let weights: Vec<Vec3A> = light.iter().map(weight).collect();
        let pairs = light.iter().zip(&weights);
        let stated = pairs.map(|(light, weight)| {
            (*light * *light + EPSILON).recip().element_sum() / weight.element_sum()
        });
        Self {
            film,
            size,
            stated: stated.collect(),
            weights,
        }
    }

    /// Mean squared error of a filter, relative, where the mean of the picture counts as 0.3; below 0 by chance.
    fn error(&self, halves: &Halves) -> f64 {
        let level = 1.min(self.film.levels() - 1);
        let pixel = |pixel: usize| {
            let batch = |b: usize| Vec3A::from(self.film.batch_mean(pixel, b, level));
            let [first, second] = halves.0.each_ref().map(|h| Vec3A::from(h.pixels[pixel]));
            let square =
                (first - batch(2)) * (first - batch(3)) + (second - batch(0)) * (second - batch(1));
            f64::from(square.dot(self.weights[pixel])) / 6.0
        };
        let pixels = self.weights.len();
        (0..pixels).map(pixel).sum::<f64>() / pixels.max(1) as f64
    }

    /// Squared difference of two pictures, weighted and smoothed.
    fn difference(&self, one: &Buffer, other: &Buffer) -> Vec<f32> {
        let pairs = one.pixels.iter().zip(&other.pixels).zip(&self.weights);
        let square = |((one, other), weight): ((&Rgb, &Rgb), &Vec3A)| {
            let d = Vec3A::from(*one - *other);
            (d * d).dot(*weight) / 3.0
        };
        let mut squares: Vec<f32> = pairs.map(square).collect();
        tent(self.size, RADIUS, &mut squares);
        squares
    }

    /// Mix of a filtered picture and a choice by their errors, with the energy of the choice.
    fn mix(&self, mut resolved: Resolved, filtered: &Buffer, halves: &Halves) -> Resolved {
        let smooth = |values: &[f32]| {
            let pairs = values.iter().zip(&self.stated);
            let mut values: Vec<f32> = pairs.map(|(value, stated)| value / stated).collect();
            tent(self.size, RADIUS, &mut values);
            values
        };
        let [bias2, variance] = [&resolved.bias2, &resolved.variance].map(|v| smooth(v));
        let differs = self.difference(filtered, &resolved.picture);
        let noise = self.difference(&halves.0[0], &halves.0[1]);
        let mut doubt: Vec<f32> = bias2.iter().zip(&variance).map(|(b, v)| b + v).collect();
        tent(self.size, DOUBT, &mut doubt);
        let mut mixed = Vec::with_capacity(doubt.len());
        for (i, m) in doubt.into_iter().enumerate() {
            let (bias, spread) = ((differs[i] - KAPPA * variance[i]).max(0.0), 0.25 * noise[i]);
            let (ours, theirs) = (bias + spread, bias2[i] + variance[i]);
            let all = ours + theirs + 2.0 * m;
            // Without any error there is nothing to filter.
            let share = if all > 0.0 { (theirs + m) / all } else { 0.0 };
            let [d, s] = [filtered, &resolved.picture].map(|picture| picture.pixels[i]);
            mixed.push(s + (d - s) * share);
            let blend =
                |ours: f32, theirs: f32| (theirs + (ours - theirs) * share) * self.stated[i];
            let halves = halves.0.each_ref().map(|half| half.pixels[i]);
            let apart = 0.5 * (halves[0] - halves[1]).abs().element_sum();
            resolved.noise[i] += (apart - resolved.noise[i]) * share;
            resolved.bias2[i] = blend(bias, bias2[i]);
            resolved.variance[i] = blend(spread, variance[i]);
        }
        let energy = Energy::between(self.size, &mixed, &resolved.picture.pixels);
        let pairs = resolved.picture.pixels.iter_mut().zip(mixed);
        for (i, (pixel, light)) in pairs.enumerate() {
            *pixel = light * Rgb::from(energy.at(i));
        }
        resolved
    }
}
