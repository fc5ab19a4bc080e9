//! The committed training scenes equal the command's output, and their manifest fits them.

use crate::support::root;
use opsr_lab::gallery::{self, training};
use opsr_train::manifest::{Manifest, Role};
use std::path::{Path, PathBuf};

fn committed() -> PathBuf {
    root().join("training_scenes")
}

#[test]
fn training_scenes_on_disk_are_what_the_command_writes() {
    let folder = tempfile::tempdir().unwrap();
    let files = training::write(folder.path()).unwrap();
    let manifest = Manifest::load(&committed().join("manifest.toml")).unwrap();
    assert_eq!(files.len(), manifest.scenes.len() + 1);
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
            let mut scenes = manifest.scenes.iter();
            assert!(scenes.any(|e| stem == e.name.as_str()), "{path:?} is stale");
        }
    }
}

#[test]
fn manifest_names_scenes_with_their_cameras_and_the_readme_names_all() {
    let manifest = Manifest::load(&committed().join("manifest.toml")).unwrap();
    let readme = std::fs::read_to_string(committed().join("README.md")).unwrap();
    for entry in &manifest.scenes {
        let parts = gallery::builtin(&entry.name).expect("a builtin scene");
        assert!(entry.camera < parts.cameras.len(), "{}", entry.name);
        assert_eq!(entry.file, Path::new(&format!("{}.glb", entry.name)));
        assert!(
            readme.contains(&format!("| `{}` |", entry.name)),
            "{}",
            entry.name
        );
    }
    assert!(manifest.of(Role::Train).count() >= 7);
    assert!(manifest.of(Role::Validation).count() >= 1);
}

#[test]
fn manifest_that_is_absent_is_named() {
    let error = Manifest::load(Path::new("no/such/manifest.toml")).unwrap_err();
    assert!(
        error.to_string().starts_with("no/such/manifest.toml: "),
        "{error}"
    );
}
