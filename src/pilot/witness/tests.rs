use super::*;
use crate::math::{Rgb, Vec3};
use crate::sampler::{Independent, SampleSource, Sampler};
use crate::unit::{materials, shapes};

/// A film of 64 × 64 pixels with light in rare hits on top of an even light.
fn film(seed: u64, samples: u32, light: impl Fn(usize) -> (f32, f32)) -> Film {
    let mut film = Film::new(UVec2::splat(64));
    let source = Independent { seed: Seed(seed) };
    for pixel in 0..film.pixels.len() {
        let (even, chance) = light(pixel);
        for sample in 0..samples {
            let place = film.window.pixel(pixel);
            let hit = source.stream(place, sample).next_1d() < chance;
            let rare = if hit { 1.0 / chance } else { 0.0 };
            film.push(pixel, Rgb::splat(even + rare), sample);
        }
    }
    film
}

/// Roughened phase functions change the light of a picture, so that a witness would prove nothing.
#[test]
fn fog_that_scatters_unevenly_has_no_witness() {
    for (mean_cosine, expected) in [(0.0, true), (-0.9, false)] {
        let mut parts = crate::scene::SceneParts::default();
        let ball = shapes::sphere(Vec3::ZERO, 0.4, 3);
        parts.add(materials::glass("glass", 1.5, 0.0), [ball]);
        parts.add_camera([0.0, 0.0, 3.0], [0.0; 3], 38.0);
        parts.medium = Some(crate::scene::Medium {
            scattering: Rgb::splat(0.1),
            mean_cosine,
            ..Default::default()
        });
        let scene = crate::scene::Scene::new(parts);
        let film = Film::new(UVec2::splat(64));
        let view = View::of(&scene, &scene.parts().cameras[0], &film);
        let samples = samples_beside(&view, &Settings::default(), 256);
        assert_eq!(samples > 0, expected, "{mean_cosine}");
    }
}

#[test]
fn light_that_a_film_lacks_is_found_where_it_is() {
    let corner = |pixel: usize| pixel % 64 < 16 && pixel / 64 < 16;
    let witness = |seed| {
        film(seed, 4, |pixel| {
            (0.5, if corner(pixel) { 0.25 } else { 0.0 })
        })
    };
    for seed in 0..20 {
        let all = film(100 + seed, 64, |pixel| {
            (0.5, if corner(pixel) { 0.02 } else { 0.0 })
        });
        assert_eq!(compared(&witness(seed), &all, 4), None);
        let none = film(100 + seed, 64, |_| (0.5, 0.0));
        let missing = compared(&witness(seed), &none, 4).expect("light is missing");
        // 1/16 of 1 beside 0.5.
        assert!((0.05..0.125).contains(&missing.share), "{missing}");
        assert!(missing.pixel.x < 24 && missing.pixel.y < 24, "{missing}");
        assert!(missing.squares[0] > 0.05 && missing.squares[4095] == 0.0);
    }
}

#[test]
fn few_bright_samples_of_a_witness_are_no_proof() {
    for seed in 0..20 {
        // Two hits of 500 beside an even light.
        let witness = film(seed, 4, |_| (0.5, 1.0 / 8192.0));
        let dark = film(100 + seed, 64, |_| (0.5, 0.0));
        assert_eq!(compared(&witness, &dark, 4), None);
    }
}
