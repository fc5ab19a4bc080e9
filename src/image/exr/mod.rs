//! EXR files: a film with its statistics and further layers, and pictures read back.
//!
//! A file has one part, so every viewer finds the picture as plain `R`, `G`, `B`; layers are channels with a
//! prefix (`albedo.R`). Lossless ZIP over 16 lines. The crop of a film is the data window, its frame the display
//! window. Metadata is one text attribute, a JSON object with sorted keys: separate attributes would be written in
//! the order of a randomly seeded hash map, and the same render must give the same bytes.

mod read;
mod write;

use std::collections::BTreeMap;

use super::Buffer;
use crate::files::Problem;
use crate::math::{Rgb, UVec2};

pub use read::{read_film, read_layers, read_rgb};
pub use write::{write_film, write_layers, write_rgb};

/// Pictures above this number of pixels are refused before memory is taken for them.
pub const MAX_PIXELS: usize = 1 << 28;

/// Name of the attribute that holds the metadata.
const METADATA: &str = "opsr";

/// Text by key, kept in the header of a file.
pub type Metadata = BTreeMap<String, String>;

/// A problem that the crate `exr` found while it read.
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
    /// Channels; an empty name stands for the layer itself.
    pub channels: Vec<(&'static str, Vec<f32>)>,
}

impl Layer {
    /// A colour: `name.R`, `name.G`, `name.B`.
    pub fn rgb(name: &str, picture: &Buffer) -> Self {
        Self::vector(name, picture, ["R", "G", "B"])
    }

    /// A direction or place: `name.X`, `name.Y`, `name.Z`.
    pub fn xyz(name: &str, picture: &Buffer) -> Self {
        Self::vector(name, picture, ["X", "Y", "Z"])
    }

    /// One value per pixel, in the channel `name`.
    pub fn scalar(name: &str, values: Vec<f32>) -> Self {
        Self {
            name: name.to_owned(),
            channels: vec![("", values)],
        }
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

/// All channels of a file.
#[derive(Clone, Debug)]
pub struct Layers {
    /// Full frame: the display window.
    pub size: UVec2,
    /// Position of the pixels in the frame; in files of other programs they may reach beyond it.
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
    pub fn picture(&self, names: [&str; 3]) -> Result<Buffer, Problem> {
        let [r, g, b] = names.map(|n| self.channel(n));
        let (r, g, b) = (r?, g?, b?);
        Ok(Buffer {
            width: self.width,
            height: self.height,
            pixels: (0..r.len()).map(|i| Rgb::new(r[i], g[i], b[i])).collect(),
        })
    }

    /// One channel by its full name.
    pub fn channel(&self, name: &str) -> Result<&[f32], Problem> {
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
