//! `opsr verify`: runs the hard numerical cases on this machine.

use super::Exit;
use super::output::print;
use clap::Args;
use opsr::verify::{CASES, Finding};
use serde_json::json;

/// Options of `opsr verify`.
#[derive(Args, Debug)]
pub(super) struct VerifyArgs {
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command: prints the worst value and the bound of every check.
pub(super) fn run(args: &VerifyArgs) -> anyhow::Result<Exit> {
    let (mut all, mut violations) = (Vec::new(), 0);
    if !args.json {
        print(row(["case", "check", "worst", "bound"], ""))?;
    }
    for case in &CASES {
        for finding in case.run() {
            violations += u32::from(!finding.holds());
            if args.json {
                all.push(as_json(case.name, &finding));
                continue;
            }
            let [worst, bound] = [finding.worst, finding.bound].map(short);
            let mark = if finding.holds() { "" } else { "  VIOLATED" };
            print(row([case.name, &finding.tried, &worst, &bound], mark))?;
        }
    }
    if args.json {
        print(format!("{:#}\n", json!(all)))?;
    } else if violations == 0 {
        print("all hold\n")?;
    } else {
        print(format!(
            "{violations} violated: please report them with the model of the processor\n"
        ))?;
    }
    Ok(if violations == 0 {
        Exit::Done
    } else {
        Exit::Failed
    })
}

fn row([case, tried, worst, bound]: [&str; 4], mark: &str) -> String {
    format!("{case:<24} {tried:<64} {worst:>9}  {bound:>9}{mark}\n")
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
