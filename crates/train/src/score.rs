//! Scores of tables, compared with constant factors and with the tables' own best scales.

use crate::config::constant_table;
use crate::learn::crop_set::{CropSet, minimise};
use crate::learn::loss::mean_loss;
use opsr::regularise::{AttenuationTable, Lookup};
use serde::Serialize;

/// Loss of a table, or of a constant factor, on some crops.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Score {
    /// Name of the table.
    pub name: String,
    /// The constant factor, or the scale of the table, if there is one.
    pub value: Option<f32>,
    /// Mean loss of the crops.
    pub loss: f32,
    /// Mean over the crops of rendered mean / reference mean.
    pub energy: f32,
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
        loss: mean_loss(&losses, beta).unwrap_or(f32::NAN),
        energy: losses.iter().map(|l| l.energy).sum::<f32>() / losses.len().max(1) as f32,
    }
}

/// Scores of `own`, the best constant of these crops; of `elsewhere`, the best constant of the training crops; and of
/// `tables`. With `hindsight` each table is scored again at its best scale for these crops.
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
        let scale = best_scale(set, beta, table);
        let scaled = AttenuationTable {
            scale: table.scale * scale,
            ..(*table).clone()
        };
        let name = format!("{name}, best scale");
        all.push(score(set, beta, &name, Some(scale), &scaled));
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
