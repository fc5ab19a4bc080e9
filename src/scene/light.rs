//! All lights of a scene: which of them is sampled, from where, and what a ray that meets one finds.

use super::accel::Accel;
use super::material::AlphaMode;
use super::{Geometry, Hit, Scene, SceneParts, Surface};
use crate::math::discrete::AliasTable;
use crate::math::measure::area_to_solid_angle;
use crate::math::{Ray, Rgb, Vec2, Vec3, luminance, warp};
use std::f32::consts::PI;

/// A direction towards a light, drawn from a point.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub wi: Vec3,
    /// Distance to the light's surface; infinity for the environment and for directional lights.
    pub distance: f32,
    /// Radiance arriving from there; for lights without area the irradiance on a plane facing them.
    pub radiance: Rgb,
    /// Density per steradian, light choice included; for lights without area the probability of the choice.
    pub pdf_w: f32,
    /// Whether the light has no area: no lobe sample can ever hit it.
    pub delta: bool,
    /// Absolute cosine between the direction and the light's surface; 1 where it has none.
    pub cos: f32,
    /// How far rounding may move the light's surface along its normal; 0 for lights at infinity.
    pub error: f32,
}

/// Emission found at the end of a ray.
#[derive(Clone, Copy, Debug)]
pub struct Emission {
    /// Emitted radiance towards the ray's origin.
    pub radiance: Rgb,
    /// Density per steradian with which [`Scene::sample_light`] from the origin draws the ray's direction.
    pub pdf_w: f32,
    /// Distance; infinity for the environment.
    pub distance: f32,
}

/// One light among all.
#[derive(Clone, Copy, Debug)]
enum LightId {
    /// Emissive triangle, by its number in the scene.
    Triangle(u32),
    /// Index into `SceneParts::lights`.
    Punctual(u32),
    Environment,
}

/// All lights of a scene and the distribution over them.
pub struct Emitters {
    lights: Vec<LightId>,
    /// Which light, by power.
    choice: AliasTable,
    /// Density per area with which each triangle of the scene is drawn, 0 for dark ones; empty without area lights.
    triangle_pdf_a: Vec<f32>,
    environment_pmf: f32,
    /// Emissive triangles alone.
    tree: Option<EmitterTree>,
}

/// The emissive triangles by themselves: most rays meet none of them and are done.
struct EmitterTree {
    accel: Accel,
    /// Numbers of the triangles in the scene.
    triangles: Vec<u32>,
}

impl Emitters {
    /// Finds emissive triangles and weighs all lights by power.
    pub fn new(parts: &SceneParts, geometry: &Geometry, warnings: &mut Vec<String>) -> Self {
        let mut lights = Vec::new();
        let mut powers = Vec::new();
        let glow: Vec<f32> = parts
            .materials
            .iter()
            .map(|m| luminance(m.average_emission(&parts.textures)))
            .collect();
        for i in 0..geometry.len() as u32 {
            let m = geometry.triangle_material(i) as usize;
            if glow[m] > 0.0 {
                let sides = if parts.materials[m].double_sided {
                    2.0
                } else {
                    1.0
                };
                lights.push(LightId::Triangle(i));
                powers.push(f64::from(PI * geometry.triangle_area(i) * glow[m] * sides));
            }
        }
        let area_lights = lights.len();
        let (low, high) = geometry.bounds();
        // What a light at infinity sends into the scene goes through a disk of the scene's radius.
        let disk = f64::from(PI * (0.25 * low.distance_squared(high)).max(1e-12));
        for (i, light) in parts.lights.iter().enumerate() {
            lights.push(LightId::Punctual(i as u32));
            powers.push(light.power(disk));
        }
        if let Some(environment) = &parts.environment {
            lights.push(LightId::Environment);
            powers.push(f64::from(luminance(environment.average())) * f64::from(PI) * disk);
        }
        let choice = AliasTable::new(&powers);
        if choice.is_empty() {
            warnings.push("no light: the picture will be black".into());
            return Self {
                lights: Vec::new(),
                choice,
                triangle_pdf_a: Vec::new(),
                environment_pmf: 0.0,
                tree: None,
            };
        }
        let mut triangle_pdf_a = vec![0.0; if area_lights > 0 { geometry.len() } else { 0 }];
        let mut environment_pmf = 0.0;
        let mut triangles = Vec::with_capacity(area_lights);
        for (k, light) in lights.iter().enumerate() {
            match *light {
                LightId::Triangle(i) => {
                    triangle_pdf_a[i as usize] = choice.pmf(k) / geometry.triangle_area(i);
                    triangles.push(i);
                }
                LightId::Environment => environment_pmf = choice.pmf(k),
                LightId::Punctual(_) => {}
            }
        }
        let tree = (!triangles.is_empty()).then(|| {
            let corners: Vec<_> = triangles.iter().map(|&i| geometry.triangle(i)).collect();
            EmitterTree {
                accel: Accel::new(&corners),
                triangles,
            }
        });
        Self {
            lights,
            choice,
            triangle_pdf_a,
            environment_pmf,
            tree,
        }
    }

    /// Whether nothing emits.
    pub fn is_empty(&self) -> bool {
        self.choice.is_empty()
    }

    /// Number of emissive triangles.
    pub fn area_lights(&self) -> usize {
        self.tree.as_ref().map_or(0, |tree| tree.triangles.len())
    }

    /// See [`Scene::sample_light`].
    #[inline]
    pub fn sample(
        &self,
        parts: &SceneParts,
        geometry: &Geometry,
        from: Vec3,
        u: [f32; 3],
    ) -> Option<LightSample> {
        let (k, _) = self.choice.sample(u[0])?;
        let at = Vec2::new(u[1], u[2]);
        match self.lights[k] {
            LightId::Triangle(i) => self.sample_triangle(parts, geometry, i, from, at),
            LightId::Punctual(i) => parts.lights[i as usize].illuminate(from, self.choice.pmf(k)),
            LightId::Environment => {
                let (wi, radiance, pdf) = parts.environment.as_ref()?.sample(at)?;
                let pdf_w = pdf * self.choice.pmf(k);
                Some(LightSample {
                    wi,
                    distance: f32::INFINITY,
                    radiance,
                    pdf_w,
                    delta: false,
                    cos: 1.0,
                    error: 0.0,
                })
            }
        }
    }

    /// A uniform point of a triangle.
    #[inline]
    fn sample_triangle(
        &self,
        parts: &SceneParts,
        geometry: &Geometry,
        i: u32,
        from: Vec3,
        u: Vec2,
    ) -> Option<LightSample> {
        let [a, b, c] = geometry.triangle(i);
        let weights = warp::triangle(u);
        let (e1, e2) = (b - a, c - a);
        let point = a + weights.x * e1 + weights.y * e2;
        let to = point - from;
        let distance = to.length();
        let wi = to / distance;
        let material = &parts.materials[geometry.triangle_material(i) as usize];
        let normal = geometry.triangle_normal(i);
        let cos = -wi.dot(normal);
        if !(cos > 0.0 || (material.double_sided && cos < 0.0)) {
            return None;
        }
        let pdf_w = area_to_solid_angle(self.triangle_pdf_a[i as usize], from, point, cos.abs());
        let varies = material.emissive_texture.is_some();
        let radiance = if varies || material.alpha_mode != AlphaMode::Opaque {
            let [ua, ub, uc] = geometry.triangle_uvs(parts, i);
            let uv = ua + weights.x * (ub - ua) + weights.y * (uc - ua);
            // The ray to the light ends before it: where the light has a hole nothing else would notice.
            material.emission_at(&parts.textures, uv) * material.presence(&parts.textures, uv)
        } else {
            material.emission
        };
        // Four roundings of the point, two of the direction.
        let reach = (a.abs() + e1.abs() + e2.abs()).dot(normal.abs());
        let error = f32::EPSILON * (4.0 * reach + 2.0 * distance);
        (pdf_w.is_finite() && pdf_w > 0.0).then_some(LightSample {
            wi,
            distance,
            radiance,
            pdf_w,
            delta: false,
            cos: cos.abs(),
            error,
        })
    }

    /// See [`Scene::emitted`].
    #[inline]
    pub fn emitted(&self, parts: &SceneParts, surface: &Surface, wo: Vec3) -> Rgb {
        let Some(&pdf_a) = self.triangle_pdf_a.get(surface.triangle as usize) else {
            return Rgb::ZERO;
        };
        let material = &parts.materials[surface.material as usize];
        if pdf_a == 0.0 || !(material.double_sided || wo.dot(surface.ng) > 0.0) {
            return Rgb::ZERO;
        }
        material.emission_at(&parts.textures, surface.uv)
    }

    /// See [`Scene::pdf_emitter`].
    #[inline]
    pub fn pdf_emitter(&self, from: Vec3, surface: &Surface) -> f32 {
        let cos = (surface.position - from).normalize().dot(surface.ng).abs();
        let pdf_a = self
            .triangle_pdf_a
            .get(surface.triangle as usize)
            .copied()
            .unwrap_or(0.0);
        area_to_solid_angle(pdf_a, from, surface.position, cos)
    }

    /// See [`Scene::pdf_environment`].
    #[inline]
    pub fn pdf_environment(&self, parts: &SceneParts, dir: Vec3) -> f32 {
        parts
            .environment
            .as_ref()
            .map_or(0.0, |e| e.pdf(dir) * self.environment_pmf)
    }

    /// See [`Scene::emission_along`].
    #[inline]
    pub fn emission_along(&self, scene: &Scene, ray: &Ray) -> Option<Emission> {
        if let Some(tree) = &self.tree
            && let Some(hit) = tree.accel.closest(ray)
        {
            let hit = Hit {
                triangle: tree.triangles[hit.triangle as usize],
                ..hit
            };
            if scene.geometry().has_opacity() {
                return self.emission_at_closest(scene, ray);
            }
            let surface = scene.surface(&hit);
            let radiance = scene.emitted(&surface, -ray.dir);
            // The emitter's own surface must not hide it. Both trees find it at the same distance to the bit.
            let segment = Ray {
                t_max: hit.t.next_down(),
                ..*ray
            };
            if radiance == Rgb::ZERO || scene.occluded(&segment) {
                return None;
            }
            let pdf_w = self.pdf_emitter(ray.origin, &surface);
            return Some(Emission {
                radiance,
                pdf_w,
                distance: hit.t,
            });
        }
        scene.parts().environment.as_ref()?;
        let radiance = scene.environment(ray.dir);
        if radiance == Rgb::ZERO || scene.occluded(ray) {
            return None;
        }
        Some(Emission {
            radiance,
            pdf_w: scene.pdf_environment(ray.dir),
            distance: f32::INFINITY,
        })
    }

    /// The same by way of the whole scene: where opacity may remove the emitter itself.
    fn emission_at_closest(&self, scene: &Scene, ray: &Ray) -> Option<Emission> {
        let Some(hit) = scene.intersect(ray) else {
            scene.parts().environment.as_ref()?;
            let (radiance, pdf_w) = (scene.environment(ray.dir), scene.pdf_environment(ray.dir));
            return (radiance != Rgb::ZERO).then_some(Emission {
                radiance,
                pdf_w,
                distance: f32::INFINITY,
            });
        };
        let surface = scene.surface(&hit);
        let radiance = scene.emitted(&surface, -ray.dir);
        let pdf_w = self.pdf_emitter(ray.origin, &surface);
        (radiance != Rgb::ZERO).then_some(Emission {
            radiance,
            pdf_w,
            distance: hit.t,
        })
    }
}
