//! Files and lines that are too long: exit code 3 and a short message.

use super::TestFolder;
use crate::fuzz::seeds;

/// Extends a file by a hole, which takes no disk space.
fn lengthen(place: &TestFolder, name: &str, bytes: u64) {
    let file = std::fs::File::options()
        .write(true)
        .open(place.path().join(name));
    file.and_then(|file| file.set_len(bytes))
        .expect("a file with a hole");
}

#[test]
fn environment_map_with_gigabytes_behind_it_is_refused() {
    let place = TestFolder::new();
    place.write("sky.hdr", &seeds::hdr()[0]);
    place.render("--spp 1 --env sky.hdr -o out.exr").done();
    lengthen(&place, "sky.hdr", (1 << 31) + 1);
    let ended = place.render("--spp 1 --env sky.hdr -o new.exr");
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    assert!(ended.err.contains("sky.hdr: more than"), "{}", ended.err);
    assert!(!place.path().join("new.exr").exists());
}

#[test]
fn errors_in_long_toml_lines_are_short() {
    let place = TestFolder::new();
    let line = format!("seeds = 5 # {0}\nlong ? {0}\n", "long ".repeat(99_999));
    place.write("line.toml", line);
    let before = place.files();
    for command in ["scenes reference --manifest", "bench"] {
        let ended = place.opsr(&format!("{command} line.toml"));
        let words = &ended.err;
        assert_eq!(ended.code, Some(3), "{words}");
        let place_in_it = "line.toml: line 2, column 6: ";
        assert!(words.contains(place_in_it), "{words}");
        assert!(words.contains("2 | long ? long long"), "{words}");
        assert!(words.len() < 500, "{words}");
        assert!(place.files() == before, "{command} changed files");
    }
}
