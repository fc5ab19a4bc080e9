//! Layers that a render can add to its EXR files, by name.

use super::aov::{Centres, Recorded};
use super::{Picture, View};
use crate::image::Buffer;
use crate::image::exr::Layer;
use std::fmt;
use std::str::FromStr;

/// A layer, or channels, that a render can add to its EXR files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Aov {
    /// Mean reflectance of the first surface.
    Albedo,
    /// Mean world normal of the first surface.
    Normal,
    /// Mean distance to the first surface; infinity where there is none.
    Depth,
    /// Channel A: share of the camera rays that meet a surface.
    Alpha,
    /// World position of the surface at the centre of the pixel.
    Position,
    /// Numbers of mesh and material at the centre of the pixel, from 1.
    Id,
    /// Light straight from emitters and the environment.
    Emission,
    /// Light scattered once.
    Direct,
    /// Light scattered more often.
    Indirect,
    /// Level of roughening that was chosen; a render of several levels adds it anyhow.
    Level,
    /// Every level, as layers level0, level1 and so on.
    EachLevel,
    /// Seconds spent on the paths of the pixel.
    Time,
    /// Pixels to the place of the surface in the last frame of a film and in the next.
    Motion,
}

/// Its name in options.
impl fmt::Display for Aov {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::EachLevel => f.write_str("each-level"),
            _ => f.write_str(&format!("{self:?}").to_lowercase()),
        }
    }
}

impl FromStr for Aov {
    type Err = String;

    /// The layer with this name; an error that lists all.
    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|aov| aov.to_string() == name);
        found.ok_or_else(|| {
            let known = Self::ALL.map(|aov| aov.to_string()).join(", ");
            format!("no layer `{name}`: there are {known}")
        })
    }
}

impl Aov {
    /// All of them.
    pub(crate) const ALL: [Self; 13] = [
        Self::Albedo,
        Self::Normal,
        Self::Depth,
        Self::Alpha,
        Self::Position,
        Self::Id,
        Self::Emission,
        Self::Direct,
        Self::Indirect,
        Self::Level,
        Self::EachLevel,
        Self::Time,
        Self::Motion,
    ];

    /// Parts of the AOVs that these layers need.
    pub(crate) fn recorded(wanted: &[Self]) -> Recorded {
        let any = |of: &[Self]| of.iter().any(|aov| wanted.contains(aov));
        Recorded {
            first: any(&[Self::Albedo, Self::Normal, Self::Depth, Self::Alpha]),
            light: any(&[Self::Emission, Self::Direct, Self::Indirect]),
            time: any(&[Self::Time]),
        }
    }
}

/// Layers that a render adds.
pub(crate) struct Layers<'a> {
    wanted: &'a [Aov],
    centres: Option<Centres>,
}

impl<'a> Layers<'a> {
    /// Traces the centres of pixels, if they are wanted.
    pub(crate) fn new(wanted: &'a [Aov], view: &View<'_>) -> Self {
        let centres = wanted.contains(&Aov::Position) || wanted.contains(&Aov::Id);
        Self {
            wanted,
            centres: centres.then(|| Centres::of(view)),
        }
    }

    /// Layers without those of pixel centres.
    pub(crate) fn recorded(wanted: &'a [Aov]) -> Self {
        let centres = None;
        Self { wanted, centres }
    }

    /// The layers of a picture, in the requested order.
    pub(crate) fn of(&self, picture: &Picture) -> Vec<Layer> {
        let layer = |aov: &Aov| self.layer(*aov, picture);
        self.wanted.iter().filter_map(layer).collect()
    }

    fn layer(&self, aov: Aov, picture: &Picture) -> Option<Layer> {
        let aovs = picture.aovs.as_ref();
        let first = aovs.and_then(|a| a.first.as_ref());
        let light = aovs.and_then(|a| a.light.as_ref());
        let centres = self.centres.as_ref();
        let grey = |buffer: Buffer| buffer.pixels.iter().map(|p| p.x).collect();
        Some(match aov {
            Aov::Albedo => Layer::rgb("albedo", &first?.albedo()),
            Aov::Normal => Layer::xyz("normal", &first?.normal()),
            Aov::Depth => Layer::scalar("depth", grey(first?.depth())),
            Aov::Alpha => Layer {
                name: String::new(),
                channels: vec![("A", grey(first?.coverage()))],
            },
            Aov::Position => Layer::xyz("position", &centres?.position),
            Aov::Id => {
                let [mesh, material] = centres?.ids.clone();
                Layer {
                    name: "id".into(),
                    channels: vec![("mesh", mesh), ("material", material)],
                }
            }
            Aov::Emission => Layer::rgb("emission", &light?.emission()),
            Aov::Direct => Layer::rgb("direct", &light?.direct()),
            Aov::Indirect => Layer::rgb("indirect", &light?.indirect(&picture.film)),
            // Written with the other results of the levels, and of films.
            Aov::Level | Aov::EachLevel | Aov::Motion => return None,
            Aov::Time => Layer::scalar("time", aovs?.time.as_ref()?.seconds()),
        })
    }
}
