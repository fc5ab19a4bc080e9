//! Scenes lit by their own surfaces: a table of scenes, and the camera of files without one.

use crate::math::{Rgb, Vec2, Vec3};
use crate::regularise::Rule;
use crate::render::Spec;
use crate::render::open::Opened;
use crate::scene::light::sky::studio;
use crate::scene::load::Formats;
use crate::scene::{Camera, Environment, Material, Mesh, PunctualLight, Scene, SceneParts};
use crate::unit::lab::gallery::glb::to_glb;
use crate::unit::lab::gallery::materials;
use crate::unit::lab::gallery::shapes::{self, Placing};
use crate::unit::support::gltf::File;
use crate::unit::support::render::{film, mean, scene};
use image::{DynamicImage, Rgb as Texel, RgbImage};
use serde_json::json;

/// A grey material that emits.
fn lamp(radiance: f32) -> Material {
    Material {
        emission: Rgb::splat(radiance),
        ..materials::diffuse("lamp", Rgb::splat(0.5))
    }
}

/// A horizontal square at a height, facing down.
fn square(size: f32, height: f32) -> Mesh {
    let (half, low) = (0.5 * size, Vec3::Y * height);
    shapes::quad(
        low - Vec3::new(half, 0.0, half),
        Vec3::X * size,
        Vec3::Z * size,
    )
}

/// A floor of this size, two boxes, and a camera.
fn ground(size: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    let grey = materials::diffuse("grey", Rgb::splat(0.5));
    let half = 0.5 * size;
    let floor = shapes::quad(Vec3::new(-half, 0.0, -half), Vec3::Z * size, Vec3::X * size);
    let boxes = [-1.0, 1.0]
        .map(|x| shapes::cuboid(Vec3::new(x - 0.4, 0.0, -0.4), Vec3::new(x + 0.4, 0.8, 0.4)));
    parts.add(grey, std::iter::once(floor).chain(boxes));
    parts.add_camera([0.0, 2.0, 5.0], [0.0, 0.6, 0.0], 45.0);
    parts
}

/// The ground, and meshes of one more material.
fn with(size: f32, material: Material, meshes: impl IntoIterator<Item = Mesh>) -> SceneParts {
    let mut parts = ground(size);
    parts.add(material, meshes);
    parts
}

/// A room of 4 m × 4 m with a lamp under the ceiling, closed or without its front wall, with or without a camera.
fn room(closed: bool, radiance: f32, inside: bool) -> SceneParts {
    let mut parts = SceneParts::default();
    let walls = shapes::room(Vec3::new(-2.0, 0.0, -2.0), Vec3::new(2.0, 3.0, 2.0));
    let walls = walls.into_iter().take(if closed { 6 } else { 5 });
    parts.add(materials::diffuse("wall", Rgb::splat(0.7)), walls);
    parts.add(lamp(radiance), [square(0.3, 2.9)]);
    if inside {
        parts.add_camera([0.0, 1.5, 1.8], [0.0, 1.2, 0.0], 60.0);
    }
    parts
}

/// A file of scene parts; the material `textured` emits a checkerboard image.
fn file(parts: &SceneParts, textured: Option<usize>) -> File {
    let mut file = File::from_glb(&to_glb(parts).expect("a scene"));
    if let Some(material) = textured {
        let image = RgbImage::from_fn(8, 8, |x, y| Texel([255 * ((x + y) % 2) as u8; 3]));
        let texture = file.texture(&DynamicImage::from(image));
        file.json["materials"][material]["emissiveTexture"] = json!({ "index": texture });
    }
    file
}

fn open(file: &File, words: &[(&str, &str)]) -> Opened {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, file.glb()).expect("a file");
    let mut spec = Spec::default();
    for (option, value) in words {
        match *option {
            "env" => spec.env = Some(value.into()),
            other => panic!("{other}"),
        }
    }
    spec.open(&path, Formats::default(), Scene::new)
        .expect("a scene")
}

/// A quad with texture coordinates.
fn mapped(mesh: Mesh) -> Mesh {
    let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from);
    Mesh {
        uvs: uvs.to_vec(),
        ..mesh
    }
}

/// Lamps light a scene; faint emission is decoration, and the studio lights the scene. Earlier versions decided the
/// cases marked * wrongly.
#[test]
fn lamps_light_and_decoration_does_not() {
    let black = |radiance: f32| Material {
        double_sided: true,
        ..materials::emitter("lamp", Rgb::splat(radiance))
    };
    let bulb = |radiance, glass: bool| {
        let centre = Vec3::new(0.0, 2.0, 0.0);
        let mut parts = with(10.0, lamp(radiance), [shapes::sphere(centre, 0.015, 2)]);
        if glass {
            let globe = shapes::sphere(centre, 0.15, 3);
            parts.add(materials::glass("globe", 1.5, 0.001), [globe]);
        }
        parts
    };
    let point = |mut parts: SceneParts| {
        parts.lights.push(PunctualLight::Point {
            position: Vec3::new(0.0, 2.0, 0.0),
            intensity: Rgb::splat(1e-3),
            range: f32::INFINITY,
        });
        parts
    };
    let screen = |radiance| {
        let screen = shapes::quad(Vec3::new(-1.2, 0.3, 0.41), Vec3::X * 0.4, Vec3::Y * 0.3);
        with(10.0, lamp(radiance), [mapped(screen)])
    };
    let shaded = || {
        let mut parts = with(10.0, lamp(40.0), [shapes::sphere(Vec3::Y * 2.0, 0.05, 2)]);
        let shade = shapes::cylinder(0.2, 0.4, 24).placed([0.0; 3], Vec3::Y * 2.0);
        parts.add(materials::diffuse("shade", Rgb::splat(0.8)), [shade]);
        parts
    };
    let large = |m: Material| with(10.0, m, [mapped(square(1.0, 2.5))]);
    let grey = || materials::diffuse("grey", Rgb::splat(0.5));
    // Every surface in view emits.
    let alone = |emission: f32, albedo: f32| {
        let mut parts = SceneParts::default();
        let material = Material {
            emission: Rgb::splat(emission),
            ..materials::diffuse("all", Rgb::splat(albedo))
        };
        parts.add(material, [shapes::sphere(Vec3::Y, 1.0, 3)]);
        parts.add_camera([0.0, 1.0, 5.0], [0.0, 1.0, 0.0], 45.0);
        parts
    };
    // Name, scene, material with a texture, true if its own lamps light it.
    let cases = [
        (
            "* lamp of 10 cm, radiance 50",
            with(10.0, lamp(50.0), [square(0.1, 2.5)]),
            None,
            true,
        ),
        (
            "* lamp of 10 cm, radiance 100",
            with(10.0, lamp(100.0), [square(0.1, 2.5)]),
            None,
            true,
        ),
        (
            "* lamp of 10 cm over 100 m",
            with(100.0, lamp(5000.0), [square(0.1, 2.5)]),
            None,
            true,
        ),
        (
            "* lamp of 30 cm, radiance 2.5",
            with(5.0, lamp(2.5), [square(0.3, 2.5)]),
            None,
            true,
        ),
        (
            "* lamp of 1 m without a strength",
            large(lamp(1.0)),
            None,
            true,
        ),
        ("* black lamp of two sides", large(black(20.0)), None, true),
        ("* lamp with a texture", large(lamp(20.0)), Some(1), true),
        ("* filament in a globe", bulb(30.0, true), None, true),
        ("* closed room", room(true, 2.0, true), None, true),
        ("* bare filament", bulb(30.0, false), None, true),
        ("* dim point light", point(ground(10.0)), None, true),
        ("* closed room, dim", room(true, 0.05, true), None, true),
        ("* open room", room(false, 5.0, true), None, true),
        ("* lamp under a shade", shaded(), None, true),
        (
            "* closed room, textured",
            room(true, 0.9, true),
            Some(1),
            true,
        ),
        (
            "thing with a tint of emission",
            alone(0.01, 0.5),
            None,
            false,
        ),
        ("thing that shines", alone(1.0, 0.5), None, true),
        (
            "dim thing that reflects nothing",
            alone(0.01, 0.0),
            None,
            true,
        ),
        ("no light", ground(10.0), None, false),
        (
            "grey thing more",
            with(10.0, grey(), [square(1.0, 2.5)]),
            None,
            false,
        ),
        ("screen", screen(1.0), Some(1), false),
        ("dial", screen(0.1), None, false),
        (
            "paper that shines",
            with(
                5.0,
                materials::translucent(black(1.0), 0.5, Rgb::ONE),
                [mapped(square(1.0, 2.5))],
            ),
            None,
            true,
        ),
        (
            "picture that is unlit",
            large(Material {
                unlit: true,
                ..black(0.9)
            }),
            None,
            false,
        ),
        (
            "lamp that faces away",
            with(10.0, lamp(50.0), [square(0.5, 3.0).inverted()]),
            None,
            false,
        ),
        (
            "lamp in a box",
            {
                let mut parts = with(10.0, lamp(500.0), [square(0.1, 0.5).moved(Vec3::X)]);
                parts.materials[1].double_sided = true;
                parts
            },
            None,
            false,
        ),
    ];
    for (name, parts, textured, lit) in cases {
        let opened = open(&file(&parts, textured), &[]);
        let chosen = opened.light_chosen();
        assert_eq!(
            !opened.in_studio, lit,
            "{name}: {chosen} {:?}",
            opened.lighting
        );
        assert_eq!(opened.scene.parts().environment.is_some(), !lit, "{name}");
        assert_eq!(
            chosen.contains("built-in studio, "),
            !lit,
            "{name}: {chosen}"
        );
        assert!(
            opened.scene.warnings().is_empty(),
            "{name}: {:?}",
            opened.scene.warnings()
        );
    }
}

/// Automatic exposure leaves pictures of the studio unchanged, chosen or by default, and empty scenes give a warning.
#[test]
fn studio_is_not_brightened_and_empty_scenes_are_named() {
    let dark = crate::image::Buffer::filled(8, 8, Rgb::splat(0.01));
    let exposure = |env: Option<&str>, in_studio| {
        let spec = Spec {
            env: env.map(Into::into),
            ..Spec::default()
        };
        spec.display(&dark, in_studio).exposure
    };
    assert!(exposure(None, false) > 1.0 && exposure(Some("sky"), false) > 1.0);
    assert_eq!(
        [exposure(None, true), exposure(Some("studio"), false)],
        [0.0; 2]
    );
    let words = "the scene has no surface";
    let mut none = file(&ground(10.0), None);
    none.json["scenes"] = json!([{ "nodes": [] }]);
    let empty = open(&none, &[]);
    assert!(
        empty.warnings.iter().any(|w| w.contains(words)),
        "{:?}",
        empty.warnings
    );
    let full = open(&file(&ground(10.0), None), &[]);
    assert!(!full.warnings.iter().any(|w| w.contains(words)));
}

/// The decision is a property of the scene, and the same in every run.
#[test]
fn lighting_is_the_same_every_time() {
    let parts = with(10.0, lamp(50.0), [square(0.1, 2.5)]);
    let measured = || {
        open(&file(&parts, None), &[])
            .lighting
            .expect("a measurement")
    };
    let first = measured();
    assert_eq!(first, measured());
    assert!(
        first.reached > first.points / 2 && !first.enclosed,
        "{first:?}"
    );
}

/// An environment too faint beside the lamps gives a warning with the factor that makes it visible.
#[test]
fn faint_surroundings_are_named() {
    let sun = |irradiance: f32| {
        let mut parts = ground(10.0);
        parts.lights.push(PunctualLight::Directional {
            direction: Vec3::NEG_Y,
            irradiance: Rgb::splat(irradiance),
        });
        open(&file(&parts, None), &[("env", "studio")]).warnings
    };
    let faint = sun(6830.0);
    assert!(
        faint.iter().any(|w| w.contains("--env-intensity")),
        "{faint:?}"
    );
    assert!(sun(3.0).is_empty());
}

/// Width and height of the bounds of projected points in a square picture, and true if all points are in it.
fn filled(camera: &Camera, points: impl Iterator<Item = Vec3>) -> (Vec2, bool) {
    let (mut low, mut high) = (Vec2::splat(f32::INFINITY), Vec2::splat(f32::NEG_INFINITY));
    for p in points {
        let (film, ..) = camera
            .project(p, 1.0, Vec2::ZERO)
            .expect("a point in front");
        (low, high) = (low.min(film), high.max(film));
    }
    let inside = low.min_element() >= 0.0 && high.max_element() <= 1.0;
    (high - low, inside)
}

#[test]
fn framing_fills_the_picture_with_the_subject() {
    let ball = shapes::sphere(Vec3::new(3.0, 1.0, 0.0), 1.0, 3);
    let grey = || materials::diffuse("grey", Rgb::splat(0.5));
    let of = |more: Vec<Mesh>| {
        let mut parts = SceneParts::default();
        parts.add(grey(), std::iter::once(ball.clone()).chain(more));
        Scene::new(parts).framing_camera(1.0)
    };
    let floor = |size: f32| {
        let corner = Vec3::new(-0.5 * size, 0.0, -0.5 * size);
        shapes::quad(corner, Vec3::Z * size, Vec3::X * size)
    };
    let sky = || shapes::sphere(Vec3::ZERO, 500.0, 3).inverted();
    let far = shapes::sphere(Vec3::new(300.0, 0.0, 0.0), 0.1, 1);
    for (name, more) in [
        ("alone", vec![]),
        ("on 300 m", vec![floor(300.0)]),
        ("under a sky", vec![sky()]),
        ("on 300 m and under a sky", vec![floor(300.0), sky()]),
        ("beside something far away", vec![far]),
    ] {
        let camera = of(more);
        let (size, inside) = filled(&camera, ball.positions.iter().copied());
        assert!(inside && size.min_element() > 0.9, "{name}: {size}");
    }
    // A floor of the size of its objects is in the picture.
    let camera = of(vec![floor(6.0)]);
    assert!(filled(&camera, floor(6.0).positions.into_iter()).1);
    // Shared copies are framed by their transformed vertices.
    let mut parts = SceneParts::default();
    parts.add_material(grey());
    parts.shared.push(crate::scene::SharedMesh {
        mesh: shapes::cuboid(-Vec3::ONE, Vec3::ONE),
        poses: [-4.0, 4.0]
            .map(|x| glam::DAffine3::from_translation(glam::DVec3::X * x))
            .to_vec(),
    });
    let camera = Scene::new(parts).framing_camera(1.0);
    let ends = [-5.0, 5.0].map(|x| Vec3::new(x, 0.0, 0.0));
    let (size, inside) = filled(&camera, ends.into_iter());
    assert!(inside && size.x > 0.8, "{size}");
}

#[test]
fn framing_looks_into_an_open_room() {
    let into = |turn: f32, closed: bool| {
        let mut parts = room(closed, 5.0, false);
        for mesh in &mut parts.meshes {
            *mesh = std::mem::take(mesh).placed([turn, 0.0, 0.0], Vec3::ZERO);
        }
        let camera = Scene::new(parts).framing_camera(1.0);
        (-camera.frame.n, camera.name)
    };
    let (along, name) = into(0.0, false);
    assert!(
        along.z < -0.99 && name.contains("open side"),
        "{along} {name}"
    );
    let (along, _) = into(std::f32::consts::FRAC_PI_2, false);
    assert!(along.x.abs() > 0.99, "{along}");
    assert!(into(0.0, true).1.contains("three-quarter"));
}

/// The floor of the studio lies below the lowest point of scenes without a floor, and does not count for the framing.
#[test]
fn objects_stand_on_the_floor_of_the_studio() {
    let block = || shapes::cuboid(Vec3::new(1.0, 2.0, -1.0), Vec3::new(2.0, 5.0, 1.0));
    let of = |more: Option<Mesh>| {
        let mut parts = SceneParts::default();
        let grey = materials::diffuse("grey", Rgb::splat(0.5));
        parts.add(grey, std::iter::once(block()).chain(more));
        file(&parts, None)
    };
    let opened = open(&of(None), &[]);
    let floor = opened.scene.parts().floor().expect("a floor");
    for p in &floor.positions {
        assert!(p.y < 2.0 && p.y > 1.99, "{p}");
    }
    let up = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|i| floor.positions[i as usize]);
        (b - a).cross(c - a).y > 0.0
    };
    assert!(floor.indices.iter().all(up));
    let (low, high) = opened.scene.bounds();
    assert!(low.distance(Vec3::new(1.0, 2.0, -1.0)) < 1e-5 && high.y == 5.0);
    let none = open(&of(None), &[("env", "none")]);
    assert!(none.scene.parts().floor().is_none());
    assert_eq!(none.scene.bounds(), (low, high));
    let [standing, floating] = [&opened, &none].map(|opened| opened.scene.framing_camera(1.5));
    assert_eq!(standing, floating);
    let named = open(&of(None), &[("env", "studio")]);
    assert!(named.scene.parts().has_floor);
    let own = shapes::quad(Vec3::new(-30.0, 2.0, -30.0), Vec3::Z * 60.0, Vec3::X * 60.0);
    assert!(!open(&of(Some(own)), &[]).scene.parts().has_floor);
    // With a lamp that is decoration the acceleration structure is built again, with the floor.
    let glow = with(2.0, lamp(0.05), [square(0.1, 0.2)]);
    let opened = open(&file(&glow, None), &[]);
    assert!(opened.in_studio && opened.scene.parts().has_floor);
    assert!(opened.scene.parts().environment.is_some());
}

/// A floor without objects is as bright as its backdrop; near and behind an object it is darker, most at the object.
#[test]
fn floor_of_the_studio_has_a_shadow_and_no_rim() {
    // Away from the key light, which stands front left.
    let along = Vec3::new(0.67, 0.0, -0.74);
    let at = |distance: f32, floor: bool| {
        let mut parts = SceneParts::default();
        let cube = shapes::cuboid(Vec3::new(-0.5, 0.0, -0.5), Vec3::new(0.5, 1.0, 0.5));
        parts.add(materials::diffuse("grey", Rgb::splat(0.5)), [cube]);
        if floor {
            parts.lay_floor(None);
        }
        parts.environment = Some(Environment::from_map(studio(), 0.0));
        let to = distance * along;
        parts.add_camera((to + 3.0 * along + 2.0 * Vec3::Y).into(), to.into(), 1.0);
        mean(&film(&scene(parts), Rule::Plain, 8, 256, 1)).0
    };
    let backdrop = at(0.8, false);
    let [close, near, rim, beyond] = [0.8, 1.5, 5.1, 5.3].map(|d| at(d, true) / backdrop);
    assert!((beyond - 1.0).abs() < 1e-6, "{beyond}");
    // A tiny difference shows a pixel of the floor: the backdrop has no noise.
    let apart = (rim - 1.0).abs();
    assert!(apart > 1e-7 && apart < 0.005, "{rim}");
    assert!(close < near - 0.1 && near < 0.95, "{close} {near}");
}
