//! Texture coordinates by position: pbrt's planar, spherical and cylindrical mappings `[PBRT4 §10.2]`, as second pair.

use super::tokens::Parameters;
use super::{Scene, affine};
use glam::{Affine2, DAffine3, DVec2, DVec3};
use opsr::math::{Vec2, Vec3};
use opsr::scene::Mesh;
use opsr::scene::load::error::{Result, fault};
use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// Axes of s and t, and the coordinates of the origin.
    Planar([DVec3; 2], DVec2),
    Spherical,
    Cylindrical,
    /// Angle and normalised height of the direction to the point: the cylindrical mapping of version 3.
    OldCylindrical,
}

/// A mapping, and the transform to its own space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Mapping {
    kind: Kind,
    pose: DAffine3,
}

impl Mapping {
    /// Coordinates of a point. The angular coordinate of a point on the axis is NaN.
    fn at(&self, p: Vec3) -> DVec2 {
        let p = self.pose.transform_point3(p.as_dvec3());
        let round = match p.x == 0.0 && p.y == 0.0 {
            true => f64::NAN,
            false => p.y.atan2(p.x) / TAU,
        };
        let height = p.z / p.length().max(f64::MIN_POSITIVE);
        match self.kind {
            Kind::Planar([s, t], shift) => shift + DVec2::new(p.dot(s), p.dot(t)),
            // The azimuth from 0 to 2π becomes [0, 1].
            Kind::Spherical => {
                let azimuth = if round < 0.0 { 1.0 + round } else { round };
                DVec2::new(height.clamp(-1.0, 1.0).acos() / PI, azimuth)
            }
            Kind::Cylindrical => DVec2::new(0.5 + round, p.z),
            Kind::OldCylindrical => DVec2::new(0.5 + round, height),
        }
    }

    /// Index of the angular coordinate.
    fn round(&self) -> Option<usize> {
        match self.kind {
            Kind::Planar(..) => None,
            Kind::Spherical => Some(1),
            _ => Some(0),
        }
    }

    /// Coordinates on one side of the seam, beyond 0 and 1 if need be. A corner on the axis gets the others' mean.
    fn together(&self, mut corners: [DVec2; 3]) -> [DVec2; 3] {
        let Some(axis) = self.round() else {
            return corners;
        };
        let all = corners.map(|c| c[axis]);
        let first = all.into_iter().find(|x| !x.is_nan()).unwrap_or(0.0);
        let near = all.map(|x| x - (x - first).round());
        let known = near.iter().filter(|x| !x.is_nan());
        let mean = known.clone().sum::<f64>() / known.count().max(1) as f64;
        for (corner, x) in corners.iter_mut().zip(near) {
            corner[axis] = if x.is_nan() { mean } else { x };
        }
        corners
    }

    /// True if coordinates along an edge deviate from linear by more than 0.001, or turn by more than a sixteenth.
    fn bends(&self, a: Vec3, b: Vec3) -> bool {
        // Three points, because the middle of a symmetric edge does not deviate.
        [0.25, 0.5, 0.75].into_iter().any(|t| {
            let [a, m, b] = self.together([a, a.lerp(b, t), b].map(|p| self.at(p)));
            let turn = self.round().map_or(0.0, |axis| (b - a)[axis].abs());
            let off = (m - a.lerp(b, f64::from(t))).abs().max_element();
            turn > 1.0 / 16.0 || off > 1e-3
        })
    }
}

/// Shortest edge that is split, relative to the diagonal of the mesh.
const FINEST: f32 = 1.0 / 256.0;

/// A mesh with a mapping's coordinates as its second pair; `None` beyond `most` triangles. Triangles are split at the
/// middle of their longest edge as long as the mapping is not linear along their edges.
fn mapped(source: &Mesh, mapping: &Mapping, most: usize) -> Option<Mesh> {
    let ends = |of: fn(Vec3, Vec3) -> Vec3| source.positions.iter().copied().reduce(of);
    let (low, high) = ends(Vec3::min).zip(ends(Vec3::max)).unwrap_or_default();
    let least = FINEST * low.distance(high);
    // Position, normal, coordinates.
    let corner = |i: u32| {
        let (i, or) = (i as usize, Vec3::ZERO);
        let normal = source.normals.get(i).copied().unwrap_or(or);
        let uv = source.uvs.get(i).map_or(or, |uv| uv.extend(0.0));
        [source.positions[i], normal, uv]
    };
    let faces = source.indices.iter().map(|face| face.map(corner));
    let mut rest: Vec<[[Vec3; 3]; 3]> = faces.collect();
    let (mut out, mut known) = (Mesh::default(), HashMap::new());
    while let Some(face) = rest.pop() {
        let edge = |k: usize| (face[k][0], face[(k + 1) % 3][0]);
        let length = |k: usize| edge(k).0.distance(edge(k).1);
        let bends = |k: usize| length(k) > least && mapping.bends(edge(k).0, edge(k).1);
        // The longest edge, whether it bends or not: other splits would leave ever thinner slivers.
        let longest = (0..3).max_by(|&i, &j| length(i).total_cmp(&length(j)));
        if let Some(k) = longest.filter(|_| (0..3).any(bends)) {
            let [a, b, c] = [0, 1, 2].map(|i| face[(k + i) % 3]);
            let middle = [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]));
            rest.extend([[a, middle, c], [middle, b, c]]);
            (out.indices.len() + rest.len() <= most).then_some(())?;
            continue;
        }
        let second = mapping.together(face.map(|corner| mapping.at(corner[0])));
        // Vertices on a seam have coordinates on either side of it.
        let indices = [0, 1, 2].map(|k| {
            let ([position, normal, uv], second) = (face[k], second[k].as_vec2());
            let key = [position, normal, uv, second.extend(0.0)];
            let key = key.map(|v| v.to_array().map(f32::to_bits));
            *known.entry(key).or_insert_with(|| {
                out.positions.push(position);
                out.normals.push(normal.normalize_or_zero());
                out.uvs.push(uv.truncate());
                out.second_uvs.push(second);
                out.positions.len() as u32 - 1
            })
        });
        out.indices.push(indices);
    }
    if source.normals.is_empty() {
        out.normals.clear();
    }
    out.name.clone_from(&source.name);
    Some(out)
}

impl Scene<'_> {
    /// Transform from mesh to texture coordinates; true if those are the second pair, by a mapping that is stored.
    pub(super) fn upward(&mut self, parameters: &Parameters) -> Result<(Affine2, bool)> {
        let place = &parameters.place;
        let of = |name: &str, or: f64| parameters.number(name, or).map(|x| x as f32);
        let scale = Vec2::new(of("uscale", 1.0)?, of("vscale", 1.0)?);
        let shift = Vec2::new(of("udelta", 0.0)?, of("vdelta", 0.0)?);
        let axis = |name: &str, or: DVec3| parameters.vector(name, or.to_array()).map(DVec3::from);
        let axes = [axis("v1", DVec3::X)?, axis("v2", DVec3::Y)?];
        let kind = match parameters.text("mapping")?.unwrap_or("uv") {
            "planar" => Kind::Planar(axes, shift.as_dvec2()),
            "spherical" => Kind::Spherical,
            "cylindrical" if self.is_old => Kind::OldCylindrical,
            "cylindrical" => Kind::Cylindrical,
            other => {
                if other != "uv" {
                    (self.context).nearest(place, format!("mapping `{other}`"), "`uv`")?;
                }
                return Ok((
                    Affine2::from_scale_angle_translation(scale, 0.0, shift),
                    false,
                ));
            }
        };
        // In version 3 the planes are in world space.
        let pose = match (kind, self.is_old) {
            (Kind::Planar(..), true) => DAffine3::IDENTITY,
            _ => affine(&self.state.pose, place)?.inverse(),
        };
        if !pose.is_finite() || !axes.iter().all(|axis| axis.is_finite()) {
            return Err(fault(place, "a mapping that is not finite"));
        }
        self.takes(Some(Mapping { kind, pose }), place)?;
        Ok((Affine2::IDENTITY, true))
    }

    /// Stores the mapping of a texture or a material. The first one, the base colour's, is used.
    pub(super) fn takes(&mut self, mapping: Option<Mapping>, place: &str) -> Result<()> {
        if self.mapping.is_some() && mapping.is_some() && self.mapping != mapping {
            (self.context).nearest(place, "a second mapping of one surface", "the first")?;
        }
        self.mapping = self.mapping.or(mapping);
        Ok(())
    }

    /// A mesh with the coordinates of a mapping at a pose, computed once.
    pub(super) fn mapped(
        &mut self,
        mesh: u32,
        mapping: Mapping,
        pose: &DAffine3,
        place: &str,
    ) -> Result<u32> {
        if self.object.is_some() {
            let what = "a mapping of an object stays with it: pbrt's stays in the world";
            self.context.approximate(place, what);
        }
        let key = format!("{mapping:?} {mesh} {pose:?}");
        if let Some(&known) = self.context.meshes.get(&key) {
            return Ok(known);
        }
        let pose = mapping.pose * *pose;
        let source = self.context.builder.mesh_mut(mesh);
        let made = mapped(source, &Mapping { pose, ..mapping }, 1 << 22);
        let made = made.ok_or_else(|| fault(place, "too many triangles under a mapping"))?;
        let made = self.context.builder.mesh(made);
        self.context.meshes.insert(key, made);
        Ok(made)
    }
}
