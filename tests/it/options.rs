//! Every option of a render, alone and in pairs: it is refused with a reason, changes pixels and metadata together, or
//! is declared to keep the pixels.

use crate::cli::TestFolder;
use crate::support::gltf::File;
use crate::support::root;
use opsr::image::exr::{self, Metadata};
use opsr::integrator::drive::RenderProgress;
use opsr::render::open::Opened;
use opsr::render::{Effect, Fault, Heading, Names, OPTIONS, Opt, Request, Spec, Subject, run};
use opsr::scene::Scene;
use opsr_lab::gallery::{self, glb};
use opsr_lab::report::bench::Suite;
use serde_json::json;
use std::collections::{BTreeMap, HashMap};
use std::ops::ControlFlow;
use std::rc::Rc;

/// Chosen options by name, as text.
type Choices = BTreeMap<&'static str, &'static str>;

/// An option, a value, and the values of options that it needs.
type Sample = (
    &'static str,
    &'static str,
    &'static [(&'static str, &'static str)],
);

/// For every option a value that is not its default, and options without which it is refused or has no effect.
#[rustfmt::skip]
const SAMPLES: &[Sample] = &[
    ("env", "sky", &[]),
    ("sun", "30,20,7", &[("env", "sky")]),
    ("env_intensity", "2", &[("env", "studio")]),
    ("env_rotation", "70", &[("env", "studio")]),
    ("distribution", "ggx", &[]),
    ("unsupported", "skip", &[]),
    ("glass", "solid", &[]),
    ("variant", "night", &[]),
    ("at", "12@48", &[]),
    ("size", "10x8", &[]),
    ("crop", "1,1,6,5", &[]),
    ("camera", "-0.4,1.1,2.2,0,0.9,0,0,1,0,45", &[]),
    ("lens", "0.2,1.5", &[]),
    ("spp", "9", &[]),
    ("time", "1h", &[]),
    ("target_error", "0.9", &[]),
    ("integrator", "bdpt", &[]),
    ("table", "beta-0.05", &[]),
    ("resolve", "none", &[("table", "0.3")]),
    ("max_vertices", "2", &[]),
    ("seed", "5", &[]),
    ("levels", "0,0.5,4", &[("table", "0.3")]),
    ("table_scale", "0.3", &[("table", "beta-0.05")]),
    ("lookup", "linear", &[("table", "beta-0.05")]),
    ("mode", "reuse", &[("table", "0.3")]),
    ("consistent", "0.2", &[("table", "0.3")]),
    ("filter", "4", &[("mode", "filter-glossy")]),
    ("unbiased", "true", &[("integrator", "guided"), ("table", "0.9")]),
    ("trials", "4", &[("integrator", "manifold")]),
    ("radius", "0.4", &[("integrator", "vcm")]),
    ("radius_alpha", "0.9", &[("integrator", "vcm")]),
    ("connections", "nee", &[("integrator", "vcm")]),
    ("mlt_pass", "2", &[("integrator", "mlt")]),
    ("strategy", "2,2", &[("integrator", "bdpt")]),
    ("sampler", "independent", &[]),
    ("aov", "albedo,alpha", &[]),
    ("denoise", "true", &[]),
    ("exposure", "1", &[]),
    ("view", "agx", &[]),
    ("exr", "piz,half", &[]),
];

/// Options that may be accepted without effect in this scene, and the reason.
const MAY_DO_NOTHING: &[(&str, &str)] = &[
    (
        "unsupported",
        "only scenes of pbrt and Mitsuba have such parts",
    ),
    ("denoise", "the library may not be there"),
];

/// Options that may have no effect alone: pixels this coarse are shown without a blur.
const MAY_DO_NOTHING_ALONE: &[&str] = &["resolve"];

/// Pairs of options whose first may have no effect beside the second.
const MAY_DO_NOTHING_BESIDE: &[(&str, &str)] = &[
    // A strategy fixes the length of its paths.
    ("max_vertices", "strategy"),
    // The picture is that of level 0.
    ("levels", "resolve"),
    ("table", "resolve"),
    // So few samples end while the guide still learns, and the picture has no others.
    ("table", "unbiased"),
    ("table_scale", "unbiased"),
    ("lookup", "unbiased"),
    ("consistent", "unbiased"),
    // The glass is metal there.
    ("glass", "variant"),
];

/// A box with caustics, an animated lamp, variants, two cameras, and a glass body without a thickness.
fn scene() -> Vec<u8> {
    let mut file = File::from_glb(&glb::to_glb(&gallery::caustic_box()).expect("a scene"));
    let second = file.json["nodes"].as_array().expect("nodes").len();
    let camera = file.json["nodes"]
        .as_array()
        .and_then(|n| n.iter().position(|n| n.get("camera").is_some()));
    let mut node = file.json["nodes"][camera.expect("a camera")].clone();
    node["name"] = json!("second");
    node["translation"] = json!([0.3, 0.9, 2.0]);
    node.as_object_mut().expect("a node").remove("matrix");
    file.push("nodes", node);
    // A tetrahedron of glass.
    let corners = [
        [-0.2, 1.2, 0.2],
        [0.2, 1.2, 0.2],
        [0.0, 1.2, -0.2],
        [0.0, 1.5, 0.0f32],
    ];
    let faces = [[0u16, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let position = file.floats("VEC3", &corners.concat());
    let indices = file.indices(&faces.concat());
    let glass = json!({
        "name": "pane",
        "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 0.4 },
        "extensions": { "KHR_materials_transmission": { "transmissionFactor": 1.0 } }
    });
    let glass = file.push("materials", glass);
    let red = json!({ "name": "red", "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.1, 0.1, 1.0], "metallicFactor": 1.0 } });
    let red = file.push("materials", red);
    let mapping = json!([{ "material": red, "variants": [0] }]);
    let mesh = json!({ "primitives": [{
        "attributes": { "POSITION": position }, "indices": indices, "material": glass,
        "extensions": { "KHR_materials_variants": { "mappings": mapping } },
    }] });
    let mesh = file.push("meshes", mesh);
    let body = file.push("nodes", json!({ "name": "body", "mesh": mesh }));
    let extensions = &mut file.json["extensionsUsed"];
    let mut used = extensions.as_array().cloned().unwrap_or_default();
    used.extend([
        json!("KHR_materials_variants"),
        json!("KHR_materials_transmission"),
    ]);
    used.sort_by_key(|e| e.to_string());
    used.dedup();
    *extensions = json!(used);
    file.json["extensions"]["KHR_materials_variants"] =
        json!({ "variants": [{ "name": "night" }] });
    let times = file.floats("SCALAR", &[0.0, 1.0]);
    file.json["accessors"][times]["min"] = json!([0.0]);
    file.json["accessors"][times]["max"] = json!([1.0]);
    let path = file.floats("VEC3", &[0.0, 0.0, 0.0, 0.5, -0.4, 0.0]);
    file.push(
        "animations",
        json!({
            "samplers": [{ "input": times, "output": path, "interpolation": "LINEAR" }],
            "channels": [{ "sampler": 0, "target": { "node": body, "path": "translation" } }],
        }),
    );
    let scenes = file.json["scenes"][0]["nodes"]
        .as_array_mut()
        .expect("roots");
    scenes.extend([json!(second), json!(body)]);
    file.glb()
}

/// Outcome of a render with chosen options: pixels and metadata, or the reason of a refusal.
type Outcome = Result<(Vec<u32>, Metadata), String>;

/// Renders of the scene, cached by their options.
struct Renders {
    place: TestFolder,
    scenes: HashMap<String, Result<Rc<Opened>, String>>,
    made: HashMap<Choices, Rc<Outcome>>,
}

impl Renders {
    fn new() -> Self {
        let place = TestFolder::new();
        place.write("scene.glb", scene());
        Self {
            place,
            scenes: HashMap::new(),
            made: HashMap::new(),
        }
    }

    fn opened(&mut self, spec: &Spec) -> Result<Rc<Opened>, String> {
        let key = spec.words(&[Heading::Scene, Heading::Light]);
        let path = self.place.path().join("scene.glb");
        let open = || {
            let opened = spec.open(&path, opsr_formats::FORMATS, Scene::new);
            opened.map(Rc::new).map_err(|fault| fault.to_string())
        };
        self.scenes.entry(key).or_insert_with(open).clone()
    }

    fn of(&mut self, choices: &Choices) -> Rc<Outcome> {
        if let Some(made) = self.made.get(choices) {
            return made.clone();
        }
        let outcome = Rc::new(self.render(choices));
        self.made.insert(choices.clone(), outcome.clone());
        outcome
    }

    fn render(&mut self, choices: &Choices) -> Outcome {
        let spec = spec(choices)?;
        // An invalid scene option refuses the whole render.
        let opened = self.opened(&spec)?;
        let subject = Subject {
            scene: &opened.scene,
            name: "scene.glb",
            sha256: &opened.sha256,
            in_studio: false,
        };
        let message = |fault: Fault| fault.to_string();
        let request = Request::new(&spec, subject, None).map_err(message)?;
        let callback = &mut |_: &RenderProgress, _: &_| ControlFlow::Continue(());
        let (request, output) = run(request, callback).map_err(message)?;
        let shown = request.spec.shown(&output.picture);
        let bits = shown
            .pixels
            .iter()
            .flat_map(|p| p.to_array().map(f32::to_bits));
        let metadata = request.metadata(output.progress.samples, 0);
        Ok((bits.collect(), metadata))
    }
}

fn spec(choices: &Choices) -> Result<Spec, String> {
    let mut spec = Spec::default();
    for (name, text) in [("size", "8x6"), ("spp", "16")] {
        spec.set(name, &text.into())
            .map_err(|fault| fault.to_string())?;
    }
    for (name, text) in choices {
        spec.set(name, &(*text).into())
            .map_err(|fault| fault.to_string())?;
    }
    Ok(spec)
}

/// The sample value of an option, and the options that it needs.
fn sample(name: &'static str) -> (&'static str, Choices) {
    let (_, value, beside) = SAMPLES.iter().find(|(n, ..)| *n == name).expect("a sample");
    (value, beside.iter().copied().collect())
}

/// Compares renders with and without an option; returns the fault, or `None`.
fn judged(option: &Opt, with: &Outcome, without: &Outcome, may: bool) -> Option<String> {
    let (pixels, metadata) = match with {
        Err(reason) if reason.len() < 10 => {
            return Some(format!("refused without a reason: {reason}"));
        }
        Err(_) => return None,
        Ok(made) => made,
    };
    let Ok((before, earlier)) = without else {
        // The option makes a refused render valid; the other option of the pair is judged instead.
        return None;
    };
    let moved = pixels != before;
    let recorded = metadata != earlier;
    match option.effect {
        Effect::Pixels | Effect::As(_) if !moved && !may => {
            Some("is taken and changes nothing".into())
        }
        Effect::Pixels | Effect::As(_) if !recorded => {
            Some("changes pixels, and no metadata".into())
        }
        Effect::Files if moved => Some("is said to leave pixels alone".into()),
        Effect::Frame if !moved => Some("changes no frame".into()),
        _ => None,
    }
}

fn may_do_nothing(name: &str, beside: &Choices) -> bool {
    let alone = MAY_DO_NOTHING.iter().any(|(n, _)| *n == name);
    let pair = |(n, other): &(&str, &str)| *n == name && beside.contains_key(other);
    alone || MAY_DO_NOTHING_BESIDE.iter().any(pair)
}

#[test]
fn options_have_samples() {
    let sampled: Vec<&str> = SAMPLES.iter().map(|(name, ..)| *name).collect();
    let mut declared: Vec<&str> = OPTIONS.iter().map(|option| option.name).collect();
    assert_eq!(declared.len(), sampled.len());
    declared.retain(|name| !sampled.contains(name));
    assert!(declared.is_empty(), "no sample of {declared:?}");
}

/// Alone, and beside the options that it needs; then it must be accepted.
#[test]
fn options_alone_change_pixels_and_metadata_together() {
    let mut renders = Renders::new();
    let mut wrong = Vec::new();
    for option in OPTIONS {
        let (value, beside) = sample(option.name);
        let plain = renders.of(&Choices::new());
        let alone = renders.of(&Choices::from([(option.name, value)]));
        let may = may_do_nothing(option.name, &beside);
        let may_alone = may || MAY_DO_NOTHING_ALONE.contains(&option.name);
        let fault = judged(option, &alone, &plain, may_alone);
        wrong.extend(fault.map(|what| format!("{}: {what}", option.name)));
        let without = renders.of(&beside);
        let mut with = beside.clone();
        with.insert(option.name, value);
        let with = renders.of(&with);
        if let Err(reason) = &*with {
            wrong.push(format!("{} with all that it needs: {reason}", option.name));
        }
        let fault = judged(option, &with, &without, may);
        wrong.extend(fault.map(|what| format!("{} beside {beside:?}: {what}", option.name)));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn options_in_pairs_change_pixels_and_metadata_together() {
    let mut renders = Renders::new();
    let mut wrong = Vec::new();
    let mut taken = 0;
    for (i, a) in OPTIONS.iter().enumerate() {
        for b in &OPTIONS[i + 1..] {
            let ((value_a, mut beside), (value_b, others)) = (sample(a.name), sample(b.name));
            for (name, value) in others {
                beside.entry(name).or_insert(value);
            }
            let mut both = beside.clone();
            both.extend([(a.name, value_a), (b.name, value_b)]);
            let outcome = renders.of(&both);
            taken += usize::from(outcome.is_ok());
            for (option, value) in [(a, value_a), (b, value_b)] {
                let mut without = both.clone();
                without.remove(option.name);
                // An option that the other needs keeps the value that the other needs.
                if let Some(needed) = beside.get(option.name).filter(|needed| **needed != value) {
                    without.insert(option.name, needed);
                }
                let before = renders.of(&without);
                let may = may_do_nothing(option.name, &both);
                let fault = judged(option, &outcome, &before, may);
                wrong.extend(fault.map(|what| format!("{} in {both:?}: {what}", option.name)));
            }
        }
    }
    assert!(taken > 400, "only {taken} pairs are taken");
    assert!(wrong.is_empty(), "{} faults: {wrong:#?}", wrong.len());
}

/// The command line accepts the options of the library and gives the same messages.
#[test]
fn options_of_the_command_line_are_those_of_the_library() {
    let mut renders = Renders::new();
    let mut wrong = Vec::new();
    for option in OPTIONS
        .iter()
        .filter(|o| o.effect != Effect::Samples && o.name != "denoise")
    {
        let (value, mut choices) = sample(option.name);
        choices.insert(option.name, value);
        let words: Vec<String> = choices
            .iter()
            .map(|(name, value)| word(name, value))
            .collect();
        let size = if choices.contains_key("size") {
            ""
        } else {
            "--size 8x6"
        };
        let args = format!(
            "render scene.glb {size} --spp 16 --reproducible -o out.exr -o out.png {}",
            words.join(" ")
        );
        let ended = renders.place.opsr(&args);
        let ours = renders.of(&choices);
        let Ok((_, metadata)) = &*ours else {
            wrong.push(format!("{args}: {ours:?}"));
            continue;
        };
        if ended.code != Some(0) {
            wrong.push(format!("{args}: {}", ended.err));
            continue;
        }
        let mut file = exr::read_layers(&renders.place.path().join("out.exr")).expect("a picture");
        // Results, not options.
        file.metadata.remove("mean_error");
        file.metadata.remove("mean_relative_error");
        if file.metadata != *metadata {
            wrong.push(format!("{args}: {:?} is not {metadata:?}", file.metadata));
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
    // Errors name options by their flags.
    let ended = renders.place.opsr("render scene.glb --set table_scale=2");
    assert_eq!(ended.code, Some(2), "{}", ended.err);
    assert!(
        ended.err.contains("--set table_scale: needs --opsr-table"),
        "{}",
        ended.err
    );
}

/// The help of `-h` is a few words per option and fits one screen.
#[test]
fn options_that_most_renders_use_have_short_help() {
    let long = |option: &&Opt| option.short_help().split_whitespace().count() > 10;
    let common = || OPTIONS.iter().filter(|option| option.common);
    let long: Vec<String> = common().filter(long).map(Opt::short_help).collect();
    assert!(long.is_empty(), "{long:#?}");
    let place = TestFolder::new();
    let [short, whole] =
        ["-h", "--help"].map(|help| place.opsr(&format!("render {help}")).done().out);
    for option in common() {
        let flag = format!("--{}", option.flag());
        assert!(short.contains(&flag) && whole.contains(&flag), "{flag}");
    }
    assert!(short.lines().count() <= 64, "{short}");
    assert!(whole.len() > 3 * short.len());
}

/// An option and its value on the command line.
fn word(name: &str, value: &str) -> String {
    Opt::named(name).expect("an option").words(value)
}

/// A method of a suite is the same spec, read from TOML.
#[test]
fn options_of_a_suite_are_those_of_the_library() {
    for option in OPTIONS {
        let (value, mut choices) = sample(option.name);
        choices.insert(option.name, value);
        let lines: Vec<String> = choices
            .iter()
            .map(|(name, value)| line(name, value))
            .collect();
        let text = format!(
            "times = [1]\n[[scene]]\nname = 's'\nbuiltin = 'plane'\nsize = [8, 8]\nreference_spp = 1\n\
             [[method]]\nname = 'm'\n{}\n",
            lines.join("\n")
        );
        let suite = Suite::parse(&text);
        let of_method = matches!(option.heading, Heading::Method | Heading::Research);
        let known = of_method || option.name == "denoise";
        if !known || ["max_vertices", "seed"].contains(&option.name) {
            let why = suite.expect_err(option.name);
            assert!(
                why.contains("is no part of a method"),
                "{}: {why}",
                option.name
            );
            continue;
        }
        let suite = suite.unwrap_or_else(|why| panic!("{text}: {why}"));
        let mut spec = Spec::default();
        for (name, value) in &choices {
            spec.set(name, &(*value).into()).expect("a value");
        }
        assert_eq!(suite.methods[0].spec, spec, "{text}");
    }
}

/// A line of TOML: numbers and booleans have no quotes.
fn line(name: &str, value: &str) -> String {
    let bare = value.parse::<f64>().is_ok() || value == "true";
    match bare {
        true => format!("{name} = {value}"),
        false => format!("{name} = '{value}'"),
    }
}

/// Python's stub lists the keywords of the library.
#[test]
fn options_of_the_python_stub_are_those_of_the_library() {
    let stub = root().join("python/opsr/__init__.pyi");
    let stub = std::fs::read_to_string(stub).expect("the stub");
    let typed = |option: &&Opt| format!("    {}: {} | None\n", option.name, (option.python)());
    let of_render = |option: &&Opt| {
        let heading = option.heading;
        let files = matches!(heading, Heading::Scene | Heading::Light | Heading::Files);
        !files || ["aov", "denoise"].contains(&option.name)
    };
    let of_save = |option: &&Opt| {
        option.heading == Heading::Files && !["aov", "denoise"].contains(&option.name)
    };
    let of_scene = |option: &&Opt| {
        matches!(option.heading, Heading::Scene | Heading::Light) && option.name != "env"
    };
    for (class, wanted) in [
        (
            "class _Options(TypedDict, total=False):\n    \"\"\"Options of `render`.\"\"\"\n\n",
            of_render as fn(&&Opt) -> bool,
        ),
        (
            "class _SceneOptions(TypedDict, total=False):\n    \"\"\"Options of `Scene.load` beside `env`.\"\"\"\n\n",
            of_scene,
        ),
        (
            "class _SaveOptions(TypedDict, total=False):\n    \"\"\"Options of `Film.save`.\"\"\"\n\n",
            of_save,
        ),
    ] {
        let fields: String = OPTIONS.iter().filter(wanted).map(|o| typed(&o)).collect();
        assert!(
            stub.contains(&format!("{class}{fields}")),
            "expected in the stub:\n{class}{fields}"
        );
    }
}

/// Messages name options by flag or by key, as requested.
#[test]
fn options_are_named_as_their_reader_names_them() {
    let mut spec = Spec::default();
    spec.set("consistent", &0.2.into()).expect("a value");
    let fault = spec.check().expect_err("no factors");
    assert_eq!(
        fault.message(Names::Flags),
        "--set consistent: needs --opsr-table"
    );
    assert_eq!(fault.message(Names::Keys), "consistent: needs table");
}

/// Blender's list of integrators is that of the library.
#[test]
fn options_of_blender_name_every_integrator() {
    let settings = root().join("python/blender/opsr_blender/settings.py");
    let settings = std::fs::read_to_string(settings).expect("the settings");
    let listed = settings
        .lines()
        .find(|line| line.starts_with("INTEGRATORS"));
    let listed: Vec<&str> = listed
        .expect("a list")
        .split('"')
        .skip(1)
        .step_by(2)
        .collect();
    let declared = (Opt::named("integrator").expect("an option").names)();
    assert_eq!(listed.len(), declared.len(), "{listed:?} {declared:?}");
    assert!(declared.iter().all(|name| listed.contains(&name.as_str())));
}
