//! Anisotropic surfaces: values by definition, roughening, and the direction of the brushing.

use crate::bsdf::{Anisotropic, Bsdf, DELTA_ALPHA, Distribution, Glossy, anisotropic};
use crate::math::{DVec3, Frame, Ray, Rgb, Vec2, Vec3};
use crate::regularise::{ConstantGamma, PathRoughness, Rule};
use crate::scene::{Material, Mesh, Scene, SceneParts, SharedMesh, Surface, Texture, TextureRef};
use crate::unit::lab::gallery::materials::{brushed, clearcoated, diffuse, emitter, metal};
use crate::unit::lab::gallery::shapes::{Placing, disc, quad};
use crate::unit::lab::verify::bsdfs::DISTRIBUTIONS;
use crate::unit::support::draws::{numbers, rng};
use crate::unit::support::gltf::File;
use crate::unit::support::render::{film, mean, scene};
use rand::RngExt;
use rand_pcg::Pcg32;
use std::f64::consts::PI;

/// A direction above the surface, often grazing.
fn above(rng: &mut Pcg32) -> Vec3 {
    let z = rng.random::<f32>().max(1e-4);
    let around = Vec2::from_angle(7.0 * rng.random::<f32>());
    (around * (1.0 - z * z).sqrt()).extend(z)
}

/// A white metal with these two roughnesses.
fn white(along: f32, across: f32, direction: Vec2, distribution: Distribution) -> Anisotropic {
    let lobe = Glossy {
        f0: Rgb::ONE,
        f90: 1.0,
        albedo: Rgb::ZERO,
        alpha: 0.0,
        distribution,
    };
    match anisotropic(lobe, along, across, direction) {
        Bsdf::Anisotropic(lobe) => lobe,
        other => panic!("{other:?}"),
    }
}

/// D and Λ for two roughnesses by [Heitz14], in coordinates along and across the brushing.
struct Exact {
    alphas: [f64; 2],
    distribution: Distribution,
}

impl Exact {
    fn d(&self, h: DVec3) -> f64 {
        let [x, y] = self.alphas;
        let (tan_x, tan_y) = (h.x / h.z / x, h.y / h.z / y);
        let e = tan_x * tan_x + tan_y * tan_y;
        let shape = match self.distribution {
            Distribution::Beckmann => (-e).exp(),
            Distribution::Ggx => 1.0 / ((1.0 + e) * (1.0 + e)),
            Distribution::HenyeyGreenstein => unreachable!("no slopes"),
        };
        shape / (PI * x * y * h.z.powi(4))
    }

    fn lambda(&self, w: DVec3) -> f64 {
        use crate::bsdf::LobeReal;
        let [x, y] = self.alphas;
        // The inverse of α in the azimuth of w times the tangent.
        let a = w.z / ((x * w.x).powi(2) + (y * w.y).powi(2)).sqrt();
        match self.distribution {
            Distribution::Beckmann => a.beckmann_lambda(),
            Distribution::Ggx => 0.5 * ((1.0 + 1.0 / (a * a)).sqrt() - 1.0),
            Distribution::HenyeyGreenstein => unreachable!("no slopes"),
        }
    }
}

#[test]
fn anisotropic_value_and_pdf_are_those_of_two_roughnesses() {
    let mut rng = rng(601);
    let mut compared = 0;
    for distribution in DISTRIBUTIONS {
        for [along, across] in [[0.5, 0.05], [0.03, 0.02], [1.0, 0.2], [0.2, 0.2]] {
            let direction = Vec2::new(-0.4, 0.7);
            let bsdf = white(along, across, direction, distribution);
            let own = Bsdf::Anisotropic(bsdf).alpha();
            assert!((own - (along * across).sqrt()).abs() < 2e-2 * own, "{own}");
            // Also after roughening.
            for alpha in [own, 1.7 * own] {
                let alphas = bsdf.alphas(alpha).map(f64::from);
                let exact = Exact {
                    alphas,
                    distribution,
                };
                let s = bsdf.direction().as_dvec2();
                let local = |w: Vec3| {
                    let w = w.as_dvec3();
                    DVec3::new(w.x * s.x + w.y * s.y, w.y * s.x - w.x * s.y, w.z)
                };
                for _ in 0..500 {
                    let (wo, u) = (above(&mut rng), numbers(&mut rng));
                    let bsdf = Bsdf::Anisotropic(bsdf);
                    let Some(sample) = bsdf.sample(alpha, wo, u) else {
                        continue;
                    };
                    if wo.z.min(sample.wi.z) < 0.02 {
                        continue;
                    }
                    let (o, i) = (local(wo), local(sample.wi));
                    let h = (o + i).normalize();
                    let d = exact.d(h);
                    let value = d / (1.0 + exact.lambda(o) + exact.lambda(i)) / (4.0 * o.z);
                    let pdf = d / (1.0 + exact.lambda(o)) / (4.0 * o.z);
                    for (found, expected) in [(sample.value.x, value), (sample.pdf_w, pdf)] {
                        let off = (f64::from(found) / expected - 1.0).abs();
                        assert!(
                            off < 2e-3,
                            "{distribution:?} {alphas:?} {o} {i}: {found} {expected}"
                        );
                    }
                    compared += 1;
                }
            }
        }
    }
    assert!(compared > 4000, "{compared}");
}

#[test]
fn anisotropic_code_keeps_direction_and_ratio() {
    let mut rng = rng(602);
    for _ in 0..20_000 {
        let angle = 7.0 * rng.random::<f32>();
        let along = 2e-3f32.powf(rng.random());
        let across = along * 1e-3f32.powf(rng.random());
        let direction = Vec2::from_angle(angle);
        let bsdf = white(along, across, 3.0 * direction, Distribution::Ggx);
        // Opposite directions are equivalent.
        let cos = bsdf.direction().dot(direction).abs();
        assert!(cos > 1.0 - 1e-6, "{direction} {}", bsdf.direction());
        let found = bsdf.alphas(Bsdf::Anisotropic(bsdf).alpha());
        for (found, expected) in found.iter().zip([along, across.max(DELTA_ALPHA)]) {
            let off = (found / expected - 1.0).abs();
            assert!(off < 0.012, "{along} {across}: {found} for {expected}");
        }
    }
}

#[test]
fn anisotropic_of_equal_roughnesses_is_isotropic() {
    let mut rng = rng(603);
    for distribution in DISTRIBUTIONS {
        let bsdf = white(0.2, 0.2, Vec2::new(1.0, 3.0), distribution);
        assert_eq!(bsdf.alphas(0.2), [0.2; 2]);
        let (one, two) = (Bsdf::Glossy(bsdf.isotropic()), Bsdf::Anisotropic(bsdf));
        for _ in 0..1000 {
            let (wo, wi) = (above(&mut rng), above(&mut rng));
            let [a, b] = [one, two].map(|bsdf| bsdf.eval(0.2, wo, wi));
            assert!((a.pdf_w - b.pdf_w).abs() <= 1e-4 * a.pdf_w, "{wo} {wi}");
            let apart = (a.value - b.value).abs().max_element();
            assert!(apart <= 1e-4 * a.value.max_element(), "{wo} {wi}");
        }
    }
    // A mirror stays a mirror.
    let mirror = |along| {
        let lobe = white(0.2, 0.2, Vec2::X, Distribution::Ggx).isotropic();
        anisotropic(lobe, along, 0.0, Vec2::X)
    };
    assert!(matches!(mirror(0.9e-3), Bsdf::Glossy(_)) && mirror(0.9e-3).is_delta_at(0.9e-3));
    let sharp = mirror(0.3);
    assert!(matches!(sharp, Bsdf::Anisotropic(_)) && !sharp.is_delta_at(sharp.alpha()));
}

/// Rules use the geometric mean. A rougher path before the lobe raises both roughnesses and lowers the peak.
#[test]
fn roughening_raises_both_roughnesses_of_an_anisotropic_lobe() {
    let lobe = white(0.3, 0.02, Vec2::X, Distribution::Beckmann);
    let bsdf = Bsdf::Anisotropic(lobe);
    let mut last = (lobe.alphas(bsdf.alpha()), f32::INFINITY);
    for k in 0..=20 {
        let before = PathRoughness::of(&[k as f32 / 20.0], &ConstantGamma(0.3));
        let alpha = before.accumulate(bsdf.alpha(), &ConstantGamma(0.3), 1.0);
        let [along, across] = lobe.alphas(alpha);
        assert!(along >= last.0[0] && across >= last.0[1], "{k}");
        let peak = bsdf.eval(alpha, Vec3::Z, Vec3::Z).value.x;
        assert!(peak <= last.1, "{k}: {peak}");
        last = ([along, across], peak);
    }
    assert!(last.0[1] > 0.05, "{last:?}");
}

/// A square of edge 2 in the plane z = 0 that faces +z; u runs along y, and v against x.
fn sheet() -> Mesh {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    Mesh {
        normals: vec![Vec3::Z; 4],
        uvs: corners.map(|[x, y]| Vec2::new(y, -x)).to_vec(),
        ..quad(Vec3::new(-1.0, -1.0, 0.0), 2.0 * Vec3::X, 2.0 * Vec3::Y)
    }
}

fn point(scene: &Scene, x: f32, y: f32) -> Surface {
    let ray = Ray::new(Vec3::new(x, y, 5.0), -Vec3::Z);
    let hit = scene.intersect(&ray).expect("a surface");
    scene.surface(&hit)
}

/// Direction of the brushing at a point, in the world, up to its sign.
fn brushing(scene: &Scene, x: f32, y: f32) -> Vec3 {
    let mut surface = point(scene, x, y);
    match scene.bsdf(&mut surface, 0.5) {
        Bsdf::Anisotropic(lobe) => {
            Frame::from_normal(surface.ns).to_world(lobe.direction().extend(0.0))
        }
        other => panic!("{other:?}"),
    }
}

fn same_line(found: Vec3, expected: Vec3) {
    let cos = found.dot(expected.normalize()).abs();
    assert!(cos > 1.0 - 1e-5, "{found}, expected {expected}");
}

fn of(material: Material, mesh: Mesh) -> Scene {
    let mut parts = SceneParts::default();
    parts.add(material, [mesh]);
    Scene::new(parts)
}

#[test]
fn anisotropy_follows_tangents_rotation_and_texture() {
    let steel = |strength, rotation| brushed(metal("steel", Rgb::ONE, 0.01), strength, rotation);
    // By the texture coordinates the tangent is y, and the bitangent is against v, along x.
    let scene = of(steel(0.5, 0.0), sheet());
    same_line(brushing(&scene, 0.3, 0.2), Vec3::Y);
    let scene = of(steel(0.5, 0.3), sheet());
    let (sin, cos) = 0.3f32.sin_cos();
    same_line(brushing(&scene, 0.3, 0.2), Vec3::new(sin, cos, 0.0));
    // The roughnesses are 0.01 and mix(0.01, 1, 0.5²).
    let mut surface = point(&scene, 0.3, 0.2);
    let bsdf = scene.bsdf(&mut surface, 0.5);
    let expected = (0.01f32 * (0.01 + 0.99 * 0.25)).sqrt();
    assert!((bsdf.alpha() - expected).abs() < 1e-2 * expected);
    assert_eq!(scene.parts().materials[0].lobe_alpha(), expected);
    // The mesh's own tangents take precedence: a disc that faces the camera.
    let plate = disc(1.0, 64).placed([0.0, std::f32::consts::FRAC_PI_2, 0.0], Vec3::ZERO);
    let scene = of(steel(0.5, 0.0), plate);
    for [x, y] in [[0.5, 0.1], [-0.3, 0.4], [0.0, -0.7f32]] {
        let found = brushing(&scene, x, y);
        let cos = found.dot(Vec3::new(-y, x, 0.0).normalize()).abs();
        assert!(cos > 0.998, "{x} {y}: {found}");
    }
    // Red and green rotate the brushing, blue scales the strength.
    let texel = |rgba: [u8; 4]| Texture::rgba(1, 1, vec![rgba]);
    let textured = |rgba| {
        let mut material = steel(1.0, 0.0);
        let anisotropy = material.finish_mut().anisotropy.as_mut().expect("brushed");
        anisotropy.texture = Some(TextureRef {
            second: false,
            texture: 0,
            transform: glam::Affine2::IDENTITY,
        });
        let mut parts = SceneParts {
            textures: vec![texel(rgba)],
            ..SceneParts::default()
        };
        parts.add(material, [sheet()]);
        Scene::new(parts)
    };
    // (0.6, -0.8) in tangent space.
    let scene = textured([204, 26, 128, 255]);
    let found = brushing(&scene, 0.0, 0.0);
    assert!(
        found.dot(Vec3::new(-0.8, 0.6, 0.0)).abs() > 0.999,
        "{found}"
    );
    let mut surface = point(&scene, 0.0, 0.0);
    let alpha = scene.bsdf(&mut surface, 0.5).alpha();
    let half = 128.0f32 / 255.0;
    let expected = (0.01 * (0.01 + 0.99 * half * half)).sqrt();
    assert!(
        (alpha - expected).abs() < 1e-2 * expected,
        "{alpha} {expected}"
    );
    let mut surface = point(&scene, 0.0, 0.0);
    let none = textured([204, 26, 0, 255]).bsdf(&mut surface, 0.5);
    assert!(matches!(none, Bsdf::Glossy(lobe) if lobe.alpha == 0.01));
}

#[test]
fn anisotropy_of_instances_turns_and_mirrors_with_them() {
    let material = brushed(metal("steel", Rgb::ONE, 0.01), 0.7, 0.5);
    let pose = glam::DAffine3::from_rotation_z(0.4)
        * glam::DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let mut parts = SceneParts::default();
    parts.add_material(material);
    parts.shared.push(SharedMesh {
        mesh: sheet(),
        poses: vec![pose],
    });
    let found = brushing(&Scene::new(parts), 0.2, 0.1);
    let (sin, cos) = 0.5f64.sin_cos();
    let expected = pose.transform_vector3(DVec3::new(sin, cos, 0.0));
    same_line(found, expected.as_vec3());
}

#[test]
fn anisotropy_without_coordinates_is_ignored_with_a_warning() {
    let material = brushed(metal("steel", Rgb::ONE, 0.01), 0.7, 0.5);
    let bare = Mesh {
        uvs: Vec::new(),
        ..sheet()
    };
    let scene = of(material, bare);
    let mut surface = point(&scene, 0.1, 0.2);
    assert!(matches!(scene.bsdf(&mut surface, 0.5), Bsdf::Glossy(_)));
    let mut file = File::triangle();
    let body = serde_json::json!({ "anisotropyStrength": 0.5 });
    let extensions = serde_json::json!({ "KHR_materials_anisotropy": body });
    file.push("materials", serde_json::json!({ "extensions": extensions }));
    file.primitive()["material"] = serde_json::json!(0);
    let warnings = file.loaded().warnings;
    let message = |w: &String| w.contains("anisotropy is ignored");
    assert!(warnings.iter().any(message), "{warnings:?}");
}

/// The coat has its own normal map or none; the base's map does not apply to it.
#[test]
fn clearcoat_normal_is_apart_from_that_of_the_base() {
    let texel = |rgba: [u8; 4]| Texture::rgba(1, 1, vec![rgba]);
    let map = |texture| {
        Some(TextureRef {
            second: false,
            texture,
            transform: glam::Affine2::IDENTITY,
        })
    };
    // Normals tilted towards the tangent y and towards the bitangent x.
    let textures = vec![texel([204, 128, 230, 255]), texel([128, 230, 204, 255])];
    let normals = |base: Option<u32>, coat: Option<u32>| {
        let mut material = clearcoated(metal("paint", Rgb::ONE, 0.3), 0.1);
        material.normal_texture = base.and_then(map);
        let finish = material.finish_mut().clearcoat.as_mut().expect("a coat");
        (finish.normal_texture, finish.normal_scale) = (coat.and_then(map), 0.5);
        let mut parts = SceneParts {
            textures: textures.clone(),
            ..SceneParts::default()
        };
        parts.add(material, [sheet()]);
        let scene = Scene::new(parts);
        // Numbers below a quarter select the coat.
        [0.1, 0.9].map(|u| {
            let mut surface = point(&scene, 0.3, -0.2);
            scene.bsdf(&mut surface, u);
            surface.ns
        })
    };
    let close = |found: Vec3, x: f32, y: f32, z: f32| {
        let expected = Vec3::new(x, y, z).normalize();
        assert!((found - expected).length() < 0.01, "{found} {expected}");
    };
    let [coat, base] = normals(None, None);
    assert_eq!((coat, base), (Vec3::Z, Vec3::Z));
    let [coat, base] = normals(Some(0), None);
    assert!((coat - Vec3::Z).length() < 1e-6, "{coat}");
    close(base, 0.0, 0.6, 0.8);
    let [coat, base] = normals(Some(0), Some(1));
    close(coat, 0.5 * 0.8, 0.0, 0.6);
    close(base, 0.0, 0.6, 0.8);
    let [coat, base] = normals(None, Some(1));
    close(coat, 0.5 * 0.8, 0.0, 0.6);
    assert_eq!(base, Vec3::Z);
}

/// Light of a brushed plate under a lamp: a table of zeros changes nothing, and roughening preserves most light.
#[test]
fn anisotropic_energy_with_and_without_regularisation() {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-2.0, 0.0, -2.0), 4.0 * Vec3::Z, 4.0 * Vec3::X);
    parts.add(diffuse("floor", Rgb::splat(0.7)), [floor]);
    let plate = disc(0.8, 32).placed([0.0, 1.3, 0.0], Vec3::new(0.0, 0.8, -0.6));
    parts.add(brushed(metal("steel", Rgb::ONE, 0.02), 0.6, 0.0), [plate]);
    let lamp = quad(Vec3::new(-0.4, 2.5, -0.4), 0.8 * Vec3::X, 0.8 * Vec3::Z);
    parts.add(emitter("lamp", Rgb::splat(8.0)), [lamp]);
    parts.add_camera([0.0, 1.2, 3.0], [0.0, 0.5, 0.0], 50.0);
    let scene = scene(parts);
    let energy = |rule: Rule| mean(&film(&scene, rule, 24, 256, 3));
    let (plain, error) = energy(Rule::Plain);
    let (zeros, _) = energy(Rule::constant(0.0));
    assert_eq!(plain, zeros);
    let (rough, rough_error) = energy(Rule::constant(0.1));
    let bound = 4.0 * (error + rough_error) + 0.02 * plain;
    assert!((rough - plain).abs() < bound, "{rough} {plain} {bound}");
}
