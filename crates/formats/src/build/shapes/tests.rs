use super::*;

/// Area of the triangles. Asserts that their fronts are on the side of the normals.
fn area(mesh: &Mesh) -> f64 {
    let of = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|i| mesh.positions[i as usize]);
        let across = (b - a).cross(c - a);
        for &i in face {
            assert!(across.dot(mesh.normals[i as usize]) >= -1e-6, "{face:?}");
        }
        0.5 * f64::from(across.length())
    };
    mesh.indices.iter().map(of).sum()
}

#[test]
fn shapes_have_their_areas_and_face_outwards() {
    let pi = std::f64::consts::PI;
    let close = |mesh: &Mesh, expected: f64| {
        let found = area(mesh);
        assert!((found / expected - 1.0).abs() < 1e-4, "{found} {expected}");
    };
    close(&rectangle(), 4.0);
    close(&cube(), 24.0);
    close(&sphere(Vec3::ONE, 2.0), 16.0 * pi);
    close(&disk(0.5, 2.0, 1.0, TAU), 3.0 * pi);
    close(&cylinder(2.0, [-1.0, 2.0], PI), 6.0 * pi);
    // A cone, a paraboloid (of radius 2 at a height of 3), a cylinder and a cone's frustum as hyperboloids.
    close(
        &revolved(|v| Vec3::new(2.0 * (1.0 - v), 0.0, 3.0 * v), TAU),
        2.0 * pi * 13f64.sqrt(),
    );
    let bowl = revolved(|v| Vec3::new(2.0 * v.sqrt(), 0.0, 3.0 * v), PI);
    let expected = 0.5 * pi * 2.0 / (6.0 * 9.0) * (40f64.powf(1.5) - 8.0);
    assert!(
        (area(&bowl) / expected - 1.0).abs() < 2e-3,
        "{} {expected}",
        area(&bowl)
    );
    close(&revolved(|v| Vec3::new(0.6, 0.8, 2.0 * v), TAU), 4.0 * pi);
    // A bent tube: its cross-section is a hexagon.
    let bend: Vec<(Vec3, f32)> = (0..=64)
        .map(|i| {
            let (sin, cos) = (i as f32 / 64.0 * PI).sin_cos();
            (Vec3::new(cos, sin, 0.2 * sin), 0.01)
        })
        .collect();
    let chord = 12.0 * (pi / 6.0).sin() * 0.01;
    let length: f64 = (bend.windows(2))
        .map(|w| f64::from(w[0].0.distance(w[1].0)))
        .sum();
    assert!((area(&tube(&bend)) / (chord * length) - 1.0).abs() < 1e-3);
    let [a, b, c] = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let uvs = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
    close(&patch([a, b, c, b + c], uvs, None), 1.0);
    assert!(patch([a, b, c, b + c + Vec3::Z], uvs, None).indices.len() > 100);
}
