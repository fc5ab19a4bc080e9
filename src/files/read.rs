//! Bounded reads of files of unknown kind and length.

use super::{FileError, Problem};
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;

/// Bytes of a file of at most `most` bytes. The bytes are counted, because pipes and endless devices report no length.
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

/// Passes the bytes of a file of at most `most` bytes to `take`, piece by piece.
pub(crate) fn stream(path: &Path, most: u64, take: impl FnMut(&[u8])) -> Result<(), FileError> {
    pieces(path, most, take).map_err(|problem| problem.at(path))
}

fn pieces(path: &Path, most: u64, mut take: impl FnMut(&[u8])) -> Result<(), Problem> {
    let file = File::open(path).map_err(Problem::Read)?;
    // A longer regular file is refused before it is read.
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

/// The text of an error, cut where it quotes too much of a file.
pub fn briefly(error: impl std::fmt::Display) -> String {
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
