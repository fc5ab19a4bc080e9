//! Documents against the program: every command parses, every file and link exists, cheap examples of the README run.

use crate::support::gltf::File;
use crate::support::root;
use opsr::regularise::bin;
use opsr::regularise::{AttenuationTable, PathRoughness};
use serde_json::json;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

const OPSR: &str = env!("CARGO_BIN_EXE_opsr");

/// Documents outside of `docs`.
const DOCUMENTS: [&str; 4] = [
    "README.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "training_scenes/README.md",
];

/// Input files of the reader.
const STAND_INS: [&str; 15] = [
    "model.obj",
    "scan.ply",
    "frames/####.exr",
    "pool.ckpt",
    "left.part",
    "right.part",
    "scene.glb",
    "scene.pbrt",
    "scene.xml",
    "a.exr",
    "b.exr",
    "reference.exr",
    "results.json",
    "view.json",
    "my_scenes/manifest.toml",
];

/// Options whose value is an output file.
const OUTPUTS: [&str; 10] = [
    "--stats",
    "-o",
    "--output",
    "--out",
    "--run",
    "--json",
    "--page",
    "--maps",
    "--plots",
    "--checkpoint",
];

/// Pages of measurements, valid at the commits they state.
const LAB: &str = "docs/lab";

const SUBCOMMANDS: [&[&str]; 21] = [
    &["completions"],
    &["man"],
    &["resolve"],
    &["part"],
    &["merge"],
    &["film"],
    &["trace"],
    &["render"],
    &["view"],
    &["train"],
    &["info"],
    &["compare"],
    &["bench"],
    &["report"],
    &["verify"],
    &["verify", "render"],
    &["verify", "soak"],
    &["scenes", "write"],
    &["scenes", "reference"],
    &["table", "show"],
    &["table", "export"],
];

fn read(document: &str) -> String {
    std::fs::read_to_string(root().join(document)).unwrap_or_else(|e| panic!("{document}: {e}"))
}

/// Words of a shell line, without the comment.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for c in line.chars() {
        match quote {
            Some(end) if c == end => quote = None,
            None if c == '\'' || c == '"' => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            None if c.is_whitespace() => words.extend(word.take()),
            None if c == '#' && word.is_none() => break,
            _ => word.get_or_insert_default().push(c),
        }
    }
    words.extend(word);
    words
}

/// Lines of `sh` blocks of a document, and its inline code outside all blocks.
fn code(text: &str) -> (Vec<Vec<String>>, Vec<Vec<String>>) {
    let (mut lines, mut spans) = (Vec::new(), Vec::new());
    for (i, part) in text.split("```").enumerate() {
        if i % 2 == 0 {
            spans.extend(part.split('`').skip(1).step_by(2).map(words));
        } else if let Some(block) = part.strip_prefix("sh\n") {
            lines.extend(block.replace("\\\n", " ").lines().map(words));
        }
    }
    lines.retain(|line| !line.is_empty());
    spans.retain(|span| !span.is_empty());
    (lines, spans)
}

/// Arguments of `opsr` in a command line, or `None`.
fn opsr_arguments(line: &[String]) -> Option<&[String]> {
    let cargo = ["cargo", "run", "--release", "--"];
    match line {
        [program, arguments @ ..] if program == "opsr" => Some(arguments),
        _ if line.len() > 4 && line[..4] == cargo => Some(&line[4..]),
        _ => None,
    }
}

fn opsr<S: AsRef<std::ffi::OsStr>>(arguments: &[S], folder: &Path) -> Output {
    let mut command = Command::new(OPSR);
    command.args(arguments).current_dir(folder);
    command.output().expect("the program")
}

/// First line of the error output.
fn message(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stderr);
    text.lines().next().unwrap_or_default().to_owned()
}

/// Error of the command's own parser for `opsr` arguments.
///
/// `--help` at the end stops the program once it has parsed all earlier options. Conflicts and missing options are not
/// found; running the command finds those.
fn parse_faults(arguments: &[String]) -> Option<String> {
    let arguments: Vec<&str> = (arguments.iter().map(String::as_str))
        .chain(["--help"])
        .collect();
    let output = opsr(&arguments, root());
    (output.status.code() != Some(0)).then(|| message(&output))
}

/// Input files of `opsr` arguments.
fn inputs(arguments: &[String]) -> Vec<&str> {
    let written = |i: usize| i > 0 && OUTPUTS.contains(&arguments[i - 1].as_str());
    let words = arguments.iter().enumerate().filter(|(i, _)| !written(*i));
    words
        .map(|(_, word)| {
            word.split_once("manifest=")
                .map_or(&**word, |(_, file)| file)
        })
        .filter(|word| {
            let ending = Path::new(word).extension().and_then(|e| e.to_str());
            ending.is_some_and(|e| e.len() > 1 && e.chars().all(|c| c.is_ascii_lowercase()))
        })
        .collect()
}

fn is_there(file: &str) -> bool {
    STAND_INS.contains(&file) || root().join(file).exists()
}

/// Names of the tests that `cargo test` runs with these arguments: all of this binary, ignored ones included, and
/// without `--test` also those of the library's modules in `tests/unit`.
fn tests(of_library: bool) -> String {
    let program = std::env::current_exe().expect("this program");
    let output = Command::new(program)
        .arg("--list")
        .output()
        .expect("a list");
    let mut all = String::from_utf8(output.stdout).expect("UTF-8");
    let mut files = Vec::new();
    if of_library {
        crate::architecture::sources(&root().join("tests/unit"), &mut files);
    }
    for file in files {
        let text = std::fs::read_to_string(&file).expect("a source file");
        let module = file.with_extension("");
        let module = module.strip_prefix(root().join("tests")).expect("a module");
        let module = module.to_string_lossy().replace('/', "::");
        for item in text.split("#[test]").skip(1) {
            let name = item
                .split_once("fn ")
                .and_then(|(_, name)| name.split_once('('));
            let name = name.map_or("", |(name, _)| name);
            all += &format!("{module}::{name}: test\n");
        }
    }
    all
}

fn cargo_faults(arguments: &[String]) -> Option<String> {
    let own = arguments.split(|a| a == "--").next().unwrap_or_default();
    let value = |option: &str| {
        let place = own.iter().position(|a| a == option)?;
        own.get(place + 1)
    };
    let manifest = read("Cargo.toml") + &read("crates/cli/Cargo.toml");
    for option in ["--test", "--bench"] {
        if let Some(name) = value(option)
            && !manifest.contains(&format!("name = \"{name}\""))
        {
            return Some(format!("no {option} {name} in Cargo.toml"));
        }
    }
    let example = |name: &String| root().join(format!("examples/{name}.rs")).exists();
    if let Some(name) = value("--example").filter(|name| !example(name)) {
        return Some(format!("no examples/{name}.rs"));
    }
    if let Some(name) =
        value("--features").filter(|name| !manifest.contains(&format!("\n{name} = [")))
    {
        return Some(format!("no feature {name} in Cargo.toml"));
    }
    let is_value = |word: &&String| {
        ["-p", "--example", "--features"]
            .iter()
            .any(|o| value(o) == Some(*word))
    };
    let mut words = own.iter().skip(1).filter(|word| !is_value(word));
    let filter = words.rfind(|a| !a.starts_with('-'));
    match (own.first()?.as_str(), filter) {
        ("test", Some(filter)) if value("--test") != Some(filter) => {
            (!tests(value("--test").is_none()).contains(filter.as_str()))
                .then(|| format!("no test has `{filter}` in its name"))
        }
        ("test" | "build" | "bench" | "fmt" | "clippy", _) => None,
        ("run", _) if value("--example").is_some() => None,
        (other, _) => Some(format!("cargo {other} is not known here")),
    }
}

/// Error for a render of a reference (by its name or by a suite) without `--resolve raw`, or `None`. The default blur
/// would bias every comparison with it.
fn reference_fault(arguments: &[String], references: &[String]) -> Option<String> {
    let after = |option: &str| {
        let place = arguments.iter().position(|a| a == option)?;
        arguments.get(place + 1)
    };
    let output = after("-o").or_else(|| after("--output"))?;
    let stem = Path::new(output).file_stem().and_then(|stem| stem.to_str());
    let is_named = stem.is_some_and(|stem| {
        let mut words = stem.split(|c: char| !c.is_ascii_alphanumeric());
        words.any(|word| ["raw", "reference"].contains(&word))
    });
    let is_reference = is_named || references.contains(output);
    let is_raw = after("--resolve").is_some_and(|how| how == "raw");
    let is_render = arguments.first().is_some_and(|command| command == "render");
    (is_render && is_reference && !is_raw)
        .then(|| format!("{output} is a reference without --resolve raw"))
}

/// Error of one command line.
fn command_faults(line: &[String]) -> Option<String> {
    if let Some(arguments) = opsr_arguments(line) {
        return parse_faults(arguments).or_else(|| {
            let missing = inputs(arguments).into_iter().find(|file| !is_there(file));
            let missing = missing.map(|file| format!("{file} does not exist"));
            missing.or_else(|| reference_fault(arguments, &[]))
        });
    }
    match line {
        [cargo, arguments @ ..] if cargo == "cargo" => cargo_faults(arguments),
        [python, m, zipfile, .., folder]
            if [python, m, zipfile] == ["python3", "-m", "zipfile"] =>
        {
            (!is_there(folder)).then(|| format!("{folder} does not exist"))
        }
        [python, script, ..] if python == "python3" => {
            (!is_there(script)).then(|| format!("{script} does not exist"))
        }
        // A file that is not in the repository.
        [pip, install, wheel]
            if [pip, install] == ["pip", "install"] && wheel.ends_with(".whl") =>
        {
            None
        }
        [pip, install, package] if pip == "pip" && install == "install" => {
            let folder = package.split('[').next().unwrap_or(package);
            let file = format!("{folder}/pyproject.toml");
            (!is_there(&file)).then(|| format!("{file} does not exist"))
        }
        [python, m, pytest, folder] if [python, m, pytest] == ["python", "-m", "pytest"] => {
            (!is_there(folder)).then(|| format!("{folder} does not exist"))
        }
        [script, ..] if script.starts_with("tests/") => {
            (!is_there(script)).then(|| format!("{script} does not exist"))
        }
        _ => Some("not a command that is known here".into()),
    }
}

/// Options in the help of any subcommand, and those of cargo that documents use.
fn known_options() -> BTreeSet<String> {
    let mut known =
        BTreeSet::from(["--no-default-features", "--features", "--help"].map(str::to_owned));
    for subcommand in SUBCOMMANDS {
        let help = opsr(&[subcommand, &["--help"]].concat(), root());
        let help = String::from_utf8(help.stdout).expect("UTF-8");
        for line in help.lines() {
            let definition = line.trim_start();
            if definition.starts_with('-') {
                let names = definition.split([' ', ',', '.', '=', '[']);
                known.extend(names.filter(|n| n.starts_with("--")).map(str::to_owned));
            }
        }
    }
    known
}

/// The anchor of a heading.
fn anchor(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
    let text: String = heading.trim_start_matches('#').trim().to_lowercase();
    text.chars()
        .filter(kept)
        .collect::<String>()
        .replace(' ', "-")
}

/// Error of a relative link in a document.
fn link_fault(document: &Path, target: &str) -> Option<String> {
    if target.contains("://") {
        return None;
    }
    let (file, fragment) = target.split_once('#').unwrap_or((target, ""));
    let place: PathBuf = match file {
        "" => root().join(document),
        file => root().join(document).parent()?.join(file),
    };
    if !place.exists() {
        return Some(format!("{target} does not exist"));
    }
    let text = std::fs::read_to_string(place).unwrap_or_default();
    let mut headings = text.lines().filter(|l| l.starts_with('#'));
    (!fragment.is_empty() && !headings.any(|h| anchor(h) == fragment))
        .then(|| format!("{target}: no such heading"))
}

/// Errors of commands and options in a document.
fn code_faults(document: &str, text: &str) -> Vec<String> {
    let mut faults = Vec::new();
    let (lines, spans) = code(text);
    let is_command = |span: &Vec<String>| span.len() > 1 && ["opsr", "cargo"].contains(&&*span[0]);
    let (commands, others): (Vec<_>, Vec<_>) = spans.into_iter().partition(is_command);
    for line in lines.iter().chain(&commands) {
        faults.extend(command_faults(line).map(|fault| format!("{}: {fault}", line.join(" "))));
    }
    // The changelog may mention removed options.
    if document != "CHANGELOG.md" {
        let known = known_options();
        let options = others
            .iter()
            .flatten()
            .filter(|w| w.starts_with("--") && w.len() > 2);
        let unknown = options.filter(|option| !known.contains(*option));
        faults.extend(unknown.map(|option| format!("{option}: no command has this option")));
    }
    faults
}

/// Errors of a document. Commands in pages of the laboratory belong to old commits, and are not checked.
fn faults(document: &str, text: &str) -> Vec<String> {
    let mut faults = if document.starts_with(LAB) {
        Vec::new()
    } else {
        code_faults(document, text)
    };
    for link in text.split("](").skip(1) {
        let target = link.split(')').next().unwrap_or_default();
        faults.extend(link_fault(Path::new(document), target));
    }
    faults
}

/// Files of a folder with this ending, sorted.
fn files(folder: &str, ending: &str) -> Vec<String> {
    let entries = std::fs::read_dir(root().join(folder)).unwrap();
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().expect("UTF-8"));
    let mut files: Vec<String> = (names.filter(|name| name.ends_with(ending)))
        .map(|name| format!("{folder}/{name}"))
        .collect();
    files.sort();
    files
}

/// Markdown pages of a folder, sorted.
fn pages(folder: &str) -> Vec<String> {
    files(folder, ".md")
}

#[test]
fn documents_have_valid_commands_options_and_links() {
    let mut documents: Vec<String> = DOCUMENTS.map(str::to_owned).to_vec();
    documents.extend(pages("docs"));
    documents.extend(pages(LAB));
    let mut all = Vec::new();
    for document in &documents {
        let found = faults(document, &read(document));
        all.extend(found.iter().map(|fault| format!("{document}: {fault}")));
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
}

/// Errors of the commands at the head of a suite. Scenes that it generates need not exist.
fn suite_faults(text: &str) -> Vec<String> {
    let references: Vec<String> = (text.lines())
        .filter_map(|line| line.strip_prefix("reference = \"../")?.strip_suffix('"'))
        .map(str::to_owned)
        .collect();
    let head = text.lines().map_while(|line| line.strip_prefix('#'));
    let commands = head
        .filter_map(|line| line.strip_prefix("     "))
        .map(words);
    commands
        .filter_map(|line| {
            let arguments = opsr_arguments(&line)?;
            parse_faults(arguments).or_else(|| reference_fault(arguments, &references))
        })
        .collect()
}

#[test]
fn suites_have_valid_commands() {
    let suites = files("suites", ".toml");
    assert!(suites.len() > 10, "{suites:?}");
    let mut all = Vec::new();
    for suite in &suites {
        let text = read(suite);
        assert!(
            text.contains("\n#     opsr bench suites/"),
            "{suite}: no command"
        );
        all.extend(
            suite_faults(&text)
                .iter()
                .map(|fault| format!("{suite}: {fault}")),
        );
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
    let planted = "# A suite.\n#\n#     opsr render a.glb -o out/a.exr\n#     opsr bench x.toml --rays\n\nreference = \"../out/a.exr\"\n";
    let found = suite_faults(planted);
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(
        found[0].contains("--resolve raw") && found[1].contains("--rays"),
        "{found:?}"
    );
}

/// True if a text has a commit, as a hash or as "the commit that" did something, and a date.
fn has_commit_and_date(text: &str) -> bool {
    let is_commit = |s: &str| s.len() >= 7 && s.chars().all(|c| c.is_ascii_hexdigit());
    let commit =
        text.contains("the commit that") || text.split('`').skip(1).step_by(2).any(is_commit);
    let is_date = |word: &str| {
        let parts: Vec<&str> = word.split('-').collect();
        let digits = |s: &str| s.chars().all(|c| c.is_ascii_digit());
        matches!(parts[..], [y, m, d] if y.len() == 4 && m.len() == 2 && d.len() == 2 && [y, m, d].into_iter().all(digits))
    };
    let mut words = text.split(|c: char| !c.is_ascii_alphanumeric() && c != '-');
    commit && words.any(is_date)
}

/// A measurement without a date cannot be compared later.
#[test]
fn pages_of_the_laboratory_name_commits_and_dates_and_are_in_its_index() {
    assert!(has_commit_and_date("*Measured at `e298150`, 2026-11-23.*"));
    assert!(!has_commit_and_date("*Measured at `e298150`.*") && !has_commit_and_date("2026-11-23"));
    let index = format!("{LAB}/README.md");
    let listed = read(&index);
    let all = pages(LAB);
    assert!(all.len() > 10, "{all:?}");
    for page in all.iter().filter(|page| **page != index) {
        let name = page.rsplit('/').next().unwrap_or_default();
        assert!(
            listed.contains(&format!("]({name})")),
            "{index} does not link {name}"
        );
        assert!(
            has_commit_and_date(&read(page)),
            "{page}: no commit or no date"
        );
    }
}

#[test]
fn planted_faults_in_a_document_are_found() {
    let good = "`--spp` [x](README.md#licence)\n```sh\nopsr render scene.glb --spp 3 # --not an option\n```\n";
    assert_eq!(faults("README.md", good), Vec::<String>::new());
    for (planted, expected) in [
        ("```sh\nopsr render scene.glb --rays 3\n```", "--rays"),
        (
            "```sh\nopsr render scene.glb --set mode=reused\n```",
            "reused",
        ),
        (
            "```sh\nopsr render scene.glb --opsr-table 2\n```",
            "from 0 to 1",
        ),
        (
            "```sh\nopsr render other.glb\n```",
            "other.glb does not exist",
        ),
        ("```sh\nopsr paint scene.glb\n```", "paint"),
        (
            "```sh\ncargo test --release --test it no_such_test_name\n```",
            "no test has",
        ),
        ("```sh\ncargo bench --bench none\n```", "none in Cargo.toml"),
        (
            "```sh\ncargo run --release --example none\n```",
            "no examples/none.rs",
        ),
        ("```sh\ncargo build --features none\n```", "no feature none"),
        ("```sh\ntests/none.sh\n```", "tests/none.sh does not exist"),
        ("```sh\nmake\n```", "not a command"),
        ("see `opsr render --rays 3`", "--rays"),
        ("add `--rays 3`", "--rays: no command"),
        (
            "```sh\nopsr render scene.glb -o reference.exr\n```",
            "--resolve raw",
        ),
        ("see `opsr render scene.glb -o raw.exr`", "--resolve raw"),
        ("[x](none.md)", "none.md does not exist"),
        ("[x](README.md#none)", "no such heading"),
    ] {
        let found = faults("README.md", planted);
        assert_eq!(found.len(), 1, "{planted}: {found:?}");
        assert!(found[0].contains(expected), "{planted}: {found:?}");
    }
}

/// Arguments of a command with small sizes, and with full paths of repository files; `None` for commands that take
/// minutes even then.
fn cheap(arguments: &[String]) -> Option<Vec<String>> {
    let (remove, add): (&[&str], &[&str]) = match arguments.first()?.as_str() {
        "render" => (
            &["--spp", "--time", "--size", "--target-error"],
            &["--spp", "1", "--size", "16x16", "--progress", "none"],
        ),
        "info" | "compare" | "table" | "report" => (&[], &[]),
        "train" => (
            &["--spp", "--steps"],
            &["--spp", "2", "--steps", "1", "--progress", "none"],
        ),
        _ => return None,
    };
    let mut small = Vec::new();
    let mut words = arguments.iter();
    while let Some(word) = words.next() {
        if remove.contains(&word.as_str()) {
            words.next();
            continue;
        }
        // An output left from running the command by hand is not an input.
        let written = small.last().is_some_and(|option| option == "-o");
        let file = root().join(word);
        let known = !written && word.contains('.') && file.exists();
        small.push(if known {
            file.display().to_string()
        } else {
            word.clone()
        });
    }
    small.extend(add.iter().map(ToString::to_string));
    if small[0] == "train" {
        let manifest = root().join("training_scenes/manifest.toml");
        small.extend(["--set".into(), format!("manifest={manifest:?}")]);
    }
    Some(small)
}

/// A training scene whose camera turns in an animation.
fn animated(name: &str) -> Vec<u8> {
    let glb = std::fs::read(root().join("training_scenes").join(name)).expect(name);
    let mut file = File::from_glb(&glb);
    let nodes = file.json["nodes"].as_array().expect("nodes");
    let camera = nodes.iter().position(|node| node.get("camera").is_some());
    let node = json!({ "children": [camera] });
    let rig = file.push("nodes", node);
    if let Some(scene) = file.json["scenes"].get_mut(0) {
        scene["nodes"] = json!((0..=rig).filter(|i| Some(*i) != camera).collect::<Vec<_>>());
    }
    let times = file.floats("SCALAR", &[0.0, 2.0]);
    let places = file.floats("VEC3", &[0.0, 0.0, 0.0, 0.1, 0.0, 0.0]);
    file.push(
        "animations",
        json!({
            "samplers": [{ "input": times, "output": places }],
            "channels": [{ "sampler": 0, "target": { "node": rig, "path": "translation" } }],
        }),
    );
    file.glb()
}

#[test]
fn examples_of_the_readme_run() {
    let folder = tempfile::tempdir().expect("a folder");
    let here = |name: &str| folder.path().join(name);
    std::fs::write(here("scene.glb"), animated("cornell_glossy.glb")).unwrap();
    let suite = r#"
        baseline = "plain"
        seeds = 2
        samples = [1, 2]
        [[scene]]
        name = "box"
        builtin = "cornell-box"
        size = [16, 16]
        max_vertices = 4
        reference_spp = 4
        [[method]]
        name = "plain"
    "#;
    std::fs::write(here("suite.toml"), suite).unwrap();
    let bench = ["bench", "suite.toml", "-o", "results.json"];
    assert!(opsr(&bench, folder.path()).status.success());
    for name in ["a.exr", "b.exr", "reference.exr"] {
        let render = [
            "render",
            "scene.glb",
            "--size",
            "16x16",
            "--spp",
            "1",
            "-o",
            name,
        ];
        assert!(opsr(&render, folder.path()).status.success());
    }
    let (lines, _) = code(&read("README.md"));
    let mut run = BTreeSet::new();
    for arguments in lines.iter().filter_map(|line| opsr_arguments(line)) {
        let Some(small) = cheap(arguments) else {
            continue;
        };
        let output = opsr(&small, folder.path());
        let line = arguments.join(" ");
        assert_eq!(
            output.status.code(),
            Some(0),
            "{line}: {}",
            message(&output)
        );
        for (option, file) in arguments.iter().zip(&arguments[1..]) {
            let file = file.replace("####", "0048");
            assert!(option != "-o" || here(&file).exists(), "{line}: no {file}");
        }
        run.insert(arguments[0].clone());
    }
    let expected = ["compare", "info", "render", "report", "table", "train"];
    assert!(run.iter().eq(&expected), "{run:?}");
}

/// Rust files of a folder.
fn sources(folder: &Path, to: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, to);
        } else if path.extension().is_some_and(|e| e == "rs") {
            to.push(path);
        }
    }
}

#[test]
fn cited_sections_of_the_method_exist() {
    let method = read("docs/method.md");
    let mut files = Vec::new();
    for folder in ["src", "crates", "tests/it", "tests/unit", "tests/bench"] {
        sources(&root().join(folder), &mut files);
    }
    let mut cited = 0;
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        for (place, found) in text.match_indices("section ") {
            let before = text[..place].trim_end_matches([' ', ',', '`']);
            let number: String = text[place + found.len()..]
                .chars()
                .take_while(char::is_ascii_digit)
                .collect();
            let is_method = before.ends_with("method") || before.ends_with("method.md");
            if is_method && !number.is_empty() {
                cited += 1;
                let heading = format!("\n## {number}. ");
                assert!(
                    method.contains(&heading),
                    "{}: section {number}",
                    file.display()
                );
            }
        }
    }
    assert!(cited > 0, "nothing cites the method");
}

/// The table of look-ups in docs/renderers.md equals that of the library.
#[test]
fn look_up_vectors_of_the_document_are_the_librarys() {
    let mut table = AttenuationTable::constant(0.0);
    for (i, gamma) in table.gammas.iter_mut().enumerate() {
        *gamma = 0.05 + 0.0005 * i as f32;
    }
    let text = read("docs/renderers.md");
    let rows = text.lines().filter_map(|line| {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        (cells.len() == 7 && cells[1].parse::<u32>().is_ok()).then_some(cells)
    });
    let number = |text: &str| text.parse::<f32>().expect("a number");
    let (mut path, mut seen) = (PathRoughness::default(), 0);
    for cells in rows {
        if cells[1] == "1" {
            path = PathRoughness::default();
        }
        let alpha = number(cells[2]);
        assert_eq!(cells[3], bin(alpha).to_string(), "{cells:?}");
        let class = path.class(alpha);
        let words = class.map_or(String::new(), |class| class.index().to_string());
        assert_eq!(cells[4], words, "{cells:?}");
        if let Some(class) = class {
            assert!((table.gammas[class.index()] - number(cells[5])).abs() < 1e-6);
        }
        let accumulated = path.accumulate(alpha, &table, 1.0);
        let expected = number(cells[6]);
        assert!(
            (accumulated - expected).abs() < 1e-6,
            "{cells:?}: {accumulated}"
        );
        path.push(alpha, &table, 1.0);
        seen += 1;
    }
    assert_eq!(seen, 11);
}
