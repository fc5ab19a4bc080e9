//! Options of `opsr render`: those of the render itself are declared in `opsr::render`, those of the program here.

use super::bar::Style;
use super::options::{Pixel, RenderOptions, pixel, samples};
use clap::Args;
use std::ops::Range;
use std::path::PathBuf;
use std::time::Duration;

/// Options of `opsr render`.
#[derive(Args, Debug)]
#[command(after_help = MORE, after_long_help = EXAMPLES)]
pub(super) struct RenderArgs {
    /// The scene: glTF 2.0 (.gltf or .glb), pbrt-v4 (.pbrt) or Mitsuba (.xml).
    pub(super) scene: PathBuf,
    #[command(flatten)]
    pub(super) render: RenderOptions,

    /// File of the picture, .exr or .png; may be repeated.
    ///
    /// EXR files are linear and have the variance and other layers.
    #[arg(
        short,
        long,
        value_name = "FILE",
        default_value = "out.exr",
        help_heading = "Files"
    )]
    pub(super) output: Vec<PathBuf>,
    /// Leave times out of the files, so that equal renders are equal files.
    #[arg(long, help_heading = "Files", hide_short_help = true)]
    pub(super) reproducible: bool,
    /// Show the true error against this picture (root of the relMSE), while rendering and at the end.
    #[arg(
        long,
        value_name = "FILE",
        help_heading = "Files",
        hide_short_help = true
    )]
    pub(super) reference: Option<PathBuf>,
    /// Write statistics of the render to this file (.json).
    #[arg(
        long,
        value_name = "FILE",
        help_heading = "Files",
        hide_short_help = true
    )]
    pub(super) stats: Option<PathBuf>,
    /// Log samples, seconds and errors over time to this file, a .csv.
    #[arg(
        long,
        value_name = "FILE",
        help_heading = "Files",
        hide_short_help = true
    )]
    pub(super) log: Option<PathBuf>,

    /// Write the picture so far this often.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration, help_heading = "Resume", hide_short_help = true)]
    pub(super) save_every: Option<Duration>,
    /// Keep the state of the render in this file.
    ///
    /// It is written at the end and as often as --save-every says (or every minute).
    #[arg(long, value_name = "FILE", help_heading = "Resume")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Continue from the checkpoint.
    ///
    /// One of another scene or of other settings is refused.
    #[arg(long, requires = "checkpoint", help_heading = "Resume")]
    pub(super) resume: bool,
    /// Write no picture but this part of one, for `opsr merge`. It is whole or not there at all.
    #[arg(
        long,
        value_name = "FILE",
        help_heading = "Resume",
        hide_short_help = true,
        conflicts_with_all = [
            "output", "time", "target_error", "checkpoint", "save_every", "reference", "stats", "log", "trace_pixel"
        ]
    )]
    pub(super) film: Option<PathBuf>,
    /// With --film: only the samples from number A on (from 0), without B, of those of the whole picture, which --spp says: a choice of
    /// the integrator depends on it. Any split of the samples, of the picture by --crop, or of both will do. A part that begins after sample 0 keeps every sample, 12 bytes for each of a pixel, 28
    /// more with levels and 12 for each of them; other parts keep only sums: parts of all samples of a crop are small.
    #[arg(long, value_name = "A..B", requires = "film", value_parser = samples, help_heading = "Resume", hide_short_help = true)]
    pub(super) samples: Option<Range<u32>>,

    /// Threads; without it as many as there are cores. The picture does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Program", hide_short_help = true)]
    pub(super) threads: Option<u16>,
    /// Style of the progress display; `auto` ends with a line that says what was written.
    #[arg(
        long,
        value_enum,
        default_value_t,
        help_heading = "Program",
        hide_short_help = true
    )]
    pub(super) progress: Style,
    /// Print the paths of a pixel instead of rendering, as --resolve raw renders them: those of its first samples, as many as
    /// --spp says (or 4).
    #[arg(long, value_name = "X,Y", value_parser = pixel, help_heading = "Program", hide_short_help = true)]
    pub(super) trace_pixel: Option<Pixel>,
    /// Print the path of this sample (from 0) only.
    #[arg(
        long,
        value_name = "N",
        requires = "trace_pixel",
        help_heading = "Program",
        hide_short_help = true
    )]
    pub(super) sample: Option<u32>,
}

const MORE: &str = "Example: opsr render scene.glb --time 60s -o out.png

These are the options that most renders use; --help lists all.";

const EXAMPLES: &str = "Examples:
  opsr render scene.glb -o out.exr -o out.png
  opsr render scene.glb --opsr-table beta-0.001 --spp 256 -o out.png
  opsr render scene.glb --time 60s --size 1280x720 --env sky.hdr -o out.png
  opsr render scene.glb --spp 4096 --checkpoint night.ckpt -o out.exr
  opsr render scene.glb --spp 8192 --checkpoint night.ckpt --resume -o out.exr";
