//! Small files that request much memory, and random files: no panic, bounded memory.

use super::broken::{good, refused};
use crate::fuzz::mutate::Rng;
use crate::support::gltf::{File, load_bytes};
use serde_json::{Value, json};

/// A 1 x 1 PNG whose header states another size, with a valid checksum.
pub(crate) fn claiming(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = crate::support::gltf::png(&image::DynamicImage::new_rgb8(1, 1));
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let crc = crate::support::gltf::crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&crc.to_be_bytes());
    bytes
}

#[test]
fn load_limits_image_sizes() {
    for (width, height, fragment) in [
        (60_000, 60_000, "images[0]: 60000 x 60000 texels"),
        (0, 5, "images[0]"),
        (4000, 1, "images[0]: cannot be decoded"),
    ] {
        let mut file = File::triangle();
        let view = file.view(&claiming(width, height));
        file.push("images", json!({ "bufferView": view }));
        file.push("textures", json!({ "source": 0 }));
        file.push("materials", json!({ "emissiveTexture": { "index": 0 } }));
        refused(&file.gltf(), fragment, "a picture");
    }
}

#[test]
fn load_limits_accessors_without_bytes() {
    let mut file = good();
    file.json["accessors"][0]
        .as_object_mut()
        .unwrap()
        .remove("bufferView");
    file.json["accessors"][0]["count"] = json!(1u64 << 40);
    refused(
        &file.gltf(),
        "accessors[0]: 1099511627776 elements without a bufferView",
        "zeros",
    );
}

#[test]
fn load_limits_instances() {
    // A single instance is small, but all together are too large.
    let mut file = good();
    let accessor = &mut file.json["accessors"][0];
    accessor.as_object_mut().unwrap().remove("bufferView");
    accessor["count"] = json!(1_000_000);
    let show = |file: &mut File, nodes: usize, material| {
        file.primitive()["material"] = json!(material);
        file.json["nodes"] = json!(vec![json!({ "mesh": 0 }); nodes]);
        file.json["scenes"][0]["nodes"] = json!((0..nodes).collect::<Vec<_>>());
    };
    // Copies of a lamp are stored one by one, other meshes are shared.
    let materials = [json!({ "emissiveFactor": [1, 1, 1] }), json!({})];
    file.json["materials"] = json!(materials);
    for (nodes, material) in [(100, 0), (7000, 1)] {
        show(&mut file, nodes, material);
        refused(
            &file.gltf(),
            "meshes[0].primitives[0]: more than 67108864 vertices",
            "instances",
        );
    }
}

#[test]
fn load_deep_node_graphs_and_refuses_cycles() {
    // A chain of nodes deeper than any stack is loaded; closed to a cycle it is refused.
    let n = 50_000;
    let mut file = File::triangle();
    let mut nodes: Vec<Value> = (1..n).map(|i| json!({ "children": [i] })).collect();
    nodes.push(json!({ "mesh": 0 }));
    file.json["nodes"] = json!(nodes);
    file.json["scenes"] = json!([{ "nodes": [0] }]);
    assert_eq!(file.loaded().parts.meshes.len(), 1);
    file.json["nodes"][n - 1]["children"] = json!([n / 2]);
    refused(&file.gltf(), "nodes[25000]: is reached twice", "a ring");
    file.json["nodes"][n - 1]["children"] = json!([0]);
    file.json.as_object_mut().unwrap().remove("scenes");
    refused(
        &file.gltf(),
        "nodes: every node is a child",
        "a ring without a scene",
    );
}

#[test]
fn load_limits_list_lengths() {
    let mut file = File::triangle();
    file.json["materials"] = json!(vec![json!({}); 70_000]);
    refused(&file.gltf(), "materials: 70000 are more than", "materials");
}

/// Loads the bytes and builds the scene, if there is one; true if they are a valid file.
fn survives(bytes: &[u8]) -> bool {
    match load_bytes(bytes) {
        Ok(loaded) => {
            let scene = opsr::scene::Scene::new(loaded.parts);
            assert!(scene.geometry().triangle_count() < 1000);
            true
        }
        Err(error) => {
            assert!(error.to_string().contains("scene.gltf"));
            false
        }
    }
}

/// JSON pointers to all values inside.
pub(crate) fn pointers(value: &Value, at: &str, out: &mut Vec<String>) {
    match value {
        Value::Array(list) => {
            for (i, v) in list.iter().enumerate() {
                pointers(v, &format!("{at}/{i}"), out);
            }
        }
        Value::Object(map) => map
            .iter()
            .for_each(|(k, v)| pointers(v, &format!("{at}/{k}"), out)),
        _ => {}
    }
    out.push(at.to_owned());
}

/// Loads this many files. The share of valid files must be neither small nor large: it shows the size of the changes.
fn run(cases: u64, mut file: impl FnMut(&mut Rng) -> Vec<u8>) {
    let mut good = 0;
    for case in 0..cases {
        good += u64::from(survives(&file(&mut Rng::new("load", case))));
    }
    assert!((cases / 50..cases - cases / 50).contains(&good), "{good}");
}

#[test]
fn load_survives_random_bytes() {
    let base = good().glb();
    run(1000, |rng| {
        let mut bytes = base.clone();
        for _ in 0..1 + rng.below(7) {
            if bytes.is_empty() {
                break;
            }
            let (at, byte) = (rng.below(bytes.len()), rng.below(256));
            match rng.below(4) {
                0 => bytes[at] = byte as u8,
                1 => bytes[at] ^= 1 << (byte % 8),
                2 => drop(bytes.drain(at..bytes.len().min(at + byte))),
                _ => bytes.insert(at, byte as u8),
            }
        }
        bytes
    });
}

#[test]
fn load_survives_random_values() {
    let base = good();
    let mut all = Vec::new();
    pointers(&base.json, "", &mut all);
    let odd = [
        json!(0),
        json!(1),
        json!(2),
        json!(-1),
        json!(0.5),
        json!(5126),
        json!(u32::MAX),
        json!(1u64 << 32),
        json!(u64::MAX),
        json!(1e39),
        json!(-1e39),
        json!(1e-45),
        json!(""),
        json!("VEC4"),
        json!(true),
        json!(null),
        json!([]),
        json!({}),
        json!([0]),
        json!([0, 0, 0]),
        json!([1e38, 1e38, 1e38, 1e38]),
    ];
    run(1000, |rng| {
        let mut file = base.clone();
        for _ in 0..1 + rng.below(3) {
            // Mostly an unusual value, sometimes another part of the file.
            let value = match odd.get(rng.below(odd.len() + 3)) {
                Some(odd) => odd.clone(),
                None => base
                    .json
                    .pointer(&all[rng.below(all.len())])
                    .cloned()
                    .unwrap_or_default(),
            };
            if let Some(place) = file.json.pointer_mut(&all[rng.below(all.len())]) {
                *place = value;
            }
        }
        if file.json.is_object() {
            file.gltf()
        } else {
            file.json.to_string().into_bytes()
        }
    });
}
