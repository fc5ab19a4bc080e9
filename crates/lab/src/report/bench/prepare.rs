//! Scenes prepared for measurement: loaded, with a reference that is rendered once and cached.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use super::BenchError;
use super::results::{Inset, SceneFacts};
use super::suite::SceneSpec;
use crate::gallery;
use opsr::files::{self, hex};
use opsr::image::film::{Film, Window};
use opsr::image::relative::EPSILON;
use opsr::image::{Buffer, exr};
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::drive::{Budget, Reason, drive};
use opsr::integrator::{Picture, Settings, View};
use opsr::math::DVec3;
use opsr::render::{Heading, Spec};
use opsr::scene::load::load;
use opsr::scene::{Camera, Environment, Scene, SceneParts};
use sha2::{Digest, Sha256};

/// Seed of references, far from the seeds of the suite: their paths must not be in the reference.
const REFERENCE_SEED: u64 = 0x7e7e_7e7e_0000_0001;

/// A scene that is ready to be measured.
pub(super) struct Prepared {
    pub(super) scene: Scene,
    pub(super) camera: Camera,
    pub(super) blank: Film,
    pub(super) reference: Buffer,
    pub(super) facts: SceneFacts,
}

fn fault(spec: &SceneSpec, reason: impl ToString) -> BenchError {
    BenchError::Scene {
        place: format!("`{}`", spec.name),
        reason: reason.to_string(),
    }
}

/// Loads a scene and finds or renders its reference; `None` if the callback stops the rendering.
pub(super) fn prepare(
    spec: &SceneSpec,
    cache: &Path,
    listener: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Option<Prepared>, BenchError> {
    let (mut parts, mut source) = parts(spec)?;
    if let Some(path) = &spec.environment {
        parts.environment = Some(Environment::load(path, 1.0, 0.0)?);
        let mut digest = Sha256::new_with_prefix(&source);
        Environment::bytes(path, |bytes| digest.update(bytes))?;
        source = hex(&digest.finalize());
    }
    let options = &spec.options.0;
    if *options != Spec::default() {
        let mut digest = Sha256::new_with_prefix(&source);
        digest.update(options.words(&[Heading::Scene, Heading::Light]));
        // A suite states its light: there is none by default.
        let own = parts.environment.take();
        let surroundings = options.surroundings(own, true, |bytes| digest.update(bytes));
        parts.environment = surroundings.map_err(|e| fault(spec, e))?;
        source = hex(&digest.finalize());
    }
    let scene = Scene::new(parts);
    let camera = camera(spec, &scene)?;
    let blank = Film::cropped(spec.frame(), spec.window()).map_err(|e| fault(spec, e))?;
    let triangles = scene.geometry().triangle_count();
    let mut prepared = Prepared {
        scene,
        camera,
        blank,
        reference: Buffer::default(),
        facts: SceneFacts {
            name: spec.name.clone(),
            triangles,
            source,
            reference: String::new(),
            reference_noise: 0.0,
        },
    };
    let found = match (&spec.reference, spec.reference_spp) {
        (Some(path), _) => prepared.given(spec, path).map(Some),
        (None, spp) => prepared.made(spec, spp.unwrap_or(1), cache, listener),
    };
    Ok(found?.map(|()| prepared))
}

fn parts(spec: &SceneSpec) -> Result<(SceneParts, String), BenchError> {
    if let Some(path) = &spec.file {
        let mut options = spec.options.0.load_options(opsr_formats::FORMATS);
        if spec.options.0.distribution.is_none() {
            options.distribution = Some(spec.distribution.into());
        }
        let loaded = load(path, &options)?;
        return Ok((loaded.parts, hex(&loaded.digest)));
    }
    let name = spec.builtin.as_deref().unwrap_or_default();
    let parts = gallery::builtin(name).ok_or_else(|| {
        let names: Vec<&str> = gallery::names().collect();
        fault(
            spec,
            format!("no builtin scene `{name}`: there are {}", names.join(", ")),
        )
    })?;
    Ok((parts, name.to_owned()))
}

fn camera(spec: &SceneSpec, scene: &Scene) -> Result<Camera, BenchError> {
    let cameras = &scene.parts().cameras;
    let Some(wanted) = &spec.camera else {
        let aspect = spec.size[0] as f32 / spec.size[1] as f32;
        let framing = || scene.framing_camera(aspect);
        return Ok(cameras.first().cloned().unwrap_or_else(framing));
    };
    let by_name = cameras.iter().find(|c| &c.name == wanted);
    let by_number = || wanted.parse::<usize>().ok().and_then(|i| cameras.get(i));
    by_name
        .or_else(by_number)
        .cloned()
        .ok_or_else(|| fault(spec, format!("no camera `{wanted}`")))
}

impl Prepared {
    /// Reads the reference from a file: a film, whose noise is known, or any picture of the right size.
    fn given(&mut self, spec: &SceneSpec, path: &Path) -> Result<(), BenchError> {
        self.facts.reference = path.display().to_string();
        if let Ok(film) = exr::read_film(path)
            && film.size == spec.frame()
            && self.blank.window.inside(&film.window)
        {
            self.take(&film.cut(self.blank.window));
            return Ok(());
        }
        let picture = exr::read_rgb(path)?;
        let (frame, window) = (spec.frame(), self.blank.window);
        self.reference = match picture.size() {
            (w, h) if (w, h) == (window.w as usize, window.h as usize) => picture,
            (w, h) if (w, h) == (frame.x as usize, frame.y as usize) => {
                cut(&picture, window, (0, 0))
            }
            (w, h) => {
                let wanted = format!("neither the frame nor the crop is {w}x{h}");
                return Err(fault(spec, format!("{}: {wanted}", path.display())));
            }
        };
        Ok(())
    }

    /// Renders the reference, unless the cache has it.
    fn made(
        &mut self,
        spec: &SceneSpec,
        spp: u32,
        cache: &Path,
        listener: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Option<()>, BenchError> {
        let path = self.cached(spec, spp, cache);
        self.facts.reference = format!("{spp} spp, {}", file_name(&path));
        if path.exists() {
            self.take(&exr::read_film(&path)?);
            return Ok(Some(()));
        }
        let settings = Settings {
            estimator: spec.reference_integrator.estimator(Radius::default()),
            max_vertices: spec.max_vertices,
            seed: REFERENCE_SEED,
            ..Settings::default()
        };
        let mut picture = Picture {
            film: self.blank.clone(),
            aovs: None,
            levels: None,
        };
        let budget = Budget {
            samples: Some(spp),
            ..Budget::default()
        };
        let (_, reason) = drive(
            &mut *settings.integrator(),
            &View::of(&self.scene, &self.camera, &self.blank),
            &budget,
            0,
            &mut picture,
            &mut |progress, _| listener(progress.fraction.unwrap_or(0.0)),
        );
        if reason == Reason::Stopped {
            return Ok(None);
        }
        files::create_folder(cache)?;
        exr::write_film(&path, &picture.film, &[], &exr::Metadata::new())?;
        // Read back from the file, so that the reference of a resumed bench is bit-identical.
        self.take(&exr::read_film(&path)?);
        Ok(Some(()))
    }

    fn cached(&self, spec: &SceneSpec, spp: u32, cache: &Path) -> PathBuf {
        let mut what = serde_json::json!([
            env!("CARGO_PKG_VERSION"),
            self.facts.source,
            spec.distribution,
            spec.size,
            spec.crop,
            spec.camera,
            spec.max_vertices,
            spp,
        ]);
        if !spec.reference_integrator.is_path()
            && let Some(list) = what.as_array_mut()
        {
            list.push(serde_json::json!(spec.reference_integrator));
        }
        cache.join(format!("reference-{}.exr", short_hash(&what)))
    }

    fn take(&mut self, film: &Film) {
        self.reference = film.mean();
        let epsilon = DVec3::splat(EPSILON);
        let noise = film
            .pixels
            .iter()
            .map(|m| (m.variance_of_mean() / (m.mean * m.mean + epsilon)).element_sum())
            .sum::<f64>();
        self.facts.reference_noise = noise / (3.0 * film.pixels.len() as f64);
    }
}

/// The window of a picture whose first pixel is at `origin` of the frame.
fn cut(picture: &Buffer, window: Window, origin: (u32, u32)) -> Buffer {
    let (x0, y0) = (
        (window.x - origin.0) as usize,
        (window.y - origin.1) as usize,
    );
    Buffer::from_fn(window.w as usize, window.h as usize, |x, y| {
        picture.pixels[(y0 + y) * picture.width + x0 + x]
    })
}

/// The part of a picture that the report shows.
pub(super) fn inset(spec: &SceneSpec, method: Option<&str>, key: &str, picture: &Buffer) -> Inset {
    let (window, outer) = (spec.inset_window(), spec.window());
    Inset {
        scene: spec.name.clone(),
        method: method.map(str::to_owned),
        key: key.to_owned(),
        samples: 0,
        seconds: 0.0,
        width: window.w as usize,
        pixels: Inset::encode(&cut(picture, window, (outer.x, outer.y))),
    }
}

/// The first half of a SHA-256 in hexadecimal digits, which identifies files and runs.
pub(super) fn short_hash(what: &serde_json::Value) -> String {
    hex(&Sha256::digest(what.to_string().as_bytes())[..16])
}

pub(super) fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}
