//! Options of `opsr render`: those of the render itself are declared in `opsr::render`, those of the program here.

use super::bar::Style;
use super::options::RenderOptions;
use clap::Args;
use opsr::render::Fault;
use opsr_frames::FrameRange;
use std::path::PathBuf;
use std::time::Duration;

/// Options of `opsr render`.
#[derive(Args, Debug)]
#[command(after_help = MORE, after_long_help = EXAMPLES)]
pub(super) struct RenderArgs {
    /// The scene: glTF 2.0 (.gltf or .glb), pbrt-v4 (.pbrt), Mitsuba (.xml), OBJ or PLY.
    pub(super) scene: PathBuf,
    #[command(flatten)]
    pub(super) render: RenderOptions,

    /// Frames of the animations, such as 1..48 or 1..48@30.
    ///
    /// Frame 0 is their start. The rate is 24 frames per second unless another number follows the @. Each frame is
    /// averaged with its neighbours along shared surfaces, which reduces noise and flicker. The number of the frame
    /// replaces #### in the names of -o; a name that ends in .apng gets all frames, for browsers to play. Frame N is
    /// rendered with the seed --seed + N. --time is for all frames, --checkpoint names a folder.
    #[arg(long, value_name = "A..B", help_heading = "Scene")]
    pub(super) frames: Option<FrameRange>,
    /// File of the picture, .exr or .png; may be repeated.
    ///
    /// EXR files hold linear radiance, the expected error and other layers.
    #[arg(
        short,
        long,
        value_name = "FILE",
        default_value = "out.exr",
        help_heading = "Files"
    )]
    pub(super) output: Vec<PathBuf>,
    /// Leave times and the command out of the files, so that equal renders give equal files.
    #[arg(long, help_heading = "Files", hide_short_help = true)]
    pub(super) reproducible: bool,
    /// Show the true error against this picture (mean relative error), while rendering and at the end.
    #[arg(
        long,
        value_name = "FILE",
        help_heading = "Files",
        hide_short_help = true
    )]
    pub(super) reference: Option<PathBuf>,
    /// Write statistics to this file; .json at the end, .csv over time. May be given twice.
    ///
    /// A .json has what the closing line says and more; a .csv samples, seconds and errors, at most once a second.
    #[arg(
        long,
        value_name = "FILE",
        help_heading = "Files",
        hide_short_help = true
    )]
    pub(super) stats: Vec<PathBuf>,

    /// Write the picture so far this often.
    ///
    /// Large pictures are written less often: writing takes at most a fifth of the time.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration, help_heading = "Resume", hide_short_help = true)]
    pub(super) save_every: Option<Duration>,
    /// Keep the state of the render in this file.
    ///
    /// It is written at the end and at the interval of --save-every (by default every minute).
    #[arg(long, value_name = "FILE", help_heading = "Resume")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Continue from the checkpoint.
    ///
    /// A checkpoint of another scene or of other settings is refused.
    #[arg(long, requires = "checkpoint", help_heading = "Resume")]
    pub(super) resume: bool,

    #[command(flatten)]
    pub(super) program: ProgramArgs,
}

impl RenderArgs {
    /// Files of statistics: those of the finished render, and those over time (.csv).
    fn statistics(&self) -> [Vec<&PathBuf>; 2] {
        let of_course = |path: &&PathBuf| path.extension().is_some_and(|ending| ending == "csv");
        let (course, end) = self.stats.iter().partition(of_course);
        [end, course]
    }

    /// The file for statistics of the finished render.
    pub(super) fn report(&self) -> Option<&PathBuf> {
        self.statistics()[0].first().copied()
    }

    /// The file for errors over time.
    pub(super) fn log(&self) -> Option<&PathBuf> {
        self.statistics()[1].first().copied()
    }

    /// An error for two files of statistics of one form.
    pub(super) fn check(&self) -> Result<(), Fault> {
        match self.statistics().iter().find(|files| files.len() > 1) {
            Some(files) => {
                let what = "one .json and one .csv at most";
                Err(Fault::usage(format!(
                    "--stats {}: {what}",
                    files[1].display()
                )))
            }
            None => Ok(()),
        }
    }

    /// Files that are written in addition to the picture.
    pub(super) fn others(&self) -> impl Iterator<Item = &PathBuf> {
        self.checkpoint.iter().chain(&self.stats)
    }
}

/// Options of the program, beside those of a render.
#[derive(Args, Debug)]
pub(super) struct ProgramArgs {
    /// Number of threads; by default the number of cores. The picture does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Program", hide_short_help = true)]
    pub(super) threads: Option<u16>,
    /// Style of the progress display; `auto` ends with a line that names the written files.
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
  opsr render scene.glb --frames 1..48 -o out_####.exr -o out_####.png
  opsr render scene.glb --spp 4096 --checkpoint night.ckpt -o out.exr
  opsr render scene.glb --spp 8192 --checkpoint night.ckpt --resume -o out.exr";
