//! Bodies around a path, and what they absorb.

use crate::math::{Ray, Rgb};
use crate::scene::Scene;

/// The bodies that enclose the current vertex of a path, innermost last; empty in scenes without absorption.
///
/// Holds four; a fifth is not entered.
#[derive(Clone, Copy, Default)]
pub(in crate::integrator) struct EnclosingBodies {
    materials: [u32; 4],
    len: usize,
}

impl EnclosingBodies {
    /// The absorbing bodies around the origin of a ray: those that the ray, followed to infinity, leaves without having
    /// entered them. Bodies are taken to be closed and nested.
    pub(in crate::integrator) fn around(scene: &Scene, ray: &Ray) -> Self {
        let mut ray = *ray;
        let mut entered = Vec::new();
        let mut around = Vec::new();
        // A surface that a ray meets again and again must not hold the walk for ever.
        for _ in 0..1024 {
            let Some(hit) = scene.intersect(&ray) else {
                break;
            };
            let surface = scene.surface(&hit);
            let material = scene.material(&surface);
            if material.solid && material.transmission > 0.0 {
                if ray.dir.dot(surface.ng) < 0.0 {
                    entered.push(surface.material);
                } else if let Some(i) = entered.iter().rposition(|&m| m == surface.material) {
                    entered.remove(i);
                } else {
                    around.push(surface.material);
                }
            }
            ray = surface.spawn(ray.dir);
        }
        let mut bodies = Self::default();
        around.iter().rev().for_each(|&m| bodies.enter(m));
        bodies
    }

    /// True outside of all bodies.
    #[inline]
    pub(in crate::integrator) fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Enters a body of this material.
    #[inline]
    pub(in crate::integrator) fn enter(&mut self, material: u32) {
        if self.len < self.materials.len() {
            self.materials[self.len] = material;
            self.len += 1;
        }
    }

    /// Leaves the innermost body of this material.
    #[inline]
    pub(in crate::integrator) fn leave(&mut self, material: u32) {
        if let Some(i) = self.materials[..self.len]
            .iter()
            .rposition(|&m| m == material)
        {
            self.materials.copy_within(i + 1..self.len, i);
            self.len -= 1;
        }
    }

    /// Transmittance over a distance inside the innermost body (Beer-Lambert).
    #[inline]
    pub(in crate::integrator) fn transmittance(&self, scene: &Scene, distance: f32) -> Rgb {
        let Some(&material) = self.materials[..self.len].last() else {
            return Rgb::ONE;
        };
        let sigma = scene.parts().materials[material as usize].absorption;
        // Without absorption 0 · ∞ must be 0.
        sigma.map(|s| if s > 0.0 { (-s * distance).exp() } else { 1.0 })
    }
}
