//! Scene, settings and random numbers of one iteration.

use super::strategies::Strategies;
use super::vertex::MergeRule;
use super::weights::Merging;
use super::{Bidirectional, MAX_LIGHT_PATHS};
use crate::image::level_film::BATCHES;
use crate::integrator::View;
use crate::integrator::walk::camera::CameraWalks;
use crate::math::UVec2;
use crate::regularise::Accumulated;
use crate::sampler::{
    CameraSource, Domain, Independent, LightSource, PathStream, SampleSource, SamplerKind, Seed,
};
use crate::scene::Aim;
use std::f32::consts::PI;

/// Distance within which surfaces allow merges at neighbours, over the merge radius. Measured in docs/lab/photons.md.
const NEAR: f32 = 64.0;

/// Scene, settings and radius of one iteration, shared by the threads.
#[derive(Clone, Copy)]
pub(super) struct Iteration<'a> {
    pub(super) settings: &'a Bidirectional,
    pub(super) strategies: Strategies,
    pub(super) view: &'a View<'a>,
    /// Aim of light paths.
    pub(super) aim: &'a Aim,
    /// Number of the iteration.
    pub(super) sample: u32,
    /// Number of light paths.
    pub(super) paths: u32,
    /// Merge radius; 0 without merging.
    pub(super) radius: f32,
    pub(super) merge_rule: MergeRule,
    /// Merging weights of camera walks, and of light walks below.
    pub(super) merging: Merging<f32>,
    pub(super) light_merging: Merging<f32>,
    /// Kernel radius in world units; `None` in scenes where camera walks can hit all lights.
    pub(super) mollifier: Option<f32>,
    /// Rule that roughens the last vertex; `None` in scenes without glossy lobes.
    pub(super) rule: Option<&'a Accumulated>,
    pub(super) light: LightSource,
    pub(super) camera: CameraSource,
    pub(super) camera_walks: CameraWalks<'a>,
    pub(super) probes: Independent,
}

impl Bidirectional {
    /// Iteration number `sample`; `first` is the merge radius of iteration 0.
    pub(super) fn iteration<'a>(
        &'a self,
        view: &'a View<'a>,
        aim: &'a Aim,
        sample: u32,
        first: Option<f32>,
    ) -> Iteration<'a> {
        let frame = view.sensor.frame;
        let pixels = u64::from(frame.x) * u64::from(frame.y);
        let paths = pixels.min(u64::from(MAX_LIGHT_PATHS)) as u32;
        let radius = (self.merging.zip(first)).map_or(0.0, |(r, first)| r.at(first, sample));
        let beside_lights = self.strategies == Strategies::Density;
        let connects = !beside_lights && !self.light_sampling_only;
        let merge_rule = MergeRule {
            near: if connects {
                NEAR * radius
            } else {
                f32::INFINITY
            },
            beside_lights,
        };
        let merging = match self.strategies {
            Strategies::All | Strategies::One(_) if radius > 0.0 => {
                Merging::new(PI * radius * radius * paths as f32)
            }
            _ => Merging::none(),
        };
        let [merging, light_merging] = if self.light_sampling_only {
            merging.light_sampling_only()
        } else {
            [merging; 2]
        };
        let seed = Seed(self.seed);
        let camera = match self.batched || !self.radii.is_empty() {
            true => self.sampler,
            false => SamplerKind::Independent,
        };
        let (low, high) = view.scene.geometry().bounds();
        let shrink = (f64::from(sample) + 1.0).powf(-1.0 / 6.0) as f32;
        let mollifier = (self.mollifier)
            .filter(|_| !view.scene.parts().lights.is_empty())
            .map(|radius| radius * 0.5 * low.distance(high) * shrink);
        Iteration {
            settings: self,
            strategies: self.strategies,
            view,
            aim,
            sample,
            paths,
            radius,
            merge_rule,
            merging,
            light_merging,
            mollifier,
            rule: self.split.as_ref().filter(|_| view.scene.features().lobes),
            light: LightSource::new(self.sampler, seed, frame.x),
            camera: CameraSource::new(camera, seed, BATCHES as u32),
            camera_walks: CameraWalks::of(view),
            probes: Independent {
                seed: seed.derive(Domain::Probes, 0),
            },
        }
    }
}

impl Iteration<'_> {
    /// Random numbers of a light path.
    pub(super) fn light_stream(&self, path: u32) -> PathStream {
        self.light.stream(path, self.sample)
    }

    /// Random numbers of a camera path.
    pub(super) fn camera_stream(&self, pixel: UVec2) -> PathStream {
        self.camera.stream(pixel, self.sample)
    }
}
