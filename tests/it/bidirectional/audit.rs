//! Contributions of real paths against the definition: every density, weight and value computed again from positions.

use super::scenes::{
    lit, normal_map, parallel_camera, point_lit, spot, sunny, two_sided, under_water, with_sphere,
};
use crate::support::render::scene;
use opsr::gallery::materials::{coated, diffuse, glass, metal};
use opsr::image::film::Window;
use opsr::integrator::bidirectional::{Bidirectional, Radius, Strategies};
use opsr::integrator::{Estimator, Settings, View};
use opsr::math::{Rgb, UVec2};
use opsr::regularise::Rule;
use opsr::scene::SceneParts;

const FRAME: UVec2 = UVec2::splat(40);

/// Audits a scene with and without merging; a light path and a camera path for every pixel.
fn assert_audited(name: &str, parts: SceneParts, least: usize) {
    assert_audited_with(Rule::Plain, name, parts, least);
}

fn assert_audited_with(rule: Rule, name: &str, parts: SceneParts, least: usize) {
    let scene = scene(parts);
    let view = View::new(
        &scene,
        &scene.parts().cameras[0],
        FRAME,
        Window::full(FRAME),
    );
    let settings = Settings {
        estimator: Estimator::Bdpt,
        rule,
        max_vertices: 7,
        ..Settings::default()
    };
    let radius = Radius {
        first: Some(0.05),
        alpha: 1.0,
    };
    for merging in [None, Some(radius)] {
        let audit = Bidirectional {
            merging,
            ..settings.bidirectional(Strategies::All)
        }
        .audit(&view, 0, FRAME.x * FRAME.y);
        assert!(
            audit.compared.len() >= least,
            "{name}: {:?}",
            audit.compared
        );
        // Rounding of rough refraction at short edges.
        let all: u32 = audit.compared.values().sum();
        println!("{name}: {} of {all} apart", audit.apart);
        assert!(100 * audit.apart <= all, "{name}: {}", audit.example);
    }
}

#[test]
fn audit_of_mis_weights_and_values_under_water() {
    for alpha in [0.0, 0.3] {
        assert_audited(&format!("water, alpha {alpha}"), under_water(alpha), 20);
    }
}

#[test]
fn audit_of_mis_weights_and_values_of_materials() {
    let half = Rgb::splat(0.5);
    assert_audited("diffuse", lit(diffuse("walls", half), 3.0), 20);
    assert_audited("rough glass", with_sphere(glass("glass", 1.5, 0.3)), 20);
    assert_audited("smooth glass", with_sphere(glass("glass", 1.5, 0.0)), 20);
    assert_audited("metal", with_sphere(metal("metal", half, 0.3)), 20);
    assert_audited("coat", with_sphere(coated("coat", half, 0.3)), 20);
    assert_audited("sharp coat", with_sphere(coated("coat", half, 0.0)), 20);
    assert_audited("normal map", normal_map(), 20);
}

#[test]
fn audit_of_mis_weights_and_values_of_ends() {
    assert_audited("point", point_lit(diffuse("walls", Rgb::splat(0.5))), 20);
    assert_audited("spot", spot(), 20);
    assert_audited("environment", sunny(false), 10);
    assert_audited("sun", sunny(true), 10);
    assert_audited("parallel camera", parallel_camera(), 20);
    assert_audited("two-sided emitter", two_sided(), 20);
}

/// What the split leaves of every contribution: lobes and shares by all strategies of the path.
#[test]
fn audit_of_the_split() {
    let audited = |name: &str, parts| assert_audited_with(Rule::constant(0.5), name, parts, 20);
    let colour = Rgb::new(0.6, 0.3, 0.1);
    for alpha in [0.0, 0.15] {
        audited("coat", with_sphere(coated("coat", colour, alpha)));
        audited("glass", with_sphere(glass("glass", 1.5, alpha)));
        audited("water", under_water(alpha));
    }
    audited("metal walls", lit(metal("walls", colour, 0.15), 3.0));
    audited("coated walls", lit(coated("walls", colour, 0.15), 3.0));
    audited("point", point_lit(coated("walls", colour, 0.15)));
}
