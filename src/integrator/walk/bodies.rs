//! Nested bodies around a path, and their absorption.

use crate::bsdf::{Bsdf, is_matched};
use crate::integrator::View;
use crate::math::{Ray, Rgb, Vec3};
use crate::scene::bodies::MAX_SURFACES;
use crate::scene::camera::Projection;
use crate::scene::medium::{Media, MediumValues};
use crate::scene::{Hit, Scene, Surface};

/// Most bodies that are stored around a vertex.
const MAX_BODIES: usize = 16;

/// The bodies that enclose the current vertex of a path, innermost last; empty in scenes that do not track them.
///
/// Stores the `MAX_BODIES` innermost. If a path needs a dropped one, its transmittance is NaN: the film rejects, counts
/// and reports the sample.
#[derive(Clone, Copy, Default)]
pub(in crate::integrator) struct EnclosingBodies {
    materials: [u32; MAX_BODIES],
    len: u32,
    /// Number of dropped bodies, which enclose the stored ones.
    dropped: u32,
}

impl EnclosingBodies {
    /// The bodies around the origin of a ray.
    pub(in crate::integrator) fn around(scene: &Scene, ray: &Ray) -> Self {
        let mut bodies = Self::default();
        for &material in scene.bodies_around(ray).iter().rev() {
            bodies.enter(material);
        }
        bodies
    }

    /// The bodies around a point, by majority over rays: a ray along a boundary, or into two at once, misses one.
    fn around_point(scene: &Scene, point: Vec3) -> Self {
        const DIRECTIONS: [Vec3; 5] = [
            Vec3::new(0.31, 0.93, 0.19),
            Vec3::new(-0.87, 0.23, 0.43),
            Vec3::new(0.53, -0.29, -0.79),
            Vec3::new(0.71, 0.17, 0.68),
            Vec3::new(-0.37, -0.61, 0.70),
        ];
        let found = DIRECTIONS.map(|dir| {
            let around = scene.bodies_around(&Ray::new(point, dir.normalize()));
            let mut sorted = around.clone();
            sorted.sort_unstable();
            (sorted, around)
        });
        let votes = |sorted: &[u32]| found.iter().filter(|(s, _)| s == sorted).count();
        // The first of equal counts.
        let best = found.iter().rev().max_by_key(|(sorted, _)| votes(sorted));
        let mut bodies = Self::default();
        for &material in best.iter().flat_map(|(_, around)| around.iter().rev()) {
            bodies.enter(material);
        }
        bodies
    }

    /// The bodies around the origin of a ray that a light emits; none for a light at infinity.
    pub(super) fn of_light(scene: &Scene, ray: &Ray, infinite: bool) -> Self {
        if scene.tracks_bodies() && !infinite {
            Self::around(scene, ray)
        } else {
            Self::default()
        }
    }

    /// The bodies around the camera, if they are the same for all its rays.
    pub(in crate::integrator) fn around_camera(view: &View<'_>) -> Option<Self> {
        let camera = view.sensor.camera;
        if !view.scene.tracks_bodies() {
            return Some(Self::default());
        }
        match camera.projection {
            Projection::Perspective { .. } if camera.lens.is_none() => {
                Some(Self::around_point(view.scene, camera.position))
            }
            _ => None,
        }
    }

    /// True outside of all bodies.
    #[inline]
    pub(in crate::integrator) fn is_empty(&self) -> bool {
        self.len == 0 && self.dropped == 0
    }

    /// Enters a body of this material.
    #[inline]
    pub(in crate::integrator) fn enter(&mut self, material: u32) {
        if self.len as usize == MAX_BODIES {
            self.materials.copy_within(1.., 0);
            self.len -= 1;
            self.dropped += 1;
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
            self.dropped = self.dropped.saturating_sub(1);
        }
    }

    /// The bodies on the other side of a boundary if a ray `crosses` it, from its `outside` or inside; else these.
    #[inline]
    pub(in crate::integrator) fn across(
        &self,
        scene: &Scene,
        crosses: bool,
        outside: bool,
        surface: &Surface,
    ) -> Self {
        let mut bodies = *self;
        if crosses {
            let touching = scene.touching(&mut { *surface });
            bodies.cross(outside, surface.material, touching);
        }
        bodies
    }

    /// The bodies around a ray along `dir` from a surface of this BSDF, which the path hit from `outside` or inside.
    #[inline]
    pub(in crate::integrator) fn towards(
        &self,
        scene: &Scene,
        surface: &Surface,
        bsdf: &Bsdf,
        outside: bool,
        dir: Vec3,
    ) -> Self {
        let crosses = bsdf.is_solid() && (dir.dot(surface.ng) > 0.0) != outside;
        self.across(scene, crosses, outside, surface)
    }

    /// Enters a body through its surface, or leaves it; a body that touches it there is left or entered instead.
    #[inline]
    fn cross(&mut self, enters: bool, material: u32, touching: Option<u32>) {
        if enters {
            touching.into_iter().for_each(|other| self.leave(other));
            self.enter(material);
        } else {
            self.leave(material);
            touching.into_iter().for_each(|other| self.enter(other));
        }
    }

    /// The material of the body at this point: the innermost, or where bodies overlap the one of the highest rank.
    #[inline]
    fn present(&self, scene: &Scene) -> Option<u32> {
        let around = self.materials[..self.len as usize].iter().copied();
        if scene.features().overlaps {
            around.max_by_key(|&material| scene.rank(material))
        } else {
            around.last()
        }
    }

    /// Transmittance over a distance inside the body at this point (Beer-Lambert).
    #[inline]
    pub(in crate::integrator) fn transmittance(&self, scene: &Scene, distance: f32) -> Rgb {
        if let Some(media) = scene.media() {
            return self.transmittance_in(scene, media, distance);
        }
        // A dropped body may outrank the stored ones.
        if self.dropped > 0 && (self.len == 0 || scene.features().overlaps) {
            return Rgb::NAN;
        }
        let Some(material) = self.present(scene) else {
            return Rgb::ONE;
        };
        let sigma = scene.parts().materials[material as usize].absorption;
        // Without absorption 0 · ∞ must be 0.
        sigma.map(|s| if s > 0.0 { (-s * distance).exp() } else { 1.0 })
    }

    #[cold]
    fn transmittance_in(&self, scene: &Scene, media: &Media, distance: f32) -> Rgb {
        (self.filling(scene, media)).map_or(Rgb::NAN, |filling| filling.transmittance(distance))
    }

    /// Medium at this point; `None` if it may be that of a dropped body.
    pub(super) fn filling<'m>(&self, scene: &Scene, media: &'m Media) -> Option<&'m MediumValues> {
        let ranked = scene.features().overlaps && !scene.parts().own_boundaries;
        let remembered = self.materials[..self.len as usize].iter();
        let mut filled = remembered.filter_map(|&m| Some((m, media.of_body(m)?)));
        let there = match ranked {
            true => filled.max_by_key(|&(m, _)| scene.rank(m)),
            false => filled.next_back(),
        };
        match there {
            Some((_, filling)) if self.dropped == 0 || !ranked => Some(filling),
            None if self.dropped == 0 => Some(media.outside()),
            _ => None,
        }
    }

    /// Enters or leaves a body whose boundary is hidden from a ray along `dir`; false at all other surfaces.
    pub(super) fn passes(&mut self, scene: &Scene, surface: &mut Surface, dir: Vec3) -> bool {
        if !scene.features().overlaps || !scene.material(surface).bounds_body() {
            return false;
        }
        let touching = scene.touching(surface);
        let hidden = self.boundary(scene, surface, touching, dir).is_none();
        if hidden {
            self.cross(dir.dot(surface.ng) < 0.0, surface.material, touching);
        }
        hidden
    }

    /// Index of refraction on the outside of a body's boundary that a ray along `dir` hits; `None` if the boundary is
    /// hidden, because both sides are in a body of higher rank or have the same index and no colour.
    #[cold]
    fn boundary(
        &self,
        scene: &Scene,
        surface: &Surface,
        touching: Option<u32>,
        dir: Vec3,
    ) -> Option<f32> {
        let material = scene.material(surface);
        if scene.parts().own_boundaries {
            return (!material.is_null()).then_some(1.0);
        }
        let mut others = *self;
        if dir.dot(surface.ng) > 0.0 {
            others.cross(false, surface.material, touching);
        }
        let around = others.present(scene);
        let index = around.map_or(1.0, |other| scene.parts().materials[other as usize].ior);
        // An emissive surface is never hidden: light sampling must find the same emitters as paths.
        if material.emission != Rgb::ZERO {
            return Some(index);
        }
        let inside =
            |other| other == surface.material || scene.rank(other) > scene.rank(surface.material);
        let invisible = is_matched(material.ior / index) && material.is_clear();
        // A touching body ends where this body begins.
        let ends = |other| touching == Some(other) && other != surface.material;
        let hidden = around.is_some_and(|other| inside(other) && !ends(other));
        (!hidden && !invisible).then_some(index)
    }

    /// Makes the BSDF's index relative to the body outside of the surface, which a ray along `dir` hit.
    #[inline]
    pub(in crate::integrator) fn interface(
        &self,
        scene: &Scene,
        surface: &mut Surface,
        dir: Vec3,
        bsdf: &mut Bsdf,
    ) {
        if scene.features().overlaps
            && let Some(dielectric) = bsdf.dielectric_mut()
        {
            let touching = scene.touching(surface);
            let index = self.boundary(scene, surface, touching, dir);
            dielectric.eta /= index.unwrap_or(1.0);
        }
    }

    /// Follows a ray to the surface that ends it, through hidden boundaries, whose bodies it enters and leaves.
    #[inline]
    pub(in crate::integrator) fn follow(&mut self, scene: &Scene, ray: &Ray) -> Segment {
        self.follow_by(scene, ray, &mut |ray: &Ray| scene.intersect(ray))
    }

    /// The same where `closest` finds the closest hit along a ray.
    #[inline(always)]
    fn follow_by(&mut self, scene: &Scene, ray: &Ray, closest: &mut impl ClosestHit) -> Segment {
        if scene.features().overlaps {
            return self.follow_through(scene, ray, closest);
        }
        Segment {
            hit: closest(ray),
            start: 0.0,
            passed: None,
        }
    }

    /// [`EnclosingBodies::follow`] where a camera ray (`from_camera`) also passes the backs of surfaces that are
    /// visible only from the front. `closest` finds the closest hit along a ray.
    #[inline(always)]
    pub(super) fn follow_seen(
        &mut self,
        scene: &Scene,
        ray: &Ray,
        from_camera: bool,
        closest: &mut impl ClosestHit,
    ) -> Segment {
        let segment = self.follow_by(scene, ray, closest);
        match &segment.hit {
            Some(hit) if from_camera && scene.hides_back(hit, ray.dir) => {
                self.follow_past(scene, ray, segment, closest)
            }
            _ => segment,
        }
    }

    #[cold]
    #[inline(never)]
    fn follow_past(
        &mut self,
        scene: &Scene,
        ray: &Ray,
        mut segment: Segment,
        closest: &mut impl ClosestHit,
    ) -> Segment {
        for _ in 0..MAX_SURFACES {
            let Some(hit) = segment.hit.filter(|hit| scene.hides_back(hit, ray.dir)) else {
                return segment;
            };
            let mut rest = scene.surface(&hit).spawn(ray.dir);
            rest.t_max = ray.t_max - hit.t;
            let before = segment.passed.unwrap_or(Rgb::ONE)
                * self.transmittance(scene, hit.t - segment.start);
            let next = self.follow_by(scene, &rest, closest);
            segment = Segment {
                hit: next.hit.map(|h| Hit {
                    t: hit.t + h.t,
                    ..h
                }),
                start: hit.t + next.start,
                passed: Some(before * next.passed.unwrap_or(Rgb::ONE)),
            };
        }
        segment.hit = None;
        segment
    }

    /// [`EnclosingBodies::unblocked`] for a ray towards the camera. Up to its first hit a camera ray passes the backs
    /// of surfaces that are visible only from the front. Such backs are no vertices, and do not count as panes.
    pub(in crate::integrator) fn unblocked_to_camera(
        mut self,
        scene: &Scene,
        ray: &Ray,
        distance: f32,
        panes: u32,
    ) -> Option<Rgb> {
        let (mut rest, mut before) = (*ray, 0.0);
        // Transmittance if all surfaces so far count as panes, and if the camera ray passes the last as hidden backs.
        let (mut met, mut seen) = (Some(Rgb::ONE), Some(Rgb::ONE));
        for n in 0..MAX_SURFACES {
            let segment = self.follow(scene, &rest);
            let through = segment.passed.unwrap_or(Rgb::ONE);
            let end = (segment.hit.as_ref()).map_or(distance - before, |hit| hit.t);
            let through = through * self.transmittance(scene, end - segment.start);
            (met, seen) = (met.map(|m| m * through), seen.map(|s| s * through));
            let Some(hit) = segment.hit else {
                return seen;
            };
            let surface = scene.surface(&hit);
            met = met
                .filter(|_| n < panes as usize)
                .and_then(|met| Some(met * scene.pane_transmittance(&surface, ray.dir)?));
            if !scene.hides_back(&hit, -ray.dir) {
                seen = met;
            }
            // Blocked either way.
            met.or(seen)?;
            before += hit.t;
            rest = surface.spawn(ray.dir);
            rest.t_max = ray.t_max - before;
        }
        None
    }

    #[cold]
    #[inline(never)]
    fn follow_through(
        &mut self,
        scene: &Scene,
        ray: &Ray,
        closest: &mut impl ClosestHit,
    ) -> Segment {
        let mut rest = *ray;
        let mut segment = Segment {
            hit: None,
            start: 0.0,
            passed: None,
        };
        for _ in 0..MAX_SURFACES {
            let Some(hit) = closest(&rest) else {
                return segment;
            };
            let mut surface = scene.surface(&hit);
            let before = *self;
            if !self.passes(scene, &mut surface, ray.dir) {
                segment.hit = Some(Hit {
                    t: segment.start + hit.t,
                    ..hit
                });
                return segment;
            }
            let transmittance = before.transmittance(scene, hit.t);
            segment.passed = Some(segment.passed.unwrap_or(Rgb::ONE) * transmittance);
            segment.start += hit.t;
            rest = surface.spawn(ray.dir);
            rest.t_max = ray.t_max - segment.start;
        }
        segment
    }

    /// Transmittance along a ray, through partial opacity and at most `panes` panes; `None` if something else stands
    /// between its origin and its `t_max`.
    #[inline]
    pub(in crate::integrator) fn unblocked(
        self,
        scene: &Scene,
        ray: &Ray,
        distance: f32,
        panes: u32,
    ) -> Option<Rgb> {
        if scene.features().overlaps {
            return self.unblocked_through(scene, ray, distance, panes);
        }
        let passed = scene.open_transmittance(ray, panes)?;
        Some(passed * self.transmittance(scene, distance))
    }

    #[cold]
    #[inline(never)]
    fn unblocked_through(
        mut self,
        scene: &Scene,
        ray: &Ray,
        distance: f32,
        panes: u32,
    ) -> Option<Rgb> {
        let (mut rest, mut passed, mut distance) = (*ray, Rgb::ONE, distance);
        for _ in 0..=panes {
            let segment = self.follow(scene, &rest);
            passed *= segment.passed.unwrap_or(Rgb::ONE);
            let end = segment.hit.as_ref().map_or(distance, |hit| hit.t);
            passed *= self.transmittance(scene, end - segment.start);
            let Some(hit) = &segment.hit else {
                return Some(passed);
            };
            let surface = scene.surface(hit);
            passed *= scene.pane_transmittance(&surface, ray.dir)?;
            let t_max = rest.t_max - hit.t;
            distance -= hit.t;
            rest = surface.spawn(ray.dir);
            rest.t_max = t_max;
        }
        None
    }
}

/// A search for the closest hit along a ray.
pub(super) trait ClosestHit: FnMut(&Ray) -> Option<Hit> {}

impl<F: FnMut(&Ray) -> Option<Hit>> ClosestHit for F {}

/// Segment of a path from a point to the surface that ends it, with the boundaries that it passed.
pub(in crate::integrator) struct Segment {
    /// The surface, at its distance from the point; `None` if there is none.
    pub(in crate::integrator) hit: Option<Hit>,
    /// Distance of the last boundary that was passed.
    pub(in crate::integrator) start: f32,
    /// Transmittance up to there; `None` if no boundary was passed.
    pub(in crate::integrator) passed: Option<Rgb>,
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
        for depth in [1, 4, 5, MAX_BODIES as u32] {
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
        let most = MAX_BODIES as u32;
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
