//! `--table-scale auto`: scale and contrast of a table from a pilot before the render.

use super::job::Size;
use super::render::{DEFAULT_SPP, check_memory, frame_and_camera};
use super::render_args::RenderArgs;
use super::scene::{self, Opened};
use super::stop::Stop;
use super::{Blame, job};
use anyhow::Context;
use opsr::integrator::{Settings, View};
use opsr::math::UVec2;
use opsr::tune;

/// Tunes the table of `settings` as a pilot finds best; false if the user stopped the pilot.
pub(super) fn tune(
    args: &RenderArgs,
    opened: &Opened,
    settings: &mut Settings,
    stop: &Stop,
) -> anyhow::Result<bool> {
    let (size, camera) = frame_and_camera(args, opened)?;
    let window = job::window(args, size);
    // Before samples are counted: that takes a picture too.
    check_memory(args, settings, size, window)?;
    let view = View::new(&opened.scene, &camera, size, window);
    let samples = match (args.spp, args.time) {
        (Some(spp), _) => spp,
        (None, Some(time)) => tune::samples_in(time, settings, &view)
            .context(job::window_option(args))
            .usage()?,
        (None, None) if args.target_error.is_some() => tune::SPP_OF_TARGET,
        (None, None) => DEFAULT_SPP,
    };
    tracing::info!("pilot for {samples} samples per pixel");
    let pilot = tune::choose_while(settings, &view, samples, &|| !stop.asked())
        .context(job::window_option(args))
        .usage()?;
    let Some(pilot) = pilot else {
        return Ok(false);
    };
    let tuning = (args.table_energy).map_or(pilot.tuning, |share| pilot.within(share.into()));
    if let Some(table) = settings.rule.table_mut() {
        *table = table.tuned(tuning);
        let why = if pilot.decided || args.table_energy.is_some() {
            ""
        } else {
            " (no candidate is better by more than the pilot's noise)"
        };
        let chosen = pilot.candidates.iter().find(|c| c.tuning == tuning);
        let energy = chosen.map_or(0.0, |c| 100.0 * c.energy);
        eprintln!(
            "table scale {}, contrast {}{why}, changes the picture's mean by {energy:+.1} %, from {} paths, for \
             {samples} samples per pixel",
            table.scale, tuning.contrast, pilot.paths
        );
    }
    for c in &pilot.candidates {
        tracing::info!(
            "scale {}, contrast {}: bias² {:.3e}, variance {:.3e}, mean {:+.1} %",
            c.tuning.scale,
            c.tuning.contrast,
            c.bias2,
            c.variance,
            100.0 * c.energy
        );
    }
    Ok(true)
}

/// Size of the whole picture.
pub(super) fn size(args: &RenderArgs, opened: &Opened) -> anyhow::Result<UVec2> {
    frame(args.size, args.camera.as_deref(), opened)
}

/// Size of the whole picture of a camera.
pub(super) fn frame(
    size: Option<Size>,
    camera: Option<&str>,
    opened: &Opened,
) -> anyhow::Result<UVec2> {
    let share = match size {
        Some(Size::Pixels(size)) => return Ok(size),
        Some(Size::Share(share)) => share,
        None => 1.0,
    };
    let camera = scene::camera(&opened.scene, camera, 1.0)?;
    let whole = camera.default_frame();
    let scaled = |side: u32| ((share * f64::from(side)).round() as u32).clamp(1, 65536);
    Ok(UVec2::new(scaled(whole.x), scaled(whole.y)))
}
