//! Files that use one another, directly or indirectly: cycles of more than two files are listed, and none may grow.

use crate::architecture::{sources, stripped};
use crate::support::root;
use std::collections::{BTreeMap, BTreeSet};

/// Cycles of more than two files by folder. A cycle or file that is no longer part of one must leave the list.
#[rustfmt::skip]
const CIRCLES: &[(&str, &[&str])] = &[
    ("src", &["bsdf", "bsdf::clearcoated", "bsdf::film"]),
    ("src", &["scene", "scene::camera", "scene::features", "scene::finish", "scene::framing", "scene::geometry", "scene::instances", "scene::lamp", "scene::light", "scene::light::area", "scene::light::emission", "scene::light::many", "scene::light::punctual", "scene::material", "scene::medium", "scene::mesh", "scene::normals", "scene::parts", "scene::sensor"]),
];

/// Folders whose files are checked.
const FOLDERS: [&str; 8] = [
    "src",
    "crates/cli/src",
    "crates/formats/src",
    "crates/frames/src",
    "crates/lab/src",
    "crates/metric/src",
    "crates/train/src",
    "crates/view/src",
];

/// A path of a `use`, the name that it introduces, and true if the name is public.
struct Import {
    path: String,
    name: String,
    public: bool,
}

/// Adds the paths of a list of use trees.
fn add_trees(prefix: &str, trees: &str, public: bool, found: &mut Vec<Import>) {
    let (mut depth, mut start) = (0, 0);
    for (i, c) in trees.char_indices().chain([(trees.len(), ',')]) {
        match c {
            '{' => depth += 1,
            '}' => depth -= 1,
            ',' if depth == 0 => {
                let tree = trees[start..i].trim();
                start = i + 1;
                if let Some((head, group)) = tree.split_once('{') {
                    let group = group.strip_suffix('}').expect("a group");
                    add_trees(&format!("{prefix}{}", head.trim()), group, public, found);
                } else if !tree.is_empty() {
                    let (path, name) = tree.split_once(" as ").unwrap_or((tree, tree));
                    let name = name.rsplit("::").next().expect("a name");
                    found.push(Import {
                        path: format!("{prefix}{}", path.trim()),
                        name: name.trim().to_owned(),
                        public,
                    });
                }
            }
            _ => {}
        }
    }
}

/// Imports of a file, and its text without imports, module declarations and visibility scopes.
fn parted(text: &str) -> (Vec<Import>, String) {
    let (mut imports, mut body) = (Vec::new(), String::new());
    for statement in text.split_inclusive(';') {
        let line = statement.trim_start();
        let visible = line.strip_prefix("pub").unwrap_or(line);
        let scope = visible.strip_prefix('(').and_then(|v| v.split_once(')'));
        let item = scope.map_or(visible, |(_, item)| item).trim_start();
        if let Some(trees) = item.strip_prefix("use ") {
            let trees = trees.trim_end_matches(';');
            add_trees("", trees, line.starts_with("pub"), &mut imports);
        } else if !item.starts_with("mod ") {
            body += &statement.replace("(in crate::", "(");
        }
    }
    (imports, body)
}

/// Words of letters, digits and `_`, and with `paths` also colons.
fn words(text: &str, paths: bool) -> impl Iterator<Item = &str> {
    text.split(move |c: char| !(c.is_alphanumeric() || c == '_' || paths && c == ':'))
}

/// Files of a crate by the path of their module, which is empty for the root.
#[derive(Default)]
struct Files(BTreeMap<Vec<String>, (Vec<Import>, String)>);

impl Files {
    fn add(&mut self, file: &str, text: &str) {
        let path = file.trim_end_matches(".rs").trim_end_matches("/mod");
        let root = ["lib", "main", "mod"].contains(&path);
        let module = path.split('/').filter(|_| !root).map(str::to_owned);
        self.0.insert(module.collect(), parted(&stripped(text)));
    }

    /// The file of the last module in a path, past re-exports; `None` for a path of another crate.
    fn find(&self, module: &[String], path: &str, depth: u32) -> Option<Vec<String>> {
        let mut names = path.split("::").filter(|n| !n.is_empty()).peekable();
        let mut at = module.to_vec();
        match *names.peek()? {
            "crate" => at.clear(),
            "self" | "super" => {}
            name => {
                let child = [module, &[name.to_owned()]].concat();
                self.0.get(&child)?;
            }
        }
        names.next_if(|name| ["crate", "self"].contains(name));
        while names.next_if_eq(&"super").is_some() {
            at.pop();
        }
        for name in names {
            let child = [&at[..], &[name.to_owned()]].concat();
            if self.0.contains_key(&child) {
                at = child;
                continue;
            }
            let (imports, _) = self.0.get(&at)?;
            let mut exports = imports.iter().filter(|i| i.public && i.name == name);
            match exports.next() {
                Some(export) if depth < 8 => at = self.find(&at, &export.path, depth + 1)?,
                _ => break,
            }
        }
        self.0.contains_key(&at).then_some(at)
    }

    /// Files that a file uses. A name that is only re-exported is not used.
    fn used(&self, module: &[String]) -> BTreeSet<Vec<String>> {
        let (imports, body) = &self.0[module];
        let own: BTreeSet<&str> = words(body, false).collect();
        let imports = imports.iter();
        let imports = imports.filter(|i| !i.public || own.contains(i.name.as_str()));
        let inline = words(body, true).filter(|w| {
            let starts = ["crate::", "super::", "self::"];
            starts.iter().any(|start| w.starts_with(start))
        });
        let paths = imports.map(|i| i.path.as_str()).chain(inline);
        let files = paths.filter_map(|path| self.find(module, path, 0));
        files.filter(|file| file != module).collect()
    }

    /// Cycles of more than two files, each sorted.
    fn circles(&self) -> BTreeSet<Vec<String>> {
        let uses: BTreeMap<_, _> = self.0.keys().map(|file| (file, self.used(file))).collect();
        let reached = |from: &Vec<String>| {
            let (mut found, mut open) = (BTreeSet::new(), vec![from.clone()]);
            while let Some(file) = open.pop() {
                open.extend(uses[&file].difference(&found).cloned().collect::<Vec<_>>());
                found.extend(uses[&file].iter().cloned());
            }
            found
        };
        let all: BTreeMap<_, _> = uses.keys().map(|file| (*file, reached(file))).collect();
        let circle = |file: &Vec<String>| -> Vec<String> {
            let both = all[file].iter().filter(|other| all[*other].contains(file));
            both.map(|file| file.join("::")).collect()
        };
        let circles = all.keys().map(|file| circle(file));
        circles.filter(|circle| circle.len() > 2).collect()
    }
}

#[test]
fn architecture_circles_of_files_do_not_grow() {
    let mut found = Vec::new();
    for folder in FOLDERS {
        let source = root().join(folder);
        let (mut paths, mut files) = (Vec::new(), Files::default());
        sources(&source, &mut paths);
        for path in paths {
            let file = path.strip_prefix(&source).expect("below the folder");
            let text = std::fs::read_to_string(&path).expect("a source file");
            files.add(&file.to_string_lossy(), &text);
        }
        found.extend(files.circles().into_iter().map(|circle| (folder, circle)));
    }
    let listed: Vec<_> = CIRCLES
        .iter()
        .map(|(folder, circle)| {
            let circle: Vec<String> = circle.iter().map(|&file| file.to_owned()).collect();
            (*folder, circle)
        })
        .collect();
    assert!(found == listed, "circles of files: {found:#?}");
}

#[test]
fn architecture_circles_are_found_in_every_form_of_import() {
    let circles = |files: &[(&str, &str)]| {
        let mut all = Files::default();
        files.iter().for_each(|(file, text)| all.add(file, text));
        all.circles()
            .into_iter()
            .map(|c| c.join(" "))
            .collect::<Vec<_>>()
    };
    let end = (
        "a/mod.rs",
        "pub mod b;\nmod c;\npub(crate) use b::{B as Bee, D};\npub use c::C;\n",
    );
    let b = ("a/b.rs", "use super::c::C;\nfn b() {}\n");
    for c in [
        "use crate::d::D;",
        "use crate::{d::{D, E}};",
        "fn c() -> super::super::d::D {}",
    ] {
        for d in [
            "use crate::a::Bee;",
            "use crate::a::b::{self, B};",
            "fn d() { crate::a::Bee }",
        ] {
            let found = circles(&[
                ("lib.rs", "mod a;\nmod d;"),
                end,
                b,
                ("a/c.rs", c),
                ("d.rs", d),
            ]);
            assert_eq!(found, ["a::b a::c d"], "{c} {d}");
        }
    }
    // A test, a comment, a visibility scope and another crate's module of that name are no uses.
    for d in [
        "#[cfg(test)]\nmod tests {\n    use crate::a::Bee;\n}\n",
        "// crate::a::Bee",
        "pub(in crate::a::b) fn d() {}",
        "use a::b::B;",
    ] {
        let found = circles(&[
            ("lib.rs", ""),
            end,
            b,
            ("a/c.rs", "use crate::d::D;"),
            ("d.rs", d),
        ]);
        assert_eq!(found, [""; 0], "{d}");
    }
}
