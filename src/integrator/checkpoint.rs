//! A render that can be resumed: the film's moments, its levels, the AOVs, and what they belong to.
//!
//! A sealed file whose header names the version, the scene and the settings; a file of another render is refused.

use super::{Aovs, Picture};
use crate::files::{FileError, Sealed};
use crate::image::exr::MAX_PIXELS;
use crate::image::film::{Cause, Film, Rejected, RejectedSample, Window};
use crate::image::level_film::LevelFilm;
use crate::math::UVec2;
use serde::{Deserialize, Serialize};
use std::path::Path;

const FILE: Sealed = Sealed {
    kind: "render checkpoint",
    version: 3,
    // 56 bytes of film, 136 of AOVs and 464 of eight levels per pixel, and a header.
    most: 700 * MAX_PIXELS as u64,
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

/// Header of the file. Payload: the numbers of the film, then those of the AOVs if there are any.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    fingerprint: Fingerprint,
    samples: u32,
    seconds: f64,
    size: [u32; 2],
    /// x, y, width, height.
    window: [u32; 4],
    /// Refused samples that were not a number, and that were infinite.
    refused: [u64; 2],
    /// The first of them: column, row, sample, and true if it was infinite.
    first_refused: Vec<(u32, u32, u32, bool)>,
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
        let film = &self.picture.film;
        let (Window { x, y, w, h }, rejected) = (film.window, &film.rejected);
        let first = rejected.first.iter();
        let header = Header {
            fingerprint: self.fingerprint.clone(),
            samples: self.samples,
            seconds: self.seconds,
            size: film.size.to_array(),
            window: [x, y, w, h],
            refused: [rejected.nan, rejected.infinite],
            first_refused: first
                .map(|r| (r.pixel.x, r.pixel.y, r.sample, r.cause == Cause::Infinite))
                .collect(),
            levels: self.levels.clone(),
        };
        FILE.save(path, &header, |mut out| {
            for number in film.numbers() {
                out.write_all(&number.to_le_bytes())?;
            }
            if let Some(levels) = &self.picture.levels {
                levels.write(&mut out)?;
            }
            for number in self.picture.aovs.iter().flat_map(Aovs::numbers) {
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
        let picture = picture(&header, &payload);
        Ok(Self {
            fingerprint: header.fingerprint,
            samples: header.samples,
            seconds: header.seconds,
            levels: header.levels,
            picture: picture.map_err(|e| FileError::content(path, e))?,
        })
    }
}

/// Little-endian numbers of double precision.
fn numbers(bytes: &[u8]) -> Result<Vec<f64>, &'static str> {
    let numbers = bytes
        .chunks(8)
        .map(|b| b.try_into().map(f64::from_le_bytes));
    numbers.collect::<Result<_, _>>().map_err(|_| "cut short")
}

/// The film, its levels if there are any, and the AOVs if there are numbers after them.
fn picture(header: &Header, payload: &[u8]) -> Result<Picture, String> {
    let [x, y, w, h] = header.window;
    let window = Window { x, y, w, h };
    let size = UVec2::from_array(header.size);
    let end = (8 * Film::NUMBERS).saturating_mul(window.len());
    let (film, mut rest) = payload.split_at(end.min(payload.len()));
    let mut film = Film::from_numbers(size, window, &numbers(film)?).map_err(|e| e.to_string())?;
    let levels = match header.levels.len() {
        0 => None,
        n => {
            let read = LevelFilm::read(size, window, &mut rest)?;
            if read.levels() != n {
                return Err(format!("it has {} levels in place of {n}", read.levels()));
            }
            Some(read)
        }
    };
    let first = header.first_refused.iter().take(Rejected::REMEMBERED);
    film.rejected = Rejected {
        nan: header.refused[0],
        infinite: header.refused[1],
        first: first
            .map(|&(x, y, sample, infinite)| RejectedSample {
                pixel: UVec2::new(x, y),
                sample,
                cause: if infinite {
                    Cause::Infinite
                } else {
                    Cause::Nan
                },
            })
            .collect(),
    };
    let aovs = match &numbers(rest)?[..] {
        [] => None,
        aovs => Some(Aovs::from_numbers(window, aovs).ok_or("wrong number of AOVs")?),
    };
    Ok(Picture { film, aovs, levels })
}
