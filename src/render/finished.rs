//! The end of a render: the picture as its user gets it, its stated error, and the layers and text of its files.
//!
//! An [`Outcome`] is what a render leaves. [`Shown`] is the picture that is made of it by the choice among levels and blurs and by the
//! denoiser. [`Finished`] has both, and writes files.
//! The program, the library, Python, the viewer, merged parts and benches end here.

use super::fault::Fault;
use super::files::{Format, format};
use super::request::Request;
use super::spec::{Effect, OPTIONS, Spec};
use super::value::Field;
use crate::image::denoise::Denoiser;
use crate::image::display::Display;
use crate::image::exr::{self, Header, Layer, Metadata, Plane};
use crate::image::film::Film;
use crate::image::{Buffer, png};
use crate::integrator::Picture;
use crate::integrator::layers::{Aov, Layers};
use crate::math::Rgb;
use crate::pilot::witness::Missing;
use crate::resolve::{
    Resolve, Resolved, Statement, denoise_film, film_error, film_errors, resolve_film,
};
use std::borrow::Cow;
use std::path::Path;

/// Key of the average error in the text of EXR files.
pub const STATED: &str = "mean_relative_error";

/// A picture as it is shown.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Linear radiance, Rec. 709 primaries.
    pub picture: Buffer,
    /// The picture before it was denoised.
    pub noisy: Option<Buffer>,
    /// The choice among levels and blurs, of films that have batches. Its error is that of the picture.
    pub resolved: Option<Resolved>,
}

impl Shown {
    /// Chooses among the levels and blurs of a picture, and denoises it where a denoiser is given.
    ///
    /// The denoiser's picture is mixed with the choice by samples that it has not seen, unless the raw samples are asked for. Fails
    /// where the denoiser does, or lacks albedo and normal.
    pub fn of(picture: &Picture, spec: &Spec, denoiser: Option<&Denoiser>) -> Result<Self, Fault> {
        Self::made(&mut Cow::Borrowed(picture), spec, denoiser)
    }

    /// The same. A picture that is owned loses levels and AOVs, unless its files have all levels, before the denoiser takes its memory.
    fn made(
        picture: &mut Cow<'_, Picture>,
        spec: &Spec,
        denoiser: Option<&Denoiser>,
    ) -> Result<Self, Fault> {
        let how = spec.resolve();
        let resolved = (picture.levels.as_ref()).map(|film| resolve_film(film, how));
        let before = match &resolved {
            Some(resolved) => resolved.picture.clone(),
            None => picture.film.mean(),
        };
        let Some(denoiser) = denoiser else {
            return Ok(Self {
                picture: before,
                noisy: None,
                resolved,
            });
        };
        let first = picture.aovs.as_ref().and_then(|a| a.first.as_ref());
        let needs = || Fault::option("denoise", "needs a render with {aov} albedo,normal");
        let first = first.ok_or_else(needs)?;
        let (albedo, normal) = (first.albedo(), first.normal());
        let levels = match picture {
            Cow::Owned(own) if !spec.aovs().contains(&Aov::EachLevel) => {
                own.aovs = None;
                own.levels.as_mut().map(|film| Cow::Owned(film.take()))
            }
            picture => picture.levels.as_ref().map(Cow::Borrowed),
        };
        let clean = |noisy: &Buffer| {
            // The network invents light in a black picture.
            if noisy.pixels.iter().all(|p| *p == Rgb::ZERO) {
                return Ok(noisy.clone());
            }
            denoiser.denoise(noisy, &albedo, &normal)
        };
        let (shown, resolved) = match (levels, resolved) {
            (Some(film), Some(resolved)) if how != Resolve::None => {
                let resolved = denoise_film(film, how, resolved, clean)?;
                (resolved.picture.clone(), Some(resolved))
            }
            (films, resolved) => {
                drop(films);
                (clean(&before)?, resolved)
            }
        };
        Ok(Self {
            picture: shown,
            noisy: Some(before),
            resolved,
        })
    }

    /// Expected relative error of every pixel, with the light that a witness found missing. `None` where there are too few
    /// samples to tell. Denoised means of samples state the error before they were denoised.
    pub fn errors(&self, film: &Film, missing: Option<&Missing>) -> Option<Vec<f32>> {
        let own = match &self.resolved {
            Some(resolved) => resolved.is_known().then(|| resolved.error()),
            None => film_errors(film),
        };
        match missing {
            Some(missing) => own.map(|errors| missing.beside(errors)),
            None => own,
        }
    }

    /// Stated error of the picture, with the light that a witness found missing; its mean is that of
    /// [`errors`](Self::errors). Denoised means of samples state the error before they were denoised.
    pub fn statement(&self, film: &Film, missing: Option<&Missing>) -> Statement {
        let own = match &self.resolved {
            Some(resolved) => resolved.statement(),
            None => film_error(film),
        };
        missing.map_or(own, |missing| own.with_missing(&missing.squares))
    }
}

/// A render at its end, or so far, before its picture is chosen and denoised.
#[derive(Clone)]
pub struct Outcome<'a> {
    /// Films and AOVs.
    pub picture: Cow<'a, Picture>,
    /// Light that a witness found and the picture lacks.
    pub missing: Option<Missing>,
    /// The layers that were asked for.
    pub aovs: Vec<Layer>,
    /// Text of EXR files.
    pub metadata: Metadata,
    /// World to camera; `None` where it is not known.
    pub world_to_camera: Option<[f32; 16]>,
    /// Options of the choice and of files.
    pub spec: Spec,
    /// True if the built-in studio lights the scene: automatic exposure then never brightens.
    pub in_studio: bool,
}

impl<'a> Outcome<'a> {
    /// The outcome of a request after `samples` samples per pixel.
    pub fn of(
        request: &Request<'_>,
        picture: Cow<'a, Picture>,
        samples: u32,
        missing: Option<Missing>,
    ) -> Self {
        let mut metadata = request.metadata(samples, picture.film.rejected.total());
        if let Some(missing) = &missing {
            missing.note(&mut metadata);
        }
        Self {
            aovs: Layers::new(request.spec.aovs(), &request.view()).of(&picture),
            picture,
            missing,
            metadata,
            world_to_camera: Some(request.camera.world_to_camera()),
            spec: request.spec.clone(),
            in_studio: request.subject.in_studio,
        }
    }

    /// The outcome of a render whose scene is not here: merged parts, or a checkpoint. `metadata` is the text of that render, in
    /// which options of the film in `spec` replace those that it had. Fails for options that its film does not have.
    pub fn of_film(
        spec: &Spec,
        picture: Picture,
        wanted: &[Aov],
        mut metadata: Metadata,
        world_to_camera: Option<[f32; 16]>,
    ) -> Result<Self, Fault> {
        spec.check_film(&picture)?;
        if picture.levels.is_some() {
            for option in OPTIONS.iter().filter(|option| option.of_film) {
                metadata.remove(option.name);
            }
            metadata.insert("resolve".into(), spec.resolve().text());
        }
        let chosen = spec.given().filter(|(option, _)| option.of_film);
        let chosen = chosen.filter(|(option, _)| option.effect == Effect::Pixels);
        metadata.extend(chosen.map(|(option, text)| (option.name.to_owned(), text)));
        Ok(Self {
            aovs: Layers::recorded(wanted).of(&picture),
            picture: Cow::Owned(picture),
            missing: None,
            metadata,
            world_to_camera,
            spec: spec.clone(),
            in_studio: false,
        })
    }

    /// Makes the picture. Fails where the denoiser does.
    pub fn finish(self, denoiser: Option<&Denoiser>) -> Result<Finished<'a>, Fault> {
        let shown = Shown::of(&self.picture, &self.spec, denoiser)?;
        Ok(Finished {
            outcome: self,
            shown,
        })
    }

    /// The same for files alone: of a picture that is owned and denoised the film and its number of levels stay, all that files need.
    pub fn finish_files(mut self, denoiser: Option<&Denoiser>) -> Result<Finished<'a>, Fault> {
        let shown = Shown::made(&mut self.picture, &self.spec, denoiser)?;
        Ok(Finished {
            outcome: self,
            shown,
        })
    }
}

/// A finished render.
#[derive(Clone)]
pub struct Finished<'a> {
    /// All that the render left.
    pub outcome: Outcome<'a>,
    /// The picture.
    pub shown: Shown,
}

impl Finished<'_> {
    fn film(&self) -> &Film {
        &self.outcome.picture.film
    }

    /// Stated error of the picture, with the light that a witness found missing.
    pub fn statement(&self) -> Statement {
        (self.shown).statement(self.film(), self.outcome.missing.as_ref())
    }

    /// Relative standard error of the mean of a picture of one level, which no blur changes.
    pub fn mean_error(&self) -> Option<f64> {
        let levels = self.outcome.picture.levels.as_ref();
        let one = levels.is_none_or(|film| film.levels() == 1);
        one.then(|| self.film().relative_mean_error()).flatten()
    }

    /// Channels of an EXR file beside the picture: layers that were asked for, the picture before it was denoised, the choice of
    /// every pixel with its bias, variance and error, and every level where that is asked for.
    fn channels(&self) -> Vec<Plane<'_>> {
        let aovs = self.outcome.aovs.iter();
        let mut channels: Vec<_> = aovs.flat_map(Layer::channels).collect();
        let count = self.film().pixels.len();
        if let Some(noisy) = &self.shown.noisy {
            channels.extend(Plane::colour("noisy", count, |i| noisy.pixels[i]));
        }
        if let Some(resolved) = &self.shown.resolved {
            channels.extend(resolved.channels());
        }
        let missing = self.outcome.missing.as_ref();
        if let Some(errors) = self.shown.errors(self.film(), missing) {
            channels.push(Plane::new("error", "", errors.len(), move |i| errors[i]));
        }
        if let Some(film) = &self.outcome.picture.levels
            && self.outcome.spec.aovs().contains(&Aov::EachLevel)
        {
            channels.extend((0..film.levels()).flat_map(|k| {
                Plane::colour(format!("level{k}"), count, move |i| film.mean_of(i, k))
            }));
        }
        channels
    }

    /// Exposure and view of PNG files.
    pub fn display(&self) -> Display {
        let Outcome {
            spec, in_studio, ..
        } = &self.outcome;
        spec.display(&self.shown.picture, *in_studio)
    }

    /// Text of EXR files, with the stated error.
    pub fn metadata(&self) -> Metadata {
        let mut metadata = self.outcome.metadata.clone();
        let stated = self.statement().mean;
        if stated.is_finite() {
            metadata.insert(STATED.into(), format!("{stated:.4}"));
        }
        metadata
    }

    /// Writes an EXR file with all layers, or a PNG file, whole or not at all; the ending of the name says which.
    ///
    /// An EXR file of a picture that is the mean of its samples also has the statistics of the samples.
    pub fn save(&self, file: impl AsRef<Path>) -> Result<(), Fault> {
        let file = file.as_ref();
        match format(file)? {
            Format::Png => png::write(file, &self.shown.picture, self.display())?,
            Format::Exr => {
                let header = Header {
                    metadata: &self.metadata(),
                    storage: self.outcome.spec.exr.unwrap_or_default(),
                    world_to_camera: self.outcome.world_to_camera,
                };
                let (film, others) = (self.film(), self.channels());
                if self.shown.resolved.is_some() || self.shown.noisy.is_some() {
                    let part = (film.size, film.window);
                    let picture = &self.shown.picture.pixels;
                    let main = Plane::colour("", picture.len(), |i| picture[i]);
                    exr::write(file, part, main.into_iter().chain(others), header)?;
                } else {
                    exr::write_film_beside(file, film, others, header)?;
                }
            }
        }
        Ok(())
    }
}
