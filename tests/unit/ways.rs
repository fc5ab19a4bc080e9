//! Paths and levels that follow both reflection and refraction at smooth glass, against a random choice of one.

use super::levels::{SCALED, level_films, metal_room, scaled, settings, table};
use crate::image::Film;
use crate::integrator::Settings;
use crate::math::{Rgb, UVec2, Vec3};
use crate::regularise::Rule;
use crate::scene::{Material, Scene};
use crate::unit::drawn::{drawn, drawn_samples};
use crate::unit::lab::gallery::materials::{coated, glass};
use crate::unit::lab::gallery::shapes::{quad, sphere};
use crate::unit::lab::stats::agreement::agree;
use crate::unit::support::render::{film_with, scene};
use crate::unit::support::scenes::{point_light_over_plane, two_mirrors};

/// A film as [`drawn`] makes it, whose samples are means of `each` samples.
fn drawn_means(scene: &Scene, settings: &Settings, size: u32, passes: u32, each: u32) -> Film {
    let mut film = Film::new(UVec2::splat(size));
    for pass in 0..passes {
        let some = drawn_samples(scene, settings, size, pass * each..(pass + 1) * each);
        let pairs = film.pixels.iter_mut().zip(&some.pixels);
        pairs.for_each(|(pixel, m)| pixel.push(m.mean));
    }
    film
}

/// The room of rough metal behind a pane that reflects a third of the light, with a glass ball and a point light.
fn glass_room() -> Scene {
    let mut parts = metal_room();
    parts.lights.push(point_light_over_plane().lights[0]);
    let pane = Material {
        transmission: 1.0,
        ior: 4.0,
        ..coated("pane", Rgb::ONE, 0.0)
    };
    let corner = Vec3::new(-0.95, 0.05, 0.6);
    parts.add(pane, [quad(corner, 1.9 * Vec3::X, 1.9 * Vec3::Y)]);
    let ball = sphere(Vec3::new(0.45, 1.0, 0.3), 0.3, 3);
    parts.add(glass("ball", 1.8, 0.0), [ball]);
    scene(parts)
}

/// Following both gives the mean of choosing one.
#[test]
fn agreement_of_paths_on_both_ways_with_drawn_ones() {
    let scene = glass_room();
    for seed in 1..=4 {
        let rules = [Rule::Plain, Rule::constant(0.5), table()];
        for (number, rule) in rules.into_iter().enumerate() {
            let name = ["plain", "constant", "table"][number];
            let both = film_with(&scene, &settings(rule.clone(), &[], seed), 16, 512);
            let one = drawn(&scene, &settings(rule.clone(), &[], seed + 9), 16, 512);
            let agreement = agree(&both, &one).expect("one frame");
            assert!(agreement.passed(), "{name}, seed {seed}: {agreement:?}");
        }
    }
}

#[test]
fn agreement_of_levels_on_both_ways_with_drawn_ones() {
    let scene = glass_room();
    for seed in 1..=4 {
        let rule = table();
        let all = level_films(&scene, &settings(rule.clone(), &SCALED, seed), 16, 64, 8);
        for (k, scale) in SCALED.iter().enumerate() {
            let settings = settings(scaled(&rule, *scale), &[], seed + 9);
            let one = drawn_means(&scene, &settings, 16, 64, 8);
            let agreement = agree(&all[k], &one).expect("one frame");
            assert!(agreement.passed(), "level {k}, seed {seed}: {agreement:?}");
        }
    }
}

#[test]
fn scenes_without_glass_have_the_bytes_of_a_drawn_way() {
    for parts in [point_light_over_plane(), two_mirrors(0.9, 0.1)] {
        let scene = scene(parts);
        for rule in [Rule::Plain, Rule::constant(0.4), table()] {
            let settings = settings(rule, &[], 3);
            assert_eq!(
                film_with(&scene, &settings, 24, 16),
                drawn(&scene, &settings, 24, 16)
            );
        }
    }
}
