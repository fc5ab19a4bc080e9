//! Constructs glTF files for tests of the loader.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use opsr::files::FileError;
use opsr::scene::load::{LoadOptions, Loaded, load};
use serde_json::{Value, json};
use std::path::Path;

/// A file under construction: its JSON without `buffers`, and the one buffer.
#[derive(Clone)]
pub(crate) struct File {
    pub(crate) json: Value,
    pub(crate) bytes: Vec<u8>,
}

/// Little-endian bytes of floats.
pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// Little-endian bytes of shorts.
pub(crate) fn shorts(values: &[u16]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

/// Number of components of an accessor type.
fn width(kind: &str) -> usize {
    match kind {
        "SCALAR" => 1,
        "VEC2" => 2,
        "VEC3" => 3,
        _ => 4,
    }
}

impl File {
    /// An empty file.
    pub(crate) fn new() -> Self {
        let json = json!({ "asset": { "version": "2.0" } });
        Self {
            json,
            bytes: Vec::new(),
        }
    }

    /// Parses a valid `.glb` file.
    pub(crate) fn from_glb(glb: &[u8]) -> Self {
        let length = u32::from_le_bytes(glb[12..16].try_into().expect("four bytes")) as usize;
        let mut json: Value = serde_json::from_slice(&glb[20..20 + length]).expect("JSON");
        json.as_object_mut().expect("an object").remove("buffers");
        let bytes = glb[28 + length..].to_vec();
        Self { json, bytes }
    }

    /// A file with one mesh of one primitive, on one node.
    pub(crate) fn of(make: impl FnOnce(&mut Self) -> Value) -> Self {
        let mut file = Self::new();
        let primitive = make(&mut file);
        file.push("meshes", json!({ "primitives": [primitive] }));
        file.push("nodes", json!({ "mesh": 0 }));
        file
    }

    /// One triangle in the plane z = 0, facing +z.
    pub(crate) fn triangle() -> Self {
        Self::of(|file| {
            let p = file.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
            json!({ "attributes": { "POSITION": p } })
        })
    }

    /// Appends to a list and returns the index.
    pub(crate) fn push(&mut self, list: &str, value: Value) -> usize {
        let entry = &mut self.json[list];
        if entry.is_null() {
            *entry = json!([]);
        }
        let list = entry.as_array_mut().expect("a list");
        list.push(value);
        list.len() - 1
    }

    /// Appends bytes as a buffer view.
    pub(crate) fn view(&mut self, bytes: &[u8]) -> usize {
        let view =
            json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len() });
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.push("bufferViews", view)
    }

    /// Appends an accessor of floats with a view of its own.
    pub(crate) fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let view = self.view(&floats(values));
        let count = values.len() / width(kind);
        let accessor =
            json!({ "bufferView": view, "componentType": 5126, "count": count, "type": kind });
        self.push("accessors", accessor)
    }

    /// Appends an accessor of 16-bit indices.
    pub(crate) fn indices(&mut self, values: &[u16]) -> usize {
        let view = self.view(&shorts(values));
        let accessor = json!({ "bufferView": view, "componentType": 5123, "count": values.len(), "type": "SCALAR" });
        self.push("accessors", accessor)
    }

    /// Appends an image in the buffer, and a texture that uses it.
    pub(crate) fn texture(&mut self, picture: &image::DynamicImage) -> usize {
        let view = self.view(&png(picture));
        let image = self.push(
            "images",
            json!({ "bufferView": view, "mimeType": "image/png" }),
        );
        self.push("textures", json!({ "source": image }))
    }

    /// The only primitive.
    pub(crate) fn primitive(&mut self) -> &mut Value {
        &mut self.json["meshes"][0]["primitives"][0]
    }

    /// As `.gltf`, the buffer as a data URI.
    pub(crate) fn gltf(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        let uri = format!(
            "data:application/octet-stream;base64,{}",
            STANDARD.encode(&self.bytes)
        );
        if json["buffers"].is_null() {
            json["buffers"] = json!([{ "byteLength": self.bytes.len(), "uri": uri }]);
        }
        json.to_string().into_bytes()
    }

    /// As `.glb`.
    pub(crate) fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let total = 28 + text.len() + self.bytes.len();
        let mut out = b"glTF".to_vec();
        for word in [2, total as u32, text.len() as u32] {
            out.extend(word.to_le_bytes());
        }
        out.extend(b"JSON");
        out.extend(text);
        out.extend((self.bytes.len() as u32).to_le_bytes());
        out.extend(b"BIN\0");
        out.extend(&self.bytes);
        out
    }

    pub(crate) fn load(&self) -> Result<Loaded, FileError> {
        load_bytes(&self.gltf())
    }

    /// Loads the file; panics on an error.
    pub(crate) fn loaded(&self) -> Loaded {
        self.load().unwrap_or_else(|e| panic!("{e}"))
    }
}

/// The bytes of a PNG file.
pub(crate) fn png(picture: &image::DynamicImage) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let format = image::ImageFormat::Png;
    picture.write_to(&mut out, format).expect("a PNG");
    out.into_inner()
}

/// The checksum of PNG chunks.
pub(crate) fn crc32(bytes: &[u8]) -> u32 {
    let step = |c: u32| c >> 1 ^ if c & 1 == 1 { 0xedb8_8320 } else { 0 };
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |c, _| step(c))
    })
}

/// Loads a file without other files beside it.
pub(crate) fn load_bytes(bytes: &[u8]) -> Result<Loaded, FileError> {
    let folder = tempfile::tempdir().expect("a folder");
    load_in(folder.path(), "scene.gltf", bytes)
}

/// Writes a file into a folder and loads it.
pub(crate) fn load_in(folder: &Path, name: &str, bytes: &[u8]) -> Result<Loaded, FileError> {
    let path = folder.join(name);
    std::fs::write(&path, bytes).expect("a file");
    load(&path, &LoadOptions::default())
}

/// A file with a grid of triangles, and two materials, the second of which emits.
pub(crate) fn grid(edge: u16) -> File {
    let mut file = File::of(|file| {
        let at = |i: u16| f32::from(i) / f32::from(edge);
        let corners = (0..=edge).flat_map(|y| (0..=edge).map(move |x| [at(x), 0.0, at(y)]));
        let positions: Vec<f32> = corners.flatten().collect();
        let index = |x: u16, y: u16| y * (edge + 1) + x;
        let faces = (0..edge).flat_map(|y| {
            (0..edge).flat_map(move |x| {
                let [a, b, c, d] =
                    [(x, y), (x, y + 1), (x + 1, y + 1), (x + 1, y)].map(|(x, y)| index(x, y));
                [a, b, c, a, c, d]
            })
        });
        let faces: Vec<u16> = faces.collect();
        json!({ "attributes": { "POSITION": file.floats("VEC3", &positions) }, "indices": file.indices(&faces), "material": 0 })
    });
    file.json["materials"] = json!([{}, { "emissiveFactor": [1, 1, 1] }]);
    file.json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    file
}

/// Puts this many instances of mesh 0 on a node.
pub(crate) fn spread(file: &mut File, count: usize) {
    let places: Vec<f32> = (0..count)
        .flat_map(|i| [(i % 100) as f32, 0.0, (i / 100) as f32])
        .collect();
    let places = file.floats("VEC3", &places);
    let extension =
        json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": places } } });
    file.json["nodes"][0]["extensions"] = extension;
}
