//! The trainer: moments and gradients of its three evaluations against renders, finite differences and each other.

mod adam;
mod fresh;
mod learning;
mod loss;

use opsr::integrator::Settings;
use opsr::math::Rgb;
use opsr::math::real::Dual;
use opsr::regularise::{AttenuationTable, Lookup, Rule};
use opsr::sampler::{Independent, Seed};
use opsr_lab::gallery::caustic_box;
use opsr_lab::gallery::materials::coated;
use opsr_lab::verify::learning::{adjoint, crop_of, derivatives, uneven};
use opsr_train::Config;
use opsr_train::evaluate::curves::Curves;
use opsr_train::evaluate::replay::Replay;
use opsr_train::evaluate::{MomentSource, Moments};
use opsr_train::record::crop::Crop;
use opsr_train::record::event::MeanAndSquare;
use opsr_train::record::recording::{Recording, Tape};
use opsr_train::record::target::EPSILON;

/// A small crop of a box with glass and copper, with a reference at a known factor.
pub(crate) fn crop(edge: u32) -> Crop {
    crop_of(caustic_box(), edge).unwrap()
}

#[test]
fn replay_matches_the_render_at_the_recorded_factor() {
    compare_replay_with_render(&crop(8));
}

/// A coat over a diffuse base: the diffuse lobe finds the light too, and is reported after the path left the vertex.
#[test]
fn replay_matches_the_render_of_a_coat_at_the_recorded_factor() {
    let mut parts = caustic_box();
    for material in &mut parts.materials {
        if material.specular == 0.0 && material.emission == Rgb::ZERO {
            *material = coated("plastic", material.base_color, 0.3);
        }
    }
    compare_replay_with_render(&crop_of(parts, 8).unwrap());
}

fn compare_replay_with_render(crop: &Crop) {
    let spp = 64;
    let mut tape = Tape::new(crop.window);
    let mut film = crop.film().unwrap();
    let settings = opsr::integrator::Settings {
        max_vertices: crop.max_vertices,
        ..Default::default()
    };
    let source = opsr::sampler::Independent {
        seed: opsr::sampler::Seed(3),
    };
    settings.tracer(Rule::constant(0.1)).estimate(
        &crop.view(),
        &source,
        0..spp,
        &mut film,
        &mut tape,
    );
    let recording = Recording::from(tape);
    assert!(recording.events.len() > 300, "{}", recording.events.len());
    let moments = Replay::new(recording).moments(&AttenuationTable::constant(0.1));
    let mean = film.mean();
    let variances = film.pixels.iter().map(|m| m.sample_variance().as_vec3());
    for (p, variance) in variances.enumerate() {
        let mut expected = 0.0;
        for c in 0..3 {
            let m = mean.pixels[p][c];
            assert!(
                (moments.mean[p][c] - m).abs() < 1e-4 * (1.0 + m),
                "pixel {p}: {} and {m}",
                moments.mean[p][c]
            );
            let n = spp as f32;
            expected += variance[c] * (n - 1.0) / n + m * m;
        }
        // With both techniques on one path the second moments agree in expectation only.
        assert!((moments.second[p] - expected).abs() < 0.5 * expected + 0.01);
    }
}

/// Mean absolute percentage error of pictures of a crop.
fn error(reference: &[[f32; 3]], pictures: impl Iterator<Item = Moments>) -> f32 {
    let (mut error, mut count) = (0.0, 0.0);
    for picture in pictures {
        for (m, f) in picture
            .mean
            .iter()
            .flatten()
            .zip(reference.iter().flatten())
        {
            error += (m - f).abs() / (f + EPSILON);
            count += 1.0;
        }
    }
    error / count
}

/// Moments of a render of a crop, with random reflection or refraction at smooth glass as in recordings.
fn render(crop: &Crop, gamma: f32, samples: u32, seed: u64) -> Moments {
    let settings = Settings {
        rule: Rule::constant(gamma),
        max_vertices: crop.max_vertices,
        seed,
        ..Settings::default()
    };
    let mut film = crop.film().unwrap();
    let (tracer, source) = (
        settings.tracer(settings.rule.clone()),
        Independent { seed: Seed(seed) },
    );
    tracer.estimate(&crop.view(), &source, 0..samples, &mut film, &mut ());
    let mean = film.mean();
    let variance = film.pixels.iter().map(|m| m.sample_variance().as_vec3());
    let variance: Vec<_> = variance.collect();
    let n = samples as f32;
    let pixels = mean.pixels.iter().zip(&variance);
    Moments {
        mean: mean.pixels.iter().map(|m| m.to_array()).collect(),
        second: pixels
            .map(|(m, v)| (*v * ((n - 1.0) / n) + *m * *m).to_array().iter().sum())
            .collect(),
    }
}

#[test]
fn bias_and_noise_of_replay_match_the_render_at_every_factor() {
    const SEEDS: u64 = 12;
    let crop = crop(8);
    let draws = Config::default().record_gammas;
    let recorded = |draws: &[f32]| -> Vec<Replay> {
        (0..SEEDS)
            .map(|seed| Replay::new(crop.record(draws, 0.3, 64, Seed(100 + seed)).unwrap()))
            .collect()
    };
    let (mut several, mut single) = (recorded(&draws), recorded(&[0.05]));
    let mut long = Replay::new(crop.record(&draws, 0.3, 8192, Seed(9)).unwrap());
    let mut worst: f32 = 1.0;
    for gamma in [0.002, 0.013, 0.05, 0.16, 0.55, 1.0] {
        let table = AttenuationTable::constant(gamma);
        let converged = render(&crop, gamma, 8192, 1);
        let replayed = long.moments(&table);
        let total =
            |m: &Moments| -> (f32, f32) { (m.mean.iter().flatten().sum(), m.second.iter().sum()) };
        let (a, b) = (total(&replayed), total(&converged));
        assert!((a.0 / b.0 - 1.0).abs() < 0.03, "{gamma}: mean {a:?} {b:?}");
        assert!(
            (a.1 / b.1 - 1.0).abs() < 0.15,
            "{gamma}: second {a:?} {b:?}"
        );

        let f = &converged.mean;
        let rendered = error(
            f,
            (0..SEEDS).map(|seed| render(&crop, gamma, 64, 200 + seed)),
        );
        let several = error(f, several.iter_mut().map(|r| r.moments(&table))) / rendered;
        let single = error(f, single.iter_mut().map(|r| r.moments(&table))) / rendered;
        println!("{gamma} several {several} single {single}");
        assert!((several - 1.0).abs() < 0.15, "{gamma}: {several}");
        worst = worst.max(single);
    }
    // A recording at a single factor has much more noise at some other factor.
    assert!(worst > 1.5, "{worst}");
}

#[test]
fn bias_of_recordings_with_event_roulette_is_zero() {
    let crop = crop(8);
    let draws = Config::default().record_gammas;
    let recorded = |roulette| crop.record(&draws, roulette, 2048, Seed(4)).unwrap();
    let (all, some) = (recorded(0.0), recorded(1.0));
    let kept = some.events.len() as f32 / all.events.len() as f32;
    assert!(kept < 0.8, "{kept}");
    let (mut all, mut some) = (Replay::new(all), Replay::new(some));
    for gamma in [0.002, 0.05, 1.0] {
        let table = AttenuationTable::constant(gamma);
        let (a, b) = (all.moments(&table), some.moments(&table));
        // The paths are the same, and only the roulette differs: at most √(f²/n) in a pixel.
        let (mut sum, mut off) = (0.0, 0.0);
        for ((a, b), f) in a.mean.iter().zip(&b.mean).zip(&crop.reference) {
            for c in 0..3 {
                sum += b[c] - a[c];
                off += ((b[c] - a[c]) / (f[c] + EPSILON)).powi(2);
            }
        }
        let (n, pixels) = (192.0, 64.0f32);
        let off = (off / n).sqrt();
        assert!(off < 1.5 / 2048f32.sqrt(), "{gamma}: {off}");
        let total: f32 = a.mean.iter().flatten().sum();
        let bound = 4.0 / (2048.0 * pixels).sqrt();
        assert!((sum / total).abs() < bound, "{gamma}: {}", sum / total);
        let second = |m: &Moments| m.second.iter().sum::<f32>();
        let ratio = second(&b) / second(&a);
        assert!((ratio - 1.0).abs() < 0.02, "{gamma}: {ratio}");
    }
}

#[test]
fn derivatives_of_events_in_single_precision_match_double() {
    let crop = crop(6);
    let recording = (crop.record(&Config::default().record_gammas, 0.0, 64, Seed(3))).unwrap();
    let mut steep = 0;
    for event in recording.events.iter().step_by(7) {
        for alpha in [1e-3f32, 4e-3, 0.02, 0.1, 0.5, 1.0] {
            let single = event.tangent(Dual::variable(alpha));
            let double = event.at(Dual::variable(f64::from(alpha)));
            let parts = |m: &MeanAndSquare<Dual>| [m.mean[0], m.mean[1], m.mean[2], m.square];
            let wide = MeanAndSquare {
                mean: single.mean.map(Dual::wide),
                square: single.square.wide(),
            };
            for (a, b) in parts(&wide).into_iter().zip(parts(&double)) {
                // The derivative is a difference of two terms, each as large as value / α.
                let scale = b.v / f64::from(alpha) + b.d.abs();
                // Smaller numbers are subnormal in single precision.
                let least = 1e-33;
                assert!(
                    (a.v - b.v).abs() <= 2e-4 * b.v + least,
                    "{alpha}: {a:?} {b:?}"
                );
                assert!(
                    (a.d - b.d).abs() <= 2e-4 * scale + least,
                    "{alpha}: {a:?} {b:?}"
                );
                steep += u32::from(b.d.abs() > 10.0 * b.v);
            }
        }
    }
    assert!(steep > 100, "{steep}");
}

#[test]
fn finite_difference_of_replay_matches_its_gradient() {
    let difference = |factor| derivatives(&crop(6), 1, factor).unwrap();
    let (right, wrong) = (difference(1.0), difference(1.03));
    assert!(right.holds() && !wrong.holds(), "{right:?} {wrong:?}");
}

#[test]
fn tabulated_moments_and_gradient_match_replay() {
    let crop = crop(8);
    for lookup in [Lookup::Nearest, Lookup::Linear] {
        let recording = (crop.record(&Config::default().record_gammas, 0.3, 256, Seed(7))).unwrap();
        let table = uneven(lookup);
        let mut curves = Curves::bake(&recording, &table);
        curves.anchor(&table);
        let mut replay = Replay::new(recording);
        let adjoint = adjoint(64);
        // The second table is near the first, so that the tangent of folded paths is used too.
        let mut near = table.clone();
        for gamma in near.gammas.iter_mut() {
            *gamma *= 1.01;
        }
        for table in [&table, &near] {
            let (a, b) = (curves.moments(table), replay.moments(table));
            for p in 0..64 {
                for c in 0..3 {
                    let (a, b) = (a.mean[p][c], b.mean[p][c]);
                    assert!((a - b).abs() < 5e-3 * b, "{lookup:?} pixel {p}: {a} {b}");
                }
            }
            let exact = curves.exact(table);
            let second = |m: &Moments| m.second.iter().sum::<f32>();
            for (e, a) in exact.mean.iter().flatten().zip(a.mean.iter().flatten()) {
                // A grid step is up to 0.17 % in γ away, and a peak changes by twice that.
                assert!((e - a).abs() < 5e-3 * a, "{lookup:?}: {e} {a}");
            }
            assert!((second(&exact) / second(&a) - 1.0).abs() < 0.01);
            assert!((second(&a) / second(&b) - 1.0).abs() < 0.05);
            let (a, b) = (
                curves.gradient(table, &adjoint),
                replay.gradient(table, &adjoint),
            );
            let norm: f64 = b.iter().map(|g| g * g).sum::<f64>().sqrt();
            let off: f64 = a
                .iter()
                .zip(&b)
                .map(|(a, b)| (a - b).powi(2))
                .sum::<f64>()
                .sqrt();
            assert!(off < 0.05 * norm, "{lookup:?}: {off} of {norm}");
        }
    }
}
