//! The files of a picture: formats, layers, exposure. Checks that they can be written and do not replace an input.

use super::fault::Fault;
use super::finished::Finished;
use super::spec::Spec;
use super::value::Exposure;
use crate::files::Target;
use crate::image::Buffer;
use crate::image::denoise::Denoiser;
use crate::image::display::{Display, auto_exposure};
use crate::integrator::Picture;
use crate::integrator::layers::Aov;
use crate::resolve::resolve_film;
use crate::scene::Backdrop;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::SystemTime;

/// The files that a picture is written to.
pub struct Outputs {
    files: Vec<PathBuf>,
    /// Version of each file at its last check or write.
    versions: Mutex<Vec<Option<Version>>>,
}

/// Modification time and length of a file in bytes.
type Version = (SystemTime, u64);

/// The version of an existing file.
fn version(file: &Path) -> Option<Version> {
    let metadata = file.metadata().ok().filter(std::fs::Metadata::is_file)?;
    Some((metadata.modified().ok()?, metadata.len()))
}

/// Format of a picture's file.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Format {
    Exr,
    Png,
}

/// The format by the ending of a name, in any case of letters.
pub(super) fn format(file: &Path) -> Result<Format, Fault> {
    let ending = file
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    if ending.eq_ignore_ascii_case("exr") {
        Ok(Format::Exr)
    } else if ending.eq_ignore_ascii_case("png") {
        Ok(Format::Png)
    } else {
        let what = "expected a name that ends in .exr or .png";
        Err(Fault::usage(format!("{}: {what}", file.display())))
    }
}

impl Spec {
    /// The picture to display during a render.
    pub fn shown(&self, picture: &Picture) -> Buffer {
        match &picture.levels {
            Some(film) => resolve_film(film, self.resolve()).picture,
            None => picture.film.mean(),
        }
    }

    /// The denoiser, if the options request it; an error if it is not installed.
    pub fn denoiser(&self) -> Result<Option<Denoiser>, Fault> {
        let denoiser = (self.denoise == Some(true)).then(Denoiser::open);
        Ok(denoiser.transpose()?)
    }

    /// Exposure and view. Automatic exposure never brightens a picture in the built-in studio, whose light already has
    /// the right brightness: dark objects stay dark.
    pub fn display(&self, picture: &Buffer, in_studio: bool) -> Display {
        let most = match in_studio || self.backdrop() == Backdrop::Studio {
            true => 0.0,
            false => f32::INFINITY,
        };
        let exposure = match self.exposure.unwrap_or_default() {
            Exposure::Auto => auto_exposure(picture).min(most),
            Exposure::Stops(stops) => stops,
        };
        let view = self.view.unwrap_or_default();
        Display { exposure, view }
    }

    /// An error for options that do not apply to a stored film, or need more levels than it has.
    pub(crate) fn check_film(&self, picture: &Picture) -> Result<(), Fault> {
        let one = picture.levels.is_none();
        if self.is_raw() {
            let why = "raw is chosen before a render, not of its film";
            return Err(Fault::option("resolve", why));
        }
        if self.aovs().iter().any(|layer| *layer != Aov::EachLevel) {
            let why = "each-level is the only layer of a film: the others are recorded by a render";
            return Err(Fault::option("aov", why));
        }
        if one && !self.aovs().is_empty() {
            let why = "each-level needs several levels, and this film has one";
            return Err(Fault::option("aov", why));
        }
        match self.given().find(|(option, _)| option.of_levels && one) {
            Some((option, _)) => Err(Fault::option(
                option.name,
                "needs several levels, and this film has one",
            )),
            None => Ok(()),
        }
    }

    /// An error for layers without an EXR file, and for options of file formats that are not written.
    pub fn check_layers(&self, files: &[PathBuf]) -> Result<(), Fault> {
        let has = |wanted| {
            files
                .iter()
                .any(|file| format(file).is_ok_and(|f| f == wanted))
        };
        let (exr, png) = (has(Format::Exr), has(Format::Png));
        let layers = "adds layers to EXR files: add -o with a name that ends in .exr";
        let (of_exr, of_png) = (
            "is of EXR files: add -o with a name that ends in .exr",
            "is of PNG files: add -o with a name that ends in .png",
        );
        for (name, there, what) in [
            ("aov", exr, layers),
            ("exr", exr, of_exr),
            ("exposure", png, of_png),
            ("view", png, of_png),
        ] {
            if self.has(name) && !there {
                return Err(Fault::option(name, what));
            }
        }
        Ok(())
    }
}

impl Outputs {
    /// Checks before anything is rendered that the files can be written at all.
    pub fn new(files: &[PathBuf]) -> Result<Self, Fault> {
        for file in files {
            format(file)?;
            can_write(file)?;
        }
        Ok(Self {
            files: files.to_vec(),
            versions: Mutex::new(files.iter().map(|file| version(file)).collect()),
        })
    }

    /// The file names, for messages.
    pub fn names(&self) -> String {
        let names = self.files.iter().map(|file| file.display().to_string());
        names.collect::<Vec<_>>().join(", ")
    }

    /// True if a PNG file is among them, so that the exposure matters.
    pub fn has_png(&self) -> bool {
        let is_png = |file: &PathBuf| format(file).is_ok_and(|f| f == Format::Png);
        self.files.iter().any(is_png)
    }

    /// The files that another program has made or changed since the last check or write.
    pub fn changed(&self) -> Vec<PathBuf> {
        let versions = self.versions.lock().unwrap_or_else(|e| e.into_inner());
        let pairs = self.files.iter().zip(versions.iter());
        let changed = pairs.filter(|(file, known)| version(file) != **known);
        changed.map(|(file, _)| file.clone()).collect()
    }

    /// Writes every file, each whole or not at all; fails with the first failure, after the other files are written.
    pub fn write(&self, finished: &Finished<'_>) -> Result<(), Fault> {
        let mut versions = self.versions.lock().unwrap_or_else(|e| e.into_inner());
        let save = |(file, known): (&PathBuf, &mut Option<Version>)| {
            let saved = finished.save(file);
            *known = version(file);
            saved
        };
        let failures = self.files.iter().zip(versions.iter_mut()).map(save);
        // Collected before the first failure is returned, so that every file is written.
        let failures: Vec<_> = failures.filter_map(Result::err).collect();
        failures.into_iter().next().map_or(Ok(()), Err)
    }
}

/// An error if a file cannot be made or replaced here, without touching it, so that a long render does not fail at its
/// end.
pub fn can_write(file: &Path) -> Result<(), Fault> {
    let cannot = |what: &str| Err(Fault::Output(format!("{}: {what}", file.display())));
    if file.is_dir() {
        return cannot("is a folder");
    }
    let target = match Target::of(file) {
        Ok(Target::Stream) => return Ok(()),
        Ok(Target::Whole(file)) => file,
        // The checks below report the problem.
        Err(_) => file.to_owned(),
    };
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        let what = match folder.exists() {
            true => "a file, not a folder",
            false => "no such folder",
        };
        return Err(Fault::Output(format!("{}: {what}", folder.display())));
    }
    // An unnamed temporary file, where the system has them, leaves no trace.
    match tempfile::tempfile_in(folder) {
        Ok(_) => Ok(()),
        Err(error) => Err(Fault::Output(format!("{}: {error}", target.display()))),
    }
}

/// An error if two outputs are one file, or an output is also an input.
pub fn check_distinct<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Fault> {
    let mut seen = HashSet::new();
    let inputs: HashSet<PathBuf> = inputs.into_iter().filter_map(identity).collect();
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
        if !seen.insert(file) {
            return refused("is the name of two outputs");
        }
    }
    Ok(())
}

/// The file that a path names, whether it exists or not; `None` for pipes and devices.
fn identity(path: &Path) -> Option<PathBuf> {
    if let Ok(file) = path.canonicalize() {
        return file.is_file().then_some(file);
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
    Some(folder.join(path.file_name()?))
}
