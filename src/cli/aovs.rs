//! `--aov`: layers of EXR files beside the picture.

use super::Blame;
use super::output;
use super::render_args::RenderArgs;
use anyhow::anyhow;
use opsr::integrator::layers::Aov;
use opsr::integrator::{Estimator, Settings};

/// True if the layers need the light of a single level.
pub(super) fn splits_light(args: &RenderArgs) -> bool {
    Aov::recorded(&args.aov)[1]
}

/// An error for a layer that the render has not.
pub(super) fn check(args: &RenderArgs, settings: &Settings) -> anyhow::Result<()> {
    let wants = |aov| args.aov.contains(&aov);
    let light = splits_light(args);
    let path = matches!(
        settings.estimator,
        Estimator::Path { .. } | Estimator::Guided { .. }
    ) && settings.levels.is_empty();
    let what = if light && !path {
        "--aov emission, direct and indirect are of the path tracer with one level"
    } else if wants(Aov::Level) && settings.levels.is_empty() {
        "--aov level needs --levels"
    } else if wants(Aov::Time) && args.reproducible {
        "--aov time never makes the same file twice: not with --reproducible"
    } else {
        return Ok(());
    };
    Err(anyhow!(what)).usage()
}

/// An error for layers that no file would hold. A part of a picture keeps them for the file that is made of it.
pub(super) fn check_files(args: &RenderArgs) -> anyhow::Result<()> {
    if args.film.is_some() || output::holds_layers(&args.output) {
        return Ok(());
    }
    let asked = match (args.aov.is_empty(), args.resolve.level_layers) {
        (false, _) => "--aov",
        (true, true) => "--level-layers",
        (true, false) => return Ok(()),
    };
    Err(anyhow!(
        "{asked} adds layers to EXR files: add -o with a name that ends in .exr"
    ))
    .usage()
}

/// Parts of the AOVs that are recorded along paths: the first surface, light, time.
pub(super) fn recorded(args: &RenderArgs) -> [bool; 3] {
    let [first, light, time] = Aov::recorded(&args.aov);
    [first || args.resolve.denoise, light, time]
}
