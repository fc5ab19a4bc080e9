//! `opsr verify`: checks that the program works on this machine.

use super::exit::Exit;
use super::output::print;
use clap::builder::PossibleValuesParser;
use clap::{Args, Subcommand};
use opsr_lab::verify::simple::Fault;
use opsr_lab::verify::{Finding, NUMERIC, Size, chaos, images, repeat, soak};
use serde_json::json;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

/// Options of `opsr verify`.
#[derive(Args, Debug)]
#[command(
    after_help = "Every line is a check: the worst value of its statistic and the bound. Exit code 0 means that all \
hold or, with --plant, that the fault is found; otherwise it is 1."
)]
pub(super) struct VerifyArgs {
    /// Print JSON.
    #[arg(long, global = true)]
    json: bool,
    /// Use the large sizes: minutes instead of seconds.
    #[arg(long, global = true)]
    thorough: bool,
    /// Take the sizes of the program's own tests.
    #[arg(long, global = true, hide = true, conflicts_with = "thorough")]
    tiny: bool,
    #[command(subcommand)]
    what: Option<What>,
}

/// Subject of the checks; numbers without one.
#[derive(Clone, Debug, Subcommand)]
enum What {
    /// Hard numerical cases; BSDFs: chi-square of draws, white furnace, reciprocity (the default).
    Numeric,
    /// Renders against a simple path tracer that shares no light sampling, weights or roulette with the program.
    Render {
        /// Plant a fault in the simple path tracer; the comparison must find it. `all` plants one after the other.
        #[arg(long, value_name = "FAULT", value_parser = faults())]
        plant: Option<String>,
    },
    /// Pictures with other numbers of threads, in other passes, and in crops: bit-identical.
    Determinism,
    /// Renders stopped at random points and resumed from their checkpoints: bit-identical.
    Resume,
    /// The trainer: gradients against finite differences; tables with other numbers of threads and after resuming;
    /// losses.
    #[cfg(feature = "train")]
    Train,
    /// Rounds of rendering, saving and learning: memory and bytes stay constant.
    Soak {
        /// Duration [default: 20s, with --thorough 1h].
        #[arg(long, value_name = "DURATION", value_parser = humantime::parse_duration)]
        time: Option<Duration>,
    },
    /// Random options on random small scenes: threads, passes, checkpoints and parts bit-identical, integrators within
    /// their noise. Disagreements are printed with their seeds.
    Chaos {
        /// Duration [default: 20s, with --thorough 1h, without --count].
        #[arg(long, value_name = "DURATION", value_parser = humantime::parse_duration)]
        time: Option<Duration>,
        /// Number of combinations.
        #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
        count: Option<u64>,
        /// Seed of the first combination; each further one has the next seed.
        #[arg(long, value_name = "N", default_value_t = 0)]
        seed: u64,
    },
}

fn faults() -> PossibleValuesParser {
    let names = Fault::ALL.iter().map(|(name, _)| *name);
    PossibleValuesParser::new(names.chain(["all"]))
}

/// Runs the command: prints the worst value and the bound of every check.
pub(super) fn run(args: &VerifyArgs) -> anyhow::Result<Exit> {
    let size = match (args.tiny, args.thorough) {
        (true, _) => Size::Tiny,
        (_, true) => Size::Thorough,
        _ => Size::Small,
    };
    let mut report = Report::new(args.json)?;
    match args.what.clone().unwrap_or(What::Numeric) {
        What::Numeric => {
            for case in &NUMERIC {
                report.add(case.name, case.run(size))?;
            }
        }
        What::Render { plant: None } => report.add("render", images::all(size, None))?,
        What::Render { plant: Some(plant) } => {
            for (name, fault) in Fault::ALL {
                if plant == name || plant == "all" {
                    report.add_planted(name, &images::all(size, Some(fault)))?;
                }
            }
        }
        What::Determinism => report.add("determinism", repeat::determinism(size))?,
        What::Resume => report.add("resume", repeat::resume(size))?,
        #[cfg(feature = "train")]
        What::Train => report.add("train", opsr_lab::verify::learning::all(size))?,
        What::Soak { time } => {
            let seconds = size.of(0, 20, 3600);
            let time = time.unwrap_or(Duration::from_secs(seconds));
            report.add("soak", soak::run(time))?;
        }
        What::Chaos { time, count, seed } => {
            let seconds = match count {
                Some(_) => u64::MAX,
                None => size.of(0, 20, 3600),
            };
            let time = time.unwrap_or(Duration::from_secs(seconds));
            let clock = Instant::now();
            let goes_on = |tried| match clock.elapsed() < time && count.is_none_or(|n| tried < n) {
                true => ControlFlow::Continue(()),
                false => ControlFlow::Break(()),
            };
            report.add("chaos", chaos::run(seed, goes_on))?;
        }
    }
    report.finish()
}

/// Findings, printed as they are added.
struct Report {
    json: Option<Vec<serde_json::Value>>,
    wrong: u32,
    planted: bool,
}

impl Report {
    fn new(json: bool) -> anyhow::Result<Self> {
        if !json {
            print(row(["case", "check", "worst", "bound"], ""))?;
        }
        Ok(Self {
            json: json.then(Vec::new),
            wrong: 0,
            planted: false,
        })
    }

    /// Adds findings that must hold.
    fn add(
        &mut self,
        case: &str,
        findings: impl IntoIterator<Item = Finding>,
    ) -> anyhow::Result<()> {
        for finding in findings {
            self.wrong += u32::from(!finding.holds());
            let mark = if finding.holds() { "" } else { "VIOLATED" };
            self.line(case, &finding, mark)?;
        }
        Ok(())
    }

    /// Adds the findings of a planted fault: at least one must violate its bound.
    fn add_planted(&mut self, fault: &str, findings: &[Finding]) -> anyhow::Result<()> {
        for finding in findings {
            let mark = if finding.holds() { "" } else { "found" };
            self.line(fault, finding, mark)?;
        }
        let missed = findings.iter().all(Finding::holds);
        self.wrong += u32::from(missed);
        self.planted = true;
        if self.json.is_none() {
            let verdict = if missed { "NOT FOUND" } else { "found" };
            print(format!("planted {fault}: {verdict}\n"))?;
        }
        Ok(())
    }

    fn line(&mut self, case: &str, finding: &Finding, mark: &str) -> anyhow::Result<()> {
        if let Some(all) = &mut self.json {
            all.push(as_json(case, finding));
            return Ok(());
        }
        let [worst, bound] = [finding.worst, finding.bound].map(short);
        print(row([case, &finding.tried, &worst, &bound], mark))
    }

    fn finish(self) -> anyhow::Result<Exit> {
        match (self.json, self.wrong) {
            (Some(all), _) => print(format!("{:#}\n", json!(all)))?,
            (None, 0) if self.planted => print("every planted fault is found\n")?,
            (None, 0) => print("all hold\n")?,
            (None, wrong) => print(format!(
                "{wrong} wrong: please report this with the model of the processor\n"
            ))?,
        }
        Ok(if self.wrong == 0 {
            Exit::Done
        } else {
            Exit::Failed
        })
    }
}

fn row([case, tried, worst, bound]: [&str; 4], mark: &str) -> String {
    let line = format!("{case:<20} {tried:<72} {worst:>9}  {bound:>9}  {mark}");
    format!("{}\n", line.trim_end())
}

fn short(x: f64) -> String {
    if x == 0.0 {
        "0".into()
    } else if (0.1..1000.0).contains(&x) {
        format!("{x:.3}")
    } else {
        format!("{x:.2e}")
    }
}

fn as_json(case: &str, finding: &Finding) -> serde_json::Value {
    json!({
        "case": case,
        "tried": finding.tried,
        "worst": finding.worst,
        "bound": finding.bound,
        "holds": finding.holds(),
    })
}
