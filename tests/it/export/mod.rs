//! Exported tables: source code is compiled and run.

mod code;
mod host;
mod resolve;

use opsr::regularise::export::{Format, export};
use opsr::regularise::file::{Provenance, TableFile, save};
use opsr::regularise::{AttenuationTable, GammaIndex, LEN, Lookup};
use rand::{RngExt, SeedableRng};
use std::path::Path;
use std::process::{Command, Output};

/// A table in which all factors differ; the scale raises some of them above 1.
fn table(lookup: Lookup, scale: f32) -> TableFile {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(11);
    let mut table = AttenuationTable {
        lookup,
        scale,
        ..AttenuationTable::constant(0.0)
    };
    table.gammas.fill_with(|| random.random::<f32>().powi(3));
    (table.gammas[0], table.gammas[1], table.gammas[2]) = (1.0, 0.0, 1.5e-7);
    let provenance = Provenance {
        opsr: "0.1.0".into(),
        loss: "MAPE + beta * Var\nint not_code = 1; \\".into(),
        beta: 0.001,
        spp: 1024,
        model: "full */ int nor_this;".into(),
        optimiser: "adam".into(),
        method: "tabulated".into(),
        steps: 10_000,
        seed: 7,
        scenes: vec![("box".into(), "00".into()), ("rings".into(), "11".into())],
        start: 0.5,
        visits: (0..LEN as u64).map(|i| i * i % 977).collect(),
    };
    TableFile {
        table,
        provenance: Some(provenance),
    }
}

/// Runs a tool; `None`, with a message, if the machine does not have it. Where cargo is, rustc is, too.
fn tool(folder: &Path, name: &str, arguments: &[&str]) -> Option<Output> {
    let run = Command::new(name)
        .args(arguments)
        .current_dir(folder)
        .output();
    match run {
        Ok(output) => Some(output),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound && name != "rustc" => {
            eprintln!("skipped: this machine has no `{name}`");
            None
        }
        Err(e) => panic!("{name}: {e}"),
    }
}

fn succeeded(what: &str, output: &Output) {
    let say = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(
        output.status.success(),
        "{what}: {}\n{}{}",
        output.status,
        say(&output.stdout),
        say(&output.stderr)
    );
}

fn opsr(folder: &Path, arguments: &[&str]) -> Output {
    tool(folder, env!("CARGO_BIN_EXE_opsr"), arguments).unwrap()
}

#[test]
fn export_command_by_file_name_extension() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let file = table(Lookup::Nearest, 1.25);
    save(&file, &at("t.json")).unwrap();
    for (name, format) in [
        ("t.hpp", Format::C),
        ("t.slang", Format::Shader),
        ("t.rs", Format::Rust),
    ] {
        let output = opsr(folder.path(), &["table", "export", "t.json", "-o", name]);
        succeeded(name, &output);
        assert!(
            std::fs::read(at(name)).unwrap() == export(&file, format),
            "{name}"
        );
    }
    let to_pipe = ["table", "export", "t.json", "--format", "glsl", "-o", "-"];
    let output = opsr(folder.path(), &to_pipe);
    assert!(output.stdout == export(&file, Format::Shader));

    let output = opsr(
        folder.path(),
        &["table", "export", "t.json", "-o", "t.table"],
    );
    assert!(!output.status.success() && !at("t.table").exists());
    assert!(String::from_utf8_lossy(&output.stderr).contains("--format"));
    // Exit code 3 for a damaged input and 4 for a missing output folder; neither leaves a file.
    std::fs::write(at("bad.json"), "{}").unwrap();
    let output = opsr(
        folder.path(),
        &["table", "export", "bad.json", "-o", "bad.h"],
    );
    assert_eq!(output.status.code(), Some(3));
    assert!(!at("bad.h").exists());
    let output = opsr(
        folder.path(),
        &["table", "export", "t.json", "-o", "no/such.h"],
    );
    assert_eq!(output.status.code(), Some(4));
}

#[test]
fn show_command_prints_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let file = table(Lookup::Linear, 1.0);
    let visits = &file.provenance.as_ref().unwrap().visits;
    save(&file, &folder.path().join("t.json")).unwrap();
    let output = opsr(folder.path(), &["table", "show", "t.json", "--json"]);
    succeeded("show", &output);
    let shown: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(shown["lookup"], "linear");
    assert_eq!(shown["training"]["spp"], 1024);
    assert_eq!(shown["all"]["classes"], LEN);
    assert_eq!(shown["live"]["classes"], 1020);
    assert_eq!(
        shown["all"]["visited"],
        visits.iter().filter(|&&v| v > 0).count()
    );
    let class = &shown["lengths"][2]["classes"][0b10_00_11_01];
    assert_eq!(class["code"], "2 0 3 1");
    let index = GammaIndex::from_bins(&[2, 0, 3, 1]).unwrap().index();
    assert_eq!(class["index"], index);
    assert_eq!(class["visits"], visits[index]);
    assert_eq!(class["gamma"], f64::from(file.table.gammas[index]));

    let output = opsr(folder.path(), &["table", "show", "t.json", "--top", "3"]);
    succeeded("show", &output);
    let text = String::from_utf8(output.stdout).unwrap();
    let most = visits[16..80].iter().max().unwrap();
    let section = text.split("\n3 vertices\n").nth(1).unwrap();
    assert!(
        section
            .lines()
            .next()
            .unwrap()
            .contains(&format!("{most} visits"))
    );
    assert_eq!(
        section.lines().take_while(|l| l.contains("visits")).count(),
        3
    );
    assert!(text.contains("beta        0.001"));
}
