//! Decoders of glTF's compression: meshopt after the text of its extension, Draco and Basis Universal by crates. They
//! produce plain buffer views, accessors or texels, which the loader then reads as usual.

mod draco;
mod ktx;
mod meshopt;
#[cfg(test)]
mod tests;

use gltf::json::Root;
use gltf::json::buffer::View;
use opsr::scene::load::codecs::{Buffers, Codec, Part};
use opsr::scene::load::error::{Result, fault};
use serde_json::{Map, Value, json};
use std::borrow::Cow;

/// All decoders, for [`Formats::codecs`](opsr::scene::load::Formats::codecs).
pub(super) const CODECS: &[Codec] = &[
    Codec {
        extension: "EXT_meshopt_compression",
        part: Part::Buffers(|root, buffers| {
            meshopt::unpack(root, buffers, "EXT_meshopt_compression")
        }),
    },
    Codec {
        extension: "KHR_meshopt_compression",
        part: Part::Buffers(|root, buffers| {
            meshopt::unpack(root, buffers, "KHR_meshopt_compression")
        }),
    },
    Codec {
        extension: draco::EXTENSION,
        part: Part::Buffers(draco::unpack),
    },
    Codec {
        extension: "KHR_texture_basisu",
        part: Part::Images(ktx::CODEC),
    },
];

/// A whole number of an extension; `default` if it is missing.
fn number(object: &Map<String, Value>, name: &str, default: Option<u64>, at: &str) -> Result<u64> {
    match object.get(name) {
        None => default.ok_or_else(|| fault(at, format!("`{name}` is missing"))),
        Some(value) => (value.as_u64())
            .ok_or_else(|| fault(at, format!("`{name}` is {value}, no whole number"))),
    }
}

/// A range of bytes of a buffer.
fn bytes<'b>(
    buffers: &'b Buffers<'_>,
    buffer: u64,
    start: u64,
    length: u64,
    at: &str,
) -> Result<&'b [u8]> {
    let buffer = usize::try_from(buffer).ok().and_then(|i| buffers.get(i));
    let end = start.checked_add(length);
    let part = buffer.zip(end).and_then(|(buffer, end)| {
        buffer.get(usize::try_from(start).ok()?..usize::try_from(end).ok()?)
    });
    part.ok_or_else(|| {
        fault(
            at,
            format!("{length} bytes from {start} pass the end of their buffer"),
        )
    })
}

/// Appends bytes as a new buffer with a view of all of it; returns the index of the view.
fn append(root: &mut Root, buffers: &mut Buffers<'_>, made: Vec<u8>, at: &str) -> Result<usize> {
    let view = json!({ "buffer": buffers.len(), "byteLength": made.len() });
    let view: View =
        gltf::json::deserialize::from_value(view).map_err(|e| fault(at, e.to_string()))?;
    buffers.push(Cow::Owned(made));
    root.buffer_views.push(view);
    Ok(root.buffer_views.len() - 1)
}
