//! Resumable renders: the film's moments, the AOVs, and the identity of the render.
//!
//! A file is written whole or not at all, carries a checksum of its content, and names its scene and settings by a
//! fingerprint; another fingerprint is refused.

use super::{FirstHit, Picture};
use crate::files::{self, hex};
use crate::image::film::Film;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 8] = b"opsrckp1";

/// Largest header, in bytes.
const MAX_HEADER: u64 = 1 << 20;

/// Identity of a render.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fingerprint {
    /// Version of the program.
    pub version: String,
    /// SHA-256 of the scene's files.
    pub scene: String,
    /// Everything else that the picture depends on, in words.
    pub settings: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    fingerprint: Fingerprint,
    samples: u32,
    seconds: f64,
    film_bytes: usize,
    aov_bytes: usize,
    sha256: String,
}

/// Number and checksum of bytes that are not held.
#[derive(Default)]
struct Summary {
    bytes: usize,
    sha256: Sha256,
}

impl Summary {
    fn of(fill: impl FnOnce(&mut BufWriter<&mut Self>) -> io::Result<()>) -> io::Result<Self> {
        let mut summary = Self::default();
        let mut out = BufWriter::new(&mut summary);
        fill(&mut out)?;
        out.flush()?;
        drop(out);
        Ok(summary)
    }
}

impl Write for Summary {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.bytes += bytes.len();
        self.sha256.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// A stopped render.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The render that was stopped.
    pub fingerprint: Fingerprint,
    /// Samples per pixel so far; the next pass begins with this number.
    pub samples: u32,
    /// Wall time spent so far.
    pub seconds: f64,
    /// The moments and AOVs so far.
    pub picture: Picture,
}

/// A checkpoint that could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file could not be read or written.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file is damaged or no checkpoint.
    #[error("{path}: not a checkpoint of this version, or damaged: {what}")]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The fault.
        what: String,
    },
    /// The file belongs to another render.
    #[error("{path}: this checkpoint belongs to {what}: it has `{theirs}`, this render `{ours}`")]
    Other {
        /// The file.
        path: PathBuf,
        /// The part that differs.
        what: &'static str,
        /// Value in the file.
        theirs: String,
        /// Value of this render.
        ours: String,
    },
}

impl Checkpoint {
    /// Writes the file, whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), CheckpointError> {
        let io = |source| CheckpointError::Io {
            path: path.to_owned(),
            source,
        };
        let film = Summary::of(|out| self.picture.film.write(out)).map_err(io)?;
        let content = Summary::of(|out| self.content(out)).map_err(io)?;
        let header = Header {
            fingerprint: self.fingerprint.clone(),
            samples: self.samples,
            seconds: self.seconds,
            film_bytes: film.bytes,
            aov_bytes: content.bytes - film.bytes,
            sha256: hex(&content.sha256.finalize()),
        };
        let header = serde_json::to_vec(&header).map_err(|e| io(e.into()))?;
        files::write(path, |out| {
            out.write_all(MAGIC)?;
            out.write_all(&(header.len() as u64).to_le_bytes())?;
            out.write_all(&header)?;
            self.content(out)
        })
        .map_err(io)
    }

    /// Film and AOVs.
    fn content(&self, out: &mut impl Write) -> io::Result<()> {
        self.picture.film.write(out)?;
        for number in self.picture.aovs.iter().flat_map(FirstHit::numbers) {
            out.write_all(&number.to_le_bytes())?;
        }
        Ok(())
    }

    /// Reads the checkpoint of this render; one of another scene or other settings is refused.
    pub fn load(path: &Path, ours: &Fingerprint) -> Result<Self, CheckpointError> {
        let bytes = read(path).map_err(|source| CheckpointError::Io {
            path: path.to_owned(),
            source,
        })?;
        let checkpoint = Self::parse(&bytes).map_err(|what| CheckpointError::Invalid {
            path: path.to_owned(),
            what,
        })?;
        let theirs = &checkpoint.fingerprint;
        for (what, theirs, ours) in [
            ("another version", &theirs.version, &ours.version),
            ("another scene", &theirs.scene, &ours.scene),
            ("other settings", &theirs.settings, &ours.settings),
        ] {
            if theirs != ours {
                let (path, theirs, ours) = (path.to_owned(), theirs.clone(), ours.clone());
                return Err(CheckpointError::Other {
                    path,
                    what,
                    theirs,
                    ours,
                });
            }
        }
        Ok(checkpoint)
    }

    fn parse(bytes: &[u8]) -> Result<Self, String> {
        let rest = bytes.strip_prefix(MAGIC).ok_or("wrong first bytes")?;
        let (length, rest) = rest.split_first_chunk::<8>().ok_or("too short")?;
        let length = u64::from_le_bytes(*length);
        if length > MAX_HEADER || length > rest.len() as u64 {
            return Err("header too long".into());
        }
        let (header, content) = rest.split_at(length as usize);
        let header: Header = serde_json::from_slice(header).map_err(files::briefly)?;
        if header.film_bytes.checked_add(header.aov_bytes) != Some(content.len()) {
            return Err("cut short".into());
        }
        if hex(&Sha256::digest(content)) != header.sha256 {
            return Err("checksum differs".into());
        }
        let (film, aovs) = content.split_at(header.film_bytes);
        let film = Film::from_bytes(film).map_err(|e| e.to_string())?;
        let numbers: Vec<f64> = aovs
            .as_chunks::<8>()
            .0
            .iter()
            .map(|&b| f64::from_le_bytes(b))
            .collect();
        let aovs = match numbers.is_empty() {
            true => None,
            false => {
                Some(FirstHit::from_numbers(film.window, &numbers).ok_or("wrong number of AOVs")?)
            }
        };
        let (samples, seconds) = (header.samples, header.seconds);
        let picture = Picture { film, aovs };
        Ok(Self {
            fingerprint: header.fingerprint,
            samples,
            seconds,
            picture,
        })
    }
}

/// The bytes of a checkpoint, or the first ones of another file.
fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    let mut bytes = Vec::new();
    Read::by_ref(&mut file)
        .take(MAGIC.len() as u64)
        .read_to_end(&mut bytes)?;
    if bytes == MAGIC {
        file.read_to_end(&mut bytes)?;
    }
    Ok(bytes)
}
