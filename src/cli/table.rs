//! `opsr table`: what a table holds, and its forms for other programs.

use super::Blame;
use super::output::print;
use anyhow::anyhow;
use clap::{Args, Subcommand, ValueEnum};
use opsr::files;
use opsr::files::hex;
use opsr::regularise::export::{self, Format};
use opsr::regularise::file::TableFile;
use opsr::regularise::{GammaIndex, LEN, LEVELS, MAX_VERTICES};
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
    /// Say how a table was learned and what its factors are.
    ///
    /// Classes are listed by length of the path, each with its roughness levels from the camera on (0 is smooth, 3 is
    /// rough), its factor and how often training met it.
    Show {
        /// The table (params/*.json).
        file: PathBuf,
        /// Print JSON.
        #[arg(long)]
        json: bool,
        /// List only the N most visited classes of each length (with the largest factors, where visits are not known).
        #[arg(long, value_name = "N")]
        top: Option<usize>,
    },
    /// Write a table for another program: an array, or source code with the whole look-up.
    ///
    /// Source code says at its head how a renderer calls it. Arrays hold the factors with the table's scale applied.
    #[command(
        after_help = "Examples:\n  opsr table export params/beta-0.001.json -o opsr_table.h\n  \
        opsr table export params/beta-0.001.json -o shaders/opsr.glsl\n  \
        opsr table export params/beta-0.001.json --format csv -o -"
    )]
    Export {
        /// The table (params/*.json).
        file: PathBuf,
        /// What to write; without it the ending of OUT decides.
        #[arg(long, value_enum)]
        format: Option<Form>,
        /// The file to write, `-` for standard output.
        #[arg(short, long, value_name = "OUT")]
        output: PathBuf,
    },
}

/// [`Format`] on the command line.
#[derive(Clone, Copy, Debug, ValueEnum)]
enum Form {
    /// NumPy's array file: f32 [1360].
    Npy,
    /// One tensor `gammas`, f32 [1360], with class order, look-up and training in the metadata.
    Safetensors,
    /// A line for each class: index, length, code, bins, gamma, visits.
    Csv,
    /// A header for C99 and C++.
    C,
    /// An include for GLSL, HLSL and Slang.
    Glsl,
    /// A Rust module without dependencies, for `core` alone.
    Rust,
}

impl From<Form> for Format {
    fn from(form: Form) -> Self {
        match form {
            Form::Npy => Self::Npy,
            Form::Safetensors => Self::Safetensors,
            Form::Csv => Self::Csv,
            Form::C => Self::C,
            Form::Glsl => Self::Shader,
            Form::Rust => Self::Rust,
        }
    }
}

/// Runs the command.
pub(super) fn run(args: &TableArgs) -> anyhow::Result<()> {
    match &args.action {
        Action::Show { file, json, top } => {
            let table = TableFile::load(file).input()?;
            let facts = facts(&table, top.unwrap_or(LEN));
            let text = if *json {
                format!("{facts:#}\n")
            } else {
                describe(&facts)
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
            "{}: the name does not say what to write: end it in .npy, .safetensors, .csv, .h, .glsl, .hlsl, .slang \
             or .rs, or give --format",
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

/// Header, statistics and classes, as JSON.
fn facts(file: &TableFile, top: usize) -> Value {
    let table = &file.table;
    let visits = file.provenance.as_ref().map(|p| p.visits.as_slice());
    let lengths = (2..=MAX_VERTICES).map(|length| of_length(file, visits, length, top));
    let mut training = json!(file.provenance);
    // The classes say it.
    if let Some(fields) = training.as_object_mut() {
        fields.remove("visits");
    }
    json!({
        "levels": LEVELS,
        "lookup": table.lookup,
        "scale": table.scale,
        "sha256": hex(&file.digest()),
        "training": training,
        "all": statistics(file, visits, &classes(|_| true)),
        // Lobes in the last level have almost nothing to roughen.
        "live": statistics(file, visits, &classes(|levels| levels.last() < Some(&(LEVELS - 1)))),
        "lengths": lengths.collect::<Vec<_>>(),
    })
}

fn classes(wanted: impl Fn(&[usize]) -> bool) -> Vec<GammaIndex> {
    (0..LEN)
        .filter_map(GammaIndex::new)
        .filter(|c| wanted(&c.levels()))
        .collect()
}

fn of_length(file: &TableFile, visits: Option<&[u64]>, length: usize, top: usize) -> Value {
    let mut classes = classes(|levels| levels.len() == length);
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
            let levels: Vec<String> = class.levels().iter().map(usize::to_string).collect();
            json!({
                "index": class.index(),
                "code": levels.join(" "),
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

/// The same as text.
fn describe(facts: &Value) -> String {
    let mut out = String::new();
    let mut line = |text: String| {
        out.push_str(text.trim_end());
        out.push('\n');
    };
    line(format!("look-up     {}", word(&facts["lookup"])));
    line(format!("scale       {}", facts["scale"]));
    line(format!("sha256      {}", word(&facts["sha256"])));
    match facts["training"].as_object() {
        None => line("learned     no: made by hand".into()),
        Some(fields) => {
            for (name, value) in fields.iter().filter(|(name, _)| *name != "scenes") {
                line(format!("{name:<11} {}", word(value)));
            }
            for scene in facts["training"]["scenes"].as_array().into_iter().flatten() {
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
    for length in facts["lengths"].as_array().into_iter().flatten() {
        line(row(&length["vertices"].to_string(), &length["statistics"]));
    }
    line(row("all", &facts["all"]));
    line(row("live", &facts["live"]));
    line("live: classes whose last vertex is not on the roughest level".into());
    for length in facts["lengths"].as_array().into_iter().flatten() {
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

/// A factor in eight columns.
fn number(value: &Value) -> String {
    match value.as_f64().unwrap_or_default() {
        x if x == 0.0 || x >= 1e-3 => format!("{x:8.5}"),
        x => format!("{x:8.1e}"),
    }
}

/// Text without its quotes, anything else as JSON.
fn word(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), Into::into)
}
