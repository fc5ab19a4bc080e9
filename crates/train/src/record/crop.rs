//! Crops of a manifest's scenes with their references, and their recordings.

use crate::manifest::{CROP, Manifest, Role, SceneEntry};
use crate::record::proposals::Proposals;
use crate::record::recording::{Recording, Tape};
use crate::record::roulette::EventRoulette;
use crate::record::target::Target;
use crate::reference::{Reference, SEED};
use opsr::files::{FileError, hex};
use opsr::image::Film;
use opsr::image::film::{FilmError, Window};
use opsr::integrator::{PathObserver, Settings, View};
use opsr::math::UVec2;
use opsr::regularise::{Roughening, Rule};
use opsr::sampler::{Independent, Seed};
use opsr::scene::load::{LoadOptions, load};
use opsr::scene::{Camera, Scene};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// A window of a scene's image, and its reference.
#[derive(Clone)]
pub struct Crop {
    /// Name of the scene and position of the window, such as `rings 16,72`.
    pub name: String,
    /// Name of the scene.
    pub scene_name: String,
    /// Family of similar scenes.
    pub family: String,
    /// Training or validation.
    pub role: Role,
    /// The scene.
    pub scene: Arc<Scene>,
    /// SHA-256 of the scene's file.
    pub digest: [u8; 32],
    /// Camera of the image.
    pub camera: Camera,
    /// Size of the whole image in pixels.
    pub frame: UVec2,
    /// Pixels of the crop.
    pub window: Window,
    /// Maximum number of scattering vertices of a path.
    pub max_vertices: u32,
    /// Converged, unregularised radiance, row by row.
    pub reference: Vec<[f32; 3]>,
    /// Mean relative standard error of the reference's pixels, see [`Reference::noise`].
    pub reference_noise: f64,
}

/// Errors of opening and recording crops.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The manifest, a scene or a reference cannot be used.
    #[error(transparent)]
    File(#[from] FileError),
    /// A reference does not exist.
    #[error("{path}: there is no reference; `opsr scenes reference` makes it")]
    Missing {
        /// File of the reference.
        path: PathBuf,
    },
    /// The camera does not exist, or the reference has pixels that are not finite.
    #[error("{path}: {problem}")]
    Shape {
        /// The file.
        path: PathBuf,
        /// The problem.
        problem: String,
    },
    /// Recordings are missing from a folder.
    #[error("{}", unrecorded(folder, missing))]
    Unrecorded {
        /// The folder.
        folder: PathBuf,
        /// Names of the files.
        missing: Vec<String>,
    },
    /// The user ended the recording.
    #[error("stopped while recording")]
    Stopped,
    /// The crop lies outside of its frame.
    #[error("{name}: {cause}")]
    Window {
        /// Name of the crop.
        name: String,
        /// Error of the film.
        cause: FilmError,
    },
}

/// Names the first missing recordings.
fn unrecorded(folder: &Path, missing: &[String]) -> String {
    const NAMED: usize = 8;
    let (folder, named) = (folder.display(), missing.iter().take(NAMED));
    let named = named.cloned().collect::<Vec<_>>().join(", ");
    let more = match missing.len().saturating_sub(NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    format!("{folder}: missing recordings, which `opsr record` makes: {named}{more}")
}

impl Crop {
    /// Opens the crops of all scenes of a manifest that `wanted` accepts.
    pub(crate) fn open_all(
        manifest: &Path,
        wanted: impl Fn(&SceneEntry) -> bool,
    ) -> Result<Vec<Self>, DatasetError> {
        let manifest = Manifest::load(manifest)?;
        let mut crops = Vec::new();
        for entry in manifest.scenes.iter().filter(|e| wanted(e)) {
            let file = manifest.file(entry);
            let loaded = load(&file, &LoadOptions::default())?;
            let scene = Arc::new(Scene::new(loaded.parts));
            let camera = scene.parts().cameras.get(entry.camera).cloned();
            let camera = camera.ok_or_else(|| DatasetError::Shape {
                path: file.clone(),
                problem: format!("no camera {}", entry.camera),
            })?;
            for &[x, y] in &entry.crops {
                let file = Reference::open(&manifest, entry, [x, y], &loaded.digest, SEED)?;
                let (reference, reference_noise) = read_reference(&file)?;
                crops.push(Self {
                    name: format!("{} {x},{y}", entry.name),
                    scene_name: entry.name.clone(),
                    family: entry.family.clone(),
                    role: entry.role,
                    scene: scene.clone(),
                    digest: loaded.digest,
                    camera: camera.clone(),
                    frame: entry.frame.into(),
                    window: Window {
                        x,
                        y,
                        w: CROP,
                        h: CROP,
                    },
                    max_vertices: entry.max_vertices,
                    reference,
                    reference_noise,
                });
            }
        }
        Ok(crops)
    }

    /// The crop's reference, for renders of `samples` samples per pixel.
    pub fn target(&self, samples: u32) -> Target {
        Target {
            reference: self.reference.clone(),
            samples,
        }
    }

    /// Records the events of samples `0..spp`. Lobes are sampled with each of the constant factors `gammas`. Events
    /// that carry less than `roulette` times the reference undergo Russian roulette.
    pub fn record(
        &self,
        gammas: &[f32],
        roulette: f32,
        spp: u32,
        seed: Seed,
    ) -> Result<Recording, DatasetError> {
        self.record_until(gammas, roulette, spp, seed, &Arc::default())
    }

    /// [`Crop::record`], which ends with [`DatasetError::Stopped`] as soon as `stop` is set.
    pub(crate) fn record_until(
        &self,
        gammas: &[f32],
        roulette: f32,
        spp: u32,
        seed: Seed,
        stop: &Arc<AtomicBool>,
    ) -> Result<Recording, DatasetError> {
        let roulette = EventRoulette::new(&self.target(spp), roulette, seed);
        let drawn = Arc::new((Proposals::new(gammas), roulette));
        let tape = Tape::drawn(self.window, drawn.clone()).until(stop.clone());
        self.trace(&drawn.0, tape, spp, seed)
    }

    /// SHA-256, in hexadecimal digits, of all that a recording with these arguments depends on.
    pub fn fingerprint(&self, gammas: &[f32], roulette: f32, spp: u32, seed: Seed) -> String {
        let mut digest = Sha256::new();
        let Self {
            name,
            camera,
            frame,
            window,
            max_vertices,
            ..
        } = self;
        digest.update(format!(
            "{} {name:?} {camera:?} {frame:?} {window:?} {max_vertices} {gammas:?} {roulette} {spp} {seed:?} ",
            env!("CARGO_PKG_VERSION")
        ));
        digest.update(self.digest);
        for value in self.reference.iter().flatten() {
            digest.update(value.to_le_bytes());
        }
        hex(&digest.finalize())
    }

    /// Records the events of samples `0..spp` with this rule; each lobe is sampled once, at the rule's roughness.
    pub fn record_with(&self, rule: Rule, spp: u32, seed: Seed) -> Result<Recording, DatasetError> {
        self.trace(rule, Tape::new(self.window), spp, seed)
    }

    fn trace<R: Roughening>(
        &self,
        rule: R,
        mut tape: Tape,
        spp: u32,
        seed: Seed,
    ) -> Result<Recording, DatasetError> {
        let mut film = self.film()?;
        let settings = self.settings(Rule::Plain);
        settings.tracer(rule).estimate(
            &self.view(),
            &Independent { seed },
            0..spp,
            &mut film,
            &mut tape,
        );
        match tape.stopped() {
            true => Err(DatasetError::Stopped),
            false => Ok(tape.into()),
        }
    }

    /// Settings of a render of the crop.
    pub(crate) fn settings(&self, rule: Rule) -> Settings {
        Settings {
            rule,
            max_vertices: self.max_vertices,
            ..Settings::default()
        }
    }

    /// View of the crop, for integrators.
    pub fn view(&self) -> View<'_> {
        View::new(&self.scene, &self.camera, self.frame, self.window)
    }

    /// An empty film of the crop.
    pub fn film(&self) -> Result<Film, DatasetError> {
        Film::cropped(self.frame, self.window).map_err(|e| self.outside(e))
    }

    pub(crate) fn outside(&self, cause: FilmError) -> DatasetError {
        DatasetError::Window {
            name: self.name.clone(),
            cause,
        }
    }
}

/// Pixels of a reference, and their mean relative standard error.
fn read_reference(reference: &Reference) -> Result<(Vec<[f32; 3]>, f64), DatasetError> {
    let path = || reference.path().to_path_buf();
    if reference.samples() == 0 {
        return Err(DatasetError::Missing { path: path() });
    }
    let mean = reference.film().mean();
    if mean.pixels.iter().any(|p| !p.is_finite()) {
        return Err(DatasetError::Shape {
            path: path(),
            problem: "a pixel is not a finite number".into(),
        });
    }
    let pixels = mean.pixels.iter().map(|p| p.to_array()).collect();
    Ok((pixels, reference.noise().mean))
}
