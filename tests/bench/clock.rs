//! Times of small pieces of work, taken in turns, so that a drifting machine favours none.

use std::time::Instant;

/// Samples of each contestant.
const ROUNDS: usize = 51;

/// The least seconds of a sample: far above what the clock resolves and what a call costs.
const SAMPLE: f64 = 2e-3;

/// A name, the number of elements that one call works on, and the work.
pub(crate) type Contestant<'a> = (String, usize, Box<dyn Fn() + 'a>);

fn seconds(work: &dyn Fn(), calls: usize) -> f64 {
    let clock = Instant::now();
    for _ in 0..calls {
        work();
    }
    clock.elapsed().as_secs_f64()
}

/// Prints the nanoseconds of an element: median and quartiles over samples.
pub(crate) fn in_turns(contestants: &[Contestant]) {
    let calls: Vec<usize> = (contestants.iter())
        .map(|(_, _, work)| {
            let mut calls = 1;
            while seconds(work, calls) < SAMPLE {
                calls *= 2;
            }
            calls
        })
        .collect();
    let mut samples = vec![Vec::new(); contestants.len()];
    for _ in 0..ROUNDS {
        for ((samples, calls), (_, elements, work)) in
            samples.iter_mut().zip(&calls).zip(contestants)
        {
            samples.push(1e9 * seconds(work, *calls) / (calls * elements) as f64);
        }
    }
    for (samples, (name, ..)) in samples.iter_mut().zip(contestants) {
        samples.sort_by(f64::total_cmp);
        let [low, median, high] = [1, 2, 3].map(|k| samples[ROUNDS * k / 4]);
        println!(
            "{name}: {median:.2} ns (quartiles {low:.2} to {high:.2}), {:.2} million per second",
            1e3 / median
        );
    }
}
