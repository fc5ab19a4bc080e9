//! Smooth thin walls: shadow rays pass them straight, with MIS against paths through them.

use super::support::render::{film_with, mean, scene};
use opsr::image::Film;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::{Amounts, Estimator, Picture, Settings, View};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::regularise::Rule;
use opsr::scene::{
    Environment, Material, Mesh, PunctualLight, Scene, SceneParts, Texture, TextureRef,
};
use opsr_lab::gallery::materials::{coated, diffuse, emitter, glass};
use opsr_lab::gallery::shapes::{cuboid, quad, room, sphere};
use opsr_lab::stats::agreement::agree;
use opsr_lab::verify::simple::Simple;

const TINT: Rgb = Rgb::new(0.9, 0.6, 0.3);

fn pane(alpha: f32) -> Material {
    Material {
        transmission: 1.0,
        ..coated("pane", TINT, alpha)
    }
}

/// A horizontal square of a half width at a height, front upward.
fn square(height: f32, half: f32) -> Mesh {
    let corner = Vec3::new(-half, height, -half);
    quad(corner, Vec3::Z * 2.0 * half, Vec3::X * 2.0 * half)
}

/// A closed room with an emissive panel below its ceiling, or open to a sky.
fn lit_room(sky: bool, content: impl FnOnce(&mut SceneParts)) -> Scene {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, front] =
        room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    let walls = diffuse("walls", Rgb::new(0.6, 0.5, 0.4));
    parts.add(walls.clone(), [left, right, floor, back, front]);
    if sky {
        parts.environment = Some(Environment::constant(Rgb::new(0.8, 0.9, 1.0)));
    } else {
        parts.add(walls, [ceiling]);
        let panel = quad(Vec3::new(-0.6, 1.9, -0.6), Vec3::X * 1.2, Vec3::Z * 1.2);
        parts.add(emitter("panel", Rgb::new(3.0, 2.7, 2.4)), [panel]);
    }
    parts.add(
        coated("block", Rgb::new(0.2, 0.4, 0.5), 0.2),
        [cuboid(Vec3::new(-0.6, 0.0, -0.5), Vec3::new(0.0, 0.5, 0.0))],
    );
    content(&mut parts);
    parts.add_camera([0.0, 1.0, 0.9], [0.0, 0.5, -0.2], 70.0);
    scene(parts)
}

/// A texture of four texels; the first channel scales the transmission.
fn textured() -> impl FnOnce(&mut SceneParts) {
    |parts| {
        let texels = [
            [255, 40, 40, 255],
            [90, 255, 90, 255],
            [30, 80, 255, 255],
            [180; 4],
        ];
        parts.textures.push(Texture {
            srgb: true,
            ..Texture::rgba(2, 2, texels)
        });
        let map = Some(TextureRef {
            second: false,
            texture: 0,
            transform: glam::Affine2::IDENTITY,
        });
        let material = Material {
            base_color_texture: map,
            transmission_texture: map,
            ..pane(0.0)
        };
        let mut mesh = square(1.4, 0.8);
        mesh.uvs = vec![[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]]
            .into_iter()
            .map(Into::into)
            .collect();
        parts.add(material, [mesh]);
    }
}

/// Rooms with panes, and one with a glass body.
fn rooms() -> Vec<(&'static str, Scene)> {
    let panes = |heights: &'static [f32], alpha: f32| {
        move |parts: &mut SceneParts| {
            parts.add(pane(alpha), heights.iter().map(|&h| square(h, 0.9)));
        }
    };
    let upright = |parts: &mut SceneParts| {
        let corner = Vec3::new(-1.0, 0.0, 0.5);
        parts.add(pane(0.0), [quad(corner, Vec3::X * 2.0, Vec3::Y * 1.6)]);
    };
    let half = |parts: &mut SceneParts| {
        let material = Material {
            transmission: 0.6,
            ..pane(0.0)
        };
        parts.add(material, [square(1.4, 0.9)]);
    };
    let curved = |parts: &mut SceneParts| {
        parts.add(pane(0.0), [sphere(Vec3::new(0.3, 1.1, -0.2), 0.4, 4)]);
    };
    let body = |parts: &mut SceneParts| {
        parts.add(
            glass("body", 1.5, 0.0),
            [cuboid(Vec3::new(-0.8, 1.3, -0.8), Vec3::new(0.8, 1.4, 0.8))],
        );
    };
    vec![
        ("one pane", lit_room(false, panes(&[1.4], 0.0))),
        ("two panes", lit_room(false, panes(&[1.2, 1.5], 0.0))),
        ("a pane before the camera", lit_room(false, upright)),
        ("half a pane", lit_room(false, half)),
        ("a curved pane", lit_room(false, curved)),
        ("a textured pane", lit_room(false, textured())),
        ("panes under a sky", lit_room(true, panes(&[1.3, 1.9], 0.0))),
        ("a rough pane", lit_room(false, panes(&[1.4], 0.3))),
        ("a body", lit_room(false, body)),
    ]
}

const PATH: Estimator = Estimator::Path { reuse: false };

fn small() -> Radius {
    Radius {
        first: Some(0.01),
        alpha: 2.0 / 3.0,
    }
}

/// All estimators agree with the naive tracer, which samples no lights.
fn assert_agree(estimators: &[(Estimator, Rule, u32)], wanted: impl Fn(&str) -> bool) {
    let mut wrong = Vec::new();
    for (name, scene) in rooms().iter().filter(|(name, _)| wanted(name)) {
        let simple = Simple {
            max_vertices: 6,
            seed: 2,
            fault: None,
        };
        let expected = simple.film(scene, 16, 1200);
        for (estimator, rule, spp) in estimators {
            let settings = Settings {
                estimator: *estimator,
                rule: rule.clone(),
                max_vertices: 6,
                ..Settings::default()
            };
            let film = film_with(scene, &settings, 16, *spp);
            let agreement = agree(&film, &expected).expect("one size");
            println!(
                "{name}, {estimator:?}: {:.5?} {:.5?}",
                mean(&film),
                mean(&expected)
            );
            let large = agreement.tiles.passed() && agreement.image.passed();
            if !large {
                println!("{agreement}");
                wrong.push(format!("{name}, {estimator:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn naive_tracer_agrees_on_panes_with_path_tracing() {
    let path = (PATH, Rule::Plain, 300);
    let guided = (Estimator::Guided { unbiased: true }, Rule::Plain, 256);
    assert_agree(&[path, guided], |_| true);
}

#[test]
fn naive_tracer_agrees_on_panes_with_bidirectional_estimators() {
    let bdpt = (Estimator::Bdpt, Rule::Plain, 150);
    let vcm = (Estimator::Vcm(small()), Rule::Plain, 150);
    let nee = (Estimator::VcmNee(small()), Rule::Plain, 150);
    assert_agree(&[bdpt, vcm, nee], |_| true);
    let mlt = (Estimator::Mlt { mutations: 8 }, Rule::Plain, 64);
    assert_agree(&[mlt], |name| name == "two panes" || name == "half a pane");
}

/// A floor under panes and a light.
fn under_pane(light: PunctualLight, panes: u32) -> Scene {
    let mut parts = SceneParts::default();
    parts.add(diffuse("floor", Rgb::splat(0.5)), [square(0.0, 4.0)]);
    let all = (1..=panes).map(|i| square(0.2 * i as f32, 4.0));
    parts.add(pane(0.0), all);
    parts.lights.push(light);
    parts.add_camera([0.0, 0.15, 0.0], [0.001, 0.0, 0.0], 20.0);
    scene(parts)
}

/// Panes transmit (1 − 0.04) of their tint each, at normal incidence.
#[test]
fn analytic_transmittance_of_panes_before_lights_without_area() {
    let sun = PunctualLight::Directional {
        direction: -Vec3::Y,
        irradiance: Rgb::ONE,
    };
    let point = PunctualLight::Point {
        position: Vec3::Y * 1000.0,
        intensity: Rgb::splat(1e6),
        range: f32::INFINITY,
    };
    for (light, panes) in [(sun, 0), (sun, 1), (sun, 3), (point, 2)] {
        let scene = under_pane(light, panes);
        let expected = (0.96 * TINT).powf(panes as f32) * 0.5 / std::f32::consts::PI;
        let all = [
            (PATH, 4, 1e-3),
            (Estimator::Guided { unbiased: true }, 16, 1e-3),
            (Estimator::Bdpt, 4, 1e-3),
            (Estimator::Vcm(small()), 4, 1e-3),
        ];
        for (estimator, spp, tolerance) in all {
            // Too short for paths that return from a pane to the floor.
            let settings = |max_vertices| Settings {
                estimator,
                max_vertices,
                ..Settings::default()
            };
            let found = |max_vertices| {
                let film = film_with(&scene, &settings(max_vertices), 8, spp);
                let mean = film.mean();
                mean.pixels.iter().sum::<Rgb>() / mean.pixels.len() as f32
            };
            let lit = found(1 + panes);
            let off = ((lit - expected) / expected).abs().max_element();
            assert!(off < tolerance, "{panes}, {estimator:?}: {lit} {expected}");
            // One vertex fewer than panes and floor.
            if panes > 0 {
                assert_eq!(found(panes), Rgb::ZERO, "{panes}, {estimator:?}");
            }
        }
    }
}

/// Roughening at a pane counts no light twice: the room is as bright as in plain path tracing.
#[test]
fn energy_conservation_of_roughened_panes() {
    for (name, scene) in rooms()
        .iter()
        .filter(|(name, _)| name.contains("pane") && *name != "a rough pane")
    {
        let settings = |rule: Rule, amounts| Settings {
            rule,
            amounts,
            max_vertices: 6,
            ..Settings::default()
        };
        let (plain, error) = mean(&film_with(
            scene,
            &settings(Rule::Plain, Amounts::Raw),
            16,
            512,
        ));
        let close = |rough: f64| {
            println!("{name}: {plain:.5} ± {error:.5}, {rough:.5}");
            let bound = 0.02 * plain + 6.0 * error;
            assert!((plain - rough).abs() < bound, "{name}: {plain} {rough}");
        };
        let rule = || Rule::constant(0.5);
        close(mean(&film_with(scene, &settings(rule(), Amounts::Raw), 16, 512)).0);
        let mut picture = Picture::new(Film::new(UVec2::splat(16)));
        let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
        let levels = settings(
            rule(),
            Amounts::roughening(&[0.0, 0.5, 1.0]).expect("scales"),
        );
        levels.integrator().pass(&view, 0..512, &mut picture);
        let levels = picture.levels.expect("levels");
        for k in 0..3 {
            let picture = levels.mean(k);
            let sum: Rgb = picture.pixels.iter().sum();
            close(f64::from(sum.element_sum()) / (3.0 * picture.pixels.len() as f64));
        }
    }
}
