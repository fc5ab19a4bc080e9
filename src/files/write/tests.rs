use super::*;
use std::os::unix::fs::symlink;

#[test]
fn write_removes_what_killed_writes_left_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let old = SystemTime::now() - 2 * ABANDONED;
    let make = |name: &str, modified: SystemTime| {
        let file = File::create(at(name)).unwrap();
        file.set_modified(modified).unwrap();
        file
    };
    let kept = [
        ".a.png.ABCDEF.par",
        ".a.png.ABCDEFG.part",
        ".a.png.b.ABCDEF.part",
        ".b.png.ABCDEF.part",
        "a.png.ABCDEF.part",
    ];
    for name in kept {
        make(name, old);
    }
    make(".a.png.young1.part", SystemTime::now());
    let written = make(".a.png.locked.part", old);
    written.lock().unwrap();
    make(".a.png.ABCDEF.part", old);
    write_bytes(&at("a.png"), b"picture").unwrap();
    assert!(!at(".a.png.ABCDEF.part").exists());
    let others = kept
        .iter()
        .chain(&[".a.png.young1.part", ".a.png.locked.part"]);
    for name in others {
        assert!(at(name).exists(), "{name}");
    }
    assert_eq!(folder.path().read_dir().unwrap().count(), kept.len() + 3);
    assert_eq!(std::fs::read(at("a.png")).unwrap(), b"picture");
    // Names as long as a file system allows.
    write_bytes(&at(&"ä".repeat(127)), b"long").unwrap();
}

#[test]
fn target_follows_links_and_tells_streams_from_files() {
    let folder = tempfile::tempdir().unwrap();
    let here = |name: &str| folder.path().join(name);
    std::fs::write(here("file"), "").unwrap();
    for (link, to) in [("a", "file"), ("b", "a"), ("c", "new"), ("d", "d")] {
        symlink(to, here(link)).unwrap();
    }
    let of = |name: &str| Target::of(&here(name));
    let whole = |name: &str| Target::Whole(here(name));
    for (name, expected) in [("file", "file"), ("b", "file"), ("c", "new"), ("e", "e")] {
        assert_eq!(of(name).unwrap(), whole(expected), "{name}");
    }
    assert!(of("d").is_err(), "a circle");
    assert!(of("file/e").is_err(), "a file is no folder");
    for stream in ["/dev/null", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/2"] {
        assert_eq!(Target::of(Path::new(stream)).unwrap(), Target::Stream);
    }
}
