//! Tables on families of scenes that they were not learned from: holds each family out once, learns from the others, and
//! scores on it, beside constants.
//!
//! ```sh
//! cargo run --release --example study                          # the fast preset: minutes
//! cargo run --release --example study -- spp=256 steps=80 'beta=[0.001, 0.05]'
//! ```
//!
//! Arguments are settings of a training (`docs/training.md`) on top of the preset `fast`.

use opsr_train::config::Preset;
use opsr_train::score::{Score, scores};
use opsr_train::{Config, RecordingControl, Session, TrainError};
use std::error::Error;
use std::ops::ControlFlow;

/// Scores on a family of scenes that was held out.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct HeldOut {
    /// The family.
    pub(crate) family: String,
    /// The scores. The first is the best constant of the family itself, which a user cannot know.
    pub(crate) scores: Vec<Score>,
}

/// The families of the training scenes, in order.
fn families(session: &Session) -> Vec<String> {
    let mut families: Vec<String> = Vec::new();
    for crop in session.training.crops() {
        if !families.contains(&crop.family) {
            families.push(crop.family.clone());
        }
    }
    families
}

/// Learns from all families but one and scores on that one; `None` for the only family. The scores do not depend on
/// families that were held out before.
fn hold_out(session: &mut Session, beta: f32, family: &str) -> Result<Option<HeldOut>, TrainError> {
    let mut held = session.training.remove(|crop| crop.family == family);
    if session.training.is_empty() {
        session.training.restore(held);
        return Ok(None);
    }
    let lookup = session.config.lookup;
    let elsewhere = session.training.best_constant(beta, lookup);
    let outcome = session.learn(beta, None, false, &mut |_, _, _| ControlFlow::Continue(()))?;
    let own = held.best_constant(beta, lookup);
    let tables = [("learned table", &outcome.table)];
    let scores = scores(&mut held, beta, own, elsewhere, &tables, true);
    session.training.restore(held);
    let family = family.to_owned();
    Ok(Some(HeldOut { family, scores }))
}

/// Holds every family out once, for each β.
pub(crate) fn study(config: Config) -> Result<Vec<(f32, Vec<HeldOut>)>, TrainError> {
    let mut session = Session::open(config, &RecordingControl::default())?;
    // Validations choose nothing here.
    session.validation = Default::default();
    session.config.validate_every = session.config.steps;
    let mut all = Vec::new();
    for beta in session.config.beta.clone() {
        let mut held_out = Vec::new();
        for family in families(&session) {
            held_out.extend(hold_out(&mut session, beta, &family)?);
        }
        all.push((beta, held_out));
    }
    Ok(all)
}

/// Geometric mean over the families of the loss of score number `i` over that of the best constant.
fn mean_ratio(held_out: &[HeldOut], i: usize) -> f32 {
    let ratio = |h: &HeldOut| (h.scores[i].loss / h.scores[0].loss).ln();
    (held_out.iter().map(ratio).sum::<f32>() / held_out.len() as f32).exp()
}

/// The scores as text: a line for each table, a column for each family.
pub(crate) fn text(beta: f32, held_out: &[HeldOut]) -> String {
    let Some(first) = held_out.first() else {
        return format!("beta {beta}: one family alone cannot be held out\n");
    };
    let mut text =
        format!("beta {beta}: loss over that of the best constant of the family, energy\n");
    text += &format!("{:34}", "");
    for h in held_out {
        text += &format!("{:>16}", h.family);
    }
    text += &format!("{:>10}\n", "mean");
    for (i, score) in first.scores.iter().enumerate() {
        text += &format!("{:34}", score.name);
        for h in held_out {
            let ratio = h.scores[i].loss / h.scores[0].loss;
            text += &format!("{:>9.3} {:>6.3}", ratio, h.scores[i].energy);
        }
        text += &format!("{:>10.3}\n", mean_ratio(held_out, i));
    }
    text
}

fn main() -> Result<(), Box<dyn Error>> {
    let settings = std::env::args().skip(1);
    let config = settings
        .into_iter()
        .try_fold(Config::from(Preset::Fast), |config, setting| {
            config.with_setting(&setting)
        })?;
    for (beta, held_out) in study(config)? {
        print!("{}", text(beta, &held_out));
    }
    Ok(())
}
