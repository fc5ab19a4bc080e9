//! Decoders of compressed parts of glTF files. The library itself contains none.

use super::error::Result;
use gltf::json::{Buffer, Root};
use std::borrow::Cow;

/// The buffers of a file, in its order; decoders append decoded ones.
pub type Buffers<'a> = Vec<Cow<'a, [u8]>>;

/// The decoder of an extension.
#[derive(Clone, Copy, Debug)]
pub struct Codec {
    /// Name of the extension.
    pub extension: &'static str,
    /// The part of a file that it compresses.
    pub part: Part,
}

/// The part of a file that an extension compresses. No bytes make a decoder panic or allocate without bound.
#[derive(Clone, Copy, Debug)]
pub enum Part {
    /// Buffer views, or primitives with their accessors; the decoder replaces them by uncompressed ones.
    Buffers(for<'a> fn(&mut Root, &mut Buffers<'a>) -> Result<()>),
    /// Images.
    Images(ImageCodec),
}

/// A decoder of images.
#[derive(Clone, Copy, Debug)]
pub struct ImageCodec {
    /// Width and height of an image in texels; `None` for bytes of another format.
    pub size: fn(&[u8]) -> Option<[u32; 2]>,
    /// The texels of an image of that size, 8 bits for each of red, green, blue and opacity, from the top left on. The
    /// second argument is the image's place, for messages.
    pub texels: fn(&[u8], &str) -> Result<Vec<u8>>,
}

/// True for a buffer that is not read, since an extension that the file uses compresses its views: it is marked as a
/// fallback, or has neither a URI nor a chunk.
pub(super) fn is_placeholder(
    buffer: &Buffer,
    has_bytes: bool,
    codecs: &[Codec],
    used: &[String],
) -> bool {
    let marked = |name: &str| {
        let extensions = buffer.extensions.as_ref().map(|e| &e.others);
        let extension = extensions.and_then(|e| e.get(name));
        extension.is_some_and(|e| e["fallback"] == true)
    };
    codecs.iter().any(|codec| {
        matches!(codec.part, Part::Buffers(_))
            && used.iter().any(|used| used == codec.extension)
            && (!has_bytes || marked(codec.extension))
    })
}
