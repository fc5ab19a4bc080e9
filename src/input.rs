//! Reading whole files that may turn out to be anything, and any number of bytes.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Reads a file of at most `most` bytes. A pipe is as good as a file, and a device without end is no worse than a file
/// that is too long: sizes are not asked for, bytes are counted.
pub(crate) fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    File::open(path)?.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        let what = format!("more than {most} bytes, too many for such a file");
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
    }
    Ok(bytes)
}

/// [`read`] of text.
pub(crate) fn read_text(path: &Path, most: u64) -> io::Result<String> {
    String::from_utf8(read(path, most)?).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))
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
