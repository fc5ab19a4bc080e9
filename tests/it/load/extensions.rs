//! Extensions: the table in the documentation, refusals with a remedy, WebP.

use super::broken::refused;
use crate::support::gltf::File;
use opsr::scene::Texels;
use opsr::scene::load::SUPPORTED;
use serde_json::json;

#[test]
fn extensions_of_the_documents_are_those_of_the_loader() {
    let rows = include_str!("../../../docs/gltf.md").lines();
    let rows = rows.take_while(|row| *row != "## Animation");
    let listed: Vec<&str> = rows
        .filter_map(|row| {
            let mut cells = row.strip_prefix("| `")?.split(" | ");
            let name = cells.next()?.trim_end_matches('`');
            let state = cells.next()?;
            let reads = ["supported", "approximated"].contains(&state);
            assert!(reads || ["ignored", "refused"].contains(&state), "{row}");
            reads.then_some(name)
        })
        .collect();
    let codecs = opsr_formats::FORMATS.codecs.iter();
    let mut all: Vec<&str> = (codecs.map(|codec| codec.extension))
        .chain(SUPPORTED)
        .collect();
    all.sort_unstable();
    assert_eq!(listed, all);
}

#[test]
fn extensions_required_are_refused_all_at_once() {
    let decoders = "; the crate opsr-formats has decoders of compressed files";
    for (required, fragment) in [
        (
            json!(["EXT_a", "KHR_b", "KHR_materials_ior"]),
            "extensionsRequired: EXT_a, KHR_b are not supported".to_owned(),
        ),
        (
            json!(["KHR_draco_mesh_compression"]),
            format!("KHR_draco_mesh_compression is not supported{decoders}"),
        ),
        (
            json!(["EXT_x", "KHR_texture_basisu", "KHR_mesh_quantization"]),
            format!("EXT_x, KHR_texture_basisu are not supported{decoders}"),
        ),
    ] {
        let mut file = File::triangle();
        file.json["extensionsUsed"] = required.clone();
        file.json["extensionsRequired"] = required;
        refused(&file.gltf(), &fragment, &fragment);
    }
}

/// A file whose only material has its base colour from a texture with this description.
fn textured(image: &[u8], texture: serde_json::Value) -> File {
    let mut file = File::triangle();
    let view = file.view(image);
    file.push("images", json!({ "bufferView": view }));
    file.push("textures", texture);
    let info = json!({ "baseColorTexture": { "index": 0 } });
    file.push("materials", json!({ "pbrMetallicRoughness": info }));
    file
}

#[test]
fn webp_textures_are_read_in_place_of_the_source() {
    let picture = image::RgbaImage::from_fn(5, 3, |x, y| {
        image::Rgba([40 * x as u8, 70 * y as u8, 9, 200])
    });
    let mut webp = std::io::Cursor::new(Vec::new());
    (picture.write_to(&mut webp, image::ImageFormat::WebP)).expect("a picture");
    let extension = json!({ "extensions": { "EXT_texture_webp": { "source": 0 } } });
    let mut file = textured(webp.get_ref(), extension.clone());
    file.json["extensionsUsed"] = json!(["EXT_texture_webp"]);
    file.json["extensionsRequired"] = json!(["EXT_texture_webp"]);
    let texture = &file.loaded().parts.textures[0];
    assert_eq!((texture.width, texture.height), (5, 3));
    assert_eq!(texture.channels, 4);
    assert_eq!(texture.texels, Texels::Byte(picture.as_raw()[..].into()));
    let short = &webp.get_ref()[..webp.get_ref().len() / 2];
    let file = textured(short, extension);
    refused(&file.gltf(), "images[0]: cannot be decoded", "half a WebP");
    let wrong = json!({ "extensions": { "EXT_texture_webp": { "source": 7 } } });
    let file = textured(webp.get_ref(), wrong);
    refused(&file.gltf(), "textures[0].source: is missing", "no image");
}
