//! Wall time and CPU time.

use cpu_time::ProcessTime;
use std::time::Instant;

/// Time by both clocks since it was started.
pub struct Stopwatch {
    wall: Instant,
    cpu: Option<ProcessTime>,
}

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self {
            cpu: ProcessTime::try_now().ok(),
            wall: Instant::now(),
        }
    }

    /// Seconds of wall time, and of CPU time of all threads, past ones too; wall time if there is no CPU clock.
    pub fn seconds(&self) -> (f64, f64) {
        let wall = self.wall.elapsed().as_secs_f64();
        let cpu = self.cpu.and_then(|cpu| cpu.try_elapsed().ok());
        (wall, cpu.map_or(wall, |cpu| cpu.as_secs_f64()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The scheduler's own figures in `/proc` are zero on kernels that do not keep them; this clock always runs. The
    /// loop ends when the clock has moved, so that no length of time is assumed.
    #[test]
    fn stopwatch_measures_wall_and_cpu_time() {
        let watch = Stopwatch::start();
        let mut x = 1.0f64;
        let (wall, cpu) = loop {
            for _ in 0..1_000_000 {
                x = std::hint::black_box(x.sqrt() + 1.0);
            }
            let (wall, cpu) = watch.seconds();
            if cpu > 0.0 {
                break (wall, cpu);
            }
        };
        let later = watch.seconds();
        assert!(wall > 0.0 && later.0 >= wall && later.1 >= cpu);
    }
}
