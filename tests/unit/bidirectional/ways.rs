//! Both paths of a camera walk at smooth glass.

use crate::integrator::amounts::SCALES;
use crate::integrator::bidirectional::Radius;
use crate::integrator::{Amounts, Estimator, Settings};
use crate::math::{Rgb, Vec3};
use crate::regularise::Rule;
use crate::scene::{Material, Mesh, SceneParts};
use crate::unit::drawn::drawn;
use crate::unit::lab::gallery::materials::{coated, diffuse, emitter, glass, tinted_glass};
use crate::unit::lab::gallery::shapes::{cuboid, quad};
use crate::unit::support::render::{film_with, mean, scene};
use std::f32::consts::FRAC_1_SQRT_2 as COS;

/// Radiance of the lamp that the glass reflects, and of the lamp behind the glass.
const LAMPS: [f32; 2] = [10.0, 1.0];

/// Index of the glass.
const IOR: f32 = 1.5;

/// A camera that sees only two lamps by glass at 45°: one reflected, one behind the glass.
fn beam_splitter(material: Material, glass: Mesh) -> SceneParts {
    let mut parts = SceneParts::default();
    let reflected = quad(Vec3::new(4.0, -3.0, -3.0), 6.0 * Vec3::Z, 6.0 * Vec3::Y);
    let behind = quad(Vec3::new(-3.0, -3.0, -4.0), 6.0 * Vec3::X, 6.0 * Vec3::Y);
    parts.add(emitter("reflected", Rgb::splat(LAMPS[0])), [reflected]);
    parts.add(emitter("behind", Rgb::splat(LAMPS[1])), [behind]);
    parts.add(material, [glass]);
    parts.add_camera([0.0, 0.0, 5.0], [0.0, 0.0, 0.0], 1.0);
    parts
}

/// Reflectance of a plate at 45°: Fresnel's equations for two faces, with all reflections between them.
fn plate_reflectance() -> f32 {
    let cos_t = (1.0 - (1.0 - COS * COS) / (IOR * IOR)).sqrt();
    let s = (COS - IOR * cos_t) / (COS + IOR * cos_t);
    let p = (IOR * COS - cos_t) / (IOR * COS + cos_t);
    let face = 0.5 * (s * s + p * p);
    2.0 * face / (1.0 + face)
}

/// Reflectance of a pane at 45°, by Schlick's approximation as glTF has it.
fn pane_reflectance() -> f32 {
    let f0 = ((IOR - 1.0) / (IOR + 1.0)).powi(2);
    f0 + (1.0 - f0) * (1.0 - COS).powi(5)
}

/// The choice between a reflection and a refraction adds no noise to any sample.
#[test]
fn glass_shows_what_it_reflects_and_what_is_behind_it_in_every_sample() {
    let turned = |p: Vec3| Vec3::new(COS * (p.x + p.z), p.y, COS * (p.z - p.x));
    let corner = Vec3::new(-1.0, -1.0, 0.0);
    let pane = quad(turned(corner), turned(2.0 * Vec3::X), 2.0 * Vec3::Y);
    let mut plate = cuboid(Vec3::new(-1.0, -1.0, -0.05), Vec3::new(1.0, 1.0, 0.05));
    plate.positions.iter_mut().for_each(|p| *p = turned(*p));
    let thin = Material {
        transmission: 1.0,
        ior: IOR,
        ..coated("pane", Rgb::ONE, 0.0)
    };
    // The remaining noise is light reflected inside the plate. A random choice would deviate by more than the mean.
    let cases = [
        ("pane", thin, pane, pane_reflectance(), 0.001),
        (
            "plate",
            glass("plate", IOR, 0.0),
            plate,
            plate_reflectance(),
            0.1,
        ),
    ];
    for (name, material, mesh, f, most) in cases {
        let expected = f * LAMPS[0] + (1.0 - f) * LAMPS[1];
        let scene = scene(beam_splitter(material, mesh));
        let path = Estimator::Path { reuse: false };
        let raw = |estimator| (estimator, Rule::Plain, Amounts::Raw);
        let levels = Amounts::roughening(&SCALES).expect("ascending scales");
        for (estimator, rule, amounts) in [
            raw(Estimator::Bdpt),
            raw(Estimator::Vcm(Radius::default())),
            raw(path),
            (path, Rule::constant(0.3), Amounts::Raw),
            (path, Rule::constant(0.3), levels),
        ] {
            let settings = Settings {
                estimator,
                rule,
                amounts,
                max_vertices: 12,
                ..Settings::default()
            };
            let film = film_with(&scene, &settings, 8, 16);
            let (whole, error) = mean(&film);
            let close = (whole - f64::from(expected)).abs() < 4.0 * error + 1e-3;
            assert!(close, "{name}: {whole} ± {error} for {expected}");
            for variance in &film.variance_of_mean().pixels {
                let deviation = (16.0 * variance.x).sqrt();
                assert!(deviation < most * expected, "{name}: {deviation}");
            }
        }
    }
}

/// Roulette of the two paths preserves the light of a room behind a pane that reflects a third of it.
#[test]
fn agreement_with_drawn_ways_behind_a_pane() {
    let mut parts = super::scenes::lit(diffuse("walls", Rgb::splat(0.8)), 3.0);
    let pane = Material {
        transmission: 1.0,
        ior: 4.0,
        ..coated("pane", Rgb::ONE, 0.0)
    };
    let corner = Vec3::new(-2.0, -1.0, 1.5);
    parts.add(pane, [quad(corner, 4.0 * Vec3::X, 4.0 * Vec3::Y)]);
    let scene = scene(parts);
    let settings = |estimator, seed| Settings {
        estimator,
        seed,
        ..Settings::default()
    };
    let path = Estimator::Path { reuse: false };
    let (expected, error) = mean(&drawn(&scene, &settings(path, 1), 16, 512));
    for estimator in [path, Estimator::Bdpt, Estimator::VcmNee(Radius::default())] {
        let (found, own) = mean(&film_with(&scene, &settings(estimator, 2), 16, 512));
        let z = (found - expected) / error.hypot(own);
        assert!(
            z.abs() < 4.0,
            "{estimator:?}: {found} ± {own} for {expected} ± {error}"
        );
    }
}

/// Three panes of dark glass darken all samples of what is behind them equally: none ends in the glass by roulette.
#[test]
fn dark_glass_adds_no_noise_to_what_is_behind_it() {
    let room = |absorption: f32, material: Material| {
        let mut parts = SceneParts::default();
        let wall = quad(Vec3::new(-3.0, -1.0, -1.0), 6.0 * Vec3::X, 6.0 * Vec3::Y);
        let floor = quad(Vec3::new(-3.0, -1.0, 1.0), 6.0 * Vec3::X, -2.0 * Vec3::Z);
        parts.add(material, [wall, floor]);
        let lamp = quad(Vec3::new(2.0, 0.0, 0.0), -Vec3::Z, Vec3::Y);
        let both_sides = Material {
            double_sided: true,
            ..emitter("lamp", Rgb::splat(10.0))
        };
        parts.add(both_sides, [lamp]);
        // Equal indices, so that nothing is reflected.
        let dark = tinted_glass("dark", 1.0, 0.0, Rgb::splat(absorption));
        let pane = |z: f32| cuboid(Vec3::new(-0.3, -0.3, z), Vec3::new(0.3, 0.3, z + 0.1));
        parts.add(dark, [3.0, 3.2, 3.4].map(pane));
        parts.add_camera([0.0, 0.0, 5.0], [0.0, 0.0, 0.0], 2.0);
        scene(parts)
    };
    let rooms = [0.0, 6.0].map(|absorption| room(absorption, diffuse("room", Rgb::splat(0.7))));
    let glowing = room(6.0, emitter("room", Rgb::ONE));
    let transmittance = (-0.3f32 * 6.0).exp();
    for estimator in [Estimator::Bdpt, Estimator::Vcm(Radius::default())] {
        let settings = Settings {
            estimator,
            ..Settings::default()
        };
        let [clear, dark] =
            (rooms.each_ref()).map(|room| film_with(room, &settings, 8, 4).mean().pixels);
        for (dark, clear) in dark.iter().zip(&clear) {
            assert!(clear.x > 0.0, "{estimator:?}: black");
            let ratio = dark.x / (transmittance * clear.x);
            assert!((ratio - 1.0).abs() < 0.01, "{estimator:?}: {ratio}");
        }
        for pixel in &film_with(&glowing, &settings, 8, 1).mean().pixels {
            let ratio = pixel.x / transmittance;
            assert!((ratio - 1.0).abs() < 0.01, "{estimator:?}: {ratio}");
        }
    }
}
