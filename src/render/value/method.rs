//! What a method is made of: tables, levels, strategies, layers.

use super::number::numbers;
use super::{Field, Range};
use crate::image::level_film::MAX_LEVELS;
use crate::integrator::bidirectional::Strategy;
use crate::integrator::layers::Aov;
use crate::integrator::levels::scales;
use crate::regularise::file::TableFile;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Learned factors: a file, a name of the program's, or a table that was read.
#[derive(Clone, Debug, PartialEq)]
pub enum TableChoice {
    /// A file, or the name of a table that the program contains.
    File(PathBuf),
    /// A table in memory.
    Held(Arc<TableFile>),
}

impl TableChoice {
    /// The table.
    pub fn load(&self) -> Result<TableFile, crate::files::FileError> {
        match self {
            Self::File(path) => Ok(TableFile::load(path)?),
            Self::Held(file) => Ok((**file).clone()),
        }
    }

    /// The file that is read; none for tables in memory and those of the program.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) if path.exists() || !TableFile::is_built_in(path) => Some(path),
            _ => None,
        }
    }
}

impl Field for TableChoice {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        PathBuf::read(value, range).map(Self::File)
    }

    fn text(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::Held(_) => "held".into(),
        }
    }

    fn python() -> String {
        "Table | Path".into()
    }
}

impl Field for Strategy {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        if value == "merges" {
            return Ok(Self::Merges);
        }
        let list = numbers(value).unwrap_or_default();
        let whole = list
            .iter()
            .all(|x| x.fract() == 0.0 && (0.0..=65538.0).contains(x));
        match *list.as_slice() {
            [s, t] if whole && t >= 1.0 && s <= 65537.0 && s + t > 1.0 => {
                let (s, t) = (s as u32, t as u32);
                Ok(Self::Connection { s, t })
            }
            _ => Err(
                "expected S,T with S from 0 and T from 1, two vertices or more, or `merges`".into(),
            ),
        }
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn python() -> String {
        "tuple[int, int] | str".into()
    }
}

/// Scales of levels; empty for one level.
#[derive(Clone, Debug, PartialEq)]
pub struct Levels(pub Vec<f32>);

impl Field for Levels {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let wrong = || format!("expected 1 to {MAX_LEVELS} levels");
        let count = match value {
            Value::Number(number) => {
                let count = number.as_u64().ok_or_else(wrong)?;
                Some(usize::try_from(count).unwrap_or(usize::MAX))
            }
            Value::String(text) => text.trim().parse::<usize>().ok(),
            _ => None,
        };
        if let Some(count) = count {
            return scales(count).map(Self).ok_or_else(wrong);
        }
        let scales = match value {
            // A text is read as single precision reads it.
            Value::String(text) => text
                .split(',')
                .map(|x| x.trim().parse().ok())
                .collect::<Option<Vec<f32>>>(),
            _ => numbers(value).map(|list| list.into_iter().map(|x| x as f32).collect()),
        };
        let scales = scales.filter(|scales| !scales.is_empty());
        scales
            .map(Self)
            .ok_or("expected a number of levels, or scales such as 0,0.25,1".into())
    }

    fn text(&self) -> String {
        match self.0.as_slice() {
            [] => "1".into(),
            scales => scales
                .iter()
                .map(f32::to_string)
                .collect::<Vec<_>>()
                .join(","),
        }
    }

    fn value(&self) -> Value {
        match self.0.as_slice() {
            [] => 1.into(),
            scales => scales.iter().map(Field::value).collect(),
        }
    }

    fn python() -> String {
        "int | Sequence[float]".into()
    }
}

/// Layers beside the picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layers(pub Vec<Aov>);

impl Layers {
    /// Layers of a render that asks for layers without naming them.
    pub const USUAL: &'static str = "albedo,normal,depth";
}

impl Field for Layers {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let names: Option<Vec<&str>> = match value {
            Value::Bool(false) => Some(Vec::new()),
            Value::Bool(true) => Some(Self::USUAL.split(',').collect()),
            Value::String(text) => Some(text.split(',').map(str::trim).collect()),
            Value::Array(list) => list.iter().map(Value::as_str).collect(),
            _ => None,
        };
        let names = names.ok_or("expected names of layers")?;
        let layers = names.into_iter().map(Aov::named);
        layers.collect::<Result<_, _>>().map(Self)
    }

    fn text(&self) -> String {
        self.0
            .iter()
            .map(|aov| aov.name())
            .collect::<Vec<_>>()
            .join(",")
    }

    fn python() -> String {
        "bool | str | Sequence[str]".into()
    }

    fn names() -> Vec<String> {
        Aov::ALL.map(Aov::name).into()
    }

    #[cfg(feature = "cli")]
    fn possible() -> Vec<clap::builder::PossibleValue> {
        super::possible::<Aov>()
    }
}
