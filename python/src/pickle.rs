//! Pickles of films: the bytes of a checkpoint, and what a render adds to its moments.

use crate::errors::{argument, file};
use crate::film::Film;
use opsr::image::Buffer;
use opsr::image::exr::Layer;
use opsr::image::level_film::LevelFilm;
use opsr::integrator::checkpoint::{Checkpoint, Fingerprint};
use opsr::integrator::method::IntegratorKind;
use opsr::integrator::{Amounts, Picture, Scales};
use opsr::math::{Rgb, UVec2};
use opsr::pilot::witness::MissingLight;
use opsr::render::{Finished, Opt, Outcome, Shown, Spec};
use opsr::resolve::Resolved;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::borrow::Cow;
use std::path::Path;

/// Names of channels, which layers store as static strings.
const CHANNELS: [&str; 10] = ["", "R", "G", "B", "X", "Y", "Z", "A", "mesh", "material"];

/// Name of a layer, and its channels with their values.
type Channels = (String, Vec<(String, Vec<u8>)>);

/// Share, pixel, finder and squares of missing light.
type PickledMissing = (f64, [u32; 2], String, Vec<u8>);

/// Pixels of the denoised and of the noisy picture; level, squared bias, variance and noise of every pixel. They are
/// pickled because the denoiser may be missing where a film is read.
type Denoised = (Vec<u8>, Vec<u8>, Option<(Vec<u8>, [Vec<u8>; 3])>);

/// Layers, missing light, camera, options of the film with true for the studio, denoised picture and wall time of a film.
type PickledFilm = (
    Vec<Channels>,
    Option<PickledMissing>,
    Option<[f32; 16]>,
    (String, bool),
    Option<Denoised>,
    f64,
);

fn bytes(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    let (words, _) = bytes.as_chunks::<4>();
    words.iter().map(|word| f32::from_le_bytes(*word)).collect()
}

fn pixels(picture: &Buffer) -> Vec<u8> {
    let values = picture.pixels.iter().flat_map(|p| p.to_array());
    values.flat_map(f32::to_le_bytes).collect()
}

/// The denoised picture; `None` for a picture that is not denoised.
fn denoised(shown: &Shown) -> Option<Denoised> {
    let choice = |r: &Resolved| {
        let maps = [&r.bias2, &r.variance, &r.noise];
        (r.level.clone(), maps.map(|map| bytes(map)))
    };
    let noisy = shown.noisy.as_ref()?;
    let choice = shown.resolved.as_ref().map(choice);
    Some((pixels(&shown.picture), pixels(noisy), choice))
}

/// A picture of the size of another one from its pixels.
fn picture(like: &Buffer, bytes: &[u8]) -> PyResult<Buffer> {
    let numbers = floats(bytes);
    let (pixels, rest) = numbers.as_chunks::<3>();
    if pixels.len() != like.pixels.len() || !rest.is_empty() {
        return Err(damaged("a picture of another size"));
    }
    Ok(Buffer {
        pixels: pixels.iter().map(|p| Rgb::from_array(*p)).collect(),
        ..*like
    })
}

/// The shown picture from its pickle, without denoising it again.
fn shown_again(film: &Picture, (shown, noisy, choice): Denoised) -> PyResult<Shown> {
    let mean = film.film.mean();
    let shown = picture(&mean, &shown)?;
    let resolved = choice.map(|(level, maps)| {
        let [bias2, variance, noise] = maps.each_ref().map(|map| floats(map));
        Resolved {
            picture: shown.clone(),
            level,
            bias2,
            variance,
            noise,
        }
    });
    Ok(Shown {
        noisy: Some(picture(&mean, &noisy)?),
        picture: shown,
        resolved,
    })
}

fn damaged(what: impl std::fmt::Display) -> PyErr {
    argument("a pickled film", what)
}

/// Recipe that makes a film again.
pub(crate) fn reduce<'py>(film: &Bound<'py, Film>) -> PyResult<Bound<'py, PyAny>> {
    let (py, film) = (film.py(), film.get());
    let Outcome {
        picture,
        missing,
        aovs,
        metadata,
        world_to_camera,
        spec,
        in_studio,
    } = &film.done.outcome;
    let checkpoint = Checkpoint {
        fingerprint: Fingerprint {
            version: String::new(),
            scene: String::new(),
            settings: String::new(),
        },
        samples: film.spp,
        seconds: 0.0,
        amounts: match picture.levels.as_ref().map(LevelFilm::levels) {
            None => Amounts::Raw,
            Some(1) => Amounts::Blurred,
            Some(films) => Amounts::Roughening(Scales::of_count(films).unwrap_or_default()),
        },
        metadata: metadata.clone(),
        picture: picture.clone().into_owned(),
    };
    let layers = aovs.iter().map(|layer| {
        let channels = layer.channels.iter();
        let channels = channels.map(|(name, values)| (name.to_string(), bytes(values)));
        (layer.name.clone(), channels.collect())
    });
    let lack = |missing: &MissingLight| {
        let pixel = missing.pixel.to_array();
        let squares = bytes(&missing.squares);
        (missing.share, pixel, missing.finder.to_string(), squares)
    };
    let mut options = spec.settings();
    options.retain(|name, _| Opt::named(name).is_some_and(|option| option.of_film));
    let rest: PickledFilm = (
        layers.collect(),
        missing.as_ref().map(lack),
        *world_to_camera,
        (serde_json::Value::from(options).to_string(), *in_studio),
        denoised(&film.done.shown),
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
pub(crate) fn _film(py: Python<'_>, moments: &[u8], rest: PickledFilm) -> PyResult<Film> {
    let folder = py.import("tempfile")?.call_method0("TemporaryDirectory")?;
    let path = folder.getattr("name")?.extract::<String>()?;
    let path = Path::new(&path).join("film");
    std::fs::write(&path, moments)?;
    let read = Checkpoint::open(&path).map_err(file)?;
    folder.call_method0("cleanup")?;
    let (layers, lack, world_to_camera, (options, in_studio), denoised, seconds) = rest;
    let mut spec = Spec::default();
    let options: serde_json::Map<String, serde_json::Value> =
        serde_json::from_str(&options).map_err(damaged)?;
    for (name, value) in &options {
        spec.set(name, value).map_err(damaged)?;
    }
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
    let missing = |(share, pixel, finder, squares): PickledMissing| {
        use IntegratorKind as Kind;
        let kinds = [
            Kind::Path,
            Kind::Light,
            Kind::Bdpt,
            Kind::Vcm,
            Kind::Sppm,
            Kind::Mlt,
        ];
        let finder = kinds.into_iter().find(|kind| kind.to_string() == finder);
        Ok::<_, PyErr>(MissingLight {
            share,
            pixel: UVec2::from_array(pixel),
            finder: finder.ok_or_else(|| damaged("no such integrator"))?,
            squares: floats(&squares),
        })
    };
    let outcome = Outcome {
        picture: Cow::Owned(read.picture),
        missing: lack.map(missing).transpose()?,
        aovs: layers.into_iter().map(layer).collect::<PyResult<_>>()?,
        metadata: read.metadata,
        world_to_camera,
        spec,
        in_studio,
    };
    let done = match denoised {
        Some(denoised) => Finished {
            shown: shown_again(&outcome.picture, denoised)?,
            outcome,
        },
        None => outcome.finish(None).map_err(damaged)?,
    };
    Ok(Film {
        done,
        spp: read.samples,
        seconds,
    })
}
