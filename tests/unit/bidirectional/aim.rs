//! Aimed emission: the same picture as uniform emission, shares that depend only on scene, view and seed, and variances
//! that do not grow with surfaces outside of the view.

use super::scenes::{
    field, lamps_in_field, many_lamps, points_in_field, sky_in_field, sun_in_field,
};
use crate::image::film::{Film, Window};
use crate::integrator::bidirectional::{AimCache, Bidirectional, Radius, Strategies};
use crate::integrator::{Estimator, Integrator, Picture, Settings, View};
use crate::math::{Rgb, UVec2};
use crate::scene::{Aim, Scene, SceneParts};
use crate::unit::lab::gallery;
use crate::unit::lab::stats::agreement::agree;
use crate::unit::support::render::{film_with, mean, scene};

const SIZE: UVec2 = UVec2::splat(24);

fn view(scene: &Scene) -> View<'_> {
    View::new(scene, &scene.parts().cameras[0], SIZE, Window::full(SIZE))
}

fn fields() -> [(&'static str, SceneParts); 5] {
    [
        ("sun", field(sun_in_field)),
        ("sky", field(sky_in_field)),
        ("lamps", field(lamps_in_field)),
        ("points", field(points_in_field)),
        ("many lamps", many_lamps()),
    ]
}

fn estimator(strategies: Strategies, merging: bool, seed: u64) -> Bidirectional {
    let radius = Radius {
        first: Some(0.02),
        alpha: 1.0,
    };
    let settings = Settings {
        max_vertices: 6,
        seed,
        ..Settings::default()
    };
    Bidirectional {
        merging: merging.then_some(radius),
        ..settings.bidirectional(strategies)
    }
}

fn picture(scene: &Scene, mut integrator: Bidirectional, spp: u32) -> Film {
    let mut picture = Picture::new(Film::new(SIZE));
    integrator.pass(&view(scene), 0..spp, &mut picture);
    assert_eq!(picture.film.rejected.total(), 0);
    picture.film
}

/// Aimed and uniform emission give the same picture with every use of light paths.
#[test]
fn agreement_of_aimed_with_uniform_emission() {
    let mut wrong = Vec::new();
    for (name, parts) in fields() {
        let scene = scene(parts);
        let ways = [
            (Strategies::All, false),
            (Strategies::All, true),
            (Strategies::Light, false),
            (Strategies::Density, true),
        ];
        for (strategies, merging) in ways {
            let aimed = picture(&scene, estimator(strategies, merging, 1), 128);
            let aim_cache = AimCache::default();
            aim_cache.aim(&view(&scene), Aim::default);
            let uniform = Bidirectional {
                aim_cache,
                ..estimator(strategies, merging, 2)
            };
            let uniform = picture(&scene, uniform, 512);
            let agreement = agree(&aimed, &uniform).expect("one size");
            println!(
                "{name}, {strategies:?}: {:.4?} {:.4?}",
                mean(&aimed),
                mean(&uniform)
            );
            // With uniform emission few photons reach a pixel.
            if !agreement.image.passed() {
                println!("{agreement}");
                wrong.push(format!("{name}, {strategies:?}, {merging}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// Lights in a field are aimed; lights of a room that the view shows are not.
#[test]
fn light_is_aimed_where_it_gains() {
    for (name, parts) in fields() {
        let scene = scene(parts);
        let aim = estimator(Strategies::All, true, 0).aim(&view(&scene));
        assert!(!aim.is_uniform() || name == "many lamps", "{name}");
    }
    let cornell_box = scene(gallery::cornell_box());
    for strategies in [Strategies::All, Strategies::Light, Strategies::Density] {
        let aim = estimator(strategies, true, 0).aim(&view(&cornell_box));
        assert!(aim.is_uniform());
    }
}

#[test]
fn determinism_of_shares_over_threads_windows_and_runs() {
    let scene = scene(field(sky_in_field));
    let whole = view(&scene);
    let crop = View {
        window: Window {
            x: 3,
            y: 5,
            w: 4,
            h: 2,
        },
        ..whole
    };
    let found = |threads: usize, view: &View<'_>, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let settings = estimator(Strategies::All, true, seed);
        pool.expect("threads").install(|| settings.aim(view))
    };
    let first = found(1, &whole, 0);
    assert!(!first.is_uniform());
    assert_eq!(first, found(7, &whole, 0));
    assert_eq!(first, found(2, &crop, 0));
    assert_ne!(first, found(2, &whole, 1));
}

/// Light and relative variance in the view of a ball in the sun do not depend on the surroundings.
#[test]
fn variance_does_not_grow_with_the_floor() {
    let vcm = Estimator::Vcm(Radius::default());
    let sppm = Estimator::Sppm(Radius::default());
    for estimator in [vcm, sppm, Estimator::Light] {
        let render = |name: &str| {
            let scene = scene(gallery::builtin(name).expect("a scene"));
            let settings = Settings {
                estimator,
                max_vertices: 8,
                ..Settings::default()
            };
            let film = film_with(&scene, &settings, 48, 32);
            let (means, variances) = (film.mean(), film.variance_of_mean());
            let sum = |all: &[Rgb]| all.iter().map(|p| f64::from(p.element_sum())).sum::<f64>();
            let light = sum(&means.pixels) / means.pixels.len() as f64;
            let noise = sum(&variances.pixels) / means.pixels.len() as f64;
            (light, noise / (light * light))
        };
        let (near, far) = (render("ball-on-40-m"), render("ball-on-400-m"));
        println!("{estimator:?}: {near:.4?} {far:.4?}");
        assert!(far.1 < 4.0 * near.1, "{estimator:?}: {near:?} {far:?}");
        // Pixels share photons: the mean is hardly less noisy than pixels, whose squared error is the second number.
        let noise = 0.5 * (near.1 + far.1).sqrt();
        assert!(
            (far.0 / near.0 - 1.0).abs() < noise.max(0.03),
            "{near:?} {far:?}"
        );
    }
}

/// Under a mesh sky bidirectional light sampling has the variance of the path tracer's.
#[test]
fn variance_of_light_sampling_among_many_lights() {
    let scene = scene(gallery::builtin("plate-under-mesh-sky").expect("a scene"));
    let noise = |estimator| {
        let settings = Settings {
            estimator,
            max_vertices: 2,
            ..Settings::default()
        };
        let film = film_with(&scene, &settings, 32, 64);
        let sum: Rgb = film.variance_of_mean().pixels.iter().sum();
        sum.element_sum()
    };
    let path = noise(Estimator::Path { reuse: false });
    let bdpt = noise(Estimator::Bdpt);
    println!("path {path:.3e}, bdpt {bdpt:.3e}");
    assert!(bdpt < 1.2 * path, "{bdpt} {path}");
}
