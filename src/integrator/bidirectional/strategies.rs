//! Strategies, and sums of contributions over them.

use crate::math::Rgb;
use std::fmt;

/// The strategies that contribute, and their weights. Strategy (s, t) takes s vertices of a path from the light walk
/// and t from the camera walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Strategies {
    /// All, by the balance heuristic.
    All,
    /// Light tracing: t = 1, and lights that the camera walk hits before its first non-Dirac draw; weight 1.
    Light,
    /// Photon density: merges at the first rough lobe of a camera walk, and lights that it hits before; weight 1.
    Density,
    /// One strategy with its weight among all: the pictures of all strategies add up to the whole.
    One(Strategy),
    /// One strategy with weight 1.
    #[cfg(test)]
    Only {
        /// Vertices of the light walk, the light's own included.
        s: u32,
        /// Vertices of the camera walk, the camera's own included.
        t: u32,
    },
}

/// A strategy, or all merges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// Strategy (s, t).
    Connection {
        /// Vertices of the light walk, the light's own included.
        s: u32,
        /// Vertices of the camera walk, the camera's own included.
        t: u32,
    },
    /// All merges.
    Merges,
}

impl fmt::Display for Strategy {
    /// The format of `--set strategy`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Connection { s, t } => write!(f, "{s},{t}"),
            Self::Merges => f.write_str("merges"),
        }
    }
}

impl Strategies {
    /// The weight of strategy (s, t); `balance` computes it where all strategies contribute.
    #[inline]
    pub(super) fn weight(self, s: u32, t: u32, balance: impl FnOnce() -> f32) -> f32 {
        match self {
            Self::All | Self::One(_) => balance(),
            Self::Light => f32::from(u8::from(t == 1 || s == 0)),
            Self::Density => f32::from(u8::from(s == 0)),
            #[cfg(test)]
            Self::Only { s: s1, t: t1 } => f32::from(u8::from((s, t) == (s1, t1))),
        }
    }

    /// True if camera walks are closed by light sampling and connections.
    pub(super) fn connects(self) -> bool {
        !matches!(self, Self::Light | Self::Density)
    }

    /// True if the picture includes contributions of this strategy.
    #[inline]
    pub(super) fn includes(self, strategy: Strategy) -> bool {
        match self {
            Self::One(one) => one == strategy,
            _ => true,
        }
    }
}

/// Contributions of a camera path.
pub(super) struct Total {
    strategies: Strategies,
    /// Sum of the strategies that were computed.
    pub(super) all: Rgb,
    /// Sum of the strategies that the picture shows.
    pub(super) included: Rgb,
}

impl Total {
    pub(super) fn new(strategies: Strategies) -> Self {
        Self {
            strategies,
            all: Rgb::ZERO,
            included: Rgb::ZERO,
        }
    }

    #[inline]
    pub(super) fn add(&mut self, strategy: Strategy, value: Rgb) {
        self.all += value;
        if self.strategies.includes(strategy) {
            self.included += value;
        }
    }

    /// Adds a contribution that belongs to no strategy.
    #[inline]
    pub(super) fn add_extra(&mut self, value: Rgb) {
        self.all += value;
        self.included += value;
    }
}
