//! A render from a program of one's own: a scene, a few choices, a picture. What it leaves out stands in
//! [`integrator`](crate::integrator): other estimators and rules, budgets of time and error, passes and their listener, checkpoints.

use crate::files::{FileError, hex};
use crate::image::display::{Display, ViewTransform, auto_exposure};
use crate::image::exr::{self, Header, Layer, Metadata, Storage};
use crate::image::film::{FilmError, Window};
use crate::image::{Buffer, png};
use crate::integrator::drive::{Budget, drive};
use crate::integrator::layers::{Aov, Layers};
use crate::integrator::levels::LevelError;
use crate::integrator::{Picture, Settings, View};
use crate::math::UVec2;
use crate::memory::{self, Shortage};
use crate::regularise::Rule;
use crate::regularise::file::TableFile;
use crate::resolve::{Resolve, Resolved, resolve_film};
use crate::sampler::SamplerKind;
use crate::scene::load::{LoadOptions, load};
use crate::scene::{Camera, Scene};
use std::ops::ControlFlow;
use std::path::Path;

impl Scene {
    /// The scene of a glTF file (`.gltf`, `.glb`), as it is in the file: without lights it is black.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let loaded = load(path.as_ref(), &LoadOptions::default())?;
        Ok(Self::new(loaded.parts))
    }
}

/// Errors of a render.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// The picture is empty or too large.
    #[error(transparent)]
    Size(#[from] FilmError),
    /// The picture does not fit into memory.
    #[error(transparent)]
    Memory(#[from] Shortage),
    /// The levels cannot be.
    #[error(transparent)]
    Levels(#[from] LevelError),
    /// A layer that several levels do not have.
    #[error("the layers emission, direct and indirect are those of one level: ask for levels(&[])")]
    Layers,
}

/// A render by path tracing, as `opsr render` makes it: the same choices give the same picture.
///
/// ```
/// use opsr::{Render, Scene};
///
/// let scene = Scene::open("training_scenes/rings.glb")?;
/// let plain = Render::new(&scene).size(16, 12).spp(2).run()?;
/// assert_eq!(plain.radiance().pixels.len(), 16 * 12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Render<'a> {
    scene: &'a Scene,
    camera: Option<Camera>,
    size: UVec2,
    spp: u32,
    settings: Settings,
    /// Scales of the levels, if they were chosen.
    levels: Option<Vec<f32>>,
    /// SHA-256 of the table.
    table: Option<String>,
    aovs: Vec<Aov>,
}

impl<'a> Render<'a> {
    /// A plain render of 640 × 480 pixels with 128 samples each and seed 0, by the scene's first camera, or by one that sees
    /// all of it.
    pub fn new(scene: &'a Scene) -> Self {
        Self {
            scene,
            camera: None,
            size: UVec2::new(640, 480),
            spp: 128,
            settings: Settings {
                sampler: SamplerKind::Sobol,
                ..Settings::default()
            },
            levels: None,
            table: None,
            aovs: Vec::new(),
        }
    }

    /// Width and height of the frame in pixels.
    pub fn size(mut self, width: u32, height: u32) -> Self {
        self.size = UVec2::new(width, height);
        self
    }

    /// Samples per pixel.
    pub fn spp(mut self, samples: u32) -> Self {
        self.spp = samples;
        self
    }

    /// Seed of all random numbers.
    pub fn seed(mut self, seed: u64) -> Self {
        self.settings.seed = seed;
        self
    }

    /// Another camera; those of the file are `scene.parts().cameras`.
    pub fn camera(mut self, camera: Camera) -> Self {
        self.camera = Some(camera);
        self
    }

    /// The attenuation factors of a table: a file, or `beta-0.001` or `beta-0.05`, which the library contains.
    pub fn table(mut self, table: impl AsRef<Path>) -> Result<Self, FileError> {
        let file = TableFile::load(table.as_ref())?;
        self.table = Some(hex(&file.digest()));
        self.settings.rule = Rule::with_table(file.table);
        Ok(self)
    }

    /// One attenuation factor in [0, 1] for all paths; 0 is plain path tracing.
    pub fn gamma(mut self, gamma: f32) -> Self {
        self.settings.rule = Rule::constant(gamma);
        self.table = None;
        self
    }

    /// Scales of the factors at several levels, ascending from 0, of which every pixel gets the best; empty for the factors
    /// as they are. By default four, where there is something to roughen.
    pub fn levels(mut self, scales: &[f32]) -> Self {
        self.levels = Some(scales.to_vec());
        self
    }

    /// Layers beside the picture, for EXR files.
    pub fn aovs(mut self, aovs: &[Aov]) -> Self {
        self.aovs = aovs.to_vec();
        self
    }

    /// Renders, on all threads of the current rayon pool. The picture does not depend on their number.
    pub fn run(&self) -> Result<Rendered, RenderError> {
        let mut settings = self.settings.clone();
        settings.levels = match &self.levels {
            Some(scales) => scales.clone(),
            None => settings.usual_levels(self.scene.has_lobes())?,
        };
        settings.check_levels()?;
        let recorded = Aov::recorded(&self.aovs);
        let [_, splits_light, _] = recorded;
        if splits_light && !settings.levels.is_empty() {
            return Err(RenderError::Layers);
        }
        let (size, window) = (self.size, Window::full(self.size));
        crate::image::Film::check(size, window)?;
        let what = format!("{}x{} pixels", size.x, size.y);
        memory::check(what, settings.bytes(size, window, recorded))?;
        let aspect = size.x as f32 / size.y as f32;
        let first = || self.scene.parts().cameras.first().cloned();
        let camera = self.camera.clone().or_else(first);
        let camera = camera.unwrap_or_else(|| self.scene.framing_camera(aspect));
        let view = View::new(self.scene, &camera, size, window);
        let mut picture = Picture::blank(size, window, settings.levels.len(), recorded)?;
        let budget = Budget {
            samples: Some(self.spp),
            ..Budget::default()
        };
        let mut integrator = settings.integrator();
        let listener = &mut |_: &_, _: &_| ControlFlow::Continue(());
        drive(&mut *integrator, &view, &budget, 0, &mut picture, listener);
        let mut metadata = settings.metadata("", "", self.table.as_deref());
        metadata.retain(|key, _| !key.starts_with("scene"));
        metadata.insert("spp".into(), self.spp.to_string());
        Ok(Rendered {
            choice: picture
                .levels
                .as_ref()
                .map(|film| resolve_film(film, Resolve::default())),
            layers: Layers::new(&self.aovs, &view).of(&picture),
            world_to_camera: camera.world_to_camera(),
            picture,
            metadata,
        })
    }
}

/// A finished render.
pub struct Rendered {
    /// The moments of every pixel, and what was recorded beside them.
    pub picture: Picture,
    /// The level of every pixel, for a render of several.
    pub choice: Option<Resolved>,
    /// The layers that were asked for.
    pub layers: Vec<Layer>,
    metadata: Metadata,
    world_to_camera: [f32; 16],
}

impl Rendered {
    /// The picture: linear radiance, Rec. 709 primaries.
    pub fn radiance(&self) -> Buffer {
        match &self.choice {
            Some(choice) => choice.picture.clone(),
            None => self.picture.film.mean(),
        }
    }

    /// Writes an EXR file with all layers, or a PNG file at the exposure that suits it, whole or not at all.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), FileError> {
        let path = path.as_ref();
        match path.extension().and_then(|e| e.to_str()) {
            Some("exr") => self.save_exr(path),
            Some("png") => {
                let shown = self.radiance();
                let exposure = auto_exposure(&shown);
                let view = ViewTransform::default();
                png::write(path, &shown, Display { exposure, view })
            }
            _ => Err(FileError::content(
                path,
                "expected a name that ends in .exr or .png",
            )),
        }
    }

    fn save_exr(&self, path: &Path) -> Result<(), FileError> {
        let film = &self.picture.film;
        let header = Header {
            metadata: &self.metadata,
            storage: Storage::default(),
            world_to_camera: Some(self.world_to_camera),
        };
        let Some(choice) = &self.choice else {
            return exr::write_film(path, film, &self.layers, header);
        };
        let mut layers = self.layers.clone();
        let level = choice.level.iter().map(|&k| f32::from(k)).collect();
        layers.push(Layer::scalar("level", level));
        layers.push(Layer::scalar("bias2", choice.bias2.clone()));
        layers.push(Layer::scalar("variance", choice.variance.clone()));
        layers.push(Layer::scalar("error", choice.error()));
        let part = (film.size, film.window);
        exr::write_layers(path, part, &choice.picture, &layers, header)
    }
}
