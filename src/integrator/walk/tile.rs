//! All camera rays of a tile of a film.

use super::bodies::EnclosingBodies;
use super::observer::PathObserver;
use crate::image::film::Film;
use crate::integrator::View;
use crate::math::{Ray, Rgb};
use crate::sampler::{SampleSource, Sampler};
use std::ops::Range;

/// Adds the samples with these numbers to every pixel of a tile. `radiance` is what arrives along a camera ray that begins
/// in these bodies, by the number of the sample.
pub(in crate::integrator) fn trace_tile<Q: SampleSource, O: PathObserver>(
    view: &View<'_>,
    source: &Q,
    samples: Range<u32>,
    tile: &mut Film,
    observer: &mut O,
    mut radiance: impl FnMut(Ray, EnclosingBodies, u32, &mut Q::Stream, &mut O) -> Rgb,
) {
    let around = EnclosingBodies::around_camera(view);
    for index in 0..tile.pixels.len() {
        let pixel = tile.pixel(index);
        for sample in samples.clone() {
            if observer.stopped() {
                return;
            }
            let mut stream = source.stream(pixel, sample);
            let place = pixel.as_vec2() + stream.film();
            let ray = (view.sensor).sample_ray(place, || stream.lens());
            observer.begin(pixel, sample);
            let bodies = around.unwrap_or_else(|| EnclosingBodies::around(view.scene, &ray));
            let value = radiance(ray, bodies, sample, &mut stream, observer);
            tile.push(index, value, sample);
        }
    }
}
