//! How to train: defaults, presets, a file, and single settings from the command line.

use super::learn::model::{Model, Optimiser};
use crate::files;
use crate::regularise::{AttenuationTable, Lookup};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Larger files are not settings.
const MAX_BYTES: u64 = 1 << 20;

/// Most factors that the lobes of a recording are drawn with.
const MOST_DRAWS: usize = 16;

/// How loss and gradient are evaluated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Evaluation {
    /// Paths are traced anew at every step.
    Fresh,
    /// Paths are traced once; their events are evaluated at every step.
    Replay,
    /// Paths are traced once; their events are baked into curves.
    #[default]
    Tabulated,
}

/// Which loss.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Loss {
    /// MAPE of the realised picture of `spp` samples, noise included.
    #[default]
    Published,
    /// MAPE of the mean of all replicates, which are many: no dependence on the number of samples.
    NoiseFree,
}

/// Everything that a training depends on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// The list of scenes.
    pub manifest: PathBuf,
    /// Names of training scenes; empty for all.
    pub scenes: Vec<String>,
    /// Family of scenes to leave out of training and to score instead.
    pub hold_out: String,
    /// Weights of the variance; one table for each.
    pub beta: Vec<f32>,
    /// Samples per pixel that the table is learned for.
    pub spp: u32,
    /// Independent recordings of `spp` samples; their losses are averaged.
    pub replicates: u32,
    /// Optimiser steps.
    pub steps: u32,
    /// Step of Adam; 0 for the optimiser's own (5e-4 on γ, 0.05 on ln γ).
    pub learning_rate: f64,
    /// In what Adam walks.
    pub optimiser: Optimiser,
    /// What is learned.
    pub model: Model,
    /// How factors are looked up.
    pub lookup: Lookup,
    /// How loss and gradient are evaluated.
    pub method: Evaluation,
    /// Which loss.
    pub loss: Loss,
    /// Where all factors start; 0 for the best constant of the training crops.
    pub start: f32,
    /// The constant factors that the lobes of a recording are drawn with.
    pub record_gammas: Vec<f32>,
    /// Recorded events that carry less than this times their pixel's reference play Russian roulette; 0 keeps all.
    pub roulette: f32,
    /// Seed of the recording.
    pub seed: u64,
    /// Steps between two lines of the log and two looks at the validation scenes.
    pub validate_every: u32,
    /// Stop after this many looks without a better validation loss; 0 for never.
    pub patience: u32,
    /// Steps between two checkpoints.
    pub checkpoint_every: u32,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            manifest: "training_scenes/manifest.toml".into(),
            scenes: Vec::new(),
            hold_out: String::new(),
            beta: vec![0.001],
            spp: 1024,
            replicates: 1,
            steps: 10_000,
            learning_rate: 0.0,
            optimiser: Optimiser::Adam,
            model: Model::Full,
            lookup: Lookup::Nearest,
            method: Evaluation::Tabulated,
            loss: Loss::Published,
            start: 0.5,
            record_gammas: vec![0.002, 0.007, 0.025, 0.09, 0.3, 1.0],
            // See `thin`.
            roulette: 0.3,
            seed: 0,
            validate_every: 500,
            patience: 0,
            checkpoint_every: 500,
        }
    }
}

/// Why a configuration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file could not be read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// Not TOML, an unknown key, or a value of the wrong type.
    #[error("{place}: {problem}")]
    Syntax {
        /// The file, or the setting.
        place: String,
        /// What is wrong.
        problem: String,
    },
    /// A value that makes no sense.
    #[error("{key}: {problem}")]
    Value {
        /// The key.
        key: &'static str,
        /// Why.
        problem: String,
    },
}

impl Config {
    /// A table of one factor with the look-up in use.
    pub fn constant(&self, gamma: f32) -> AttenuationTable {
        AttenuationTable {
            lookup: self.lookup,
            ..AttenuationTable::constant(gamma)
        }
    }

    /// The learning rate in use.
    pub fn rate(&self) -> f64 {
        match self.optimiser {
            _ if self.learning_rate > 0.0 => self.learning_rate,
            // The additive model walks in ln γ whatever the optimiser is called.
            Optimiser::Adam if self.model == Model::Full => 5e-4,
            _ => 0.05,
        }
    }

    /// This configuration with the values of a TOML file in place of its own.
    pub fn with_file(&self, path: &Path) -> Result<Self, ConfigError> {
        let text = files::read_text(path, MAX_BYTES).map_err(|source| ConfigError::Io {
            path: path.into(),
            source,
        })?;
        self.with_text(&text, &path.display().to_string())
    }

    /// This configuration with the values of a TOML text in place of its own; `place` is for messages.
    pub fn with_text(&self, text: &str, place: &str) -> Result<Self, ConfigError> {
        let syntax = |problem| ConfigError::Syntax {
            place: place.into(),
            problem,
        };
        let new: toml::Table = files::toml(text).map_err(syntax)?;
        let mut all = toml::Table::try_from(self).map_err(|e| ConfigError::Value {
            key: "configuration",
            problem: e.to_string(),
        })?;
        all.extend(new);
        all.try_into().map_err(|e| syntax(files::briefly(e)))
    }

    /// This configuration with one setting `key=value` changed; a value that is not TOML is taken as a string.
    pub fn with_setting(&self, setting: &str) -> Result<Self, ConfigError> {
        let place = format!("--set {setting}");
        if let Some((key, value)) = setting.split_once('=')
            && toml::from_str::<toml::Table>(setting).is_err()
        {
            return self.with_text(&format!("{key} = {value:?}"), &place);
        }
        self.with_text(setting, &place)
    }

    /// Whether all values make sense.
    pub fn check(&self) -> Result<(), ConfigError> {
        let bad = |key, problem: &str| {
            Err(ConfigError::Value {
                key,
                problem: problem.into(),
            })
        };
        if self.beta.is_empty() || self.beta.iter().any(|b| !(0.0..=1e6).contains(b)) {
            return bad("beta", "expected numbers from 0 to 1e6, at least one");
        }
        if !(2..=1 << 20).contains(&self.spp) {
            return bad("spp", "expected 2 to 1048576 samples");
        }
        if !(1..=64).contains(&self.replicates) {
            return bad("replicates", "expected 1 to 64");
        }
        if self.steps == 0 {
            return bad("steps", "expected at least 1");
        }
        if !(0.0..1e3).contains(&self.learning_rate) {
            return bad("learning_rate", "expected a number from 0 to 1000");
        }
        let usable = |gamma: &f32| *gamma > 0.0 && *gamma <= 1.0;
        if !(1..=MOST_DRAWS).contains(&self.record_gammas.len())
            || !self.record_gammas.iter().all(usable)
        {
            return bad("record_gammas", "expected 1 to 16 numbers in (0, 1]");
        }
        if !(0.0..=10.0).contains(&self.roulette) {
            return bad("roulette", "expected a number from 0 to 10");
        }
        if !(0.0..=1.0).contains(&self.start) {
            return bad("start", "expected a number from 0 to 1");
        }
        if self.validate_every == 0 || self.checkpoint_every == 0 {
            return bad("validate_every, checkpoint_every", "expected at least 1");
        }
        Ok(())
    }

    /// The resolved configuration as TOML.
    pub fn to_toml(&self) -> Result<String, ConfigError> {
        toml::to_string_pretty(self).map_err(|e| ConfigError::Value {
            key: "configuration",
            problem: e.to_string(),
        })
    }
}
