//! Log of a render: samples, seconds and errors over time.

use super::exit::Blame;
use opsr::files::{self, FileError};
use std::path::{Path, PathBuf};

/// Most bytes of a log; a day of lines has fewer.
const MAX_BYTES: u64 = 1 << 26;

/// Names of the columns.
const HEADER: &str = "samples,seconds,estimated_error,true_error\n";

/// One line of a log.
#[derive(Clone, Copy)]
pub(super) struct Line {
    /// Samples per pixel.
    pub(super) samples: u32,
    /// Seconds, including those before the render was resumed.
    pub(super) seconds: f64,
    /// Estimated relative error.
    pub(super) estimated: f64,
    /// Error against the reference.
    pub(super) true_error: Option<f64>,
}

impl Line {
    /// The estimate, which one sample does not have.
    fn estimated(&self) -> Option<f64> {
        Some(self.estimated).filter(|e| e.is_finite())
    }
}

/// The log. Its file is replaced as a whole, so that it is never incomplete.
pub(super) struct ErrorLog {
    path: PathBuf,
    /// The lines of the file up to the samples of the checkpoint from which the render was resumed.
    earlier: Vec<u8>,
    lines: Vec<Line>,
}

impl ErrorLog {
    /// A log at this path. A render that is resumed after `start` samples keeps the lines up to these samples.
    pub(super) fn open(path: &Path, start: u32) -> anyhow::Result<Self> {
        let old = if start > 0 && path.is_file() {
            files::read(path, MAX_BYTES).input()?
        } else {
            Vec::new()
        };
        let damaged = || FileError::content(path, "not a log of opsr render");
        Ok(Self {
            path: path.to_owned(),
            earlier: rows_until(&old, start).ok_or_else(damaged).input()?,
            lines: Vec::new(),
        })
    }

    /// Adds a line.
    pub(super) fn add(&mut self, line: Line) -> anyhow::Result<()> {
        self.lines.retain(|earlier| earlier.samples < line.samples);
        self.lines.push(line);
        files::write_bytes(&self.path, self.csv()).output()
    }

    fn csv(&self) -> Vec<u8> {
        let mut csv = self.earlier.clone();
        if csv.is_empty() {
            csv.extend(HEADER.as_bytes());
        }
        let cell = |e: Option<f64>| e.map_or(String::new(), |e| e.to_string());
        for line in &self.lines {
            let [estimated, known] = [line.estimated(), line.true_error].map(cell);
            let (samples, seconds) = (line.samples, line.seconds);
            csv.extend(format!("{samples},{seconds:.3},{estimated},{known}\n").into_bytes());
        }
        csv
    }
}

/// The header and the rows of at most this many samples; `None` if the file is not a log.
fn rows_until(csv: &[u8], samples: u32) -> Option<Vec<u8>> {
    if csv.is_empty() {
        return Some(Vec::new());
    }
    let rows = std::str::from_utf8(csv).ok()?.strip_prefix(HEADER)?;
    let mut kept = HEADER.to_owned();
    for row in rows.split_inclusive('\n') {
        if row.split(',').next()?.parse::<u32>().ok()? <= samples {
            kept += row;
        }
    }
    Some(kept.into_bytes())
}
