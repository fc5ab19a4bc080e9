//! Small pictures of several integrators, judged without a reference.
//!
//! The error of an integrator is that of `opsr compare`: relMSE with ε = 0.01, without the worst pixels. The variance of a
//! sample in every pixel, over the samples that fit into the time of the render, relative to what the integrators together
//! show there, is the error to be expected. Variances of few samples are too small where bright samples are rare, so that
//! an integrator which has found nothing looks noise-free. Four rules look for that:
//!
//! - A tile that is darker than another integrator shows it, by more than the noise of both, misses light. Light that none of
//!   n samples found has a second moment of at least n times its squared mean.
//! - The strategies of `path` are among those of `bdpt`, and its are among those of `vcm`, so that a sample of fewer
//!   strategies has no less variance `[Veach97 §9.2]`. One that shows much less has not met its bright samples.
//! - Where a hundredth of the pixels carries most of the variance, single samples made it, and what is left without them is a
//!   lower bound. Such an integrator needs a clear lead over one with more strategies that has no such pixels.
//! - Where there are smooth surfaces merges find caustics at once, and others seldom.

use super::{Contender, MISSED, Trial};
use crate::image::Buffer;
use crate::image::film::Window;
use crate::image::metric::pixel::EPSILON;
use crate::integrator::Picture;
use crate::integrator::method::IntegratorKind;
use crate::math::Rgb;
use crate::regularise::Rule;
use crate::resolve::{Resolve, resolve_film};

/// Edge in pixels of the tiles on which means are compared.
const TILE: u32 = 8;

/// Standard errors by which a tile must be darker than with another integrator to miss light.
const DARKER: f64 = 2.0;

/// Share of the pixels, those of the largest errors, that are left out: what single bright samples bring is chance.
const TRIMMED: f64 = 0.002;

/// Share of the pixels that may carry [`MAX_CONCENTRATION`] of the variance before it counts as that of single samples, and is left out.
const FEW: f64 = 0.01;
const MAX_CONCENTRATION: f64 = 0.7;

/// Factor on errors that are lower bounds.
const UNSURE: f64 = 10.0;

/// Share of the variance of more strategies below which that of a part of them is a lower bound: it has not met the
/// samples that the others have.
const TOO_SMALL: f64 = 0.5;

/// Factor on errors of integrators that do not merge, where others do. Of 1, 1.5, 1.7, 2 and 2.5 this one chose best in 19
/// scenes.
const UNSEEN: f64 = 2.0;

/// A contender's small picture.
pub(super) struct Draft {
    kind: IntegratorKind,
    /// False if the picture is regularised: less variance for some bias.
    plain: bool,
    /// Samples per pixel.
    samples: f64,
    /// Time of a sample per pixel.
    cost: f64,
    /// Mean of every pixel and variance of one of its samples, the channels taken together.
    mean: Vec<f64>,
    variance: Vec<f64>,
}

impl Draft {
    /// The picture of a contender after so many samples per pixel, each of this cost.
    pub(super) fn of(contender: &Contender, picture: &Picture, samples: u32, cost: f64) -> Self {
        let grey = |buffer: &Buffer| {
            let each = |p: &Rgb| p.as_dvec3().element_sum() / 3.0;
            buffer.pixels.iter().map(each).collect::<Vec<f64>>()
        };
        let (mean, variance) = match &picture.levels {
            Some(levels) => {
                let resolved = resolve_film(levels, Resolve::default());
                let absolute = |(m, e): (&Rgb, f32)| {
                    let squared = m.as_dvec3().length_squared() / 3.0 + EPSILON;
                    f64::from(samples) * f64::from(e) * f64::from(e) * squared
                };
                let pixels = resolved.picture.pixels.iter().zip(resolved.error());
                let variance = pixels.map(absolute).collect();
                (grey(&resolved.picture), variance)
            }
            None => {
                let film = &picture.film;
                (grey(&film.mean()), grey(&film.sample_variance()))
            }
        };
        Self {
            kind: contender.kind,
            plain: contender.settings.rule == Rule::Plain,
            samples: samples.into(),
            cost,
            mean,
            variance,
        }
    }

    /// Light paths alone never find what is seen by way of a Dirac lobe, others no light without area there.
    fn is_blind(&self, punctual: bool) -> bool {
        match self.kind {
            IntegratorKind::Light => true,
            IntegratorKind::Path | IntegratorKind::Bdpt => punctual,
            _ => false,
        }
    }

    fn merges(&self) -> bool {
        matches!(self.kind, IntegratorKind::Vcm | IntegratorKind::Sppm)
    }

    /// Mean of some pixels, and the variance of that mean; of so few samples it is often zero by chance, so that a sample of
    /// a pixel counts as having no less than `usual`.
    fn tile(&self, pixels: &[usize], usual: &[f64]) -> (f64, f64) {
        let count = pixels.len() as f64;
        let mean: f64 = pixels.iter().map(|&p| self.mean[p]).sum();
        let variance: f64 = (pixels.iter())
            .map(|&p| self.variance[p].max(usual[p]))
            .sum();
        (mean / count, variance / (count * count * self.samples))
    }
}

/// True if all strategies of an integrator are among those of another one, which has more.
fn is_part(kind: IntegratorKind, other: IntegratorKind) -> bool {
    use IntegratorKind::{Bdpt, Light, Path, Sppm, Vcm};
    match kind {
        Path | Light => matches!(other, Bdpt | Vcm),
        Bdpt | Sppm => other == Vcm,
        _ => false,
    }
}

/// Median of some contenders in every pixel: a bright sample of one of them does not change it.
fn median(drafts: &[&Draft], values: impl Fn(&Draft) -> &[f64]) -> Vec<f64> {
    let pixels = drafts.first().map_or(0, |draft| draft.mean.len());
    let of_pixel = |pixel: usize| {
        let mut sorted: Vec<f64> = drafts.iter().map(|d| values(d)[pixel]).collect();
        sorted.sort_by(f64::total_cmp);
        let (low, high) = ((sorted.len() - 1) / 2, sorted.len() / 2);
        0.5 * (sorted[low] + sorted[high])
    };
    (0..pixels).map(of_pixel).collect()
}

/// Radiance of every pixel, from the contenders that find all light.
fn radiance(drafts: &[Draft], punctual: bool) -> Vec<f64> {
    let mut seeing: Vec<&Draft> = drafts.iter().filter(|d| !d.is_blind(punctual)).collect();
    if seeing.is_empty() {
        seeing = drafts.iter().collect();
    }
    median(&seeing, |d| &d.mean)
}

/// Share of the sum of some values that the largest [`FEW`] of them have; `None` if there is nothing.
fn concentration(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(|a, b| b.total_cmp(a));
    let few = (FEW * sorted.len() as f64).ceil() as usize;
    let sum: f64 = sorted.iter().sum();
    (sum > 0.0).then(|| sorted[..few].iter().sum::<f64>() / sum)
}

/// The contenders' small pictures of a window against each other, for a render of this time per pixel; `punctual` if there
/// are lights without area.
pub(super) fn judged(drafts: &[Draft], window: Window, time: f64, punctual: bool) -> Vec<Trial> {
    let radiance = radiance(drafts, punctual);
    let weight = |radiance: f64| 1.0 / (radiance * radiance + EPSILON);
    let tiles: Vec<Vec<usize>> = (window.tiles(TILE).iter())
        .map(|tile| super::window::inside(tile, &window).collect())
        .collect();
    let usual = median(&drafts.iter().collect::<Vec<_>>(), |d| &d.variance);
    let means: Vec<Vec<(f64, f64)>> = (drafts.iter())
        .map(|draft| {
            tiles
                .iter()
                .map(|pixels| draft.tile(pixels, &usual))
                .collect()
        })
        .collect();
    let relative = |draft: &Draft| -> Vec<f64> {
        let pairs = draft.variance.iter().zip(&radiance);
        pairs.map(|(v, radiance)| v * weight(*radiance)).collect()
    };
    let shares: Vec<Option<f64>> = (drafts.iter())
        .map(|draft| concentration(&relative(draft)))
        .collect();
    // Where nobody has variance there is nothing to be unsure of.
    let nothing = shares.iter().all(Option::is_none);
    let sure: Vec<bool> = (shares.iter())
        .map(|share| share.map_or(nothing, |share| share <= MAX_CONCENTRATION))
        .collect();
    let mut light = 0.0f64;
    let (mut of_sample, mut missed) = (Vec::new(), Vec::new());
    for ((draft, mine), sure) in drafts.iter().zip(&means).zip(&sure) {
        let blind = draft.is_blind(punctual);
        let samples = (time / draft.cost).max(1.0);
        let mut values = relative(draft);
        let mut dark = 0.0;
        for (tile, pixels) in tiles.iter().enumerate() {
            let (mean, variance) = mine[tile];
            let (mut squared, mut beyond) = (0.0f64, 0.0f64);
            for (other, other_variance) in means.iter().map(|others| others[tile]) {
                let (noise, lack) = (variance + other_variance, other - mean);
                let significant = lack - DARKER * noise.sqrt();
                if significant > 0.0 {
                    // Without what noise adds to the square.
                    squared = squared.max(lack * lack - noise);
                    beyond = beyond.max(significant);
                }
            }
            dark += beyond / tiles.len() as f64;
            let found = draft.samples * pixels.len() as f64;
            let least = squared * if blind { samples } else { samples.min(found) };
            // A lamp in a tile must not count as light that is missing from the dark pixels beside it.
            let shown = pixels.iter().map(|&p| radiance[p]).sum::<f64>() / pixels.len() as f64;
            for &pixel in pixels {
                values[pixel] = values[pixel].max(least * weight(shown));
            }
        }
        let whole = mine.iter().map(|(mean, _)| mean).sum::<f64>() / tiles.len().max(1) as f64;
        light = light.max(whole);
        missed.push(if blind { dark } else { 0.0 });
        values.sort_by(f64::total_cmp);
        let kept = 1.0 - if *sure { TRIMMED } else { FEW };
        values.truncate((kept * values.len() as f64).ceil() as usize);
        of_sample.push(values.iter().sum::<f64>() / values.len().max(1) as f64);
    }
    let more =
        |i: usize| (0..drafts.len()).filter(move |&j| is_part(drafts[i].kind, drafts[j].kind));
    let trial = |i: usize| {
        let draft = &drafts[i];
        let samples = (time / draft.cost).max(1.0);
        let mut variance = of_sample[i];
        if draft.plain {
            variance = more(i).map(|j| of_sample[j]).fold(variance, f64::max);
        }
        let factor = match draft.kind {
            // The radius of merges shrinks, so that the variance of a sample rises with n^(1 − α).
            IntegratorKind::Sppm => (samples / draft.samples).max(1.0).cbrt(),
            IntegratorKind::Vcm => 1.0,
            _ if drafts.iter().any(Draft::merges) => UNSEEN,
            _ => 1.0,
        };
        let too_small = of_sample[i] < TOO_SMALL * variance;
        let doubt = too_small || !sure[i] && more(i).any(|j| sure[j]);
        Trial {
            kind: draft.kind,
            samples,
            error: variance * factor * if doubt { UNSURE } else { 1.0 } / samples,
            missed: missed[i] / light.max(1e-30),
            sure: sure[i],
        }
    };
    (0..drafts.len()).map(trial).collect()
}

/// The place of the least error among those that miss no light; among all if every one does. Where nobody's error is known,
/// photons do not find the light either, and `bdpt`, which begins at both ends, is taken.
pub(super) fn best(trials: &[Trial]) -> Option<usize> {
    let all = 0..trials.len();
    let seeing: Vec<usize> = all.clone().filter(|&i| trials[i].missed < MISSED).collect();
    let seeing = if seeing.is_empty() {
        all.collect()
    } else {
        seeing
    };
    let order = |a: &usize, b: &usize| trials[*a].error.total_cmp(&trials[*b].error);
    let known = seeing.iter().any(|&i| trials[i].sure);
    let bdpt = |i: &usize| !known && trials[*i].kind == IntegratorKind::Bdpt;
    let robust = seeing.iter().copied().find(bdpt);
    robust.or_else(|| seeing.into_iter().min_by(order))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::UVec2;

    const AREA: bool = false;
    const POINT: bool = true;
    use IntegratorKind::{Bdpt, Path, Sppm, Vcm};

    fn window() -> Window {
        Window::full(UVec2::splat(32))
    }

    fn draft(kind: IntegratorKind, cost: f64, mean: f64, variance: f64) -> Draft {
        Draft {
            kind,
            plain: true,
            samples: 16.0,
            cost,
            mean: vec![mean; 1024],
            variance: vec![variance; 1024],
        }
    }

    /// A picture whose variance comes from few pixels.
    fn spiky(kind: IntegratorKind, cost: f64, mean: f64, variance: f64) -> Draft {
        let mut draft = draft(kind, cost, mean, 0.0);
        draft.variance[..10].fill(variance * 102.4);
        draft
    }

    fn trials(drafts: &[Draft], time: f64, punctual: bool) -> Vec<Trial> {
        judged(drafts, window(), time, punctual)
    }

    fn winner(trials: &[Trial]) -> IntegratorKind {
        trials[best(trials).unwrap()].kind
    }

    #[test]
    fn pilot_weighs_noise_and_cost() {
        let drafts = [draft(Path, 1.0, 1.0, 4.0), draft(Bdpt, 2.0, 1.0, 1.0)];
        let found = trials(&drafts, 800.0, AREA);
        // relMSE of a picture of ones.
        assert!((found[0].error - 4.0 / 800.0 / 1.01).abs() < 1e-12);
        assert!((found[1].error - 0.5 * found[0].error).abs() < 1e-12);
        assert!(found.iter().all(|t| t.missed == 0.0 && t.sure));
        assert_eq!(winner(&found), Bdpt);
        // Bright samples are rare where others merge.
        let [path, bdpt] = drafts;
        let found = trials(&[path, bdpt, draft(Vcm, 3.0, 1.0, 1.0)], 800.0, AREA);
        assert_eq!(winner(&found), Vcm);
    }

    #[test]
    fn pilot_counts_missing_light() {
        // A path tracer that is dark for want of light has no noise and the largest error.
        let drafts = [draft(Path, 1.0, 0.0, 0.0), draft(Vcm, 8.0, 1.0, 0.5)];
        for (punctual, missed) in [(POINT, 0.9), (AREA, -0.1)] {
            let found = trials(&drafts, 1600.0, punctual);
            assert!(found[0].error > 100.0 * found[1].error, "{found:?}");
            assert!(found[0].missed > missed && !found[0].sure);
        }
        // Light that can be found is found in time; light that cannot is not.
        let long = |punctual| trials(&drafts, 1e7, punctual)[0].error;
        assert!(long(AREA) < 0.01 && long(POINT) > 0.5);
        // A picture that lacks light is no bargain.
        let drafts = [draft(Path, 1.0, 0.7, 1e-3), draft(Vcm, 8.0, 1.0, 10.0)];
        let found = trials(&drafts, 16.0, POINT);
        assert!(found[0].missed > 0.01);
        assert_eq!(winner(&found), Vcm);
    }

    #[test]
    fn pilot_doubts_variance_of_few_pixels() {
        let mut path = spiky(Path, 1.0, 1.0, 0.5);
        path.variance[20..].fill(0.1);
        let found = trials(&[path, draft(Bdpt, 2.0, 1.0, 1.0)], 100.0, AREA);
        assert_eq!([found[0].sure, found[1].sure], [false, true]);
        assert_eq!(winner(&found), Bdpt);
        // Where all are like that, the pilot cannot tell.
        let all = [
            spiky(Path, 1.0, 1.0, 0.1),
            spiky(Bdpt, 3.0, 1.0, 1.0),
            spiky(Vcm, 4.0, 1.0, 0.1),
        ];
        assert_eq!(winner(&trials(&all, 100.0, AREA)), Bdpt);
        // A picture without any noise is no such case.
        let still = [draft(Path, 1.0, 1.0, 0.0), draft(Bdpt, 3.0, 1.0, 0.0)];
        let found = trials(&still, 100.0, AREA);
        assert!(found.iter().all(|t| t.sure));
        assert_eq!(winner(&found), Path);
    }

    /// More strategies have no more variance: one that shows less has not met its bright samples yet.
    #[test]
    fn pilot_knows_whose_strategies_are_part_of_others() {
        let drafts = |plain| {
            let path = draft(Path, 1.0, 1.0, 0.1);
            [
                Draft { plain, ..path },
                draft(Bdpt, 3.0, 1.0, 1.0),
                draft(Vcm, 4.0, 1.0, 1.2),
                draft(Sppm, 1.0, 1.0, 1.0),
            ]
        };
        let found = trials(&drafts(true), 16.0, AREA);
        let of_sample = |t: &Trial| t.error * t.samples * 1.01;
        for (trial, factor) in found.iter().zip([UNSURE * UNSEEN, UNSEEN, 1.0, 1.0]) {
            assert!((of_sample(trial) - 1.2 * factor).abs() < 1e-9, "{trial:?}");
        }
        // A roughened path has less.
        let found = trials(&drafts(false), 16.0, AREA);
        assert!((of_sample(&found[0]) - 0.1 * UNSEEN).abs() < 1e-9);
    }

    /// The bright sample of one contender must not make its own pixel look bright, and its error small.
    #[test]
    fn pilot_takes_the_radiance_that_most_contenders_show() {
        let mut bright = draft(Path, 1.0, 1.0, 1.0);
        bright.mean[5] = 1e3;
        let drafts = [
            bright,
            draft(Bdpt, 1.0, 1.0, 1.0),
            draft(Vcm, 1.0, 1.0, 1.0),
        ];
        assert_eq!(radiance(&drafts, AREA)[5], 1.0);
    }
}
