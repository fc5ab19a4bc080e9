//! The file of a render that can be resumed: the film's moments, its levels, the AOVs, and the render's fingerprint.
//!
//! A sealed file whose header names the version, the scene and the settings; a file of another render is an error.

use super::{Amounts, Aovs, Picture, Recorded};
use crate::files::{FileError, Sealed};
use crate::image::batches::{Batches, Sharing};
use crate::image::exr::Metadata;
use crate::image::film::MAX_PIXELS;
use crate::image::film::{Cause, Film, Rejected, RejectedSample, Window};
use crate::image::level_film::LevelFilm;
use crate::math::UVec2;
use serde::{Deserialize, Serialize};
use std::io::{self, Write};
use std::path::Path;

const FILE: Sealed = Sealed {
    kind: "render checkpoint",
    version: 4,
    // 56 bytes of film, 136 of AOVs and 968 of eight levels with carried sums per pixel, and a header.
    most: 1200 * MAX_PIXELS as u64,
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

impl Fingerprint {
    /// An error unless both are the same. It names `file`, the kind of `self`'s file, and `other`, the owner of `ours`.
    pub(super) fn differs(&self, ours: &Self, file: &str, other: &str) -> Result<(), String> {
        for (what, theirs, ours) in [
            ("another version", &self.version, &ours.version),
            ("another scene", &self.scene, &ours.scene),
            ("other settings", &self.settings, &ours.settings),
        ] {
            if theirs != ours {
                let (theirs, ours) = difference(theirs, ours);
                let differs = format!("it has `{theirs}`, this {other} `{ours}`");
                return Err(format!("this {file} belongs to {what}: {differs}"));
            }
        }
        Ok(())
    }
}

/// Two texts without the parts, between commas, with which both begin or end.
fn difference(a: &str, b: &str) -> (String, String) {
    let [a, b] = [a, b].map(|text| text.split(", ").collect::<Vec<_>>());
    let pairs = || a.iter().zip(&b);
    let mut begin = pairs().take_while(|(x, y)| x == y).count();
    let shorter = a.len().min(b.len());
    let pairs_back = a.iter().rev().zip(b.iter().rev());
    let mut end = pairs_back.take_while(|(x, y)| x == y).count();
    end = end.min(shorter - begin);
    if begin + end == shorter && a.len() != b.len() {
        // Only one text has a middle: a common part beside it is shown too.
        match begin {
            0 => end = end.saturating_sub(1),
            _ => begin -= 1,
        }
    }
    let middle = |parts: &[&str]| parts[begin..parts.len() - end].join(", ");
    (middle(&a), middle(&b))
}

/// Header of the file. Payload, little endian: the numbers of the film (f64), the levels if there are any
/// ([`LevelFilm::write`]), the numbers of the AOVs (f64) if there are any.
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
    /// The films of the payload.
    amounts: Amounts,
    #[serde(default)]
    metadata: Metadata,
    /// Batch sums of all pixels, if pixels share light paths.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    shared: Vec<u64>,
}

impl Header {
    /// Most bytes of the payload.
    fn payload_bytes(&self) -> u64 {
        let [_, _, w, h] = self.window.map(u64::from);
        let pixels = w.saturating_mul(h).min(MAX_PIXELS as u64);
        let levels = LevelFilm::bytes_with(1, self.amounts.films(), u32::MAX);
        let aovs = 8 * Recorded::ALL.numbers();
        LevelFilm::HEAD + pixels * ((8 * Film::NUMBERS + aovs) as u64 + levels)
    }
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
    /// The films of the picture.
    pub amounts: Amounts,
    /// Text for the file of the picture.
    pub metadata: Metadata,
    /// The moments and AOVs so far.
    pub picture: Picture,
}

impl Checkpoint {
    /// Writes the file, whole or not at all.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        let film = &self.picture.film;
        let Window { x, y, w, h } = film.window;
        let (refused, first_refused) = refusals(&film.rejected);
        let header = Header {
            fingerprint: self.fingerprint.clone(),
            samples: self.samples,
            seconds: self.seconds,
            size: film.size.to_array(),
            window: [x, y, w, h],
            refused,
            first_refused,
            amounts: self.amounts.clone(),
            metadata: self.metadata.clone(),
            shared: shared(&film.sharing),
        };
        FILE.save(path, &header, |out| write(&self.picture, out))
    }

    /// Reads the checkpoint of this render; one of another version, scene or other settings is refused.
    pub fn load(path: &Path, ours: &Fingerprint) -> Result<Self, FileError> {
        let old = Self::open(path)?;
        old.check(path, ours)?;
        Ok(old)
    }

    /// An error unless the checkpoint, read from this file, is of this render.
    pub(crate) fn check(&self, path: &Path, ours: &Fingerprint) -> Result<(), FileError> {
        let differs = self.fingerprint.differs(ours, "checkpoint", "render");
        differs.map_err(|what| FileError::content(path, what))
    }

    /// Reads the checkpoint of any render, in this version of the file format.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let promised = |header: &Header| header.payload_bytes();
        let (header, payload): (Header, _) = FILE.load_of(path, promised)?;
        let [x, y, w, h] = header.window;
        let (size, window) = (UVec2::from_array(header.size), Window { x, y, w, h });
        let picture = read(size, window, &header.amounts, &payload);
        let mut picture = picture.map_err(|e| FileError::content(path, e))?;
        picture.film.rejected = rejected(header.refused, &header.first_refused);
        picture.film.sharing = sharing(&header.shared);
        Ok(Self {
            fingerprint: header.fingerprint,
            samples: header.samples,
            seconds: header.seconds,
            amounts: header.amounts,
            metadata: header.metadata,
            picture,
        })
    }
}

/// Batch sums of all pixels in the form of a header; empty if pixels share no light paths.
pub(super) fn shared(sharing: &Sharing) -> Vec<u64> {
    match sharing {
        Sharing::Batches(batches) => batches.numbers(),
        _ => Vec::new(),
    }
}

/// The inverse of [`shared`].
pub(super) fn sharing(numbers: &[u64]) -> Sharing {
    match Batches::from_numbers(numbers) {
        Some(batches) => Sharing::Batches(Box::new(batches)),
        None if numbers.is_empty() => Sharing::None,
        None => Sharing::Unknown,
    }
}

/// Decodes little-endian `f64` values.
fn numbers(bytes: &[u8]) -> Result<Vec<f64>, &'static str> {
    let numbers = bytes
        .chunks(8)
        .map(|b| b.try_into().map(f64::from_le_bytes));
    numbers.collect::<Result<_, _>>().map_err(|_| "cut short")
}

/// Refused samples that were not a number, and that were infinite; and the first of them: column, row, sample, and true
/// if it was infinite.
pub(super) type Refusals = ([u64; 2], Vec<(u32, u32, u32, bool)>);

/// Refused samples in the form of a header.
pub(super) fn refusals(rejected: &Rejected) -> Refusals {
    let first = rejected.first.iter();
    let first = first.map(|r| (r.pixel.x, r.pixel.y, r.sample, r.cause == Cause::Infinite));
    ([rejected.nan, rejected.infinite], first.collect())
}

/// The inverse of [`refusals`].
pub(super) fn rejected(refused: [u64; 2], first: &[(u32, u32, u32, bool)]) -> Rejected {
    let sample = |&(x, y, sample, infinite): &(u32, u32, u32, bool)| RejectedSample {
        pixel: UVec2::new(x, y),
        sample,
        cause: if infinite {
            Cause::Infinite
        } else {
            Cause::Nan
        },
    };
    let first = first.iter().take(Rejected::REMEMBERED);
    Rejected {
        nan: refused[0],
        infinite: refused[1],
        first: first.map(sample).collect(),
    }
}

/// Writes the film, its levels if there are any, and the AOVs.
pub(super) fn write(picture: &Picture, mut out: &mut dyn Write) -> io::Result<()> {
    for number in picture.film.numbers() {
        out.write_all(&number.to_le_bytes())?;
    }
    if let Some(levels) = &picture.levels {
        levels.write(&mut out)?;
    }
    for number in picture.aovs.iter().flat_map(Aovs::numbers) {
        out.write_all(&number.to_le_bytes())?;
    }
    Ok(())
}

/// The film without refused samples, its levels if there are any, and the AOVs if numbers follow.
pub(super) fn read(
    size: UVec2,
    window: Window,
    amounts: &Amounts,
    payload: &[u8],
) -> Result<Picture, String> {
    let end = (8 * Film::NUMBERS).saturating_mul(window.len());
    let (film, mut rest) = payload.split_at(end.min(payload.len()));
    let film = Film::from_numbers(size, window, &numbers(film)?).map_err(|e| e.to_string())?;
    let levels = match amounts.films() {
        0 => None,
        n => {
            let read = LevelFilm::read(size, window, &mut rest)?;
            if read.levels() != n {
                return Err(format!("it has {} levels in place of {n}", read.levels()));
            }
            Some(read)
        }
    };
    let aovs = match &numbers(rest)?[..] {
        [] => None,
        aovs if aovs.iter().any(|x| !x.is_finite()) => {
            return Err("sums of the AOVs are not finite".into());
        }
        aovs => {
            let recorded = Recorded::with_numbers(aovs.len() / window.len().max(1));
            let read = recorded.and_then(|recorded| Aovs::from_numbers(window, recorded, aovs));
            Some(read.ok_or("wrong number of AOVs")?)
        }
    };
    Ok(Picture { film, aovs, levels })
}
