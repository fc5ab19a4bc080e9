//! Parsers of render options, and the settings that the options resolve to.

use super::Blame;
use super::render_args::RenderArgs;
use anyhow::{Context, anyhow};
use opsr::image::film::Window;
use opsr::image::level_film::MAX_LEVELS;
use opsr::integrator::Settings;
use opsr::integrator::bidirectional::Strategy;
use opsr::integrator::levels::scales;
use opsr::integrator::method::{IntegratorKind, Kind, Method, MethodSpec};
use opsr::math::UVec2;

/// Size of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Size {
    /// Columns and rows.
    Pixels(UVec2),
    /// Share of the size that the picture has without being asked for one.
    Share(f64),
}

/// A pair such as `640x480`, or a share such as `50%`.
pub(super) fn size(text: &str) -> Result<Size, String> {
    if let Some(share) = share(text).filter(|s| *s > 0.0) {
        return Ok(Size::Share(share));
    }
    let numbers = text.split_once('x').map(|(w, h)| (w.parse(), h.parse()));
    match numbers {
        Some((Ok(w @ 1..=65536), Ok(h @ 1..=65536))) => Ok(Size::Pixels(UVec2::new(w, h))),
        _ => Err(
            "expected WIDTHxHEIGHT, such as 640x480, from 1 to 65536 each, or a share such as 50%"
                .into(),
        ),
    }
}

/// A share such as `25%`, `0.25` or `1/4`; a number without a point is none.
fn share(text: &str) -> Option<f64> {
    let text = text.trim();
    let number = |x: &str| x.trim().parse::<f64>().ok();
    let share = if let Some(percent) = text.strip_suffix('%') {
        number(percent)? / 100.0
    } else if let Some((a, b)) = text.split_once('/') {
        number(a)? / number(b)?
    } else {
        number(text).filter(|_| text.contains('.'))?
    };
    (share.is_finite() && share >= 0.0).then_some(share)
}

/// A strategy such as `2,3`, or `merges`.
pub(super) fn strategy(text: &str) -> Result<Strategy, String> {
    if text == "merges" {
        return Ok(Strategy::Merges);
    }
    let numbers = text.split_once(',').map(|(s, t)| (s.parse(), t.parse()));
    match numbers {
        Some((Ok(s), Ok(t @ 1..=65538))) if s <= 65537 && s + t > 1 => {
            Ok(Strategy::Connection { s, t })
        }
        _ => {
            Err("expected S,T with S from 0 and T from 1, two vertices or more, or `merges`".into())
        }
    }
}

/// Refuses to show a strategy of what has none.
fn check_strategy(strategy: Strategy, spec: &MethodSpec) -> Result<(), &'static str> {
    let merges = strategy == Strategy::Merges;
    match spec.integrator {
        IntegratorKind::Vcm => {}
        IntegratorKind::Bdpt if !merges => {}
        _ if merges => return Err("only --integrator vcm has merges"),
        _ => return Err("only --integrator bdpt and vcm have strategies"),
    }
    let plain = spec.method == Kind::Default && spec.table.is_none() && spec.gamma.is_none();
    if plain {
        Ok(())
    } else {
        Err("a strategy is shown without --mode, --opsr-table and --gamma")
    }
}

/// A length along one side of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Length {
    Pixels(u32),
    Share(f64),
}

impl Length {
    fn of(self, side: u32) -> f64 {
        match self {
            Self::Pixels(n) => f64::from(n),
            Self::Share(share) => share * f64::from(side),
        }
    }
}

/// A part of a picture: column, row, width, height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Crop([Length; 4]);

/// A part such as `10,20,32,32` or `25%,25%,1/2,1/2`.
pub(super) fn crop(text: &str) -> Result<Crop, String> {
    let length = |text: &str| {
        let pixels = text.trim().parse().ok().map(Length::Pixels);
        pixels.or_else(|| share(text).map(Length::Share))
    };
    let lengths: Option<Vec<Length>> = text.split(',').map(length).collect();
    match lengths.as_deref() {
        Some(&[x, y, w, h]) => Ok(Crop([x, y, w, h])),
        _ => Err(
            "expected X,Y,WIDTH,HEIGHT from the top left, in pixels or as shares such as 25%"
                .into(),
        ),
    }
}

impl Crop {
    /// The part of a picture of this size. Edges are rounded, so that shares that meet make parts that meet.
    pub(super) fn of(&self, size: UVec2) -> Window {
        let [x, y, w, h] = self.0;
        let edges = |at: Length, length: Length, side: u32| {
            let start = at.of(side);
            let end = (start + length.of(side)).round();
            let start = start.round();
            (start as u32, (end - start) as u32)
        };
        let ((x, w), (y, h)) = (edges(x, w, size.x), edges(y, h, size.y));
        Window { x, y, w, h }
    }
}

/// A pixel of the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pixel(pub(super) UVec2);

/// A pixel such as `10,20`.
pub(super) fn pixel(text: &str) -> Result<Pixel, String> {
    let numbers = text
        .split_once(',')
        .map(|(x, y)| (x.trim().parse(), y.trim().parse()));
    match numbers {
        Some((Ok(x), Ok(y))) => Ok(Pixel(UVec2::new(x, y))),
        _ => Err("expected X,Y in pixels from the top left".into()),
    }
}

/// The part of a picture of this size that is rendered.
pub(super) fn window(args: &RenderArgs, size: UVec2) -> Window {
    args.crop.map_or(Window::full(size), |crop| crop.of(size))
}

/// Scales of levels; empty for one level.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Levels(Vec<f32>);

/// A number of levels such as `6`, or their scales such as `0,0.25,1`.
pub(super) fn level_scales(text: &str) -> Result<Levels, String> {
    if let Ok(number) = text.parse::<usize>() {
        let scales = scales(number).map(Levels);
        return scales.ok_or_else(|| format!("expected 1 to {MAX_LEVELS} levels"));
    }
    let scales: Result<Vec<f32>, _> = text.split(',').map(|x| x.trim().parse()).collect();
    let scales = scales.map_err(|_| "expected a number of levels, or scales such as 0,0.25,1")?;
    Ok(Levels(scales))
}

/// Scales of the levels of a render. Those that were asked for and that the settings cannot have are refused; where nothing
/// was asked for, there are the usual ones.
pub(super) fn levels(
    args: &RenderArgs,
    settings: &Settings,
    has_lobes: bool,
) -> anyhow::Result<Vec<f32>> {
    if let Some(Levels(levels)) = args.levels.clone() {
        let settings = Settings {
            levels,
            ..settings.clone()
        };
        settings.check_levels().context("--levels").usage()?;
        return Ok(settings.levels);
    }
    let single = args.trace_pixel.is_some() || super::aovs::splits_light(args);
    if single {
        return Ok(Vec::new());
    }
    Ok(settings.usual_levels(has_lobes).unwrap_or_else(|why| {
        tracing::info!("one level: {why}");
        Vec::new()
    }))
}

/// Resolves the options that choose a method.
pub(super) fn method(args: &RenderArgs) -> anyhow::Result<Method> {
    let spec = args.method.clone();
    let factors = spec.table.is_some() || spec.gamma.is_some();
    let consistent = spec.lambda.is_some();
    spec.refused().map_err(anyhow::Error::msg).usage()?;
    if let Some(strategy) = args.strategy {
        let checked = check_strategy(strategy, &spec).map_err(anyhow::Error::msg);
        checked.context("--strategy").usage()?;
    }
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
    spec.resolve().input()
}

/// Options that choose the picture, by name; the integrator may be a pilot's choice.
pub(super) fn words(args: &RenderArgs, integrator: IntegratorKind) -> Vec<(&'static str, String)> {
    let vertices = ("max_vertices", args.max_vertices.to_string());
    let strategy = (args.strategy).map(|strategy| ("strategy", strategy.to_string()));
    let words = args.method.words(integrator);
    words.chain([vertices]).chain(strategy).collect()
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
        strategy: args.strategy,
        sampler: args.method.sampler,
        max_vertices: args.max_vertices,
        seed: args.seed,
        ..Settings::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crop_shares_tile_the_frame() {
        let frame = UVec2::new(101, 67);
        let of = |text: &str| crop(text).unwrap().of(frame);
        assert_eq!(of("0,0,100%,1.0"), Window::full(frame));
        let thirds = ["0%", "1/3", "2/3"].map(|x| of(&format!("{x},0,1/3,67")));
        assert_eq!(thirds.iter().map(|w| w.w).sum::<u32>(), 101);
        assert!(thirds.windows(2).all(|w| w[0].x + w[0].w == w[1].x));
        assert_eq!(
            of("10,20,32,32"),
            Window {
                x: 10,
                y: 20,
                w: 32,
                h: 32
            }
        );
        for bad in ["1,2,3", "a,0,1,1", "-1%,0,1,1", "1/0,0,1,1", "0,0,inf%,1"] {
            assert!(crop(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn size_in_pixels_or_as_a_share() {
        assert_eq!(size("640x480"), Ok(Size::Pixels(UVec2::new(640, 480))));
        for half in ["50%", "1/2", "0.5"] {
            assert_eq!(size(half), Ok(Size::Share(0.5)));
        }
        for bad in ["0x5", "2", "0%", "640", "-50%", "x", "70000x1"] {
            assert!(size(bad).is_err(), "{bad}");
        }
    }
}
