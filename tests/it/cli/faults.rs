//! Benches and trainings that cannot write: exit code 4, old files unchanged, no new files.

#[cfg(unix)]
use super::shut::Shut;
use super::{RunResult, TestFolder};
use crate::fuzz::seeds;
use crate::support::gltf::File;
use opsr::image::{Buffer, exr};
use opsr::math::Rgb;
use serde_json::json;

const SUITE: &str = "seeds = 1\nsamples = [1]\n[[scene]]\nname = 'box'\nbuiltin = 'caustic-box'\nsize = [32, 32]\n\
                     reference_spp = 1\n[[method]]\nname = 'plain'\n";

/// A file name that is too long for any file system.
fn long() -> String {
    "n".repeat(300)
}

#[test]
#[cfg(unix)]
fn exit_code_of_a_bench_that_cannot_write() {
    let place = TestFolder::new();
    place.write("suite.toml", SUITE);
    place.opsr("bench suite.toml -o old.json").done();
    let state = || (place.files(), place.files_in("old.pictures"));
    let before = state();
    assert_eq!(before.1.len(), 2, "a reference and a picture");
    // With another time point everything is measured again.
    place.write("suite.toml", SUITE.replace("[1]", "[2]"));
    let refused = |ended: RunResult, what: &str| {
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
    if let Some(shut) = Shut::new(&place, "old.pictures") {
        let ended = shut.opsr("bench suite.toml -o old.json");
        assert!(ended.err.contains("old.pictures"), "{}", ended.err);
        refused(ended, "a folder that is read-only");
    }
    place.opsr("bench suite.toml -o old.json").done();
    assert!(place.read("old.json") != before.0["old.json"]);
}

/// The page is written completely or not at all.
#[test]
#[cfg(unix)]
fn exit_code_of_a_report_that_cannot_be_written() {
    let place = TestFolder::new();
    place.write("suite.toml", SUITE);
    place.opsr("bench suite.toml -o results.json").done();
    place.write("old.html", "what was there before");
    let before = place.files();
    let long = long();
    for (bytes, output, words) in [
        (1024, "old.html", "old.html"),
        (1 << 20, "none/new.html", "none: no such folder"),
        (1 << 20, &long, &long),
    ] {
        let ended = place.opsr_on_a_full_disk(bytes, &format!("report results.json -o {output}"));
        assert_eq!(ended.code, Some(4), "{output}: {}", ended.err);
        assert!(ended.err.contains(words), "{}", ended.err);
        assert!(place.files() == before, "{output} changed files");
    }
    for file in ["suite.toml", "scene.glb", "/dev/zero"] {
        let ended = place.opsr(&format!("report {file} -o old.html"));
        assert_eq!(ended.code, Some(3), "{file}: {}", ended.err);
        assert!(ended.err.contains(file), "{}", ended.err);
    }
    assert!(place.files() == before);
}

/// Every command that writes, with a read-only folder.
#[test]
#[cfg(unix)]
fn exit_code_of_a_read_only_folder() {
    let place = TestFolder::new();
    place.write("suite.toml", SUITE.replace("[1]", "[1, 2]"));
    place.opsr("bench suite.toml -o results.json").done();
    place.write("table.json", &seeds::tables()[1]);
    for name in ["a.exr", "b.exr"] {
        let picture = Buffer::filled(4, 4, Rgb::ONE);
        exr::write_rgb(&place.path().join(name), &picture, &Default::default()).expect("written");
    }
    std::fs::create_dir(place.path().join("shut")).expect("a folder");
    for name in ["old.exr", "old.png", "old.json", "old.html", "old.h"] {
        place.write(&format!("shut/{name}"), "what was there before");
    }
    place
        .render("--spp 1 -o old.exr --checkpoint shut/old.ckpt")
        .done();
    let list = "[[scene]]\nname = \"a\"\nfile = \"scene.glb\"\nrole = \"train\"\nfamily = \"f\"\n\
                frame = [32, 32]\ncrops = [[0, 0]]\nmax_vertices = 3\nexposure = 1.0\n";
    place.write("shut/list.toml", list);
    place.save("shut/scene.glb", &opsr_lab::gallery::caustic_box());
    let state = || (place.files(), place.files_in("shut"));
    let before = state();
    let Some(shut) = Shut::new(&place, "shut") else {
        return;
    };
    let render = "render scene.glb --size 16x16 --reproducible --progress none";
    for (args, name) in [
        (format!("{render} --spp 1 -o shut/old.exr"), "shut/old.exr"),
        (
            format!("{render} --spp 1 -o new.exr -o shut/old.png"),
            "shut/old.png",
        ),
        (format!("{render} --spp 1 -o shut/new.exr"), "shut/new.exr"),
        (
            format!("{render} --spp 1 -o new.exr --checkpoint shut/new.ckpt"),
            "shut/new.ckpt",
        ),
        (
            format!("{render} --spp 2 -o new.exr --checkpoint shut/old.ckpt --resume"),
            "shut/old.ckpt",
        ),
        ("table export table.json -o shut/old.h".into(), "shut/old.h"),
        ("bench suite.toml -o shut/new.json".into(), "shut/new."),
        (
            "report results.json -o shut/old.html".into(),
            "shut/old.html",
        ),
        (
            "report results.json -o new.html --plots shut".into(),
            "shut/",
        ),
        (
            "compare a.exr b.exr --json shut/old.json".into(),
            "shut/old.json",
        ),
        (
            "compare a.exr b.exr --page shut/old.html".into(),
            "shut/old.html",
        ),
        ("compare a.exr b.exr --maps shut".into(), "shut/"),
        ("scenes write --out shut".into(), "shut/"),
        (
            "scenes reference --manifest shut/list.toml --spp 1".into(),
            "shut/",
        ),
    ] {
        let ended = shut.opsr(&args);
        assert_eq!(ended.code, Some(4), "{args}: {}", ended.err);
        assert!(ended.err.contains(name), "{args}: {}", ended.err);
        assert!(state() == before, "{args} changed files");
    }
}

#[cfg(all(unix, feature = "train"))]
mod training {
    use super::super::train::{TRAIN, place, train};
    use super::*;

    #[test]
    fn exit_code_of_a_training_that_cannot_write() {
        let place = place();
        train(&place, "--steps 4").done();
        let run = "run/beta-0.001";
        let state = || (place.files(), place.files_in(run), place.files_in("params"));
        let before = state();
        let long = long();
        for option in ["--run", "--out"] {
            for folder in ["scene.glb", "scene.glb/new", &long] {
                let ended = train(&place, &format!("--steps 4 --force {option} {folder}"));
                assert_eq!(ended.code, Some(4), "{option} {folder}: {}", ended.err);
                assert!(ended.err.contains(folder), "{}", ended.err);
                assert!(state() == before, "{option} {folder} changed files");
            }
        }
        // First the settings fit, but not the log and the checkpoint; then the log fits, too, but not the checkpoint.
        for bytes in [1024, 4096, 16384] {
            let mut ended = place.opsr_on_a_full_disk(bytes, &format!("{TRAIN} --steps 4 --force"));
            assert_eq!(ended.code, Some(4), "{bytes}: {}", ended.err);
            let mut now = state();
            // A new training starts a new log and new curves, which are complete even if short.
            for log in ["metrics.jsonl", "metrics.csv"] {
                now.1.insert(log.into(), before.1[log].clone());
            }
            assert!(now == before, "{bytes} bytes changed files");
            ended = train(&place, "--steps 4 --resume").done();
            assert_eq!(ended.err, "");
            assert!(place.files_in("params") == before.2, "{bytes} bytes");
        }
        for folder in [run, "run", "params"] {
            let before = (place.files_in(folder), place.files_in("params"));
            let Some(shut) = Shut::new(&place, folder) else {
                return;
            };
            let ended = shut.opsr(&format!("{TRAIN} --steps 4 --force --seed 5"));
            assert_eq!(ended.code, Some(4), "{folder}: {}", ended.err);
            assert!(ended.err.contains(folder), "{folder}: {}", ended.err);
            let now = (place.files_in(folder), place.files_in("params"));
            assert!(now == before, "{folder}: changed files");
        }
    }

    #[test]
    fn closed_progress_pipe_does_not_end_a_training() {
        let place = place();
        let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
        let args = format!("{TRAIN} --steps 2 --progress json").replace("--progress none ", "");
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full");
        command.args(args.split_whitespace());
        command.stdout(full.expect("/dev/full"));
        super::super::RunResult::of(command.output().expect("an end")).done();
    }
}

/// A checkpoint that cannot be saved may be saved later: the render continues, and its picture is written.
#[test]
#[cfg(unix)]
fn a_checkpoint_that_cannot_be_saved_ends_no_render() {
    let place = TestFolder::new();
    let render = "render scene.glb --size 16x16 --spp 64 --threads 1 --progress none";
    place.opsr(&format!("{render} -o whole.png")).done();
    let ended = place.opsr_on_a_full_disk(
        4096,
        &format!("{render} --save-every 1ms --checkpoint a.ckpt -o out.png"),
    );
    assert_eq!(ended.code, Some(4), "{}", ended.err);
    for words in ["the render continues and tries again", "a.ckpt"] {
        assert!(ended.err.contains(words), "{}", ended.err);
    }
    assert!(place.read("out.png") == place.read("whole.png"));
    assert!(!place.path().join("a.ckpt").exists());
}

/// A file that cannot be written does not prevent the others.
#[test]
#[cfg(unix)]
fn files_that_can_be_written_are() {
    let place = TestFolder::new();
    let args = "render scene.glb --size 32x32 --spp 2 --progress none --exr none -o out.exr -o out.png --stats out.json";
    let ended = place.opsr_on_a_full_disk(16384, args);
    assert_eq!(ended.code, Some(4), "{}", ended.err);
    assert!(ended.err.contains("out.exr"), "{}", ended.err);
    let files: Vec<String> = place.files().into_keys().collect();
    assert_eq!(files, ["out.json", "out.png", "scene.glb"]);
}

/// No output replaces an input or another output.
#[test]
fn outputs_have_names_of_their_own() {
    let place = TestFolder::new();
    place.write("table.json", &seeds::tables()[1]);
    place.render("--spp 1 -o a.exr").done();
    std::fs::create_dir(place.path().join("folder")).expect("a folder");
    let before = place.files();
    let read = "would replace a file that is read";
    let twice = "is the name of two outputs";
    let render = "render scene.glb --size 8x8 --spp 1 --progress none";
    for (args, words) in [
        (format!("{render} -o o.exr --stats scene.glb"), read),
        (
            format!("{render} -o o.exr --stats folder/../scene.glb"),
            read,
        ),
        (
            "part scene.glb --size 8x8 --spp 1 -o scene.glb".into(),
            read,
        ),
        (
            format!("{render} -o o.exr --opsr-table table.json --stats table.json"),
            read,
        ),
        (format!("{render} -o a.exr --env a.exr"), read),
        (format!("{render} -o a.exr --reference a.exr"), read),
        (format!("{render} -o o.exr --stats o.exr"), twice),
        (
            format!("{render} -o o.exr --checkpoint folder/../o.exr"),
            twice,
        ),
        (format!("{render} -o o.exr -o o.exr"), twice),
        ("compare a.exr a.exr --page a.exr".into(), read),
        (
            "compare a.exr a.exr --page p.html --json p.html".into(),
            twice,
        ),
    ] {
        let ended = place.opsr(&args);
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
        assert!(place.files() == before, "{args}");
    }
    // Devices are not files.
    #[cfg(unix)]
    place
        .opsr(&format!("{render} -o o.exr --stats /dev/null"))
        .done();
}

#[test]
fn a_black_picture_of_a_lit_scene_is_named() {
    let place = TestFolder::new();
    let mut file = File::triangle();
    file.json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    file.json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }] } });
    file.push("nodes", json!({ "translation": [0, 0, 2], "extensions": { "KHR_lights_punctual": { "light": 0 } } }));
    place.write("lit.glb", file.glb());
    let render = |crop: &str| {
        let args = format!("render lit.glb --size 16x16 --spp 4 --progress none -o out.png {crop}");
        place.opsr(&args).done().err
    };
    assert!(render("--crop 0,0,1,1").contains("the picture is black"));
    assert!(!render("").contains("the picture is black"));
}

/// A checkpoint in use is refused for a second render, and the first render is not affected.
#[test]
#[cfg(unix)]
fn checkpoint_in_use_is_refused() {
    let place = TestFolder::new();
    let args = "render scene.glb --size 32x32 --spp 1000000 --progress none --save-every 20ms --checkpoint a.ckpt -o out.exr";
    let mut second = None;
    let first = place.meanwhile("INT", args, "a.ckpt", || {
        second = Some(place.render("--spp 1 --checkpoint a.ckpt -o second.exr"));
    });
    assert_eq!(first.code, Some(5), "{}", first.err);
    let second = second.expect("a second render");
    assert_eq!(second.code, Some(4), "{}", second.err);
    let words = "a.ckpt: another process is using it";
    assert!(second.err.contains(words), "{}", second.err);
    let files: Vec<String> = place.files().into_keys().collect();
    assert_eq!(files, ["a.ckpt", "out.exr", "scene.glb"]);
    // The checkpoint can be used again.
    let args = "render scene.glb --size 32x32 --time 10ms --checkpoint a.ckpt --resume -o out.exr";
    place.opsr(args).done();
}

/// A picture that another program changes during a render is replaced, with a warning.
#[test]
#[cfg(unix)]
fn picture_changed_during_a_render_is_named() {
    let place = TestFolder::new();
    let args = "render scene.glb --size 32x32 --spp 1000000 --progress none --save-every 10s --stats seen.csv -o out.exr -o out.png";
    let ended = place.meanwhile("INT", args, "seen.csv", || {
        place.write("out.png", "another picture");
    });
    assert_eq!(ended.code, Some(5), "{}", ended.err);
    let words = "out.png: was changed by another program";
    assert!(ended.err.contains(words), "{}", ended.err);
    assert!(!ended.err.contains("out.exr: was"), "{}", ended.err);
    // The render's own saves cause no warning.
    let args =
        "render scene.glb --size 16x16 --spp 400 --progress none --save-every 1ms -o out.png";
    let ended = place.opsr(args).done();
    assert!(!ended.err.contains("was changed"), "{}", ended.err);
}
