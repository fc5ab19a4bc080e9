//! The files of a picture: formats, layers, exposure; a check that they can be written.

use super::fault::Fault;
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
use std::path::Path;

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
