//! Tables of a report.

use maud::{Markup, html};

use super::super::curve::Crossing;
use super::super::overall::{METRICS as OVER_SCENES, Overall};
use super::super::results::Results;
use super::super::summary::{MAIN, MethodSummary, SceneSummary};
use super::plots;
use crate::report::compare::definition;
use crate::report::html::{or_dash, table};
use crate::stats::ratios::{Interval, Verdict};
use opsr::image::Buffer;
use opsr::math::Rgb;
use opsr_metric::{self as metric, flip};

/// A number with three significant digits.
pub(super) fn short(x: f64) -> String {
    if !x.is_finite() {
        return x.to_string();
    }
    if x != 0.0 && x.abs() < 1e-3 {
        return format!("{x:.2e}");
    }
    let digits = (2 - x.abs().max(1e-2).log10().floor() as i32).clamp(0, 5) as usize;
    format!("{x:.digits$}")
}

fn interval(i: &Interval) -> Markup {
    html! { (short(i.value)) " " span.interval { "[" (short(i.low)) ", " (short(i.high)) "]" } }
}

/// A cell with a ratio and its verdict.
fn ratio(ratio: Option<(Interval, Verdict)>) -> Markup {
    let class = |verdict| match verdict {
        Verdict::Better => "better",
        Verdict::Worse => "worse",
        Verdict::Tie | Verdict::TooFewSeeds => "open",
    };
    html! {
        @match ratio {
            Some((r, verdict)) => td class=(class(verdict)) { (interval(&r)) " " (verdict.word()) },
            None => td { "–" },
        }
    }
}

/// First cell of a method's row: its colour and name.
fn name(results: &Results, method: &str) -> Markup {
    let colour = format!("background:{}", plots::colour(&results.suite, method));
    html! { th { span.swatch style=(colour) {} (method) } }
}

/// The comparisons of methods over many scenes.
pub(super) fn overall(results: &Results, overall: &Overall) -> Markup {
    let scenes = match overall.scenes {
        1 => "1 scene".to_owned(),
        n => format!("{n} scenes"),
    };
    let group = (overall.group.as_ref()).map_or(String::new(), |g| format!("{g}, "));
    let caption = format!("Against {}: {group}{scenes}", overall.opponent);
    let heads = ["method"].into_iter().chain(OVER_SCENES);
    let rows = overall.standings.iter().map(|s| {
        html! {
            (name(results, &s.name))
            @for r in &s.ratios { (ratio(*r)) }
            td {
                (s.tally[0]) " / " (s.tally[1]) " / " (s.tally[2])
                @if s.scenes < overall.scenes { " (on " (s.scenes) " scenes)" }
            }
        }
    });
    table(&caption, heads.chain(["scenes better / tie / worse"]), rows)
}

/// The errors that are worse than the baseline's.
pub(super) fn losses(scenes: &[SceneSummary]) -> Markup {
    let mut losses = Vec::new();
    for scene in scenes {
        for m in &scene.methods {
            for (metric, compared) in &m.metrics {
                if let Some((r, Verdict::Worse)) = compared.and_then(|c| c.ratio) {
                    losses.push(html! {
                        th { (scene.name) } td { (m.name) } td { (metric) } td { (interval(&r)) }
                    });
                }
            }
        }
    }
    html! {
        h2 { "Where methods lose to the baseline" }
        @if losses.is_empty() { p { "Nowhere." } } @else {
            details {
                summary { "Ratios above 1 at the last time point: " (losses.len()) }
                (table("", ["scene", "method", "error", "ratio"], losses))
            }
        }
    }
}

/// Errors of a scene at the last time point.
pub(super) fn ratios(results: &Results, scene: &SceneSummary) -> Markup {
    let caption = format!("Errors at {}, against {}", scene.last, scene.baseline);
    let mut heads = vec!["method".to_owned(), MAIN.to_owned()];
    heads.extend(OVER_SCENES.map(|metric| format!("ratio of {metric}")));
    heads.extend(["bias floor", "cross-over"].map(str::to_owned));
    let rows = scene.methods.iter().map(|m| {
        html! {
            (name(results, &m.name))
            td { (or_dash(m.metrics.first().and_then(|(_, c)| *c), |c| short(c.value))) }
            @for (metric, compared) in &m.metrics {
                @if OVER_SCENES.contains(metric) { (ratio(compared.and_then(|c| c.ratio))) }
            }
            td { (or_dash(m.floor(), short)) }
            td { (or_dash(m.crossing, crossing)) }
        }
    });
    table(&caption, heads, rows)
}

fn crossing(crossing: Crossing) -> String {
    match crossing {
        Crossing::Never => "at once".to_owned(),
        Crossing::Measured(t) => format!("{} s", short(t)),
        Crossing::Extrapolated(t) => format!("≈ {} s", short(t)),
        Crossing::NotInSight => "not in sight".to_owned(),
        Crossing::Undecided => "a tie".to_owned(),
    }
}

/// Ratios of the main error at every time point, and of the other errors at the last.
pub(super) fn time_points(results: &Results, scene: &SceneSummary) -> Markup {
    let others = || scene.methods.iter().filter(|m| m.name != scene.baseline);
    let Some(first) = others().next() else {
        return html! {};
    };
    let rest = |m: &MethodSummary| {
        let rest = m.metrics.iter().filter(|(n, _)| !OVER_SCENES.contains(n));
        rest.copied().collect::<Vec<_>>()
    };
    let mut heads = vec!["method".to_owned()];
    heads.extend(first.main.iter().map(|(at, _)| format!("{MAIN} at {at}")));
    heads.extend(
        rest(first)
            .iter()
            .map(|(n, _)| format!("{n} at {}", scene.last)),
    );
    let rows = others().map(|m| {
        html! {
            (name(results, &m.name))
            @for (_, compared) in &m.main { (ratio(compared.and_then(|c| c.ratio))) }
            @for (_, compared) in rest(m) { (ratio(compared.and_then(|c| c.ratio))) }
        }
    });
    html! {
        details {
            summary { "Ratio of " (MAIN) " at every time point, other errors" }
            (table("", heads, rows))
        }
    }
}

/// Time and memory of each method.
pub(super) fn costs(results: &Results, scene: &SceneSummary) -> Markup {
    let heads = [
        "method",
        "paths per second",
        "CPU ns per path",
        "ratio",
        "regularised",
        "memory of the process",
    ];
    let rows = scene.methods.iter().map(|m| {
        html! {
            (name(results, &m.name))
            td { (or_dash(m.paths_per_second, |x| format!("{x:.0}"))) }
            td { (or_dash(m.ns_per_path, |c| format!("{:.0}", c.value))) }
            (ratio(m.ns_per_path.and_then(|c| c.ratio)))
            td { (or_dash(m.regularised, |x| format!("{:.1} %", 100.0 * x))) }
            td { (or_dash(m.memory, |mib| format!("{mib:.0} MiB"))) }
        }
    });
    table("Cost", heads, rows)
}

/// Seeds, energy, bias and rejected samples of each method.
pub(super) fn stability(results: &Results, scene: &SceneSummary) -> Markup {
    let heads = [
        "method",
        "seeds",
        "energy: picture over reference",
        "squared bias",
        "samples refused",
    ];
    let or_interval = |i: &Option<Interval>| match i {
        Some(i) => interval(i),
        None => html! { "–" },
    };
    let rows = scene.methods.iter().map(|m| {
        html! {
            (name(results, &m.name))
            td { (m.seeds) }
            td.off[m.energy_is_off()] {
                (or_interval(&m.energy))
                @if m.energy_is_off() { " off" }
            }
            td { (or_interval(&m.squared_bias)) }
            td.off[m.rejected > 0] { (m.rejected) }
        }
    });
    table("Stability", heads, rows)
}

/// The formulas of the errors.
pub(super) fn definitions() -> Vec<String> {
    let one = Buffer::filled(1, 1, Rgb::ONE);
    let metrics = metric::pixel::all(&one, &one).unwrap_or_default();
    let formulas = metrics.iter().filter(|m| m.name != "RMSE").map(definition);
    let flip = format!(
        "FLIP: LDR-FLIP at the scene's exposure; pixels per degree = {:.2}",
        flip::DEFAULT_PPD
    );
    formulas.chain([flip]).collect()
}
