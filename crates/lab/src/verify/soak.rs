//! Soak tests: bounded memory, and bit-identical results.

use super::{Finding, repeat};
use std::time::{Duration, Instant};

/// Resident memory of the process in bytes; `None` if the system does not report it (other than Linux).
fn resident() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some(1024.0 * kilobytes)
}

/// Growth of memory in per cent, from the least of the second third to that of the last. The first third fills pools.
pub fn growth(resident: &[f64]) -> f64 {
    let third = resident.len() / 3;
    let least = |part: &[f64]| part.iter().copied().fold(f64::INFINITY, f64::min);
    let (early, late) = (&resident[third..2 * third], &resident[2 * third..]);
    100.0 * (least(late) / least(early) - 1.0)
}

/// Most rounds that distinguish a leak from an allocator that settles.
const MAX_ROUNDS: usize = 36;

/// Repeats rounds of loading a scene, rendering it with every estimator, saving and loading its checkpoint, and
/// learning a table, for this time and at least nine times. Finds growing memory, and bytes that differ between rounds.
/// Memory that grows too much gets more rounds: a leak grows on, an allocator under load settles.
pub fn run(time: Duration) -> Vec<Finding> {
    let mut all = Vec::new();
    #[cfg(feature = "train")]
    all.extend(learner());
    let clock = Instant::now();
    // The allocator settles in the first minutes.
    let bound = |clock: &Instant| {
        if clock.elapsed().as_secs() < 600 {
            10.0
        } else {
            1.0
        }
    };
    let (mut memory, mut first, mut changed) = (Vec::new(), None, 0);
    let mut rounds = 0;
    while rounds < 9
        || clock.elapsed() < time
        || (rounds < MAX_ROUNDS && growth(&memory) > bound(&clock))
    {
        let round = match repeat::round() {
            Ok(round) => round,
            Err(error) => return vec![Finding::failed(error)],
        };
        changed += u32::from(*first.get_or_insert_with(|| round.clone()) != round);
        memory.extend(resident());
        rounds += 1;
    }
    let seconds = clock.elapsed().as_secs();
    all.push(Finding::new(
        format!("{seconds} s: rounds whose bytes differ from the first's"),
        0.0,
        [f64::from(changed)],
    ));
    if memory.is_empty() {
        return all;
    }
    let megabytes = memory.iter().copied().fold(0.0, f64::max) / 1e6;
    all.push(Finding::new(
        format!("growth of memory in per cent, {rounds} rounds, {megabytes:.0} MB"),
        bound(&clock),
        [growth(&memory).max(0.0)],
    ));
    all
}

/// Growth of memory over steps of the optimiser: a training has far more of them than a round.
#[cfg(feature = "train")]
fn learner() -> Option<Finding> {
    use opsr::regularise::{LEN, Lookup};
    use opsr_train::config::Optimiser;
    use opsr_train::learn::model::Learner;
    let mut learner = Learner::new(Optimiser::Adam, 0.01, Lookup::default(), 0.5);
    let memory = (0..9).map(|_| {
        for _ in 0..300 {
            learner.step(&[1.0; LEN]);
        }
        resident()
    });
    let memory: Option<Vec<f64>> = memory.collect();
    Some(Finding::new(
        "growth of memory in per cent, 2,700 steps of the optimiser",
        2.0,
        [growth(&memory?).max(0.0)],
    ))
}
