//! Errors of a render. Messages name options as the user gave them.

use super::spec::Opt;
use crate::files::FileError;
use crate::image::denoise::DenoiseError;
use crate::memory::Shortage;
use std::fmt;

/// Style in which messages name options.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Names {
    /// `--opsr-table`.
    Flags,
    /// `table`, as in Python keywords and suite keys.
    Keys,
}

/// An error before or during a render. In texts, `{name}` stands for the option of that name.
#[derive(Debug)]
pub enum Fault {
    /// An option that is invalid, alone or in combination.
    Option {
        /// Name of the option.
        name: &'static str,
        /// The reason.
        why: String,
    },
    /// An invalid combination of options.
    Usage(String),
    /// A file that cannot be read or written, or has invalid content.
    File(FileError),
    /// An input that is not a file, or a file with a further explanation.
    Input(String),
    /// An output that cannot be written.
    Output(String),
    /// Too little memory, and a hint at what would need less.
    Memory(Shortage, &'static str),
}

impl Fault {
    /// A fault of this option.
    pub fn option(name: &'static str, why: impl fmt::Display) -> Self {
        let why = why.to_string();
        Self::Option { name, why }
    }

    /// A fault of the options.
    pub fn usage(what: impl fmt::Display) -> Self {
        Self::Usage(what.to_string())
    }

    /// For an option's fault the reason without the option's name, else the message; with options in this style.
    pub fn reason(&self, names: Names) -> String {
        match self {
            Self::Option { why, .. } => spelt(why, names),
            _ => self.message(names),
        }
    }

    /// The message, with options in this style.
    pub fn message(&self, names: Names) -> String {
        match self {
            Self::Option { name, why } => match names {
                // Suites and Python give the argument's name first.
                Names::Keys => format!("{name}: {}", spelt(why, names)),
                Names::Flags => format!(
                    "{}: {}",
                    spelt(&format!("{{{name}}}"), names),
                    spelt(why, names)
                ),
            },
            Self::Usage(what) | Self::Input(what) | Self::Output(what) => spelt(what, names),
            Self::File(error) => error.to_string(),
            Self::Memory(shortage, hint) => format!("{shortage}; {}", spelt(hint, names)),
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message(Names::Keys))
    }
}

impl std::error::Error for Fault {}

impl From<FileError> for Fault {
    fn from(error: FileError) -> Self {
        Self::File(error)
    }
}

impl From<DenoiseError> for Fault {
    fn from(error: DenoiseError) -> Self {
        Self::Input(format!("{{denoise}}: {error}"))
    }
}

/// A text with every `{name}` of an option replaced.
fn spelt(text: &str, names: Names) -> String {
    let mut spelt = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('{') {
        spelt += before;
        rest = after;
        match after.split_once('}') {
            Some((name, after)) if is_name(name) => {
                spelt += &match names {
                    Names::Flags => {
                        let flag = Opt::named(name).map(Opt::flag);
                        format!("--{}", flag.unwrap_or_else(|| name.replace('_', "-")))
                    }
                    Names::Keys => name.to_owned(),
                };
                rest = after;
            }
            _ => spelt.push('{'),
        }
    }
    spelt + rest
}

fn is_name(text: &str) -> bool {
    !text.is_empty() && text.chars().all(|c| c.is_ascii_lowercase() || c == '_')
}
