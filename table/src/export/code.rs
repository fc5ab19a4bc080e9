//! Source code for other renderers, from the templates beside this file.
//!
//! A template contains placeholders `@NAME@`, and lines `//@nearest`, `//@linear` and `//@end` around the parts that
//! belong to one look-up only.

use crate::TableFile;
use crate::{BIN_EDGES, Lookup};

/// Number of factors on a line.
const PER_LINE: usize = 8;

/// Fills a template with a table; `suffix` marks a number as single precision.
pub(super) fn fill(template: &str, file: &TableFile, suffix: &str) -> String {
    let table = &file.table;
    let [edge1, edge2, edge3] = BIN_EDGES.map(|edge| format!("{edge:?}"));
    select(template, table.lookup)
        .replace("@SCALE@", &format!("{:?}", table.scale))
        .replace("@EDGE1@", &edge1)
        .replace("@EDGE2@", &edge2)
        .replace("@EDGE3@", &edge3)
        .replace("@GAMMAS@", &rows(table.gammas.as_slice(), suffix))
        // Last, since text of the table file may look like a placeholder.
        .replace("@ABOUT@", &about(file))
}

/// Removes the parts of the other look-up from a template.
fn select(template: &str, lookup: Lookup) -> String {
    let mut part = None;
    let mut out = String::new();
    for line in template.lines() {
        match line.strip_prefix("//@") {
            Some("nearest") => part = Some(Lookup::Nearest),
            Some("linear") => part = Some(Lookup::Linear),
            Some(_) => part = None,
            None if part.is_none_or(|p| p == lookup) => {
                out.push_str(line);
                out.push('\n');
            }
            None => {}
        }
    }
    out
}

/// Comment lines with the origin of the code.
fn about(file: &TableFile) -> String {
    let lookup = match file.table.lookup {
        Lookup::Nearest => "nearest",
        Lookup::Linear => "linear",
    };
    let digest: String = (file.digest().iter())
        .map(|byte| format!("{byte:02x}"))
        .collect();
    let mut lines = vec![
        format!("Written by opsr {}.", env!("CARGO_PKG_VERSION")),
        format!("Table: look-up {lookup}, SHA-256 {digest}."),
    ];
    match &file.provenance {
        None => lines.push("Learned: no, made by hand.".into()),
        Some(p) => {
            let scenes: Vec<&str> = p.scenes.iter().map(|(name, _)| name.as_str()).collect();
            lines.push(format!(
                "Learned: beta {}, {} samples per pixel, {} steps, model {}, seed {}, opsr {}.",
                p.beta, p.spp, p.steps, p.model, p.seed, p.opsr
            ));
            lines.push(format!("Loss: {}.", p.loss));
            lines.push(format!("Scenes: {}.", scenes.join(", ")));
        }
    }
    let lines: Vec<String> = lines.iter().map(|l| comment(l)).collect();
    lines.join("\n") + "\n//"
}

/// Makes one comment line of any text: text from a table file must not become code.
fn comment(text: &str) -> String {
    let plain = |c: char| match c {
        // A backslash at the end of a line continues the comment on the next one.
        '\\' => '/',
        // Control characters, the Unicode line separators, and the marks that reverse the direction of text.
        c if c.is_control() || ('\u{2028}'..='\u{202e}').contains(&c) => ' ',
        c if ('\u{2066}'..='\u{2069}').contains(&c) => ' ',
        c => c,
    };
    let text: String = text.chars().map(plain).collect();
    // `??/` is the trigraph of a backslash.
    let text = text.replace("?/", "? /");
    format!("// {}", text.trim_end())
}

/// Formats numbers in rows, each as the shortest decimal that reads back bit-identical.
fn rows(numbers: &[f32], suffix: &str) -> String {
    let rows = numbers.chunks(PER_LINE).map(|row| {
        let row: Vec<String> = row.iter().map(|x| format!("{x:?}{suffix}")).collect();
        format!("    {}", row.join(", "))
    });
    // No comma after the last number: GLSL's array constructor forbids it.
    rows.collect::<Vec<_>>().join(",\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LEN;
    use std::path::Path;

    #[test]
    fn text_of_a_table_file_stays_in_its_comment() {
        for text in [
            "loss\nint x;",
            "ends in \\",
            "a??/",
            "a???/",
            "a??\\",
            "\u{2028}x",
            "\u{202e}x",
            "\r\u{b}\u{c}\u{85}x",
        ] {
            let line = comment(text);
            assert!(line.starts_with("// "), "{line:?}");
            assert!(!line.chars().any(char::is_control), "{line:?}");
            let bad = ["\\", "??/", "\u{2028}", "\u{202e}"];
            assert!(!bad.iter().any(|b| line.contains(b)), "{line:?}");
        }
    }

    #[test]
    fn placeholders_in_a_table_file_stay_as_they_are() {
        let name = Path::new("beta-0.001");
        let mut file = TableFile::load(name).expect("a built-in table");
        let provenance = file.provenance.as_mut().expect("it was learned");
        provenance.loss = "see @GAMMAS@, @SCALE@ and @ABOUT@".into();
        let code = fill("@ABOUT@\nfactors: @GAMMAS@;\n", &file, "f");
        let numbers = |line: &str| line.matches("f,").count();
        let comments = code.lines().filter(|line| line.starts_with("//"));
        assert!(comments.clone().any(|line| line.contains("see @GAMMAS@")));
        assert_eq!(comments.map(numbers).sum::<usize>(), 0);
        // The last number has no comma.
        assert_eq!(code.lines().map(numbers).sum::<usize>(), LEN - 1);
    }

    #[test]
    fn select_removes_the_other_lookup() {
        let template = "a\n//@nearest\nb\n//@linear\nc\n//@end\nd\n";
        assert_eq!(select(template, Lookup::Nearest), "a\nb\nd\n");
        assert_eq!(select(template, Lookup::Linear), "a\nc\nd\n");
    }
}
