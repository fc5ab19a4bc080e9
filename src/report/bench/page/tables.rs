//! The numbers of a report.

use maud::{Markup, html};

use super::super::curve::Crossing;
use super::super::overall::{METRICS as OVER_SCENES, Overall};
use super::super::results::Results;
use super::super::summary::{Compared, MAIN, MethodSummary, SceneSummary};
use super::plots;
use crate::image::metric::{self, Metric};
use crate::image::{Buffer, metric::flip};
use crate::math::Rgb;
use crate::report::compare::definition;
use crate::stats::ratios::{Interval, Verdict};

fn class(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Better => "better",
        Verdict::Worse => "worse",
        Verdict::Tie | Verdict::TooFewSeeds => "open",
    }
}

/// Three digits.
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

fn short_or_dash(x: Option<f64>) -> String {
    x.map_or_else(|| "–".to_owned(), short)
}

fn interval(i: &Interval) -> Markup {
    html! { (short(i.value)) " " span.interval { "[" (short(i.low)) ", " (short(i.high)) "]" } }
}

fn ratio(ratio: Option<(Interval, Verdict)>) -> Markup {
    html! {
        @match ratio {
            Some((r, verdict)) => td class=(class(verdict)) { (interval(&r)) " " (verdict.word()) },
            None => td { "–" },
        }
    }
}

fn name(results: &Results, method: &str) -> Markup {
    let colour = format!("background:{}", plots::colour(&results.suite, method));
    html! { th { span.swatch style=(colour) {} (method) } }
}

/// Methods over many scenes.
pub(super) fn overall(results: &Results, overall: &Overall) -> Markup {
    let many = if overall.scenes == 1 {
        "1 scene".to_owned()
    } else {
        format!("{} scenes", overall.scenes)
    };
    let scenes = match &overall.group {
        Some(group) => format!("{group}, {many}"),
        None => many,
    };
    html! {
        .scroll { table {
            caption { "Against " (overall.opponent) ": " (scenes) }
            thead { tr {
                th { "method" }
                @for metric in OVER_SCENES { th { (metric) } }
                th { "scenes better / tie / worse" }
            } }
            tbody { @for s in &overall.standings { tr {
                (name(results, &s.name))
                @for r in &s.ratios { (ratio(*r)) }
                td {
                    (s.tally[0]) " / " (s.tally[1]) " / " (s.tally[2])
                    @if s.scenes < overall.scenes { " (on " (s.scenes) " scenes)" }
                }
            } } }
        } }
    }
}

/// Where a method is worse than the baseline, or too bright or too dark: what must not be overlooked.
pub(super) fn losses(scenes: &[SceneSummary]) -> Markup {
    let mut losses = Vec::new();
    for scene in scenes {
        for m in &scene.methods {
            for (metric, compared) in &m.metrics {
                if let Some((r, Verdict::Worse)) = compared.and_then(|c| c.ratio) {
                    losses.push((&scene.name, &m.name, *metric, r));
                }
            }
        }
    }
    html! {
        h2 { "Where methods lose to the baseline" }
        @if losses.is_empty() { p { "Nowhere." } } @else {
            details {
                summary { (losses.len()) " of the ratios at the last moment are worse than 1" }
                table {
                    thead { tr { th { "scene" } th { "method" } th { "error" } th { "ratio" } } }
                    tbody { @for (scene, method, metric, r) in losses {
                        tr { th { (scene) } td { (method) } td { (metric) } td { (interval(&r)) } }
                    } }
                }
            }
        }
    }
}

/// Errors of a scene at the last moment.
pub(super) fn ratios(results: &Results, scene: &SceneSummary) -> Markup {
    html! {
        .scroll { table {
            caption { "Errors at " (scene.last) ", against " (scene.baseline) }
            thead { tr {
                th { "method" }
                th { (MAIN) }
                @for metric in OVER_SCENES { th { "ratio of " (metric) } }
                th { "bias floor" }
                th { "cross-over" }
            } }
            tbody { @for m in &scene.methods { tr {
                (name(results, &m.name))
                td { (short_or_dash(m.metrics.first().and_then(|(_, c)| *c).map(|c| c.value))) }
                @for (metric, compared) in &m.metrics {
                    @if OVER_SCENES.contains(metric) { (ratio(compared.and_then(|c| c.ratio))) }
                }
                td { (short_or_dash(m.floor())) }
                td { (crossing(m.crossing)) }
            } } }
        } }
    }
}

fn crossing(crossing: Option<Crossing>) -> String {
    match crossing {
        None => "–".to_owned(),
        Some(Crossing::Never) => "at once".to_owned(),
        Some(Crossing::Measured(t)) => format!("{} s", short(t)),
        Some(Crossing::Extrapolated(t)) => format!("≈ {} s", short(t)),
        Some(Crossing::NotInSight) => "not in sight".to_owned(),
        Some(Crossing::Undecided) => "a tie".to_owned(),
    }
}

/// The main error's ratio at every moment, and the other errors' at the last.
pub(super) fn moments(results: &Results, scene: &SceneSummary) -> Markup {
    let others: Vec<&MethodSummary> = scene
        .methods
        .iter()
        .filter(|m| m.name != scene.baseline)
        .collect();
    let Some(first) = others.first() else {
        return html! {};
    };
    let rest = |m: &MethodSummary| -> Vec<(&'static str, Option<Compared>)> {
        let rest = m.metrics.iter().filter(|(n, _)| !OVER_SCENES.contains(n));
        rest.copied().collect()
    };
    html! {
        details {
            summary { "Ratio of " (MAIN) " at every moment, other errors" }
            .scroll { table {
                thead { tr {
                    th { "method" }
                    @for (moment, _) in &first.main { th { (MAIN) " at " (moment) } }
                    @for (metric, _) in rest(first) { th { (metric) " at " (scene.last) } }
                } }
                tbody { @for m in &others { tr {
                    (name(results, &m.name))
                    @for (_, compared) in &m.main { (ratio(compared.and_then(|c| c.ratio))) }
                    @for (_, compared) in rest(m) { (ratio(compared.and_then(|c| c.ratio))) }
                } } }
            } }
        }
    }
}

/// What a method costs.
pub(super) fn costs(results: &Results, scene: &SceneSummary) -> Markup {
    let whole = |x: Option<f64>| x.map_or_else(|| "–".to_owned(), |x| format!("{x:.0}"));
    let share = |x: f64| format!("{:.1} %", 100.0 * x);
    html! {
        .scroll { table {
            caption { "Cost" }
            thead { tr {
                th { "method" }
                th { "paths per second" }
                th { "CPU ns per path" }
                th { "ratio" }
                th { "regularised" }
                th { "memory of the process" }
            } }
            tbody { @for m in &scene.methods { tr {
                (name(results, &m.name))
                td { (whole(m.paths_per_second)) }
                td { (whole(m.ns_per_path.map(|c: Compared| c.value))) }
                (ratio(m.ns_per_path.and_then(|c| c.ratio)))
                td { (m.regularised.map_or_else(|| "–".to_owned(), share)) }
                td { @match m.memory { Some(mib) => (format!("{mib:.0} MiB")), None => "–" } }
            } } }
        } }
    }
}

/// Whether a method's picture can be trusted.
pub(super) fn stability(results: &Results, scene: &SceneSummary) -> Markup {
    html! {
        .scroll { table {
            caption { "Stability" }
            thead { tr {
                th { "method" }
                th { "seeds" }
                th { "energy: picture over reference" }
                th { "squared bias" }
                th { "samples refused" }
            } }
            tbody { @for m in &scene.methods { tr {
                (name(results, &m.name))
                td { (m.seeds) }
                td.off[m.energy_is_off()] {
                    @match &m.energy { Some(e) => (interval(e)), None => "–" }
                    @if m.energy_is_off() { " off" }
                }
                td {
                    @match &m.squared_bias {
                        Some(b) => (interval(b)),
                        None => "–",
                    }
                }
                td.off[m.rejected > 0] { (m.rejected) }
            } } }
        } }
    }
}

/// The formulas of the errors, as the metrics tell them.
pub(super) fn definitions() -> Vec<String> {
    let one = Buffer::filled(1, 1, Rgb::ONE);
    type Measure = fn(&Buffer, &Buffer) -> Result<Metric, metric::MetricError>;
    let metrics: [Measure; 6] = [
        metric::relmse,
        metric::relmse_trimmed,
        metric::mse,
        metric::mape,
        metric::smape,
        metric::energy_ratio,
    ];
    let formulas = metrics.iter().filter_map(|m| m(&one, &one).ok());
    let flip = format!(
        "FLIP: LDR-FLIP at the scene's exposure; pixels per degree = {:.2}",
        flip::DEFAULT_PPD
    );
    formulas.map(|m| definition(&m)).chain([flip]).collect()
}
