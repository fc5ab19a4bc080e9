//! The camera for a file without one: what it frames, and from which side.

use super::{Camera, Hit, Mesh, Scene, SceneParts};
use crate::math::{DVec3, Ray, Rgb, Vec3};
use crate::scene::camera::Fit;
use glam::DAffine3;

/// Extent of a flat mesh, over that of all smaller meshes together, above which it is the ground beneath them.
const GROUND: f64 = 4.0;

/// Extent of a mesh around all smaller meshes, over theirs, above which it is their sky.
const SKY: f64 = 10.0;

/// Largest height of a ground over its shorter horizontal side.
const FLAT: f64 = 0.1;

/// Number of the largest meshes that may be ground and sky.
const SURROUNDINGS: usize = 3;

/// Distance of a small mesh, over the extent of all others, above which the picture leaves it out.
const FAR: f64 = 4.0;

/// Number of rays from the middle of a room that search for walls.
const LOOKS: u32 = 256;

/// Least share of these rays that hit the walls of a room.
const WALLS: f64 = 0.7;

/// Least cosine with a side's direction of the rays that must hit nothing if the side is open.
const OPEN: f32 = 0.92;

/// The box around a mesh or an instance.
#[derive(Clone, Copy)]
struct Part {
    low: DVec3,
    high: DVec3,
    emits: bool,
}

impl Part {
    const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
        emits: true,
    };

    fn of(points: impl Iterator<Item = DVec3>, emits: bool) -> Option<Self> {
        let empty = Self {
            emits,
            ..Self::EMPTY
        };
        let part = points
            .filter(|p| p.is_finite())
            .fold(empty, |part, p| Self {
                low: part.low.min(p),
                high: part.high.max(p),
                ..part
            });
        (part.low.x <= part.high.x).then_some(part)
    }

    fn with(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            emits: self.emits && other.emits,
        }
    }

    fn extent(&self) -> f64 {
        (self.high - self.low).max_element()
    }

    /// True for the ground or the sky of the smaller parts, which must not all be lamps.
    fn surrounds(&self, smaller: &Self) -> bool {
        let size = self.high - self.low;
        let is_flat = size.y <= FLAT * size.x.min(size.z);
        let ratio = if is_flat { GROUND } else { SKY };
        let inside = self.low.x <= smaller.low.x
            && self.low.z <= smaller.low.z
            && self.high.x >= smaller.high.x
            && self.high.z >= smaller.high.z;
        !smaller.emits
            && smaller.extent() > 0.0
            && inside
            && self.extent() > ratio * smaller.extent()
    }

    /// True if the part is smaller than the others and far from them.
    fn is_far_from(&self, others: &Self) -> bool {
        let apart = (self.low - others.high).max(others.low - self.high);
        let extent = others.extent();
        !others.emits
            && extent > 0.0
            && self.extent() < extent
            && apart.max_element() > FAR * extent
    }
}

/// Box and points of each mesh, and of each instance of a shared mesh.
fn shown(parts: &SceneParts) -> Vec<(Part, Points<'_>)> {
    let emits = |mesh: &Mesh| {
        let material = parts.materials.get(mesh.material as usize);
        material.is_some_and(|m| m.emission != Rgb::ZERO)
    };
    let mut all = Vec::new();
    let own = parts.meshes.len() - usize::from(parts.has_floor);
    for mesh in &parts.meshes[..own] {
        let points = Points::Mesh(mesh);
        all.extend(Part::of(points.iter(), emits(mesh)).map(|part| (part, points)));
    }
    for shared in &parts.shared {
        let own = shared.mesh.positions.iter().map(|p| p.as_dvec3());
        let Some(own) = Part::of(own, emits(&shared.mesh)) else {
            continue;
        };
        for pose in &shared.poses {
            let points = Points::Instance(own, pose);
            all.extend(Part::of(points.iter(), own.emits).map(|part| (part, points)));
        }
    }
    all
}

/// Points that a camera frames.
#[derive(Clone, Copy)]
enum Points<'a> {
    /// Vertices of a mesh.
    Mesh(&'a Mesh),
    /// Corners of the box of a shared mesh at a pose.
    Instance(Part, &'a DAffine3),
}

impl Points<'_> {
    fn iter(&self) -> impl Iterator<Item = DVec3> {
        let (mesh, corners) = match *self {
            Self::Mesh(mesh) => (mesh.positions.as_slice(), None),
            Self::Instance(Part { low, high, .. }, pose) => {
                let corners = corners(low, high).map(|p| pose.transform_point3(p));
                (&[][..], Some(corners))
            }
        };
        mesh.iter()
            .map(|p| p.as_dvec3())
            .chain(corners.into_iter().flatten())
    }
}

/// Corners of a box.
pub(super) fn corners(low: DVec3, high: DVec3) -> [DVec3; 8] {
    std::array::from_fn(|i| {
        let pick = |bit: usize, low: f64, high: f64| if i >> bit & 1 == 0 { low } else { high };
        DVec3::new(
            pick(0, low.x, high.x),
            pick(1, low.y, high.y),
            pick(2, low.z, high.z),
        )
    })
}

/// Lowest and highest corner of the box around all parts except the floor of the studio.
pub(super) fn bounds(parts: &SceneParts) -> Option<[DVec3; 2]> {
    around(&shown(parts))
}

/// Lowest and highest corner of the box around the subject; `None` also if the parts have a ground or a sky.
pub(super) fn bounds_on_nothing(parts: &SceneParts) -> Option<[DVec3; 2]> {
    let (subject, surrounded) = subject(shown(parts));
    around(&subject).filter(|_| !surrounded)
}

fn around(all: &[(Part, Points<'_>)]) -> Option<[DVec3; 2]> {
    let all = (all.iter()).fold(Part::EMPTY, |all, (part, _)| all.with(*part));
    (all.low.x <= all.high.x).then_some([all.low, all.high])
}

/// The subject: all parts except grounds, skies and small distant parts. True if there are grounds or skies.
fn subject(mut all: Vec<(Part, Points<'_>)>) -> (Vec<(Part, Points<'_>)>, bool) {
    all.sort_by(|(a, _), (b, _)| a.extent().total_cmp(&b.extent()));
    let mut smaller = vec![Part::EMPTY];
    for (part, _) in &all {
        smaller.push(smaller[smaller.len() - 1].with(*part));
    }
    let surround = |k: &usize| {
        all[*k..]
            .iter()
            .all(|(part, _)| part.surrounds(&smaller[*k]))
    };
    let least = all.len().saturating_sub(SURROUNDINGS);
    let first = (least..all.len()).rev().find(surround);
    all.truncate(first.unwrap_or(all.len()));
    let mut larger = Part::EMPTY;
    let mut kept = Vec::new();
    for (i, part) in all.into_iter().enumerate().rev() {
        let others = smaller[i].with(larger);
        larger = larger.with(part.0);
        if !part.0.is_far_from(&others) {
            kept.push(part);
        }
    }
    (kept, first.is_some())
}

impl Scene {
    /// Camera for a file that has none, for a picture of the given width over height: in three-quarter view from the
    /// front, or through the open side of a room. It frames the vertices of the scene except ground, sky and small
    /// distant parts.
    pub fn framing_camera(&self, aspect: f32) -> Camera {
        let (subject, _) = subject(shown(&self.parts));
        let Some([low, high]) = around(&subject) else {
            return Camera::framing(self.geometry.bounds(), aspect);
        };
        let side = self.open_side(0.5 * (low + high), (high - low).max_element());
        let mut fit = Fit::new(aspect, side);
        for (_, points) in &subject {
            points
                .iter()
                .filter(|p| p.is_finite())
                .for_each(|p| fit.add(p));
        }
        fit.camera()
            .unwrap_or_else(|| Camera::framing(self.geometry.bounds(), aspect))
    }

    /// Horizontal direction of the open side of a room with this middle; `None` unless walls are on all other sides.
    fn open_side(&self, middle: DVec3, extent: f64) -> Option<DVec3> {
        let from = middle.as_vec3();
        let beyond = 2.0 * extent as f32;
        let free = |dir: Vec3| {
            let mut ray = Ray::new(from, dir);
            ray.t_max = beyond;
            let floor = |hit: &Hit| {
                (self.parts.floor()).is_some_and(|mesh| {
                    self.geometry.triangle_material(hit.triangle) == mesh.material
                })
            };
            self.intersect(&ray).is_none_or(|hit| floor(&hit))
        };
        let golden = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
        let dirs: Vec<Vec3> = (0..LOOKS)
            .map(|i| {
                let y = 1.0 - (2.0 * i as f32 + 1.0) / LOOKS as f32;
                let (radius, angle) = ((1.0 - y * y).sqrt(), golden * i as f32);
                Vec3::new(radius * angle.cos(), y, radius * angle.sin())
            })
            .collect();
        let open: Vec<Vec3> = dirs.into_iter().filter(|dir| free(*dir)).collect();
        if open.len() as f64 > (1.0 - WALLS) * f64::from(LOOKS) {
            return None;
        }
        // 90 % of the expected number of rays in the spherical cap of a side: with that number free, the side is open.
        let least = 0.9 * 0.5 * (1.0 - OPEN) * LOOKS as f32;
        [DVec3::Z, DVec3::X, DVec3::NEG_X, DVec3::NEG_Z]
            .into_iter()
            .find(|side| {
                let within = open.iter().filter(|d| d.dot(side.as_vec3()) > OPEN);
                within.count() as f32 >= least
            })
    }
}
