//! What can be asked of `opsr render`.

use super::bar::Style;
use super::job;
use super::scene::{self, SceneArgs};
use clap::{Args, ValueEnum};
use opsr::image::film::Window;
use opsr::math::UVec2;
use opsr::regularise::Lookup;
use std::path::PathBuf;
use std::time::Duration;

/// Options of `opsr render`.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(super) struct RenderArgs {
    #[command(flatten)]
    pub(super) scene: SceneArgs,

    /// Where the picture goes: .exr (linear, with variance and other layers) or .png; may be given several times.
    #[arg(short, long, value_name = "FILE", default_value = "out.exr")]
    pub(super) output: Vec<PathBuf>,

    /// Samples per pixel. Without --spp, --time and --target-error: 128.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) spp: Option<u32>,
    /// Stop after this long, such as 60s or 5min.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(super) time: Option<Duration>,
    /// Stop when the estimated relative error of the picture (root of its relMSE) is below this.
    #[arg(long, value_name = "X", value_parser = scene::positive)]
    pub(super) target_error: Option<f32>,

    /// Size of the picture; without it 512 rows, as wide as the camera asks for.
    #[arg(long, value_name = "WxH", value_parser = job::size)]
    pub(super) size: Option<UVec2>,
    /// Render only this part of the picture.
    #[arg(long, value_name = "X,Y,W,H", value_parser = job::window)]
    pub(super) crop: Option<Window>,
    /// Camera by name or number (from 0).
    #[arg(long, value_name = "NAME")]
    pub(super) camera: Option<String>,

    /// Learned attenuation factors.
    #[arg(long, value_name = "FILE", conflicts_with = "gamma")]
    pub(super) opsr_table: Option<PathBuf>,
    /// Multiply the table's factors by this, instead of the scale that the table carries; `auto` finds it, and the
    /// contrast, from a pilot for the number of samples asked for: 28 small renders, the best of them longer.
    #[arg(long, value_name = "X|auto", requires = "opsr_table", value_parser = job::scale)]
    pub(super) table_scale: Option<job::Scale>,
    /// How much of the table's pattern is kept, from 0, one factor for all paths, to 1.
    #[arg(long, value_name = "X", default_value_t = 1.0, requires = "opsr_table", value_parser = unit)]
    pub(super) table_contrast: f32,
    /// With --table-scale auto: of all that the pilot tries, only what changes the mean of the picture by at most this
    /// share, such as 0.03.
    #[arg(long, value_name = "SHARE", requires = "table_scale", value_parser = unit)]
    pub(super) table_energy: Option<f32>,
    /// How factors are looked up, instead of the way that the table was learned for.
    #[arg(long, value_enum, requires = "opsr_table")]
    pub(super) lookup: Option<LookupArg>,
    /// One attenuation factor in [0, 1] for all paths, instead of a table; 0 is plain path tracing.
    #[arg(long, value_name = "X", value_parser = unit)]
    pub(super) gamma: Option<f32>,
    /// How regularisation is done.
    #[arg(long, value_enum, default_value_t)]
    pub(super) mode: Mode,
    /// Filter value of --mode filter-glossy.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = scene::positive)]
    pub(super) filter: f32,
    /// Let the bias vanish: sample n roughens by n^-LAMBDA of the full amount, LAMBDA in (0, 0.5).
    #[arg(long, value_name = "LAMBDA", num_args = 0..=1, default_missing_value = "0.16666667", value_parser = exponent)]
    pub(super) consistent: Option<f32>,

    /// Surfaces that the longest path scatters from.
    #[arg(long, value_name = "N", default_value_t = 16, value_parser = clap::value_parser!(u32).range(1..=65536))]
    pub(super) max_depth: u32,
    /// Seed of all random numbers: the same seed gives the same picture to the bit.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) seed: u64,
    /// Threads; without it as many as there are cores. The picture does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    pub(super) threads: Option<u16>,

    /// Add albedo, normal and depth layers to EXR files.
    #[arg(long)]
    pub(super) aov: bool,
    /// Brighten PNG files by this many stops.
    #[arg(
        long,
        value_name = "STOPS",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        value_parser = scene::finite
    )]
    pub(super) exposure: f32,
    /// Leave times out of the files, so that equal renders are equal files.
    #[arg(long)]
    pub(super) reproducible: bool,

    /// How progress is shown.
    #[arg(long, value_enum, default_value_t)]
    pub(super) progress: Style,
    /// Write the picture so far this often.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(super) save_every: Option<Duration>,
    /// Keep the state of the render in this file, at the end and as often as --save-every says (or every minute).
    #[arg(long, value_name = "FILE")]
    pub(super) checkpoint: Option<PathBuf>,
    /// Go on from the checkpoint; one of another scene or of other settings is refused.
    #[arg(long, requires = "checkpoint")]
    pub(super) resume: bool,
    /// Show the picture in the viewer tev while it is made.
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, default_missing_value = "127.0.0.1:14158")]
    pub(super) tev: Option<String>,
}

const EXAMPLES: &str = "Examples:
  opsr render scene.glb --opsr-table params/beta-0.001.json -o out.exr -o out.png
  opsr render scene.glb --time 60s --size 1280x720 --env sky.hdr -o out.png
  opsr render scene.glb --spp 4096 --checkpoint night.ckpt -o out.exr
  opsr render scene.glb --spp 8192 --checkpoint night.ckpt --resume -o out.exr";

/// How regularisation is done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Mode {
    /// At next-event estimation only; the path goes on with the original lobe.
    #[default]
    Default,
    /// The path goes on with the regularised lobe: faster, slightly more bias.
    Reuse,
    /// pbrt-v4's rule, for comparison.
    Pbrt,
    /// Cycles' filter glossy, for comparison.
    FilterGlossy,
    /// No lobe sharper than the roughest before it, for comparison.
    RoughnessClamp,
    /// Kaplanyan and Dachsbacher's mollifier: lights without area seen through smooth mirrors and glass.
    Mollifier,
}

/// [`Lookup`] on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum LookupArg {
    /// The factor of the path's class.
    Nearest,
    /// Between neighbouring classes: continuous in every roughness.
    Linear,
}

impl From<LookupArg> for Lookup {
    fn from(lookup: LookupArg) -> Self {
        match lookup {
            LookupArg::Nearest => Self::Nearest,
            LookupArg::Linear => Self::Linear,
        }
    }
}

fn unit(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err("expected a number from 0 to 1".into()),
    }
}

fn exponent(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if x > 0.0 && x < 0.5 => Ok(x),
        _ => Err("expected a number between 0 and 0.5".into()),
    }
}
