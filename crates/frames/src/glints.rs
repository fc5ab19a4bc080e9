//! Glints: lamps that mirrors and smooth glass show.
//!
//! A reflected lamp does not move with its mirror, and is far brighter than its surroundings. A pixel of a smooth
//! surface has the mean light of lamps along a few rays, which follow the likelier of reflection and refraction.

use opsr::integrator::View;
use opsr::math::{Rgb, Vec2, Vec3};
use opsr::scene::{Scene, Surface};

/// Roughness from which on a surface shows no lamps; blurs of pictures, too, count such a surface as rough.
const ROUGH: f32 = 0.05;

/// Maximum number of smooth surfaces along a ray.
const CHAIN: usize = 5;

/// Rays per pixel, on a lattice: reflections in curved surfaces are thinner than pixels. Measured in docs/lab/films.md.
const RAYS: u32 = 8;

/// Rows from one point of the lattice to the next: it has one in every column and row.
const STEP: u32 = 3;

/// Mean of the channels.
fn grey(light: Rgb) -> f32 {
    light.element_sum() / 3.0
}

/// Light of lamps and of the environment along a ray after it hits a smooth `surface`; `None` for a rough surface.
fn behind(scene: &Scene, mut dir: Vec3, mut surface: Surface) -> Option<f32> {
    let mut light = None;
    for _ in 0..CHAIN {
        let bsdf = scene.bsdf(&mut surface, 0.5);
        let frame = surface.frame_for(-dir);
        // The number 0.5 selects the likelier lobe.
        let drawn = bsdf.sample(0.0, frame.to_local(-dir), [0.5; 3]);
        let Some(next) = drawn.filter(|next| next.delta && bsdf.alpha() < ROUGH) else {
            break;
        };
        let light = light.get_or_insert(0.0);
        dir = frame.to_world(next.wi);
        let Some(hit) = scene.intersect(&surface.spawn_leaving(dir)) else {
            *light += grey(scene.lights().environment(dir));
            break;
        };
        surface = scene.surface_along(&hit, dir);
        *light += grey(scene.lights().emitted(&surface, -dir));
    }
    light
}

/// Mean light of the lamps that a pixel shows by smooth surfaces; 0 if the `surface` at its centre is rough.
pub(crate) fn glint(view: &View<'_>, pixel: Vec2, surface: &Surface) -> f32 {
    let scene = view.scene;
    let dir = view.sensor.ray(pixel + 0.5).dir;
    if behind(scene, dir, *surface).is_none() {
        return 0.0;
    }
    let along = |i| {
        let place = Vec2::new(i as f32 + 0.5, (STEP * i % RAYS) as f32 + 0.5);
        let ray = view.sensor.ray(pixel + place / RAYS as f32);
        let hit = scene.intersect_seen(&ray)?;
        behind(scene, ray.dir, scene.surface_along(&hit, ray.dir))
    };
    (0..RAYS).filter_map(along).sum::<f32>() / RAYS as f32
}
