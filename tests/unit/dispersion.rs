//! Dispersion: indices of the channels, and each channel against a scene with its index.

use crate::image::Film;
use crate::integrator::bidirectional::Radius;
use crate::integrator::{Amounts, Estimator, Settings};
use crate::regularise::Rule;
use crate::scene::{Material, Scene, SceneParts};
use crate::unit::lab::gallery;
use crate::unit::support::render;

#[test]
fn dispersion_gives_the_indices_of_a_known_glass() {
    // Schott N-BK7: n_d = 1.51680, V = 64.17, n_C = 1.51432, n_F = 1.52238.
    let glass = Material {
        ior: 1.5168,
        dispersion: 20.0 / 64.17,
        ..Material::default()
    };
    for (got, expected) in glass.iors().into_iter().zip([1.51432f32, 1.5168, 1.52238]) {
        assert!((got - expected).abs() < 2e-4, "{got} {expected}");
    }
    assert_eq!(Material::default().iors(), [1.5; 3]);
}

/// A box with a glass ball of this index and dispersion.
fn ball(ior: f32, dispersion: f32) -> Scene {
    rough_ball(0.0, ior, dispersion)
}

/// The same box with rough glass.
fn rough_ball(alpha: f32, ior: f32, dispersion: f32) -> Scene {
    let parts = gallery::caustic_box();
    let change = |m: Material| match m.solid {
        true => Material {
            alpha,
            ior,
            dispersion,
            ..m
        },
        false => m,
    };
    let materials = parts.materials.into_iter().map(change).collect();
    render::scene(SceneParts { materials, ..parts })
}

/// Mean of a channel over the picture, and its standard error.
fn channel(film: &Film, c: usize) -> (f64, f64) {
    let n = film.pixels.len() as f64;
    let sum = |b: crate::image::Buffer| b.pixels.iter().map(|p| f64::from(p[c])).sum::<f64>();
    (
        sum(film.mean()) / n,
        sum(film.variance_of_mean()).sqrt() / n,
    )
}

/// Each channel of a picture with this glass against glass with the channel's index, with z-scores of at most 4.
fn assert_channels(alpha: f32, all: &[Settings]) {
    let (ior, dispersion) = (1.5, 2.5);
    let scene = rough_ball(alpha, ior, dispersion);
    let glass = Material {
        ior,
        dispersion,
        ..Material::default()
    };
    for settings in all {
        let split = render::film_with(&scene, settings, 24, 256);
        for (c, n) in glass.iors().into_iter().enumerate() {
            let other = Settings {
                seed: 40 + c as u64,
                ..settings.clone()
            };
            let alone = render::film_with(&rough_ball(alpha, n, 0.0), &other, 24, 128);
            let ((a, s), (b, t)) = (channel(&split, c), channel(&alone, c));
            let z = (a - b) / s.hypot(t);
            println!(
                "{:?}, channel {c}: {a:.4} {b:.4}, z = {z:.2}",
                settings.estimator
            );
            assert!(
                z.abs() < 4.0,
                "channel {c} of {settings:?}: {a} {b}, z = {z}"
            );
        }
    }
}

#[test]
fn dispersion_gives_each_channel_the_picture_of_its_index() {
    assert!(ball(1.5, 2.5).features().dispersion && !ball(1.5, 0.0).features().dispersion);
    let path = Settings {
        seed: 3,
        ..Settings::default()
    };
    let rough = Settings {
        rule: Rule::constant(0.4),
        ..path.clone()
    };
    let reuse = Settings {
        estimator: Estimator::Path { reuse: true },
        ..rough.clone()
    };
    assert_channels(0.0, &[path, rough, reuse]);
}

/// Connections and merges at and behind smooth and rough dispersive glass.
#[test]
fn dispersion_from_both_ends_gives_each_channel_the_picture_of_its_index() {
    let radius = Radius {
        first: Some(0.03),
        ..Radius::default()
    };
    let of = |estimator| Settings {
        estimator,
        seed: 3,
        ..Settings::default()
    };
    let all = [
        Estimator::Light,
        Estimator::Bdpt,
        Estimator::Vcm(radius),
        Estimator::Sppm(radius),
    ];
    for alpha in [0.0, 0.3] {
        assert_channels(alpha, &all.map(of));
    }
}

#[test]
fn dispersion_of_levels_is_that_of_the_path_tracer() {
    let scene = ball(1.5, 2.5);
    let plain = Settings::default();
    let levels = Settings {
        rule: Rule::constant(0.4),
        amounts: Amounts::roughening(&[0.0, 1.0]).expect("scales"),
        seed: 9,
        ..Settings::default()
    };
    let picture = |settings: &Settings| {
        let mut picture = crate::integrator::Picture::new(Film::new(glam::UVec2::splat(24)));
        let camera = &scene.parts().cameras[0];
        let view = crate::integrator::View::of(&scene, camera, &picture.film);
        settings.integrator().pass(&view, 0..128, &mut picture);
        picture.film
    };
    let (a, b) = (picture(&plain), picture(&levels));
    for c in 0..3 {
        let ((a, s), (b, t)) = (channel(&a, c), channel(&b, c));
        assert!((a - b).abs() < 4.0 * s.hypot(t), "channel {c}: {a} {b}");
    }
}
