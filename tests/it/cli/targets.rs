//! Outputs that are not regular files: links are followed, and pipes and devices are written to and stay.

use super::{RunResult, TestFolder};
use crate::fuzz::seeds;
use opsr::image::exr;
use std::os::unix::fs::{FileTypeExt, symlink};
use std::process::{Command, Stdio};

/// A folder with a table and several links.
fn place() -> TestFolder {
    let place = TestFolder::new();
    place.write("table.json", &seeds::tables()[1]);
    std::fs::create_dir(place.path().join("far")).expect("a folder");
    for (link, to) in [
        ("old.exr", "far/old.exr"),
        ("new.exr", "far/new.exr"),
        ("full.h", "/dev/full"),
        ("out.h", "/dev/stdout"),
    ] {
        symlink(to, place.path().join(link)).expect("a link");
    }
    place
}

fn is_link(place: &TestFolder, name: &str) -> bool {
    place.path().join(name).is_symlink()
}

#[test]
fn output_links_stay_and_their_targets_are_replaced() {
    let place = place();
    place.write("far/old.exr", "what was there before");
    place.render("--spp 1 -o old.exr -o new.exr").done();
    for name in ["old.exr", "new.exr"] {
        assert!(is_link(&place, name), "{name}");
        exr::read_rgb(&place.path().join("far").join(name)).expect("a picture");
    }
}

#[test]
fn output_pipe_stays_a_pipe_and_gets_the_bytes() {
    let place = place();
    let pipe = place.path().join("pipe.h");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.is_ok_and(|status| status.success()));
    let export = "table export table.json -o";
    place.opsr(&format!("{export} file.h")).done();
    // The reader ends if nothing is written.
    let mut reader = place.command("timeout");
    reader.args(["60", "cat", "pipe.h"]).stdout(Stdio::piped());
    let reader = reader.spawn().expect("cat");
    let writer = place.opsr(&format!("{export} pipe.h"));
    let is_pipe = pipe.symlink_metadata().unwrap().file_type().is_fifo();
    if !is_pipe {
        let _ = reader.wait_with_output();
        panic!("the pipe became a file");
    }
    writer.done();
    let read = reader.wait_with_output().expect("bytes").stdout;
    assert!(read == place.read("file.h"));
}

#[test]
#[cfg(target_os = "linux")]
fn output_devices_are_written_into() {
    let place = place();
    let export = "table export table.json -o";
    place.opsr(&format!("{export} file.h")).done();
    let ended = place.opsr(&format!("{export} full.h"));
    assert_eq!(ended.code, Some(4), "{}", ended.err);
    assert!(ended.err.contains("full.h"), "{}", ended.err);
    let shown = place.opsr(&format!("{export} out.h")).done();
    assert!(shown.out.as_bytes() == place.read("file.h"));
    // Standard output that is a file is not replaced.
    let file = std::fs::File::create(place.path().join("said")).expect("a file");
    let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
    command.args(format!("{export} out.h").split_whitespace());
    command.stdout(file);
    RunResult::of(command.output().expect("the program")).done();
    assert!(place.read("said") == place.read("file.h"));
    assert!(is_link(&place, "full.h") && is_link(&place, "out.h"));
}

/// Ctrl-C during loading: nothing needs to be saved, so the program ends at once. Unlike a scene, a table can be a
/// pipe.
#[test]
fn interrupt_while_inputs_load_ends_with_its_exit_code() {
    let place = TestFolder::new();
    let pipe = place.path().join("slow.json");
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.is_ok_and(|status| status.success()));
    let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
    command.args("render scene.glb --opsr-table slow.json -o out.exr --spp 1".split(' '));
    let mut child = command.stderr(Stdio::piped()).spawn().expect("the program");
    // This blocks until the program reads.
    let writer = std::fs::OpenOptions::new().write(true).open(&pipe);
    let kill = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(kill.expect("kill").success());
    assert_eq!(child.wait().expect("an end").code(), Some(5));
    drop(writer);
    assert!(!place.path().join("out.exr").exists());
}
