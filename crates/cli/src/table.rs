//! `opsr table`: shows a table, and exports it for other programs.

use super::exit::Blame;
use super::output::print;
use anyhow::anyhow;
use clap::{Args, Subcommand, ValueEnum};
use opsr::files;
use opsr::files::hex;
use opsr::regularise::export::{self, Format};
use opsr::regularise::file::TableFile;
use opsr::regularise::{BINS, GammaIndex, LEN, MAX_VERTICES};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// Options of `opsr table`.
#[derive(Args, Debug)]
pub(super) struct TableArgs {
    #[command(subcommand)]
    action: Action,
}

#[derive(Clone, Debug, Subcommand)]
enum Action {
    /// Show the factors of a table and how it was learned.
    ///
    /// Classes are listed by the number of vertices. Each has the roughness bins of its vertices, camera first (0 is
    /// smooth, 3 is rough), its factor, and the number of its events in training.
    Show {
        /// The table: a file, or beta-0.001 or beta-0.05, which the program contains.
        file: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
        /// List only the N most visited classes of each length; for a table without a training record, those with the
        /// largest factors.
        #[arg(long, value_name = "N")]
        top: Option<usize>,
    },
    /// Export a table for another renderer, as source code with the complete look-up.
    ///
    /// A comment at the head of the source code shows how a renderer calls it. `opsr table show --json` prints the factors
    /// for other programs.
    #[command(
        after_help = "Examples:\n  opsr table export params/beta-0.001.json -o opsr_table.h\n  \
        opsr table export beta-0.05 -o shaders/opsr.glsl\n  \
        opsr table export params/beta-0.001.json --format c -o -\n  \
        opsr table export beta-0.001 --format resolve -o resolve.h"
    )]
    Export {
        /// The table: a file, or beta-0.001 or beta-0.05, which the program contains.
        file: PathBuf,
        /// Format of OUT; by default chosen by the file name extension.
        #[arg(long, value_enum)]
        format: Option<Form>,
        /// File to write, or `-` for standard output.
        #[arg(short, long, value_name = "OUT")]
        output: PathBuf,
    },
}

/// [`Format`] as a command line value.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Form {
    /// Header for C99 and C++.
    C,
    /// Include file for GLSL, HLSL and Slang.
    Glsl,
    /// Rust module that depends on `core` only.
    Rust,
    /// Header for C99 and C++ of the choice among levels, the same for every table.
    Resolve,
}

impl From<Form> for Format {
    fn from(form: Form) -> Self {
        match form {
            Form::C => Self::C,
            Form::Glsl => Self::Shader,
            Form::Rust => Self::Rust,
            Form::Resolve => Self::Resolve,
        }
    }
}

/// Runs the command.
pub(super) fn run(args: &TableArgs) -> anyhow::Result<()> {
    match &args.action {
        Action::Show { file, json, top } => {
            let table = TableFile::load(file).input()?;
            let summary = summarise(&table, top.unwrap_or(LEN));
            let text = if *json {
                format!("{summary:#}\n")
            } else {
                describe(&summary)
            };
            print(text)
        }
        Action::Export {
            file,
            format,
            output,
        } => write(file, format.map(Format::from), output),
    }
}

fn write(file: &Path, format: Option<Format>, output: &Path) -> anyhow::Result<()> {
    let Some(format) = format.or_else(|| Format::of(output)) else {
        return Err(anyhow!(
            "{}: no format for this extension: use .h, .glsl, .hlsl, .slang or .rs, or \
             --format",
            output.display()
        ))
        .usage();
    };
    let bytes = export::export(&TableFile::load(file).input()?, format);
    if output == Path::new("-") {
        return print(bytes);
    }
    files::write_bytes(output, &bytes).output()
}

/// Training record, statistics and classes as JSON.
fn summarise(file: &TableFile, top: usize) -> Value {
    let table = &file.table;
    let visits = file.provenance.as_ref().map(|p| p.visits.as_slice());
    let lengths = (2..=MAX_VERTICES).map(|length| of_length(file, visits, length, top));
    let mut training = json!(file.provenance);
    // Each class lists its visits.
    if let Some(fields) = training.as_object_mut() {
        fields.remove("visits");
    }
    json!({
        "levels": BINS,
        "lookup": table.lookup,
        "scale": table.scale,
        "sha256": hex(&file.digest()),
        "training": training,
        "all": statistics(file, visits, &classes(|_| true)),
        // A last vertex in the top bin is so rough that its factor hardly matters.
        "live": statistics(file, visits, &classes(|bins| bins.last() < Some(&(BINS - 1)))),
        "lengths": lengths.collect::<Vec<_>>(),
    })
}

fn classes(wanted: impl Fn(&[usize]) -> bool) -> Vec<GammaIndex> {
    (0..LEN)
        .filter_map(GammaIndex::new)
        .filter(|c| wanted(&c.bins()))
        .collect()
}

fn of_length(file: &TableFile, visits: Option<&[u64]>, length: usize, top: usize) -> Value {
    let mut classes = classes(|bins| bins.len() == length);
    let statistics = statistics(file, visits, &classes);
    let gamma = |class: GammaIndex| file.table.gammas[class.index()];
    if top < classes.len() {
        match visits {
            Some(v) => classes.sort_by_key(|c| std::cmp::Reverse(v[c.index()])),
            None => classes.sort_by(|a, b| gamma(*b).total_cmp(&gamma(*a))),
        }
        classes.truncate(top);
    }
    let list: Vec<Value> = (classes.iter())
        .map(|&class| {
            let bins: Vec<String> = class.bins().iter().map(usize::to_string).collect();
            json!({
                "index": class.index(),
                "code": bins.join(" "),
                "gamma": gamma(class),
                "visits": visits.map(|v| v[class.index()]),
            })
        })
        .collect();
    json!({ "vertices": length, "statistics": statistics, "classes": list })
}

fn statistics(file: &TableFile, visits: Option<&[u64]>, classes: &[GammaIndex]) -> Value {
    let mut gammas: Vec<f32> = (classes.iter())
        .map(|c| file.table.gammas[c.index()])
        .collect();
    gammas.sort_by(f32::total_cmp);
    let count = |wanted: f32| gammas.iter().filter(|&&g| g == wanted).count();
    let sum: f64 = gammas.iter().copied().map(f64::from).sum();
    let visited = |v: &[u64]| classes.iter().filter(|c| v[c.index()] > 0).count();
    json!({
        "classes": classes.len(),
        "visited": visits.map(visited),
        "smallest": gammas.first(),
        "median": gammas.get(gammas.len() / 2),
        "mean": sum / gammas.len() as f64,
        "largest": gammas.last(),
        "at_zero": count(0.0),
        "at_one": count(1.0),
    })
}

/// Formats the summary as text.
fn describe(summary: &Value) -> String {
    let mut out = String::new();
    let mut line = |text: String| {
        out.push_str(text.trim_end());
        out.push('\n');
    };
    line(format!("look-up     {}", word(&summary["lookup"])));
    line(format!("scale       {}", summary["scale"]));
    line(format!("sha256      {}", word(&summary["sha256"])));
    match summary["training"].as_object() {
        None => line("learned     no: made by hand".into()),
        Some(fields) => {
            for (name, value) in fields.iter().filter(|(name, _)| *name != "scenes") {
                line(format!("{name:<11} {}", word(value)));
            }
            for scene in summary["training"]["scenes"]
                .as_array()
                .into_iter()
                .flatten()
            {
                line(format!(
                    "scene       {} {}",
                    word(&scene[0]),
                    word(&scene[1])
                ));
            }
        }
    }
    line(String::new());
    line(
        "vertices  classes  visited  smallest    median      mean   largest  at 0  at 1".to_owned(),
    );
    for length in summary["lengths"].as_array().into_iter().flatten() {
        line(row(&length["vertices"].to_string(), &length["statistics"]));
    }
    line(row("all", &summary["all"]));
    line(row("live", &summary["live"]));
    line("live: classes whose last vertex is not in the roughest bin".into());
    for length in summary["lengths"].as_array().into_iter().flatten() {
        line(format!("\n{} vertices", length["vertices"]));
        for class in length["classes"].as_array().into_iter().flatten() {
            let visits = match class["visits"].as_u64() {
                Some(0) => "never visited".into(),
                Some(n) => format!("{n} visits"),
                None => String::new(),
            };
            line(format!(
                "  {}  {}  {visits}",
                word(&class["code"]),
                number(&class["gamma"])
            ));
        }
    }
    out
}

fn row(name: &str, s: &Value) -> String {
    let visited = s["visited"].as_u64().map_or("?".into(), |n| n.to_string());
    format!(
        "{name:<8}  {:>7}  {visited:>7}  {}  {}  {}  {}  {:>4}  {:>4}",
        s["classes"].to_string(),
        number(&s["smallest"]),
        number(&s["median"]),
        number(&s["mean"]),
        number(&s["largest"]),
        s["at_zero"].to_string(),
        s["at_one"].to_string()
    )
}

/// Formats a factor in eight columns.
fn number(value: &Value) -> String {
    match value.as_f64().unwrap_or_default() {
        x if x == 0.0 || x >= 1e-3 => format!("{x:8.5}"),
        x => format!("{x:8.1e}"),
    }
}

/// Formats a string without quotes and any other value as JSON.
fn word(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), Into::into)
}
