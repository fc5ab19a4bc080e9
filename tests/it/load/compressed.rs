//! Compressed glTF files against the reference decoders: Google's (Draco) and meshoptimizer's own. The files of
//! `tests/data/compressed` are a bumpy shell over a ground, with a texture, colours and an animation. Writers:
//! gltf-transform 4.5.1 (`draco`, `sequential`), gltfpack 1.0 (`ext`, `khr` with every filter, `fallback`), Basis
//! Universal (`.ktx2`).

use super::broken::refused;
use crate::support::gltf::File;
use crate::support::root;
use opsr::scene::Texels;
use opsr::scene::load::{LoadOptions, Loaded, load};
use serde_json::{Value, json};

fn data(name: &str) -> Vec<u8> {
    std::fs::read(root().join("tests/data/compressed").join(name)).expect("a file")
}

fn loaded(glb: &[u8], time: Option<f64>) -> Result<Loaded, String> {
    let folder = crate::support::quick_folder();
    let path = folder.path().join("a.glb");
    std::fs::write(&path, glb).expect("a file");
    let options = LoadOptions {
        time,
        ..opsr_formats::options()
    };
    load(&path, &options).map_err(|e| e.to_string())
}

fn error(file: &File) -> String {
    loaded(&file.glb(), None).expect_err("an error")
}

/// Asserts that two files give bit-identical meshes at a moment of their animations.
fn same(a: &[u8], b: &[u8]) {
    let [a, b] = [a, b].map(|glb| {
        loaded(glb, Some(0.7))
            .unwrap_or_else(|e| panic!("{e}"))
            .parts
    });
    assert_eq!(a.meshes.len(), 2);
    assert_eq!(a.meshes.len(), b.meshes.len());
    for (a, b) in a.meshes.iter().zip(&b.meshes) {
        assert!(a.indices.len() >= 50);
        assert_eq!(a.indices, b.indices, "{}", a.name);
        assert_eq!(a.positions, b.positions, "{}", a.name);
        assert_eq!(a.normals, b.normals, "{}", a.name);
        assert_eq!(a.tangents, b.tangents, "{}", a.name);
        assert_eq!(a.uvs, b.uvs, "{}", a.name);
        assert_eq!(a.colors, b.colors, "{}", a.name);
    }
    assert!(!a.meshes[0].normals.is_empty() && !a.meshes[0].uvs.is_empty());
    assert!(!a.meshes[0].colors.is_empty());
}

#[test]
fn compressed_meshes_are_those_of_the_reference_decoders() {
    for name in ["draco", "sequential", "ext", "khr"] {
        same(
            &data(&format!("{name}.glb")),
            &data(&format!("{name}_plain.glb")),
        );
    }
    // The external file of its fallback does not exist.
    same(&data("fallback.glb"), &data("ext_plain.glb"));
}

/// A `.glb` file of the data with changed JSON.
fn changed(name: &str, change: impl FnOnce(&mut Value)) -> File {
    let mut file = File::from_glb(&data(name));
    // The file is written with one buffer, which contains the views of the placeholder.
    for view in file.json["bufferViews"].as_array_mut().expect("views") {
        view["buffer"] = json!(0);
    }
    change(&mut file.json);
    file
}

/// The Draco extension of the first primitive.
fn draco(json: &mut Value) -> &mut Value {
    &mut json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]
}

#[test]
fn draco_faults_name_their_place() {
    let at = "meshes[0].primitives[0].extensions.KHR_draco_mesh_compression";
    type Change = fn(&mut Value);
    let cases: [(Change, &str); 7] = [
        (
            |j| {
                let accessors = j["accessors"].as_array_mut().expect("a list");
                accessors
                    .iter_mut()
                    .for_each(|a| a["count"] = json!(u64::MAX >> 1));
            },
            "more than 67108864 points or faces",
        ),
        (
            |j| draco(j)["bufferView"] = json!(99),
            "bufferViews[99] does not exist",
        ),
        (
            |j| draco(j)["bufferView"] = json!(-1),
            "`bufferView` is -1, no whole number",
        ),
        (
            |j| draco(j)["attributes"]["NORMAL"] = json!(17),
            "NORMAL: the stream has no attribute 17",
        ),
        (
            |j| draco(j)["attributes"]["POSITION"] = json!(3),
            "POSITION: the stream's attribute 3 is of another shape",
        ),
        (
            |j| j["meshes"][0]["primitives"][0]["mode"] = json!(1),
            "only triangles and strips",
        ),
        (|j| *draco(j) = json!(7), "is no object"),
    ];
    for (change, words) in cases {
        let message = error(&changed("draco.glb", change));
        assert!(message.contains(at) && message.contains(words), "{message}");
    }
    let mut file = File::from_glb(&data("draco.glb"));
    let view = draco(&mut file.json)["bufferView"]
        .as_u64()
        .expect("a view") as usize;
    let start = file.json["bufferViews"][view]["byteOffset"]
        .as_u64()
        .unwrap_or(0) as usize;
    file.bytes[start..start + 5].copy_from_slice(b"DRACU");
    let message = error(&file);
    assert!(
        message.contains(at) && message.contains("cannot be decoded"),
        "{message}"
    );
}

#[test]
fn draco_streams_do_not_mix_where_primitives_share_accessors() {
    // The ground's primitive refers to the shell's positions, as in files with equal placeholders.
    let file = changed("draco.glb", |json| {
        let shared = json["meshes"][0]["primitives"][0]["attributes"]["POSITION"].clone();
        json["meshes"][1]["primitives"][0]["attributes"]["POSITION"] = shared;
    });
    same(&file.glb(), &data("draco_plain.glb"));
}

/// Primitives with one stream and different materials share accessors.
#[test]
fn draco_streams_are_shared_where_materials_differ() {
    let file = changed("draco.glb", |json| {
        let mut again = json["meshes"][0]["primitives"][0].clone();
        again["material"] = json!(1);
        json["meshes"][0]["primitives"]
            .as_array_mut()
            .expect("a list")
            .push(again);
    });
    let parts = loaded(&file.glb(), None)
        .unwrap_or_else(|e| panic!("{e}"))
        .parts;
    let [first, second, _] = &parts.meshes[..] else {
        panic!("three meshes");
    };
    assert_eq!(first.positions, second.positions);
    assert_eq!((&first.indices, first.material), (&second.indices, 0));
    assert_eq!(second.material, 1);
}

/// The meshopt extension of the first compressed view, which has index 1.
fn view(json: &mut Value) -> &mut Value {
    &mut json["bufferViews"][1]["extensions"]["EXT_meshopt_compression"]
}

#[test]
fn meshopt_faults_name_their_place() {
    let at = "bufferViews[1].extensions.EXT_meshopt_compression";
    type Change = fn(&mut Value);
    let cases: [(Change, &str); 8] = [
        (
            |j| view(j)["count"] = json!(188),
            "1504 bytes of a view of 1512",
        ),
        (
            |j| view(j)["byteLength"] = json!(1),
            "the compressed bytes are damaged",
        ),
        (
            |j| view(j)["byteLength"] = json!(1 << 20),
            "pass the end of their buffer",
        ),
        (|j| view(j)["mode"] = json!("TRIANGLES"), "mode `TRIANGLES`"),
        (
            |j| view(j)["filter"] = json!("SEPIA"),
            "filter `SEPIA` of 8 bytes",
        ),
        (|j| view(j)["byteStride"] = json!(0), "elements of 0 bytes"),
        (
            |j| view(j)["count"] = json!(1u64 << 40),
            "1099511627776 elements",
        ),
        (
            |j| view(j)["buffer"] = json!(5),
            "pass the end of their buffer",
        ),
    ];
    for (change, words) in cases {
        let message = error(&changed("ext.glb", change));
        assert!(message.contains(at) && message.contains(words), "{message}");
    }
}

#[test]
fn ktx2_textures_are_near_their_pictures() {
    // Least peak signal to noise in decibels: ETC1S has one colour per block, UASTC nearly all colours.
    for (name, picture, least) in [
        ("etc1s", "color", 27.0),
        ("etc1s_alpha", "color_alpha", 27.0),
        ("uastc", "color", 40.0),
        ("uastc_zstd", "color", 38.0),
    ] {
        let file = textured(&data(&format!("{name}.ktx2")));
        let parts = loaded(&file.glb(), None)
            .unwrap_or_else(|e| panic!("{name}: {e}"))
            .parts;
        let texture = &parts.textures[0];
        let png = data(&format!("{picture}.png"));
        let png = image::load_from_memory(&png).expect("a picture").to_rgba8();
        assert_eq!(
            (texture.width, texture.height, texture.channels),
            (48, 32, 4)
        );
        let Texels::Byte(texels) = &texture.texels else {
            panic!("8 bits");
        };
        let squares = texels.iter().zip(png.as_raw());
        let squares = squares.map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2));
        let mean = squares.sum::<f64>() / texels.len() as f64;
        let decibels = 10.0 * (255.0 * 255.0 / mean).log10();
        assert!(decibels > least, "{name}: {decibels:.1} dB");
    }
}

/// A file with a texture of these bytes, and the PNG that the extension replaces.
fn textured(ktx: &[u8]) -> File {
    let mut file = File::triangle();
    let (png, ktx) = (file.view(&data("color_alpha.png")), file.view(ktx));
    file.push("images", json!({ "bufferView": png }));
    file.push("images", json!({ "bufferView": ktx }));
    let extensions = json!({ "KHR_texture_basisu": { "source": 1 } });
    file.push("textures", json!({ "source": 0, "extensions": extensions }));
    let info = json!({ "baseColorTexture": { "index": 0 } });
    file.push("materials", json!({ "pbrMetallicRoughness": info }));
    file.json["extensionsUsed"] = json!(["KHR_texture_basisu"]);
    file
}

#[test]
fn ktx2_faults_name_their_image() {
    let zstd = data("uastc_zstd.ktx2");
    let with = |at: usize, word: u32| {
        let mut bytes = zstd.clone();
        bytes[at..at + 4].copy_from_slice(&word.to_le_bytes());
        bytes
    };
    let (start, length) = (zstd[80..84].try_into(), zstd.len() as u32);
    let start = u32::from_le_bytes(start.expect("four bytes")) as usize;
    for (bytes, words) in [
        (with(20, 1 << 20), "1048576 x 32 texels"),
        (with(28, 3), "no picture in two dimensions"),
        (with(36, 6), "no picture in two dimensions"),
        (with(44, 3), "supercompression 3"),
        (with(84, 1), "do not fit its size"),
        (with(88, length), "pass the end of the file"),
        (with(100, 1 << 6), "do not fit its size"),
        (with(12, 97), "no Basis Universal"),
        // The magic number of Zstandard.
        (with(start, 0), "cannot be decoded"),
        (zstd[..zstd.len() / 2].to_vec(), "pass the end of the file"),
    ] {
        let message = error(&textured(&bytes));
        assert!(
            message.contains("images[1]: KTX2: ") && message.contains(words),
            "{message}"
        );
    }
    // Without the decoder the PNG for other programs is shown.
    assert_eq!(textured(&zstd).loaded().parts.textures[0].channels, 4);
    let mut file = textured(&zstd);
    file.json["extensionsRequired"] = json!(["KHR_texture_basisu"]);
    let words = "KHR_texture_basisu is not supported; the crate opsr-formats has decoders";
    refused(&file.gltf(), words, "no decoder");
}
