use super::*;
use crate::math::Rgb;
use crate::scene::PunctualLight;
use crate::unit::{materials, shapes};

#[test]
fn what_is_no_scene_says_what_to_do() {
    let folder = tempfile::tempdir().expect("a folder");
    let of = |name: &str| {
        let path = folder.path().join(name);
        if !name.is_empty() && !name.starts_with("none.") {
            std::fs::write(&path, "x").expect("a file");
        }
        expect_scene(&path).err().map(|fault| fault.to_string())
    };
    for (name, words) in [
        ("none.glb", "cannot be read"),
        ("a.blend", "File > Export > glTF 2.0"),
        ("a.STL", "import it in Blender"),
        ("a.usdz", "files .usdz are not read"),
        ("a.fbx", "files .fbx are not read"),
        ("none.fbx", "files .fbx are not read"),
    ] {
        let said = of(name).expect("a fault");
        assert!(said.contains(words) && said.contains(name), "{said}");
    }
    for name in ["a.glb", "b.gltf", "c.pbrt", "d.xml", "e"] {
        assert_eq!(of(name), None);
    }
    for (wrong, beside) in [("c.pbr", "c.pbrt, "), ("none/c.pbrt", "cannot be read")] {
        let said = expect_scene(&folder.path().join(wrong)).expect_err("no scene");
        assert!(said.to_string().contains(beside), "{said}");
    }
    let said = of("").expect("a fault");
    let (first, last) = (said.contains("a folder"), said.contains("a.glb"));
    assert!(first && last && !said.contains("a.STL"), "{said}");
}

#[test]
fn metal_that_reflects_nothing_is_named() {
    let ball = |around: bool, under: fn(&mut SceneParts)| {
        let mut parts = SceneParts::default();
        let metal = materials::metal("mirror", Rgb::splat(0.9), 0.01);
        parts.add(metal, [shapes::sphere(Vec3::ZERO, 1.0, 3)]);
        if around {
            let mut wall = shapes::sphere(Vec3::ZERO, 4.0, 2);
            wall.indices
                .iter_mut()
                .for_each(|corners| corners.swap(0, 1));
            parts.add(materials::diffuse("wall", Rgb::splat(0.5)), [wall]);
        }
        under(&mut parts);
        parts
    };
    let sun = |parts: &mut SceneParts| {
        parts.lights.push(PunctualLight::Directional {
            direction: Vec3::NEG_Y,
            irradiance: Rgb::ONE,
        });
    };
    let nothing = |_: &mut SceneParts| {};
    assert!(reflects_nothing(&Scene::new(ball(false, sun))));
    assert!(!reflects_nothing(&Scene::new(ball(true, sun))));
    assert!(!reflects_nothing(&Scene::new(ball(false, nothing))));
    assert!(!reflects_nothing(&Scene::without_trees(ball(false, sun))));
}

#[test]
fn warnings_of_one_kind_are_cut_short() {
    let mut warnings: Vec<String> = (0..98)
        .map(|i| {
            let name = ["leaf", "twig"][i % 2];
            format!("{name} {i} is not closed ({i} open edges): it is shown as thin walls")
        })
        .collect();
    warnings.insert(50, "no light".into());
    let told = gathered(warnings);
    assert_eq!(told.len(), 5, "{told:?}");
    assert!(told[2].contains("leaf 2 is"));
    assert_eq!(told[3], "95 more warnings like the last");
    assert_eq!(told[4], "no light");
    let four: Vec<String> = (0..4)
        .map(|i| format!("mesh {i}: all its faces were dropped"))
        .collect();
    assert_eq!(gathered(four.clone()), four);
}
