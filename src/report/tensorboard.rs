//! Event files of TensorBoard: scalars by step.
//!
//! A file is a list of records as TensorFlow's record files have them: the length (u64), its checksum, the data, and their
//! checksum, little-endian. The data are an `Event` of TensorFlow's `event.proto` as protocol buffers encode it:
//!
//! ```text
//! Event   { double wall_time = 1; int64 step = 2; string file_version = 3; Summary summary = 5 }
//! Summary { repeated Value value = 1 }        Value { string tag = 1; float simple_value = 2 }
//! ```

/// Scalars of an event file; [`Scalars::bytes`] is the file. TensorBoard reads files whose names contain `tfevents`.
pub struct Scalars(Vec<u8>);

impl Scalars {
    /// A file without scalars; `time` in seconds since 1970.
    pub fn new(time: f64) -> Self {
        let mut scalars = Self(Vec::new());
        let mut event = wall_time(time);
        field(&mut event, 3, b"brain.Event:2");
        scalars.record(&event);
        scalars
    }

    /// Scalars that continue a file.
    pub fn after(file: Vec<u8>, time: f64) -> Self {
        if file.is_empty() {
            Self::new(time)
        } else {
            Self(file)
        }
    }

    /// A file without its events after this step. `None` if it is damaged, or was not written by `Scalars`.
    pub fn until(mut file: &[u8], step: u64) -> Option<Vec<u8>> {
        let mut kept = Vec::new();
        while !file.is_empty() {
            let (length, rest) = checked(file, 8)?;
            let length = u64::from_le_bytes(length.try_into().ok()?);
            let (event, rest) = checked(rest, length.try_into().ok()?)?;
            // The time, then the step, or the version.
            let (key, number) = event.get(9..)?.split_first()?;
            if *key != (2 << 3 | VARINT) || leading_varint(number)? <= step {
                kept.extend(&file[..file.len() - rest.len()]);
            }
            file = rest;
        }
        Some(kept)
    }

    /// Adds values by tag at a step; `time` in seconds since 1970.
    pub fn add<'a>(
        &mut self,
        step: u64,
        time: f64,
        values: impl IntoIterator<Item = (&'a str, f64)>,
    ) {
        let mut summary = Vec::new();
        for (tag, number) in values {
            let mut value = Vec::new();
            field(&mut value, 1, tag.as_bytes());
            value.push(2 << 3 | FIXED32);
            value.extend((number as f32).to_le_bytes());
            field(&mut summary, 1, &value);
        }
        let mut event = wall_time(time);
        event.push(2 << 3 | VARINT);
        varint(&mut event, step);
        field(&mut event, 5, &summary);
        self.record(&event);
    }

    /// The file.
    pub fn bytes(&self) -> &[u8] {
        &self.0
    }

    fn record(&mut self, data: &[u8]) {
        let length = (data.len() as u64).to_le_bytes();
        for part in [&length, data] {
            self.0.extend(part);
            self.0.extend(masked(part).to_le_bytes());
        }
    }
}

/// Types of fields on the wire.
const VARINT: u8 = 0;
const FIXED64: u8 = 1;
const BYTES: u8 = 2;
const FIXED32: u8 = 5;

/// The beginning of an event.
fn wall_time(time: f64) -> Vec<u8> {
    let mut event = vec![1 << 3 | FIXED64];
    event.extend(time.to_le_bytes());
    event
}

/// Appends a field of bytes: text, or a message.
fn field(to: &mut Vec<u8>, number: u8, bytes: &[u8]) {
    to.push(number << 3 | BYTES);
    varint(to, bytes.len() as u64);
    to.extend(bytes);
}

/// Appends a number in groups of seven bits, the lowest first.
fn varint(to: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        to.push(number as u8 | 0x80);
        number >>= 7;
    }
    to.push(number as u8);
}

/// The number at the beginning.
fn leading_varint(bytes: &[u8]) -> Option<u64> {
    let groups = bytes.iter().take(10).position(|byte| byte & 0x80 == 0)?;
    let group = |number, &byte: &u8| number << 7 | u64::from(byte & 0x7f);
    Some(bytes[..=groups].iter().rev().fold(0, group))
}

/// Splits `length` bytes off a file; their checksum, which follows, must hold. Returns the bytes and the rest of the file.
fn checked(file: &[u8], length: usize) -> Option<(&[u8], &[u8])> {
    let (bytes, rest) = file.split_at_checked(length)?;
    let (sum, rest) = rest.split_first_chunk()?;
    (u32::from_le_bytes(*sum) == masked(bytes)).then_some((bytes, rest))
}

/// CRC-32C, masked: a checksum of data that contain checksums is no good.
fn masked(bytes: &[u8]) -> u32 {
    crc32c(bytes).rotate_right(15).wrapping_add(0xa282_ead8)
}

/// CRC-32 with Castagnoli's polynomial, reflected (RFC 3720, appendix B.4).
fn crc32c(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| {
            crc >> 1 ^ if crc & 1 == 1 { 0x82f6_3b78 } else { 0 }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crc32c_of_the_rfc() {
        assert_eq!(crc32c(b"123456789"), 0xe306_9283);
        assert_eq!(crc32c(&[0; 32]), 0x8a91_36aa);
    }
}
