//! `--integrator auto`: its choice, and that a resumed render keeps it.

use super::TestFolder;
use opsr::image::exr;
use opsr_lab::gallery;

fn place(scene: &str) -> TestFolder {
    let place = TestFolder::new();
    let mut parts = gallery::builtin(scene).expect("a scene");
    // Environment maps cannot be written to the file.
    parts.environment = None;
    place.save("scene.glb", &parts);
    place
}

/// The integrator in a picture's metadata.
fn integrator(place: &TestFolder, file: &str) -> String {
    let layers = exr::read_layers(&place.path().join(file)).expect("a picture");
    layers.metadata["integrator"].clone()
}

#[test]
fn auto_chooses_an_integrator_that_finds_the_light() {
    // All sunlight under water is seen through two Dirac lobes: path finds a quarter of the light, bdpt half.
    for (scene, expected) in [
        ("sun-pool", ["vcm", "sppm"]),
        ("cornell-box", ["path", "path"]),
    ] {
        let place = place(scene);
        let ended = place.render("--verbose --spp 64 -o auto.exr").done();
        let chosen = integrator(&place, "auto.exr");
        assert!(expected.contains(&chosen.as_str()), "{}", ended.err);
        let says = format!("integrator {chosen}: ");
        let message = ended.err.lines().any(|line| line.contains(&says));
        assert!(message, "{}", ended.err);
        // The pilot does not affect the picture, and reproducible renders always choose the same.
        place
            .render(&format!("--integrator {chosen} --spp 64 -o named.exr"))
            .done();
        place
            .render("--integrator auto --spp 64 --threads 1 -o again.exr")
            .done();
        assert!(place.read("auto.exr") == place.read("named.exr"), "{scene}");
        assert!(place.read("auto.exr") == place.read("again.exr"), "{scene}");
    }
}

/// One sample of light paths for a million pixels takes seconds, and would not be finished.
#[test]
fn auto_takes_paths_where_no_other_sample_fits_into_the_time() {
    let place = place("sun-pool");
    let ended = place.opsr("render scene.glb --size 1200x900 --time 0.4s -o short.exr");
    assert!([Some(0), Some(5)].contains(&ended.code), "{}", ended.err);
    assert_eq!(integrator(&place, "short.exr"), "path");
    let why = "takes longer than there is time";
    assert!(ended.err.contains(why), "{}", ended.err);
    let ended = place
        .opsr("render scene.glb --size 32x24 --time 1s -o long.exr")
        .done();
    assert_eq!(integrator(&place, "long.exr"), "vcm", "{}", ended.err);
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
    // A checkpoint of other settings is refused, as without `auto`.
    let ended = place
        .render("--integrator auto --spp 12 --seed 5 --checkpoint a.ckpt --resume -o long.exr");
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    assert!(ended.err.contains("other settings"), "{}", ended.err);
}

#[test]
fn auto_refuses_what_it_cannot_choose_for() {
    let place = TestFolder::new();
    for args in ["--set mode=pbrt", "--set mlt_pass=4", "--set trials=4"] {
        let ended = place.render(&format!("--integrator auto {args}"));
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        assert!(ended.err.contains("auto"), "{}", ended.err);
    }
    let ended = place.opsr("trace scene.glb 1,1 --integrator auto");
    assert!(
        ended.code == Some(2) && ended.err.contains("--integrator path"),
        "{}",
        ended.err
    );
}

/// All integrators support lenses and dispersive glass.
#[test]
fn lens_and_dispersion_take_no_candidate_away() {
    let mut parts = gallery::caustic_box();
    parts.materials.iter_mut().for_each(|m| m.dispersion = 0.5);
    let place = TestFolder::new();
    place.save("scene.glb", &parts);
    let lens = "--lens 0.1,3";
    place
        .opsr(&format!(
            "render scene.glb --size 16x16 --spp 2 {lens} -o a.exr"
        ))
        .done();
    assert_eq!(integrator(&place, "a.exr"), "vcm");
}

/// Without an integrator a pilot chooses, unless another option implies a method.
#[test]
fn default_integrator_is_a_choice_unless_the_method_is_named() {
    let place = place("caustic-box");
    for (args, expected) in [
        ("", "vcm"),
        ("--integrator auto", "vcm"),
        ("--resolve raw --max-vertices 8 --seed 4", "vcm"),
        ("--opsr-table beta-0.001", "path"),
        ("--opsr-table 0.3", "path"),
        ("--set mode=pbrt", "path"),
        ("--set sampler=sobol", "path"),
        // These layers exist only with the path tracer.
        ("--resolve raw --aov direct", "path"),
    ] {
        place.render(&format!("--spp 4 {args} -o a.exr")).done();
        let metadata = exr::read_layers(&place.path().join("a.exr"))
            .expect("a picture")
            .metadata;
        assert_eq!(metadata["integrator"], expected, "{args}");
    }
    let ended = place.render("--set radius=0.1 -o b.exr");
    assert_eq!(ended.code, Some(2));
    assert!(
        ended
            .err
            .contains("--set radius: needs --integrator vcm or sppm"),
        "{}",
        ended.err
    );
}

/// Crops and parts choose as the whole picture does, and are bit-identical to it.
#[test]
fn crops_and_parts_of_a_choice_are_those_of_the_whole_picture() {
    let place = place("caustic-box");
    // The whole picture has enough samples for a race of contenders, a crop has not.
    let render = "render scene.glb --size 48x48 --spp 600 --reproducible --progress none";
    place
        .opsr(&format!("{render} --verbose --resolve raw -o whole.exr"))
        .done();
    let whole = exr::read_rgb(&place.path().join("whole.exr")).expect("a picture");
    let message = place
        .opsr(&format!(
            "{render} --verbose --resolve raw --crop 8,8,4,4 -o crop.exr"
        ))
        .done()
        .err;
    assert!(message.contains("pilot: "), "{message}");
    let crop = exr::read_rgb(&place.path().join("crop.exr")).expect("a picture");
    for (i, pixel) in crop.pixels.iter().enumerate() {
        assert_eq!(*pixel, whole.pixels[(8 + i / 4) * 48 + 8 + i % 4]);
    }
    let part = "part scene.glb --size 48x48 --spp 600 --progress none";
    for (i, samples) in ["0..200", "200..600"].iter().enumerate() {
        let part = format!("{part} --resolve raw --samples {samples} -o {i}.part");
        place.opsr(&part).done();
    }
    place.opsr("merge 0.part 1.part -o merged.exr").done();
    assert!(place.read("merged.exr") == place.read("whole.exr"));
}

#[test]
fn mlt_refuses_what_it_cannot_take() {
    let place = TestFolder::new();
    for (args, word) in [
        ("--integrator mlt --set mode=pbrt", "mlt"),
        ("--integrator mlt --set radius=0.1", "radius"),
        ("--integrator bdpt --set mlt_pass=4", "mlt_pass"),
        ("--integrator mlt --set mlt_pass=0", "from 1 to 65536"),
    ] {
        let ended = place.render(args);
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        assert!(ended.err.contains(word), "{args}: {}", ended.err);
    }
    place
        .render("--integrator mlt --set mlt_pass=2 --spp 2 --crop 4,4,8,8 --aov -o a.exr")
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

/// A pilot may take longer than the render, but leaves time for one pass.
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
