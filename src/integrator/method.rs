//! Names by which users choose an estimator and a rule.

use super::Estimator;
use super::bidirectional::Radius;
use super::metropolis::MUTATIONS;
use serde::{Deserialize, Serialize};

/// Connections of `vcm`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum Connections {
    /// Every vertex of a light path to the camera and to every vertex of a camera path.
    All,
    /// Light samples only: cheaper, and as good where photons find the rest.
    Nee,
}

/// Integrators by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum IntegratorKind {
    /// Path tracing from the camera.
    Path,
    /// Path tracing with directions from a guide too, which learns while rendering where light comes from.
    Guided,
    /// Path tracing that seeks lights by way of a smooth mirror, out of water or through a smooth body of glass too (specular
    /// manifold sampling).
    Manifold,
    /// Light tracing: caustics seen directly; no surface that is seen by way of a mirror or smooth glass.
    Light,
    /// Bidirectional path tracing: lamps behind glass, caustics, indirect light.
    Bdpt,
    /// Bidirectional path tracing and photon density in one: caustics seen through glass, water or mirrors too.
    #[cfg_attr(feature = "clap", value(alias = "ups"))]
    #[serde(alias = "ups")]
    Vcm,
    /// Photon density with a shrinking radius.
    Sppm,
    /// Metropolis light transport over bdpt: light through keyholes and around corners, chains of glossy reflections. A
    /// sample is 16 mutations per pixel.
    Mlt,
    /// The one of path, path with levels, bdpt and vcm with the least expected error, by the scene's lights and materials and
    /// a pilot of a few per cent of the render.
    #[default]
    Auto,
}

impl IntegratorKind {
    /// True for path tracing.
    pub fn is_path(&self) -> bool {
        *self == Self::Path
    }

    /// The algorithm, with this radius if it has one.
    pub fn estimator(self, radius: Radius) -> Estimator {
        match self {
            // Until a pilot has chosen.
            Self::Path | Self::Auto => Estimator::Path { reuse: false },
            Self::Guided => Estimator::Guided { unbiased: false },
            Self::Manifold => Estimator::Manifold { trials: 0 },
            Self::Light => Estimator::Light,
            Self::Bdpt => Estimator::Bdpt,
            Self::Vcm => Estimator::Vcm(radius),
            Self::Sppm => Estimator::Sppm(radius),
            Self::Mlt => Estimator::Mlt {
                mutations: MUTATIONS,
            },
        }
    }

    /// The name that users know it by.
    pub fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

/// Rules of regularisation by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Mode {
    /// At next-event estimation only; the path continues with the original lobe.
    #[default]
    Default,
    /// The path continues with the roughened lobe: faster, slightly more bias.
    Reuse,
    /// pbrt-v4's rule, for comparison.
    Pbrt,
    /// Cycles' filter glossy, for comparison.
    FilterGlossy,
    /// No lobe sharper than the roughest before it, for comparison.
    RoughnessClamp,
    /// Kaplanyan and Dachsbacher's mollifier: lights without area seen through smooth mirrors and glass.
    Mollifier,
}
