//! Converged pictures of a manifest's crops, rendered with resumption from their files.
//!
//! A file stores mean, variance of one sample and number of samples of each pixel, which suffice to add samples to
//! [`Moments`](opsr::math::moments::Moments). The metadata name the next sample number, so that no sample is used
//! twice. During a run the moments have double precision (Welford's update: no large sums, no cancellation). A file
//! rounds them to single precision: a relative error of at most 6e-8 for each resumed run, thousands of times less than
//! the noise.

use crate::manifest::{CROP, Manifest, SceneEntry};
use opsr::files::{self, FileError, hex};
use opsr::image::Film;
use opsr::image::exr::{self, Metadata};
use opsr::image::film::{FilmError, Window};
use opsr::integrator::{Picture, Settings, View};
use opsr::math::{DVec3, UVec2};
use opsr::scene::{Camera, Scene};
use std::path::{Path, PathBuf};

/// Default seed of references. Renders and trainings use others: a picture that shares samples with its reference would
/// look better than it is.
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

/// Share of the crop's mean that is added to a pixel in the denominator of a relative error: the ε = 0.01 of a loss on
/// crops scaled to a mean of 0.3.
const DARKEST: f64 = 1.0 / 30.0;

/// Noise of a reference: the standard error of a pixel's mean, divided by the pixel plus a thirtieth of the crop's
/// mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// Mean over the pixels: the contribution to a relative L1 error, up to a factor of √(2/π).
    pub mean: f64,
    /// Median over the pixels.
    pub median: f64,
    /// 90th percentile over the pixels.
    pub p90: f64,
}

impl Reference {
    /// Opens the reference of an entry's crop with the samples of its file, or an empty one if there is no file.
    /// `digest` is the SHA-256 of the scene's file. Fails for a file of another scene, camera, crop, seed or path
    /// length.
    pub fn open(
        manifest: &Manifest,
        entry: &SceneEntry,
        crop: [u32; 2],
        digest: &[u8; 32],
        seed: u64,
    ) -> Result<Self, FileError> {
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
        let place = |e| FileError::content(&path, e);
        let mut film = Film::cropped(frame, window).map_err(place)?;
        let stamp = stamp(entry, digest, &settings);
        let mut next = 0;
        if path.exists() {
            let stored = exr::read_film(&path)?;
            let metadata = exr::read_layers(&path)?.metadata;
            check(&path, &stamp, &metadata)?;
            let [a, b] = [&film, &stored].map(|film| (film.size, film.window));
            if a != b {
                return Err(place(FilmError::Differ { a, b }));
            }
            let samples = metadata.get("spp").and_then(|n| n.parse().ok());
            next = samples
                .ok_or_else(|| FileError::content(&path, "no number of samples in its metadata"))?;
            film = stored;
        }
        Ok(Self {
            path,
            stamp,
            settings,
            next,
            picture: Picture::new(film),
        })
    }

    /// Adds the next `samples` samples to every pixel.
    pub fn extend(&mut self, scene: &Scene, camera: &Camera, samples: u32) {
        let end = self.next.saturating_add(samples);
        let view = View::of(scene, camera, &self.picture.film);
        self.settings
            .integrator()
            .pass(&view, self.next..end, &mut self.picture);
        self.next = end;
    }

    /// Writes the file, whole or not at all.
    pub fn save(&self) -> Result<(), FileError> {
        if let Some(folder) = self.path.parent() {
            files::create_folder(folder)?;
        }
        let mut metadata = self.stamp.clone();
        metadata.insert("spp".into(), self.next.to_string());
        exr::write_film(&self.path, &self.picture.film, &[], &metadata)
    }

    /// Samples of each pixel so far.
    pub fn samples(&self) -> u32 {
        self.next
    }

    /// The moments so far.
    pub fn film(&self) -> &Film {
        &self.picture.film
    }

    /// Path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Noise so far; infinite for less than two samples.
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
        let mut relative: Vec<f64> = pixels
            .iter()
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

/// Metadata that identify the content of a file; frame and crop are the file's windows.
fn stamp(entry: &SceneEntry, digest: &[u8; 32], settings: &Settings) -> Metadata {
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

fn check(path: &Path, ours: &Metadata, theirs: &Metadata) -> Result<(), FileError> {
    let found = |key: &str| theirs.get(key).map_or("not said", String::as_str);
    match ours.iter().find(|(key, value)| found(key) != *value) {
        None => Ok(()),
        Some((key, value)) => {
            let differs = format!("its {key} is `{}`, expected `{value}`", found(key));
            let what = format!("{differs}; remove the file to render it anew");
            Err(FileError::content(path, what))
        }
    }
}
