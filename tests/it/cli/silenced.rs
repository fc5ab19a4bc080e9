//! Commands whose messages cannot be written: standard error is a full device, or a pipe without a reader. Exit code
//! and files are those of a run with messages.

use super::{RunResult, TestFolder};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;
use std::process::Stdio;

/// A scene, a suite of one scene and one method, and the inputs of later commands.
fn place() -> TestFolder {
    let place = TestFolder::new();
    place.write(
        "suite.toml",
        "seeds = 1\nsamples = [1]\n[[scene]]\nname = 'box'\nbuiltin = 'caustic-box'\nsize = [16, 16]\nreference_spp = 1\n\
         [[method]]\nname = 'plain'\n",
    );
    for args in [
        "-o before.exr --checkpoint before.ckpt --opsr-table 0.3",
        "-o other.exr --seed 1",
    ] {
        place.render(&format!("--spp 2 {args}")).done();
    }
    for part in ["0..2", "2..4"] {
        let name = &part[..1];
        let args = format!("part scene.glb --size 16x16 --samples {part} -o {name}.part");
        place.opsr(&args).done();
    }
    place.opsr("bench suite.toml -o before.json").done();
    place
}

/// Files below a folder, by path.
fn tree(folder: &Path, found: &mut BTreeMap<String, Vec<u8>>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        match path.is_dir() {
            true => tree(&path, found),
            false => {
                let bytes = std::fs::read(&path).expect("a file");
                found.insert(path.display().to_string(), bytes);
            }
        }
    }
}

/// A copy of the folder.
fn copy(place: &TestFolder) -> TestFolder {
    let (made, mut files) = (TestFolder::new(), BTreeMap::new());
    tree(place.path(), &mut files);
    for (name, bytes) in files {
        let below = Path::new(&name).strip_prefix(place.path());
        let path = made.path().join(below.expect("a file of the folder"));
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("a folder");
        std::fs::write(path, bytes).expect("a file");
    }
    made
}

/// Runs a command in copies of a folder: with messages, and with messages lost in both ways.
fn same(original: &TestFolder, args: &str, code: i32) {
    let run = |lost: Option<Stdio>| {
        let place = copy(original);
        let ended = match lost {
            None => place.opsr(args),
            Some(stderr) => {
                let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
                let command = command.args(args.split_whitespace()).stderr(stderr);
                RunResult::of(
                    command
                        .stdout(Stdio::piped())
                        .output()
                        .expect("the program"),
                )
            }
        };
        let mut files = BTreeMap::new();
        tree(place.path(), &mut files);
        let below = place.path().display().to_string();
        let names: Vec<String> = files.keys().map(|name| name.replace(&below, "")).collect();
        let pictures = files
            .into_iter()
            .filter(|(name, _)| name.ends_with("picture.exr"));
        let pictures: Vec<Vec<u8>> = pictures.map(|(_, bytes)| bytes).collect();
        (ended.code, names, pictures, ended.err)
    };
    let read = run(None);
    assert_eq!(read.0, Some(code), "{args}: {}", read.3);
    let full = File::create("/dev/full").expect("a full device");
    let (gone, pipe) = std::io::pipe().expect("a pipe");
    drop(gone);
    for stderr in [Stdio::from(full), Stdio::from(pipe)] {
        let lost = run(Some(stderr));
        assert_eq!((&lost.0, &lost.1), (&read.0, &read.1), "{args}");
        assert!(lost.2 == read.2, "{args}: another picture");
    }
}

#[test]
fn messages_that_cannot_be_written_end_no_command() {
    let place = place();
    let picture = "--size 16x16 --reproducible -o picture.exr";
    for (args, code) in [
        (&*format!("render scene.glb --spp 2 {picture}"), 0),
        (
            &*format!("-vv render scene.glb --spp 2 {picture} --aov albedo"),
            0,
        ),
        (
            &*format!("render scene.glb --spp 8 --integrator auto {picture}"),
            0,
        ),
        (
            &*format!("render scene.glb --spp 8 --reference before.exr {picture}"),
            0,
        ),
        (
            &*format!("render scene.glb --spp 2 --env none --table missing {picture}"),
            2,
        ),
        (&*format!("render none.glb --spp 2 {picture}"), 3),
        ("part scene.glb --size 16x16 --samples 0..2 -o new.part", 0),
        ("merge 0.part 2.part -o merged.exr", 0),
        ("resolve before.ckpt -o again.exr", 0),
        ("compare before.exr other.exr", 0),
        ("compare before.exr other.exr --fail-above relMSE=0", 6),
        ("info scene.glb", 0),
        ("convert scene.glb -o copy.glb", 0),
        ("scenes write torus-in-glass", 0),
        ("bench suite.toml -o results.json", 0),
        ("report before.json -o page.html", 0),
        ("table show beta-0.001", 0),
        ("verify --tiny numeric", 0),
        ("completions bash", 0),
        ("man pages", 0),
        ("man scene.glb", 4),
    ] {
        same(&place, args, code);
    }
}

#[test]
#[cfg(feature = "train")]
fn messages_that_cannot_be_written_end_no_training() {
    use super::train;
    let place = train::place();
    same(&place, &format!("{}--steps 2", train::TRAIN), 0);
    let list = "--set manifest=\"list.toml\" --set spp=2 --set start=0.1";
    same(&place, &format!("record {list} --recordings shards"), 0);
    same(&place, "scenes reference --manifest list.toml --spp 8", 0);
}

/// `opsr view` serves its page although its messages have no reader.
#[test]
fn messages_that_cannot_be_written_end_no_viewer() {
    use std::io::{BufRead, BufReader};
    let place = TestFolder::new();
    let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
    command.args(["view", "scene.glb", "--port", "0", "--no-open"]);
    let full = File::create("/dev/full").expect("a full device");
    command.stdout(Stdio::piped()).stderr(full);
    let mut child = command.spawn().expect("the program");
    let out = child.stdout.take().expect("standard output");
    let line = BufReader::new(out)
        .lines()
        .next()
        .expect("a line")
        .expect("UTF-8");
    assert!(line.contains("http://"), "{line}");
    std::thread::sleep(std::time::Duration::from_millis(300));
    let ended = child.try_wait().expect("a status");
    child.kill().expect("an end");
    child.wait().expect("an end");
    assert!(ended.is_none(), "{ended:?}");
}
