//! Rendering: the path-tracing loop, who listens to it, and the methods that a user can choose from.
//!
//! A [`Method`] says how to regularise; [`Settings::integrator`] turns it into an [`Integrator`], the one place with
//! dynamic dispatch (one call a pass). Everything below is monomorphised: plain path tracing compiles to a loop
//! that has never heard of a table.

pub mod aov;
pub mod census;
pub mod checkpoint;
pub mod drive;
pub mod path;
pub mod walk;

use crate::image::film::Film;
use crate::math::Vec2;
use crate::regularise::rules::{FilterGlossy, Mollifier, PbrtRegularize, RoughnessClamp};
use crate::regularise::{Accumulated, AttenuationTable, ConstantGamma, Regulariser, Unregularised};
use crate::sampler::{Domain, Independent, SampleSource, Sampler, Seed};
use crate::scene::{Camera, Scene};
pub use aov::FirstHit;
pub use census::Census;
pub use path::PathTracer;
use rayon::prelude::*;
use std::ops::Range;
pub use walk::observer::{Event, PathObserver, Recorder, Technique, Vertex};

/// Pixels a side of the tiles that threads take: small enough that all cores stay busy to the end.
const TILE: u32 = 16;

/// How the last vertex of a path is roughened.
#[derive(Clone, Debug, PartialEq)]
pub enum Method {
    /// Not at all.
    Plain,
    /// Accumulated roughness with one attenuation factor.
    Constant {
        /// γ in [0, 1].
        gamma: f32,
        /// Whether the path goes on with the regularised lobe.
        reuse: bool,
        /// λ of the consistent variant, 0 for the fixed one.
        lambda: f32,
    },
    /// Accumulated roughness with learned attenuation factors.
    Table {
        /// The factors.
        table: AttenuationTable,
        /// Whether the path goes on with the regularised lobe.
        reuse: bool,
        /// λ of the consistent variant, 0 for the fixed one.
        lambda: f32,
    },
    /// pbrt-v4's `regularize`.
    Pbrt,
    /// Cycles' "filter glossy" with this filter value.
    FilterGlossy(f32),
    /// No lobe sharper than the roughest before it.
    RoughnessClamp,
    /// Kaplanyan and Dachsbacher's mollifier with this first radius over half the diagonal of the scene.
    Mollifier(f32),
}

/// What makes a picture, apart from the scene, the camera and the number of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// How to regularise.
    pub method: Method,
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Russian roulette begins after this many vertices.
    pub roulette_start: u32,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::Plain,
            max_vertices: 16,
            roulette_start: 5,
            seed: 0,
        }
    }
}

/// What a render makes.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// The moments of every pixel.
    pub film: Film,
    /// Albedo, normal and depth, where they are wanted.
    pub aovs: Option<FirstHit>,
}

/// Something that adds independent estimates to a film.
pub trait Integrator: Send + Sync {
    /// Adds the samples with these numbers to every pixel of the film's window, and to the AOVs if they are wanted.
    ///
    /// Samples depend on their pixel and number only: passes in any split and at any number of threads give the
    /// same film to the bit.
    fn pass(&self, scene: &Scene, camera: &Camera, samples: Range<u32>, picture: &mut Picture);

    /// Counts the vertices of the paths with these sample numbers through the window of `film`, which stays as it is.
    fn census(&self, scene: &Scene, camera: &Camera, samples: Range<u32>, film: &Film) -> Census;
}

impl Settings {
    /// The integrator of these settings.
    pub fn integrator(&self) -> Box<dyn Integrator> {
        match &self.method {
            Method::Plain => self.with(Unregularised),
            &Method::Constant {
                gamma,
                reuse,
                lambda,
            } => self.accumulated(ConstantGamma(gamma), reuse, lambda),
            Method::Table {
                table,
                reuse,
                lambda,
            } => self.accumulated(table.clone(), *reuse, *lambda),
            Method::Pbrt => self.with(PbrtRegularize),
            &Method::FilterGlossy(filter) => self.with(FilterGlossy { filter }),
            Method::RoughnessClamp => self.with(RoughnessClamp),
            &Method::Mollifier(radius) => self.with(Mollifier { radius }),
        }
    }

    fn accumulated<A: crate::regularise::Attenuation + Send + 'static>(
        &self,
        attenuation: A,
        reuse: bool,
        lambda: f32,
    ) -> Box<dyn Integrator> {
        if reuse {
            self.with(Accumulated::<A, true> {
                attenuation,
                lambda,
            })
        } else {
            self.with(Accumulated::<A, false> {
                attenuation,
                lambda,
            })
        }
    }

    fn with<R: Regulariser + Send + 'static>(&self, regulariser: R) -> Box<dyn Integrator> {
        Box::new(Rendering {
            tracer: self.tracer(regulariser),
            seed: self.seed,
        })
    }

    /// The path tracer of these settings with a rule of the caller's.
    pub fn tracer<R>(&self, regulariser: R) -> PathTracer<R> {
        PathTracer {
            max_vertices: self.max_vertices,
            roulette_start: self.roulette_start,
            regulariser,
        }
    }
}

/// A path tracer and its seed.
struct Rendering<R> {
    tracer: PathTracer<R>,
    seed: u64,
}

impl<R: Regulariser + Send> Integrator for Rendering<R> {
    fn pass(&self, scene: &Scene, camera: &Camera, samples: Range<u32>, picture: &mut Picture) {
        let (tracer, seed) = (&self.tracer, self.seed);
        if scene.has_lobes() {
            tracer.picture(scene, camera, seed, samples, picture);
        } else {
            // Nothing to roughen: no path need remember what it met.
            let tracer = tracer.with(Unregularised);
            tracer.picture(scene, camera, seed, samples, picture);
        }
    }

    fn census(&self, scene: &Scene, camera: &Camera, samples: Range<u32>, film: &Film) -> Census {
        let source = Independent {
            seed: Seed(self.seed).derive(Domain::Camera, 0),
        };
        let mut census = Census::default();
        let mut film = film.clone();
        self.tracer
            .estimate(scene, camera, &source, samples, &mut film, &mut census);
        census
    }
}

impl<R> PathTracer<R> {
    /// The same with another rule.
    fn with<Q>(&self, regulariser: Q) -> PathTracer<Q> {
        PathTracer {
            max_vertices: self.max_vertices,
            roulette_start: self.roulette_start,
            regulariser,
        }
    }
}

impl<R: Regulariser> PathTracer<R> {
    fn picture(
        &self,
        scene: &Scene,
        camera: &Camera,
        seed: u64,
        samples: Range<u32>,
        picture: &mut Picture,
    ) {
        let source = Independent {
            seed: Seed(seed).derive(Domain::Camera, 0),
        };
        let Picture { film, aovs } = picture;
        match aovs {
            Some(aovs) => self.estimate(scene, camera, &source, samples, film, aovs),
            None => self.estimate(scene, camera, &source, samples, film, &mut ()),
        }
    }

    /// Adds the samples with these numbers to every pixel of the film's window; tiles in parallel, joined in order.
    pub fn estimate<Q: SampleSource, O: Recorder>(
        &self,
        scene: &Scene,
        camera: &Camera,
        source: &Q,
        samples: Range<u32>,
        film: &mut Film,
        recorder: &mut O,
    ) {
        let tiles: Vec<(Film, O)> = film
            .tiles(TILE)
            .into_par_iter()
            .map(|window| {
                let mut tile = film.cut(window);
                let mut observer = recorder.fork();
                self.tile(
                    scene,
                    camera,
                    source,
                    samples.clone(),
                    &mut tile,
                    &mut observer,
                );
                (tile, observer)
            })
            .collect();
        for (tile, observer) in tiles {
            film.paste(&tile);
            recorder.join(observer);
        }
    }

    fn tile<Q: SampleSource, O: PathObserver>(
        &self,
        scene: &Scene,
        camera: &Camera,
        source: &Q,
        samples: Range<u32>,
        tile: &mut Film,
        observer: &mut O,
    ) {
        let size = tile.size.as_vec2();
        let aspect = size.x / size.y;
        for index in 0..tile.pixels.len() {
            let pixel = tile.pixel(index);
            for sample in samples.clone() {
                let mut stream = source.stream(pixel, sample);
                let film = (pixel.as_vec2() + stream.film()) / size;
                observer.begin(pixel, sample);
                let ray = camera.ray(Vec2::new(film.x, film.y), aspect);
                let value = self.radiance(scene, ray, sample, &mut stream, observer);
                tile.push(index, value, sample);
            }
        }
    }
}
