//! `opsr verify`: hard numerical cases on this machine.

use super::Exit;
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

/// Runs the command: every case, what was tried in it, the worst value met and its bound.
pub(super) fn run(args: &VerifyArgs) -> anyhow::Result<Exit> {
    if !args.json {
        println!(
            "{:<24} {:<64} {:>9}  {:>7}",
            "case", "tried", "worst", "bound"
        );
    }
    let (mut all, mut violations) = (Vec::new(), 0);
    for case in &CASES {
        for finding in case.run() {
            violations += u32::from(!finding.holds());
            if args.json {
                all.push(as_json(case.name, &finding));
            } else {
                println!("{}", row(case.name, &finding));
            }
        }
    }
    if args.json {
        println!("{:#}", json!(all));
    } else if violations > 0 {
        println!("{violations} violated: please report this with the kind of machine");
    } else {
        println!("all hold");
    }
    Ok(if violations > 0 {
        Exit::Failed
    } else {
        Exit::Done
    })
}

fn row(case: &str, finding: &Finding) -> String {
    let mark = if finding.holds() { "" } else { "  VIOLATED" };
    format!(
        "{case:<24} {:<64} {:>9}  {:>7}{mark}",
        finding.tried,
        short(finding.worst),
        short(finding.bound)
    )
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
