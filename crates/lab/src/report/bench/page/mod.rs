//! The report of a bench: one HTML file that loads nothing else and has no scripts.
//!
//! It depends on the results alone: equal results give equal bytes.

use maud::{Markup, html};

use super::overall::{self, Overall};
use super::results::Results;
use super::suite::Clock;
use super::summary::{self, MAIN, SceneSummary};
use crate::report::html::{self, plot};
use crate::stats::ratios::{CONFIDENCE, MIN_SEEDS};

mod pictures;
pub mod plots;
mod tables;

/// The page.
pub fn page(results: &Results) -> String {
    let scenes = summary::summaries(results);
    let body = html! {
        (introduction(results, scenes.len()))
        (overview(results, &overalls(results)))
        (tables::losses(&scenes))
        h2 { "Scenes" }
        nav { @for (i, s) in scenes.iter().enumerate() { a href={ "#scene-" (i) } { (s.name) } " " } }
        @for (i, s) in scenes.iter().enumerate() { (section(results, s, i)) }
        (reading())
        (repeat(results))
    };
    html::page("Speed against error", &body)
}

/// The whole suite, then its groups, against the baseline and against the best constant.
pub fn overalls(results: &Results) -> Vec<Overall> {
    let baseline = results.suite.baseline();
    let constant = overall::best_constant(results).filter(|c| *c != baseline);
    let groups = overall::groups(&results.suite);
    let named = groups.iter().filter(|_| groups.len() > 1).map(|g| Some(*g));
    let groups: Vec<Option<&str>> = std::iter::once(None).chain(named).collect();
    let opponents = std::iter::once(baseline).chain(constant);
    let all = opponents.flat_map(|o| groups.iter().map(move |g| overall::overall(results, *g, o)));
    all.collect()
}

fn introduction(results: &Results, scenes: usize) -> Markup {
    let Results { suite, machine, .. } = results;
    let clock = match suite.clock {
        Clock::Wall => "wall time",
        Clock::Cpu => "CPU time over the number of threads",
    };
    html! {
        p {
            (suite.methods.len()) " methods, " (scenes) " scenes, " (suite.seeds) " seeds, on " (machine.cpu) " with "
            (machine.threads) " of " (machine.cores) " threads (" (machine.system) "). Seconds are " (clock) "."
        }
        p {
            "A ratio is an error or a cost of a method over that of the method it is compared with, at the same time point "
            "and seed by seed; below 1 is better. Brackets hold its " (percent(CONFIDENCE)) " interval over seeds. A "
            "verdict is given only where the interval excludes 1 and at least " (MIN_SEEDS) " seeds were run; "
            "otherwise it is a tie."
        }
    }
}

fn overview(results: &Results, overalls: &[Overall]) -> Markup {
    let Some(at) = overall::last_time_point(&results.suite) else {
        return html! {};
    };
    html! {
        h2 { "All scenes" }
        p {
            "Geometric means over scenes of the ratio at " (at) ". The intervals tell about other seeds on these "
            "scenes, not about other scenes."
        }
        @if let Some(svg) = overalls.first().and_then(plots::standings) {
            (plot(&svg, &format!("{MAIN} against {}, all scenes", overalls[0].opponent)))
        }
        @for o in overalls { (tables::overall(results, o)) }
    }
}

fn section(results: &Results, scene: &SceneSummary, index: usize) -> Markup {
    let facts = results.scenes.iter().find(|f| f.name == scene.name);
    let spec = results.suite.scenes.iter().find(|s| s.name == scene.name);
    html! {
        section id={ "scene-" (index) } {
            h3 { (scene.name) }
            p {
                @if let Some(spec) = spec {
                    @let window = spec.window();
                    (window.w) "×" (window.h) " pixels of " (spec.size[0]) "×" (spec.size[1])
                    ", paths of at most " (spec.max_vertices) " vertices"
                    @if let Some(group) = &spec.group { ", " (group) }
                    ". "
                }
                @if let Some(facts) = facts {
                    (facts.triangles) " triangles. Reference: " (facts.reference)
                    @if facts.reference_noise > 0.0 {
                        ", its own " (MAIN) " about " (tables::short(facts.reference_noise)) ", which is in every error below"
                    }
                    "."
                }
            }
            @for (method, why) in results.refused(&scene.name) {
                p { strong { (method) } " is left out: " (why) "." }
            }
            .plots { @for (svg, caption) in plots::curves(results, scene) { (plot(&svg, &caption)) } }
            (tables::ratios(results, scene))
            (tables::time_points(results, scene))
            (tables::costs(results, scene))
            (tables::stability(results, scene))
            (pictures::pictures(results, scene, index))
        }
    }
}

fn reading() -> Markup {
    html! {
        h2 { "How to read this" }
        dl {
            dt { "Errors" }
            dd {
                ul { @for definition in tables::definitions() { li { (definition) } } }
                "I is the picture, f the reference; means are over pixels and channels. " (MAIN) " of few samples hangs on "
                "single bright pixels: the trimmed one and MAPE do not."
            }
            dt { "Bias floor" }
            dd {
                "The part of " (MAIN) " that no number of samples removes, estimated without bias from the products of "
                "different seeds' errors; given where its interval excludes 0."
            }
            dt { "Cross-over" }
            dd {
                "The time from which on the baseline has the smaller " (MAIN) ": measured where the curves cross, "
                "otherwise (≈) extrapolated from a baseline that falls as 1/t and a method that stays at its floor."
            }
            dt { "Energy" }
            dd { "Mean of the picture over mean of the reference at the end of the runs, with its interval over seeds." }
            dt { "Regularised" }
            dd { "Share of the vertices at which light is gathered with a roughened lobe." }
            dt { "Pictures" }
            dd {
                "The first seed at the end of its run, FLIP against the reference beneath. A picture shows the reference "
                "while the pointer is on it."
            }
        }
    }
}

fn repeat(results: &Results) -> Markup {
    let suite = toml::to_string(&results.suite).unwrap_or_default();
    html! {
        h2 { "To repeat it" }
        p { "opsr " (results.program) ":" }
        pre { (results.command) }
        details { summary { "The suite" } pre { (suite) } }
    }
}

fn percent(x: f64) -> String {
    format!("{:.0} %", 100.0 * x)
}
