//! Progress of a training.

use super::super::bar::{self, Style};
use crate::output::note;
use indicatif::ProgressBar;
use opsr_train::learn::outer_loop::LogEntry;
use opsr_train::learn::recordings::RecordingProgress;
use std::io::{IsTerminal, Write};
use std::time::Instant;

/// Progress as a bar on a terminal, as JSON lines, or none.
pub(super) struct ProgressDisplay {
    bar: Option<ProgressBar>,
    style: Style,
    steps: u32,
}

impl ProgressDisplay {
    pub(super) fn new(style: Style, steps: u32) -> Self {
        let terminal = style == Style::Auto && std::io::stderr().is_terminal();
        let bar = terminal.then(|| bar::terminal(steps.into(), "{bar:30} {pos}/{len} {msg}"));
        Self { bar, style, steps }
    }

    /// Prints a message; nothing with `Style::None`.
    pub(super) fn say(&self, text: &str) {
        match (&self.bar, self.style) {
            (Some(bar), _) => bar.println(text),
            (None, Style::None) => {}
            (None, _) => note(text),
        }
    }

    /// Shows that a crop's recording begins.
    pub(super) fn recording(&self, progress: &RecordingProgress<'_>) {
        let RecordingProgress {
            crop,
            done,
            of,
            left,
        } = *progress;
        let eta = left.map_or(String::new(), |left| {
            format!(", {:.0} s left", left.as_secs_f64())
        });
        let line = format!("recording {crop} ({done} of {of} done{eta})");
        match (&self.bar, self.style) {
            (Some(bar), _) => {
                bar.set_length(of as u64);
                bar.set_position(done as u64);
                bar.set_message(line);
            }
            (None, Style::Json) => {
                // A closed output does not end the training.
                let line = serde_json::json!({
                    "recording": crop, "done": done, "of": of, "eta": left.map(|l| l.as_secs_f64()),
                });
                let _ = writeln!(std::io::stdout(), "{line}");
            }
            (None, _) => self.say(&line),
        }
    }

    /// Switches from recordings to steps.
    pub(super) fn recorded(&self) {
        if let Some(bar) = &self.bar {
            bar.set_length(self.steps.into());
            bar.set_position(0);
            bar.set_message("");
        }
    }

    /// Shows a step; at a validation also the crop with the largest loss.
    pub(super) fn show(
        &self,
        step: u32,
        beta: f32,
        loss: f32,
        entry: Option<&LogEntry>,
        names: &[String],
        clock: &Instant,
    ) {
        let worst = entry.and_then(|entry| {
            let losses = entry.crops.iter().map(|l| l.total(beta)).zip(names);
            losses.max_by(|a, b| a.0.total_cmp(&b.0))
        });
        if let Some(bar) = &self.bar {
            bar.set_position(step.into());
            if let Some((loss_of_worst, name)) = worst {
                let left = (self.steps - step.min(self.steps)) as f64 / f64::from(step.max(1))
                    * clock.elapsed().as_secs_f64();
                bar.set_message(format!(
                    "beta {beta}: loss {loss:.4}, worst crop {name} {loss_of_worst:.4}, {left:.0} s left"
                ));
            }
        }
        if self.style == Style::Json
            && let Some(entry) = entry
        {
            let line = serde_json::json!({
                "beta": beta, "step": step, "steps": self.steps, "loss": entry.loss,
                "validation": entry.validation, "worst": worst.map(|w| w.1), "seconds": entry.seconds,
            });
            // A closed output does not end the training.
            let _ = writeln!(std::io::stdout(), "{line}");
        }
    }
}
