//! One light path and one camera path, connected, from given random numbers.

use super::Bidirectional;
use super::iteration::Iteration;
use super::paths::LightPath;
use crate::image::splat::Splat;
use crate::integrator::View;
use crate::integrator::walk::ways::Ways;
use crate::math::UVec2;
use crate::sampler::Sampler;
use crate::scene::Aim;

/// Pairs of paths of one iteration. The mean of a pair's values over all random numbers, the pixel of the camera path
/// included, is the picture.
pub(in crate::integrator) struct Pairs<'a> {
    iteration: Iteration<'a>,
    light: LightPath,
    splats: Vec<Splat>,
}

impl<'a> Pairs<'a> {
    /// Pairs of iteration number `sample` over a whole frame, without merging.
    pub(in crate::integrator) fn new(
        settings: &'a Bidirectional,
        view: &'a View<'a>,
        aim: &'a Aim,
        sample: u32,
    ) -> Self {
        Self {
            iteration: settings.iteration(view, aim, sample, None),
            light: LightPath::default(),
            splats: Vec::new(),
        }
    }

    /// The values of a pair, one for the pixel of the camera path, and one for every visible vertex of the light path;
    /// zeros are omitted.
    pub(in crate::integrator) fn trace(
        &mut self,
        light: &mut impl Sampler,
        camera: &mut impl Sampler,
        pixel: UVec2,
    ) -> &[Splat] {
        let Self {
            iteration,
            light: path,
            splats,
        } = self;
        splats.clear();
        iteration.whole_light_path(light, path, splats);
        for splat in splats.iter_mut() {
            splat.value *= iteration.paths as f32;
        }
        let frame = iteration.view.sensor.frame;
        let drawn = (&mut Ways::drawn(), &mut ());
        let value = iteration.camera_way(pixel, camera, path, None, drawn);
        splats.push(Splat {
            index: pixel.y * frame.x + pixel.x,
            value: value * (frame.x as f32 * frame.y as f32),
        });
        splats.retain(|splat| splat.value != crate::math::Rgb::ZERO);
        splats
    }
}
