//! Renders of the program against renders of the [simple path tracer](super::simple).

use super::simple::{Fault, Simple};
use super::{Finding, Size};
use crate::gallery::materials::{
    GOLD, brushed, clearcoated, coated, diffuse, emitter, glass, metal,
};
use crate::gallery::shapes::{Placing, cuboid, disc, room, sphere};
use crate::stats::agreement::{Agreement, agree};
use opsr::image::Film;
use opsr::integrator::{Estimator, Picture, Settings, View};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::scene::{Material, Scene, SceneParts};

/// A closed room with bodies of all materials, and an emissive ceiling that the simple tracer finds quickly.
fn lit_room() -> Scene {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, front] =
        room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    let walls = diffuse("walls", Rgb::new(0.6, 0.5, 0.4));
    parts.add(walls, [left, right, floor, back, front]);
    parts.add(emitter("ceiling", Rgb::new(1.0, 0.9, 0.8)), [ceiling]);
    let ball = |x: f32, z: f32, radius: f32| sphere(Vec3::new(x, radius + 0.05, z), radius, 3);
    parts.add(metal("gold", GOLD, 0.1), [ball(-0.5, -0.4, 0.4)]);
    parts.add(glass("frosted", 1.5, 0.3), [ball(0.45, 0.2, 0.4)]);
    // Light that starts inside a body: for light that crosses a body, the factors η² of both surfaces would cancel.
    let filament = emitter("filament", Rgb::splat(4.0));
    let place = Vec3::new(0.45, 0.45, 0.2);
    parts.add(filament, [sphere(place, 0.2, 2)]);
    parts.add(glass("clear", 1.5, 0.0), [ball(-0.3, 0.4, 0.2)]);
    let pane = Material {
        solid: false,
        ..glass("pane", 1.5, 0.1)
    };
    parts.add(pane, [sphere(Vec3::new(0.1, 1.2, 0.0), 0.3, 3)]);
    let paint = metal("paint", Rgb::new(0.7, 0.1, 0.1), 0.3);
    parts.add(clearcoated(paint, 0.02), [ball(0.65, 0.65, 0.25)]);
    let lamp = glass("lamp", 1.5, 0.2);
    parts.add(clearcoated(lamp, 0.0), [ball(-0.75, 0.6, 0.2)]);
    let lacquer = coated("lacquer", Rgb::new(0.1, 0.3, 0.6), 0.05);
    let block = cuboid(Vec3::new(0.1, 0.0, -0.9), Vec3::new(0.7, 0.9, -0.4));
    parts.add(lacquer, [block]);
    let plate = disc(0.4, 24).placed([0.0, 1.2, 0.0], Vec3::new(-0.3, 1.2, -0.9));
    let plates = [plate.clone(), plate.moved(Vec3::new(0.0, -0.6, 0.3))];
    let [upper, lower] = plates;
    parts.add(brushed(metal("brushed", GOLD, 0.05), 0.7, 0.4), [upper]);
    let varnish = coated("varnish", Rgb::new(0.2, 0.5, 0.3), 0.02);
    parts.add(clearcoated(brushed(varnish, 0.5, 0.0), 0.01), [lower]);
    parts.add_camera([0.0, 1.0, 0.9], [0.0, 0.7, 0.0], 70.0);
    Scene::new(parts)
}

fn render(scene: &Scene, settings: &Settings, size: u32, spp: u32) -> Film {
    let mut picture = Picture {
        film: Film::new(UVec2::splat(size)),
        aovs: None,
        levels: None,
    };
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, 0..spp, &mut picture);
    picture.film
}

/// Least p-values of pixels, tiles and the whole image, as −log₁₀.
fn findings(name: &str, agreement: &Agreement) -> Vec<Finding> {
    let negative_log = |p: f64| -p.max(1e-300).log10();
    [
        ("pixels", &agreement.pixels),
        ("tiles", &agreement.tiles),
        ("whole image", &agreement.image),
    ]
    .map(|(scale, tests)| {
        let p = tests.worst.map_or(f64::NAN, |worst| worst.p);
        let (tried, bound) = (format!("{name}: {scale}, −log10 p"), tests.threshold);
        Finding::new(tried, negative_log(bound), [negative_log(p)])
    })
    .into()
}

/// Agreement of path and bidirectional path tracing with the simple path tracer, which may have a planted fault.
pub fn all(size: Size, fault: Option<Fault>) -> Vec<Finding> {
    let (edge, spp) = size.of((16, 256), (24, 2048), (32, 16_384));
    let scene = lit_room();
    let simple = Simple {
        max_vertices: 8,
        seed: 2,
        fault,
    };
    let simple = simple.film(&scene, edge, spp);
    let refused = |film: &Film| film.rejected.total() as f64;
    let mut all = Vec::new();
    for (name, estimator) in [("path", Estimator::default()), ("bdpt", Estimator::Bdpt)] {
        let settings = Settings {
            estimator,
            max_vertices: 8,
            roulette_start: 3,
            seed: 1,
            ..Settings::default()
        };
        let film = render(&scene, &settings, edge, spp);
        let tried = format!("{name}, {spp} samples a pixel: refused samples");
        all.push(Finding::new(
            tried,
            0.0,
            [refused(&film) + refused(&simple)],
        ));
        match agree(&film, &simple) {
            Ok(agreement) => all.extend(findings(name, &agreement)),
            Err(error) => all.push(Finding::failed(error)),
        }
    }
    all
}
