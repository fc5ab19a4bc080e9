//! A render that can be resumed: the film's moments, its levels, the AOVs, and what they belong to.
//!
//! A sealed file whose header names the version, the scene and the settings; a file of another render is refused.

use super::{FirstHit, Picture};
use crate::files::{FileError, Sealed};
use crate::image::exr::MAX_PIXELS;
use crate::image::film::Film;
use crate::image::level_film::LevelFilm;
use serde::{Deserialize, Serialize};
use std::path::Path;

const FILE: Sealed = Sealed {
    kind: "render checkpoint",
    version: 3,
    // 52 bytes of film, 72 of AOVs and 400 of eight levels a pixel.
    most: 528 * MAX_PIXELS as u64,
};

/// Render that a checkpoint belongs to.
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
    /// Scales of the levels; empty for one level.
    levels: Vec<f32>,
}

/// A stopped render.
#[derive(Clone, Debug, PartialEq)]
pub struct Checkpoint {
    /// The render that it belongs to.
    pub fingerprint: Fingerprint,
    /// Samples per pixel so far; the next pass begins with this number.
    pub samples: u32,
    /// Wall time spent so far.
    pub seconds: f64,
    /// Scales of the levels; empty for one level.
    pub levels: Vec<f32>,
    /// The moments and AOVs so far.
    pub picture: Picture,
}

impl Checkpoint {
    /// Writes the file, whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let header = Header {
            fingerprint: self.fingerprint.clone(),
            samples: self.samples,
            seconds: self.seconds,
            levels: self.levels.clone(),
        };
        FILE.save(path, &header, |mut out| {
            self.picture.film.write(&mut out)?;
            if let Some(levels) = &self.picture.levels {
                levels.write(&mut out)?;
            }
            for number in self.picture.aovs.iter().flat_map(FirstHit::numbers) {
                out.write_all(&number.to_le_bytes())?;
            }
            Ok(())
        })
    }

    /// Reads the checkpoint of this render; one of another version, scene or other settings is refused.
    pub fn load(path: &Path, ours: &Fingerprint) -> Result<Self, FileError> {
        let old = Self::open(path)?;
        let theirs = &old.fingerprint;
        for (what, theirs, ours) in [
            ("another version", &theirs.version, &ours.version),
            ("another scene", &theirs.scene, &ours.scene),
            ("other settings", &theirs.settings, &ours.settings),
        ] {
            if theirs != ours {
                let differs = format!("it has `{theirs}`, this render `{ours}`");
                let what = format!("this checkpoint belongs to {what}: {differs}");
                return Err(FileError::content(path, what));
            }
        }
        Ok(old)
    }

    /// Reads the checkpoint of any render by this version of the file.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let (header, payload): (Header, _) = FILE.load(path)?;
        let picture = picture(&payload, header.levels.len());
        Ok(Self {
            fingerprint: header.fingerprint,
            samples: header.samples,
            seconds: header.seconds,
            levels: header.levels,
            picture: picture.map_err(|e| FileError::content(path, e))?,
        })
    }
}

/// The film, its levels if there are any, and the AOVs if there are bytes after them.
fn picture(mut payload: &[u8], levels: usize) -> Result<Picture, String> {
    let film = Film::read(&mut payload).map_err(|e| e.to_string())?;
    let levels = match levels {
        0 => None,
        n => {
            let read = LevelFilm::read(film.size, film.window, &mut payload);
            let read = read.map_err(|e| e.to_string())?;
            if read.levels() != n {
                return Err(format!("it has {} levels in place of {n}", read.levels()));
            }
            Some(read)
        }
    };
    let (numbers, rest) = payload.as_chunks::<8>();
    let numbers: Vec<f64> = numbers.iter().map(|&b| f64::from_le_bytes(b)).collect();
    let aovs = match (numbers.is_empty(), rest.is_empty()) {
        (true, true) => None,
        (false, true) => FirstHit::from_numbers(film.window, &numbers),
        (_, false) => return Err("the AOVs are cut short".into()),
    };
    if aovs.is_none() && !numbers.is_empty() {
        return Err("wrong number of AOVs".into());
    }
    Ok(Picture { film, aovs, levels })
}
