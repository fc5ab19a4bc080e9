//! The files of a picture: formats, layers, exposure; and the checks that they can be written and replace nothing that is
//! read.

use super::fault::Fault;
use super::spec::Spec;
use super::value::Exposure;
use crate::files::Target;
use crate::image::denoise::Denoiser;
use crate::image::display::{Display, auto_exposure};
use crate::image::exr::{self, Header, Layer, Metadata, Storage};
use crate::image::{Buffer, png};
use crate::integrator::Picture;
use crate::math::Rgb;
use crate::resolve::{Resolve, Resolved, denoise_film, film_error, film_errors, resolve_film};
use std::path::{Path, PathBuf};

/// Picture that was written.
pub struct Written {
    /// Exposure of the PNG files, if there are any.
    pub exposure: Option<f32>,
    /// Estimated relative error of the picture; of one level that before it was denoised.
    pub error: f64,
    /// The picture.
    pub shown: Buffer,
}

/// The files that a picture is written to.
pub struct Outputs {
    files: Vec<PathBuf>,
    spec: Spec,
    denoiser: Option<Denoiser>,
    /// Stops that automatic exposure brightens by at most.
    most: f32,
}

/// Format of a picture's file.
#[derive(Clone, Copy, PartialEq)]
enum Format {
    Exr,
    Png,
}

/// The format that a name ends in, in capitals or not.
fn format(file: &Path) -> Option<Format> {
    let ending = file.extension()?.to_str()?;
    if ending.eq_ignore_ascii_case("exr") {
        Some(Format::Exr)
    } else if ending.eq_ignore_ascii_case("png") {
        Some(Format::Png)
    } else {
        None
    }
}

impl Spec {
    /// The picture to look at while it is made.
    pub fn shown(&self, picture: &Picture) -> Buffer {
        match &picture.levels {
            Some(film) => resolve_film(film, self.resolve()).picture,
            None => picture.film.mean(),
        }
    }

    /// Exposure and view; a picture is brightened by at most `most` stops unless the user says so.
    pub fn display(&self, picture: &Buffer, most: f32) -> Display {
        let exposure = match self.exposure.unwrap_or_default() {
            Exposure::Auto => auto_exposure(picture).min(most),
            Exposure::Stops(stops) => stops,
        };
        let view = self.view.unwrap_or_default();
        Display { exposure, view }
    }

    /// Refuses choices among levels for a film of one.
    pub fn check_film(&self, picture: &Picture) -> Result<(), Fault> {
        let one = picture.levels.is_none();
        match self.given().find(|(option, _)| option.of_levels && one) {
            Some((option, _)) => Err(Fault::option(
                option.name,
                "needs several levels, and this film has one",
            )),
            None => Ok(()),
        }
    }

    /// Refuses layers that no file would hold.
    pub fn check_layers(&self, files: &[PathBuf]) -> Result<(), Fault> {
        let exr = files.iter().any(|file| format(file) == Some(Format::Exr));
        for name in ["aov", "level_layers"] {
            if self.has(name) && !exr {
                let what = "adds layers to EXR files: add -o with a name that ends in .exr";
                return Err(Fault::option(name, what));
            }
        }
        Ok(())
    }
}

impl Outputs {
    /// Checks before anything is rendered that the files can be written at all.
    pub fn new(files: &[PathBuf], spec: &Spec) -> Result<Self, Fault> {
        for file in files {
            if format(file).is_none() {
                let what = "expected a name that ends in .exr or .png";
                return Err(Fault::usage(format!("{}: {what}", file.display())));
            }
            can_write(file)?;
        }
        Ok(Self {
            files: files.to_vec(),
            spec: spec.clone(),
            denoiser: (spec.denoise == Some(true))
                .then(Denoiser::open)
                .transpose()?,
            most: f32::INFINITY,
        })
    }

    /// Lets automatic exposure darken pictures only: in a light that has the right brightness, what is dark stays dark.
    pub fn never_brighten(&mut self) {
        self.most = 0.0;
    }

    /// The files, for people.
    pub fn names(&self) -> String {
        let names = self.files.iter().map(|file| file.display().to_string());
        names.collect::<Vec<_>>().join(", ")
    }

    /// Writes every file, each whole or not at all; fails with the first failure, after the other files are written.
    pub fn write(
        &self,
        picture: &Picture,
        layers: Vec<Layer>,
        world_to_camera: Option<[f32; 16]>,
        metadata: &Metadata,
    ) -> Result<Written, Fault> {
        let (written, failed) = self.try_write(picture, layers, world_to_camera, metadata)?;
        failed.map_or(Ok(written), Err)
    }

    /// Writes every file, each whole or not at all, and returns the first failure beside the rest.
    ///
    /// EXR files get the layers, and the place of the camera if it is known. Of several levels the one of every pixel is
    /// chosen; EXR files then have the layers `level`, `bias2`, `variance` and `error` in place of the statistics of the
    /// film, as does a denoised picture. Of one level they have `error` beside them.
    pub fn try_write(
        &self,
        picture: &Picture,
        mut layers: Vec<Layer>,
        world_to_camera: Option<[f32; 16]>,
        metadata: &Metadata,
    ) -> Result<(Written, Option<Fault>), Fault> {
        let Finished {
            shown,
            noisy,
            resolved,
        } = finish(picture, &self.spec, self.denoiser.as_ref())?;
        layers.extend(noisy.map(|noisy| Layer::rgb("noisy", &noisy)));
        let error = match &resolved {
            Some(resolved) => resolved.relative_error(),
            None => film_error(&picture.film).error,
        };
        let whole = resolved.is_some() || self.denoiser.is_some();
        if let Some(resolved) = resolved {
            // A layer of errors that is there knows what a witness has found, too.
            let told = layers.iter().any(|layer| layer.name == "error");
            let own = resolved.into_layers().into_iter();
            layers.extend(own.filter(|layer| !told || layer.name != "error"));
            if let Some(film) = &picture.levels
                && self.spec.level_layers == Some(true)
            {
                let level = |k| Layer::rgb(&format!("level{k}"), &film.mean(k));
                layers.extend((0..film.levels()).map(level));
            }
        } else if !layers.iter().any(|layer| layer.name == "error") {
            let errors = film_errors(&picture.film);
            layers.extend(errors.map(|errors| Layer::scalar("error", errors)));
        }
        let header = Header {
            metadata,
            storage: Storage {
                half: self.spec.exr_half.unwrap_or_default(),
                compression: self.spec.exr_compression.unwrap_or_default(),
            },
            world_to_camera,
        };
        let is_png = |file: &PathBuf| format(file) == Some(Format::Png);
        let display = (self.files.iter().any(is_png)).then(|| self.spec.display(&shown, self.most));
        let film = &picture.film;
        let mut failed = None;
        for file in &self.files {
            let done = if let Some(display) = display.filter(|_| is_png(file)) {
                png::write(file, &shown, display)
            } else if whole {
                let part = (film.size, film.window);
                exr::write_layers(file, part, &shown, &layers, header)
            } else {
                exr::write_film(file, film, &layers, header)
            };
            if let Err(error) = done {
                failed = failed.or(Some(error.into()));
            }
        }
        let written = Written {
            exposure: display.map(|display| display.exposure),
            error,
            shown,
        };
        Ok((written, failed))
    }
}

/// A picture as a user gets it.
pub struct Finished {
    /// The picture.
    pub shown: Buffer,
    /// What it was before it was denoised.
    pub noisy: Option<Buffer>,
    /// The choice, of several levels; its error is that of the picture.
    pub resolved: Option<Resolved>,
}

/// Chooses among the levels of a picture, and denoises it. Of several levels the denoiser is fed with one of them, and the
/// choice and its picture are mixed by their errors, unless level 0 is asked for.
pub fn finish(
    picture: &Picture,
    spec: &Spec,
    denoiser: Option<&Denoiser>,
) -> Result<Finished, Fault> {
    let how = spec.resolve();
    let resolved = (picture.levels.as_ref()).map(|film| resolve_film(film, how));
    let noisy = match &resolved {
        Some(resolved) => resolved.picture.clone(),
        None => picture.film.mean(),
    };
    let Some(denoiser) = denoiser else {
        return Ok(Finished {
            shown: noisy,
            noisy: None,
            resolved,
        });
    };
    let first = picture.aovs.as_ref().and_then(|a| a.first.as_ref());
    let needs = || Fault::option("denoise", "needs a render with {aov} albedo,normal");
    let first = first.ok_or_else(needs)?;
    let (albedo, normal) = (first.albedo(), first.normal());
    let clean = |noisy: &Buffer| {
        // A filter makes something of nothing.
        if noisy.pixels.iter().all(|p| *p == Rgb::ZERO) {
            return Ok(noisy.clone());
        }
        denoiser.denoise(noisy, &albedo, &normal)
    };
    let (shown, resolved) = match (&picture.levels, resolved) {
        (Some(film), Some(resolved)) if how != Resolve::None => {
            let denoised = denoise_film(film, resolved, clean)?;
            (denoised.resolved.picture.clone(), Some(denoised.resolved))
        }
        (_, resolved) => (clean(&noisy)?, resolved),
    };
    Ok(Finished {
        shown,
        noisy: Some(noisy),
        resolved,
    })
}

/// Fails if a file cannot be made or replaced here, as far as one can tell without touching it: better known before
/// a long render than after.
pub fn can_write(file: &Path) -> Result<(), Fault> {
    let cannot = |what: &str| Err(Fault::Output(format!("{}: {what}", file.display())));
    if file.is_dir() {
        return cannot("is a folder");
    }
    let target = match Target::of(file) {
        Ok(Target::Stream) => return Ok(()),
        Ok(Target::Whole(file)) => file,
        // What is wrong with it is said below.
        Err(_) => file.to_owned(),
    };
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return Err(Fault::Output(format!(
            "{}: no such folder",
            folder.display()
        )));
    }
    // The same kind of file that a result is before it takes its name; it goes away at once.
    match tempfile::NamedTempFile::new_in(folder) {
        Ok(_) => Ok(()),
        Err(error) => Err(Fault::Output(format!("{}: {error}", target.display()))),
    }
}

/// Refuses outputs of which two are one file, or one is a file that is read.
pub fn check_distinct<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Fault> {
    let mut seen: Vec<PathBuf> = Vec::new();
    let inputs: Vec<PathBuf> = inputs.into_iter().filter_map(identity).collect();
    for path in outputs {
        let Some(file) = identity(path) else { continue };
        let refused = |what: &str| {
            let problem = "give the output another name";
            Err(Fault::usage(format!(
                "{}: {what}: {problem}",
                path.display()
            )))
        };
        if inputs.contains(&file) {
            return refused("would replace a file that is read");
        }
        if seen.contains(&file) {
            return refused("is the name of two outputs");
        }
        seen.push(file);
    }
    Ok(())
}

/// The file that a path leads to, whether it exists or not; `None` for pipes and devices.
fn identity(path: &Path) -> Option<PathBuf> {
    if let Ok(file) = path.canonicalize() {
        return file.is_file().then_some(file);
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
    Some(folder.join(path.file_name()?))
}
