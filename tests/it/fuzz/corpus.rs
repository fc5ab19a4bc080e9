//! Corpus of small broken and odd files in `tests/corpus`: one folder of numbered files per target, and the outcome
//! expected of each file in the folder's `expected.txt`.
//!
//! The outcome of a file is its error message, or the summary of what the reader accepted, without numbers, names and
//! paths. `corpus_add_new_outcomes` searches for outcomes that no file has yet and adds the smallest file of each.

use super::mutate::json_in;
use super::{Target, env_number, selected, targets};
use crate::load::hostile::pointers;
use crate::support::{quick_folder, root};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// Outcomes by file number.
type Outcomes = BTreeMap<u32, String>;

/// Name of the list of expected outcomes in each folder.
const EXPECTED: &str = "expected.txt";

fn folder(target: &Target) -> PathBuf {
    let corpus = root().join("tests/corpus");
    corpus.join(target.name)
}

/// Path of a numbered file, such as `0001.glb`.
fn file(target: &Target, number: u32) -> PathBuf {
    let (_, extension) = target.file_name.rsplit_once('.').expect("an extension");
    folder(target).join(format!("{number:04}.{extension}"))
}

/// Numbers of the files in a folder, and the paths of files that are not named by a number.
fn files(target: &Target) -> (BTreeSet<u32>, Vec<PathBuf>) {
    let (mut numbers, mut misnamed) = (BTreeSet::new(), Vec::new());
    for entry in std::fs::read_dir(folder(target)).expect("a folder") {
        let path = entry.expect("an entry").path();
        let stem = path.file_stem().and_then(|s| s.to_str());
        let number = stem.and_then(|s| s.parse().ok());
        match number.filter(|&n| file(target, n) == path) {
            Some(number) => drop(numbers.insert(number)),
            None if path.ends_with(EXPECTED) => {}
            None => misnamed.push(path),
        }
    }
    (numbers, misnamed)
}

/// Outcomes listed for a folder: one line per file, its number, a space and its outcome.
fn expected(target: &Target) -> Outcomes {
    let path = folder(target).join(EXPECTED);
    let text = std::fs::read_to_string(&path).unwrap_or_default();
    let mut outcomes = Outcomes::new();
    for (i, line) in text.lines().enumerate() {
        let place = format!("{}:{}", path.display(), i + 1);
        let entry = line.split_once(' ');
        let entry = entry.and_then(|(number, outcome)| Some((number.parse().ok()?, outcome)));
        let Some((number, outcome)) = entry else {
            panic!("{place}: expected a number and an outcome, found `{line}`");
        };
        let twice = outcomes.insert(number, outcome.to_owned()).is_some();
        assert!(!twice, "{place}: number {number:04} is listed twice");
    }
    outcomes
}

fn record(target: &Target, outcomes: &Outcomes) {
    let lines = outcomes
        .iter()
        .map(|(number, outcome)| format!("{number:04} {outcome}\n"));
    let text: String = lines.collect();
    std::fs::write(folder(target).join(EXPECTED), text).expect("a list");
}

/// One complaint for each file that has no expected outcome or another one, and for each listed file that is missing.
fn differences(target: &Target, expected: &Outcomes, found: &Outcomes) -> Vec<String> {
    let numbers: BTreeSet<&u32> = expected.keys().chain(found.keys()).collect();
    let complaint = |&number: &u32| {
        let complaint = match (expected.get(&number), found.get(&number)) {
            (Some(old), Some(new)) if old == new => return None,
            (Some(old), Some(new)) => format!("expected `{old}`, found `{new}`"),
            (Some(old), None) => format!("missing, {EXPECTED} lists it with `{old}`"),
            (None, new) => {
                format!(
                    "not in {EXPECTED}, found `{}`",
                    new.map_or("", String::as_str)
                )
            }
        };
        Some(format!("{}: {complaint}", file(target, number).display()))
    };
    numbers.into_iter().filter_map(complaint).collect()
}

/// Delimiters of the parts of a message that quote the file's content, which differs from file to file.
const QUOTED: [(&str, &str); 8] = [
    ("ChunkType {", " }"),
    ("invalid type: ", ", expected"),
    ("unknown variant ", ", expected"),
    ("unknown field ", ", expected"),
    ("cannot read ", ": "),
    ("Orientation ", "."),
    ("; the file has", ";"),
    (" ('", "')"),
];

/// The text with `…` in place of everything between two delimiters, at every occurrence.
fn without(text: &str, from: &str, to: &str) -> String {
    let mut pieces = text.split(from);
    let mut out = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let end = piece.find(to).map_or("", |at| &piece[at..]);
        out.push_str(&format!("{from}…{end}"));
    }
    out
}

/// A message without what differs from file to file: paths, file name, quoted words, numbers, and the line that TOML's
/// errors copy from the file. Names are replaced before numbers, since the name of a corpus file is a number.
fn normalised(message: &str, path: &Path) -> String {
    let folder = path.parent().unwrap_or(path).display().to_string();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let message = message.replace(&*path.display().to_string(), "FILE");
    let message = message.replace(&folder, "FOLDER").replace(&*name, "FILE");
    let copied = |l: &&str| {
        !l.trim_start_matches(|c: char| c.is_numeric() || c == ' ')
            .starts_with('|')
    };
    let lines: Vec<&str> = message.lines().filter(copied).collect();
    let mut plain = lines.join(" ");
    for (from, to) in QUOTED {
        plain = without(&plain, from, to);
    }
    for quote in ['`', '"'] {
        let inside = |(i, piece)| if i % 2 == 0 { piece } else { "_" };
        plain = plain.split(quote).enumerate().map(inside).collect();
    }
    let part = |c: char| c.is_alphanumeric() || c == '_';
    let mut out = String::new();
    for word in plain.split_inclusive(|c| !part(c)) {
        let end = word.trim_end_matches(|c| !part(c));
        let number = end.starts_with(|c: char| c.is_ascii_digit());
        let name = end.starts_with("KHR_") || end.starts_with("EXT_");
        out.push_str(if number {
            "N"
        } else if name {
            "_"
        } else {
            end
        });
        out.push_str(&word[end.len()..]);
    }
    for (long, short) in [
        ("N.N", "N"),
        ("-N", "N"),
        ("N N", "N"),
        ("N, N", "N"),
        ("_ _", "_"),
        ("_, _", "_"),
    ] {
        while out.contains(long) {
            out = out.replace(long, short);
        }
    }
    let blanks = out.split(|c: char| c.is_whitespace() || c.is_control());
    let words: Vec<&str> = blanks.filter(|w| !w.is_empty()).collect();
    words.join(" ").chars().take(200).collect()
}

/// Outcome of reading a file.
///
/// # Errors
/// If the reader panics, or its error message does not name the file.
fn outcome(target: &Target, path: &Path) -> Result<String, String> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    match catch_unwind(AssertUnwindSafe(|| (target.read)(path))) {
        Err(_) => Err("a panic".into()),
        Ok(Ok(summary)) => Ok(format!("accepted: {}", normalised(&summary, path))),
        Ok(Err(message)) if !message.contains(&*name) => Err(format!("no file in `{message}`")),
        Ok(Err(message)) => Ok(normalised(&message, path)),
    }
}

#[test]
fn corpus_files_have_their_expected_outcomes() {
    let recording = std::env::var("OPSR_CORPUS_RECORD").is_ok();
    let mut faults = Vec::new();
    let mut count = 0;
    for target in targets::all() {
        let (numbers, misnamed) = files(&target);
        let form = file(&target, 1);
        let form = form.file_name().unwrap_or_default().display();
        let misnamed = misnamed.iter().map(|path| path.display());
        faults.extend(misnamed.map(|path| format!("{path}: expected a name such as {form}")));
        count += numbers.len();
        let mut found = Outcomes::new();
        let mut failed = Vec::new();
        for number in numbers {
            let path = file(&target, number);
            match outcome(&target, &path) {
                Ok(outcome) => drop(found.insert(number, outcome)),
                Err(fault) => {
                    faults.push(format!("{}: {fault}", path.display()));
                    failed.push(number);
                }
            }
        }
        if recording {
            record(&target, &found);
        } else {
            let mut expected = expected(&target);
            expected.retain(|number, _| !failed.contains(number));
            faults.extend(differences(&target, &expected, &found));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(count >= 300 || !cfg!(feature = "train"), "{count} files");
}

#[test]
fn corpus_differences_name_the_file() {
    let target = targets::hdr();
    let outcomes = |list: &[(u32, &str)]| -> Outcomes {
        list.iter().map(|&(n, text)| (n, text.to_owned())).collect()
    };
    let expected = outcomes(&[(1, "same"), (2, "old"), (3, "listed")]);
    let found = outcomes(&[(1, "same"), (2, "new"), (4, "unlisted")]);
    let complaints = differences(&target, &expected, &found);
    let fragments = [
        "0002.hdr: expected `old`, found `new`",
        "0003.hdr: missing, expected.txt lists it with `listed`",
        "0004.hdr: not in expected.txt, found `unlisted`",
    ];
    assert_eq!(complaints.len(), fragments.len(), "{complaints:?}");
    for (complaint, fragment) in complaints.iter().zip(fragments) {
        assert!(complaint.ends_with(fragment), "{complaint}");
    }
}

#[test]
fn corpus_outcomes_do_not_depend_on_the_file_number() {
    let of = |path: &str, message: &str| normalised(message, Path::new(path));
    let first = of("/a/0001.glb", "/a/0001.glb: see 0001.glb in /a, byte 1");
    let second = of("/b/0712.glb", "/b/0712.glb: see 0712.glb in /b, byte 712");
    assert_eq!(first, "FILE: see FILE in FOLDER, byte N");
    assert_eq!(first, second);
}

/// The shortest file found for which `same` holds, by removing JSON values and byte ranges in at most `tries` tries.
fn shrunk(mut bytes: Vec<u8>, mut tries: u32, same: &mut dyn FnMut(&[u8]) -> bool) -> Vec<u8> {
    let place = json_in(&bytes);
    if let Ok(json) = serde_json::from_slice::<Value>(&bytes[place.clone()]) {
        let mut all = Vec::new();
        pointers(&json, "", &mut all);
        // Backwards, since a removal shifts the indices of the values that follow.
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

/// The file with its JSON range replaced, padded with spaces to a multiple of four bytes in a `.glb` file.
fn spliced(bytes: &[u8], place: Range<usize>, json: &Value) -> Vec<u8> {
    let mut text = json.to_string();
    while bytes.starts_with(b"glTF") && !text.len().is_multiple_of(4) {
        text.push(' ');
    }
    [&bytes[..place.start], text.as_bytes(), &bytes[place.end..]].concat()
}

/// Removes the value at a JSON pointer; `false` if there is none.
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

/// Adds a file for each outcome of executions `0..count` that no file has yet, under the next free number.
fn enlarge(target: &Target, count: u64) {
    std::fs::create_dir_all(folder(target)).expect("a folder");
    let mut listed = expected(target);
    let temporary = quick_folder();
    let path = temporary.path().join(target.file_name);
    let outcome_of = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("a file");
        outcome(target, &path).unwrap_or_else(|fault| panic!("{}: {fault}", target.name))
    };
    let mut smallest: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    for i in 0..count {
        let bytes = target.input(i);
        let outcome = outcome_of(&bytes);
        let known = listed.values().any(|o| *o == outcome);
        let smaller = |old: &Vec<u8>| bytes.len() < old.len();
        if !known && smallest.get(&outcome).is_none_or(smaller) {
            smallest.insert(outcome, bytes);
        }
    }
    for (outcome, bytes) in smallest {
        let mut best = shrunk(bytes, 700, &mut |b| outcome_of(b) == outcome);
        let repaired = (target.repair)(best.clone());
        if repaired.len() <= best.len() && outcome_of(&repaired) == outcome {
            best = repaired;
        }
        let present = files(target).0;
        let last = present.last().max(listed.keys().last());
        let number = last.map_or(1, |last| last + 1);
        std::fs::write(file(target, number), &best).expect("a file");
        listed.insert(number, outcome);
    }
    println!("{}: {} files", target.name, listed.len());
    record(target, &listed);
}

#[test]
#[ignore = "adds files to tests/corpus"]
fn corpus_add_new_outcomes() {
    let count = env_number("OPSR_FUZZ_EXECUTIONS", 20_000);
    for target in selected() {
        enlarge(&target, count);
    }
}
