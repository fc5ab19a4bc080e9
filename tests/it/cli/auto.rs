//! `--integrator auto`: what it chooses, and that a resumed render goes on with it.

use super::Place;
use opsr::image::exr;
use opsr_lab::gallery;

fn place(scene: &str) -> Place {
    let place = Place::new();
    let mut parts = gallery::builtin(scene).expect("a scene");
    // Maps are no part of a file.
    parts.environment = None;
    place.save("scene.glb", &parts);
    place
}

/// The integrator that a picture's metadata name.
fn integrator(place: &Place, file: &str) -> String {
    let layers = exr::read_layers(&place.path().join(file)).expect("a picture");
    layers.metadata["integrator"].clone()
}

#[test]
fn auto_chooses_an_integrator_that_finds_the_light() {
    // All sunlight under water is seen by way of two Dirac lobes: path finds a quarter of the light, bdpt half.
    for (scene, expected) in [
        ("sun-pool", ["vcm", "sppm"]),
        ("cornell-box", ["path", "path"]),
    ] {
        let place = place(scene);
        let ended = place.render("--integrator auto --spp 64 -o auto.exr");
        let ended = ended.done();
        let chosen = integrator(&place, "auto.exr");
        assert!(expected.contains(&chosen.as_str()), "{}", ended.err);
        let says = format!("integrator {chosen}: ");
        let said = ended.err.lines().any(|line| line.starts_with(&says));
        assert!(said, "{}", ended.err);
        let layers = exr::read_layers(&place.path().join("auto.exr")).expect("a picture");
        let by = layers.metadata.get("integrator_chosen_by");
        assert_eq!(by.map(String::as_str), Some("pilot"));
        // The pilot leaves no trace in the picture, and reproducible renders choose the same every time.
        place
            .render(&format!("--integrator {chosen} --spp 64 -o named.exr"))
            .done();
        place
            .render("--integrator auto --spp 64 --threads 1 -o again.exr")
            .done();
        let pixels = |file: &str| exr::read_rgb(&place.path().join(file)).expect("a picture");
        assert!(pixels("auto.exr") == pixels("named.exr"), "{scene}");
        assert!(place.read("auto.exr") == place.read("again.exr"), "{scene}");
    }
}

#[test]
fn auto_resume_goes_on_with_the_same_integrator() {
    let place = place("sun-pool");
    place
        .render("--integrator auto --spp 8 --checkpoint a.ckpt -o short.exr")
        .done();
    let chosen = integrator(&place, "short.exr");
    let ended = place
        .render("--integrator auto --spp 12 --checkpoint a.ckpt --resume -o long.exr")
        .done();
    assert!(!ended.err.contains("pilot"), "{}", ended.err);
    assert_eq!(integrator(&place, "long.exr"), chosen);
    place
        .render(&format!("--integrator {chosen} --spp 12 -o named.exr"))
        .done();
    let pixels = |file: &str| exr::read_rgb(&place.path().join(file)).expect("a picture");
    assert!(pixels("long.exr") == pixels("named.exr"));
    // A checkpoint of other settings is refused as always.
    let ended = place
        .render("--integrator auto --spp 12 --seed 5 --checkpoint a.ckpt --resume -o long.exr");
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    assert!(ended.err.contains("other settings"), "{}", ended.err);
}

#[test]
fn auto_refuses_what_it_cannot_choose_for() {
    let place = Place::new();
    for args in [
        "--mode pbrt",
        "--mlt-pass 4",
        "--trace-pixel 1,1",
        "--film part.film",
    ] {
        let ended = place.render(&format!("--integrator auto {args}"));
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        assert!(ended.err.contains("auto"), "{}", ended.err);
    }
    // Only the path tracer has levels and a lens.
    let ended = place
        .render("--integrator auto --aperture 0.1 --focus 3 --spp 2 -o a.exr")
        .done();
    assert!(ended.err.starts_with("integrator path: "), "{}", ended.err);
}

#[test]
fn mlt_refuses_what_it_cannot_take() {
    let place = Place::new();
    for (args, word) in [
        ("--integrator mlt --mode pbrt", "mlt"),
        ("--integrator mlt --radius 0.1", "radius"),
        ("--integrator bdpt --mlt-pass 4", "mlt-pass"),
        ("--integrator mlt --mlt-pass 0", "from 1 to 65536"),
    ] {
        let ended = place.render(args);
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        assert!(ended.err.contains(word), "{args}: {}", ended.err);
    }
    place
        .render("--integrator mlt --mlt-pass 2 --spp 2 --crop 4,4,8,8 --aov -o a.exr")
        .done();
    assert_eq!(integrator(&place, "a.exr"), "mlt");
}

#[test]
fn info_names_the_integrator_that_a_scene_calls_for() {
    for (scene, expected) in [
        ("sun-pool", "vcm"),
        ("caustic-box", "vcm"),
        ("cornell-box", "path"),
        ("glossy_corridor", "path"),
    ] {
        let place = place(scene);
        let text = place.opsr("info scene.glb").done().out;
        let line = text.lines().find(|line| line.starts_with("integrator "));
        let line = line.unwrap_or_else(|| panic!("{text}"));
        assert!(line.contains(&format!(" {expected}: ")), "{scene}: {line}");
        let json = place.opsr("info scene.glb --json").done().out;
        let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
        assert_eq!(json["integrator"]["name"], expected);
    }
}

/// A pilot that takes longer than the render may leaves time for one pass.
#[test]
fn auto_makes_a_picture_when_the_pilot_takes_all_the_time() {
    let place = place("caustic-box");
    let ended = place
        .render("--integrator auto --time 1ms -o auto.exr")
        .done();
    assert!(!ended.err.contains(" 0 spp"), "{}", ended.err);
    let picture = exr::read_rgb(&place.path().join("auto.exr")).expect("a picture");
    assert!(picture.pixels.iter().any(|p| p.max_element() > 0.0));
}
