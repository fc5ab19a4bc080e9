//! Contributions of real paths against the definition: every density, weight and value computed again from positions.

use crate::image::film::Window;
use crate::integrator::bidirectional::{Bidirectional, Radius, Strategies};
use crate::integrator::{Estimator, Settings, View};
use crate::math::{Rgb, UVec2};
use crate::regularise::Rule;
use crate::scene::{Scene, SceneParts};
use crate::unit::bidirectional::scenes::{
    field, lamps_in_field, lit, many_lamps, normal_map, parallel_camera, point_lit,
    points_in_field, sheets, sky_in_field, spot, sun_in_field, sunny, through_a_lens, two_sided,
    under_water, with_sphere,
};
use crate::unit::materials::{coated, diffuse, glass, metal};

const FRAME: UVec2 = UVec2::splat(40);

/// Audits a scene with and without merging; a light path and a camera path for every pixel.
fn assert_audited(name: &str, parts: SceneParts, least: usize) {
    assert_audited_with(Rule::Plain, name, parts, least);
}

fn assert_audited_with(rule: Rule, name: &str, parts: SceneParts, least: usize) {
    let scene = Scene::new(parts);
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
    // Within the larger one all surfaces are near, beyond the smaller one most are not.
    let radius = |first| Radius {
        first: Some(first),
        alpha: 1.0,
    };
    for merging in [None, Some(radius(0.05)), Some(radius(0.005))] {
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
    assert_audited("translucent sheets", sheets(), 20);
    assert_audited("normal map", normal_map(), 20);
}

#[test]
fn audit_of_mis_weights_and_values_of_ends() {
    assert_audited("point", point_lit(diffuse("walls", Rgb::splat(0.5))), 20);
    assert_audited("spot", spot(), 20);
    assert_audited("environment", sunny(false), 10);
    assert_audited("sun", sunny(true), 10);
    assert_audited("parallel camera", parallel_camera(), 20);
    let lens = through_a_lens(with_sphere(coated("coat", Rgb::splat(0.5), 0.0)));
    assert_audited("lens", lens, 20);
    let slanted = through_a_lens(parallel_camera());
    assert_audited("lens of a parallel camera", slanted, 20);
    assert_audited("two-sided emitter", two_sided(), 20);
}

/// Light that is aimed at the ball: the density of a start is one of its ray.
#[test]
fn audit_of_mis_weights_of_aimed_light() {
    assert_audited("sun", field(sun_in_field), 15);
    assert_audited("sky", field(sky_in_field), 15);
    assert_audited("lamps", field(lamps_in_field), 15);
    assert_audited("points", field(points_in_field), 15);
}

/// Light samples choose at the vertex, light walks by power.
#[test]
fn audit_of_mis_weights_among_many_lights() {
    assert_audited("many lamps", many_lamps(), 20);
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
