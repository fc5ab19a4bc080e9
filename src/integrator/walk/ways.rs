//! Path splitting at the first smooth interfaces of a camera walk; a *way* is one choice of their lobes.
//!
//! A random draw selects the reflection at a pane in a few per cent of the samples, so that reflected light is noisy.
//! Here the walk follows both lobes, and each way is weighted by its probability c: V = c V₁ + (1 − c) V₂, the
//! expectation over that draw. All ways of a path share the other random numbers.

use crate::bsdf::{Bsdf, Lobe};
use crate::math::Vec3;

/// Most interfaces at which a walk splits: the front and back walls of a vessel.
const MAX_FORKS: usize = 4;

/// Least probability of a way that is followed besides the drawn one.
const MIN_WAY_SHARE: f32 = 0.01;

/// An interface on a way.
#[derive(Clone, Copy, Debug)]
struct Fork {
    lobe: Lobe,
    /// Probability of the lobe.
    chance: f32,
    /// True if the other lobe was followed before.
    is_second: bool,
}

/// One way of a walk after another, depth first. The first follows the lobes that are drawn.
#[derive(Clone, Copy, Debug)]
pub(in crate::integrator) struct Ways {
    forks: [Option<Fork>; MAX_FORKS],
    /// Forks that the current way has passed.
    passed: usize,
    /// Forks at most.
    max_forks: usize,
}

impl Ways {
    /// All ways.
    pub(in crate::integrator) fn all() -> Self {
        Self {
            forks: [None; MAX_FORKS],
            passed: 0,
            max_forks: MAX_FORKS,
        }
    }

    /// Only the way that is drawn.
    pub(in crate::integrator) fn drawn() -> Self {
        Self {
            max_forks: 0,
            ..Self::all()
        }
    }

    /// The random numbers for the lobe at a vertex before the first draw from a non-Dirac lobe: `u`, except that at a
    /// fork the first number is replaced by one that selects the lobe of the current way.
    #[inline]
    pub(in crate::integrator) fn choose(
        &mut self,
        bsdf: &Bsdf,
        alpha: f32,
        wo: Vec3,
        u: [f32; 3],
    ) -> [f32; 3] {
        if self.passed == self.max_forks {
            return u;
        }
        let Some(reflected) = bsdf.chance_of_reflection(alpha, wo) else {
            return u;
        };
        let drawn = match u[0] < reflected {
            true => (Lobe::Reflection, reflected),
            false => (Lobe::Transmission, 1.0 - reflected),
        };
        if self.share() * reflected.min(1.0 - reflected) < MIN_WAY_SHARE {
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

    /// Probability of the current way, in (0, 1].
    pub(in crate::integrator) fn share(&self) -> f32 {
        let forks = self.forks[..self.passed].iter().flatten();
        forks.map(|fork| fork.chance).product()
    }

    /// Survival probability after the first draw from a non-Dirac lobe. Light beyond it is weighted by the way's share
    /// c: a probability of c would give the noise of a drawn way, 1 the cost of a whole path.
    pub(in crate::integrator) fn survival(&self) -> f32 {
        self.share().sqrt()
    }

    /// Switches to the next way; false after the last one.
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
