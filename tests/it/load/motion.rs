//! Animations, skins, morph targets and instances.

use super::broken::refused;
use crate::support::gltf::{File, floats};
use crate::support::render;
use opsr::math::Vec3;
use opsr::regularise::Rule;
use opsr::regularise::file::TableFile;
use opsr::render::Spec;
use opsr::render::open::Opened;
use opsr::scene::Scene;
use opsr::scene::load::{Formats, LoadOptions, Loaded, cameras_at, load};
use opsr_lab::gallery::{self, glb};
use serde_json::{Value, json};
use std::path::Path;

/// Loads the scene of a file at a time.
fn at(file: &File, seconds: f64) -> Loaded {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, file.gltf()).expect("a file");
    let options = LoadOptions {
        time: Some(seconds),
        ..LoadOptions::default()
    };
    load(&path, &options).unwrap_or_else(|e| panic!("{e}"))
}

/// Adds an animation of one property of a node, with one output accessor.
fn animate(file: &mut File, times: &[f32], output: usize, kind: &str, target: Value) {
    let input = file.floats("SCALAR", times);
    file.json["accessors"][input]["min"] = json!([times[0]]);
    file.json["accessors"][input]["max"] = json!([times[times.len() - 1]]);
    file.push(
        "animations",
        json!({
            "name": format!("move {input}"),
            "samplers": [{ "input": input, "output": output, "interpolation": kind }],
            "channels": [{ "sampler": 0, "target": target }],
        }),
    );
}

/// A file with one animation per action, as Blender writes: all play, and the first channel of each property counts.
#[test]
fn animation_of_several_actions_is_named() {
    let mut file = File::triangle();
    for _ in 0..4 {
        file.push("nodes", json!({ "name": "bone" }));
    }
    for action in 0..3 {
        let place = [0.0, action as f32 + 1.0, 0.0];
        let output = file.floats("VEC3", &[place, place].concat());
        for node in 0..=4 {
            let target = json!({ "node": node, "path": "translation" });
            animate(&mut file, &[0.0, 1.0], output, "LINEAR", target);
        }
    }
    let moved = at(&file, 0.5);
    assert_eq!(moved.parts.meshes[0].positions[0].y, 1.0);
    let nodes = "5 nodes: several animations move it; the first counts: nodes[0], nodes[1] (`bone`), nodes[2] (`bone`) …";
    assert_eq!(moved.warnings, [nodes, "animations: all 15 play at once"]);
}

/// The studio's floor stays where the scene at rest puts it, while objects move.
#[test]
fn floor_of_the_studio_stays_at_every_moment() {
    let mut file = File::triangle();
    let output = file.floats("VEC3", &[0.0, 5.0, 0.0, 1.0, 9.0, 0.0]);
    let target = json!({ "node": 0, "path": "translation" });
    animate(&mut file, &[0.0, 2.0], output, "LINEAR", target);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, file.gltf()).expect("a file");
    let opened = |at: Option<&str>| {
        let mut spec = Spec::default();
        if let Some(at) = at {
            spec.set("at", &at.into()).expect("a moment");
        }
        spec.open(&path, Formats::default(), Scene::new)
            .expect("a scene")
    };
    let floor = |opened: &Opened| {
        let floor = opened.scene.parts().floor().expect("a floor");
        floor.positions.clone()
    };
    let rest = opened(None);
    for at in ["0s", "1s", "2s"] {
        let moved = opened(Some(at));
        assert_eq!(floor(&moved), floor(&rest));
        assert!(moved.scene.bounds().0.y >= 5.0, "{at}");
    }
    assert!(floor(&rest).iter().all(|p| p.y < 0.0 && p.y > -0.01));
    // Only an animation of more than cameras, at a requested time, needs the scene at rest too.
    assert!(file.loaded().rest.is_none() && at(&file, 1.0).rest.is_some());
}

fn corner(file: &File, seconds: f64) -> Vec3 {
    at(file, seconds).parts.meshes[0].positions[0]
}

#[test]
fn animation_of_translations_steps_and_interpolates() {
    let target = json!({ "node": 0, "path": "translation" });
    let (a, b) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(5.0, 0.0, 3.0));
    for (kind, middle) in [("STEP", a), ("LINEAR", a + 0.25 * (b - a))] {
        let mut file = File::triangle();
        let output = file.floats("VEC3", &[a.to_array(), b.to_array()].concat());
        animate(&mut file, &[1.0, 3.0], output, kind, target.clone());
        // Before the first keyframe and after the last, the value of that keyframe.
        for (seconds, expected) in [(-1.0, a), (1.0, a), (1.5, middle), (3.0, b), (9.0, b)] {
            let got = corner(&file, seconds);
            assert!((got - expected).length() < 1e-6, "{kind} {seconds}: {got}");
        }
        let rest = file.loaded();
        assert_eq!(rest.parts.meshes[0].positions[0], Vec3::ZERO);
        assert!(rest.warnings[0].contains("--at"), "{:?}", rest.warnings);
        assert_eq!(rest.animations[0].seconds, 3.0);
    }
    // Hermite: from 0 with tangent 0 to 1 with tangent 0 over 2 s passes 0.5 in the middle, 0.15625 at a quarter; an
    // outgoing tangent of 1 per second adds 2 (t³ − 2t² + t).
    for (tangent, quarter) in [(0.0f32, 0.15625f32), (1.0, 0.15625 + 2.0 * 0.140_625)] {
        let mut file = File::triangle();
        let mut keys = [0.0f32; 18];
        (keys[6], keys[12]) = (tangent, 1.0);
        let output = file.floats("VEC3", &keys);
        animate(
            &mut file,
            &[0.0, 2.0],
            output,
            "CUBICSPLINE",
            target.clone(),
        );
        assert!((corner(&file, 0.5).x - quarter).abs() < 1e-6);
        assert_eq!(corner(&file, 2.0), Vec3::X);
    }
}

#[test]
fn animation_of_rotations_takes_the_shorter_arc() {
    let half = 0.5f32.sqrt();
    // A quarter turn about z, and the same rotation by the negated quaternion.
    for sign in [1.0, -1.0] {
        let mut file = File::triangle();
        let keys = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, sign * half, sign * half];
        let output = file.floats("VEC4", &keys);
        let target = json!({ "node": 0, "path": "rotation" });
        animate(&mut file, &[0.0, 1.0], output, "LINEAR", target);
        let x = at(&file, 1.0 / 3.0).parts.meshes[0].positions[1];
        let (sin, cos) = 30f32.to_radians().sin_cos();
        assert!((x - Vec3::new(cos, sin, 0.0)).length() < 1e-6, "{x}");
    }
}

/// A film opens its scene once if the animations move cameras alone; the loader reports if they do.
#[test]
fn animation_of_cameras_alone_is_told() {
    let file = |below: Option<Value>| {
        let mut file = File::triangle();
        let lens = json!({ "yfov": 1, "znear": 0.1 });
        let camera = json!({ "type": "perspective", "perspective": lens });
        file.push("cameras", camera);
        // A moving rig, with the camera and another node below it.
        let camera = file.push("nodes", json!({ "camera": 0, "translation": [0, 0, 1] }));
        let mut rig = vec![camera];
        rig.extend(below.map(|node| file.push("nodes", node)));
        let rig = file.push("nodes", json!({ "children": rig }));
        let output = file.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
        let target = json!({ "node": rig, "path": "translation" });
        animate(&mut file, &[0.0, 1.0], output, "LINEAR", target);
        file
    };
    let report = |file: &File| file.loaded().animations[0].of_cameras;
    let alone = file(None);
    assert!(report(&alone) && report(&file(Some(json!({})))));
    let light = json!({ "extensions": { "KHR_lights_punctual": { "light": 0 } } });
    let mut lit = file(Some(light));
    lit.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    lit.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
    assert!(!report(&lit) && !report(&file(Some(json!({ "mesh": 0 })))));
    let mut skinned = file(Some(json!({})));
    let joint = skinned.json["nodes"].as_array().expect("nodes").len() - 2;
    skinned.push("skins", json!({ "joints": [joint] }));
    assert!(!report(&skinned));
    // `cameras_at` returns the cameras of the scene opened at the same time.
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, alone.gltf()).expect("a file");
    for seconds in [0.0, 0.25, 7.0] {
        let moved = cameras_at(&path, seconds, &[]).unwrap_or_else(|e| panic!("{e}"));
        let opened = at(&alone, seconds).parts.cameras;
        assert_eq!(moved.len(), 1);
        assert_eq!(moved[0].position, opened[0].position);
        assert_eq!(
            moved[0].position,
            Vec3::new(0.0, 4.0 * (seconds as f32).min(1.0), 1.0)
        );
    }
    let missing = cameras_at(&folder.path().join("none.gltf"), 0.0, &[]);
    assert!(missing.expect_err("no file").is_missing());
}

#[test]
fn animation_moves_cameras_and_lights_with_their_parents() {
    let mut file = File::triangle();
    file.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
    let lens = json!({ "yfov": 1, "znear": 0.1 });
    file.push(
        "cameras",
        json!({ "type": "perspective", "perspective": lens }),
    );
    let light = json!({ "KHR_lights_punctual": { "light": 0 } });
    file.push("nodes", json!({ "camera": 0, "translation": [0, 0, 1] }));
    file.push("nodes", json!({ "extensions": light }));
    file.json["nodes"][0]["children"] = json!([1, 2]);
    let output = file.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 4.0, 0.0]);
    let target = json!({ "node": 0, "path": "translation" });
    animate(&mut file, &[0.0, 1.0], output, "LINEAR", target);
    let parts = at(&file, 0.5).parts;
    assert_eq!(parts.cameras[0].position, Vec3::new(0.0, 2.0, 1.0));
    match parts.lights[0] {
        opsr::scene::PunctualLight::Point { position, .. } => {
            assert_eq!(position, Vec3::new(0.0, 2.0, 0.0));
        }
        _ => panic!("not a point light"),
    }
}

#[test]
fn animation_of_morph_weights_adds_the_targets() {
    let mut file = File::triangle();
    let up = file.floats("VEC3", &[0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let right = file.floats("VEC3", &[8.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    file.primitive()["targets"] = json!([{ "POSITION": up }, { "POSITION": right }]);
    file.json["meshes"][0]["weights"] = json!([1, 0.5]);
    assert_eq!(
        file.loaded().parts.meshes[0].positions[0],
        Vec3::new(4.0, 0.0, 2.0)
    );
    assert_eq!(file.loaded().warnings, [""; 0]);
    let mut tinted = file.clone();
    tinted.primitive()["targets"][1]["COLOR_0"] = json!(up);
    let line = "meshes[0]: morph targets of COLOR_0 are ignored";
    assert_eq!(tinted.loaded().warnings, [line]);
    let output = file.floats("SCALAR", &[0.0, 1.0, 1.0, 0.0]);
    let target = json!({ "node": 0, "path": "weights" });
    animate(&mut file, &[0.0, 1.0], output, "LINEAR", target);
    assert_eq!(corner(&file, 0.25), Vec3::new(6.0, 0.0, 0.5));
}

#[test]
fn skins_move_vertices_with_their_joints() {
    let mut file = File::triangle();
    let joints = file.view(&[0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0]);
    let joints = file.push(
        "accessors",
        json!({
            "bufferView": joints, "componentType": 5121, "count": 3, "type": "VEC4",
        }),
    );
    let weights = file.floats(
        "VEC4",
        &[1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    );
    file.primitive()["attributes"]["JOINTS_0"] = json!(joints);
    file.primitive()["attributes"]["WEIGHTS_0"] = json!(weights);
    // The second joint is bound at (0, 1, 0), its position at rest; the pose of the mesh's node does not count.
    let mut bind = [0.0f32; 32];
    for i in 0..4 {
        (bind[5 * i], bind[16 + 5 * i]) = (1.0, 1.0);
    }
    bind[16 + 13] = -1.0;
    let view = file.view(&floats(&bind));
    let matrices = file.push(
        "accessors",
        json!({
            "bufferView": view, "componentType": 5126, "count": 2, "type": "MAT4",
        }),
    );
    file.push(
        "skins",
        json!({ "joints": [1, 2], "inverseBindMatrices": matrices }),
    );
    file.json["nodes"][0] = json!({ "mesh": 0, "skin": 0, "translation": [99, 0, 0] });
    file.push("nodes", json!({ "children": [2] }));
    file.push("nodes", json!({ "translation": [0, 1, 0] }));
    let rest = file.loaded();
    assert_eq!(rest.warnings, [""; 0]);
    assert_eq!(
        rest.parts.meshes[0].positions,
        [Vec3::ZERO, Vec3::X, Vec3::Y]
    );
    let output = file.floats("VEC3", &[0.0, 1.0, 0.0, 0.0, 1.0, 4.0]);
    let target = json!({ "node": 2, "path": "translation" });
    animate(&mut file, &[0.0, 1.0], output, "LINEAR", target);
    let moved = [
        Vec3::ZERO,
        Vec3::new(1.0, 0.0, 2.0),
        Vec3::new(0.0, 1.0, 4.0),
    ];
    assert_eq!(at(&file, 1.0).parts.meshes[0].positions, moved);
    file.json["skins"][0]["joints"] = json!([1]);
    refused(&file.gltf(), "joint 1 of vertex 1 is not below 1", "joints");
}

#[test]
fn instances_of_a_mesh_stand_at_each_pose() {
    let mut file = File::triangle();
    file.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    file.json["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
    let places = file.floats("VEC3", &[1.0, 0.0, 0.0, 0.0, 5.0, 0.0]);
    let scales = file.floats("VEC3", &[1.0, 1.0, 1.0, 3.0, 1.0, 1.0]);
    let attributes = json!({ "TRANSLATION": places, "SCALE": scales });
    let extension = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    file.json["nodes"][0] = json!({ "mesh": 0, "translation": [0, 0, 7], "extensions": extension });
    let meshes = file.loaded().parts.meshes;
    let second: Vec<Vec3> = meshes.iter().map(|m| m.positions[1]).collect();
    assert_eq!(second, [Vec3::new(2.0, 0.0, 7.0), Vec3::new(3.0, 5.0, 7.0)]);
    let one = file.floats("VEC3", &[1.0; 3]);
    file.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"]["SCALE"] =
        json!(one);
    refused(&file.gltf(), "its attributes differ in length", "lengths");
}

#[test]
fn animations_that_are_broken_are_refused_by_place() {
    let broken = |edit: fn(&mut File)| {
        let mut file = File::triangle();
        let output = file.floats("VEC3", &[0.0; 6]);
        let target = json!({ "node": 0, "path": "translation" });
        animate(&mut file, &[0.0, 1.0], output, "LINEAR", target);
        edit(&mut file);
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("scene.gltf");
        std::fs::write(&path, file.gltf()).unwrap();
        let options = LoadOptions {
            time: Some(0.5),
            ..LoadOptions::default()
        };
        load(&path, &options).unwrap_err().to_string()
    };
    type Edit = fn(&mut File);
    let cases: [(Edit, &str); 4] = [
        (
            |f| f.json["animations"][0]["samplers"][0]["output"] = json!(0),
            "channels[0]: 3 values, not 2",
        ),
        (
            |f| f.json["animations"][0]["samplers"][0]["input"] = json!(0),
            "is a Vec3, not the Scalar",
        ),
        (
            |f| f.bytes[60..64].copy_from_slice(&2f32.to_le_bytes()),
            "out of order",
        ),
        (
            |f| {
                f.json["nodes"][0]["matrix"] =
                    json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
            },
            "has a matrix",
        ),
    ];
    for (edit, fragment) in cases {
        let message = broken(edit);
        assert!(message.contains(fragment), "{message} lacks {fragment}");
    }
}

/// Twelve frames of a caustic with moving glass: with a table the energy follows that of plain path tracing from frame
/// to frame. The bias of the table may drift, but not flicker.
#[test]
fn animation_with_a_table_is_stable_in_time() {
    let parts = gallery::caustic_box();
    let mut file = File::from_glb(&glb::to_glb(&parts).expect("a file"));
    let glass = (parts.meshes.iter())
        .position(|m| parts.materials[m.material as usize].solid)
        .expect("a glass body");
    let node = (file.json["nodes"].as_array().expect("nodes").iter())
        .position(|n| n["mesh"] == json!(glass))
        .expect("its node");
    let output = file.floats("VEC3", &[-0.15, 0.0, 0.0, 0.15, 0.0, 0.0]);
    let target = json!({ "node": node, "path": "translation" });
    animate(&mut file, &[0.0, 0.5], output, "LINEAR", target);
    let table = TableFile::load(Path::new("beta-0.001")).expect("a table");
    let rule = Rule::with_table(table.table);
    let ratios: Vec<(f64, f64)> = (0..12)
        .map(|frame| {
            let scene = Scene::new(at(&file, f64::from(frame) / 24.0).parts);
            let (with, error) = render::mean(&render::film(&scene, rule.clone(), 24, 64, 5));
            let (plain, noise) = render::mean(&render::film(&scene, Rule::Plain, 24, 256, 6));
            let relative = (error / with).hypot(noise / plain);
            ((with / plain).ln(), relative)
        })
        .collect();
    for (frame, pair) in ratios.windows(2).enumerate() {
        let step = pair[1].0 - pair[0].0;
        let noise = pair[0].1.hypot(pair[1].1);
        assert!(
            step.abs() < 4.0 * noise + 0.01,
            "frame {frame}: {step} with noise {noise}: {ratios:?}"
        );
    }
}
