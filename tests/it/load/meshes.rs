//! Every form of a mesh gives the same mesh, and transforms keep its front outward.

use super::{close, triangles};
use crate::support::gltf::{File, floats, shorts};
use opsr::math::Vec3;
use opsr::scene::{Mesh, SceneParts};
use opsr_lab::gallery::glb;
use opsr_lab::gallery::shapes;
use serde_json::{Value, json};

const SQUARE: [f32; 12] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];

/// Signed volume by the divergence theorem.
fn volume(mesh: &Mesh) -> f32 {
    let parts = triangles(mesh).into_iter();
    parts.map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// The unit square in several topologies; each gives the same two triangles.
#[test]
fn load_mesh_topologies() {
    let strip = |file: &mut File| {
        let p = file.floats("VEC3", &SQUARE);
        json!({ "attributes": { "POSITION": p }, "mode": 5 })
    };
    let indexed = |file: &mut File| {
        let p = file.floats("VEC3", &SQUARE);
        let i = file.indices(&[0, 1, 2, 2, 1, 3]);
        json!({ "attributes": { "POSITION": p }, "indices": i })
    };
    let fan = |file: &mut File| {
        let p = file.floats("VEC3", &SQUARE);
        let i = file.indices(&[2, 0, 1, 3]);
        json!({ "attributes": { "POSITION": p }, "indices": i, "mode": 6 })
    };
    // A strip with a repeated vertex, and 8-bit indices.
    let stitched = |file: &mut File| {
        let p = file.floats("VEC3", &SQUARE);
        let view = file.view(&[0, 1, 2, 3, 3]);
        let i = file.push(
            "accessors",
            json!({ "bufferView": view, "componentType": 5121, "count": 5, "type": "SCALAR" }),
        );
        json!({ "attributes": { "POSITION": p }, "indices": i, "mode": 5 })
    };
    let list = |file: &mut File| {
        let corners = [0, 1, 2, 2, 1, 3].map(|i: usize| &SQUARE[3 * i..3 * i + 3]);
        let p = file.floats("VEC3", &corners.concat());
        json!({ "attributes": { "POSITION": p } })
    };
    let makers: [&dyn Fn(&mut File) -> Value; 5] = [&strip, &indexed, &fan, &stitched, &list];
    for (i, make) in makers.into_iter().enumerate() {
        let parts = File::of(make).loaded().parts;
        let [mesh] = &parts.meshes[..] else {
            panic!("one mesh")
        };
        assert!(mesh.normals.is_empty() && mesh.uvs.is_empty());
        let found = triangles(mesh);
        assert_eq!(found.len(), 2, "form {i}");
        let mut area = 0.0;
        for [a, b, c] in found {
            let twice = (b - a).cross(c - a);
            assert!(twice.z > 0.0, "form {i}: faces away");
            area += 0.5 * twice.z;
        }
        assert_eq!(area, 1.0, "form {i}");
    }
    let mut points = File::of(strip);
    points.primitive()["mode"] = json!(0);
    let loaded = points.loaded();
    assert!(loaded.parts.meshes.is_empty() && loaded.warnings[0].contains("points"));
}

#[test]
fn load_interleaved_attributes() {
    let file = File::of(|file| {
        let vertex = |x: f32, y: f32| [x, y, 0.0, 0.0, 0.0, 1.0, x, 1.0 - y];
        let data = [vertex(0.0, 0.0), vertex(1.0, 0.0), vertex(0.0, 1.0)].concat();
        let view = file.view(&floats(&data));
        file.json["bufferViews"][view]["byteStride"] = json!(32);
        let mut part = |offset: usize, kind: &str| {
            file.push("accessors", json!({ "bufferView": view, "byteOffset": offset, "componentType": 5126, "count": 3, "type": kind }))
        };
        let (p, n, t) = (part(0, "VEC3"), part(12, "VEC3"), part(24, "VEC2"));
        json!({ "attributes": { "POSITION": p, "NORMAL": n, "TEXCOORD_0": t } })
    });
    let mesh = &file.loaded().parts.meshes[0];
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(mesh.normals, [Vec3::Z; 3]);
    assert_eq!(mesh.uvs[2], glam::Vec2::new(0.0, 0.0));
    assert_eq!(mesh.uvs[1], glam::Vec2::ONE);
}

#[test]
fn load_sparse_accessors() {
    for backed in [true, false] {
        let mut file = File::triangle();
        let indices = file.view(&shorts(&[0, 2]));
        let values = file.view(&floats(&[5.0, 6.0, 7.0, 0.0, 9.0, 0.0]));
        file.json["accessors"][0]["sparse"] = json!({
            "count": 2,
            "indices": { "bufferView": indices, "componentType": 5123 },
            "values": { "bufferView": values },
        });
        let mut middle = Vec3::X;
        if !backed {
            file.json["accessors"][0]
                .as_object_mut()
                .unwrap()
                .remove("bufferView");
            middle = Vec3::ZERO;
        }
        let expected = [Vec3::new(5.0, 6.0, 7.0), middle, Vec3::new(0.0, 9.0, 0.0)];
        assert_eq!(file.loaded().parts.meshes[0].positions, expected);
    }
}

#[test]
fn load_quantised_attributes() {
    let mut file = File::of(|file| {
        let mut part = |bytes: &[u8], component: u32, kind: &str, normalised: bool, stride: u32| {
            let view = file.view(bytes);
            file.json["bufferViews"][view]["byteStride"] = json!(stride);
            file.push("accessors", json!({ "bufferView": view, "componentType": component, "count": 3, "type": kind, "normalized": normalised }))
        };
        let p = part(
            &shorts(&[0, 0, 0, 0, 65535, 0, 0, 0, 0, 65535, 0, 0]),
            5123,
            "VEC3",
            true,
            8,
        );
        let n = part(
            &[0, 0, 127, 0, 0, 0, 100, 0, 0, 90, 90, 0],
            5120,
            "VEC3",
            true,
            4,
        );
        let t = part(&shorts(&[0, 4096, 1, 2, 3, 4]), 5123, "VEC2", false, 4);
        json!({ "attributes": { "POSITION": p, "NORMAL": n, "TEXCOORD_0": t } })
    });
    file.json["extensionsUsed"] = json!(["KHR_mesh_quantization"]);
    file.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    file.json["nodes"][0]["scale"] = json!([2, 2, 2]);
    let loaded = file.loaded();
    assert!(loaded.warnings.is_empty());
    let mesh = &loaded.parts.meshes[0];
    assert_eq!(mesh.positions, [Vec3::ZERO, 2.0 * Vec3::X, 2.0 * Vec3::Y]);
    assert_eq!(mesh.normals[..2], [Vec3::Z; 2]);
    assert!(close(
        mesh.normals[2],
        Vec3::new(0.0, 0.5f32.sqrt(), 0.5f32.sqrt())
    ));
    assert_eq!(mesh.uvs[0], glam::Vec2::new(0.0, 4096.0));
}

/// A closed ball on a node with a parent; the loaded mesh must be closed and face outward.
fn ball(outer: Value, inner: Value) -> Mesh {
    let ball = shapes::sphere(Vec3::new(0.2, 0.0, 0.1), 1.0, 2);
    let mut parts = SceneParts::default();
    parts.add(opsr::scene::Material::default(), [ball]);
    let bytes = glb::to_glb(&parts).unwrap();
    let mut file = File::from_glb(&bytes);
    file.json["nodes"] = json!([outer, inner]);
    file.json["nodes"][0]["children"] = json!([1]);
    file.json["nodes"][1]["mesh"] = json!(0);
    file.json["scenes"][0]["nodes"] = json!([0]);
    file.loaded().parts.meshes.remove(0)
}

#[test]
fn load_node_transforms_keep_the_winding() {
    let plain = volume(&ball(json!({}), json!({})));
    let turn = json!([0.5, 0.5, -0.5, 0.5]);
    let poses = [
        (json!({ "scale": [-1, 1, 1] }), json!({}), 1.0),
        (
            json!({ "scale": [-1, -1, -1] }),
            json!({ "translation": [3, 4, 5] }),
            1.0,
        ),
        (json!({ "scale": [-2, -1, 1] }), json!({}), 2.0),
        (
            json!({ "scale": [1, -3, 0.5] }),
            json!({ "rotation": turn, "scale": [-1, 1, 1] }),
            1.5,
        ),
        (
            json!({ "scale": [1, -3, 0.5], "rotation": turn }),
            json!({ "scale": [2, 1, 1] }),
            3.0,
        ),
        (
            json!({ "matrix": [0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 7, 8, 9, 1] }),
            json!({}),
            1.0,
        ),
    ];
    for (outer, inner, factor) in poses {
        let mesh = ball(outer.clone(), inner);
        assert!(
            (volume(&mesh) / plain - factor).abs() < 1e-3,
            "{outer}: {}",
            volume(&mesh) / plain
        );
        for &[a, b, c] in &mesh.indices {
            let p = |i: u32| mesh.positions[i as usize];
            let ng = (p(b) - p(a)).cross(p(c) - p(a));
            for n in [a, b, c].map(|i| mesh.normals[i as usize]) {
                assert!(
                    (n.length() - 1.0).abs() < 1e-5 && n.dot(ng) > 0.0,
                    "{outer}"
                );
            }
        }
    }
    // A ball with scale 0 along z still has the normals of a disc.
    let flat = ball(json!({ "scale": [1, 1, 0] }), json!({}));
    assert!(
        flat.normals
            .iter()
            .all(|n| n.z.abs() == 1.0 || *n == Vec3::ZERO)
    );
}

#[test]
fn load_matrix_and_trs_transforms_agree() {
    // 90° about y, then scaled by 2, then translated.
    let h = 0.5f64.sqrt();
    let parts = json!({ "rotation": [0, h, 0, h], "scale": [2, 2, 2], "translation": [1, 2, 3] });
    let matrix = json!({ "matrix": [0, 0, -2, 0, 0, 2, 0, 0, 2, 0, 0, 0, 1, 2, 3, 1] });
    let (a, b) = (ball(parts, json!({})), ball(matrix, json!({})));
    let pairs = a.positions.iter().zip(&b.positions);
    assert!(pairs.into_iter().all(|(a, b)| close(*a, *b)));
    let pairs = a.normals.iter().zip(&b.normals);
    assert!(pairs.into_iter().all(|(a, b)| close(*a, *b)));
}

#[test]
fn load_tangents_keep_their_handedness() {
    let mut file = File::of(|file| {
        let p = file.floats("VEC3", &SQUARE[..9]);
        let n = file.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
        let t = file.floats("VEC4", &[1.0, 0.0, 0.0, 1.0].repeat(3));
        json!({ "attributes": { "POSITION": p, "NORMAL": n, "TANGENT": t } })
    });
    file.json["nodes"][0]["scale"] = json!([1, -2, 1]);
    let mesh = &file.loaded().parts.meshes[0];
    // The bitangent n × t · w is transformed as y is.
    let bitangent = mesh.normals[0].cross(mesh.tangents[0].truncate()) * mesh.tangents[0].w;
    assert!(close(bitangent, Vec3::NEG_Y) && close(mesh.normals[0], Vec3::Z));
}

/// An accessor with neither buffer view nor overrides is all zeros; exporters write unused shape keys so.
#[test]
fn load_accessors_without_bytes_as_zeros() {
    let mut file = File::triangle();
    let still = file.push(
        "accessors",
        json!({ "componentType": 5126, "count": 3, "type": "VEC3" }),
    );
    let moved = file.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    file.primitive()["targets"] = json!([{ "POSITION": still }, { "POSITION": moved }]);
    file.json["meshes"][0]["weights"] = json!([1, 0.5]);
    let mesh = &file.loaded().parts.meshes[0];
    assert!(
        mesh.positions.iter().all(|p| p.z == 0.5),
        "{:?}",
        mesh.positions
    );
}
