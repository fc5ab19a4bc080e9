//! Depth of field: rays of a lens, sources of lenses, and refusals.

use crate::math::{UVec2, Vec2, Vec3};
use crate::sampler::{Independent, SampleSource, Sampler, Seed};
use crate::scene::{Camera, Lens, Sensor};
use crate::unit::lab::verify::chi_square::p_value;
use crate::unit::support::assert_likely;
use crate::unit::support::gltf::File;
use serde_json::{Value, json};

const LENS: Lens = Lens {
    radius: 0.1,
    focus: 3.0,
};

fn camera(lens: Option<Lens>) -> Camera {
    let pinhole = Camera::look_at(Vec3::new(1.0, 2.0, 3.0), Vec3::ZERO, Vec3::Y, 0.8);
    Camera { lens, ..pinhole }
}

#[test]
fn lens_rays_of_a_film_position_meet_in_the_plane_of_focus() {
    let camera = camera(Some(LENS));
    for film in [Vec2::splat(0.5), Vec2::new(0.1, 0.8)] {
        let chief = camera.ray(film, 1.5);
        let depth = |p: Vec3| -(p - camera.position).dot(camera.frame.n);
        let at = |ray: crate::math::Ray, d: f32| {
            ray.origin + ray.dir * ((d - depth(ray.origin)) / -ray.dir.dot(camera.frame.n))
        };
        // Uniform points of the lens form a uniform disk of radius R |1 − d/f| in the plane at distance d.
        let (n, d) = (64, 7.0f32);
        let mut moments = [0.0f64; 5];
        for i in 0..n * n {
            let u = Vec2::new((i % n) as f32 + 0.5, (i / n) as f32 + 0.5) / n as f32;
            let ray = camera.ray_through(LENS, film, 1.5, u);
            assert!((ray.dir.length() - 1.0).abs() < 1e-5);
            assert!((at(ray, LENS.focus) - at(chief, LENS.focus)).length() < 1e-5);
            let off = camera.frame.to_local(at(ray, d) - at(chief, d));
            let (x, y) = (f64::from(off.x), f64::from(off.y));
            for (m, v) in moments.iter_mut().zip([x, y, x * x, y * y, x * y]) {
                *m += v / f64::from(n * n);
            }
        }
        let radius = f64::from(LENS.radius * (1.0 - d / LENS.focus).abs());
        let expected = [0.0, 0.0, 0.25, 0.25, 0.0].map(|m| m * radius * radius);
        for (got, expected) in moments.iter().zip(expected) {
            assert!((got - expected).abs() < 2e-3 * radius, "{moments:?}");
        }
    }
}

/// Ray origins are uniform on the lens, in equal cells of squared radius and angle, for several film positions.
#[test]
fn chi_square_of_lens_samples() {
    const CELLS: usize = 12;
    const DRAWS: u32 = 40_000;
    let camera = camera(Some(LENS));
    let sensor = Sensor {
        camera: &camera,
        frame: UVec2::new(30, 20),
    };
    let mut p_values = Vec::new();
    for (seed, place) in [Vec2::ZERO, Vec2::new(15.0, 10.0), Vec2::new(29.9, 3.2)]
        .into_iter()
        .enumerate()
    {
        let mut stream = Independent {
            seed: Seed(500 + seed as u64),
        }
        .stream(UVec2::ZERO, 0);
        let mut observed = vec![0; CELLS * CELLS];
        for _ in 0..DRAWS {
            let ray = sensor.sample_ray(place, || stream.lens());
            let at = camera.frame.to_local(ray.origin - camera.position) / LENS.radius;
            assert!(at.z.abs() < 1e-5, "{at}");
            let share = (at.x * at.x + at.y * at.y).min(0.999_99);
            let turn = at.y.atan2(at.x) / std::f32::consts::TAU + 0.5;
            let cell = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
            observed[cell(share) * CELLS + cell(turn)] += 1;
        }
        let expected = vec![f64::from(DRAWS) / (CELLS * CELLS) as f64; CELLS * CELLS];
        p_values.push((p_value(&observed, &expected), place.to_string()));
    }
    assert_likely(&p_values);
}

#[test]
fn pinhole_draws_no_numbers_for_a_lens() {
    let camera = camera(None);
    let sensor = Sensor {
        camera: &camera,
        frame: UVec2::new(30, 20),
    };
    let place = Vec2::new(3.7, 11.2);
    let ray = sensor.sample_ray(place, || panic!("a number was drawn"));
    let same = sensor.ray(place);
    assert_eq!((ray.origin, ray.dir), (same.origin, same.dir));
}

#[test]
fn load_lens_from_the_extras_of_a_camera() {
    let lens = |extras: Value| {
        let mut file = File::triangle();
        let yfov = 2.0 * 0.24f32.atan();
        file.push("cameras", json!({
            "type": "perspective", "perspective": { "yfov": yfov, "znear": 0.1 }, "extras": extras,
        }));
        file.push("nodes", json!({ "camera": 0 }));
        let loaded = file.loaded();
        (loaded.parts.cameras[0].lens, loaded.warnings.len())
    };
    let is = |got: (Option<Lens>, usize), radius: f32| {
        let lens = got.0.expect("a lens");
        assert!(
            (lens.radius - radius).abs() < 1e-6 && lens.focus == 4.0,
            "{lens:?}"
        );
    };
    is(
        lens(json!({ "apertureRadius": 0.5, "focusDistance": 4 })),
        0.5,
    );
    is(
        lens(json!({ "fstop": 2, "focalLength": 80, "focusDistance": 4 })),
        0.02,
    );
    // For a film of 24 mm this field of view has a focal length of 50 mm.
    is(lens(json!({ "fstop": 2.5, "focusDistance": 4 })), 0.01);
    for (extras, warnings) in [
        (json!({}), 0),
        (json!("a word"), 0),
        (json!({ "focusDistance": 4 }), 0),
        (json!({ "apertureRadius": 0, "focusDistance": 4 }), 0),
        (json!({ "apertureRadius": 0.5 }), 1),
        (json!({ "apertureRadius": -1, "focusDistance": 4 }), 1),
    ] {
        assert_eq!(lens(extras.clone()), (None, warnings), "{extras}");
    }
}
