use super::*;

/// Film coordinates of a world point in [-1, 1], and its depth.
fn project(camera: &Camera, p: Vec3, aspect: f32) -> (f32, f32, f32) {
    let Projection::Perspective { tan_half_y } = camera.projection else {
        panic!("a pinhole was asked for");
    };
    let l = camera.frame.to_local(p - camera.position);
    let scale = -1.0 / (l.z * tan_half_y);
    (l.x * scale / aspect, l.y * scale, -l.z)
}

#[test]
fn camera_framing_sees_every_corner_and_fills_the_picture() {
    let boxes = [
        (Vec3::ZERO, Vec3::ONE),
        (Vec3::new(-1e4, 5.0, 2.0), Vec3::new(1e4, 5.0, 3.0)),
        (Vec3::splat(1e-6), Vec3::splat(3e-6)),
    ];
    for (low, high) in boxes {
        for aspect in [0.3, 1.0, 2.4] {
            let camera = Camera::framing((low, high), aspect);
            let mut furthest = 0.0f32;
            for corner in 0..8 {
                let pick = |bit: i32, a, b| if corner >> bit & 1 == 0 { a } else { b };
                let p = Vec3::new(
                    pick(0, low.x, high.x),
                    pick(1, low.y, high.y),
                    pick(2, low.z, high.z),
                );
                let (x, y, z) = project(&camera, p, aspect);
                assert!(
                    z > 0.0 && x.abs() < 1.0 && y.abs() < 1.0,
                    "{p}: {x} {y} {z}"
                );
                furthest = furthest.max(x.abs()).max(y.abs());
            }
            assert!(furthest > 0.6, "{low} {high} {aspect}: {furthest}");
        }
    }
}

/// glTF's fronts face +Z, its up is +Y `[glTF §3.4]`.
#[test]
fn camera_framing_stands_in_front() {
    let camera = Camera::framing((-Vec3::ONE, Vec3::ONE), 1.0);
    let Vec3 { x, y, z } = camera.position;
    assert!(z > x && x > 0.0 && y > 0.0 && y < z, "{}", camera.position);
    assert!(camera.frame.t.y > 0.8 && camera.frame.s.x > 0.8);
}

#[test]
fn camera_framing_accepts_degenerate_bounds() {
    let (inf, nan) = (Vec3::INFINITY, Vec3::NAN);
    for bounds in [
        (Vec3::ZERO, Vec3::ZERO),
        (inf, -inf),
        (-inf, inf),
        (nan, nan),
        (Vec3::ONE, Vec3::ZERO),
        (Vec3::splat(f32::MIN), Vec3::splat(f32::MAX)),
        (Vec3::splat(3e38), Vec3::splat(3.1e38)),
    ] {
        for aspect in [1.0, 0.0, f32::NAN, f32::INFINITY] {
            let camera = Camera::framing(bounds, aspect);
            let ray = camera.ray(Vec2::splat(0.5), 1.0);
            assert!(ray.origin.is_finite(), "{bounds:?} {aspect}");
            assert!((ray.dir.length() - 1.0).abs() < 1e-5);
        }
    }
}
