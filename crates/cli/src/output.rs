//! Standard output, and messages on standard error.

use super::exit::Blame;
use anyhow::Context;
use std::fmt::Display;
use std::io::Write;

/// Writes to standard output. A closed pipe is no error: its reader needs no more.
pub(super) fn print(text: impl AsRef<[u8]>) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_ref()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(e).context("standard output").output()
        }
        _ => Ok(()),
    }
}

/// Writes a message to standard error. Its failure is ignored, because messages may have no reader.
pub(super) fn note(line: impl Display) {
    let _ = writeln!(std::io::stderr().lock(), "{line}");
}

/// The command line, for the metadata of files.
pub(super) fn command() -> String {
    std::env::args().collect::<Vec<_>>().join(" ")
}

/// A share as per cent, with two digits.
pub(super) fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    if !percent.is_finite() {
        return "unknown".into();
    }
    let digits = match percent {
        p if p >= 10.0 => 0,
        p if p >= 1.0 => 1,
        _ => 2,
    };
    format!("{percent:.digits$} %")
}
