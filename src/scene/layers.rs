//! Surfaces of partial opacity along one ray.
//!
//! A ray hits each of them independently, with the opacity as the probability. One uniform number u decides for all,
//! from the nearest on: the ray hits a surface of opacity a if u < a, else (u − a) / (1 − a), uniform again, decides for
//! the next. Stratified numbers thus stratify the choice among all layers.

use super::Hit;
use std::cell::RefCell;

/// Layers that a traversal has found, in its order, each once: a tree has every triangle in one leaf.
#[derive(Default)]
pub(super) struct Layers(RefCell<Vec<(Hit, f32)>>);

impl Layers {
    /// Adds a hit and the opacity there.
    pub(super) fn add(&self, hit: &Hit, opacity: f32) {
        self.0.borrow_mut().push((*hit, opacity));
    }

    /// The layers from the nearest on, whatever the order of the traversal.
    fn sorted(self) -> Vec<(Hit, f32)> {
        let mut layers = self.0.into_inner();
        layers.sort_unstable_by(|(a, _), (b, _)| {
            a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle))
        });
        layers
    }

    /// The first hit in front of `last` by `u` in [0, 1), else `last`. `u` stays uniform, whatever the result. Of hits at
    /// one distance the one on the triangle of the lower number is in front.
    pub(super) fn first(self, last: Option<Hit>, u: &mut f64) -> Option<Hit> {
        let in_front = |hit: &Hit| match &last {
            Some(last) => hit.t < last.t || hit.t == last.t && hit.triangle < last.triangle,
            None => true,
        };
        for (hit, opacity) in self.sorted() {
            if !in_front(&hit) {
                break;
            }
            let opacity = f64::from(opacity);
            if *u < opacity {
                *u /= opacity;
                return Some(hit);
            }
            *u = (*u - opacity) / (1.0 - opacity);
        }
        last
    }

    /// Product of 1 − a of all layers.
    pub(super) fn transmittance(self) -> f32 {
        let layers = self.sorted();
        layers.iter().fold(1.0, |passed, (_, a)| passed * (1.0 - a))
    }
}

#[cfg(test)]
mod tests;
