//! Fuzz tests of every file reader: a mutated file gives an error that names the file, or a value that passes the
//! reader's checks; never a panic, and never more than a bounded amount of memory.
//!
//! Execution `i` of a target depends only on the target's file name and on `i`, so a failure is reproduced by its
//! number. A short tier runs with every `cargo test`. `cargo test --release fuzz_long -- --ignored` runs
//! `OPSR_FUZZ_EXECUTIONS` executions of each target, starting with number `OPSR_FUZZ_FROM`; `OPSR_FUZZ_TARGETS` lists
//! the targets to run, separated by commas. Files worth keeping are in `tests/corpus`.

mod corpus;
pub(crate) mod mutate;
pub(crate) mod repair;
pub(crate) mod seeds;
mod targets;
#[cfg(feature = "train")]
mod trained;

use mutate::{Rng, mutated};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// A file reader under test.
pub(crate) struct Target {
    /// Name of the target and of its folder in the corpus.
    pub(crate) name: &'static str,
    /// Name of the file that the reader is given; some readers depend on its extension.
    pub(crate) file_name: &'static str,
    /// Valid files.
    pub(crate) seeds: Vec<Vec<u8>>,
    /// Corrects lengths and checksums after a mutation, so that the reader gets past them.
    pub(crate) repair: fn(Vec<u8>) -> Vec<u8>,
    /// Reads the file, asserts that what it accepted is sane, and summarises it in a few words.
    pub(crate) read: fn(&Path) -> Result<String, String>,
}

impl Target {
    /// Input of execution `i`: a mutated seed, repaired three times out of four.
    fn input(&self, i: u64) -> Vec<u8> {
        let mut rng = Rng::new(self.file_name, i);
        let bytes = mutated(&mut rng, &self.seeds);
        if rng.below(4) > 0 {
            (self.repair)(bytes)
        } else {
            bytes
        }
    }
}

/// Limit on the peak memory of this process, in KiB. The targets need 30 MiB; other tests run in the same process.
const MAX_KIB: u64 = 1 << 20;

/// Peak resident memory of this process in KiB; 0 if the system does not report it.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").parse().ok())
        .unwrap_or(0)
}

/// Number in an environment variable; `default` if it is not set.
fn env_number(name: &str, default: u64) -> u64 {
    std::env::var(name).map_or(default, |text| text.parse().expect("a number"))
}

/// Targets named in `OPSR_FUZZ_TARGETS`; all targets if it is not set.
fn selected() -> Vec<Target> {
    let names = std::env::var("OPSR_FUZZ_TARGETS").unwrap_or_default();
    let mut targets = targets::all();
    targets.extend(targets::foreign());
    targets.retain(|target| names.is_empty() || names.split(',').any(|name| name == target.name));
    targets
}

/// Runs executions `from..from + count` and returns the fraction of inputs that the reader accepted.
fn fuzz(target: &Target, from: u64, count: u64) -> f64 {
    let folder = crate::support::quick_folder();
    let path = folder.path().join(target.file_name);
    for seed in &target.seeds {
        std::fs::write(&path, seed).expect("a file");
        (target.read)(&path).expect("the seeds are valid");
    }
    let mut accepted = 0;
    for i in from..from + count {
        let bytes = target.input(i);
        std::fs::write(&path, &bytes).expect("a file");
        let outcome = catch_unwind(AssertUnwindSafe(|| (target.read)(&path)));
        let fault = match outcome {
            Err(_) => Some("a panic".to_owned()),
            Ok(Err(message)) if !message.contains(target.file_name) => {
                Some(format!("no file in `{message}`"))
            }
            Ok(Err(message)) if message.len() > 4000 => {
                Some(format!("{} bytes of message", message.len()))
            }
            Ok(outcome) => {
                accepted += u64::from(outcome.is_ok());
                None
            }
        };
        let fault = fault.or_else(|| {
            let peak = peak_kib();
            (peak > MAX_KIB).then(|| format!("{peak} KiB of memory"))
        });
        if let Some(fault) = fault {
            let kept = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(target.file_name);
            std::fs::write(&kept, &bytes).expect("a file");
            let (name, kept) = (target.file_name, kept.display());
            panic!("{name}, execution {i}: {fault}; input kept as {kept}");
        }
    }
    accepted as f64 / count.max(1) as f64
}

/// Runs the first `count` executions. If nearly all inputs are accepted, or nearly none, the mutations are of the wrong
/// size.
fn short(target: &Target, count: u64) {
    let accepted = fuzz(target, 0, count);
    assert!((0.02..0.98).contains(&accepted), "{accepted} accepted");
}

#[test]
fn fuzz_seeds_are_reproducible() {
    for (first, second) in targets::all().iter().zip(targets::all()) {
        assert!(first.seeds == second.seeds, "{}", first.name);
    }
}

#[test]
fn fuzz_gltf() {
    short(&targets::gltf(), 1500);
}

#[test]
fn fuzz_foreign() {
    for target in targets::foreign() {
        let accepted = fuzz(&target, 0, 500);
        assert!(
            accepted > 0.01 && accepted < 0.99,
            "{}: {accepted}",
            target.name
        );
    }
}

#[test]
fn fuzz_exr() {
    short(&targets::exr(), 1500);
}

#[test]
fn fuzz_hdr() {
    short(&targets::hdr(), 1000);
}

#[test]
fn fuzz_png() {
    short(&targets::png(), 500);
}

#[test]
fn fuzz_tables() {
    short(&targets::tables(), 600);
}

#[test]
fn fuzz_manifests() {
    short(&targets::manifests(), 600);
}

#[test]
fn fuzz_suites() {
    short(&targets::suites(), 600);
}

#[test]
fn fuzz_checkpoints() {
    short(&targets::checkpoints(), 600);
}

#[test]
fn fuzz_parts() {
    short(&targets::parts(), 600);
}

#[test]
fn fuzz_textures() {
    short(&targets::textures(), 500);
}

#[test]
fn fuzz_results() {
    short(&targets::results(), 200);
}

#[test]
#[cfg(feature = "train")]
fn fuzz_configurations() {
    short(&trained::configurations(), 600);
}

#[test]
#[cfg(feature = "train")]
fn fuzz_trainings() {
    short(&trained::trainings(), 600);
}

#[test]
#[cfg(feature = "train")]
fn fuzz_recordings() {
    short(&trained::recordings(), 600);
}

#[test]
#[ignore = "long: OPSR_FUZZ_EXECUTIONS of each target, 20000 if not set"]
fn fuzz_long() {
    let from = env_number("OPSR_FUZZ_FROM", 0);
    let count = env_number("OPSR_FUZZ_EXECUTIONS", 20_000);
    for target in selected() {
        let accepted = fuzz(&target, from, count);
        let name = target.file_name;
        println!("{name}: {count} executions, {accepted:.3} accepted");
        println!("peak memory so far: {} KiB", peak_kib());
    }
}
