//! A render from another program: a scene, a few options, a picture. Other estimators and rules, limits of time and
//! error, callbacks between passes, and checkpoints are in [`integrator`](crate::integrator).

use crate::files::FileError;
use crate::integrator::layers::Aov;
use crate::math::UVec2;
use crate::regularise::file::TableFile;
use crate::render::value::{self, Levels, ResolveChoice, Size, TableChoice};
use crate::render::{Fault, Finished, Outcome, Request, Spec, Subject, run};
use crate::scene::load::{LoadOptions, load};
use crate::scene::{Camera, Scene};
use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

impl Scene {
    /// The scene of a glTF file (`.gltf`, `.glb`), or with the feature `scenes` of a pbrt (`.pbrt`) or Mitsuba (`.xml`)
    /// file. No lights are added: a file without lights gives a black picture.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let loaded = load(path.as_ref(), &LoadOptions::default())?;
        Ok(Self::new(loaded.parts))
    }
}

/// A render as `opsr render` makes it: the same choices give the same picture.
///
/// ```
/// use opsr::{Render, Scene};
///
/// let scene = Scene::open("training_scenes/rings.glb")?;
/// let plain = Render::new(&scene).size(16, 12).spp(2).run()?;
/// assert_eq!(plain.shown.picture.pixels.len(), 16 * 12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Render<'a> {
    scene: &'a Scene,
    camera: Option<Camera>,
    spec: Spec,
}

impl<'a> Render<'a> {
    /// A render of 640 × 480 pixels with 128 samples each and seed 0. The camera is the scene's first, or else one that
    /// frames the whole scene; the integrator is the one that suits the scene.
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

    /// Path tracing with the attenuation factors of a table: a file, or the built-in `beta-0.001` or `beta-0.05`.
    pub fn table(self, table: impl AsRef<Path>) -> Result<Self, FileError> {
        let path = table.as_ref();
        let table = TableChoice::Loaded(Arc::new(TableFile::load(path)?), Some(path.into()));
        Ok(self.with(|spec| spec.table = Some(table)))
    }

    /// Path tracing with one attenuation factor in [0, 1] for all paths; 0 is plain path tracing.
    pub fn gamma(self, gamma: f32) -> Self {
        self.with(|spec| spec.table = Some(TableChoice::Factor(gamma)))
    }

    /// Scales of the factors at several levels, ascending from 0; every pixel gets the best level. By default four, if
    /// the scene has glossy lobes.
    pub fn levels(self, scales: &[f32]) -> Self {
        self.with(|spec| spec.levels = Some(Levels::At(scales.to_vec())))
    }

    /// The means of all samples at the factors as they are, without levels and blurs.
    pub fn raw(self) -> Self {
        self.with(|spec| spec.resolve = Some(ResolveChoice::Raw))
    }

    /// Layers beside the picture, for EXR files.
    pub fn aovs(self, aovs: &[Aov]) -> Self {
        self.with(|spec| spec.aov = Some(value::Layers(aovs.to_vec())))
    }

    /// Renders, on all threads of the current rayon pool. The picture does not depend on their number.
    pub fn run(&self) -> Result<Finished<'static>, Fault> {
        let subject = Subject {
            scene: self.scene,
            name: "",
            sha256: "",
            in_studio: false,
        };
        let denoiser = self.spec.denoiser()?;
        let request = Request::new(&self.spec, subject, self.camera.clone())?;
        let (request, output) = run(request, &mut |_, _| ControlFlow::Continue(()))?;
        let film = Cow::Owned(output.picture);
        let samples = output.progress.samples;
        Outcome::of(&request, film, samples, output.missing).finish(denoiser.as_ref())
    }
}
