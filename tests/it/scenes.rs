//! Procedural shapes are closed and face outward; written files are well formed.

use opsr::math::{Vec2, Vec3};
use opsr::scene::{Mesh, SceneParts};
use opsr_lab::gallery;
use opsr_lab::gallery::glb;
use opsr_lab::gallery::shapes::{self, Placing};
use std::collections::HashMap;

/// Signed volume by the divergence theorem; panics unless every directed edge has its reverse exactly once.
fn closed_volume(mesh: &Mesh) -> f64 {
    let key = |i: u32| {
        mesh.positions[i as usize]
            .to_array()
            .map(|x| (x + 0.0).to_bits())
    };
    let mut edges: HashMap<_, i32> = HashMap::new();
    let mut volume = 0.0;
    for &[a, b, c] in &mesh.indices {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let (p, q) = (key(p), key(q));
            assert_ne!(p, q, "an edge without length");
            *edges.entry((p, q)).or_default() += 1;
        }
        let p = |i: u32| mesh.positions[i as usize].as_dvec3();
        volume += p(a).dot(p(b).cross(p(c))) / 6.0;
    }
    for (&(p, q), &count) in &edges {
        assert_eq!(count, 1, "an edge used twice the same way");
        assert!(edges.contains_key(&(q, p)), "an open edge");
    }
    volume
}

/// Smooth normals are on the front side of every face that uses them.
fn normals_face_front(mesh: &Mesh) {
    for &[a, b, c] in &mesh.indices {
        let p = |i: u32| mesh.positions[i as usize];
        let ng = (p(b) - p(a)).cross(p(c) - p(a));
        for i in [a, b, c] {
            if let Some(n) = mesh.normals.get(i as usize) {
                assert!((n.length() - 1.0).abs() < 1e-5);
                assert!(n.dot(ng) > 0.0, "normal {n} against face {ng}");
            }
        }
    }
}

#[test]
fn shapes_are_closed_and_face_outward() {
    let goblet = [
        Vec2::new(0.0, 0.0),
        Vec2::new(0.5, 0.0),
        Vec2::new(0.6, 1.0),
        Vec2::new(0.5, 1.0),
        Vec2::new(0.4, 0.2),
        Vec2::new(0.0, 0.2),
    ];
    let triangle = [Vec2::ZERO, Vec2::X, Vec2::new(0.5, 0.8)];
    let tau = std::f64::consts::TAU;
    // Shape, volume of the smooth body, relative tolerance of the tessellation.
    let shapes = [
        (
            shapes::cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)),
            6.0,
            1e-6,
        ),
        (shapes::sphere(Vec3::X, 1.0, 3), tau * 2.0 / 3.0, 0.02),
        (shapes::torus(1.0, 0.25, 64, 24), tau * tau / 32.0, 0.02),
        (shapes::cylinder(1.0, 2.0, 64), tau, 0.01),
        (shapes::ring(1.0, 0.1, 0.5, 64), tau * 0.05, 0.01),
        (shapes::prism(&triangle, 2.0), 0.8, 1e-6),
        (shapes::blob(3, |_| 1.0), tau * 2.0 / 3.0, 0.02),
        (shapes::revolve(&goblet, false, 64), 0.4419, 0.01),
    ];
    for (i, (mesh, volume, tolerance)) in shapes.iter().enumerate() {
        let found = closed_volume(mesh);
        assert!(
            (found / volume - 1.0).abs() < *tolerance,
            "shape {i}: volume {found}, not {volume}"
        );
        normals_face_front(mesh);
    }
    let cavity = shapes::sphere(Vec3::ZERO, 1.0, 2).inverted();
    assert!(closed_volume(&cavity) < 0.0);
    normals_face_front(&cavity);
}

#[test]
fn placed_shapes_keep_normals_on_their_side() {
    let turned = shapes::torus(0.7, 0.3, 48, 24).placed([0.5, 0.3, -0.2], Vec3::Y);
    normals_face_front(&turned);
    let volume = 2.0 * std::f64::consts::PI.powi(2) * 0.7 * 0.3 * 0.3;
    assert!((closed_volume(&turned) / volume - 1.0).abs() < 0.03);
}

#[test]
fn room_walls_face_inward() {
    let walls = shapes::room(Vec3::new(-1.0, 0.0, -2.0), Vec3::new(1.0, 3.0, 2.0));
    let all = Mesh::joined(walls);
    assert!((closed_volume(&all) + 24.0).abs() < 1e-4);
}

#[test]
fn height_fields_face_up() {
    let field = shapes::height_field(Vec2::ZERO, Vec2::ONE, [8, 8], |x, z| {
        0.1 * (9.0 * x).sin() * (7.0 * z).cos()
    });
    normals_face_front(&field);
    assert!(field.normals.iter().all(|n| n.y > 0.0));
}

#[test]
fn glb_files_are_well_formed() {
    let bytes = glb::to_glb(&gallery::caustic_box()).unwrap();
    assert_eq!(&bytes[..4], b"glTF");
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!(word(8), bytes.len());
    let json: serde_json::Value = serde_json::from_slice(&bytes[20..20 + word(12)]).unwrap();
    assert_eq!(json["buffers"][0]["byteLength"], word(20 + word(12)));
    for used in json["extensionsUsed"].as_array().unwrap() {
        assert!(json.to_string().contains(used.as_str().unwrap()));
    }
    assert_eq!(bytes, glb::to_glb(&gallery::caustic_box()).unwrap());
}

#[test]
fn glb_refuses_textures() {
    let parts = SceneParts {
        textures: vec![Default::default()],
        ..SceneParts::default()
    };
    let error = glb::to_glb(&parts).unwrap_err().to_string();
    assert!(error.contains("texture"), "{error}");
}
