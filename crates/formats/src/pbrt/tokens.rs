//! Tokens of a pbrt file: directives, quoted strings, numbers and brackets, each with its line.

use opsr::scene::load::error::{Result, fault};

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    Word(String),
    Quoted(String),
    Number(f64),
    Open,
    Close,
}

/// Tokens of a text, read one after another.
pub(super) struct Tokens {
    text: Vec<u8>,
    at: usize,
    line: usize,
    /// Name of an included file; empty for the scene's own.
    name: String,
    ahead: Option<(Token, usize)>,
}

impl Tokens {
    pub(super) fn new(text: Vec<u8>, name: &str) -> Self {
        Self {
            text,
            at: 0,
            line: 1,
            name: name.to_owned(),
            ahead: None,
        }
    }

    fn place_of(&self, line: usize) -> String {
        match self.name.is_empty() {
            true => format!("line {line}"),
            false => format!("{} line {line}", self.name),
        }
    }

    /// Place of the next token.
    pub(super) fn place(&self) -> String {
        self.place_of(self.ahead.as_ref().map_or(self.line, |(_, line)| *line))
    }

    pub(super) fn peek(&mut self) -> Result<Option<&Token>> {
        if self.ahead.is_none() {
            self.ahead = self.read()?;
        }
        Ok(self.ahead.as_ref().map(|(token, _)| token))
    }

    pub(super) fn next(&mut self) -> Result<Option<Token>> {
        self.peek()?;
        Ok(self.ahead.take().map(|(token, _)| token))
    }

    fn read(&mut self) -> Result<Option<(Token, usize)>> {
        loop {
            let Some(&byte) = self.text.get(self.at) else {
                return Ok(None);
            };
            let line = self.line;
            match byte {
                b'\n' => {
                    self.line += 1;
                    self.at += 1;
                }
                // All white space, form feeds too: a word that starts with one would be empty, and so would all after
                // it.
                _ if byte.is_ascii_whitespace() => self.at += 1,
                b'#' => {
                    let rest = &self.text[self.at..];
                    self.at += rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
                }
                b'[' | b']' => {
                    self.at += 1;
                    let token = if byte == b'[' {
                        Token::Open
                    } else {
                        Token::Close
                    };
                    return Ok(Some((token, line)));
                }
                b'"' => {
                    let start = self.at + 1;
                    let end = self.text[start..]
                        .iter()
                        .position(|&b| b == b'"' || b == b'\n');
                    let end = end.map(|n| start + n).filter(|&end| self.text[end] == b'"');
                    let end =
                        end.ok_or_else(|| fault(self.place_of(line), "a string without its end"))?;
                    self.at = end + 1;
                    let text = String::from_utf8_lossy(&self.text[start..end]).into_owned();
                    return Ok(Some((Token::Quoted(text), line)));
                }
                _ => {
                    let rest = &self.text[self.at..];
                    let end = (rest.iter())
                        .position(|b| b.is_ascii_whitespace() || b"[]\"#".contains(b))
                        .unwrap_or(rest.len());
                    let word = String::from_utf8_lossy(&rest[..end]).into_owned();
                    self.at += end;
                    let numeric =
                        word.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
                    let token = match word.parse::<f64>() {
                        Ok(number) if numeric => Token::Number(number),
                        _ => Token::Word(word),
                    };
                    return Ok(Some((token, line)));
                }
            }
        }
    }

    /// A quoted string.
    pub(super) fn quoted(&mut self) -> Result<String> {
        let place = self.place();
        match self.next()? {
            Some(Token::Quoted(text)) => Ok(text),
            _ => Err(fault(place, "a quoted string should follow")),
        }
    }

    /// A fixed number of finite numbers, with brackets or without.
    pub(super) fn numbers<const N: usize>(&mut self) -> Result<[f64; N]> {
        let place = self.place();
        let bracket = self.peek()? == Some(&Token::Open);
        if bracket {
            self.next()?;
        }
        let mut out = [0.0; N];
        for x in &mut out {
            match self.next()? {
                Some(Token::Number(number)) if number.is_finite() => *x = number,
                _ => return Err(fault(place, format!("{N} numbers should follow"))),
            }
        }
        if bracket && self.next()? != Some(Token::Close) {
            return Err(fault(place, "a bracket without its end"));
        }
        Ok(out)
    }
}

/// Values of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    Texts(Vec<String>),
    Flags(Vec<bool>),
}

/// A parameter, such as `"float fov" 45`.
#[derive(Clone, Debug)]
pub(super) struct Parameter {
    pub(super) kind: String,
    pub(super) name: String,
    pub(super) values: Values,
    pub(super) place: String,
}

/// The parameters of a directive.
#[derive(Clone, Debug, Default)]
pub(super) struct Parameters {
    pub(super) list: Vec<Parameter>,
    pub(super) place: String,
}

impl Parameters {
    /// Reads the parameters up to the next directive.
    pub(super) fn read(tokens: &mut Tokens, place: String) -> Result<Self> {
        let mut list = Vec::new();
        while let Some(Token::Quoted(_)) = tokens.peek()? {
            let at = tokens.place();
            let declared = tokens.quoted()?;
            let mut words = declared.split_whitespace();
            let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
                return Err(fault(at, format!("`{declared}` is not a type and a name")));
            };
            let values = values(tokens, &at)?;
            list.push(Parameter {
                kind: kind.into(),
                name: name.into(),
                values,
                place: at,
            });
        }
        Ok(Self { list, place })
    }

    /// Names, each with its place.
    pub(super) fn names(&self) -> impl Iterator<Item = (&str, &str)> {
        self.list
            .iter()
            .map(|p| (p.name.as_str(), p.place.as_str()))
    }

    pub(super) fn get(&self, name: &str) -> Option<&Parameter> {
        self.list.iter().find(|p| p.name == name)
    }

    pub(super) fn numbers(&self, name: &str) -> Result<Option<&[f64]>> {
        match self.get(name).map(|p| &p.values) {
            None => Ok(None),
            Some(Values::Numbers(all)) => Ok(Some(all)),
            Some(_) => Err(fault(&self.place, format!("`{name}` is no number"))),
        }
    }

    pub(super) fn number(&self, name: &str, or: f64) -> Result<f64> {
        match self.numbers(name)? {
            None => Ok(or),
            Some([x]) => Ok(*x),
            Some(_) => Err(fault(&self.place, format!("`{name}` is not one number"))),
        }
    }

    pub(super) fn vector(&self, name: &str, or: [f64; 3]) -> Result<[f64; 3]> {
        match self.numbers(name)? {
            None => Ok(or),
            Some([x, y, z]) => Ok([*x, *y, *z]),
            Some(_) => Err(fault(&self.place, format!("`{name}` is not three numbers"))),
        }
    }

    pub(super) fn text(&self, name: &str) -> Result<Option<&str>> {
        match self.get(name).map(|p| &p.values) {
            None => Ok(None),
            Some(Values::Texts(all)) if all.len() == 1 => Ok(Some(&all[0])),
            Some(_) => Err(fault(&self.place, format!("`{name}` is no string"))),
        }
    }

    pub(super) fn flag(&self, name: &str, or: bool) -> Result<bool> {
        match self.get(name).map(|p| (p.kind.as_str(), &p.values)) {
            None => Ok(or),
            Some((_, Values::Flags(all))) if all.len() == 1 => Ok(all[0]),
            // The form of pbrt-v3.
            Some(("bool", Values::Texts(all))) if *all == ["true"] => Ok(true),
            Some(("bool", Values::Texts(all))) if *all == ["false"] => Ok(false),
            Some(_) => Err(fault(
                &self.place,
                format!("`{name}` is neither true nor false"),
            )),
        }
    }
}

/// The values of a parameter: a single one, or those in brackets.
pub(super) fn values(tokens: &mut Tokens, at: &str) -> Result<Values> {
    let bad = |what: &str| fault(at, what);
    let mut all = Vec::new();
    if tokens.peek()? == Some(&Token::Open) {
        tokens.next()?;
        loop {
            match tokens.next()? {
                Some(Token::Close) => break,
                Some(token) => all.push(token),
                None => return Err(bad("a bracket without its end")),
            }
        }
    } else {
        all.extend(tokens.next()?);
    }
    let numbers: Option<Vec<f64>> = (all.iter())
        .map(|token| match token {
            Token::Number(x) if x.is_finite() => Some(*x),
            _ => None,
        })
        .collect();
    if let Some(numbers) = numbers {
        return Ok(Values::Numbers(numbers));
    }
    let words: Option<Vec<String>> = (all.iter())
        .map(|token| match token {
            Token::Quoted(text) => Some(text.clone()),
            _ => None,
        })
        .collect();
    if let Some(words) = words {
        return Ok(Values::Texts(words));
    }
    let flags: Option<Vec<bool>> = (all.iter())
        .map(|token| match token {
            Token::Word(word) => word.parse().ok(),
            _ => None,
        })
        .collect();
    flags
        .map(Values::Flags)
        .ok_or_else(|| bad("values that are not of one kind, or not finite"))
}
