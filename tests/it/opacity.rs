//! Surfaces of partial opacity: their colours in a stack, their shadows, and the noise of both.

use super::support::render::{add_passes, film_with, mean, scene};
use opsr::image::Film;
use opsr::image::film::Window;
use opsr::integrator::{Estimator, Picture, Settings};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::sampler::SamplerKind;
use opsr::scene::{AlphaMode, Material, PunctualLight, Scene, SceneParts};
use opsr_lab::gallery::materials::{diffuse, emitter};
use opsr_lab::gallery::shapes::{Placing, quad};

fn partly_opaque(opacity: f32, material: Material) -> Material {
    Material {
        alpha_mode: AlphaMode::Blend,
        opacity,
        ..material
    }
}

fn settings(sampler: SamplerKind, seed: u64) -> Settings {
    Settings {
        sampler,
        seed,
        ..Settings::default()
    }
}

/// Layers behind each other across the whole view, the first red, the next ones green and blue.
fn coloured(opacities: &[f32]) -> Scene {
    let mut parts = SceneParts::default();
    for (k, &opacity) in opacities.iter().enumerate().rev() {
        let corner = Vec3::new(-10.0, -10.0, -(k as f32));
        let light = emitter("layer", Rgb::AXES[k]);
        parts.add(
            partly_opaque(opacity, light),
            [quad(corner, 20.0 * Vec3::X, 20.0 * Vec3::Y)],
        );
    }
    parts.add_camera([0.0, 0.0, 5.0], [0.0, 0.0, 0.0], 20.0);
    scene(parts)
}

/// The share of each layer is its opacity times the transmittance before it, with far less noise than by independent
/// samples.
#[test]
fn stacked_layers_show_the_product_of_their_opacities() {
    const SAMPLES: u32 = 16;
    for opacities in [&[0.3][..], &[0.5, 0.5], &[0.3, 0.5, 0.6]] {
        let scene = coloured(opacities);
        for (sampler, most) in [(SamplerKind::Independent, 1.2), (SamplerKind::Sobol, 0.25)] {
            let film = film_with(&scene, &settings(sampler, 4), 24, SAMPLES).mean();
            let pixels = film.pixels.len() as f64;
            let mut through = 1.0;
            for (k, &opacity) in opacities.iter().enumerate() {
                let share = through * f64::from(opacity);
                through -= share;
                let values = film.pixels.iter().map(|p| f64::from(p[k]));
                let mean = values.clone().sum::<f64>() / pixels;
                let variance = values.map(|v| (v - share).powi(2)).sum::<f64>() / pixels;
                let expected = share * (1.0 - share) / f64::from(SAMPLES);
                let far = 5.0 * (expected / pixels).sqrt();
                assert!(
                    (mean - share).abs() < far,
                    "{opacities:?} {k}: {mean}, not {share}"
                );
                let ratio = variance / expected;
                assert!(ratio < most, "{opacities:?} {k} {sampler:?}: {ratio}");
            }
        }
    }
}

/// A floor under a small lamp and black layers between the two, seen from below or above them.
fn shaded(opacities: &[f32], height: f32) -> Scene {
    let mut parts = SceneParts::default();
    let wide = |y| quad(Vec3::new(-20.0, y, -20.0), 40.0 * Vec3::Z, 40.0 * Vec3::X);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [wide(0.0)]);
    for (k, &opacity) in opacities.iter().enumerate() {
        let black = diffuse("layer", Rgb::ZERO);
        parts.add(partly_opaque(opacity, black), [wide(1.0 + 0.2 * k as f32)]);
    }
    parts.lights.push(PunctualLight::Point {
        position: 4.0 * Vec3::Y,
        intensity: Rgb::splat(30.0),
        range: f32::INFINITY,
    });
    parts.add_camera([0.0, height, 2.0], [0.0, 0.0, 0.0], 20.0);
    scene(parts)
}

/// The transmittance of layers has no noise.
#[test]
fn shadow_of_layers_is_their_transmittance() {
    let settings = Settings {
        max_vertices: 1,
        ..settings(SamplerKind::Sobol, 2)
    };
    let of = |opacities: &[f32]| film_with(&shaded(opacities, 0.8), &settings, 16, 4).mean();
    let (open, shade) = (of(&[]), of(&[0.3, 0.5]));
    for (open, shade) in open.pixels.iter().zip(&shade.pixels) {
        let expected = 0.35 * open.x;
        assert!(
            (shade.x - expected).abs() < 1e-5 * expected,
            "{shade} {open}"
        );
    }
}

/// Camera rays and shadow rays pass the same layers independently, for paths from the camera and from lights.
#[test]
fn camera_and_light_pass_layers_independently() {
    for estimator in [Settings::default().estimator, Estimator::Bdpt] {
        let settings = Settings {
            max_vertices: 1,
            estimator,
            ..settings(SamplerKind::Sobol, 3)
        };
        let of = |opacities: &[f32]| mean(&film_with(&shaded(opacities, 3.0), &settings, 16, 256));
        let (open, seen) = (of(&[]), of(&[0.3, 0.5]));
        let expected = 0.35 * 0.35 * open.0;
        assert!(
            (seen.0 - expected).abs() < 0.01 * expected + 3.0 * seen.1,
            "{estimator:?}: {seen:?}, not {expected}"
        );
    }
}

/// A box of partial opacity whose backs are hidden from the camera, and not from light paths.
#[test]
fn agreement_of_path_and_bdpt_through_hidden_backs() {
    let mut parts = SceneParts::default();
    let wide = quad(Vec3::new(-4.0, -1.01, -4.0), 8.0 * Vec3::Z, 8.0 * Vec3::X);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [wide]);
    let box_of = opsr_lab::gallery::shapes::cuboid(-Vec3::ONE, Vec3::ONE).inverted();
    let wall = Material {
        double_sided: false,
        ..diffuse("wall", Rgb::splat(0.6))
    };
    parts.add(partly_opaque(0.6, wall), [box_of]);
    let corner = Vec3::new(-0.4, 0.9, -0.4);
    parts.add(
        emitter("lamp", Rgb::splat(4.0)),
        [quad(corner, Vec3::X * 0.8, Vec3::Z * 0.8)],
    );
    parts.add_camera([0.8, 0.6, 4.5], [0.0, 0.0, 0.0], 34.0);
    let scene = scene(parts);
    let of = |estimator, seed| {
        let settings = Settings {
            estimator,
            ..settings(SamplerKind::Sobol, seed)
        };
        mean(&film_with(&scene, &settings, 16, 512)).0
    };
    let (path, both) = (of(Settings::default().estimator, 1), of(Estimator::Bdpt, 2));
    // Pixels share light paths, so that the mean has more noise than the film states.
    assert!((path - both).abs() < 0.05 * path, "{path} {both}");
}

#[test]
fn determinism_of_layers_over_splits_threads_and_crops() {
    let scene = shaded(&[0.3, 0.5], 3.0);
    let settings = settings(SamplerKind::Sobol, 5);
    let size = UVec2::new(21, 18);
    let render = |window: Window, ends: &[u32], threads: usize| {
        let mut picture = Picture::new(Film::cropped(size, window).expect("inside"));
        add_passes(&scene, &settings, ends, threads, &mut picture);
        picture.film
    };
    let whole = render(Window::full(size), &[10], 1);
    assert_eq!(render(Window::full(size), &[1, 2, 7, 10], 3), whole);
    let window = Window {
        x: 3,
        y: 2,
        w: 17,
        h: 16,
    };
    assert_eq!(render(window, &[10], 2), whole.cut(window));
}
