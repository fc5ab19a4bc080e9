//! Estimator and rule as users choose them: options of `opsr render`, keys of a method in a suite.

use super::Estimator;
use super::bidirectional::Radius;
use super::levels::SCALES;
use super::metropolis::MUTATIONS;
use crate::files::{FileError, hex};
use crate::regularise::file::TableFile;
use crate::regularise::rules::MOLLIFIER_RADIUS;
use crate::regularise::{Accumulated, Factors, Lookup, Rule};
use crate::sampler::SamplerKind;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Table of the levels that [`IntegratorKind::Auto`] tries where none is given.
const DEFAULT_TABLE: &str = "beta-0.001";

/// A method and its constants.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
#[serde(deny_unknown_fields)]
pub struct MethodSpec {
    /// Its name in the results of a bench.
    #[cfg_attr(feature = "cli", arg(skip))]
    pub name: String,
    /// The algorithm that estimates the picture.
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    #[serde(default, skip_serializing_if = "IntegratorKind::is_path")]
    pub integrator: IntegratorKind,
    /// Rule of regularisation.
    #[cfg_attr(
        feature = "cli",
        arg(long = "mode", value_name = "RULE", value_enum, default_value_t)
    )]
    pub method: Kind,
    /// One attenuation factor in [0, 1] for all paths, instead of a table; 0 is plain path tracing.
    #[cfg_attr(feature = "cli", arg(long, value_name = "X", value_parser = unit))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gamma: Option<f32>,
    /// Learned attenuation factors: a table's file, or beta-0.001 or beta-0.05, which the program contains.
    #[cfg_attr(
        feature = "cli",
        arg(
            id = "opsr_table",
            long = "opsr-table",
            value_name = "TABLE",
            conflicts_with = "gamma"
        )
    )]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<PathBuf>,
    /// Multiply the table's factors by this, instead of the scale that the table carries.
    #[cfg_attr(feature = "cli", arg(long, value_name = "X", requires = "opsr_table", value_parser = scale))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table_scale: Option<f32>,
    /// Scales of several levels on the same paths, of which every pixel gets the best; empty for one level.
    #[cfg_attr(feature = "cli", arg(skip))]
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<f32>,
    /// Smoothing of a picture of several levels, instead of the default.
    #[cfg_attr(feature = "cli", arg(skip))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub resolve: Option<Resolve>,
    /// Denoise the picture.
    #[cfg_attr(feature = "cli", arg(skip))]
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub denoise: bool,
    /// Look-up of the factors, instead of the one that the table was learned for.
    #[cfg_attr(feature = "cli", arg(long, value_enum, requires = "opsr_table"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lookup: Option<Lookup>,
    /// Continue paths with the roughened lobe.
    #[cfg_attr(feature = "cli", arg(skip))]
    #[serde(default)]
    pub reuse: bool,
    /// Let the bias vanish: sample n roughens by n^-LAMBDA of the full amount, LAMBDA in (0, 0.5).
    #[cfg_attr(feature = "cli", arg(
        long = "consistent",
        value_name = "LAMBDA",
        num_args = 0..=1,
        default_missing_value = "0.16666667",
        value_parser = exponent
    ))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lambda: Option<f32>,
    /// Filter value of filter-glossy; 1 if not given.
    #[cfg_attr(feature = "cli", arg(long, value_name = "X", value_parser = positive))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter: Option<f32>,
    /// First radius within which the photons of vcm and sppm count, in the scene's units; twice a pixel's footprint if
    /// not given.
    #[cfg_attr(feature = "cli", arg(long, value_name = "R", value_parser = positive))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius: Option<f32>,
    /// Shrinking of that radius: in sample n it is n^((A − 1)/2) of the first, A in (0, 1]; 2/3 if not given.
    #[cfg_attr(feature = "cli", arg(long, value_name = "A", value_parser = shrinking))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_alpha: Option<f32>,
    /// Connections of vcm; all if not given.
    #[cfg_attr(feature = "cli", arg(long, value_enum))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub connections: Option<Connections>,
    /// Draw directions from a guide too, which learns while rendering where light comes from; path only. With a table or
    /// gamma the picture is roughened and the guide learns from it; `unbiased` roughens for the guide alone.
    #[cfg_attr(feature = "cli", arg(long, value_enum, value_name = "FOR", num_args = 0..=1, default_missing_value = "picture"))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guide: Option<Guide>,
    /// Mutations per pixel of one sample of mlt; 16 if not given.
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=65536)))]
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mlt_pass: Option<u32>,
    /// Random numbers of camera paths of --integrator path; independent in a suite that does not say, and with --guide.
    #[cfg_attr(feature = "cli", arg(long, value_enum, value_name = "KIND", default_value_t = SamplerKind::Sobol))]
    #[serde(default, skip_serializing_if = "SamplerKind::is_independent")]
    pub sampler: SamplerKind,
}

/// Smoothing that a picture of several levels may get.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Resolve {
    /// None: the means of all samples at level 0, plain path tracing.
    None,
    /// Every pixel gets the level with the least error.
    Sharp,
    /// Every pixel gets the level with the least error, and blurs where they make it less.
    #[default]
    Default,
    /// The same, and what is smoother is believed more easily: less noise, more bias.
    Smooth,
}

/// Connections of `vcm`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Connections {
    /// Every vertex of a light path to the camera and to every vertex of a camera path.
    All,
    /// Light samples only: cheaper, and as good where photons find the rest.
    Nee,
}

/// The paths from which a guide learns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Guide {
    /// The paths of the picture.
    Picture,
    /// Roughened ones, beside those of the picture, which are not.
    Unbiased,
}

/// Integrators by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum IntegratorKind {
    /// Path tracing from the camera.
    #[default]
    Path,
    /// Light tracing: caustics seen directly; no surface that is seen by way of a mirror or smooth glass.
    Light,
    /// Bidirectional path tracing: lamps behind glass, caustics, indirect light.
    Bdpt,
    /// Bidirectional path tracing and photon density in one: caustics seen through glass, water or mirrors too.
    #[cfg_attr(feature = "cli", value(alias = "ups"))]
    #[serde(alias = "ups")]
    Vcm,
    /// Photon density with a shrinking radius.
    Sppm,
    /// Metropolis light transport over bdpt: light through keyholes and around corners, chains of glossy reflections. A
    /// sample is 16 mutations per pixel.
    Mlt,
    /// The one of path, bdpt, vcm and sppm with the least expected error, by a pilot of a few per cent of the render.
    Auto,
}

impl IntegratorKind {
    /// True for path tracing.
    pub fn is_path(&self) -> bool {
        *self == Self::Path
    }

    /// The algorithm, with this radius if it has one.
    pub fn estimator(self, radius: Radius) -> Estimator {
        match self {
            // Until a pilot has chosen.
            Self::Path | Self::Auto => Estimator::Path { reuse: false },
            Self::Light => Estimator::Light,
            Self::Bdpt => Estimator::Bdpt,
            Self::Vcm => Estimator::Vcm(radius),
            Self::Sppm => Estimator::Sppm(radius),
            Self::Mlt => Estimator::Mlt {
                mutations: MUTATIONS,
            },
        }
    }

    /// The name that users know it by.
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }

    fn merges(self) -> bool {
        matches!(self, Self::Vcm | Self::Sppm)
    }
}

/// Kinds of methods.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// At next-event estimation only; the path continues with the original lobe.
    #[default]
    #[serde(skip)]
    Default,
    /// The path continues with the roughened lobe: faster, slightly more bias.
    #[serde(skip)]
    Reuse,
    /// No regularisation.
    #[cfg_attr(feature = "cli", value(skip))]
    Plain,
    /// One attenuation factor.
    #[cfg_attr(feature = "cli", value(skip))]
    Constant,
    /// Learned attenuation factors.
    #[cfg_attr(feature = "cli", value(skip))]
    Table,
    /// pbrt-v4's rule, for comparison.
    Pbrt,
    /// Cycles' filter glossy, for comparison.
    FilterGlossy,
    /// No lobe sharper than the roughest before it, for comparison.
    RoughnessClamp,
    /// Kaplanyan and Dachsbacher's mollifier: lights without area seen through smooth mirrors and glass.
    Mollifier,
}

/// A method whose table is read.
#[derive(Clone, Debug)]
pub struct Method {
    /// The algorithm.
    pub estimator: Estimator,
    /// The rule.
    pub rule: Rule,
    /// SHA-256 of the table's file, in hexadecimal digits.
    pub table_sha256: Option<String>,
    /// Number of scenes that the table was learned from, if its file says so.
    pub table_scenes: Option<usize>,
}

impl MethodSpec {
    /// The first option that the integrator cannot take.
    pub fn refused(&self) -> Result<(), String> {
        use IntegratorKind::{Bdpt, Mlt, Path, Vcm};
        let modes = !matches!(
            self.method,
            Kind::Default | Kind::Plain | Kind::Constant | Kind::Table
        );
        let accumulates = self.gamma.is_some() || self.table.is_some();
        if self.guide.is_some() && (modes || self.reuse || self.integrator != Path) {
            return Err("a guide is for integrator path without mode or reuse".into());
        }
        if self.guide.is_some() && !self.levels.is_empty() {
            return Err("a guide has one level".into());
        }
        if self.guide == Some(Guide::Unbiased) && !accumulates {
            return Err(
                "an unbiased guide needs a table or gamma, which roughens for it alone".into(),
            );
        }
        if self.integrator == IntegratorKind::Auto {
            let others = [Kind::Pbrt, Kind::FilterGlossy, Kind::RoughnessClamp];
            return match others.contains(&self.method) {
                true => Err("integrator auto takes no mode but reuse and mollifier".into()),
                false if self.mlt_pass.is_some() => {
                    Err("integrator auto does not try mlt: no mlt-pass".into())
                }
                false => Ok(()),
            };
        }
        let name = self.integrator.name();
        let mollifies = matches!(self.integrator, Bdpt | Mlt);
        let mollified = mollifies && self.method == Kind::Mollifier;
        match self.integrator {
            Path => {}
            Bdpt | Vcm | Mlt if self.reuse || modes && !mollified => {
                let allowed = if mollifies {
                    "no mode but mollifier"
                } else {
                    "no mode"
                };
                return Err(format!(
                    "integrator {name} roughens the last vertex only, with a table or gamma: {allowed}, no reuse"
                ));
            }
            Bdpt | Vcm | Mlt => {}
            _ if modes || accumulates || self.reuse => {
                return Err(format!(
                    "integrator {name} does not regularise: no mode, gamma, table or reuse"
                ));
            }
            _ => {}
        }
        if self.connections.is_some() && self.integrator != Vcm {
            return Err(format!(
                "integrator {name} has no choice of connections: vcm has"
            ));
        }
        if (self.radius.is_some() || self.radius_alpha.is_some()) && !self.integrator.merges() {
            return Err(format!(
                "integrator {name} has no radius: vcm and sppm have"
            ));
        }
        if self.mlt_pass.is_some() && self.integrator != IntegratorKind::Mlt {
            return Err(format!("integrator {name} has no mlt-pass: mlt has"));
        }
        Ok(())
    }

    /// Integrator, mode and what else was given for them, by name, for the file of a picture; the integrator may be a pilot's
    /// choice.
    pub fn words(
        &self,
        integrator: IntegratorKind,
    ) -> impl Iterator<Item = (&'static str, String)> + use<> {
        let gamma = self.gamma.map(|gamma| ("gamma", gamma.to_string()));
        let sampled = integrator.is_path() && self.guide.is_none();
        let sampler =
            (sampled && !self.sampler.is_independent()).then(|| ("sampler", word(&self.sampler)));
        let guide = self.guide.map(|guide| ("guide", word(&guide)));
        let pilot =
            (integrator != self.integrator).then(|| ("integrator_chosen_by", "pilot".to_owned()));
        let consistent = self.lambda.map(|x| ("consistent", x.to_string()));
        let filter = self.filter.map(|x| ("filter", x.to_string()));
        let lookup = self.lookup.map(|lookup| ("lookup", word(&lookup)));
        // A pilot may have chosen an integrator without a radius.
        let merges = integrator.merges();
        let radius = self.radius.filter(|_| merges);
        let radius = radius.map(|x| ("radius", x.to_string()));
        let radius_alpha = self.radius_alpha.filter(|_| merges);
        let radius_alpha = radius_alpha.map(|x| ("radius_alpha", x.to_string()));
        let connections = self.connections.map(|kind| ("connections", word(&kind)));
        let mlt_pass = self.mlt_pass.map(|n| ("mlt_pass", n.to_string()));
        [
            ("integrator", word(&integrator)),
            ("mode", word(&self.method)),
        ]
        .into_iter()
        .chain(pilot)
        .chain(gamma)
        .chain([consistent, filter, lookup].into_iter().flatten())
        .chain(sampler)
        .chain(guide)
        .chain(
            [radius, radius_alpha, connections, mlt_pass]
                .into_iter()
                .flatten(),
        )
    }

    /// The methods among which [`IntegratorKind::Auto`] chooses, the plain path tracer first: the path tracer as asked for,
    /// or with [levels](super::levels) of the table that the program contains where nothing was, and every other integrator, without
    /// roughening. So a table adds no error to them.
    pub fn contenders(&self) -> Vec<Self> {
        let plain = |integrator| {
            let merges = IntegratorKind::merges(integrator);
            let mollifies = self.method == Kind::Mollifier
                && matches!(integrator, IntegratorKind::Path | IntegratorKind::Bdpt);
            Self {
                integrator,
                method: if mollifies {
                    Kind::Mollifier
                } else {
                    Kind::Plain
                },
                radius: self.radius.filter(|_| merges),
                radius_alpha: self.radius_alpha.filter(|_| merges),
                connections: (self.connections).filter(|_| integrator == IntegratorKind::Vcm),
                gamma: None,
                table: None,
                lambda: None,
                reuse: false,
                levels: Vec::new(),
                ..self.clone()
            }
        };
        let path = plain(IntegratorKind::Path);
        let mut roughened = Self {
            radius: None,
            radius_alpha: None,
            connections: None,
            integrator: IntegratorKind::Path,
            ..self.clone()
        };
        let asked = self.gamma.is_some() || self.table.is_some();
        if !asked && path.method == Kind::Plain {
            roughened.method = Kind::Table;
            roughened.table = Some(DEFAULT_TABLE.into());
            roughened.levels = SCALES.to_vec();
        }
        let others = [
            IntegratorKind::Bdpt,
            IntegratorKind::Vcm,
            IntegratorKind::Sppm,
        ];
        let twice = roughened.method == path.method && !asked;
        let roughened = (!twice).then_some(roughened);
        [path]
            .into_iter()
            .chain(roughened)
            .chain(others.map(plain))
            .collect()
    }

    /// The method; a table is read from its file.
    pub fn resolve(&self) -> Result<Method, FileError> {
        let (mut table_sha256, mut table_scenes) = (None, None);
        let accumulated = |factors| {
            Rule::Accumulated(Accumulated {
                factors,
                lambda: self.lambda.unwrap_or(0.0),
            })
        };
        let rule = match (self.method, self.gamma, &self.table) {
            (Kind::Pbrt, ..) => Rule::Pbrt,
            (Kind::FilterGlossy, ..) => Rule::FilterGlossy(self.filter.unwrap_or(1.0)),
            (Kind::RoughnessClamp, ..) => Rule::RoughnessClamp,
            (Kind::Mollifier, ..) => Rule::Mollifier(MOLLIFIER_RADIUS),
            (_, Some(gamma), _) => accumulated(Factors::Constant(gamma)),
            (_, None, Some(path)) => {
                let file = TableFile::load(path)?;
                table_sha256 = Some(hex(&file.digest()));
                table_scenes = file.provenance.as_ref().map(|p| p.scenes.len());
                let mut table = file.table;
                table.scale = self.table_scale.unwrap_or(table.scale);
                table.lookup = self.lookup.unwrap_or(table.lookup);
                accumulated(Factors::Table(table))
            }
            (_, None, None) => Rule::Plain,
        };
        let reuse = self.reuse || self.method == Kind::Reuse;
        let radius = Radius {
            first: self.radius,
            alpha: self.radius_alpha.unwrap_or(Radius::default().alpha),
        };
        let estimator = match self.integrator.estimator(radius) {
            Estimator::Path { .. } => match self.guide {
                Some(guide) => Estimator::Guided {
                    unbiased: guide == Guide::Unbiased,
                },
                None => Estimator::Path { reuse },
            },
            Estimator::Vcm(radius) if self.connections == Some(Connections::Nee) => {
                Estimator::VcmNee(radius)
            }
            Estimator::Mlt { mutations } => Estimator::Mlt {
                mutations: self.mlt_pass.unwrap_or(mutations),
            },
            other => other,
        };
        Ok(Method {
            estimator,
            rule,
            table_sha256,
            table_scenes,
        })
    }
}

/// A choice by the name that options have for it: that of its variant in kebab case.
fn word(choice: &impl std::fmt::Debug) -> String {
    let mut word = String::new();
    for c in format!("{choice:?}").chars() {
        if c.is_uppercase() && !word.is_empty() {
            word.push('-');
        }
        word.extend(c.to_lowercase());
    }
    word
}

/// A number from 0 to 1.
pub fn unit(text: &str) -> Result<f32, String> {
    number(text, |x| (0.0..=1.0).contains(&x), "from 0 to 1")
}

#[cfg(feature = "cli")]
fn exponent(text: &str) -> Result<f32, String> {
    number(text, |x| x > 0.0 && x < 0.5, "between 0 and 0.5")
}

#[cfg(feature = "cli")]
fn shrinking(text: &str) -> Result<f32, String> {
    number(text, |x| x > 0.0 && x <= 1.0, "above 0 and at most 1")
}

/// A number above 0.
pub fn positive(text: &str) -> Result<f32, String> {
    number(text, |x| x > 0.0 && x.is_finite(), "above 0")
}

#[cfg(feature = "cli")]
fn scale(text: &str) -> Result<f32, String> {
    positive(text).map_err(|what| match text {
        "auto" => format!(
            "{what}: auto is gone, and levels, the default, choose an amount for every pixel"
        ),
        _ => what,
    })
}

/// A number not below 0.
pub fn at_least_zero(text: &str) -> Result<f32, String> {
    number(text, |x| x >= 0.0 && x.is_finite(), "of at least 0")
}

fn number(text: &str, allowed: fn(f32) -> bool, range: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|&x| allowed(x));
    number.ok_or_else(|| format!("expected a number {range}"))
}

#[cfg(all(test, feature = "cli"))]
mod tests {
    use super::*;
    use clap::ValueEnum;

    /// Metadata name a choice as its option does.
    #[test]
    fn words_are_the_names_of_options() {
        fn check<T: ValueEnum + std::fmt::Debug>() {
            for choice in T::value_variants() {
                let name = choice.to_possible_value();
                assert!(name.is_none_or(|name| name.get_name() == word(choice)));
            }
        }
        check::<Kind>();
        check::<IntegratorKind>();
        check::<Guide>();
        check::<Connections>();
        check::<SamplerKind>();
        check::<Lookup>();
        assert_eq!(word(&Kind::Default), "default");
    }
}
