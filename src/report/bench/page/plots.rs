//! Plots as SVG, drawn by kuva.

use kuva::backend::svg::SvgBackend;
use kuva::plot::{ForestPlot, LinePlot, LineStyle};
use kuva::render::annotations::ReferenceLine;
use kuva::render::layout::Layout;
use kuva::render::plots::Plot;
use kuva::render::render::render_multiple;

use super::super::curve::Crossing;
use super::super::overall::Overall;
use super::super::results::Results;
use super::super::suite::Suite;
use super::super::summary::{self, MAIN, MethodSummary, SceneSummary, TimePoint};
use crate::stats::ratios;

/// Colours of the methods in turn: those of [OkabeIto08] that show on white paper, then darker and lighter ones.
const COLOURS: [&str; 12] = [
    "#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8a7f00",
    "#6a3d9a", "#8c564b", "#808080", "#b2182b",
];

/// Dashes, one kind for each round of colours.
const DASHES: [LineStyle; 3] = [LineStyle::Solid, LineStyle::Dashed, LineStyle::Dotted];

/// Opacity of a band: a dozen of them lie over one another.
const BAND: f64 = 0.08;

const WIDTH: f64 = 570.0;
const HEIGHT: f64 = 370.0;

/// A floor this far below all errors is not drawn: the curves would be squeezed to make room.
const FLOOR_ROOM: f64 = 30.0;

/// The colour of a method, the same throughout a report.
pub fn colour(suite: &Suite, method: &str) -> &'static str {
    COLOURS[place(suite, method) % COLOURS.len()]
}

fn dash(suite: &Suite, method: &str) -> LineStyle {
    DASHES[place(suite, method) / COLOURS.len() % DASHES.len()].clone()
}

fn place(suite: &Suite, method: &str) -> usize {
    suite
        .methods
        .iter()
        .position(|m| m.name == method)
        .unwrap_or(0)
}

/// Errors of a method at one moment: of the fastest, on average, of the slowest seed.
struct Spread {
    at: f64,
    low: f64,
    mean: f64,
    high: f64,
}

/// The error curves of a scene with their captions: over time and over samples, where there are two moments of each.
pub fn curves(results: &Results, scene: &SceneSummary) -> Vec<(String, String)> {
    let Suite { times, samples, .. } = &results.suite;
    let times: Vec<TimePoint> = times.iter().map(|&t| TimePoint::Seconds(t)).collect();
    let samples: Vec<TimePoint> = samples.iter().map(|&n| TimePoint::Samples(n)).collect();
    let over_time = format!(
        "{MAIN} over time: geometric mean and range over seeds. Dashed across: bias floors. Dotted down: where \
         {} overtakes.",
        scene.baseline
    );
    let over_samples = format!("{MAIN} over samples: geometric mean and range over seeds.");
    [
        (times, "seconds", over_time),
        (samples, "samples per pixel", over_samples),
    ]
    .into_iter()
    .filter_map(|(moments, axis, caption)| Some((curve(results, scene, &moments, axis)?, caption)))
    .collect()
}

fn curve(
    results: &Results,
    scene: &SceneSummary,
    moments: &[TimePoint],
    axis: &str,
) -> Option<String> {
    let suite = &results.suite;
    let methods: Vec<(&MethodSummary, Vec<Spread>)> = scene
        .methods
        .iter()
        .map(|m| (m, spreads(results, &scene.name, &m.name, moments)))
        .filter(|(_, s)| s.len() > 1)
        .collect();
    let all = || methods.iter().flat_map(|(_, spreads)| spreads);
    let lowest = all().map(|s| s.low).reduce(f64::min)?;
    let highest = all().map(|s| s.high).reduce(f64::max)?;
    let (first, last) = (moments.first()?, moments.last()?);
    let mut bottom = lowest;
    let mut lines = Vec::new();
    for (method, _) in &methods {
        let colour = colour(suite, &method.name);
        if let Some(floor) = method.floor().filter(|f| *f > lowest / FLOOR_ROOM) {
            bottom = bottom.min(floor);
            lines.push(ReferenceLine::horizontal(floor).with_color(colour));
        }
        if let (TimePoint::Seconds(_), Some(Crossing::Measured(t))) = (first, method.crossing) {
            let line = ReferenceLine::vertical(t).with_dasharray("1 4");
            lines.push(line.with_color(colour).with_stroke_width(1.5));
        }
    }
    let plots: Vec<Plot> = methods
        .iter()
        .map(|(m, spreads)| Plot::Line(line(suite, &m.name, spreads)))
        .collect();
    let mut layout = Layout::auto_from_plots(&plots)
        .with_log_scale()
        .with_x_axis_min(position(*first))
        .with_x_axis_max(position(*last))
        .with_y_axis_min(bottom / 1.15)
        .with_y_axis_max(highest * 1.15)
        .with_x_label(axis)
        .with_y_label(MAIN);
    for line in lines {
        layout = layout.with_reference_line(line);
    }
    let scenes = &suite.scenes;
    let index = scenes.iter().position(|s| s.name == scene.name)?;
    let id = format!("{index}-{}", axis.split(' ').next()?);
    Some(svg(plots, layout, HEIGHT, &id))
}

fn line(suite: &Suite, name: &str, spreads: &[Spread]) -> LinePlot {
    let mut line = LinePlot::new()
        .with_data(spreads.iter().map(|s| (s.at, s.mean)))
        .with_color(colour(suite, name))
        .with_line_style(dash(suite, name))
        // The band takes the colour that the line has by now.
        .with_band(
            spreads.iter().map(|s| s.low),
            spreads.iter().map(|s| s.high),
        )
        .with_legend(name);
    if let Some(band) = &mut line.band {
        band.opacity = BAND;
    }
    line
}

fn position(moment: TimePoint) -> f64 {
    match moment {
        TimePoint::Seconds(t) => t,
        TimePoint::Samples(n) => f64::from(n),
    }
}

/// The moments that all seeds reached; errors of zero have no place on a logarithmic axis.
fn spreads(results: &Results, scene: &str, method: &str, moments: &[TimePoint]) -> Vec<Spread> {
    let runs = results.runs(scene, method);
    let spread = |&moment: &TimePoint| {
        let errors: Option<Vec<f64>> = runs
            .iter()
            .map(|c| summary::error(results, c, MAIN, moment).filter(|e| *e > 0.0 && e.is_finite()))
            .collect();
        let errors = errors?;
        Some(Spread {
            at: position(moment),
            low: errors.iter().copied().reduce(f64::min)?,
            mean: ratios::geometric_mean(&errors)?,
            high: errors.iter().copied().reduce(f64::max)?,
        })
    };
    moments.iter().filter_map(spread).collect()
}

/// Ratios over all scenes with their intervals, one row per method; `None` where there are none.
pub fn standings(overall: &Overall) -> Option<String> {
    let rows: Vec<_> = overall
        .standings
        .iter()
        .filter_map(|s| Some((s.name.as_str(), s.ratios.first()?.as_ref()?.0)))
        .filter(|(_, r)| r.low.is_finite() && r.high.is_finite())
        .collect();
    let lowest = rows.iter().map(|(_, r)| r.low).reduce(f64::min)?.min(0.9);
    let highest = rows.iter().map(|(_, r)| r.high).reduce(f64::max)?.max(1.1);
    let mut forest = ForestPlot::new().with_null_value(1.0).with_color("#0072b2");
    for (name, r) in &rows {
        forest = forest.with_row(*name, r.value, r.low, r.high);
    }
    let plots = vec![Plot::Forest(forest)];
    let label = format!("ratio of {MAIN} to {}", overall.opponent);
    let layout = Layout::auto_from_plots(&plots)
        .with_log_x()
        .with_x_axis_min(lowest / 1.1)
        .with_x_axis_max(highest * 1.1)
        .with_x_label(label);
    let height = 90.0 + 24.0 * rows.len() as f64;
    Some(svg(plots, layout, height, "overall"))
}

/// A plot; `id` is not the same for two plots of a page.
fn svg(plots: Vec<Plot>, layout: Layout, height: f64, id: &str) -> String {
    let layout = layout
        .with_width(WIDTH)
        .with_height(height)
        .with_font_family("system-ui, sans-serif")
        .with_label_size(13)
        .with_tick_size(11)
        .with_body_size(11);
    let scene = render_multiple(plots, layout);
    let size = (scene.width, scene.height);
    let svg = SvgBackend::new().render_scene(&scene);
    // So that a narrow window scales it instead of cutting it off.
    let view = format!("<svg role=\"img\" viewBox=\"0 0 {} {}\" ", size.0, size.1);
    let svg = svg.replacen("<svg ", &view, 1);
    renamed(&svg, &format!("clip-{id}-"))
}

/// kuva numbers the clipping paths of all plots of a process; here they are numbered within the plot, so that the same
/// results give the same plot.
fn renamed(svg: &str, prefix: &str) -> String {
    const THEIRS: &str = "kuva-clip-";
    let mut seen: Vec<&str> = Vec::new();
    let mut pieces = svg.split(THEIRS);
    let mut text = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let digits = piece.bytes().take_while(u8::is_ascii_digit).count();
        let (number, rest) = piece.split_at(digits);
        let ours = seen.iter().position(|n| *n == number).unwrap_or_else(|| {
            seen.push(number);
            seen.len() - 1
        });
        text.push_str(&format!("{prefix}{ours}{rest}"));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clipping_paths_are_numbered_within_a_plot() {
        let theirs = "a kuva-clip-17\" b url(#kuva-clip-17) kuva-clip-4";
        assert_eq!(renamed(theirs, "c-"), "a c-0\" b url(#c-0) c-1");
        assert_eq!(renamed("none", "c-"), "none");
    }
}
