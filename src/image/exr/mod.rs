//! EXR files: a film with its statistics and further layers, and pictures read back.
//!
//! A file has one part, so every viewer finds the picture as plain `R`, `G`, `B`; layers are channels with a prefix
//! (`albedo.R`). Compression is lossless ZIP over 16 lines unless [`Storage`] says otherwise. The crop of a film is the
//! data window, its frame the display window. Metadata is one text attribute, a JSON object with sorted keys: the crate
//! `exr` would write separate attributes in random order, and the same render must give the same bytes. Standard
//! attributes are the chromaticities of Rec. 709 and, where the camera is known, `worldToCamera`.

mod read;
mod write;

use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

use super::Buffer;
use crate::files::Problem;
use crate::math::{Rgb, UVec2};

pub use read::{read_film, read_layers, read_rgb};
pub(crate) use write::{write, write_film_beside};
pub use write::{write_film, write_layers, write_rgb};

/// Name of the attribute that holds the metadata.
const METADATA: &str = "opsr";

/// Metadata key of the standard error of the mean by channel, for films whose pixels share light paths.
const MEAN_ERROR: &str = "mean_error";

/// Channels of a colour.
const RGB: [&str; 3] = ["R", "G", "B"];

/// Last names of layers that hold the main picture.
const MAIN: [&str; 3] = ["Combined", "RGBA", "beauty"];

/// Text by key, kept in the header of a file.
pub type Metadata = BTreeMap<String, String>;

/// Lossless codings of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Compression {
    /// Pixels as they are.
    None,
    /// Run lengths.
    Rle,
    /// Deflate, line by line.
    Zips,
    /// Deflate over 16 lines.
    #[default]
    Zip,
    /// Wavelets: small files of grainy pictures.
    Piz,
}

/// Storage of pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Storage {
    /// Colours, normals and coverage as half floats, clamped to ±65504; statistics, places and numbers as singles.
    pub half: bool,
    /// Coding.
    pub compression: Compression,
}

/// Everything in a file but its frame and pixels.
#[derive(Clone, Copy, Debug)]
pub struct Header<'a> {
    /// Text.
    pub metadata: &'a Metadata,
    /// Storage of pixels.
    pub storage: Storage,
    /// The standard attribute `worldToCamera`.
    pub world_to_camera: Option<[f32; 16]>,
}

impl<'a> From<&'a Metadata> for Header<'a> {
    fn from(metadata: &'a Metadata) -> Self {
        Self {
            metadata,
            storage: Storage::default(),
            world_to_camera: None,
        }
    }
}

/// Converts a read error of the crate `exr`.
fn problem(error: ::exr::error::Error) -> Problem {
    use ::exr::error::Error;
    match error {
        Error::Io(e) => Problem::Read(e),
        Error::Invalid(s) => invalid(s),
        Error::NotSupported(s) => unsupported(s),
        Error::Aborted => invalid("reading was stopped"),
    }
}

fn invalid(what: impl std::fmt::Display) -> Problem {
    Problem::content(format!("not a valid EXR file: {what}"))
}

fn unsupported(what: impl std::fmt::Display) -> Problem {
    Problem::content(format!("unsupported EXR file: {what}"))
}

/// A layer to write beside the picture: channel names without the layer's prefix, and their values.
#[derive(Clone, Debug)]
pub struct Layer {
    /// Name of the layer, such as `albedo`.
    pub name: String,
    /// Channels by name; the channel with an empty name is called like the layer.
    pub channels: Vec<(&'static str, Vec<f32>)>,
}

impl Layer {
    /// A colour: `name.R`, `name.G`, `name.B`.
    pub(crate) fn rgb(name: &str, picture: &Buffer) -> Self {
        Self::vector(name, picture, ["R", "G", "B"])
    }

    /// A direction or place: `name.X`, `name.Y`, `name.Z`.
    pub(crate) fn xyz(name: &str, picture: &Buffer) -> Self {
        Self::vector(name, picture, ["X", "Y", "Z"])
    }

    /// One value per pixel, in the channel `name`.
    pub(crate) fn scalar(name: &str, values: Vec<f32>) -> Self {
        Self {
            name: name.to_owned(),
            channels: vec![("", values)],
        }
    }

    /// Channels to write.
    pub(crate) fn channels(&self) -> impl Iterator<Item = Plane<'_>> {
        let channels = self.channels.iter();
        channels.map(|(name, values)| Plane::new(&*self.name, name, values.len(), |i| values[i]))
    }

    fn vector(name: &str, picture: &Buffer, names: [&'static str; 3]) -> Self {
        let channel = |i: usize| picture.pixels.iter().map(|p| p[i]).collect();
        Self {
            name: name.to_owned(),
            channels: names
                .into_iter()
                .enumerate()
                .map(|(i, n)| (n, channel(i)))
                .collect(),
        }
    }
}

/// Value of a channel, by the number of the pixel.
type Value<'a> = Box<dyn Fn(usize) -> f32 + Sync + 'a>;

/// A channel to write, whose values are computed while they are written.
pub(crate) struct Plane<'a> {
    pub(crate) layer: Cow<'a, str>,
    /// Name without the layer's prefix; empty for the channel that is called like the layer.
    name: &'static str,
    count: usize,
    value: Value<'a>,
}

impl<'a> Plane<'a> {
    /// A channel of `count` pixels.
    pub(crate) fn new(
        layer: impl Into<Cow<'a, str>>,
        name: &'static str,
        count: usize,
        value: impl Fn(usize) -> f32 + Sync + 'a,
    ) -> Self {
        Self {
            layer: layer.into(),
            name,
            count,
            value: Box::new(value),
        }
    }

    /// A colour: `layer.R`, `layer.G`, `layer.B`.
    pub(crate) fn colour(
        layer: impl Into<Cow<'a, str>>,
        count: usize,
        value: impl Fn(usize) -> Rgb + Copy + Sync + 'a,
    ) -> [Self; 3] {
        let layer = layer.into();
        let channel = |place| Self::new(layer.clone(), RGB[place], count, move |i| value(i)[place]);
        [0, 1, 2].map(channel)
    }
}

/// All channels of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Layers {
    /// Full frame: the display window.
    pub size: UVec2,
    /// Position of the data window in the frame; in files of other programs it may reach beyond the frame.
    pub position: (i32, i32),
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Values by full channel name, such as `R` or `albedo.R`; `width * height` each, row by row.
    pub channels: BTreeMap<String, Vec<f32>>,
    /// Text attributes by name.
    pub metadata: Metadata,
}

impl Layers {
    /// The picture in three channels, such as `["R", "G", "B"]`, or the name of the one that is missing.
    pub(crate) fn picture(&self, names: [&str; 3]) -> Result<Buffer, Problem> {
        let [r, g, b] = names.map(|n| self.channel(n));
        let (r, g, b) = (r?, g?, b?);
        Ok(Buffer {
            width: self.width,
            height: self.height,
            pixels: (0..r.len()).map(|i| Rgb::new(r[i], g[i], b[i])).collect(),
        })
    }

    /// The main picture: `R`, `G`, `B`, or a grey `Y`. If all channels are in layers, it is the layer named `Combined`
    /// (Blender), `RGBA` or `beauty` (others), or else the only colour.
    pub fn main(&self) -> Result<Buffer, Problem> {
        if self.channels.contains_key("R") {
            return self.picture(["R", "G", "B"]);
        }
        if self.channels.contains_key("Y") {
            return self.picture(["Y"; 3]);
        }
        let colours = self
            .names()
            .into_iter()
            .filter(|layer| self.has(layer, RGB));
        let colours: Vec<&str> = colours.collect();
        let is_main = |layer: &&str| {
            let last = layer.rsplit('.').next().unwrap_or_default();
            MAIN.iter().any(|name| last.eq_ignore_ascii_case(name))
        };
        let main: Vec<&str> = colours.iter().copied().filter(is_main).collect();
        match (&main[..], &colours[..]) {
            ([layer], _) | (_, [layer]) => self.vector(layer, RGB),
            ([], []) => self.picture(RGB),
            _ => Err(Problem::content(format!(
                "no main picture, but the layers {}",
                colours.join(", ")
            ))),
        }
    }

    /// The picture of a layer: its colour, its vector, or its only channel in grey. The name may omit a prefix, as in
    /// `Depth` for `ViewLayer.Depth`, if that is unambiguous.
    pub fn layer(&self, name: &str) -> Result<Buffer, Problem> {
        let suffix = format!(".{name}");
        let (names, keys) = (self.names(), self.channels.keys().map(String::as_str));
        let of_one = keys.filter(|key| !names.contains(key));
        let all: Vec<&str> = names.iter().copied().chain(of_one).collect();
        let mut found: Vec<&str> = all.iter().copied().filter(|n| *n == name).collect();
        if found.is_empty() {
            found = all
                .iter()
                .copied()
                .filter(|n| n.ends_with(&suffix))
                .collect();
        }
        let [layer] = found[..] else {
            let (what, list) = match found.len() {
                0 => ("no layer", all),
                _ => ("more than one layer", found),
            };
            let list = list.join(", ");
            return Err(Problem::content(format!(
                "{what} '{name}'; the file has {list}"
            )));
        };
        if self.channels.contains_key(layer) {
            return self.picture([layer; 3]);
        }
        let kinds = [RGB, ["X", "Y", "Z"]];
        if let Some(channels) = kinds
            .into_iter()
            .find(|channels| self.has(layer, *channels))
        {
            return self.vector(layer, channels);
        }
        let inside = |key: &&String| {
            key.rsplit_once('.')
                .is_some_and(|(front, _)| front == layer)
        };
        match self.channels.keys().filter(inside).collect::<Vec<_>>()[..] {
            [only] => self.picture([only; 3]),
            _ => Err(Problem::content(format!(
                "layer '{layer}' is neither a colour nor a vector"
            ))),
        }
    }

    /// Names of the layers: the part of a channel's name before its last point.
    fn names(&self) -> BTreeSet<&str> {
        let fronts = self.channels.keys().filter_map(|key| key.rsplit_once('.'));
        fronts.map(|(front, _)| front).collect()
    }

    fn has(&self, layer: &str, channels: [&str; 3]) -> bool {
        channels
            .iter()
            .all(|channel| self.channels.contains_key(&join(layer, channel)))
    }

    fn vector(&self, layer: &str, channels: [&str; 3]) -> Result<Buffer, Problem> {
        let names = channels.map(|channel| join(layer, channel));
        self.picture(names.each_ref().map(String::as_str))
    }

    /// One channel by its full name.
    pub(crate) fn channel(&self, name: &str) -> Result<&[f32], Problem> {
        self.channels.get(name).map(Vec::as_slice).ok_or_else(|| {
            let found: Vec<&str> = self.channels.keys().map(String::as_str).collect();
            let found = found.join(", ");
            Problem::content(format!("no channel '{name}'; the file has {found}"))
        })
    }
}

/// Full name of a channel in a layer.
fn join(layer: &str, channel: &str) -> String {
    match (layer, channel) {
        ("", name) | (name, "") => name.to_owned(),
        (layer, channel) => format!("{layer}.{channel}"),
    }
}
