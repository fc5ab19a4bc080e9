//! Values of options: read from text, Python arguments and suites; written as text that reads back as the same value.

use crate::bsdf::Distribution;
use crate::image::display::ViewTransform;
use crate::image::exr::{Compression, Storage};
use crate::integrator::method::{Connections, IntegratorKind, Mode};
use crate::regularise::Lookup;
use crate::resolve::Resolve;
use crate::sampler::SamplerKind;
use crate::scene::load::Unsupported;
use serde_json::Value;
use std::path::PathBuf;

mod frame;
mod method;
mod number;
mod range;

pub use frame::{Crop, LensChoice, Size};
pub use method::{Layers, Levels, ResolveChoice, TableChoice};
pub use number::{Moment, Sun};
pub use range::Range;

/// Type of an option's value.
pub trait Field: Sized {
    /// Parses a value; the error says what was expected.
    fn read(value: &Value, range: &Range) -> Result<Self, String>;

    /// The value as text that [`Self::read`] accepts.
    fn text(&self) -> String;

    /// The value for a file of settings.
    fn value(&self) -> Value {
        self.text().into()
    }

    /// The Python type.
    fn python() -> String;

    /// Names of the valid choices; empty if there is no list.
    fn names() -> Vec<String> {
        Vec::new()
    }

    /// The choices for a command line.
    #[cfg(feature = "clap")]
    fn possible() -> Vec<clap::builder::PossibleValue> {
        Vec::new()
    }
}

impl Field for PathBuf {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let text = value.as_str().filter(|text| !text.is_empty());
        text.map(Self::from)
            .ok_or("expected a file or a name".into())
    }

    fn text(&self) -> String {
        self.display().to_string()
    }

    fn python() -> String {
        "Path".into()
    }
}

/// An object of the scene by name, or by number from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NameOrNumber(pub String);

impl Field for NameOrNumber {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        match value {
            Value::String(name) => Ok(Self(name.clone())),
            Value::Number(number) if number.is_u64() => Ok(Self(number.to_string())),
            _ => Err("expected a name or a number, from 0".into()),
        }
    }

    fn text(&self) -> String {
        self.0.clone()
    }

    fn python() -> String {
        "str | int".into()
    }
}

/// Closed meshes that transmit without a thickness.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Glass {
    /// Solid bodies.
    Solid,
    /// Thin walls.
    Thin,
}

/// Exposure of PNG files.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// Chosen from the picture.
    #[default]
    Auto,
    /// Number of stops.
    Stops(f32),
}

impl Field for Exposure {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        if value == "auto" {
            return Ok(Self::Auto);
        }
        if value == "none" {
            return Ok(Self::Stops(0.0));
        }
        let stops = f32::read(value, &Range::FINITE).map(Self::Stops);
        stops.map_err(|_| "expected a number of stops, auto or none".into())
    }

    fn text(&self) -> String {
        match self {
            Self::Auto => "auto".into(),
            Self::Stops(stops) => stops.to_string(),
        }
    }

    fn python() -> String {
        "float | str".into()
    }
}

#[cfg(feature = "clap")]
fn possible<T: clap::ValueEnum>() -> Vec<clap::builder::PossibleValue> {
    let variants = T::value_variants().iter();
    variants
        .filter_map(clap::ValueEnum::to_possible_value)
        .collect()
}

/// A choice by its name in options: its variant in kebab case.
pub fn word(choice: &impl std::fmt::Debug) -> String {
    let mut word = String::new();
    for c in format!("{choice:?}").chars() {
        if c.is_uppercase() && !word.is_empty() {
            word.push('-');
        }
        word.extend(c.to_lowercase());
    }
    word
}

/// The choice with this name or alias.
fn choice<T: std::fmt::Debug + Copy>(
    value: &Value,
    all: &[T],
    aliases: &[(&str, T)],
) -> Result<T, String> {
    let name = value.as_str().unwrap_or_default();
    let alias = aliases
        .iter()
        .find(|(alias, _)| *alias == name)
        .map(|(_, choice)| *choice);
    let found = alias.or_else(|| all.iter().copied().find(|choice| word(choice) == name));
    found.ok_or_else(|| {
        let names: Vec<String> = all.iter().map(word).collect();
        format!("expected {}", listed(&names))
    })
}

/// Words as `a, b or c`.
pub(crate) fn listed(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [one] => one.clone(),
        [all @ .., last] => format!("{} or {last}", all.join(", ")),
    }
}

macro_rules! choices {
    ($type:ty: $($variant:ident),+) => {
        choices!($type = &[$(<$type>::$variant),+]);
    };
    ($type:ty = $all:expr $(; $alias:literal = $to:ident)?) => {
        impl Field for $type {
            fn read(value: &Value, _: &Range) -> Result<Self, String> {
                choice(value, $all, &[$(($alias, <$type>::$to))?])
            }

            fn text(&self) -> String {
                word(self)
            }

            fn python() -> String {
                let names = Self::names().iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>();
                format!("Literal[{}]", names.join(", "))
            }

            fn names() -> Vec<String> {
                $all.iter().map(word).collect()
            }

            #[cfg(feature = "clap")]
            fn possible() -> Vec<clap::builder::PossibleValue> {
                possible::<$type>()
            }
        }
    };
}

choices!(IntegratorKind = IntegratorKind::ALL; "ups" = Vcm);
choices!(Mode = &Mode::ALL);
choices!(Lookup: Nearest, Linear);
choices!(Connections: All, Nee);
choices!(Glass: Solid, Thin);
choices!(Unsupported: Error, Nearest, Skip);
choices!(SamplerKind: Independent, Sobol);
choices!(Distribution: Beckmann, Ggx);
choices!(ViewTransform: Srgb, Filmic, Agx);
choices!(Resolve: None, Sharp, Default);
choices!(Compression: None, Rle, Zips, Zip, Piz);

impl Field for Storage {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        let words = match value {
            Value::Array(list) => list.iter().map(Value::as_str).collect(),
            _ => value.as_str().map(|text| text.split(',').collect()),
        };
        let words: Vec<&str> = words.unwrap_or_default();
        let (half, codings): (Vec<&str>, Vec<&str>) =
            words.iter().partition(|word| **word == "half");
        let coding = |word: &str| Compression::read(&word.into(), range);
        let compression = match *codings.as_slice() {
            [] if half.len() == 1 => Ok(Compression::default()),
            [word] if half.len() < 2 => coding(word),
            _ => coding(""),
        };
        let wrong = |what| format!("{what}, and half alone or after it");
        Ok(Self {
            half: !half.is_empty(),
            compression: compression.map_err(wrong)?,
        })
    }

    fn text(&self) -> String {
        match (self.half, self.compression) {
            (false, compression) => compression.text(),
            (true, Compression::Zip) => "half".into(),
            (true, compression) => format!("{},half", compression.text()),
        }
    }

    fn python() -> String {
        "str".into()
    }
}
