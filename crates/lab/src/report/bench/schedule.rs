//! Time points at which a run records its errors, and lengths of the passes between them.

use super::results::Point;
use super::suite::Suite;

/// The time points of a suite that a run has not yet reached.
pub(super) struct Schedule<'a> {
    suite: &'a Suite,
    threads: usize,
    times: usize,
    samples: usize,
}

impl<'a> Schedule<'a> {
    pub(super) fn new(suite: &'a Suite, threads: usize) -> Self {
        Self {
            suite,
            threads,
            times: 0,
            samples: 0,
        }
    }

    /// The sample number at which the next pass ends; `None` after the last time point.
    ///
    /// The first pass has one sample: it gives the first point of the curve and the time per sample.
    pub(super) fn next(&self, now: &Point) -> Option<u32> {
        let (time, samples) = self.ahead();
        if time.is_none() && samples.is_none() {
            return None;
        }
        let seconds = self.suite.clock.seconds(now, self.threads);
        let by_time = match time {
            _ if now.samples == 0 => 1.0,
            Some(t) => ((t - seconds) * f64::from(now.samples) / seconds.max(1e-9)).ceil(),
            None => f64::INFINITY,
        };
        // A prediction from n samples is good enough for n more.
        let length = (by_time.clamp(1.0, f64::from(now.samples.max(1)))) as u32;
        let end = now.samples.saturating_add(length);
        Some(samples.map_or(end, |s| end.min(s)))
    }

    /// True if errors are to be recorded now. Drops the time points that are reached.
    pub(super) fn crossed(&mut self, now: &Point) -> bool {
        let seconds = self.suite.clock.seconds(now, self.threads);
        let before = (self.times, self.samples);
        while self.ahead().0.is_some_and(|t| seconds >= t) {
            self.times += 1;
        }
        while self.ahead().1.is_some_and(|s| now.samples >= s) {
            self.samples += 1;
        }
        now.samples == 1 || before != (self.times, self.samples)
    }

    fn ahead(&self) -> (Option<f64>, Option<u32>) {
        (
            self.suite.times.get(self.times).copied(),
            self.suite.samples.get(self.samples).copied(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    /// Simulates a run whose samples take `cost` seconds each; returns the recorded (samples, seconds) and the passes.
    fn play(times: &str, samples: &str, cost: f64) -> (Vec<(u32, f64)>, u32) {
        let suite = Suite::parse(&format!(
            "times = {times}\nsamples = {samples}\n\
             [[scene]]\nname = 's'\nbuiltin = 'plane'\nsize = [4, 4]\nreference_spp = 1\n\
             [[method]]\nname = 'm'\n"
        ))
        .unwrap();
        let mut schedule = Schedule::new(&suite, 1);
        let mut now = Point {
            samples: 0,
            wall: 0.0,
            cpu: 0.0,
            errors: BTreeMap::new(),
        };
        let (mut seen, mut passes) = (Vec::new(), 0);
        while let Some(end) = schedule.next(&now) {
            assert!(end > now.samples);
            now.wall += cost * f64::from(end - now.samples);
            now.samples = end;
            passes += 1;
            if schedule.crossed(&now) {
                seen.push((now.samples, now.wall));
            }
        }
        (seen, passes)
    }

    #[test]
    fn passes_end_at_the_time_points() {
        let (seen, passes) = play("[0.5, 1.0, 4.0]", "[4, 16]", 1.0 / 1024.0);
        let samples: Vec<u32> = seen.iter().map(|s| s.0).collect();
        assert_eq!(samples, [1, 4, 16, 512, 1024, 4096]);
        assert!(passes < 30, "{passes}");
        // A sample takes longer than the first time points.
        let (seen, _) = play("[0.5, 1.0, 4.0]", "[]", 1.5);
        assert_eq!(seen, [(1, 1.5), (3, 4.5)]);
        // Samples only.
        assert_eq!(play("[]", "[3]", 1.0).0, [(1, 1.0), (3, 3.0)]);
    }
}
