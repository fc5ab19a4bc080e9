//! The committed training scenes are what the command writes, and their manifest reads back.

use opsr::gallery::manifest::{Manifest, Role};
use opsr::gallery::training::{self, EXAMPLES};
use std::path::Path;

fn committed() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/training_scenes"))
}

#[test]
fn committed_files_are_what_the_command_writes() {
    let folder = tempfile::tempdir().unwrap();
    let files = training::write(folder.path()).unwrap();
    assert_eq!(files.len(), EXAMPLES.len() + 1);
    let mut total = 0;
    for file in files {
        let name = file.file_name().unwrap();
        let ours = std::fs::read(&file).unwrap();
        let theirs = std::fs::read(committed().join(name)).unwrap();
        assert!(
            ours == theirs,
            "{name:?} is out of date: run `opsr scenes write`"
        );
        total += ours.len();
    }
    assert!(total < 3_000_000, "{total} bytes are too many to commit");
    for file in std::fs::read_dir(committed()).unwrap() {
        let path = file.unwrap().path();
        let stem = path.file_stem().unwrap();
        if path.extension().is_some_and(|e| e == "glb") {
            assert!(EXAMPLES.iter().any(|e| e.name == stem), "{path:?} is stale");
        }
    }
}

#[test]
fn the_manifest_says_what_the_code_says() {
    let manifest = Manifest::load(&committed().join("manifest.toml")).unwrap();
    assert_eq!(manifest.scenes.len(), EXAMPLES.len());
    for (entry, example) in manifest.scenes.iter().zip(EXAMPLES) {
        assert_eq!(entry.name, example.name);
        assert_eq!(entry.role, example.role);
        assert_eq!(entry.family, example.family);
        assert_eq!(entry.frame, example.frame);
        assert_eq!(entry.crops, example.crops);
        assert_eq!(entry.max_vertices, example.max_vertices);
        assert_eq!(entry.exposure, example.exposure);
        assert_eq!(entry.note, example.note);
        assert!(manifest.file(entry).exists());
        assert!(entry.camera < (example.build)().cameras.len());
    }
    assert!(manifest.of(Role::Train).count() >= 7);
    assert!(manifest.of(Role::Validation).count() >= 1);
}

#[test]
fn every_training_scene_is_named_in_the_readme() {
    let readme = std::fs::read_to_string(committed().join("README.md")).unwrap();
    for example in EXAMPLES {
        assert!(readme.contains(example.name), "{}", example.name);
    }
}

#[test]
fn an_absent_manifest_is_named() {
    let error = Manifest::load(Path::new("no/such/manifest.toml")).unwrap_err();
    assert!(
        error.to_string().starts_with("no/such/manifest.toml: "),
        "{error}"
    );
}
