//! Error curves of the methods, and their ratios over all scenes.

use super::super::curve::Crossing;
use super::super::overall::Overall;
use super::super::results::Results;
use super::super::suite::Suite;
use super::super::summary::{self, MAIN, MethodSummary, SceneSummary, TimePoint};
use crate::report::plot::{self, Axis, Guide, INK, Line, Place, Row};
use crate::stats::ratios;

/// Colours of the methods: ink, those of [OkabeIto08] with a contrast of 3 to both white and dark paper, and more. The
/// latter keep the greatest distance from one another, also without red or green cones.
const COLOURS: [&str; 12] = [
    INK, "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#896900", "#2c97ff", "#7b6b91", "#a95bc5",
    "#b68d64", "#6668e5", "#21765b",
];

/// Dashes, one pattern for each round of colours.
const DASHES: [&str; 3] = ["", "6 4", "2 3"];

/// A floor further than this factor below all errors is not drawn, because it would compress the curves.
const FLOOR_ROOM: f64 = 30.0;

/// The colour of a method, the same throughout a report.
pub fn colour(suite: &Suite, method: &str) -> &'static str {
    COLOURS[place(suite, method) % COLOURS.len()]
}

fn dashes(suite: &Suite, method: &str) -> &'static str {
    DASHES[place(suite, method) / COLOURS.len() % DASHES.len()]
}

fn place(suite: &Suite, method: &str) -> usize {
    suite
        .methods
        .iter()
        .position(|m| m.name == method)
        .unwrap_or(0)
}

/// Errors of a method at one time point: lowest, mean and highest over seeds.
struct Spread {
    at: f64,
    low: f64,
    mean: f64,
    high: f64,
}

/// The error curves of a scene with captions, over time and over samples, each with at least two time points.
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
    let mut guides = Vec::new();
    for (method, _) in &methods {
        let colour = colour(suite, &method.name);
        if let Some(floor) = method.floor().filter(|f| *f > lowest / FLOOR_ROOM) {
            bottom = bottom.min(floor);
            guides.push(Guide {
                place: Place::Y(floor),
                colour,
                dashes: "5 3",
            });
        }
        if let (TimePoint::Seconds(_), Some(Crossing::Measured(t))) = (first, method.crossing) {
            guides.push(Guide {
                place: Place::X(t),
                colour,
                dashes: "1 4",
            });
        }
    }
    let lines: Vec<Line> = (methods.iter())
        .map(|(m, spreads)| line(suite, &m.name, spreads))
        .collect();
    let x = Axis {
        label: axis,
        low: position(*first),
        high: position(*last),
        log: true,
    };
    let y = Axis {
        label: MAIN,
        low: bottom / 1.15,
        high: highest * 1.15,
        log: true,
    };
    Some(plot::lines(&x, &y, &lines, &guides))
}

fn line<'a>(suite: &Suite, name: &'a str, spreads: &[Spread]) -> Line<'a> {
    Line {
        name,
        colour: colour(suite, name),
        dashes: dashes(suite, name),
        points: spreads.iter().map(|s| (s.at, s.mean)).collect(),
        band: spreads.iter().map(|s| (s.at, s.low, s.high)).collect(),
    }
}

fn position(moment: TimePoint) -> f64 {
    match moment {
        TimePoint::Seconds(t) => t,
        TimePoint::Samples(n) => f64::from(n),
    }
}

/// Errors at the time points that all seeds reached. Zero has no place on a logarithmic axis and is left out.
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

/// A plot of ratios over all scenes with their intervals, one row per method; `None` without any ratio.
pub fn standings(overall: &Overall) -> Option<String> {
    let rows: Vec<_> = overall
        .standings
        .iter()
        .filter_map(|s| Some((s.name.as_str(), s.ratios.first()?.as_ref()?.0)))
        .filter(|(_, r)| r.low.is_finite() && r.high.is_finite())
        .collect();
    let lowest = rows.iter().map(|(_, r)| r.low).reduce(f64::min)?.min(0.9);
    let highest = rows.iter().map(|(_, r)| r.high).reduce(f64::max)?.max(1.1);
    let label = format!("ratio of {MAIN} to {}", overall.opponent);
    let x = Axis {
        label: &label,
        low: lowest / 1.1,
        high: highest * 1.1,
        log: true,
    };
    let rows: Vec<Row> = (rows.iter())
        .map(|&(name, r)| Row {
            name,
            value: r.value,
            low: r.low,
            high: r.high,
        })
        .collect();
    Some(plot::intervals(&x, 1.0, &rows, "#0072b2"))
}
