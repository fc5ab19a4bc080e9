//! Area lights: the emissive triangles of a scene.

use super::aim::{AimShares, Source};
use super::tree::{Item, LightBounds};
use super::{LightDensity, LightSample};
use crate::math::measure::area_to_solid_angle;
use crate::math::{Ray, Rgb, Vec2, Vec3, luminance, warp};
use crate::scene::accel::Accel;
use crate::scene::material::AlphaMode;
use crate::scene::{Geometry, Hit, Material, SceneParts, Surface, Texture, TriangleId};
use std::f32::consts::{FRAC_1_PI, PI};
use std::sync::OnceLock;

/// Density per steradian with which an emission sample leaves a triangle at this cosine: |cos θ|/π, halved if both
/// sides emit.
#[inline]
fn emission_pdf(double_sided: bool, cos: f32) -> f32 {
    let sides = if double_sided { 2.0 } else { 1.0 };
    cos.abs() * FRAC_1_PI / sides
}

/// Power of a triangle that emits this radiance. Rounded to single precision unless it overflows there: alias tables,
/// and so pictures, depend on the last digit.
fn power(area: f32, radiance: f32, sides: f32) -> f64 {
    let rounded = PI * area * radiance * sides;
    if rounded.is_finite() {
        return rounded.into();
    }
    f64::from(PI) * f64::from(area) * f64::from(radiance) * f64::from(sides)
}

/// Factor of a material's radiance along `dir`.
#[inline]
fn share(material: &Material, dir: Vec3) -> f32 {
    material.cone().map_or(1.0, |cone| cone.share(dir))
}

/// All emissive triangles and their materials.
#[derive(Default)]
pub(super) struct AreaLights {
    triangles: Vec<EmissiveTriangle>,
    /// Emitted power of each triangle (luminance).
    powers: Vec<f64>,
    /// Texture coordinates of the triangles' corners.
    uvs: Vec<[Vec2; 3]>,
    /// Density per area with which each triangle that is not shared is drawn by power, 0 for dark ones; empty without
    /// area lights.
    pdf_a: Vec<f32>,
    /// Index in `triangles` of each triangle of the scene; set if there are many lights or aimed ones.
    places: OnceLock<Vec<u32>>,
    /// Tree over the emissive triangles alone, and their bounds.
    tree: Option<(Bounds, Accel)>,
    /// The scene's materials, in its order.
    materials: Vec<Material>,
    /// For each material, true if it emits: a short list, which stays in the cache unlike the densities.
    emits: Vec<bool>,
    textures: Vec<Texture>,
}

/// A triangle with all data for sampling its points, unless its emission varies.
struct EmissiveTriangle {
    corner: Vec3,
    /// From `corner` to the second and third corner.
    edges: [Vec3; 2],
    /// Unit normal, towards the front.
    normal: Vec3,
    area: f32,
    /// Magnitude of the coordinates along the normal, to which the rounding error of a point is proportional.
    reach: f32,
    /// Radiance where it does not vary.
    radiance: Rgb,
    double_sided: bool,
    /// True if texture, opacity or a cone make the radiance vary.
    varies: bool,
    /// The triangle, which no instances share.
    triangle: TriangleId,
    /// Index of the material.
    material: u32,
}

/// Bounding sphere and box of the emissive triangles, which reject most rays that hit none: the sphere rejects rays
/// that pass far away, the box, which is flat around a flat lamp, most others.
struct Bounds {
    centre: Vec3,
    radius: f32,
    low: Vec3,
    high: Vec3,
}

impl Bounds {
    fn new((low, high): (Vec3, Vec3)) -> Self {
        Self {
            centre: 0.5 * (low + high),
            radius: 0.5 * low.distance(high),
            low,
            high,
        }
    }

    /// False only if a ray misses the bounds; rounding errors never cause it.
    #[inline]
    fn may_hit(&self, ray: &Ray) -> bool {
        self.may_hit_ball(ray) && self.may_hit_box(ray)
    }

    #[inline]
    fn may_hit_ball(&self, ray: &Ray) -> bool {
        let to = self.centre - ray.origin;
        // Rounding errors of the squares below, and of the differences above.
        let slack = 1e-5 * (to.length_squared() + self.centre.length_squared());
        let far = to.length_squared() - self.radius * self.radius - slack;
        let along = to.dot(ray.dir);
        !(far > 0.0 && (along < 0.0 || far > along * along))
    }

    #[inline]
    fn may_hit_box(&self, ray: &Ray) -> bool {
        let inv = ray.dir.recip();
        let (a, b) = (
            (self.low - ray.origin) * inv,
            (self.high - ray.origin) * inv,
        );
        // Margins for three roundings and one more. The NaN of a ray in the plane of a side must not reject it.
        let enter = a.min(b).max_element() * (1.0 - 2.0 * f32::EPSILON);
        let leave = a.max(b).min_element() * (1.0 + 2.0 * f32::EPSILON);
        !(enter > leave || leave < 0.0)
    }
}

impl AreaLights {
    /// Collects the triangles whose material emits.
    pub(super) fn new(parts: &SceneParts, geometry: &Geometry) -> Self {
        let of_material = |m: &Material| luminance(m.average_emission(&parts.textures));
        let averages: Vec<f32> = parts.materials.iter().map(of_material).collect();
        let mut lights = Self::default();
        let average =
            |triangle: &TriangleId| averages[geometry.triangle_material(*triangle) as usize];
        let singles = (0..geometry.single() as u32).map(TriangleId::single);
        for triangle in singles.filter(|t| average(t) > 0.0) {
            let material = geometry.triangle_material(triangle);
            let of = &parts.materials[material as usize];
            let sides = if of.double_sided { 2.0 } else { 1.0 };
            let area = geometry.triangle_area(triangle);
            let [a, b, c] = geometry.triangle(triangle);
            let (edges, normal) = ([b - a, c - a], geometry.triangle_normal(triangle));
            lights.powers.push(power(area, average(&triangle), sides));
            lights.uvs.push(geometry.triangle_uvs(parts, triangle));
            lights.triangles.push(EmissiveTriangle {
                corner: a,
                edges,
                normal,
                area,
                reach: (a.abs() + edges[0].abs() + edges[1].abs()).dot(normal.abs()),
                radiance: of.emission,
                double_sided: of.double_sided,
                varies: of.emissive_texture.is_some()
                    || of.alpha_mode != AlphaMode::Opaque
                    || of.cone().is_some(),
                triangle,
                material,
            });
        }
        if lights.triangles.is_empty() {
            return lights;
        }
        let emissive = &lights.triangles;
        let corners = |k: u32| geometry.triangle(emissive[k as usize].triangle);
        let tree = (geometry.has_tree()).then(|| {
            let tree = Accel::over(emissive.len(), corners, &[]);
            (Bounds::new(tree.bounds()), tree)
        });
        Self {
            pdf_a: vec![0.0; geometry.single()],
            tree,
            emits: averages.iter().map(|&average| average > 0.0).collect(),
            materials: parts.materials.clone(),
            textures: parts.textures.clone(),
            ..lights
        }
    }

    /// Number of emissive triangles.
    pub(super) fn len(&self) -> usize {
        self.triangles.len()
    }

    /// Power of each emissive triangle.
    pub(super) fn powers(&self) -> Vec<f64> {
        self.powers.clone()
    }

    /// Sets the densities, given the probabilities with which the emissive triangles are drawn.
    pub(super) fn set_densities(&mut self, pmf: impl Fn(usize) -> f32) {
        for (k, t) in self.triangles.iter().enumerate() {
            self.pdf_a[t.triangle.index() as usize] = pmf(k) / t.area;
        }
    }

    /// Bounds of the emissive triangles for a light tree, grouped by mesh; intensities are multiplied by `unit`.
    pub(super) fn bounds(&self, geometry: &Geometry, unit: f64) -> Vec<Item> {
        let mut meshes: Vec<Item> = Vec::new();
        let mut last = None;
        let all = self.triangles.iter().zip(&self.powers).enumerate();
        for (k, (t, &power)) in all.filter(|(_, (_, power))| **power > 0.0) {
            let [a, b, c] = geometry.triangle(t.triangle);
            let sides = if t.double_sided { 2.0 } else { 1.0 };
            let bounds = LightBounds {
                low: a.min(b).min(c),
                high: a.max(b).max(c),
                axis: t.normal,
                cos_facing: 1.0,
                cos_emission: 0.0,
                two_sided: t.double_sided,
                intensity: (power * unit / (f64::from(PI) * sides)) as f32,
            };
            let mesh = geometry.triangle_mesh(t.triangle);
            match meshes.last_mut().filter(|_| last == Some(mesh)) {
                Some(of_mesh) => of_mesh.push(Item::light(bounds, k)),
                None => meshes.push(Item::light(bounds, k)),
            }
            last = Some(mesh);
        }
        meshes
    }

    /// Prepares [`AreaLights::place`].
    pub(super) fn index(&self) {
        self.places.get_or_init(|| {
            let mut places = vec![u32::MAX; self.pdf_a.len()];
            for (k, t) in self.triangles.iter().enumerate() {
                places[t.triangle.index() as usize] = k as u32;
            }
            places
        });
    }

    /// Index of a triangle of the scene among the emissive ones; `None` for others. Needs [`AreaLights::index`].
    #[inline]
    pub(super) fn place(&self, triangle: TriangleId) -> Option<usize> {
        let k = *self.places.get()?.get(triangle.index() as usize)?;
        (k != u32::MAX).then_some(k as usize)
    }

    /// Density per area of a uniform point of the `k`-th emissive triangle.
    #[inline]
    pub(super) fn pdf_point(&self, k: usize) -> f32 {
        1.0 / self.triangles[k].area
    }

    /// World position of the point of the `k`-th emissive triangle that [`AreaLights::sample`] draws.
    pub(super) fn position(&self, k: usize, u: Vec2) -> Vec3 {
        let light = &self.triangles[k];
        let weights = warp::triangle(u);
        light.corner + weights.x * light.edges[0] + weights.y * light.edges[1]
    }

    /// Draws a uniform point of the `k`-th emissive triangle, which was chosen with this probability.
    #[inline]
    pub(super) fn sample(&self, k: usize, pmf: f32, from: Vec3, u: Vec2) -> Option<LightSample> {
        let light = &self.triangles[k];
        let weights = warp::triangle(u);
        let [e1, e2] = light.edges;
        let point = light.corner + weights.x * e1 + weights.y * e2;
        let to = point - from;
        let distance = to.length();
        let wi = to / distance;
        let cos = -wi.dot(light.normal);
        if !(cos > 0.0 || (light.double_sided && cos < 0.0)) {
            return None;
        }
        let pdf_a = pmf / light.area;
        let pdf_w = area_to_solid_angle(pdf_a, from, point, cos.abs());
        let mut density = LightDensity::SolidAngle(pdf_w);
        let radiance = if light.varies {
            let material = &self.materials[light.material as usize];
            let [ua, ub, uc] = self.uvs[k];
            let uv = ua + weights.x * (ub - ua) + weights.y * (uc - ua);
            // The shadow ray ends before the light, whose own opacity is applied here.
            if material.alpha_mode == AlphaMode::Unseen {
                density = LightDensity::Delta(pdf_w);
            }
            let shining = material.emission_presence(&self.textures, uv) * share(material, -wi);
            material.emission_at(&self.textures, uv) * shining
        } else {
            light.radiance
        };
        // Bound for four roundings of the point and two of the direction.
        let error = f32::EPSILON * (4.0 * light.reach + 2.0 * distance);
        (pdf_w.is_finite() && pdf_w > 0.0).then_some(LightSample {
            wi,
            distance,
            radiance,
            density,
            cos: cos.abs(),
            error,
            light: k as u32,
            pmf,
        })
    }

    /// Density per area with which a triangle of the scene is drawn by power.
    #[inline]
    pub(super) fn pdf_by_power(&self, triangle: TriangleId) -> f32 {
        self.pdf_a
            .get(triangle.index() as usize)
            .copied()
            .unwrap_or(0.0)
    }

    /// Density per steradian with which the direction from `from` to a surface point is drawn, from its density per
    /// area.
    #[inline]
    pub(super) fn pdf(pdf_a: f32, from: Vec3, surface: &Surface) -> f32 {
        let cos = (surface.position - from).normalize().dot(surface.ng).abs();
        area_to_solid_angle(pdf_a, from, surface.position, cos)
    }

    /// A uniform point of the `k`-th emissive triangle, as a hit.
    pub(super) fn point(&self, k: usize, u: Vec2) -> Hit {
        let weights = warp::triangle(u);
        Hit {
            t: 0.0,
            triangle: self.triangles[k].triangle,
            u: weights.x,
            v: weights.y,
        }
    }

    /// Factor of a surface point's radiance along `dir`.
    pub(super) fn share(&self, surface: &Surface, dir: Vec3) -> f32 {
        share(&self.materials[surface.material as usize], dir)
    }

    /// Radiance on the emitting sides of a surface point times its presence, and true if both sides emit.
    pub(super) fn exitance(&self, surface: &Surface) -> (Rgb, bool) {
        let material = &self.materials[surface.material as usize];
        let shining = material.emission_presence(&self.textures, surface.uv);
        let radiance = material.emission_at(&self.textures, surface.uv);
        (radiance * shining, material.double_sided)
    }

    /// True if rays can hit the surface of a light.
    pub(super) fn shows_front(&self, surface: &Surface) -> bool {
        self.materials[surface.material as usize].alpha_mode != AlphaMode::Unseen
    }

    /// Density per steradian with which an emission sample leaves a surface point along `wo` (world).
    pub(super) fn pdf_emission(&self, aim: Option<&AimShares>, surface: &Surface, wo: Vec3) -> f32 {
        let double_sided = self.materials[surface.material as usize].double_sided;
        let uniform = emission_pdf(double_sided, wo.dot(surface.ng));
        aim.map_or(uniform, |aim| {
            let source = Source {
                position: surface.position,
                facing: (!double_sided).then_some(surface.ng),
            };
            aim.pdf_towards(&source, wo, uniform)
        })
    }

    /// Density per steradian of uniform emission from the `k`-th emissive triangle along `dir`. `cos` is that of the
    /// emission sample, 0 for an invisible lamp.
    pub(super) fn pdf_uniform(&self, k: usize, cos: f32, dir: Vec3) -> f32 {
        let triangle = &self.triangles[k];
        let cos = if cos > 0.0 {
            cos
        } else {
            dir.dot(triangle.normal)
        };
        emission_pdf(triangle.double_sided, cos)
    }

    /// [`AreaLights::pdf_emission`] from the point of a light sample back along it, with the cosine of the sample.
    #[inline]
    pub(super) fn pdf_emission_to(
        &self,
        aim: Option<&AimShares>,
        light: &LightSample,
        from: Vec3,
    ) -> f32 {
        let triangle = &self.triangles[light.light as usize];
        let uniform = emission_pdf(triangle.double_sided, light.cos);
        aim.map_or(uniform, |aim| {
            let source = Source {
                position: from + light.distance * light.wi,
                facing: (!triangle.double_sided).then_some(triangle.normal),
            };
            aim.pdf_towards(&source, -light.wi, uniform)
        })
    }

    /// Radiance emitted by a surface point towards `wo` (world).
    #[inline]
    pub(super) fn emitted(&self, surface: &Surface, wo: Vec3) -> Rgb {
        if self.emits.get(surface.material as usize) != Some(&true) {
            return Rgb::ZERO;
        }
        self.emitted_by(surface, wo)
    }

    fn emitted_by(&self, surface: &Surface, wo: Vec3) -> Rgb {
        match self.pdf_a.get(surface.triangle.index() as usize) {
            Some(&pdf_a) if pdf_a > 0.0 => {}
            _ => return Rgb::ZERO,
        }
        let material = &self.materials[surface.material as usize];
        if !(material.double_sided || wo.dot(surface.ng) > 0.0) {
            return Rgb::ZERO;
        }
        material.emission_at(&self.textures, surface.uv) * share(material, wo)
    }

    /// The closest emissive triangle along a ray.
    #[inline]
    pub(super) fn closest(&self, ray: &Ray) -> Option<Hit> {
        let (_, tree) = (self.tree.as_ref()).filter(|(bounds, _)| bounds.may_hit(ray))?;
        let hit = tree.closest(ray)?;
        Some(Hit {
            triangle: self.triangles[hit.triangle.index() as usize].triangle,
            ..hit
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_are_met_by_every_ray_to_a_point_of_them() {
        let (mut backwards, mut flat) = (0, 0);
        for k in 0..20_000u32 {
            let u = |m: u32| 2.0 * (k.wrapping_mul(m) >> 8) as f32 / 16_777_216.0 - 1.0;
            let v = |m: u32| Vec3::new(u(m), u(m.rotate_left(7) | 1), u(m.rotate_left(13) | 1));
            let size = 10f32.powf(6.0 * u(2_654_435_761));
            let (p, mut q) = (size * v(2_246_822_519), size * v(3_266_489_917));
            // Every other box is flat, as around a lamp.
            let axis = k as usize / 2 % 3;
            if k % 2 == 0 {
                q[axis] = p[axis];
            }
            let bounds = Bounds::new((p.min(q), p.max(q)));
            let origin = 10.0 * size * v(668_265_263);
            let to = |point: Vec3| Ray::new(origin, (point - origin).normalize());
            let on_ball = to(bounds.centre + bounds.radius * v(374_761_393).normalize());
            assert!(bounds.may_hit_ball(&on_ball), "{k}: {on_ball:?}");
            let at = 0.5 + 0.499 * v(374_761_393);
            let in_box = to(bounds.low + at * (bounds.high - bounds.low));
            assert!(bounds.may_hit(&in_box), "{k}: {in_box:?}");
            // In the plane of a side, where a bound is 0 · ∞.
            let mut along = v(1_013_904_223);
            along[axis] = 0.0;
            let inside = bounds.low + at * (bounds.high - bounds.low);
            let along = Ray::new(inside, along.normalize());
            assert!(bounds.may_hit(&along), "{k}: {along:?}");
            backwards += u32::from(!bounds.may_hit(&Ray::new(origin, -in_box.dir)));
            flat += u32::from(bounds.may_hit_ball(&on_ball) && !bounds.may_hit(&on_ball));
        }
        assert!(backwards > 15_000, "{backwards}");
        assert!(flat > 10_000, "{flat}");
    }
}
