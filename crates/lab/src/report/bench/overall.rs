//! Methods over many scenes: the geometric mean of their ratios to an opponent, seed by seed.
//!
//! The interval covers the choice of seeds on *these* scenes; it does not cover the choice of scenes.

use super::results::Results;
use super::suite::{SceneSpec, Suite};
use super::summary::{self, MAIN, TimePoint};
use crate::stats::ratios::{self, Interval, Verdict};
use opsr::integrator::method::Mode;
use opsr::render::value::TableChoice;

/// The errors that are compared over many scenes.
pub const METRICS: [&str; 4] = [MAIN, "relMSE trimmed", "MAPE", "FLIP"];

/// All methods against one of them, over some scenes.
#[derive(Clone, Debug)]
pub struct Overall {
    /// The group of scenes; `None` for all scenes.
    pub group: Option<String>,
    /// The method that the others are compared with.
    pub opponent: String,
    /// Number of scenes.
    pub scenes: usize,
    /// The other methods in the suite's order.
    pub standings: Vec<Standing>,
}

/// A method against the opponent.
#[derive(Clone, Debug)]
pub struct Standing {
    /// The method.
    pub name: String,
    /// Number of scenes on which both have results.
    pub scenes: usize,
    /// Ratios of [`METRICS`], in that order.
    pub ratios: Vec<Option<(Interval, Verdict)>>,
    /// Number of scenes on which [`MAIN`] is better, no different, worse.
    pub tally: [usize; 3],
}

/// Time point of a suite's comparisons: the last time, or the last sample count of a suite without times.
pub fn last_time_point(suite: &Suite) -> Option<TimePoint> {
    let time = suite.times.last().map(|&t| TimePoint::Seconds(t));
    time.or(suite.samples.last().map(|&n| TimePoint::Samples(n)))
}

/// The groups of the suite's scenes, in order of appearance.
pub fn groups(suite: &Suite) -> Vec<&str> {
    let mut groups: Vec<&str> = Vec::new();
    for group in suite.scenes.iter().filter_map(|s| s.group.as_deref()) {
        if !groups.contains(&group) {
            groups.push(group);
        }
    }
    groups
}

/// All methods against `opponent` on the scenes of a group; on all scenes for `None`.
pub fn overall(results: &Results, group: Option<&str>, opponent: &str) -> Overall {
    let scenes: Vec<&SceneSpec> = results
        .suite
        .scenes
        .iter()
        .filter(|s| group.is_none() || s.group.as_deref() == group)
        .collect();
    let others = results.suite.methods.iter().filter(|m| m.name != opponent);
    Overall {
        group: group.map(str::to_owned),
        opponent: opponent.to_owned(),
        scenes: scenes.len(),
        standings: others
            .map(|m| standing(results, &scenes, &m.name, opponent))
            .collect(),
    }
}

/// The constant factor with the least error on the measured scenes, chosen with hindsight: the aim of a learned table.
pub fn best_constant(results: &Results) -> Option<&str> {
    let level = |name: &str| -> Option<f64> {
        let at = last_time_point(&results.suite)?;
        let mut errors = Vec::new();
        for scene in &results.suite.scenes {
            for run in results.runs(&scene.name, name) {
                errors.push(summary::error(results, run, MAIN, at)?);
            }
        }
        ratios::geometric_mean(&errors)
    };
    let constants = results.suite.methods.iter().filter(|m| {
        let spec = &m.spec;
        let plain = spec.mode.unwrap_or_default() == Mode::Default && spec.consistent.is_none();
        matches!(spec.table, Some(TableChoice::Factor(g)) if g > 0.0) && plain
    });
    constants
        .filter_map(|m| Some((m.name.as_str(), level(&m.name)?)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(name, _)| name)
}

fn standing(results: &Results, scenes: &[&SceneSpec], name: &str, opponent: &str) -> Standing {
    let pairs = |metric: &str| -> Vec<ScenePairs> {
        scenes
            .iter()
            .filter_map(|s| pairs(results, s, name, opponent, metric))
            .collect()
    };
    let main = pairs(MAIN);
    let mut tally = [0; 3];
    for (ours, theirs) in &main {
        let present =
            |errors: &[Option<f64>]| errors.iter().flatten().copied().collect::<Vec<f64>>();
        let (ours, theirs) = (present(ours), present(theirs));
        let Some(ratio) = ratios::paired_ratio(&ours, &theirs) else {
            continue;
        };
        match Verdict::of(&ratio, ours.len()) {
            Verdict::Better => tally[0] += 1,
            Verdict::Tie => tally[1] += 1,
            Verdict::Worse => tally[2] += 1,
            Verdict::TooFewSeeds => {}
        }
    }
    Standing {
        name: name.to_owned(),
        scenes: main.len(),
        ratios: METRICS.iter().map(|m| mean_ratio(&pairs(m))).collect(),
        tally,
    }
}

/// Errors of both methods on a scene by seed; `None` for a seed without result.
type ScenePairs = (Vec<Option<f64>>, Vec<Option<f64>>);

fn pairs(
    results: &Results,
    scene: &SceneSpec,
    name: &str,
    opponent: &str,
    metric: &str,
) -> Option<ScenePairs> {
    let at = last_time_point(&results.suite)?;
    let runs = |method: &str| results.runs(&scene.name, method);
    let (ours, theirs) = (runs(name), runs(opponent));
    let both = |seed: u64| {
        let error = |runs: &[&super::results::Run]| {
            let run = runs.iter().find(|c| c.seed == seed)?;
            summary::error(results, run, metric, at)
        };
        error(&ours).zip(error(&theirs)).unzip()
    };
    let pairs: ScenePairs = results.suite.seeds().map(both).unzip();
    pairs.0.iter().any(Option::is_some).then_some(pairs)
}

/// Ratio of the geometric means over scenes, paired by seed; seeds without all results are left out.
fn mean_ratio(scenes: &[ScenePairs]) -> Option<(Interval, Verdict)> {
    let seeds = scenes.first()?.0.len();
    let over_scenes = |errors: &dyn Fn(&ScenePairs) -> Option<f64>| {
        let errors: Option<Vec<f64>> = scenes.iter().map(errors).collect();
        ratios::geometric_mean(&errors?)
    };
    let (ours, theirs): (Vec<f64>, Vec<f64>) = (0..seeds)
        .filter_map(|s| over_scenes(&|p| p.0[s]).zip(over_scenes(&|p| p.1[s])))
        .unzip();
    let ratio = ratios::paired_ratio(&ours, &theirs)?;
    Some((ratio, Verdict::of(&ratio, ours.len())))
}
