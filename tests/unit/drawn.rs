//! Films of path tracing with independent samples.

use crate::image::Film;
use crate::integrator::{Settings, View};
use crate::math::UVec2;
use crate::sampler::{Independent, Seed};
use crate::scene::Scene;
use std::ops::Range;

/// A square film of path tracing with independent samples and random reflection or refraction at smooth glass.
pub(crate) fn drawn(scene: &Scene, settings: &Settings, size: u32, spp: u32) -> Film {
    drawn_samples(scene, settings, size, 0..spp)
}

pub(crate) fn drawn_samples(
    scene: &Scene,
    settings: &Settings,
    size: u32,
    samples: Range<u32>,
) -> Film {
    let mut film = Film::new(UVec2::splat(size));
    let view = View::of(scene, &scene.parts().cameras[0], &film);
    let (tracer, seed) = (settings.tracer(settings.rule.clone()), Seed(settings.seed));
    tracer.estimate(&view, &Independent { seed }, samples, &mut film, &mut ());
    film
}
