//! `KHR_texture_basisu`: KTX2 files of Basis Universal, ETC1S and UASTC; UASTC may be compressed by Zstandard.
//!
//! The crate `basisu` trusts the lengths in a file's header: damaged ones make it allocate hundreds of gigabytes, or
//! panic. So they are checked here (KTX file format 2.0 [Khronos]), and the crate reads a copy without metadata.

use opsr::scene::load::codecs::ImageCodec;
use opsr::scene::load::error::{Result, fault};
use std::panic::catch_unwind;

pub(super) const CODEC: ImageCodec = ImageCodec { size, texels };

/// Most texels along a side.
const MAX_SIDE: u32 = 1 << 15;

/// Bytes of a block of 4 × 4 texels in UASTC.
const BLOCK: u64 = 16;

/// Bytes of the header before its table of levels, and of an entry of this table.
const HEADER: usize = 80;
const LEVEL: usize = 24;

/// Width and height in texels; `None` for a file of another format or one that ends within its header.
fn size(bytes: &[u8]) -> Option<[u32; 2]> {
    let whole = bytes.starts_with(b"\xabKTX 20\xbb\r\n\x1a\n") && bytes.len() >= HEADER + LEVEL;
    whole.then(|| [word(bytes, 20), word(bytes, 24)])
}

/// A little-endian word of four bytes; 0 past the end.
fn word(bytes: &[u8], at: usize) -> u32 {
    let four = bytes.get(at..).and_then(|rest| rest.first_chunk());
    four.map_or(0, |four| u32::from_le_bytes(*four))
}

fn long(bytes: &[u8], at: usize) -> u64 {
    u64::from(word(bytes, at)) | u64::from(word(bytes, at + 4)) << 32
}

/// RGBA texels of the finest level, eight bits per channel.
fn texels(bytes: &[u8], at: &str) -> Result<Vec<u8>> {
    let bad = |what: String| fault(at, format!("KTX2: {what}"));
    let small = checked(bytes).map_err(bad)?;
    let decode = || {
        let image = basisu::Transcoder::new(&small).map_err(|e| format!("{e:?}"))?;
        (image.transcode(0, basisu::TargetFormat::Rgba32, basisu::DecodeFlags::NONE))
            .map_err(|e| format!("{e:?}"))
    };
    // A panic of this young crate becomes an error of the file.
    let done = catch_unwind(decode).unwrap_or_else(|_| Err("the decoder failed".into()));
    let texels = done.map_err(|what| bad(format!("cannot be decoded: {what}")))?;
    let (width, height) = (word(&small, 20), word(&small, 24));
    match texels.len() as u64 == 4 * u64::from(width) * u64::from(height) {
        true => Ok(texels),
        false => Err(bad("has another size than it says".into())),
    }
}

/// A copy of the file without metadata, if its lengths are possible.
fn checked(bytes: &[u8]) -> std::result::Result<Vec<u8>, String> {
    let (width, height) = (word(bytes, 20), word(bytes, 24));
    let (depth, layers, faces) = (word(bytes, 28), word(bytes, 32), word(bytes, 36));
    let (levels, packed) = (word(bytes, 40), word(bytes, 44));
    if width.max(height) > MAX_SIDE || width.min(height) == 0 {
        return Err(format!("{width} x {height} texels"));
    }
    if depth != 0 || layers > 1 || faces != 1 || levels == 0 || levels > 32 {
        return Err("is no picture in two dimensions".into());
    }
    let size = bytes.len() as u64;
    let within = |start: u64, length: u64| start.checked_add(length).is_some_and(|end| end <= size);
    let (start, length, plain) = (long(bytes, 80), long(bytes, 88), long(bytes, 96));
    let blocks = u64::from(width.div_ceil(4)) * u64::from(height.div_ceil(4)) * BLOCK;
    let right = match packed {
        // ETC1S: one table for all levels.
        1 => within(long(bytes, 64), long(bytes, 72)),
        // UASTC, uncompressed and compressed by Zstandard.
        0 => length == blocks,
        2 => plain == blocks,
        _ => return Err(format!("supercompression {packed} is not of glTF")),
    };
    if !right || !within(start, length) || HEADER + LEVEL * levels as usize > bytes.len() {
        return Err("its lengths pass the end of the file, or do not fit its size".into());
    }
    if word(bytes, 12) != 0 {
        return Err("no Basis Universal".into());
    }
    // Removes the key/value data, which is not used.
    let mut copy = bytes.to_vec();
    copy[56..64].fill(0);
    Ok(copy)
}
