use super::*;
use crate::image::film::Window;
use crate::integrator::bidirectional::psr::Ends;
use crate::integrator::bidirectional::weights::Partial;
use crate::integrator::bidirectional::{Radius, Strategies};
use crate::integrator::{Estimator, Settings, View};
use crate::math::UVec2;
use crate::sampler::{Independent, SampleSource, Sampler, Seed};
use crate::scene::{Aim, Material, SceneParts};
use crate::unit::{materials, shapes};

/// A list that grows step by step to a predicted length reserves little more memory than it needs.
#[test]
fn lists_grow_to_the_length_that_is_expected() {
    let mut list: Vec<u32> = Vec::new();
    for step in 0..100u32 {
        let more: Vec<u32> = (0..900 + 200 * (step % 2)).collect();
        let count = list.len() + more.len();
        extend(&mut list, more, 100.0 / f64::from(step + 1));
        assert_eq!(list.len(), count);
    }
    assert_eq!(list.len(), 100_000);
    assert!(list.capacity() < 112_000, "{}", list.capacity());
}

/// Rough dispersive glass that overlaps water: indices of refraction depend on the path, and are stored.
#[test]
fn vertices_built_again_are_those_of_the_walk() {
    let mut parts = SceneParts::default();
    let side = shapes::quad(Vec3::new(-4.0, -1.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0);
    parts.add(materials::diffuse("floor", Rgb::splat(0.5)), [side]);
    let lamp = shapes::quad(Vec3::new(-0.5, 3.0, -0.5), Vec3::X, Vec3::Z);
    parts.add(materials::emitter("lamp", Rgb::ONE), [lamp]);
    let ball = |x: f32| shapes::sphere(Vec3::new(x, 0.5, 0.0), 0.6, 3);
    let jewel = Material {
        dispersion: 2.0,
        priority: 1.0,
        ..materials::glass("jewel", 1.7, 0.2)
    };
    parts.add(jewel, [ball(-0.3)]);
    parts.add(materials::glass("water", 1.33, 0.1), [ball(0.3)]);
    parts.add_camera([0.0, 1.0, 4.0], [0.0, 0.5, 0.0], 40.0);
    let scene = Scene::new(parts);
    let size = UVec2::splat(32);
    let view = View::new(&scene, &scene.parts().cameras[0], size, Window::full(size));
    let settings = Settings {
        estimator: Estimator::Vcm(Radius::default()),
        ..Settings::default()
    };
    let bidirectional = settings.bidirectional(Strategies::All);
    let aim = Aim::default();
    let iteration = bidirectional.iteration(&view, &aim, 0, Some(0.1));
    let map = PhotonMap::new(iteration.some_light_vertices(), Vec3::splat(-4.0), 0.1);
    let kinds = [&map.vertices.photons.len(), &map.vertices.others.len()];
    assert!(kinds.iter().all(|count| **count > 100), "{kinds:?}");
    let (mut again, mut summaries) = (Vec::new(), Vec::new());
    let mut indices = std::collections::BTreeSet::new();
    for path in 0..map.paths() {
        let mut walked = Vec::new();
        let stream = &mut iteration.light_stream(path);
        let keep = |vertex: Vertex, _| walked.push(vertex);
        iteration.light_path(stream, keep, &mut Ends::default(), &mut Vec::new());
        map.of_path(path, u32::MAX, &scene, &mut again, &mut summaries);
        assert_eq!(walked.len(), again.len());
        for (a, b) in walked.iter().zip(&again) {
            assert_eq!(a.bsdf.eta(), b.bsdf.eta());
            assert_eq!((a.n, a.first, a.alpha), (b.n, b.first, b.alpha));
            assert_eq!((a.throughput, a.back), (b.throughput, b.back));
            assert_eq!((a.partial, a.merges), (b.partial, b.merges));
            assert_eq!(a.surface.position, b.surface.position);
            indices.extend(a.bsdf.eta().map(f32::to_bits));
        }
    }
    // Three channels in air and in water, and water in air.
    assert!(indices.len() >= 7, "{indices:?}");
}

/// All eight cells of a query share the bucket of a single photon, and few photons have few buckets.
#[test]
fn cells_that_share_a_bucket_count_no_photon_twice() {
    let mut parts = SceneParts::default();
    let corner = Vec3::new(-20.0, 0.0, -20.0);
    let plane = shapes::quad(corner, Vec3::Z * 40.0, Vec3::X * 40.0);
    parts.add(materials::diffuse("plane", Rgb::splat(0.5)), [plane]);
    let scene = Scene::new(parts);
    let vertex = |at: [f32; 2]| {
        let arrived = Arrived {
            flux: Rgb::ONE,
            partial: Partial::default(),
        };
        let photon = Photon {
            back: Vec3::Y,
            number: 6,
            index: 0,
            at,
            choice: 0.5,
        };
        photon.vertex(&arrived, &scene, 0, None)
    };
    let edge = vertex([0.5, 0.0]).surface.position - vertex([0.0, 0.0]).surface.position;
    let radius = 0.2 * edge.length();
    let mut stream = Independent { seed: Seed(17) }.stream(UVec2::ZERO, 0);
    let mut place = || [(); 2].map(|()| 0.5 * stream.next_1d());
    let mut found = 0;
    for photons in 1..=64 {
        let mut vertices = LightVertices::default();
        let places: Vec<Vertex> = (0..photons).map(|_| vertex(place())).collect();
        places.iter().for_each(|v| vertices.push(v, &scene, None));
        vertices.end();
        let low = places.iter().map(|v| v.surface.position);
        let low = low.reduce(Vec3::min).expect("a photon");
        let map = PhotonMap::new(vertices, low, radius);
        for _ in 0..16 {
            let query = vertex(place());
            let near = |v: &&Vertex| {
                let to = v.surface.position - query.surface.position;
                to.length_squared() <= radius * radius
            };
            let mut count = 0;
            map.around(&query, |_, _, _| count += 1);
            assert_eq!(
                count,
                places.iter().filter(near).count(),
                "{photons} photons"
            );
            found += count;
        }
    }
    assert!(found > 1000, "{found}");
}
