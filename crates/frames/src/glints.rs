//! Lamps that mirrors and smooth glass show.
//!
//! A reflected lamp moves otherwise than the surface that reflects it, and is many times as bright as what is beside it. Each pixel of a
//! smooth surface has the light of lamps at the ends of a few of its rays, which follow the likelier one of reflection and refraction.

use opsr::integrator::View;
use opsr::math::{Rgb, Vec2, Vec3};
use opsr::scene::{Scene, Surface};

/// Roughness from which on a surface shows no lamps. Blurs of pictures count it as rough too.
const ROUGH: f32 = 0.05;

/// Most smooth surfaces along a ray.
const CHAIN: usize = 5;

/// Rays of a pixel, at the points of a lattice: reflections in curved surfaces are thinner than pixels. Measured in docs/lab/films.md.
const RAYS: u32 = 8;

/// Rows from one point of the lattice to the next: it has one in every column and row.
const STEP: u32 = 3;

/// Mean of the channels.
fn grey(light: Rgb) -> f32 {
    light.element_sum() / 3.0
}

/// Light of lamps and of the environment along a ray behind the smooth surface that it meets; `None` where that is rough.
fn behind(scene: &Scene, mut dir: Vec3, mut surface: Surface) -> Option<f32> {
    let mut light = None;
    for _ in 0..CHAIN {
        let bsdf = scene.bsdf(&mut surface, 0.5);
        let frame = surface.frame_for(-dir);
        // The middle of the numbers draws the likelier lobe.
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

/// Mean light of the lamps that a pixel shows by smooth surfaces, if the `surface` at its centre is one; otherwise 0.
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
