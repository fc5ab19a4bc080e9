//! The corpus: small files that are kept, broken and odd ones, each with what must come of it.
//!
//! A file is there for the kind of its outcome: the message, or what was taken, without numbers and names. `make` looks
//! for kinds that no file has yet and keeps the smallest of each.

use super::mutate::{Rng, json_in, mutated};
use super::{Target, targets};
use crate::load::hostile::pointers;
use crate::support::quick_folder;
use serde_json::Value;
use std::collections::BTreeMap;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Kinds by the file's name.
type Expected = BTreeMap<String, String>;

/// The list of a folder.
const LIST: &str = "expected.txt";

fn folder(target: &Target) -> PathBuf {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
    corpus.join(target.name)
}

fn expected(target: &Target) -> Expected {
    let text = std::fs::read_to_string(folder(target).join(LIST)).unwrap_or_default();
    let line = |l: &str| {
        let (name, kind) = l.split_once(": ").expect("a name and a kind");
        (name.to_owned(), kind.to_owned())
    };
    text.lines().map(line).collect()
}

fn record(target: &Target, expected: &Expected) {
    let lines = expected
        .iter()
        .map(|(name, kind)| format!("{name}: {kind}\n"));
    let text: String = lines.collect();
    std::fs::write(folder(target).join(LIST), text).expect("a list");
}

/// Between which words messages tell what they found instead, which does not matter.
const FOUND: [(&str, &str); 8] = [
    ("ChunkType {", " }"),
    ("invalid type: ", ", expected"),
    ("unknown variant ", ", expected"),
    ("unknown field ", ", expected"),
    ("cannot read ", ": "),
    ("Orientation ", "."),
    ("; the file has", ";"),
    (" ('", "')"),
];

/// The text without what stands between two words, wherever they are.
fn without(text: &str, from: &str, to: &str) -> String {
    let mut pieces = text.split(from);
    let mut out = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let end = piece.find(to).map_or("", |at| &piece[at..]);
        out.push_str(&format!("{from}…{end}"));
    }
    out
}

/// A message without what differs from file to file: paths, quoted words, numbers, and TOML's copy of the line.
fn words(message: &str, path: &Path) -> String {
    let folder = path.parent().unwrap_or(path).display().to_string();
    let message = message.replace(&*path.display().to_string(), "FILE");
    let message = message.replace(&folder, "FOLDER");
    let copied = |l: &&str| {
        !l.trim_start_matches(|c: char| c.is_numeric() || c == ' ')
            .starts_with('|')
    };
    let lines: Vec<&str> = message.lines().filter(copied).collect();
    let mut plain = lines.join(" ");
    for (from, to) in FOUND {
        plain = without(&plain, from, to);
    }
    for quote in ['`', '"'] {
        let inside = |(i, piece)| if i % 2 == 0 { piece } else { "_" };
        plain = plain.split(quote).enumerate().map(inside).collect();
    }
    let part = |c: char| c.is_alphanumeric() || c == '_';
    let mut kind = String::new();
    for word in plain.split_inclusive(|c| !part(c)) {
        let end = word.trim_end_matches(|c| !part(c));
        let number = end.starts_with(|c: char| c.is_ascii_digit());
        let name = end.starts_with("KHR_") || end.starts_with("EXT_");
        kind.push_str(if number {
            "N"
        } else if name {
            "_"
        } else {
            end
        });
        kind.push_str(&word[end.len()..]);
    }
    for (long, short) in [
        ("N.N", "N"),
        ("-N", "N"),
        ("N N", "N"),
        ("N, N", "N"),
        ("_ _", "_"),
        ("_, _", "_"),
    ] {
        while kind.contains(long) {
            kind = kind.replace(long, short);
        }
    }
    let blanks = kind.split(|c: char| c.is_whitespace() || c.is_control());
    let kind: Vec<&str> = blanks.filter(|w| !w.is_empty()).collect();
    kind.join(" ").chars().take(200).collect()
}

/// What came of a file; a panic, or a message without the file's name, is a fault.
fn kind(target: &Target, path: &Path) -> Result<String, String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    match catch_unwind(AssertUnwindSafe(|| (target.read)(path))) {
        Err(_) => Err("a panic".into()),
        Ok(Ok(taken)) => Ok(format!("taken: {}", words(&taken, path))),
        Ok(Err(message)) if !message.contains(&*name) => Err(format!("no file in `{message}`")),
        Ok(Err(message)) => Ok(words(&message, path).replace(&*name, "FILE")),
    }
}

#[test]
fn every_file_has_the_outcome_it_had() {
    let again = std::env::var("OPSR_CORPUS_RECORD").is_ok();
    let mut wrong = Vec::new();
    let mut files = 0;
    for target in targets::all() {
        let old = expected(&target);
        let mut new = Expected::new();
        for entry in std::fs::read_dir(folder(&target)).expect("a folder") {
            let path = entry.expect("an entry").path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            if name == LIST {
                continue;
            }
            files += 1;
            match kind(&target, &path) {
                Ok(kind) => drop(new.insert(name.into_owned(), kind)),
                Err(fault) => wrong.push(format!("{}: {fault}", path.display())),
            }
        }
        if again {
            record(&target, &new);
        } else if old != new {
            let gone = old
                .iter()
                .filter(|(name, kind)| new.get(*name) != Some(kind));
            let come = new
                .iter()
                .filter(|(name, kind)| old.get(*name) != Some(kind));
            wrong.extend(gone.map(|(name, kind)| format!("- {}/{name}: {kind}", target.name)));
            wrong.extend(come.map(|(name, kind)| format!("+ {}/{name}: {kind}", target.name)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(files >= 300 || !cfg!(feature = "train"), "{files} files");
}

/// Shorter files with pieces or JSON values left out, or with numbers of one digit, as long as `same` holds.
fn shrunk(mut bytes: Vec<u8>, mut tries: u32, same: &mut dyn FnMut(&[u8]) -> bool) -> Vec<u8> {
    let place = json_in(&bytes);
    if let Ok(json) = serde_json::from_slice::<Value>(&bytes[place.clone()]) {
        let mut all = Vec::new();
        pointers(&json, "", &mut all);
        // From the end: what comes before keeps its index.
        for at in all.iter().rev().filter(|p| !p.is_empty()) {
            let place = json_in(&bytes);
            let Ok(mut json) = serde_json::from_slice(&bytes[place.clone()]) else {
                break;
            };
            if tries > 0 && remove(&mut json, at) {
                tries -= 1;
                let candidate = spliced(&bytes, place, &json);
                if candidate.len() < bytes.len() && same(&candidate) {
                    bytes = candidate;
                }
            }
        }
    }
    let mut length = bytes.len() / 2;
    while length > 0 {
        let mut at = 0;
        while at < bytes.len() && tries > 0 {
            tries -= 1;
            let end = (at + length).min(bytes.len());
            let candidate = [&bytes[..at], &bytes[end..]].concat();
            if same(&candidate) {
                bytes = candidate;
            } else {
                at = end;
            }
        }
        length /= 2;
    }
    bytes
}

/// JSON text in place of what was there, with blanks to a length that glTF likes.
fn spliced(bytes: &[u8], place: Range<usize>, json: &Value) -> Vec<u8> {
    let mut text = json.to_string();
    while bytes.starts_with(b"glTF") && !text.len().is_multiple_of(4) {
        text.push(' ');
    }
    [&bytes[..place.start], text.as_bytes(), &bytes[place.end..]].concat()
}

fn remove(json: &mut Value, at: &str) -> bool {
    let Some((parent, key)) = at.rsplit_once('/') else {
        return false;
    };
    match json.pointer_mut(parent) {
        Some(Value::Object(map)) => map.remove(key).is_some(),
        Some(Value::Array(list)) => match key.parse::<usize>() {
            Ok(i) if i < list.len() => {
                list.remove(i);
                true
            }
            _ => false,
        },
        _ => false,
    }
}

/// A name for a file of this kind that no other has.
fn name(target: &Target, kind: &str, taken: &Expected) -> String {
    let letter = |c: char| {
        if c.is_ascii_alphanumeric() {
            c.to_ascii_lowercase()
        } else {
            ' '
        }
    };
    let plain: String = kind.replace("FILE", "").chars().map(letter).collect();
    let words: Vec<&str> = plain.split_whitespace().filter(|w| *w != "n").collect();
    let mut slug: String = words.join("-").chars().take(60).collect();
    if slug.is_empty() {
        slug = "file".into();
    }
    let ending = target.file.rsplit_once('.').map_or("", |(_, e)| e);
    let names = (1..).map(|i| match i {
        1 => format!("{slug}.{ending}"),
        _ => format!("{slug}-{i}.{ending}"),
    });
    let free = |name: &String| !taken.contains_key(name);
    names.into_iter().find(free).expect("a number")
}

/// Adds a file for each kind of outcome that has none yet.
fn enlarge(target: &Target, count: u64) {
    let folder = folder(target);
    std::fs::create_dir_all(&folder).expect("a folder");
    let mut listed = expected(target);
    let place = quick_folder();
    let path = place.path().join(target.file);
    let outcome = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("a file");
        kind(target, &path).unwrap_or_else(|fault| panic!("{}: {fault}", target.name))
    };
    let mut found: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    for i in 0..count {
        let mut rng = Rng::new(target.file, i);
        let mut bytes = mutated(&mut rng, &target.seeds);
        if rng.below(4) > 0 {
            bytes = (target.repair)(bytes);
        }
        let kind = outcome(&bytes);
        let known = listed.values().any(|k| *k == kind);
        if !known && found.get(&kind).is_none_or(|b| b.len() > bytes.len()) {
            found.insert(kind, bytes);
        }
    }
    for (kind, bytes) in found {
        let mut best = shrunk(bytes, 700, &mut |b| outcome(b) == kind);
        let repaired = (target.repair)(best.clone());
        if repaired.len() <= best.len() && outcome(&repaired) == kind {
            best = repaired;
        }
        let name = name(target, &kind, &listed);
        std::fs::write(folder.join(&name), &best).expect("a file");
        listed.insert(name, kind);
    }
    println!("{}: {} files", target.name, listed.len());
    record(target, &listed);
}

#[test]
#[ignore = "adds files to tests/corpus"]
fn make() {
    let count =
        std::env::var("OPSR_FUZZ_EXECUTIONS").map_or(20_000, |n| n.parse().expect("a number"));
    let only = std::env::var("OPSR_FUZZ_TARGETS").unwrap_or_default();
    for target in targets::all() {
        if only.is_empty() || only.split(',').any(|name| name == target.name) {
            enlarge(&target, count);
        }
    }
}
