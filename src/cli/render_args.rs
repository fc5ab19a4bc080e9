//! Options of `opsr render`.

use super::bar::Style;
use super::job;
use super::output::{FileArgs, ResolveArgs};
use super::part;
use super::scene::{LensArgs, SceneArgs};
use clap::Args;
use opsr::integrator::bidirectional::Strategy;
use opsr::integrator::layers::Aov;
use opsr::integrator::method::{MethodSpec, positive};
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

/// Options of `opsr render`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    pub(super) scene: SceneArgs,

    /// File of the picture: .exr (linear, with variance and other layers) or .png; may be given several times.
    #[arg(short, long, value_name = "FILE", default_value = "out.exr")]
    pub(super) output: Vec<PathBuf>,

    /// Samples per pixel. Without --spp, --time and --target-error: 128.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) spp: Option<u32>,
    /// With --film: only the samples from number A on (from 0), without B. Any split of the samples, of the picture by
    /// --crop, or of both will do. A part that begins after sample 0 keeps every sample, 12 bytes for each of a pixel, 28
    /// more with levels and 12 for each of them; other parts keep only sums: parts of all samples of a crop are small.
    #[arg(long, value_name = "A..B", requires = "film", conflicts_with = "spp", value_parser = part::samples)]
    pub(super) samples: Option<Range<u32>>,
    /// Stop after this long, such as 60s or 5min.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(super) time: Option<Duration>,
    /// Stop when the estimated relative error of the picture (root of its relMSE; of several levels that of the best of
    /// every pixel) is below this.
    #[arg(long, value_name = "X", value_parser = positive)]
    pub(super) target_error: Option<f32>,

    /// Size of the picture, or a share such as 50% or 1/2 of the size without this option: 512 rows, as wide as the camera
    /// asks for.
    #[arg(long, value_name = "WxH|SHARE", value_parser = job::size)]
    pub(super) size: Option<job::Size>,
    /// Render only this part of the picture; each number in pixels, or a share of width or height such as 25% or 1/4.
    #[arg(long, value_name = "X,Y,W,H", value_parser = job::crop)]
    pub(super) crop: Option<job::Crop>,
    /// Camera by name or number (from 0).
    #[arg(long, value_name = "NAME")]
    pub(super) camera: Option<String>,
    #[command(flatten)]
    pub(super) lens: LensArgs,

    #[command(flatten)]
    pub(super) method: MethodSpec,
    /// Levels of roughening on the same paths, of which every pixel gets the best: their number, or the scales of the
    /// table or constant, such as 0,0.25,1. Level 0 is plain path tracing; 1 renders the table or constant as it is.
    /// Without it four where a table or a constant can have them: not with --mode, --consistent or another integrator.
    #[arg(long, value_name = "N|SCALES", value_parser = job::level_scales)]
    pub(super) levels: Option<job::Levels>,
    #[command(flatten)]
    pub(super) resolve: ResolveArgs,

    /// Show one strategy of bdpt or vcm with its weights: S vertices from the light and T from the camera, both ends
    /// included, such as 0,3 (a light that the camera meets), 1,2 (light sampling) or 3,1 (light tracing); or `merges` of
    /// vcm. The pictures of all strategies add up to the whole.
    #[arg(long, value_name = "S,T|merges", value_parser = job::strategy)]
    pub(super) strategy: Option<Strategy>,

    /// Scattering vertices of the longest path.
    #[arg(long, alias = "max-depth", value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(super) max_vertices: u32,
    /// Seed of all random numbers: the same seed gives a bit-identical picture.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// Threads; without it as many as there are cores. The picture does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) threads: Option<u16>,

    /// Add layers to EXR files; without a list albedo, normal and depth.
    #[arg(
        long,
        value_enum,
        value_name = "LAYERS",
        value_delimiter = ',',
        num_args = 0..=1,
        default_missing_value = "albedo,normal,depth"
    )]
    pub(super) aov: Vec<Aov>,
    #[command(flatten)]
    pub(super) files: FileArgs,
    /// Leave times out of the files, so that equal renders are equal files.
    #[arg(long)]
    pub(super) reproducible: bool,

    /// Style of the progress display; `auto` ends with a line that says what was written.
    #[arg(long, value_enum, default_value_t)]
    pub(super) progress: Style,
    /// Write the picture so far this often.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(super) save_every: Option<Duration>,
    /// Keep the state of the render in this file, at the end and as often as --save-every says (or every minute).
    #[arg(long, value_name = "FILE")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Continue from the checkpoint; one of another scene or of other settings is refused.
    #[arg(long, requires = "checkpoint")]
    pub(super) resume: bool,
    /// Write no picture but this part of one, for `opsr merge`. It is whole or not there at all.
    #[arg(
        long,
        value_name = "FILE",
        conflicts_with_all = [
            "output", "time", "target_error", "checkpoint", "save_every", "reference", "stats", "log", "trace_pixel", "tev",
            "resolve", "level_layers",
            "denoise", "exposure", "view", "exr_half", "exr_compression"
        ]
    )]
    pub(super) film: Option<PathBuf>,
    /// Show the true error against this picture (root of the relMSE), while rendering and at the end.
    #[arg(long, value_name = "FILE")]
    pub(super) reference: Option<PathBuf>,
    /// Write statistics of the render to this file (.json).
    #[arg(long, value_name = "FILE")]
    pub(super) stats: Option<PathBuf>,
    /// Log samples, seconds and errors over time to this file: .csv, or for TensorBoard a name that contains tfevents.
    #[arg(long, value_name = "FILE")]
    pub(super) log: Option<PathBuf>,
    /// Print the paths of a pixel instead of rendering, as --levels 1 renders them: those of its first samples, as many as
    /// --spp says (or 4).
    #[arg(long, value_name = "X,Y", value_parser = job::pixel)]
    pub(super) trace_pixel: Option<job::Pixel>,
    /// Print the path of this sample (from 0) only.
    #[arg(long, value_name = "N", requires = "trace_pixel")]
    pub(super) sample: Option<u32>,
    /// Show the picture in the viewer tev while it is made.
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:14158")]
    pub(super) tev: Option<String>,
}

const EXAMPLES: &str = "Examples:
  opsr render scene.glb --opsr-table beta-0.001 -o out.exr -o out.png
  opsr render scene.glb --time 60s --size 1280x720 --env sky.hdr -o out.png
  opsr render scene.glb --spp 4096 --checkpoint night.ckpt -o out.exr
  opsr render scene.glb --spp 8192 --checkpoint night.ckpt --resume -o out.exr";
