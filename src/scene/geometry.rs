//! Triangles in scene order, their attributes, and the tree over them.

use super::accel::Accel;
use super::material::{AlphaMode, TextureRef};
use super::{Hit, Material, Mesh, SceneParts, Surface, Texture};
use crate::math::{Frame, Ray, Vec2, Vec3};
use std::ops::{Add, Mul};

/// Half a unit in the last place, relative.
const HALF_ULP: f32 = 0.5 * f32::EPSILON;

/// All triangles of a scene.
pub struct Geometry {
    accel: Accel,
    corners: Vec<[Vec3; 3]>,
    /// Mesh and face each triangle came from.
    sources: Vec<[u32; 2]>,
    /// Material of each mesh.
    materials: Vec<u32>,
    /// Whether opacity may remove a hit of the triangle; empty if it never does.
    cutouts: Vec<bool>,
}

impl Geometry {
    /// Collects the triangles of all meshes and builds the tree.
    pub fn new(parts: &SceneParts, warnings: &mut Vec<String>) -> Self {
        let mut corners = Vec::new();
        let mut sources = Vec::new();
        for (m, mesh) in parts.meshes.iter().enumerate() {
            if mesh.material as usize >= parts.materials.len() {
                warnings.push(format!(
                    "mesh {m}: dropped, it names material {} of {}",
                    mesh.material,
                    parts.materials.len()
                ));
                continue;
            }
            let before = corners.len();
            for (face, indices) in mesh.indices.iter().enumerate() {
                if let Some(triangle) = usable(mesh, indices) {
                    corners.push(triangle);
                    sources.push([m as u32, face as u32]);
                }
            }
            let dropped = mesh.indices.len() - (corners.len() - before);
            if dropped > 0 {
                warnings.push(format!(
                    "mesh {m}: dropped {dropped} of {} triangles (no area, not finite, or missing corners)",
                    mesh.indices.len()
                ));
            }
        }
        let materials: Vec<u32> = parts.meshes.iter().map(|m| m.material).collect();
        let cut: Vec<bool> = parts.materials.iter().map(may_vanish).collect();
        let mut cutouts = Vec::new();
        if cut.contains(&true) {
            let of = |s: &[u32; 2]| cut[materials[s[0] as usize] as usize];
            cutouts = sources.iter().map(of).collect();
            if !cutouts.contains(&true) {
                cutouts.clear();
            }
        }
        Self {
            accel: Accel::new(&corners),
            corners,
            sources,
            materials,
            cutouts,
        }
    }

    /// Number of triangles.
    pub fn len(&self) -> usize {
        self.corners.len()
    }

    /// Whether there is no triangle.
    pub fn is_empty(&self) -> bool {
        self.corners.is_empty()
    }

    /// Corners of a triangle, counter-clockwise seen from the front.
    #[inline]
    pub fn triangle(&self, i: u32) -> [Vec3; 3] {
        self.corners[i as usize]
    }

    /// Index of a triangle's material.
    #[inline]
    pub fn triangle_material(&self, i: u32) -> u32 {
        self.materials[self.sources[i as usize][0] as usize]
    }

    /// Texture coordinates of a triangle's corners; zero where the mesh has none.
    #[inline]
    pub fn triangle_uvs(&self, parts: &SceneParts, i: u32) -> [Vec2; 3] {
        let (mesh, indices) = self.source(parts, i);
        attribute(&mesh.uvs, indices).unwrap_or([Vec2::ZERO; 3])
    }

    /// Area of a triangle.
    #[inline]
    pub fn triangle_area(&self, i: u32) -> f32 {
        let [a, b, c] = self.triangle(i);
        (0.5 * normal(a, b, c).length()) as f32
    }

    /// Unit normal of a triangle, towards its front.
    #[inline]
    pub fn triangle_normal(&self, i: u32) -> Vec3 {
        let [a, b, c] = self.triangle(i);
        normal(a, b, c).normalize().as_vec3()
    }

    /// Whether opacity may remove a hit.
    #[inline]
    pub fn has_opacity(&self) -> bool {
        !self.cutouts.is_empty()
    }

    /// Lower and upper corner of the scene; both zero if it is empty.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        self.accel.bounds()
    }

    /// Closest hit; parts that opacity removes are skipped.
    #[inline]
    pub fn intersect(&self, parts: &SceneParts, ray: &Ray) -> Option<Hit> {
        if self.cutouts.is_empty() {
            self.accel.closest(ray)
        } else {
            self.accel
                .closest_where(ray, |hit| self.present(parts, ray, hit))
        }
    }

    /// Any hit before the ray's end.
    #[inline]
    pub fn occluded(&self, parts: &SceneParts, ray: &Ray) -> bool {
        if self.cutouts.is_empty() {
            self.accel.any(ray)
        } else {
            self.accel
                .any_where(ray, |hit| self.present(parts, ray, hit))
        }
    }

    /// Interpolates a hit.
    pub fn surface(&self, parts: &SceneParts, ray: &Ray, hit: &Hit) -> Surface {
        let [a, b, c] = self.triangle(hit.triangle);
        let weights = [(1.0 - hit.u - hit.v).max(0.0), hit.u, hit.v];
        let origin = a.as_dvec3();
        let (e, f) = (b.as_dvec3() - origin, c.as_dvec3() - origin);
        let ng = e.cross(f).normalize().as_vec3();
        // On the plane but for the rounding to single precision.
        let position = (origin + f64::from(hit.u) * e + f64::from(hit.v) * f).as_vec3();
        // A spawned origin is off by that rounding and by its own, half a unit in the last place each; the test that
        // meets it knows the side of the plane exactly. [PBRT4 §6.8] has to allow for γ₇ of the corners' size.
        let rounding = 3.0 * HALF_ULP * position.abs().dot(ng.abs());
        let extent = e.abs().max(f.abs()).max_element() as f32;
        let (mesh, indices) = self.source(parts, hit.triangle);
        let uv = attribute(&mesh.uvs, indices).map_or(Vec2::ZERO, |uv| mix(&weights, uv));
        let mut ns = attribute(&mesh.normals, indices)
            .and_then(|n| mix(&weights, n).try_normalize())
            .unwrap_or(ng);
        let flipped = ns.dot(ng) < 0.0;
        let material = &parts.materials[mesh.material as usize];
        if let Some(map) = &material.normal_texture {
            let edges = [e.as_vec3(), f.as_vec3()];
            if let Some((tangent, hand)) = tangent(mesh, indices, &weights, edges, map, ns) {
                let local = normal_texel(&parts.textures, map, uv, material.normal_scale);
                ns = perturbed(ns, tangent, hand, local);
            }
        }
        if flipped {
            ns = -ns;
        }
        Surface {
            position,
            ng,
            frame: Frame::from_normal(facing(ns, ng, -ray.dir)),
            uv,
            triangle: hit.triangle,
            material: mesh.material,
            error: rounding + 1e-13 * extent,
        }
    }

    #[inline]
    fn source<'a>(&self, parts: &'a SceneParts, i: u32) -> (&'a Mesh, &'a [u32; 3]) {
        let [mesh, face] = self.sources[i as usize];
        let mesh = &parts.meshes[mesh as usize];
        (mesh, &mesh.indices[face as usize])
    }

    /// Whether opacity leaves this hit in place.
    fn present(&self, parts: &SceneParts, ray: &Ray, hit: &Hit) -> bool {
        if !self.cutouts[hit.triangle as usize] {
            return true;
        }
        let material = &parts.materials[self.triangle_material(hit.triangle) as usize];
        let texel = material.base_color_texture.as_ref().map_or(1.0, |map| {
            let uvs = self.triangle_uvs(parts, hit.triangle);
            let uv = mix(&[1.0 - hit.u - hit.v, hit.u, hit.v], uvs);
            let texture = parts.textures.get(map.texture as usize);
            texture.map_or(1.0, |t| t.sample(map.transform.transform_point2(uv))[3])
        });
        let opacity = material.opacity * texel;
        match material.alpha_mode {
            AlphaMode::Opaque => true,
            AlphaMode::Mask(cutoff) => opacity >= cutoff,
            AlphaMode::Blend => chance(ray, hit.triangle) < opacity,
        }
    }
}

/// The corners, if all are there, finite, and span an area.
fn usable(mesh: &Mesh, indices: &[u32; 3]) -> Option<[Vec3; 3]> {
    let triangle = attribute(&mesh.positions, indices)?;
    let [a, b, c] = triangle;
    let area = normal(a, b, c).length();
    (Accel::accepts(&triangle) && area > 0.0).then_some(triangle)
}

/// The values of an attribute at three corners; `None` if it is absent or too short.
#[inline]
fn attribute<T: Copy>(values: &[T], indices: &[u32; 3]) -> Option<[T; 3]> {
    let at = |k: usize| values.get(indices[k] as usize).copied();
    Some([at(0)?, at(1)?, at(2)?])
}

/// Normal by winding, twice the area long; in double precision, exact enough for the thinnest sliver.
#[inline]
fn normal(a: Vec3, b: Vec3, c: Vec3) -> glam::DVec3 {
    let a = a.as_dvec3();
    (b.as_dvec3() - a).cross(c.as_dvec3() - a)
}

/// Interpolates between corners.
#[inline]
fn mix<T: Copy + Mul<f32, Output = T> + Add<Output = T>>(weights: &[f32; 3], at: [T; 3]) -> T {
    at[0] * weights[0] + at[1] * weights[1] + at[2] * weights[2]
}

/// The normal map's direction in tangent space, not yet normalised `[glTF §3.9.3]`.
fn normal_texel(textures: &[Texture], map: &TextureRef, uv: Vec2, scale: f32) -> Vec3 {
    let at = map.transform.transform_point2(uv);
    let [x, y, z, _] =
        (textures.get(map.texture as usize)).map_or([0.5, 0.5, 1.0, 1.0], |t| t.sample(at));
    (2.0 * Vec3::new(x, y, z) - 1.0) * Vec3::new(scale, scale, 1.0)
}

/// Tangent and handedness: the mesh's own, or along u. The map's green channel points up, against v `[glTF §3.9.3]`.
fn tangent(
    mesh: &Mesh,
    indices: &[u32; 3],
    weights: &[f32; 3],
    edges: [Vec3; 2],
    map: &TextureRef,
    ns: Vec3,
) -> Option<(Vec3, f32)> {
    if let Some(t) = attribute(&mesh.tangents, indices) {
        return Some((mix(weights, t).truncate(), t[0].w));
    }
    let [a, b, c] = attribute(&mesh.uvs, indices)?.map(|uv| map.transform.transform_point2(uv));
    let (d, e) = (b - a, c - a);
    let det = d.perp_dot(e);
    let along_u = (edges[0] * e.y - edges[1] * d.y) * det;
    let along_v = (edges[1] * d.x - edges[0] * e.x) * det;
    let hand = if ns.cross(along_u).dot(along_v) > 0.0 {
        -1.0
    } else {
        1.0
    };
    (det != 0.0).then_some((along_u, hand))
}

/// The normal that a normal map makes of `ns`.
fn perturbed(ns: Vec3, tangent: Vec3, hand: f32, local: Vec3) -> Vec3 {
    let Some(t) = (tangent - ns * ns.dot(tangent)).try_normalize() else {
        return ns;
    };
    let b = hand * ns.cross(t);
    let n = local.x * t + local.y * b + local.z * ns;
    n.try_normalize().unwrap_or(ns)
}

/// Bends the shading normal towards `ng` just so far that it is on the same side and that `wo` sees the same side of
/// both.
fn facing(ns: Vec3, ng: Vec3, wo: Vec3) -> Vec3 {
    let below = ns.dot(ng);
    let ns = if below < 0.0 {
        (ns + (1e-3 - below) * ng).try_normalize().unwrap_or(ng)
    } else {
        ns
    };
    let cos = wo.dot(ng);
    let w = if cos < 0.0 { -wo } else { wo };
    let (cos_g, cos_s) = (cos.abs(), w.dot(ns));
    let least = (0.5 * cos_g).min(1e-3);
    if cos_s >= least {
        return ns;
    }
    // w·(ns + k ng) = least.
    let k = (least - cos_s) / cos_g;
    (ns + k * ng).try_normalize().unwrap_or(ng)
}

/// Whether a hit on the material can be removed by opacity.
fn may_vanish(material: &Material) -> bool {
    let textured = material.base_color_texture.is_some();
    match material.alpha_mode {
        AlphaMode::Opaque => false,
        AlphaMode::Mask(cutoff) => textured || material.opacity < cutoff,
        AlphaMode::Blend => textured || material.opacity < 1.0,
    }
}

/// A number in [0, 1) that is a function of the ray and the triangle alone.
fn chance(ray: &Ray, triangle: u32) -> f32 {
    let (o, d) = (ray.origin, ray.dir);
    let mut h = 0x9e37_79b9_7f4a_7c15u64 ^ u64::from(triangle);
    for x in [o.x, o.y, o.z, d.x, d.y, d.z] {
        h = (h ^ u64::from(x.to_bits())).wrapping_mul(0xff51_afd7_ed55_8ccd);
        h ^= h >> 32;
    }
    (h >> 40) as f32 / (1u64 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A triangle facing +z whose u runs along `u` and whose v runs along `v`.
    fn mapped(u: Vec2, v: Vec2) -> (Mesh, [Vec3; 2]) {
        let positions = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
        let uvs = positions
            .iter()
            .map(|p| Vec2::new(p.truncate().dot(u), p.truncate().dot(v)));
        let mesh = Mesh {
            uvs: uvs.collect(),
            positions,
            ..Mesh::default()
        };
        (mesh, [Vec3::X, Vec3::Y])
    }

    #[test]
    fn red_points_along_u_and_green_against_v() {
        let map = TextureRef {
            texture: 0,
            transform: glam::Affine2::IDENTITY,
        };
        for (u, v) in [
            (Vec2::X, Vec2::NEG_Y),
            (Vec2::NEG_X, Vec2::NEG_Y),
            (Vec2::Y, Vec2::X),
            (Vec2::X, 3.0 * Vec2::Y),
        ] {
            let (mesh, edges) = mapped(u, v);
            let (t, hand) = tangent(&mesh, &[0, 1, 2], &[0.2, 0.3, 0.5], edges, &map, Vec3::Z)
                .expect("the coordinates span an area");
            let red = perturbed(Vec3::Z, t, hand, Vec3::X);
            let green = perturbed(Vec3::Z, t, hand, Vec3::Y);
            assert!(
                (red - u.normalize().extend(0.0)).length() < 1e-6,
                "{u} {v}: {red}"
            );
            assert!(
                (green + v.normalize().extend(0.0)).length() < 1e-6,
                "{u} {v}: {green}"
            );
            assert_eq!(perturbed(Vec3::Z, t, hand, Vec3::Z), Vec3::Z);
        }
        let (flat, edges) = mapped(Vec2::X, Vec2::X);
        assert!(tangent(&flat, &[0, 1, 2], &[1.0, 0.0, 0.0], edges, &map, Vec3::Z).is_none());
    }

    #[test]
    fn a_mesh_s_own_tangents_go_first() {
        let (mut mesh, edges) = mapped(Vec2::X, Vec2::NEG_Y);
        mesh.tangents = vec![glam::Vec4::new(0.0, 1.0, 0.0, -1.0); 3];
        let map = TextureRef {
            texture: 0,
            transform: glam::Affine2::IDENTITY,
        };
        let (t, hand) =
            tangent(&mesh, &[0, 1, 2], &[0.2, 0.3, 0.5], edges, &map, Vec3::Z).expect("given");
        assert_eq!((t, hand), (Vec3::Y, -1.0));
        assert_eq!(perturbed(Vec3::Z, t, hand, Vec3::Y), Vec3::X);
    }

    #[test]
    fn bending_stops_where_the_viewer_sees_both_sides_alike() {
        let (ng, wo) = (Vec3::Z, Vec3::new(1.0, 0.0, 0.2).normalize());
        let ns = Vec3::new(-0.8, 0.0, 0.6);
        for sign in [1.0, -1.0] {
            let n = facing(ns, ng, sign * wo);
            assert!((n.dot(wo) - 1e-3).abs() < 1e-3 && n.dot(wo) > 0.0, "{n}");
            assert!(n.y == 0.0 && n.x < 0.0, "{n}");
        }
        assert_eq!(facing(ns, ng, Vec3::Z), ns, "seen from above nothing bends");
        assert_eq!(facing(ns, ng, Vec3::X), ng, "edge-on the shading is flat");
    }
}
