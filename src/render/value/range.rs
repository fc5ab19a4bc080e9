//! Ranges of numbers.

/// Numbers that an option takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    pub(super) least: f64,
    pub(super) most: f64,
    /// True if the lower, and if the upper bound is included.
    closed: [bool; 2],
}

impl Range {
    /// Every finite number.
    pub const FINITE: Self = Self::from(f64::MIN, f64::MAX);
    /// Above 0.
    pub(crate) const POSITIVE: Self = Self::between(0.0, f64::MAX);
    /// From 1 on.
    pub(crate) const COUNT: Self = Self::from(1.0, f64::MAX);

    /// Both bounds included.
    pub(crate) const fn from(least: f64, most: f64) -> Self {
        Self {
            least,
            most,
            closed: [true; 2],
        }
    }

    /// Both bounds excluded.
    pub(crate) const fn between(least: f64, most: f64) -> Self {
        Self {
            closed: [false; 2],
            ..Self::from(least, most)
        }
    }

    /// The upper bound included, the lower excluded.
    pub(crate) const fn above(least: f64, most: f64) -> Self {
        Self {
            closed: [false, true],
            ..Self::from(least, most)
        }
    }

    pub(super) fn holds(&self, x: f64) -> bool {
        let [low, high] = self.closed;
        let above = if low { x >= self.least } else { x > self.least };
        let below = if high { x <= self.most } else { x < self.most };
        x.is_finite() && above && below
    }

    /// The range in words, to follow "a number".
    pub(super) fn words(&self) -> String {
        let Self {
            least,
            most,
            closed,
        } = *self;
        match (least == f64::MIN, most == f64::MAX, closed) {
            (true, ..) => String::new(),
            (_, true, [true, _]) => format!(" of at least {least}"),
            (_, true, [false, _]) => format!(" above {least}"),
            (_, _, [true, _]) => format!(" from {least} to {most}"),
            (_, _, [false, true]) => format!(" above {least} and at most {most}"),
            (_, _, [false, false]) => format!(" between {least} and {most}"),
        }
    }
}
