//! Log of a render: samples, seconds and errors over time.

use super::Blame;
use anyhow::anyhow;
use opsr::files;
use opsr::report::tensorboard::Scalars;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Interval of the lines.
const EVERY: Duration = Duration::from_secs(1);

/// Form of a log.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Form {
    Csv,
    TensorBoard,
}

/// One line of a log.
#[derive(Clone, Copy)]
pub(super) struct Line {
    /// Samples per pixel.
    pub(super) samples: u32,
    /// Seconds, those before the render was resumed included.
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

/// The log; its file is replaced as a whole, so that it is never half-written.
pub(super) struct ErrorLog {
    path: PathBuf,
    form: Form,
    lines: Vec<Line>,
    latest: Option<Instant>,
}

impl ErrorLog {
    /// A log at this place; its name says the form.
    pub(super) fn new(path: &Path) -> anyhow::Result<Self> {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let form = if name.contains("tfevents") {
            Form::TensorBoard
        } else if name.ends_with(".csv") {
            Form::Csv
        } else {
            let what = "ends in .csv, or contains tfevents for TensorBoard";
            return Err(anyhow!("--log {}: its name {what}", path.display())).usage();
        };
        Ok(Self {
            path: path.to_owned(),
            form,
            lines: Vec::new(),
            latest: None,
        })
    }

    /// Adds a line if the last one is old enough, or if it is the `last` one.
    pub(super) fn add(&mut self, last: bool, line: impl FnOnce() -> Line) -> anyhow::Result<()> {
        if !last && self.latest.is_some_and(|at| at.elapsed() < EVERY) {
            return Ok(());
        }
        self.latest = Some(Instant::now());
        let line = line();
        self.lines.retain(|earlier| earlier.samples < line.samples);
        self.lines.push(line);
        files::write_bytes(&self.path, self.bytes()).output()
    }

    fn bytes(&self) -> Vec<u8> {
        match self.form {
            Form::Csv => self.csv().into_bytes(),
            Form::TensorBoard => self.events(),
        }
    }

    fn csv(&self) -> String {
        let row = |line: &Line| {
            let cell = |e: Option<f64>| e.map_or(String::new(), |e| e.to_string());
            let [estimated, known] = [line.estimated(), line.true_error].map(cell);
            format!("{},{:.3},{estimated},{known}\n", line.samples, line.seconds)
        };
        let rows = self.lines.iter().map(row);
        std::iter::once("samples,seconds,estimated_error,true_error\n".to_owned())
            .chain(rows)
            .collect()
    }

    fn events(&self) -> Vec<u8> {
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
        let last = self.lines.last().map_or(0.0, |line| line.seconds);
        let began = now.map_or(0.0, |now| now.as_secs_f64()) - last;
        let mut scalars = Scalars::new(began);
        for line in &self.lines {
            let estimated = line.estimated().map(|e| ("error/estimated", e));
            let known = line.true_error.map(|e| ("error/true", e));
            let values = estimated.into_iter().chain(known);
            scalars.add(line.samples.into(), began + line.seconds, values);
        }
        scalars.bytes().to_vec()
    }
}
