//! Reading whole files that may turn out to be anything, and any number of bytes.

use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

/// Reads a file of at most `most` bytes. A pipe is as good as a file, and a device without end is no worse than a file
/// that is too long: sizes are not asked for, bytes are counted.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        return Err(too_long(most));
    }
    Ok(bytes)
}

/// Hands over the bytes of a file of at most `most`, piece by piece.
pub(crate) fn stream(path: &Path, most: u64, mut take: impl FnMut(&[u8])) -> io::Result<()> {
    let file = File::open(path)?;
    // A length that is known need not be counted.
    if file.metadata()?.len() > most {
        return Err(too_long(most));
    }
    let mut file = BufReader::with_capacity(1 << 16, file.take(most + 1));
    let mut all = 0;
    loop {
        let bytes = file.fill_buf()?;
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

fn too_long(most: u64) -> io::Error {
    let what = format!("more than {most} bytes, too many for such a file");
    io::Error::new(io::ErrorKind::FileTooLarge, what)
}

/// [`read`] of text.
pub fn read_text(path: &Path, most: u64) -> io::Result<String> {
    String::from_utf8(read(path, most)?).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))
}

/// What a TOML text says, or what is wrong with it and where.
pub(crate) fn toml<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    toml::from_str(text).map_err(|e| briefly(narrow(&e.to_string())))
}

/// The words of the reader of TOML, which quotes a whole line and marks the place below it, with the surroundings of
/// the place alone.
fn narrow(words: &str) -> String {
    const AROUND: usize = 60;
    let mut rows: Vec<String> = words.lines().map(str::to_owned).collect();
    let [_, _, quoted, marks, ..] = &mut rows[..] else {
        return words.to_owned();
    };
    let (Some(gutter), Some(place)) = (marks.find("| "), marks.find('^')) else {
        return words.to_owned();
    };
    // Gutter and blanks are ASCII: a byte is a character in the row of the mark.
    let gutter = gutter + 2;
    let (from, to) = (place.saturating_sub(AROUND).max(gutter), place + AROUND);
    for (row, cut) in [(quoted, '…'), (marks, ' ')] {
        let kept = row.chars().enumerate().filter_map(|(i, c)| match i {
            _ if i < gutter || (from..to).contains(&i) => Some(c),
            _ if i + 1 == from || i == to => Some(cut),
            _ => None,
        });
        *row = kept.collect();
    }
    rows.join("\n")
}

/// The words of an error, cut where they quote too much of a file.
pub(crate) fn briefly(error: impl std::fmt::Display) -> String {
    const MOST: usize = 600;
    let words = error.to_string();
    match words.char_indices().nth(MOST) {
        Some((end, _)) => format!("{}…", &words[..end]),
        None => words,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_words_are_cut() {
        assert_eq!(briefly("ä".repeat(600)), "ä".repeat(600));
        assert_eq!(briefly("ä".repeat(601)), format!("{}…", "ä".repeat(600)));
    }

    /// Where the mark is and what is quoted above it.
    #[test]
    fn toml_is_quoted_around_the_place() {
        let wrong = |text: &str| super::toml::<toml::Table>(text).unwrap_err();
        let short = wrong("a = 1\nb = many");
        assert!(short.contains("line 2, column 5"), "{short}");
        assert!(short.contains("2 | b = many\n  |     ^"), "{short}");
        for (before, after) in [(0, 0), (50, 5000), (5000, 50), (5000, 5000)] {
            let text = format!(
                "a = 1\nb = [{}?{}]",
                "'ä',".repeat(before),
                " ".repeat(after) + &"1,".repeat(after)
            );
            let words = wrong(&text);
            assert!(words.len() < 600, "{words}");
            let rows: Vec<Vec<char>> = words.lines().map(|l| l.chars().collect()).collect();
            let place = rows[3].iter().position(|&c| c == '^').expect("a mark");
            assert_eq!(rows[2][place], '?', "{words}");
            assert!(rows[2].starts_with(&['2', ' ', '|', ' ']), "{words}");
            assert!(rows[2].len() <= 130 && rows[3].len() <= 130, "{words}");
            let column = 5 + 4 * before + 1;
            assert!(words.contains(&format!("column {column}\n")), "{words}");
        }
        let long = wrong(&format!("{} = ", "k".repeat(5000)));
        assert!(long.len() < 2000, "{long}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn pieces_make_the_file_and_too_many_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("long");
        let bytes: Vec<u8> = (0..200_000u32).map(|i| (i % 251) as u8).collect();
        std::fs::write(&path, &bytes).unwrap();
        let mut all = Vec::new();
        stream(&path, 200_000, |piece| all.extend_from_slice(piece)).unwrap();
        assert!(all == bytes);
        for (path, most) in [(path.as_path(), 199_999), (Path::new("/dev/zero"), 1 << 20)] {
            let error = stream(path, most, |_| ()).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        }
    }

    #[test]
    fn as_many_bytes_as_allowed_and_no_more() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("five");
        std::fs::write(&path, b"abcd\xff").unwrap();
        assert_eq!(read(&path, 5).unwrap(), b"abcd\xff");
        assert_eq!(
            read(&path, 4).unwrap_err().kind(),
            io::ErrorKind::FileTooLarge
        );
        assert_eq!(
            read_text(&path, 5).unwrap_err().kind(),
            io::ErrorKind::InvalidData
        );
        assert!(read(&folder.path().join("none"), 5).is_err());
    }
}
