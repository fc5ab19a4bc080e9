//! Metadata of a picture, typed again, give the picture.

use super::Place;
use crate::fuzz::seeds;
use opsr::image::exr::{self, Layers};
use opsr_lab::gallery;
use std::path::Path;

/// Options of every mode, and of what surrounds a scene and its film.
const MODES: &[&str] = &[
    "",
    "--resolve raw",
    "--resolve none",
    "--resolve sharp",
    "--sampler sobol --max-vertices 4",
    "--gamma 0.3",
    "--gamma 0.3 --levels 3",
    "--gamma 0.3 --levels 0,0.5,2 --resolve sharp",
    "--gamma 0.3 --levels none",
    "--gamma 0",
    "--gamma 0.3 --mode reuse",
    "--gamma 0.3 --consistent",
    "--gamma 0.3 --consistent 0.2",
    "--opsr-table beta-0.001",
    "--opsr-table table.json --table-scale 0.5 --lookup linear",
    "--mode pbrt",
    "--mode filter-glossy --filter 2",
    "--mode roughness-clamp",
    "--mode mollifier",
    "--guide",
    "--guide --gamma 0.3",
    "--guide unbiased --gamma 0.3",
    "--manifold",
    "--manifold 4",
    "--integrator light",
    "--integrator bdpt",
    "--integrator bdpt --resolve raw --gamma 0.3",
    "--integrator bdpt --mode mollifier",
    "--integrator bdpt --strategy 1,2",
    "--integrator vcm",
    "--integrator vcm --radius 0.1 --gamma 0.3",
    "--integrator vcm --connections nee",
    "--integrator vcm --strategy merges",
    "--integrator sppm",
    "--integrator sppm --radius 0.1 --radius-alpha 0.8 --levels 1,3",
    "--integrator sppm --resolve raw",
    "--integrator mlt",
    "--integrator mlt --mlt-pass 3 --gamma 0.3",
    "--integrator auto",
    "--integrator auto --gamma 0.3",
    "--env sky --sun 30,120 --turbidity 4 --env-intensity 0.5",
    "--env studio --env-rotation 40",
    "--look=0,1,4,0,1,0,0,1,0,40 --seed 7",
    "--camera 0 --aperture 0.05 --focus 3",
    "--solid-glass --distribution beckmann",
];

/// The layers of a file.
fn layers(path: &Path) -> Layers {
    exr::read_layers(path).expect("layers")
}

/// What metadata hold beside the options.
const NO_OPTIONS: [&str; 8] = [
    "mean_error",
    "mean_relative_error",
    "missing_light",
    "refused_samples",
    "scene",
    "scene_sha256",
    "table_sha256",
    "version",
];

/// The options that metadata name.
fn options(layers: &Layers) -> Vec<String> {
    let choices = layers.metadata.iter();
    let choices = choices.filter(|(key, _)| !NO_OPTIONS.contains(&key.as_str()));
    let typed = choices.flat_map(|(key, value)| {
        let name = if key == "table" { "opsr-table" } else { key };
        let flag = format!("--{}", name.replace('_', "-"));
        match value.as_str() {
            "true" => vec![flag],
            _ => vec![format!("{flag}={value}")],
        }
    });
    typed.collect()
}

#[test]
fn metadata_typed_again_give_the_bytes_of_every_mode() {
    let place = Place::new();
    place.save("box.glb", &gallery::caustic_box());
    place.write("table.json", &seeds::tables()[1]);
    let file = |name: &str| place.path().join(name);
    for mode in MODES {
        let render = |more: &[String], out: &str| {
            let mut command = place.command(env!("CARGO_BIN_EXE_opsr"));
            command.args(["render", "box.glb", "--size", "10x8", "--reproducible"]);
            let ended = command.args(more).args(["-o", out]).output();
            let ended = ended.expect("an end");
            let err = String::from_utf8_lossy(&ended.stderr);
            assert!(ended.status.success(), "{mode}: {more:?}: {err}");
        };
        let words: Vec<String> = mode.split_whitespace().map(str::to_owned).collect();
        render(
            &[&words[..], &["--spp".into(), "8".into()]].concat(),
            "a.exr",
        );
        let typed = options(&layers(&file("a.exr")));
        render(&typed, "b.exr");
        let [first, again] = ["a.exr", "b.exr"].map(|name| layers(&file(name)));
        // The method that `auto` chose is named for itself.
        assert_eq!(typed, options(&again), "{mode}");
        assert!(first.channels == again.channels, "{mode}: {typed:?}");
        assert!(
            place.read("a.exr") == place.read("b.exr"),
            "{mode}: {typed:?}"
        );
    }
}
