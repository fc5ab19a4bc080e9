//! Report of a training: the learned tables, their data, and their scores compared with constant factors.

use super::plot::{self, Axis, Line};
use super::{factors, html};
use base64::prelude::{BASE64_STANDARD, Engine as _};
use maud::{Markup, html};
use opsr::image::{Buffer, png};
use opsr::math::Rgb;
use opsr::regularise::{AttenuationTable, Lookup};
use opsr_train::config::ConfigError;
use opsr_train::learn::crop_set::CropSet;
use opsr_train::learn::loss::CropLoss;
use opsr_train::record::visits::{LIVE_CLASSES, Visits};
use opsr_train::score::Score;
use opsr_train::{Config, Session};
use serde::Serialize;

/// All data of the report.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Version of the program.
    pub opsr: String,
    /// The resolved settings.
    pub config: Config,
    /// Names of the training crops.
    pub names: Vec<String>,
    /// Names of the validation crops.
    pub validation_names: Vec<String>,
    /// Wall-clock seconds of recording and baking.
    pub recording_seconds: f64,
    /// Memory of the recordings in bytes.
    pub bytes: usize,
    /// Events per class.
    pub visits: Vec<u64>,
    /// One table for each β.
    pub tables: Vec<LearnedTable>,
}

/// A table and its scores.
#[derive(Debug, Serialize)]
pub struct LearnedTable {
    /// Weight of the variance.
    pub beta: f32,
    /// Steps taken.
    pub steps: u32,
    /// Wall-clock seconds of the steps.
    pub seconds: f64,
    /// Lines of the log.
    #[serde(skip)]
    pub log: Vec<serde_json::Value>,
    /// Scores on the training crops.
    pub training: Vec<Score>,
    /// Scores on the validation crops.
    pub validation: Vec<Score>,
    /// Losses of the training crops.
    pub crops: CropScores,
    /// Losses of the validation crops.
    pub validation_crops: CropScores,
    /// The table.
    #[serde(skip)]
    pub table: AttenuationTable,
}

/// Losses and images of every crop of a set.
#[derive(Debug, Default, Serialize)]
pub struct CropScores {
    /// Losses without roughening: all factors are 0.
    pub plain: Vec<CropLoss>,
    /// Losses with the table at the start of the training.
    pub before: Vec<CropLoss>,
    /// Losses with the learned table.
    pub after: Vec<CropLoss>,
    /// Mean relative standard error of the references.
    pub reference_noise: Vec<f64>,
    /// Reference, start and learned, as PNG.
    #[serde(skip)]
    pictures: Vec<[Vec<u8>; 3]>,
}

impl CropScores {
    /// Losses and images at the start of the training and with the learned table.
    pub fn new(set: &mut CropSet, start: &AttenuationTable, learned: &AttenuationTable) -> Self {
        if set.is_empty() {
            return Self::default();
        }
        let plain = AttenuationTable {
            lookup: learned.lookup,
            ..AttenuationTable::constant(0.0)
        };
        let plain = set.losses(&plain);
        let (a, b) = (set.exact(start), set.exact(learned));
        let pictures = (set.crops().zip(a.iter().zip(&b)))
            .map(|(crop, (a, b))| {
                let total: f32 = crop.reference.iter().flatten().sum();
                let mean = total / (3 * crop.reference.len()) as f32;
                // The crop's mean becomes middle grey.
                let exposure = (0.3 / mean.max(1e-20)).log2();
                [&crop.reference, &a.mean, &b.mean].map(|pixels| {
                    let picture = Buffer {
                        width: crop.window.w as usize,
                        height: crop.window.h as usize,
                        pixels: pixels.iter().map(|&p| Rgb::from(p)).collect(),
                    };
                    png::encode(&picture, exposure).unwrap_or_default()
                })
            })
            .collect();
        Self {
            plain,
            before: set.losses_of(&a),
            after: set.losses_of(&b),
            reference_noise: set.crops().map(|c| c.reference_noise).collect(),
            pictures,
        }
    }

    /// True if a crop's loss is larger with the learned table than without roughening.
    fn is_worse(&self, crop: usize, beta: f32) -> bool {
        self.after[crop].total(beta) > self.plain[crop].total(beta)
    }
}

impl Report {
    /// The report of a session that has recorded its crops, without tables yet.
    pub fn new(session: &Session) -> Self {
        Self {
            opsr: env!("CARGO_PKG_VERSION").into(),
            config: session.config.clone(),
            names: session.training.crops().map(|c| c.name.clone()).collect(),
            validation_names: session.validation.crops().map(|c| c.name.clone()).collect(),
            recording_seconds: session.seconds,
            bytes: session.training.bytes() + session.validation.bytes(),
            visits: session.training.visits().0,
            tables: Vec::new(),
        }
    }

    /// The report as one self-contained HTML file.
    pub fn html(&self) -> Result<String, ConfigError> {
        let settings = self.config.to_toml()?;
        let visits = Visits(self.visits.clone());
        let events: u64 = self.visits.iter().sum();
        let body = html! {
            p {
                "opsr " (self.opsr) " learned from " (self.names.len()) " crops, with "
                (self.validation_names.len()) " crops for validation, for renders of " (self.config.spp)
                " samples per pixel. Recording took " (format!("{:.1}", self.recording_seconds)) " s and "
                (self.bytes / 1_000_000) " MB. The " (events) " events visit " (visits.live_with(1)) " of "
                (LIVE_CLASSES) " live classes, " (visits.live_with(100)) " of them at least 100 times."
            }
            (legend())
            (factors::events(&self.visits))
            @for learned in &self.tables { (self.learned(learned)) }
            h2 { "Settings" }
            pre { (settings) }
        };
        Ok(html::page("Training of attenuation factors", &body))
    }

    fn learned(&self, l: &LearnedTable) -> Markup {
        html! {
            h2 { "β = " (l.beta) }
            p { (l.steps) " steps in " (format!("{:.1}", l.seconds)) " s. " (summary(&l.table, &self.visits)) }
            (html::plot(
                &self.curves(l),
                "Mean loss of the training and of the validation crops, and the loss of two crops of each."
            ))
            h3 { "Training crops: the table beside constants" }
            (scores(&l.training))
            @if !l.validation.is_empty() {
                h3 { "Validation crops: scenes that nothing was learned from" }
                (scores(&l.validation))
            }
            h3 { "Factor by factor" }
            (factors::factors(&l.table.gammas[..], &self.visits))
            h3 { "Crop by crop" }
            (crops(&self.names, &l.crops, l.beta))
            @if !l.validation.is_empty() { (crops(&self.validation_names, &l.validation_crops, l.beta)) }
        }
    }

    /// Loss by step, as SVG: means, and two crops of each set.
    fn curves(&self, l: &LearnedTable) -> String {
        const COLOURS: [&str; 6] = [
            "#0072b2", "#d55e00", "#2c97ff", "#6668e5", "#b68d64", "#cc79a7",
        ];
        let step = |e: &serde_json::Value| e["step"].as_f64().unwrap_or(0.0);
        let crop = |key: &'static str, i: usize| {
            let beta = f64::from(l.beta);
            move |e: &serde_json::Value| {
                let crop = &e[key][i];
                Some(crop["mape"].as_f64()? + beta * crop["variance"].as_f64()?)
            }
        };
        let points = |value: &dyn Fn(&serde_json::Value) -> Option<f64>| -> Vec<(f64, f64)> {
            let points = l.log.iter().filter_map(|e| Some((step(e), value(e)?)));
            points.collect()
        };
        let mut curves = vec![
            ("training", points(&|e| e["loss"].as_f64())),
            ("validation", points(&|e| e["validation"].as_f64())),
        ];
        for (key, names) in [
            ("crops", &self.names),
            ("validation_crops", &self.validation_names),
        ] {
            for i in [0, names.len() / 2] {
                if let Some(name) = names.get(i) {
                    curves.push((name, points(&crop(key, i))));
                }
            }
        }
        curves.retain(|(_, points)| !points.is_empty());
        let all = || curves.iter().flat_map(|(_, points)| points);
        let steps = Axis::around("step", all().map(|p| p.0));
        let losses = Axis::around("loss", all().map(|p| p.1));
        let lines: Vec<Line> = (curves.iter().zip(COLOURS))
            .map(|((name, points), colour)| Line {
                name,
                colour,
                dashes: "",
                points: points.clone(),
                band: Vec::new(),
            })
            .collect();
        plot::lines(&steps, &losses, &lines, &[])
    }
}

/// Explanation of the terms in the tables.
fn legend() -> Markup {
    let terms = [
        (
            "loss",
            "MAPE + β · variance, averaged over crops. Smaller is better. A good table has a smaller loss than the best \
             constant (a ratio below 1), on validation crops too.",
        ),
        (
            "MAPE",
            "Mean of |image − reference| / (reference + 0.01) over pixels and channels; 0.1 means 10 %. It holds both the \
             noise at the chosen number of samples and the bias.",
        ),
        (
            "variance",
            "Sample variance of one path sample, after every crop is scaled to mean 0.3. It falls as paths are roughened.",
        ),
        (
            "β",
            "Weight of the variance in the loss. A larger β asks for more roughening: less noise, more bias.",
        ),
        (
            "factor",
            "How much of a path's roughness is added to its last surface, from 0 (none: plain path tracing) to 1.",
        ),
        (
            "energy",
            "Image mean / reference mean. 1 is right; below about 0.97 the roughening loses light, usually of caustics.",
        ),
        (
            "best constant",
            "The one factor for all classes that has the smallest loss on these very crops. It needs their references, \
             which a user does not have, and is the honest baseline of a table.",
        ),
        ("scale", "A number that multiplies all factors of a table."),
        (
            "live class",
            "A class of paths whose last surface can be roughened; classes never visited inherit the factor of a \
             visited one.",
        ),
    ];
    html! {
        details {
            summary { "What the terms mean, and what good looks like" }
            dl { @for (term, meaning) in terms { dt { (term) } dd { (meaning) } } }
        }
    }
}

/// A sentence about the factors: their quantiles, weighted by events, and the look-up.
fn summary(table: &AttenuationTable, visits: &[u64]) -> String {
    let mut factors: Vec<(f32, u64)> =
        (table.gammas.iter().copied().zip(visits.iter().copied())).collect();
    factors.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: u64 = visits.iter().sum();
    let quantile = |q: f64| {
        let mut sum = 0;
        (factors.iter())
            .find(|(_, n)| {
                sum += n;
                sum as f64 >= q * total as f64
            })
            .map_or(f32::NAN, |f| f.0)
    };
    let lookup = match table.lookup {
        Lookup::Nearest => "nearest",
        Lookup::Linear => "linear",
    };
    format!(
        "Factors, weighted by events: 10 % below {:.4}, median {:.4}, 90 % below {:.4}; {lookup} look-up.",
        quantile(0.1),
        quantile(0.5),
        quantile(0.9)
    )
}

/// A table of scores; the first one is the best constant.
fn scores(all: &[Score]) -> Markup {
    let best_constant = all.first().map_or(f32::NAN, |s| s.loss);
    html! {
        .scroll { table.named {
            tr {
                th { "table" } th { "factor or scale" } th { "loss" } th { "loss / best constant" } th { "energy" }
            }
            @for s in all {
                tr {
                    td { (s.name) }
                    td { (s.value.map_or(String::new(), |v| format!("{v:.4}"))) }
                    td { (format!("{:.4}", s.loss)) }
                    td { (format!("{:.3}", s.loss / best_constant)) }
                    td { (format!("{:.3}", s.energy)) }
                }
            }
        } }
    }
}

/// Losses and images of every crop.
fn crops(names: &[String], crops: &CropScores, beta: f32) -> Markup {
    let image =
        |bytes: &Vec<u8>| format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes));
    let worse = (0..names.len())
        .filter(|&i| crops.is_worse(i, beta))
        .count();
    html! {
        p {
            (worse) " of " (names.len()) " crops have a larger loss with the table than plain, without roughening"
            @if worse > 0 { "; they are marked ▲" } "."
        }
        .scroll { table.named {
            tr {
                th { "crop" } th { "reference, start, learned" } th { "loss, plain" } th { "loss at the start" }
                th { "loss, learned" } th { "MAPE" } th { "variance" } th { "energy" } th { "noise of the reference" }
            }
            @for (i, name) in names.iter().enumerate() {
                @let worse = crops.is_worse(i, beta);
                tr {
                    td { (name) @if worse { strong.off title="worse than plain" { " ▲" } } }
                    td { .crop { @for picture in &crops.pictures[i] { img src=(image(picture)) alt=(name); } } }
                    td { (format!("{:.4}", crops.plain[i].total(beta))) }
                    td { (format!("{:.4}", crops.before[i].total(beta))) }
                    td.worse[worse] { (format!("{:.4}", crops.after[i].total(beta))) }
                    td { (format!("{:.4}", crops.after[i].mape)) }
                    td { (format!("{:.3}", crops.after[i].variance)) }
                    td { (format!("{:.3}", crops.after[i].energy)) }
                    td { (format!("{:.2} %", 100.0 * crops.reference_noise[i])) }
                }
            }
        } }
    }
}
