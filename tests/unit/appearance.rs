//! Textures, normal maps, opacity and lights without area, against closed forms and geometry.

use crate::bsdf::Bsdf;
use crate::math::{Ray, Rgb, Vec2, Vec3};
use crate::regularise::Rule;
use crate::scene::{
    AlphaMode, Environment, LightDensity, Material, Mesh, PunctualLight, Scene, SceneParts,
    Texture, TextureRef, Wrap,
};
use crate::unit::lab::gallery::materials::{clearcoated, coated, diffuse, emitter, metal};
use crate::unit::lab::gallery::shapes::{quad, sphere};
use crate::unit::lab::verify::chi_square;
use crate::unit::support::assert_likely;
use crate::unit::support::render::{film, mean, scene};
use glam::{Affine2, Vec2 as Uv};
use std::f32::consts::PI;
use std::f64::consts::FRAC_PI_2;

/// A texture with these texels side by side.
fn row(texels: &[[u8; 4]]) -> Texture {
    Texture {
        wrap: [Wrap::Clamp; 2],
        ..Texture::rgba(texels.len() as u32, 1, texels.iter().copied())
    }
}

fn map(texture: u32) -> Option<TextureRef> {
    let transform = Affine2::IDENTITY;
    Some(TextureRef {
        texture,
        transform,
        second: false,
    })
}

/// A quad whose texture coordinates run from 0 to 1 along its edges.
fn mapped(corner: Vec3, u: Vec3, v: Vec3) -> Mesh {
    Mesh {
        uvs: vec![Uv::ZERO, Uv::X, Uv::ONE, Uv::Y],
        ..quad(corner, u, v)
    }
}

/// A floor of albedo ½ and a camera that shows only this point of it.
fn floor(at: [f32; 3]) -> SceneParts {
    let mut parts = SceneParts::default();
    let floor = mapped(Vec3::new(-9.0, 0.0, -9.0), Vec3::Z * 18.0, Vec3::X * 18.0);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
    parts.add_camera([at[0], 0.5, at[2] + 4.0], at, 0.01);
    parts
}

fn brightness(parts: SceneParts, size: u32, spp: u32) -> f64 {
    let (mean, error) = mean(&film(&scene(parts), Rule::Plain, size, spp, 1));
    assert!(error <= 4e-3 * mean, "too noisy: {mean} ± {error}");
    mean
}

fn assert_close(value: f64, expected: f64, what: &str) {
    let off = (value - expected).abs();
    assert!(
        off <= 1e-3 * expected,
        "{what}: {value}, expected {expected}"
    );
}

#[test]
fn textures_multiply_factors() {
    let textures = [
        row(&[[51, 102, 204, 255], [255; 4]]),
        row(&[[9, 128, 64, 255], [255; 4]]),
        row(&[[64, 255, 255, 255], [255; 4]]),
    ];
    let material = Material {
        base_color: Rgb::new(1.0, 0.5, 1.0),
        metallic: 0.5,
        alpha: 0.8,
        transmission: 0.4,
        base_color_texture: map(0),
        metallic_roughness_texture: map(1),
        transmission_texture: map(2),
        ..Material::default()
    };
    let at = |u: f32, choice: f32| material.bsdf(&textures, Vec2::new(u, 0.5), choice);
    let byte = |b: u8| f32::from(b) / 255.0;
    // Metalness is in blue, the square root of α in green, transmission in red.
    let (metallic, transmission) = (0.5 * byte(64), 0.4 * byte(64));
    let color = Rgb::new(0.2, 0.2, 0.8);
    let Bsdf::Glossy(glossy) = at(0.0, 0.9) else {
        panic!("{:?}", at(0.0, 0.9));
    };
    assert!((glossy.albedo - color * (1.0 - metallic)).length() < 1e-6);
    assert!((glossy.alpha - 0.8 * byte(128) * byte(128)).abs() < 1e-6);
    let f0 = Rgb::splat(0.04) + (color - 0.04) * metallic;
    assert!((glossy.f0 - f0).length() < 1e-6);
    // Transmission is chosen with the probability of the texture.
    let share = transmission * (1.0 - metallic);
    assert!(matches!(at(0.0, 0.99 * share), Bsdf::Thin(t) if (t.tint - color).length() < 1e-6));
    assert!(matches!(at(0.0, 1.01 * share), Bsdf::Glossy(_)));
    // White texels do not change factors.
    assert!(matches!(at(1.0, 0.0), Bsdf::Thin(t) if t.alpha == 0.8));
    assert!(matches!(at(1.0, 0.21), Bsdf::Glossy(g) if g.albedo == Rgb::new(0.5, 0.25, 0.5)));
}

/// The coat's reflectance is specularFactor · Schlick(min(r0² · specularColorFactor, 1), 1) [KHR_materials_specular]:
/// the factor also scales it at grazing incidence.
#[test]
fn specular_factor_scales_the_reflectance_at_every_angle() {
    let alpha = 0.3;
    for (transmission, metallic) in [(0.0, 0.0), (0.0, 0.5), (1.0, 0.0)] {
        let bsdf = |specular, specular_color| {
            let material = Material {
                base_color: Rgb::ZERO,
                alpha,
                transmission,
                metallic,
                specular,
                specular_color,
                ..Material::default()
            };
            material.bsdf(&[], Vec2::ZERO, 0.0)
        };
        for degrees in [0.0f64, 30.0, 60.0, 80.0, 86.0, 89.5] {
            let (sin, cos) = degrees.to_radians().sin_cos();
            let wo = glam::DVec3::new(sin, 0.0, cos).as_vec3();
            let wi = Vec3::new(-wo.x, 0.0, wo.z);
            let value = |b: Bsdf| b.eval(alpha, wo, wi).value;
            // A black metal has F = (1 − cos)⁵, and the result is linear in the metalness.
            let m = (1.0 - cos).powi(5);
            let fresnel = |factor: f64, color: f64| {
                let f0 = (0.04 * color).min(1.0);
                let coat = factor * (f0 + (1.0 - f0) * m);
                coat + (m - coat) * f64::from(metallic)
            };
            let full = f64::from(value(bsdf(1.0, Rgb::ONE)).x) / fresnel(1.0, 1.0);
            for factor in [1.0, 0.5, 0.1, 0.0] {
                for color in [0.0, 1.0, 10.0, 100.0] {
                    let value = value(bsdf(factor as f32, Rgb::splat(color as f32))).x;
                    let (got, wanted) = (f64::from(value) / full, fresnel(factor, color));
                    assert!(
                        (got - wanted).abs() <= 1e-4 * wanted.max(0.01),
                        "{transmission} {metallic} {degrees} {factor} {color}: {got}, not {wanted}"
                    );
                }
            }
        }
    }
}

#[test]
fn directional_light_irradiance() {
    let mut parts = floor([0.0; 3]);
    let direction = Vec3::new(0.3, -0.8, 0.4).normalize();
    parts.lights.push(PunctualLight::Directional {
        direction,
        irradiance: Rgb::splat(3.0),
    });
    let expected = 0.5 / PI * 3.0 * -direction.y;
    assert_close(brightness(parts, 2, 4), expected.into(), "sun");
}

#[test]
fn spot_light_falloff_and_range() {
    let (inner, outer) = (20f32.to_radians(), 40f32.to_radians());
    for range in [f32::INFINITY, 1.5] {
        for degrees in [0.0, 15.0, 25.0, 35.0, 45.0] {
            let angle: f32 = f32::to_radians(degrees);
            let mut parts = floor([angle.tan(), 0.0, 0.0]);
            parts.lights.push(PunctualLight::Spot {
                position: Vec3::Y,
                direction: Vec3::NEG_Y,
                intensity: Rgb::splat(2.0 * PI),
                range,
                cos_inner: inner.cos(),
                cos_outer: outer.cos(),
                falloff: Default::default(),
            });
            let ramp = (angle.cos() - outer.cos()) / (inner.cos() - outer.cos());
            let distance = 1.0 / angle.cos();
            let window = 1.0 - (distance / range).powi(4);
            let arriving = ramp.clamp(0.0, 1.0).powi(2) * window / (distance * distance);
            let expected = f64::from(arriving * angle.cos());
            let what = format!("{degrees} degrees, range {range}");
            assert_close(brightness(parts, 2, 4), expected, &what);
        }
    }
}

#[test]
fn light_selection_among_several_lights() {
    let mut parts = floor([0.0; 3]);
    let sun = PunctualLight::Directional {
        direction: Vec3::NEG_Y,
        irradiance: Rgb::splat(1.0),
    };
    let spot = |cos_inner, cos_outer| PunctualLight::Spot {
        position: Vec3::Y,
        direction: Vec3::NEG_Y,
        intensity: Rgb::splat(2.0 * PI),
        range: f32::INFINITY,
        cos_inner,
        cos_outer,
        falloff: Default::default(),
    };
    parts.lights = vec![sun, spot(0.9, 0.8), spot(0.999, 0.99)];
    let expected = f64::from(0.5 / PI) + 2.0;
    let (value, error) = mean(&film(&scene(parts), Rule::Plain, 16, 1024, 1));
    assert!(
        (value - expected).abs() < 4.0 * error && error < 0.03 * expected,
        "{value} ± {error}, expected {expected}"
    );
}

#[test]
fn normal_map_tilts_the_shading() {
    let texel = [204u8, 90, 230, 255];
    let light = Vec3::new(-0.3, -0.8, -0.2).normalize();
    for scale in [1.0, 0.5] {
        let mut parts = floor([0.0; 3]);
        parts.textures.push(row(&[texel]));
        parts.materials[0].normal_texture = map(0);
        parts.materials[0].normal_scale = scale;
        parts.lights.push(PunctualLight::Directional {
            direction: light,
            irradiance: Rgb::splat(2.0),
        });
        let [x, y, z] = [texel[0], texel[1], texel[2]].map(|c| 2.0 * f32::from(c) / 255.0 - 1.0);
        // u is along +Z, v along +X; green is against v.
        let normal = Vec3::new(-scale * y, z, scale * x).normalize();
        let expected = 0.5 / PI * 2.0 * normal.dot(-light);
        assert_close(brightness(parts, 2, 4), expected.into(), "bumpy floor");
    }
}

/// A matt normal map looks the same from a low and a high camera, if its normal faces both.
#[test]
fn relief_of_matt_surfaces_does_not_depend_on_the_view() {
    for (degrees, elevation) in [(40.0f32, 45.0f32), (25.0, 30.0), (15.0, 20.0)] {
        let (lean, elevation) = (degrees.to_radians(), elevation.to_radians());
        let encode = |x: f32| (127.5 + 127.5 * x).round() as u8;
        let texel = [encode(-lean.sin()), encode(0.0), encode(lean.cos()), 255];
        let [x, y, z] = [0, 1, 2].map(|c| 2.0 * f32::from(texel[c]) / 255.0 - 1.0);
        let expected = 0.5 / PI * Vec3::new(x, y, z).normalize().z;
        let mut parts = floor([0.0; 3]);
        parts.textures.push(row(&[texel]));
        parts.materials[0].normal_texture = map(0);
        parts.cameras.clear();
        let place = 4.0 * Vec3::new(0.0, elevation.sin(), elevation.cos());
        parts.add_camera(place.to_array(), [0.0; 3], 0.01);
        parts.lights.push(PunctualLight::Directional {
            direction: Vec3::NEG_Y,
            irradiance: Rgb::ONE,
        });
        assert_close(brightness(parts, 2, 4), expected.into(), "matt");
    }
}

/// A floor under a panel of this material, at most two units wide, two units above the floor.
fn under(material: Material, textures: Vec<Texture>, width: f32) -> SceneParts {
    let mut parts = floor([0.0; 3]);
    parts.textures = textures;
    let panel = mapped(Vec3::new(-1.0, 2.0, -1.0), Vec3::X * width, Vec3::Z * 2.0);
    parts.add(material, [panel]);
    parts
}

#[test]
fn area_light_with_texture_and_opacity() {
    const SPP: u32 = 1024;
    let lit = emitter("light", Rgb::ONE);
    let whole = brightness(under(lit.clone(), vec![], 2.0), 8, SPP);
    let half = brightness(under(lit.clone(), vec![], 1.0), 8, SPP);
    assert!(
        (half / whole - 0.5).abs() < 0.01,
        "by symmetry: {half} {whole}"
    );
    // Wide texels: interpolation between them is symmetric about the middle.
    let white = [255; 4];
    let picture = |dark: [u8; 4]| row(&[white, white, dark, dark]);
    let cases = [
        (
            "dark half",
            Material {
                emissive_texture: map(0),
                ..lit.clone()
            },
            picture([0, 0, 0, 255]),
        ),
        (
            "missing half",
            Material {
                alpha_mode: AlphaMode::Mask(0.5),
                base_color_texture: map(0),
                ..lit.clone()
            },
            picture([255, 255, 255, 0]),
        ),
        (
            "half there by chance",
            Material {
                alpha_mode: AlphaMode::Blend,
                opacity: 0.5,
                ..lit.clone()
            },
            picture(white),
        ),
        (
            "half of it half there",
            Material {
                alpha_mode: AlphaMode::Blend,
                opacity: 2.0 / 3.0,
                base_color_texture: map(0),
                ..lit
            },
            picture([255, 255, 255, 128]),
        ),
    ];
    for (name, material, texture) in cases {
        let value = brightness(under(material, vec![texture], 2.0), 8, SPP);
        assert!(
            (value / half - 1.0).abs() < 0.015,
            "{name}: {value}, expected {half}"
        );
    }
}

#[test]
fn environment_through_the_holes_of_a_light() {
    let mut parts = under(
        Material {
            alpha_mode: AlphaMode::Mask(0.5),
            base_color_texture: map(0),
            ..emitter("light", Rgb::splat(0.7))
        },
        vec![row(&[[255; 4], [255, 255, 255, 0]])],
        2.0,
    );
    parts.environment = Some(Environment::constant(Rgb::splat(0.7)));
    // Panel and sky have the same radiance: the hole changes nothing.
    let value = brightness(parts, 8, 1024);
    assert!((value / 0.35 - 1.0).abs() < 0.01, "{value}");
}

#[test]
fn opacity_mask_from_a_texture() {
    let mut parts = SceneParts::default();
    parts
        .textures
        .push(row(&[[255; 4], [255, 255, 255, 100], [255; 4], [0; 4]]));
    let leaf = Material {
        alpha_mode: AlphaMode::Mask(0.5),
        base_color_texture: map(0),
        ..diffuse("leaf", Rgb::ONE)
    };
    parts.add(leaf, [mapped(Vec3::ZERO, Vec3::X * 4.0, Vec3::Y)]);
    let scene = Scene::new(parts);
    for (x, there) in [(0.5, true), (1.5, false), (2.5, true), (3.5, false)] {
        for y in [0.1, 0.9] {
            let ray = Ray::new(Vec3::new(x, y, 1.0), Vec3::NEG_Z);
            assert_eq!(scene.intersect(&ray).is_some(), there, "{x} {y}");
            assert_eq!(scene.occluded(&ray), there, "{x} {y}");
        }
    }
}

/// P-value of directions of light samples against the density of the emission along rays, both from the origin.
fn light_sampling(parts: SceneParts) -> f64 {
    const CELLS: [usize; 2] = [20, 12];
    const COUNT: u32 = 200_000;
    let (scene, tau) = (Scene::new(parts), std::f64::consts::TAU);
    let steps = [tau / CELLS[0] as f64, 0.5 * tau / CELLS[1] as f64];
    let density = |phi: f64, theta: f64| {
        let ((sin, cos), (y, x)) = (theta.sin_cos(), phi.sin_cos());
        let dir = glam::DVec3::new(sin * x, cos, sin * y).as_vec3();
        let seen = scene.emission_along(&Ray::new(Vec3::ZERO, dir));
        seen.map_or(0.0, |e| sin * f64::from(e.pdf_w))
    };
    let mut expected = Vec::new();
    for cell in 0..CELLS[0] * CELLS[1] {
        let [x, y] = [cell % CELLS[0], cell / CELLS[0]].map(|i| i as f64);
        let (phi, theta) = (x * steps[0], y * steps[1]);
        let (across, down) = ([phi, phi + steps[0]], [theta, theta + steps[1]]);
        let count = f64::from(COUNT);
        expected.push(count * chi_square::integrate(&density, across, down, 0.2 / count));
    }
    let mut rng = crate::unit::support::draws::rng(5);
    let mut observed = vec![0; expected.len()];
    for _ in 0..COUNT {
        let u: [f32; 3] = std::array::from_fn(|_| rand::RngExt::random(&mut rng));
        let light = scene
            .lights()
            .sample(Vec3::ZERO, u.into())
            .expect("all lights shine here");
        assert!(matches!(light.density, LightDensity::SolidAngle(_)));
        let phi = f64::from(light.wi.z)
            .atan2(light.wi.x.into())
            .rem_euclid(tau);
        let theta = f64::from(light.wi.y).acos();
        let at = [phi / steps[0], theta / steps[1]];
        let [x, y] = [0, 1].map(|i| (at[i] as usize).min(CELLS[i] - 1));
        observed[y * CELLS[0] + x] += 1;
    }
    let total: f64 = expected.iter().sum();
    assert!(
        (total / f64::from(COUNT) - 1.0).abs() < 2e-3,
        "densities sum to {total} of {COUNT}"
    );
    chi_square::p_value(&observed, &expected)
}

#[test]
fn chi_square_light_sampling_of_environment_and_area_lights() {
    let sky = |x: usize, y: usize| Rgb::splat(0.2 + ((7 * x + 3 * y) % 5) as f32);
    let map = crate::image::Buffer::from_fn(8, 4, sky);
    let mut lamps = SceneParts::default();
    let panel = |at: f32| quad(Vec3::new(-1.0, at, -1.5), Vec3::X * 2.0, Vec3::Z * 3.0);
    lamps.add(emitter("above", Rgb::splat(2.0)), [panel(0.8)]);
    let below = Material {
        double_sided: true,
        ..emitter("below", Rgb::ONE)
    };
    lamps.add(below, [panel(-1.2)]);
    let sky = SceneParts {
        environment: Some(Environment::from_map(map, 0.4)),
        ..SceneParts::default()
    };
    let all = [("environment", sky), ("area lights", lamps)];
    let p_values = all.map(|(name, parts)| (light_sampling(parts), name.to_owned()));
    assert_likely(&p_values);
}

#[test]
fn light_density_of_lights_without_area_is_a_probability() {
    let mut parts = SceneParts::default();
    for power in [1.0, 3.0] {
        parts.lights.push(PunctualLight::Point {
            position: Vec3::Y,
            intensity: Rgb::splat(power),
            range: f32::INFINITY,
        });
    }
    let scene = Scene::new(parts);
    let mut seen = [0.1, 0.9].map(|u| {
        let light = scene
            .lights()
            .sample(Vec3::ZERO, [u, 0.5, 0.5].into())
            .expect("a light");
        assert!(light.density.is_delta() && light.density.mis_weight(7.0) == 1.0);
        light.density.value()
    });
    seen.sort_by(f32::total_cmp);
    assert!(seen.iter().all(|p| [0.25, 0.75].contains(p)), "{seen:?}");
}

/// An empty scene in a white environment.
fn white() -> SceneParts {
    SceneParts {
        environment: Some(Environment::constant(Rgb::ONE)),
        ..SceneParts::default()
    }
}

/// Balls of few facets with smooth normals lose no light at their edges: they are invisible in a white environment.
#[test]
fn white_furnace_of_coarse_balls_shows_no_rim() {
    let materials = [
        ("mirror", metal("ball", Rgb::ONE, 0.0), 0.999),
        ("metal", metal("ball", Rgb::ONE, 0.04), 0.9),
        ("gloss", coated("ball", Rgb::ONE, 0.01), 0.9),
        (
            "coat",
            clearcoated(metal("ball", Rgb::ONE, 0.04), 0.0),
            0.85,
        ),
    ];
    for (name, material, least) in materials {
        for divisions in [1, 2] {
            let mut parts = white();
            parts.add(material.clone(), [sphere(Vec3::ZERO, 1.0, divisions)]);
            parts.add_camera([0.0, 0.6, 5.0], [0.0; 3], 26.0);
            let film = film(&scene(parts), Rule::Plain, 48, 256, 7);
            let means = film.mean();
            let darkest = means.pixels.iter().map(|p| p.y).fold(1.0, f32::min);
            assert!(
                darkest > least,
                "{name}, {} faces: {darkest}",
                20 << (2 * divisions)
            );
        }
    }
}

/// The shadow on a ball of few facets begins where it does on a ball of many facets; the sun is at the side.
#[test]
fn shadow_of_a_coarse_ball_begins_where_that_of_a_fine_one_does() {
    let mesh = |rows: u32| {
        let columns = 2 * rows;
        let point = |i: u32| {
            let t = std::f32::consts::PI * (i / (columns + 1)) as f32 / rows as f32;
            let p = std::f32::consts::TAU * (i % (columns + 1)) as f32 / columns as f32;
            Vec3::new(t.sin() * p.cos(), t.cos(), t.sin() * p.sin())
        };
        let quad = |i: u32| {
            let [a, b] =
                [0, columns + 1].map(|row| i / columns * (columns + 1) + i % columns + row);
            let upper = (i >= columns).then_some([a, a + 1, b + 1]);
            let lower = (i < columns * (rows - 1)).then_some([a, b + 1, b]);
            upper.into_iter().chain(lower)
        };
        let points: Vec<Vec3> = (0..(rows + 1) * (columns + 1)).map(point).collect();
        Mesh {
            normals: points.clone(),
            positions: points,
            indices: (0..rows * columns).flat_map(quad).collect(),
            ..Mesh::default()
        }
    };
    let ball = |rows: u32, towards: f32| {
        let mut parts = SceneParts::default();
        parts.add(diffuse("ball", Rgb::ONE), [mesh(rows)]);
        parts.add_camera([0.0, 0.0, 6.0], [0.0; 3], 18.0);
        parts.lights.push(PunctualLight::Directional {
            direction: Vec3::new(-1.0, 0.0, towards).normalize(),
            irradiance: Rgb::splat(3.0),
        });
        film(&scene(parts), Rule::Plain, 32, 64, 7).mean()
    };
    // Self-shadowing by triangles would leave 0.79 and 0.82 of the light, and 130 and 66 dark pixels.
    for (rows, towards) in [(5, 0.0), (8, 0.2)] {
        let (fine, coarse) = (ball(48, towards), ball(rows, towards));
        // Without the outline, at which the coarse ball is smaller.
        let inner = fine.pixels.iter().enumerate().filter(|(i, _)| {
            let at = Vec2::new((i % 32) as f32, (i / 32) as f32) - 15.5;
            at.length() < 12.5
        });
        let (mut sum, mut of, mut dark) = (0.0, 0.0, 0);
        for (i, there) in inner {
            sum += coarse.pixels[i].y;
            of += there.y;
            dark += usize::from(coarse.pixels[i].y < there.y / 3.0 && there.y > 0.02);
        }
        assert!((sum / of - 1.0).abs() < 0.1, "{rows}: {sum} of {of}");
        assert!(dark < 3, "{rows}: {dark} dark pixels");
    }
}

/// Ripples of 10 degrees in a normal map, from a low camera: a mirror loses nothing. Water has Fresnel's reflectance
/// for the normal that keeps the mirror direction above the surface.
#[test]
fn ripples_seen_from_low_are_not_black() {
    let slope = |i: usize| 10f64.to_radians() * (4.0 * FRAC_PI_2 * i as f64 / 256.0).sin();
    let texel = |i: usize| {
        let encode = |x: f64| (127.5 + 127.5 * x).round() as u8;
        [
            encode(slope(i).sin()),
            encode(0.0),
            encode(slope(i).cos()),
            255,
        ]
    };
    // Schlick's form, as in [glTF §B.2.3].
    let normal = (0.33f64 / 2.33).powi(2);
    let fresnel = |incidence: f64| normal + (1.0 - normal) * (1.0 - incidence.cos()).powi(5);
    for degrees in [5.0f64, 10.0, 20.0] {
        let elevation = degrees.to_radians();
        let least = 0.01f64.min(0.9 * elevation.sin()).asin();
        // A normal tilted away by t mirrors the elevation less 2t.
        let away = |t: f64| t.min(0.5 * (elevation - least));
        let water = (0..256)
            .map(|i| fresnel(FRAC_PI_2 - elevation + away(slope(i))))
            .sum::<f64>()
            / 256.0;
        let mut sea = coated("water", Rgb::ZERO, 0.0);
        sea.ior = 1.33;
        for (material, expected) in [(metal("mirror", Rgb::ONE, 0.0), 1.0), (sea, water)] {
            let mut parts = white();
            parts.textures = vec![Texture::rgba(256, 1, (0..256).map(texel))];
            let sea = Material {
                normal_texture: map(0),
                double_sided: true,
                ..material
            };
            let mut plane = mapped(Vec3::new(-1.0, 0.0, -1.0), 2.0 * Vec3::Z, 2.0 * Vec3::X);
            plane.uvs.iter_mut().for_each(|uv| uv.x *= 10.0);
            parts.add(sea, [plane]);
            // Six ripples of the plane fill the height of the picture.
            let (sin, cos) = (elevation.sin() as f32, elevation.cos() as f32);
            let high = (1.2 * sin / 1000.0).to_degrees();
            parts.add_camera([0.0, 1000.0 * sin, 1000.0 * cos], [0.0; 3], high);
            let (mean, _) = mean(&film(&scene(parts), Rule::Plain, 48, 64, 1));
            assert!(
                (mean / expected - 1.0).abs() < 0.01,
                "{degrees}: {mean}, expected {expected}"
            );
        }
    }
}
