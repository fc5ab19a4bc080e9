//! Crops to learn from: a manifest's scenes, opened, with their references.

use crate::gallery::manifest::{CROP, Entry, Manifest, ManifestError, Role};
use crate::gallery::reference::{Reference, ReferenceError, SEED};
use crate::image::Film;
use crate::image::film::{FilmError, Window};
use crate::integrator::{Method, Settings};
use crate::math::UVec2;
use crate::regularise::{Accumulated, AttenuationTable, Regulariser};
use crate::sampler::{Independent, Seed};
use crate::scene::load::{LoadError, LoadOptions, load};
use crate::scene::{Camera, Scene};
use crate::train::learn::objective::Target;
use crate::train::record::proposals::Drawn;
use crate::train::record::recording::{Recording, Tape};
use crate::train::record::roulette::Thin;
use crate::tune::{self, Pilot, View};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A crop, its scene and its reference.
#[derive(Clone)]
pub struct Crop {
    /// Scene and place, such as `rings 16,72`.
    pub name: String,
    /// Name of the scene.
    pub scene_name: String,
    /// Scenes of one kind.
    pub family: String,
    /// What the scene is for.
    pub role: Role,
    /// The scene.
    pub scene: Arc<Scene>,
    /// SHA-256 of the scene's file.
    pub digest: [u8; 32],
    /// Its camera.
    pub camera: Camera,
    /// Size of the whole picture.
    pub frame: UVec2,
    /// Where the crop is.
    pub window: Window,
    /// Scattering vertices of the longest path.
    pub max_vertices: u32,
    /// Converged, unregularised radiance, row by row.
    pub reference: Vec<[f32; 3]>,
    /// Mean relative standard error of the reference's pixels, see [`Reference::noise`].
    pub reference_noise: f64,
}

/// Why crops could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum DatasetError {
    /// The manifest.
    #[error(transparent)]
    Manifest(#[from] ManifestError),
    /// A scene.
    #[error(transparent)]
    Scene(#[from] LoadError),
    /// A reference that cannot be read, or is one of another scene, crop or path length.
    #[error(transparent)]
    Reference(#[from] ReferenceError),
    /// No reference.
    #[error("{path}: there is no reference; `opsr scenes reference` makes it")]
    Missing {
        /// The file.
        path: PathBuf,
    },
    /// A camera or a reference that cannot be used.
    #[error("{path}: {problem}")]
    Shape {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        problem: String,
    },
    /// A crop outside of its frame.
    #[error("{name}: {source}")]
    Window {
        /// The crop.
        name: String,
        /// What is wrong with it.
        source: FilmError,
    },
}

impl Crop {
    /// Opens the crops of all scenes that `wanted` says.
    pub fn open_all(
        manifest: &Path,
        wanted: impl Fn(&Entry) -> bool,
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

    /// What the loss compares the crop with.
    pub fn target(&self, samples: u32) -> Target {
        Target {
            reference: self.reference.clone(),
            samples,
        }
    }

    /// Records the events of samples `0..spp`, lobes drawn with each of these constant factors; events that carry less
    /// than `roulette` times the reference are thinned out.
    pub fn record(
        &self,
        gammas: &[f32],
        roulette: f32,
        spp: u32,
        seed: Seed,
    ) -> Result<Recording, DatasetError> {
        let thin = Thin::new(&self.target(spp), roulette, seed);
        let drawn = Arc::new((Drawn::new(gammas), thin));
        let tape = Tape::drawn(self.window, drawn.clone());
        self.trace(&drawn.0, tape, spp, seed)
    }

    /// Records the events of samples `0..spp` with this attenuation.
    pub fn record_with<A: crate::regularise::Attenuation>(
        &self,
        rule: Accumulated<A>,
        spp: u32,
        seed: Seed,
    ) -> Result<Recording, DatasetError> {
        self.trace(rule, Tape::new(self.window), spp, seed)
    }

    fn trace<R: Regulariser>(
        &self,
        rule: R,
        mut tape: Tape,
        spp: u32,
        seed: Seed,
    ) -> Result<Recording, DatasetError> {
        let mut film = self.film()?;
        let settings = self.settings(Method::Plain);
        settings.tracer(rule).estimate(
            &self.scene,
            &self.camera,
            &Independent { seed },
            0..spp,
            &mut film,
            &mut tape,
        );
        Ok(tape.into())
    }

    /// What a pilot does to a table for a render of `samples` samples per pixel, without the reference.
    pub fn pilot(&self, table: &AttenuationTable, samples: u32) -> Result<Pilot, DatasetError> {
        let settings = self.settings(Method::Table {
            table: table.clone(),
            reuse: false,
            lambda: 0.0,
        });
        let view = View {
            scene: &self.scene,
            camera: &self.camera,
            frame: self.frame,
            window: self.window,
        };
        tune::choose(&settings, &view, samples).map_err(|e| self.outside(e))
    }

    /// How the crop is rendered.
    fn settings(&self, method: Method) -> Settings {
        Settings {
            method,
            max_vertices: self.max_vertices,
            ..Settings::default()
        }
    }

    /// An empty film of the crop.
    pub fn film(&self) -> Result<Film, DatasetError> {
        Film::cropped(self.frame, self.window).map_err(|e| self.outside(e))
    }

    fn outside(&self, source: FilmError) -> DatasetError {
        DatasetError::Window {
            name: self.name.clone(),
            source,
        }
    }
}

/// Pixels of a reference and their mean relative standard error.
fn read_reference(reference: &Reference) -> Result<(Vec<[f32; 3]>, f64), DatasetError> {
    let path = || reference.path().to_path_buf();
    if reference.samples() == 0 {
        return Err(DatasetError::Missing { path: path() });
    }
    let mean = reference.film().mean();
    if mean.first_non_finite().is_some() {
        return Err(DatasetError::Shape {
            path: path(),
            problem: "a pixel is not a finite number".into(),
        });
    }
    let pixels = mean.pixels.iter().map(|p| p.to_array()).collect();
    Ok((pixels, reference.noise().mean))
}
