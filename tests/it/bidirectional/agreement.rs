//! Agreement of bidirectional estimators with the path tracer, at three scales.

use crate::support::render::{film_with, mean, scene};
use opsr::image::Film;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::{Estimator, Settings};
use opsr::math::Vec3;
use opsr::scene::Scene;
use opsr_lab::gallery::furnace_sphere;
use opsr_lab::gallery::materials::glass;
use opsr_lab::gallery::shapes::sphere;
use opsr_lab::stats::agreement::agree;

const SIZE: u32 = 24;

fn film(scene: &Scene, estimator: Estimator, spp: u32, seed: u64) -> Film {
    let settings = Settings {
        estimator,
        max_vertices: 8,
        seed,
        ..Settings::default()
    };
    film_with(scene, &settings, SIZE, spp)
}

/// Names of the scenes in which two films differ.
fn differing(
    a: Estimator,
    b: Estimator,
    more: u32,
    wanted: impl Fn(&str) -> bool,
    pixels: impl Fn(&str) -> bool,
) -> Vec<&'static str> {
    let mut differing = Vec::new();
    for (name, parts, spp) in super::all_scenes() {
        if !wanted(name) {
            continue;
        }
        let scene = scene(parts);
        let (a, b) = (film(&scene, a, more * spp, 1), film(&scene, b, spp, 2));
        let agreement = agree(&a, &b).expect("one size");
        let large = agreement.tiles.passed() && agreement.image.passed();
        let passed = large && (agreement.pixels.passed() || !pixels(name));
        println!("{name}: {:.5?} {:.5?} {passed}", mean(&a), mean(&b));
        if !passed {
            println!("{agreement}");
            differing.push(name);
        }
    }
    differing
}

/// False if path tracing misses whole pixels: caustics of a small light, or light through a surface of water.
fn found_by_path(name: &str) -> bool {
    name != "caustic box" && !name.starts_with("under") && !lit_from_nowhere(name)
}

/// Scenes with caustics of lights without area, which path tracing cannot find; `aim` compares them.
fn lit_from_nowhere(name: &str) -> bool {
    name.ends_with("in a field") || name == "many lamps"
}

const PATH: Estimator = Estimator::Path { reuse: false };

#[test]
fn agreement_of_bdpt_with_path() {
    let wrong = differing(
        PATH,
        Estimator::Bdpt,
        4,
        |n| !lit_from_nowhere(n),
        found_by_path,
    );
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// Scenes in which the camera sees no rough surface through a Dirac lobe. Single pixels are not compared, because some
/// get few light paths.
#[test]
fn agreement_of_light_with_path() {
    // The last scene has light from below a triangle's plane, which no light walk can reach.
    let dirac = ["caustic box", "partial glass", "sharp coat", "coarse balls"];
    let wanted = |name: &str| !dirac.contains(&name) && !lit_from_nowhere(name);
    let wrong = differing(PATH, Estimator::Light, 1, wanted, |_| false);
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// A radius whose bias is far below the noise, but with which many photons still merge.
const SMALL: Radius = Radius {
    first: Some(0.01),
    alpha: 2.0 / 3.0,
};

#[test]
fn agreement_of_vcm_with_path() {
    let wrong = differing(
        PATH,
        Estimator::Vcm(SMALL),
        4,
        |n| !lit_from_nowhere(n),
        found_by_path,
    );
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// Single pixels are not compared: caustics by photons alone are noisy.
#[test]
fn agreement_of_vcm_with_light_sampling_only_with_path() {
    let estimator = Estimator::VcmNee(SMALL);
    let wanted = |name: &str| name != "caustic box" && !lit_from_nowhere(name);
    let wrong = differing(PATH, estimator, 4, wanted, |_| false);
    assert!(wrong.is_empty(), "{wrong:?}");
}

/// Only means of whole pictures: pixels have few photons. Edges lose photons in proportion to the radius.
#[test]
fn agreement_of_sppm_with_path() {
    let radius = Radius {
        first: Some(0.05),
        alpha: 2.0 / 3.0,
    };
    for (name, parts, spp) in super::all_scenes() {
        if lit_from_nowhere(name) || name == "coarse balls" {
            continue;
        }
        let scene = scene(parts);
        let (a, its_error) = mean(&film(&scene, PATH, 2 * spp, 1));
        let (b, error) = mean(&film(&scene, Estimator::Sppm(radius), spp, 2));
        println!("{name}: {a:.5} ± {its_error:.5}, {b:.5} ± {error:.5}");
        // The channels of a pixel are highly correlated.
        let noise = 3.0 * 3f64.sqrt() * error.hypot(its_error);
        assert!((a - b).abs() < 0.015 * a + noise, "{name}: {a} {b}");
        assert!(error < 0.1 * a, "{name}: {error} of {a}");
    }
}

/// Every path in a white furnace carries radiance 1, and a smooth ball of glass changes nothing, unless η² is missing
/// or a shading normal is misplaced. A rough ball loses the same energy as in the path tracer.
#[test]
fn white_furnace_with_glass_from_both_ends() {
    for alpha in [0.0f32, 0.3] {
        let mut parts = furnace_sphere(0.5);
        let ball = sphere(Vec3::new(0.0, 0.0, -0.5), 0.25, 4);
        parts.add(glass("glass", 1.5, alpha), [ball]);
        let scene = scene(parts);
        let furnace = |estimator| {
            let settings = Settings {
                estimator,
                max_vertices: 48,
                roulette_start: 12,
                ..Settings::default()
            };
            let (mean, error) = mean(&film_with(&scene, &settings, 16, 256));
            println!("alpha {alpha}, {estimator:?}: {mean:.5} ± {error:.5}");
            assert!(error < 1e-2, "{mean} ± {error}");
            (mean, error)
        };
        let (expected, its_error) = match alpha {
            0.0 => (1.0, 0.0),
            _ => furnace(PATH),
        };
        // Light paths alone are far too noisy here: they are tested as a part of `bdpt`.
        let (mean, error) = furnace(Estimator::Bdpt);
        let noise = 3.0 * error.hypot(its_error);
        assert!((mean - expected).abs() < 2e-3 + noise, "{mean} {expected}");
    }
}
