//! Files of averaged frames.

use super::super::exit::{Blame, IntoExit};
use super::super::output::{command, percent};
use super::movie::Movie;
use crate::outputs::{Outputs, check_distinct, check_layers, has_ending};
use anyhow::anyhow;
use opsr::image::display::Display;
use opsr::image::exr::{self, Header, Layer, Metadata};
use opsr::image::png;
use opsr::math::Vec2;
use opsr::render::can_write;
use opsr::render::{Fault, STATED, Spec};
use opsr_frames::{Averaged, Frame, FrameNames};
use std::path::{Path, PathBuf};

/// The files that averaged frames are written to.
pub(super) struct FrameOutputs {
    names: Vec<FrameNames>,
    movies: Vec<Movie>,
    spec: Spec,
    reproducible: bool,
    /// Exposure and view of PNG files: those of the first frame, so that brightness does not flicker.
    display: Option<Display>,
    written: usize,
    /// Sum of the average errors of the frames that state one, and their number.
    errors: (f64, usize),
}

impl FrameOutputs {
    /// Checks before any rendering that the files of `count` frames from the first one on can be written.
    pub(super) fn new(
        paths: &[PathBuf],
        spec: &Spec,
        (reproducible, motion): (bool, bool),
        (first, count): (u32, usize),
    ) -> anyhow::Result<Self> {
        let (movies, paths): (Vec<&PathBuf>, _) =
            paths.iter().partition(|path| has_ending(path, "apng"));
        let name = |path: &&PathBuf| {
            let what = "expected a name with ####, which stand for the number of the frame, or one that ends in .apng";
            let names = FrameNames::new(path);
            names
                .ok_or_else(|| anyhow!("{}: {what}", path.display()))
                .usage()
        };
        let names = paths.iter().map(name).collect::<Result<Vec<_>, _>>()?;
        let movie = |path: &&PathBuf| {
            can_write(path)?;
            Ok(Movie::new(path, count))
        };
        let movies: Result<Vec<Movie>, Fault> = movies.iter().map(movie).collect();
        let outputs = Self {
            names,
            movies: movies.into_exit()?,
            spec: spec.clone(),
            reproducible,
            display: None,
            written: 0,
            errors: (0.0, 0),
        };
        let files = outputs.files(first);
        Outputs::new(&files).into_exit()?;
        let all = files.iter().map(PathBuf::as_path).chain(outputs.movies());
        check_distinct(all, []).into_exit()?;
        let mut shown = files.clone();
        // A movie has an exposure and a view, as a PNG file has.
        shown.extend(outputs.movies().map(|path| path.with_extension("png")));
        check_layers(spec, &shown).into_exit()?;
        if motion && !files.iter().any(|file| has_ending(file, "exr")) {
            let what = "motion is a layer of EXR files: add -o with a name that ends in .exr";
            return Err(anyhow!(what)).usage();
        }
        Ok(outputs)
    }

    /// The files of all frames together.
    pub(super) fn movies(&self) -> impl Iterator<Item = &Path> {
        self.movies.iter().map(Movie::path)
    }

    /// Completes the files of all frames; returns those that are not written because frames are missing.
    pub(super) fn end(&mut self) -> anyhow::Result<Vec<PathBuf>> {
        let mut missing = Vec::new();
        for movie in self.movies.drain(..) {
            let path = movie.path().to_owned();
            if !movie.end().output()? {
                missing.push(path);
            }
        }
        Ok(missing)
    }

    /// The files of a frame.
    pub(super) fn files(&self, number: u32) -> Vec<PathBuf> {
        self.names.iter().map(|names| names.of(number)).collect()
    }

    /// Writes the files of a frame.
    pub(super) fn write(
        &mut self,
        frame: &Frame,
        averaged: Averaged,
        in_studio: bool,
    ) -> anyhow::Result<()> {
        let mut metadata = frame.metadata.clone();
        metadata.insert("frame".into(), frame.number.to_string());
        metadata.insert("averaged".into(), "along surfaces".into());
        let stated = metadata
            .get(STATED)
            .and_then(|text| text.parse::<f64>().ok());
        if let Some(stated) = stated {
            let stated = stated * averaged.error_ratio;
            self.errors = (self.errors.0 + stated, self.errors.1 + 1);
            metadata.insert(STATED.into(), format!("{stated:.4}"));
        }
        if !self.reproducible {
            metadata.insert("command".into(), command());
        }
        let mut layers = frame.layers.clone();
        let [last, next] = &averaged.motion;
        if !last.is_empty() {
            let channel = |of: &[Vec2], k: usize| of.iter().map(|way| way[k]).collect();
            let channels = [
                ("X", last, 0),
                ("Y", last, 1),
                ("Z", next, 0),
                ("W", next, 1),
            ];
            let channels = channels.map(|(name, of, k)| (name, channel(of, k)));
            layers.push(Layer {
                name: "motion".into(),
                channels: channels.into(),
            });
        }
        let window = averaged.window.iter().map(|frames| f32::from(*frames));
        layers.push(scalar("window", window.collect()));
        if !averaged.error.is_empty() {
            layers.push(scalar("error", averaged.error));
        }
        let picture = &averaged.picture;
        let display = *(self.display).get_or_insert_with(|| self.spec.display(picture, in_studio));
        for movie in &mut self.movies {
            movie.add(picture, display, fps(&metadata)).output()?;
        }
        for file in self.files(frame.number) {
            if has_ending(&file, "png") {
                png::write(&file, picture, display).output()?;
                continue;
            }
            let header = Header {
                metadata: &metadata,
                storage: self.spec.exr.unwrap_or_default(),
                world_to_camera: Some(frame.camera.world_to_camera()),
            };
            let part = (frame.size, frame.window);
            exr::write_layers(&file, part, picture, &layers, header).output()?;
        }
        self.written += 1;
        Ok(())
    }

    /// Number of frames that were written, with their error.
    pub(super) fn summary(&self) -> String {
        let names = self.names.iter().map(FrameNames::to_string);
        let movies = self.movies().map(|path| path.display().to_string());
        let names: Vec<String> = names.chain(movies).collect();
        let error = match self.errors {
            (_, 0) => String::new(),
            (sum, frames) => format!(", average error {}", percent(sum / frames as f64)),
        };
        let mut shown = self.files(0).into_iter();
        let shows = !self.movies.is_empty() || shown.any(|file| has_ending(&file, "png"));
        let exposure = match self.display.filter(|_| shows) {
            Some(display) => format!(", exposure {:+}", display.exposure),
            None => String::new(),
        };
        format!(
            "{}: {} frames{exposure}{error}",
            names.join(", "),
            self.written
        )
    }
}

/// Frames per second of a frame's moment; 24 by default.
fn fps(metadata: &Metadata) -> f64 {
    let moment = metadata.get("at").and_then(|text| text.split_once('@'));
    let fps = moment.and_then(|(_, fps)| fps.parse().ok());
    fps.filter(|fps| *fps > 0.0).unwrap_or(24.0)
}

/// A layer of one number per pixel.
fn scalar(name: &str, values: Vec<f32>) -> Layer {
    Layer {
        name: name.to_owned(),
        channels: vec![("", values)],
    }
}
