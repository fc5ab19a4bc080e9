//! Files and streams that results are written to.

use super::Blame;
use anyhow::{Context, anyhow, bail};
use opsr::files::Target;
use opsr::image::denoise::Denoiser;
use opsr::image::display::{Display, ViewTransform, auto_exposure};
use opsr::image::exr::{self, Compression, Header, Layer, Metadata, Storage};
use opsr::image::{Buffer, png};
use opsr::integrator::Picture;
use opsr::math::Rgb;
use opsr::resolve::{Resolve, film_error, film_errors, resolve_film};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Options of the choice among the levels of a film.
#[derive(clap::Args, Clone, Copy, Debug)]
pub(super) struct ResolveArgs {
    /// Smoothing of a picture of several levels. Without it `default`, and `sharp` with --denoise.
    #[arg(long, value_enum)]
    resolve: Option<Resolve>,
    /// Add every level to EXR files, as layers `level0`, `level1` and so on.
    #[arg(long)]
    pub(super) level_layers: bool,
    /// Denoise the picture with Open Image Denoise 2, which is looked for in the folder OIDN_DIR and in the system's library
    /// path. EXR files keep the picture before it as the layer `noisy`.
    #[arg(long)]
    pub(super) denoise: bool,
}

impl ResolveArgs {
    /// Settings of the choice. A denoiser does its own blur.
    pub(super) fn settings(self) -> Resolve {
        self.resolve.unwrap_or(match self.denoise {
            true => Resolve::Sharp,
            false => Resolve::Default,
        })
    }

    /// The denoiser, if one is asked for.
    pub(super) fn denoiser(self) -> anyhow::Result<Option<Denoiser>> {
        let denoiser = self.denoise.then(Denoiser::open).transpose();
        denoiser.context("--denoise").input()
    }

    /// The picture to look at while it is made.
    pub(super) fn shown(self, picture: &Picture) -> Buffer {
        match &picture.levels {
            Some(film) => resolve_film(film, self.settings()).picture,
            None => picture.film.mean(),
        }
    }
}

/// Options of the files.
#[derive(clap::Args, Clone, Copy, Debug)]
pub(super) struct FileArgs {
    /// Brightness of PNG files in stops; `auto` puts the 95th percentile of the luminance at 80 % of white, and brightens nothing
    /// in the built-in studio; `none` is 0.
    #[arg(
        long,
        value_name = "STOPS|auto|none",
        default_value = "auto",
        allow_negative_numbers = true,
        value_parser = exposure
    )]
    exposure: Exposure,
    /// View transform of PNG files.
    #[arg(long, value_enum, default_value_t)]
    view: ViewTransform,
    /// Write colours and normals of EXR files as half floats: half the size, three digits, at most 65504.
    #[arg(long)]
    exr_half: bool,
    /// Compression of EXR files, always lossless.
    #[arg(long, value_enum, value_name = "CODING", default_value_t)]
    exr_compression: Compression,
}

/// Exposure of PNG files.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Exposure {
    /// The one that suits the picture.
    Auto,
    /// So many stops.
    Stops(f32),
}

fn exposure(text: &str) -> Result<Exposure, String> {
    match text {
        "auto" => Ok(Exposure::Auto),
        "none" => Ok(Exposure::Stops(0.0)),
        number => (super::scene::finite(number).map(Exposure::Stops))
            .map_err(|_| "expected a number of stops, auto or none".into()),
    }
}

impl FileArgs {
    fn storage(self) -> Storage {
        Storage {
            half: self.exr_half,
            compression: self.exr_compression,
        }
    }

    /// Exposure and view; a picture is brightened by at most `most` stops unless the user says so.
    fn display(self, picture: &Buffer, most: f32) -> Display {
        let exposure = match self.exposure {
            Exposure::Auto => auto_exposure(picture).min(most),
            Exposure::Stops(stops) => stops,
        };
        let view = self.view;
        Display { exposure, view }
    }
}

/// Picture that was written.
pub(super) struct Written {
    /// Exposure of the PNG files, if there are any.
    pub(super) exposure: Option<f32>,
    /// Estimated relative error of the picture, before it was denoised.
    pub(super) error: f64,
    /// The picture.
    pub(super) shown: Buffer,
}

/// The files that a picture is written to.
pub(super) struct Outputs {
    files: Vec<PathBuf>,
    args: FileArgs,
    resolve: ResolveArgs,
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

/// True if one of the files can hold layers.
pub(super) fn holds_layers(files: &[PathBuf]) -> bool {
    files.iter().any(|file| format(file) == Some(Format::Exr))
}

impl Outputs {
    /// Checks before anything is rendered that the files can be written at all.
    pub(super) fn new(
        files: &[PathBuf],
        args: FileArgs,
        resolve: ResolveArgs,
    ) -> anyhow::Result<Self> {
        for file in files {
            if format(file).is_none() {
                let file = file.display();
                let what = anyhow!("{file}: expected a name that ends in .exr or .png");
                return Err(what).usage();
            }
            can_write(file).output()?;
        }
        Ok(Self {
            files: files.to_vec(),
            args,
            resolve,
            denoiser: resolve.denoiser()?,
            most: f32::INFINITY,
        })
    }

    /// Lets automatic exposure darken pictures only: in a light that has the right brightness, what is dark stays dark.
    pub(super) fn never_brighten(&mut self) {
        self.most = 0.0;
    }

    /// The files, for people.
    pub(super) fn names(&self) -> String {
        let names = self.files.iter().map(|file| file.display().to_string());
        names.collect::<Vec<_>>().join(", ")
    }

    /// Writes every file, each whole or not at all; fails with the first failure, after the other files are written.
    pub(super) fn write(
        &self,
        picture: &Picture,
        layers: Vec<Layer>,
        world_to_camera: Option<[f32; 16]>,
        metadata: &Metadata,
    ) -> anyhow::Result<Written> {
        let (written, failed) = self.try_write(picture, layers, world_to_camera, metadata)?;
        failed.map_or(Ok(written), Err)
    }

    /// Writes every file, each whole or not at all, and returns the first failure beside the rest.
    ///
    /// EXR files get the layers, and the place of the camera if it is known. Of several levels the one of every pixel is
    /// chosen; EXR files then have the layers `level`, `bias2`, `variance` and `error` in place of the statistics of the
    /// film, as does a denoised picture. Of one level they have `error` beside them.
    pub(super) fn try_write(
        &self,
        picture: &Picture,
        mut layers: Vec<Layer>,
        world_to_camera: Option<[f32; 16]>,
        metadata: &Metadata,
    ) -> anyhow::Result<(Written, Option<anyhow::Error>)> {
        let args = self.resolve;
        let resolved =
            (picture.levels.as_ref()).map(|film| (film, resolve_film(film, args.settings())));
        let mut shown = match &resolved {
            Some((_, resolved)) => resolved.picture.clone(),
            None => picture.film.mean(),
        };
        if let Some(denoiser) = &self.denoiser {
            let first = picture.aovs.as_ref().and_then(|a| a.first.as_ref());
            let first = first.context("--denoise needs a render with --aov albedo,normal");
            let first = first.usage()?;
            // A filter makes something of nothing.
            let black = shown.pixels.iter().all(|p| *p == Rgb::ZERO);
            let clean = match black {
                true => shown.clone(),
                false => denoiser.denoise(&shown, &first.albedo(), &first.normal())?,
            };
            layers.push(Layer::rgb("noisy", &shown));
            shown = clean;
        }
        if let Some((film, resolved)) = &resolved {
            layers.extend(resolved.layers());
            if args.level_layers {
                let level = |k| Layer::rgb(&format!("level{k}"), &film.mean(k));
                layers.extend((0..film.levels()).map(level));
            }
        } else if !layers.iter().any(|layer| layer.name == "error") {
            let errors = film_errors(&picture.film);
            layers.extend(errors.map(|errors| Layer::scalar("error", errors)));
        }
        let header = Header {
            metadata,
            storage: self.args.storage(),
            world_to_camera,
        };
        let is_png = |file: &PathBuf| format(file) == Some(Format::Png);
        let display = (self.files.iter().any(is_png)).then(|| self.args.display(&shown, self.most));
        let (film, whole) = (&picture.film, resolved.is_some() || args.denoise);
        let mut failed = None;
        for file in &self.files {
            let done = if let Some(display) = display.filter(|_| is_png(file)) {
                png::write(file, &shown, display).output()
            } else if whole {
                let part = (film.size, film.window);
                exr::write_layers(file, part, &shown, &layers, header).output()
            } else {
                exr::write_film(file, film, &layers, header).output()
            };
            if let Err(error) = done {
                failed = failed.or(Some(error));
            }
        }
        let written = Written {
            exposure: display.map(|display| display.exposure),
            error: match &resolved {
                Some((_, resolved)) => resolved.relative_error(),
                None => film_error(&picture.film).error,
            },
            shown,
        };
        Ok((written, failed))
    }
}

/// Fails if a file cannot be made or replaced here, as far as one can tell without touching it: better known before
/// a long render than after.
pub(super) fn can_write(file: &Path) -> anyhow::Result<()> {
    if file.is_dir() {
        bail!("{}: is a folder", file.display());
    }
    let file = match Target::of(file) {
        Ok(Target::Stream) => return Ok(()),
        Ok(Target::Whole(file)) => file,
        // What is wrong with it is said below.
        Err(_) => file.to_owned(),
    };
    let folder = match file.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        bail!("{}: no such folder", folder.display());
    }
    // The same kind of file that a result is before it takes its name; it goes away at once.
    tempfile::NamedTempFile::new_in(folder).with_context(|| file.display().to_string())?;
    Ok(())
}

/// Refuses outputs of which two are one file, or one is a file that is read.
pub(super) fn check_distinct(outputs: &[&Path], inputs: &[&Path]) -> anyhow::Result<()> {
    let mut seen: Vec<PathBuf> = Vec::new();
    let inputs: Vec<PathBuf> = inputs.iter().filter_map(|path| identity(path)).collect();
    for path in outputs {
        let Some(file) = identity(path) else { continue };
        let (path, problem) = (path.display(), "give the output another name");
        if inputs.contains(&file) {
            return Err(anyhow!(
                "{path}: would replace a file that is read: {problem}"
            ))
            .usage();
        }
        if seen.contains(&file) {
            return Err(anyhow!("{path}: is the name of two outputs: {problem}")).usage();
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

/// Writes to standard output. A pipe that is closed early is no error: its reader has seen enough.
pub(super) fn print(text: impl AsRef<[u8]>) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_ref()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(e).context("standard output").output()
        }
        _ => Ok(()),
    }
}

/// Origin of a picture, for the metadata of its file.
pub(super) struct Provenance {
    pub(super) command: String,
    pub(super) scene: String,
    /// Metadata that every run of these options has alike.
    pub(super) fixed: Metadata,
    /// Options that choose the picture, by name.
    pub(super) settings: Vec<(&'static str, String)>,
    pub(super) reproducible: bool,
}

impl Provenance {
    /// The EXR metadata of a picture with this many samples, of which so many were refused.
    pub(super) fn metadata(
        &self,
        spp: u32,
        refused: u64,
        seconds: f64,
        threads: usize,
    ) -> Metadata {
        let mut metadata = self.reproducible_metadata(spp, refused);
        // Neither the number of threads nor the words of the command change a pixel.
        if !self.reproducible {
            metadata.insert("command".into(), self.command.clone());
            metadata.insert("seconds".into(), format!("{seconds:.3}"));
            metadata.insert("threads".into(), threads.to_string());
        }
        metadata
    }

    /// The metadata of reproducible files.
    pub(super) fn reproducible_metadata(&self, spp: u32, refused: u64) -> Metadata {
        let mut metadata = self.fixed.clone();
        metadata.insert("spp".into(), spp.to_string());
        metadata.insert("refused_samples".into(), refused.to_string());
        metadata
    }
}
