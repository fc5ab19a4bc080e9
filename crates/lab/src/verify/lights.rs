//! Light sampling: squares from 1e-12 steradians to the hemisphere, slivers, sky maps with one bright texel.

use super::{Finding, Numbers};
use crate::gallery::furnace_sphere;
use crate::gallery::materials::emitter;
use crate::gallery::shapes::quad;
use opsr::bsdf::{Bsdf, Diffuse};
use opsr::image::Buffer;
use opsr::math::measure::balance;
use opsr::math::{DVec3, Frame, Ray, Rgb, Vec2, Vec3};
use opsr::sampler::LightU;
use opsr::scene::{Environment, LightSample, Material, Mesh, Scene, SceneParts, Surface};
use std::f64::consts::{FRAC_1_PI, PI, TAU};

/// Strata along one axis.
const STRATA: usize = 128;

/// A square that emits downwards, towards a surface at the origin.
struct Square {
    /// Height above the origin.
    height: f32,
    /// Length of the edge.
    edge: f32,
    /// Horizontal distance of the centre from the origin.
    shift: f32,
    /// Normal of the surface at the origin.
    normal: Vec3,
}

/// Squares from small and distant to large and near.
fn squares() -> Vec<Square> {
    let tilted = Vec3::new(1.0, 1.0, 0.3);
    [
        (1e6, 1.0, 0.0, Vec3::Y),
        (1e6, 1.0, 1e6, Vec3::Y),
        (1e-4, 1e-10, 0.0, Vec3::Y),
        (1e3, 1.0, 0.0, tilted),
        (30.0, 1.0, 10.0, Vec3::Y),
        (1.0, 1.0, 0.0, Vec3::Y),
        (1.0, 1.0, 3.0, tilted),
        (0.3, 1.0, 0.2, Vec3::X),
        (0.1, 1.0, 0.0, Vec3::Y),
        (1e-2, 1.0, 0.3, tilted),
        (1e-4, 1.0, 0.0, Vec3::Y),
        (1e-4, 1.0, 0.0, Vec3::X),
        (1e-4, 1.0, 0.5, Vec3::Y),
        (1.0, 1e6, 0.0, Vec3::Y),
        // The surface lies in the plane of the light, behind the light, and turned away from it.
        (0.0, 1.0, 2.0, Vec3::Y),
        (-1.0, 1.0, 0.0, -Vec3::Y),
        (1.0, 1.0, 0.0, -Vec3::Y),
    ]
    .map(|(height, edge, shift, normal)| Square {
        height,
        edge,
        shift,
        normal: normal.normalize(),
    })
    .into()
}

impl Square {
    fn corners(&self) -> [Vec3; 4] {
        let h = 0.5 * self.edge;
        [(-h, -h), (h, -h), (h, h), (-h, h)].map(|(x, z)| Vec3::new(self.shift + x, self.height, z))
    }

    fn scene(&self) -> Scene {
        let mut parts = SceneParts::default();
        let [a, b, _, d] = self.corners();
        parts.add(emitter("light", Rgb::ONE), [quad(a, b - a, d - a)]);
        Scene::new(parts)
    }

    /// Light reflected by the surface, which is white, in closed form.
    fn exact(&self) -> f64 {
        let normal = self.normal.as_dvec3();
        if self.height <= 0.0 {
            return 0.0;
        }
        let centre = DVec3::new(self.shift.into(), self.height.into(), 0.0);
        if f64::from(self.edge) < 1e-3 * centre.length() {
            // Lambert's sum suffers from cancellation here.
            let to = centre.normalize();
            let area = f64::from(self.edge).powi(2);
            let cosines = to.dot(normal).max(0.0) * to.y;
            return FRAC_1_PI * cosines * area / centre.length_squared();
        }
        lambert(&self.corners().map(|c| c.as_dvec3()), normal)
    }
}

/// Light reflected at the origin by a white surface with this normal, by light and lobe samples with MIS. Also the
/// largest relative difference between the densities of a light sample and of a ray towards it.
fn sampled(scene: &Scene, normal: Vec3, numbers: &mut Numbers) -> (f64, f64) {
    let frame = Frame::from_normal(normal);
    let diffuse = Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE });
    let (mut sum, mut apart) = (0.0f64, 0.0f64);
    for i in 0..STRATA * STRATA {
        let cell = Vec2::new((i % STRATA) as f32, (i / STRATA) as f32);
        let mut place = || (cell + Vec2::new(numbers.next(), numbers.next())) / STRATA as f32;
        let (at, lobe) = (place(), place());
        let u = LightU {
            pick: numbers.next().into(),
            at,
        };
        if let Some(light) = scene.lights().sample(Vec3::ZERO, u) {
            let pdf = light.wi.dot(normal).max(0.0) * FRAC_1_PI as f32;
            let weight = light.density.mis_weight(pdf) * pdf / light.density.value();
            sum += f64::from(light.radiance.x * weight);
            // A ray through the very edge may miss the light.
            if let Some(seen) = scene.emission_along(&Ray::new(Vec3::ZERO, light.wi)) {
                let ratio = f64::from(seen.pdf_w) / f64::from(light.density.value());
                apart = apart.max((ratio - 1.0).abs());
            }
        }
        let drawn = diffuse.direction(1.0, Vec3::Z, [0.0, lobe.x, lobe.y]);
        let local = drawn.map_or(Vec3::Z, |(wi, _)| wi);
        let ray = Ray::new(Vec3::ZERO, frame.to_world(local).normalize());
        let pdf = local.z * FRAC_1_PI as f32;
        if let Some(seen) = scene.emission_along(&ray)
            && pdf > 0.0
        {
            sum += f64::from(seen.radiance.x * balance(pdf, seen.pdf_w));
        }
    }
    (sum / (STRATA * STRATA) as f64, apart)
}

/// Light of a polygon reflected by a white surface: Lambert's sum over the edges of the part above the horizon.
fn lambert(polygon: &[DVec3], normal: DVec3) -> f64 {
    let corners = above(polygon, normal);
    let edges = (0..corners.len()).map(|i| {
        let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
        let across = a.cross(b);
        across.normalize_or_zero().dot(normal) * across.length().atan2(a.dot(b))
    });
    edges.sum::<f64>().abs() / TAU
}

/// Part of a polygon above the plane through the origin with this normal.
fn above(polygon: &[DVec3], normal: DVec3) -> Vec<DVec3> {
    let mut out = Vec::new();
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        let (x, y) = (a.dot(normal), b.dot(normal));
        if x >= 0.0 {
            out.push(a);
        }
        if (x < 0.0) != (y < 0.0) {
            out.push(a + (b - a) * (x / (x - y)));
        }
    }
    out
}

pub(super) fn all() -> Vec<Finding> {
    let mut numbers = Numbers::new(30);
    let (mut errors, mut densities) = (Vec::new(), Vec::new());
    for square in squares() {
        let exact = square.exact();
        let (found, apart) = sampled(&square.scene(), square.normal, &mut numbers);
        errors.push(if exact > 0.0 {
            (found / exact - 1.0).abs()
        } else {
            found
        });
        densities.push(apart);
    }
    vec![
        Finding::new(
            "light of squares of 1e-12 sr to a hemisphere: relative error",
            5e-3,
            errors,
        ),
        Finding::new(
            "density of a light sample against that of the ray to it",
            1e-3,
            densities,
        ),
        slivers(),
        occluded(&|surface, light| surface.spawn_to_light(light)),
        sun(),
    ]
}

/// Relative error of light samples for triangles up to 1e6 times as long as wide.
fn slivers() -> Finding {
    let mut numbers = Numbers::new(31);
    let mut errors = Vec::new();
    for i in 0..40 {
        let mut direction = || {
            let w = numbers.above();
            let mut turn = || std::f32::consts::TAU * numbers.next();
            glam::Quat::from_euler(glam::EulerRot::XYZ, turn(), turn(), turn()) * w
        };
        let (along, across) = (direction(), direction());
        let across = across.cross(along).normalize();
        let width = [1e-4, 1e-5, 1e-6][i % 3];
        let centre = 2.0 * direction();
        let corners = [
            centre - 0.5 * along,
            centre + 0.5 * along,
            centre + width * across,
        ];
        let normal = centre.normalize();
        let mut parts = SceneParts::default();
        let light = Material {
            double_sided: true,
            ..emitter("sliver", Rgb::ONE)
        };
        let mesh = Mesh {
            positions: corners.into(),
            indices: vec![[0, 1, 2]],
            ..Mesh::default()
        };
        parts.add(light, [mesh]);
        let scene = Scene::new(parts);
        let mut sum = 0.0;
        for k in 0..64 * 64 {
            let u = [0.0, (k % 64) as f32 + 0.5, (k / 64) as f32 + 0.5].map(|u| u / 64.0);
            if let Some(light) = scene.lights().sample(Vec3::ZERO, u.into()) {
                sum += f64::from(light.wi.dot(normal).max(0.0) / light.density.value()) * FRAC_1_PI;
            }
        }
        let exact = lambert(&corners.map(|c| c.as_dvec3()), normal.as_dvec3());
        errors.push((sum / (64.0 * 64.0) / exact - 1.0).abs());
    }
    Finding::new(
        "light of triangles 1e4 to 1e6 times as long as wide",
        5e-3,
        errors,
    )
}

/// Shadow ray from a surface to a light sample.
pub type ShadowRay<'a> = &'a dyn Fn(&Surface, &LightSample) -> Ray;

/// Counts light samples that are occluded inside an emissive sphere, at several scales and away from the origin.
pub fn occluded(shadow_ray: ShadowRay<'_>) -> Finding {
    let mut numbers = Numbers::new(33);
    let mut count = 0;
    for scale in [1e-3, 1.0, 1e3, 1e6] {
        for shift in [Vec3::ZERO, Vec3::new(5.0, -3.0, 0.5)] {
            let mut parts = furnace_sphere(0.5);
            let positions = parts.meshes.iter_mut().flat_map(|m| &mut m.positions);
            positions.for_each(|p| *p = (*p + shift) * scale);
            let scene = Scene::new(parts);
            for _ in 0..10_000 {
                let (at, u) = (numbers.above(), numbers.ends());
                let dir = if numbers.next() < 0.5 { at } else { -at };
                let ray = Ray::new(shift * scale, dir);
                let Some(hit) = scene.intersect(&ray) else {
                    count += 1;
                    continue;
                };
                let surface = scene.surface(&hit);
                if let Some(light) = scene.lights().sample(surface.position, u.into()) {
                    count += u32::from(scene.occluded(&shadow_ray(&surface, &light)));
                }
            }
        }
    }
    Finding::new(
        "light samples in a convex room that are occluded",
        0.0,
        [f64::from(count)],
    )
}

/// Relative error of the light of a dim sky with one bright texel of 1e5 or 1e9 at several places, the nadir included.
fn sun() -> Finding {
    const SIZE: [usize; 2] = [64, 32];
    let mut numbers = Numbers::new(32);
    let mut errors = Vec::new();
    for bright in [1e5, 1e9] {
        for sun in [(10, 0), (40, 8), (20, 15), (20, 16), (50, 31)] {
            let map = Buffer::from_fn(SIZE[0], SIZE[1], |x, y| {
                Rgb::splat(if (x, y) == sun { bright } else { 0.1 })
            });
            // 16 × 16 points per texel, weighted by solid angle.
            let mut exact = 0.0;
            let normal = Vec3::new(0.3, 1.0, -0.2).normalize();
            let (columns, rows) = (16 * SIZE[0], 16 * SIZE[1]);
            for y in 0..rows {
                let theta = (y as f64 + 0.5) / rows as f64 * PI;
                for x in 0..columns {
                    let phi = ((x as f64 + 0.5) / columns as f64 - 0.5) * TAU;
                    let (sin, cos) = theta.sin_cos();
                    let dir = DVec3::new(sin * phi.sin(), cos, -sin * phi.cos());
                    let radiance = map.pixels[y / 16 * SIZE[0] + x / 16].x;
                    let cell = sin * PI / rows as f64 * TAU / columns as f64;
                    exact += f64::from(radiance) * dir.dot(normal.as_dvec3()).max(0.0) * cell;
                }
            }
            let parts = SceneParts {
                environment: Some(Environment::from_map(map, 0.0)),
                ..SceneParts::default()
            };
            let (found, _) = sampled(&Scene::new(parts), normal, &mut numbers);
            errors.push((found / (exact * FRAC_1_PI) - 1.0).abs());
        }
    }
    Finding::new(
        "sky with one texel of 1e5 or 1e9: relative error",
        5e-3,
        errors,
    )
}
