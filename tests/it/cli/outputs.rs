//! Outputs of commands that succeed: comparisons, plots, a live view.

use super::TestFolder;
use crate::fuzz::seeds;
use opsr::image::denoise::Denoiser;
use opsr::image::{Buffer, exr, png};
use opsr::math::Vec3;
use opsr::scene::PunctualLight;
use opsr_lab::gallery;
use opsr_lab::report::compare::{Named, Options, compare};
use serde_json::Value;

/// A folder with the caustic box and a table.
fn caustics() -> TestFolder {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    place.write("table.json", &seeds::tables()[1]);
    place
}

fn picture(place: &TestFolder, name: &str) -> Buffer {
    exr::read_rgb(&place.path().join(name)).expect("a picture")
}

/// A warning distinguishes a black picture without surfaces from one without light.
#[test]
fn black_picture_of_nothing_names_the_camera() {
    let place = caustics();
    let away = "--camera 0,0,50,0,0,100,0,1,0,40 --spp 1 -o a.exr";
    let ended = place.render(away);
    let words = "the camera sees no surface; --camera chooses another view";
    assert!(ended.err.contains(words), "{}", ended.err);
}

/// Without the library the render does not start; with it the noisy picture is kept as a layer.
#[test]
fn denoised_picture_keeps_the_noisy_one_as_a_layer() {
    let place = caustics();
    let args = "--spp 8 --opsr-table table.json --denoise -o clean.exr --checkpoint a.ckpt";
    if let Err(missing) = Denoiser::open() {
        eprintln!("skipped: {missing}");
        let ended = place.render(args);
        assert_eq!(ended.code, Some(3), "{}", ended.err);
        assert!(
            ended
                .err
                .contains("--denoise: Open Image Denoise 2 was not found")
                && ended.err.contains("OIDN_DIR"),
            "{}",
            ended.err
        );
        assert!(!place.path().join("clean.exr").exists());
        return;
    }
    // The film is freed before the denoiser runs; the closing line still reports several levels.
    let ended = place.render(args).done();
    assert!(!ended.err.contains("mean ±"), "{}", ended.err);
    let args = "--spp 8 --opsr-table table.json --aov each-level";
    place
        .render(&format!("{args} --denoise -o each.exr"))
        .done();
    assert_eq!(picture(&place, "each.exr"), picture(&place, "clean.exr"));
    place.render(&format!("{args} -o noisy.exr")).done();
    let levels = ["each.exr", "noisy.exr"].map(|file| {
        let layers = exr::read_layers(&place.path().join(file)).expect("layers");
        let level = layers.layer("level1");
        level.expect("a layer")
    });
    assert_eq!(levels[0], levels[1]);
    let layers = exr::read_layers(&place.path().join("clean.exr")).expect("layers");
    let noisy = picture(&place, "noisy.exr");
    let kept = layers.layer("noisy");
    assert_eq!(kept.expect("a layer"), noisy);
    assert!(picture(&place, "clean.exr") != noisy);
    place.opsr("resolve a.ckpt --denoise -o again.exr").done();
    assert_eq!(picture(&place, "again.exr"), picture(&place, "clean.exr"));
    // A film without AOVs has no guides for the denoiser.
    place
        .render("--spp 8 --opsr-table 0.5 -o noisy.exr --checkpoint b.ckpt")
        .done();
    let ended = place.opsr("resolve b.ckpt --denoise -o again.exr");
    assert_eq!(ended.code, Some(2), "{}", ended.err);
    assert!(ended.err.contains("--aov"), "{}", ended.err);
}

#[test]
fn compare_writes_numbers_maps_and_a_page() {
    let place = caustics();
    for (name, args) in [
        ("a.exr", "--spp 4"),
        ("b.exr", "--spp 4 --seed 1"),
        ("reference.exr", "--spp 64 --seed 2"),
    ] {
        let args = format!("--resolve raw {args} -o {name}");
        place.render(&args).done();
    }
    let ended = place
        .opsr(
            "compare a.exr b.exr reference.exr --seeds --agree --json out.json --maps maps --page out.html \
             --exposures -1,0",
        );
    // Four samples are too few for a test without false alarms, so either result is valid.
    let differ = ended.out.contains("DIFFER");
    assert_eq!(
        ended.code,
        Some(if differ { 6 } else { 0 }),
        "{}",
        ended.err
    );
    assert_eq!(ended.out.matches(" against reference.exr").count(), 2);
    let json: Value = serde_json::from_slice(&place.read("out.json")).unwrap();
    let load = |name: &str| Named::load(&place.path().join(name)).unwrap();
    let options = Options {
        seeds: true,
        ..Options::default()
    };
    let pictures = [load("a.exr"), load("b.exr")];
    let expected = compare(&pictures, &load("reference.exr"), &options).unwrap();
    for (entry, expected) in json["entries"]
        .as_array()
        .unwrap()
        .iter()
        .zip(&expected.entries)
    {
        let metrics = entry["metrics"].as_array().unwrap();
        assert_eq!(metrics.len(), expected.metrics.len());
        for (metric, expected) in metrics.iter().zip(&expected.metrics) {
            assert_eq!(metric["name"], expected.name);
            assert_eq!(metric["value"], expected.value, "{}", expected.name);
            assert!(ended.out.contains(expected.name), "{}", ended.out);
        }
    }
    assert!(json["seeds"].is_object());
    let maps: Vec<String> = place.files_in("maps").into_keys().collect();
    let of = |i: usize, stem: &str| {
        ["flip", "hdr-flip", "relative"].map(|map| format!("{i}-{stem}-{map}.png"))
    };
    assert_eq!(maps, [of(1, "a"), of(2, "b")].concat());
    for map in &maps {
        let shown = png::read(&place.path().join("maps").join(map)).unwrap();
        assert_eq!(shown.size(), (16, 16));
    }
    let page = String::from_utf8(place.read("out.html")).unwrap();
    assert!(page.contains("a.exr") && page.contains("reference.exr"));
    assert!(!page.contains("src=\"http"), "it needs nothing else");
}

/// A picture that differs from its reference or exceeds its bound has its own exit code.
#[test]
fn compare_exit_code_of_pictures_that_differ() {
    let place = caustics();
    for (name, args) in [
        ("a.exr", "--resolve raw"),
        ("b.exr", "--resolve raw --seed 1"),
        ("bright.exr", "--resolve raw --max-vertices 1"),
        ("blurred.exr", ""),
    ] {
        place.render(&format!("--spp 64 {args} -o {name}")).done();
    }
    let compare = |args: &str| place.opsr(&format!("compare {args} b.exr"));
    for (code, args, words) in [
        (0, "--agree a.exr", ""),
        (6, "--agree bright.exr", ""),
        (6, "--json out.json --agree bright.exr a.exr", ""),
        (0, "--fail-above relmse=1e6 --fail-above MSE=1e6 a.exr", ""),
        (6, "--fail-above relMSE=0 a.exr", "a.exr: relMSE "),
        (6, "--fail-above MSE=1e6 --fail-above MAPE=0 a.exr", "MAPE "),
        (
            2,
            "--fail-above noise=1 a.exr",
            "no metric `noise` among MSE",
        ),
        (2, "--fail-above relMSE a.exr", "METRIC=X"),
        (3, "--agree blurred.exr", "`--resolve raw` keeps them"),
    ] {
        let ended = compare(args);
        assert_eq!(ended.code, Some(code), "{args}: {}{}", ended.out, ended.err);
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
        assert_eq!(ended.err.is_empty(), words.is_empty(), "{}", ended.err);
        let differ = code == 6 && args.contains("--agree");
        assert_eq!(ended.out.contains("DIFFER"), differ, "{}", ended.out);
    }
    // The numbers are written nevertheless.
    assert!(place.path().join("out.json").exists());
}

#[test]
fn report_plots_determinism() {
    let place = TestFolder::new();
    place.write(
        "suite.toml",
        "seeds = 4\nsamples = [1, 4]\n[[scene]]\nname = 'a box/1'\nbuiltin = 'caustic-box'\nsize = [16, 16]\n\
         reference_spp = 16\n[[method]]\nname = 'plain'\n[[method]]\nname = 'constant'\n\
         table = 0.3\n",
    );
    place.opsr("bench suite.toml -o results.json").done();
    place
        .opsr("report results.json -o page.html --plots plots")
        .done();
    let plots = place.files_in("plots");
    // The file name has no slash of the scene's name.
    assert!(plots.contains_key("a-box-1-1.svg"), "{:?}", plots.keys());
    for (name, plot) in &plots {
        let plot = std::str::from_utf8(plot).unwrap();
        assert!(plot.trim_start().starts_with("<svg"), "{name}");
        assert!(plot.contains("constant"), "{name}");
    }
    // Page and plots depend only on the results.
    let page = place.read("page.html");
    place
        .opsr("report results.json -o page.html --plots plots")
        .done();
    assert!(place.read("page.html") == page && place.files_in("plots") == plots);
}

/// Asserts that the command failed with this exit code and these words.
fn fails(ended: super::RunResult, code: i32, words: &str) {
    assert_eq!(ended.code, Some(code), "{}", ended.err);
    assert!(ended.err.contains(words), "{}", ended.err);
}

/// File endings are recognised in any case.
#[test]
fn outputs_in_capitals_are_written() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::cornell_box());
    place.render("--spp 1 -o A.EXR -o b.Png").done();
    exr::read_rgb(&place.path().join("A.EXR")).expect("a picture");
    png::read(&place.path().join("b.Png")).expect("a picture");
}

/// A named scene of the gallery is written; a scene that a file cannot hold is an error.
#[test]
fn scenes_that_are_named_are_written() {
    let place = TestFolder::new();
    let written = place.opsr("scenes write torus-in-glass").done().out;
    assert_eq!(written.trim(), "training_scenes/torus-in-glass.glb");
    let parts = gallery::builtin("torus-in-glass").expect("a scene");
    let expected = opsr_lab::gallery::glb::to_glb(&parts).expect("a file");
    let found = std::fs::read(place.path().join(written.trim())).expect("the file");
    assert!(found == expected);
    assert!(!place.path().join("training_scenes/manifest.toml").exists());
    let sky = place.opsr("scenes write sun-pool --out pools");
    fails(sky, 4, "sun-pool: an environment cannot be written");
    fails(place.opsr("scenes write torus"), 2, "torus-in-glass");
}

/// Options for layers that no output file would hold are refused.
#[test]
fn layers_with_only_a_png_are_refused() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::cornell_box());
    for option in ["--aov", "--opsr-table 0.1 --aov each-level"] {
        let ended = place.render(&format!("--spp 1 {option} -o out.png"));
        let words = "adds layers to EXR files: add -o with a name that ends in .exr";
        fails(ended, 2, words);
    }
}

/// A model without light gets the studio, with a note in the closing line; without any light there is no picture.
#[test]
fn scenes_without_light_are_lit_or_refused() {
    let place = TestFolder::new();
    let mut parts = gallery::cornell_box();
    for material in &mut parts.materials {
        material.emission = opsr::math::Rgb::ZERO;
    }
    place.save("scene.glb", &parts);
    let render = |options: &str| {
        let words =
            format!("render scene.glb --size 16x16 --spp 4 {options} -o out.png -o out.exr");
        place.opsr(&words)
    };
    let pixels = || {
        exr::read_rgb(&place.path().join("out.exr"))
            .expect("a picture")
            .pixels
    };
    let ended = render("").done();
    assert!(
        ended.err.contains("lit by the built-in studio"),
        "{}",
        ended.err
    );
    let studio = pixels();
    assert!(studio.iter().any(|p| p.x > 0.1));
    let ended = render("--env studio").done();
    assert!(
        !ended.err.contains("since the file has no light"),
        "{}",
        ended.err
    );
    assert!(pixels() == studio);
    render("--env sky --sun 30,10,4").done();
    assert!(pixels() != studio);
    std::fs::remove_file(place.path().join("out.png")).expect("the picture");
    fails(
        render("--env none"),
        3,
        "nothing lights the scene: --env studio, --env sky or a map would",
    );
    assert!(!place.path().join("out.png").exists());
    fails(render("--sun 30"), 2, "--sun: needs --env sky");
    fails(
        render("--env sky --sun 120"),
        2,
        "expected a height from 0 to 90",
    );
    fails(
        render("--variant red"),
        3,
        "there is no `red`: the file has none",
    );
}

/// No output replaces a file that the loader has read: textures, buffers, maps.
#[test]
fn outputs_do_not_replace_textures_and_buffers() {
    use crate::support::gltf::{File, png};
    let place = TestFolder::new();
    let mut file = File::triangle();
    let picture = image::RgbImage::from_pixel(2, 2, image::Rgb([200, 90, 90]));
    place.write("tex.png", png(&picture.into()));
    let image = file.push("images", serde_json::json!({ "uri": "tex.png" }));
    let texture = file.push("textures", serde_json::json!({ "source": image }));
    let colour = serde_json::json!({ "baseColorTexture": { "index": texture } });
    let material = file.push(
        "materials",
        serde_json::json!({ "pbrMetallicRoughness": colour }),
    );
    let uv = file.floats("VEC2", &[0.5; 6]);
    file.primitive()["material"] = serde_json::json!(material);
    file.primitive()["attributes"]["TEXCOORD_0"] = serde_json::json!(uv);
    place.write("sep.bin", &file.bytes);
    file.json["buffers"] =
        serde_json::json!([{ "byteLength": file.bytes.len(), "uri": "sep.bin" }]);
    place.write("scene.gltf", file.gltf());
    place.write("sky.hdr", &seeds::hdr()[0]);
    let before = place.files();
    for args in [
        "-o tex.png",
        "-o a.exr --checkpoint sep.bin",
        "-o a.exr --stats ./tex.png",
        "-o a.exr --env sky.hdr --stats sky.hdr",
    ] {
        let ended = place.opsr(&format!("render scene.gltf --size 4x4 --spp 1 {args}"));
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        let words = "would replace a file that is read";
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
        assert!(place.files() == before, "{args}: files have changed");
    }
    let part = place.opsr("part scene.gltf --size 4x4 --spp 1 -o sep.bin");
    assert_eq!(part.code, Some(2), "{}", part.err);
    assert!(place.files() == before);
    place
        .opsr("render scene.gltf --size 4x4 --spp 1 -o a.exr")
        .done();
}

/// A repeated choice among levels keeps the metadata of the render.
#[test]
fn resolve_keeps_the_metadata_of_the_render() {
    let place = caustics();
    let args = "--spp 8 --opsr-table table.json --seed 7 --resolve sharp";
    place
        .render(&format!("{args} -o first.exr --checkpoint a.ckpt"))
        .done();
    place
        .opsr("resolve a.ckpt --resolve sharp -o again.exr")
        .done();
    let layers = |name: &str| exr::read_layers(&place.path().join(name)).expect("a file");
    let (first, again) = (layers("first.exr").metadata, layers("again.exr").metadata);
    assert_eq!(first, again);
    for key in [
        "seed",
        "table_sha256",
        "integrator",
        "max_vertices",
        "resolve",
    ] {
        assert!(again.contains_key(key), "{key}");
    }
    // The metadata have the options of the repeated choice.
    place
        .opsr("resolve a.ckpt --resolve none -o other.exr")
        .done();
    let other = layers("other.exr").metadata;
    assert_eq!(other["resolve"].as_str(), "none");
}

/// The hint for a rejected sample is a command that reproduces it.
#[test]
fn hint_for_a_refused_sample_is_a_command() {
    let place = TestFolder::new();
    let mut parts = crate::support::scenes::point_light_over_plane();
    // Radiance below the light overflows.
    parts.lights = vec![PunctualLight::Point {
        position: Vec3::new(0.0, 0.05, 0.0),
        intensity: Vec3::splat(3e38),
        range: f32::INFINITY,
    }];
    place.save("a scene.glb", &parts);
    let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
    let args = [
        "render",
        "a scene.glb",
        "--size",
        "8x8",
        "--spp",
        "4",
        "--opsr-table",
        "0.3",
        "--seed",
        "3",
    ];
    let ended = command.args(args).output().expect("the program");
    let report = String::from_utf8(ended.stderr).expect("UTF-8");
    assert!(report.contains("samples were refused"), "{report}");
    let (_, hint) = report
        .split_once("to see one again: opsr ")
        .expect("a hint");
    let hint = hint.lines().next().expect("a line");
    assert!(
        hint.contains("'a scene.glb'") && hint.contains("--opsr-table 0.3"),
        "{hint}"
    );
    let script = format!("{} {hint}", env!("CARGO_BIN_EXE_opsr"));
    let again = place
        .command("sh")
        .args(["-c", &script])
        .output()
        .expect("a shell");
    let report = String::from_utf8(again.stderr).expect("UTF-8");
    assert!(again.status.success(), "{script}: {report}");
    assert!(
        report.contains("samples were refused"),
        "{script}: {report}"
    );
}
