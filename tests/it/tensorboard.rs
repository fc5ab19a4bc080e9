//! Event files of TensorBoard, read by a parser of their own.

use opsr::report::tensorboard::Scalars;
use std::collections::BTreeMap;

/// Scalars of one step.
#[derive(Debug, PartialEq)]
pub(crate) struct Event {
    pub(crate) time: f64,
    pub(crate) step: u64,
    pub(crate) scalars: BTreeMap<String, f32>,
}

/// CRC-32C by a table of bytes.
fn crc(bytes: &[u8]) -> u32 {
    let table: Vec<u32> = (0..256u32)
        .map(|i| (0..8).fold(i, |c, _| (c >> 1) ^ (0x82f6_3b78 * (c & 1))))
        .collect();
    let step = |c: u32, &b: &u8| table[((c ^ u32::from(b)) & 255) as usize] ^ (c >> 8);
    !bytes.iter().fold(u32::MAX, step)
}

/// The data of all records, whose checksums must hold.
fn records(mut file: &[u8]) -> Vec<&[u8]> {
    let mut all = Vec::new();
    while !file.is_empty() {
        let length = u64::from_le_bytes(file[..8].try_into().unwrap()) as usize;
        let (data, rest) = (&file[12..12 + length], &file[12 + length..]);
        for (bytes, sum) in [(&file[..8], &file[8..12]), (data, &rest[..4])] {
            let sum = u32::from_le_bytes(sum.try_into().unwrap()).wrapping_sub(0xa282_ead8);
            assert_eq!(sum.rotate_left(15), crc(bytes));
        }
        all.push(data);
        file = &rest[4..];
    }
    all
}

/// The fields of a protocol buffer message: number, and content or little-endian number.
fn fields(mut message: &[u8]) -> Vec<(u64, Vec<u8>)> {
    fn varint(message: &mut &[u8]) -> u64 {
        let mut number = 0;
        for shift in (0..).step_by(7) {
            let byte = message[0];
            *message = &message[1..];
            number |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                break;
            }
        }
        number
    }
    let mut all = Vec::new();
    while !message.is_empty() {
        let key = varint(&mut message);
        let length = match key & 7 {
            0 => {
                let number = varint(&mut message);
                all.push((key >> 3, number.to_le_bytes().to_vec()));
                continue;
            }
            1 => 8,
            2 => varint(&mut message) as usize,
            5 => 4,
            other => panic!("wire type {other}"),
        };
        all.push((key >> 3, message[..length].to_vec()));
        message = &message[length..];
    }
    all
}

/// The events with scalars, after the one with the version.
pub(crate) fn events(file: &[u8]) -> Vec<Event> {
    let mut records = records(file).into_iter().map(fields);
    let version = records.next().expect("a version");
    assert_eq!(version[1], (3, b"brain.Event:2".to_vec()));
    let event = |fields: Vec<(u64, Vec<u8>)>| {
        let numbers: Vec<u64> = fields.iter().map(|f| f.0).collect();
        assert_eq!(numbers, [1, 2, 5]);
        let value = |(number, value): (u64, Vec<u8>)| {
            assert_eq!(number, 1);
            let parts = self::fields(&value);
            assert_eq!((parts.len(), parts[0].0, parts[1].0), (2, 1, 2));
            let tag = String::from_utf8(parts[0].1.clone()).unwrap();
            let number = parts[1].1.as_slice().try_into().unwrap();
            (tag, f32::from_le_bytes(number))
        };
        Event {
            time: f64::from_le_bytes(fields[0].1.as_slice().try_into().unwrap()),
            step: u64::from_le_bytes(fields[1].1.as_slice().try_into().unwrap()),
            scalars: self::fields(&fields[2].1).into_iter().map(value).collect(),
        }
    };
    records.map(event).collect()
}

#[test]
fn tensorboard_scalars_are_read_back() {
    let mut written = Scalars::new(1.5e9);
    let long = "a tag of more than 127 bytes, ".repeat(8);
    let all = [
        (0, vec![("loss/training", 0.25)]),
        (127, vec![]),
        (128, vec![("loss/training", -1e-3), (long.as_str(), 3e30)]),
        (1 << 40, vec![("loss/training", f64::INFINITY)]),
    ];
    for (i, (step, values)) in all.iter().enumerate() {
        written.add(*step, 1.5e9 + i as f64, values.iter().copied());
    }
    let expected: Vec<Event> = (all.iter().enumerate())
        .map(|(i, (step, values))| Event {
            time: 1.5e9 + i as f64,
            step: *step,
            scalars: (values.iter())
                .map(|(tag, value)| ((*tag).to_owned(), *value as f32))
                .collect(),
        })
        .collect();
    assert_eq!(events(written.bytes()), expected);
    // Without the events after a step, and continued.
    let file = written.bytes();
    let kept = Scalars::until(file, 128).unwrap();
    assert_eq!(events(&kept), expected[..3]);
    let mut continued = Scalars::after(kept, 0.0);
    continued.add(1 << 40, 1.5e9 + 3.0, [("loss/training", f64::INFINITY)]);
    assert_eq!(continued.bytes(), file);
    assert_eq!(Scalars::until(&[], 9), Some(vec![]));
    // Damaged: cut, or another byte.
    for at in [7, 11, 30, file.len() - 1] {
        assert_eq!(Scalars::until(&file[..at], 9), None, "cut at {at}");
        let mut other = file.to_vec();
        other[at] ^= 4;
        assert_eq!(Scalars::until(&other, 9), None, "byte {at}");
    }
}
