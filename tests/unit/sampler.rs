//! Sobol points against independent samples: the same pictures, less noise, correct batch variances.

use crate::image::Film;
use crate::image::level_film::BATCHES;
use crate::integrator::bidirectional::Radius;
use crate::integrator::{Amounts, Estimator, Picture, Settings, View};
use crate::math::moments::Moments;
use crate::math::{Rgb, UVec2};
use crate::regularise::Rule;
use crate::sampler::{CameraSource, SampleSource, Sampler, SamplerKind, Seed};
use crate::scene::{Lens, Scene};
use crate::unit::lab::gallery::{area_light_over_plane, caustic_box, cornell_box, furnace_sphere};
use crate::unit::lab::stats::agreement::agree;
use crate::unit::support::render::{film_with, scene};
use crate::unit::support::scenes::two_mirrors;

fn settings(sampler: SamplerKind, seed: u64) -> Settings {
    Settings {
        sampler,
        seed,
        ..Settings::default()
    }
}

/// A film whose samples are renders of `spp` samples with different seeds, and so independent.
fn renders(scene: &Scene, base: &Settings, size: u32, spp: u32, seeds: u64) -> Film {
    let mut film = Film::new(UVec2::splat(size));
    for seed in 0..seeds {
        let settings = Settings {
            seed: base.seed + seed,
            ..base.clone()
        };
        let render = film_with(scene, &settings, size, spp);
        let pairs = film.pixels.iter_mut().zip(&render.pixels);
        pairs.for_each(|(pixel, m): (&mut Moments, &Moments)| pixel.push(m.mean));
    }
    film
}

fn sum(pixels: &[Rgb]) -> f64 {
    pixels.iter().map(|p| f64::from(p.element_sum())).sum()
}

#[test]
fn agreement_of_sobol_and_independent_samples() {
    let mut lens = cornell_box();
    lens.cameras[0].lens = Some(Lens {
        radius: 0.1,
        focus: 2.0,
    });
    for parts in [
        furnace_sphere(0.8),
        caustic_box(),
        two_mirrors(0.9, 0.2),
        lens,
    ] {
        let scene = scene(parts);
        // 12 samples: no power of 2.
        let sobol = renders(&scene, &settings(SamplerKind::Sobol, 1), 16, 12, 64);
        let plain = renders(
            &scene,
            &settings(SamplerKind::Independent, 1000),
            16,
            12,
            64,
        );
        let agreement = agree(&sobol, &plain).unwrap();
        assert!(agreement.passed(), "{agreement}");
    }
}

/// Estimators with light paths, with their default films.
fn with_light_paths(sampler: SamplerKind, seed: u64) -> [Settings; 4] {
    let radius = Radius::default();
    [
        Estimator::Bdpt,
        Estimator::Vcm(radius),
        Estimator::Sppm(radius),
        Estimator::Light,
    ]
    .map(|estimator| {
        let raw = Settings {
            estimator,
            ..settings(sampler, seed)
        };
        let amounts = raw.usual_amounts(true).expect("films");
        Settings { amounts, ..raw }
    })
}

#[test]
fn agreement_of_sobol_and_independent_light_paths() {
    let mut lens = two_mirrors(0.9, 0.2);
    lens.cameras[0].lens = Some(Lens {
        radius: 0.1,
        focus: 2.0,
    });
    for parts in [caustic_box(), lens] {
        let scene = scene(parts);
        let sobol = with_light_paths(SamplerKind::Sobol, 1);
        let plain = with_light_paths(SamplerKind::Independent, 1000);
        for (sobol, plain) in sobol.iter().zip(&plain) {
            let pictures = [sobol, plain].map(|settings| renders(&scene, settings, 16, 12, 48));
            let agreement = agree(&pictures[0], &pictures[1]).unwrap();
            assert!(agreement.passed(), "{:?}: {agreement}", sobol.estimator);
        }
    }
}

/// Variance of the mean of 64 Sobol samples, relative to independent ones. Measured: 0.20 and 0.05; 0.13, 0.13 and 0.81
/// with light paths.
#[test]
fn variance_of_sobol_samples_is_lower() {
    for (parts, most) in [(area_light_over_plane(), 0.5), (cornell_box(), 0.5)] {
        let scene = scene(parts);
        let ratio = ratio_of_variances(&scene, |sampler| settings(sampler, 5));
        println!("ratio {ratio}");
        assert!(ratio < most, "{ratio}");
    }
    let scene = scene(caustic_box());
    for (k, most) in [0.2, 0.2, 0.95].into_iter().enumerate() {
        let ratio = ratio_of_variances(&scene, |sampler| with_light_paths(sampler, 5)[k].clone());
        println!("estimator {k}: ratio {ratio}");
        assert!(ratio < most, "estimator {k}: {ratio}");
    }
}

/// Variance of the mean of 64 Sobol samples of a frame, relative to independent ones.
fn ratio_of_variances(scene: &Scene, settings: impl Fn(SamplerKind) -> Settings) -> f64 {
    let variance = |sampler| {
        let film = renders(scene, &settings(sampler), 12, 64, 16);
        sum(&film.sample_variance().pixels)
    };
    variance(SamplerKind::Sobol) / variance(SamplerKind::Independent)
}

/// The variance between batches, input to the choice of levels, is that of the picture; the variance of a film is an
/// upper bound.
#[test]
fn variance_between_batches_of_sobol_samples_is_honest() {
    let levels = Settings {
        amounts: Amounts::roughening(&[0.0, 1.0]).expect("scales"),
        rule: Rule::constant(0.2),
        ..settings(SamplerKind::Sobol, 9)
    };
    let [bdpt, vcm, ..] = with_light_paths(SamplerKind::Sobol, 9);
    for settings in [levels, bdpt, vcm] {
        let [between, bound] = stated_variances(&settings);
        let estimator = settings.estimator;
        println!("{estimator:?}: between {between}, bound {bound}");
        assert!((0.85..1.18).contains(&between), "{estimator:?}: {between}");
        assert!(bound > 1.2, "{estimator:?}: {bound}");
    }
}

/// Raw means of estimators with light paths have independent samples: the film's variance is that of the picture.
#[test]
fn variance_of_raw_means_with_light_paths_is_honest() {
    for settings in with_light_paths(SamplerKind::Sobol, 9) {
        let raw = Settings {
            amounts: Amounts::Raw,
            ..settings
        };
        let [_, bound] = stated_variances(&raw);
        let estimator = raw.estimator;
        println!("{estimator:?}: {bound}");
        assert!((0.85..1.18).contains(&bound), "{estimator:?}: {bound}");
    }
}

/// The variance between batches (0 without batches) and that of a film, relative to the true variance.
fn stated_variances(base: &Settings) -> [f64; 2] {
    let scene = scene(cornell_box());
    let (size, spp, seeds) = (12, 64, 24);
    let truth = sum(&renders(&scene, base, size, spp, seeds)
        .sample_variance()
        .pixels);
    let (mut between, mut bound) = (0.0, 0.0);
    for seed in 100..100 + seeds {
        let mut picture = Picture::new(Film::new(UVec2::splat(size)));
        let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
        let settings = Settings {
            seed,
            ..base.clone()
        };
        (settings.integrator()).pass(&view, 0..spp, &mut picture);
        if let Some(levels) = picture.levels {
            let batches = levels.batch_means(0);
            for pixel in 0..picture.film.pixels.len() {
                let mut moments = Moments::default();
                for batch in &batches {
                    moments.push(batch.pixels[pixel].as_dvec3());
                }
                between += moments.variance_of_mean().element_sum();
            }
        }
        bound += sum(&picture.film.variance_of_mean().pixels);
    }
    [between, bound].map(|sum| sum / seeds as f64 / truth)
}

/// Streams depend on pixel and sample alone; other pixels, batches and seeds give other numbers.
#[test]
fn determinism_of_camera_streams() {
    let source = |seed, batches| CameraSource::new(SamplerKind::Sobol, Seed(seed), batches);
    let numbers = |source: CameraSource, pixel: [u32; 2], sample| {
        let mut stream = source.stream(pixel.into(), sample);
        let vertices = (0..8).map(|_| stream.vertex());
        let lobes: Vec<[f32; 3]> = vertices.map(|u| u.lobe).collect();
        (stream.film(), lobes)
    };
    let batches = BATCHES as u32;
    let one = numbers(source(1, batches), [3, 4], 9);
    assert_eq!(one, numbers(source(1, batches), [3, 4], 9));
    for other in [
        numbers(source(2, batches), [3, 4], 9),
        numbers(source(1, batches), [4, 3], 9),
        numbers(source(1, batches), [3, 4], 10),
        numbers(source(1, 1), [3, 4], 9),
    ] {
        assert_ne!(one.0, other.0);
        let pairs = one.1.iter().zip(&other.1);
        assert!(pairs.take(4).all(|(a, b)| a != b));
    }
}
