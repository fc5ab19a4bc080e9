//! The films that a render keeps, and what makes them differ.

use crate::image::level_film::MAX_LEVELS;
use serde::{Deserialize, Serialize};

/// Scales of four levels: plain path tracing, and the factors from 0.64 to 16 times as large. A fifth level at 0.128 does not
/// make better pictures, and a third of them cannot be left out.
pub const SCALES: [f32; 4] = [0.0, 0.64, 3.2, 16.0];

/// Factors on the radius at which the same photons count, of which every pixel gets the best: the first is the radius itself.
pub const RADII: [f32; 3] = [1.0, 2.0, 4.0];

/// Settings that cannot have several levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LevelError {
    /// The levels of plain path tracing are equal, and rules of other renderers roughen the path itself.
    #[error("several levels scale the factors of a table or a constant, and this rule has none")]
    Rule,
    /// A path that continues with the roughened lobe belongs to one level.
    #[error("the reuse mode continues a path with the roughened lobe: it has one level only")]
    Reuse,
    /// Other estimators have no rule, and one radius.
    #[error(
        "several levels are for the path tracer without a guide, and for sppm; bdpt and vcm have one"
    )]
    Estimator,
    /// The levels are chosen afterwards, so that their bias vanishes anyhow.
    #[error("the consistent variant has one level only")]
    Consistent,
    /// Wrong factors on the radius of photon density.
    #[error(
        "levels of sppm are 2 to {MAX_LEVELS} factors on its radius, ascending from 1, such as 1,2,4"
    )]
    Radii,
    /// Wrong scales.
    #[error("expected 2 to {MAX_LEVELS} scales of levels, ascending from 0")]
    Scales,
}

/// Films of a render beside the means of its samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Amounts {
    /// None: the picture is the mean of its samples.
    #[default]
    Raw,
    /// One film in batches, of which blurs are chosen per pixel.
    Blurred,
    /// A film for each of several scales of the rule's factors, of which one is chosen per pixel.
    Roughening(Scales),
    /// A film for each of several radii of photon density, of which one is chosen per pixel.
    Radii(RadiusFactors),
}

impl Amounts {
    /// Levels of roughening at these scales; [`LevelError::Scales`] for others than [`Scales`] takes.
    pub fn roughening(scales: &[f32]) -> Result<Self, LevelError> {
        Scales::try_from(scales.to_vec()).map(Self::Roughening)
    }

    /// Radii of photon density by these factors; [`LevelError::Radii`] for others than 2 to [`MAX_LEVELS`] numbers, ascending from 1.
    pub fn radii(factors: &[f32]) -> Result<Self, LevelError> {
        RadiusFactors::try_from(factors.to_vec()).map(Self::Radii)
    }

    /// Number of films in batches: 0 for raw means, else from 1 to [`MAX_LEVELS`].
    pub fn films(&self) -> usize {
        match self {
            Self::Raw => 0,
            Self::Blurred => 1,
            Self::Roughening(scales) => scales.as_slice().len(),
            Self::Radii(factors) => factors.as_slice().len(),
        }
    }

    /// True if samples are kept in independent batches.
    pub fn has_batches(&self) -> bool {
        self.films() > 0
    }

    /// True if there are several films to choose among.
    pub fn has_choice(&self) -> bool {
        self.films() > 1
    }
}

macro_rules! ascending {
    ($($(#[doc = $doc:literal])+ $name:ident from $first:literal, $usual:ident, $error:ident;)+) => {$(
        $(#[doc = $doc])+
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(try_from = "Vec<f32>", into = "Vec<f32>")]
        pub struct $name(Vec<f32>);

        impl $name {
            /// The numbers, ascending.
            pub(crate) fn as_slice(&self) -> &[f32] {
                &self.0
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self($usual.to_vec())
            }
        }

        impl TryFrom<Vec<f32>> for $name {
            type Error = LevelError;

            fn try_from(numbers: Vec<f32>) -> Result<Self, LevelError> {
                let count = (2..=MAX_LEVELS).contains(&numbers.len());
                let finite = numbers.iter().all(|x| x.is_finite());
                let ascending = numbers.first() == Some(&$first) && numbers.is_sorted_by(|a, b| a < b);
                match count && finite && ascending {
                    true => Ok(Self(numbers)),
                    false => Err(LevelError::$error),
                }
            }
        }

        impl From<$name> for Vec<f32> {
            fn from(numbers: $name) -> Self {
                numbers.0
            }
        }
    )+};
}

ascending! {
    /// Scales of the rule's factors at the levels of a render: 2 to [`MAX_LEVELS`], ascending from 0, which is
    /// plain path tracing.
    Scales from 0.0, SCALES, Scales;
    /// Factors on the radius of photon density: 2 to [`MAX_LEVELS`], ascending from 1.
    RadiusFactors from 1.0, RADII, Radii;
}

impl Scales {
    /// Scales of this number of levels: plain path tracing, and down from the roughest by factors of 5. `None` for fewer
    /// than 2 and more than [`MAX_LEVELS`].
    pub fn of_count(levels: usize) -> Option<Self> {
        let roughest = SCALES[SCALES.len() - 1];
        let scale = |k: usize| roughest * 0.2f32.powi((levels - 1 - k) as i32);
        match levels {
            n if n == SCALES.len() => Some(Self::default()),
            2..=MAX_LEVELS => Some(Self(
                std::iter::once(0.0).chain((1..levels).map(scale)).collect(),
            )),
            _ => None,
        }
    }
}
