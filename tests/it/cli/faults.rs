//! Places that benches and trainings cannot write to: exit code 4, what was there before is there as it was, and
//! nothing is left behind.

use super::Place;

const SUITE: &str = "seeds = 1\nsamples = [1]\n[[scene]]\nname = 'box'\nbuiltin = 'caustic-box'\nsize = [32, 32]\n\
                     reference_spp = 1\n[[method]]\nname = 'plain'\nmethod = 'plain'\n";

/// A name that no file can have.
fn long() -> String {
    "n".repeat(300)
}

/// Whether a folder without the right to write refuses to be written to; the user root may write everywhere.
#[cfg(unix)]
fn read_only(place: &Place, folder: &str) -> bool {
    use std::os::unix::fs::PermissionsExt;
    let path = place.path().join(folder);
    let mode = std::fs::Permissions::from_mode(0o555);
    std::fs::set_permissions(&path, mode).expect("permissions");
    std::fs::write(path.join("probe"), "").is_err()
}

/// Makes a folder one that can be removed again.
#[cfg(unix)]
fn writable(place: &Place, folder: &str) {
    use std::os::unix::fs::PermissionsExt;
    let path = place.path().join(folder);
    let _ = std::fs::remove_file(path.join("probe"));
    let mode = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(&path, mode).expect("permissions");
}

#[test]
#[cfg(unix)]
fn a_bench_that_cannot_write() {
    let place = Place::new();
    place.write("suite.toml", SUITE);
    place.opsr("bench suite.toml -o old.json").done();
    let state = || (place.files(), place.files_in("old.pictures"));
    let before = state();
    assert_eq!(before.1.len(), 2, "a reference and a picture");
    // Another moment: everything is to be measured anew.
    place.write("suite.toml", SUITE.replace("[1]", "[2]"));
    let refused = |ended: super::Ended, what: &str| {
        assert_eq!(ended.code, Some(4), "{what}: {}", ended.err);
        let mut now = state();
        now.0.insert("suite.toml".into(), SUITE.into());
        assert!(now == before, "{what} changed files");
    };
    std::fs::create_dir(place.path().join("folder.json")).expect("a folder");
    let long = long();
    for output in ["folder.json", "scene.glb/new.json", &long] {
        let ended = place.opsr(&format!("bench suite.toml -o {output}"));
        let stem = output.trim_end_matches("new.json");
        assert!(ended.err.contains(stem), "{output}: {}", ended.err);
        let _ = std::fs::remove_dir(place.path().join("folder.json"));
        refused(ended, output);
    }
    for bytes in [512, 2048] {
        let ended = place.opsr_on_a_full_disk(bytes, "bench suite.toml -o old.json");
        refused(ended, &format!("{bytes} bytes"));
    }
    if read_only(&place, "old.pictures") {
        let ended = place.opsr("bench suite.toml -o old.json");
        writable(&place, "old.pictures");
        refused(ended, "a folder that is read-only");
    }
    writable(&place, "old.pictures");
    place.opsr("bench suite.toml -o old.json").done();
    assert!(place.read("old.json") != before.0["old.json"]);
}

/// The page is written whole or not at all.
#[test]
#[cfg(unix)]
fn a_report_that_cannot_be_written() {
    let place = Place::new();
    place.write("suite.toml", SUITE);
    place.opsr("bench suite.toml -o results.json").done();
    place.write("old.html", "what was there before");
    let before = place.files();
    for (bytes, output) in [
        (1024, "old.html"),
        (1 << 20, "none/new.html"),
        (1 << 20, &long()),
    ] {
        let ended = place.opsr_on_a_full_disk(bytes, &format!("report results.json -o {output}"));
        assert_eq!(ended.code, Some(4), "{output}: {}", ended.err);
        assert!(ended.err.contains(output), "{}", ended.err);
        assert!(place.files() == before, "{output} changed files");
    }
    for file in ["suite.toml", "scene.glb", "/dev/zero"] {
        let ended = place.opsr(&format!("report {file} -o old.html"));
        assert_eq!(ended.code, Some(3), "{file}: {}", ended.err);
        assert!(ended.err.contains(file), "{}", ended.err);
    }
    assert!(place.files() == before);
}

#[cfg(all(unix, feature = "train"))]
mod training {
    use super::super::train::{TRAIN, place, train};
    use super::*;

    #[test]
    fn a_training_that_cannot_write() {
        let place = place();
        train(&place, "--steps 4").done();
        let run = "run/beta-0.001";
        let state = || (place.files(), place.files_in(run), place.files_in("params"));
        let before = state();
        let long = long();
        for option in ["--run", "--out"] {
            for folder in ["scene.glb", "scene.glb/new", &long] {
                let ended = train(&place, &format!("--steps 4 {option} {folder}"));
                assert_eq!(ended.code, Some(4), "{option} {folder}: {}", ended.err);
                assert!(ended.err.contains(folder), "{}", ended.err);
                assert!(state() == before, "{option} {folder} changed files");
            }
        }
        // The settings fit, the log and the checkpoint do not; then the log too, not the checkpoint.
        for bytes in [1024, 4096, 16384] {
            let mut ended = place.opsr_on_a_full_disk(bytes, &format!("{TRAIN} --steps 4"));
            assert_eq!(ended.code, Some(4), "{bytes}: {}", ended.err);
            let mut now = state();
            // The log begins anew with the training: it is a whole one, if a short one.
            now.1
                .insert("metrics.jsonl".into(), before.1["metrics.jsonl"].clone());
            assert!(now == before, "{bytes} bytes changed files");
            ended = train(&place, "--steps 4 --resume").done();
            assert_eq!(ended.err, "");
            assert!(place.files_in("params") == before.2, "{bytes} bytes");
        }
        for folder in [run, "params"] {
            if read_only(&place, folder) {
                let ended = train(&place, "--steps 4 --seed 5");
                writable(&place, folder);
                assert_eq!(ended.code, Some(4), "{folder}: {}", ended.err);
            }
            writable(&place, folder);
        }
    }

    #[test]
    fn progress_that_nobody_can_read_ends_no_training() {
        let place = place();
        let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
        let args = format!("{TRAIN} --steps 2 --progress json").replace("--progress none ", "");
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full");
        command.args(args.split_whitespace());
        command.stdout(full.expect("/dev/full"));
        super::super::Ended::of(command.output().expect("an end")).done();
    }
}
