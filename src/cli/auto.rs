//! `--integrator auto`: a pilot before the render chooses the integrator, or the checkpoint says which it was.

use super::render::{DEFAULT_SPP, fingerprint, frame_and_camera};
use super::render_args::RenderArgs;
use super::scene::Opened;
use super::stop::Stop;
use super::{Blame, aovs, job};
use anyhow::{Context, anyhow};
use opsr::integrator::View;
use opsr::integrator::checkpoint::Checkpoint;
use opsr::integrator::method::Method;
use opsr::pilot::{Contender, Horizon, SPP_OF_TARGET, choose_integrator};
use opsr::regularise::Rule;

/// A contender, and the method that its settings come from.
type Entry = (Contender, Method);

/// The integrator that a checkpoint continues with, or the one that a pilot finds best; `None` if the user stopped the
/// pilot.
pub(super) fn choose(
    args: &RenderArgs,
    opened: &Opened,
    stop: &Stop,
) -> anyhow::Result<Option<Entry>> {
    if args.trace_pixel.is_some() || args.film.is_some() {
        let what = "--integrator auto chooses for itself: not with --trace-pixel or --film";
        return Err(anyhow!(what)).usage();
    }
    let mut entries = entries(args, opened)?;
    let (size, camera) = frame_and_camera(args, opened)?;
    if args.resume
        && let Some(path) = &args.checkpoint
    {
        let crop = args.crop.map(|crop| crop.of(size));
        let theirs = Checkpoint::open(path).input()?.fingerprint;
        let ours = |(c, _): &Entry| fingerprint(args, opened, &c.settings, size, crop) == theirs;
        // A checkpoint of none of them is refused where it is loaded.
        let place = entries.iter().position(ours).unwrap_or(0);
        return Ok(Some(entries.swap_remove(place)));
    }
    let view = View::new(&opened.scene, &camera, size, job::window(args, size));
    let threads = rayon::current_num_threads() as f64;
    let horizon = match (args.spp, args.time) {
        (Some(spp), _) => Horizon::Samples(spp),
        (None, Some(time)) => Horizon::Seconds(time.as_secs_f64() * threads),
        (None, None) if args.target_error.is_some() => Horizon::Samples(SPP_OF_TARGET),
        (None, None) => Horizon::Samples(DEFAULT_SPP),
    };
    let contenders: Vec<Contender> = entries.iter().map(|(c, _)| c.clone()).collect();
    let go_on = || !stop.asked();
    tracing::info!("the pilot begins");
    let choice = choose_integrator(&contenders, &view, horizon, args.reproducible, &go_on)
        .context(job::window_option(args))
        .usage()?;
    Ok(choice.map(|choice| {
        eprintln!("{choice}");
        entries.swap_remove(choice.best)
    }))
}

/// Everything that can render this picture, the path tracer first.
fn entries(args: &RenderArgs, opened: &Opened) -> anyhow::Result<Vec<Entry>> {
    let mut entries = Vec::new();
    for spec in args.method.contenders() {
        let (kind, own_table) = (spec.integrator, spec.table != args.method.table);
        let method = spec.resolve().input()?;
        let mut settings = job::settings(args, &method);
        if kind.is_path() && settings.rule != Rule::Plain {
            settings.levels = job::levels(args, &settings, opened.scene.has_lobes())?;
        }
        // A table that nobody asked for is for levels alone.
        let roughened = own_table && settings.rule != Rule::Plain && settings.levels.is_empty();
        if roughened || !kind.is_path() && aovs::check(args, &settings).is_err() {
            continue;
        }
        entries.push((Contender { kind, settings }, method));
    }
    Ok(entries)
}
