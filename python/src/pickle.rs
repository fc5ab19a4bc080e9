//! Pickles of films: the bytes of a checkpoint, and what a render adds to its moments.

use crate::errors::{argument, file};
use crate::film::Film;
use opsr::image::exr::Layer;
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::method::IntegratorKind;
use opsr::math::UVec2;
use opsr::pilot::witness::Missing;
use opsr::resolve::{Resolve, resolve_film};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::Path;

/// Names of channels, which layers have for good.
const CHANNELS: [&str; 10] = ["", "R", "G", "B", "X", "Y", "Z", "A", "mesh", "material"];

/// Name of a layer, and its channels with their values.
type Channels = (String, Vec<(String, Vec<u8>)>);

/// Share, pixel, finder and squares of missing light.
type Lack = (f64, [u32; 2], String, Vec<u8>);

/// Layers, missing light, camera, choice and wall time of a film.
type Rest = (Vec<Channels>, Option<Lack>, [f32; 16], String, f64);

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    let (words, _) = bytes.as_chunks::<4>();
    words.iter().map(|word| f32::from_le_bytes(*word)).collect()
}

fn damaged(what: impl std::fmt::Display) -> PyErr {
    argument("a pickled film", what)
}

/// What makes a film again.
pub(crate) fn reduce<'py>(film: &Bound<'py, Film>) -> PyResult<Bound<'py, PyAny>> {
    let (py, film) = (film.py(), film.get());
    let levels = film.made.levels.as_ref();
    let checkpoint = Checkpoint {
        fingerprint: Fingerprint {
            version: String::new(),
            scene: String::new(),
            settings: String::new(),
        },
        samples: film.spp,
        seconds: 0.0,
        levels: vec![0.0; levels.map_or(0, |levels| levels.levels())],
        metadata: film.metadata.clone(),
        picture: film.made.clone(),
    };
    let layers = film.layers.iter().map(|layer| {
        let channels = layer.channels.iter();
        let channels = channels.map(|(name, values)| (name.to_string(), bytes(values)));
        (layer.name.clone(), channels.collect())
    });
    let lack = |missing: &Missing| {
        let pixel = missing.pixel.to_array();
        let squares = bytes(&missing.squares);
        (missing.share, pixel, missing.finder.name(), squares)
    };
    let rest: Rest = (
        layers.collect(),
        film.missing.as_ref().map(lack),
        film.camera,
        format!("{:?}", film.resolve).to_lowercase(),
        film.seconds,
    );
    let tempfile = py.import("tempfile")?;
    let folder = tempfile.call_method0("TemporaryDirectory")?;
    let path = folder.getattr("name")?.extract::<String>()?;
    let path = Path::new(&path).join("film");
    checkpoint.save(&path).map_err(file)?;
    let moments = std::fs::read(&path)?;
    folder.call_method0("cleanup")?;
    let unpickle = py.import("opsr._opsr")?.getattr("_film")?;
    (unpickle, (PyBytes::new(py, &moments), rest)).into_bound_py_any(py)
}

/// A film from its pickle.
#[pyfunction]
pub(crate) fn _film(py: Python<'_>, moments: &[u8], rest: Rest) -> PyResult<Film> {
    let folder = py.import("tempfile")?.call_method0("TemporaryDirectory")?;
    let path = folder.getattr("name")?.extract::<String>()?;
    let path = Path::new(&path).join("film");
    std::fs::write(&path, moments)?;
    let read = Checkpoint::open(&path).map_err(file)?;
    folder.call_method0("cleanup")?;
    let (layers, lack, camera, resolve, seconds) = rest;
    let resolve = [
        Resolve::None,
        Resolve::Sharp,
        Resolve::Default,
        Resolve::Smooth,
    ]
    .into_iter()
    .find(|known| format!("{known:?}").to_lowercase() == resolve)
    .ok_or_else(|| damaged("no such choice"))?;
    let channel = |(name, values): (String, Vec<u8>)| {
        let known = CHANNELS.into_iter().find(|known| *known == name);
        let name = known.ok_or_else(|| damaged(format!("no channel `{name}`")))?;
        Ok((name, floats(&values)))
    };
    let layer = |(name, channels): Channels| {
        let channels = channels.into_iter().map(channel);
        let channels = channels.collect::<PyResult<Vec<_>>>()?;
        Ok(Layer { name, channels })
    };
    let missing = |(share, pixel, finder, squares): Lack| {
        use IntegratorKind as Kind;
        let kinds = [
            Kind::Path,
            Kind::Light,
            Kind::Bdpt,
            Kind::Vcm,
            Kind::Sppm,
            Kind::Mlt,
        ];
        let finder = kinds.into_iter().find(|kind| kind.name() == finder);
        Ok::<_, PyErr>(Missing {
            share,
            pixel: UVec2::from_array(pixel),
            finder: finder.ok_or_else(|| damaged("no such integrator"))?,
            squares: floats(&squares),
        })
    };
    let picture = read.picture;
    Ok(Film {
        choice: (picture.levels.as_ref()).map(|film| resolve_film(film, resolve)),
        resolve,
        layers: layers.into_iter().map(layer).collect::<PyResult<_>>()?,
        missing: lack.map(missing).transpose()?,
        camera,
        made: picture,
        metadata: read.metadata,
        spp: read.samples,
        seconds,
    })
}
