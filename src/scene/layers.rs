//! Surfaces that let part of all rays pass, along one ray.
//!
//! Each is met with its opacity as the probability, by itself. One uniform number decides them all, from the nearest on: below the
//! opacity the ray meets the surface, and what is left of the number, stretched to [0, 1) again, decides the next. So each
//! surface is met by the share of the light that comes through to it, and of a set of even numbers by an even share.

use super::Hit;
use std::cell::RefCell;

/// Layers that one number decides. Of further ones a hash of the ray decides.
pub(super) const MOST: usize = 8;

/// Layers that a walk through the tree has found.
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

    /// The first hit in front of `last` that `u` in [0, 1) meets, else `last`. `u` is uniform afterwards too, whatever was met.
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
