//! The report of a training: what was learned, from how much, and what it is worth beside constants.

use super::plot::{self, Axis, Line};
use crate::image::{Buffer, png};
use crate::math::Rgb;
use crate::regularise::{AttenuationTable, GammaIndex, LEN, Lookup};
use crate::train::objective::CropLoss;
use crate::train::set::Set;
use crate::train::study::{HeldOut, Score};
use crate::train::visits::{LIVE, Visits};
use crate::train::{Config, Session};
use base64::prelude::{BASE64_STANDARD, Engine as _};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use serde::Serialize;

/// What the report is made from.
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
    /// Seconds that recording and baking took.
    pub recording_seconds: f64,
    /// Bytes that the sources hold.
    pub bytes: usize,
    /// Events per class.
    pub visits: Vec<u64>,
    /// One for each β.
    pub tables: Vec<Learned>,
}

/// A table and its scores.
#[derive(Debug, Serialize)]
pub struct Learned {
    /// Weight of the variance.
    pub beta: f32,
    /// Steps taken.
    pub steps: u32,
    /// Seconds that they took.
    pub seconds: f64,
    /// Lines of the log.
    #[serde(skip)]
    pub log: Vec<serde_json::Value>,
    /// On the training crops.
    pub training: Vec<Score>,
    /// On the validation crops.
    pub validation: Vec<Score>,
    /// On each family, learned from the others; empty if that was not asked for.
    pub held_out: Vec<HeldOut>,
    /// Losses of the training crops.
    pub crops: Crops,
    /// Losses of the validation crops.
    pub validation_crops: Crops,
    /// The table.
    #[serde(skip)]
    pub table: AttenuationTable,
}

/// Crops before and after.
#[derive(Debug, Default, Serialize)]
pub struct Crops {
    /// At the start of the training.
    pub before: Vec<CropLoss>,
    /// With the learned table.
    pub after: Vec<CropLoss>,
    /// Relative noise of the references.
    pub reference_noise: Vec<f64>,
    /// Reference, start and learned, as PNG.
    #[serde(skip)]
    pictures: Vec<[Vec<u8>; 3]>,
}

impl Crops {
    /// Scores and pictures of a set.
    pub fn of(set: &mut Set, start: &AttenuationTable, learned: &AttenuationTable) -> Self {
        if set.is_empty() {
            return Self::default();
        }
        let (a, b) = (set.exact(start), set.exact(learned));
        let pictures = (set.crops().zip(a.iter().zip(&b)))
            .map(|(crop, (a, b))| {
                let total: f32 = crop.reference.iter().flatten().sum();
                let mean = total / (3 * crop.reference.len()) as f32;
                // Middle grey at the crop's mean.
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
            before: set.losses_of(&a),
            after: set.losses_of(&b),
            reference_noise: set.crops().map(|c| c.reference_noise).collect(),
            pictures,
        }
    }
}

impl Report {
    /// Of a session that has recorded and not learned yet.
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

    /// One offline HTML file.
    pub fn html(&self) -> Result<String, crate::train::config::ConfigError> {
        let settings = self.config.to_toml()?;
        let visits = Visits(self.visits.clone());
        let events: u64 = self.visits.iter().sum();
        let page = html! {
            (DOCTYPE)
            html lang="en" {
                head {
                    meta charset="utf-8";
                    title { "opsr training" }
                    style { (PreEscaped(include_str!("page.css"))) }
                }
                body {
                    h1 { "Training of attenuation factors" }
                    p {
                        "opsr " (self.opsr) ". " (self.names.len()) " training crops, " (self.validation_names.len())
                        " validation crops, " (self.config.spp) " samples per pixel. Recorded in "
                        (format!("{:.1}", self.recording_seconds)) " s; " (self.bytes / 1_000_000) " MB held. "
                        (events) " events; " (visits.coverage()) " of " (LIVE) " live classes seen, "
                        (at_least(&visits, 100)) " of them at least 100 times."
                    }
                    @for learned in &self.tables { (self.learned(learned)) }
                    h2 { "Settings" }
                    pre { (settings) }
                }
            }
        };
        Ok(page.into_string())
    }

    fn learned(&self, l: &Learned) -> Markup {
        html! {
            h2 { "β = " (l.beta) }
            p { (l.steps) " steps in " (format!("{:.1}", l.seconds)) " s. Factors: " (summary(&l.table, &self.visits)) }
            figure {
                (PreEscaped(self.curves(l)))
                figcaption { "Loss by step: mean of the training and of the validation crops, and two of each." }
            }
            h3 { "Training crops: the table beside constants" }
            (scores(&l.training))
            @if !l.validation.is_empty() {
                h3 { "Validation crops: scenes that nothing was learned from" }
                (scores(&l.validation))
            }
            @if !l.held_out.is_empty() {
                h3 { "Families held out: learned from the others, scored on this one" }
                (held_out(&l.held_out))
            }
            h3 { "Crops" }
            (crops(&self.names, &l.crops, l.beta))
            @if !l.validation.is_empty() { (crops(&self.validation_names, &l.validation_crops, l.beta)) }
        }
    }

    /// Loss by step, as SVG: means, and two crops of each set.
    fn curves(&self, l: &Learned) -> String {
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

/// Live classes with at least so many events.
fn at_least(visits: &Visits, n: u64) -> usize {
    (0..LEN)
        .filter_map(GammaIndex::new)
        .filter(|&c| crate::train::visits::is_live(c) && visits.0[c.index()] >= n)
        .count()
}

/// Factors in a sentence: quantiles weighted by visits, and the look-up.
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
        "a tenth of the events is below {:.4}, half below {:.4}, nine tenths below {:.4}; {lookup} look-up.",
        quantile(0.1),
        quantile(0.5),
        quantile(0.9)
    )
}

fn scores(all: &[Score]) -> Markup {
    let oracle = all.first().map_or(f32::NAN, |s| s.loss);
    html! {
        table {
            tr { th { "way" } th { "factor or scale" } th { "loss" } th { "over the best constant" } th { "energy" } }
            @for s in all {
                tr {
                    td { (s.name) }
                    td { (s.value.map_or(String::new(), |v| format!("{v:.4}"))) }
                    td { (format!("{:.4}", s.loss)) }
                    td { (format!("{:.3}", s.loss / oracle)) }
                    td { (format!("{:.3}", s.energy)) }
                }
            }
        }
    }
}

fn held_out(all: &[HeldOut]) -> Markup {
    let names: Vec<&str> = all.first().map_or(Vec::new(), |h| {
        h.scores.iter().map(|s| s.name.as_str()).collect()
    });
    // Black crops have no loss to compare with.
    let ratio = |h: &HeldOut, i: usize| {
        let ratio = h.scores[i].loss / h.scores[0].loss;
        (ratio > 0.0 && ratio.is_finite()).then_some(ratio)
    };
    let mean = |i: usize| {
        let logs: Vec<f32> = all.iter().filter_map(|h| Some(ratio(h, i)?.ln())).collect();
        (!logs.is_empty()).then(|| (logs.iter().sum::<f32>() / logs.len() as f32).exp())
    };
    let shown = |x: Option<f32>| x.map_or("–".to_owned(), |x| format!("{x:.3}"));
    html! {
        p { "Loss over that of the best constant of the held-out crops themselves, which a user cannot know; energy in brackets." }
        table {
            tr { th { "family" } @for name in &names { th { (name) } } }
            @for h in all {
                tr {
                    td { (h.family) }
                    @for i in 0..names.len() { td { (format!("{} ({:.3})", shown(ratio(h, i)), h.scores[i].energy)) } }
                }
            }
            tr {
                td { "geometric mean" }
                @for i in 0..names.len() { td { (shown(mean(i))) } }
            }
        }
    }
}

fn crops(names: &[String], crops: &Crops, beta: f32) -> Markup {
    let image =
        |bytes: &Vec<u8>| format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes));
    html! {
        table {
            tr {
                th { "crop" } th { "reference, start, learned" } th { "loss at the start" } th { "loss" } th { "MAPE" }
                th { "variance" } th { "energy" } th { "noise of the reference" }
            }
            @for (i, name) in names.iter().enumerate() {
                tr {
                    td { (name) }
                    td style="white-space: nowrap" {
                        @for picture in &crops.pictures[i] { img src=(image(picture)) width="96" height="96" alt=(name); " " }
                    }
                    td { (format!("{:.4}", crops.before[i].total(beta))) }
                    td { (format!("{:.4}", crops.after[i].total(beta))) }
                    td { (format!("{:.4}", crops.after[i].mape)) }
                    td { (format!("{:.3}", crops.after[i].variance)) }
                    td { (format!("{:.3}", crops.after[i].energy)) }
                    td { (format!("{:.2} %", 100.0 * crops.reference_noise[i])) }
                }
            }
        }
    }
}
