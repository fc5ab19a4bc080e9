//! Values of a method: tables, levels, strategies, layers.

use super::number::numbers;
use super::{Field, Range};
use crate::files::FileError;
use crate::image::level_film::MAX_LEVELS;
use crate::integrator::amounts::Scales;
use crate::integrator::bidirectional::Strategy;
use crate::integrator::layers::Aov;
use crate::regularise::file::TableFile;
use crate::resolve::Resolve;
use serde_json::Value;
use std::path::PathBuf;
use std::sync::Arc;

/// Attenuation factors: a file, the name of a built-in table, a loaded table, or one factor.
#[derive(Clone, Debug, PartialEq)]
pub enum TableChoice {
    /// A file, or the name of a built-in table.
    File(PathBuf),
    /// A loaded table, and its file or name, if any.
    Loaded(Arc<TableFile>, Option<PathBuf>),
    /// One factor in [0, 1] for all paths.
    Factor(f32),
}

impl TableChoice {
    /// Loads a file or built-in table once; does nothing for one factor.
    pub fn load(&mut self) -> Result<(), FileError> {
        if let Self::File(path) = self {
            *self = Self::Loaded(Arc::new(TableFile::load(path)?), Some(path.clone()));
        }
        Ok(())
    }

    /// True for a table, false for one factor.
    pub(crate) fn has_classes(&self) -> bool {
        !matches!(self, Self::Factor(_))
    }
}

impl Field for TableChoice {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        let text = value.as_str().and_then(|text| text.parse().ok());
        match value.as_f64().or(text) {
            Some(factor) if (0.0..=1.0).contains(&factor) => {
                f32::read(value, range).map(Self::Factor)
            }
            Some(_) => Err("expected a table, or a factor from 0 to 1".into()),
            None => PathBuf::read(value, range).map(Self::File),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::File(path) | Self::Loaded(_, Some(path)) => path.display().to_string(),
            Self::Loaded(_, None) => "held".into(),
            Self::Factor(factor) => factor.text(),
        }
    }

    fn value(&self) -> Value {
        match self {
            Self::Factor(factor) => factor.value(),
            _ => self.text().into(),
        }
    }

    fn python() -> String {
        "Table | Path | float".into()
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

/// Levels of a render.
#[derive(Clone, Debug, PartialEq)]
pub enum Levels {
    /// One level: the factors as they are, with blurs.
    None,
    /// Several scales of the factors, or factors on the radius of `sppm`. The settings validate them.
    At(Vec<f32>),
}

impl Field for Levels {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        if value == "none" {
            return Ok(Self::None);
        }
        let count = match value {
            Value::Number(number) => Some(number.as_f64()),
            Value::String(text) => text.trim().parse().ok().map(Some),
            _ => None,
        };
        if let Some(count) = count.flatten() {
            if count == 1.0 {
                return Err("one level is {resolve} raw, the means of all samples".into());
            }
            let whole = (count.fract() == 0.0 && count > 0.0).then_some(count as usize);
            let scales = whole.and_then(Scales::of_count);
            return scales
                .map(|scales| Self::At(scales.into()))
                .ok_or_else(|| format!("expected 2 to {MAX_LEVELS} levels"));
        }
        let scales = match value {
            // Text is parsed in single precision.
            Value::String(text) => text
                .split(',')
                .map(|x| x.trim().parse().ok())
                .collect::<Option<Vec<f32>>>(),
            _ => numbers(value).map(|list| list.into_iter().map(|x| x as f32).collect()),
        };
        let scales = scales.filter(|scales| !scales.is_empty());
        scales
            .map(Self::At)
            .ok_or("expected a number of levels, scales such as 0,0.25,1, or none".into())
    }

    fn text(&self) -> String {
        match self {
            Self::None => "none".into(),
            Self::At(scales) => {
                let scales: Vec<String> = scales.iter().map(f32::to_string).collect();
                scales.join(",")
            }
        }
    }

    fn value(&self) -> Value {
        match self {
            Self::None => "none".into(),
            Self::At(scales) => scales.iter().map(Field::value).collect(),
        }
    }

    fn python() -> String {
        "int | str | Sequence[float]".into()
    }
}

/// The picture that a render computes from its samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResolveChoice {
    /// The means of all samples, with their statistics; no film in batches is kept.
    Raw,
    /// A choice among levels and blurs.
    Film(Resolve),
}

impl Field for ResolveChoice {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        if value == "raw" {
            return Ok(Self::Raw);
        }
        let film = Resolve::read(value, range).map(Self::Film);
        film.map_err(|_| format!("expected {}", super::listed(&Self::names())))
    }

    fn text(&self) -> String {
        match self {
            Self::Raw => "raw".into(),
            Self::Film(resolve) => resolve.text(),
        }
    }

    fn python() -> String {
        let names = Self::names()
            .iter()
            .map(|name| format!("\"{name}\""))
            .collect::<Vec<_>>();
        format!("Literal[{}]", names.join(", "))
    }

    fn names() -> Vec<String> {
        let mut names = vec!["raw".to_owned()];
        names.extend(Resolve::names());
        names
    }

    #[cfg(feature = "clap")]
    fn possible() -> Vec<clap::builder::PossibleValue> {
        let raw = clap::builder::PossibleValue::new("raw");
        let help =
            "The means of all samples, with their statistics; nothing to choose from is kept";
        let mut all = vec![raw.help(help)];
        all.extend(Resolve::possible());
        all
    }
}

/// Layers beside the picture.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Layers(pub Vec<Aov>);

impl Layers {
    /// Layers of an option without a list.
    pub(crate) const USUAL: &'static str = "albedo,normal,depth";
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
        let layers = names.into_iter().map(str::parse);
        layers.collect::<Result<_, _>>().map(Self)
    }

    fn text(&self) -> String {
        self.0
            .iter()
            .map(|aov| aov.to_string())
            .collect::<Vec<_>>()
            .join(",")
    }

    fn python() -> String {
        "bool | str | Sequence[str]".into()
    }

    fn names() -> Vec<String> {
        Aov::ALL.map(|aov| aov.to_string()).into()
    }

    #[cfg(feature = "clap")]
    fn possible() -> Vec<clap::builder::PossibleValue> {
        super::possible::<Aov>()
    }
}
