//! Scenes.

use crate::errors::{argument, file};
use crate::work::detached;
use opsr::bsdf::Distribution;
use opsr::files::{FileError, hex};
use opsr::scene::light::sky::Sky;
use opsr::scene::load::{LoadOptions, load};
use opsr::scene::{Backdrop, Camera, Scene as World};
use pyo3::exceptions::{PyTypeError, PyUserWarning};
use pyo3::prelude::*;
use pyo3::types::{PyInt, PyString};
use sha2::{Digest, Sha256};
use std::ffi::CString;
use std::path::PathBuf;

/// A glTF scene, loaded and ready to render. It never changes; several threads may render it.
#[pyclass(frozen, module = "opsr")]
pub(crate) struct Scene {
    pub(crate) world: World,
    /// The path that it was loaded from.
    #[pyo3(get)]
    pub(crate) path: PathBuf,
    /// SHA-256 of the scene's files, in hexadecimal digits.
    #[pyo3(get)]
    pub(crate) sha256: String,
    /// Options that it was loaded with.
    pub(crate) words: String,
    /// Defects and features of the file that are ignored, one line each.
    #[pyo3(get)]
    warnings: Vec<String>,
}

#[pymethods]
impl Scene {
    /// Loads a glTF 2.0 file (.gltf or .glb). Each of its warnings is issued as a UserWarning.
    ///
    /// path: the file.
    /// env: what surrounds the scene: an equirectangular map (.hdr or .exr), "studio", "sky" or "none"; by default the studio
    ///     for a scene that has no light.
    /// env_intensity: factor on the map's radiance, above 0.
    /// env_rotation: rotation of the map about the vertical axis, in degrees.
    /// distribution: "beckmann" (that of the tables) or "ggx" (glTF's own).
    /// solid_glass: make solid bodies of closed meshes that transmit without a thickness.
    ///
    /// Raises FileNotFoundError or OSError for a file that cannot be read, ValueError for one that is damaged or not
    /// supported.
    #[staticmethod]
    #[pyo3(signature = (path, env=None, *, env_intensity=1.0, env_rotation=0.0, distribution="beckmann", solid_glass=false))]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        env: Option<PathBuf>,
        env_intensity: f32,
        env_rotation: f32,
        distribution: &str,
        solid_glass: bool,
    ) -> PyResult<Self> {
        if !(env_intensity > 0.0 && env_intensity.is_finite()) {
            return Err(argument("env_intensity", "expected a number above 0"));
        }
        if !env_rotation.is_finite() {
            return Err(argument("env_rotation", "expected a number"));
        }
        let distribution = match distribution {
            "beckmann" => Distribution::Beckmann,
            "ggx" => Distribution::Ggx,
            _ => return Err(argument("distribution", "expected beckmann or ggx")),
        };
        let mut options = LoadOptions::default();
        (options.distribution, options.solid_glass) = (distribution, solid_glass);
        let words = format!(
            "env {env_intensity} {env_rotation}, {distribution:?}, solid glass {solid_glass}"
        );
        let env = Backdrop::named(env.as_deref(), Sky::default());
        let env = (env, env_intensity, env_rotation.to_radians());
        let scene = detached(py, || open(path, env, &options, words))?.map_err(file)?;
        for warning in &scene.warnings {
            let text = format!("{}: {warning}", scene.path.display()).replace('\0', " ");
            let text = CString::new(text)?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
        Ok(scene)
    }

    /// Names of the cameras, in the order of the file. `render` takes a name or a position in this list.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        let cameras = self.world.parts().cameras.iter();
        cameras.map(|camera| camera.name.clone()).collect()
    }

    fn __repr__(&self) -> String {
        let triangles = self.world.geometry().len();
        format!(
            "<opsr.Scene {}: {triangles} triangles>",
            self.path.display()
        )
    }
}

/// The scene of a file within its surroundings, of this intensity and rotation in radians.
fn open(
    path: PathBuf,
    (env, intensity, rotation): (Backdrop, f32, f32),
    options: &LoadOptions,
    words: String,
) -> Result<Scene, FileError> {
    let loaded = load(&path, options)?;
    let (mut parts, mut warnings) = (loaded.parts, loaded.warnings);
    let mut digest = Sha256::new();
    digest.update(loaded.digest);
    let take = |bytes: &[u8]| digest.update(bytes);
    env.surround(&mut parts, loaded.lit, intensity, rotation, take)?;
    let world = World::new(parts);
    warnings.extend_from_slice(world.warnings());
    Ok(Scene {
        world,
        path,
        sha256: hex(&digest.finalize()),
        words,
        warnings,
    })
}

impl Scene {
    /// The camera with this name or number; without one the first, or one that sees the whole scene.
    pub(crate) fn camera(
        &self,
        wanted: Option<&Bound<'_, PyAny>>,
        aspect: f32,
    ) -> PyResult<Camera> {
        let cameras = &self.world.parts().cameras;
        let Some(wanted) = wanted else {
            let framing = || Camera::framing(self.world.geometry().bounds(), aspect);
            return Ok(cameras.first().cloned().unwrap_or_else(framing));
        };
        let found = if let Ok(name) = wanted.cast::<PyString>() {
            let name = name.to_str()?;
            cameras.iter().find(|camera| camera.name == name)
        } else if wanted.is_instance_of::<PyInt>() {
            let number = wanted.extract::<usize>().ok();
            number.and_then(|number| cameras.get(number))
        } else {
            let what = "camera: expected a name or a number";
            return Err(PyTypeError::new_err(what));
        };
        found.cloned().ok_or_else(|| {
            let names = (cameras.iter().enumerate()).map(|(i, c)| format!("{i} `{}`", c.name));
            let names = names.collect::<Vec<_>>().join(", ");
            let has = if names.is_empty() { "none" } else { &names };
            argument(
                "camera",
                format!("no camera `{wanted}`: the scene has {has}"),
            )
        })
    }
}
