//! Names by which users choose an estimator and a rule, and the table of estimators.
//!
//! A new estimator is a variant of [`Estimator`], a branch in [`Settings::integrator`](super::Settings::integrator), a
//! row of the table here, and a mode in `crates/lab/src/verify/modes.rs` for random checks.

use super::Estimator;
use super::bidirectional::Radius;
use serde::{Deserialize, Serialize};

/// Default number of mutations per pixel of a pass.
pub(crate) const MUTATIONS: u32 = 16;

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

/// Contents of a scene that not every estimator supports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Content {
    /// Media, also those that only absorb.
    Media,
    /// Media that scatter.
    Scattering,
    /// Indices of refraction by channel.
    Dispersion,
    /// Bodies that overlap.
    Overlaps,
}

/// Light that an estimator without roughening never finds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Misses {
    /// None.
    Nothing,
    /// Lights without area that are seen through a Dirac lobe.
    PointsByDirac,
    /// Everything that is seen through a Dirac lobe.
    AllByDirac,
}

/// Properties of an estimator, for its choice, for checks and for planning.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row {
    /// The algorithm.
    pub(crate) estimator: Estimator,
    /// Cost of a camera path and of a light path, in samples of the path tracer, in most scenes.
    pub(crate) cost: [f64; 2],
    /// Contents of scenes that it does not support.
    pub(crate) refuses: &'static [Content],
    /// Light that it never finds.
    pub(crate) misses: Misses,
    /// Estimators that have all of its strategies and more.
    pub(crate) part_of: &'static [IntegratorKind],
    /// Rules that it supports.
    pub(crate) modes: &'static [Mode],
    /// True if its paths can draw Sobol points.
    pub(crate) takes_sobol: bool,
}

impl Row {
    /// Path tracing; the other rows differ from it.
    const PATH: Self = Self {
        estimator: Estimator::Path { reuse: false },
        cost: [1.0, 0.0],
        refuses: &[],
        misses: Misses::PointsByDirac,
        part_of: &[IntegratorKind::Bdpt, IntegratorKind::Vcm],
        modes: &Mode::ALL,
        takes_sobol: true,
    };
    /// An estimator without rules, whose strategies are no part of another one's.
    const ALONE: Self = Self {
        refuses: &[Content::Scattering],
        misses: Misses::Nothing,
        part_of: &[],
        modes: &[Mode::Default],
        ..Self::PATH
    };
}

macro_rules! estimators {
    ($($(#[$meta:meta])+ $kind:ident = $row:expr;)+) => {
        /// Integrators by name.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
        #[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
        #[serde(rename_all = "kebab-case")]
        pub enum IntegratorKind {
            $($(#[$meta])+ $kind,)+
        }

        impl IntegratorKind {
            /// All of them, in the order of the table.
            pub(crate) const ALL: &[Self] = &[$(Self::$kind),+];

            /// Its row in the table of estimators.
            pub(crate) fn row(self) -> Row {
                match self {
                    $(Self::$kind => $row,)+
                }
            }
        }
    };
}

estimators! {
    /// Path tracing from the camera.
    Path = Row::PATH;
    /// Path tracing with directions from a guide too, which learns while rendering where light comes from.
    Guided = Row {
        estimator: Estimator::Guided { unbiased: false },
        takes_sobol: false,
        ..Row::ALONE
    };
    /// Path tracing that seeks lights by way of a smooth mirror, out of water or through a smooth body of glass too
    /// (specular manifold sampling).
    Manifold = Row {
        estimator: Estimator::Manifold { trials: 0 },
        cost: [5.0, 0.0],
        refuses: &[Content::Media, Content::Dispersion, Content::Overlaps],
        ..Row::ALONE
    };
    /// Light tracing: caustics seen directly; no surface that is seen by way of a mirror or smooth glass.
    Light = Row {
        estimator: Estimator::Light,
        cost: [0.0, 1.3],
        misses: Misses::AllByDirac,
        part_of: &[Self::Bdpt, Self::Vcm],
        ..Row::ALONE
    };
    /// Bidirectional path tracing: lamps behind glass, caustics, indirect light.
    Bdpt = Row {
        estimator: Estimator::Bdpt,
        cost: [2.0, 1.3],
        part_of: &[Self::Vcm],
        modes: &[Mode::Default, Mode::Mollifier],
        ..Row::PATH
    };
    /// Bidirectional path tracing and photon density in one: caustics seen through glass, water or mirrors too.
    #[cfg_attr(feature = "clap", value(alias = "ups"))]
    #[serde(alias = "ups")]
    Vcm = Row {
        estimator: Estimator::Vcm(Radius::DEFAULT),
        cost: [2.1, 1.3],
        ..Row::ALONE
    };
    /// Photon density with a shrinking radius.
    Sppm = Row {
        estimator: Estimator::Sppm(Radius::DEFAULT),
        cost: [0.4, 1.0],
        part_of: &[Self::Vcm],
        ..Row::ALONE
    };
    /// Metropolis light transport over bdpt: light through keyholes and around corners, chains of glossy reflections. A
    /// sample is 16 mutations per pixel.
    Mlt = Row {
        estimator: Estimator::Mlt { mutations: MUTATIONS },
        // Per mutation.
        cost: [3.0, 0.0],
        takes_sobol: false,
        modes: &[Mode::Default, Mode::Mollifier],
        ..Row::ALONE
    };
    /// The one of path, path with levels, bdpt and vcm with the least expected error, by the scene's lights and
    /// materials and a pilot of a few per cent of the render.
    #[default]
    Auto = Row {
        // Until a pilot has chosen.
        modes: &[Mode::Default, Mode::Reuse, Mode::Mollifier],
        ..Row::PATH
    };
}

impl IntegratorKind {
    /// True for path tracing.
    pub fn is_path(&self) -> bool {
        *self == Self::Path
    }

    /// The algorithm, with this radius if it has one.
    pub fn estimator(self, radius: Radius) -> Estimator {
        match self.row().estimator {
            Estimator::Vcm(_) => Estimator::Vcm(radius),
            Estimator::Sppm(_) => Estimator::Sppm(radius),
            other => other,
        }
    }
}

/// Its name in options.
impl std::fmt::Display for IntegratorKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&format!("{self:?}").to_lowercase())
    }
}

impl Estimator {
    /// The integrator by which users choose it.
    pub(crate) fn kind(self) -> IntegratorKind {
        match self {
            Self::Path { .. } => IntegratorKind::Path,
            Self::Guided { .. } => IntegratorKind::Guided,
            Self::Manifold { .. } => IntegratorKind::Manifold,
            Self::Light => IntegratorKind::Light,
            Self::Bdpt => IntegratorKind::Bdpt,
            Self::Vcm(_) | Self::VcmNee(_) => IntegratorKind::Vcm,
            Self::Sppm(_) => IntegratorKind::Sppm,
            Self::Mlt { .. } => IntegratorKind::Mlt,
        }
    }

    /// Usual cost of a sample of a pixel in samples of the path tracer, with this number of light paths a pixel.
    pub(crate) fn cost(self, light_paths: f64) -> f64 {
        let [camera, light] = self.kind().row().cost;
        let cost = camera + light * light_paths;
        match self {
            Self::Manifold { trials } => cost + f64::from(trials),
            Self::Mlt { mutations } => cost * f64::from(mutations),
            _ => cost,
        }
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

impl Mode {
    /// All of them.
    pub(crate) const ALL: [Self; 6] = [
        Self::Default,
        Self::Reuse,
        Self::Pbrt,
        Self::FilterGlossy,
        Self::RoughnessClamp,
        Self::Mollifier,
    ];
}
