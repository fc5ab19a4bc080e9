//! Records of a render: metadata, checkpoints, parts, and the command that repeats it.

use super::fault::Fault;
use super::request::{DEFAULT_SPP, Request};
use super::spec::{Effect, Heading, Opt, Spec};
use super::value::{Field, Levels, TableChoice, word};
use crate::image::exr::Metadata;
use crate::integrator::checkpoint::Checkpoint;
use crate::integrator::drive::RenderProgress;
use crate::integrator::layers::Aov;
use crate::integrator::method::IntegratorKind;
use crate::integrator::part::Part;
use crate::integrator::{Amounts, Estimator, Picture};
use std::ops::{ControlFlow, Range};
use std::path::Path;

impl Request<'_> {
    /// Recorded options by name: integrator, mode, and every given option that changes pixels.
    pub fn choices(&self) -> Vec<(&'static str, String)> {
        let mut choices = vec![
            ("integrator", word(&self.kind)),
            ("mode", word(&self.own().mode.unwrap_or_default())),
            ("max_vertices", self.settings.max_vertices.to_string()),
        ];
        if self.kind.row().takes_sobol && !self.settings.sampler.is_independent() {
            choices.push(("sampler", word(&self.settings.sampler)));
        }
        choices.extend(self.amounts());
        match &self.own().table {
            // A table passed by a program has no name.
            None | Some(TableChoice::Loaded(_, None)) => {}
            Some(table) => choices.push(("table", table.text())),
        }
        for (name, text) in self.own().recorded(self.kind) {
            if choices.iter().all(|(known, _)| *known != name) {
                choices.push((name, text));
            }
        }
        choices
    }

    /// The options that determine the films of the render and their resolve.
    fn amounts(&self) -> Vec<(&'static str, String)> {
        let resolve = ("resolve", self.spec.resolve().text());
        let path = matches!(self.settings.estimator, Estimator::Path { .. });
        let levels = match &self.settings.amounts {
            Amounts::Raw => return vec![("resolve", "raw".into())],
            // The default of all other methods.
            Amounts::Blurred if !(path && self.own().has_factors()) => return vec![resolve],
            Amounts::Blurred => Levels::None,
            Amounts::Roughening(scales) => Levels::At(scales.as_slice().to_vec()),
            Amounts::Radii(factors) => Levels::At(factors.as_slice().to_vec()),
        };
        vec![("levels", levels.text()), resolve]
    }

    /// Metadata for the file of the picture, equal for equal renders.
    pub fn metadata(&self, samples: u32, refused: u64) -> Metadata {
        let subject = self.subject;
        let table = self.method.table_sha256.as_deref();
        let mut metadata = self.settings.metadata(subject.name, subject.sha256, table);
        if subject.name.is_empty() {
            metadata.retain(|key, _| !key.starts_with("scene"));
        }
        for (key, value) in self.choices() {
            metadata.entry(key.to_owned()).or_insert(value);
        }
        metadata.insert("spp".into(), samples.to_string());
        metadata.insert("refused_samples".into(), refused.to_string());
        metadata
    }

    /// A checkpoint of the render so far.
    pub fn checkpoint(
        &self,
        progress: &RenderProgress,
        spent: f64,
        picture: &Picture,
    ) -> Checkpoint {
        let refused = picture.film.rejected.total();
        Checkpoint {
            fingerprint: self.fingerprint(),
            samples: progress.samples,
            seconds: spent + progress.elapsed.as_secs_f64(),
            amounts: self.settings.amounts.clone(),
            metadata: self.metadata(progress.samples, refused),
            picture: picture.clone(),
        }
    }

    /// An error for options that a part does not support or store.
    pub fn check_part(spec: &Spec) -> Result<(), Fault> {
        let wants = |aov| spec.aovs().contains(&aov);
        if wants(Aov::Position) || wants(Aov::Id) || wants(Aov::Time) {
            let what = "a part keeps no position, id and time";
            return Err(Fault::option("aov", what));
        }
        if wants(Aov::EachLevel) {
            let what = "each-level is for the whole picture, where its parts are merged";
            return Err(Fault::option("aov", what));
        }
        if spec.kind() == IntegratorKind::Guided {
            let what = "a guide learns from all samples before: none for a part";
            return Err(Fault::option("integrator", what));
        }
        for name in ["time", "target_error"] {
            if spec.has(name) {
                return Err(Fault::option(name, "a part has a number of samples"));
            }
        }
        match spec.given_but_raw().find(|(option, _)| option.of_film) {
            Some((option, _)) => {
                let why = "is for the whole picture, where its parts are merged";
                Err(Fault::option(option.name, why))
            }
            None => Ok(()),
        }
    }

    /// Renders these samples, by default all, into the file of a part, whole or not at all. `begun` is a part of the
    /// same pixels whose samples come before. False if `on_pass` ended the render; then no file is written.
    ///
    /// Needs an integrator: [`Request::choose`] must be called first if a pilot chooses it.
    pub fn part(
        &self,
        path: &Path,
        samples: Option<Range<u32>>,
        begun: Option<&Path>,
        on_pass: &mut dyn FnMut(&RenderProgress) -> ControlFlow<()>,
    ) -> Result<bool, Fault> {
        Self::check_part(&self.spec)?;
        let view = self.view();
        let recorded = self.spec.recorded_aovs();
        let identity = self.identity(&self.settings, false);
        let amounts = self.settings.amounts.clone();
        let samples = samples.unwrap_or(0..self.spec.spp.unwrap_or(DEFAULT_SPP));
        let mut part = Part::new(identity, &view, samples, amounts, recorded);
        part.layers = self.spec.aovs().iter().map(|aov| aov.to_string()).collect();
        part.metadata = self.metadata(0, 0);
        let integrator = &mut *self.settings.integrator();
        Ok(part.render_on(begun, path, integrator, &view, on_pass)?)
    }

    /// The command that renders this picture, without files, part and samples.
    pub fn command(&self) -> String {
        let mut words = vec![
            "opsr".to_owned(),
            "render".to_owned(),
            quoted(self.subject.name),
        ];
        let kept = |heading, effect| {
            heading != Heading::Files && heading != Heading::Stop && effect != Effect::Frame
        };
        let spelt = ["integrator", "levels", "resolve"];
        for (option, text) in self.own().given() {
            if !kept(option.heading, option.effect) || spelt.contains(&option.name) {
                continue;
            }
            words.push(option.words(&quoted(&text)));
        }
        for (name, text) in self.amounts() {
            words.extend(Opt::named(name).map(|option| option.words(&text)));
        }
        words.push(format!("--integrator {}", word(&self.kind)));
        words.push(format!("--size {}x{}", self.frame.x, self.frame.y));
        words.join(" ")
    }
}

/// A word of a command line, quoted if necessary.
fn quoted(text: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_.,/%+=:".contains(c);
    match !text.is_empty() && text.chars().all(plain) {
        true => text.to_owned(),
        false => format!("'{}'", text.replace('\'', "'\\''")),
    }
}
