//! The films that a render stores, and the parameters in which they differ.

use crate::image::level_film::MAX_LEVELS;
use serde::{Deserialize, Serialize};

/// Scales of a rule's factors at four levels, of which 0 is plain path tracing. A fifth level at 0.128 does not make
/// better pictures, and three levels make worse ones.
pub(crate) const SCALES: [f32; 4] = [0.0, 0.64, 3.2, 16.0];

/// Factors on the radius within which the same photons count. One is chosen per pixel; the first keeps the radius.
pub(crate) const RADII: [f32; 3] = [1.0, 2.0, 4.0];

/// Settings that cannot have these levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LevelError {
    /// The rule has no factors: levels of plain path tracing are equal, and other renderers' rules roughen the path.
    #[error("several levels scale the factors of a table or a constant, and this rule has none")]
    Rule,
    /// A path that continues with the roughened lobe belongs to one level.
    #[error("the reuse mode continues a path with the roughened lobe: it has one level only")]
    Reuse,
    /// The estimator has neither levels of a rule nor several radii.
    #[error(
        "several levels are for the path tracer without a guide, and for sppm; bdpt and vcm have one"
    )]
    Estimator,
    /// The consistent variant needs no levels: with a choice of levels the bias vanishes anyhow.
    #[error("the consistent variant has one level only")]
    Consistent,
    /// Factors on the radius of photon density that are not 2 to 8 numbers, ascending from 1.
    #[error(
        "levels of sppm are 2 to {MAX_LEVELS} factors on its radius, ascending from 1, such as 1,2,4"
    )]
    Radii,
    /// Scales that are not 2 to 8 numbers, ascending from 0.
    #[error("expected 2 to {MAX_LEVELS} scales of levels, ascending from 0")]
    Scales,
}

/// Films that a render stores beside the means of its samples.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Amounts {
    /// None: the picture is the mean of its samples.
    #[default]
    Raw,
    /// One film in batches; a blur of it is chosen per pixel.
    Blurred,
    /// A film for each of several scales of the rule's factors, of which one is chosen per pixel.
    Roughening(Scales),
    /// A film for each of several radii of photon density, of which one is chosen per pixel.
    Radii(RadiusFactors),
}

impl Amounts {
    /// Levels of roughening at these scales; [`LevelError::Scales`] for numbers that [`Scales`] refuses.
    pub fn roughening(scales: &[f32]) -> Result<Self, LevelError> {
        Scales::try_from(scales.to_vec()).map(Self::Roughening)
    }

    /// Radii of photon density by these factors; [`LevelError::Radii`] unless 2 to [`MAX_LEVELS`], ascending from 1.
    pub(crate) fn radii(factors: &[f32]) -> Result<Self, LevelError> {
        RadiusFactors::try_from(factors.to_vec()).map(Self::Radii)
    }

    /// Number of films in batches: 0 for raw means, else from 1 to 8.
    pub fn films(&self) -> usize {
        match self {
            Self::Raw => 0,
            Self::Blurred => 1,
            Self::Roughening(scales) => scales.as_slice().len(),
            Self::Radii(factors) => factors.as_slice().len(),
        }
    }

    /// True if samples are stored in independent batches.
    pub(crate) fn has_batches(&self) -> bool {
        self.films() > 0
    }

    /// True if there are several films to choose among.
    pub(crate) fn has_choice(&self) -> bool {
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
    /// Scales of the rule's factors at the levels of a render: 2 to 8, ascending from 0, which is plain path
    /// tracing.
    Scales from 0.0, SCALES, Scales;
    /// Factors on the radius of photon density: 2 to 8, ascending from 1.
    RadiusFactors from 1.0, RADII, Radii;
}

impl Scales {
    /// Scales of this number of levels: 0, and descending from the roughest of the default ones by factors of 5. `None` for
    /// fewer than 2 and more than 8.
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
