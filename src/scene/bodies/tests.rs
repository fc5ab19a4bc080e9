use super::*;
use crate::scene::Material;
use crate::unit::shapes;

/// True if the inside of a glass ball is dark, in a scene with a lamp at `lamp` after `change`.
fn is_dark(lamp: Vec3, change: impl Fn(&mut SceneParts)) -> bool {
    let glass = Material {
        metallic: 0.0,
        transmission: 1.0,
        solid: true,
        ..Material::default()
    };
    let shine = Material {
        emission: Rgb::ONE,
        ..Material::default()
    };
    let lamp = Mesh {
        material: 1,
        ..shapes::sphere(lamp, 0.1, 2)
    };
    let mut parts = SceneParts {
        meshes: vec![shapes::sphere(Vec3::ZERO, 1.0, 3), lamp],
        materials: vec![glass, shine],
        ..SceneParts::default()
    };
    change(&mut parts);
    let scene = Scene::new(parts);
    // A mesh that bounds no body gets a material of its own.
    scene.is_dark_inside(scene.parts().meshes[0].material)
}

#[test]
fn inside_of_a_body_is_dark_only_where_it_is_closed_and_holds_no_light() {
    let outside = Vec3::new(3.0, 0.0, 0.0);
    assert!(is_dark(outside, |_| ()));
    assert!(!is_dark(Vec3::ZERO, |_| ()));
    let inside_out = |parts: &mut SceneParts| {
        let mut ball = shapes::sphere(Vec3::new(0.0, 5.0, 0.0), 0.5, 2);
        ball.indices.iter_mut().for_each(|f| f.reverse());
        let first = parts.meshes[0].positions.len() as u32;
        parts.meshes[0].positions.extend(ball.positions);
        let indices = ball.indices.iter().map(|f| f.map(|v| v + first));
        parts.meshes[0].indices.extend(indices);
        parts.meshes[0].normals.clear();
        parts.meshes[0].uvs.clear();
    };
    type Change<'a> = &'a dyn Fn(&mut SceneParts);
    let changes: [(&str, Change<'_>); 5] = [
        ("open", &|parts| parts.meshes[0].indices.truncate(20)),
        ("a part inside out", &inside_out),
        ("shines itself", &|parts| {
            parts.materials[0].emission = Rgb::ONE
        }),
        ("a thin wall", &|parts| parts.materials[0].solid = false),
        ("a lamp without area", &|parts| {
            parts.lights.push(PunctualLight::Point {
                position: Vec3::new(0.1, 0.2, 0.3),
                intensity: Rgb::ONE,
                range: f32::INFINITY,
            });
        }),
    ];
    for (name, change) in changes {
        assert!(!is_dark(outside, change), "{name}");
    }
}
