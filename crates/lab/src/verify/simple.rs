//! A path tracer without light sampling, MIS weights or roulette: slow, and too simple to share the renderer's faults.
//!
//! A [`Fault`] can be planted in it: a comparison that does not detect the fault proves nothing.

use opsr::bsdf::Lobe;
use opsr::image::Film;
use opsr::math::{Ray, Rgb, UVec2};
use opsr::sampler::{Independent, SampleSource, Sampler, Seed};
use opsr::scene::{Scene, Sensor};
use rayon::prelude::*;

/// Samples of a pixel that are traced before they are added to the film.
const BATCH: u32 = 64;

/// Fault that is planted on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The density of the reverse sample: pdf(wi, wo) in place of pdf(wo, wi).
    SwappedDensity,
    /// Refraction that does not scale radiance by 1/η².
    MissingEta2,
    /// Values multiplied by |cos θi| twice.
    CosineTwice,
    /// Samples from a lobe 1.5 times as rough as the evaluated one, with the density of the evaluated one.
    RougherDraws,
    /// Emission counted twice from the third vertex on, as by two techniques without weights.
    LightTwice,
    /// Roulette that ends a tenth of the paths without scaling the others up.
    LossyRoulette,
    /// A picture 1 % too bright.
    Brightness,
    /// One tile of 8 × 8 pixels 10 % too bright.
    Tile,
}

impl Fault {
    /// All faults, with their names.
    pub const ALL: [(&'static str, Self); 8] = [
        ("swapped-density", Self::SwappedDensity),
        ("missing-eta2", Self::MissingEta2),
        ("cosine-twice", Self::CosineTwice),
        ("rougher-draws", Self::RougherDraws),
        ("light-twice", Self::LightTwice),
        ("lossy-roulette", Self::LossyRoulette),
        ("brightness", Self::Brightness),
        ("tile", Self::Tile),
    ];
}

/// The simple path tracer.
#[derive(Clone, Copy, Debug)]
pub struct Simple {
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Planted fault, for tests of the tests.
    pub fault: Option<Fault>,
}

impl Simple {
    /// A square film of the scene's first camera.
    pub fn film(&self, scene: &Scene, size: u32, spp: u32) -> Film {
        let mut film = Film::new(UVec2::splat(size));
        let seed = Seed(self.seed);
        let source = Independent { seed };
        let sensor = Sensor {
            camera: &scene.parts().cameras[0],
            frame: film.size,
        };
        for first in (0..spp).step_by(BATCH as usize) {
            let samples = first..spp.min(first + BATCH);
            let value = |index: usize, sample: u32| {
                let pixel = film.window.pixel(index);
                let mut stream = source.stream(pixel, sample);
                let ray = sensor.ray(pixel.as_vec2() + stream.film());
                self.exposure(pixel) * self.radiance(scene, &sensor, ray, &mut stream)
            };
            let values: Vec<Vec<Rgb>> = (0..film.pixels.len())
                .into_par_iter()
                .map(|index| samples.clone().map(|s| value(index, s)).collect())
                .collect();
            for (index, values) in values.into_iter().enumerate() {
                for (value, sample) in values.into_iter().zip(samples.clone()) {
                    film.push(index, value, sample);
                }
            }
        }
        film
    }

    /// Factor on the radiance of a pixel.
    fn exposure(&self, pixel: UVec2) -> f32 {
        match self.fault {
            Some(Fault::Brightness) => 1.01,
            Some(Fault::Tile) if pixel / 8 == UVec2::ONE => 1.1,
            _ => 1.0,
        }
    }

    fn radiance(
        &self,
        scene: &Scene,
        sensor: &Sensor<'_>,
        mut ray: Ray,
        sampler: &mut impl Sampler,
    ) -> Rgb {
        let (eye, pixel) = (ray.origin, sensor.cone(ray.dir));
        let (mut total, mut throughput) = (Rgb::ZERO, Rgb::ONE);
        for n in 1..=self.max_vertices + 1 {
            let times = match self.fault {
                Some(Fault::LightTwice) if n > 2 => 2.0,
                _ => 1.0,
            };
            let met = match n {
                1 => scene.intersect_seen(&ray),
                _ => scene.intersect(&ray),
            };
            let Some(hit) = met else {
                return total + throughput * times * scene.lights().environment(ray.dir);
            };
            let mut surface = scene.surface_along(&hit, ray.dir);
            total += throughput * times * scene.lights().emitted(&surface, -ray.dir);
            if n > self.max_vertices {
                break;
            }
            let u = sampler.vertex();
            if self.fault == Some(Fault::LossyRoulette) && u.roulette < 0.1 {
                break;
            }
            let (dir, distance) = (ray.dir, eye.distance(surface.position));
            let footprint = || pixel.footprint(dir, distance).filter(|_| n == 1);
            let bsdf = scene.bsdf_seen(&mut surface, u.material, footprint);
            let frame = surface.frame_for(-ray.dir);
            let wo = frame.to_local(-ray.dir);
            let alpha = bsdf.alpha();
            let drawn = match self.fault {
                Some(Fault::RougherDraws) => (1.5 * alpha).min(1.0),
                _ => alpha,
            };
            let Some(sample) = bsdf.sample(drawn, wo, u.lobe) else {
                break;
            };
            let wi = frame.to_world(sample.wi);
            let seen = surface.curved_height > 0.0 && sample.wi.z > 0.0;
            if wi.dot(surface.ng) * sample.wi.z <= 0.0 && !seen {
                break;
            }
            let mut weight = sample.weight;
            match self.fault {
                Some(Fault::SwappedDensity) if !sample.delta => {
                    weight *= sample.pdf_w / bsdf.pdf(alpha, sample.wi, wo).max(1e-6);
                }
                Some(Fault::RougherDraws) if !sample.delta => {
                    let eval = bsdf.eval(alpha, wo, sample.wi);
                    weight = eval.value / eval.pdf_w.max(1e-6);
                }
                Some(Fault::MissingEta2) if sample.lobe == Lobe::Transmission => {
                    weight *= bsdf.refraction_scale(wo);
                }
                Some(Fault::CosineTwice) => weight *= sample.wi.z.abs(),
                _ => {}
            }
            throughput *= weight;
            ray = surface.spawn_leaving(wi);
        }
        total
    }
}
