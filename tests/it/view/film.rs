//! Animations on the page: each frame is a render at its time, and better renders replace it.

use super::{Running, colours, spec};
use crate::support::gltf::File;
use opsr::image::png::display;
use opsr_lab::gallery::{self, glb};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::time::{Duration, Instant};

const FRAMES: usize = 6;

/// A caustic box whose camera moves nearer in a quarter of a second.
fn moving() -> Vec<u8> {
    let mut file = File::from_glb(&glb::to_glb(&gallery::caustic_box()).expect("a scene"));
    let nodes = file.json["nodes"].as_array().expect("nodes");
    let camera = nodes.iter().position(|node| node.get("camera").is_some());
    let camera = camera.expect("a camera");
    let place = |i: usize| nodes[camera]["matrix"][i].as_f64().expect("a number") as f32;
    let from = [0.0, place(13), place(14)];
    // A camera looks along its own -z.
    let lens = nodes[camera]["camera"].clone();
    file.json["nodes"][camera] = json!({ "camera": lens });
    let times = file.floats("SCALAR", &[0.0, 0.25]);
    let ends = [("min", [0.0]), ("max", [0.25])];
    for (end, at) in ends {
        file.json["accessors"][times][end] = json!(at);
    }
    let comes = file.floats("VEC3", &[from, [0.5, from[1], 0.6 * from[2]]].concat());
    let channel = json!({ "sampler": 0, "target": { "node": camera, "path": "translation" } });
    let sampler = json!({ "input": times, "output": comes });
    let animation = json!({ "samplers": [sampler], "channels": [channel] });
    file.push("animations", animation);
    file.glb()
}

impl Running {
    /// The oldest change after one of a film, and its pixels.
    fn change(&self, film: &Value, change: &Value) -> (Value, Vec<u8>) {
        let body = self.get(&format!("film?film={film}&change={change}")).body;
        let length = u32::from_le_bytes(body[..4].try_into().expect("a length")) as usize;
        let head = serde_json::from_slice(&body[4..4 + length]).expect("JSON");
        (head, body[4 + length..].to_vec())
    }

    /// Changes of a film until every frame is of this round.
    fn changes(&self, round: u64, film: &mut Value, change: &mut Value) -> Vec<(Value, Vec<u8>)> {
        let (mut all, mut rounds) = (Vec::new(), BTreeMap::new());
        let end = Instant::now() + Duration::from_secs(120);
        while rounds.len() < FRAMES || rounds.values().any(|of| *of < round) {
            assert!(Instant::now() < end, "{rounds:?}");
            let (head, pixels) = self.change(film, change);
            if head["size"].is_null() {
                std::thread::sleep(Duration::from_millis(10));
                continue;
            }
            if head["film"] == *film {
                assert!(head["change"].as_u64() > change.as_u64(), "{head}");
            }
            (*film, *change) = (head["film"].clone(), head["change"].clone());
            let of = |key: &str| head[key].as_u64().expect("a number");
            rounds.insert(of("frame"), of("round"));
            all.push((head, pixels));
        }
        all
    }

    fn play(&self, message: &Value) {
        let answer = self.post("set", message);
        assert_eq!(answer.status, 200, "{}", answer.text());
    }
}

/// A render of a frame of this size, as the page shows it.
fn rendered(viewer: &Running, frame: u64, samples: u32, method: &str, size: &Value) -> Vec<u8> {
    let (at, spp) = (json!(format!("{frame}@24")), json!(samples));
    let size = json!(format!("{}x{}", size[0], size[1]));
    let choices = [
        ("at", at),
        ("spp", spp),
        ("seed", json!(frame)),
        ("size", size),
    ];
    let asked = spec(&[&choices[..], &[("integrator", json!(method))]].concat());
    let (_, picture) = super::rendered(viewer, &asked);
    let pixels = picture.pixels.iter();
    pixels.flat_map(|&p| display(p, 0.5.into())).collect()
}

fn difference(a: &[u8], b: &[u8]) -> u64 {
    let pairs = a.iter().zip(b);
    pairs.map(|(a, b)| u64::from(a.abs_diff(*b))).sum()
}

/// The first round renders frames with two samples, later rounds converge. Frames are kept while the animation is
/// paused, and rendered again after other changes.
#[test]
fn view_runs_animations() {
    let viewer = Running::of(
        &moving(),
        &[("exposure", json!(0.5)), ("integrator", json!("path"))],
    );
    viewer.done();
    assert_eq!(viewer.json("facts")["frames"], FRAMES);
    let (head, pixels) = viewer.change(&json!(0), &json!(0));
    assert!(head["size"].is_null() && pixels.is_empty(), "{head}");
    viewer.play(&json!({ "playing": true }));
    let (mut film, mut change) = (json!(0), json!(0));
    let all = viewer.changes(3, &mut film, &mut change);
    let (head, _) = viewer.until(|head| head["state"]["playing"] == true);
    assert_eq!(head["state"]["phase"], "playing");
    assert_eq!(head["state"]["film"]["kept"], FRAMES);
    assert_eq!(viewer.get("picture.png").status, 503);
    let of = |frame: u64, round: u64| {
        let mut found = all
            .iter()
            .filter(|(head, _)| head["frame"] == frame && head["round"] == round);
        found.next()
    };
    let mut errors = [0; 2];
    let mut seen = 0;
    for frame in 0..FRAMES as u64 {
        let truth = rendered(&viewer, frame, 200, "vcm", &json!([24, 16]));
        let (head, last) = of(frame, 3).expect("the last round");
        assert_eq!(head["size"], json!([24, 16]));
        let command = head["command"].as_str().expect("a command");
        for words in [
            format!("--at '{frame}@24'"),
            format!("--seed {frame} "),
            "--camera ".into(),
        ] {
            let words = words.replace("--seed 0 ", "");
            assert!(command.contains(&words), "{command}");
        }
        // A slow page misses replaced frames.
        let Some((head, first)) = of(frame, 0) else {
            continue;
        };
        // A slow machine starts with fewer pixels.
        let size = &head["size"];
        let own = rendered(&viewer, frame, 2, "path", size);
        assert_eq!(head["samples"], 2);
        assert!(colours(first) == own, "{frame} {size}");
        if *size != json!([24, 16]) {
            continue;
        }
        errors[0] += difference(&colours(first), &truth);
        errors[1] += difference(&colours(last), &truth);
        seen += 1;
    }
    assert!(seen == 0 || 2 * errors[1] < errors[0], "{seen}: {errors:?}");

    // Another exposure sends all frames again without rendering.
    viewer.play(&json!({ "options": { "exposure": 2 } }));
    let brighter = viewer.changes(3, &mut film, &mut change);
    assert_eq!(brighter.len(), FRAMES);
    for (head, pixels) in &brighter {
        let frame = head["frame"].as_u64().expect("a number");
        let (_, before) = of(frame, 3).expect("the last round");
        let sum = |pixels: &[u8]| colours(pixels).iter().map(|x| u64::from(*x)).sum::<u64>();
        assert!(sum(pixels) > sum(before));
    }
    viewer.play(&json!({ "options": { "exposure": 0.5, "at": "3@24" }, "playing": false }));
    let (head, _) = viewer.until(|head| {
        let same = head["picture"]["run"] == head["state"]["run"];
        same && head["state"]["phase"] == "done" && head["picture"]["samples"] == 8
    });
    let command = head["state"]["command"].as_str().expect("a command");
    assert!(command.contains("--at '3@24'"), "{command}");
    // The file's camera moves with the animation.
    let look = head["state"]["look"].clone();
    viewer.play(&json!({ "options": { "at": "5@24" } }));
    viewer.until(|head| head["state"]["look"] != look && head["state"]["look"].is_object());

    // Without changes the frames are kept.
    viewer.play(&json!({ "playing": true }));
    let (head, _) = viewer.until(|head| head["state"]["phase"] == "playing");
    assert_eq!(head["state"]["film"]["number"], film);
    assert_eq!(head["state"]["film"]["kept"], FRAMES);
    // Another camera invalidates the frames.
    let mut turned = look.clone();
    turned["position"][0] = json!(0.4);
    viewer.play(&json!({ "look": turned }));
    let before = film.clone();
    // On a busy machine the frames of the old camera are there for a while.
    viewer.until(|head| {
        let number = &head["state"]["film"]["number"];
        number.is_number() && *number != before
    });
    let other = viewer.changes(0, &mut film, &mut change);
    assert!(film != before && other.iter().all(|(head, _)| head["film"] == film));
    viewer.play(&json!({ "playing": false, "options": { "at": null, "max_vertices": 3 } }));
    viewer.until(|head| head["state"]["film"].is_null() && head["state"]["phase"] == "done");
}

/// A file without animations cannot play.
#[test]
fn view_plays_no_file_without_animations() {
    let viewer = Running::new(&[]);
    viewer.play(&json!({ "playing": true }));
    let (head, _) = viewer.done();
    assert!(head["state"]["film"].is_null());
    assert_eq!(viewer.json("facts")["seconds"], 0.0);
}
