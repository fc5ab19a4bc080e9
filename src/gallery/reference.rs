//! Converged pictures of a manifest's crops, and rendering that goes on where a file stopped.
//!
//! A file holds, for each pixel, the mean, the variance of one sample and the number of samples; that is all that
//! [`Moments`](crate::math::moments::Moments) needs to take more. The metadata say which sample number comes next, so
//! that no sample is used twice. While a run lasts the moments are double precision (Welford's update: no large sums,
//! nothing cancels); a file rounds them to single precision, a relative error of at most 6e-8 each time a run is
//! resumed, thousands of times less than the noise of any reference.

use crate::files::hex;
use crate::gallery::manifest::{CROP, Entry, Manifest};
use crate::image::Film;
use crate::image::exr::{self, ExrError, Metadata};
use crate::image::film::{FilmError, Window};
use crate::integrator::{Picture, Settings, View};
use crate::math::{DVec3, UVec2};
use crate::scene::{Camera, Scene};
use std::io;
use std::path::{Path, PathBuf};

/// Seed of references unless another is asked for. Not a seed that anyone renders or trains with: a picture that
/// shares samples with its reference would look better than it is.
pub const SEED: u64 = 0x7265_6665_7265;

/// A reference, finished or not.
#[derive(Clone, Debug)]
pub struct Reference {
    path: PathBuf,
    stamp: Metadata,
    settings: Settings,
    next: u32,
    picture: Picture,
}

/// Added to a pixel before something is divided by it, as part of the crop's mean: the ε = 0.01 of a loss on crops
/// that are scaled to a mean of 0.3.
const DARKEST: f64 = 1.0 / 30.0;

/// How noisy a reference is: the standard error of a pixel's mean over the pixel (plus a thirtieth of the crop's mean).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Mean over the pixels: what it adds to a relative L1 error, but for a factor of √(2/π).
    pub mean: f64,
    /// Median over the pixels.
    pub median: f64,
    /// Nine of ten pixels have less than this.
    pub p90: f64,
}

/// Why a reference could not be read or written.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// The file could not be read or written.
    #[error(transparent)]
    Exr(#[from] ExrError),
    /// The file holds something else than what is to be rendered.
    #[error(
        "{}: its {what} is `{theirs}`, expected `{ours}`; remove the file to render it anew", path.display()
    )]
    Other {
        /// The file.
        path: PathBuf,
        /// In what it differs.
        what: String,
        /// What the file says.
        theirs: String,
        /// What it should say.
        ours: String,
    },
    /// The file does not say how many samples it has.
    #[error("{}: no number of samples in its metadata", .0.display())]
    Samples(PathBuf),
    /// A crop outside of its frame, or a file of another one.
    #[error("{}: {source}", path.display())]
    Place {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        source: FilmError,
    },
    /// The folder could not be made.
    #[error("{}: {source}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

impl Reference {
    /// The reference of an entry's crop as far as its file goes, or an empty one; `digest` is that of the scene's file.
    ///
    /// A file of another scene, crop, seed or path length is refused.
    pub fn open(
        manifest: &Manifest,
        entry: &Entry,
        crop: [u32; 2],
        digest: &[u8; 32],
        seed: u64,
    ) -> Result<Self, ReferenceError> {
        let settings = Settings {
            max_vertices: entry.max_vertices,
            seed,
            ..Settings::default()
        };
        let path = manifest.reference(entry, crop);
        let frame = UVec2::from(entry.frame);
        let [x, y] = crop;
        let window = Window {
            x,
            y,
            w: CROP,
            h: CROP,
        };
        let place = |source| ReferenceError::Place {
            path: path.clone(),
            source,
        };
        let mut film = Film::cropped(frame, window).map_err(place)?;
        let stamp = stamp(entry, digest, &settings);
        let mut next = 0;
        if path.exists() {
            let stored = exr::read_film(&path)?;
            let metadata = exr::read_layers(&path)?.metadata;
            check(&path, &stamp, &metadata)?;
            film.same_place(&stored).map_err(place)?;
            let samples = metadata.get("spp").and_then(|n| n.parse().ok());
            next = samples.ok_or_else(|| ReferenceError::Samples(path.clone()))?;
            film = stored;
        }
        Ok(Self {
            path,
            stamp,
            settings,
            next,
            picture: Picture { film, aovs: None },
        })
    }

    /// Adds the next `samples` samples to every pixel.
    pub fn extend(&mut self, scene: &Scene, camera: &Camera, samples: u32) {
        let end = self.next.saturating_add(samples);
        let view = View::of(scene, camera, &self.picture.film);
        (self.settings.integrator()).pass(&view, self.next..end, &mut self.picture);
        self.next = end;
    }

    /// Writes the file, whole or not at all.
    pub fn save(&self) -> Result<(), ReferenceError> {
        if let Some(folder) = self.path.parent() {
            std::fs::create_dir_all(folder).map_err(|source| ReferenceError::Folder {
                path: folder.to_owned(),
                source,
            })?;
        }
        let mut metadata = self.stamp.clone();
        metadata.insert("spp".into(), self.next.to_string());
        exr::write_film(&self.path, &self.picture.film, &[], &metadata)?;
        Ok(())
    }

    /// Samples of each pixel so far.
    pub fn samples(&self) -> u32 {
        self.next
    }

    /// The moments so far.
    pub fn film(&self) -> &Film {
        &self.picture.film
    }

    /// Its file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// How noisy it is; infinite while there are no two samples.
    pub fn noise(&self) -> Noise {
        let pixels = &self.film().pixels;
        if pixels.iter().any(|p| p.n < 2) {
            return Noise {
                mean: f64::INFINITY,
                median: f64::INFINITY,
                p90: f64::INFINITY,
            };
        }
        let grey = |v: DVec3| v.element_sum() / 3.0;
        let count = pixels.len() as f64;
        let crop = pixels.iter().map(|p| grey(p.mean)).sum::<f64>() / count;
        let floor = (DARKEST * crop).max(f64::MIN_POSITIVE);
        let mut relative: Vec<f64> = (pixels.iter())
            .map(|p| grey(p.variance_of_mean().map(f64::sqrt)) / (grey(p.mean) + floor))
            .collect();
        relative.sort_by(f64::total_cmp);
        let at = |share: f64| relative[(share * (count - 1.0)).round() as usize];
        Noise {
            mean: relative.iter().sum::<f64>() / count,
            median: at(0.5),
            p90: at(0.9),
        }
    }
}

/// What a file says about what it shows; frame and crop are the file's windows.
fn stamp(entry: &Entry, digest: &[u8; 32], settings: &Settings) -> Metadata {
    [
        ("scene", entry.name.clone()),
        ("scene_sha256", hex(digest)),
        ("camera", entry.camera.to_string()),
        ("method", "plain".to_owned()),
        ("max_vertices", settings.max_vertices.to_string()),
        ("roulette_start", settings.roulette_start.to_string()),
        ("seed", settings.seed.to_string()),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into()
}

fn check(path: &Path, ours: &Metadata, theirs: &Metadata) -> Result<(), ReferenceError> {
    let found = |key: &str| theirs.get(key).map_or("not said", String::as_str);
    match ours.iter().find(|(key, value)| found(key) != *value) {
        None => Ok(()),
        Some((key, value)) => Err(ReferenceError::Other {
            path: path.to_owned(),
            what: key.clone(),
            theirs: found(key).to_owned(),
            ours: value.clone(),
        }),
    }
}
