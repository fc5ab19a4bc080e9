//! The programs of `examples/`, compiled into this binary so that they need no build of their own, and the library's
//! facade against the program.

#[path = "../../examples/levels_and_layers.rs"]
#[allow(dead_code)]
mod levels_and_layers;
#[path = "../../examples/look_up.rs"]
mod look_up;
#[path = "../../examples/render.rs"]
#[allow(dead_code)]
mod render;
#[cfg(feature = "train")]
#[path = "../../examples/study.rs"]
#[allow(dead_code)]
mod study;
#[cfg(feature = "train")]
#[path = "../../examples/train.rs"]
#[allow(dead_code)]
mod train;

use crate::cli::TestFolder;
use crate::support::{quick_folder, root};
use opsr::image::denoise::Denoiser;
use opsr::image::exr;
use opsr::render::Spec;
use opsr::scene::SceneParts;
use opsr::{Aov, Fault, Render, Scene};
use opsr_lab::gallery;
use serde_json::json;

/// A scene of the repository.
fn scene(name: &str) -> String {
    format!("{}/training_scenes/{name}.glb", root().display())
}

#[test]
fn example_look_up_regularises_a_path() {
    look_up::main().expect("a built-in table");
}

#[test]
fn example_render_writes_a_picture() {
    let folder = quick_folder();
    let out = folder.path().join("out.exr");
    render::render(&scene("rings"), out.to_str().expect("UTF-8"), 2).expect("a picture");
    let picture = exr::read_rgb(&out).expect("a picture");
    assert_eq!((picture.width, picture.height), (160, 120));
    assert!(picture.pixels.iter().any(|p| p.x > 0.0));
    let png = folder.path().join("out.png");
    render::render(&scene("rings"), png.to_str().expect("UTF-8"), 1).expect("a picture");
    assert!(std::fs::read(&png).expect("a file").starts_with(b"\x89PNG"));
    let wrong = render::render(&scene("rings"), "out.gif", 1).expect_err("no such format");
    assert!(wrong.to_string().contains("out.gif: expected"), "{wrong}");
    let none = render::render("none.glb", "out.png", 1).expect_err("no such file");
    assert!(none.to_string().contains("none.glb"), "{none}");
}

#[test]
fn example_levels_and_layers_chooses_levels() {
    let folder = quick_folder();
    let out = folder.path().join("out.exr");
    let words = out.to_str().expect("UTF-8");
    let shares = levels_and_layers::render(&scene("swimming_pool"), words, 8).expect("a picture");
    assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9);
    assert!(shares[0] < 0.99, "nothing is roughened: {shares:?}");
    let bytes = std::fs::read(&out).expect("a file");
    for layer in ["albedo.", "normal.", "depth", "level", "error", "bias2"] {
        let found = bytes.windows(layer.len()).any(|w| w == layer.as_bytes());
        assert!(found, "no layer {layer}");
    }
}

/// A short program with the facade makes the picture of the command line.
#[test]
fn facade_renders_the_picture_of_the_program() {
    let place = TestFolder::new();
    place.save("scene.glb", &gallery::caustic_box());
    let path = place.path().join("scene.glb");
    let scene = Scene::open(&path).expect("a scene");
    for (args, render) in [
        ("", Render::new(&scene)),
        (
            "--opsr-table beta-0.001 --seed 3",
            Render::new(&scene).table("beta-0.001").unwrap().seed(3),
        ),
        (
            "--opsr-table 0.2 --resolve raw",
            Render::new(&scene).gamma(0.2).raw(),
        ),
    ] {
        let command = format!("render scene.glb --size 24x16 --spp 8 {args} -o theirs.exr");
        place.opsr(&command).done();
        let picture = render.size(24, 16).spp(8).run().expect("a picture");
        picture.save(place.path().join("ours.exr")).expect("a file");
        let read = |name: &str| exr::read_rgb(&place.path().join(name)).expect("a picture");
        let (ours, theirs) = (read("ours.exr"), read("theirs.exr"));
        assert!(ours.pixels == theirs.pixels, "{args}");
        assert!(ours.pixels == picture.shown.picture.pixels, "{args}");
    }
    // Impossible options are errors, not ignored.
    let light = Render::new(&scene).gamma(0.2).aovs(&[Aov::Emission]).run();
    assert!(matches!(light, Err(Fault::Option { name: "aov", .. })));
    assert!(Render::new(&scene).size(0, 4).run().is_err());
    assert!(
        Render::new(&scene)
            .gamma(0.2)
            .levels(&[0.5, 0.1])
            .run()
            .is_err()
    );
    assert!(Render::new(&scene).table("none.json").is_err());
}

/// Files of the library equal the program's: every EXR layer, the metadata except the scene, and PNG files.
#[test]
fn facade_writes_the_files_of_the_program() {
    let place = TestFolder::new();
    // Only the sun: glTF has no environment.
    let parts = SceneParts {
        environment: None,
        ..gallery::builtin("sun-pool").expect("a scene")
    };
    place.save("scene.glb", &parts);
    let scene = Scene::open(place.path().join("scene.glb")).expect("a scene");
    let mut cases = vec![
        ("", json!({})),
        ("--integrator path", json!({"integrator": "path"})),
        (
            "--resolve raw --aov --exposure 1.5 --view agx",
            json!({"resolve": "raw", "aov": true, "exposure": 1.5, "view": "agx"}),
        ),
        (
            "--opsr-table 0.3 --aov each-level --exr half",
            json!({"table": 0.3, "aov": "each-level", "exr": "half"}),
        ),
    ];
    if Denoiser::open().is_ok() {
        for (args, mut options) in cases.clone() {
            options["denoise"] = true.into();
            cases.push((format!("{args} --denoise").leak(), options));
        }
    }
    let mut witnessed = 0;
    for (args, options) in cases {
        let mut spec = Spec::default();
        for (name, value) in options.as_object().expect("options") {
            spec.set(name, value).expect("an option");
        }
        // Enough samples for a witness.
        let command =
            "render scene.glb --size 32x32 --spp 400 --reproducible -o theirs.exr -o theirs.png";
        place.opsr(&format!("{command} {args}")).done();
        let render = Render::new(&scene).with(|own| *own = spec.clone());
        let finished = render.size(32, 32).spp(400).run().expect("a picture");
        witnessed += usize::from(finished.outcome.missing.is_some());
        for name in ["ours.exr", "ours.png"] {
            finished.save(place.path().join(name)).expect("a file");
        }
        assert!(place.read("ours.png") == place.read("theirs.png"), "{args}");
        let [ours, mut theirs] = ["ours.exr", "theirs.exr"]
            .map(|name| exr::read_layers(&place.path().join(name)).expect("a file"));
        theirs.metadata.retain(|key, _| !key.starts_with("scene"));
        assert!(ours == theirs, "{args}");
    }
    assert!(witnessed > 0, "light is missing in plain pictures");
}

/// Settings of a training that takes a second.
#[cfg(feature = "train")]
fn config(scenes: &[&str]) -> opsr_train::Config {
    opsr_train::Config {
        scenes: scenes.iter().map(|&name| name.into()).collect(),
        manifest: root().join("training_scenes/manifest.toml"),
        spp: 8,
        steps: 2,
        ..Default::default()
    }
}

#[cfg(feature = "train")]
#[test]
fn example_train_lowers_the_loss() {
    let config = opsr_train::Config {
        steps: 20,
        optimiser: opsr_train::config::Optimiser::Log,
        start: 0.0,
        ..config(&["cornell_caustics"])
    };
    let (table, ratio) = train::learn(config).expect("a table");
    assert!(ratio < 1.0, "{ratio}");
    assert!(table.gammas.iter().any(|g| *g != table.gammas[0]));
}

#[cfg(feature = "train")]
#[test]
fn example_study_holds_every_family_out_once() {
    let all = study::study(config(&["cornell_caustics", "rings"])).expect("scores");
    let (beta, held_out) = &all[0];
    assert_eq!((all.len(), *beta), (1, 0.001));
    let families: Vec<&str> = held_out.iter().map(|h| h.family.as_str()).collect();
    assert_eq!(families, ["box", "rings"]);
    for family in held_out {
        let loss = |i: usize| family.scores[i].loss;
        assert_eq!(family.scores[0].name, "best constant of these crops");
        assert_eq!(family.scores[3].name, "learned table, best scale");
        // The best constant, and a scale chosen on the same crops, cannot be worse.
        assert!(loss(0) <= loss(1) * 1.000_001, "{family:?}");
        assert!(loss(3) <= loss(2) * 1.000_001, "{family:?}");
    }
    let text = study::text(*beta, held_out);
    assert!(
        text.contains("rings") && text.contains("mean") && !text.contains("NaN"),
        "{text}"
    );
}
