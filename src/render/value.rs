//! Values of options: read from text, from Python's arguments and from a suite; written as the text that is read back.

use crate::bsdf::Distribution;
use crate::image::display::ViewTransform;
use crate::image::exr::Compression;
use crate::image::film::Window;
use crate::image::level_film::MAX_LEVELS;
use crate::integrator::bidirectional::Strategy;
use crate::integrator::layers::Aov;
use crate::integrator::levels::scales;
use crate::integrator::method::{Connections, Guide, IntegratorKind, Mode};
use crate::math::UVec2;
use crate::regularise::Lookup;
use crate::regularise::file::TableFile;
use crate::resolve::Resolve;
use crate::sampler::SamplerKind;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

/// Numbers that an option takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    least: f64,
    most: f64,
    /// False for a bound that is itself left out.
    closed: [bool; 2],
    unit: &'static str,
}

impl Range {
    /// Every finite number.
    pub const FINITE: Self = Self::from(f64::MIN, f64::MAX);
    /// Above 0.
    pub const POSITIVE: Self = Self::between(0.0, f64::MAX);
    /// Not below 0.
    pub const NOT_NEGATIVE: Self = Self::from(0.0, f64::MAX);
    /// From 0 to 1.
    pub const UNIT: Self = Self::from(0.0, 1.0);
    /// From 1 on.
    pub const COUNT: Self = Self::from(1.0, f64::MAX);

    /// Both bounds included.
    pub const fn from(least: f64, most: f64) -> Self {
        Self {
            least,
            most,
            closed: [true; 2],
            unit: "",
        }
    }

    /// Both bounds left out.
    pub const fn between(least: f64, most: f64) -> Self {
        Self {
            closed: [false; 2],
            ..Self::from(least, most)
        }
    }

    /// The upper bound included, the lower left out.
    pub const fn above(least: f64, most: f64) -> Self {
        Self {
            closed: [false, true],
            ..Self::from(least, most)
        }
    }

    /// Numbers of this unit.
    pub const fn of(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    fn holds(&self, x: f64) -> bool {
        let [low, high] = self.closed;
        let above = if low { x >= self.least } else { x > self.least };
        let below = if high { x <= self.most } else { x < self.most };
        x.is_finite() && above && below
    }

    /// The range in words, to follow "a number".
    fn words(&self) -> String {
        let Self {
            least,
            most,
            closed,
            unit,
        } = *self;
        let bounds = match (least == f64::MIN, most == f64::MAX, closed) {
            (true, ..) => String::new(),
            (_, true, [true, _]) => format!(" of at least {least}"),
            (_, true, [false, _]) => format!(" above {least}"),
            (_, _, [true, _]) => format!(" from {least} to {most}"),
            (_, _, [false, true]) => format!(" above {least} and at most {most}"),
            (_, _, [false, false]) => format!(" between {least} and {most}"),
        };
        format!("{bounds}{unit}")
    }
}

/// Type of an option's value.
pub trait Field: Sized {
    /// The value, or a message that says what was expected.
    fn read(value: &Value, range: &Range) -> Result<Self, String>;

    /// The value as it is read back from text.
    fn text(&self) -> String;

    /// The value for a file of settings.
    fn value(&self) -> Value {
        self.text().into()
    }

    /// The type in Python's words.
    fn python() -> String;

    /// Names of the choices; none where there is no list.
    fn names() -> Vec<String> {
        Vec::new()
    }

    /// The choices for a command line.
    #[cfg(feature = "cli")]
    fn possible() -> Vec<clap::builder::PossibleValue> {
        Vec::new()
    }
}

/// A finite number, also one that is written as text.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => text.trim().parse().ok(),
        _ => None,
    }
}

fn real(value: &Value, range: &Range) -> Result<f64, String> {
    let number = number(value).filter(|&x| range.holds(x));
    number.ok_or_else(|| format!("expected a number{}", range.words()))
}

fn whole(value: &Value, range: &Range, most: u64) -> Result<u64, String> {
    let whole = match value {
        Value::Number(number) => number.as_u64(),
        Value::String(text) => text.trim().parse().ok(),
        _ => None,
    };
    let known = whole.filter(|&n| n <= most && range.holds(n as f64));
    known.ok_or_else(|| {
        let Range {
            least, most: high, ..
        } = *range;
        let (least, high) = (
            least.max(0.0),
            if high == f64::MAX { most } else { high as u64 },
        );
        format!("expected a whole number from {least} to {high}")
    })
}

/// The numbers of a list, or of a text with commas.
fn numbers(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Array(list) => list
            .iter()
            .map(|x| number(x).filter(|_| x.is_number()))
            .collect(),
        Value::String(text) => text.split(',').map(|x| x.trim().parse().ok()).collect(),
        _ => None,
    }
}

impl Field for f32 {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        let wide = real(value, range)?;
        // A range holds in single precision too.
        let x = match value {
            Value::String(text) => text.trim().parse().unwrap_or(wide as Self),
            _ => wide as Self,
        };
        match range.holds(x.into()) {
            true => Ok(x),
            false => Err(format!("expected a number{}", range.words())),
        }
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn value(&self) -> Value {
        // As short as it is written.
        self.to_string()
            .parse::<f64>()
            .unwrap_or((*self).into())
            .into()
    }

    fn python() -> String {
        "float".into()
    }
}

impl Field for f64 {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        real(value, range)
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn value(&self) -> Value {
        (*self).into()
    }

    fn python() -> String {
        "float".into()
    }
}

impl Field for u32 {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        Ok(whole(value, range, Self::MAX.into())? as Self)
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn value(&self) -> Value {
        (*self).into()
    }

    fn python() -> String {
        "int".into()
    }
}

impl Field for u64 {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        whole(value, range, Self::MAX)
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn value(&self) -> Value {
        (*self).into()
    }

    fn python() -> String {
        "int".into()
    }
}

impl Field for bool {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        match value {
            Value::Bool(is) => Ok(*is),
            Value::String(text) if text == "true" => Ok(true),
            Value::String(text) if text == "false" => Ok(false),
            _ => Err("expected true or false".into()),
        }
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn value(&self) -> Value {
        (*self).into()
    }

    fn python() -> String {
        "bool".into()
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

/// A thing of the scene by name, or by number from 0.
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

/// A time in seconds, or with its unit, such as `60s` or `5min`.
impl Field for Duration {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        #[cfg(feature = "cli")]
        if let Value::String(text) = value {
            let expected = "expected a number of seconds, or a time such as 60s or 5min";
            return humantime::parse_duration(text).map_err(|e| format!("{expected}: {e}"));
        }
        let seconds = number(value).and_then(|s| Self::try_from_secs_f64(s).ok());
        seconds.ok_or("expected a number of seconds, not below 0".into())
    }

    fn text(&self) -> String {
        format!("{}ns", self.as_nanos())
    }

    fn value(&self) -> Value {
        self.as_secs_f64().into()
    }

    fn python() -> String {
        "float".into()
    }
}

/// Height of the sun above the horizon and its angle to the right of the front, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun(pub [f32; 2]);

impl Field for Sun {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let list = numbers(value).or_else(|| number(value).map(|height| vec![height]));
        let sun = match list.as_deref() {
            Some(&[height]) => Some([height, -40.0]),
            Some(&[height, angle]) => Some([height, angle]),
            _ => None,
        };
        let known = |[height, angle]: &[f64; 2]| {
            (0.0..=90.0).contains(height) && angle.is_finite() && (*angle as f32).is_finite()
        };
        let sun = sun.filter(known).map(|sun| Self(sun.map(|x| x as f32)));
        sun.ok_or("expected a height from 0 to 90, and an angle".into())
    }

    fn text(&self) -> String {
        let [height, angle] = self.0;
        format!("{height},{angle}")
    }

    fn python() -> String {
        "tuple[float, float]".into()
    }
}

/// A share such as `25%`, `0.25` or `1/4`; a number without a point is none.
fn share(text: &str) -> Option<f64> {
    let text = text.trim();
    let number = |x: &str| x.trim().parse::<f64>().ok();
    let share = if let Some(percent) = text.strip_suffix('%') {
        number(percent)? / 100.0
    } else if let Some((a, b)) = text.split_once('/') {
        number(a)? / number(b)?
    } else {
        number(text).filter(|_| text.contains('.'))?
    };
    (share.is_finite() && share >= 0.0).then_some(share)
}

/// Size of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Size {
    /// Columns and rows.
    Pixels(UVec2),
    /// Share of the size that the picture has without being asked for one.
    Share(f64),
}

impl Size {
    /// The size, where the picture has `whole` without being asked for one.
    pub fn of(self, whole: UVec2) -> UVec2 {
        let scaled =
            |share: f64, side: u32| ((share * f64::from(side)).round() as u32).clamp(1, 65536);
        match self {
            Self::Pixels(size) => size,
            Self::Share(share) => UVec2::new(scaled(share, whole.x), scaled(share, whole.y)),
        }
    }
}

impl Field for Size {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let side = |x: f64| (x.fract() == 0.0 && (1.0..=65536.0).contains(&x)).then_some(x as u32);
        let size = match value {
            Value::String(text) => {
                let pixels = text
                    .split_once('x')
                    .and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
                match share(text).filter(|s| *s > 0.0) {
                    Some(share) => return Ok(Self::Share(share)),
                    None => pixels,
                }
            }
            list => numbers(list).and_then(|list| match *list.as_slice() {
                [w, h] => Some((w, h)),
                _ => None,
            }),
        };
        let size = size.and_then(|(w, h)| Some(UVec2::new(side(w)?, side(h)?)));
        size.map(Self::Pixels).ok_or(
            "expected WIDTHxHEIGHT, such as 640x480, from 1 to 65536 each, or a share such as 50%"
                .into(),
        )
    }

    fn text(&self) -> String {
        match self {
            Self::Pixels(size) => format!("{}x{}", size.x, size.y),
            Self::Share(share) => format!("{}%", 100.0 * share),
        }
    }

    fn python() -> String {
        "tuple[int, int] | str".into()
    }
}

/// A length along one side of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Length {
    Pixels(u32),
    Share(f64),
}

impl Length {
    fn of(self, side: u32) -> f64 {
        match self {
            Self::Pixels(n) => f64::from(n),
            Self::Share(share) => share * f64::from(side),
        }
    }
}

/// A part of a picture: column, row, width, height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop([Length; 4]);

impl Crop {
    /// These pixels.
    pub fn pixels(x: u32, y: u32, w: u32, h: u32) -> Self {
        Self([x, y, w, h].map(Length::Pixels))
    }

    /// The part of a picture of this size. Edges are rounded, so that shares that meet make parts that meet.
    pub fn of(&self, size: UVec2) -> Window {
        let [x, y, w, h] = self.0;
        let edges = |at: Length, length: Length, side: u32| {
            let start = at.of(side);
            let end = (start + length.of(side)).round();
            let start = start.round();
            (start as u32, (end - start) as u32)
        };
        let ((x, w), (y, h)) = (edges(x, w, size.x), edges(y, h, size.y));
        Window { x, y, w, h }
    }
}

impl Field for Crop {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let length = |text: &str| {
            let pixels = text.trim().parse().ok().map(Length::Pixels);
            pixels.or_else(|| share(text).map(Length::Share))
        };
        let pixels = |x: &Value| {
            x.as_u64()
                .and_then(|x| u32::try_from(x).ok())
                .map(Length::Pixels)
        };
        let lengths: Option<Vec<Length>> = match value {
            Value::String(text) => text.split(',').map(length).collect(),
            Value::Array(list) => list.iter().map(pixels).collect(),
            _ => None,
        };
        match lengths.as_deref() {
            Some(&[x, y, w, h]) => Ok(Self([x, y, w, h])),
            _ => Err(
                "expected X,Y,WIDTH,HEIGHT from the top left, in pixels or as shares such as 25%"
                    .into(),
            ),
        }
    }

    fn text(&self) -> String {
        let length = |length: &Length| match length {
            Length::Pixels(n) => n.to_string(),
            Length::Share(share) => format!("{}%", 100.0 * share),
        };
        self.0.iter().map(length).collect::<Vec<_>>().join(",")
    }

    fn python() -> String {
        "tuple[int, int, int, int] | str".into()
    }
}

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
        possible::<Aov>()
    }
}

/// Exposure of PNG files.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// The one that suits the picture.
    #[default]
    Auto,
    /// A number of stops.
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

#[cfg(feature = "cli")]
fn possible<T: clap::ValueEnum>() -> Vec<clap::builder::PossibleValue> {
    let variants = T::value_variants().iter();
    variants
        .filter_map(clap::ValueEnum::to_possible_value)
        .collect()
}

/// A choice by the name that options have for it: that of its variant in kebab case.
pub(crate) fn word(choice: &impl std::fmt::Debug) -> String {
    let mut word = String::new();
    for c in format!("{choice:?}").chars() {
        if c.is_uppercase() && !word.is_empty() {
            word.push('-');
        }
        word.extend(c.to_lowercase());
    }
    word
}

/// The choice of a name among these.
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
    ($type:ty: $($variant:ident),+ $(; $($alias:literal = $to:ident),+)?) => {
        impl Field for $type {
            fn read(value: &Value, _: &Range) -> Result<Self, String> {
                choice(value, &[$(<$type>::$variant),+], &[$($(($alias, <$type>::$to)),+)?])
            }

            fn text(&self) -> String {
                word(self)
            }

            fn python() -> String {
                let names = Self::names().iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>();
                format!("Literal[{}]", names.join(", "))
            }

            fn names() -> Vec<String> {
                [$(<$type>::$variant),+].iter().map(word).collect()
            }

            #[cfg(feature = "cli")]
            fn possible() -> Vec<clap::builder::PossibleValue> {
                possible::<$type>()
            }
        }
    };
}

choices!(IntegratorKind: Path, Light, Bdpt, Vcm, Sppm, Mlt, Auto; "ups" = Vcm);
choices!(Mode: Default, Reuse, Pbrt, FilterGlossy, RoughnessClamp, Mollifier);
choices!(Lookup: Nearest, Linear);
choices!(Connections: All, Nee);
choices!(Guide: Picture, Unbiased);
choices!(SamplerKind: Independent, Sobol);
choices!(Distribution: Beckmann, Ggx);
choices!(ViewTransform: Srgb, Filmic, Agx);
choices!(Resolve: None, Sharp, Default, Smooth);
choices!(Compression: None, Rle, Zips, Zip, Piz);

#[cfg(test)]
mod tests {
    use super::*;

    fn read<T: Field>(text: &str) -> Result<T, String> {
        T::read(&text.into(), &Range::FINITE)
    }

    #[test]
    fn crop_shares_tile_the_frame() {
        let frame = UVec2::new(101, 67);
        let of = |text: &str| read::<Crop>(text).unwrap().of(frame);
        assert_eq!(of("0,0,100%,1.0"), Window::full(frame));
        let thirds = ["0%", "1/3", "2/3"].map(|x| of(&format!("{x},0,1/3,67")));
        assert_eq!(thirds.iter().map(|w| w.w).sum::<u32>(), 101);
        assert!(thirds.windows(2).all(|w| w[0].x + w[0].w == w[1].x));
        assert_eq!(
            of("10,20,32,32"),
            Window {
                x: 10,
                y: 20,
                w: 32,
                h: 32
            }
        );
        for bad in ["1,2,3", "a,0,1,1", "-1%,0,1,1", "1/0,0,1,1", "0,0,inf%,1"] {
            assert!(read::<Crop>(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn size_in_pixels_or_as_a_share() {
        assert_eq!(read("640x480"), Ok(Size::Pixels(UVec2::new(640, 480))));
        let list = serde_json::json!([640, 480]);
        assert_eq!(Size::read(&list, &Range::FINITE), read("640x480"));
        for half in ["50%", "1/2", "0.5"] {
            assert_eq!(read(half), Ok(Size::Share(0.5)));
        }
        for bad in ["0x5", "2", "0%", "640", "-50%", "x", "70000x1"] {
            assert!(read::<Size>(bad).is_err(), "{bad}");
        }
    }

    /// Bounds that are left out, in single precision too; and no truth value is a number.
    #[test]
    fn ranges_of_numbers_hold() {
        let share = Range::above(0.0, 1.0);
        for (value, right) in [(1.0, true), (0.0, false), (1e-60, false), (1.1, false)] {
            assert_eq!(f32::read(&value.into(), &share).is_ok(), right, "{value}");
        }
        assert!(f32::read(&true.into(), &share).is_err());
        assert!(Levels::read(&true.into(), &share).is_err());
        assert!(Levels::read(&serde_json::json!([]), &share).is_err());
        let negative = u64::read(&(-1).into(), &Range::FINITE);
        assert_eq!(
            negative.unwrap_err(),
            format!("expected a whole number from 0 to {}", u64::MAX)
        );
    }
}
