//! Failures: the documented exit code, a message that names the cause, and no changed file.

use super::{RunResult, TestFolder};
use crate::fuzz::seeds;
use crate::support::gltf::File;
use opsr::image::{Buffer, exr};
use opsr::math::Rgb;
use serde_json::json;

fn half(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.len() / 2]
}

/// A folder with valid and invalid files of every kind, and older results.
fn place() -> TestFolder {
    let place = TestFolder::new();
    place.write("old.exr", "what was there before");
    place.write("old.png", "what was there before");
    place.write("old.json", "what was there before");
    place.write("garbage.glb", "glTF but not really");
    place.write("text.gltf", "{\"asset\": {\"version\": \"2.0\"}");
    let mut dangling = File::triangle();
    dangling.json["nodes"][0]["mesh"] = json!(7);
    place.write("dangling.gltf", dangling.gltf());
    let mut required = File::triangle();
    required.json["extensionsRequired"] = json!(["EXT_dream", "KHR_materials_ior", "EXT_sleep"]);
    place.write("required.gltf", required.gltf());
    place.write("table.json", &seeds::tables()[1]);
    place.write("short.json", half(&seeds::tables()[1]));
    let future = String::from_utf8(seeds::tables()[0].clone()).expect("text");
    place.write(
        "future.json",
        future.replacen("\"version\": 1", "\"version\": 9", 1),
    );
    place.write("sky.hdr", &seeds::hdr()[0]);
    place.write("short.hdr", half(&seeds::hdr()[0]));
    place.write(
        "empty.hdr",
        "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 0 +X 5\n",
    );
    place.write("short.exr", half(&seeds::exr()[0]));
    place.write("short.png", half(&seeds::png()[0]));
    for (name, width) in [("a.exr", 4), ("b.exr", 4), ("wide.exr", 5)] {
        let picture = Buffer::filled(width, 4, Rgb::ONE);
        exr::write_rgb(&place.path().join(name), &picture, &Default::default()).expect("written");
    }
    let far = "[[scene]]\nname = \"a\"\nfile = \"scene.glb\"\nrole = \"train\"\nfamily = \"f\"\ncamera = 9\n\
               frame = [32, 32]\ncrops = [[0, 0]]\nmax_vertices = 3\nexposure = 1.0\n";
    place.write("far.toml", far);
    place.write("suite.toml", "seeds = 5\n[[scene]]\nname = 3\n");
    place.write("state.ckpt", "opsrckp1 and nothing behind");
    std::fs::create_dir(place.path().join("folder.exr")).expect("a folder");
    place
}

/// Exit code, arguments, and a part of the message.
const CASES: &[(i32, &str, &str)] = &[
    // Wrong usage.
    (2, "", "Usage"),
    (2, "paint scene.glb", "unrecognized subcommand"),
    (2, "render", "<SCENE>"),
    (2, "render scene.glb --spp 0", "--spp"),
    (
        2,
        "render scene.glb --spp -3",
        "'-3' for '--spp <N>': expected a whole number from 1",
    ),
    (
        2,
        "render scene.glb --opsr-table -1",
        "'-1' for '--opsr-table <TABLE|X>': expected a table, or a factor from 0 to 1",
    ),
    (
        2,
        "bench suite.toml --threads -2",
        "'-2' for '--threads <N>'",
    ),
    (2, "table show table.json --top -2", "'-2' for '--top <N>'"),
    (2, "render scene.glb --spp 4294967296", "--spp"),
    (2, "render scene.glb --time soon", "--time"),
    (2, "render scene.glb --size 0x5", "--size"),
    (2, "render scene.glb --size 640", "WIDTHxHEIGHT"),
    (2, "render scene.glb --size 70000x1", "65536"),
    (
        2,
        "render scene.glb --size 65536x65536",
        "--size: 65536x65536 pixels are more",
    ),
    (2, "render scene.glb --crop 1,2,3", "--crop"),
    (
        2,
        "render scene.glb --size 16x16 --crop 8,8,9,8",
        "--crop: the window of 9x8 pixels at (8, 8) is empty or not inside the picture of 16x16 pixels",
    ),
    (2, "render scene.glb --size 16x16 --crop 8,8,0,8", "--crop"),
    (2, "render scene.glb --opsr-table 1.5", "from 0 to 1"),
    (2, "render scene.glb --opsr-table nan", "from 0 to 1"),
    (
        2,
        "render scene.glb --gamma 0.3",
        "--gamma is --opsr-table X now",
    ),
    (
        2,
        "render scene.glb --radius=0.3",
        "--radius is --set radius=R now",
    ),
    (2, "render scene.glb --film a.part", "--film is `opsr part`"),
    (2, "render scene.glb --set", "a value is required"),
    (
        2,
        "render scene.glb --set rad=3",
        "no key `rad`: there are levels",
    ),
    (
        2,
        "render scene.glb --set spp=3",
        "an option of its own, --spp",
    ),
    (2, "render scene.glb --set radius", "expected radius=R"),
    (
        2,
        "render scene.glb --set mode=pbrt --set mode=reuse",
        "--set mode: given twice",
    ),
    (2, "render scene.glb --exr half,half", "expected none, rle"),
    (2, "render scene.glb --camera 1,2,3", "expected ten numbers"),
    (
        2,
        "render scene.glb --sun 30,0,1 --env sky",
        "a haze from 1.8 to 10",
    ),
    (
        2,
        "render scene.glb --opsr-table 0.1 --opsr-table table.json",
        "cannot be used multiple times",
    ),
    (2, "render scene.glb --set table_scale=2", "--opsr-table"),
    (
        2,
        "render scene.glb --set table_scale=2 --opsr-table 0.3",
        "--set table_scale: is of a table, not of one factor",
    ),
    (
        2,
        "render scene.glb --opsr-table table.json --set table_scale=0",
        "above 0",
    ),
    (2, "render scene.glb --set mode=reuse", "needs --opsr-table"),
    (2, "render scene.glb --set consistent", "needs --opsr-table"),
    (
        2,
        "render scene.glb --opsr-table 0.1 --set consistent=0.5",
        "between 0 and 0.5",
    ),
    (
        2,
        "render scene.glb --integrator sppm --opsr-table table.json",
        "--opsr-table: is of --integrator path, guided, bdpt, vcm and mlt, not of sppm",
    ),
    (
        2,
        "render scene.glb --integrator light --set mode=mollifier",
        "light takes no mode",
    ),
    (
        2,
        "render scene.glb --integrator bdpt --set mode=reuse --opsr-table 0.1",
        "--set mode: --integrator bdpt takes no mode but mollifier",
    ),
    (
        2,
        "render scene.glb --integrator vcm --set mode=pbrt",
        "--set mode: --integrator vcm takes no mode",
    ),
    (
        2,
        "render scene.glb --integrator bdpt --set trials=3",
        "--set trials: is of --integrator manifold, not of bdpt",
    ),
    (
        2,
        "render scene.glb --integrator guided --set mode=pbrt",
        "--set mode: --integrator guided takes no mode",
    ),
    (
        2,
        "render scene.glb --integrator guided --set unbiased",
        "--set unbiased: needs --opsr-table",
    ),
    (
        2,
        "render scene.glb --integrator guided --opsr-table 0.1 --set levels=3",
        "--set levels: ",
    ),
    (
        2,
        "render scene.glb --integrator bdpt --set strategy=1",
        "expected S,T with S from 0 and T from 1",
    ),
    (
        2,
        "render scene.glb --integrator bdpt --set strategy=0,1",
        "two vertices or more",
    ),
    (
        2,
        "render scene.glb --integrator bdpt --set strategy=merges",
        "only --integrator vcm has merges",
    ),
    (
        2,
        "render scene.glb --integrator bdpt --set strategy=9,9 --max-vertices 15",
        "--set strategy: paths of 16 scattering vertices are longer than --max-vertices 15",
    ),
    (
        2,
        "render scene.glb --exposure 1 -o old.exr",
        "--exposure: is of PNG files",
    ),
    (
        2,
        "render scene.glb --view agx -o old.exr",
        "--view: is of PNG files",
    ),
    (
        2,
        "render scene.glb --exr half -o old.png",
        "--exr: is of EXR files",
    ),
    (
        2,
        "render scene.glb --env sky --env-intensity 1e36",
        "--env-intensity: makes surroundings of radiance",
    ),
    (
        2,
        "render scene.glb --set strategy=1,2",
        "--set strategy: needs --integrator bdpt or vcm",
    ),
    (
        2,
        "render scene.glb --integrator bdpt --opsr-table 0.1 --set strategy=1,2",
        "--set strategy: cannot be used with --opsr-table",
    ),
    (
        2,
        "render scene.glb --integrator bdpt --set radius=0.1",
        "--set radius: is of --integrator vcm and sppm, not of bdpt",
    ),
    (
        2,
        "render scene.glb --integrator bdpt --set connections=nee",
        "--set connections: is of --integrator vcm, not of bdpt",
    ),
    (
        2,
        "render scene.glb --integrator vcm --set radius=0",
        "above 0",
    ),
    (
        2,
        "render scene.glb --integrator sppm --set radius=inf",
        "above 0",
    ),
    (
        2,
        "render scene.glb --integrator vcm --set radius_alpha=0",
        "above 0 and at most 1",
    ),
    (
        2,
        "render scene.glb --integrator ups --set radius_alpha=1.5",
        "above 0 and at most 1",
    ),
    (
        2,
        "render scene.glb --set mode=pbrt --opsr-table 0.1",
        "has a rule of its own",
    ),
    (
        2,
        "render scene.glb --set mode=filter-glossy --set filter=inf",
        "above 0",
    ),
    (
        2,
        "render scene.glb --set filter=2",
        "--set filter: needs --set mode=filter-glossy",
    ),
    (2, "render scene.glb --set mode=sharpen", "sharpen"),
    (2, "render scene.glb --exposure nan", "--exposure"),
    (
        2,
        "render scene.glb --env sky.hdr --env-rotation inf",
        "--env-rotation",
    ),
    (2, "render scene.glb --threads 0", "--threads"),
    (2, "render scene.glb --seed -1", "'-1' for '--seed <N>'"),
    (2, "render scene.glb --resume", "--checkpoint"),
    (2, "render scene.glb --set levels=5", "scale the factors"),
    (
        2,
        "render scene.glb --set mode=pbrt --set levels=5",
        "scale the factors",
    ),
    (
        2,
        "render scene.glb --opsr-table 0.1 --set levels=9",
        "2 to 8 levels",
    ),
    (
        2,
        "render scene.glb --opsr-table 0.1 --set levels=0,2,1",
        "ascending",
    ),
    (
        2,
        "render scene.glb --opsr-table 0.1 --set levels=5 --set mode=reuse",
        "reuse",
    ),
    (
        2,
        "render scene.glb --opsr-table 0.1 --set levels=5 --set consistent",
        "consistent",
    ),
    (
        2,
        "render scene.glb -o old.jpg",
        "old.jpg: expected a name that ends in",
    ),
    (
        2,
        "render scene.glb -o old",
        "old: expected a name that ends in",
    ),
    (
        2,
        "render scene.glb --checkpoint state.ckpt",
        "state.ckpt exists",
    ),
    (
        2,
        "table export table.json -o old.exr",
        "old.exr: no format for this extension",
    ),
    (2, "compare a.exr", "PICTURE"),
    (2, "compare a.exr b.exr --exposures 0,nan", "--exposures"),
    // Inputs.
    (3, "render none.glb", "none.glb"),
    (3, "render .", ".: "),
    (3, "render garbage.glb", "garbage.glb: GLB header"),
    (3, "render text.gltf", "text.gltf: JSON: EOF"),
    (
        3,
        "render dangling.gltf",
        "dangling.gltf: nodes[0].mesh: index out of range",
    ),
    (
        3,
        "render required.gltf",
        "required.gltf: extensionsRequired: EXT_dream, EXT_sleep are not supported",
    ),
    (3, "render old.png -o new.exr", "old.png: not a glTF file"),
    (3, "info none.glb", "none.glb"),
    (3, "info --json text.gltf", "text.gltf: JSON"),
    (3, "render scene.glb --camera none", "no camera `none`"),
    (3, "render scene.glb --camera 7", "no camera `7`"),
    (3, "render scene.glb --opsr-table none.json", "none.json"),
    (
        3,
        "render scene.glb --opsr-table scene.glb",
        "scene.glb: expected value",
    ),
    (
        3,
        "render scene.glb --opsr-table short.json",
        "short.json: invalid number at line 134",
    ),
    (
        3,
        "render scene.glb --opsr-table future.json",
        "future.json: version: 9 where",
    ),
    (
        3,
        "render scene.glb --opsr-table /dev/zero",
        "/dev/zero: more than",
    ),
    (3, "render scene.glb --env none.hdr", "none.hdr"),
    (3, "render scene.glb --env short.hdr", "short.hdr"),
    (
        3,
        "render scene.glb --env empty.hdr",
        "empty.hdr: a map without texels",
    ),
    (
        3,
        "render scene.glb --env sky.hdr --env-intensity 3e38",
        "sky.hdr: texel (0, 0) is",
    ),
    (3, "render scene.glb --env short.exr", "short.exr"),
    (
        3,
        "render scene.glb --env table.json",
        "table.json: an environment map is",
    ),
    (
        3,
        "render scene.glb --checkpoint none.ckpt --resume",
        "none.ckpt",
    ),
    (
        3,
        "render scene.glb --checkpoint state.ckpt --resume",
        "state.ckpt: not a render checkpoint of version 4: it begins with `opsrckp1",
    ),
    (
        3,
        "render scene.glb --checkpoint a.exr --resume",
        "a.exr: not a render checkpoint",
    ),
    (3, "resolve a.exr", "a.exr: not a render checkpoint"),
    (3, "compare none.exr b.exr", "none.exr"),
    (3, "compare short.exr b.exr", "short.exr"),
    (3, "compare short.png b.exr", "short.png"),
    (3, "compare table.json b.exr", "table.json: not a picture"),
    (3, "compare wide.exr b.exr", "wide.exr against b.exr"),
    (3, "compare a.exr b.exr --agree", "b.exr: no channel"),
    (2, "compare a.exr b.exr --ppd 0", "from 1 to 1000"),
    (3, "table show none.json", "none.json"),
    (
        3,
        "table export future.json -o old.h",
        "future.json: version: 9",
    ),
    (3, "scenes reference --manifest none.toml", "none.toml"),
    (3, "scenes reference --manifest suite.toml", "suite.toml"),
    (3, "scenes reference --manifest far.toml --spp 1", "camera"),
    (3, "bench none.toml", "none.toml"),
    (3, "bench suite.toml -o old.json", "suite.toml"),
    // Outputs.
    (4, "table export table.json -o none/t.h", "none/t.h"),
    (
        4,
        "render scene.glb -o none/out.exr",
        "none: no such folder",
    ),
    (
        4,
        "render scene.glb -o scene.glb/out.png",
        "scene.glb: a file, not a folder",
    ),
    (
        4,
        "render scene.glb -o folder.exr",
        "folder.exr: is a folder",
    ),
    (
        4,
        "render scene.glb --checkpoint none/state.ckpt",
        "none: no such folder",
    ),
    (
        4,
        "compare a.exr b.exr --json none/out.json",
        "none/out.json",
    ),
    (
        4,
        "compare a.exr b.exr --page none/out.html",
        "none/out.html",
    ),
    (4, "compare a.exr b.exr --maps old.exr", "old.exr"),
    (4, "scenes write --out old.exr", "old.exr"),
];

#[test]
fn exit_codes_and_messages() {
    let place = place();
    let before = place.files();
    let mut wrong = Vec::new();
    for &(code, args, fragment) in CASES {
        // A command with an output of its own must not change it either.
        let args = match args.starts_with("render ") && !args.contains(" -o ") {
            true => format!("{args} -o old.exr -o old.png"),
            false => args.to_owned(),
        };
        let RunResult {
            code: found, err, ..
        } = place.opsr(&args);
        // Messages have one line, without repetition; those of the parsers of arguments and of TOML have more.
        let others = code == 2 && !err.starts_with("opsr: ") || fragment.ends_with("toml");
        let words = err.trim().rsplit_once(": ").unwrap_or_default();
        let lines = others || err.lines().count() == 1 && !words.0.contains(words.1);
        if found != Some(code) || !err.contains(fragment) || !lines || place.files() != before {
            wrong.push(format!(
                "opsr {args}\n  {found:?} for {code}, `{fragment}`: {err}"
            ));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn exit_codes_are_documented() {
    let help = TestFolder::new().opsr("--help").done().out;
    for words in [
        "0 done",
        "1 failed",
        "2 wrong usage",
        "3 an input",
        "4 a result",
        "5 stopped",
        "6 pictures differ",
    ] {
        let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(help.contains(words), "{words}");
    }
}

/// Standard output is a closed pipe, or a full disk.
#[test]
#[cfg(target_os = "linux")]
fn closed_pipe_is_no_error_and_full_output_is() {
    let place = place();
    for args in [
        "info scene.glb",
        "info --json scene.glb",
        "compare a.exr b.exr",
        "scenes write --out new",
        "table show table.json",
        "table export table.json -o - --format c",
        "render scene.glb --size 4x4 --spp 1 --progress json -o new.exr",
    ] {
        let run = |out: std::process::Stdio| {
            let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
            let command = command.args(args.split_whitespace());
            command.stderr(std::process::Stdio::piped());
            let child = command.stdout(out).spawn().expect("the program");
            RunResult::of(child.wait_with_output().expect("an end"))
        };
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        run(writer.into()).done();
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full");
        let ended = run(full.expect("/dev/full").into());
        if args.starts_with("render") {
            ended.done();
        } else {
            assert_eq!(ended.code, Some(4), "{args}: {}", ended.err);
            assert!(ended.err.contains("standard output"), "{}", ended.err);
        }
    }
}

/// A disk that fills up within a file, simulated by a limit on the size of files.
#[test]
#[cfg(unix)]
fn full_disk_leaves_the_old_picture() {
    let place = TestFolder::new();
    place.write("old.exr", "what was there before");
    place.write("old.png", "what was there before");
    let before = place.files();
    for output in [
        "-o old.exr",
        "-o old.png",
        "-o old.exr --checkpoint new.ckpt",
    ] {
        let program = env!("CARGO_BIN_EXE_opsr");
        // With the signal ignored, writing fails as on a full disk. Noise compresses badly, so every file is too long.
        let script = format!(
            "trap '' XFSZ; ulimit -f 1; exec {program} render scene.glb --size 64x64 --spp 2 --progress none {output}"
        );
        let mut shell = place.command("sh");
        let ended = RunResult::of(shell.args(["-c", &script]).output().expect("a shell"));
        assert_eq!(ended.code, Some(4), "{output}: {}", ended.err);
        assert!(place.files() == before, "{output} changed files");
    }
}

/// A pipe without a writer, which would block its reader.
#[test]
#[cfg(unix)]
fn environment_map_from_a_pipe_is_refused() {
    let place = TestFolder::new();
    let made = std::process::Command::new("mkfifo")
        .arg(place.path().join("sky.hdr"))
        .status();
    assert!(made.is_ok_and(|status| status.success()));
    let ended = place.render("--spp 1 --env sky.hdr -o new.exr");
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    assert!(
        ended.err.contains("sky.hdr: not a plain file"),
        "{}",
        ended.err
    );
}
