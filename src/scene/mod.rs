//! The world: geometry, materials, lights and cameras, immutable after it is built.
//!
//! A [`Scene`] is made from [`SceneParts`] (plain data, filled by [`load`] or by the [gallery](crate::gallery)). Indices are typed by
//! their field names; nothing holds references.

use crate::bsdf::Bsdf;
use crate::math::{Frame, Ray, Rgb, Vec2, Vec3, luminance};
use crate::sampler::LightU;
use std::sync::OnceLock;

pub mod accel;
pub mod bodies;
pub mod camera;
pub mod finish;
pub mod geometry;
mod instances;
pub mod light;
pub mod load;
pub mod material;
pub mod mesh;
mod normals;

pub mod sensor;
pub mod texture;

pub use camera::{Camera, Lens};
pub use geometry::Geometry;
pub use light::{
    Emission, EmissionDensity, EmissionSample, Environment, LightDensity, LightSample, Lights,
    PunctualLight,
};
pub use material::Material;
pub use mesh::{Mesh, SharedMesh};

pub use sensor::{Sensor, Sighting};
pub use texture::Texture;

/// Everything a scene is made of, as plain data.
#[derive(Clone, Debug, Default)]
pub struct SceneParts {
    /// Triangle meshes in world space.
    pub meshes: Vec<Mesh>,
    /// Meshes that are shown at several poses and kept once. The program shares where copies would take much memory; see
    /// [`load`].
    pub shared: Vec<SharedMesh>,
    /// Materials; `Mesh::material` is an index into this list.
    pub materials: Vec<Material>,
    /// Textures; materials hold indices into this list.
    pub textures: Vec<Texture>,
    /// Point, spot and directional lights.
    pub lights: Vec<PunctualLight>,
    /// Radiance from infinity.
    pub environment: Option<Environment>,
    /// Cameras, in file order.
    pub cameras: Vec<Camera>,
}

impl SceneParts {
    /// All meshes, the shared ones once and in their own space.
    pub fn all_meshes(&self) -> impl Iterator<Item = &Mesh> {
        let shared = self.shared.iter().map(|shared| &shared.mesh);
        self.meshes.iter().chain(shared)
    }
}

/// A ray's closest hit: 16 bytes.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hit {
    /// Distance along the ray.
    pub t: f32,
    /// Index of the triangle, in scene order.
    pub triangle: u32,
    /// Barycentric weight of the second corner.
    pub u: f32,
    /// Barycentric weight of the third corner.
    pub v: f32,
}

/// A point of a surface, the same for every ray that meets it.
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
    /// Index of the triangle, in scene order.
    pub triangle: u32,
    /// Index of the material.
    pub material: u32,
    /// Distance from `position` along ±`ng` at which a ray is clear of this surface's rounding error.
    pub error: f32,
}

/// The immutable scene.
pub struct Scene {
    parts: SceneParts,
    geometry: Geometry,
    lights: Lights,
    /// The BSDF of each material that has the same everywhere.
    constant_bsdfs: Vec<Option<Bsdf>>,
    has_absorption: bool,
    has_dispersion: bool,
    has_overlaps: bool,
    has_touching: bool,
    /// Rank of each material where bodies overlap.
    ranks: Vec<u32>,
    has_lobes: bool,
    /// For each material, true if no light can reach its bodies' surfaces from inside of them; found when first asked for,
    /// since smooth bodies never ask.
    dark_inside: OnceLock<Vec<bool>>,
    warnings: Vec<String>,
}

impl Scene {
    /// Builds the tree and the light distributions. Degenerate input is dropped and listed in [`Scene::warnings`].
    pub fn new(parts: SceneParts) -> Self {
        let mut scene = Self::build(parts, true);
        let priorities =
            (scene.parts.materials.iter()).any(|m| m.bounds_body() && m.priority != 0.0);
        scene.has_touching = scene.finds_touching();
        scene.has_overlaps = priorities || scene.has_touching || scene.find_overlaps();
        scene
    }

    /// The scene without trees, and without a search for bodies that overlap: to be described, not rendered. No ray meets
    /// what is not shared.
    pub fn outline(parts: SceneParts) -> Self {
        Self::build(parts, false)
    }

    fn build(parts: SceneParts, trees: bool) -> Self {
        let mut warnings = Vec::new();
        let geometry = Geometry::build(&parts, trees, &mut warnings);
        let lights = Lights::new(&parts, &geometry, &mut warnings);
        let has_absorption = (parts.materials.iter()).any(|m| m.absorption != Rgb::ZERO);
        let has_dispersion =
            (parts.materials.iter()).any(|m| m.dispersion > 0.0 && m.bounds_body());
        let shown = |m: &Mesh| parts.materials.get(m.material as usize);
        let has_lobes = (parts.all_meshes()).any(|m| !shown(m).is_some_and(Material::is_rough));
        let constant_bsdfs = (parts.materials.iter()).map(Material::constant_bsdf);
        Self {
            constant_bsdfs: constant_bsdfs.collect(),
            ranks: bodies::ranks(&parts),
            parts,
            geometry,
            lights,
            has_absorption,
            has_dispersion,
            has_overlaps: false,
            has_touching: false,
            has_lobes,
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

    /// True if any body absorbs light.
    #[inline]
    pub fn has_absorption(&self) -> bool {
        self.has_absorption
    }

    /// True if any body refracts each colour channel by an index of its own.
    #[inline]
    pub fn has_dispersion(&self) -> bool {
        self.has_dispersion
    }

    /// True if bodies overlap, touch or have priorities: what a boundary is depends on the bodies around it.
    #[inline]
    pub fn has_overlaps(&self) -> bool {
        self.has_overlaps
    }

    /// True if a path must know the bodies around it.
    #[inline]
    pub fn tracks_bodies(&self) -> bool {
        self.has_absorption || self.has_overlaps
    }

    /// Rank of a material where bodies overlap: that of the highest is there.
    #[inline]
    pub fn rank(&self, material: u32) -> u32 {
        self.ranks[material as usize]
    }

    /// True if a ray that starts on a surface of this material towards its inside can meet no light before that body ends.
    #[inline]
    pub fn is_dark_inside(&self, material: u32) -> bool {
        self.dark_inside.get_or_init(|| self.find_dark_insides())[material as usize]
    }

    /// True if any surface has a lobe that a rule could roughen.
    pub fn has_lobes(&self) -> bool {
        self.has_lobes
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

    /// Camera for a file that has none: all of the scene, from the side that the lights shine on.
    pub fn framing_camera(&self, aspect: f32) -> Camera {
        let (low, high) = self.geometry.bounds();
        let light = self.light_direction(0.5 * (low + high));
        Camera::framing_lit((low, high), light, aspect)
    }

    /// Direction from a point towards the lights, weighted by the irradiance that each would send there if nothing stood
    /// between; zero without lights.
    fn light_direction(&self, from: Vec3) -> Vec3 {
        /// Enough to find a side.
        const SAMPLES: u32 = 1024;
        // A sequence of low discrepancy: multiples of powers of the root of x⁴ = x + 1.
        let at = |i: u32, step: f64| (f64::from(i) * step).fract();
        let one = |i: u32| {
            let u = LightU {
                pick: at(i, 0.819_172_513_396_164_4),
                at: Vec2::new(
                    at(i, 0.671_043_606_703_789_2) as f32,
                    at(i, 0.549_700_477_901_97) as f32,
                ),
            };
            let light = self.lights.sample(from, u)?;
            let towards = light.wi * (luminance(light.radiance) / light.density.value());
            towards.is_finite().then_some(towards)
        };
        (1..=SAMPLES).filter_map(one).sum::<Vec3>() / SAMPLES as f32
    }

    /// Closest hit in front of the ray's origin; parts that opacity removes are skipped.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.geometry.intersect(&self.parts, ray)
    }

    /// True if anything stands between the ray's origin and its `t_max`.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.geometry.occluded(&self.parts, ray)
    }

    /// Interpolates the surface at a hit.
    #[inline]
    pub fn surface(&self, hit: &Hit) -> Surface {
        self.geometry.surface(&self.parts, hit)
    }

    /// The material at a surface point.
    #[inline]
    pub fn material(&self, surface: &Surface) -> &Material {
        &self.parts.materials[surface.material as usize]
    }

    /// The BSDF at a surface point; `u` in [0, 1) chooses between the two BSDFs of a partly transmissive material, and
    /// between a clear coat and its base. Where that has a normal of its own the surface gets it.
    #[inline(always)]
    pub fn bsdf(&self, surface: &mut Surface, u: f32) -> Bsdf {
        // A copy of what was just computed would wait for its stores.
        match self.constant_bsdfs[surface.material as usize] {
            Some(bsdf) => bsdf,
            None => self.varying_bsdf(surface, u),
        }
    }

    #[inline(never)]
    fn varying_bsdf(&self, surface: &mut Surface, u: f32) -> Bsdf {
        let material = self.material(surface);
        match &material.finish {
            None => material.bsdf(&self.parts.textures, surface.uv, u),
            Some(finish) => self.finished_bsdf(finish, surface, u),
        }
    }

    /// The emission at the end of a ray, as light sampling from the ray's origin sees it; `None` if the ray ends on
    /// something dark.
    ///
    /// For regularised lobe samples, whose ray counts emission only: the lights are asked first, so that a ray that
    /// meets none of them never walks the whole scene.
    #[inline]
    pub fn emission_along(&self, ray: &Ray) -> Option<Emission> {
        let lights = &self.lights;
        let met = lights.closest(ray);
        // Opacity may remove the emitter itself: then only the whole scene can tell.
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
    /// The emission of what a ray met first: a surface, or without one the environment.
    pub fn emission_at(&self, ray: &Ray, hit: Option<Hit>) -> Option<Emission> {
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
    /// Shading frame for light that leaves or arrives along `w`: its normal is `ns`, bent towards `ng` just so far that
    /// `w` sees the same side of both.
    ///
    /// A BSDF's value is a function of the frame for the direction towards the camera; the density of a walk is one of
    /// the frame for the direction the walk came from. Where neither direction bends `ns` these are equal bit for bit.
    #[inline]
    pub fn frame_for(&self, w: Vec3) -> Frame {
        Frame::from_normal(normals::bent(self.ns, self.ng, w))
    }

    /// [`Surface::frame_for`] `w`, bit for bit: hardly ever another than a frame for another direction, which is `known`.
    #[inline]
    pub fn frame_near(&self, known: &Frame, w: Vec3) -> Frame {
        let n = normals::bent(self.ns, self.ng, w);
        if n == known.n {
            *known
        } else {
            Frame::from_normal(n)
        }
    }

    /// A ray that leaves this surface towards `dir`, starting clear of it.
    #[inline]
    pub fn spawn(&self, dir: Vec3) -> Ray {
        let side = if dir.dot(self.ng) >= 0.0 {
            self.error
        } else {
            -self.error
        };
        Ray::new(self.position + side * self.ng, dir)
    }

    /// The segment from this surface along `dir` to just before another surface at this distance, whose absolute cosine
    /// with `dir` is `cos`.
    #[inline]
    pub fn spawn_to(&self, other: &Self, dir: Vec3, distance: f32, cos: f32) -> Ray {
        let mut ray = self.spawn(dir);
        let slack = (self.error + other.error + 2.0 * f32::EPSILON * distance) / cos;
        ray.t_max = (distance - slack).max(0.5 * distance);
        ray
    }

    /// The segment from this surface to just before a light sample.
    #[inline]
    pub fn spawn_to_light(&self, light: &LightSample) -> Ray {
        let mut ray = self.spawn(light.wi);
        // The light's own surface must not hide it, but a sheet just before it must. A rounding error e along the normal
        // moves the meeting point by e over the cosine. For a light at infinity the difference stays infinite.
        let slack = (self.error + light.error) / light.cos;
        ray.t_max = (light.distance - slack).max(0.5 * light.distance);
        ray
    }
}
