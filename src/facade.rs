//! A render from a program of one's own: a scene, a few choices, a picture. What it leaves out stands in
//! [`integrator`](crate::integrator): other estimators and rules, budgets of time and error, passes and their listener, checkpoints.

use crate::files::FileError;
use crate::image::display::{Display, ViewTransform, auto_exposure};
use crate::image::exr::{self, Header, Layer, Metadata, Storage};
use crate::image::{Buffer, png};
use crate::integrator::Picture;
use crate::integrator::layers::{Aov, Layers};
use crate::math::UVec2;
use crate::pilot::witness::Missing;
use crate::regularise::file::TableFile;
use crate::render::value::{self, Levels, Size, TableChoice};
use crate::render::{Fault, Request, Spec, Subject, run};
use crate::resolve::{Resolved, resolve_film};
use crate::scene::load::{LoadOptions, load};
use crate::scene::{Camera, Scene};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

impl Scene {
    /// The scene of a glTF file (`.gltf`, `.glb`), or with the feature `scenes` of a pbrt (`.pbrt`) or Mitsuba (`.xml`) file, as it
    /// is in the file: without lights it is black.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let loaded = load(path.as_ref(), &LoadOptions::default())?;
        Ok(Self::new(loaded.parts))
    }
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
    spec: Spec,
}

impl<'a> Render<'a> {
    /// A plain render of 640 × 480 pixels with 128 samples each and seed 0, by the scene's first camera, or by one that sees
    /// all of it.
    pub fn new(scene: &'a Scene) -> Self {
        Self {
            scene,
            camera: None,
            spec: Spec {
                size: Some(Size::Pixels(UVec2::new(640, 480))),
                ..Spec::default()
            },
        }
    }

    /// Every option of the program, by the names that Python and suites have for them.
    pub fn with(mut self, change: impl FnOnce(&mut Spec)) -> Self {
        change(&mut self.spec);
        self
    }

    /// Width and height of the frame in pixels.
    pub fn size(self, width: u32, height: u32) -> Self {
        let size = Size::Pixels(UVec2::new(width, height));
        self.with(|spec| spec.size = Some(size))
    }

    /// Samples per pixel.
    pub fn spp(self, samples: u32) -> Self {
        self.with(|spec| spec.spp = Some(samples))
    }

    /// Seed of all random numbers.
    pub fn seed(self, seed: u64) -> Self {
        self.with(|spec| spec.seed = Some(seed))
    }

    /// Another camera; those of the file are `scene.parts().cameras`.
    pub fn camera(mut self, camera: Camera) -> Self {
        self.camera = Some(camera);
        self
    }

    /// The attenuation factors of a table: a file, or `beta-0.001` or `beta-0.05`, which the library contains.
    pub fn table(self, table: impl AsRef<Path>) -> Result<Self, FileError> {
        let file = Arc::new(TableFile::load(table.as_ref())?);
        Ok(self.with(|spec| (spec.table, spec.gamma) = (Some(TableChoice::Held(file)), None)))
    }

    /// One attenuation factor in [0, 1] for all paths; 0 is plain path tracing.
    pub fn gamma(self, gamma: f32) -> Self {
        self.with(|spec| (spec.table, spec.gamma) = (None, Some(gamma)))
    }

    /// Scales of the factors at several levels, ascending from 0, of which every pixel gets the best; empty for the factors
    /// as they are. By default four, where there is something to roughen.
    pub fn levels(self, scales: &[f32]) -> Self {
        self.with(|spec| spec.levels = Some(Levels(scales.to_vec())))
    }

    /// Layers beside the picture, for EXR files.
    pub fn aovs(self, aovs: &[Aov]) -> Self {
        self.with(|spec| spec.aov = Some(value::Layers(aovs.to_vec())))
    }

    /// Renders, on all threads of the current rayon pool. The picture does not depend on their number.
    pub fn run(&self) -> Result<Rendered, Fault> {
        let subject = Subject {
            scene: self.scene,
            name: "",
            sha256: "",
        };
        let request = Request::new(&self.spec, subject, self.camera.clone())?;
        let (request, output) = run(request, &mut |_, _| ControlFlow::Continue(()))?;
        let picture = output.picture;
        let refused = picture.film.rejected.total();
        let mut metadata = request.metadata(output.progress.samples, refused);
        if let Some(missing) = &output.missing {
            missing.note(&mut metadata);
        }
        Ok(Rendered {
            choice: (picture.levels.as_ref())
                .map(|film| resolve_film(film, request.spec.resolve())),
            layers: Layers::new(request.spec.aovs(), &request.view()).of(&picture),
            world_to_camera: request.camera.world_to_camera(),
            metadata,
            picture,
            missing: output.missing,
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
    /// Light that a witness has found and the picture lacks.
    pub missing: Option<Missing>,
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
        layers.extend(choice.layers());
        let part = (film.size, film.window);
        exr::write_layers(path, part, &choice.picture, &layers, header)
    }
}
