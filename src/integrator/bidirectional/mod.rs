//! Bidirectional transport: every light path is connected to the camera and to every vertex of a camera path.
//!
//! One iteration is one sample a pixel. It walks one light path per pixel of the *full* frame, at most [`MOST_PATHS`],
//! and connects the camera path of pixel p to light path p mod N. Light paths depend on the seed, their number and the
//! iteration only: any thread count, split into passes, and crop give bit-identical pixels. A light path and the camera
//! paths that it serves are walked together, so that no light vertex outlives them; splats are kept in the order of
//! their light paths and added in that order.
//!
//! | file | contents |
//! |---|---|
//! | [`weights`] | multiple importance sampling over all strategies: pure recursions |
//! | `vertex` | a scattering vertex: its value, and the densities of both walks |
//! | `walk` | one walk from either end: edges, draws, running numbers |
//! | `connect` | the five ways to close a path: value, then weight, then shadow ray |

mod connect;
mod vertex;
mod walk;
pub mod weights;

use super::walk::observer::{PathObserver, Recorder};
use super::walk::shading_point::ShadingPoint;
use super::{Integrator, Picture, View};
use crate::image::splat::{Splat, SplatLayer};
use crate::integrator::walk::bodies::EnclosingBodies;
use crate::math::{Rgb, UVec2};
use crate::sampler::{Domain, Independent, SampleSource, Sampler, Seed};
use rayon::prelude::*;
use std::ops::Range;
use vertex::{Origin, Vertex};
use walk::Walk;
use weights::Partial;

/// Most light paths of an iteration.
pub const MOST_PATHS: u32 = 1 << 20;

/// Light paths that a thread takes at a time.
const CHUNK: u32 = 1024;

/// The strategies that count, and their weights. Strategy (s, t) takes s vertices of a path from the light walk and t
/// from the camera walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategies {
    /// All, by the balance heuristic.
    All,
    /// Light tracing: t = 1, and lights met by the camera walk before its first smooth draw; weight 1.
    Light,
    /// One strategy with weight 1, for tests.
    Only {
        /// Vertices of the light walk, the light's own included.
        s: u32,
        /// Vertices of the camera walk, the camera's own included.
        t: u32,
    },
}

/// A bidirectional path tracer, or one of its parts.
#[derive(Clone, Copy, Debug)]
pub struct Bidirectional {
    /// The strategies that count.
    pub strategies: Strategies,
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Vertex (from 1 at either end) at which Russian roulette begins.
    pub roulette_start: u32,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Results of a chunk of light paths.
struct Chunk<O> {
    /// Values of camera paths, and splats of light paths, each in order.
    camera: Vec<Splat>,
    splats: Vec<Splat>,
    observer: O,
}

impl Strategies {
    /// The weight of strategy (s, t); `balance` computes it where all strategies count.
    #[inline]
    fn weight(self, s: u32, t: u32, balance: impl FnOnce() -> f32) -> f32 {
        match self {
            Self::All => balance(),
            Self::Light => f32::from(u8::from(t == 1 || s == 0)),
            Self::Only { s: s1, t: t1 } => f32::from(u8::from((s, t) == (s1, t1))),
        }
    }

    /// True if camera walks are closed by light sampling and connections.
    fn connects(self) -> bool {
        self != Self::Light
    }
}

impl Integrator for Bidirectional {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) {
        let mut layer = SplatLayer::new(&view.window);
        for sample in samples {
            match &mut picture.aovs {
                Some(aovs) => self.iteration(view, sample, &mut layer, aovs),
                None => self.iteration(view, sample, &mut layer, &mut ()),
            }
            for (index, value) in layer.take().enumerate() {
                picture.film.push(index, value, sample);
            }
        }
    }
}

/// Work of one thread on one iteration.
struct Iteration<'a> {
    settings: Bidirectional,
    view: &'a View<'a>,
    /// Number of the iteration.
    sample: u32,
    /// Number of light paths.
    paths: u32,
    light: Independent,
    camera: Independent,
    /// Bodies around the camera, if they are the same for all its rays.
    around_camera: Option<EnclosingBodies>,
}

impl Bidirectional {
    /// Adds one sample of every pixel to the layer, which holds a value a pixel of the window.
    fn iteration<O: Recorder>(
        &self,
        view: &View<'_>,
        sample: u32,
        layer: &mut SplatLayer,
        recorder: &mut O,
    ) {
        let frame = view.sensor.frame;
        let pixels = u64::from(frame.x) * u64::from(frame.y);
        let source = |domain| Independent {
            seed: Seed(self.seed).derive(domain, 0),
        };
        let iteration = Iteration {
            settings: *self,
            view,
            sample,
            paths: pixels.min(u64::from(MOST_PATHS)) as u32,
            light: source(Domain::Light),
            camera: source(Domain::Camera),
            around_camera: EnclosingBodies::around_camera(view),
        };
        let chunks: Vec<Chunk<O>> = (0..iteration.paths.div_ceil(CHUNK))
            .into_par_iter()
            .map(|chunk| {
                let first = chunk * CHUNK;
                let paths = first..(first + CHUNK).min(iteration.paths);
                iteration.chunk(paths, pixels, recorder.fork())
            })
            .collect();
        for chunk in chunks {
            layer.add_in_order(&chunk.camera);
            layer.add_in_order(&chunk.splats);
            recorder.join(chunk.observer);
        }
    }
}

impl Iteration<'_> {
    /// A range of light paths and the camera paths that they serve.
    fn chunk<O: PathObserver>(&self, paths: Range<u32>, pixels: u64, observer: O) -> Chunk<O> {
        let mut chunk = Chunk {
            camera: Vec::new(),
            splats: Vec::new(),
            observer,
        };
        let mut vertices = Vec::new();
        let columns = u64::from(self.view.sensor.frame.x);
        for path in paths {
            self.light_path(path, &mut vertices, &mut chunk.splats);
            for index in (u64::from(path)..pixels).step_by(self.paths as usize) {
                let pixel = UVec2::new((index % columns) as u32, (index / columns) as u32);
                if let Some(mut splat) = Splat::new(&self.view.window, pixel, Rgb::ZERO) {
                    splat.value = self.camera_path(pixel, &vertices, &mut chunk.observer);
                    chunk.camera.push(splat);
                }
            }
        }
        chunk
    }

    /// Walks a light path: connects its vertices to the camera, and leaves those to which a camera walk can connect.
    fn light_path(&self, path: u32, vertices: &mut Vec<Vertex>, splats: &mut Vec<Splat>) {
        vertices.clear();
        let scene = self.view.scene;
        let mut stream = self.light.stream(UVec2::new(path, 0), self.sample);
        let (pick, u) = (
            stream.next_pick(),
            std::array::from_fn(|_| stream.next_1d()),
        );
        let Some(start) = scene.sample_emission(pick, u) else {
            return;
        };
        let mut walk = Walk::light(scene, &start);
        for n in 1..=self.settings.max_vertices {
            let Some(hit) = walk.arrive() else {
                return;
            };
            if n == 1 {
                walk.throughput *= start.window(hit.0.t);
            }
            let u = stream.vertex();
            let vertex = walk.vertex(n, &hit, u.material);
            if !vertex.is_delta()
                && let Some(splat) = self.connect_to_camera(&vertex)
            {
                splats.push(splat);
            }
            let more = n < self.settings.max_vertices;
            let goes_on = more && walk.scatter(&vertex, u.lobe).is_some();
            if more && self.settings.strategies.connects() && !vertex.is_delta() {
                vertices.push(vertex);
            }
            if !goes_on || (n >= self.settings.roulette_start && walk.survive(u.roulette).is_none())
            {
                return;
            }
        }
    }

    /// Walks a camera path: the sum of all contributions that end at its vertices.
    fn camera_path<O: PathObserver>(
        &self,
        pixel: UVec2,
        light: &[Vertex],
        observer: &mut O,
    ) -> Rgb {
        let View { scene, sensor, .. } = *self.view;
        let strategies = self.settings.strategies;
        let mut stream = self.camera.stream(pixel, self.sample);
        let ray = sensor.ray(pixel.as_vec2() + stream.film());
        let (pdf, parallel) = sensor.pdf(ray.dir);
        let mut walk = Walk {
            scene,
            origin: Origin::Camera,
            ray,
            throughput: Rgb::ONE,
            partial: Partial::camera(pdf, self.paths as f32),
            parallel,
            roulette_scale: 1.0,
            bodies: self
                .around_camera
                .unwrap_or_else(|| EnclosingBodies::around(scene, &ray)),
        };
        let mut total = Rgb::ZERO;
        observer.begin(pixel, self.sample);
        for n in 1..=self.settings.max_vertices + 1 {
            let Some(hit) = walk.arrive() else {
                total += self.environment(&walk, n);
                break;
            };
            let u = stream.vertex();
            let vertex = walk.vertex(n, &hit, u.material);
            total += self.emitter(&vertex);
            if n > self.settings.max_vertices {
                break;
            }
            if n == 1 {
                observer.vertex(n, hit.0.t, &point(&walk, &vertex));
            }
            if strategies.connects() && !vertex.is_delta() {
                total += self.sampled_light(&vertex, u.light);
                for other in light {
                    if n + other.n > self.settings.max_vertices {
                        break;
                    }
                    total += self.connection(&vertex, other);
                }
            }
            match walk.scatter(&vertex, u.lobe) {
                Some(smooth) if strategies.connects() || !smooth => {}
                _ => break,
            }
            if n >= self.settings.roulette_start && walk.survive(u.roulette).is_none() {
                break;
            }
        }
        observer.finish(total);
        total
    }
}

/// The first vertex of a camera walk as observers see it.
fn point<'a>(walk: &Walk<'a>, vertex: &Vertex) -> ShadingPoint<'a> {
    ShadingPoint {
        scene: walk.scene,
        surface: vertex.surface,
        frame: vertex.frame,
        bsdf: vertex.bsdf,
        wo: vertex.local,
        alpha: vertex.alpha,
        alpha_reg: vertex.alpha,
        throughput: vertex.throughput,
        bodies: vertex.bodies,
    }
}
