//! Reads of files that may turn out to be anything, and any number of bytes.

use super::{FileError, Problem};
use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Bytes of a file of at most `most`. Bytes are counted rather than sizes asked for: a pipe is as good as a file, and a
/// device without end is a file that is too long.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>, FileError> {
    let mut bytes = Vec::new();
    let read = File::open(path).and_then(|f| f.take(most + 1).read_to_end(&mut bytes));
    match read {
        Ok(_) if bytes.len() as u64 <= most => Ok(bytes),
        Ok(_) => Err(too_long(most).at(path)),
        Err(e) => Err(Problem::Read(e).at(path)),
    }
}

/// [`read`] of UTF-8 text.
pub fn read_text(path: &Path, most: u64) -> Result<String, FileError> {
    String::from_utf8(read(path, most)?).map_err(|e| FileError::content(path, e))
}

/// Hands over the bytes of a file of at most `most`, piece by piece.
pub(crate) fn stream(path: &Path, most: u64, take: impl FnMut(&[u8])) -> Result<(), FileError> {
    pieces(path, most, take).map_err(|problem| problem.at(path))
}

fn pieces(path: &Path, most: u64, mut take: impl FnMut(&[u8])) -> Result<(), Problem> {
    let file = File::open(path).map_err(Problem::Read)?;
    // A length that is known need not be counted.
    if file.metadata().map_err(Problem::Read)?.len() > most {
        return Err(too_long(most));
    }
    let mut file = BufReader::with_capacity(1 << 16, file.take(most + 1));
    let mut all = 0;
    loop {
        let bytes = file.fill_buf().map_err(Problem::Read)?;
        if bytes.is_empty() {
            return Ok(());
        }
        all += bytes.len() as u64;
        if all > most {
            return Err(too_long(most));
        }
        take(bytes);
        let read = bytes.len();
        file.consume(read);
    }
}

fn too_long(most: u64) -> Problem {
    Problem::content(format!("more than {most} bytes, too many for such a file"))
}

/// The value of a TOML text, or the error with line, column and an excerpt around them.
pub(crate) fn toml<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    toml::from_str(text).map_err(|e| {
        let message = briefly(e.message().replace('\n', ", "));
        e.span().map_or(message.clone(), |span| {
            let (place, excerpt) = excerpt(text, span.start);
            format!("{place}: {message}\n{excerpt}")
        })
    })
}

/// Line and column of a byte, and the surroundings of the place with a mark below it.
fn excerpt(text: &str, at: usize) -> (String, String) {
    const AROUND: usize = 60;
    let before = &text[..text.floor_char_boundary(at)];
    let line = before.matches('\n').count() + 1;
    let start = before.rfind('\n').map_or(0, |i| i + 1);
    let column = before[start..].chars().count();
    let from = column.saturating_sub(AROUND);
    let row = text[start..].lines().next().unwrap_or_default();
    let mut quoted: String = row
        .chars()
        .skip(from)
        .take(column - from + AROUND)
        .collect();
    let mut mark = column - from;
    if from > 0 {
        quoted.insert(0, '…');
        mark += 1;
    }
    if row.chars().count() > column + AROUND {
        quoted.push('…');
    }
    let gutter = " ".repeat(line.to_string().len());
    let excerpt = format!("{line} | {quoted}\n{gutter} | {}^", " ".repeat(mark));
    (format!("line {line}, column {}", column + 1), excerpt)
}

/// The text of an error, cut where it quotes too much of a file.
pub(crate) fn briefly(error: impl std::fmt::Display) -> String {
    const MAX_CHARS: usize = 600;
    let words = error.to_string();
    match words.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => format!("{}…", &words[..end]),
        None => words,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_messages_are_cut() {
        assert_eq!(briefly("ä".repeat(600)), "ä".repeat(600));
        assert_eq!(briefly("ä".repeat(601)), format!("{}…", "ä".repeat(600)));
    }

    /// The mark stands below the place, the excerpt is short.
    #[test]
    fn toml_errors_quote_the_place() {
        let wrong = |text: &str| super::toml::<toml::Table>(text).unwrap_err();
        let short = wrong("a = 1\nb = many");
        assert!(short.starts_with("line 2, column 5: "), "{short}");
        assert!(short.ends_with("\n2 | b = many\n  |     ^"), "{short}");
        for (before, after) in [(0, 0), (50, 5000), (5000, 50), (5000, 5000)] {
            let text = format!(
                "a = 1\nb = [{}?{}]",
                "'ä',".repeat(before),
                " ".repeat(after) + &"1,".repeat(after)
            );
            let words = wrong(&text);
            assert!(words.len() < 600, "{words}");
            let rows: Vec<Vec<char>> = words.lines().map(|l| l.chars().collect()).collect();
            let place = rows[2].iter().position(|&c| c == '^').expect("a mark");
            assert_eq!(rows[1][place], '?', "{words}");
            assert!(rows[1].starts_with(&['2', ' ', '|', ' ']), "{words}");
            assert!(rows[1].len() <= 130 && rows[2].len() <= 130, "{words}");
            let column = 5 + 4 * before + 1;
            assert!(
                words.starts_with(&format!("line 2, column {column}: ")),
                "{words}"
            );
        }
        let long = wrong(&format!("{} = ", "k".repeat(5000)));
        assert!(long.len() < 2000, "{long}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn streamed_pieces_make_the_file_and_too_many_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("long");
        let bytes: Vec<u8> = (0..200_000u32).map(|i| (i % 251) as u8).collect();
        std::fs::write(&path, &bytes).unwrap();
        let mut all = Vec::new();
        stream(&path, 200_000, |piece| all.extend_from_slice(piece)).unwrap();
        assert!(all == bytes);
        for (path, most) in [(path.as_path(), 199_999), (Path::new("/dev/zero"), 1 << 20)] {
            let error = stream(path, most, |_| ()).unwrap_err();
            assert!(error.to_string().contains("more than"), "{error}");
        }
    }

    #[test]
    fn bounded_read_refuses_longer_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("five");
        std::fs::write(&path, b"abcd\xff").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"abcd\xff");
        let long = read(&path, 4).unwrap_err().to_string();
        assert!(
            long.ends_with("more than 4 bytes, too many for such a file"),
            "{long}"
        );
        let text = read_text(&path, 5).unwrap_err();
        assert!(matches!(text.problem, Problem::Content(_)), "{text}");
        let none = read(&folder.path().join("none"), 5).unwrap_err();
        assert!(none.is_missing() && !none.is_write(), "{none}");
    }
}
