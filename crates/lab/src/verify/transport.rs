//! Small renders: light leaks, scales of the scene, Russian roulette, empty scenes.

use super::{Finding, Numbers};
use crate::gallery::materials::{GOLD, coated, diffuse, emitter, glass, metal};
use crate::gallery::shapes::{Placing, quad, room, sphere};
use crate::gallery::{caustic_box, furnace_sphere};
use opsr::bsdf::Distribution;
use opsr::image::Film;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::{Estimator, Picture, Settings, View};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::regularise::Rule;
use opsr::scene::{Environment, Material, Mesh, PunctualLight, Scene, SceneParts};

fn plain() -> Settings {
    Settings::default()
}

fn regularised() -> Settings {
    Settings {
        rule: Rule::constant(0.3),
        ..Settings::default()
    }
}

/// Settings of the other estimators.
fn others() -> [Settings; 6] {
    [
        Estimator::Guided { unbiased: false },
        Estimator::Light,
        Estimator::Bdpt,
        Estimator::Vcm(Radius::default()),
        Estimator::Sppm(Radius::default()),
        Estimator::Mlt { mutations: 1 },
    ]
    .map(|estimator| Settings {
        estimator,
        ..Settings::default()
    })
}

fn render(parts: SceneParts, settings: &Settings, size: u32, spp: u32) -> Film {
    let scene = Scene::new(parts);
    let mut picture = Picture {
        film: Film::new(UVec2::splat(size)),
        aovs: None,
        levels: None,
    };
    let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, 0..spp, &mut picture);
    picture.film
}

/// Mean of the picture and its standard error; NaN if samples were rejected.
fn mean(film: &Film) -> (f64, f64) {
    if film.rejected.total() > 0 {
        return (f64::NAN, f64::NAN);
    }
    let n = 3.0 * film.pixels.len() as f64;
    let sum: f64 = film.pixels.iter().map(|p| p.mean.element_sum()).sum();
    let variance = |p: &opsr::math::moments::Moments| p.variance_of_mean().element_sum();
    let variance: f64 = film.pixels.iter().map(variance).sum();
    (sum / n, variance.sqrt() / n)
}

/// Largest of a quantity over the pixels; NaN if samples were rejected.
fn largest(film: &Film, at: impl Fn(usize) -> f64) -> f64 {
    if film.rejected.total() > 0 {
        return f64::NAN;
    }
    (0..film.pixels.len()).map(at).fold(0.0, f64::max)
}

/// Largest absolute value of a picture.
fn brightest(film: &Film) -> f64 {
    largest(film, |i| film.pixels[i].mean.abs().max_element())
}

/// Room under an emissive ceiling with a metal ball and a glass ball of one roughness.
fn balls(alpha: f32, distribution: Distribution) -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, front] =
        room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    let walls = [left, right, floor, back, front];
    parts.add(diffuse("walls", Rgb::splat(0.5)), walls);
    parts.add(emitter("ceiling", Rgb::ONE), [ceiling]);
    let ball = |x: f32, z: f32| sphere(Vec3::new(x, 0.45, z), 0.4, 3);
    for (material, ball) in [
        (metal("metal", GOLD, alpha), ball(-0.5, -0.3)),
        (glass("glass", 1.5, alpha), ball(0.45, 0.2)),
    ] {
        let material = Material {
            distribution,
            ..material
        };
        parts.add(material, [ball]);
    }
    parts.add_camera([0.0, 1.0, 0.95], [0.0, 0.5, 0.0], 75.0);
    parts
}

/// Relative change of the mean of a picture from just below to just above the Dirac bound.
pub(super) fn mean_across_the_dirac_bound() -> Finding {
    let mut errors = Vec::new();
    for (settings, distribution) in [
        (plain(), Distribution::Beckmann),
        (plain(), Distribution::Ggx),
        (regularised(), Distribution::Beckmann),
    ] {
        let parts = |alpha| balls(alpha, distribution);
        let at = |alpha| mean(&render(parts(alpha), &settings, 24, 128)).0;
        let (below, above) = (at(9.9e-4), at(1.01e-3));
        errors.push((below / above - 1.0).abs());
    }
    Finding::new("mean of a picture across α = 1e-3", 5e-3, errors)
}

/// Relative change of a picture's mean by a ball with an index near 1, on a floor under a constant sky. The indices are
/// on both sides of the bound below which an interface is invisible.
pub(super) fn weak_interfaces() -> Vec<Finding> {
    let parts = |ior: f32, alpha: f32| {
        let mut parts = SceneParts::default();
        let side = 8.0;
        let corner = Vec3::new(-0.5 * side, 0.0, -0.5 * side);
        let floor = quad(corner, Vec3::Z * side, Vec3::X * side);
        parts.add(diffuse("floor", Rgb::splat(0.6)), [floor]);
        parts.environment = Some(Environment::constant(Rgb::ONE));
        let ball = sphere(Vec3::new(0.0, 0.8, 0.0), 0.7, 3);
        parts.add(glass("ball", ior, alpha), [ball]);
        parts.add_camera([0.0, 1.2, 3.0], [0.0, 0.7, 0.0], 45.0);
        parts
    };
    let worst = |settings: Settings, alphas: &[f32]| {
        let picture = |ior, alpha| mean(&render(parts(ior, alpha), &settings, 16, 256)).0;
        let nothing = picture(1.0, 0.0);
        let mut errors = Vec::new();
        for ior in [1.0001, 1.0006, 1.001] {
            let off = |&alpha: &f32| (picture(ior, alpha) / nothing - 1.0).abs();
            errors.extend(alphas.iter().map(off));
        }
        errors
    };
    let mut rough = worst(plain(), &[0.3]);
    rough.extend(worst(regularised(), &[0.0]));
    vec![
        Finding::new(
            "mean with a ball of index 1.0001 to 1.001 against none",
            5e-3,
            worst(plain(), &[0.0, 0.01]),
        ),
        // Single scattering loses the light that a rough interface masks, whatever its index.
        Finding::new("the same, rough or roughened", 2e-2, rough),
    ]
}

/// Sphere with random shading normals, the camera inside and all light outside.
fn dark(open: bool) -> SceneParts {
    let mut numbers = Numbers::new(40);
    let mut ball = sphere(Vec3::ZERO, 1.0, 3);
    for normal in &mut ball.normals {
        *normal = match numbers.below(6) {
            0 => Vec3::ZERO,
            1 => -*normal,
            2 => Vec3::NAN,
            _ => numbers.above(),
        };
    }
    if open {
        ball.indices.truncate(ball.indices.len() - 200);
    }
    let mut parts = SceneParts::default();
    // The camera sees the inside.
    let shell = opsr::scene::Material {
        double_sided: true,
        ..coated("shell", Rgb::splat(0.9), 0.01)
    };
    parts.add(shell, [ball]);
    parts.environment = Some(Environment::constant(Rgb::splat(1e5)));
    parts.lights.push(PunctualLight::Point {
        position: Vec3::new(0.0, 1.001, 0.0),
        intensity: Rgb::splat(1e3),
        range: f32::INFINITY,
    });
    parts.add_camera([0.3, 0.1, 0.2], [0.0, 0.0, -1.0], 100.0);
    parts
}

/// Largest value inside a closed sphere, or inside a sphere with a hole.
pub fn leak(open: bool) -> Finding {
    let reuse = Settings {
        estimator: Estimator::Path { reuse: true },
        ..regularised()
    };
    let settings = [plain(), regularised(), reuse].into_iter();
    let films = settings
        .chain(others())
        .map(|s| render(dark(open), &s, 24, 16));
    Finding::new(
        "light inside a closed sphere, random shading normals",
        0.0,
        films.map(|film| brightest(&film)),
    )
}

pub(super) fn leaks() -> Vec<Finding> {
    vec![leak(false), divided(), covered(true)]
}

/// Largest value inside a closed box of flat walls with all light outside. The box is rotated, so that the triangles of
/// a wall are coplanar only up to rounding.
pub(crate) fn divided() -> Finding {
    let inside = |turn: [f32; 3]| {
        let mut parts = SceneParts::default();
        let walls = room(Vec3::splat(-1.0), Vec3::ONE).map(|wall| wall.placed(turn, Vec3::ONE));
        parts.add(diffuse("walls", Rgb::splat(0.9)), walls);
        parts.environment = Some(Environment::constant(Rgb::splat(1e5)));
        parts.add_camera([1.1, 0.9, 1.2], [1.5, 0.6, 0.0], 100.0);
        parts
    };
    let turns = [[0.3, 0.7, 0.2], [1.1, 0.1, 2.3]];
    let films = turns.into_iter().flat_map(|turn| {
        let settings = std::iter::once(plain()).chain(others());
        settings.map(move |s| render(inside(turn), &s, 24, 16))
    });
    Finding::new(
        "light inside a closed box whose walls are two triangles each",
        0.0,
        films.map(|film| brightest(&film)),
    )
}

/// Lamp of edge 1 at height 2 over a white floor and a metal ball, with a black sheet 4e-5 below the lamp if `closed`.
fn lamp(closed: bool) -> SceneParts {
    let mut parts = SceneParts::default();
    let panel = |y: f32, edge: f32| {
        let h = 0.5 * edge;
        quad(Vec3::new(-h, y, -h), Vec3::X * edge, Vec3::Z * edge)
    };
    parts.add(emitter("lamp", Rgb::splat(10.0)), [panel(2.0, 1.0)]);
    if closed {
        parts.add(diffuse("sheet", Rgb::ZERO), [panel(2.0 - 4e-5, 1.2)]);
    }
    let floor = quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0);
    parts.add(coated("floor", Rgb::splat(0.8), 0.1), [floor]);
    let ball = sphere(Vec3::new(0.0, 0.5, 0.0), 0.5, 3);
    parts.add(metal("ball", GOLD, 0.1), [ball]);
    parts.add_camera([0.0, 1.0, 4.0], [0.0, 0.5, 0.0], 50.0);
    parts
}

/// Largest value of a picture whose only light is covered by a sheet that almost touches the light.
pub fn covered(closed: bool) -> Finding {
    let films = [1e-3, 1.0, 37.0, 1e6].into_iter().flat_map(|scale| {
        let settings = [plain(), regularised()].into_iter();
        settings
            .chain(others())
            .map(move |s| render(scaled(lamp(closed), scale), &s, 12, 16))
    });
    Finding::new(
        "light through a sheet 4e-5 before the lamp",
        0.0,
        films.map(|film| brightest(&film)),
    )
}

/// Multiplies all positions by `scale`.
fn scaled(mut parts: SceneParts, scale: f32) -> SceneParts {
    for mesh in &mut parts.meshes {
        mesh.positions.iter_mut().for_each(|p| *p *= scale);
    }
    for camera in &mut parts.cameras {
        camera.position *= scale;
    }
    parts
}

pub(super) fn scales() -> Vec<Finding> {
    let apart = |settings: &Settings| {
        let picture = |scale| render(scaled(caustic_box(), scale), settings, 24, 16);
        let one = picture(1.0);
        let same = |other: Film| {
            let apart = |i: usize| one.pixels[i].mean - other.pixels[i].mean;
            largest(&other, |i| apart(i).abs().max_element())
        };
        [-10, 20].map(|e| same(picture(2f32.powi(e))))
    };
    let settings = std::iter::once(regularised()).chain(others());
    let powers: Vec<f64> = settings.flat_map(|s| apart(&s)).collect();
    let balls = balls(0.01, Distribution::Beckmann);
    let mean = |scale| {
        mean(&render(
            scaled(balls.clone(), scale),
            &regularised(),
            24,
            64,
        ))
        .0
    };
    let unit = mean(1.0);
    let means = [1e-3, 1e3, 1e6].map(|scale| (mean(scale) / unit - 1.0).abs());
    vec![
        Finding::new("a picture at 2⁻¹⁰ and 2²⁰ times the size", 0.0, powers),
        Finding::new("mean at 1e-3, 1e3 and 1e6 times the size", 2e-3, means),
    ]
}

/// White furnace with Russian roulette from the first vertex on, for dark and bright walls and radiances from 1e-30 to
/// 1e30: deviation of the mean from 1 in standard errors.
pub(super) fn roulette() -> Vec<Finding> {
    let settings = Settings {
        max_vertices: 256,
        roulette_start: 1,
        ..Settings::default()
    };
    let furnace = |settings: &Settings, spp: u32, albedo: f32, radiance: f32| {
        let mut parts = furnace_sphere(albedo);
        parts.materials[0].emission *= radiance;
        let (mean, error) = mean(&render(parts, settings, 12, spp));
        let radiance = f64::from(radiance);
        (mean / radiance - 1.0, error / radiance)
    };
    let noisy = [
        (0.1, 1.0),
        (0.5, 1.0),
        (0.9, 1.0),
        (0.5, 1e30),
        (0.5, 1e-30),
    ];
    let noisy = noisy.map(|(albedo, radiance)| {
        let (off, error) = furnace(&settings, 256, albedo, radiance);
        off.abs() / error
    });
    // Camera and light walk each have their own roulette.
    let both = Settings {
        estimator: Estimator::Bdpt,
        ..settings.clone()
    };
    let from_both_ends = [(0.1, 1.0), (0.5, 1.0), (0.5, 1e30), (0.5, 1e-30)];
    let from_both_ends = from_both_ends.map(|(albedo, radiance)| {
        let (off, error) = furnace(&both, 64, albedo, radiance);
        off.abs() / error
    });
    let noisy = noisy.into_iter().chain(from_both_ends);
    // Paths of throughput 0 or 1e-30 end at once.
    let dark = [0.0, 1e-30].map(|albedo| furnace(&settings, 256, albedo, 1.0).0.abs());
    vec![
        Finding::new("furnace with roulette: standard errors from 1", 4.5, noisy),
        Finding::new("furnace with black walls: mean − 1", 1e-6, dark),
    ]
}

/// Largest value of scenes without triangles, without light, or without valid triangles.
pub(super) fn empty_scenes() -> Vec<Finding> {
    let empty = || {
        let mut parts = SceneParts::default();
        parts.add_camera([0.0, 0.0, 3.0], [0.0, 0.0, 0.0], 40.0);
        parts
    };
    let mut unlit = empty();
    unlit.add(metal("ball", GOLD, 0.1), [sphere(Vec3::ZERO, 1.0, 2)]);
    let mut broken = empty();
    let corners = [Vec3::NAN, Vec3::ZERO, Vec3::X, Vec3::splat(f32::INFINITY)];
    let faces = vec![[0, 1, 2], [1, 1, 2], [1, 2, 3], [2, 2, 2], [0, 1, 9]];
    let mesh = Mesh {
        positions: corners.into(),
        indices: faces,
        ..Mesh::default()
    };
    broken.add(emitter("shards", Rgb::splat(1e9)), [mesh]);
    let mut black = empty();
    black.environment = Some(Environment::constant(Rgb::ZERO));
    black.add(glass("ball", 1.5, 0.0), [sphere(Vec3::ZERO, 1.0, 2)]);
    let settings = std::iter::once(regularised()).chain(others());
    let scenes = [empty(), unlit, broken, black];
    let values = settings.flat_map(|s| {
        let scenes = scenes.iter().cloned();
        scenes.map(move |parts| brightest(&render(parts, &s, 8, 4)))
    });
    vec![Finding::new(
        "light of empty, unlit and broken scenes",
        0.0,
        values,
    )]
}
