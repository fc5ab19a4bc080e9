//! Loading glTF files: round trips with the writer, and equal scenes from all forms of a file.

pub(crate) mod broken;
mod compressed;
mod extensions;
pub(crate) mod hostile;
mod looks;
mod materials;
mod meshes;
mod motion;

use super::support::gltf::{File, load_bytes, load_in};
use super::support::scenes;
use opsr::math::Vec3;
use opsr::scene::{Mesh, SceneParts};
use opsr_lab::gallery;
use opsr_lab::gallery::glb;
use opsr_lab::gallery::shapes::{self, Placing};
use serde_json::json;
use sha2::{Digest, Sha256};

fn triangles(mesh: &Mesh) -> Vec<[Vec3; 3]> {
    let at = |i: u32| mesh.positions[i as usize];
    mesh.indices.iter().map(|t| t.map(at)).collect()
}

fn close(a: Vec3, b: Vec3) -> bool {
    (a - b).length() <= 1e-6 * (1.0 + a.length())
}

/// The meshes of a round trip are bit-identical, except for normals that were not exactly unit vectors.
fn same_meshes(a: &SceneParts, b: &SceneParts) {
    assert_eq!(a.meshes.len(), b.meshes.len());
    for (a, b) in a.meshes.iter().zip(&b.meshes) {
        assert_eq!(a.positions, b.positions);
        assert_eq!(a.indices, b.indices);
        assert_eq!((&a.uvs, a.material), (&b.uvs, b.material));
        assert_eq!(
            (a.normals.len(), a.tangents.len()),
            (b.normals.len(), b.tangents.len())
        );
        assert!(a.normals.iter().zip(&b.normals).all(|(a, b)| close(*a, *b)));
        let tangents = a.tangents.iter().zip(&b.tangents);
        assert!(tangents.into_iter().all(|(a, b)| a.abs_diff_eq(*b, 1e-6)));
    }
}

fn same_materials(a: &SceneParts, b: &SceneParts) {
    assert_eq!(a.materials.len(), b.materials.len());
    for (a, b) in a.materials.iter().zip(&b.materials) {
        let discrete = |m: &opsr::scene::Material| {
            (
                m.name.clone(),
                m.alpha_mode,
                m.double_sided,
                m.solid,
                m.distribution,
            )
        };
        assert_eq!(discrete(a), discrete(b));
        for (x, y) in [
            (a.base_color, b.base_color),
            (a.emission, b.emission),
            (a.specular_color, b.specular_color),
            (
                Vec3::new(a.opacity, a.metallic, a.alpha),
                Vec3::new(b.opacity, b.metallic, b.alpha),
            ),
            (
                Vec3::new(a.transmission, a.ior, a.specular),
                Vec3::new(b.transmission, b.ior, b.specular),
            ),
        ] {
            assert!(close(x, y), "{}: {x} {y}", a.name);
        }
        let rounding = 1e-6 * a.absorption.max_element();
        assert!((a.absorption - b.absorption).abs().max_element() <= rounding);
    }
}

fn same_cameras(a: &SceneParts, b: &SceneParts) {
    assert_eq!(a.cameras.len(), b.cameras.len());
    for (a, b) in a.cameras.iter().zip(&b.cameras) {
        assert_eq!(
            (&a.name, a.position, a.aspect),
            (&b.name, b.position, b.aspect)
        );
        for film in [[0.0, 0.0], [1.0, 0.3]] {
            let (x, y) = (a.ray(film.into(), 1.5), b.ray(film.into(), 1.5));
            assert!(close(x.dir, y.dir) && close(x.origin, y.origin));
        }
    }
}

#[test]
fn load_returns_what_was_saved() {
    let scenes = [
        gallery::furnace_sphere(0.5),
        gallery::cornell_box(),
        gallery::caustic_box(),
        scenes::point_light_over_plane(),
        gallery::area_light_over_plane(),
        scenes::glass_slab(0.3),
        scenes::two_mirrors(0.9, 0.01),
    ];
    for parts in scenes {
        let bytes = glb::to_glb(&parts).unwrap();
        let loaded = load_bytes(&bytes).unwrap();
        assert_eq!(loaded.warnings, [""; 0]);
        same_meshes(&parts, &loaded.parts);
        same_materials(&parts, &loaded.parts);
        same_cameras(&parts, &loaded.parts);
        assert_eq!(parts.lights.len(), loaded.parts.lights.len());
        // A second round trip causes no further rounding.
        let again = load_bytes(&glb::to_glb(&loaded.parts).unwrap()).unwrap();
        same_meshes(&loaded.parts, &again.parts);
        same_materials(&loaded.parts, &again.parts);
    }
}

#[test]
fn load_returns_a_mesh_of_many_vertices() {
    let mut parts = SceneParts::default();
    let mesh = Mesh {
        tangents: vec![glam::Vec4::new(1.0, 0.0, 0.0, -1.0); 40_962],
        ..shapes::sphere(Vec3::ONE, 2.0, 6)
    };
    assert_eq!(mesh.positions.len(), 40_962);
    parts.add(opsr::scene::Material::default(), [mesh.clone(), mesh]);
    parts.meshes = vec![Mesh::joined(parts.meshes)];
    let loaded = load_bytes(&glb::to_glb(&parts).unwrap()).unwrap();
    same_meshes(&parts, &loaded.parts);
}

#[test]
fn load_gltf_and_glb_give_the_same_scene() {
    let file = File::triangle();
    let (text, binary) = (
        load_bytes(&file.gltf()).unwrap(),
        load_bytes(&file.glb()).unwrap(),
    );
    same_meshes(&text.parts, &binary.parts);
    assert_eq!(text.digest[..], Sha256::digest(file.gltf())[..]);
    assert_eq!(binary.digest[..], Sha256::digest(file.glb())[..]);
    // A primitive without a material gets the default one.
    assert_eq!(text.parts.materials.len(), 1);
    assert_eq!(text.parts.materials[0].metallic, 1.0);
}

#[test]
fn load_hashes_external_files_in_order() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = File::triangle();
    let picture = super::support::gltf::png(&image::DynamicImage::new_rgb8(2, 2));
    let uri = "sub%20folder/bild%C3%A9.png";
    file.push("images", json!({ "uri": "unused.png" }));
    file.push("images", json!({ "uri": uri }));
    let texture = file.push("textures", json!({ "source": 1 }));
    let info = json!({ "baseColorTexture": { "index": texture } });
    file.push("materials", json!({ "pbrMetallicRoughness": info }));
    file.json["buffers"] = json!([{ "byteLength": 36, "uri": "./a/../mesh.bin" }]);
    std::fs::create_dir(folder.path().join("sub folder")).unwrap();
    std::fs::write(folder.path().join("sub folder/bildé.png"), &picture).unwrap();
    std::fs::write(folder.path().join("mesh.bin"), &file.bytes).unwrap();
    let loaded = load_in(folder.path(), "s.gltf", &file.gltf()).unwrap();
    let all = [file.gltf(), file.bytes.clone(), picture].concat();
    assert_eq!(loaded.digest[..], Sha256::digest(all)[..]);
    assert_eq!(loaded.parts.textures.len(), 1);
}

#[test]
fn load_scenes_and_instances() {
    let mut file = File::triangle();
    file.json["nodes"] = json!([
        { "mesh": 0, "translation": [1, 0, 0] },
        { "mesh": 0, "children": [0] },
        { "mesh": 0, "translation": [0, 0, 9] },
    ]);
    let starts = |file: &File| -> Vec<Vec3> {
        file.loaded()
            .parts
            .meshes
            .iter()
            .map(|m| m.positions[0])
            .collect()
    };
    // Without scenes all root nodes are loaded; parents come first.
    let far = Vec3::new(0.0, 0.0, 9.0);
    assert_eq!(starts(&file), [Vec3::ZERO, Vec3::X, far]);
    file.json["scenes"] = json!([{ "nodes": [1] }, { "nodes": [2] }]);
    assert_eq!(starts(&file), [Vec3::ZERO, Vec3::X]);
    file.json["scene"] = json!(1);
    assert_eq!(starts(&file), [far]);
}

#[test]
fn load_warns_once_of_each_ignored_feature() {
    let mut file = File::triangle();
    file.json["extensionsUsed"] = json!(["EXT_sleep", "EXT_dream", "KHR_materials_ior"]);
    file.json["animations"] = json!([]);
    file.push(
        "meshes",
        json!({ "primitives": [{ "mode": 0, "attributes": { "POSITION": 0 } }] }),
    );
    file.push("nodes", json!({ "mesh": 1 }));
    file.push("nodes", json!({ "mesh": 1 }));
    let warnings = file.loaded().warnings;
    let about = [
        "2 extensions: not supported and ignored: EXT_sleep, EXT_dream",
        "points and lines",
    ];
    assert_eq!(warnings.len(), about.len(), "{warnings:?}");
    for word in about {
        assert_eq!(
            warnings.iter().filter(|w| w.contains(word)).count(),
            1,
            "{word}"
        );
    }
}
