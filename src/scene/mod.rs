//! Scenes: geometry, materials, lights and cameras, immutable after they are built.
//!
//! A [`Scene`] is made from [`SceneParts`] (plain data, filled by [`load`] or in code). Parts refer to each
//! other by indices, which the names of their fields explain.

use crate::bsdf::Bsdf;
use crate::math::{Frame, Ray, Rgb, Vec2, Vec3};
use medium::Media;
use std::sync::OnceLock;

pub mod accel;
pub(crate) mod backdrop;
pub(crate) mod bodies;
pub(crate) mod camera;
mod features;
pub mod finish;
mod floor;
mod framing;
pub(crate) mod geometry;
mod hit;
mod instances;
pub mod lamp;
mod layers;
pub mod light;
pub(crate) mod lighting;
pub mod limits;
pub mod load;
pub(crate) mod material;
pub(crate) mod medium;
pub(crate) mod mesh;
mod normals;
mod parts;
pub(crate) mod pyramid;
pub(crate) mod sensor;
mod shells;
pub(crate) mod texture;

pub(crate) use backdrop::Backdrop;
pub use camera::{Camera, FilmSize, Lens, Projection};
pub use features::Features;
pub use geometry::Geometry;
pub use hit::{Hit, TriangleId};
pub(crate) use light::{Aim, AimShares, EmissionDensity, EmissionSample, Target};
pub use light::{Emission, Environment, Falloff, LightDensity, LightSample, Lights, PunctualLight};
pub use material::{AlphaMode, Material, TextureRef};
pub use medium::Medium;
pub use mesh::{Mesh, SharedMesh};
pub use parts::SceneParts;
pub(crate) use sensor::Sighting;
pub use sensor::{Footprint, Sensor};
pub use texture::{Texels, Texture, Wrap};

/// A point of a surface. Except for `curved_height` it does not depend on the ray that hits it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World position.
    pub position: Vec3,
    /// Unit geometric normal, towards the front side (counter-clockwise winding).
    pub ng: Vec3,
    /// Unit shading normal, interpolated and normal-mapped, on the same side as `ng`; see [`Surface::frame_for`].
    pub ns: Vec3,
    /// Texture coordinates (set 0); zero where the material has no texture. See [`Geometry::uv`].
    pub uv: Vec2,
    /// The triangle.
    pub triangle: TriangleId,
    /// Index of the material.
    pub material: u32,
    /// Least cosine with `ng` of the mirror image of a direction about the normal of [`Surface::frame_for`].
    pub min_mirror_cos: f32,
    /// Distance from `position` along ±`ng` at which a ray is clear of this surface's rounding error.
    pub error: f32,
    /// Height along `ng` of the curved opaque surface that a flat triangle approximates, if a camera walk has hit its
    /// front; 0 otherwise. See [`Scene::surface_along`].
    pub curved_height: f32,
}

/// The immutable scene.
pub struct Scene {
    parts: SceneParts,
    geometry: Geometry,
    lights: Lights,
    /// For each material, its BSDF if this is the same at every point.
    constant_bsdfs: Vec<Option<Bsdf>>,
    /// For each material, true if cameras see its colour as a mean over a pixel's footprint; empty if none.
    filtered: Vec<bool>,
    features: Features,
    media: Option<Box<Media>>,
    /// True if the end of an edge may be drawn.
    draws_ends: bool,
    /// Rank of each material: the highest rank determines the medium where bodies overlap.
    ranks: Vec<u32>,
    /// True for each material that is a [pane](Material::is_pane); empty if no surface is one.
    panes: Vec<bool>,
    /// For each material, true if no light can reach the surfaces of its bodies from inside. Computed on first use,
    /// since smooth bodies never need it.
    dark_inside: OnceLock<Vec<bool>>,
    warnings: Vec<String>,
}

impl Scene {
    /// Builds the tree and the light distributions. Degenerate input is dropped, and meshes with the material of a body
    /// become thin walls if they bound none. [`Scene::warnings`] lists both.
    pub fn new(parts: SceneParts) -> Self {
        let mut scene = Self::build(parts, true);
        let passes = scene.media.is_some() && scene.parts.materials.iter().any(Material::is_null);
        if scene.parts.own_boundaries {
            scene.features.overlaps = passes;
            if scene.media.is_some() {
                scene.warnings.extend(scene.open_media());
            }
            return scene;
        }
        let defective = shells::defective_meshes(&scene.parts);
        let found = scene.classify_meshes(&defective);
        if !found.thin.is_empty() {
            let mut parts = scene.parts;
            parts.make_thin(&found.thin);
            scene = Self::build(parts, true);
        }
        scene.warnings.extend(found.warnings);
        let priorities =
            (scene.parts.materials.iter()).any(|m| m.bounds_body() && m.priority != 0.0);
        scene.features.touching = scene.finds_touching();
        scene.features.overlaps =
            passes || priorities || scene.features.touching || scene.find_overlaps(&found.turned);
        scene
    }

    /// The scene without a tree over unshared meshes, so that no ray hits these, and without a search for overlapping
    /// bodies: for descriptions, not for rendering.
    pub fn without_trees(parts: SceneParts) -> Self {
        Self::build(parts, false)
    }

    /// Replaces the cameras.
    pub(crate) fn set_cameras(&mut self, cameras: Vec<Camera>) {
        self.parts.cameras = cameras;
    }

    /// The scene with its environment replaced and the same trees.
    pub(crate) fn with_environment(mut self, environment: Environment) -> Self {
        self.parts.environment = Some(environment);
        self.warnings.retain(|warning| warning != light::BLACK);
        self.lights = Lights::new(&self.parts, &self.geometry, &mut self.warnings);
        self.dark_inside = OnceLock::new();
        self
    }

    fn build(mut parts: SceneParts, trees: bool) -> Self {
        let mut warnings = Vec::new();
        let filtered = match trees {
            true => parts.filter_textures(),
            false => Vec::new(),
        };
        let media = Media::of(&mut parts);
        let geometry = Geometry::build(&parts, trees, &mut warnings);
        let lights = Lights::new(&parts, &geometry, &mut warnings);
        let features = Features::of(&parts);
        let panes: Vec<bool> = parts.materials.iter().map(Material::is_pane).collect();
        let is_pane = |m: &Mesh| panes.get(m.material as usize) == Some(&true);
        let has_panes = panes.contains(&true) && parts.all_meshes().any(is_pane);
        let constant_bsdfs = (parts.materials.iter()).map(Material::constant_bsdf);
        Self {
            constant_bsdfs: constant_bsdfs.collect(),
            filtered,
            ranks: bodies::ranks(&parts),
            parts,
            lights,
            features,
            draws_ends: media.is_some() || geometry.has_layers(),
            media: media.map(Box::new),
            geometry,
            panes: if has_panes { panes } else { Vec::new() },
            dark_inside: OnceLock::new(),
            warnings,
        }
    }

    /// Defects of the input and their treatment, one line each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The plain data the scene was built from.
    pub fn parts(&self) -> &SceneParts {
        &self.parts
    }

    /// Contents of the scene that require extra work of its paths.
    #[inline(always)]
    pub fn features(&self) -> Features {
        self.features
    }

    /// The media of the scene; `None` if paths need none beyond the absorption of bodies.
    #[inline]
    pub(crate) fn media(&self) -> Option<&Media> {
        self.media.as_deref()
    }

    /// True if a random number may decide where an edge of a path ends: in media, or at surfaces of partial opacity.
    #[inline]
    pub(crate) fn draws_ends(&self) -> bool {
        self.draws_ends
    }

    /// True if there are surfaces of partial opacity, which some rays pass.
    pub(crate) fn has_layers(&self) -> bool {
        self.geometry.has_layers()
    }

    /// True if any medium scatters light.
    pub(crate) fn scatters(&self) -> bool {
        self.media().is_some_and(Media::scatters)
    }

    /// True if the index of refraction at an interface depends on the path: on its channel or the bodies around it.
    #[inline]
    pub(crate) fn has_paths_indices(&self) -> bool {
        self.features.dispersion || self.features.overlaps
    }

    /// True if a path must track the bodies that contain it.
    #[inline]
    pub(crate) fn tracks_bodies(&self) -> bool {
        self.features.absorption || self.features.overlaps || self.media.is_some()
    }

    /// Rank of a material: where bodies overlap, the material of the highest rank counts.
    #[inline]
    pub(crate) fn rank(&self, material: u32) -> u32 {
        self.ranks[material as usize]
    }

    /// True if a ray from a surface of this material into its body can reach no light before it leaves the body.
    #[inline]
    pub(crate) fn is_dark_inside(&self, material: u32) -> bool {
        self.dark_inside.get_or_init(|| self.find_dark_insides())[material as usize]
    }

    /// Triangles and their tree.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// The lights.
    #[inline]
    pub fn lights(&self) -> &Lights {
        &self.lights
    }

    /// Closest hit in front of the ray's origin, without hits that opacity removes.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.geometry.intersect(&self.parts, ray)
    }

    /// [`Scene::intersect`] where `u`, uniform in [0, 1), decides which surfaces of partial opacity are hit. It stays
    /// uniform whatever the ray hits; `None` for a hash of the ray.
    pub(crate) fn intersect_drawn(&self, ray: &Ray, u: &mut Option<f64>) -> Option<Hit> {
        match u {
            Some(u) => self.geometry.intersect_drawn(&self.parts, ray, u),
            None => self.intersect(ray),
        }
    }

    /// The distance at which a ray first hits a surface whose normal is within acos(`least`) of `normal`, and the
    /// cosine between the two. Every surface counts as opaque.
    pub(crate) fn closest_facing(&self, ray: &Ray, normal: Vec3, least: f32) -> Option<(f32, f32)> {
        let cos = |triangle| self.geometry.triangle_normal(triangle).dot(normal);
        let hit = (self.geometry).closest_of(ray, |triangle| cos(triangle) > least)?;
        Some((hit.t, cos(hit.triangle)))
    }

    /// True if the disk of this radius around a surface point lies in its triangle.
    #[inline]
    pub(crate) fn inside_triangle(&self, surface: &Surface, radius: f32) -> bool {
        let [a, b, c] = self.geometry.triangle(surface.triangle);
        let across = (b - a).cross(c - a).normalize();
        let within = |from: Vec3, to: Vec3| {
            let inwards = across.cross(to - from);
            (surface.position - from).dot(inwards) >= radius * inwards.length()
        };
        within(a, b) && within(b, c) && within(c, a)
    }

    /// True if a camera ray along `dir` passes through its hit: the back of a surface that shows only its front, or a
    /// lamp that shows neither side. All other rays hit both sides, so that the illumination does not change.
    #[inline]
    pub(crate) fn hides_back(&self, hit: &Hit, dir: Vec3) -> bool {
        self.geometry.hides_back(hit.triangle, dir)
    }

    /// [`Scene::hides_back`] at a surface point.
    #[inline]
    pub(crate) fn hides_surface(&self, surface: &Surface, dir: Vec3) -> bool {
        !surface.is_in_medium() && self.geometry.hides_back(surface.triangle, dir)
    }

    /// [`Scene::intersect`] for a camera ray, which passes through surfaces that are hidden from the camera.
    pub fn intersect_seen(&self, ray: &Ray) -> Option<Hit> {
        let (mut rest, mut before) = (*ray, 0.0);
        for _ in 0..bodies::MAX_SURFACES {
            let hit = self.intersect(&rest)?;
            let t = before + hit.t;
            if !self.hides_back(&hit, ray.dir) {
                return Some(Hit { t, ..hit });
            }
            (rest, before) = (self.surface(&hit).spawn(ray.dir), t);
            rest.t_max = ray.t_max - before;
        }
        None
    }

    /// The surface that a camera ray shows: the first of [`Scene::intersect_seen`] that does not just bound a medium.
    pub(crate) fn surface_seen(&self, ray: &Ray) -> Option<(Hit, Surface)> {
        let (mut rest, mut before) = (*ray, 0.0);
        for _ in 0..bodies::MAX_SURFACES {
            let hit = self.intersect_seen(&rest)?;
            let (surface, t) = (self.surface(&hit), before + hit.t);
            if !self.material(&surface).is_null() {
                return Some((Hit { t, ..hit }, surface));
            }
            (rest, before) = (surface.spawn(ray.dir), t);
            rest.t_max = ray.t_max - before;
        }
        None
    }

    /// True if anything stands between the ray's origin and its `t_max`.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.geometry.occluded(&self.parts, ray)
    }

    /// True if some surface is a [pane](Material::is_pane).
    #[inline]
    pub(crate) fn has_panes(&self) -> bool {
        !self.panes.is_empty()
    }

    /// True for a smooth thin wall. Shadow rays pass straight through it, so that its transmission does not count as
    /// scattering: emission behind it counts at the vertex before it.
    #[inline]
    pub(crate) fn is_pane(&self, surface: &Surface) -> bool {
        self.has_panes() && self.panes[surface.material as usize]
    }

    /// Transmittance of a pane straight along `dir`, which leads away from the camera; `None` for other surfaces, and
    /// where the drawn BSDF does not transmit.
    pub(crate) fn pane_transmittance(&self, surface: &Surface, dir: Vec3) -> Option<Rgb> {
        if !self.is_pane(surface) {
            return None;
        }
        let mut surface = *surface;
        let Bsdf::Thin(wall) = self.bsdf(&mut surface, 0.0) else {
            return None;
        };
        let cos = surface.frame_for(-dir).n.dot(dir);
        let share = self
            .material(&surface)
            .transmitted(&self.parts.textures, surface.uv);
        Some(share * wall.straight_transmittance(cos))
    }

    /// Transmittance between the ray's origin and its `t_max`: the product over surfaces of partial opacity, or over at
    /// most `most` panes; `None` if anything else blocks the ray.
    #[inline]
    pub(crate) fn open_transmittance(&self, ray: &Ray, most: u32) -> Option<Rgb> {
        let is_pane = |material: u32| self.panes.get(material as usize) == Some(&true);
        if let Some(passed) = self.geometry.transmittance(&self.parts, ray, is_pane) {
            return Some(Rgb::splat(passed));
        }
        if self.has_panes() {
            self.through_panes(ray, most)
        } else {
            None
        }
    }

    #[cold]
    #[inline(never)]
    fn through_panes(&self, ray: &Ray, most: u32) -> Option<Rgb> {
        let (mut rest, mut passed) = (*ray, Rgb::ONE);
        for _ in 0..=most {
            let Some(hit) = self.intersect(&rest) else {
                return Some(passed);
            };
            let surface = self.surface(&hit);
            passed *= self.pane_transmittance(&surface, ray.dir)?;
            let t_max = rest.t_max - hit.t;
            rest = surface.spawn(ray.dir);
            rest.t_max = t_max;
        }
        None
    }

    /// Interpolates the surface at a hit.
    #[inline]
    pub fn surface(&self, hit: &Hit) -> Surface {
        Surface {
            curved_height: 0.0,
            ..self.geometry.surface(&self.parts, hit)
        }
    }

    /// The surface at a hit of a camera walk along `dir`, with its [`Surface::curved_height`] if on its front.
    #[inline]
    pub fn surface_along(&self, hit: &Hit, dir: Vec3) -> Surface {
        let mut surface = self.geometry.surface(&self.parts, hit);
        if surface.curved_height > 0.0 && dir.dot(surface.ng) > 0.0 {
            surface.curved_height = 0.0;
        }
        surface
    }

    /// The material at a surface point.
    #[inline]
    pub(crate) fn material(&self, surface: &Surface) -> &Material {
        &self.parts.materials[surface.material as usize]
    }

    /// The BSDF at a surface point; `u` in [0, 1) chooses between the two BSDFs of a partly transmissive material, and
    /// between a clear coat and its base. Sets the normal of the surface if the choice has its own.
    #[inline(always)]
    pub fn bsdf(&self, surface: &mut Surface, u: f32) -> Bsdf {
        self.bsdf_seen(surface, u, || None)
    }

    /// The BSDF of a material if it is the same at every point. A reference, since a copy is written in parts and read
    /// whole, which stalls until all parts are stored.
    #[inline]
    pub(crate) fn constant_bsdf(&self, material: u32) -> Option<&Bsdf> {
        self.constant_bsdfs[material as usize].as_ref()
    }

    /// [`Scene::bsdf`] of a surface that the camera sees, as a mean over the footprint of a pixel if there is one.
    ///
    /// Every integrator and every strategy uses it for the first surface that the camera sees, directly or through
    /// panes, so that their MIS weights agree. For all other surfaces textures are looked up at a point.
    #[inline(always)]
    pub fn bsdf_seen(
        &self,
        surface: &mut Surface,
        u: f32,
        footprint: impl FnOnce() -> Option<Footprint>,
    ) -> Bsdf {
        // Copied from the table: a copy of a value that was just computed would wait for its stores.
        match self.constant_bsdfs[surface.material as usize] {
            Some(bsdf) => bsdf,
            None => self.varying_bsdf(surface, u, footprint()),
        }
    }

    /// True if cameras see the colour of this material as a mean over a pixel's footprint.
    #[inline]
    pub(crate) fn is_filtered(&self, material: u32) -> bool {
        self.filtered.get(material as usize) == Some(&true)
    }

    /// True if [`Scene::is_filtered`] is true for any material.
    #[inline]
    pub(crate) fn has_filtered(&self) -> bool {
        !self.filtered.is_empty()
    }

    /// Reflectance of a surface whose BSDF is drawn as `drawn`. Under a coat or a sheen it is the base's, whichever is
    /// drawn, so that even few samples show no noise. A mixture has the reflectance of the drawn material.
    pub(crate) fn reflectance(&self, surface: &Surface, drawn: &Bsdf) -> Rgb {
        match &self.material(surface).finish {
            Some(finish) if finish.covers() && finish.mix.is_none() => {
                let last = 1.0 - 0.5 * f32::EPSILON;
                match self.finished_bsdf(finish, &mut surface.clone(), last) {
                    Bsdf::Covered(covered) => covered.base().reflectance(),
                    base => base.reflectance(),
                }
            }
            _ => drawn.reflectance(),
        }
    }

    #[inline(never)]
    fn varying_bsdf(&self, surface: &mut Surface, u: f32, footprint: Option<Footprint>) -> Bsdf {
        let material = self.material(surface);
        let bsdf = match &material.finish {
            None => {
                let axes = footprint
                    .filter(|_| self.is_filtered(surface.material))
                    .and_then(|footprint| self.geometry.uv_axes(&self.parts, surface, &footprint));
                let values = material.sampled_over(&self.parts.textures, surface.uv, axes);
                material.bsdf_of(&values, u)
            }
            Some(finish) => self.finished_bsdf(finish, surface, u),
        };
        if let Bsdf::Diffuse(_) = bsdf {
            surface.min_mirror_cos = normals::MIN_COS_MATT;
        }
        bsdf
    }

    /// The emission at the end of a ray, with the density of light sampling from its origin; `None` if nothing emits
    /// there.
    ///
    /// For regularised lobe samples, whose rays count emission only. The lights are traversed first, so that a ray that
    /// hits none of them does not traverse the whole scene.
    #[inline]
    pub fn emission_along(&self, ray: &Ray) -> Option<Emission> {
        let lights = &self.lights;
        let met = lights.closest(ray);
        // Opacity may remove the emitter itself, which only a traversal of the whole scene takes into account.
        let whole = met.is_some() && self.geometry.has_opacity();
        let hit = if whole { self.intersect(ray) } else { met };
        let hidden = |t_max| !whole && self.occluded(&Ray { t_max, ..*ray });
        let Some(hit) = hit else {
            let radiance = lights.environment(ray.dir);
            return (radiance != Rgb::ZERO && !hidden(ray.t_max)).then(|| Emission {
                radiance,
                pdf_w: lights.pdf_environment(ray.origin, ray.dir),
                distance: f32::INFINITY,
            });
        };
        let surface = self.surface(&hit);
        let radiance = lights.emitted(&surface, -ray.dir);
        // The emitter's own surface must not hide it. Both trees find it at the same distance, bit for bit.
        (radiance != Rgb::ZERO && !hidden(hit.t.next_down())).then(|| Emission {
            radiance,
            pdf_w: lights.pdf_emitter(ray.origin, &surface),
            distance: hit.t,
        })
    }
}

impl Scene {
    /// The emission of the surface that a ray has hit, or of the environment without a hit; `None` if it is zero.
    pub(crate) fn emission_at(&self, ray: &Ray, hit: Option<Hit>) -> Option<Emission> {
        let lights = &self.lights;
        let emission = match hit {
            None => Emission {
                radiance: lights.environment(ray.dir),
                pdf_w: lights.pdf_environment(ray.origin, ray.dir),
                distance: f32::INFINITY,
            },
            Some(hit) => {
                let surface = self.surface(&hit);
                Emission {
                    radiance: lights.emitted(&surface, -ray.dir),
                    pdf_w: lights.pdf_emitter(ray.origin, &surface),
                    distance: hit.t,
                }
            }
        };
        (emission.radiance != Rgb::ZERO).then_some(emission)
    }
}

impl Surface {
    /// Shading frame for light that leaves or arrives along `w`. Its normal is `ns`, bent towards `ng` just so far that
    /// the mirror image of `w` has a cosine of [`Surface::min_mirror_cos`] with `ng` on the side of `w`.
    ///
    /// The value of a BSDF uses the frame for the direction towards the camera; the density of a walk uses the frame
    /// for the direction from which it came. Where neither direction bends `ns`, the frames are equal bit for bit.
    #[inline]
    pub fn frame_for(&self, w: Vec3) -> Frame {
        Frame::from_normal(self.bent_normal(w))
    }

    #[inline]
    fn bent_normal(&self, w: Vec3) -> Vec3 {
        normals::bent(self.ns, self.ng, w, self.min_mirror_cos)
    }

    /// [`Surface::frame_for`] `w` bit for bit. Reuses `known`, the frame for another direction, if it is equal.
    #[inline]
    pub(crate) fn frame_near(&self, known: &Frame, w: Vec3) -> Frame {
        let n = self.bent_normal(w);
        if n == known.n {
            *known
        } else {
            Frame::from_normal(n)
        }
    }

    /// True if a camera walk may go on towards `w`, whose cosine in the shading frame is `z`. Either both normals agree
    /// on the side, or `w` is below the triangle's plane but above the curved surface, from which such rays start.
    #[inline]
    pub(crate) fn allows_direction(&self, w: Vec3, z: f32) -> bool {
        w.dot(self.ng) * z > 0.0 || (z > 0.0 && self.is_below(w))
    }

    /// True for a direction below the plane of a triangle of a curved surface; the triangle gets no light from there.
    #[inline]
    pub(crate) fn is_below(&self, w: Vec3) -> bool {
        self.curved_height > 0.0 && w.dot(self.ng) <= 0.0
    }

    /// A ray that leaves this surface towards `dir`, starting clear of it.
    #[inline]
    pub(crate) fn spawn(&self, dir: Vec3) -> Ray {
        let side = if dir.dot(self.ng) >= 0.0 {
            self.error
        } else {
            -self.error
        };
        Ray::new(self.position + side * self.ng, dir)
    }

    /// A ray from the surface, offset so that it does not hit it again; its direction may be below the plane of a
    /// triangle of a curved surface.
    #[inline]
    pub fn spawn_leaving(&self, dir: Vec3) -> Ray {
        if self.is_below(dir) {
            let height = self.curved_height.max(self.error);
            return Ray::new(self.position + height * self.ng, dir);
        }
        self.spawn(dir)
    }

    /// [`Surface::spawn_leaving`] towards the point at `distance` along `dir`, and the distance from its origin.
    #[inline]
    fn spawn_towards(&self, dir: Vec3, distance: f32) -> (Ray, f32) {
        let ray = self.spawn_leaving(dir);
        if !self.is_below(dir) || distance == f32::INFINITY {
            return (ray, distance);
        }
        let to = self.position + distance * dir - ray.origin;
        let length = to.length();
        (Ray::new(ray.origin, to / length), length)
    }

    /// The segment from this surface along `dir` to just before another surface at this distance, whose absolute cosine
    /// with `dir` is `cos`.
    #[inline]
    pub(crate) fn spawn_to(&self, other: &Self, dir: Vec3, distance: f32, cos: f32) -> Ray {
        let (mut ray, distance) = self.spawn_towards(dir, distance);
        let slack = (self.error + other.error + 2.0 * f32::EPSILON * distance) / cos;
        ray.t_max = (distance - slack).max(0.5 * distance);
        ray
    }

    /// The segment from this surface to just before a light sample.
    #[inline]
    pub fn spawn_to_light(&self, light: &LightSample) -> Ray {
        let (mut ray, distance) = self.spawn_towards(light.wi, light.distance);
        // The light's own surface must not hide it, but a sheet just before it must. A rounding error e along the
        // normal moves the hit by e over the cosine. For a light at infinity the difference stays infinite.
        let slack = (self.error + light.error) / light.cos;
        ray.t_max = (distance - slack).max(0.5 * distance);
        ray
    }
}
