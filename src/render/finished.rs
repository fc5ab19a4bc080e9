//! The end of a render: the picture for the user, its stated error, and the layers and metadata of its files.
//!
//! An [`Outcome`] has the films of a render. [`Shown`] is the picture after the choice among levels and blurs and after
//! denoising. [`Finished`] has both, and writes files. The program, the library, Python, the viewer, merged parts and
//! benches use this module.

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
use crate::pilot::witness::MissingLight;
use crate::resolve::{
    Resolve, Resolved, Statement, denoise_film, film_error, film_errors, resolve_film,
};
use std::borrow::Cow;
use std::path::Path;

/// Metadata key of the average error in EXR files.
pub const STATED: &str = "mean_relative_error";

/// A picture after the choice among levels, blurs and denoising.
#[derive(Clone, Debug, PartialEq)]
pub struct Shown {
    /// Linear radiance, Rec. 709 primaries.
    pub picture: Buffer,
    /// The picture before denoising; `None` if it was not denoised.
    pub noisy: Option<Buffer>,
    /// The choice among levels and blurs, for films in batches. Its error is that of `picture`.
    pub resolved: Option<Resolved>,
}

impl Shown {
    /// Chooses among the levels and blurs of a picture, and denoises it where a denoiser is given.
    ///
    /// The denoised picture is blended with the resolved one by samples that the denoiser did not get, unless `resolve`
    /// is `Resolve::None`. Fails if the denoiser fails or albedo and normal are missing.
    pub fn of(picture: &Picture, spec: &Spec, denoiser: Option<&Denoiser>) -> Result<Self, Fault> {
        Self::made(&mut Cow::Borrowed(picture), spec, denoiser)
    }

    /// [`Self::of`], but an owned picture drops levels and AOVs before denoising, unless files need all levels.
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
            // The network adds light to a black picture.
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

    /// Expected relative error of every pixel, including the light that a witness found missing. `None` with too few
    /// samples. For denoised means of samples it is the error before denoising.
    pub fn errors(&self, film: &Film, missing: Option<&MissingLight>) -> Option<Vec<f32>> {
        let own = match &self.resolved {
            Some(resolved) => resolved.is_known().then(|| resolved.error()),
            None => film_errors(film),
        };
        match missing {
            Some(missing) => own.map(|errors| missing.beside(errors)),
            None => own,
        }
    }

    /// Stated error of the picture, including the light that a witness found missing; its mean is that of
    /// [`errors`](Self::errors). For denoised means of samples it is the error before denoising.
    pub fn statement(&self, film: &Film, missing: Option<&MissingLight>) -> Statement {
        let own = match &self.resolved {
            Some(resolved) => resolved.statement(),
            None => film_error(film),
        };
        missing.map_or(own, |missing| own.with_missing(&missing.squares))
    }
}

/// A finished or partial render, before its picture is chosen and denoised.
#[derive(Clone)]
pub struct Outcome<'a> {
    /// Films and AOVs.
    pub picture: Cow<'a, Picture>,
    /// Light that a witness found missing in the picture.
    pub missing: Option<MissingLight>,
    /// The requested layers.
    pub aovs: Vec<Layer>,
    /// Metadata of EXR files.
    pub metadata: Metadata,
    /// World-to-camera matrix; `None` if unknown.
    pub world_to_camera: Option<[f32; 16]>,
    /// Options of the choice among levels and of files.
    pub spec: Spec,
    /// True if the built-in studio lights the scene, where automatic exposure never brightens.
    pub in_studio: bool,
}

impl<'a> Outcome<'a> {
    /// The outcome of a request after `samples` samples per pixel.
    pub fn of(
        request: &Request<'_>,
        picture: Cow<'a, Picture>,
        samples: u32,
        missing: Option<MissingLight>,
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

    /// The outcome of a render without its scene: merged parts, or a checkpoint. `metadata` is that of the render;
    /// options of the film in `spec` replace those in it. Fails for options that do not apply to the film.
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

    /// Makes the picture. Fails if the denoiser fails.
    pub fn finish(self, denoiser: Option<&Denoiser>) -> Result<Finished<'a>, Fault> {
        let shown = Shown::of(&self.picture, &self.spec, denoiser)?;
        Ok(Finished {
            outcome: self,
            shown,
        })
    }

    /// [`Self::finish`] for files only: an owned picture that is denoised keeps only its film and the number of levels.
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
    /// Films, layers and metadata of the render.
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

    /// Relative standard error of the mean of a picture of one level, which blurs do not change.
    pub fn mean_error(&self) -> Option<f64> {
        let levels = self.outcome.picture.levels.as_ref();
        let one = levels.is_none_or(|film| film.levels() == 1);
        one.then(|| self.film().relative_mean_error()).flatten()
    }

    /// Channels of an EXR file beside the picture: requested layers, the picture before denoising, the choice of every
    /// pixel with its bias, variance and error, and every level if requested.
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
    pub(crate) fn display(&self) -> Display {
        let Outcome {
            spec, in_studio, ..
        } = &self.outcome;
        spec.display(&self.shown.picture, *in_studio)
    }

    /// Metadata of EXR files, with the stated error.
    pub fn metadata(&self) -> Metadata {
        let mut metadata = self.outcome.metadata.clone();
        let stated = self.statement().mean;
        if stated.is_finite() {
            metadata.insert(STATED.into(), format!("{stated:.4}"));
        }
        metadata
    }

    /// Writes an EXR file with all layers, or a PNG file, by the ending of the name; whole or not at all.
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
