//! Settings of a training from the command line, for `opsr train` and `opsr record`.

use super::super::exit::Blame;
use clap::Args;
use opsr_train::Config;
use opsr_train::config::Preset;
use std::path::PathBuf;

/// Options that make the settings.
#[derive(Args, Debug)]
pub(super) struct SettingArgs {
    /// Weight of the variance against the error; several with commas make several tables from one recording.
    #[arg(long, value_name = "B", value_delimiter = ',')]
    beta: Vec<f32>,
    /// Settings to start from.
    #[arg(long, value_enum, default_value_t)]
    pub(super) preset: Preset,
    /// A TOML file of settings, such as the config.toml of an earlier run.
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// One setting, such as spp=256; may be given several times and overrides all others.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    settings: Vec<String>,

    /// Evaluation of the loss: tabulated (fast) or replay (exact for the recording).
    #[arg(long, value_name = "NAME")]
    method: Option<String>,
    /// adam (published) or log (Adam on the logarithm of the factors: hundreds of steps instead of thousands).
    #[arg(long, value_name = "NAME")]
    optimiser: Option<String>,
    /// Gone; a message says what does its work.
    #[arg(long, value_name = "NAME", hide = true)]
    model: Option<String>,
    /// Look-up of factors: nearest or linear.
    #[arg(long, value_name = "NAME")]
    lookup: Option<String>,
    /// Optimiser steps.
    #[arg(long, value_name = "N")]
    steps: Option<u32>,
    /// Samples per pixel for which the tables are learned.
    #[arg(long, value_name = "N")]
    spp: Option<u32>,
    /// Seed of the recording; the same seed gives bit-identical tables.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Leave this family of scenes out of the training and score the tables on it.
    #[arg(long, value_name = "FAMILY")]
    hold_out: Option<String>,
}

impl SettingArgs {
    /// Resolves the settings; later ones override earlier ones: preset, file, options, --set.
    pub(super) fn resolve(&self) -> anyhow::Result<Config> {
        let mut config = Config::from(self.preset);
        if let Some(path) = &self.config {
            config = config.with_file(path).input()?;
        }
        if !self.beta.is_empty() {
            config.beta.clone_from(&self.beta);
        }
        let named = [
            ("method", &self.method),
            ("optimiser", &self.optimiser),
            ("model", &self.model),
            ("lookup", &self.lookup),
            ("hold_out", &self.hold_out),
        ];
        for (key, value) in named {
            if let Some(value) = value {
                config = config.with_setting(&format!("{key}={value:?}")).usage()?;
            }
        }
        config.steps = self.steps.unwrap_or(config.steps);
        config.spp = self.spp.unwrap_or(config.spp);
        config.seed = self.seed.unwrap_or(config.seed);
        for setting in &self.settings {
            config = config.with_setting(setting).usage()?;
        }
        // With a file the fault may be in the input, without a file only in the command line.
        let checked = config.check();
        match self.config {
            Some(_) => checked.input()?,
            None => checked.usage()?,
        }
        Ok(config)
    }
}
