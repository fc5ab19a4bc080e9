//! Seconds of one optimiser step and of the recording, and the memory, of both evaluations of the loss.
//!
//! `cargo bench --bench training [-- SPP [SCENE ...]]`; by default 64 samples of `cornell_caustics`. The two
//! evaluations take turns, so that a drifting clock of the machine favours none.

use opsr_train::config::{Config, Evaluation, Optimiser};
use opsr_train::{RecordingControl, Session};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

const BETA: f32 = 0.001;

/// Rounds, and steps of each evaluation in a round.
const ROUNDS: usize = 5;
const STEPS: u32 = 10;

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1).filter(|w| !w.starts_with("--"));
    let spp = words.next().map_or(Ok(64), |w| w.parse())?;
    let mut scenes: Vec<String> = words.collect();
    if scenes.is_empty() {
        scenes.push("cornell_caustics".into());
    }
    println!(
        "{spp} samples per pixel of {}, {} threads",
        scenes.join(", "),
        rayon::current_num_threads()
    );
    let evaluations = [
        ("replay", Evaluation::Replay),
        ("tabulated", Evaluation::Tabulated),
    ];
    let mut sessions = Vec::new();
    for (name, method) in evaluations {
        let config = Config {
            manifest: Path::new(env!("CARGO_MANIFEST_DIR"))
                .join("../../training_scenes/manifest.toml"),
            scenes: scenes.clone(),
            spp,
            steps: STEPS,
            optimiser: Optimiser::Log,
            start: 0.1,
            method,
            validate_every: 2 * STEPS,
            ..Config::default()
        };
        let mut session = Session::open(config, &RecordingControl::default())?;
        session.validation = Default::default();
        println!(
            "{name}: prepared in {:.2} s, {:.1} MB",
            session.seconds,
            session.training.bytes() as f64 / 1e6
        );
        sessions.push((name, session, Vec::new()));
    }
    for _ in 0..ROUNDS {
        for (_, session, times) in &mut sessions {
            let mut clock = None;
            session.learn(BETA, None, false, &mut |step, _, _| {
                let now = Instant::now();
                // The first step linearises and validates all crops.
                if let Some(before) = clock.replace(now)
                    && step > 1
                    && step < STEPS
                {
                    times.push(now.duration_since(before).as_secs_f64());
                }
                ControlFlow::Continue(())
            })?;
        }
    }
    let medians: Vec<f64> = sessions.iter_mut().map(|s| median(&mut s.2)).collect();
    for ((name, _, times), step) in sessions.iter().zip(&medians) {
        println!(
            "{name}: a step takes {:.2} ms (quartiles {:.2} to {:.2}), {:.2} of a replayed one",
            step * 1e3,
            times[times.len() / 4] * 1e3,
            times[times.len() * 3 / 4] * 1e3,
            step / medians[0]
        );
    }
    Ok(())
}
