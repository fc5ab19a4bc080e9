//! Scenes made of numpy arrays and dicts.

use crate::array::to_floats;
use crate::errors::argument;
use opsr::bsdf::Distribution;
use opsr::math::{Rgb, Vec2, Vec3};
use opsr::scene::light::Falloff;
use opsr::scene::{Camera, Environment, Lens, Material, Medium, Mesh, PunctualLight, SceneParts};
use opsr_formats::build::looks::{self, Paint};
use opsr_formats::build::{Builder, Placed, flip, metals, shapes};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::f32::consts::TAU;

/// A dict with a fixed set of keys; other keys are errors.
pub(crate) struct Given<'a, 'py> {
    dict: &'a Bound<'py, PyDict>,
    /// Place of the dict, such as `meshes[2]`.
    place: String,
}

impl<'a, 'py> Given<'a, 'py> {
    pub(crate) fn new(item: &'a Bound<'py, PyAny>, place: String, keys: &[&str]) -> PyResult<Self> {
        let Ok(dict) = item.cast::<PyDict>() else {
            let what = format!("{place}: expected a dict, got {}", item.get_type().name()?);
            return Err(PyTypeError::new_err(what));
        };
        for key in dict.keys() {
            let key: String = key.extract()?;
            if !keys.contains(&key.as_str()) {
                let what = format!("no `{key}`; there are {}", keys.join(", "));
                return Err(argument(&place, what));
            }
        }
        Ok(Self { dict, place })
    }

    fn get(&self, key: &str) -> PyResult<Option<Bound<'py, PyAny>>> {
        Ok(self.dict.get_item(key)?.filter(|value| !value.is_none()))
    }

    fn name(&self, key: &str) -> String {
        format!("{}[{key:?}]", self.place)
    }

    fn text(&self, key: &str, or: &str) -> PyResult<String> {
        let value = self.get(key)?;
        value.map_or(Ok(or.to_owned()), |value| value.extract())
    }

    fn number(&self, key: &str, or: f32) -> PyResult<f32> {
        let Some(value) = self.get(key)? else {
            return Ok(or);
        };
        let number: f32 = value.extract()?;
        match number.is_finite() {
            true => Ok(number),
            false => Err(argument(&self.name(key), format!("{number} is not finite"))),
        }
    }

    fn flag(&self, key: &str) -> PyResult<bool> {
        self.get(key)?.map_or(Ok(false), |value| value.extract())
    }

    /// Numbers in rows of `N`; empty without the key.
    fn rows<const N: usize>(&self, key: &str) -> PyResult<Vec<[f32; N]>> {
        let Some(value) = self.get(key)? else {
            return Ok(Vec::new());
        };
        let (shape, values) = to_floats(&value)?;
        if shape.len() != 2 || shape[1] != N {
            let what = format!("expected an array of n x {N}, got shape {shape:?}");
            return Err(argument(&self.name(key), what));
        }
        if values.iter().any(|x| !x.is_finite()) {
            return Err(argument(&self.name(key), "a number that is not finite"));
        }
        Ok(values.as_chunks::<N>().0.to_vec())
    }

    fn vector(&self, key: &str, or: Option<Vec3>) -> PyResult<Vec3> {
        let Some(value) = self.get(key)? else {
            return or.ok_or_else(|| argument(&self.place, format!("needs `{key}`")));
        };
        let (_, values) = to_floats(&value)?;
        let vector = match values[..] {
            [x] => Vec3::splat(x),
            [x, y, z] => Vec3::new(x, y, z),
            _ => return Err(argument(&self.name(key), "expected three numbers")),
        };
        match vector.is_finite() {
            true => Ok(vector),
            false => Err(argument(&self.name(key), "a number that is not finite")),
        }
    }

    /// A colour that is not negative.
    fn colour(&self, key: &str, or: f32) -> PyResult<Rgb> {
        let colour = self.vector(key, Some(Rgb::splat(or)))?;
        match colour.min_element() >= 0.0 {
            true => Ok(colour),
            false => Err(argument(&self.name(key), "a colour below 0")),
        }
    }

    fn direction(&self, key: &str) -> PyResult<Vec3> {
        let direction = self.vector(key, None)?.try_normalize();
        direction.ok_or_else(|| argument(&self.name(key), "has no direction"))
    }
}

/// Keys of a material.
const MATERIAL: &[&str] = &[
    "type",
    "color",
    "ior",
    "alpha",
    "metal",
    "eta",
    "k",
    "emission",
    "opacity",
    "double_sided",
    "distribution",
    "medium",
    "name",
];

/// A medium from a dict.
fn medium(item: &Bound<'_, PyAny>, place: String) -> PyResult<Medium> {
    let given = Given::new(item, place, &["absorption", "scattering", "g"])?;
    let mean_cosine = given.number("g", 0.0)?;
    if mean_cosine.abs() >= 1.0 {
        return Err(argument(&given.name("g"), "is not between -1 and 1"));
    }
    Ok(Medium {
        absorption: given.colour("absorption", 0.0)?,
        scattering: given.colour("scattering", 0.0)?,
        mean_cosine,
    })
}

/// A material from a dict.
pub(crate) fn material(item: &Bound<'_, PyAny>, place: String) -> PyResult<Material> {
    let given = Given::new(item, place, MATERIAL)?;
    let alpha = given.number("alpha", 0.0)?;
    if !(0.0..=1.0).contains(&alpha) {
        return Err(argument(&given.name("alpha"), "is not within [0, 1]"));
    }
    let ior = given.number("ior", 1.5)?;
    if !(0.1..=10.0).contains(&ior) {
        return Err(argument(&given.name("ior"), "is not within [0.1, 10]"));
    }
    let paint =
        |or: f32| -> PyResult<Paint> { Ok(Paint::plain(given.colour("color", or)?.min(Rgb::ONE))) };
    let mut made = match given.text("type", "diffuse")?.as_str() {
        "diffuse" => looks::diffuse(paint(0.5)?),
        "metal" => {
            let (eta, k) = match given.get("metal")? {
                Some(name) => {
                    let name: String = name.extract()?;
                    let all = || metals::metals().collect::<Vec<_>>().join(", ");
                    metals::metal(&name).ok_or_else(|| {
                        argument(
                            &given.name("metal"),
                            format!("no `{name}`; there are {}", all()),
                        )
                    })?
                }
                None => (given.colour("eta", 0.0)?, given.colour("k", 1.0)?),
            };
            looks::metal(eta, k, paint(1.0)?, alpha)
        }
        "glass" => looks::glass(ior, paint(1.0)?, alpha),
        "wall" => looks::wall(ior, paint(1.0)?, Rgb::ONE),
        "coated" => looks::coated(ior, paint(0.5)?, Rgb::ONE, alpha, true),
        other => {
            let what = format!("no `{other}`; there are diffuse, metal, glass, wall, coated");
            return Err(argument(&given.name("type"), what));
        }
    };
    made.distribution = match given.text("distribution", "beckmann")?.as_str() {
        "beckmann" => Distribution::Beckmann,
        "ggx" => Distribution::Ggx,
        _ => {
            return Err(argument(
                &given.name("distribution"),
                "expected beckmann or ggx",
            ));
        }
    };
    made.emission = given.colour("emission", 0.0)?;
    made.double_sided = given.flag("double_sided")?;
    let opacity = given.number("opacity", 1.0)?;
    if opacity != 1.0 {
        let done = Builder::default().set_opacity(&mut made, Paint::from(opacity));
        done.map_err(|what| argument(&given.name("opacity"), what))?;
    }
    if let Some(inside) = given.get("medium")? {
        let place = given.name("medium");
        if !made.solid {
            return Err(argument(&place, "only glass has a medium inside"));
        }
        made.medium = Some(Box::new(medium(&inside, place)?));
    }
    made.name = given.text("name", "")?;
    Ok(made)
}

/// The 4 x 4 matrix of a key, for points as columns; the identity without it.
fn pose(given: &Given<'_, '_>) -> PyResult<opsr_formats::build::Pose> {
    let rows = given.rows::<4>("to_world")?;
    if rows.is_empty() {
        return Ok(opsr_formats::build::Pose::IDENTITY);
    }
    let [x, y, z, w] = rows[..] else {
        return Err(argument(&given.name("to_world"), "expected 4 x 4 numbers"));
    };
    if w != [0.0, 0.0, 0.0, 1.0] {
        return Err(argument(
            &given.name("to_world"),
            "its last row is not 0 0 0 1",
        ));
    }
    let column = |c: usize| [x[c], y[c], z[c]].map(f64::from);
    Ok(opsr_formats::build::pose_of([
        column(0),
        column(1),
        column(2),
        column(3),
    ]))
}

/// Keys of a mesh.
const MESH: &[&str] = &[
    "shape",
    "positions",
    "triangles",
    "normals",
    "uvs",
    "material",
    "to_world",
    "flip",
    "name",
];

fn mesh(given: &Given<'_, '_>) -> PyResult<Mesh> {
    let mut mesh = match given.get("shape")? {
        Some(shape) => match shape.extract::<String>()?.as_str() {
            "sphere" => shapes::sphere(Vec3::ZERO, 1.0),
            "cube" => shapes::cube(),
            "rectangle" => shapes::rectangle(),
            "disk" => shapes::disk(0.0, 1.0, 0.0, TAU),
            "cylinder" => shapes::cylinder(1.0, [0.0, 1.0], TAU),
            other => {
                let what =
                    format!("no `{other}`; there are sphere, cube, rectangle, disk, cylinder");
                return Err(argument(&given.name("shape"), what));
            }
        },
        None => {
            let positions = given.rows::<3>("positions")?;
            let n = positions.len();
            let fits = |len: usize, key: &str| match len == 0 || len == n {
                true => Ok(()),
                false => Err(argument(
                    &given.name(key),
                    format!("{len} for {n} positions"),
                )),
            };
            let normals = given.rows::<3>("normals")?;
            let uvs = given.rows::<2>("uvs")?;
            fits(normals.len(), "normals")?;
            fits(uvs.len(), "uvs")?;
            let triangles = given.rows::<3>("triangles")?;
            // Whole numbers up to 2^24 are exact.
            let good = |i: &f32| *i >= 0.0 && *i < n as f32 && i.fract() == 0.0;
            if n > 1 << 24 || !triangles.iter().flatten().all(good) {
                let what = format!(
                    "indices must be whole and below the {n} positions, of which 2^24 may be"
                );
                return Err(argument(&given.name("triangles"), what));
            }
            Mesh {
                positions: positions.into_iter().map(Vec3::from).collect(),
                normals: (normals.into_iter())
                    .map(|n| Vec3::from(n).normalize_or_zero())
                    .collect(),
                uvs: uvs.into_iter().map(Vec2::from).collect(),
                indices: triangles.into_iter().map(|t| t.map(|i| i as u32)).collect(),
                ..Mesh::default()
            }
        }
    };
    if given.flag("flip")? {
        flip(&mut mesh);
    }
    mesh.name = given.text("name", "")?;
    Ok(mesh)
}

/// A light without area, from a dict.
pub(crate) fn light(item: &Bound<'_, PyAny>, place: String) -> PyResult<PunctualLight> {
    let keys = [
        "type",
        "position",
        "direction",
        "intensity",
        "irradiance",
        "inner",
        "outer",
    ];
    let given = Given::new(item, place, &keys)?;
    let range = f32::INFINITY;
    Ok(match given.text("type", "point")?.as_str() {
        "point" => PunctualLight::Point {
            position: given.vector("position", None)?,
            intensity: given.colour("intensity", 1.0)?,
            range,
        },
        "spot" => {
            let (inner, outer) = (given.number("inner", 0.0)?, given.number("outer", 45.0)?);
            if !(0.0 <= inner && inner <= outer && outer > 0.0 && outer <= 90.0) {
                return Err(argument(
                    &given.place,
                    "angles are not 0 <= inner <= outer <= 90 degrees",
                ));
            }
            PunctualLight::Spot {
                position: given.vector("position", None)?,
                direction: given.direction("direction")?,
                intensity: given.colour("intensity", 1.0)?,
                range,
                cos_inner: inner.to_radians().cos(),
                cos_outer: outer.to_radians().cos(),
                falloff: Falloff::Smooth,
            }
        }
        "directional" => PunctualLight::Directional {
            direction: given.direction("direction")?,
            irradiance: given.colour("irradiance", 1.0)?,
        },
        other => {
            let what = format!("no `{other}`; there are point, spot, directional");
            return Err(argument(&given.name("type"), what));
        }
    })
}

/// A camera from a dict.
pub(crate) fn camera(item: &Bound<'_, PyAny>, place: String) -> PyResult<Camera> {
    let keys = [
        "name", "position", "target", "up", "fov", "aperture", "focus", "aspect",
    ];
    let given = Given::new(item, place, &keys)?;
    let (from, to) = (
        given.vector("position", None)?,
        given.vector("target", None)?,
    );
    let up = given.vector("up", Some(Vec3::Y))?;
    if (from - to)
        .try_normalize()
        .is_none_or(|n| up.cross(n).length() < 1e-6)
    {
        return Err(argument(&given.place, "looks nowhere, or along `up`"));
    }
    let fov = given.number("fov", 45.0)?;
    if !(0.0 < fov && fov < 180.0) {
        return Err(argument(
            &given.name("fov"),
            "is not between 0 and 180 degrees",
        ));
    }
    let aspect = given.number("aspect", 1.0)?;
    let radius = given.number("aperture", 0.0)?;
    let focus = given.number("focus", (from - to).length())?;
    if aspect <= 0.0 || radius < 0.0 || focus <= 0.0 {
        return Err(argument(
            &given.place,
            "aspect and focus must be above 0, and aperture not below",
        ));
    }
    Ok(Camera {
        name: given.text("name", "camera")?,
        aspect: Some(aspect),
        lens: (radius > 0.0).then_some(Lens { radius, focus }),
        ..Camera::look_at(from, to, up, fov.to_radians())
    })
}

/// The items of a list, each with its place for messages.
pub(crate) fn items<'py>(
    list: Option<&Bound<'py, PyAny>>,
    name: &str,
) -> PyResult<Vec<(Bound<'py, PyAny>, String)>> {
    let Some(list) = list else {
        return Ok(Vec::new());
    };
    let mut out = Vec::new();
    for (i, item) in list.try_iter()?.enumerate() {
        out.push((item?, format!("{name}[{i}]")));
    }
    Ok(out)
}

/// Environment of one colour.
pub(crate) fn environment(value: &Bound<'_, PyAny>) -> PyResult<Environment> {
    let (_, values) = to_floats(value)?;
    let colour = match values[..] {
        [x] => Rgb::splat(x),
        [r, g, b] => Rgb::new(r, g, b),
        _ => return Err(argument("environment", "expected a colour")),
    };
    match colour.is_finite() && colour.min_element() >= 0.0 {
        true => Ok(Environment::constant(colour)),
        false => Err(argument(
            "environment",
            "a colour that is negative or not finite",
        )),
    }
}

/// The parts of a scene.
pub(crate) fn parts(
    meshes: &Bound<'_, PyAny>,
    lights: Option<&Bound<'_, PyAny>>,
    cameras: Option<&Bound<'_, PyAny>>,
    sky: Option<&Bound<'_, PyAny>>,
    whole: Option<&Bound<'_, PyAny>>,
) -> PyResult<SceneParts> {
    let mut builder = Builder::default();
    builder.parts.own_boundaries = true;
    for (item, place) in items(Some(meshes), "meshes")? {
        let given = Given::new(&item, place.clone(), MESH)?;
        let made = match given.get("material")? {
            Some(item) => material(&item, given.name("material"))?,
            None => looks::diffuse(Paint::from(0.5)),
        };
        let placed = Placed {
            mesh: builder.mesh(mesh(&given)?),
            material: builder.material(made),
            pose: pose(&given)?,
        };
        builder.place(placed).map_err(|e| argument(&place, e))?;
    }
    for (item, place) in items(lights, "lights")? {
        builder.parts.lights.push(light(&item, place)?);
    }
    for (item, place) in items(cameras, "cameras")? {
        builder.parts.cameras.push(camera(&item, place)?);
    }
    if let Some(whole) = whole {
        builder.parts.medium = Some(medium(whole, "medium".into())?);
    }
    if let Some(sky) = sky {
        builder.parts.environment = Some(environment(sky)?);
    }
    builder.finish().map_err(|e| argument("meshes", e))
}
