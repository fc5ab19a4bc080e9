//! What a table is worth: against constant factors, on crops that it was not learned from, with its level free.

use super::TrainError;
use super::config::Config;
use super::learn::crop_set::CropSet;
use super::learn::model::Model;
use super::learn::objective::CropLoss;
use super::learn::session::Session;
use crate::regularise::{AttenuationTable, Lookup};
use crate::tune::{CONTRASTS, Change, Pilot};
use serde::Serialize;
use std::ops::ControlFlow;

/// Loss of one way to roughen on some crops.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// Which way.
    pub name: String,
    /// Its constant factor, or the scale of its table, if it has one; the geometric mean where crops have their own.
    pub value: Option<f32>,
    /// Mean loss of the crops.
    pub loss: f32,
    /// Sum of the crops' means over the sum of their references', each crop scaled alike.
    pub energy: f32,
}

/// Scores on a family of scenes that was held out.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct HeldOut {
    /// The family.
    pub family: String,
    /// The scores; the first is the best constant of the family itself, which a user cannot know.
    pub scores: Vec<Score>,
}

/// Steps of a search by golden section.
const GOLDEN_STEPS: usize = 6;

/// Where `loss` is smallest in [`low`, `high`]: a scan of 16 steps, then golden section between the neighbours of the
/// best.
fn minimise(low: f64, high: f64, mut loss: impl FnMut(f64) -> f64) -> f64 {
    const SCAN: usize = 16;
    let at = |i: usize| low + (high - low) * i as f64 / SCAN as f64;
    let scores: Vec<f64> = (0..=SCAN).map(|i| loss(at(i))).collect();
    let best = (0..=SCAN)
        .min_by(|&a, &b| scores[a].total_cmp(&scores[b]))
        .unwrap_or(0);
    let (mut a, mut b) = (at(best.saturating_sub(1)), at((best + 1).min(SCAN)));
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let (mut x, mut y) = (b - golden * (b - a), a + golden * (b - a));
    let (mut fx, mut fy) = (loss(x), loss(y));
    for _ in 0..GOLDEN_STEPS {
        if fx < fy {
            (b, y, fy) = (y, x, fx);
            x = b - golden * (b - a);
            fx = loss(x);
        } else {
            (a, x, fx) = (x, y, fy);
            y = a + golden * (b - a);
            fy = loss(y);
        }
    }
    let (value, found) = if fx < fy { (x, fx) } else { (y, fy) };
    if found < scores[best] {
        value
    } else {
        at(best)
    }
}

/// A table of one factor.
fn constant(gamma: f32, lookup: Lookup) -> AttenuationTable {
    AttenuationTable {
        lookup,
        ..AttenuationTable::constant(gamma)
    }
}

/// The best single factor for a set of crops.
pub fn best_constant(set: &mut CropSet, beta: f32, lookup: Lookup) -> f32 {
    let ln = minimise(
        f64::from(super::evaluate::grid::GAMMA_MIN).ln(),
        0.0,
        |ln| {
            let loss = set.constant_loss(beta, ln.exp() as f32, lookup);
            f64::from(loss.unwrap_or(0.0))
        },
    );
    ln.exp() as f32
}

/// The best scale of a table for a set of crops, between 1/32 and 32.
pub fn best_scale(set: &mut CropSet, beta: f32, table: &AttenuationTable) -> f32 {
    let ln = minimise(-(32f64.ln()), 32f64.ln(), |ln| {
        let loss = set.loss(beta, &scaled(table, ln.exp() as f32));
        f64::from(loss.unwrap_or(0.0))
    });
    ln.exp() as f32
}

/// The contrasts that a pilot tries, each with its best scale and the loss there.
fn best_changes(set: &mut CropSet, beta: f32, table: &AttenuationTable) -> [(f32, Change); 3] {
    CONTRASTS.map(|contrast| {
        let scale = best_scale(set, beta, &table.with_contrast(contrast));
        let change = Change { contrast, scale };
        let loss = set.loss(beta, &change.of(table));
        (loss.unwrap_or(0.0), change)
    })
}

fn scaled(table: &AttenuationTable, scale: f32) -> AttenuationTable {
    AttenuationTable {
        scale: table.scale * scale,
        ..table.clone()
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
    let losses = set.losses(table);
    Score {
        name: name.into(),
        value,
        loss: super::learn::crop_set::mean_loss(&losses, beta).unwrap_or(f32::NAN),
        energy: energy(&losses),
    }
}

fn energy(losses: &[CropLoss]) -> f32 {
    losses.iter().map(|l| l.energy).sum::<f32>() / losses.len().max(1) as f32
}

/// Scores of tables beside constants: the best one of the crops themselves, and one chosen elsewhere; in `hindsight`
/// also with the change to each table that suits the crops best.
pub fn scores(
    set: &mut CropSet,
    beta: f32,
    own: f32,
    elsewhere: f32,
    tables: &[(&str, &AttenuationTable)],
    hindsight: bool,
) -> Vec<Score> {
    let lookup = tables.first().map_or(Lookup::Nearest, |t| t.1.lookup);
    let mut all = vec![
        score(
            set,
            beta,
            "best constant of these crops",
            Some(own),
            &constant(own, lookup),
        ),
        score(
            set,
            beta,
            "constant of the training crops",
            Some(elsewhere),
            &constant(elsewhere, lookup),
        ),
    ];
    for (name, table) in tables {
        all.push(score(set, beta, name, None, table));
        if !hindsight {
            continue;
        }
        let changes = best_changes(set, beta, table);
        let mut best = changes[0];
        for change in changes {
            if change.0 < best.0 {
                best = change;
            }
        }
        for (what, change) in [("scale", changes[0].1), ("scale and contrast", best.1)] {
            let name = format!("{name}, best {what}");
            let scale = Some(change.scale);
            all.push(score(set, beta, &name, scale, &change.of(table)));
        }
    }
    all
}

/// Scores of a table that a pilot changes for every crop, without its reference, for renders of `samples` samples per
/// pixel: by what it chooses, and by what it would if the picture's mean may change by some per cent at most.
pub fn piloted(
    set: &mut CropSet,
    beta: f32,
    name: &str,
    table: &AttenuationTable,
    samples: u32,
) -> Result<Vec<Score>, TrainError> {
    let pilots = (set.crops())
        .map(|crop| crop.pilot(table, samples))
        .collect::<Result<Vec<Pilot>, _>>()?;
    let mut scores = Vec::new();
    let mut choices = vec![(
        String::new(),
        pilots.iter().map(|p| p.change).collect::<Vec<_>>(),
    )];
    for per_cent in [3, 10] {
        let within = |pilot: &Pilot| pilot.within(f64::from(per_cent) / 100.0);
        let name = format!(", energy within {per_cent} %");
        choices.push((name, pilots.iter().map(within).collect()));
    }
    for (what, changes) in choices {
        let tables: Vec<AttenuationTable> = changes.iter().map(|c| c.of(table)).collect();
        let moments = set.exact_each(&tables);
        let losses = set.losses_of(&moments);
        let ln: f32 = tables.iter().map(|t| (t.scale / table.scale).ln()).sum();
        scores.push(Score {
            name: format!("{name}{what}"),
            value: Some((ln / tables.len().max(1) as f32).exp()),
            loss: super::learn::crop_set::mean_loss(&losses, beta).unwrap_or(f32::NAN),
            energy: energy(&losses),
        });
    }
    Ok(scores)
}

/// Learns from all families but one, and scores on that one; for every family of the training scenes.
///
/// `listen` is told of every family before it is held out, and can end the study.
pub fn leave_one_out(
    session: &mut Session,
    beta: f32,
    listen: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Vec<HeldOut>, TrainError> {
    let mut families: Vec<String> = Vec::new();
    for crop in session.training.crops() {
        if !families.contains(&crop.family) {
            families.push(crop.family.clone());
        }
    }
    let config = session.config.clone();
    let mut all = Vec::new();
    for family in families {
        if listen(&family).is_break() {
            break;
        }
        let mut held = session.training.take(|crop| crop.family == family);
        if session.training.is_empty() {
            session.training.append(held);
            continue;
        }
        let validation = std::mem::take(&mut session.validation);
        let elsewhere = best_constant(&mut session.training, beta, config.lookup);
        let mut learn = |model| -> Result<AttenuationTable, TrainError> {
            session.config = Config {
                model,
                validate_every: config.steps,
                ..config.clone()
            };
            let outcome =
                session.learn(beta, None, false, &mut |_, _, _| ControlFlow::Continue(()))?;
            Ok(outcome.table)
        };
        let learned = learn(Model::Full).and_then(|full| Ok((full, learn(Model::Additive)?)));
        session.config = config.clone();
        session.validation = validation;
        let (full, additive) = learned?;
        let tables = [("full table", &full), ("additive table", &additive)];
        let own = best_constant(&mut held, beta, config.lookup);
        let mut scores = scores(&mut held, beta, own, elsewhere, &tables, true);
        for (name, table) in tables {
            // What little is known of a scene: halfway to one factor.
            let half = format!("{name}, half its contrast");
            scores.push(score(
                &mut held,
                beta,
                &half,
                None,
                &table.with_contrast(0.5),
            ));
            let name = format!("{name}, pilot's scale and contrast");
            scores.extend(piloted(&mut held, beta, &name, table, config.spp)?);
        }
        session.training.append(held);
        all.push(HeldOut { family, scores });
    }
    Ok(all)
}
