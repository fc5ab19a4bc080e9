//! One strategy at a time, with weight 1, against the path tracer's paths of the same length: MIS weights could hide
//! wrong values.

use super::scenes::{lit, point_lit, sheets, with_sphere};
use crate::image::Film;
use crate::integrator::bidirectional::{Radius, Strategies, Strategy};
use crate::integrator::{Estimator, Integrator, Picture, Settings, View};
use crate::math::{Rgb, UVec2};
use crate::sampler::{Independent, SampleSource, Sampler, Seed};
use crate::scene::{Material, Scene, SceneParts};
use crate::unit::lab::gallery::materials::{coated, diffuse, metal};
use crate::unit::lab::stats::agreement::agree;
use crate::unit::support::render::{film_with, scene};

const SIZE: u32 = 16;

/// Paths of exactly this number of edges: the difference of two path lengths with the same random numbers.
fn exact_length(scene: &Scene, edges: u32, spp: u32) -> Film {
    let mut film = Film::new(UVec2::splat(SIZE));
    let source = Independent { seed: Seed(5) };
    let view = View::of(scene, &scene.parts().cameras[0], &film);
    let radiance = |depth: u32, sample: u32| {
        let settings = Settings {
            max_vertices: depth,
            seed: source.seed.0,
            ..Settings::default()
        };
        let mut picture = Picture::new(Film::new(UVec2::splat(SIZE)));
        (settings.integrator()).pass(&view, sample..sample + 1, &mut picture);
        picture.film.mean()
    };
    for sample in 0..spp {
        let long = radiance(edges - 1, sample);
        let short = (edges > 2).then(|| radiance(edges - 2, sample));
        for index in 0..film.pixels.len() {
            let shorter = match &short {
                None => {
                    radiance_of_emitters(scene, &view, film.window.pixel(index), &source, sample)
                }
                Some(short) => short.pixels[index],
            };
            film.push(index, long.pixels[index] - shorter, sample);
        }
    }
    film
}

/// Emission that the camera sees directly.
fn radiance_of_emitters(
    scene: &Scene,
    view: &View<'_>,
    pixel: UVec2,
    source: &Independent,
    sample: u32,
) -> Rgb {
    let ray = (view.sensor).ray(pixel.as_vec2() + source.stream(pixel, sample).film());
    (scene.intersect(&ray)).map_or(Rgb::ZERO, |hit| {
        scene.lights().emitted(&scene.surface(&hit), -ray.dir)
    })
}

fn strategy(scene: &Scene, s: u32, t: u32, spp: u32) -> Film {
    let mut picture = Picture {
        film: Film::new(UVec2::splat(SIZE)),
        aovs: None,
        levels: None,
    };
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    Settings::default()
        .bidirectional(Strategies::Only { s, t })
        .pass(&view, 0..spp, &mut picture);
    picture.film
}

fn assert_each_strategy(name: &str, parts: SceneParts, area: bool) {
    let scene = scene(parts);
    let mut wrong = Vec::new();
    for edges in 2..=5 {
        let expected = exact_length(&scene, edges, 128);
        for s in u32::from(!area)..=edges {
            let t = edges + 1 - s;
            // With weight 1 the 1/d² of a connection is unbounded. Bright corners are too rare for a test of means: of
            // tiles with an area light, and of the whole image near a point light. `agreement` compares the weighted
            // sum of all strategies.
            let unbounded = s > 1 && t > 1;
            if !area && unbounded {
                continue;
            }
            let agreement = agree(&expected, &strategy(&scene, s, t, 192)).expect("one size");
            // Single pixels of a strategy that hardly ever succeeds have no variance to test with.
            if !(unbounded || agreement.tiles.passed()) || !agreement.image.passed() {
                println!("{name}, s = {s}, t = {t}\n{agreement}");
                wrong.push((s, t));
            }
        }
    }
    assert!(wrong.is_empty(), "{name}: {wrong:?}");
}

fn grey() -> Material {
    diffuse("walls", Rgb::new(0.7, 0.5, 0.3))
}

#[test]
fn agreement_of_each_strategy_in_a_diffuse_box() {
    assert_each_strategy("area light", lit(grey(), 3.0), true);
    assert_each_strategy("point light", point_lit(grey()), false);
}

#[test]
fn agreement_of_each_strategy_in_a_glossy_box() {
    let walls = metal("walls", Rgb::new(0.7, 0.5, 0.3), 0.3);
    assert_each_strategy("area light", lit(walls, 3.0), true);
}

#[test]
fn agreement_of_each_strategy_through_translucent_sheets() {
    assert_each_strategy("sheets", sheets(), true);
}

/// With their weights the strategies add up to the whole, without gaps or overlaps.
#[test]
fn weighted_strategies_add_up_to_the_whole() {
    let scene = scene(with_sphere(coated("coat", Rgb::splat(0.5), 0.1)));
    let vcm = Estimator::Vcm(Radius {
        first: Some(0.05),
        alpha: 1.0,
    });
    for estimator in [Estimator::Bdpt, vcm] {
        let film = |strategy| {
            let settings = Settings {
                estimator,
                strategy,
                max_vertices: 4,
                seed: 3,
                ..Settings::default()
            };
            film_with(&scene, &settings, SIZE, 16)
        };
        let whole = film(None);
        let mut sum = vec![Rgb::ZERO; whole.pixels.len()];
        let of = |all| (0..all).map(move |s| Strategy::Connection { s, t: all - s });
        for strategy in (2..=6).flat_map(of).chain([Strategy::Merges]) {
            let mean = film(Some(strategy)).mean();
            for (sum, value) in sum.iter_mut().zip(&mean.pixels) {
                *sum += *value;
            }
        }
        for (sum, value) in sum.iter().zip(&whole.mean().pixels) {
            let off = (*sum - *value).abs().max_element();
            assert!(off <= 1e-4 * value.max_element().max(1e-3), "{sum} {value}");
        }
    }
}
