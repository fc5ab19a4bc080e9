//! Mutated files: every reader answers with an error or with something sane, never with a panic, a flood of memory or a
//! message that does not name its file.
//!
//! Execution `i` of a target depends on nothing but its name and `i`, so a failure is found again by its number. The
//! short tier always runs; `cargo test --release fuzz::long -- --ignored` runs `OPSR_FUZZ_EXECUTIONS` of each target,
//! from `OPSR_FUZZ_FROM` on, or only of the targets named in `OPSR_FUZZ_TARGETS`. Files worth keeping are in
//! `tests/corpus`.

mod corpus;
pub(crate) mod mutate;
mod repair;
pub(crate) mod seeds;
mod targets;
#[cfg(feature = "train")]
mod trained;

use mutate::{Rng, mutated};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

/// A reader under test.
pub(crate) struct Target {
    /// Its name, and that of its folder in the corpus.
    pub(crate) name: &'static str,
    /// Name of the file that it reads; its ending may matter.
    pub(crate) file: &'static str,
    /// Good files.
    pub(crate) seeds: Vec<Vec<u8>>,
    /// Sets lengths and checksums right that a change has broken.
    pub(crate) repair: fn(Vec<u8>) -> Vec<u8>,
    /// Reads the file, checks what comes of it, and says in a few words what was taken.
    pub(crate) read: fn(&Path) -> Result<String, String>,
}

/// The most memory that this process may ever have held, in KiB. The targets need 30 MiB; other tests run beside them.
const MOST_KIB: u64 = 1 << 20;

/// The most memory that this process has held so far, in KiB; 0 where the system does not tell.
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    line.and_then(|l| l.trim().trim_end_matches(" kB").parse().ok())
        .unwrap_or(0)
}

/// Executions `from..from + count`; the share of files that were taken.
fn fuzz(target: &Target, from: u64, count: u64) -> f64 {
    let folder = crate::support::quick_folder();
    let path = folder.path().join(target.file);
    for seed in &target.seeds {
        std::fs::write(&path, seed).expect("a file");
        (target.read)(&path).expect("the seeds are good");
    }
    let mut taken = 0;
    for i in from..from + count {
        let mut rng = Rng::new(target.file, i);
        let mut bytes = mutated(&mut rng, &target.seeds);
        if rng.below(4) > 0 {
            bytes = (target.repair)(bytes);
        }
        std::fs::write(&path, &bytes).expect("a file");
        let outcome = catch_unwind(AssertUnwindSafe(|| (target.read)(&path)));
        let fault = match outcome {
            Err(_) => Some("a panic".to_owned()),
            Ok(Err(message)) if !message.contains(target.file) => {
                Some(format!("no file in `{message}`"))
            }
            Ok(Err(message)) if message.len() > 4000 => {
                Some(format!("{} bytes of message", message.len()))
            }
            Ok(outcome) => {
                taken += u64::from(outcome.is_ok());
                None
            }
        };
        let fault = fault.or_else(|| {
            let peak = peak_kib();
            (peak > MOST_KIB).then(|| format!("{peak} KiB of memory"))
        });
        if let Some(fault) = fault {
            let kept = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(target.file);
            std::fs::write(&kept, &bytes).expect("a file");
            panic!("{} {i}: {fault}; kept as {}", target.file, kept.display());
        }
    }
    taken as f64 / count.max(1) as f64
}

/// The short tier. If nearly all files are refused, or nearly none, the changes are of the wrong size.
fn short(target: &Target, count: u64) {
    let taken = fuzz(target, 0, count);
    assert!((0.02..0.98).contains(&taken), "{taken} were taken");
}

#[test]
fn gltf() {
    short(&targets::gltf(), 1500);
}

#[test]
fn exr() {
    short(&targets::exr(), 1500);
}

#[test]
fn hdr() {
    short(&targets::hdr(), 1000);
}

#[test]
fn png() {
    short(&targets::png(), 500);
}

#[test]
fn tables() {
    short(&targets::tables(), 600);
}

#[test]
fn manifests() {
    short(&targets::manifests(), 600);
}

#[test]
fn suites() {
    short(&targets::suites(), 600);
}

#[test]
fn checkpoints() {
    short(&targets::checkpoints(), 600);
}

#[test]
fn textures() {
    short(&targets::textures(), 500);
}

#[test]
fn results() {
    short(&targets::results(), 200);
}

#[test]
#[cfg(feature = "train")]
fn configurations() {
    short(&trained::configurations(), 600);
}

#[test]
#[cfg(feature = "train")]
fn trainings() {
    short(&trained::trainings(), 600);
}

#[test]
#[ignore = "long: OPSR_FUZZ_EXECUTIONS of each target, 20000 if not set"]
fn long() {
    let number = |name: &str, or: u64| match std::env::var(name) {
        Ok(text) => text.parse().expect("a number"),
        Err(_) => or,
    };
    let (from, count) = (
        number("OPSR_FUZZ_FROM", 0),
        number("OPSR_FUZZ_EXECUTIONS", 20_000),
    );
    let only = std::env::var("OPSR_FUZZ_TARGETS").unwrap_or_default();
    for target in targets::all() {
        if !only.is_empty() && !only.split(',').any(|name| name == target.name) {
            continue;
        }
        let taken = fuzz(&target, from, count);
        println!("{}: {count} executions, {taken:.3} taken", target.file);
        println!("at most {} KiB of memory so far", peak_kib());
    }
}
