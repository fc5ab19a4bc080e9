//! Source code: templates beside this file, filled with a table.
//!
//! A template holds `@NAME@` where something is put in, and lines `//@nearest`, `//@linear` and `//@end` around what
//! belongs to one of the look-ups only.

use crate::regularise::file::TableFile;
use crate::regularise::{BIN_EDGES, Lookup};

/// Numbers on a line.
const PER_LINE: usize = 8;

/// The template with the table in its places; `suffix` ends a number of single precision.
pub(super) fn fill(template: &str, file: &TableFile, suffix: &str) -> String {
    let table = &file.table;
    let [edge1, edge2, edge3] = BIN_EDGES.map(|edge| format!("{edge:?}"));
    select(template, table.lookup)
        .replace("@ABOUT@", &about(file))
        .replace("@SCALE@", &format!("{:?}", table.scale))
        .replace("@EDGE1@", &edge1)
        .replace("@EDGE2@", &edge2)
        .replace("@EDGE3@", &edge3)
        .replace("@GAMMAS@", &rows(table.gammas.as_slice(), suffix))
}

/// The template without the parts of the other look-up.
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

/// Comment lines that say where the code comes from.
fn about(file: &TableFile) -> String {
    let lookup = match file.table.lookup {
        Lookup::Nearest => "nearest",
        Lookup::Linear => "linear",
    };
    let digest: String = (file.digest().iter()).map(|b| format!("{b:02x}")).collect();
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

/// One line of comment, whatever the text holds: a file's words must not become code.
fn comment(text: &str) -> String {
    let plain = |c: char| match c {
        // A backslash at the end of a line would draw the next one into the comment.
        '\\' => '/',
        // Also the separators that some languages count as ends of lines, and marks that turn text around.
        c if c.is_control() || ('\u{2028}'..='\u{202e}').contains(&c) => ' ',
        c if ('\u{2066}'..='\u{2069}').contains(&c) => ' ',
        c => c,
    };
    let text: String = text.chars().map(plain).collect();
    // `??/` is a backslash to an old C compiler.
    let text = text.replace("?/", "? /");
    format!("// {}", text.trim_end())
}

/// Numbers in rows, each as the shortest text that reads back to the bit.
fn rows(numbers: &[f32], suffix: &str) -> String {
    let rows = numbers.chunks(PER_LINE).map(|row| {
        let row: Vec<String> = row.iter().map(|x| format!("{x:?}{suffix}")).collect();
        format!("    {}", row.join(", "))
    });
    // No comma after the last number: GLSL's constructor takes none.
    rows.collect::<Vec<_>>().join(",\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_a_file_stay_in_their_comment() {
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
    fn parts_of_the_other_look_up_are_left_out() {
        let template = "a\n//@nearest\nb\n//@linear\nc\n//@end\nd\n";
        assert_eq!(select(template, Lookup::Nearest), "a\nb\nd\n");
        assert_eq!(select(template, Lookup::Linear), "a\nc\nd\n");
    }
}
