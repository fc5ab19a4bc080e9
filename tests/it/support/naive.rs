//! A path tracer without light sampling, weights or roulette: slow, and too simple to share the faults of the real one.

use opsr::image::Film;
use opsr::math::{Ray, Rgb, UVec2};
use opsr::sampler::{Independent, SampleSource, Sampler, Seed};
use opsr::scene::{Scene, Sensor};

/// A film of the scene's first camera.
pub(crate) fn film(scene: &Scene, size: u32, spp: u32, seed: u64, max_vertices: u32) -> Film {
    let mut film = Film::new(UVec2::splat(size));
    let source = Independent { seed: Seed(seed) };
    let sensor = Sensor {
        camera: &scene.parts().cameras[0],
        frame: film.size,
    };
    for index in 0..film.pixels.len() {
        let pixel = film.pixel(index);
        for sample in 0..spp {
            let mut stream = source.stream(pixel, sample);
            let ray = sensor.ray(pixel.as_vec2() + stream.film());
            let value = radiance(scene, ray, &mut stream, max_vertices);
            film.push(index, value, sample);
        }
    }
    film
}

fn radiance(scene: &Scene, mut ray: Ray, sampler: &mut impl Sampler, max_vertices: u32) -> Rgb {
    let (mut total, mut throughput) = (Rgb::ZERO, Rgb::ONE);
    for n in 1..=max_vertices + 1 {
        let Some(hit) = scene.intersect(&ray) else {
            return total + throughput * scene.lights().environment(ray.dir);
        };
        let surface = scene.surface(&hit);
        total += throughput * scene.lights().emitted(&surface, -ray.dir);
        if n > max_vertices {
            break;
        }
        let u = sampler.vertex();
        let bsdf = scene.bsdf(&surface, u.material);
        let frame = surface.frame_for(-ray.dir);
        let wo = frame.to_local(-ray.dir);
        let Some(sample) = bsdf.sample(bsdf.alpha(), wo, u.lobe) else {
            break;
        };
        let wi = frame.to_world(sample.wi);
        if wi.dot(surface.ng) * sample.wi.z <= 0.0 {
            break;
        }
        throughput *= sample.weight;
        ray = surface.spawn(wi);
    }
    total
}
