//! `opsr render --frames` and `opsr film`.

use super::TestFolder;
use crate::support::gltf::File;
use opsr::image::exr;
use opsr_lab::gallery::{self, glb};
use serde_json::json;

/// A folder with a caustic box, whose camera approaches, and unless `still` a mesh that rises.
fn moving(still: bool) -> TestFolder {
    let mut file = File::from_glb(&glb::to_glb(&gallery::caustic_box()).unwrap());
    let nodes = file.json["nodes"].as_array().unwrap();
    let camera = nodes.iter().position(|n| n.get("camera").is_some());
    let camera = camera.expect("a camera");
    let matrix: Vec<f32> = (nodes[camera]["matrix"].as_array().unwrap().iter())
        .map(|x| x.as_f64().unwrap() as f32)
        .collect();
    // Without rotation the camera looks along -z.
    let lens = file.json["nodes"][camera]["camera"].clone();
    file.json["nodes"][camera] = json!({ "camera": lens });
    let from = [0.0, matrix[13], matrix[14]];
    let times = file.floats("SCALAR", &[0.0, 1.0]);
    let comes = file.floats("VEC3", &[from, [0.3, from[1], 0.7 * from[2]]].concat());
    let rises = file.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.5, 0.0]);
    let mesh = file.json["meshes"].as_array().unwrap().len() - 1;
    let moved = [(comes, camera), (rises, mesh)];
    for &(output, node) in &moved[..if still { 1 } else { 2 }] {
        file.push(
            "animations",
            json!({
                "samplers": [{ "input": times, "output": output }],
                "channels": [{ "sampler": 0, "target": { "node": node, "path": "translation" } }],
            }),
        );
    }
    let place = TestFolder::new();
    place.write("scene.glb", file.glb());
    place
}

const FILM: &str = "--spp 3 --aov position,motion,albedo --frames 2..7";

const NUMBERS: std::ops::RangeInclusive<u32> = 2..=7;

/// The frames are equal for one run, for single renders that are averaged later, for other numbers of threads, and for
/// a resumed film. A scene in which only cameras move is opened once; every single render opens it again.
#[test]
fn film_has_the_same_bytes_however_it_is_made() {
    for (still, method) in [
        (false, "--opsr-table beta-0.001"),
        (true, "--integrator vcm --resolve raw"),
    ] {
        let place = moving(still);
        let film = format!("{FILM} {method}");
        let outputs = |name: &str| format!("-o {name}_#.exr -o {name}_#.png -o {name}.apng");
        let ended = place.render(&format!("{film} {}", outputs("one"))).done();
        // The animations of the camera and of an object.
        let both = match still {
            true => "",
            false => " WARN scene.glb: animations: all 2 play at once",
        };
        assert_eq!(ended.err.trim_end(), both);
        let single = "--spp 3 --aov position,albedo --at";
        for k in NUMBERS {
            let single = format!("{single} {k}@24 --seed {k} {method} -o {k}.exr");
            place.render(&single).done();
        }
        let film_of = format!(
            "film scene.glb #.exr {} --motion --reproducible",
            outputs("all")
        );
        let words = place.opsr(&film_of).done().err;
        let expected = "all_#.exr, all_#.png, all.apng: 6 frames, exposure ";
        assert!(words.starts_with(expected), "{words}");
        place
            .render(&format!(
                "{film} --threads 7 --checkpoint kept -o kept_#.exr"
            ))
            .done();
        for k in NUMBERS {
            let kept = place.read(&format!("kept/00000{k}.exr"));
            assert!(
                kept == place.read(&format!("{k}.exr")),
                "{method}: kept {k}"
            );
        }
        std::fs::remove_file(place.path().join("kept/000005.exr")).expect("a kept frame");
        let later = format!("{film} --checkpoint kept --resume {}", outputs("later"));
        place.render(&later).done();
        for k in NUMBERS {
            let one = |name: &str| place.read(&format!("{name}_{k}.exr"));
            for other in ["all", "kept", "later"] {
                assert!(one(other) == one("one"), "{method}: {other} {k}");
            }
            let png = |name: &str| place.read(&format!("{name}_{k}.png"));
            assert!(
                png("all") == png("one") && png("later") == png("one"),
                "{method}: {k}"
            );
        }
        let all = ["all", "one", "later"].map(|name| place.read(&format!("{name}.apng")));
        assert!(all[0] == all[1] && all[1] == all[2], "{method}");
        // The chunk acTL has the number of frames; an ordinary decoder finds the first frame.
        let control = all[0]
            .windows(4)
            .position(|name| name == b"acTL")
            .expect("an animation");
        assert_eq!(all[0][control + 4..control + 8], 6u32.to_be_bytes());
        let first = image::load_from_memory(&all[0])
            .expect("a picture")
            .into_rgb8();
        let png = image::load_from_memory(&place.read("one_2.png")).expect("a picture");
        assert!(first == png.into_rgb8());
    }
}

#[test]
fn frame_without_neighbours_is_the_single_picture() {
    let place = moving(false);
    let how = "--spp 8 --integrator path --exr piz";
    place
        .render(&format!("{how} --frames 5..5@30 --seed 10 -o film_#.exr"))
        .done();
    place
        .render(&format!("{how} --at 5@30 --seed 15 -o one.exr"))
        .done();
    let layers = |name: &str| exr::read_layers(&place.path().join(name)).expect(name);
    let (film, one) = (layers("film_5.exr"), layers("one.exr"));
    for channel in ["R", "G", "B", "error"] {
        assert!(film.channels[channel] == one.channels[channel], "{channel}");
    }
    assert!(film.channels["window"].iter().all(|r| *r == 0.0));
    let text = |key: &str| {
        (
            film.metadata.get(key).cloned(),
            one.metadata.get(key).cloned(),
        )
    };
    let (a, b) = text("mean_relative_error");
    assert!(a.is_some() && a == b, "{a:?} {b:?}");
    assert_eq!(film.metadata["frame"], "5");
}

/// A stopped film keeps its finished frames, and can be resumed.
#[cfg(unix)]
#[test]
fn stopped_film_loses_no_frame() {
    let place = moving(false);
    let film = "render scene.glb --size 16x16 --reproducible --progress none --integrator path --spp 3000 --frames 0..3";
    place.opsr(&format!("{film} -o whole_#.exr")).done();
    let run = |more: &str| format!("{film} --checkpoint kept -o film_#.exr -o film.apng {more}");
    let ended = place.interrupted(&run(""), "kept/000000.exr");
    assert_eq!(ended.code, Some(5), "{}", ended.err);
    let kept = place.files_in("kept");
    assert!(!kept.is_empty() && kept.len() < 4, "{} frames", kept.len());
    // The finished frames are written.
    assert!(place.path().join("film_0.exr").exists());
    assert!(
        ended.err.contains("film.apng: not written"),
        "{}",
        ended.err
    );
    assert!(!place.path().join("film.apng").exists());
    let refused = place.opsr(&run(""));
    assert_eq!(refused.code, Some(2), "{}", refused.err);
    place.opsr(&run("--resume")).done();
    for k in 0..4 {
        assert!(
            place.read(&format!("film_{k}.exr")) == place.read(&format!("whole_{k}.exr")),
            "{k}"
        );
    }
    for (name, bytes) in kept {
        assert!(
            place.files_in("kept")[&name] == bytes,
            "{name} was rendered again"
        );
    }
}

#[test]
fn films_that_cannot_be_are_refused() {
    let place = moving(false);
    place.render("--spp 2 --at 1@24 -o in_1.exr").done();
    let small = "render scene.glb --progress none --spp 2 --at 2@24 --size 8x8";
    place.opsr(&format!("{small} -o in_2.exr")).done();
    place.render("--spp 2 --at 3@24 -o in_3.exr").done();
    place.save("still.glb", &gallery::caustic_box());
    place
        .render("--spp 2 --integrator path --frames 0..1 --checkpoint kept -o kept_#.exr")
        .done();
    let render =
        "render scene.glb --size 16x16 --progress none --integrator path --spp 2 --frames 0..1";
    for (code, args, words) in [
        (
            2,
            format!("{render} -o out.exr"),
            "out.exr: expected a name with ####",
        ),
        (
            2,
            format!("{render} -o #_#.exr"),
            "expected a name with ####",
        ),
        (4, format!("{render} -o none/#.exr"), "none: no such folder"),
        (
            2,
            format!("{render} -o #.exr -o #.exr"),
            "is the name of two outputs",
        ),
        (
            2,
            format!("{render} -o a.apng -o a.apng"),
            "is the name of two outputs",
        ),
        (
            2,
            format!("{render} -o #.exr --exposure 1"),
            "--exposure: is of PNG files",
        ),
        (
            2,
            format!("{render} -o #.exr --at 1s"),
            "--at: --frames already sets the moments",
        ),
        (
            2,
            format!("{render} -o #.exr --stats a.json"),
            "--stats: for one picture",
        ),
        (
            2,
            format!("{render} -o #.exr --save-every 1s"),
            "--save-every: for one picture",
        ),
        (
            2,
            format!("{render} -o #.exr --aov direct"),
            "--aov: direct describes a single frame",
        ),
        (
            2,
            format!("{render} -o #.png --aov motion"),
            "motion is a layer of EXR files",
        ),
        (
            2,
            "render scene.glb --size 16x16 --spp 2 --aov motion -o out.exr".into(),
            "--aov: motion is of the frames of a film",
        ),
        (
            2,
            format!("{render} -o #.png --aov"),
            "--aov: adds layers to EXR files",
        ),
        (
            2,
            format!("{render} -o #.exr --checkpoint kept"),
            "kept has frames: --resume",
        ),
        (
            2,
            format!("{render} -o #.exr --checkpoint in_1.exr"),
            "with --frames it is a folder",
        ),
        (
            3,
            format!("{render} -o #.exr --checkpoint kept --resume --seed 5"),
            "its `seed` is 0",
        ),
        (
            3,
            format!("{render} -o #.exr --checkpoint kept --resume --aov"),
            "a frame without the layer albedo",
        ),
        (
            2,
            "render still.glb --frames 0..1 -o #.exr".into(),
            "there are no animations",
        ),
        (
            2,
            "render scene.glb --frames 3..1 -o #.exr".into(),
            "expected the first and the last frame",
        ),
        (
            2,
            "film scene.glb in_1.exr -o #.exr".into(),
            "in_1.exr: expected a name with ####",
        ),
        (
            2,
            "film scene.glb in_#.exr -o in_#.exr".into(),
            "would replace a file that is read",
        ),
        (
            3,
            "film scene.glb no_#.exr -o #.exr".into(),
            "no_#.exr: no such files",
        ),
        (
            3,
            "film scene.glb in_#.exr --frames 4..5 -o #.exr".into(),
            "in_4.exr",
        ),
        (
            3,
            "film scene.glb in_#.exr -o #.exr".into(),
            "frame 1 shows 16x16 pixels at (0, 0) of 16x16",
        ),
        (
            3,
            "film still.glb in_#.exr --frames 1..1 -o #.exr".into(),
            "in_1.exr: rendered from another scene than still.glb",
        ),
        (
            3,
            "render none.glb --frames 0..1 --checkpoint fresh -o #.exr".into(),
            "none.glb",
        ),
    ] {
        let before = place.files();
        let ended = place.opsr(&args);
        assert_eq!(ended.code, Some(code), "{args}: {}", ended.err);
        assert!(ended.err.contains(words), "{args}: {}", ended.err);
        assert!(place.files() == before, "{args} left files");
    }
    // An option of the kept frames that the command does not have.
    let thin = "--integrator path --spp 2 --frames 0..1 --glass thin --checkpoint thin";
    place.render(&format!("{thin} -o thin_#.exr")).done();
    let other = place.opsr(&format!("{render} --checkpoint thin --resume -o #.exr"));
    assert_eq!(other.code, Some(3), "{}", other.err);
    assert!(other.err.contains("its `glass` is thin"), "{}", other.err);
    std::fs::remove_file(place.path().join("in_2.exr")).expect("a file");
    let gap = place.opsr("film scene.glb in_#.exr -o #.exr");
    assert!(
        gap.code == Some(3) && gap.err.contains("in_2.exr: missing"),
        "{}",
        gap.err
    );
    // Frames with the same seed have the same noise.
    place.render("--spp 2 --at 2@24 -o in_2.exr").done();
    let warned = place.opsr("film scene.glb in_#.exr -o out_#.exr").done();
    assert!(
        warned.err.contains("all frames have the seed 0"),
        "{}",
        warned.err
    );
}
