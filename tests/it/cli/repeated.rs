//! The options in a picture's metadata reproduce the picture.

use super::TestFolder;
use crate::fuzz::seeds;
use opsr::image::exr::{self, Layers};
use opsr::render::{Heading, Opt};
use opsr_lab::gallery;
use std::path::Path;

/// Options of every mode, of scenes and of films.
const MODES: &[&str] = &[
    "",
    "--resolve raw",
    "--resolve none",
    "--resolve sharp",
    "--set sampler=sobol --max-vertices 4",
    "--opsr-table 0.3",
    "--opsr-table 0.3 --set levels=3",
    "--opsr-table 0.3 --set levels=0,0.5,2 --resolve sharp",
    "--opsr-table 0.3 --set levels=none",
    "--opsr-table 0",
    "--opsr-table 0.3 --set mode=reuse",
    "--opsr-table 0.3 --set consistent",
    "--opsr-table 0.3 --set consistent=0.2",
    "--opsr-table beta-0.001",
    "--opsr-table table.json --set table_scale=0.5 --set lookup=linear",
    "--set mode=pbrt",
    "--set mode=filter-glossy --set filter=2",
    "--set mode=roughness-clamp",
    "--set mode=mollifier",
    "--integrator guided",
    "--integrator guided --opsr-table 0.3",
    "--integrator guided --set unbiased --opsr-table 0.3",
    "--integrator manifold",
    "--integrator manifold --set trials=4",
    "--integrator light",
    "--integrator bdpt",
    "--integrator bdpt --resolve raw --opsr-table 0.3",
    "--integrator bdpt --set mode=mollifier",
    "--integrator bdpt --set strategy=1,2",
    "--integrator vcm",
    "--integrator vcm --set radius=0.1 --opsr-table 0.3",
    "--integrator vcm --set connections=nee",
    "--integrator vcm --set strategy=merges",
    "--integrator sppm",
    "--integrator sppm --set radius=0.1 --set radius_alpha=0.8 --set levels=1,3",
    "--integrator sppm --resolve raw",
    "--integrator mlt",
    "--integrator mlt --set mlt_pass=3 --opsr-table 0.3",
    "--integrator auto",
    "--integrator auto --opsr-table 0.3",
    "--env sky --sun 30,120,4 --env-intensity 0.5",
    "--env studio --env-rotation 40",
    "--camera=0,1,4,0,1,0,0,1,0,40 --seed 7",
    "--camera 0 --lens 0.05,3",
    "--at 0.5s --glass thin",
    "--glass solid --distribution beckmann",
];

/// The layers of a file.
fn layers(path: &Path) -> Layers {
    exr::read_layers(path).expect("layers")
}

/// Metadata that are not options.
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

/// The options in the metadata.
fn options(layers: &Layers) -> Vec<String> {
    let choices = layers.metadata.iter();
    let choices = choices.filter(|(key, _)| !NO_OPTIONS.contains(&key.as_str()));
    let typed = choices.flat_map(|(key, value)| {
        let option = Opt::named(key).unwrap_or_else(|| panic!("{key} is no option"));
        match (option.heading == Heading::Research, option.value.is_empty()) {
            (true, _) => vec!["--set".into(), format!("{key}={value}")],
            (false, true) => vec![format!("--{}", option.flag())],
            (false, false) => vec![format!("--{}={value}", option.flag())],
        }
    });
    typed.collect()
}

#[test]
fn metadata_typed_again_give_the_bytes_of_every_mode() {
    let place = TestFolder::new();
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
        // The method that `auto` chose is in the metadata.
        assert_eq!(typed, options(&again), "{mode}");
        assert!(first.channels == again.channels, "{mode}: {typed:?}");
        assert!(
            place.read("a.exr") == place.read("b.exr"),
            "{mode}: {typed:?}"
        );
    }
}
