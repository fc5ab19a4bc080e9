//! `opsr part` and `opsr merge`.

use super::TestFolder;
use crate::fuzz::repair::sealed;
use opsr_lab::gallery;

/// Splits by samples, by crops, and by both, in another order, and with other numbers of threads.
#[test]
fn parts_merge_to_the_bytes_of_the_single_render() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    for settings in [
        "--aov albedo,alpha,emission,indirect",
        "--opsr-table 0.3 --aov",
        "--opsr-table 0.3 --set levels=0,0.5,4",
        "--integrator bdpt",
        "--integrator sppm",
    ] {
        place
            .render(&format!("--spp 7 {settings} -o one.exr -o one.png"))
            .done();
        for parts in [
            vec!["--samples 5..7", "--samples 0..3", "--samples 3..5"],
            vec!["--spp 7 --crop 1/2,0,1/2,16", "--spp 7 --crop 0,0,1/2,16"],
            vec![
                "--samples 0..7 --crop 0,0,16,5",
                "--samples 4..7 --crop 0,5,16,11 --threads 3",
                "--samples 0..4 --crop 0,5,7,11",
                "--samples 0..4 --crop 7,5,9,11 --threads 1",
            ],
        ] {
            let mut names = String::new();
            for (i, part) in parts.iter().enumerate() {
                let part = format!("part scene.glb --size 16x16 {settings} {part} -o {i}.part");
                place.opsr(&part).done();
                names += &format!(" {i}.part");
            }
            let ended = place
                .opsr(&format!("merge{names} --spp 7 -o all.exr -o all.png"))
                .done();
            assert!(
                ended
                    .err
                    .starts_with("all.exr, all.png: 16x16, 7 spp from "),
                "{}",
                ended.err
            );
            for kind in ["exr", "png"] {
                let same = place.read(&format!("one.{kind}")) == place.read(&format!("all.{kind}"));
                assert!(same, "{kind}, {settings}, {parts:?}");
            }
        }
    }
    assert!(!place.path().join("out.exr").exists());
}

#[test]
fn parts_of_other_renders_are_refused_by_name() {
    let place = TestFolder::new();
    place.save("other.glb", &gallery::caustic_box());
    let part = |scene: &str, args: &str, name: &str| {
        let common = "--size 8x8 --progress none --integrator path";
        place
            .opsr(&format!("part {scene} {common} {args} -o {name}"))
            .done();
    };
    part("scene.glb", "--samples 0..2", "a.part");
    part("scene.glb", "--samples 2..4 --seed 1", "seed.part");
    part(
        "scene.glb",
        "--samples 2..4 --max-vertices 3",
        "vertices.part",
    );
    part("other.glb", "--samples 2..4", "scene.part");
    part("scene.glb", "--samples 3..4", "late.part");
    place.write("cut.part", &place.read("late.part")[..900]);
    let mut damaged = place.read("late.part");
    let end = damaged.len() - 40;
    damaged[end] ^= 1;
    place.write("damaged.part", damaged);
    place.write("text.part", "nothing");
    for (code, args, words) in [
        (
            3,
            "a.part seed.part",
            "seed.part: this part belongs to other settings: it has `",
        ),
        (
            3,
            "a.part vertices.part",
            "vertices.part: this part belongs to other settings: it has `",
        ),
        (
            3,
            "a.part scene.part",
            "scene.part: this part belongs to another scene: it has `",
        ),
        (
            3,
            "late.part a.part",
            "missing samples: 2..3 within 8x8 pixels at (0, 0)",
        ),
        (
            3,
            "a.part a.part",
            "a.part and a.part both have samples 0..2 of 8x8",
        ),
        (
            3,
            "a.part cut.part",
            "cut.part: its length is not that of its samples",
        ),
        (
            3,
            "a.part text.part",
            "text.part: not a part of a render of version 3: it begins with `nothing`",
        ),
        (3, "a.part none.part", "none.part: cannot be read"),
        (
            3,
            "a.part --spp 1",
            "a.part: samples 0..2 of 8x8 pixels at (0, 0): more than the 1",
        ),
        (
            3,
            "a.part --crop 0,0,4,4",
            "a.part: 8x8 pixels at (0, 0) leave the 4x4",
        ),
        (2, "a.part -o out.jpg", "ends in .exr or .png"),
        (2, "", "PART"),
        (4, "a.part -o none/out.exr", "no such folder"),
    ] {
        let ended = place.opsr(&format!("merge {args}"));
        assert_eq!(ended.code, Some(code), "{args}: {}", ended.err);
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
    }
    part("scene.glb", "--samples 2..3", "b.part");
    let ended = place.opsr("merge a.part b.part damaged.part");
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    let words = "damaged.part: a damaged part of a render: the checksum differs";
    assert!(ended.err.contains(words), "{}", ended.err);
    assert!(!place.path().join("out.exr").exists());
    for (args, words) in [
        ("--samples 0..4", "--output"),
        ("--samples 4..4 -o x", "expected A..B"),
        ("--samples 0..5 --spp 4 -o x", "has 4 samples, by --spp"),
        ("-o x -o y", "--output"),
        ("-o x --time 3s", "--time"),
        ("-o x --denoise", "--denoise"),
        (
            "-o x --resolve sharp",
            "--resolve: is for the whole picture",
        ),
        ("-o x --checkpoint c", "--checkpoint"),
        (
            "-o x --aov id",
            "--aov: a part keeps no position, id and time",
        ),
        (
            "-o x --aov each-level",
            "--aov: each-level is for the whole",
        ),
        ("-o x --integrator guided", "--integrator: a guide learns"),
        ("-o x --crop 0,0,99,99", "--crop"),
    ] {
        let ended = place.opsr(&format!("part scene.glb --size 8x8 {args}"));
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
    }
}

/// Help lists the options of each command: a part has no limits except samples and no options of the whole picture.
#[test]
fn parts_and_traces_list_their_own_options() {
    let place = TestFolder::new();
    let help = |command: &str| place.opsr(&format!("{command} --help")).done().out;
    for (command, there, not) in [
        (
            "part",
            "--resolve",
            ["--denoise", "--target-error", "--exposure"],
        ),
        ("trace", "--set", ["--aov", "--time", "--crop"]),
        ("resolve", "each-level", ["albedo", "--set", "--seed"]),
    ] {
        let help = help(command);
        assert!(help.contains(there), "{command}: {help}");
        for option in not {
            let line = |line: &&str| line.trim_start().starts_with(option);
            assert!(
                !help.lines().any(|l| line(&l)) && !help.contains(&format!("- {option}:")),
                "{command}: {option}"
            );
        }
    }
}

/// A part that is stopped, or that does not fit on the disk, leaves no file.
#[test]
#[cfg(unix)]
fn parts_are_whole_or_not_there() {
    let place = TestFolder::new();
    let long = "part scene.glb --size 64x64 --samples 1..1000000 -o long.part --progress json";
    let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
    command
        .args(long.split(' '))
        .stdout(std::process::Stdio::piped());
    let mut child = command.spawn().expect("the program");
    let mut line = String::new();
    let out = child.stdout.take().expect("a pipe");
    std::io::BufRead::read_line(&mut std::io::BufReader::new(out), &mut line).expect("progress");
    let id = child.id().to_string();
    assert!(
        std::process::Command::new("kill")
            .args(["-INT", &id])
            .status()
            .expect("kill")
            .success()
    );
    assert_eq!(child.wait().expect("an end").code(), Some(5));
    let ended = place.opsr_on_a_full_disk(
        4096,
        "part scene.glb --size 64x64 --samples 1..9 -o full.part",
    );
    assert_eq!(ended.code, Some(4), "{}", ended.err);
    assert_eq!(place.files().into_keys().collect::<Vec<_>>(), ["scene.glb"]);
}

/// Invalid numbers with a valid checksum: in a part of later samples, a checkpoint and AOVs.
#[test]
fn absurd_numbers_behind_a_right_checksum_are_refused() {
    let place = TestFolder::new();
    let path = "--integrator path --resolve raw";
    for (name, samples) in [("first.part", "0..1"), ("a.part", "1..3")] {
        let part = format!("part scene.glb --size 16x16 {path} --samples {samples} -o {name}");
        place.opsr(&part).done();
    }
    place
        .render("--spp 4 -o a.exr --checkpoint levels.ckpt")
        .done();
    place
        .render(&format!(
            "{path} --aov direct --spp 4 -o a.exr --checkpoint aov.ckpt"
        ))
        .done();
    for (file, number, command, words) in [
        (
            "a.part",
            (-1.0f32).to_le_bytes().to_vec(),
            "merge",
            "a sample is negative",
        ),
        (
            "levels.ckpt",
            (-1.0f32).to_le_bytes().to_vec(),
            "",
            "sums of the levels are negative",
        ),
        (
            "levels.ckpt",
            f32::NAN.to_le_bytes().to_vec(),
            "",
            "sums of the levels are not finite",
        ),
        (
            "levels.ckpt",
            (-1.0f32).to_le_bytes().to_vec(),
            "resolve",
            "sums of the levels are negative",
        ),
        (
            "aov.ckpt",
            f64::NAN.to_le_bytes().to_vec(),
            "aov",
            "sums of the AOVs are not finite",
        ),
    ] {
        let mut bytes = place.read(file);
        // The last numbers before the checksum.
        let end = bytes.len() - 32;
        bytes[end - number.len()..end].copy_from_slice(&number);
        place.write("absurd", sealed(bytes));
        let resume = "--spp 6 -o b.exr --checkpoint absurd --resume";
        let ended = match command {
            "merge" => place.opsr("merge first.part absurd -o b.exr"),
            "resolve" => place.opsr("resolve absurd -o b.exr"),
            "aov" => place.render(&format!("{path} --aov direct {resume}")),
            _ => place.render(resume),
        };
        assert_eq!(ended.code, Some(3), "{file}: {}", ended.err);
        assert!(
            ended.err.contains("absurd: ") && ended.err.contains(words),
            "{}",
            ended.err
        );
        assert!(!place.path().join("b.exr").exists());
    }
}
