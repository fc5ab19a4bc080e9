//! `opsr render`: files in and out, interruption, resumption.

use super::{RunResult, TestFolder};
use crate::fuzz::seeds;
use crate::support::gltf::File;
use crate::support::root;
use crate::support::srgb;
use opsr::image::{exr, png};
use opsr_lab::gallery::{self, glb};
use serde_json::json;

#[test]
fn render_writes_its_outputs_and_nothing_else() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::cornell_box());
    let all = "--spp 4 --resolve raw --aov --exposure none -o out.exr -o out.png";
    let ended = place.render(all).done();
    assert_eq!((ended.out.as_str(), ended.err.as_str()), ("", ""));
    assert_eq!(
        place.files().into_keys().collect::<Vec<_>>(),
        ["out.exr", "out.png", "scene.glb"]
    );
    let layers = exr::read_layers(&place.path().join("out.exr")).unwrap();
    assert_eq!((layers.width, layers.height), (16, 16));
    for name in ["R", "sample_variance.G", "albedo.B", "normal.X", "depth"] {
        let channel = &layers.channels[name];
        assert!(channel.iter().any(|&x| x != 0.0), "{name}");
    }
    assert_eq!(layers.metadata["spp"], "4");
    assert_eq!(layers.metadata["scene"], "scene.glb");
    let picture = exr::read_rgb(&place.path().join("out.exr")).unwrap();
    let shown = png::read(&place.path().join("out.png")).unwrap();
    for (p, q) in picture.pixels.iter().zip(&shown.pixels) {
        let encode = |x: f32| srgb(x.clamp(0.0, 1.0));
        let off = |a: f32, b: f32| (encode(a) - encode(b)).abs();
        assert!(off(p.x, q.x).max(off(p.y, q.y)).max(off(p.z, q.z)) < 0.003);
    }
    // An old picture is replaced.
    place.write("out.png", "old");
    place
        .render("--spp 4 --resolve raw --exposure 0 -o out.png")
        .done();
    assert_eq!(png::read(&place.path().join("out.png")).unwrap(), shown);
}

/// A lens blurs surfaces out of focus, and 0 is a pinhole again; wrong uses are errors.
#[test]
fn lens_changes_the_picture() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::cornell_box());
    let picture = |options: &str| {
        let file = format!("{}.exr", options.len());
        place
            .render(&format!("--spp 16 {options} -o {file}"))
            .done();
        exr::read_rgb(&place.path().join(file)).unwrap().pixels
    };
    let pinhole = picture("");
    assert!(picture("--lens 0") == pinhole);
    assert!(picture("--lens 0.4,1") != pinhole);
    for (options, words) in [
        ("--lens 0.1", "--lens: needs a distance in focus too"),
        ("--lens 0,2", "expected RADIUS,DISTANCE"),
        ("--lens=-1,2", "expected RADIUS,DISTANCE"),
        ("--aperture 0.1", "--aperture is --lens RADIUS,DISTANCE now"),
    ] {
        let ended = place.render(&format!("--spp 1 {options} -o no.exr"));
        assert_eq!(ended.code, Some(2), "{options}: {}", ended.err);
        assert!(ended.err.contains(words), "{options}: {}", ended.err);
    }
}

/// A camera that moves away during one second, at several frames.
#[test]
fn seconds_and_frames_choose_a_moment() {
    let mut file = File::from_glb(&glb::to_glb(&gallery::cornell_box()).unwrap());
    let nodes = file.json["nodes"].as_array().unwrap();
    let camera = nodes
        .iter()
        .position(|n| n.get("camera").is_some())
        .unwrap();
    // Without rotation the camera looks along -z.
    file.json["nodes"][camera] = json!({ "camera": file.json["nodes"][camera]["camera"] });
    let times = file.floats("SCALAR", &[0.0, 1.0]);
    let places = file.floats("VEC3", &[0.0, 1.0, 3.9, 0.0, 1.0, 39.0]);
    file.push(
        "animations",
        json!({
            "samplers": [{ "input": times, "output": places }],
            "channels": [{ "sampler": 0, "target": { "node": camera, "path": "translation" } }],
        }),
    );
    let place = TestFolder::new();
    place.write("scene.glb", file.glb());
    let picture = |options: &str| {
        place
            .render(&format!("--spp 4 {options} -o out.exr"))
            .done();
        exr::read_rgb(&place.path().join("out.exr")).unwrap().pixels
    };
    let (start, half) = (picture("--at 0@24"), picture("--at 12@24"));
    assert!(start != half);
    for same in ["--at 0.5s", "--at 6@12", "--at 30@60"] {
        assert!(picture(same) == half, "{same}");
    }
    for options in [
        "--at 1@24 --at 1s",
        "--at 12",
        "--frame 12",
        "--at x",
        "--at 1@0",
    ] {
        let ended = place.render(&format!("--spp 1 {options} -o no.exr"));
        assert_eq!(ended.code, Some(2), "{options}: {}", ended.err);
    }
}

/// The closing line names the written files and their error in plain words.
#[test]
fn summary_line_names_files_samples_time_and_error() {
    let place = TestFolder::new();
    let ended = place.opsr("render scene.glb --size 16x8 --spp 4 --verbose -o out.exr -o out.png");
    let ended = ended.done();
    let is_summary = |line: &&str| {
        line.starts_with("out.exr, out.png: 16x8, exposure ") && line.contains(", 4 spp in ")
    };
    let line = ended.err.lines().find(is_summary);
    let line = line.unwrap_or_else(|| panic!("{}", ended.err));
    let (_, error) = line.split_once("average error ").expect("an error");
    let (error, mean) = error.split_once(", mean ± ").expect("an error of the mean");
    for text in [error, mean] {
        let percent = text.strip_suffix(" %").map(str::parse::<f64>);
        assert!(percent.is_some_and(|p| p.is_ok_and(|p| p > 0.0)), "{line}");
    }
    assert!(line.contains(" million paths/s, "), "{line}");
    // A pipe gets no colours, not even in the log.
    assert!(
        ended.err.contains("INFO") && !ended.err.contains('\x1b'),
        "{}",
        ended.err
    );
    assert_eq!(ended.out, "");
    // One sample has no error estimate.
    let one = place.opsr("render scene.glb --size 16x8 --spp 1").done();
    assert!(
        one.err.contains("1 spp in ") && !one.err.contains("inf"),
        "{}",
        one.err
    );
}

/// The exposure of the closing line, given as an option, makes the same PNG file; EXR files do not depend on it.
#[test]
fn exposure_auto_is_printed_and_leaves_exr_files_alone() {
    let place = TestFolder::new();
    let mut parts = gallery::cornell_box();
    for material in &mut parts.materials {
        material.emission *= 5000.0;
    }
    place.save("scene.glb", &parts);
    let render = |args: &str| {
        let common = "render scene.glb --size 16x16 --spp 4 --reproducible -o out.exr -o out.png";
        let ended = place.opsr(&format!("{common} {args}")).done();
        (ended.err, place.read("out.exr"), place.read("out.png"))
    };
    let (line, radiance, auto) = render("");
    let (_, rest) = line.split_once("exposure ").expect("an exposure");
    let stops = rest.split(',').next().expect("a number");
    assert!(stops.parse::<f32>().is_ok_and(|e| e < -8.0), "{line}");
    let (_, _, white) = render("--exposure none");
    assert!(white != auto && render("--exposure 0").2 == white);
    for (same, args) in [
        (true, format!("--exposure {stops}")),
        (true, format!("--exposure={stops} --view srgb")),
        (false, "--view filmic".to_owned()),
    ] {
        let (_, exr, png) = render(&args);
        assert!(exr == radiance && (png == auto) == same, "{args}");
    }
    // Without a PNG file there is no exposure.
    let ended = place.opsr("render scene.glb --size 16x16 --spp 1 -o out.exr");
    assert!(!ended.err.contains("exposure"), "{}", ended.err);
}

/// `render` and `info` warn of glass without a thickness, and name the remedy.
#[test]
fn solid_glass_turns_closed_thin_walls_into_bodies() {
    let place = TestFolder::new();
    let mut parts = gallery::caustic_box();
    for material in &mut parts.materials {
        material.solid = false;
        if material.transmission > 0.0 {
            "ball".clone_into(&mut material.name);
        }
    }
    place.save("scene.glb", &parts);
    let warning = "transmit without a thickness";
    for (command, warns) in [
        ("render scene.glb --size 16x16 --spp 1", true),
        ("render scene.glb --size 16x16 --spp 1 --glass solid", false),
        ("info scene.glb", true),
        ("info scene.glb --glass solid", false),
    ] {
        let ended = place.opsr(command).done();
        assert_eq!(ended.err.contains(warning), warns, "{command}");
        if command.starts_with("info") {
            let kind = ["solid transmission ball", "thin-walled transmission ball"];
            assert!(
                ended.out.contains(kind[usize::from(warns)]),
                "{}",
                ended.out
            );
            assert_eq!(ended.out.contains("--glass solid"), warns);
        }
    }
}

/// A warning for tables with GGX lobes, and for tables of a single training scene.
#[test]
fn table_warns_of_ggx_lobes_and_of_one_training_scene() {
    let place = TestFolder::new();
    let shipped = std::fs::read(root().join("params/beta-0.001.json"));
    let mut table: serde_json::Value = serde_json::from_slice(&shipped.unwrap()).unwrap();
    let scenes = table["training"]["scenes"].as_array_mut().unwrap();
    assert!(scenes.len() > 1);
    scenes.truncate(1);
    place.write("one.json", table.to_string());
    for (options, of_ggx, of_one_scene) in [
        ("--opsr-table beta-0.001", false, false),
        ("--opsr-table beta-0.001 --distribution ggx", true, false),
        ("--opsr-table one.json", false, true),
        ("--opsr-table 0.1 --distribution ggx", false, false),
        ("--distribution ggx", false, false),
    ] {
        let ended = place.opsr(&format!("render scene.glb --size 8x8 --spp 1 {options}"));
        let err = ended.done().err;
        let warns = [
            err.contains("--distribution ggx:"),
            err.contains("a table of one scene"),
        ];
        assert_eq!(warns, [of_ggx, of_one_scene], "{options}: {err}");
    }
}

/// The shipped tables are available by name, unless a file has this name.
#[test]
fn table_by_name_is_the_shipped_file() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    let picture = |table: &str| {
        place
            .render(&format!("--spp 4 -o out.exr --opsr-table {table}"))
            .done();
        let mut layers = exr::read_layers(&place.path().join("out.exr")).expect("layers");
        // Only the given name differs.
        layers.metadata.remove("table");
        layers
    };
    for name in ["beta-0.001", "beta-0.05"] {
        let file = format!("{}/params/{name}.json", root().display());
        assert!(picture(name) == picture(&file), "{name}");
        let shown = |table: &str| place.opsr(&format!("table show {table}")).done().out;
        assert_eq!(shown(name), shown(&file));
    }
    let built_in = picture("beta-0.05");
    place.write("beta-0.05", &seeds::tables()[1]);
    assert!(picture("beta-0.05") != built_in, "a file of that name wins");
    let ended = place.render("--spp 1 -o out.exr --opsr-table beta-0.1");
    assert_eq!(ended.code, Some(3), "{}", ended.err);
}

/// Every layer by name, and errors for layers that the render does not have.
#[test]
fn aov_layers_are_written_by_name() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    let layers = |args: &str| {
        let args = format!("--spp 4 --integrator path --resolve raw -o out.exr {args}");
        place.render(&args).done();
        let layers = exr::read_layers(&place.path().join("out.exr")).unwrap();
        assert_eq!(layers.channels["spp"][0], 4.0);
        layers
    };
    let plain = layers("");
    let all = layers("--aov albedo,normal,depth,alpha,position,id,emission,direct,indirect");
    for name in ["R", "sample_variance.G", "variance_of_mean.B"] {
        assert_eq!(plain.channels[name], all.channels[name]);
    }
    let added = (all.channels.keys()).filter(|name| !plain.channels.contains_key(*name));
    let expected = "A albedo.B albedo.G albedo.R depth direct.B direct.G direct.R emission.B emission.G emission.R \
                    id.material id.mesh indirect.B indirect.G indirect.R normal.X normal.Y normal.Z position.X \
                    position.Y position.Z";
    assert_eq!(
        added.map(String::as_str).collect::<Vec<_>>().join(" "),
        expected
    );
    let (coverage, depth) = (&all.channels["A"], &all.channels["depth"]);
    let ids = all.layer("id.mesh").unwrap();
    for (i, id) in ids.pixels.iter().enumerate() {
        assert!((0.0..=8.0).contains(&id.x) && (0.0..=1.0).contains(&coverage[i]));
        assert_eq!(coverage[i] == 0.0, depth[i] == f32::INFINITY);
    }
    let timed = "--size 16x16 --spp 4 --aov time,level --opsr-table 0.5 --set levels=3 -o out.exr";
    place.opsr(&format!("render scene.glb {timed}")).done();
    let timed = exr::read_layers(&place.path().join("out.exr")).unwrap();
    assert!(timed.channels["time"].iter().all(|&t| t > 0.0 && t < 10.0));
    assert!(timed.channels.contains_key("level") && !timed.channels.contains_key("albedo.R"));
    for (args, words) in [
        ("--aov direct --integrator bdpt", "path tracer"),
        (
            "--aov emission --opsr-table 0.5 --set levels=3",
            "--resolve raw",
        ),
        ("--aov level --resolve raw", "level needs several levels"),
        ("--aov each-level --resolve raw", "each-level needs several"),
        ("--aov time", "--reproducible"),
        ("--aov colour", "albedo"),
    ] {
        let ended = place.render(&format!("--spp 1 -o out.exr {args}"));
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
    }
}

#[test]
fn size_and_crop_as_shares_equal_those_in_pixels() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    let render = |args: &str| {
        let command =
            format!("render scene.glb --spp 1 --reproducible --progress none -o out.exr {args}");
        place.opsr(&command).done();
        place.read("out.exr")
    };
    let whole = exr_size(&place, &render("--size 1/16"));
    assert_eq!(whole, (32, 32));
    assert!(render("--size 6.25%") == render("--size 32x32"));
    let pixels = render("--size 32x32 --crop 8,16,16,4");
    for shares in ["25%,50%,50%,4", "1/4,0.5,16,1/8"] {
        assert!(
            render(&format!("--size 32x32 --crop {shares}")) == pixels,
            "{shares}"
        );
    }
    let ended = place.opsr("render scene.glb --size 32x32 --crop 50%,0,75%,1 -o out.exr");
    assert!(
        ended.code == Some(2) && ended.err.contains("--crop"),
        "{}",
        ended.err
    );
}

fn exr_size(place: &TestFolder, bytes: &[u8]) -> (usize, usize) {
    place.write("size.exr", bytes);
    let layers = exr::read_layers(&place.path().join("size.exr")).unwrap();
    (layers.width, layers.height)
}

/// A file without a camera is seen from the front, whatever its light, and the closing line reports it.
#[test]
fn camera_of_a_file_without_one_is_named() {
    let place = TestFolder::new();
    let mut parts = gallery::cornell_box();
    parts.cameras.clear();
    for material in &mut parts.materials {
        material.emission = opsr::math::Rgb::ZERO;
    }
    for (x, z) in [(9.0, 0.0), (0.0, -9.0), (-9.0, 0.0)] {
        parts.lights = vec![opsr::scene::PunctualLight::Point {
            position: opsr::math::Vec3::new(x, 3.0, z),
            intensity: opsr::math::Rgb::ONE,
            range: f32::INFINITY,
        }];
        place.save("scene.glb", &parts);
        let ended = place
            .opsr("render scene.glb --size 16x16 --spp 1 -o out.exr")
            .done();
        let words = "16x16, view through the open side";
        assert!(ended.err.contains(words), "{}", ended.err);
        assert!(
            ended.err.contains("since the file has no camera"),
            "{}",
            ended.err
        );
    }
}

/// The printed paths add up to the pixel of the picture, and errors of usage are explained.
#[test]
fn trace_prints_the_paths_of_the_render() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    let common = "--size 16x16 --opsr-table 0.5";
    let ended = place
        .opsr(&format!("trace scene.glb 9,12 {common} --spp 3"))
        .done();
    let heads = ended
        .out
        .lines()
        .filter(|line| line.starts_with("pixel 9,12 sample "));
    assert_eq!(heads.count(), 3, "{}", ended.out);
    for word in [
        "alpha ",
        "class ",
        "throughput ",
        "continues by ",
        "diffuse `white`",
    ] {
        assert!(ended.out.contains(word), "{word}: {}", ended.out);
    }
    let one = place
        .opsr(&format!("trace scene.glb 9,12 {common} --sample 2"))
        .done();
    assert!(ended.out.ends_with(&one.out) && one.out.lines().count() > 2);
    assert!(!place.path().join("out.exr").exists());
    for args in [
        "trace scene.glb 16,0",
        "trace scene.glb 1",
        "trace scene.glb",
        "trace scene.glb 1,1 --set levels=3",
        "trace scene.glb 1,1 --integrator bdpt",
        "render scene.glb --trace-pixel 1,1",
    ] {
        let ended = place.opsr(&format!("{args} {common}"));
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
    }
    let seen = place
        .opsr("info scene.glb --pixel 9,12 --size 16x16")
        .done()
        .out;
    for word in ["distance ", "normal ", "alpha ", "material "] {
        assert!(seen.contains(word), "{seen}");
    }
    let json = place
        .opsr("info scene.glb --pixel 0,0 --size 1/8 --json")
        .done()
        .out;
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json["frame"], serde_json::json!([64, 64]));
    let ended = place.opsr("info scene.glb --pixel 64,0 --size 64x64");
    assert_eq!(ended.code, Some(2), "{}", ended.err);
}

/// The share that a line states in per cent after some words.
fn percent_after(line: &str, words: &str) -> Option<f64> {
    let (_, rest) = line.split_once(words)?;
    let (percent, _) = rest.split_once(" %")?;
    Some(0.01 * percent.parse::<f64>().ok()?)
}

/// The true error equals that of `compare`, and the statistics equal the closing line.
#[test]
fn reference_and_statistics_of_a_render() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    place.render("--spp 64 -o reference.exr").done();
    let args = "--spp 4 --seed 1 --reference reference.exr --stats stats.json";
    let crop = "--crop 25%,25%,50%,50%";
    let ended = place
        .opsr(&format!(
            "render scene.glb --size 16x16 {args} {crop} -o out.exr"
        ))
        .done();
    let stats: serde_json::Value = serde_json::from_slice(&place.read("stats.json")).unwrap();
    let error = stats["true_error"].as_f64().unwrap();
    let message = percent_after(&ended.err, ", true error ");
    assert!(
        message.is_some_and(|message| (message - error).abs() < 0.05 * error),
        "{}",
        ended.err
    );
    place
        .opsr("compare out.exr reference.exr --json compare.json")
        .done();
    let compared: serde_json::Value = serde_json::from_slice(&place.read("compare.json")).unwrap();
    let metrics = compared["entries"][0]["metrics"].as_array().unwrap();
    let of_metric = |m: &&serde_json::Value| m["name"] == "mean relative error";
    let compared = metrics.iter().find(of_metric).unwrap();
    assert!((error - compared["value"].as_f64().unwrap()).abs() < 1e-9);
    assert_eq!(stats["window"], serde_json::json!([4, 4, 8, 8]));
    assert_eq!((&stats["spp"], &stats["paths"]), (&4.into(), &256.into()));
    assert_eq!(stats["settings"]["integrator"], "vcm");
    // The last line of the log has the same numbers.
    let render = format!("render scene.glb --size 16x16 {args} {crop} --stats log.csv -o out.exr");
    place.opsr(&render).done();
    let csv = String::from_utf8(place.read("log.csv")).unwrap();
    let last: Vec<&str> = csv.lines().last().unwrap().split(',').collect();
    let number = |i: usize| last[i].parse::<f64>().unwrap();
    assert_eq!((last.len(), last[0], number(3)), (4, "4", error));
    assert!((number(2) - stats["mean_relative_error"].as_f64().unwrap()).abs() < 1e-9);
    let ended = place.opsr("render scene.glb --spp 1 --stats a.csv --stats b.csv -o out.exr");
    assert_eq!(ended.code, Some(2), "{}", ended.err);
    // The progress shows the true error, too.
    let lines = place.opsr(&format!(
        "render scene.glb --size 16x16 {args} --progress json"
    ));
    assert!(
        lines
            .done()
            .out
            .lines()
            .all(|line| line.contains("\"true_error\":"))
    );
    (place.opsr("render scene.glb --size 8x8 --spp 1 -o small.exr")).done();
    for (code, file) in [(2, "small.exr"), (3, "none.exr")] {
        let ended = place.opsr(&format!(
            "render scene.glb --size 9x16 --spp 1 --reference {file}"
        ));
        assert_eq!(ended.code, Some(code), "{}", ended.err);
        assert!(ended.err.contains(file), "{}", ended.err);
    }
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let place = TestFolder::new();
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let text = place.opsr(&format!("completions {shell}")).done().out;
        for word in ["trace", "max-vertices", "compare", "completions"] {
            assert!(text.contains(word), "{shell}: {word}");
        }
    }
    place.opsr("man pages").done();
    let pages: Vec<String> = place.files_in("pages").into_keys().collect();
    for page in [
        "opsr.1",
        "opsr-render.1",
        "opsr-table-export.1",
        "opsr-man.1",
    ] {
        assert!(pages.iter().any(|p| p == page), "{pages:?}");
    }
    let page = String::from_utf8(place.read("pages/opsr-render.1")).unwrap();
    assert!(page.contains("exposure") && page.contains("EXAMPLES") || page.contains("Examples"));
}

/// Options that change the picture are in its metadata by their keys.
#[test]
fn exr_metadata_name_the_options_that_change_the_picture() {
    let place = TestFolder::new();
    for (args, entries) in [
        (
            "--opsr-table 0.3 --set consistent=0.25",
            &[("consistent", "0.25")][..],
        ),
        (
            "--set mode=filter-glossy --set filter=2",
            &[("filter", "2")],
        ),
        (
            "--opsr-table beta-0.001 --set lookup=nearest",
            &[("lookup", "nearest")],
        ),
        (
            "--integrator bdpt --set strategy=3,1",
            &[("strategy", "3,1")],
        ),
        (
            "--integrator vcm --set strategy=merges --set connections=nee --set radius=0.5 --set radius_alpha=0.75",
            &[
                ("strategy", "merges"),
                ("connections", "nee"),
                ("radius", "0.5"),
                ("radius_alpha", "0.75"),
            ],
        ),
        ("--integrator mlt --set mlt_pass=4", &[("mlt_pass", "4")]),
    ] {
        let common = "--spp 1 -o out.exr";
        place.render(&format!("{common} {args}")).done();
        let named = exr::read_layers(&place.path().join("out.exr")).unwrap();
        place.render(common).done();
        let plain = exr::read_layers(&place.path().join("out.exr")).unwrap();
        for (key, value) in entries {
            let found = named.metadata.get(*key).map(String::as_str);
            assert_eq!(found, Some(*value), "{args}: {key}");
            assert!(!plain.metadata.contains_key(*key), "{key}");
        }
    }
}

/// Half floats and every compression hold the same picture, and the metadata describe its render.
#[test]
fn exr_options_and_metadata() {
    let place = TestFolder::new();
    let render = |args: &str| {
        let file = "--spp 4 --opsr-table 0.25 --max-vertices 5 --aov normal -o out.exr";
        place.render(&format!("{file} {args}")).done();
        let layers = exr::read_layers(&place.path().join("out.exr")).unwrap();
        (layers, place.read("out.exr").len())
    };
    let (plain, _) = render("");
    for (key, value) in [
        ("integrator", "path"),
        ("mode", "default"),
        ("table", "0.25"),
        ("max_vertices", "5"),
        ("refused_samples", "0"),
        ("spp", "4"),
        ("seed", "0"),
    ] {
        assert_eq!(plain.metadata[key], value, "{key}");
    }
    let mut sizes = Vec::new();
    for coding in ["none", "rle", "zips", "zip", "piz"] {
        let (layers, size) = render(&format!("--exr {coding}"));
        assert_eq!(layers.channels, plain.channels, "{coding}");
        sizes.push(size);
    }
    assert!(sizes[3] < sizes[0], "{sizes:?}");
    let (half, size) = render("--exr none,half");
    assert!(size < sizes[0]);
    for (name, values) in &half.channels {
        let exact = ["spp", "sample_variance", "variance_of_mean"]
            .iter()
            .any(|n| name.starts_with(n));
        let bound = if exact { 0.0 } else { 1.0 / 1024.0 };
        for (a, b) in values.iter().zip(&plain.channels[name]) {
            assert!(
                (a - b).abs() <= bound * b.abs().max(1e-4),
                "{name}: {a} {b}"
            );
        }
    }
}

/// A crop is compared with its window of the full frame, and a layer with the same layer.
#[test]
fn compare_crops_and_layers() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    for args in ["-o whole.exr", "--crop 4,2,8,9 -o crop.exr"] {
        let args = format!("--spp 16 --resolve raw --aov {args}");
        place.render(&args).done();
    }
    for args in [
        "",
        "--layer albedo",
        "--layer normal",
        "--layer depth",
        "--agree",
    ] {
        let ended = place.opsr(&format!(
            "compare crop.exr whole.exr --fail-above MSE=0 {args}"
        ));
        let ended = ended.done();
        assert!(
            ended.out.contains("8x9 pixels at (4, 2)"),
            "{args}: {}",
            ended.out
        );
    }
    let ended = place.opsr("compare crop.exr whole.exr --layer depht");
    assert!(
        ended.code == Some(3) && ended.err.contains("depth"),
        "{}",
        ended.err
    );
    let ended = place.opsr("compare crop.exr whole.exr --layer depth --agree");
    assert_eq!(ended.code, Some(2), "{}", ended.err);
}

#[test]
fn determinism_of_reproducible_files() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    place.write("table.json", &seeds::tables()[1]);
    let picture = |args: &str| {
        place.render(&format!("--spp 4 -o out.exr {args}")).done();
        place.read("out.exr")
    };
    // All data except the metadata, which contain the factor.
    let channels = |args: &str| {
        picture(args);
        exr::read_layers(&place.path().join("out.exr"))
            .unwrap()
            .channels
    };
    assert!(
        channels("--opsr-table 0") == channels("--integrator path"),
        "γ = 0 is plain path tracing"
    );
    let path = picture("--integrator path");
    let plain = picture("");
    assert!(path != plain, "glass and a lamp call for vcm");
    assert!(picture("--threads 1") == plain && picture("--threads 3") == plain);
    assert!(picture("--crop 0,0,16,16") == plain);
    let others = [
        "--seed 1",
        "--opsr-table 0.5",
        "--opsr-table table.json",
        "--set mode=pbrt",
        "--integrator light",
        "--integrator bdpt --aov",
        "--integrator sppm --set radius=0.1 --set radius_alpha=1",
        "--max-depth 2",
    ];
    for other in others {
        assert!(picture(other) != plain, "{other} changed nothing");
    }
}

#[test]
fn resume_equals_an_uninterrupted_render() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    place.render("--aov --spp 9 -o whole.exr").done();
    place
        .render("--aov --spp 4 -o part.exr --checkpoint a.ckpt")
        .done();
    assert!(place.read("part.exr") != place.read("whole.exr"));
    place
        .render("--aov --spp 9 -o part.exr --checkpoint a.ckpt --resume")
        .done();
    assert!(place.read("part.exr") == place.read("whole.exr"));
    // With fewer samples than the checkpoint has, all of them are kept.
    let ended = place
        .render("--aov --spp 5 -o part.exr --checkpoint a.ckpt --resume --verbose")
        .done();
    assert!(place.read("part.exr") == place.read("whole.exr"));
    assert!(ended.err.contains("no new samples"), "{}", ended.err);
    assert!(!ended.err.contains("inf"), "{}", ended.err);
}

/// A checkpoint of another seed is refused with only this difference, and one far longer than its pixels is not read.
#[test]
fn resume_refuses_checkpoints_that_do_not_fit() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    place
        .render("--spp 2 -o out.exr --checkpoint a.ckpt")
        .done();
    let resume = |options: &str| {
        let ended = place.render(&format!(
            "--spp 4 -o out.exr --checkpoint a.ckpt --resume {options}"
        ));
        assert_eq!(ended.code, Some(3), "{}", ended.err);
        ended.err
    };
    let message = resume("--seed 3");
    let expected = "other settings: it has `seed 0`, this render `seed 3`";
    assert!(message.contains(expected), "{message}");
    // A sparse file, which takes no disk space.
    let file = std::fs::File::options()
        .write(true)
        .open(place.path().join("a.ckpt"))
        .expect("the checkpoint");
    file.set_len(1 << 40).expect("a sparse file");
    let message = resume("");
    assert!(message.contains("longer than its header says"), "{message}");
}

#[test]
fn time_is_a_number_of_seconds_or_has_a_unit() {
    let place = TestFolder::new();
    for time in ["0.1", "100ms"] {
        place.render(&format!("--time {time} -o out.exr")).done();
    }
    for time in ["-1", "soon", "1e99"] {
        let ended = place.render(&format!("--time={time} -o out.exr"));
        assert_eq!(ended.code, Some(2), "{}", ended.err);
    }
}

/// Thousands of threads would take minutes to start.
#[test]
fn threads_are_few_beside_the_cores() {
    let place = TestFolder::new();
    let clock = std::time::Instant::now();
    let ended = place.render("--spp 1 --threads 65535 -o out.exr").done();
    assert!(ended.err.contains("threads are used"), "{}", ended.err);
    assert!(clock.elapsed().as_secs() < 20);
}

/// A picture without a complete sample is not finished.
#[test]
fn time_that_ends_within_the_first_sample_is_told() {
    let place = TestFolder::new();
    for integrator in ["path", "vcm"] {
        let render = format!("render scene.glb --size 2048x2048 --integrator {integrator}");
        let ended = place.opsr(&format!("{render} --time 1ms --progress none -o part.exr"));
        assert_eq!(ended.code, Some(5), "{integrator}: {}", ended.err);
        assert!(
            ended.err.contains("stopped within the first sample"),
            "{}",
            ended.err
        );
        assert!(place.path().join("part.exr").exists());
    }
}

/// The lines of the log after the checkpoint belong to lost samples.
#[test]
fn resume_continues_the_log() {
    let place = TestFolder::new();
    let render = |options: &str, log: &str| {
        place.render(&format!(
            "{options} -o out.exr --checkpoint {log}.ckpt --stats {log}"
        ))
    };
    render("--spp 3", "log.csv").done();
    let early = String::from_utf8(place.read("log.csv")).unwrap();
    place.write("log.csv", early.clone() + "4,9.0,0.5,\n");
    render("--spp 5 --resume", "log.csv").done();
    let rows = String::from_utf8(place.read("log.csv")).unwrap();
    let later = rows.strip_prefix(&early).expect("the earlier rows");
    assert!(later.lines().last().unwrap().starts_with("5,"), "{rows}");
    assert!(!later.contains("4,9"), "{rows}");
    // A file that is not a log is not replaced.
    place.write("log.csv", "date,price\n");
    let ended = render("--spp 7 --resume", "log.csv");
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    assert!(ended.err.contains("log.csv"), "{}", ended.err);
    assert_eq!(place.read("log.csv"), b"date,price\n");
}

/// A resumed render learns its guide again. Its picture differs from the path tracer's; the metadata name the guide.
#[test]
fn resume_of_a_guided_render_equals_an_uninterrupted_one() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    let render = |spp: u32, args: &str| place.render(&format!("--spp {spp} {args}")).done();
    render(12, "-o path.exr");
    for guide in [
        "--integrator guided --opsr-table 0.2",
        "--integrator guided --set unbiased --opsr-table 0.2",
    ] {
        let _ = std::fs::remove_file(place.path().join("a.ckpt"));
        render(12, &format!("{guide} -o whole.exr"));
        let part = "-o part.exr --checkpoint a.ckpt";
        render(5, &format!("{guide} {part}"));
        render(12, &format!("{guide} {part} --resume"));
        let [whole, part, path] = ["whole.exr", "part.exr", "path.exr"].map(|file| {
            let layers = exr::read_layers(&place.path().join(file)).unwrap();
            let integrator = layers.metadata["integrator"].clone();
            (layers.channels["R"].to_vec(), integrator)
        });
        assert!(whole == part && whole.0 != path.0, "{guide}");
        assert!(whole.1 == "guided" && path.1 != "guided");
    }
}

#[test]
fn resume_refuses_the_checkpoint_of_another_render() {
    let place = TestFolder::new();
    place.write("table.json", &seeds::tables()[1]);
    place.write("sky.hdr", &seeds::hdr()[0]);
    place
        .render("--spp 2 -o out.exr --checkpoint a.ckpt")
        .done();
    let before = place.files();
    let settings = [
        "--seed 1",
        "--opsr-table 0.1",
        "--opsr-table 0",
        "--set mode=pbrt",
        "--opsr-table table.json",
        "--max-depth 3",
        "--size 17x16",
        "--crop 0,0,8,8",
        "--aov",
        "--distribution ggx",
        "--glass solid",
    ];
    let refused = |RunResult { code, err, .. }: RunResult, what: &str, args: &str| {
        assert_eq!(code, Some(3), "{args}: {err}");
        assert!(
            err.contains("a.ckpt") && err.contains(what),
            "{args}: {err}"
        );
        assert!(place.files() == before, "{args} changed files");
    };
    for args in settings {
        let size = if args.contains("size") {
            ""
        } else {
            "--size 16x16"
        };
        let common =
            "render scene.glb --spp 4 -o out.exr --checkpoint a.ckpt --resume --progress none";
        refused(
            place.opsr(&format!("{common} {size} {args}")),
            "other settings",
            args,
        );
    }
    let sky = "--spp 4 -o out.exr --checkpoint a.ckpt --resume --env sky.hdr";
    refused(place.render(sky), "another scene", sky);
    // The scene's own file has changed.
    place.save(
        "scene.glb",
        &crate::support::scenes::point_light_over_plane(),
    );
    let ended = place.render("--spp 4 -o out.exr --checkpoint a.ckpt --resume");
    assert!(
        ended.code == Some(3) && ended.err.contains("another scene"),
        "{}",
        ended.err
    );
}

/// A signal during a long render: the picture so far is saved, with its own exit code.
#[test]
#[cfg(unix)]
fn exit_code_after_a_signal() {
    for signal in ["INT", "TERM", "HUP", "USR1", "XCPU"] {
        saved_at(signal);
    }
}

#[cfg(unix)]
fn saved_at(signal: &str) {
    let place = TestFolder::new();
    let args = "render scene.glb --size 16x16 --time 10min --threads 1 --progress none --save-every 1ms \
                -o out.exr --checkpoint a.ckpt --reproducible";
    // The checkpoint is written after the picture: when it exists, both exist.
    let ended = place.signalled(signal, args, "a.ckpt");
    assert_eq!(ended.code, Some(5), "{signal}: {}", ended.err);
    assert_eq!(
        place.files().into_keys().collect::<Vec<_>>(),
        ["a.ckpt", "out.exr", "scene.glb"]
    );
    let layers = exr::read_layers(&place.path().join("out.exr")).unwrap();
    let spp: u32 = layers.metadata["spp"].parse().unwrap();
    // The checkpoint has the same samples: resumed for one more, the render equals one with that many.
    let more = spp + 1;
    place
        .render(&format!(
            "--spp {more} -o out.exr --checkpoint a.ckpt --resume"
        ))
        .done();
    place.render(&format!("--spp {more} -o whole.exr")).done();
    assert!(place.read("out.exr") == place.read("whole.exr"));
}

/// Ctrl-C during a pilot has the exit code of any other stop.
#[test]
#[cfg(unix)]
fn exit_code_of_a_stopped_pilot() {
    use std::io::{BufRead, BufReader};
    use std::process::{Command, Stdio};
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    let args = "render scene.glb --verbose --threads 1 --spp 100000 --size 1024x1024 -o out.exr";
    let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
    let command = command.args(args.split_whitespace()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program");
    let mut lines = BufReader::new(child.stderr.take().expect("a pipe")).lines();
    let begun = lines.any(|line| line.expect("UTF-8").contains("the pilot begins"));
    assert!(begun, "no pilot");
    let id = child.id().to_string();
    let kill = Command::new("kill").args(["-INT", &id]).status();
    assert!(kill.expect("kill").success());
    let rest: Vec<String> = lines.map_while(Result::ok).collect();
    let code = child.wait().expect("an end").code();
    assert_eq!(code, Some(5), "{}", rest.join("\n"));
    assert!(!place.path().join("out.exr").exists());
}

/// Every pixel gets the best of its levels; the choice can be repeated from the checkpoint.
#[test]
fn levels_are_rendered_and_resolved_again() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    place.write("table.json", &seeds::tables()[1]);
    let levels = "--spp 8 --set sampler=independent --opsr-table table.json";
    let render = |args: &str| {
        place.render(&format!("{levels} {args}")).done();
        place.read("out.exr")
    };
    let whole = render("--set levels=0,0.5,1,4 -o out.exr --aov each-level --checkpoint a.ckpt");
    assert!(render("--set levels=0,0.5,1,4 -o out.exr --aov each-level --threads 3") == whole);
    let file = |name: &str| exr::read_layers(&place.path().join(name)).expect("a file");
    let plain = {
        place
            .render("--spp 8 --set sampler=independent --resolve raw -o plain.exr")
            .done();
        file("plain.exr")
    };
    let (layers, levels) = (
        file("out.exr"),
        ["level0.R", "level1.R", "level2.R", "level3.R"],
    );
    for (a, b) in layers.channels["level0.R"].iter().zip(&plain.channels["R"]) {
        assert!((a - b).abs() <= 1e-5 * b.abs(), "{a} {b}");
    }
    for name in levels.into_iter().chain(["variance", "error"]) {
        let values = &layers.channels[name];
        assert!(
            values.iter().any(|&x| x > 0.0) && values.iter().all(|x| x.is_finite()),
            "{name}"
        );
    }
    assert_eq!(layers.metadata["levels"], "0,0.5,1,4");
    place
        .opsr("resolve a.ckpt -o again.exr --aov each-level")
        .done();
    assert_eq!(file("again.exr").channels, layers.channels);
    let ended = place.opsr("resolve a.ckpt -o again.exr --aov depth");
    assert!(
        ended.code == Some(2) && ended.err.contains("each-level"),
        "{}",
        ended.err
    );
    place
        .opsr("resolve a.ckpt -o sharp.exr --resolve sharp")
        .done();
    assert!(file("sharp.exr").channels["R"] != layers.channels["R"]);
}

/// Several levels are the default of every rule that supports them.
#[test]
fn levels_are_the_default_of_tables_and_constants() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    place.write("table.json", &seeds::tables()[1]);
    let levels = |args: &str| {
        place.render(&format!("--spp 8 {args} -o out.exr")).done();
        let layers = exr::read_layers(&place.path().join("out.exr")).expect("layers");
        layers.metadata.get("levels").cloned()
    };
    for factors in ["--opsr-table 0.3", "--opsr-table table.json"] {
        let four = levels(factors);
        assert_eq!(four.as_deref(), Some("0,0.64,3.2,16"));
        let file = place.read("out.exr");
        assert_eq!(levels(&format!("{factors} --set levels=4")), four);
        assert!(place.read("out.exr") == file);
        let settings = ["--resolve raw", "--set mode=reuse", "--set consistent"];
        for one in settings
            .iter()
            .take(if factors.contains("0.3") { 3 } else { 2 })
        {
            assert_eq!(levels(&format!("{factors} {one}")), None, "{one}");
        }
    }
    for one in [
        "--resolve raw",
        "--opsr-table 0 --resolve raw",
        "--set mode=pbrt",
        "--integrator guided",
        "--integrator bdpt --resolve raw",
        // These layers must add up to the unchanged picture.
        "--aov direct",
    ] {
        assert_eq!(levels(one), None, "{one}");
    }
    // One film, which may be blurred.
    for one in [
        "",
        "--opsr-table 0",
        "--integrator bdpt",
        "--integrator vcm",
        "--integrator vcm --set connections=nee",
    ] {
        // Without levels the metadata of a table's render say so.
        let none = (one == "--opsr-table 0").then_some("none");
        assert_eq!(levels(one).as_deref(), none, "{one}");
        let layers = exr::read_layers(&place.path().join("out.exr")).expect("layers");
        assert_eq!(layers.metadata["resolve"], "default", "{one}");
    }
    // The bound on the error includes the remaining bias, and applies to the picture that is shown.
    for options in ["--opsr-table 0.3", "", "--resolve none"] {
        let ended = place
            .opsr(&format!(
                "render scene.glb --size 16x16 {options} --target-error 0.1 --spp 4096 -o out.exr"
            ))
            .done();
        let error = percent_after(&ended.err, "average error ");
        assert!(error.is_some_and(|e| e <= 0.1), "{options}: {}", ended.err);
    }
}
