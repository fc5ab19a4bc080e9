//! Parsers of render options, and the settings that the options resolve to.

use super::Blame;
use super::render_args::RenderArgs;
use anyhow::{Context, anyhow};
use opsr::image::film::Window;
use opsr::image::level_film::MAX_LEVELS;
use opsr::integrator::Settings;
use opsr::integrator::levels::SCALES;
use opsr::integrator::method::{Kind, Method};
use opsr::math::UVec2;
use opsr::regularise::Rule;

/// A pair such as `640x480`.
pub(super) fn size(text: &str) -> Result<UVec2, String> {
    let numbers = text.split_once('x').map(|(w, h)| (w.parse(), h.parse()));
    match numbers {
        Some((Ok(w @ 1..=65536), Ok(h @ 1..=65536))) => Ok(UVec2::new(w, h)),
        _ => Err("expected WIDTHxHEIGHT, such as 640x480, from 1 to 65536 each".into()),
    }
}

/// A window such as `10,20,32,32`.
pub(super) fn window(text: &str) -> Result<Window, String> {
    let numbers: Result<Vec<u32>, _> = text.split(',').map(|n| n.trim().parse()).collect();
    match numbers.as_deref() {
        Ok(&[x, y, w, h]) => Ok(Window { x, y, w, h }),
        _ => Err("expected X,Y,WIDTH,HEIGHT in pixels from the top left".into()),
    }
}

/// Scale of a table's factors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Scale {
    /// The best one of a pilot.
    Auto,
    /// This, instead of the table's own scale.
    By(f32),
}

/// A scale such as `0.5` or `auto`.
pub(super) fn scale(text: &str) -> Result<Scale, String> {
    if text == "auto" {
        return Ok(Scale::Auto);
    }
    match text.parse::<f32>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(Scale::By(x)),
        _ => Err("expected a number above 0, or auto".into()),
    }
}

/// Scales of levels; empty for one level.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Levels(Vec<f32>);

/// A number of levels such as `6`, or their scales such as `0,0.25,1`.
pub(super) fn level_scales(text: &str) -> Result<Levels, String> {
    if let Ok(number) = text.parse::<usize>() {
        // Plain path tracing, and down from the roughest by factors of 5.
        let roughest = SCALES[SCALES.len() - 1];
        let scale = |k: usize| roughest * 0.2f32.powi((number - 1 - k) as i32);
        return match number {
            1 => Ok(Levels(Vec::new())),
            n if n == SCALES.len() => Ok(Levels(SCALES.to_vec())),
            2..=MAX_LEVELS => Ok(Levels(
                std::iter::once(0.0).chain((1..number).map(scale)).collect(),
            )),
            _ => Err(format!("expected 1 to {MAX_LEVELS} levels")),
        };
    }
    let scales: Result<Vec<f32>, _> = text.split(',').map(|x| x.trim().parse()).collect();
    let scales = scales.map_err(|_| "expected a number of levels, or scales such as 0,0.25,1")?;
    Ok(Levels(scales))
}

/// Scales of the levels of a render. Those that were asked for and that the settings cannot have are refused; where
/// nothing was asked for and there is something to roughen, there are several wherever the settings can have them.
pub(super) fn levels(
    args: &RenderArgs,
    settings: &Settings,
    has_lobes: bool,
) -> anyhow::Result<Vec<f32>> {
    let with = |levels: Vec<f32>| Settings {
        levels,
        ..settings.clone()
    };
    if let Some(Levels(levels)) = args.levels.clone() {
        let settings = with(levels);
        settings.check_levels().context("--levels").usage()?;
        return Ok(settings.levels);
    }
    let nothing = [Rule::Plain, Rule::constant(0.0)].contains(&settings.rule) || !has_lobes;
    if nothing || args.table_scale == Some(Scale::Auto) {
        return Ok(Vec::new());
    }
    let settings = with(SCALES.to_vec());
    if let Err(why) = settings.check_levels() {
        tracing::info!("one level: {why}");
        return Ok(Vec::new());
    }
    Ok(settings.levels)
}

/// Resolves the options that choose a method.
pub(super) fn method(args: &RenderArgs) -> anyhow::Result<Method> {
    let mut spec = args.method.clone();
    let factors = spec.table.is_some() || spec.gamma.is_some();
    let consistent = spec.lambda.is_some();
    spec.refused().map_err(anyhow::Error::msg).usage()?;
    let accumulates = matches!(spec.method, Kind::Default | Kind::Reuse);
    if accumulates && !factors && (consistent || spec.method == Kind::Reuse) {
        let what = "--consistent and --mode reuse need --opsr-table or --gamma";
        return Err(anyhow!(what)).usage();
    }
    if !accumulates && (factors || consistent) {
        let what = "this --mode has a rule of its own: no --opsr-table, --gamma or --consistent";
        return Err(anyhow!(what)).usage();
    }
    if spec.filter.is_some() && spec.method != Kind::FilterGlossy {
        return Err(anyhow!("--filter needs --mode filter-glossy")).usage();
    }
    if let Some(Scale::By(scale)) = args.table_scale {
        if args.table_energy.is_some() {
            return Err(anyhow!("--table-energy needs --table-scale auto")).usage();
        }
        spec.table_scale = Some(scale);
    }
    spec.resolve().input()
}

/// The option to blame for a film that cannot be.
pub(super) fn window_option(args: &RenderArgs) -> &'static str {
    match args.crop {
        Some(_) => "--crop",
        None => "--size",
    }
}

/// The settings with that method.
pub(super) fn settings(args: &RenderArgs, method: &Method) -> Settings {
    Settings {
        estimator: method.estimator,
        rule: method.rule.clone(),
        max_vertices: args.max_vertices,
        seed: args.seed,
        ..Settings::default()
    }
}
