//! Log of a training as JSON lines, and its curves as CSV for spreadsheets and plots.

use super::super::exit::Blame;
use super::save;
use opsr::files;
use opsr_train::learn::outer_loop::LogEntry;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most bytes of a log: more than ten thousand steps need, with a validation each.
const MAX_BYTES: u64 = 1 << 26;

/// The log by step. Its file is replaced as a whole at every line, so that it is never incomplete.
pub(super) struct MetricsLog {
    path: PathBuf,
    lines: BTreeMap<u32, String>,
}

impl MetricsLog {
    /// Opens the log; a resumed run keeps its earlier lines.
    pub(super) fn open(path: &Path, resume: bool) -> anyhow::Result<Self> {
        let old = match resume.then(|| files::read_text(path, MAX_BYTES)) {
            Some(Err(e)) if !e.is_missing() => return Err(e).input(),
            Some(Ok(text)) => text,
            _ => String::new(),
        };
        let step = |line: &str| -> Option<u32> {
            let value: serde_json::Value = serde_json::from_str(line).ok()?;
            value.get("step")?.as_u64()?.try_into().ok()
        };
        Ok(Self {
            path: path.into(),
            lines: (old.lines())
                .filter_map(|line| Some((step(line)?, line.to_string())))
                .collect(),
        })
    }

    pub(super) fn add(&mut self, entry: &LogEntry) -> anyhow::Result<()> {
        self.lines.retain(|&step, _| step < entry.step);
        (self.lines).insert(entry.step, serde_json::to_string(entry)?);
        let text: String = self
            .lines
            .values()
            .flat_map(|l| [l.as_str(), "\n"])
            .collect();
        save(&self.path, &text)?;
        let entries = self.entries();
        save(&self.path.with_extension("csv"), &csv(&entries))
    }

    pub(super) fn entries(&self) -> Vec<serde_json::Value> {
        (self.lines.values())
            .filter_map(|line| serde_json::from_str(line).ok())
            .collect()
    }
}

/// Step, seconds and mean losses of all entries; unknown values are empty.
fn csv(entries: &[serde_json::Value]) -> String {
    const COLUMNS: [&str; 4] = ["step", "seconds", "loss", "validation"];
    let row = |entry: &serde_json::Value| {
        let cells = COLUMNS.map(|key| entry[key].as_f64().map_or(String::new(), |x| x.to_string()));
        cells.join(",") + "\n"
    };
    let rows = entries.iter().map(row);
    std::iter::once(COLUMNS.join(",") + "\n")
        .chain(rows)
        .collect()
}
