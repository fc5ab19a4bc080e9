//! The world: geometry, materials, lights and cameras, immutable after it is built.
//!
//! A [`Scene`] is made from [`SceneParts`] (plain data, filled by [`load`] or by the [gallery](crate::gallery)). Indices are typed by
//! their field names; nothing holds references.

use crate::bsdf::Bsdf;
use crate::math::{Frame, Ray, Rgb, Vec2, Vec3};

pub mod accel;
pub mod camera;
pub mod environment;
pub mod geometry;
pub mod light;
pub mod load;
pub mod material;
pub mod mesh;
mod normals;
pub mod punctual;
pub mod sensor;
pub mod texture;

pub use camera::Camera;
pub use environment::Environment;
pub use geometry::Geometry;
pub use light::{Emission, Emitters, LightSample};
pub use material::Material;
pub use mesh::Mesh;
pub use punctual::PunctualLight;
pub use sensor::Sensor;
pub use texture::Texture;

/// Everything a scene is made of, as plain data.
#[derive(Clone, Debug, Default)]
pub struct SceneParts {
    /// Triangle meshes in world space.
    pub meshes: Vec<Mesh>,
    /// Materials; `Mesh::material` is an index into this list.
    pub materials: Vec<Material>,
    /// Textures; materials hold indices into this list.
    pub textures: Vec<Texture>,
    /// Point, spot and directional lights.
    pub lights: Vec<PunctualLight>,
    /// What surrounds the scene.
    pub environment: Option<Environment>,
    /// Cameras, in file order.
    pub cameras: Vec<Camera>,
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

/// A point of a surface, as the integrator sees it.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World position.
    pub position: Vec3,
    /// Unit geometric normal, towards the front side (counter-clockwise winding).
    pub ng: Vec3,
    /// Shading frame; its normal lies on the same side as `ng`.
    pub frame: Frame,
    /// Texture coordinates (set 0).
    pub uv: Vec2,
    /// Index of the triangle, in scene order.
    pub triangle: u32,
    /// Index of the material.
    pub material: u32,
    /// How far a ray must start from `position` along ±`ng` to be clear of this surface's rounding error.
    pub error: f32,
}

/// The immutable scene.
pub struct Scene {
    parts: SceneParts,
    geometry: Geometry,
    emitters: Emitters,
    has_absorption: bool,
    has_lobes: bool,
    warnings: Vec<String>,
}

impl Scene {
    /// Builds the tree and the light distributions. Degenerate input is dropped and listed in [`Scene::warnings`].
    pub fn new(parts: SceneParts) -> Self {
        let mut warnings = Vec::new();
        let geometry = Geometry::new(&parts, &mut warnings);
        let emitters = Emitters::new(&parts, &geometry, &mut warnings);
        let has_absorption = (parts.materials.iter()).any(|m| m.absorption != Rgb::ZERO);
        let mut shown = parts.meshes.iter().map(|m| m.material as usize);
        let has_lobes = shown.any(|m| !parts.materials.get(m).is_some_and(Material::is_rough));
        Self {
            parts,
            geometry,
            emitters,
            has_absorption,
            has_lobes,
            warnings,
        }
    }

    /// What was odd about the scene and how it was treated; one line each.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The plain data the scene was built from.
    pub fn parts(&self) -> &SceneParts {
        &self.parts
    }

    /// Whether any body absorbs light on its way through.
    #[inline]
    pub fn has_absorption(&self) -> bool {
        self.has_absorption
    }

    /// Whether any surface has a lobe that a rule could roughen.
    pub fn has_lobes(&self) -> bool {
        self.has_lobes
    }

    /// Triangles and their tree.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Everything that emits.
    pub fn emitters(&self) -> &Emitters {
        &self.emitters
    }

    /// Closest hit in front of the ray's origin, alpha-masked parts left out.
    #[inline]
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        self.geometry.intersect(&self.parts, ray)
    }

    /// Whether anything stands between the ray's origin and its `t_max`.
    #[inline]
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.geometry.occluded(&self.parts, ray)
    }

    /// Interpolates the surface at a hit of `ray`.
    #[inline]
    pub fn surface(&self, ray: &Ray, hit: &Hit) -> Surface {
        self.geometry.surface(&self.parts, ray, hit)
    }

    /// The material at a surface point.
    #[inline]
    pub fn material(&self, surface: &Surface) -> &Material {
        &self.parts.materials[surface.material as usize]
    }

    /// The closure at a surface point; `u` in [0, 1) chooses between the closures of a partly transmissive material.
    #[inline]
    pub fn bsdf(&self, surface: &Surface, u: f32) -> Bsdf {
        self.material(surface)
            .bsdf(&self.parts.textures, surface.uv, u)
    }

    /// Draws a light and a point on it, as seen from `from`. `None` where the light drawn does not reach `from`.
    /// Visibility is not tested.
    #[inline]
    pub fn sample_light(&self, from: Vec3, u: [f32; 3]) -> Option<LightSample> {
        self.emitters.sample(&self.parts, &self.geometry, from, u)
    }

    /// Radiance emitted by a surface point towards `wo` (world); zero for most surfaces and for unlit sides.
    #[inline]
    pub fn emitted(&self, surface: &Surface, wo: Vec3) -> Rgb {
        self.emitters.emitted(&self.parts, surface, wo)
    }

    /// Density per steradian with which [`Scene::sample_light`] from `from` draws the direction to that emitting point.
    #[inline]
    pub fn pdf_emitter(&self, from: Vec3, surface: &Surface) -> f32 {
        self.emitters.pdf_emitter(from, surface)
    }

    /// Radiance seen from the scene when looking along `dir` past all surfaces.
    #[inline]
    pub fn environment(&self, dir: Vec3) -> Rgb {
        self.parts
            .environment
            .as_ref()
            .map_or(Rgb::ZERO, |e| e.radiance(dir))
    }

    /// Density per steradian with which [`Scene::sample_light`] draws the direction `dir` from the environment.
    #[inline]
    pub fn pdf_environment(&self, dir: Vec3) -> f32 {
        self.emitters.pdf_environment(&self.parts, dir)
    }

    /// The emission at the end of a ray, as light sampling from the ray's origin sees it; `None` if the ray ends on
    /// something dark.
    ///
    /// For regularised lobe samples, whose ray counts emission only (method section 3): asks the emitters first, so
    /// that a ray which meets none of them never walks the whole scene.
    #[inline]
    pub fn emission_along(&self, ray: &Ray) -> Option<Emission> {
        self.emitters.emission_along(self, ray)
    }
}

impl Surface {
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

    /// The segment from this surface to just before a light sample.
    #[inline]
    pub fn spawn_to_light(&self, light: &LightSample) -> Ray {
        let mut ray = self.spawn(light.wi);
        // The light's own surface must not hide it, a sheet just before it must: what rounding moves along the normal
        // moves the meeting point by that over the cosine. For a light at infinity the difference stays infinite.
        let slack = (self.error + light.error) / light.cos;
        ray.t_max = (light.distance - slack).max(0.5 * light.distance);
        ray
    }
}
