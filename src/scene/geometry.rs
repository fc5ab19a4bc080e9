//! Triangles in scene order, their attributes, and the tree over them.

use super::accel::Accel;
use super::material::AlphaMode;
use super::mesh::{attribute, mix};
use super::normals::{lifted, normal_texel, perturbed, tangent};
use super::{Hit, Material, Mesh, SceneParts, Surface};
use crate::math::{Ray, Vec2, Vec3};

/// Half a unit in the last place, relative.
const HALF_ULP: f32 = 0.5 * f32::EPSILON;

/// All triangles of a scene.
pub struct Geometry {
    accel: Accel,
    corners: Vec<[Vec3; 3]>,
    /// Mesh and face of each triangle.
    sources: Vec<[u32; 2]>,
    /// Material of each mesh.
    materials: Vec<u32>,
    /// True for triangles whose hits opacity may remove; empty if there are none.
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
                    "mesh {m}: dropped, its material is {} of {}",
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

    /// True if there is no triangle.
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

    /// Index of a triangle's mesh.
    #[inline]
    pub fn triangle_mesh(&self, i: u32) -> u32 {
        self.sources[i as usize][0]
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

    /// True if opacity may remove a hit.
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

    /// Interpolates the surface at a hit. No direction enters: a path from the camera and a path from a light that meet
    /// at a point see the same surface.
    pub fn surface(&self, parts: &SceneParts, hit: &Hit) -> Surface {
        let [a, b, c] = self.triangle(hit.triangle);
        let weights = [(1.0 - hit.u - hit.v).max(0.0), hit.u, hit.v];
        let origin = a.as_dvec3();
        let (e, f) = (b.as_dvec3() - origin, c.as_dvec3() - origin);
        let ng = e.cross(f).normalize().as_vec3();
        // Exact up to the rounding to single precision.
        let position = (origin + f64::from(hit.u) * e + f64::from(hit.v) * f).as_vec3();
        // A spawned origin is off by that rounding and by its own, half a unit in the last place each; the intersection
        // test knows the side of the plane exactly. [PBRT4 §6.8] has to allow for γ₇ of the corners' size.
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
            ns: lifted(ns, ng),
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

    /// True if opacity leaves this hit in place.
    fn present(&self, parts: &SceneParts, ray: &Ray, hit: &Hit) -> bool {
        if !self.cutouts[hit.triangle as usize] {
            return true;
        }
        let material = &parts.materials[self.triangle_material(hit.triangle) as usize];
        let uvs = self.triangle_uvs(parts, hit.triangle);
        let uv = mix(&[1.0 - hit.u - hit.v, hit.u, hit.v], uvs);
        match material.presence(&parts.textures, uv) {
            0.0 => false,
            1.0 => true,
            part => chance(ray, hit.triangle) < part,
        }
    }
}

/// The corners, if all exist, are finite, and span an area.
fn usable(mesh: &Mesh, indices: &[u32; 3]) -> Option<[Vec3; 3]> {
    let triangle = attribute(&mesh.positions, indices)?;
    let [a, b, c] = triangle;
    let area = normal(a, b, c).length();
    (Accel::accepts(&triangle) && area > 0.0).then_some(triangle)
}

/// Normal by winding, twice the area long; in double precision, exact enough for the thinnest sliver.
#[inline]
fn normal(a: Vec3, b: Vec3, c: Vec3) -> glam::DVec3 {
    let a = a.as_dvec3();
    (b.as_dvec3() - a).cross(c.as_dvec3() - a)
}

/// True if opacity may remove a hit on the material.
fn may_vanish(material: &Material) -> bool {
    let textured = material.base_color_texture.is_some();
    match material.alpha_mode {
        AlphaMode::Opaque => false,
        AlphaMode::Mask(cutoff) => textured || material.opacity < cutoff,
        AlphaMode::Blend => textured || material.opacity < 1.0,
    }
}

/// A hash of ray and triangle, uniform in [0, 1).
fn chance(ray: &Ray, triangle: u32) -> f32 {
    let (o, d) = (ray.origin, ray.dir);
    let mut h = 0x9e37_79b9_7f4a_7c15u64 ^ u64::from(triangle);
    for x in [o.x, o.y, o.z, d.x, d.y, d.z] {
        h = (h ^ u64::from(x.to_bits())).wrapping_mul(0xff51_afd7_ed55_8ccd);
        h ^= h >> 32;
    }
    (h >> 40) as f32 / (1u64 << 24) as f32
}
