//! Frames of an animation: `opsr film`, and `opsr render --frames`.

mod movie;
mod outputs;
pub(super) mod render;

use super::exit::{Blame, IntoExit};
use super::options::PictureOptions;
use super::output::note;
use crate::outputs::check_distinct;
use anyhow::{Context, anyhow};
use opsr::Aov;
use opsr::image::exr::{self, Layer, Layers, Metadata};
use opsr::image::film::Window;
use opsr::integrator::View;
use opsr::render::open::Opened;
use opsr::render::{Fault, Heading, OPTIONS, Spec};
use opsr::scene::{Camera, Hit, Scene};
use opsr_formats::FORMATS;
use opsr_frames::surfaces::places;
use opsr_frames::{Frame, FrameNames, FrameRange, Sequence, Surfaces};
use outputs::FrameOutputs;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Options of `opsr film`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct FilmArgs {
    /// The scene that the frames show.
    scene: PathBuf,
    /// Frames that `opsr render` wrote (.exr); #### stands for their numbers.
    frames: PathBuf,
    /// Numbers of the frames, such as 1..48; by default all existing files.
    #[arg(long = "frames", value_name = "A..B")]
    range: Option<FrameRange>,
    /// Files of the averaged frames, .exr or .png, or one file of all frames, .apng; may be given several times.
    #[arg(short, long, value_name = "FILE", required = true)]
    output: Vec<PathBuf>,
    /// Add the layer `motion`: pixels to the place of a surface in the last frame and in the next.
    #[arg(long)]
    motion: bool,
    /// Leave the command out of the files, so that equal films give equal files.
    #[arg(long)]
    reproducible: bool,
    #[command(flatten)]
    files: PictureOptions,
}

const EXAMPLES: &str = "Examples:
  opsr render scene.glb --at 12@24 --seed 12 -o frames/0012.exr
  opsr film scene.glb frames/####.exr -o film_####.png

Frames need different seeds: noise that is the same in all of them does not average.";

/// Runs `opsr film`.
pub(super) fn run(args: &FilmArgs) -> anyhow::Result<()> {
    let names = FrameNames::new(&args.frames);
    let missing = || {
        anyhow!(
            "{}: expected a name with #### for the numbers of frames",
            args.frames.display()
        )
    };
    let names = names.ok_or_else(missing).usage()?;
    let numbers = match args.range {
        Some(range) => range.numbers().collect(),
        None => found(&names, &args.frames)?,
    };
    let mut outputs = FrameOutputs::new(
        &args.output,
        &args.files.0,
        (args.reproducible, args.motion),
        (numbers[0], numbers.len()),
    )?;
    let inputs: Vec<PathBuf> = numbers.iter().map(|number| names.of(*number)).collect();
    let read = inputs.iter().chain([&args.scene]).map(PathBuf::as_path);
    let written: Vec<PathBuf> = numbers.iter().flat_map(|n| outputs.files(*n)).collect();
    let written = written.iter().map(PathBuf::as_path);
    check_distinct(written.chain(outputs.movies()), read).into_exit()?;
    let mut film = Film::new(args.motion);
    let mut seeds = Vec::new();
    for number in numbers {
        let path = names.of(number);
        let (spec, read) = recorded(&path)?;
        seeds.extend(read.metadata.get("seed").cloned());
        let open = || spec.open(&args.scene, FORMATS, Scene::new).into_exit();
        let opened = film.open(&args.scene, &spec, open)?;
        let theirs = read.metadata.get("scene_sha256");
        if theirs.is_some_and(|theirs| *theirs != opened.sha256) {
            let what = format!("rendered from another scene than {}", args.scene.display());
            return Err(anyhow!("{}: {what}", path.display())).input();
        }
        let camera = spec.camera(&opened.scene, read.size).into_exit()?;
        let frame = read_frame(&path, number, read, camera).input()?;
        film.add(opened, frame, &mut outputs)?;
    }
    film.end(&mut outputs)?;
    let summary = outputs.summary();
    outputs.end()?;
    if seeds.len() > 1 && seeds.windows(2).all(|pair| pair[0] == pair[1]) {
        tracing::warn!(
            "all frames have the seed {}: noise that is the same in all of them does not average",
            seeds[0]
        );
    }
    note(summary);
    Ok(())
}

/// Numbers of the existing frames, which must be consecutive.
fn found(names: &FrameNames, pattern: &Path) -> anyhow::Result<Vec<u32>> {
    let shown = pattern.display().to_string();
    let numbers = names.found().context(shown.clone()).input()?;
    if numbers.is_empty() {
        return Err(anyhow!("{shown}: no such files")).input();
    }
    let gap = numbers.windows(2).find(|pair| pair[1] != pair[0] + 1);
    if let Some([before, _]) = gap {
        let path = names.of(before + 1);
        return Err(anyhow!(
            "{}: missing; --frames A..B takes a part",
            path.display()
        ))
        .input();
    }
    Ok(numbers)
}

/// A file of a frame with the options of its scene, light and camera.
fn recorded(path: &Path) -> anyhow::Result<(Spec, Layers)> {
    let layers = exr::read_layers(path).input()?;
    let mut spec = Spec::default();
    let wanted = [Heading::Scene, Heading::Light, Heading::Camera];
    for option in OPTIONS
        .iter()
        .filter(|option| wanted.contains(&option.heading))
    {
        let Some(text) = layers.metadata.get(option.name) else {
            continue;
        };
        let value = match option.value.is_empty() {
            true => Value::Bool(text == "true"),
            false => Value::from(text.as_str()),
        };
        let set = spec.set(option.name, &value);
        set.map_err(|fault| Fault::Input(format!("{}: {fault}", path.display())))
            .into_exit()?;
    }
    spec.load_look().into_exit()?;
    Ok((spec, layers))
}

/// Layers of an averaged frame, which describe its surfaces, with their names in files and their channels.
const LAYERS: [(Aov, &str, &[&str]); 6] = [
    (Aov::Albedo, "albedo", &["R", "G", "B"]),
    (Aov::Normal, "normal", &["X", "Y", "Z"]),
    (Aov::Depth, "depth", &[""]),
    (Aov::Alpha, "", &["A"]),
    (Aov::Position, "position", &["X", "Y", "Z"]),
    (Aov::Id, "id", &["mesh", "material"]),
];

/// The frame of a file.
fn read_frame(path: &Path, number: u32, mut read: Layers, camera: Camera) -> anyhow::Result<Frame> {
    let at = |what| anyhow!("{}: {what}", path.display());
    let (x, y) = read.position;
    let place = u32::try_from(x).ok().zip(u32::try_from(y).ok());
    let window = place.map(|(x, y)| Window {
        x,
        y,
        w: read.width as u32,
        h: read.height as u32,
    });
    let window = window.filter(|window| window.inside(&Window::full(read.size)));
    let window = window.ok_or_else(|| at("its pixels reach beyond the frame"))?;
    let picture = read.main().map_err(|problem| problem.at(path))?;
    if picture.pixels.iter().any(|p| !p.is_finite()) {
        return Err(at("a pixel is not finite"));
    }
    let mut take = |layer: &str, channel: &&'static str| {
        let name = [layer, channel];
        let name = name.into_iter().filter(|part| !part.is_empty());
        let name = name.collect::<Vec<_>>().join(".");
        Some((*channel, read.channels.remove(&name)?))
    };
    let layers = LAYERS.iter().filter_map(|(_, layer, channels)| {
        Some(Layer {
            channels: channels
                .iter()
                .map(|c| take(layer, c))
                .collect::<Option<_>>()?,
            name: (*layer).to_owned(),
        })
    });
    let layers = layers.collect();
    let mut plane = |name: &str| read.channels.remove(name).unwrap_or_default();
    let error = plane("error");
    let pairs = plane("variance").into_iter().zip(plane("bias2"));
    let squares: Vec<f32> = pairs.map(|(v, b)| v + b).collect();
    if error.iter().chain(&squares).any(|x| x.is_nan() || *x < 0.0) {
        return Err(at("a stated error is not a number"));
    }
    Ok(Frame {
        number,
        size: read.size,
        window,
        camera,
        picture,
        error,
        squares,
        surfaces: Surfaces::default(),
        layers,
        metadata: of_render(read.metadata),
    })
}

/// Metadata keys of the run that rendered a frame, and of the statistics of its samples.
const OF_A_RUN: [&str; 4] = ["command", "seconds", "threads", "mean_error"];

/// The metadata of a frame without the keys in [`OF_A_RUN`].
fn of_render(mut metadata: Metadata) -> Metadata {
    metadata.retain(|key, _| !OF_A_RUN.contains(&key.as_str()));
    metadata
}

/// Frames in order. `last` is the scene of the last frame, with the surface hits of its pixel centres.
#[derive(Default)]
struct Film {
    sequence: Sequence,
    last: Option<(Opened, Vec<Option<Hit>>)>,
    /// Options of the scene and light of the last frame.
    asked: String,
}

/// The options of scene and light without the moment, as text: equal for two specs only if their scenes are equal.
fn asked(spec: &Spec) -> String {
    let spec = Spec {
        at: None,
        ..spec.clone()
    };
    spec.words(&[Heading::Scene, Heading::Light])
}

impl Film {
    /// A film without frames; `motion` adds the layer of that name.
    fn new(motion: bool) -> Self {
        Self {
            sequence: Sequence::new(motion),
            ..Self::default()
        }
    }

    /// The scene at the moment of a spec: the last frame's if only cameras have moved since, else opened by `open`.
    fn open(
        &mut self,
        scene: &Path,
        spec: &Spec,
        open: impl FnOnce() -> anyhow::Result<Opened>,
    ) -> anyhow::Result<Opened> {
        let (asked, before) = (asked(spec), self.asked.clone());
        self.asked = asked;
        if let Some((opened, _)) = &mut self.last
            && self.asked == before
            && opened.at(spec, scene, FORMATS).into_exit()?
            && let Some((opened, _)) = self.last.take()
        {
            return Ok(opened);
        }
        open()
    }

    /// Adds a frame of a scene, traces its surfaces, and writes the frame whose neighbours are now complete.
    fn add(
        &mut self,
        opened: Opened,
        mut frame: Frame,
        outputs: &mut FrameOutputs,
    ) -> anyhow::Result<()> {
        let view = View::new(&opened.scene, &frame.camera, frame.size, frame.window);
        let (surfaces, hits) = Surfaces::of(&view);
        frame.surfaces = surfaces;
        // A static scene needs no positions of surfaces in the other frame: `open` took `last`.
        if let Some((last, before)) = &self.last {
            self.sequence
                .set_after(places(before, &last.scene, &opened.scene));
            frame.surfaces.before = places(&hits, &opened.scene, &last.scene);
        }
        let in_studio = opened.in_studio;
        self.last = Some((opened, hits));
        let done = self
            .sequence
            .push(frame)
            .map_err(anyhow::Error::msg)
            .input()?;
        if let Some((frame, averaged)) = done {
            outputs.write(frame, averaged, in_studio)?;
        }
        Ok(())
    }

    /// Writes the remaining frames, without neighbours after the last.
    fn end(&mut self, outputs: &mut FrameOutputs) -> anyhow::Result<()> {
        let in_studio = self
            .last
            .as_ref()
            .is_some_and(|(opened, _)| opened.in_studio);
        while let Some((frame, averaged)) = self.sequence.average_next() {
            outputs.write(frame, averaged, in_studio)?;
        }
        Ok(())
    }
}
