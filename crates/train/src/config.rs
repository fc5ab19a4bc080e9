//! Settings of a training: defaults, a TOML file, single settings from the command line.

use opsr::files::{self, FileError};
use opsr::regularise::{AttenuationTable, Lookup};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Maximum size of a settings file in bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Maximum number of factors with which the lobes of a recording are sampled.
const MAX_RECORD_GAMMAS: usize = 16;

/// Evaluation of the loss and its gradient (`docs/method.md` section 7).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Evaluation {
    /// Paths are traced once; their events are evaluated at every step.
    Replay,
    /// Paths are traced once; their events are baked into curves over the factor.
    #[default]
    Tabulated,
}

/// Parameter space in which Adam steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Optimiser {
    /// γ, as published.
    #[default]
    Adam,
    /// ln γ, which takes hundreds of steps instead of thousands.
    Log,
}

/// Settings to start from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// All scenes, 1024 samples, ten thousand steps of Adam, from the best constant.
    #[default]
    Full,
    /// The same from 0.5, as published.
    Published,
    /// The same with 150 steps on the logarithm from the best constant: minutes.
    Fast,
    /// One scene, 256 samples, 150 steps on the logarithm.
    Smoke,
}

/// All settings that a training depends on. The default is [`Preset::Published`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Manifest that lists the scenes.
    pub manifest: PathBuf,
    /// Names of the training scenes; empty for all.
    pub scenes: Vec<String>,
    /// Family of scenes that is left out of training and scored instead; empty for none.
    pub hold_out: String,
    /// Weights β of the variance, from 0 to 1e6; each makes one table.
    pub beta: Vec<f32>,
    /// Samples per pixel that the table is learned for, at least 2.
    pub spp: u32,
    /// Optimiser steps.
    pub steps: u32,
    /// Step size of Adam; 0 for the optimiser's default (5e-4 on γ, 0.05 on ln γ).
    pub learning_rate: f64,
    /// Parameter space in which Adam steps.
    pub optimiser: Optimiser,
    /// Look-up of factors, see `docs/method.md` section 8.
    pub lookup: Lookup,
    /// Evaluation of the loss and its gradient.
    pub method: Evaluation,
    /// Strength of the prior that the factor of a class is near that of its suffix; 0 for none.
    pub prior: f64,
    /// Initial value of all factors; 0 for the best constant of the training crops.
    pub start: f32,
    /// Constant factors with which the lobes of a recording are sampled, 1 to 16 numbers in (0, 1].
    pub record_gammas: Vec<f32>,
    /// Recorded events that carry less than this share of their pixel's reference undergo Russian roulette; 0 keeps all.
    pub roulette: f32,
    /// Seed of the recording.
    pub seed: u64,
    /// Steps between two lines of the log, each with a validation.
    pub validate_every: u32,
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
            steps: 10_000,
            learning_rate: 0.0,
            optimiser: Optimiser::Adam,
            lookup: Lookup::Nearest,
            method: Evaluation::Tabulated,
            prior: 0.0,
            start: 0.5,
            record_gammas: vec![0.002, 0.007, 0.025, 0.09, 0.3, 1.0],
            roulette: 0.3,
            seed: 0,
            validate_every: 500,
            checkpoint_every: 500,
        }
    }
}

/// Errors of settings.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// Invalid TOML, an unknown key, or a value of the wrong type.
    #[error("{place}: {problem}")]
    Syntax {
        /// The file, or the setting of the command line.
        place: String,
        /// Message of the parser.
        problem: String,
    },
    /// A value out of range.
    #[error("{key}: {problem}")]
    Value {
        /// The key.
        key: &'static str,
        /// The range.
        problem: String,
    },
}

impl Preset {
    /// Name, as `--preset` takes it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Published => "published",
            Self::Fast => "fast",
            Self::Smoke => "smoke",
        }
    }
}

impl From<Preset> for Config {
    fn from(preset: Preset) -> Self {
        // From 0.5 ten thousand steps on the training scenes end in a far worse minimum than from the best constant.
        let full = Self {
            start: 0.0,
            // Smallest loss on paths that were not learned from, in `docs/lab/training.md`.
            prior: 0.003,
            ..Self::default()
        };
        let fast = Self {
            steps: 150,
            optimiser: Optimiser::Log,
            validate_every: 25,
            checkpoint_every: 50,
            ..full.clone()
        };
        match preset {
            Preset::Published => Self::default(),
            Preset::Full => full,
            Preset::Fast => fast,
            Preset::Smoke => Self {
                scenes: vec!["cornell_caustics".into()],
                spp: 256,
                ..fast
            },
        }
    }
}

impl Config {
    /// A table whose factors are all `gamma`, with the configured look-up.
    pub fn constant(&self, gamma: f32) -> AttenuationTable {
        constant_table(gamma, self.lookup)
    }

    /// Step size of Adam; the optimiser's default where none is set.
    pub(crate) fn step_size(&self) -> f64 {
        match self.optimiser {
            _ if self.learning_rate > 0.0 => self.learning_rate,
            Optimiser::Adam => 5e-4,
            Optimiser::Log => 0.05,
        }
    }

    /// Returns these settings, overridden by the settings of a TOML file.
    pub fn with_file(&self, path: &Path) -> Result<Self, ConfigError> {
        let text = files::read_text(path, MAX_BYTES)?;
        self.with_text(&text, &path.display().to_string())
    }

    /// Returns these settings, overridden by the settings of a TOML text; messages name `place`.
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

    /// Returns these settings with one setting `key=value` changed; a value that is not TOML is taken as a string.
    pub fn with_setting(&self, setting: &str) -> Result<Self, ConfigError> {
        let place = format!("--set {setting}");
        if let Some((key, value)) = setting.split_once('=')
            && toml::from_str::<toml::Table>(setting).is_err()
        {
            return self.with_text(&format!("{key} = {value:?}"), &place);
        }
        self.with_text(setting, &place)
    }

    /// Checks the range of every value.
    pub fn check(&self) -> Result<(), ConfigError> {
        let usable = |gamma: &f32| *gamma > 0.0 && *gamma <= 1.0;
        let gammas = &self.record_gammas;
        let checks = [
            (
                "beta",
                !self.beta.is_empty() && self.beta.iter().all(|b| (0.0..=1e6).contains(b)),
                "expected numbers from 0 to 1e6, at least one",
            ),
            (
                "spp",
                (2..=1 << 20).contains(&self.spp),
                "expected 2 to 1048576 samples",
            ),
            ("steps", self.steps > 0, "expected at least 1"),
            (
                "learning_rate",
                (0.0..1e3).contains(&self.learning_rate),
                "expected a number from 0 to 1000",
            ),
            (
                "record_gammas",
                (1..=MAX_RECORD_GAMMAS).contains(&gammas.len()) && gammas.iter().all(usable),
                "expected 1 to 16 numbers in (0, 1]",
            ),
            (
                "roulette",
                (0.0..=10.0).contains(&self.roulette),
                "expected a number from 0 to 10",
            ),
            (
                "prior",
                (0.0..1e3).contains(&self.prior),
                "expected a number from 0 to 1000",
            ),
            (
                "start",
                (0.0..=1.0).contains(&self.start),
                "expected a number from 0 to 1",
            ),
            (
                "validate_every, checkpoint_every",
                self.validate_every > 0 && self.checkpoint_every > 0,
                "expected at least 1",
            ),
        ];
        match checks.into_iter().find(|(_, valid, _)| !valid) {
            None => Ok(()),
            Some((key, _, problem)) => Err(ConfigError::Value {
                key,
                problem: problem.into(),
            }),
        }
    }

    /// The settings as TOML.
    pub fn to_toml(&self) -> Result<String, ConfigError> {
        toml::to_string_pretty(self).map_err(|e| ConfigError::Value {
            key: "configuration",
            problem: e.to_string(),
        })
    }
}

/// A table whose factors are all `gamma`.
pub(crate) fn constant_table(gamma: f32, lookup: Lookup) -> AttenuationTable {
    AttenuationTable {
        lookup,
        ..AttenuationTable::constant(gamma)
    }
}
