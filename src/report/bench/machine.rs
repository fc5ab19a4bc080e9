//! The machine, its clocks and its memory.

use std::fs;
use std::time::Instant;

use cpu_time::ProcessTime;
use serde::{Deserialize, Serialize};

/// Machine of a bench.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Machine {
    /// The processor's name.
    pub cpu: String,
    /// Threads that the system offers.
    pub cores: usize,
    /// Threads that rendered.
    pub threads: usize,
    /// Operating system and architecture.
    pub system: String,
}

impl Machine {
    /// This machine.
    pub fn this() -> Self {
        let cpu = fs::read_to_string("/proc/cpuinfo")
            .ok()
            .and_then(|text| {
                let line = text.lines().find(|l| l.starts_with("model name"))?;
                Some(line.split_once(':')?.1.trim().to_owned())
            })
            .unwrap_or_else(|| "unknown".to_owned());
        Self {
            cpu,
            cores: std::thread::available_parallelism().map_or(1, usize::from),
            threads: rayon::current_num_threads(),
            system: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        }
    }
}

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

    /// Seconds of wall time, and of CPU time over all threads, ended ones too; wall time where the system does not tell.
    pub fn seconds(&self) -> (f64, f64) {
        let wall = self.wall.elapsed().as_secs_f64();
        let cpu = self.cpu.and_then(|cpu| cpu.try_elapsed().ok());
        (wall, cpu.map_or(wall, |cpu| cpu.as_secs_f64()))
    }
}

/// Memory of this process in MiB.
pub fn memory() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmRSS:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The scheduler's own figures in `/proc` are zero on kernels that do not keep them; this clock always runs. No
    /// length of time is asked for: the loop ends when the clock has moved.
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
