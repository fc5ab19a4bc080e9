//! Targets at which emission samples are aimed: spheres around casters of caustics and around what the camera sees.
//!
//! Light paths that start uniformly rarely hit a glass in a large scene. An [`AimShares`] sends a share of them through
//! spheres: p = u · p_uniform + Σ qₜ [the ray meets sphere t] / Aₜ, with Aₜ the sphere's cross section for light from
//! infinity, or the solid angle of its cone for a lamp. The density of every ray is known in closed form, so that all
//! MIS weights stay exact.

use crate::math::{Frame, Ray, Vec2, Vec3, warp};
use std::f32::consts::{PI, TAU};

/// Least share of uniform emission: light that no target covers has at most twice the variance without aiming.
pub(crate) const MIN_UNIFORM: f32 = 0.5;

/// Relative rounding error of the distance of a ray from a centre, over the centre's distance from the ray's origin.
const SLACK: f32 = 1e-6;

/// A sphere at which light is aimed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Target {
    /// Centre in world space.
    pub centre: Vec3,
    /// Radius in world units.
    pub radius: f32,
}

/// Distribution of the aimed emission samples of a light.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct AimShares {
    /// Share of uniform emission.
    uniform: f32,
    /// Targets, with the share of each.
    targets: Vec<(Target, f32)>,
}

/// The beams of all lights; the default aims none.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Aim {
    beams: Vec<Option<AimShares>>,
    /// Beam of each light, by its index as in [`Lights::pmf`](super::Lights::pmf); empty if no light is aimed.
    of_light: Vec<u8>,
}

impl Aim {
    /// Beams, fewer than 256, and the index of each light's beam. A light whose beam is `None` emits uniformly.
    pub(crate) fn new(beams: Vec<Option<AimShares>>, of_light: Vec<u8>) -> Self {
        if beams.iter().all(Option::is_none) {
            return Self::default();
        }
        Self { beams, of_light }
    }

    /// True if all light is emitted uniformly.
    pub(crate) fn is_uniform(&self) -> bool {
        self.of_light.is_empty()
    }

    /// The beam of a light, if it is aimed.
    #[inline]
    pub(crate) fn beam(&self, light: usize) -> Option<&AimShares> {
        let beam = *self.of_light.get(light)?;
        self.beams[usize::from(beam)].as_ref()
    }
}

/// Starting point of emission at finite distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    pub position: Vec3,
    /// Normal of a surface that emits only to its front; `None` for other lights.
    pub facing: Option<Vec3>,
}

impl Target {
    /// True if the infinite line of a ray passes through the sphere. A tolerance for rounding errors ensures that no
    /// ray drawn through the sphere fails.
    #[inline]
    fn is_hit(&self, ray: &Ray) -> bool {
        let to = self.centre - ray.origin;
        let reach = self.radius + SLACK * to.length();
        (to - to.dot(ray.dir) * ray.dir).length_squared() <= reach * reach
    }

    /// 1 − cos of the half angle of the cone that the sphere subtends; `None` from inside, and where all of it lies
    /// behind a surface that emits to its front.
    #[inline]
    fn width(&self, from: &Source) -> Option<f32> {
        let to = self.centre - from.position;
        let sin2 = self.radius * self.radius / to.length_squared();
        let behind = |normal: Vec3| to.dot(normal) <= -self.radius;
        // False also for the NaN of a point target at the source.
        let outside = sin2 < 0.999;
        if !outside || from.facing.is_some_and(behind) {
            return None;
        }
        Some(sin2 / (1.0 + (1.0 - sin2).sqrt()))
    }
}

impl Target {
    /// Density per area across a ray of light from infinity that is sent through the sphere.
    #[inline]
    pub(super) fn pdf_across(&self, ray: &Ray) -> f32 {
        if self.is_hit(ray) {
            1.0 / (PI * self.radius * self.radius)
        } else {
            0.0
        }
    }

    /// Density per steradian of light from a source that is sent through the sphere; `None` if [`Target::width`] is.
    #[inline]
    pub(super) fn pdf_towards(&self, from: &Source, dir: Vec3) -> Option<f32> {
        let width = self.width(from)?;
        let ahead = (self.centre - from.position).dot(dir) > 0.0;
        let met = ahead && self.is_hit(&Ray::new(from.position, dir));
        Some(if met { 1.0 / (TAU * width) } else { 0.0 })
    }
}

impl AimShares {
    /// A beam with these shares at its targets, all together at most 1 − `MIN_UNIFORM`.
    pub(crate) fn new(targets: Vec<(Target, f32)>) -> Self {
        let aimed: f32 = targets.iter().map(|(_, share)| share).sum();
        debug_assert!(aimed <= 1.0 - MIN_UNIFORM + 1e-5);
        Self {
            uniform: 1.0 - aimed,
            targets,
        }
    }

    /// Density per area across a ray of light from infinity, where uniform emission has `uniform`.
    #[inline]
    pub(super) fn pdf_across(&self, ray: &Ray, uniform: f32) -> f32 {
        let part = |(target, share): &(Target, f32)| share * target.pdf_across(ray);
        self.uniform * uniform + self.targets.iter().map(part).sum::<f32>()
    }

    /// A point of the disk of a target across `dir`, chosen with `pick`; `None` where uniform emission is chosen.
    pub(super) fn point_across(&self, dir: Vec3, pick: f64, u: Vec2) -> Option<Vec3> {
        let shares = self.targets.iter().map(|(_, share)| *share);
        let k = chosen(shares, self.uniform, pick)?;
        let (target, _) = self.targets[k];
        let p = target.radius * warp::disk(u);
        Some(target.centre + Frame::from_normal(dir).to_world(p.extend(0.0)))
    }

    /// Density per steradian of a ray from a light at finite distance, where uniform emission has `uniform`.
    #[inline]
    pub(super) fn pdf_towards(&self, from: &Source, dir: Vec3, uniform: f32) -> f32 {
        let (mut total, mut aimed) = (self.uniform, 0.0);
        for (target, share) in &self.targets {
            if let Some(pdf) = target.pdf_towards(from, dir) {
                total += share;
                aimed += share * pdf;
            }
        }
        (self.uniform * uniform + aimed) / total
    }

    /// A direction from a light at finite distance towards a target, chosen with `pick`; `None` where uniform emission
    /// is chosen.
    pub(super) fn direction(&self, from: &Source, pick: f64, u: Vec2) -> Option<Vec3> {
        let share = |(target, share): &(Target, f32)| target.width(from).map_or(0.0, |_| *share);
        let k = chosen(self.targets.iter().map(share), self.uniform, pick)?;
        let (target, _) = self.targets[k];
        let axis = (target.centre - from.position).normalize();
        Some(Frame::from_normal(axis).to_world(warp::cone(u, target.width(from)?)))
    }
}

/// Index of the share that `pick` in [0, 1) chooses, `None` for the share `uniform`; shares need not add up to 1.
fn chosen(shares: impl Iterator<Item = f32> + Clone, uniform: f32, pick: f64) -> Option<usize> {
    let total = f64::from(uniform) + shares.clone().map(f64::from).sum::<f64>();
    let mut rest = pick * total - f64::from(uniform);
    if rest < 0.0 {
        return None;
    }
    let mut last = None;
    for (k, share) in shares.enumerate().filter(|(_, share)| *share > 0.0) {
        last = Some(k);
        rest -= f64::from(share);
        if rest < 0.0 {
            break;
        }
    }
    last
}
