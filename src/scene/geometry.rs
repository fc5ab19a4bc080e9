//! Triangles in scene order, their attributes, and the tree over them.

use super::accel::{self, Accel};
use super::instances::{Instances, Shared};
use super::layers::Layers;
use super::material::TextureRef;
use super::material::{AlphaMode, may_vanish};
use super::mesh::{attribute, mix};
use super::normals::{
    MIN_COS_ROUGH, MIN_COS_SMOOTH, is_curved, lifted, normal_texel, perturbed, rise, tangent,
};
use super::{Footprint, Hit, Mesh, SceneParts, Surface, TriangleId};
use crate::bsdf::DELTA_ALPHA;
use crate::math::{DVec3, Ray, Rgb, Vec2, Vec3, Vec4};
use rayon::prelude::*;
use std::ops::Range;

/// Half a unit in the last place, relative.
const HALF_ULP: f32 = 0.5 * f32::EPSILON;

/// All triangles of a scene. In scene order the triangles of [`SceneParts::meshes`] precede those of the instances.
pub struct Geometry {
    accel: Accel,
    has_tree: bool,
    triangles: Vec<Triangle>,
    /// Number of meshes that are not shared.
    meshes: u32,
    /// For each triangle, true if opacity may remove its hits; empty if it can remove none.
    cutouts: Vec<bool>,
    instances: Option<Instances>,
    traversal: Traversal,
    /// True if there are surfaces of partial opacity, which some rays pass.
    has_layers: bool,
}

/// Traversal of the scene by a ray: the cheapest sufficient kind.
#[derive(Clone, Copy)]
enum Traversal {
    /// One tree, in which every hit counts.
    Plain,
    /// One tree, with hits that opacity may remove.
    Cutouts,
    /// One tree that also contains instances.
    Instances,
}

/// A triangle with all data that a surface without textures needs. One load replaces dependent loads of the mesh, the
/// indices of the corners and their attributes.
#[repr(C, align(32))]
pub(super) struct Triangle {
    pub(super) corners: [Vec3; 3],
    /// Unit normal by winding.
    ng: Vec3,
    /// Shading normals of the corners; zero where the mesh has none.
    normals: [Vec3; 3],
    /// Index of the material, with bits: [`TEXTURED`] if it needs texture coordinates, [`ONE_SIDED`] if cameras see the
    /// front only, [`HIDDEN`] if they see neither side, [`ROUGH`] if opaque and rough, [`CURVED`] if part of a curved
    /// opaque surface.
    material: u32,
    /// Index of the mesh.
    mesh: u32,
    /// Index of its face.
    face: u32,
}

/// Bit of [`Triangle::material`].
const TEXTURED: u32 = 1 << 31;

/// Bit of [`Triangle::material`]: the camera does not see the back.
const ONE_SIDED: u32 = 1 << 30;
const HIDDEN: u32 = 1 << 29;
const ROUGH: u32 = 1 << 28;
const CURVED: u32 = 1 << 27;

impl Triangle {
    /// Index of the material.
    #[inline]
    fn material(&self) -> u32 {
        self.material & !(TEXTURED | ONE_SIDED | HIDDEN | ROUGH | CURVED)
    }

    /// Corners' indices in the triangle's mesh.
    #[inline]
    pub(super) fn indices<'a>(&self, mesh: &'a Mesh) -> &'a [u32; 3] {
        &mesh.indices[self.face as usize]
    }
}

/// A face of a mesh: its index in a list of meshes, and its own.
pub(super) type Face = [u32; 2];

impl Triangle {
    /// True if the camera does not see the side that a ray hits, which is the back if `is_back()`.
    #[inline]
    fn hides_side(&self, is_back: impl Fn() -> bool) -> bool {
        self.material & (ONE_SIDED | HIDDEN) != 0 && (self.material & HIDDEN != 0 || is_back())
    }

    pub(super) fn new(mesh: &Mesh, [m, face]: Face, parts: &SceneParts) -> Self {
        let corners @ [a, b, c] = corners(mesh, face);
        let material = &parts.materials[mesh.material as usize];
        let bit = |set: bool, bit: u32| if set { bit } else { 0 };
        let bits = bit(material.is_textured(), TEXTURED)
            | bit(material.hides_back(), ONE_SIDED)
            | bit(material.is_hidden(), HIDDEN)
            | bit(
                !material.transmits() && material.alpha >= DELTA_ALPHA,
                ROUGH,
            );
        let ng = normal(a, b, c).normalize().as_vec3();
        let normals =
            attribute(&mesh.normals, &mesh.indices[face as usize]).unwrap_or([Vec3::ZERO; 3]);
        let opaque = !material.transmits() && material.translucency().is_none();
        let opaque = opaque && material.emission == Rgb::ZERO && !material.is_hidden();
        let bits = bits | bit(opaque && is_curved(&normals, ng), CURVED);
        Self {
            corners,
            ng,
            normals,
            material: mesh.material | bits,
            mesh: m,
            face,
        }
    }
}

/// Corners of a usable face.
#[inline]
pub(super) fn corners(mesh: &Mesh, face: u32) -> [Vec3; 3] {
    mesh.indices[face as usize].map(|i| mesh.positions[i as usize])
}

/// Number of dropped triangles, and the names and triangle count of their meshes.
#[derive(Default)]
pub(super) struct Dropped {
    names: Vec<String>,
    dropped: usize,
    of: usize,
}

impl Dropped {
    /// Adds one warning for all meshes.
    pub(super) fn say(self, warnings: &mut Vec<String>) {
        /// Names that the warning lists.
        const NAMES: usize = 3;
        let Self { names, dropped, of } = self;
        let who = match names.len() {
            0 => return,
            1 => names[0].clone(),
            n @ ..=NAMES => format!("{n} meshes ({})", names.join(", ")),
            n => format!("{n} meshes ({} …)", names[..NAMES].join(", ")),
        };
        warnings.push(format!(
            "{who}: dropped {dropped} of {of} triangles (no area, not finite, or missing corners)"
        ));
    }
}

/// Adds the usable faces of the `m`-th mesh and counts the others. A mesh whose material does not exist adds a warning
/// instead.
pub(super) fn add_faces(
    out: &mut Vec<Face>,
    (m, mesh): (usize, &Mesh),
    parts: &SceneParts,
    name: &str,
    all: &mut Dropped,
    warnings: &mut Vec<String>,
) {
    if mesh.material as usize >= parts.materials.len() {
        warnings.push(format!(
            "{name}: dropped, its material is {} of {}",
            mesh.material,
            parts.materials.len()
        ));
        return;
    }
    let before = out.len();
    let faces = mesh.indices.iter().enumerate();
    out.extend(
        faces
            .filter(|(_, indices)| is_usable(mesh, indices))
            .map(|(face, _)| [m as u32, face as u32]),
    );
    let dropped = mesh.indices.len() - (out.len() - before);
    if dropped > 0 {
        all.names.push(name.to_owned());
        all.dropped += dropped;
        all.of += mesh.indices.len();
    }
}

impl Geometry {
    /// Collects the triangles of all meshes, with or without a tree over those that are not shared.
    pub(crate) fn build(parts: &SceneParts, tree: bool, warnings: &mut Vec<String>) -> Self {
        let most = parts.meshes.iter().map(|mesh| mesh.indices.len()).sum();
        let mut faces: Vec<Face> = Vec::with_capacity(most);
        let mut dropped = Dropped::default();
        for (m, mesh) in parts.meshes.iter().enumerate() {
            let name = format!("mesh {m}");
            add_faces(&mut faces, (m, mesh), parts, &name, &mut dropped, warnings);
        }
        dropped.say(warnings);
        let mut instances = Instances::new(parts, faces.len() as u32, warnings);
        let boxes = instances
            .as_mut()
            .map_or_else(Vec::new, Instances::take_boxes);
        // The tree first, so that the triangles take no memory while it is built.
        let of = |&[m, face]: &Face| corners(&parts.meshes[m as usize], face);
        let accel = match tree {
            true => Accel::over(faces.len(), |i| of(&faces[i as usize]), &boxes),
            false => Accel::bounds_only(faces.iter().map(of), &boxes),
        };
        let mut triangles = accel::huge_list(faces.len());
        let triangle = |face: Face| Triangle::new(&parts.meshes[face[0] as usize], face, parts);
        triangles.par_extend(faces.into_par_iter().map(triangle));
        let cut: Vec<bool> = parts.materials.iter().map(may_vanish).collect();
        let mut cutouts = Vec::new();
        if cut.contains(&true) {
            let of = |t: &Triangle| cut[t.material() as usize];
            cutouts = triangles.iter().map(of).collect();
            if !cutouts.contains(&true) {
                cutouts.clear();
            }
        }
        let is_layer = |m: &Mesh| {
            (parts.materials.get(m.material as usize))
                .is_some_and(|m| m.alpha_mode == AlphaMode::Blend && may_vanish(m))
        };
        let traversal = match (&instances, cutouts.is_empty()) {
            (Some(_), _) => Traversal::Instances,
            (None, false) => Traversal::Cutouts,
            (None, true) => Traversal::Plain,
        };
        Self {
            accel,
            has_tree: tree,
            triangles,
            meshes: parts.meshes.len() as u32,
            cutouts,
            instances,
            traversal,
            has_layers: parts.all_meshes().any(is_layer),
        }
    }

    /// True if rays can be traced against unshared meshes.
    pub(super) fn has_tree(&self) -> bool {
        self.has_tree
    }

    /// Number of triangles, including those of every instance.
    pub fn triangle_count(&self) -> usize {
        self.single() + self.instances.as_ref().map_or(0, Instances::triangle_count)
    }

    /// Number of triangles that no instances share: the first in scene order, and the only ones that emit.
    pub(crate) fn single(&self) -> usize {
        self.triangles.len()
    }

    /// Number of triangles in memory, where those of a shared mesh count once.
    pub fn stored(&self) -> usize {
        self.single() + self.instances.as_ref().map_or(0, Instances::stored)
    }

    /// Number of instances of shared meshes.
    pub fn instances(&self) -> usize {
        self.instances.as_ref().map_or(0, Instances::len)
    }

    /// The instances, which exist if a triangle belongs to one.
    #[inline]
    fn shared(&self) -> &Instances {
        (self.instances.as_ref())
            .expect("a triangle that is not of a single mesh is of an instance")
    }

    /// Corners of a triangle, counter-clockwise seen from the front.
    #[inline]
    pub fn triangle(&self, i: TriangleId) -> [Vec3; 3] {
        match self.triangles.get(i.index() as usize) {
            Some(triangle) => triangle.corners,
            None => self.shared().corners(i),
        }
    }

    /// Index of a triangle's material.
    #[inline]
    pub fn triangle_material(&self, i: TriangleId) -> u32 {
        match self.triangles.get(i.index() as usize) {
            Some(triangle) => triangle.material(),
            None => self.shared().material(i),
        }
    }

    /// Index of a triangle's mesh; instances are counted after the meshes.
    #[inline]
    pub fn triangle_mesh(&self, i: TriangleId) -> u32 {
        match self.triangles.get(i.index() as usize) {
            Some(triangle) => triangle.mesh,
            None => self.meshes + i.instance() - 1,
        }
    }

    /// The triangles of each mesh and instance that has any, in scene order.
    pub(crate) fn runs(&self) -> Vec<Run> {
        let mut runs = Vec::new();
        let mut start = 0;
        for mesh in self.triangles.chunk_by(|a, b| a.mesh == b.mesh) {
            let end = start + mesh.len() as u32;
            runs.push(Run {
                instance: 0,
                indices: start..end,
            });
            start = end;
        }
        runs.extend(self.instances.iter().flat_map(Instances::runs));
        runs
    }

    /// At most `most` triangles of the materials that `of` accepts, evenly spread in scene order.
    pub(crate) fn some_of(&self, most: usize, of: impl Fn(u32) -> bool) -> Vec<TriangleId> {
        let mut runs = self.runs();
        runs.retain(|run| of(self.triangle_material(run.first())));
        let step = (runs.iter().map(Run::len).sum::<usize>().div_ceil(most)).max(1);
        let (mut before, mut some) = (0usize, Vec::new());
        for run in runs {
            let skip = before.next_multiple_of(step) - before;
            before += run.len();
            some.extend(run.every(skip, step));
        }
        some
    }

    /// Texture coordinates of a triangle's corners; zero where the mesh has none.
    #[inline]
    pub(crate) fn triangle_uvs(&self, parts: &SceneParts, i: TriangleId) -> [Vec2; 3] {
        let (mesh, indices) = match self.triangles.get(i.index() as usize) {
            Some(triangle) => {
                let mesh = &parts.meshes[triangle.mesh as usize];
                (mesh, triangle.indices(mesh))
            }
            None => self.shared().source(parts, i),
        };
        attribute(&mesh.uvs, indices).unwrap_or([Vec2::ZERO; 3])
    }

    /// Texture coordinates at a hit; zero where the mesh has none.
    pub fn uv(&self, parts: &SceneParts, hit: &Hit) -> Vec2 {
        mix(&weights(hit), self.triangle_uvs(parts, hit.triangle))
    }

    /// Corners of a triangle and the shading normals there.
    pub(crate) fn smooth_triangle(&self, i: TriangleId) -> ([Vec3; 3], [Vec3; 3]) {
        let normals = self.at(i, |triangle, to_world| {
            triangle.normals.map(|n| to_world.normal(n))
        });
        (self.triangle(i), normals)
    }

    /// Area of a triangle.
    #[inline]
    pub(crate) fn triangle_area(&self, i: TriangleId) -> f32 {
        let [a, b, c] = self.triangle(i);
        (0.5 * normal(a, b, c).length()) as f32
    }

    /// Unit normal of a triangle, towards its front.
    #[inline]
    pub(crate) fn triangle_normal(&self, i: TriangleId) -> Vec3 {
        let [a, b, c] = self.triangle(i);
        normal(a, b, c).normalize().as_vec3()
    }

    /// Signed distance of a point from the plane of a triangle.
    pub(super) fn height(&self, i: TriangleId, point: Vec3) -> f64 {
        let [a, b, c] = self.triangle(i);
        (point.as_dvec3() - a.as_dvec3()).dot(normal(a, b, c).normalize())
    }

    /// True if opacity may remove any hit.
    #[inline]
    pub fn has_opacity(&self) -> bool {
        !self.cutouts.is_empty() || self.instances.as_ref().is_some_and(Instances::vanish)
    }

    /// True if there are surfaces of partial opacity, which some rays pass.
    pub(super) fn has_layers(&self) -> bool {
        self.has_layers
    }

    /// Lower and upper corner of the scene; both zero if it is empty.
    pub(crate) fn bounds(&self) -> (Vec3, Vec3) {
        self.accel.bounds()
    }

    /// Closest hit, without hits that opacity removes.
    #[inline]
    pub(crate) fn intersect(&self, parts: &SceneParts, ray: &Ray) -> Option<Hit> {
        match self.traversal {
            // The surface at the closest hit is computed next: its triangle is prefetched during the traversal.
            Traversal::Plain => self.accel.closest_where(ray, |hit| {
                accel::prefetch(&self.triangles, hit.triangle.index());
                true
            }),
            Traversal::Cutouts => {
                (self.accel).closest_where(ray, |hit| self.present(parts, ray, hit))
            }
            Traversal::Instances => self.intersect_instances(parts, ray),
        }
    }

    #[inline(never)]
    fn intersect_instances(&self, parts: &SceneParts, ray: &Ray) -> Option<Hit> {
        self.among::<false>(ray, |hit| self.present_at(parts, ray, hit))
    }

    /// [`Geometry::intersect`] where `u`, uniform in [0, 1), decides which surfaces of partial opacity are hit. It stays
    /// uniform whatever the ray hits.
    pub(super) fn intersect_drawn(
        &self,
        parts: &SceneParts,
        ray: &Ray,
        u: &mut f64,
    ) -> Option<Hit> {
        let layers = Layers::default();
        let last = self.among::<false>(ray, |hit| match self.presence(parts, hit) {
            0.0 => false,
            1.0 => true,
            part => {
                layers.add(hit, part);
                false
            }
        });
        layers.first(last, u)
    }

    /// Transmittance of the surfaces of partial opacity along a ray; `None` if anything else blocks it. `blocks` tells
    /// materials that block the ray at any opacity above 0.
    #[inline]
    pub(super) fn transmittance(
        &self,
        parts: &SceneParts,
        ray: &Ray,
        blocks: impl Fn(u32) -> bool,
    ) -> Option<f32> {
        match self.has_layers {
            false => (!self.occluded(parts, ray)).then_some(1.0),
            true => self.transmittance_of_layers(parts, ray, blocks),
        }
    }

    #[cold]
    #[inline(never)]
    fn transmittance_of_layers(
        &self,
        parts: &SceneParts,
        ray: &Ray,
        blocks: impl Fn(u32) -> bool,
    ) -> Option<f32> {
        let layers = Layers::default();
        let blocked = self.among::<true>(ray, |hit| match self.presence(parts, hit) {
            0.0 => false,
            1.0 => true,
            part => {
                layers.add(hit, part);
                blocks(self.triangle_material(hit.triangle))
            }
        });
        blocked.is_none().then(|| layers.transmittance())
    }

    /// The closest hit on triangles and instances, or with `ANY` any hit; `keep` decides about hits that opacity may
    /// remove.
    #[inline]
    fn among<const ANY: bool>(&self, ray: &Ray, keep: impl Fn(&Hit) -> bool) -> Option<Hit> {
        let single = |hit: &Hit| match self.cutouts.get(hit.triangle.index() as usize) {
            Some(true) => keep(hit),
            _ => true,
        };
        match &self.instances {
            None => (self.accel).among::<ANY>(ray, single, ()),
            Some(instances) => {
                let shared = |of: &Shared, hit: &Hit| !of.vanishes || keep(hit);
                let enter = |i: u32, best: &Hit| instances.enter::<ANY>(ray, i, best, shared);
                (self.accel).among::<ANY>(ray, single, enter)
            }
        }
    }

    /// Closest hit on one of the triangles that `keep` accepts.
    pub(super) fn closest_of(&self, ray: &Ray, keep: impl Fn(TriangleId) -> bool) -> Option<Hit> {
        let keep = |hit: &Hit| keep(hit.triangle);
        match &self.instances {
            None => self.accel.closest_where(ray, keep),
            Some(instances) => (self.accel).among::<false>(ray, keep, |i: u32, best: &Hit| {
                instances.enter::<false>(ray, i, best, |_, hit| keep(hit))
            }),
        }
    }

    /// True if a ray along `dir` hits a side of a triangle that the camera does not see.
    #[inline]
    pub(super) fn hides_back(&self, triangle: TriangleId, dir: Vec3) -> bool {
        match self.triangles.get(triangle.index() as usize) {
            Some(t) => t.hides_side(|| dir.dot(t.ng) > 0.0),
            None => {
                let (t, _) = self.shared().place(triangle);
                t.hides_side(|| dir.dot(self.triangle_normal(triangle)) > 0.0)
            }
        }
    }

    /// True if there is a hit before the ray's end.
    #[inline]
    pub(crate) fn occluded(&self, parts: &SceneParts, ray: &Ray) -> bool {
        match self.traversal {
            Traversal::Plain => self.accel.any(ray),
            Traversal::Cutouts => (self.accel).any_where(ray, |hit| self.present(parts, ray, hit)),
            Traversal::Instances => self.occluded_instances(parts, ray),
        }
    }

    #[inline(never)]
    fn occluded_instances(&self, parts: &SceneParts, ray: &Ray) -> bool {
        (self.among::<true>(ray, |hit| self.present_at(parts, ray, hit))).is_some()
    }

    /// Interpolates the surface at a hit. It does not depend on the ray's direction: camera paths and light paths find
    /// the same surface at a point.
    pub(crate) fn surface(&self, parts: &SceneParts, hit: &Hit) -> Surface {
        match self.triangles.get(hit.triangle.index() as usize) {
            Some(triangle) => triangle.surface(parts, hit, &InWorld),
            None => self.shared().surface(parts, hit),
        }
    }

    /// The shading normal at a surface point with this normal map and scale in place of the material's, or with none.
    pub(super) fn mapped_normal(
        &self,
        parts: &SceneParts,
        surface: &Surface,
        map: Option<(&TextureRef, f32)>,
    ) -> Vec3 {
        self.at(surface.triangle, |triangle, to_world| {
            let point = triangle.point_at(parts, surface.position, to_world);
            let (ns, flipped) = triangle.smooth_normal(&point.weights, surface.ng, to_world);
            let mapped = map.and_then(|(map, scale)| point.mapped(parts, map, scale, ns));
            let ns = mapped.unwrap_or(ns);
            lifted(if flipped { -ns } else { ns }, surface.ng)
        })
    }

    /// Unit tangent and bitangent at a surface point, by the mesh's tangents or the texture coordinates of a map;
    /// `None` without either.
    pub(super) fn tangents(
        &self,
        parts: &SceneParts,
        surface: &Surface,
        map: Option<&TextureRef>,
    ) -> Option<[Vec3; 2]> {
        let plain = TextureRef {
            texture: 0,
            transform: glam::Affine2::IDENTITY,
            second: false,
        };
        self.at(surface.triangle, |triangle, to_world| {
            let point = triangle.point_at(parts, surface.position, to_world);
            let (ns, _) = triangle.smooth_normal(&point.weights, surface.ng, to_world);
            let (tangent, hand) = point.tangent(map.unwrap_or(&plain), ns)?;
            let t = (tangent - ns * ns.dot(tangent)).try_normalize()?;
            Some([t, hand * ns.cross(t)])
        })
    }

    /// The footprint of a pixel in texture coordinates, as two half axes in the surface: across the line of sight and
    /// along it. `None` if the mesh has no coordinates.
    pub(super) fn uv_axes(
        &self,
        parts: &SceneParts,
        surface: &Surface,
        footprint: &Footprint,
    ) -> Option<[Vec2; 2]> {
        let across = (surface.ng.cross(footprint.dir)).try_normalize();
        let across = across.unwrap_or_else(|| surface.ng.any_orthonormal_vector());
        let cos = surface.ng.dot(footprint.dir).abs();
        let along = surface.ng.cross(across) / cos;
        let axes = [across, along].map(|axis| footprint.half * axis);
        match self.triangles.get(surface.triangle.index() as usize) {
            Some(triangle) => triangle.uv_axes(parts, axes, &InWorld),
            None => {
                let (triangle, placed) = self.shared().place(surface.triangle);
                triangle.uv_axes(parts, axes, &placed)
            }
        }
    }

    /// The second pair of texture coordinates, and the colour with its opacity, at a surface point.
    pub(super) fn further_attributes(&self, parts: &SceneParts, surface: &Surface) -> (Vec2, Vec4) {
        self.at(surface.triangle, |triangle, to_world| {
            let point = triangle.point_at(parts, surface.position, to_world);
            (point.second_uv(), point.color())
        })
    }

    /// Calls `ask` with a triangle and its transform to the world.
    fn at<T>(&self, triangle: TriangleId, ask: impl FnOnce(&Triangle, &dyn ToWorld) -> T) -> T {
        match self.triangles.get(triangle.index() as usize) {
            Some(triangle) => ask(triangle, &InWorld),
            None => {
                let (triangle, placed) = self.shared().place(triangle);
                ask(triangle, &placed)
            }
        }
    }

    /// True if opacity leaves this hit in place.
    fn present(&self, parts: &SceneParts, ray: &Ray, hit: &Hit) -> bool {
        !self.cutouts[hit.triangle.index() as usize] || self.present_at(parts, ray, hit)
    }

    /// [`Self::present`] of a hit on a material whose opacity may remove it.
    fn present_at(&self, parts: &SceneParts, ray: &Ray, hit: &Hit) -> bool {
        match self.presence(parts, hit) {
            0.0 => false,
            1.0 => true,
            part => chance(ray, hit.triangle) < part,
        }
    }

    /// Opacity in [0, 1] at a hit on a material whose opacity may remove it.
    fn presence(&self, parts: &SceneParts, hit: &Hit) -> f32 {
        let material = &parts.materials[self.triangle_material(hit.triangle) as usize];
        let uvs = self.triangle_uvs(parts, hit.triangle);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let uv = mix(&weights, uvs);
        let presence = match &material.finish {
            Some(finish) if finish.needs_attributes() => {
                self.at(hit.triangle, |triangle, to_world| {
                    let mesh = to_world.mesh(parts, triangle.mesh);
                    let point = TrianglePoint {
                        mesh,
                        indices: triangle.indices(mesh),
                        weights,
                        edges: [Vec3::ZERO; 2],
                        to_world,
                    };
                    let (uvs, own) = ([uv, point.second_uv()], point.color().w);
                    material.presence_of(&parts.textures, uvs, own)
                })
            }
            _ => material.presence(&parts.textures, uv),
        };
        // NaN is 0.
        if presence > 0.0 {
            presence.min(1.0)
        } else {
            0.0
        }
    }
}

/// The triangles of a mesh or of an instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Run {
    /// See [`TriangleId::instance`].
    pub(super) instance: u32,
    /// See [`TriangleId::index`]; not empty.
    pub(super) indices: Range<u32>,
}

impl Run {
    /// Number of triangles.
    pub(crate) fn len(&self) -> usize {
        self.indices.len()
    }

    /// The first triangle.
    pub(crate) fn first(&self) -> TriangleId {
        TriangleId::new(self.instance, self.indices.start)
    }

    /// Every `step`-th triangle after the first `skip`.
    pub(crate) fn every(self, skip: usize, step: usize) -> impl Iterator<Item = TriangleId> {
        let Self { instance, indices } = self;
        let all = indices.skip(skip).step_by(step);
        all.map(move |index| TriangleId::new(instance, index))
    }
}

/// Barycentric weights of a hit.
#[inline(always)]
fn weights(hit: &Hit) -> [f32; 3] {
    [(1.0 - hit.u - hit.v).max(0.0), hit.u, hit.v]
}

/// Transform from a mesh's space to the world.
pub(super) trait ToWorld {
    /// The mesh of this index.
    fn mesh<'a>(&self, parts: &'a SceneParts, index: u32) -> &'a Mesh;
    /// A point.
    fn point(&self, p: Vec3) -> DVec3;
    /// A difference of points.
    fn edge(&self, e: DVec3) -> DVec3;
    /// The unit geometric normal, towards the front: from the mesh's own and from the edges in the world.
    fn geometric(&self, ng: Vec3, e: DVec3, f: DVec3) -> Vec3;
    /// A corner's shading normal.
    fn normal(&self, n: Vec3) -> Vec3;
    /// A corner's tangent and handedness.
    fn tangent(&self, t: Vec4) -> Vec4;
    /// The error of a surface point, given the error of its rounding to single precision.
    fn error(&self, error: f32) -> f32;
}

/// Identity, for a mesh in world coordinates.
struct InWorld;

impl ToWorld for InWorld {
    #[inline(always)]
    fn mesh<'a>(&self, parts: &'a SceneParts, index: u32) -> &'a Mesh {
        &parts.meshes[index as usize]
    }

    #[inline(always)]
    fn point(&self, p: Vec3) -> DVec3 {
        p.as_dvec3()
    }

    #[inline(always)]
    fn edge(&self, e: DVec3) -> DVec3 {
        e
    }

    #[inline(always)]
    fn geometric(&self, ng: Vec3, _: DVec3, _: DVec3) -> Vec3 {
        ng
    }

    #[inline(always)]
    fn normal(&self, n: Vec3) -> Vec3 {
        n
    }

    #[inline(always)]
    fn tangent(&self, t: Vec4) -> Vec4 {
        t
    }

    #[inline(always)]
    fn error(&self, error: f32) -> f32 {
        error
    }
}

impl Triangle {
    /// Interpolates the surface at a hit.
    #[inline(always)]
    pub(super) fn surface(
        &self,
        parts: &SceneParts,
        hit: &Hit,
        to_world: &impl ToWorld,
    ) -> Surface {
        let [a, b, c] = self.corners;
        let weights = weights(hit);
        let local = a.as_dvec3();
        let e = to_world.edge(b.as_dvec3() - local);
        let f = to_world.edge(c.as_dvec3() - local);
        let ng = to_world.geometric(self.ng, e, f);
        // The position is exact up to the rounding to single precision.
        let position = (to_world.point(a) + f64::from(hit.u) * e + f64::from(hit.v) * f).as_vec3();
        // A spawned origin has this rounding error and its own, half a unit in the last place each; the intersection
        // test decides the side of the plane exactly. [PBRT4 §6.8] has to allow for γ₇ of the corners' size.
        let rounding = 3.0 * HALF_ULP * position.abs().dot(ng.abs());
        let extent = e.abs().max(f.abs()).max_element() as f32;
        let (mut ns, flipped) = self.smooth_normal(&weights, ng, to_world);
        let mut uv = Vec2::ZERO;
        if self.material & TEXTURED != 0 {
            let mesh = to_world.mesh(parts, self.mesh);
            let point = TrianglePoint {
                mesh,
                indices: self.indices(mesh),
                weights,
                edges: [e.as_vec3(), f.as_vec3()],
                to_world,
            };
            (uv, ns) = self.textured(parts, &point, ns);
        }
        if flipped {
            ns = -ns;
        }
        let mut height = 0.0;
        if self.material & CURVED != 0 {
            let [u, v] = [hit.u, hit.v].map(f64::from);
            let corners = [DVec3::ZERO, e, f].map(|corner| (corner - u * e - v * f).as_vec3());
            height = rise(
                &weights,
                &corners,
                &self.normals.map(|n| to_world.normal(n)),
                ng,
            );
        }
        Surface {
            position,
            ng,
            ns: lifted(ns, ng),
            uv,
            triangle: hit.triangle,
            material: self.material(),
            min_mirror_cos: if self.material & ROUGH != 0 {
                MIN_COS_ROUGH
            } else {
                MIN_COS_SMOOTH
            },
            error: to_world.error(rounding + 1e-13 * extent),
            curved_height: height,
        }
    }

    /// The interpolated unit normal, and true if it is not on the side of `ng`.
    #[inline(always)]
    fn smooth_normal(
        &self,
        weights: &[f32; 3],
        ng: Vec3,
        to_world: &(impl ToWorld + ?Sized),
    ) -> (Vec3, bool) {
        let ns = mix(weights, self.normals.map(|n| to_world.normal(n)))
            .try_normalize()
            .unwrap_or(ng);
        (ns, ns.dot(ng) < 0.0)
    }

    /// Texture coordinates, and the shading normal with the normal map applied.
    fn textured<P: ToWorld>(
        &self,
        parts: &SceneParts,
        point: &TrianglePoint<'_, P>,
        ns: Vec3,
    ) -> (Vec2, Vec3) {
        let material = &parts.materials[self.material() as usize];
        let mapped = (material.normal_texture.as_ref())
            .and_then(|map| point.mapped(parts, map, material.normal_scale, ns));
        (point.uv(), mapped.unwrap_or(ns))
    }

    /// Derivatives of the texture coordinates along two vectors in the triangle's plane.
    #[inline]
    fn uv_axes(
        &self,
        parts: &SceneParts,
        axes: [Vec3; 2],
        to_world: &impl ToWorld,
    ) -> Option<[Vec2; 2]> {
        let mesh = to_world.mesh(parts, self.mesh);
        let [a, b, c] = attribute(&mesh.uvs, self.indices(mesh))?;
        let [p, q, r] = self.corners;
        let e = to_world.edge((q - p).as_dvec3()).as_vec3();
        let f = to_world.edge((r - p).as_dvec3()).as_vec3();
        let (ee, ef, ff) = (e.dot(e), e.dot(f), f.dot(f));
        let scale = 1.0 / (ee * ff - ef * ef);
        Some(axes.map(|axis| {
            let (de, df) = (scale * axis.dot(e), scale * axis.dot(f));
            (de * ff - df * ef) * (b - a) + (df * ee - de * ef) * (c - a)
        }))
    }

    /// The point of the triangle at a position in the world.
    fn point_at<'a, P: ToWorld + ?Sized>(
        &'a self,
        parts: &'a SceneParts,
        position: Vec3,
        to_world: &'a P,
    ) -> TrianglePoint<'a, P> {
        let mesh = to_world.mesh(parts, self.mesh);
        let [a, b, c] = self.corners;
        let local = a.as_dvec3();
        let e = to_world.edge(b.as_dvec3() - local);
        let f = to_world.edge(c.as_dvec3() - local);
        let d = position.as_dvec3() - to_world.point(a);
        let (ee, ef, ff) = (e.dot(e), e.dot(f), f.dot(f));
        let (de, df) = (d.dot(e), d.dot(f));
        let part = |x: f64| (x / (ee * ff - ef * ef)).clamp(0.0, 1.0) as f32;
        let (u, v) = (part(de * ff - df * ef), part(df * ee - de * ef));
        TrianglePoint {
            mesh,
            indices: self.indices(mesh),
            weights: [(1.0 - u - v).max(0.0), u, v],
            edges: [e.as_vec3(), f.as_vec3()],
            to_world,
        }
    }
}

/// A point of a triangle of a mesh, and the transform to the world.
struct TrianglePoint<'a, P: ?Sized> {
    mesh: &'a Mesh,
    indices: &'a [u32; 3],
    weights: [f32; 3],
    edges: [Vec3; 2],
    to_world: &'a P,
}

impl<P: ToWorld + ?Sized> TrianglePoint<'_, P> {
    /// Texture coordinates of the corners in the set that a map uses.
    fn uvs(&self, map: &TextureRef) -> Option<[Vec2; 3]> {
        let all = if map.second {
            &self.mesh.second_uvs
        } else {
            &self.mesh.uvs
        };
        attribute(all, self.indices)
    }

    fn uv(&self) -> Vec2 {
        attribute(&self.mesh.uvs, self.indices).map_or(Vec2::ZERO, |uvs| mix(&self.weights, uvs))
    }

    fn second_uv(&self) -> Vec2 {
        let uvs = attribute(&self.mesh.second_uvs, self.indices);
        uvs.map_or(Vec2::ZERO, |uvs| mix(&self.weights, uvs))
    }

    /// Colour and opacity.
    fn color(&self) -> Vec4 {
        let colors = attribute(&self.mesh.colors, self.indices);
        colors.map_or(Vec4::ONE, |colors| mix(&self.weights, colors))
    }

    /// Tangent and handedness for the coordinates of a map, about the normal `ns`.
    fn tangent(&self, map: &TextureRef, ns: Vec3) -> Option<(Vec3, f32)> {
        let own = attribute(&self.mesh.tangents, self.indices)
            .map(|t| t.map(|t| self.to_world.tangent(t)));
        tangent(own, self.uvs(map), &self.weights, self.edges, map, ns)
    }

    /// The normal `ns` with a normal map applied; `None` without tangents.
    fn mapped(&self, parts: &SceneParts, map: &TextureRef, scale: f32, ns: Vec3) -> Option<Vec3> {
        let (tangent, hand) = self.tangent(map, ns)?;
        let uv = self
            .uvs(map)
            .map_or(Vec2::ZERO, |uvs| mix(&self.weights, uvs));
        let local = normal_texel(&parts.textures, map, uv, scale);
        Some(perturbed(ns, tangent, hand, local))
    }
}

/// True if all corners exist, are finite, and span an area.
fn is_usable(mesh: &Mesh, indices: &[u32; 3]) -> bool {
    attribute(&mesh.positions, indices).is_some_and(|triangle| {
        let [a, b, c] = triangle;
        Accel::accepts(&triangle) && normal(a, b, c).length() > 0.0
    })
}

/// Normal by winding, of a length of twice the area; in double precision, which suffices for the thinnest sliver.
#[inline]
fn normal(a: Vec3, b: Vec3, c: Vec3) -> glam::DVec3 {
    let a = a.as_dvec3();
    (b.as_dvec3() - a).cross(c.as_dvec3() - a)
}

/// A hash of ray and triangle, uniform in [0, 1).
fn chance(ray: &Ray, triangle: TriangleId) -> f32 {
    let (o, d) = (ray.origin, ray.dir);
    let mut h = 0x9e37_79b9_7f4a_7c15u64 ^ triangle.bits();
    for x in [o.x, o.y, o.z, d.x, d.y, d.z] {
        h = (h ^ u64::from(x.to_bits())).wrapping_mul(0xff51_afd7_ed55_8ccd);
        h ^= h >> 32;
    }
    (h >> 40) as f32 / (1u64 << 24) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::SharedMesh;
    use crate::unit::{materials, shapes};
    use glam::DAffine3;

    #[test]
    fn instances_and_meshes_are_sampled_evenly_in_scene_order() {
        let mut parts = SceneParts::default();
        let box_of = || shapes::cuboid(Vec3::ZERO, Vec3::ONE);
        parts.add(materials::diffuse("chalk", Vec3::ONE), [box_of(), box_of()]);
        parts.add(materials::metal("silver", Vec3::ONE, 0.0), [box_of()]);
        let mut poses = |material, count| {
            let mesh = Mesh {
                material,
                ..box_of()
            };
            let poses = vec![DAffine3::IDENTITY; count];
            parts.shared.push(SharedMesh { mesh, poses });
        };
        poses(1, 3);
        poses(0, 2);
        poses(1, 4);
        let geometry = Geometry::build(&parts, true, &mut Vec::new());
        let every = |run: Run| run.every(0, 1);
        let all: Vec<TriangleId> = geometry.runs().into_iter().flat_map(every).collect();
        assert!(all.is_sorted() && all.len() == geometry.triangle_count());
        let is_silver = |i: &TriangleId| geometry.triangle_material(*i) == 1;
        let silver: Vec<_> = all.into_iter().filter(is_silver).collect();
        assert_eq!(silver.len(), 8 * 12);
        for most in [1, 2, 5, 7, 12, 13, 50, 95, 96, 1000] {
            let step = silver.len().div_ceil(most);
            let expected: Vec<_> = silver.iter().copied().step_by(step).collect();
            assert_eq!(geometry.some_of(most, |material| material == 1), expected);
        }
        assert!(geometry.some_of(9, |_| false).is_empty());
    }
}
