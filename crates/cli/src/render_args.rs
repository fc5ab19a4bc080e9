//! Options of `opsr render`: those of the render itself are declared in `opsr::render`, those of the program here.

use super::bar::Style;
use super::options::RenderOptions;
use clap::Args;
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

    #[command(flatten)]
    pub(super) program: ProgramArgs,
}

/// Options of the program, beside those of a render.
#[derive(Args, Debug)]
pub(super) struct ProgramArgs {
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
}

const MORE: &str = "Example: opsr render scene.glb --time 60s -o out.png

These are the options that most renders use; --help lists all.";

const EXAMPLES: &str = "Examples:
  opsr render scene.glb -o out.exr -o out.png
  opsr render scene.glb --opsr-table beta-0.001 --spp 256 -o out.png
  opsr render scene.glb --time 60s --size 1280x720 --env sky.hdr -o out.png
  opsr render scene.glb --spp 4096 --checkpoint night.ckpt -o out.exr
  opsr render scene.glb --spp 8192 --checkpoint night.ckpt --resume -o out.exr";
