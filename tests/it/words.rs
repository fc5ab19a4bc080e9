//! English of documents and comments: openings of doc comments, length of sentences, length of the README.

use crate::support::root;
use std::path::{Path, PathBuf};

/// Folders of Rust sources.
const SOURCES: [&str; 4] = ["src", "crates", "table/src", "python/src"];

/// Pages of theory and numerics, exempt from the rules for the other pages of `docs`.
const THEORY: [&str; 2] = ["method.md", "numerics.md"];

/// A doc comment begins with a noun or a verb, not with a relative clause.
const OPENINGS: [&str; 5] = ["What", "Whether", "How", "Of", "Those"];

/// Phrases with a plainer equivalent, in comments and on pages for users: a number of, except, slow, after.
const DIALECT: [&str; 7] = [
    "so many",
    "as far as",
    "but for",
    "dear",
    "dearer",
    "hears",
    "what all else",
];

/// Longest sentence, in words.
const LONGEST: usize = 30;

/// Longest README, in words with marks of tables and code.
const README: usize = 1200;

fn files(folder: &Path, ending: &str, to: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            files(&path, ending, to);
        } else if path.extension().is_some_and(|e| e == ending) {
            to.push(path);
        }
    }
}

/// Lines of doc comments that begin with one of [`OPENINGS`].
fn bad_openings(text: &str) -> Vec<String> {
    let comment = |line: &str| {
        let line = line.trim_start();
        let inner = line.strip_prefix("///").or(line.strip_prefix("//!"))?;
        Some(inner.trim().to_owned())
    };
    text.lines()
        .filter_map(comment)
        .filter(|line| {
            OPENINGS
                .iter()
                .any(|&word| line.split(' ').next() == Some(word))
        })
        .collect()
}

/// Phrases of [`DIALECT`] in a text, as whole words.
fn dialect(text: &str) -> Vec<&'static str> {
    let words: Vec<&str> = text
        .split(|c: char| !c.is_alphanumeric() && c != '_')
        .filter(|word| !word.is_empty())
        .collect();
    let spoken = |phrase: &&str| {
        let phrase: Vec<&str> = phrase.split(' ').collect();
        words.windows(phrase.len()).any(|w| w == phrase)
    };
    DIALECT.iter().copied().filter(spoken).collect()
}

/// Text of the comments of a source, line by line.
fn comments(text: &str) -> String {
    let after = |line: &str| line.trim_start().strip_prefix("//").map(str::to_owned);
    text.lines().filter_map(after).collect::<Vec<_>>().join(" ")
}

/// Sentences of the prose of a Markdown text, without code blocks, tables and headings.
fn sentences(text: &str) -> Vec<String> {
    let (mut sentences, mut sentence) = (Vec::new(), Vec::new());
    let prose: String = text.split("```").step_by(2).collect();
    for line in prose.lines().map(str::trim) {
        let item = line.starts_with("- ")
            || line.starts_with(|c: char| c.is_ascii_digit()) && line.contains(". ");
        if item || line.is_empty() || line.starts_with(['|', '#']) {
            sentences.push(std::mem::take(&mut sentence));
        }
        if line.starts_with(['|', '#']) {
            continue;
        }
        for word in line.split_whitespace().filter(|&word| word != "-") {
            sentence.push(word);
            if word
                .trim_end_matches([')', '*'])
                .ends_with(['.', '!', '?', ':'])
            {
                sentences.push(std::mem::take(&mut sentence));
            }
        }
    }
    sentences.push(sentence);
    sentences.retain(|words| !words.is_empty());
    sentences.iter().map(|words| words.join(" ")).collect()
}

fn too_long(text: &str) -> Vec<String> {
    let mut long = sentences(text);
    long.retain(|sentence| sentence.split(' ').count() > LONGEST);
    long
}

#[test]
fn comments_are_plain_and_open_with_nouns_and_verbs() {
    let mut sources = Vec::new();
    for folder in SOURCES {
        files(&root().join(folder), "rs", &mut sources);
    }
    assert!(sources.len() > 200, "{} sources", sources.len());
    let mut faults = Vec::new();
    for path in sources {
        let text = std::fs::read_to_string(&path).expect("a source");
        let found = bad_openings(&text).into_iter();
        faults.extend(found.map(|line| format!("{}: {line}", path.display())));
        let found = dialect(&comments(&text)).into_iter();
        faults.extend(found.map(|phrase| format!("{}: \"{phrase}\"", path.display())));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn sentences_for_users_are_plain_and_short() {
    let mut pages = vec![root().join("README.md")];
    for entry in std::fs::read_dir(root().join("docs")).expect("docs") {
        let path = entry.expect("an entry").path();
        let theory = THEORY.iter().any(|&name| path.ends_with(name));
        if path.extension().is_some_and(|e| e == "md") && !theory {
            pages.push(path);
        }
    }
    assert!(pages.len() > 10);
    let mut faults = Vec::new();
    for path in pages {
        let text = std::fs::read_to_string(&path).expect("a page");
        let found = too_long(&text).into_iter();
        faults.extend(found.map(|sentence| format!("{}: {sentence}", path.display())));
        let found = dialect(&sentences(&text).join(" ")).into_iter();
        faults.extend(found.map(|phrase| format!("{}: \"{phrase}\"", path.display())));
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn readme_is_short() {
    let text = std::fs::read_to_string(root().join("README.md")).expect("README.md");
    let words = text.split_whitespace().count();
    assert!(words <= README, "{words} words, at most {README}");
}

#[test]
fn planted_words_are_found() {
    assert_eq!(
        bad_openings("    /// What a film is.\nfn f() {}\n//! Whatever.\n"),
        ["What a film is."]
    );
    assert_eq!(
        dialect(&comments("let dear = 1;\n// Of so\n// many, so dearly.\n")),
        ["so many"]
    );
    let long = "word ".repeat(LONGEST) + "end.";
    let text = format!(
        "# {long}\n\nShort one. {long} Another.\n```sh\n{long}\n```\n- An item: {long}\n| {long} |\n"
    );
    assert_eq!(too_long(&text).len(), 2);
    assert_eq!(
        sentences("One two.\nThree (four.) Five"),
        ["One two.", "Three (four.)", "Five"]
    );
}
