//! The table of rooms at the top of `src/lib.rs` as an assertion: a room uses only rooms below it.

use crate::support::root;
use std::path::{Path, PathBuf};

/// A folder of source, and its rooms from bottom to top; each may use those before it.
type Rooms = (&'static str, &'static [&'static str]);

/// Rooms of the crates. Cargo itself refuses cycles of crates.
#[rustfmt::skip]
const ROOMS: &[Rooms] = &[
    ("src", &["memory", "files", "math", "sampler", "regularise", "bsdf", "image", "scene", "integrator", "resolve", "pilot", "render", "facade"]),
    ("crates/lab/src", &["gallery", "stats", "report", "verify"]),
    ("crates/train/src", &["manifest", "reference", "record", "evaluate", "learn", "score"]),
];

/// Rooms inside a room, in the same order.
const INNER: &[Rooms] = &[(
    "integrator",
    &[
        "walk",
        "path",
        "guided",
        "levels",
        "bidirectional",
        "metropolis",
    ],
)];

/// A source text without comments and test modules; the lines are kept, blank.
pub(crate) fn stripped(text: &str) -> String {
    let mut kept = String::new();
    // The line that ends a test module, and true until its first line was read.
    let mut tests: Option<(String, bool)> = None;
    for line in text.lines() {
        if line.trim() == "#[cfg(test)]" {
            tests = Some((line.replace("#[cfg(test)]", "}"), true));
        } else if let Some((end, starts)) = &mut tests {
            // A test module ends with a brace at its attribute's indentation; one in another file is a single line.
            let in_a_file = *starts && line.ends_with(';');
            *starts &= line.trim().starts_with("#[");
            if in_a_file || line == end {
                tests = None;
            }
        } else {
            kept += line.split("//").next().unwrap_or_default();
        }
        kept.push('\n');
    }
    kept
}

/// First words of the items of a `{…}` group, up to the brace that closes it.
fn heads(group: &str) -> Vec<&str> {
    let (mut depth, mut starts, mut heads) = (0, true, Vec::new());
    for (i, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => break,
            '}' => depth -= 1,
            ',' => starts |= depth == 0,
            c if starts && !c.is_whitespace() => {
                let word = group[i..].split(|c: char| !c.is_alphanumeric() && c != '_');
                heads.extend(word.take(1));
                starts = false;
            }
            _ => {}
        }
    }
    heads
}

/// A path from the crate's root, without `crate` or `opsr`; `None` for another crate.
fn resolved<'a>(path: &'a str, module: &[&'a str]) -> Option<Vec<&'a str>> {
    let mut names = path.split("::").filter(|name| !name.is_empty()).peekable();
    let mut base = match names.next()? {
        "crate" | "opsr" => Vec::new(),
        "self" => module.to_vec(),
        "super" => module[..module.len() - 1].to_vec(),
        _ => return None,
    };
    while names.next_if_eq(&"super").is_some() {
        base.pop();
    }
    base.extend(names);
    Some(base)
}

/// The uses in a file that break its folder's table, one line each.
fn faults((folder, rooms): Rooms, file: &str, text: &str) -> Vec<String> {
    let module = file.trim_end_matches(".rs").trim_end_matches("/mod");
    let module: Vec<&str> = module.split('/').collect();
    let text = stripped(text);
    let mut faults = Vec::new();
    let mut judge = |at: usize, path: &str| {
        let Some(used) = resolved(path, &module) else {
            return;
        };
        let inner = INNER
            .iter()
            .filter(|(room, _)| module[0] == *room && used.first() == Some(room));
        let (table, level) = inner
            .map(|(_, table)| (*table, 1))
            .next()
            .unwrap_or((rooms, 0));
        let floor = |path: &[&str]| table.iter().position(|room| path.get(level) == Some(room));
        if let (Some(own), Some(other)) = (floor(&module), floor(&used))
            && other > own
        {
            let line = text[..at].matches('\n').count() + 1;
            let [own, other] = [own, other].map(|floor| table[floor]);
            faults.push(format!(
                "{folder}/{file}:{line}: `{own}` uses `{path}`, but `{other}` stands above it"
            ));
        }
    };
    let in_path = |c: char| c.is_alphanumeric() || c == '_' || c == ':';
    let mut at = 0;
    while let Some(start) = text[at..].find(in_path).map(|i| at + i) {
        at = text[start..]
            .find(|c| !in_path(c))
            .map_or(text.len(), |i| start + i);
        let path = &text[start..at];
        match text[at..].strip_prefix('{') {
            Some(group) if path.ends_with("::") => {
                heads(group)
                    .iter()
                    .for_each(|head| judge(start, &format!("{path}{head}")));
            }
            _ => judge(start, path),
        }
    }
    faults
}

/// Every source file below `folder`, except test modules in files of their own.
pub(crate) fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") && !path.ends_with("tests.rs") {
            found.push(path);
        }
    }
}

#[test]
fn architecture_rooms_use_only_rooms_below_them() {
    let mut all = Vec::new();
    for &(folder, rooms) in ROOMS {
        let source = root().join(folder);
        let mut files = Vec::new();
        sources(&source, &mut files);
        assert!(files.len() > 20, "only {} files in {folder}", files.len());
        for path in files {
            let file = path.strip_prefix(&source).expect("below the folder");
            let text = std::fs::read_to_string(&path).expect("a source file");
            all.extend(faults((folder, rooms), &file.to_string_lossy(), &text));
        }
        for room in rooms.iter().map(|room| source.join(room)) {
            let there = room.is_dir() || room.with_extension("rs").is_file();
            assert!(there, "no room {}", room.display());
        }
    }
    assert!(
        all.is_empty(),
        "data flows one way (src/lib.rs):\n{}",
        all.join("\n")
    );
}

/// Names for what lies between the vertices of a path or changes along it.
const WALKED: &[&str] = &[
    "EnclosingBodies",
    "Channel",
    "refraction_scale",
    "roulette_scale",
    "eta_scale",
    "tracks_bodies",
    "bodies_around",
    "overlaps",
    "bodies",
    "dispersion",
];

/// Names that occur in a refusal.
const ASKED: &[&str] = &["overlaps", "bodies", "dispersion"];

/// Other files that may use these names: scene data, refusals of integrators, and checks of other programs.
/// `refraction_scale` belongs to the BSDF, and the flux of a light walk along a Dirac lobe needs it.
const MAY_NAME: &[(&str, &[&str])] = &[
    ("scene/", WALKED),
    ("bsdf/", &["refraction_scale"]),
    ("integrator/walk/", WALKED),
    ("integrator/bidirectional/walk.rs", &["refraction_scale"]),
    ("integrator/settings.rs", ASKED),
    ("render/", ASKED),
    ("pilot/", ASKED),
];

/// Names of [`WALKED`] in a file that may not use them.
fn walked(file: &str, text: &str) -> Vec<&'static str> {
    let text = stripped(text);
    let words: std::collections::HashSet<&str> = text
        .split(|c: char| !c.is_alphanumeric() && c != '_')
        .collect();
    let may = |word: &str| {
        let mut named = MAY_NAME.iter().filter(|(place, _)| file.starts_with(place));
        named.any(|(_, words)| words.contains(&word))
    };
    let wrong = |word: &&str| words.contains(word) && !may(word);
    let named = WALKED.iter().copied();
    named.filter(wrong).collect()
}

#[test]
fn architecture_only_the_walk_names_bodies_and_dispersion() {
    let src = root().join("src");
    let mut files = Vec::new();
    sources(&src, &mut files);
    let mut all = Vec::new();
    for path in files {
        let file = path.strip_prefix(&src).expect("below src");
        let file = file.to_string_lossy().into_owned();
        let text = std::fs::read_to_string(&path).expect("a source file");
        let words = walked(&file, &text);
        if !words.is_empty() {
            all.push(format!("src/{file}: {words:?}"));
        }
    }
    assert!(
        all.is_empty(),
        "a loop holds its estimator and nothing else (src/integrator/walk):\n{}",
        all.join("\n")
    );
    let line = "use super::walk::bodies::EnclosingBodies;";
    let found = walked("integrator/path/mod.rs", line);
    assert_eq!(found, ["EnclosingBodies", "bodies"]);
    assert!(walked("integrator/walk/mod.rs", line).is_empty());
}

#[test]
fn architecture_check_sees_every_form_of_import() {
    for (file, line, wrong) in [
        ("scene/mod.rs", "use crate::render::Spec;", true),
        (
            "scene/load/mesh.rs",
            "    let x = crate::integrator::drive(1);",
            true,
        ),
        ("math/frame.rs", "use super::super::scene::Scene;", true),
        (
            "bsdf/mod.rs",
            "use crate::{math::Vec3, scene::{Scene, Hit}};",
            true,
        ),
        (
            "integrator/walk/mod.rs",
            "use super::path::PathTracer;",
            true,
        ),
        (
            "integrator/walk/bodies.rs",
            "use super::super::{drive, path};",
            true,
        ),
        ("sampler.rs", "use crate::bsdf::Bsdf;", true),
        (
            "scene/mod.rs",
            "use crate::math::Vec3; // not crate::render",
            false,
        ),
        (
            "scene/mod.rs",
            "#[cfg(test)]\nmod tests {\n    use crate::render::quad;\n}\n",
            false,
        ),
        (
            "integrator/path/mod.rs",
            "use super::walk::observer::Vertex;",
            false,
        ),
        ("scene/page.rs", "use std::render::resolve;", false),
    ] {
        let found = faults(ROOMS[0], file, &format!("//! Text.\n{line}\n"));
        assert_eq!(!found.is_empty(), wrong, "{file}: {line}: {found:?}");
        assert!(
            found
                .iter()
                .all(|f| f.starts_with(&format!("src/{file}:2: "))),
            "{found:?}"
        );
    }
    // Text after the declaration of a test module in another file counts.
    let text = "#[cfg(test)]\nmod tests;\nuse crate::render::Spec;\n";
    assert_eq!(faults(ROOMS[0], "scene/mod.rs", text).len(), 1);
}

/// A package has no files from outside its folder, and symbolic links do not survive every way to copy a tree.
#[test]
fn architecture_crate_of_tables_holds_copies_of_tables_and_licences() {
    let root = root();
    let mut copies = vec!["LICENSE-APACHE".to_owned(), "LICENSE-MIT".to_owned()];
    for file in std::fs::read_dir(root.join("table/params")).unwrap() {
        let name = file.unwrap().file_name();
        copies.push(format!("params/{}", name.to_str().unwrap()));
    }
    assert!(copies.len() >= 4, "{copies:?}");
    for copy in copies {
        let [original, copied] = [root.join(&copy), root.join("table").join(&copy)];
        let same = std::fs::read(&original).unwrap() == std::fs::read(&copied).unwrap();
        assert!(same, "copy {copy} to table/{copy}");
    }
}
