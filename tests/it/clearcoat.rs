//! Clear coats: energy, textures, and the roughness that a path stores.

use super::support::render::scene;
use crate::support::draws::{numbers, rng};
use opsr::bsdf::{Bsdf, Covers, Diffuse, Distribution, covered};
use opsr::image::Film;
use opsr::integrator::{PathObserver, Recorder, Settings, View};
use opsr::math::{Ray, Rgb, UVec2, Vec3};
use opsr::regularise::Rule;
use opsr::sampler::{Independent, Seed};
use opsr::scene::{Scene, SceneParts, Texture, TextureRef};
use opsr_lab::gallery::materials::{self, metal};
use opsr_lab::gallery::shapes::quad;
use opsr_lab::verify::bsdfs::{DISTRIBUTIONS, at, glass, metal as mirror, plastic};

/// Coat and base of a surface, each with its probability.
fn both(coat: f32, alpha: f32, distribution: Distribution, base: Bsdf) -> [(f32, Bsdf); 2] {
    let chance = 0.25 * coat;
    let covers = Covers {
        coat,
        alpha,
        distribution,
        ..Covers::default()
    };
    [(0.0, chance), (0.99, 1.0 - chance)].map(|(u, chance)| (chance, covered(&covers, u, |_| base)))
}

/// Schlick's reflectance of index 1.5.
fn fresnel(cos: f32) -> f32 {
    0.04 + 0.96 * (1.0 - cos).powi(5)
}

#[test]
fn reciprocity_and_value_of_clearcoat_over_base() {
    let mut rng = rng(400);
    let mut compared = 0;
    for distribution in DISTRIBUTIONS {
        for (weight, coat_alpha) in [(1.0, 0.02), (0.4, 0.3)] {
            for base in [
                Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE }),
                plastic(0.2, distribution),
                mirror(0.1, distribution),
                glass(1.5, 0.3, distribution),
            ] {
                let parts = both(weight, coat_alpha, distribution, base);
                let value = |wo, wi| -> Rgb {
                    let part = |(p, b): &(f32, Bsdf)| *p * b.eval(b.alpha(), wo, wi).value;
                    parts.iter().map(part).sum()
                };
                for k in 0..2000 {
                    let wo = at([5.0, 40.0, 70.0, 80.0][k % 4]);
                    let drawn = parts[k / 4 % 2].1;
                    let Some(s) = drawn.sample(drawn.alpha(), wo, numbers(&mut rng)) else {
                        continue;
                    };
                    let wi = s.wi;
                    let lobe = mirror(coat_alpha, distribution).eval(coat_alpha, wo, wi);
                    let coat = if wi.z > 0.0 {
                        weight * fresnel(wo.dot((wo + wi).normalize())) * lobe.value
                    } else {
                        Rgb::ZERO
                    };
                    let kept = 1.0 - weight * fresnel(wo.z.min(wi.z.abs()));
                    let expected = coat + kept * base.eval(base.alpha(), wo, wi).value;
                    let found = value(wo, wi);
                    let close =
                        |a: Rgb, b: Rgb, t: f32| (a - b).abs().max_element() <= t * a.max_element();
                    assert!(close(expected, found, 1e-4), "{wo} {wi} {found} {expected}");
                    let scale = if wi.z < 0.0 {
                        base.refraction_scale(wo)
                    } else {
                        1.0
                    };
                    let back = value(wi, wo) / wo.z.abs();
                    let there = found / wi.z.abs() * scale;
                    // Half vectors of refractions lose digits at grazing angles.
                    assert!(close(there, back, 2e-3), "{wo} {wi}: {there} {back}");
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 25_000, "{compared}");
}

/// A smooth coat over a mirror preserves all energy; over a white base it loses light that the coat reflects back.
#[test]
fn white_furnace_of_smooth_clearcoats() {
    let mut rng = rng(410);
    let beckmann = Distribution::Beckmann;
    for (base, least) in [
        (mirror(0.0, beckmann), 0.999),
        (Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE }), 0.94),
    ] {
        for degrees in [0.0, 45.0, 70.0, 85.0] {
            let (wo, draws) = (at(degrees), 40_000);
            let mut kept = 0.0;
            for (chance, bsdf) in both(1.0, 0.0, beckmann, base) {
                let weight = |_| {
                    bsdf.sample(bsdf.alpha(), wo, numbers(&mut rng))
                        .map(|s| s.weight.y)
                };
                let sum: f32 = (0..draws).filter_map(weight).sum();
                kept += f64::from(chance * sum) / f64::from(draws);
            }
            assert!(kept > least && kept < 1.001, "{base:?} {degrees}: {kept}");
        }
    }
}

#[test]
fn clearcoat_textures_scale_weight_and_roughness() {
    let texel = |rgba: [u8; 4]| Texture::rgba(1, 1, vec![rgba]);
    let textures = [texel([51, 0, 0, 255]), texel([0, 128, 0, 255])];
    let map = |texture| {
        Some(TextureRef {
            second: false,
            texture,
            transform: glam::Affine2::IDENTITY,
        })
    };
    let mut material = materials::clearcoated(metal("paint", Rgb::ONE, 0.3), 0.8);
    let coat = material.finish_mut().clearcoat.as_mut().expect("a coat");
    coat.texture = map(0);
    coat.roughness_texture = map(1);
    let mut parts = SceneParts {
        textures: textures.to_vec(),
        ..SceneParts::default()
    };
    parts.add(material, [quad(Vec3::ZERO, Vec3::Z, Vec3::X)]);
    let scene = Scene::new(parts);
    let ray = Ray::new(Vec3::new(0.3, 1.0, 0.3), Vec3::NEG_Y);
    let hit = scene.intersect(&ray).expect("the floor");
    let bsdf = |u| scene.bsdf(&mut scene.surface(&hit), u);
    // A weight of 0.2 is chosen with a probability of 0.05.
    assert!(matches!(bsdf(0.0499), Bsdf::Glossy(_)));
    let alpha = 0.8 * (128.0f32 / 255.0).powi(2);
    assert!((bsdf(0.0499).alpha() - alpha).abs() < 1e-6);
    assert!(matches!(bsdf(0.0501), Bsdf::Covered(_)));
    assert_eq!(bsdf(0.0501).alpha(), 0.3);
}

/// Records the roughnesses that paths store.
#[derive(Default)]
struct Scattered(Vec<f32>);

impl PathObserver for Scattered {
    fn scattered(&mut self, alpha: f32) {
        self.0.push(alpha);
    }
}

impl Recorder for Scattered {
    fn fork(&self) -> Self {
        Self::default()
    }

    fn join(&mut self, tile: Self) {
        self.0.extend(tile.0);
    }
}

#[test]
fn clearcoat_paths_have_the_class_of_the_coat_or_of_the_base() {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    let paint = metal("paint", Rgb::ONE, 0.3);
    parts.add(materials::clearcoated(paint, 0.01), [floor]);
    parts.environment = Some(opsr::scene::Environment::constant(Rgb::ONE));
    parts.add_camera([0.0, 1.0, 0.1], [0.0, 0.0, 0.0], 40.0);
    let scene = scene(parts);
    let (mut film, mut seen) = (Film::new(UVec2::splat(16)), Scattered::default());
    let view = View::of(&scene, &scene.parts().cameras[0], &film);
    let source = Independent { seed: Seed(1) };
    let tracer = Settings::default().tracer(Rule::constant(0.5));
    tracer.estimate(&view, &source, 0..16, &mut film, &mut seen);
    let coats = seen.0.iter().filter(|&&alpha| alpha == 0.01).count();
    let bases = seen.0.iter().filter(|&&alpha| alpha == 0.3).count();
    assert_eq!(coats + bases, seen.0.len());
    let share = coats as f64 / seen.0.len() as f64;
    assert!((share - 0.25).abs() < 0.03, "{share}");
}
