//! Work that needs more memory than is free: refused before allocation, with exit code 7 and the number of bytes.

use super::{RunResult, TestFolder};
use crate::support::gltf::File;
use crate::support::gltf::{grid, spread};
use serde_json::json;

impl TestFolder {
    /// Runs the program with an address space of this many kilobytes.
    fn opsr_in_memory(&self, kilobytes: u64, args: &str) -> RunResult {
        let program = env!("CARGO_BIN_EXE_opsr");
        let script = format!("ulimit -v {kilobytes}; exec {program} {args}");
        let mut shell = self.command("sh");
        RunResult::of(shell.args(["-c", &script]).output().expect("a shell"))
    }
}

/// Meshes of 2730 emissive triangles on this number of nodes; emissive meshes are not shared.
fn lamps(nodes: usize) -> Vec<u8> {
    let mut file = File::triangle();
    let corners = file.indices(&[0, 1, 2].repeat(2730));
    file.primitive()["indices"] = json!(corners);
    file.primitive()["material"] = json!(0);
    file.json["materials"] = json!([{ "emissiveFactor": [1, 1, 1] }]);
    for k in 1..nodes {
        file.push("nodes", json!({ "mesh": 0, "translation": [k, 0, 0] }));
    }
    file.glb()
}

#[test]
fn memory_of_eight_million_triangles_is_refused_before_it_is_taken() {
    let place = TestFolder::new();
    place.write("many.glb", lamps(3000));
    place.write("few.glb", lamps(100));
    for args in [
        "info many.glb",
        "render many.glb --size 8x8 --spp 1 -o out.exr --progress none",
    ] {
        let ended = place.opsr_in_memory(2_000_000, args);
        assert_eq!(ended.code, Some(7), "{args}: {}", ended.err);
        let words = "many.glb: not enough memory: 8190000 triangles, instances counted, need about 4.60 GB, and ";
        assert!(ended.err.contains(words), "{}", ended.err);
        assert!(!place.path().join("out.exr").exists());
    }
    place.opsr_in_memory(2_000_000, "info few.glb").done();
}

#[test]
fn memory_of_shared_instances_is_counted_once() {
    let place = TestFolder::new();
    let mut file = grid(71);
    spread(&mut file, 10_000);
    place.write("shared.glb", file.glb());
    // A hundred million triangles, whose copies would take 35 GB.
    let ended = place.opsr_in_memory(500_000, "info shared.glb").done();
    for words in [
        "triangles   100820000 in 10000 meshes",
        "shared      10000 instances of 1 mesh, 10082 triangles in memory",
    ] {
        assert!(ended.out.contains(words), "{}", ended.out);
    }
    let tiny = "--size 8x8 --spp 1 --progress none -o out.exr";
    place
        .opsr_in_memory(500_000, &format!("render shared.glb {tiny}"))
        .done();
}

#[test]
fn memory_of_a_large_picture_is_refused_before_it_is_taken() {
    let place = TestFolder::new();
    let render = |options: &str| {
        let common = "--spp 1 --max-vertices 1 --progress none -o out.exr";
        place.opsr_in_memory(1_500_000, &format!("render scene.glb {common} {options}"))
    };
    for (options, words) in [
        (
            "--size 16384x16384 --resolve raw",
            "16384x16384 pixels need about 29.53 GB",
        ),
        (
            "--size 16384x16384",
            "16384x16384 pixels need about 86.44 GB",
        ),
        (
            "--size 4096x4096 --resolve raw --aov",
            "4096x4096 pixels need about 5.12 GB",
        ),
        (
            "--size 2048x2048 --opsr-table 0.1 --set levels=4",
            "2048x2048 pixels of 4 levels need about 2.00 GB",
        ),
        // Mutations need the whole frame.
        (
            "--size 16384x16384 --crop 5,5,8,8 --integrator mlt",
            "16384x16384 pixels need about 12.88 GB",
        ),
    ] {
        let ended = render(options);
        assert_eq!(ended.code, Some(7), "{options}: {}", ended.err);
        assert!(ended.err.contains(words), "{options}: {}", ended.err);
        let hint = match options.contains("--crop") {
            true => "--size makes the picture smaller",
            false => "--crop renders a part",
        };
        assert!(ended.err.contains(hint), "{}", ended.err);
    }
    // The pilot does not start.
    let timed = "render scene.glb --time 1s --integrator auto --size 16384x16384 -o out.exr";
    let ended = place.opsr_in_memory(1_500_000, timed);
    assert_eq!(ended.code, Some(7), "{}", ended.err);
    // A picture that the estimate allows does fit: 0.46 GB of 0.8 for raw means, without copies of tiles or file.
    let raw = "--size 2048x2048 --resolve raw --spp 1 --max-vertices 1 --progress none -o out.exr";
    let args = format!("render scene.glb {raw} --threads 2");
    place.opsr_in_memory(800_000, &args).done();
    render("--size 1600x1600").done();
    render("--size 16384x16384 --crop 5,5,8,8").done();
}

/// Memory of a training's recordings.
#[test]
#[cfg(feature = "train")]
fn memory_of_recordings_is_refused_before_it_is_taken() {
    let place = super::train::place();
    let args = super::train::TRAIN;
    let ended = place.opsr_in_memory(1_500_000, &format!("{args} --set spp=100000 --steps 1"));
    assert_eq!(ended.code, Some(7), "{}", ended.err);
    let words = "recordings of 2 crops need about ";
    assert!(ended.err.contains(words), "{}", ended.err);
}
