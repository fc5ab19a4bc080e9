//! Changes to files: of bits, numbers and stretches, of words where there is text, and of values where it is JSON.

use crate::load::hostile::pointers;
use serde_json::{Value, json};

/// Numbers that depend on a name and a count alone (SplitMix64).
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

    /// A number below `n`; 0 if there is none.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.next() % n.max(1) as u64) as usize
    }

    fn pick<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }
}

/// Numbers at which something often breaks.
const ODD: [u64; 16] = [
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

/// Words at which a reader of text often breaks.
const WORDS: [&str; 28] = [
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

/// A good file with one to some changes.
pub(crate) fn mutated(rng: &mut Rng, seeds: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = rng.pick(seeds).clone();
    let text = std::str::from_utf8(&bytes).is_ok();
    // Half of the files stay JSON, so that what comes after the parser has something to do.
    let whole = rng.below(2) == 0;
    let changes = 1 + rng.below(3) * rng.below(4);
    for _ in 0..changes {
        if whole && change_json(rng, &mut bytes) {
            continue;
        }
        if text && rng.below(4) > 0 {
            change_words(rng, &mut bytes);
        } else {
            change_bytes(rng, &mut bytes, seeds);
        }
    }
    bytes
}

/// A place in the file, half of the time near its head, where sizes are.
fn place(rng: &mut Rng, length: usize) -> usize {
    let reach = if rng.below(2) == 0 {
        length.min(512)
    } else {
        length
    };
    rng.below(reach)
}

/// A stretch of the file, mostly short.
fn stretch(rng: &mut Rng, length: usize) -> std::ops::Range<usize> {
    let start = place(rng, length);
    let most = if rng.below(8) == 0 { length } else { 32 };
    start..(start + rng.below(most)).min(length)
}

fn change_bytes(rng: &mut Rng, bytes: &mut Vec<u8>, seeds: &[Vec<u8>]) {
    if bytes.is_empty() {
        bytes.push(0);
    }
    let at = place(rng, bytes.len());
    match rng.below(9) {
        0 | 1 => bytes[at] ^= 1 << rng.below(8),
        2 => bytes[at] = rng.next() as u8,
        3 | 4 => {
            // A number of one, two, four or eight bytes, little- or big-endian, somewhere round an odd one.
            let width = 1 << rng.below(4);
            let value = rng
                .pick(&ODD)
                .wrapping_add(rng.below(3) as u64)
                .wrapping_sub(1);
            let end = (at + width).min(bytes.len());
            let number = match rng.below(2) {
                0 => value.to_le_bytes()[..width].to_vec(),
                _ => value.to_be_bytes()[8 - width..].to_vec(),
            };
            bytes[at..end].copy_from_slice(&number[..end - at]);
        }
        5 => drop(bytes.drain(stretch(rng, bytes.len()))),
        6 => {
            let piece = bytes[stretch(rng, bytes.len())].to_vec();
            bytes.splice(at..at, piece);
        }
        7 => {
            let other = rng.pick(seeds);
            let from = stretch(rng, other.len());
            let end = (at + from.len()).min(bytes.len());
            bytes.splice(at..end, other[from].iter().copied());
        }
        _ => bytes.truncate(at),
    }
}

/// Words and numbers of a text, as ranges of bytes.
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

fn change_words(rng: &mut Rng, bytes: &mut Vec<u8>) {
    let words = words(bytes);
    if words.is_empty() {
        return;
    }
    let word = words[place(rng, words.len())].clone();
    match rng.below(4) {
        0 | 1 => drop(bytes.splice(word, rng.pick(&WORDS).bytes())),
        2 => {
            let other = bytes[rng.pick(&words).clone()].to_vec();
            bytes.splice(word, other);
        }
        _ => {
            // A line, or a stretch up to the next comma, once more.
            let rest = &bytes[word.start..];
            let length = rest.iter().position(|b| b",\n".contains(b));
            let piece = rest[..length.map_or(rest.len(), |n| n + 1)].to_vec();
            bytes.splice(word.start..word.start, piece);
        }
    }
}

/// Where JSON is in a file, if anywhere: in the first chunk of a `.glb` file, or all of it.
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

/// Another value at a random place; `false` if this is not JSON.
fn change_json(rng: &mut Rng, bytes: &mut Vec<u8>) -> bool {
    let place = json_in(bytes);
    let Ok(mut json) = serde_json::from_slice::<Value>(&bytes[place.clone()]) else {
        return false;
    };
    let mut all = Vec::new();
    pointers(&json, "", &mut all);
    // The first of a long list is as good as the last; the keys between lists are what is rare.
    let short: Vec<&String> = all
        .iter()
        .filter(|p| !p.ends_with(char::is_numeric))
        .collect();
    let at = match rng.below(2) {
        0 => rng.pick(&all),
        _ => *rng.pick(&short),
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
            // An index one too far, a size one too small.
            *value = match (n.as_i64(), rng.below(3)) {
                (Some(n), 0) => json!(n.saturating_add(1)),
                (Some(n), 1) => json!(n.saturating_sub(1)),
                (_, 2) => json!(n.as_f64().map(|n| n * -2.0)),
                _ => json!(n.as_f64().map(|n| n * 1e20)),
            };
        }
        _ => *value = rng.pick(&WORDS).parse().unwrap_or(json!("?")),
    }
    let mut text = json.to_string();
    while text.len() % 4 > 0 {
        text.push(' ');
    }
    bytes.splice(place, text.into_bytes());
    true
}
