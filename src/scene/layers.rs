//! Surfaces of partial opacity along one ray.
//!
//! A ray hits each of them independently, with the opacity as the probability. One uniform number u decides for all, from
//! the nearest on: the ray hits a surface of opacity a if u < a, else (u − a) / (1 − a), uniform again, decides for the
//! next. Stratified numbers thus stratify the choice among all layers.

use super::Hit;
use std::cell::RefCell;

/// Layers for which one number decides. A hash of the ray decides for further ones.
pub(super) const MOST: usize = 8;

/// Layers that a traversal has found.
#[derive(Default)]
pub(super) struct Layers(RefCell<(usize, [(Hit, f32); MOST])>);

impl Layers {
    /// Adds a hit and the opacity there; false if there are too many.
    pub(super) fn add(&self, hit: &Hit, opacity: f32) -> bool {
        let (len, list) = &mut *self.0.borrow_mut();
        let Some(place) = list.get_mut(*len) else {
            return false;
        };
        *place = (*hit, opacity);
        *len += 1;
        true
    }

    /// The first hit in front of `last` by `u` in [0, 1), else `last`. `u` stays uniform, whatever the result.
    pub(super) fn first(self, last: Option<Hit>, u: &mut f64) -> Option<Hit> {
        let (len, mut list) = self.0.into_inner();
        let found = &mut list[..len];
        found.sort_unstable_by(|(a, _), (b, _)| {
            a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle))
        });
        let end = last.as_ref().map_or(f32::INFINITY, |last| last.t);
        for (hit, opacity) in found.iter().filter(|(hit, _)| hit.t < end) {
            let opacity = f64::from(*opacity);
            if *u < opacity {
                *u /= opacity;
                return Some(*hit);
            }
            *u = (*u - opacity) / (1.0 - opacity);
        }
        last
    }
}

#[cfg(test)]
mod tests;
