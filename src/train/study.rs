//! The worth of a table: beside constant factors, on crops that it was not learned from, and with its scale free.

use crate::regularise::{AttenuationTable, Lookup, Rule, TableTuning};
use crate::train::TrainError;
use crate::train::config::{Config, Model, constant_table};
use crate::train::learn::crop_set::{CropSet, minimise};
use crate::train::learn::loss::{CropLoss, mean_loss};
use crate::train::learn::session::Session;
use crate::train::record::crop::{Crop, DatasetError};
use crate::tune::{self, CONTRASTS, Pilot};
use serde::Serialize;
use std::ops::ControlFlow;

/// Loss of a table, or of a constant factor, on some crops.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// Name of the table.
    pub name: String,
    /// The constant factor, or the scale of the table, if there is one; the geometric mean where each crop has its own.
    pub value: Option<f32>,
    /// Mean loss of the crops.
    pub loss: f32,
    /// Mean over the crops of rendered mean / reference mean.
    pub energy: f32,
}

/// Scores on a family of scenes that was held out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOut {
    /// The family.
    pub family: String,
    /// The scores. The first is the best constant of the family itself, which a user cannot know.
    pub scores: Vec<Score>,
}

impl Score {
    fn new(name: &str, value: Option<f32>, losses: &[CropLoss], beta: f32) -> Self {
        Self {
            name: name.into(),
            value,
            loss: mean_loss(losses, beta).unwrap_or(f32::NAN),
            energy: losses.iter().map(|l| l.energy).sum::<f32>() / losses.len().max(1) as f32,
        }
    }
}

/// The score of a table.
pub fn score(
    set: &mut CropSet,
    beta: f32,
    name: &str,
    value: Option<f32>,
    table: &AttenuationTable,
) -> Score {
    Score::new(name, value, &set.losses(table), beta)
}

/// Scores of constants and tables: the constant `own`, the best one of the crops themselves; `elsewhere`, the best one
/// of the training crops; and `tables`, in `hindsight` also with the scale and contrast that suit the crops best.
pub fn scores(
    set: &mut CropSet,
    beta: f32,
    own: f32,
    elsewhere: f32,
    tables: &[(&str, &AttenuationTable)],
    hindsight: bool,
) -> Vec<Score> {
    let lookup = tables.first().map_or(Lookup::Nearest, |t| t.1.lookup);
    let mut all = Vec::new();
    for (name, gamma) in [
        ("best constant of these crops", own),
        ("constant of the training crops", elsewhere),
    ] {
        let table = constant_table(gamma, lookup);
        all.push(score(set, beta, name, Some(gamma), &table));
    }
    for (name, table) in tables {
        all.push(score(set, beta, name, None, table));
        if !hindsight {
            continue;
        }
        let tuned = best_tunings(set, beta, table);
        let mut best = tuned[0];
        for candidate in tuned {
            if candidate.0 < best.0 {
                best = candidate;
            }
        }
        for (what, tuning) in [("scale", tuned[0].1), ("scale and contrast", best.1)] {
            let name = format!("{name}, best {what}");
            let scale = Some(tuning.scale);
            all.push(score(set, beta, &name, scale, &table.tuned(tuning)));
        }
    }
    all
}

/// The best scale of a table for some crops, between 1/32 and 32.
fn best_scale(set: &mut CropSet, beta: f32, table: &AttenuationTable) -> f32 {
    let ln = minimise(-(32f64.ln()), 32f64.ln(), |ln| {
        let scaled = AttenuationTable {
            scale: table.scale * ln.exp() as f32,
            ..table.clone()
        };
        f64::from(set.loss(beta, &scaled).unwrap_or(0.0))
    });
    ln.exp() as f32
}

/// The contrasts that a pilot tries, each with its best scale and the loss there.
fn best_tunings(set: &mut CropSet, beta: f32, table: &AttenuationTable) -> [(f32, TableTuning); 3] {
    CONTRASTS.map(|contrast| {
        let flattened = table.tuned(TableTuning {
            scale: 1.0,
            contrast,
        });
        let scale = best_scale(set, beta, &flattened);
        let tuning = TableTuning { scale, contrast };
        let loss = set.loss(beta, &table.tuned(tuning));
        (loss.unwrap_or(0.0), tuning)
    })
}

/// Scores of a table that a pilot tunes for every crop, without its reference, for renders of `samples` samples per
/// pixel: as the pilot chooses, and as it chooses where the image mean may change by 3 or 10 % at most.
pub fn piloted(
    set: &mut CropSet,
    beta: f32,
    name: &str,
    table: &AttenuationTable,
    samples: u32,
) -> Result<Vec<Score>, TrainError> {
    let pilots = (set.crops())
        .map(|crop| pilot(crop, table, samples))
        .collect::<Result<Vec<Pilot>, _>>()?;
    let mut choices = vec![(
        String::new(),
        pilots.iter().map(|p| p.tuning).collect::<Vec<_>>(),
    )];
    for per_cent in [3, 10] {
        let within = |pilot: &Pilot| pilot.within(f64::from(per_cent) / 100.0);
        let name = format!(", energy within {per_cent} %");
        choices.push((name, pilots.iter().map(within).collect()));
    }
    let mut scores = Vec::new();
    for (limit, tunings) in choices {
        let tables: Vec<AttenuationTable> = tunings.iter().map(|t| table.tuned(*t)).collect();
        let moments = set.exact_each(&tables);
        let ln: f32 = tables.iter().map(|t| (t.scale / table.scale).ln()).sum();
        let scale = (ln / tables.len().max(1) as f32).exp();
        let name = format!("{name}{limit}");
        scores.push(Score::new(
            &name,
            Some(scale),
            &set.losses_of(&moments),
            beta,
        ));
    }
    Ok(scores)
}

/// Runs a pilot of a table on a crop, for a render of `samples` samples per pixel.
fn pilot(crop: &Crop, table: &AttenuationTable, samples: u32) -> Result<Pilot, DatasetError> {
    let settings = crop.settings(Rule::with_table(table.clone()));
    tune::choose(&settings, &crop.view(), samples).map_err(|e| crop.outside(e))
}

/// The families of the training scenes, in order.
pub fn families(session: &Session) -> Vec<String> {
    let mut families: Vec<String> = Vec::new();
    for crop in session.training.crops() {
        if !families.contains(&crop.family) {
            families.push(crop.family.clone());
        }
    }
    families
}

/// Learns from all families but one and scores on that one. The scores do not depend on families that were held out
/// before. `None` for the only family, and if `listen`, which is called at every step, ends it.
pub fn hold_out(
    session: &mut Session,
    beta: f32,
    family: &str,
    listen: &dyn Fn() -> ControlFlow<()>,
) -> Result<Option<HeldOut>, TrainError> {
    let mut held = session.training.remove(|crop| crop.family == family);
    let scores = if session.training.is_empty() {
        Ok(None)
    } else {
        held_out_scores(session, &mut held, beta, listen)
    };
    session.training.restore(held);
    let family = family.to_owned();
    Ok(scores?.map(|scores| HeldOut { family, scores }))
}

/// Scores on crops that were held out of a session; `None` if the listener ends it.
fn held_out_scores(
    session: &mut Session,
    held: &mut CropSet,
    beta: f32,
    listen: &dyn Fn() -> ControlFlow<()>,
) -> Result<Option<Vec<Score>>, TrainError> {
    let config = session.config.clone();
    let validation = std::mem::take(&mut session.validation);
    let elsewhere = session.training.best_constant(beta, config.lookup);
    let mut stopped = false;
    let mut learn = |model| -> Result<AttenuationTable, TrainError> {
        session.config = Config {
            model,
            validate_every: config.steps,
            ..config.clone()
        };
        let outcome = session.learn(beta, None, false, &mut |_, _, _| listen())?;
        stopped |= outcome.stopped;
        Ok(outcome.table)
    };
    let learned = learn(Model::Full).and_then(|full| Ok((full, learn(Model::Additive)?)));
    session.config = config.clone();
    session.validation = validation;
    let (full, additive) = learned?;
    if stopped {
        return Ok(None);
    }
    let tables = [("full table", &full), ("additive table", &additive)];
    let own = held.best_constant(beta, config.lookup);
    let mut scores = scores(held, beta, own, elsewhere, &tables, true);
    for (name, table) in tables {
        let half = format!("{name}, half its contrast");
        let softened = table.tuned(TableTuning {
            scale: 1.0,
            contrast: 0.5,
        });
        scores.push(score(held, beta, &half, None, &softened));
        let name = format!("{name}, pilot's scale and contrast");
        scores.extend(piloted(held, beta, &name, table, config.spp)?);
    }
    Ok(Some(scores))
}
