//! Log of a training, as JSON lines, and its curves as CSV for spreadsheets and plots, and for TensorBoard.

use super::super::exit::Blame;
use super::save;
use opsr::files;
use opsr::report::tensorboard::Scalars;
use opsr::train::learn::outer_loop::LogEntry;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

/// Longest log that is read; ten thousand steps with a validation each need less.
const MAX_BYTES: u64 = 1 << 26;

/// The log by step. Its file is replaced as a whole at every line, so that it is never half-written.
pub(super) struct MetricsLog {
    path: PathBuf,
    lines: BTreeMap<u32, String>,
}

impl MetricsLog {
    /// Opens the log, with the lines of the earlier run if that is resumed.
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
        save(&self.path.with_extension("csv"), &csv(&entries))?;
        let events = self.path.with_file_name("events.out.tfevents.opsr");
        files::write_bytes(&events, scalars(&entries).bytes()).output()
    }

    pub(super) fn entries(&self) -> Vec<serde_json::Value> {
        (self.lines.values())
            .filter_map(|line| serde_json::from_str(line).ok())
            .collect()
    }
}

/// Losses of all entries, and the mean scores of their crops.
fn scalars(entries: &[serde_json::Value]) -> Scalars {
    // Seconds begin anew where a training was resumed.
    let mut times = Vec::with_capacity(entries.len());
    let (mut before, mut last) = (0.0, 0.0);
    for entry in entries {
        let seconds = entry["seconds"].as_f64().unwrap_or(last);
        if seconds < last {
            before += last;
        }
        last = seconds;
        times.push(before + seconds);
    }
    let now = SystemTime::now().duration_since(UNIX_EPOCH);
    let began = now.map_or(0.0, |now| now.as_secs_f64()) - before - last;
    let mut scalars = Scalars::new(began);
    for (entry, time) in entries.iter().zip(times) {
        let mut values = Vec::new();
        for (set, loss, crops) in [
            ("training", "loss", "crops"),
            ("validation", "validation", "validation_crops"),
        ] {
            let mean = |key: &str| {
                let crops = entry[crops].as_array()?;
                let scores = crops.iter().filter_map(|crop| crop[key].as_f64());
                Some(scores.sum::<f64>() / crops.len() as f64).filter(|mean| mean.is_finite())
            };
            values.push((format!("loss/{set}"), entry[loss].as_f64()));
            for key in ["mape", "variance", "energy"] {
                values.push((format!("{key}/{set}"), mean(key)));
            }
        }
        let known = (values.iter()).filter_map(|(tag, value)| Some((tag.as_str(), (*value)?)));
        scalars.add(entry["step"].as_u64().unwrap_or(0), time, known);
    }
    scalars
}

/// Step, seconds and mean losses of all entries; what is not known is left empty.
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
