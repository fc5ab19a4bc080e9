//! TOML with errors that quote the place.

use super::briefly;
use serde::de::DeserializeOwned;

/// The value of a TOML text, or the error with line, column and an excerpt around them.
pub fn toml<T: DeserializeOwned>(text: &str) -> Result<T, String> {
    ::toml::from_str(text).map_err(|e| {
        let message = briefly(e.message().replace('\n', ", "));
        e.span().map_or(message.clone(), |span| {
            let (place, excerpt) = excerpt(text, span.start);
            format!("{place}: {message}\n{excerpt}")
        })
    })
}

/// Line and column of a byte, and the surroundings of the place with a mark below it.
fn excerpt(text: &str, at: usize) -> (String, String) {
    const AROUND: usize = 60;
    let before = &text[..text.floor_char_boundary(at)];
    let line = before.matches('\n').count() + 1;
    let start = before.rfind('\n').map_or(0, |i| i + 1);
    let column = before[start..].chars().count();
    let from = column.saturating_sub(AROUND);
    let row = text[start..].lines().next().unwrap_or_default();
    let mut quoted: String = row
        .chars()
        .skip(from)
        .take(column - from + AROUND)
        .collect();
    let mut mark = column - from;
    if from > 0 {
        quoted.insert(0, '…');
        mark += 1;
    }
    if row.chars().count() > column + AROUND {
        quoted.push('…');
    }
    let gutter = " ".repeat(line.to_string().len());
    let excerpt = format!("{line} | {quoted}\n{gutter} | {}^", " ".repeat(mark));
    (format!("line {line}, column {}", column + 1), excerpt)
}

#[cfg(test)]
mod tests {
    /// The mark is below the place, and the excerpt is short.
    #[test]
    fn toml_errors_quote_the_place() {
        let wrong = |text: &str| super::toml::<::toml::Table>(text).unwrap_err();
        let short = wrong("a = 1\nb = many");
        assert!(short.starts_with("line 2, column 5: "), "{short}");
        assert!(short.ends_with("\n2 | b = many\n  |     ^"), "{short}");
        for (before, after) in [(0, 0), (50, 5000), (5000, 50), (5000, 5000)] {
            let text = format!(
                "a = 1\nb = [{}?{}]",
                "'ä',".repeat(before),
                " ".repeat(after) + &"1,".repeat(after)
            );
            let words = wrong(&text);
            assert!(words.len() < 600, "{words}");
            let rows: Vec<Vec<char>> = words.lines().map(|l| l.chars().collect()).collect();
            let place = rows[2].iter().position(|&c| c == '^').expect("a mark");
            assert_eq!(rows[1][place], '?', "{words}");
            assert!(rows[1].starts_with(&['2', ' ', '|', ' ']), "{words}");
            assert!(rows[1].len() <= 130 && rows[2].len() <= 130, "{words}");
            let column = 5 + 4 * before + 1;
            assert!(
                words.starts_with(&format!("line 2, column {column}: ")),
                "{words}"
            );
        }
        let long = wrong(&format!("{} = ", "k".repeat(5000)));
        assert!(long.len() < 2000, "{long}");
    }
}
