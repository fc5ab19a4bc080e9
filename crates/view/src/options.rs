//! Options that pages set: those of a render by their names, a look, an overlay, a comparison. Messages of pages are
//! checked here, before the render thread uses them.

use super::film::{self, Clock};
use super::scene_file::SceneFile;
use opsr::render::look::{CameraChoice, Look};
use opsr::render::value::{Field, TableChoice, word};
use opsr::render::{Fault, Names, Spec};
use opsr::scene::Scene;
use serde::Deserialize;
use serde_json::{Map, Value};
use std::sync::Arc;

/// Options that a page can change. Files are read only if they were named at the start.
pub(super) const CONTROLS: [&str; 18] = [
    "integrator",
    "table",
    "levels",
    "resolve",
    "max_vertices",
    "env",
    "env_intensity",
    "env_rotation",
    "sun",
    "exposure",
    "view",
    "denoise",
    "camera",
    "at",
    "variant",
    "lens",
    "seed",
    "target_error",
];

/// Options that apply to a finished film or its picture: a change of them starts no render.
const OF_SHOWING: [&str; 4] = ["exposure", "view", "resolve", "exr"];

/// Options that are left out if others exclude them.
const MAY_GO: [&str; 8] = [
    "table",
    "levels",
    "resolve",
    "lens",
    "sun",
    "env_intensity",
    "env_rotation",
    "target_error",
];

/// Picture shown in place of the rendered one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Overlay {
    /// The picture.
    #[default]
    Picture,
    /// Expected relative error.
    Error,
    /// Noise and bias, the parts of that error; bias for several levels only.
    Noise,
    Bias,
    /// Chosen level of roughening.
    Level,
    /// The first surfaces.
    Normal,
    Albedo,
    Depth,
    /// FLIP against the other picture.
    Flip,
    /// Light that the picture misses, as the witness has found.
    Missing,
}

impl Overlay {
    pub(super) const ALL: [Self; 10] = [
        Self::Picture,
        Self::Error,
        Self::Noise,
        Self::Bias,
        Self::Level,
        Self::Normal,
        Self::Albedo,
        Self::Depth,
        Self::Flip,
        Self::Missing,
    ];

    pub(super) fn name(self) -> String {
        word(&self)
    }
}

/// The other picture.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Other {
    /// The reference.
    Reference,
    /// The same scene with another integrator.
    Integrator(String),
    /// The same without table, constant and levels.
    Plain,
}

/// A message of a page; fields that it omits do not change.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Message {
    options: Map<String, Value>,
    look: Option<Look>,
    /// Back to the camera of the file.
    home: bool,
    overlay: Option<Overlay>,
    #[serde(deserialize_with = "there")]
    other: Option<Option<Other>>,
    paused: Option<bool>,
    /// Starts or stops the animations.
    playing: Option<bool>,
}

/// Reads `null` as `Some(None)`, unlike a field that is missing.
fn there<'de, D: serde::Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    T::deserialize(from).map(Some)
}

/// Options that all pages share.
#[derive(Clone, Debug)]
pub(super) struct Options {
    /// The scene.
    pub(super) file: Arc<SceneFile>,
    /// Options as pages have requested them.
    asked: Map<String, Value>,
    /// Values of `env` and `table` at the start, the only files that pages may name.
    known: [Option<Value>; 2],
    /// Table at the start, which may be in memory only.
    held: Option<TableChoice>,
    /// The requested options that fit together.
    pub(super) spec: Spec,
    /// Options that were left out, and why.
    pub(super) left_out: Vec<String>,
    /// The current camera, once the scene is open.
    pub(super) look: Option<Look>,
    /// True for a camera that is not the file's.
    pub(super) moved: bool,
    pub(super) overlay: Overlay,
    pub(super) other: Option<Other>,
    pub(super) paused: bool,
    /// Moment of the animations, while they run.
    pub(super) playing: Option<Clock>,
    /// True if there is a reference.
    pub(super) has_reference: bool,
}

impl Options {
    /// Options at the start of the viewer.
    pub(super) fn new(
        spec: &Spec,
        file: Arc<SceneFile>,
        has_reference: bool,
    ) -> Result<Self, Fault> {
        let mut spec = spec.clone();
        spec.check()?;
        spec.load_look()?;
        let look = match &spec.camera {
            Some(CameraChoice::Numbers(look)) => Some(**look),
            _ => None,
        };
        spec.camera.take_if(|_| look.is_some());
        let asked = spec.settings();
        let known = ["env", "table"].map(|name| asked.get(name).cloned());
        Ok(Self {
            file,
            asked,
            known,
            held: spec.table.clone(),
            spec,
            left_out: Vec::new(),
            moved: look.is_some(),
            look,
            overlay: Overlay::Picture,
            other: None,
            paused: false,
            playing: None,
            has_reference,
        })
    }

    /// The options after a message; an error leaves them as they were.
    pub(super) fn after(&self, message: Message) -> Result<Self, Fault> {
        let mut next = self.clone();
        if !message.options.is_empty() {
            for (name, value) in &message.options {
                next.set(name, value)?;
            }
            let changed: Vec<&str> = message.options.keys().map(String::as_str).collect();
            (next.spec, next.left_out) = self.fitted(&next.asked, &changed)?;
        }
        if let Some(look) = message.look {
            look.check().map_err(|what| Fault::option("camera", what))?;
            // The lens stays that of the moved camera, or of the options.
            next.look = Some(Look {
                aspect: None,
                aperture: self.look.and_then(|look| look.aperture),
                focus: self.look.and_then(|look| look.focus),
                ..look
            });
            next.moved = true;
        }
        if message.home || message.options.contains_key("camera") {
            (next.look, next.moved) = (None, false);
        }
        next.overlay = message.overlay.unwrap_or(next.overlay);
        if let Some(other) = message.other {
            if other == Some(Other::Reference) && !self.has_reference {
                return Err(Fault::usage("there is no reference: --reference names one"));
            }
            next.other = other;
            // Fails if the other picture cannot be rendered.
            next.other_spec()?;
        }
        next.paused = message.paused.unwrap_or(next.paused);
        match message.playing {
            Some(true) => next.playing = (next.playing).or(Some(Clock::at(next.seconds()))),
            Some(false) => next.playing = None,
            None => {}
        }
        Ok(next)
    }

    /// The options for another scene, without camera, moment and variant of the last one.
    pub(super) fn with_file(&self, file: Arc<SceneFile>) -> Result<Self, Fault> {
        let mut next = self.clone();
        for name in ["camera", "at", "variant"] {
            next.asked.remove(name);
        }
        (next.spec, next.left_out) = self.fitted(&next.asked, &[])?;
        (next.look, next.moved, next.playing) = (None, false, None);
        next.other.take_if(|other| *other == Other::Reference);
        next.file = file;
        Ok(next)
    }

    /// The camera of all moments; `None` for a camera of the file, which animations may move.
    pub(super) fn look_in(&self, scene: &Scene) -> Option<Look> {
        let own = scene.parts().cameras.is_empty();
        self.look.filter(|_| self.moved || own)
    }

    /// Seconds from the start of the animations.
    fn seconds(&self) -> f64 {
        self.spec.at.map_or(0.0, film::seconds)
    }

    /// Sets an option; `null` removes it.
    fn set(&mut self, name: &str, value: &Value) -> Result<(), Fault> {
        if !CONTROLS.contains(&name) {
            return Err(Fault::usage(format!("a page cannot change `{name}`")));
        }
        let place = ["env", "table"].iter().position(|n| *n == name);
        if let Some(place) = place
            && let Some(text) = value.as_str()
        {
            let built_in = ["studio", "sky", "none", "beta-0.001", "beta-0.05"].contains(&text);
            if !built_in && self.known[place].as_ref() != Some(value) {
                return Err(Fault::option(
                    ["env", "table"][place],
                    "a page reads no file that was not named when the viewer was started",
                ));
            }
        }
        if value.is_null() || *value == Value::Bool(false) {
            self.asked.remove(name);
            return Ok(());
        }
        // Parsed now, so that an error names its option.
        Spec::default().set(name, value)?;
        self.asked.insert(name.to_owned(), value.clone());
        Ok(())
    }

    /// Options of the other picture, if it is rendered.
    pub(super) fn other_spec(&self) -> Result<Option<Spec>, Fault> {
        let mut asked = self.asked.clone();
        let changed = match &self.other {
            None | Some(Other::Reference) => return Ok(None),
            Some(Other::Integrator(name)) => {
                asked.insert("integrator".into(), name.clone().into());
                "integrator"
            }
            Some(Other::Plain) => {
                for name in ["table", "levels", "mode", "consistent"] {
                    asked.remove(name);
                }
                asked.insert("integrator".into(), "path".into());
                "integrator"
            }
        };
        self.fitted(&asked, &[changed]).map(|(spec, _)| Some(spec))
    }

    /// A valid spec of the requested options, and a message for each conflicting option that was removed; options in
    /// `changed` are never removed.
    fn fitted(
        &self,
        asked: &Map<String, Value>,
        changed: &[&str],
    ) -> Result<(Spec, Vec<String>), Fault> {
        let mut spec = remade(asked, self.held.as_ref())?;
        let mut left_out = Vec::new();
        while let Err(fault) = spec.check() {
            let (without, why) = leave_out(&spec, fault, changed)?;
            spec = without;
            left_out.push(why);
        }
        Ok((spec, left_out))
    }

    /// Key that two sets of options share only if they open the same scene.
    pub(super) fn scene_key(&self) -> String {
        use opsr::render::Heading::{Light, Scene};
        let words = self.spec.words(&[Scene, Light]);
        format!("{} {words}", self.file.path.display())
    }

    /// Key that two sets of options share only if they are the same render.
    pub(super) fn render_key(&self) -> String {
        let mut asked = self.spec.settings();
        asked.retain(|name, _| !OF_SHOWING.contains(&name.as_str()));
        let raw = self.spec.is_raw();
        let film = self.playing.as_ref().map(|_| self.film_key());
        let (file, look, other) = (&self.file.path, self.look, &self.other);
        format!("{file:?} {asked:?} {raw} {look:?} {other:?} {film:?}")
    }

    /// Key that two sets of options share only if they have the same film.
    pub(super) fn film_key(&self) -> String {
        let mut asked = self.spec.settings();
        asked.retain(|name, _| !["exposure", "view", "at"].contains(&name.as_str()));
        let look = self.look.filter(|_| self.moved);
        format!("{:?} {asked:?} {look:?}", self.file.path)
    }

    /// Key of exposure and view.
    pub(super) fn display_key(&self) -> String {
        let settings = self.spec.settings();
        format!("{:?} {:?}", settings.get("exposure"), settings.get("view"))
    }
}

/// A spec of these settings; `held` replaces the table of its name, since a table in memory has no file.
fn remade(settings: &Map<String, Value>, held: Option<&TableChoice>) -> Result<Spec, Fault> {
    let mut spec = Spec::default();
    for (name, value) in settings {
        match held.filter(|held| name == "table" && *value == held.value()) {
            Some(held) => spec.table = Some(held.clone()),
            None => spec.set(name, value)?,
        }
    }
    Ok(spec)
}

/// The spec without the option at fault, and why; the fault if the option must stay.
pub(super) fn leave_out(
    spec: &Spec,
    fault: Fault,
    changed: &[&str],
) -> Result<(Spec, String), Fault> {
    let Fault::Option { name, .. } = &fault else {
        return Err(fault);
    };
    let mut settings = spec.settings();
    if !MAY_GO.contains(name) || changed.contains(name) || settings.remove(*name).is_none() {
        return Err(fault);
    }
    let mut without = remade(&settings, spec.table.as_ref())?;
    without.camera.clone_from(&spec.camera);
    Ok((without, format!("left out {}", fault.message(Names::Flags))))
}
