//! Bodies around a path, and what they absorb.

use crate::integrator::View;
use crate::math::{Ray, Rgb};
use crate::scene::Scene;
use crate::scene::camera::Projection;

/// Bodies that are remembered around a vertex.
const MOST: usize = 16;

/// Surfaces at which the search for the bodies around a point gives up.
const MOST_SURFACES: usize = 10_000;

/// The bodies that enclose the current vertex of a path, innermost last; empty in scenes without absorption.
///
/// Remembers the `MOST` innermost. Where a path needs one that was forgotten, its transmittance is not a number: the film
/// refuses the sample, counts and names it.
#[derive(Clone, Copy, Default)]
pub struct EnclosingBodies {
    materials: [u32; MOST],
    len: u32,
    /// Bodies outside of the remembered ones.
    forgotten: u32,
}

impl EnclosingBodies {
    /// The bodies around the origin of a ray: those that the ray, followed through all surfaces to infinity, leaves without
    /// having entered. Bodies are taken for closed.
    pub(in crate::integrator) fn around(scene: &Scene, ray: &Ray) -> Self {
        let mut ray = *ray;
        let (mut entered, mut around) = (Vec::new(), Vec::new());
        for _ in 0..MOST_SURFACES {
            let Some(hit) = scene.intersect(&ray) else {
                break;
            };
            let surface = scene.surface(&hit);
            if scene.material(&surface).bounds_body() {
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

    /// The bodies around the camera, if they are the same for all its rays.
    pub(in crate::integrator) fn around_camera(view: &View<'_>) -> Option<Self> {
        let camera = view.sensor.camera;
        if !view.scene.has_absorption() {
            return Some(Self::default());
        }
        match camera.projection {
            Projection::Perspective { .. } if camera.lens.is_none() => {
                let forwards = Ray::new(camera.position, -camera.frame.n);
                Some(Self::around(view.scene, &forwards))
            }
            _ => None,
        }
    }

    /// True outside of all bodies.
    #[inline]
    pub(in crate::integrator) fn is_empty(&self) -> bool {
        self.len == 0 && self.forgotten == 0
    }

    /// Enters a body of this material.
    #[inline]
    pub(in crate::integrator) fn enter(&mut self, material: u32) {
        if self.len as usize == MOST {
            self.materials.copy_within(1.., 0);
            self.len -= 1;
            self.forgotten += 1;
        }
        self.materials[self.len as usize] = material;
        self.len += 1;
    }

    /// Leaves the innermost body of this material.
    #[inline]
    pub(in crate::integrator) fn leave(&mut self, material: u32) {
        let remembered = &mut self.materials[..self.len as usize];
        if let Some(i) = remembered.iter().rposition(|&m| m == material) {
            remembered.copy_within(i + 1.., i);
            self.len -= 1;
        } else {
            self.forgotten = self.forgotten.saturating_sub(1);
        }
    }

    /// Transmittance over a distance inside the innermost body (Beer-Lambert).
    #[inline]
    pub(in crate::integrator) fn transmittance(&self, scene: &Scene, distance: f32) -> Rgb {
        let Some(&material) = self.materials[..self.len as usize].last() else {
            return if self.forgotten == 0 {
                Rgb::ONE
            } else {
                Rgb::NAN
            };
        };
        let sigma = scene.parts().materials[material as usize].absorption;
        // Without absorption 0 · ∞ must be 0.
        sigma.map(|s| if s > 0.0 { (-s * distance).exp() } else { 1.0 })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, SceneParts};

    fn transmittance(bodies: &EnclosingBodies) -> f32 {
        let material = |i: u8| Material {
            absorption: Rgb::splat(f32::from(i)),
            ..Material::default()
        };
        let materials = (0..40).map(material).collect();
        let parts = SceneParts {
            materials,
            ..SceneParts::default()
        };
        bodies.transmittance(&Scene::new(parts), 0.1).x
    }

    #[test]
    fn nested_bodies_are_left_in_the_order_of_entering() {
        for depth in [1, 4, 5, MOST as u32] {
            let mut bodies = EnclosingBodies::default();
            (1..=depth).for_each(|m| bodies.enter(m));
            for m in (1..=depth).rev() {
                assert_eq!(transmittance(&bodies), (-0.1 * m as f32).exp());
                bodies.leave(m);
            }
            assert!(bodies.is_empty() && transmittance(&bodies) == 1.0);
        }
    }

    #[test]
    fn bodies_forgotten_make_the_transmittance_nan_and_not_wrong() {
        let most = MOST as u32;
        let mut bodies = EnclosingBodies::default();
        (1..=most + 2).for_each(|m| bodies.enter(m));
        for m in (3..=most + 2).rev() {
            assert_eq!(transmittance(&bodies), (-0.1 * m as f32).exp());
            bodies.leave(m);
        }
        for m in [2, 1] {
            assert!(!bodies.is_empty() && transmittance(&bodies).is_nan());
            bodies.leave(m);
        }
        assert!(bodies.is_empty() && transmittance(&bodies) == 1.0);
    }
}
