//! Films and pictures into EXR files.

use std::io;
use std::path::Path;

use ::exr::prelude as exrs;
use exrs::WritableImage;

use super::{Layer, METADATA, Metadata, join, problem, unsupported};
use crate::files::{self, FileError, Problem};
use crate::image::Buffer;
use crate::image::film::{Film, Window};
use crate::math::UVec2;

/// Writes a film: the picture, `sample_variance`, `variance_of_mean`, `spp`, and the layers given.
pub fn write_film(
    path: &Path,
    film: &Film,
    layers: &[Layer],
    metadata: &Metadata,
) -> Result<(), FileError> {
    let mut all = vec![
        Layer::rgb("sample_variance", &film.sample_variance()),
        Layer::rgb("variance_of_mean", &film.variance_of_mean()),
        Layer::scalar("spp", film.pixels.iter().map(|m| m.n as f32).collect()),
    ];
    all.extend_from_slice(layers);
    let part = (film.size, film.window);
    let bytes = encoded(part, &film.mean(), &all, metadata).map_err(|e| e.at(path))?;
    files::write_bytes(path, bytes)
}

/// Writes a picture of a part of a frame, and the layers given.
pub fn write_layers(
    path: &Path,
    part: (UVec2, Window),
    picture: &Buffer,
    layers: &[Layer],
    metadata: &Metadata,
) -> Result<(), FileError> {
    let bytes = encoded(part, picture, layers, metadata).map_err(|e| e.at(path))?;
    files::write_bytes(path, bytes)
}

/// Writes a picture alone.
pub fn write_rgb(path: &Path, picture: &Buffer, metadata: &Metadata) -> Result<(), FileError> {
    let size = UVec2::new(picture.width as u32, picture.height as u32);
    let part = (size, Window::full(size));
    let bytes = encoded(part, picture, &[], metadata).map_err(|e| e.at(path))?;
    files::write_bytes(path, bytes)
}

/// The bytes of a file; frame and window come first.
fn encoded(
    (size, window): (UVec2, Window),
    picture: &Buffer,
    layers: &[Layer],
    metadata: &Metadata,
) -> Result<Vec<u8>, Problem> {
    let main = Layer::rgb("", picture);
    let mut list = Vec::new();
    for layer in std::iter::once(&main).chain(layers) {
        for (channel, values) in &layer.channels {
            if values.len() != window.len() {
                return Err(Problem::content(format!(
                    "layer '{}' has {} values, the picture {} pixels",
                    layer.name,
                    values.len(),
                    window.len()
                )));
            }
            let name = text(&join(&layer.name, channel))?;
            list.push(exrs::AnyChannel::new(
                name,
                exrs::FlatSamples::F32(values.clone()),
            ));
        }
    }

    let mut attributes = exrs::LayerAttributes {
        layer_position: exrs::Vec2(window.x as i32, window.y as i32),
        software_name: exrs::Text::new_or_none(concat!("opsr ", env!("CARGO_PKG_VERSION"))),
        ..Default::default()
    };
    if !metadata.is_empty() {
        let value = exrs::AttributeValue::Text(text(&ascii_json(metadata))?);
        attributes.other.insert(text(METADATA)?, value);
    }
    let encoding = exrs::Encoding {
        compression: exrs::Compression::ZIP16,
        blocks: exrs::Blocks::ScanLines,
        // A fixed order of the blocks: the same bytes however many threads compress.
        line_order: exrs::LineOrder::Increasing,
    };
    let part = exrs::Layer::new(
        (window.w as usize, window.h as usize),
        attributes,
        encoding,
        exrs::AnyChannels::sort(list.into_iter().collect()),
    );
    let image = exrs::Image {
        attributes: exrs::ImageAttributes::with_size((size.x as usize, size.y as usize)),
        layer_data: part,
    };

    let mut bytes = io::Cursor::new(Vec::new());
    // On this thread: the pool that the crate makes for every file left holes in the heap, 8 % in an hour of saves.
    image
        .write()
        .non_parallel()
        .to_buffered(&mut bytes)
        .map_err(problem)?;
    Ok(bytes.into_inner())
}

fn text(s: &str) -> Result<exrs::Text, Problem> {
    exrs::Text::new_or_none(s).ok_or_else(|| unsupported(format!("name '{s}' is not Latin-1")))
}

/// JSON with everything above ASCII escaped, since EXR text has no encoding.
fn ascii_json(metadata: &Metadata) -> String {
    let json = serde_json::json!(metadata).to_string();
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        if c.is_ascii() {
            out.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                out.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    out
}
