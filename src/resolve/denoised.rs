//! The choice among levels and blurs, blended with a denoised picture.
//!
//! A filter can be any function of a picture, so no bound on its error is known. But independent samples can judge it.
//! With A₁ the choice of the first two of the four batches, F₁ their filtered mean and h₂ the mean of the other two
//!
//! ```text
//! E[(A₁ − F₁) (A₁ − h₂)] = E[(A₁ − F₁) (A₁ − I)]        I what h₂ has for its mean
//! ```
//!
//! for any choice and filter. Half of the samples have twice the noise of all. So with A₂, F₂ and h₁ of swapped halves,
//!
//! ```text
//! N = w [(A₁ − F₁) (A₁ − h₂) + (A₂ − F₂) (A₂ − h₁)] / 2 − w (A₁ − A₂) ((A₁ − F₁) − (A₂ − F₂)) / 4
//! Q = w ((A₁ + A₂ − F₁ − F₂) / 2)²
//! ```
//!
//! and E[N] / E[Q] is the share of the filter in the mix of choice and filter that has the least squared error. It is
//! estimated from the tents of N and Q around every pixel and, the noisier these are, from the sums over the picture:
//!
//! ```text
//! λ₀ = Σ N / Σ Q
//! λ  = (a tent₄(N) tent₄(Q) + v λ₀) / (a tent₄(Q)² + v)        v = tent₄(N²) / τ², a independent pixels of a tent
//! ```
//!
//! The picture is S + s (D − S): S the choice of all batches, D their filtered mean, s = (λ − 0.1) 7/6, in [0, 0.7].
//! Detail that the filter removes stays where samples confirm it, and a lamp that the filter spreads stays sharp. Only
//! w uses all samples, by S: weights from the halves are noisier and give a worse mix (docs/lab/resolve.md).

use super::filter::{Size, tent};
use super::{Resolve, Resolved, gain, resolve_film};
use crate::image::Buffer;
use crate::image::level_film::{BATCHES, LevelFilm};
use crate::math::Vec3A;
use std::borrow::Cow;

/// Radius in pixels of the tents of N and Q.
const RADIUS: usize = 4;

/// Pixels that such a tent averages: one over the sum of its squared weights.
const INDEPENDENT: f32 = ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as f32 * 2.25;

/// τ: standard deviation of λ around λ₀.
const SPREAD: f32 = 0.2;

/// Largest and least λ; shares are scaled so that the least one becomes 0. Excessive smoothing is more visible than its
/// squared error says, and light that a filter spreads from a lamp reaches far.
const MAX_LAMBDA: f32 = 0.7;
const MIN_LAMBDA: f32 = 0.1;

/// Radius in pixels over which brightness and noise are smoothed.
const NEAR: usize = 1;

/// ε of relative errors, as in [`Resolved`].
const EPSILON: f32 = 0.01;

/// Blends `resolved`, the choice in a film with these settings, with a denoised picture. Fails if `denoise` fails. A
/// film of fewer than four samples has too few batches to judge: its mean is denoised, and the error is unknown. An
/// owned film is dropped before the denoiser allocates memory.
pub(crate) fn denoise_film<E>(
    film: Cow<'_, LevelFilm>,
    settings: Resolve,
    resolved: Resolved,
    denoise: impl Fn(&Buffer) -> Result<Buffer, E>,
) -> Result<Resolved, E> {
    let complete = film.complete().filter(|film| film.batches() == BATCHES);
    let Some(complete) = complete else {
        let mut resolved = Resolved::unknown(&film);
        drop(film);
        resolved.picture = denoise(&resolved.picture)?;
        return Ok(resolved);
    };
    let half = |second: bool| {
        let half = complete.half(second);
        (half.mean(0), resolve_film(&half, settings).picture)
    };
    let ([one, two], all) = ([false, true].map(half), complete.mean(0));
    drop(complete);
    drop(film);
    let half = |(raw, chosen): (Buffer, Buffer)| {
        Ok(Half {
            filtered: denoise(&raw)?,
            chosen,
            raw,
        })
    };
    let halves = [half(one)?, half(two)?];
    Ok(mix(resolved, &denoise(&all)?, &halves))
}

/// Pictures of two of the batches of a film.
struct Half {
    raw: Buffer,
    chosen: Buffer,
    filtered: Buffer,
}

/// Share of the filter in every pixel; `light` is the choice of all batches.
fn shares(light: &Weights, halves: &[Half; 2]) -> Vec<f32> {
    let pixels = light.own.len();
    let at = |picture: &Buffer, i: usize| Vec3A::from(picture.pixels[i]);
    let terms = |i: usize| {
        let [a, b] = halves.each_ref().map(|half| at(&half.chosen, i));
        let [raw, other] = halves.each_ref().map(|half| at(&half.raw, i));
        let [f, g] = halves.each_ref().map(|half| at(&half.filtered, i));
        let (one, two) = (a - f, b - g);
        let whole = 0.5 * (one * (a - other) + two * (b - raw)) - 0.25 * (a - b) * (one - two);
        let mean = 0.5 * (one + two);
        [whole, mean * mean].map(|term| term.dot(light.own[i]))
    };
    let (mut gains, mut squares): (Vec<f32>, Vec<f32>) =
        (0..pixels).map(terms).map(|[n, q]| (n, q)).unzip();
    let sum = |values: &[f32]| values.iter().map(|&x| f64::from(x)).sum::<f64>();
    let (gain, square) = (sum(&gains), sum(&squares));
    let overall = if square > 0.0 {
        (gain / square).clamp(0.0, f64::from(MAX_LAMBDA)) as f32
    } else {
        0.0
    };
    let mut noise: Vec<f32> = gains.iter().map(|n| n * n / (SPREAD * SPREAD)).collect();
    for values in [&mut gains, &mut squares, &mut noise] {
        tent(light.size, RADIUS, values);
    }
    let share = |i: usize| {
        let (n, q, v) = (gains[i], squares[i], noise[i]);
        let all = INDEPENDENT * q * q + v;
        let best = (INDEPENDENT * n * q + v * overall) / all;
        let best = if all > 0.0 { best } else { 0.0 };
        (best.clamp(MIN_LAMBDA, MAX_LAMBDA) - MIN_LAMBDA) * MAX_LAMBDA / (MAX_LAMBDA - MIN_LAMBDA)
    };
    (0..pixels).map(share).collect()
}

/// w of every pixel and channel, for squared errors relative to a picture scaled to a mean of 0.3.
struct Weights {
    size: Size,
    own: Vec<Vec3A>,
    /// Weights without that scaling, for stated errors.
    stated: Vec<Vec3A>,
}

impl Weights {
    fn of(picture: &Buffer) -> Self {
        let size = picture.size();
        let mut light: Vec<Vec3A> = picture.pixels.iter().map(|p| Vec3A::from(*p)).collect();
        tent(size, NEAR, &mut light);
        let gain = gain(picture.pixels.iter().copied());
        let weight = |light: Vec3A| (light * light + EPSILON).recip();
        Self {
            size,
            own: (light.iter())
                .map(|p| gain * gain * weight(*p * gain))
                .collect(),
            stated: light.iter().map(|p| weight(*p)).collect(),
        }
    }
}

/// Blends a filtered picture with a choice.
fn mix(mut resolved: Resolved, filtered: &Buffer, halves: &[Half; 2]) -> Resolved {
    let weights = Weights::of(&resolved.picture);
    let shares = shares(&weights, halves);
    let [first, second] = halves.each_ref().map(|half| &half.filtered.pixels);
    let apart = |i: usize| 0.5 * (first[i] - second[i]);
    let spread = |i: usize| {
        let apart = Vec3A::from(apart(i));
        (apart * apart).dot(weights.stated[i]) / 3.0
    };
    let mut spreads: Vec<f32> = (0..shares.len()).map(spread).collect();
    tent(weights.size, NEAR, &mut spreads);
    for (i, share) in shares.into_iter().enumerate() {
        let pixel = &mut resolved.picture.pixels[i];
        *pixel += (filtered.pixels[i] - *pixel) * share;
        let noise = apart(i).abs().element_sum();
        resolved.noise[i] += (noise - resolved.noise[i]) * share;
        resolved.variance[i] += (spreads[i] - resolved.variance[i]) * share;
    }
    resolved
}
