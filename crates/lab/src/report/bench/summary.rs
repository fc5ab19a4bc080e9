//! Summaries of a scene: every method against the baseline.

use std::fmt::{self, Write};

use super::curve::{self, Crossing};
use super::overall::last_time_point;
use super::results::{Results, Run};
use super::suite::SceneSpec;
use crate::report::compare::{aligned, number};
use crate::report::html::or_dash;
use crate::stats::ratios::{self, Interval, Verdict};

/// The error of curves, floors and crossings.
pub const MAIN: &str = "relMSE";

/// All errors that are compared. The energy ratio is no error.
pub const METRICS: [&str; 6] = [MAIN, "relMSE trimmed", "MSE", "MAPE", "SMAPE", "FLIP"];

/// Time point at which errors are compared.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TimePoint {
    /// After the same time.
    Seconds(f64),
    /// After the same number of samples.
    Samples(u32),
}

impl fmt::Display for TimePoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Seconds(t) => write!(f, "{t} s"),
            Self::Samples(n) => write!(f, "{n} spp"),
        }
    }
}

/// A number of one method, compared with the baseline's.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    /// Geometric mean over the seeds.
    pub value: f64,
    /// Ratio to the baseline's, seed by seed; `None` for the baseline itself.
    pub ratio: Option<(Interval, Verdict)>,
}

/// Everything about a method on a scene.
#[derive(Clone, Debug)]
pub struct MethodSummary {
    /// The method.
    pub name: String,
    /// Number of its runs.
    pub seeds: usize,
    /// [`MAIN`] at each time point of the suite; `None` where it was not reached.
    pub main: Vec<(TimePoint, Option<Compared>)>,
    /// [`METRICS`] at the last time point that is compared (see [`SceneSummary::last`]).
    pub metrics: Vec<(&'static str, Option<Compared>)>,
    /// Nanoseconds of CPU time per path.
    pub ns_per_path: Option<Compared>,
    /// Paths per second of wall time.
    pub paths_per_second: Option<f64>,
    /// Share of the vertices with a roughened lobe, over all runs.
    pub regularised: Option<f64>,
    /// Largest memory of the process at the end of a run, in MiB.
    pub memory: Option<f64>,
    /// Light of the picture over light of the reference at the end of the runs.
    pub energy: Option<Interval>,
    /// Estimated over true error, and their rank correlation, of the error maps at the end of runs with several levels
    /// (see [`error_map`](super::errors::error_map)).
    pub error_map: Option<[f64; 2]>,
    /// Part of [`MAIN`] that no number of samples removes.
    pub squared_bias: Option<Interval>,
    /// Samples that were refused, over all runs.
    pub rejected: u64,
    /// Point at which the baseline overtakes; `None` for the baseline.
    pub crossing: Option<Crossing>,
}

impl MethodSummary {
    /// The bias floor, if the interval excludes zero.
    pub fn floor(&self) -> Option<f64> {
        self.squared_bias.filter(|b| b.low > 0.0).map(|b| b.value)
    }

    /// True if the interval of the energy ratio excludes 1: the picture is too bright or too dark.
    pub fn energy_is_off(&self) -> bool {
        self.seeds >= ratios::MIN_SEEDS && self.energy.is_some_and(|e| !e.holds(1.0))
    }
}

/// All methods of a scene.
#[derive(Clone, Debug)]
pub struct SceneSummary {
    /// The scene.
    pub name: String,
    /// The baseline on this scene.
    pub baseline: String,
    /// The time point at which all metrics are compared: the last time, or the last sample count without times.
    pub last: TimePoint,
    /// The methods in the suite's order.
    pub methods: Vec<MethodSummary>,
}

/// Summaries of all scenes that have runs.
pub fn summaries(results: &Results) -> Vec<SceneSummary> {
    results
        .suite
        .scenes
        .iter()
        .filter(|s| results.cells.iter().any(|c| c.scene == s.name))
        .filter_map(|s| scene(results, s))
        .collect()
}

fn scene(results: &Results, spec: &SceneSpec) -> Option<SceneSummary> {
    let suite = &results.suite;
    let methods: Vec<&str> = suite.methods_of(spec).map(|m| m.name.as_str()).collect();
    let wanted = suite.baseline();
    let baseline = *methods.iter().find(|m| **m == wanted).or(methods.first())?;
    let times = suite.times.iter().map(|&t| TimePoint::Seconds(t));
    let samples = suite.samples.iter().map(|&n| TimePoint::Samples(n));
    let last = last_time_point(suite)?;
    let points: Vec<TimePoint> = times.chain(samples).collect();
    let against = Baseline {
        results,
        runs: results.runs(&spec.name, baseline),
    };
    let methods = methods
        .iter()
        .map(|name| against.method(spec, name, *name == baseline, &points, last))
        .collect();
    Some(SceneSummary {
        name: spec.name.clone(),
        baseline: baseline.to_owned(),
        last,
        methods,
    })
}

/// The error of a run at a time point; `None` if the run did not reach it.
pub(super) fn error(results: &Results, run: &Run, metric: &str, at: TimePoint) -> Option<f64> {
    let Results { suite, machine, .. } = results;
    match at {
        TimePoint::Samples(n) => curve::at_samples(run, metric, n),
        TimePoint::Seconds(t) => {
            curve::at_seconds(run, metric, t, &|p| suite.clock.seconds(p, machine.threads))
        }
    }
}

/// The baseline's runs on a scene, which every method is compared with.
struct Baseline<'a> {
    results: &'a Results,
    runs: Vec<&'a Run>,
}

impl Baseline<'_> {
    fn method(
        &self,
        spec: &SceneSpec,
        name: &str,
        is_baseline: bool,
        points: &[TimePoint],
        last: TimePoint,
    ) -> MethodSummary {
        let runs = self.results.runs(&spec.name, name);
        let compared = |f: &dyn Fn(&Run) -> Option<f64>| self.compared(&runs, is_baseline, f);
        let error =
            |at: TimePoint, metric: &str| compared(&|c| self::error(self.results, c, metric, at));
        let energy: Vec<f64> = runs
            .iter()
            .filter_map(|c| c.points.last()?.errors.get("energy ratio").copied())
            .collect();
        let error_map = ["error map ratio", "error map rank"].map(|name| {
            let last = |c: &&Run| c.points.last()?.errors.get(name).copied();
            ratios::mean(&runs.iter().filter_map(last).collect::<Vec<f64>>())
        });
        let facts = self.results.scenes.iter().find(|s| s.name == spec.name);
        let noise = facts.map_or(0.0, |f| f.reference_noise);
        let squared_bias = self
            .results
            .products(&spec.name, name)
            .and_then(|p| ratios::squared_bias(&p.values, noise));
        let mut summary = MethodSummary {
            name: name.to_owned(),
            seeds: runs.len(),
            main: points.iter().map(|&m| (m, error(m, MAIN))).collect(),
            metrics: METRICS.iter().map(|&m| (m, error(last, m))).collect(),
            ns_per_path: compared(&ns_per_path),
            paths_per_second: paths_per_second(&runs),
            regularised: ratios::mean(&runs.iter().map(|c| c.regularised).collect::<Vec<f64>>()),
            memory: runs.iter().filter_map(|c| c.memory).reduce(f64::max),
            energy: ratios::mean_interval(&energy),
            error_map: error_map[0].zip(error_map[1]).map(<[f64; 2]>::from),
            squared_bias,
            rejected: runs.iter().fold(0, |n, c| n.saturating_add(c.rejected)),
            crossing: None,
        };
        if !is_baseline {
            summary.crossing = self.crossing(&runs, &summary);
        }
        summary
    }

    /// A value over all runs and its ratio to the baseline's, over the seeds that both methods have.
    fn compared(
        &self,
        runs: &[&Run],
        is_baseline: bool,
        f: &dyn Fn(&Run) -> Option<f64>,
    ) -> Option<Compared> {
        let all: Vec<f64> = runs.iter().filter_map(|c| f(c)).collect();
        // One seed that does not reach the time point makes the value unknown.
        let value = ratios::geometric_mean(&all).filter(|_| all.len() == runs.len())?;
        if is_baseline {
            return Some(Compared { value, ratio: None });
        }
        let (ours, theirs): (Vec<f64>, Vec<f64>) = runs
            .iter()
            .filter_map(|c| {
                let other = self.runs.iter().find(|b| b.seed == c.seed)?;
                Some((f(c)?, f(other)?))
            })
            .unzip();
        let ratio = ratios::paired_ratio(&ours, &theirs).map(|r| (r, Verdict::of(&r, ours.len())));
        Some(Compared { value, ratio })
    }

    fn crossing(&self, runs: &[&Run], summary: &MethodSummary) -> Option<Crossing> {
        let timed = |(m, c): &(TimePoint, Option<Compared>)| match m {
            TimePoint::Seconds(_) => c.and_then(|c| c.ratio),
            TimePoint::Samples(_) => None,
        };
        let (_, verdict) = summary.main.iter().filter_map(timed).next_back()?;
        if matches!(verdict, Verdict::Tie | Verdict::TooFewSeeds) {
            return Some(Crossing::Undecided);
        }
        let curve = |runs: &[&Run], t: f64| {
            let errors: Option<Vec<f64>> = runs
                .iter()
                .map(|c| error(self.results, c, MAIN, TimePoint::Seconds(t)))
                .collect();
            ratios::geometric_mean(&errors?)
        };
        let mut times = Vec::new();
        let (mut ours, mut theirs) = (Vec::new(), Vec::new());
        for &t in &self.results.suite.times {
            if let Some((a, b)) = curve(runs, t).zip(curve(&self.runs, t)) {
                times.push(t);
                ours.push(a);
                theirs.push(b);
            }
        }
        curve::crossing(&times, &ours, &theirs, summary.floor())
    }
}

fn ns_per_path(run: &Run) -> Option<f64> {
    let end = run.points.last()?;
    (run.paths > 0).then(|| end.cpu * 1e9 / run.paths as f64)
}

fn paths_per_second(runs: &[&Run]) -> Option<f64> {
    let rate = |c: &&Run| Some(c.paths as f64 / c.points.last()?.wall);
    ratios::geometric_mean(&runs.iter().filter_map(rate).collect::<Vec<f64>>())
}

/// `0.52 [0.48, 0.57] better`, or a dash for the baseline.
fn ratio_words(compared: Option<Compared>) -> String {
    let ratio = compared.and_then(|c| c.ratio);
    or_dash(ratio, |(r, verdict)| {
        let Interval { value, low, high } = r;
        format!("{value:.3} [{low:.3}, {high:.3}] {}", verdict.word())
    })
}

/// One table per scene, as text.
pub fn text(results: &Results) -> String {
    let mut text = String::new();
    for scene in summaries(results) {
        let _ = writeln!(
            text,
            "{}: {MAIN} at {}, against {}\n",
            scene.name, scene.last, scene.baseline
        );
        let heads = [
            "",
            MAIN,
            "ratio",
            "MAPE",
            "FLIP",
            "ns/path",
            "ratio",
            "energy",
            "bias²",
            "error map",
            "rank",
        ];
        let mut rows = vec![heads.map(str::to_owned).to_vec()];
        for m in &scene.methods {
            let metric = |name| {
                m.metrics
                    .iter()
                    .find(|(n, _)| *n == name)
                    .and_then(|(_, c)| *c)
            };
            let main = metric(MAIN);
            rows.push(vec![
                m.name.clone(),
                or_dash(main, |c| number(c.value)),
                ratio_words(main),
                or_dash(metric("MAPE"), |c| number(c.value)),
                or_dash(metric("FLIP"), |c| number(c.value)),
                or_dash(m.ns_per_path, |c| format!("{:.0}", c.value)),
                ratio_words(m.ns_per_path),
                or_dash(m.energy, |e| format!("{:.4}", e.value)),
                or_dash(m.floor(), number),
                or_dash(m.error_map, |[ratio, _]| format!("{ratio:.2}")),
                or_dash(m.error_map, |[_, rank]| format!("{rank:.2}")),
            ]);
        }
        text.push_str(&aligned(&rows));
        for (method, why) in results.refused(&scene.name) {
            let _ = writeln!(text, "{method} is left out: {why}");
        }
        text.push('\n');
    }
    text
}
