//! Learned roughening in the bidirectional estimators: one integrand for all strategies.

use super::scenes::{lit, under_water};
use crate::image::Film;
use crate::integrator::bidirectional::{Radius, Strategies};
use crate::integrator::{Estimator, Integrator, Picture, Settings, View};
use crate::math::{Rgb, UVec2};
use crate::regularise::{AttenuationTable, Rule};
use crate::scene::Scene;
use crate::unit::lab::gallery::materials::{coated, metal};
use crate::unit::lab::stats::agreement::agree;
use crate::unit::support::render::{film_with, mean, scene};

const PATH: Estimator = Estimator::Path { reuse: false };

fn vcm() -> Estimator {
    Estimator::Vcm(Radius {
        first: Some(0.01),
        alpha: 2.0 / 3.0,
    })
}

fn settings(estimator: Estimator, rule: Rule, max_vertices: u32, seed: u64) -> Settings {
    Settings {
        estimator,
        rule,
        max_vertices,
        seed,
        ..Settings::default()
    }
}

#[test]
fn split_without_roughening_is_bit_identical() {
    let scene = scene(lit(coated("walls", Rgb::splat(0.2), 0.05), 3.0));
    for estimator in [Estimator::Bdpt, vcm()] {
        let film = |rule| film_with(&scene, &settings(estimator, rule, 8, 1), 16, 4);
        let plain = film(Rule::Plain);
        assert_eq!(film(Rule::constant(0.0)), plain);
        assert_eq!(
            film(Rule::with_table(AttenuationTable::constant(0.0))),
            plain
        );
        // Merges happen at the base, hardly ever at the coat alone.
        if estimator == Estimator::Bdpt {
            assert!(film(Rule::constant(0.5)) != plain);
        }
    }
}

/// With rough walls every connection and every merge is good, so nothing is roughened.
#[test]
fn split_leaves_paths_with_a_good_strategy_bit_identical() {
    let scene = scene(lit(metal("walls", Rgb::splat(0.7), 0.31), 3.0));
    for estimator in [Estimator::Bdpt, vcm()] {
        let film = |rule| film_with(&scene, &settings(estimator, rule, 8, 1), 16, 4);
        assert_eq!(film(Rule::constant(1.0)), film(Rule::Plain));
    }
}

/// Asserts that two means agree within three standard errors; the channels share their noise.
fn assert_equal_energy(name: &str, a: &Film, b: &Film, most: f64) {
    let ((a, a_error), (b, b_error)) = (mean(a), mean(b));
    println!("{name}: {a:.5} ± {a_error:.5}, {b:.5} ± {b_error:.5}");
    let noise = 3.0 * 3f64.sqrt() * a_error.hypot(b_error);
    assert!(noise < most * a, "{name}: {noise} of {a}");
    assert!((a - b).abs() < noise, "{name}: {a} {b}");
}

/// Water from above with short paths: all light from below passes the surface twice, where no connection is good. There
/// the split has the integrand of the path tracer.
#[test]
fn agreement_of_split_bdpt_with_path_through_smooth_water() {
    let scene = scene(under_water(0.0));
    let film = |estimator, gamma: f32, spp| {
        let settings = settings(estimator, Rule::constant(gamma), 3, 7);
        film_with(&scene, &settings, 24, spp)
    };
    for gamma in [0.1, 0.5] {
        let (path, bdpt) = (film(PATH, gamma, 512), film(Estimator::Bdpt, gamma, 256));
        let agreement = agree(&path, &bdpt).expect("one size");
        assert!(
            agreement.tiles.passed() && agreement.image.passed(),
            "{agreement}"
        );
        assert_equal_energy("water", &path, &bdpt, 0.1);
    }
}

/// Every single strategy, with weight 1, has the same integrand. α = 0.15 roughens a part of every lobe.
#[test]
fn agreement_of_each_strategy_of_a_regularised_integrand() {
    let scene = scene(lit(metal("walls", Rgb::new(0.7, 0.5, 0.3), 0.17), 3.0));
    let view = |film: &Film| View::of(&scene, &scene.parts().cameras[0], film);
    let strategy = |s, t, rule: &Rule, spp| {
        let mut picture = Picture::new(Film::new(UVec2::splat(16)));
        let view = view(&picture.film);
        let mut settings = settings(Estimator::Bdpt, rule.clone(), 8, u64::from(s) + 3);
        settings.rule = rule.clone();
        (settings.bidirectional(Strategies::Only { s, t })).pass(&view, 0..spp, &mut picture);
        picture.film
    };
    let rule = Rule::constant(0.5);
    for edges in 3..=4 {
        let hits = strategy(0, edges + 1, &rule, 1024);
        let whole = mean(&strategy(0, edges + 1, &Rule::Plain, 256)).0;
        let part = mean(&hits).0 / whole;
        println!("{edges} edges: {part:.3} of the light is left");
        assert!((0.1..0.9).contains(&part), "{part}");
        for s in 1..=edges {
            let film = strategy(s, edges + 1 - s, &rule, 1024);
            // Connections have spikes; see the test of each strategy without regularisation.
            let most = if s > 1 && s < edges { 2.0 } else { 0.2 };
            assert_equal_energy(&format!("{edges} edges, s = {s}"), &hits, &film, most);
        }
    }
}

/// Roughening moves light, but neither loses nor doubles it, as a blend of strategies with different integrands would.
#[test]
fn split_keeps_energy_in_sharp_metal_walls() {
    let scene: Scene = scene(lit(metal("walls", Rgb::new(0.7, 0.5, 0.3), 0.05), 3.0));
    for (estimator, spp) in [(Estimator::Bdpt, 512), (vcm(), 256)] {
        let film = |rule| film_with(&scene, &settings(estimator, rule, 6, 5), 24, spp);
        let (plain, split) = (film(Rule::Plain), film(Rule::constant(0.5)));
        let ((a, a_error), (b, b_error)) = (mean(&plain), mean(&split));
        println!("{estimator:?}: {a:.5} ± {a_error:.5}, {b:.5} ± {b_error:.5}");
        let noise = 3.0 * 3f64.sqrt() * a_error.hypot(b_error);
        assert!((a - b).abs() < 0.02 * a + noise, "{estimator:?}: {a} {b}");
    }
}
