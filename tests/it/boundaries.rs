//! Meshes that fail to bound a body, and open meshes that do bound one.

use super::support::render::{film_with, mean};
use opsr::integrator::Settings;
use opsr::math::{Rgb, Vec3};
use opsr::scene::load::{LoadOptions, load};
use opsr::scene::{Environment, Mesh, Scene, SceneParts};
use opsr_lab::gallery::materials::{diffuse, glass};
use opsr_lab::gallery::shapes::{cuboid, quad, sphere};
use opsr_lab::gallery::{builtin, glb, names};

/// Glass bodies under a white sky, seen from `eye`.
fn under_sky(bodies: impl IntoIterator<Item = Mesh>, eye: [f32; 3]) -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(glass("glass", 1.5, 0.0), bodies);
    parts.environment = Some(Environment::constant(Rgb::ONE));
    parts.add_camera(eye, [0.0, 0.0, 0.0], 20.0);
    parts
}

fn pane() -> Mesh {
    quad(Vec3::new(-1.0, -1.0, 0.0), Vec3::X * 2.0, Vec3::Y * 2.0)
}

fn inside_out(mut mesh: Mesh) -> Mesh {
    mesh.indices.iter_mut().for_each(|face| face.reverse());
    mesh
}

/// Under a white sky everything is white, from both sides.
#[test]
fn pane_with_a_thickness_is_a_thin_wall() {
    for z in [4.0, -4.0] {
        let scene = Scene::new(under_sky([pane()], [0.0, 0.0, z]));
        let (mean, _) = mean(&film_with(&scene, &Settings::default(), 16, 16));
        assert!((mean - 1.0).abs() < 1e-3, "{z}: {mean}");
        let [warning] = scene.warnings() else {
            panic!("{:?}", scene.warnings());
        };
        assert!(warning.contains("4 open edges"), "{warning}");
        assert!(warning.contains("thin walls"), "{warning}");
    }
}

/// Only one of two meshes of a material is turned inside out: the other keeps its thickness.
#[test]
fn body_inside_out_is_a_thin_wall_and_its_neighbour_stays_a_body() {
    let turned = inside_out(sphere(Vec3::new(-1.0, 0.0, 0.0), 0.5, 3));
    let good = sphere(Vec3::new(1.0, 0.0, 0.0), 0.5, 3);
    let scene = Scene::new(under_sky([turned, good], [0.0, 0.0, 6.0]));
    let [warning] = scene.warnings() else {
        panic!("{:?}", scene.warnings());
    };
    assert!(
        warning.contains("normals of mesh 0 point inwards"),
        "{warning}"
    );
    let parts = scene.parts();
    let solid = |i: usize| parts.materials[parts.meshes[i].material as usize].solid;
    assert_eq!([solid(0), solid(1)], [false, true]);
}

/// The surface of a pool ends at its walls, and normals of a cavity point into it: both bound bodies.
#[test]
fn open_and_turned_meshes_that_bound_bodies_stay_what_they_are() {
    for name in names() {
        let parts = builtin(name).expect("a scene of the gallery");
        assert_eq!(Scene::new(parts).warnings(), &[] as &[String], "{name}");
    }
    let hollow = [
        sphere(Vec3::ZERO, 1.0, 3),
        inside_out(sphere(Vec3::ZERO, 0.8, 3)),
    ];
    let scene = Scene::new(under_sky(hollow, [0.0, 0.0, 6.0]));
    assert_eq!(scene.warnings(), &[] as &[String]);
    // A closed box of two primitives.
    let mut box_of_two = cuboid(-Vec3::ONE, Vec3::ONE);
    let mut rest = box_of_two.clone();
    box_of_two.indices.truncate(4);
    rest.indices.drain(..4);
    let scene = Scene::new(under_sky([box_of_two, rest], [0.0, 0.0, 6.0]));
    assert_eq!(scene.warnings(), &[] as &[String]);
}

/// Near a few reversed triangles every point seems to lie in a body.
#[test]
fn turned_triangles_are_named_and_are_no_overlap() {
    let mut ball = sphere(Vec3::ZERO, 1.0, 3);
    for face in ball.indices.iter_mut().step_by(100) {
        face.reverse();
    }
    let scene = Scene::new(under_sky([ball.clone()], [0.0, 0.0, 6.0]));
    let [warning] = scene.warnings() else {
        panic!("{:?}", scene.warnings());
    };
    assert!(
        warning.contains("normals of mesh 0 point both ways"),
        "{warning}"
    );
    assert!(scene.parts().materials[0].solid);
    assert!(!scene.features().overlaps);
    // A real overlap is still found.
    let mut parts = under_sky([ball], [0.0, 0.0, 6.0]);
    let other = sphere(Vec3::new(1.0, 0.0, 0.0), 0.5, 3);
    parts.add(glass("other", 1.3, 0.0), [other]);
    assert!(Scene::new(parts).features().overlaps);
}

/// A warning gives the mesh's place in its file.
#[test]
fn warning_names_the_mesh_of_the_file() {
    let mut parts = under_sky([pane()], [0.0, 0.0, 4.0]);
    parts.environment = None;
    parts.add(
        diffuse("floor", Rgb::splat(0.5)),
        [quad(
            Vec3::new(-5.0, -2.0, -5.0),
            Vec3::Z * 10.0,
            Vec3::X * 10.0,
        )],
    );
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("pane.glb");
    glb::save(&parts, &path).expect("a scene file");
    let loaded = load(&path, &LoadOptions::default()).expect("a scene");
    let scene = Scene::new(loaded.parts);
    let named = "meshes[0].primitives[0] is not closed";
    let warnings = scene.warnings();
    assert!(
        warnings.iter().any(|w| w.starts_with(named)),
        "{warnings:?}"
    );
}
