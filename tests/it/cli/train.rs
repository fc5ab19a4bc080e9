//! `opsr train` from scenes to tables: output, resumption, errors.

use super::{RunResult, TestFolder};
use opsr::regularise::file::TableFile;
use opsr_lab::gallery;

/// A short training of one crop. Later options override these.
pub(super) const TRAIN: &str = "train --set manifest=\"list.toml\" --set spp=2 --set start=0.1 --set validate_every=2 \
                                --set checkpoint_every=1 --run run --out params --progress none ";

/// A folder with a manifest of two scenes that have references.
pub(super) fn place() -> TestFolder {
    place_of(1)
}

/// A folder as [`place`] makes it, with this many training crops.
fn place_of(crops: u32) -> TestFolder {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    let entry = |name: &str, role: &str, crops: &[[u32; 2]]| {
        format!(
            "[[scene]]\nname = \"{name}\"\nfile = \"scene.glb\"\nrole = \"{role}\"\nfamily = \"{name}\"\n\
             frame = [64, 64]\ncrops = {crops:?}\nmax_vertices = 6\nexposure = 1.0\n"
        )
    };
    let training: Vec<[u32; 2]> = (0..crops).map(|i| [32 - 4 * i, 32]).collect();
    let list = entry("a", "train", &training) + &entry("b", "validation", &[[0, 32]]);
    place.write("list.toml", list);
    place
        .opsr("scenes reference --manifest list.toml --spp 4")
        .done();
    place
}

pub(super) fn train(place: &TestFolder, args: &str) -> RunResult {
    // The options of folders may be given only once.
    let mut all = TRAIN.to_owned();
    for folder in ["--run", "--out"] {
        if args.contains(folder) {
            all = all
                .replace(&format!("{folder} run "), "")
                .replace(&format!("{folder} params "), "");
        }
    }
    place.opsr(&format!("{all}{args}"))
}

#[test]
fn output_is_tables_a_log_and_a_report() {
    let place = place();
    train(&place, "--steps 4 --beta 0.001,0.05").done();
    let names = |folder: &str| place.files_in(folder).into_keys().collect::<Vec<_>>();
    assert_eq!(names("params"), ["beta-0.001.json", "beta-0.05.json"]);
    let run = [
        "beta-0.001",
        "beta-0.05",
        "config.toml",
        "report.html",
        "report.json",
    ];
    assert_eq!(names("run"), run);
    let files = [
        "best.json",
        "last.ckpt",
        "metrics.csv",
        "metrics.jsonl",
        "table.json",
    ];
    assert_eq!(names("run/beta-0.001"), files);
    let log = String::from_utf8(place.read("run/beta-0.001/metrics.jsonl")).unwrap();
    assert_eq!(log.lines().count(), 3, "{log}");
    let csv = String::from_utf8(place.read("run/beta-0.001/metrics.csv")).unwrap();
    let rows: Vec<&str> = csv.lines().collect();
    assert_eq!((rows.len(), rows[0]), (4, "step,seconds,loss,validation"));
    for (row, line) in rows[1..].iter().zip(log.lines()) {
        let entry: serde_json::Value = serde_json::from_str(line).unwrap();
        let cells: Vec<&str> = row.split(',').collect();
        assert_eq!((cells.len(), cells[0]), (4, &*entry["step"].to_string()));
        let loss: f64 = cells[2].parse().unwrap();
        assert_eq!(Some(loss), entry["loss"].as_f64());
        assert!(entry["crops"][0]["energy"].is_f64(), "{line}");
    }
    let tables = ["beta-0.001", "beta-0.05"].map(|name| {
        let path = place.path().join(format!("params/{name}.json"));
        TableFile::load(&path).unwrap()
    });
    for (table, beta) in tables.iter().zip([0.001, 0.05]) {
        let provenance = table.provenance.as_ref().unwrap();
        assert!((provenance.beta - beta).abs() < 1e-6 && provenance.steps == 4);
        assert_eq!(provenance.scenes.len(), 1, "{:?}", provenance.scenes);
    }
    // The written settings reproduce the tables.
    let before = place.files_in("params");
    place
        .opsr("train --config run/config.toml --run other --out more --progress none")
        .done();
    assert!(place.files_in("more") == before);
    // A render can use the tables.
    place
        .render("--spp 1 -o out.exr --opsr-table params/beta-0.05.json")
        .done();
}

#[test]
fn resume_gives_the_same_tables() {
    let place = place();
    train(&place, "--steps 7").done();
    let whole = place.files_in("params");
    let report = place.read("run/beta-0.001/metrics.jsonl");
    std::fs::remove_dir_all(place.path().join("run")).unwrap();
    std::fs::remove_dir_all(place.path().join("params")).unwrap();
    train(&place, "--steps 3").done();
    assert!(place.files_in("params") != whole);
    train(&place, "--steps 7 --resume --threads 3").done();
    assert!(place.files_in("params") == whole);
    let steps = |log: &[u8]| -> Vec<serde_json::Value> {
        let lines = std::str::from_utf8(log).unwrap().lines();
        let entry = |l| serde_json::from_str::<serde_json::Value>(l).unwrap();
        lines.map(|l| entry(l)["step"].clone()).collect()
    };
    let log = place.read("run/beta-0.001/metrics.jsonl");
    assert!(steps(&report).iter().all(|s| steps(&log).contains(s)));
    // Other settings and a damaged file are refused, and no file is overwritten.
    let before = place.files_in("run/beta-0.001");
    let refused = |args: &str, words: &str| {
        let ended = train(&place, args);
        assert_eq!(ended.code, Some(3), "{args}: {}", ended.err);
        assert!(
            ended.err.contains("last.ckpt") && ended.err.contains(words),
            "{}",
            ended.err
        );
    };
    refused("--steps 9 --resume --seed 1", "other settings");
    assert!(place.files_in("run/beta-0.001") == before);
    place.write("run/beta-0.001/last.ckpt", &before["last.ckpt"][..99]);
    refused("--steps 9 --resume", "a damaged training checkpoint");
    assert!(place.files_in("params") == whole);
    // A log that is too long is refused, too.
    place.write("run/beta-0.001/last.ckpt", &before["last.ckpt"]);
    let log = std::fs::File::create(place.path().join("run/beta-0.001/metrics.jsonl"));
    log.unwrap().set_len((1 << 26) + 1).unwrap();
    let ended = train(&place, "--steps 9 --resume");
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    assert!(
        ended.err.contains("metrics.jsonl: more than"),
        "{}",
        ended.err
    );
    assert!(place.files_in("params") == whole);
}

/// Ctrl-C during a long training.
#[test]
#[cfg(unix)]
fn resume_after_an_interrupt_gives_the_same_tables() {
    let place = place();
    let args = format!("{TRAIN} --steps 4000000000");
    let ended = place.interrupted(&args, "run/beta-0.001/last.ckpt");
    assert_eq!(ended.code, Some(5), "{}", ended.err);
    assert!(!place.path().join("params/beta-0.001.json").exists());
    let table = TableFile::load(&place.path().join("run/beta-0.001/table.json")).unwrap();
    let more = table.provenance.unwrap().steps + 2;
    train(&place, &format!("--steps {more} --resume")).done();
    let resumed = place.files_in("params");
    train(&place, &format!("--steps {more} --force")).done();
    assert!(place.files_in("params") == resumed);
}

/// Ctrl-C during recording: finished crops are kept, and the tables are the same.
#[test]
#[cfg(unix)]
fn resume_after_an_interrupt_of_the_recording_gives_the_same_tables() {
    let place = place_of(4);
    let args = "--steps 3 --set spp=300";
    let first = "run/recordings/000-a-32-32.recording";
    let ended = place.interrupted(&format!("{TRAIN} {args}"), first);
    assert_eq!(ended.code, Some(5), "{}", ended.err);
    let kept = place.files_in("run/recordings").len();
    assert!((1..5).contains(&kept), "{kept}");
    // Without --resume a run with recordings is not replaced.
    let refused = train(&place, args);
    assert_eq!(refused.code, Some(2), "{}", refused.err);
    assert!(refused.err.contains("run holds a run"), "{}", refused.err);
    let other = train(&place, &format!("{args} --seed 5 --resume"));
    assert_eq!(other.code, Some(3), "{}", other.err);
    assert!(other.err.contains("run/recordings/00"), "{}", other.err);
    train(&place, &format!("{args} --resume")).done();
    let resumed = place.files_in("params");
    // A finished run removes its recordings.
    assert!(!place.path().join("run/recordings").exists());
    train(&place, &format!("{args} --force")).done();
    assert!(place.files_in("params") == resumed);
    // JSON progress names the crops.
    let args = args.replace("300", "2") + " --force --progress json";
    let all = format!("{TRAIN} {args}").replace("--progress none", "");
    let ended = place.opsr(&all).done();
    let line = ended.out.lines().find(|l| l.contains("recording"));
    let line: serde_json::Value = serde_json::from_str(line.expect("a line")).unwrap();
    assert_eq!(
        (&line["of"], &line["done"]),
        (&5.into(), &0.into()),
        "{line}"
    );
}

/// An existing table or run is replaced only with `--force`.
#[test]
fn force_is_needed_to_overwrite_tables_and_runs() {
    let place = place();
    let all = || {
        let folders = ["run", "run/beta-0.001", "params"];
        folders.map(|folder| place.files_in(folder))
    };
    train(&place, "--steps 3").done();
    std::fs::create_dir(place.path().join("empty")).unwrap();
    let before = all();
    for (args, word) in [
        ("--steps 2", "run holds a run"),
        (
            "--steps 2 --run other",
            "params/beta-0.001.json exists: --force",
        ),
        (
            "--steps 2 --run none --resume",
            "none: there is no such run",
        ),
        (
            "--steps 2 --run empty --resume",
            "empty: an empty folder: nothing to resume",
        ),
        (
            "--steps 2 --beta 0.9 --resume --run run",
            "run: no checkpoint or recording of these",
        ),
    ] {
        let ended = train(&place, &format!("{args} --out params"));
        let code = if args.contains("resume") { 3 } else { 2 };
        assert_eq!(ended.code, Some(code), "{args}: {}", ended.err);
        assert!(ended.err.contains(word), "{args}: {}", ended.err);
        assert!(all() == before, "{args} changed files");
    }
    for folder in ["other", "none"] {
        assert!(!place.path().join(folder).exists(), "{folder}");
    }
    // A resumed run replaces its own table, but no other table.
    train(&place, "--steps 4 --resume").done();
    place.write("params/beta-0.001.json", "another table");
    let ended = train(&place, "--steps 5 --resume");
    assert_eq!(ended.code, Some(2), "{}", ended.err);
    assert!(place.read("params/beta-0.001.json") == b"another table");
    train(&place, "--steps 3 --force").done();
    assert!(place.files_in("params") == before[2]);
    // Tables of presets have names of their own.
    train(&place, "--preset fast --steps 2 --run fast").done();
    train(&place, "--preset published --steps 2 --run published").done();
    let names: Vec<String> = place.files_in("params").into_keys().collect();
    let expected = ["beta-0.001", "fast-beta-0.001", "published-beta-0.001"];
    assert_eq!(names, expected.map(|name| format!("{name}.json")));
}

#[test]
fn errors_name_the_setting_or_file() {
    let place = place();
    place.write("bad.toml", "steps = \"many\"\n");
    place.write("line.toml", format!("beta = [{}?]\n", "1, ".repeat(9999)));
    let long = place.path().join("long.toml");
    std::fs::write(long, vec![b'#'; (1 << 20) + 1]).unwrap();
    let before = place.files();
    for (code, args, words) in [
        (3, "--config none.toml", "none.toml"),
        (3, "--config bad.toml", "bad.toml"),
        (3, "--config long.toml", "long.toml"),
        (3, "--config line.toml", "line.toml: line 1, column 30006: "),
        (3, "--config /dev/zero", "/dev/zero"),
        (2, "--set speed=3", "speed"),
        (2, "--set steps=0", "steps"),
        (2, "--beta=-1", "beta"),
        (2, "--model round", "round"),
        (2, "--steps many", "--steps"),
        (2, "--preset huge", "huge"),
    ] {
        let ended = train(&place, args);
        assert_eq!(ended.code, Some(code), "{args}: {}", ended.err);
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
        assert!(ended.err.len() < 800, "{args}: {}", ended.err);
        assert!(place.files() == before, "{args} changed files");
    }
    for (args, words) in [
        ("--set manifest=\"none.toml\"", "none.toml"),
        ("--set scenes=[\"z\"]", "no training scene `z`"),
    ] {
        let ended = train(&place, args);
        assert_eq!(ended.code, Some(3), "{args}: {}", ended.err);
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
    }
    // Without references a training is impossible.
    std::fs::remove_dir_all(place.path().join("references")).unwrap();
    let ended = train(&place, "--steps 1");
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    assert!(ended.err.contains("there is no reference"), "{}", ended.err);
}

/// Runs `opsr record` with the settings in `extra`.
fn record(place: &TestFolder, extra: &str) -> RunResult {
    let settings = "--set manifest=\"list.toml\" --set spp=2 --set start=0.1";
    place.opsr(&format!("record {settings} {extra}"))
}

/// Recordings of other processes, in any order, give the same tables as a training that records itself.
#[test]
fn recordings_of_several_processes_give_the_same_tables() {
    let place = place_of(2);
    let args = "--steps 5 --beta 0.001,0.05";
    train(&place, args).done();
    let whole = place.files_in("params");
    // Three recordings: two training crops and one for validation. Settings of the learning do not affect them.
    record(
        &place,
        "--recordings shards --crops 1..3 --threads 1 --beta 3",
    )
    .done();
    let learn = format!("{args} --run other --out mine --recordings shards");
    let refused = |code: i32, words: &[&str]| {
        let ended = train(&place, &learn);
        assert_eq!(ended.code, Some(code), "{}", ended.err);
        for word in words {
            assert!(ended.err.contains(word), "{word}: {}", ended.err);
        }
        assert!(place.files_in("mine").is_empty());
    };
    refused(3, &["shards: missing recordings", "000-a-32-32.recording"]);
    record(&place, "--recordings shards --crops 0..1 --threads 3").done();
    let shards = place.files_in("shards");
    assert_eq!(shards.len(), 3);
    train(&place, &learn).done();
    assert!(place.files_in("mine") == whole);
    // These recordings are kept for other trainings.
    assert!(place.files_in("shards") == shards);
    assert!(!place.path().join("other/recordings").exists());
    // Complete recordings are not repeated.
    let message = record(&place, "--recordings shards").done().err;
    assert!(
        message.contains("shards: recordings of 3 of 3 crops"),
        "{message}"
    );
    assert!(place.files_in("shards") == shards);

    for folder in ["mine", "other"] {
        std::fs::remove_dir_all(place.path().join(folder)).unwrap();
    }
    // Other settings, half of a file, and a file of no crop.
    let first = "shards/001-a-28-32.recording";
    let bytes = place.read(first);
    record(&place, "--recordings more --crops 1..2 --seed 1").done();
    place.write(first, place.read("more/001-a-28-32.recording"));
    refused(3, &[first, "other settings"]);
    let ended = record(&place, "--recordings shards");
    assert!(
        ended.code == Some(3) && ended.err.contains(first),
        "{}",
        ended.err
    );
    place.write(first, &bytes[..bytes.len() / 2]);
    refused(3, &[first, "a damaged recording"]);
    let ended = record(&place, "--recordings shards");
    assert!(
        ended.code == Some(3) && ended.err.contains("damaged"),
        "{}",
        ended.err
    );
    place.write(first, &bytes);
    place.write("shards/003-b.recording", &bytes);
    refused(3, &["shards/003-b.recording", "belongs to no crop"]);

    #[cfg(unix)]
    {
        let args = "record --set manifest=list.toml --set spp=2 --recordings full --progress none";
        let ended = place.opsr_on_a_full_disk(4096, args);
        assert_eq!(ended.code, Some(4), "{}", ended.err);
        assert!(ended.err.contains("full/00"), "{}", ended.err);
        assert!(place.files_in("full").is_empty());
    }
    for (args, words) in [
        (
            "--recordings shards --crops 2..4",
            "--crops 2..4: there are 0..3",
        ),
        ("--recordings shards --crops 2..2", "expected A..B"),
        ("--crops 0..1", "--recordings"),
    ] {
        let ended = record(&place, args);
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
    }
}

#[test]
#[cfg(unix)]
fn record_resumes_after_an_interrupt() {
    let place = place_of(6);
    let args =
        "record --set manifest=\"list.toml\" --set spp=300 --recordings shards --progress none";
    let ended = place.interrupted(args, "shards/000-a-32-32.recording");
    assert_eq!(ended.code, Some(5), "{}", ended.err);
    let kept = place.files_in("shards");
    assert!((1..7).contains(&kept.len()), "{}", kept.len());
    place.opsr(args).done();
    let all = place.files_in("shards");
    assert_eq!(all.len(), 7);
    assert!(kept.iter().all(|(name, bytes)| all[name] == *bytes));
}
