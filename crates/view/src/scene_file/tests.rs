use super::*;

fn message(files: &[(&str, &[u8])]) -> Vec<u8> {
    let list: Vec<_> = (files.iter())
        .map(|(name, bytes)| serde_json::json!({ "name": name, "size": bytes.len() }))
        .collect();
    let list = serde_json::Value::from(list).to_string();
    let mut all = (list.len() as u32).to_le_bytes().to_vec();
    all.extend(list.bytes());
    all.extend(files.iter().flat_map(|(_, bytes)| *bytes));
    all
}

/// Dropped files are in a folder of their own, which is deleted with their scene or with all dropped files.
#[test]
fn dropped_files_are_kept_as_long_as_their_scene() {
    let dropped = Dropped::default();
    let files: [(&str, &[u8]); 2] = [("chair/a b.gltf", b"{}"), ("chair/maps/wood.png", b"x")];
    let scene = dropped.unpacked(&message(&files)).expect("a scene");
    assert!(scene.is_dropped() && scene.name == "chair/a b.gltf" && scene.title() == "a b");
    assert_eq!(std::fs::read(&scene.path).expect("a file"), b"{}");
    let map = scene.path.with_file_name("maps").join("wood.png");
    assert_eq!(std::fs::read(map).expect("a file"), b"x");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let folder = scene.folder.as_ref().expect("a folder").path();
        let mode = folder.metadata().expect("a folder").permissions().mode();
        assert_eq!(mode & 0o077, 0);
    }
    let path = scene.path.clone();
    let fault = scene.redacted(Fault::Input(format!("{}: cannot read", path.display())));
    assert_eq!(fault.message(Names::Flags), "chair/a b.gltf: cannot read");
    drop(scene);
    assert!(!path.exists());
    let scene = dropped
        .unpacked(&message(&[("a.GLB", b"y")]))
        .expect("a scene");
    assert!(scene.path.exists());
    dropped.remove();
    assert!(!scene.path.exists());
}

/// Names that leave the folder, messages of a wrong length, and files without a scene are refused.
#[test]
fn dropped_files_stay_in_their_folder() {
    let dropped = Dropped::default();
    let refused = |bytes: &[u8], words: &str| {
        let fault = dropped.unpacked(bytes).expect_err("a refusal");
        let what = fault.message(Names::Flags);
        assert!(what.contains(words), "{what}");
    };
    for name in [
        "/etc/a.glb",
        "../a.glb",
        "a/../../b.glb",
        "./a.glb",
        "a//b.glb",
        "",
        "..\\a.glb",
        "C:a.glb",
        "a\0.glb",
        &"a/".repeat(20),
        &"a".repeat(600),
    ] {
        refused(&message(&[("x.glb", b""), (name, b"")]), "leads out");
    }
    refused(&message(&[("a.png", b"")]), "one scene");
    refused(&message(&[("a.glb", b""), ("b.gltf", b"")]), "one scene");
    refused(&message(&[("a.glb", b""), ("a.glb", b"")]), "one scene");
    refused(
        &message(&[("a.glb", b""), ("b", b""), ("b", b"")]),
        "exists",
    );
    refused(&[1, 0], "list");
    refused(&[255, 255, 255, 255, b'['], "list");
    let good = message(&[("a.glb", b"12345")]);
    refused(&good[..good.len() - 1], "shorter");
    refused(&[&good[..], b"6"].concat(), "longer");
    refused(&message(&vec![("a", &b""[..]); MAX_FILES + 1]), "more than");
}
