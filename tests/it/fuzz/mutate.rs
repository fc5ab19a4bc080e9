//! Mutations of files: bits, numbers and byte ranges in any file, words in text, values in JSON.

use crate::load::hostile::pointers;
use serde_json::{Value, json};

/// Random numbers (SplitMix64) that depend only on a name, hashed with FNV-1a, and a number.
pub(crate) struct Rng(u64);

impl Rng {
    pub(crate) fn new(name: &str, i: u64) -> Self {
        let hash = |h: u64, b: u8| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3);
        let name = name.bytes().fold(0xcbf2_9ce4_8422_2325, hash);
        Self(name ^ i.wrapping_mul(0xd134_2543_de82_ef95))
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// A number below `n`; 0 if `n` is 0.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn pick<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }
}

/// Integers near the limits of common types.
const EDGE_NUMBERS: [u64; 16] = [
    0,
    1,
    2,
    3,
    0x7f,
    0x80,
    0xff,
    0x7fff,
    0xffff,
    0x1_0000,
    0x0fff_ffff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    u64::MAX,
];

/// Words that often break a reader of text.
const EDGE_WORDS: [&str; 28] = [
    "0",
    "1",
    "-1",
    "2",
    "5",
    "255",
    "65535",
    "65536",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "1e999",
    "1e38",
    "-1e39",
    "1e-46",
    "0.5",
    "1.0000001",
    "nan",
    "inf",
    "null",
    "true",
    "\"\"",
    "[]",
    "{}",
    "[0]",
    "{\"a\":0}",
    "\"\\u0000\"",
    "\u{fffd}",
];

/// A random seed with one to seven mutations.
pub(crate) fn mutated(rng: &mut Rng, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = rng.pick(seeds).clone();
    let text = std::str::from_utf8(&bytes).is_ok();
    // Half of the JSON files stay valid JSON, so that the code behind the parser is reached.
    let keep_json = rng.below(2) == 0;
    let mutations = 1 + rng.below(3) * rng.below(4);
    for _ in 0..mutations {
        if keep_json && mutate_json(rng, &mut bytes) {
            continue;
        }
        if text && rng.below(4) > 0 {
            mutate_words(rng, &mut bytes);
        } else {
            mutate_bytes(rng, &mut bytes, seeds);
        }
    }
    bytes
}

/// A position in the file, half of the time in its first 512 bytes, which is where headers store sizes.
fn position(rng: &mut Rng, length: usize) -> usize {
    let end = if rng.below(2) == 0 {
        length.min(512)
    } else {
        length
    };
    rng.below(end)
}

/// A byte range of the file, mostly shorter than 32 bytes.
fn range(rng: &mut Rng, length: usize) -> std::ops::Range<usize> {
    let start = position(rng, length);
    let limit = if rng.below(8) == 0 { length } else { 32 };
    start..(start + rng.below(limit)).min(length)
}

fn mutate_bytes(rng: &mut Rng, bytes: &mut Vec<u8>, seeds: &[Vec<u8>]) {
    if bytes.is_empty() {
        bytes.push(0);
    }
    let at = position(rng, bytes.len());
    match rng.below(9) {
        0 | 1 => bytes[at] ^= 1 << rng.below(8),
        2 => bytes[at] = rng.next() as u8,
        3 | 4 => {
            // An integer of one, two, four or eight bytes, little- or big-endian, at most one away from an edge.
            let width = 1 << rng.below(4);
            let value = rng
                .pick(&EDGE_NUMBERS)
                .wrapping_add(rng.below(3) as u64)
                .wrapping_sub(1);
            let end = (at + width).min(bytes.len());
            let number = match rng.below(2) {
                0 => value.to_le_bytes()[..width].to_vec(),
                _ => value.to_be_bytes()[8 - width..].to_vec(),
            };
            bytes[at..end].copy_from_slice(&number[..end - at]);
        }
        5 => drop(bytes.drain(range(rng, bytes.len()))),
        6 => {
            let piece = bytes[range(rng, bytes.len())].to_vec();
            bytes.splice(at..at, piece);
        }
        7 => {
            let other = rng.pick(seeds);
            let from = range(rng, other.len());
            let end = (at + from.len()).min(bytes.len());
            bytes.splice(at..end, other[from].iter().copied());
        }
        _ => bytes.truncate(at),
    }
}

/// Byte ranges of the words and numbers of a text.
fn words(bytes: &[u8]) -> Vec<std::ops::Range<usize>> {
    let inside = |b: u8| b.is_ascii_alphanumeric() || b"_.+-".contains(&b);
    let mut out = Vec::new();
    let mut start = None;
    for (i, &b) in bytes.iter().chain(b" ").enumerate() {
        match (inside(b), start) {
            (true, None) => start = Some(i),
            (false, Some(s)) => {
                out.push(s..i);
                start = None;
            }
            _ => {}
        }
    }
    out
}

fn mutate_words(rng: &mut Rng, bytes: &mut Vec<u8>) {
    let words = words(bytes);
    if words.is_empty() {
        return;
    }
    let word = words[position(rng, words.len())].clone();
    match rng.below(4) {
        0 | 1 => drop(bytes.splice(word, rng.pick(&EDGE_WORDS).bytes())),
        2 => {
            let other = bytes[rng.pick(&words).clone()].to_vec();
            bytes.splice(word, other);
        }
        _ => {
            // Repeats the text up to the next comma or line break.
            let rest = &bytes[word.start..];
            let length = rest.iter().position(|b| b",\n".contains(b));
            let piece = rest[..length.map_or(rest.len(), |n| n + 1)].to_vec();
            bytes.splice(word.start..word.start, piece);
        }
    }
}

/// Byte range of a file that holds its JSON, if it has any: the first chunk of a `.glb` file, else the whole file.
pub(crate) fn json_in(bytes: &[u8]) -> std::ops::Range<usize> {
    match bytes.get(12..16) {
        Some(length) if bytes.starts_with(b"glTF") => {
            let length = u32::from_le_bytes(length.try_into().expect("four bytes"));
            let end = (20 + length as usize).min(bytes.len());
            end.min(20)..end
        }
        _ => 0..bytes.len(),
    }
}

/// Replaces, removes or changes the value at a random JSON pointer; `false` if the file is not JSON.
fn mutate_json(rng: &mut Rng, bytes: &mut Vec<u8>) -> bool {
    let place = json_in(bytes);
    let Ok(mut json) = serde_json::from_slice::<Value>(&bytes[place.clone()]) else {
        return false;
    };
    let mut all = Vec::new();
    pointers(&json, "", &mut all);
    // Long lists have many elements that are read alike, so half of the choices leave out their elements.
    let keys: Vec<&String> = all
        .iter()
        .filter(|p| !p.ends_with(char::is_numeric))
        .collect();
    let at = match rng.below(2) {
        0 => rng.pick(&all),
        _ => *rng.pick(&keys),
    };
    let from: &String = rng.pick(&all);
    let other = json.pointer(from).cloned().unwrap_or_default();
    let Some(value) = json.pointer_mut(at) else {
        return false;
    };
    match (rng.below(4), &mut *value) {
        (0, _) => *value = other,
        (1, Value::Object(map)) => {
            let key = map.keys().nth(rng.below(map.len())).cloned();
            key.and_then(|key| map.remove(&key));
        }
        (1, Value::Array(list)) if !list.is_empty() => drop(list.remove(rng.below(list.len()))),
        (2, Value::Array(list)) => list.push(other),
        (1 | 2, Value::Number(n)) => {
            // Off by one in either direction, the other sign, or far too large.
            *value = match (n.as_i64(), rng.below(3)) {
                (Some(n), 0) => json!(n.saturating_add(1)),
                (Some(n), 1) => json!(n.saturating_sub(1)),
                (_, 2) => json!(n.as_f64().map(|n| n * -2.0)),
                _ => json!(n.as_f64().map(|n| n * 1e20)),
            };
        }
        _ => *value = rng.pick(&EDGE_WORDS).parse().unwrap_or(json!("?")),
    }
    let mut text = json.to_string();
    while text.len() % 4 > 0 {
        text.push(' ');
    }
    bytes.splice(place, text.into_bytes());
    true
}
