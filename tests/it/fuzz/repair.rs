//! Corrections of lengths and checksums after a mutation, so that readers do not reject every file because of them.

use crate::support::gltf::crc32;
use serde_json::{Value, json};
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

/// Corrects the content's length and checksum in the header of a render checkpoint.
pub(crate) fn checkpoint(bytes: Vec<u8>) -> Vec<u8> {
    let length = bytes
        .get(8..16)
        .map(|b| u64::from_le_bytes(b.try_into().expect("eight bytes")));
    let Some(length) = length.filter(|&n| n <= bytes.len() as u64 - 16) else {
        return bytes;
    };
    let (head, content) = bytes.split_at(16 + length as usize);
    let Ok(mut header) = serde_json::from_slice::<Value>(&head[16..]) else {
        return bytes;
    };
    let aovs = header["aov_bytes"].as_u64().unwrap_or(0);
    header["film_bytes"] = json!((content.len() as u64).saturating_sub(aovs));
    let digest = Sha256::digest(content);
    let digits: Vec<String> = digest.iter().map(|b| format!("{b:02x}")).collect();
    header["sha256"] = json!(digits.concat());
    let header = header.to_string();
    let length = (header.len() as u64).to_le_bytes();
    [&head[..8], &length, header.as_bytes(), content].concat()
}
