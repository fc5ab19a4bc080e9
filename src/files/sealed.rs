//! Sealed files: state that is read back unchanged or refused.
//!
//! Layout: the line `opsr KIND VERSION`, the length of the header in eight bytes (little endian), the header as JSON,
//! the payload, and the SHA-256 of everything before it.

use super::{FileError, Problem, write};
use serde::{Serialize, de::DeserializeOwned};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Write};
use std::path::Path;

/// Bytes of the checksum at the end.
const CHECKSUM: usize = 32;

/// A kind of sealed file.
pub struct Sealed {
    /// Name of the kind, such as `render checkpoint`.
    pub kind: &'static str,
    /// Version of its header and payload.
    pub version: u32,
    /// Longer files are refused.
    pub most: u64,
}

impl Sealed {
    fn first_line(&self) -> String {
        format!("opsr {} {}\n", self.kind, self.version)
    }

    /// Writes a file, whole or not at all; `payload` may write in pieces.
    pub fn save(
        &self,
        path: &Path,
        header: &impl Serialize,
        payload: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), FileError> {
        write(path, |out| {
            let header = serde_json::to_vec(header)?;
            let mut hashed = Hashed {
                out,
                sha256: Sha256::new(),
            };
            {
                let mut out = BufWriter::new(&mut hashed);
                out.write_all(self.first_line().as_bytes())?;
                out.write_all(&(header.len() as u64).to_le_bytes())?;
                out.write_all(&header)?;
                payload(&mut out)?;
                out.flush()?;
            }
            hashed.out.write_all(&hashed.sha256.finalize())
        })
    }

    /// Header and payload of a file of this kind and version whose checksum is right.
    pub fn load<H: DeserializeOwned>(&self, path: &Path) -> Result<(H, Vec<u8>), FileError> {
        self.open(path).map_err(|problem| problem.at(path))
    }

    /// [`Self::load`], but refuses a payload of more than `most(header)` bytes before it is read.
    pub(crate) fn load_of<H: DeserializeOwned>(
        &self,
        path: &Path,
        most: impl FnOnce(&H) -> u64,
    ) -> Result<(H, Vec<u8>), FileError> {
        let begun = self.stream::<H>(path).map_err(|problem| problem.at(path))?;
        let (header, payload) = begun;
        if payload.left() > most(&header) {
            return Err(self.damaged("longer than its header says").at(path));
        }
        self.load(path)
    }

    fn open<H: DeserializeOwned>(&self, path: &Path) -> Result<(H, Vec<u8>), Problem> {
        let line = self.first_line();
        let file = File::open(path).map_err(Problem::Read)?;
        let mut bytes = Vec::new();
        let fill = |most: u64, bytes: &mut Vec<u8>| {
            let read = (&file).take(most).read_to_end(bytes);
            read.map_err(Problem::Read)
        };
        // The first line alone: a file of another kind may have any length.
        fill(line.len() as u64, &mut bytes)?;
        if bytes != line.as_bytes() {
            fill(40, &mut bytes)?;
            return Err(self.another(&bytes));
        }
        bytes.clear();
        fill(self.most + 1, &mut bytes)?;
        let damaged = |what: &str| self.damaged(what);
        let Some(end) = bytes.len().checked_sub(CHECKSUM) else {
            return Err(damaged("cut short"));
        };
        if bytes.len() as u64 > self.most {
            return Err(damaged("too long"));
        }
        let checksum = bytes.split_off(end);
        let sha256 = Sha256::new_with_prefix(&line).chain_update(&bytes);
        if sha256.finalize()[..] != checksum[..] {
            return Err(damaged("the checksum differs"));
        }
        let header = bytes.split_first_chunk::<8>().and_then(|(length, rest)| {
            let length = usize::try_from(u64::from_le_bytes(*length)).ok()?;
            rest.split_at_checked(length)
        });
        let (header, payload) = header.ok_or_else(|| damaged("the header ends nowhere"))?;
        let header = serde_json::from_slice(header).map_err(|e| damaged(&super::briefly(e)))?;
        let begin = bytes.len() - payload.len();
        bytes.drain(..begin);
        Ok((header, bytes))
    }

    /// The header of a file, and its payload to read piece by piece. Both are unchecked until the payload is read to
    /// its end.
    pub fn stream<H: DeserializeOwned>(&self, path: &Path) -> Result<(H, Payload), Problem> {
        let file = File::open(path).map_err(Problem::Read)?;
        let length = file.metadata().map_err(Problem::Read)?.len();
        let mut file = BufReader::new(file);
        let line = self.first_line();
        let mut begin = Vec::new();
        let read = (&mut file).take(line.len() as u64).read_to_end(&mut begin);
        read.map_err(Problem::Read)?;
        if begin != line.as_bytes() {
            let read = file.take(40).read_to_end(&mut begin);
            read.map_err(Problem::Read)?;
            return Err(self.another(&begin));
        }
        let mut words = [0; 8];
        let read = file.read_exact(&mut words);
        read.map_err(|_| self.damaged("cut short"))?;
        let long = u64::from_le_bytes(words);
        let fixed = (line.len() + words.len() + CHECKSUM) as u64;
        let left = length.checked_sub(fixed).and_then(|l| l.checked_sub(long));
        let left = left.filter(|_| long <= MAX_HEADER);
        let left = left.ok_or_else(|| self.damaged("the header ends nowhere"))?;
        let mut header = Vec::new();
        let read = (&mut file).take(long).read_to_end(&mut header);
        read.map_err(Problem::Read)?;
        let sha256 = Sha256::new_with_prefix(&begin)
            .chain_update(words)
            .chain_update(&header);
        let header = serde_json::from_slice(&header);
        let header = header.map_err(|e| self.damaged(&super::briefly(e)))?;
        let kind = self.kind;
        let payload = Payload {
            kind,
            file,
            sha256,
            left,
        };
        Ok((header, payload))
    }

    /// Error for a file of another kind or version, which begins with these bytes.
    fn another(&self, bytes: &[u8]) -> Problem {
        let (kind, version) = (self.kind, self.version);
        let found = String::from_utf8_lossy(bytes);
        let found = found.chars().take_while(|c| (' '..='~').contains(c));
        let found = found.collect::<String>().replace(['`', '"'], "'");
        let what = format!("not a {kind} of version {version}: it begins with `{found}`");
        Problem::Content(what)
    }

    fn damaged(&self, what: &str) -> Problem {
        Problem::Content(format!("a damaged {}: {what}", self.kind))
    }
}

/// Longest header that is read before the rest of a file.
const MAX_HEADER: u64 = 1 << 20;

/// Payload of a sealed file that is read piece by piece.
pub struct Payload {
    kind: &'static str,
    file: BufReader<File>,
    sha256: Sha256,
    left: u64,
}

impl Payload {
    /// Bytes that have not been read.
    pub(crate) fn left(&self) -> u64 {
        self.left
    }

    /// Reads this many bytes; a file that has become shorter is an error.
    pub(crate) fn read(&mut self, bytes: &mut [u8]) -> Result<(), Problem> {
        self.left = self.left.saturating_sub(bytes.len() as u64);
        self.file.read_exact(bytes).map_err(Problem::Read)?;
        self.sha256.update(bytes);
        Ok(())
    }

    /// All bytes that have not been read; an error unless the checksum is right.
    pub(crate) fn rest(mut self) -> Result<Vec<u8>, Problem> {
        let mut bytes = vec![0; self.left as usize];
        self.read(&mut bytes)?;
        self.finish()?;
        Ok(bytes)
    }

    /// An error unless all has been read and the checksum is right.
    pub(crate) fn finish(mut self) -> Result<(), Problem> {
        let mut checksum = [0; CHECKSUM];
        self.file.read_exact(&mut checksum).map_err(Problem::Read)?;
        match self.sha256.finalize()[..] == checksum && self.left == 0 {
            true => Ok(()),
            false => {
                let what = format!("a damaged {}: the checksum differs", self.kind);
                Err(Problem::Content(what))
            }
        }
    }
}

/// Hashes all bytes written through it.
struct Hashed<W> {
    out: W,
    sha256: Sha256,
}

impl<W: Write> Write for Hashed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.sha256.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

#[cfg(test)]
mod tests;
