//! Corrections of lengths and checksums after a mutation, so that readers do not reject every file because of them.

use crate::support::gltf::crc32;
use serde_json::Value;
use sha2::{Digest, Sha256};

/// Returns the file unchanged.
pub(crate) fn nothing(bytes: Vec<u8>) -> Vec<u8> {
    bytes
}

/// Writes a little-endian `u32`.
fn set_u32(bytes: &mut [u8], at: usize, value: usize) {
    bytes[at..at + 4].copy_from_slice(&(value as u32).to_le_bytes());
}

/// Corrects the lengths in a `.glb` file from the position of its second chunk.
pub(crate) fn glb(mut bytes: Vec<u8>) -> Vec<u8> {
    let found = bytes.windows(4).position(|w| w == b"BIN\0");
    let Some(at) = found.filter(|&at| at >= 24 && bytes.starts_with(b"glTF")) else {
        return bytes;
    };
    let length = bytes.len();
    set_u32(&mut bytes, 8, length);
    set_u32(&mut bytes, 12, at - 24);
    set_u32(&mut bytes, at - 4, length - at - 4);
    bytes
}

/// Corrects the checksums of a PNG file's chunks up to the first chunk that passes the end of the file.
pub(crate) fn png(mut bytes: Vec<u8>) -> Vec<u8> {
    let mut at = 8;
    while let Some(head) = bytes.get(at..at + 4) {
        let length = u32::from_be_bytes(head.try_into().expect("four bytes")) as usize;
        let end = at + 8 + length;
        if end + 4 > bytes.len() {
            return bytes;
        }
        let crc = crc32(&bytes[at + 4..end]);
        bytes[end..end + 4].copy_from_slice(&crc.to_be_bytes());
        at = end + 4;
    }
    bytes
}

/// Length of the header and checksum of a sealed file, as far as its header can be found.
pub(crate) fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let line = bytes.iter().position(|&b| b == b'\n').unwrap_or(0);
    let Some(end) = bytes.len().checked_sub(32).filter(|&end| end > line + 9) else {
        return bytes;
    };
    let mut header = serde_json::Deserializer::from_slice(&bytes[line + 9..end]).into_iter();
    if let Some(Ok(Value::Object(_))) = header.next() {
        let length = header.byte_offset() as u64;
        bytes[line + 1..line + 9].copy_from_slice(&length.to_le_bytes());
    }
    let checksum = Sha256::digest(&bytes[..end]);
    bytes[end..].copy_from_slice(&checksum);
    bytes
}
