//! Photon density against known values, and its radius.

use crate::image::Film;
use crate::integrator::bidirectional::Radius;
use crate::integrator::{Estimator, Settings, View};
use crate::math::UVec2;
use crate::scene::finish::{Clearcoat, Finish};
use crate::scene::{Camera, Material};
use crate::unit::support::render::{film_with, mean, scene};
use crate::unit::support::scenes::point_light_over_plane;

/// The plane under a point light; all pixels show the point below the light.
fn foot(radius: f32, iterations: u32) -> (f64, f64) {
    let mut parts = point_light_over_plane();
    let camera = parts.cameras.remove(0);
    let at = camera.position;
    parts.cameras.push(Camera::look_at(
        at,
        crate::math::Vec3::ZERO,
        crate::math::Vec3::Y,
        1e-3,
    ));
    let settings = Settings {
        estimator: Estimator::Sppm(Radius {
            first: Some(radius),
            alpha: 1.0,
        }),
        ..Settings::default()
    };
    // All pixels share the same photons, so their mean is as noisy as one of them.
    let film = film_with(&scene(parts), &settings, 16, iterations);
    let error = film.variance_of_mean().pixels[0].x.sqrt();
    (mean(&film).0, error.into())
}

/// The mean radiance over a disk of radius r around this point is (2/r²)(1 − (1 + r²)^(−1/2)).
#[test]
fn photon_density_of_an_analytic_disk() {
    for (r, iterations, tolerance) in [(0.5f64, 30_000, 0.002), (0.2, 20_000, 0.006)] {
        let expected = 2.0 / (r * r) * (1.0 - 1.0 / (1.0 + r * r).sqrt());
        let (found, error) = foot(r as f32, iterations);
        println!("r {r}: {found:.5} ± {error:.5} for {expected:.5}");
        assert!(error < tolerance, "{error}");
        assert!((found - expected).abs() < 3.5 * error, "{found} {expected}");
    }
}

#[test]
fn radius_shrinks_as_the_exponent_says() {
    let radius = Radius::default();
    assert_eq!(radius.at(0.5, 0), 0.5);
    // The factor is i^(−1/6).
    assert!((radius.at(0.5, 63) - 0.25).abs() < 1e-6);
    let fixed = Radius {
        alpha: 1.0,
        ..radius
    };
    assert_eq!(fixed.at(0.5, 1000), 0.5);
}

/// Twice the footprint of a pixel at the visible distance, mirrors included; half as large with twice the rows.
#[test]
fn first_radius_follows_the_footprint() {
    let mut parts = point_light_over_plane();
    parts.cameras.clear();
    parts.add_camera([0.0, 2.0, 0.01], [0.0, 0.0, 0.0], 10.0);
    let scene = scene(parts);
    let first = |rows| {
        let film = Film::new(UVec2::splat(rows));
        let view = View::of(&scene, &scene.parts().cameras[0], &film);
        Radius::default().first(&view)
    };
    let expected = 2.0 * 2.0 * 2.0 * 5f32.to_radians().tan() / 128.0;
    assert!((first(128) / expected - 1.0).abs() < 0.02, "{}", first(128));
    assert!((first(256) / first(128) - 0.5).abs() < 0.01);
}

/// Both walks of a merge choose between the two BSDFs of a material, but the probability counts once.
#[test]
fn photons_where_the_light_walk_drew_a_smooth_bsdf_are_kept() {
    let coat = Clearcoat {
        weight: 1.0,
        ..Clearcoat::default()
    };
    let coated = Finish {
        clearcoat: Some(coat),
        ..Finish::default()
    };
    let half = |material: &mut Material| (material.transmission, material.alpha) = (0.5, 0.0);
    let coat = |material: &mut Material| material.finish = Some(Box::new(coated.clone()));
    let radius = Radius {
        first: Some(0.2),
        alpha: 1.0,
    };
    for (name, change) in [
        ("coat", &coat as &dyn Fn(&mut Material)),
        ("partial transmission", &half),
    ] {
        let mut parts = point_light_over_plane();
        change(&mut parts.materials[0]);
        let scene = scene(parts);
        let found = |estimator, spp| {
            let settings = Settings {
                estimator,
                max_vertices: 1,
                ..Settings::default()
            };
            mean(&film_with(&scene, &settings, 16, spp))
        };
        let (expected, its_error) = found(Estimator::Path { reuse: false }, 1000);
        for estimator in [
            Estimator::Sppm(radius),
            Estimator::Vcm(radius),
            Estimator::VcmNee(radius),
        ] {
            let (mean, error) = found(estimator, 2000);
            println!(
                "{name}, {estimator:?}: {mean:.4} ± {error:.4} for {expected:.4} ± {its_error:.4}"
            );
            assert!((mean / expected - 1.0).abs() < 0.03, "{name} {estimator:?}");
        }
    }
}
