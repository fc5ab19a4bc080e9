//! Prior of a table: the factor of a class is near that of its suffix, the class without the vertex nearest the camera.
//!
//! ```text
//! P(γ) = κ / LIVE · Σ (ln γ_c − ln γ_s)²      over classes c with events, s the longest suffix of c with events
//! ```
//!
//! The prior is added to the loss. Most factors hardly change the loss, and without the prior they would fit the noise
//! of a recording. In classes that carry much light, the loss outweighs the prior.

use crate::record::visits::{LIVE_CLASSES, Visits};
use opsr::regularise::{GammaIndex, LEN};

/// The prior of the classes that a recording visits.
pub(crate) struct Prior {
    /// Classes and their suffixes.
    pairs: Vec<(usize, usize)>,
    /// Weight of each squared difference.
    weight: f64,
}

impl Prior {
    /// The prior of strength κ for classes with these visits.
    pub(crate) fn new(strength: f64, visits: &Visits) -> Self {
        let pair = |class: GammaIndex| {
            let suffix = visits.suffix(class)?;
            visits.has(class).then_some((class.index(), suffix.index()))
        };
        Self {
            pairs: match strength > 0.0 {
                true => (0..LEN)
                    .filter_map(GammaIndex::new)
                    .filter_map(pair)
                    .collect(),
                false => Vec::new(),
            },
            weight: strength / LIVE_CLASSES as f64,
        }
    }

    /// Adds dP/dγ at these factors, which are above 0, to a gradient; returns P.
    pub(crate) fn add(&self, gammas: &[f32; LEN], gradient: &mut [f64]) -> f64 {
        let mut value = 0.0;
        for &(class, suffix) in &self.pairs {
            let [own, inherited] = [class, suffix].map(|i| f64::from(gammas[i]));
            let difference = (own / inherited).ln();
            value += self.weight * difference * difference;
            let slope = 2.0 * self.weight * difference;
            gradient[class] += slope / own;
            gradient[suffix] -= slope / inherited;
        }
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_of_the_prior_match_differences() {
        let mut visits = Visits::default();
        for (i, n) in visits.0.iter_mut().enumerate() {
            *n = u64::from(i % 3 != 1);
        }
        let prior = Prior::new(0.7, &visits);
        let mut gammas = [0.0f32; LEN];
        for (i, gamma) in gammas.iter_mut().enumerate() {
            *gamma = 0.05 + 0.9 * ((i * 37 % LEN) as f32 / LEN as f32);
        }
        let mut gradient = vec![0.0; LEN];
        prior.add(&gammas, &mut gradient);
        let mut value = |i: usize, gamma: f32| {
            let kept = std::mem::replace(&mut gammas[i], gamma);
            let value = prior.add(&gammas, &mut vec![0.0; LEN]);
            gammas[i] = kept;
            value
        };
        for i in (0..LEN).step_by(7) {
            let gamma = 0.05 + 0.9 * ((i * 37 % LEN) as f32 / LEN as f32);
            let (low, high) = (gamma - 1e-3, gamma + 1e-3);
            let slope = (value(i, high) - value(i, low)) / f64::from(high - low);
            let error = (slope - gradient[i]).abs();
            assert!(
                error < 1e-3 * (1e-4 + slope.abs()),
                "{i}: {slope} {}",
                gradient[i]
            );
        }
        assert!(
            visits
                .0
                .iter()
                .zip(&gradient)
                .all(|(&n, &g)| n > 0 || g == 0.0)
        );
    }

    #[test]
    fn prior_of_a_constant_is_zero() {
        let prior = Prior::new(1.0, &Visits(vec![1; LEN]));
        let mut gradient = vec![0.0; LEN];
        assert_eq!(prior.add(&[0.2; LEN], &mut gradient), 0.0);
        assert!(gradient.iter().all(|&g| g == 0.0));
        assert_eq!(prior.pairs.len(), LEN - 16);
    }
}
