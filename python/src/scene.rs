//! Scenes.

use crate::build;
use crate::errors::argument;
use crate::options::{of_scene, raised, read};
use crate::work::detached;
use opsr::render::Spec;
use opsr::scene::{Scene as World, SceneParts};
use opsr_formats::FORMATS;
use pyo3::IntoPyObjectExt;
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use std::ffi::CString;
use std::path::PathBuf;

/// A scene, loaded or built, and ready to render. It never changes; several threads may render it.
#[pyclass(frozen, module = "opsr")]
pub(crate) struct Scene {
    pub(crate) world: World,
    /// The path that it was loaded from, or its name.
    #[pyo3(get)]
    pub(crate) path: PathBuf,
    /// SHA-256 of the scene's files, in hexadecimal digits.
    #[pyo3(get)]
    pub(crate) sha256: String,
    /// Options that it was loaded with.
    pub(crate) spec: Spec,
    /// True if the built-in studio lights it.
    pub(crate) in_studio: bool,
    /// Defects and features of the file that are ignored, one line each.
    #[pyo3(get)]
    warnings: Vec<String>,
    /// Recipe that makes it again: a static method's name, its arguments and its keywords.
    recipe: (&'static str, Py<PyTuple>, Py<PyDict>),
}

#[pymethods]
impl Scene {
    /// Loads a glTF 2.0 file (.gltf or .glb), or a scene of pbrt-v4 (.pbrt) or Mitsuba (.xml). Each of its warnings is issued as a UserWarning. Keywords are the options of
    /// `opsr render` for the scene and its light; `help(opsr)` lists them.
    ///
    /// name: what the scene goes by in `path` and in metadata, for a copy of a file from elsewhere; by default the path.
    ///
    /// Raises FileNotFoundError or OSError for a file that cannot be read, ValueError for one that is damaged or not
    /// supported.
    #[staticmethod]
    #[pyo3(signature = (path, env=None, *, name=None, **options))]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        env: Option<&Bound<'_, PyAny>>,
        name: Option<PathBuf>,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let keywords = match options {
            Some(options) => options.copy()?,
            None => PyDict::new(py),
        };
        if let Some(env) = env {
            keywords.set_item("env", env)?;
        }
        let again = keywords.copy()?;
        again.set_item("name", &name)?;
        let recipe = ("load", PyTuple::new(py, [&path])?.unbind(), again.unbind());
        let spec = read("Scene.load", Some(&keywords), of_scene)?;
        let opened = detached(py, || spec.open(&path, FORMATS, World::new))?.map_err(raised)?;
        for warning in &opened.warnings {
            let text = format!("{}: {warning}", path.display()).replace('\0', " ");
            let text = CString::new(text)?;
            PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
        }
        Ok(Self {
            world: opened.scene,
            path: name.unwrap_or(path),
            sha256: opened.sha256,
            spec,
            in_studio: opened.in_studio,
            warnings: opened.warnings,
            recipe,
        })
    }

    /// Builds a scene of numpy arrays.
    ///
    /// meshes: dicts, each of "positions" (n x 3), "triangles" (m x 3, counter-clockwise seen from the front) and perhaps
    /// "normals" (n x 3) and "uvs" (n x 2), or of a "shape": "sphere", "cube", "rectangle", "disk" or "cylinder" of Mitsuba's
    /// sizes; of a "material"; and perhaps of "to_world", a 4 x 4 matrix, "flip" to turn the front round, and "name".
    /// A material is a dict of its "type", "diffuse", "metal", "glass", "wall" (a thin pane) or "coated" (diffuse under a clear
    /// layer); "color", the reflectance or tint; "alpha", the roughness; "ior"; "metal", a name such as "Cu", or "eta" and "k";
    /// "emission", the radiance of the front; "opacity", "double_sided", "distribution" and "name". Glass may have a "medium" inside,
    /// a dict of "absorption" and "scattering", per unit length, and "g", the mean cosine of the deflection; with an "ior" of 1 it has
    /// no surface.
    /// lights: dicts of a "type", "point", "spot" or "directional"; "position", "direction", "intensity" or "irradiance", and
    /// of a spot the angles "inner" and "outer" in degrees.
    /// cameras: dicts of "position" and "target", and perhaps "up", "fov" (vertical, degrees), "aspect", "aperture", "focus"
    /// and "name".
    /// environment: radiance from everywhere, one number or three.
    /// medium: a dict as those of glass, what is outside of all bodies.
    ///
    /// Boundaries of glass refract by their own index, as in Mitsuba: nested bodies need the ratio of both sides. Colours are
    /// linear Rec. 709. Raises ValueError or TypeError for what no scene can be made of.
    #[staticmethod]
    #[pyo3(signature = (meshes, *, lights=None, cameras=None, environment=None, medium=None))]
    fn build(
        py: Python<'_>,
        meshes: &Bound<'_, PyAny>,
        lights: Option<&Bound<'_, PyAny>>,
        cameras: Option<&Bound<'_, PyAny>>,
        environment: Option<&Bound<'_, PyAny>>,
        medium: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let parts = build::parts(meshes, lights, cameras, environment, medium)?;
        let keywords = PyDict::new(py);
        keywords.set_item("lights", lights)?;
        keywords.set_item("cameras", cameras)?;
        keywords.set_item("environment", environment)?;
        keywords.set_item("medium", medium)?;
        let arguments = PyTuple::new(py, [meshes])?;
        Self::of(
            py,
            parts,
            "built",
            ("build", arguments.unbind(), keywords.unbind()),
        )
    }

    /// This scene with other parts, without reading its file again; the scene itself stays as it is.
    ///
    /// cameras: dicts as those of `build`, in place of all cameras.
    /// lights: dicts as those of `build`, in place of all lights without area.
    /// materials: dicts as those of `build`, by the name or the number of the material that each replaces.
    /// environment: radiance from everywhere, in place of what surrounds the scene.
    #[pyo3(signature = (*, cameras=None, lights=None, materials=None, environment=None))]
    fn changed(
        slf: &Bound<'_, Self>,
        cameras: Option<&Bound<'_, PyAny>>,
        lights: Option<&Bound<'_, PyAny>>,
        materials: Option<&Bound<'_, PyDict>>,
        environment: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Self> {
        let (py, scene) = (slf.py(), slf.get());
        let mut parts = scene.world.parts().clone();
        if cameras.is_some() {
            let cameras = build::items(cameras, "cameras")?.into_iter();
            let read = cameras.map(|(item, place)| build::camera(&item, place));
            parts.cameras = read.collect::<PyResult<_>>()?;
        }
        if lights.is_some() {
            let lights = build::items(lights, "lights")?.into_iter();
            let read = lights.map(|(item, place)| build::light(&item, place));
            parts.lights = read.collect::<PyResult<_>>()?;
        }
        for (key, item) in materials.into_iter().flat_map(|m| m.iter()) {
            let number = match key.extract::<usize>() {
                Ok(number) => Some(number).filter(|&n| n < parts.materials.len()),
                Err(_) => {
                    let name: String = key.extract()?;
                    parts.materials.iter().position(|m| m.name == name)
                }
            };
            let place = format!("materials[{}]", key.repr()?);
            let number =
                number.ok_or_else(|| argument(&place, "the scene has no such material"))?;
            let old = std::mem::take(&mut parts.materials[number].name);
            parts.materials[number] = build::material(&item, place)?;
            if parts.materials[number].name.is_empty() {
                parts.materials[number].name = old;
            }
        }
        if let Some(sky) = environment {
            parts.environment = Some(build::environment(sky)?);
        }
        let keywords = PyDict::new(py);
        keywords.set_item("cameras", cameras)?;
        keywords.set_item("lights", lights)?;
        keywords.set_item("materials", materials)?;
        keywords.set_item("environment", environment)?;
        let recipe = (
            "changed",
            PyTuple::new(py, [slf])?.unbind(),
            keywords.unbind(),
        );
        let made = Self::of(py, parts, &scene.path.display().to_string(), recipe)?;
        Ok(Self {
            spec: scene.spec.clone(),
            in_studio: scene.in_studio && environment.is_none(),
            ..made
        })
    }

    /// Names of the materials.
    #[getter]
    fn materials(&self) -> Vec<String> {
        let all = self.world.parts().materials.iter();
        all.map(|material| material.name.clone()).collect()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let py = slf.py();
        let (method, arguments, keywords) = &slf.get().recipe;
        let remake = py.import("opsr")?.getattr("_remade")?;
        let arguments = (*method, arguments.clone_ref(py), keywords.clone_ref(py));
        (remake, arguments).into_bound_py_any(py)
    }

    /// Names of the cameras, in the order of the file. `render` takes a name or a position in this list.
    #[getter]
    fn cameras(&self) -> Vec<String> {
        let cameras = self.world.parts().cameras.iter();
        cameras.map(|camera| camera.name.clone()).collect()
    }

    fn __repr__(&self) -> String {
        let triangles = self.world.geometry().triangle_count();
        format!(
            "<opsr.Scene {}: {triangles} triangles>",
            self.path.display()
        )
    }
}

impl Scene {
    /// A scene of parts that were made here. Its hash is that of their contents.
    fn of(
        py: Python<'_>,
        parts: SceneParts,
        name: &str,
        recipe: (&'static str, Py<PyTuple>, Py<PyDict>),
    ) -> PyResult<Self> {
        let world = detached(py, || World::new(parts))?;
        Ok(Self {
            sha256: opsr_formats::build::fingerprint(world.parts()),
            warnings: world.warnings().to_vec(),
            world,
            path: PathBuf::from(name),
            spec: Spec::default(),
            in_studio: false,
            recipe,
        })
    }
}
