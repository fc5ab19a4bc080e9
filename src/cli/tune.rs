//! `--table-scale auto`: the level of a table, and how much of its pattern, from a pilot before the render.

use super::Blame;
use super::render::DEFAULT_SPP;
use super::render_args::RenderArgs;
use super::scene::{self, Opened};
use anyhow::Context;
use opsr::image::film::{Film, Window};
use opsr::integrator::{Picture, Settings, View};
use opsr::math::UVec2;
use opsr::tune;
use std::time::{Duration, Instant};

/// Rows of a picture whose size is not given.
const DEFAULT_ROWS: u32 = 512;

/// Samples that a pilot takes a render to a target error for.
const SPP_OF_TARGET: u32 = 256;

/// Changes the table as a pilot finds best; how much of its pattern is left.
pub(super) fn tune(
    args: &RenderArgs,
    opened: &Opened,
    settings: &mut Settings,
) -> anyhow::Result<f32> {
    let size = size(args, opened)?;
    let aspect = size.x as f32 / size.y as f32;
    let camera = scene::camera(&opened.scene, args.camera.as_deref(), aspect)?;
    let window = args.crop.unwrap_or(Window::full(size));
    let view = View::new(&opened.scene, &camera, size, window);
    let samples = match (args.spp, args.time) {
        (Some(spp), _) => spp,
        (None, Some(time)) => samples_in(time, settings, &view)?,
        (None, None) if args.target_error.is_some() => SPP_OF_TARGET,
        (None, None) => DEFAULT_SPP,
    };
    let pilot = tune::choose(settings, &view, samples)
        .context("--crop")
        .usage()?;
    let change = (args.table_energy).map_or(pilot.change, |share| pilot.within(share.into()));
    if let Some(table) = settings.rule.table_mut() {
        *table = change.of(table);
        let why = if pilot.decided || args.table_energy.is_some() {
            ""
        } else {
            " (the pilot could not tell another one better)"
        };
        let level = pilot.levels.iter().find(|level| level.change == change);
        let energy = level.map_or(0.0, |level| 100.0 * level.energy);
        eprintln!(
            "table scale {}, contrast {}{why}, changes the picture's mean by {energy:+.1} %, from {} paths, for \
             {samples} samples per pixel",
            table.scale, change.contrast, pilot.paths
        );
    }
    for level in &pilot.levels {
        tracing::info!(
            "scale {}, contrast {}: bias² {:.3e}, variance {:.3e}, mean {:+.1} %",
            level.change.scale,
            level.change.contrast,
            level.bias2,
            level.variance,
            100.0 * level.energy
        );
    }
    Ok(change.contrast)
}

/// About how many samples per pixel fit into this time.
fn samples_in(time: Duration, settings: &Settings, view: &View<'_>) -> anyhow::Result<u32> {
    const PROBE: u32 = 4;
    let mut picture = Picture {
        film: Film::cropped(view.sensor.frame, view.window)
            .context("--crop")
            .usage()?,
        aovs: None,
    };
    let clock = Instant::now();
    (settings.integrator()).pass(view, 0..PROBE, &mut picture);
    let rate = f64::from(PROBE) / clock.elapsed().as_secs_f64().max(1e-6);
    Ok(((rate * time.as_secs_f64()) as u32).max(1))
}

/// Size of the whole picture.
pub(super) fn size(args: &RenderArgs, opened: &Opened) -> anyhow::Result<UVec2> {
    if let Some(size) = args.size {
        return Ok(size);
    }
    let camera = scene::camera(&opened.scene, args.camera.as_deref(), 1.0)?;
    let width = (DEFAULT_ROWS as f32 * camera.aspect.unwrap_or(1.0)).round();
    Ok(UVec2::new(
        (width as u32).clamp(1, 16 * DEFAULT_ROWS),
        DEFAULT_ROWS,
    ))
}
