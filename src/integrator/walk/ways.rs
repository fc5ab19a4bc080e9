//! The ways of a camera walk through the smooth interfaces that it meets first.
//!
//! A draw follows the reflection at a pane with a chance of some per cent, so that few samples have what the pane reflects. Here the
//! walk goes both ways, and each counts with its chance c: V = c V₁ + (1 − c) V₂, the expectation over that draw with all other
//! numbers of the path as they are. All ways of a path have the same numbers.

use crate::bsdf::{Bsdf, Lobe};
use crate::math::Vec3;

/// Interfaces at which a walk goes both ways: the front and back walls of a vessel.
const MOST: usize = 4;

/// Least chance of a way that is walked besides the one that is drawn.
const LEAST: f32 = 0.01;

/// An interface on a way.
#[derive(Clone, Copy, Debug)]
struct Fork {
    lobe: Lobe,
    /// Chance of the lobe.
    chance: f32,
    /// True if the other lobe was followed before.
    is_second: bool,
}

/// One way of a walk after another, depth first. The first follows the lobes that are drawn.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct Ways {
    forks: [Option<Fork>; MOST],
    /// Forks that the current way has passed.
    passed: usize,
    /// Forks at most.
    most: usize,
}

impl Ways {
    /// All ways.
    pub(in crate::integrator) fn all() -> Self {
        Self {
            forks: [None; MOST],
            passed: 0,
            most: MOST,
        }
    }

    /// The way that is drawn.
    pub(in crate::integrator) fn drawn() -> Self {
        Self {
            most: 0,
            ..Self::all()
        }
    }

    /// The numbers that draw a lobe at a vertex before the first draw from a smooth lobe: those of the path, `u`, except that
    /// the first chooses the lobe of the current way at a fork.
    #[inline]
    pub(in crate::integrator) fn choose(
        &mut self,
        bsdf: &Bsdf,
        alpha: f32,
        wo: Vec3,
        u: [f32; 3],
    ) -> [f32; 3] {
        if self.passed == self.most {
            return u;
        }
        let Some(reflected) = bsdf.chance_of_reflection(alpha, wo) else {
            return u;
        };
        let drawn = match u[0] < reflected {
            true => (Lobe::Reflection, reflected),
            false => (Lobe::Transmission, 1.0 - reflected),
        };
        if self.share() * reflected.min(1.0 - reflected) < LEAST {
            return u;
        }
        let fork = *self.forks[self.passed].get_or_insert(Fork {
            lobe: drawn.0,
            chance: drawn.1,
            is_second: false,
        });
        self.passed += 1;
        let choice = match fork.lobe {
            Lobe::Reflection => 0.0,
            _ => 1.0 - f32::EPSILON,
        };
        [choice, u[1], u[2]]
    }

    /// Chance of the current way, in (0, 1].
    pub(in crate::integrator) fn share(&self) -> f32 {
        let forks = self.forks[..self.passed].iter().flatten();
        forks.map(|fork| fork.chance).product()
    }

    /// Chance of going on after the first draw from a smooth lobe. Light beyond it counts the way's share c; with the chance c it would
    /// have the noise of a drawn way, with 1 the cost of a whole path.
    pub(in crate::integrator) fn survival(&self) -> f32 {
        self.share().sqrt()
    }

    /// Turns to the next way; false after the last one.
    pub(in crate::integrator) fn turn(&mut self) -> bool {
        while self.passed > 0 {
            self.passed -= 1;
            let fork = &mut self.forks[self.passed];
            match fork {
                Some(one) if !one.is_second => {
                    *one = Fork {
                        lobe: match one.lobe {
                            Lobe::Reflection => Lobe::Transmission,
                            _ => Lobe::Reflection,
                        },
                        chance: 1.0 - one.chance,
                        is_second: true,
                    };
                    self.passed = 0;
                    return true;
                }
                _ => *fork = None,
            }
        }
        false
    }
}

#[cfg(test)]
mod tests;
