//! Broken files are refused with the place of the fault, without panics and without allocations by false lengths.

use crate::support::gltf::{File, floats, load_bytes, load_in, shorts};
use serde_json::{Value, json};

/// A valid file that uses every supported feature.
pub(crate) fn good() -> File {
    let mut file = File::of(|file| {
        let p = file.floats(
            "VEC3",
            &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0],
        );
        let n = file.floats("VEC3", &[0.0, 0.0, 1.0].repeat(4));
        let uv = file.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
        let t = file.floats("VEC4", &[1.0, 0.0, 0.0, -1.0].repeat(4));
        let i = file.indices(&[0, 1, 2, 2, 1, 3]);
        let at = file.view(&shorts(&[1, 3]));
        let to = file.view(&floats(&[1.5, 0.0, 0.0, 1.5, 1.0, 0.0]));
        file.json["accessors"][p]["sparse"] = json!({
            "count": 2, "indices": { "bufferView": at, "componentType": 5123 }, "values": { "bufferView": to },
        });
        let attributes = json!({ "POSITION": p, "NORMAL": n, "TEXCOORD_0": uv, "TANGENT": t });
        json!({ "attributes": attributes, "indices": i, "material": 0 })
    });
    file.texture(&image::RgbImage::from_pixel(2, 2, image::Rgb([9, 99, 199])).into());
    file.push("samplers", json!({ "wrapS": 33071 }));
    file.json["textures"][0]["sampler"] = json!(0);
    let info =
        json!({ "index": 0, "extensions": { "KHR_texture_transform": { "scale": [2, 2] } } });
    file.push("materials", json!({
        "name": "glass", "alphaMode": "MASK", "alphaCutoff": 0.5,
        "pbrMetallicRoughness": { "baseColorTexture": info, "baseColorFactor": [1, 1, 1, 1], "roughnessFactor": 0.5 },
        "normalTexture": info, "emissiveFactor": [1, 1, 1],
        "extensions": {
            "KHR_materials_emissive_strength": { "emissiveStrength": 2 },
            "KHR_materials_ior": { "ior": 1.4 },
            "KHR_materials_specular": { "specularFactor": 1 },
            "KHR_materials_transmission": { "transmissionFactor": 1 },
            "KHR_materials_volume": { "thicknessFactor": 1, "attenuationDistance": 1, "attenuationColor": [1, 1, 1] },
        },
    }));
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "spot", "spot": { "outerConeAngle": 0.5 }, "intensity": 3, "range": 9 },
    ]}});
    let lens = json!({ "yfov": 1, "znear": 0.1, "aspectRatio": 1.5 });
    file.push(
        "cameras",
        json!({ "type": "perspective", "perspective": lens }),
    );
    let light = json!({ "KHR_lights_punctual": { "light": 0 } });
    file.push(
        "nodes",
        json!({ "name": "lamp", "translation": [0, 0, 5], "extensions": light }),
    );
    file.push("nodes", json!({ "camera": 0, "rotation": [0, 0, 0, 1] }));
    file.json["nodes"][0]["children"] = json!([1, 2]);
    file.json["scenes"] = json!([{ "nodes": [0] }]);
    file.json["scene"] = json!(0);
    file
}

/// Sets the value at a JSON pointer, whose last key may be new; `null` removes it.
fn edit(json: &mut Value, pointer: &str, value: Value) {
    let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
    match json
        .pointer_mut(parent)
        .unwrap_or_else(|| panic!("{pointer} has no parent"))
    {
        Value::Array(list) => list[key.parse::<usize>().expect("an index")] = value,
        Value::Object(map) if value.is_null() => drop(map.remove(key).expect("a key")),
        other => other[key] = value,
    }
}

pub(super) fn refused(bytes: &[u8], fragment: &str, what: &str) {
    match load_bytes(bytes) {
        Ok(_) => panic!("{what}: accepted"),
        Err(e) => {
            let message = e.to_string();
            assert!(
                message.contains("scene.gltf: "),
                "{what}: no file in `{message}`"
            );
            assert!(
                message.contains(fragment),
                "{what}: `{message}` lacks `{fragment}`"
            );
        }
    }
}

#[test]
fn load_accepts_the_unbroken_file() {
    for bytes in [good().gltf(), good().glb()] {
        let loaded = load_bytes(&bytes).unwrap();
        assert_eq!(loaded.warnings, [""; 0]);
        let parts = &loaded.parts;
        assert_eq!(
            (parts.meshes.len(), parts.lights.len(), parts.cameras.len()),
            (1, 1, 1)
        );
        assert_eq!(parts.meshes[0].positions[3].x, 1.5);
    }
}

#[test]
fn load_refuses_every_invalid_value_by_place() {
    // A line of the table is a JSON pointer, its new value (`null` removes it), and a part of the message.
    let table = include_str!("edits.txt").lines();
    let table: Vec<&str> = table.filter(|line| !line.starts_with('#')).collect();
    assert!(table.len() >= 95);
    for line in table {
        let [pointer, value, fragment] = line.splitn(3, " | ").collect::<Vec<_>>()[..] else {
            panic!("`{line}` has not three parts");
        };
        let mut file = good();
        let value = value.parse().expect("JSON");
        edit(&mut file.json, pointer, value);
        refused(&file.gltf(), fragment, line);
        refused(&file.glb(), fragment, line);
    }
}

#[test]
fn load_refuses_broken_bytes() {
    let poke = |at: usize, bytes: &[u8]| {
        let mut file = good();
        file.bytes[at..at + bytes.len()].copy_from_slice(bytes);
        file.gltf()
    };
    // The first view has 48 bytes of positions; the fifth, after 48 + 48 + 32 + 64 bytes, has indices.
    refused(
        &poke(8, &f32::NAN.to_le_bytes()),
        "POSITION: position 0 is not finite",
        "NaN",
    );
    refused(
        &poke(24, &f32::INFINITY.to_le_bytes()),
        "position 2 is not finite",
        "infinity",
    );
    refused(
        &poke(192, &[4, 0]),
        "primitives[0].indices: index 4 is not below the 4",
        "index",
    );
    refused(
        &poke(192, &[255, 255]),
        "primitives[0].indices: index 65535",
        "restart",
    );
    refused(
        &poke(204, &[3, 0]),
        "accessors[0].sparse.indices: index 3 is out of order",
        "order",
    );
    refused(
        &poke(206, &[4, 0]),
        "accessors[0].sparse.indices: index 4",
        "sparse index",
    );

    let glb = good().glb();
    let word = |at: usize, value: u32| {
        let mut bytes = glb.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        bytes
    };
    refused(
        &glb[..glb.len() - 1],
        "GLB header: truncated",
        "one byte short",
    );
    refused(
        &glb[..10],
        "GLB header: the file ends within it",
        "ten bytes",
    );
    refused(&word(4, 1), "GLB header: version 1", "version");
    refused(
        &word(8, 5),
        "GLB chunk 0: the file ends within its header",
        "length",
    );
    refused(
        &word(12, u32::MAX),
        "GLB chunk 0: its 4294967295 bytes",
        "chunk length",
    );
    refused(&word(16, 0), "GLB chunk 0: is not JSON", "chunk kind");
    let second = 20 + u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    refused(
        &word(second, u32::MAX),
        "GLB chunk 1: its 4294967295 bytes",
        "second chunk",
    );
    refused(
        &word(second + 4, 7),
        "buffers[0]: has no uri",
        "second chunk's kind",
    );
    for (text, fragment) in [
        ("", "JSON: EOF"),
        ("{", "JSON: EOF"),
        ("[]", "JSON"),
        ("\u{0}", "JSON"),
        (
            "{\"asset\":{\"version\":\"2.0\"},\"nodes\":[{\"mesh\":-1}]}",
            "JSON",
        ),
    ] {
        refused(text.as_bytes(), fragment, text);
    }
    // Nesting deeper than any stack, with and without its end.
    let deep = "[".repeat(100_000);
    let text = format!("{{\"asset\":{{\"version\":\"2.0\"}},\"extensions\":{{\"x\":{deep}");
    refused(text.as_bytes(), "JSON: EOF", "deep nesting");
    let text = text + &"]".repeat(100_000) + "}}";
    refused(text.as_bytes(), "JSON: recursion limit", "deep nesting");
}

#[test]
fn load_refuses_external_files_by_name() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("folder")).unwrap();
    std::fs::write(folder.path().join("short.bin"), [0; 10]).unwrap();
    for (uri, fragment) in [
        ("none.bin", "none.bin"),
        (
            "short.bin",
            "buffers[0]: byteLength is 36, but there are 10 bytes",
        ),
        ("folder", "not a regular file"),
        ("/dev/zero", "leaves the scene's folder"),
        ("%2e%2e/x", "leaves the scene's folder"),
        ("file:///etc/passwd", "only relative files"),
        ("https://example.org/a.bin", "only relative files"),
        // An invalid encoding is taken as it stands.
        ("%zz", "%zz: No such file"),
        ("data:,%zz", "without two hexadecimal digits"),
        ("%ff", "not UTF-8"),
        ("data:;base64,?", "bad base64"),
        ("data:;base64", "without a comma"),
        ("", "names no file"),
    ] {
        let mut file = File::triangle();
        file.json["buffers"] = json!([{ "byteLength": 36, "uri": uri }]);
        let error = load_in(folder.path(), "s.gltf", &file.gltf()).unwrap_err();
        let message = error.to_string();
        assert!(
            message.contains(fragment) && message.contains("buffers[0]"),
            "{uri}: {message}"
        );
    }
    let path = folder.path().join("absent.glb");
    let error = opsr::scene::load::load(&path, &Default::default()).unwrap_err();
    assert!(error.to_string().contains("absent.glb"));
    assert!(opsr::scene::load::load(folder.path(), &Default::default()).is_err());
}
