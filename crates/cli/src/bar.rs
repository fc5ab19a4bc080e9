//! Progress: a bar on a terminal, JSON lines for programs, or nothing.

use super::output::percent;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressStyle};
use opsr::integrator::drive::RenderProgress;
use std::io::{IsTerminal, Write};
use std::time::Duration;

/// Form of the progress.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Style {
    /// A bar if standard error is a terminal, else nothing.
    #[default]
    Auto,
    /// One JSON object per line on standard output.
    Json,
    /// Nothing.
    None,
}

/// Steps of the bar, finer than any terminal can show.
const STEPS: u64 = 1000;

/// The progress display of a render.
pub(super) enum Bar {
    /// A bar on standard error.
    Terminal(ProgressBar),
    /// JSON lines on standard output.
    Json,
    /// No progress.
    Quiet,
}

/// A bar with this number of steps.
pub(super) fn terminal(steps: u64, template: &str) -> ProgressBar {
    let bar = ProgressBar::new(steps);
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style);
    }
    bar
}

impl Bar {
    /// A bar in this style.
    pub(super) fn new(style: Style) -> Self {
        match style {
            Style::Json => Self::Json,
            Style::Auto if std::io::stderr().is_terminal() => {
                Self::Terminal(terminal(STEPS, "{bar:30} {msg}"))
            }
            Style::Auto | Style::None => Self::Quiet,
        }
    }

    /// Shows the progress of a render, and its true error if it is known.
    pub(super) fn show(&self, progress: &RenderProgress, true_error: Option<f64>) {
        self.show_frame(None, progress, true_error);
    }

    /// Shows the progress of frame `frame` of a film, or of a single picture.
    pub(super) fn show_frame(
        &self,
        frame: Option<u32>,
        progress: &RenderProgress,
        true_error: Option<f64>,
    ) {
        let seconds = progress.elapsed.as_secs_f64();
        // Time left, extrapolated from the part that is done.
        let fraction = progress.fraction.filter(|&f| f > 0.0);
        let eta = fraction.and_then(|f| Duration::try_from_secs_f64(seconds * (1.0 - f) / f).ok());
        match self {
            Self::Quiet => {}
            Self::Terminal(bar) => {
                bar.set_position((progress.fraction.unwrap_or(0.0) * STEPS as f64) as u64);
                let eta = eta.map_or(String::new(), |eta| {
                    let whole = Duration::from_secs(eta.as_secs());
                    format!(", {} left", humantime::format_duration(whole))
                });
                let error = progress
                    .error
                    .map_or(String::new(), |e| format!(", average error {}", percent(e)));
                let truth =
                    true_error.map_or(String::new(), |e| format!(", true error {}", percent(e)));
                let frame = frame.map_or(String::new(), |number| format!("frame {number}, "));
                bar.set_message(format!(
                    "{frame}{} spp, {seconds:.1} s{error}{truth}{eta}",
                    progress.samples
                ));
            }
            Self::Json => {
                let mut line = serde_json::json!({
                    "spp": progress.samples,
                    "seconds": seconds,
                    "fraction": progress.fraction,
                    "eta": eta.map(|e| e.as_secs_f64()),
                    "error": progress.error.filter(|e| e.is_finite()),
                });
                if let Some(number) = frame {
                    line["frame"] = number.into();
                }
                if let Some(error) = true_error {
                    line["true_error"] = error.into();
                }
                // A closed output does not end a render.
                let _ = writeln!(std::io::stdout(), "{line}");
            }
        }
    }

    /// Removes the bar.
    pub(super) fn finish(&self) {
        if let Self::Terminal(bar) = self {
            bar.finish_and_clear();
        }
    }
}
