//! A table that is learned from one scene, with its loss beside that of plain path tracing.
//!
//! ```sh
//! cargo run --release --example train                       # a minute
//! ```

use opsr::AttenuationTable;
use opsr_train::config::Preset;
use opsr_train::{Config, RecordingControl, Session, TrainError};
use std::ops::ControlFlow;

/// Learns a table from the scenes of a configuration, for its first β. Returns the table and its loss over that of plain path
/// tracing on the crops that it was learned from.
pub(crate) fn learn(config: Config) -> Result<(AttenuationTable, f32), TrainError> {
    let beta = config.beta[0];
    let mut session = Session::open(config, &RecordingControl::default())?;
    // Paths are traced; from here on no ray is.
    let outcome = session.learn(beta, None, false, &mut |step, loss, log| {
        if log.is_some() {
            println!("step {step}: loss {loss:.4}");
        }
        ControlFlow::Continue(())
    })?;
    let plain = AttenuationTable::constant(0.0);
    let losses = [&outcome.table, &plain].map(|table| session.training.loss(beta, table));
    let ratio = losses[0]
        .zip(losses[1])
        .map_or(f32::NAN, |(learned, plain)| learned / plain);
    Ok((outcome.table, ratio))
}

fn main() -> Result<(), TrainError> {
    let (table, ratio) = learn(Preset::Smoke.into())?;
    let mean = table.gammas.iter().sum::<f32>() / table.gammas.len() as f32;
    println!("mean factor {mean:.3}; loss {ratio:.3} of plain path tracing");
    Ok(())
}
