//! Walks from the camera, and the loop over the pixels of a tile.

use super::observer::PathObserver;
use super::{Surroundings, Walk};
use crate::integrator::View;
use crate::integrator::pieces::Tile;
use crate::math::{Rgb, UVec2};
use crate::sampler::{SampleSource, Sampler};
use std::ops::Range;

/// Starts walks from a view's camera.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct CameraWalks<'a> {
    view: View<'a>,
    /// Media around the camera, if they are the same for all its rays.
    around: Option<Surroundings>,
}

impl<'a> CameraWalks<'a> {
    /// Walks from the camera of a view.
    pub(in crate::integrator) fn of(view: &View<'a>) -> Self {
        Self {
            view: *view,
            around: Surroundings::around_camera(view),
        }
    }

    /// A walk through a pixel.
    #[inline]
    pub(in crate::integrator) fn start(&self, pixel: UVec2, stream: &mut impl Sampler) -> Walk<'a> {
        let View { scene, sensor, .. } = self.view;
        let place = pixel.as_vec2() + stream.film();
        let ray = sensor.sample_ray(place, || stream.lens());
        let around = self
            .around
            .unwrap_or_else(|| Surroundings::around(scene, &ray));
        let mut walk = Walk::camera(scene, ray, around);
        if scene.has_filtered() {
            walk.pixel = sensor.cone(ray.dir);
        }
        walk
    }
}

/// Traces the samples with these numbers of every pixel of a tile. `radiance` estimates the radiance that arrives along
/// a walk, given the sample's number.
pub(in crate::integrator) fn trace_tile<'a, Q: SampleSource, O: PathObserver>(
    view: &View<'a>,
    source: &Q,
    samples: Range<u32>,
    tile: &mut Tile<'_>,
    observer: &mut O,
    mut radiance: impl FnMut(Walk<'a>, u32, &mut Q::Stream, &mut O) -> Rgb,
) {
    let walks = CameraWalks::of(view);
    for index in 0..tile.window.len() {
        let pixel = tile.window.pixel(index);
        for sample in samples.clone() {
            if observer.stopped() {
                return;
            }
            let mut stream = source.stream(pixel, sample);
            let walk = walks.start(pixel, &mut stream);
            observer.begin(pixel, sample);
            let light = radiance(walk, sample, &mut stream, observer);
            observer.finish(light);
            tile.push(light);
        }
    }
}
