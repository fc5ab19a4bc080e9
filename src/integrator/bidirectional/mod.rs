//! Bidirectional transport: every light path is connected to the camera and to every vertex of a camera path, or merges
//! with the camera paths that come near it.
//!
//! One iteration is one sample a pixel. It walks one light path per pixel of the *full* frame, at most [`MAX_LIGHT_PATHS`],
//! and connects the camera path of pixel p to light path p mod N. Light paths depend on the seed, their number and the
//! iteration only: any thread count, split into passes, and crop give bit-identical pixels. Without merging a light path
//! and the camera paths that it serves are walked together, so that no light vertex outlives them; with merging all
//! light vertices of an iteration are kept and sorted into a grid before the first camera path. Splats are added in the
//! order of their light paths.
//!
//! | file | contents |
//! |---|---|
//! | `aim` | where light paths are sent: at what throws caustics, and at what the camera sees |
//! | [`weights`] | multiple importance sampling over all strategies: pure recursions |
//! | `vertex` | a scattering vertex: its value, and the densities of both walks |
//! | `walk` | one walk from either end: edges, draws, running numbers |
//! | `guides` | what a camera path tells for blurs of the picture |
//! | `connect` | the ways to close a path by an edge: value, then weight, then shadow ray |
//! | `photons` | light vertices that are kept, and the grid over them |
//! | `pair` | one light path and one camera path alone, for Markov chains |
//! | `merge` | paths closed by a merge, and photon density estimation |
//! | `radius` | the radius of merges |
//! | `psr` | paths that no strategy can sample, regularised |
//! | `split` | learned roughening where no strategy is good |

mod aim;
#[cfg(test)]
#[path = "../../../tests/unit/audit/mod.rs"]
mod audit;
mod connect;
mod guides;
mod merge;
mod pair;
mod photons;
mod psr;
mod radius;
mod split;
mod vertex;
mod walk;
pub mod weights;

use super::walk::camera::CameraWalks;
use super::walk::observer::{PathObserver, Recorder};
use super::walk::shading_point::ShadingPoint;
use super::{Integrator, Picture, View};
use crate::image::film::{Film, Window};
use crate::image::level_film::{LevelFilm, PathLevels};
use crate::image::splat::{Splat, SplatLayer};
use crate::math::{Rgb, UVec2};
use crate::regularise::Accumulated;
use crate::sampler::{Domain, Independent, IndependentStream, SampleSource, Sampler, Seed};
use crate::scene::Aim;
use crate::scene::sensor::RayDensity;
pub use aim::Aimed;
use guides::Guides;
use merge::Densities;
pub(super) use pair::Pairs;
use photons::{LightVertices, PhotonMap};
use psr::{Chain, Ends};
pub use radius::Radius;
use rayon::prelude::*;
use split::Trail;
use std::f32::consts::PI;
use std::fmt;
use std::ops::Range;
use vertex::Vertex;
use walk::{Onward, WeightedWalk};
use weights::{Merging, Partial};

/// Most light paths of an iteration.
pub const MAX_LIGHT_PATHS: u32 = 1 << 20;

/// Paths that a thread takes at a time.
const CHUNK: u32 = 1024;

/// Chunks of light paths that are walked before their vertices are joined: few enough to hold little twice.
const BATCH: u32 = 32;

/// Vertices by which roulette of light walks begins earlier: every vertex of theirs is connected to all of a camera walk.
const EARLIER: u32 = 3;

/// Share of what a camera path has found so far below which a connection is left to chance: most shadow rays would find
/// hardly any light.
const MIN_SHARE: f32 = 0.1;

/// The strategies that count, and their weights. Strategy (s, t) takes s vertices of a path from the light walk and t
/// from the camera walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategies {
    /// All, by the balance heuristic.
    All,
    /// Light tracing: t = 1, and lights met by the camera walk before its first smooth draw; weight 1.
    Light,
    /// Photon density: merges at the first rough lobe of a camera walk, and lights met before it; weight 1.
    Density,
    /// One of all, with the weights that it has there: the pictures of all add up to the whole.
    One(Strategy),
    /// One strategy with weight 1, for tests.
    Only {
        /// Vertices of the light walk, the light's own included.
        s: u32,
        /// Vertices of the camera walk, the camera's own included.
        t: u32,
    },
}

/// A strategy, or all merges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// Strategy (s, t).
    Connection {
        /// Vertices of the light walk, the light's own included.
        s: u32,
        /// Vertices of the camera walk, the camera's own included.
        t: u32,
    },
    /// All merges.
    Merges,
}

impl fmt::Display for Strategy {
    /// As `--strategy` takes it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Connection { s, t } => write!(f, "{s},{t}"),
            Self::Merges => f.write_str("merges"),
        }
    }
}

/// A bidirectional path tracer, or one of its strategies.
#[derive(Clone, Debug)]
pub struct Bidirectional {
    /// The strategies that count.
    pub strategies: Strategies,
    /// The radius of merges; `None` for connections only.
    pub merging: Option<Radius>,
    /// Factors on that radius at which [`Strategies::Density`] counts the same photons, ascending from 1; empty for the radius
    /// alone.
    pub radii: Vec<f32>,
    /// True if the picture is kept in batches, with guides for its blur.
    pub batched: bool,
    /// No connections but light samples, beside merges.
    pub light_sampling_only: bool,
    /// Radius of the kernel for paths that no strategy can sample, over half the diagonal of the scene: that of sample 1,
    /// for sample n times n^(−1/6) `[PSR (6)]`. Without merging only.
    pub mollifier: Option<f32>,
    /// Accumulated roughness of the last vertex, where no strategy finds the path well. With [`Strategies::Only`] the
    /// picture lacks what is roughened.
    pub split: Option<Accumulated>,
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Vertex (from 1) at which Russian roulette of camera walks begins, that of light walks three before.
    pub roulette_start: u32,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Where light was aimed in the last view.
    pub aimed: Aimed,
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
            Self::All | Self::One(_) => balance(),
            Self::Light => f32::from(u8::from(t == 1 || s == 0)),
            Self::Density => f32::from(u8::from(s == 0)),
            Self::Only { s: s1, t: t1 } => f32::from(u8::from((s, t) == (s1, t1))),
        }
    }

    /// True if camera walks are closed by light sampling and connections.
    fn connects(self) -> bool {
        matches!(self, Self::All | Self::One(_) | Self::Only { .. })
    }

    /// True if the picture shows this part of what is computed.
    #[inline]
    fn shows(self, strategy: Strategy) -> bool {
        match self {
            Self::One(shown) => shown == strategy,
            _ => true,
        }
    }
}

impl Integrator for Bidirectional {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32 {
        let mut layer = SplatLayer::new(&view.window);
        let first = self.merging.map(|radius| radius.first(view));
        let aim = self.aim(view);
        for sample in samples.clone() {
            let iteration = self.iteration(view, &aim, sample, first);
            if !self.radii.is_empty() {
                iteration.add_radii(&self.radii, picture);
                if view.is_cut() {
                    return sample - samples.start;
                }
                view.begun();
                continue;
            }
            let Picture { film, aovs, levels } = &mut *picture;
            let done = if self.batched {
                let mut guides = Guides::new(view.window, aovs.take());
                let done = iteration.run(&mut layer, &mut guides);
                if !view.drops_pass() {
                    let blank = || LevelFilm::new(film.size, film.window, 1);
                    guides.push(sample, &layer, levels.get_or_insert_with(blank));
                }
                *aovs = guides.aovs();
                done
            } else if let Some(aovs) = aovs {
                iteration.run(&mut layer, aovs)
            } else {
                iteration.run(&mut layer, &mut ())
            };
            if view.drops_pass() {
                return sample - samples.start;
            }
            for (index, value) in layer.take().enumerate() {
                if done.as_ref().is_none_or(|done| done[index]) {
                    film.push_shared(index, value, sample);
                }
            }
            if view.is_cut() {
                return sample - samples.start;
            }
            view.begun();
        }
        samples.end - samples.start
    }

    fn prepare(&self, view: &View<'_>) {
        self.aim(view);
    }

    fn shares_light(&self) -> bool {
        true
    }

    fn notes(&self, view: &View<'_>) -> Option<String> {
        let first = self.merging?.first(view);
        let aim = self.aim(view);
        let iteration = self.iteration(view, &aim, 0, Some(first));
        let some = iteration.light_chunk(0..iteration.paths.min(CHUNK));
        let bytes = some.vertices.bytes_per_path() * iteration.paths as usize;
        Some(format!(
            "first radius {first:e}; light vertices take about {} MB",
            bytes.div_ceil(1_000_000)
        ))
    }
}

/// A light path, as a camera path needs it.
#[derive(Default)]
struct LightPath {
    vertices: Vec<Vertex>,
    trails: Vec<Trail>,
    ends: Ends,
}

/// Light paths of a chunk.
struct LightChunk {
    vertices: LightVertices,
    splats: Vec<Splat>,
}

/// Contributions of a camera path.
struct Total {
    strategies: Strategies,
    /// Sum of the strategies that were computed.
    all: Rgb,
    /// Sum of the strategies that the picture shows.
    shown: Rgb,
}

impl Total {
    fn of(strategies: Strategies) -> Self {
        Self {
            strategies,
            all: Rgb::ZERO,
            shown: Rgb::ZERO,
        }
    }

    #[inline]
    fn add(&mut self, strategy: Strategy, value: Rgb) {
        self.all += value;
        if self.strategies.shows(strategy) {
            self.shown += value;
        }
    }

    /// Adds what belongs to no strategy.
    #[inline]
    fn show(&mut self, value: Rgb) {
        self.all += value;
        self.shown += value;
    }
}

/// Scene, settings and radius of one iteration, shared by the threads.
#[derive(Clone, Copy)]
struct Iteration<'a> {
    settings: &'a Bidirectional,
    strategies: Strategies,
    view: &'a View<'a>,
    /// Where light is aimed.
    aim: &'a Aim,
    /// Number of the iteration.
    sample: u32,
    /// Number of light paths.
    paths: u32,
    /// Radius of merges; 0 without.
    radius: f32,
    /// Merging weights of camera walks, and of light walks below.
    merging: Merging<f32>,
    light_merging: Merging<f32>,
    /// Radius of the kernel in world units; `None` where all lights can be met too.
    mollifier: Option<f32>,
    /// Accumulated roughness, in scenes that have glossy lobes.
    rule: Option<&'a Accumulated>,
    light: Independent,
    camera: Independent,
    camera_walks: CameraWalks<'a>,
    probes: Independent,
}

impl Bidirectional {
    /// Iteration number `sample`; `first` is the radius of merges in iteration 0.
    fn iteration<'a>(
        &'a self,
        view: &'a View<'a>,
        aim: &'a Aim,
        sample: u32,
        first: Option<f32>,
    ) -> Iteration<'a> {
        let frame = view.sensor.frame;
        let pixels = u64::from(frame.x) * u64::from(frame.y);
        let paths = pixels.min(u64::from(MAX_LIGHT_PATHS)) as u32;
        let source = |domain| Independent {
            seed: Seed(self.seed).derive(domain, 0),
        };
        let radius = (self.merging.zip(first)).map_or(0.0, |(r, first)| r.at(first, sample));
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
            merging,
            light_merging,
            mollifier,
            rule: self.split.as_ref().filter(|_| view.scene.has_lobes()),
            light: source(Domain::Light),
            camera: source(Domain::Camera),
            camera_walks: CameraWalks::of(view),
            probes: source(Domain::Probes),
        }
    }
}

impl Iteration<'_> {
    /// Adds one sample of every pixel to the layer, which holds a value a pixel of the window. Without use if it is stopped, but for
    /// the first sample of all: then the pixels that have one, where not all do.
    ///
    /// All pixels share the light paths. Those that were walked before the end stand for all: their splats and photons count
    /// more, and a pixel has a sample if its camera path was walked. So what there is of it is right in the mean.
    fn run<O: Recorder>(&self, layer: &mut SplatLayer, recorder: &mut O) -> Option<Vec<bool>> {
        if self.settings.merging.is_some() {
            let vertices = self.light_vertices(layer);
            let walked = vertices.paths();
            if self.view.drops_pass() || walked == 0 {
                return Some(vec![false; self.view.window.len()]);
            }
            self.scale_splats(layer, walked);
            let low = self.view.scene.geometry().bounds().0;
            let map = PhotonMap::new(vertices, low, self.radius);
            self.view.shared_work_is_done();
            self.camera_paths(&map, layer, recorder)
        } else {
            self.paths_together(layer, recorder)
        }
    }

    /// Lets the splats of so many light paths stand for those of all.
    fn scale_splats(&self, layer: &mut SplatLayer, walked: u32) {
        if walked > 0 && walked < self.paths {
            layer.scale(f64::from(self.paths) / f64::from(walked));
        }
    }

    /// Light paths and camera paths, chunk by chunk; the pixels that have a sample, where not all do.
    fn paths_together<O: Recorder>(
        &self,
        layer: &mut SplatLayer,
        recorder: &mut O,
    ) -> Option<Vec<bool>> {
        let chunks: Vec<(u32, Chunk<O>)> = (0..self.paths.div_ceil(CHUNK))
            .into_par_iter()
            .filter(|chunk| !self.view.leaves_out(*chunk))
            .map(|chunk| {
                let range = self.range(chunk);
                (range.len() as u32, self.chunk(range, recorder.fork()))
            })
            .collect();
        if self.view.drops_pass() {
            return None;
        }
        let walked = chunks.iter().map(|(paths, _)| paths).sum();
        if walked == self.paths {
            for (_, chunk) in chunks {
                layer.add_in_order(&chunk.camera);
                layer.add_in_order(&chunk.splats);
                recorder.join(chunk.observer);
            }
            return None;
        }
        let mut done = vec![false; self.view.window.len()];
        for (_, chunk) in &chunks {
            layer.add_in_order(&chunk.splats);
        }
        self.scale_splats(layer, walked);
        for (_, chunk) in chunks {
            layer.add_in_order(&chunk.camera);
            let pixels = chunk.camera.iter().map(|splat| splat.index as usize);
            pixels.for_each(|index| done[index] = true);
            recorder.join(chunk.observer);
        }
        Some(done)
    }

    /// Light paths of a chunk.
    fn range(&self, chunk: u32) -> Range<u32> {
        let first = chunk * CHUNK;
        first..(first + CHUNK).min(self.paths)
    }

    /// All light paths: their splats go to the layer, their vertices are kept.
    fn light_vertices(&self, layer: &mut SplatLayer) -> LightVertices {
        let mut vertices = LightVertices::default();
        let chunks = self.paths.div_ceil(CHUNK);
        for first in (0..chunks).step_by(BATCH as usize) {
            let batch: Vec<LightChunk> = (first..(first + BATCH).min(chunks))
                .into_par_iter()
                .filter(|chunk| !self.view.leaves_out_shared(*chunk))
                .map(|chunk| self.light_chunk(self.range(chunk)))
                .collect();
            for chunk in batch {
                layer.add_in_order(&chunk.splats);
                vertices.append(chunk.vertices);
            }
        }
        vertices
    }

    fn light_chunk(&self, paths: Range<u32>) -> LightChunk {
        let mut chunk = LightChunk {
            vertices: LightVertices::default(),
            splats: Vec::new(),
        };
        let shares = self.view.scene.geometry().instances() > 0;
        for path in paths {
            let keep = |v, trail| (chunk.vertices).push(&v, shares, self.rule.map(|_| trail));
            let stream = &mut self.light_stream(path);
            self.light_path(stream, keep, &mut Ends::default(), &mut chunk.splats);
            chunk.vertices.end();
        }
        chunk
    }

    /// All camera paths of the window; the pixels that have one, where not all do.
    fn camera_paths<O: Recorder>(
        &self,
        map: &PhotonMap,
        layer: &mut SplatLayer,
        recorder: &mut O,
    ) -> Option<Vec<bool>> {
        let window = self.view.window;
        let pixels = window.len() as u32;
        let chunks: Vec<(Vec<Splat>, O)> = (0..pixels.div_ceil(CHUNK))
            .into_par_iter()
            .filter(|chunk| !self.view.leaves_out(*chunk))
            .map(|chunk| {
                let mut observer = recorder.fork();
                let mut light = LightPath::default();
                let indices = chunk * CHUNK..(chunk * CHUNK + CHUNK).min(pixels);
                let value = |index: u32| {
                    let pixel =
                        UVec2::new(window.x + index % window.w, window.y + index / window.w);
                    let value = if self.strategies == Strategies::Density {
                        self.density_path(pixel, map, &mut observer)
                    } else {
                        if !self.settings.light_sampling_only {
                            self.fetch(pixel, map, &mut light);
                        }
                        let stream = &mut self.camera_stream(pixel);
                        self.camera_path(pixel, stream, &light, Some(map), &mut observer)
                    };
                    Splat { index, value }
                };
                (indices.map(value).collect(), observer)
            })
            .collect();
        if self.view.drops_pass() {
            return None;
        }
        let all = chunks.iter().map(|(values, _)| values.len()).sum::<usize>() == window.len();
        let mut done = (!all).then(|| vec![false; window.len()]);
        for (values, observer) in chunks {
            layer.add_in_order(&values);
            let pixels = values.iter().map(|splat| splat.index as usize);
            if let Some(done) = &mut done {
                pixels.for_each(|index| done[index] = true);
            }
            recorder.join(observer);
        }
        done
    }

    /// Adds one sample of every pixel of photon density at several radii: the first to the film, all to its levels. Of the first
    /// sample of all, if it is stopped, the pixels that have one; else nothing.
    fn add_radii(&self, factors: &[f32], picture: &mut Picture) {
        let Picture { film, aovs, levels } = picture;
        let levels =
            levels.get_or_insert_with(|| LevelFilm::new(film.size, film.window, factors.len()));
        let vertices = self.light_vertices(&mut SplatLayer::new(&Window {
            w: 0,
            ..film.window
        }));
        if self.view.drops_pass() || vertices.paths() == 0 {
            return;
        }
        let radii: Vec<f32> = factors.iter().map(|factor| self.radius * factor).collect();
        let low = self.view.scene.geometry().bounds().0;
        let map = PhotonMap::new(vertices, low, radii[radii.len() - 1]);
        self.view.shared_work_is_done();
        match aovs {
            Some(aovs) => self.density_at(&map, &radii, (film, levels), aovs),
            None => self.density_at(&map, &radii, (film, levels), &mut ()),
        }
    }

    /// The camera paths of [`Iteration::add_radii`].
    fn density_at<O: Recorder>(
        &self,
        map: &PhotonMap,
        radii: &[f32],
        (film, levels): (&mut Film, &mut LevelFilm),
        recorder: &mut O,
    ) {
        let window = self.view.window;
        let pixels = window.len() as u32;
        let chunks: Vec<(u32, Vec<Densities>, O)> = (0..pixels.div_ceil(CHUNK))
            .into_par_iter()
            .filter(|chunk| !self.view.leaves_out(*chunk))
            .map(|chunk| {
                let mut observer = recorder.fork();
                let first = chunk * CHUNK;
                let indices = first..(first + CHUNK).min(pixels);
                let path = |index: u32| {
                    let pixel = window.pixel(index as usize);
                    self.density_paths(pixel, map, radii, &mut observer)
                };
                (first, indices.map(path).collect(), observer)
            })
            .collect();
        if self.view.drops_pass() {
            return;
        }
        for (first, paths, observer) in chunks {
            for (index, path) in (first as usize..).zip(&paths) {
                film.push_shared(index, path.levels[0], self.sample);
                let values = PathLevels {
                    levels: &path.levels[..radii.len()],
                    shared: path.shared,
                    features: path.features,
                };
                levels.push(index, self.sample, &values);
            }
            recorder.join(observer);
        }
    }

    /// The light path to which the camera path of a pixel is connected, from those that are kept.
    fn fetch(&self, pixel: UVec2, map: &PhotonMap, light: &mut LightPath) {
        let columns = u64::from(self.view.sensor.frame.x);
        let number = u64::from(pixel.y) * columns + u64::from(pixel.x);
        let path = (number % u64::from(map.paths())) as u32;
        let most = self.settings.max_vertices - 1;
        let LightPath {
            vertices, trails, ..
        } = light;
        map.of_path(path, most, self.view.scene, vertices, trails);
    }

    /// A range of light paths and the camera paths that they serve.
    fn chunk<O: PathObserver>(&self, paths: Range<u32>, observer: O) -> Chunk<O> {
        let mut chunk = Chunk {
            camera: Vec::new(),
            splats: Vec::new(),
            observer,
        };
        let mut light = LightPath::default();
        let [columns, rows] = self.view.sensor.frame.to_array().map(u64::from);
        let pixels = columns * rows;
        for path in paths {
            self.whole_light_path(&mut self.light_stream(path), &mut light, &mut chunk.splats);
            for index in (u64::from(path)..pixels).step_by(self.paths as usize) {
                let pixel = UVec2::new((index % columns) as u32, (index / columns) as u32);
                if let Some(mut splat) = Splat::new(&self.view.window, pixel, Rgb::ZERO) {
                    let stream = &mut self.camera_stream(pixel);
                    splat.value =
                        self.camera_path(pixel, stream, &light, None, &mut chunk.observer);
                    chunk.camera.push(splat);
                }
            }
        }
        chunk
    }

    /// Random numbers of a light path.
    fn light_stream(&self, path: u32) -> IndependentStream {
        self.light.stream(UVec2::new(path, 0), self.sample)
    }

    /// Random numbers of a camera path.
    fn camera_stream(&self, pixel: UVec2) -> IndependentStream {
        self.camera.stream(pixel, self.sample)
    }

    /// Walks a light path and keeps all that one camera path needs of it.
    fn whole_light_path(
        &self,
        stream: &mut impl Sampler,
        light: &mut LightPath,
        splats: &mut Vec<Splat>,
    ) {
        let LightPath {
            vertices,
            trails,
            ends,
        } = light;
        vertices.clear();
        trails.clear();
        ends.clear();
        let keep = |v, trail| {
            vertices.push(v);
            trails.push(trail);
        };
        self.light_path(stream, keep, ends, splats);
    }

    /// Walks a light path: connects its vertices to the camera, and keeps those that a camera walk can use.
    fn light_path(
        &self,
        stream: &mut impl Sampler,
        mut keep: impl FnMut(Vertex, Trail),
        ends: &mut Ends,
        splats: &mut Vec<Splat>,
    ) {
        let strategies = self.strategies;
        let scene = self.view.scene;
        let (pick, u) = (
            stream.next_pick(),
            std::array::from_fn(|_| stream.next_1d()),
        );
        let Some(start) = scene.sample_emission(self.aim, pick, u) else {
            return;
        };
        let mut walk = WeightedWalk::light(scene, &start, self.light_merging);
        let mut chain = Chain::default();
        let mut trail = Trail::START;
        for n in 1..=self.settings.max_vertices {
            let Some(arrival) = walk.arrive(stream) else {
                return;
            };
            if walk.first {
                walk.base.throughput *= walk.window(&start, arrival.hit.t);
            }
            let u = stream.vertex();
            let vertex = walk.vertex(n, &arrival, u.material);
            if strategies != Strategies::Density
                && !self.settings.light_sampling_only
                && !vertex.is_delta()
                && strategies.shows(Strategy::Connection { s: n + 1, t: 1 })
                && let Some(splat) = self.connect_to_camera(&vertex, &trail)
            {
                splats.push(splat);
            }
            let more = n < self.settings.max_vertices;
            let drawn = if more || self.mollifier.is_some() {
                walk.scatter(&vertex, u.lobe)
            } else {
                None
            };
            self.note_light(
                &start,
                &walk,
                &vertex,
                walk.length,
                drawn,
                (&mut chain, ends, splats),
            );
            let merges = self.settings.merging.is_some();
            // The camera walk that merges draws one of two BSDFs on its own: that of the light walk does not matter.
            let merged = merges && (!vertex.is_delta() || vertex.chooses_bsdf(scene));
            let connected = more && strategies.connects() && !vertex.is_delta();
            if merged || connected {
                keep(vertex, trail);
            }
            if let Some(smooth) = drawn.and_then(Onward::smooth) {
                trail = self.trail(trail, &vertex, walk.dir(), smooth);
            }
            let goes_on = more && drawn.is_some();
            if !goes_on
                || (n + EARLIER >= self.settings.roulette_start
                    && walk.survive(u.roulette).is_none())
            {
                return;
            }
        }
    }

    /// A camera walk through a pixel.
    fn camera_walk(&self, pixel: UVec2, stream: &mut impl Sampler) -> WeightedWalk<'_> {
        let base = self.camera_walks.start(pixel, stream);
        let RayDensity { pdf, parallel } = self.view.sensor.pdf(base.ray.dir);
        let partial = Partial::camera(pdf, self.paths as f32);
        WeightedWalk {
            base,
            partial,
            merging: self.merging,
            parallel,
            light: None,
            first: true,
            travelled: 0.0,
            length: 0.0,
            start: partial,
        }
    }

    /// Walks a camera path: the sum of all contributions that end at its vertices.
    fn camera_path<O: PathObserver>(
        &self,
        pixel: UVec2,
        stream: &mut impl Sampler,
        light: &LightPath,
        map: Option<&PhotonMap>,
        observer: &mut O,
    ) -> Rgb {
        let strategies = self.strategies;
        let mut walk = self.camera_walk(pixel, stream);
        let mut chain = Chain::default();
        let mut prefix = self.prefix();
        let mut probes = self.probe_stream(pixel);
        let mut total = Total::of(strategies);
        // True up to the first draw from a smooth lobe.
        let mut is_seen = true;
        observer.begin(pixel, self.sample);
        for n in 1..=self.settings.max_vertices + 1 {
            let edge = |s| Strategy::Connection { s, t: n + 1 };
            let Some(arrival) = walk.arrive(stream) else {
                let met = prefix.met * self.environment(&walk, n);
                total.add(edge(0), met);
                if is_seen {
                    observer.seen(met);
                }
                break;
            };
            let u = stream.vertex();
            let vertex = walk.vertex(n, &arrival, u.material);
            let met = prefix.met * self.emitter(&walk, &vertex);
            total.add(edge(0), met);
            if is_seen {
                observer.seen(met);
            }
            if n > self.settings.max_vertices {
                break;
            }
            observer.vertex(n, arrival.hit.t, &point(&walk, &vertex));
            let share = prefix.share(&vertex);
            if strategies.connects() && !vertex.is_delta() {
                total.add(edge(1), self.sampled_light(&vertex, u.light, share));
                let least = MIN_SHARE * total.all.max_element();
                for (other, trail) in light.vertices.iter().zip(&light.trails) {
                    if n + other.n > self.settings.max_vertices {
                        break;
                    }
                    // Kept for merges alone.
                    if other.is_delta() {
                        continue;
                    }
                    let part = prefix.connected(&vertex, other, trail);
                    if part != Rgb::ZERO {
                        let u = (u.roulette + 0.618_034 * other.n as f32).fract();
                        let value = part * self.connection(&vertex, other, (least, u));
                        total.add(edge(other.n + 1), value);
                    }
                }
                if let Some(map) = map {
                    let value = self.merges(&vertex, &prefix, map, &mut probes);
                    total.add(Strategy::Merges, value);
                }
            }
            if strategies == Strategies::All {
                total.show(self.hard_part(&prefix, &vertex, share, &u));
            }
            let drawn = walk.scatter(&vertex, u.lobe);
            if let Some(smooth) = drawn.and_then(Onward::smooth) {
                is_seen &= !smooth;
                prefix.scatter(&vertex, walk.dir(), smooth, share);
            }
            let (ends, length) = ((&mut chain, &light.ends), walk.length);
            let value = self.regularised(&walk, &vertex, length, drawn, u.light, ends);
            total.show(value);
            match drawn {
                Some(drawn) if strategies.connects() || drawn != Onward::Smooth => {}
                _ => break,
            }
            if n >= self.settings.roulette_start && walk.survive(u.roulette).is_none() {
                break;
            }
        }
        observer.finish(total.shown);
        total.shown
    }
}

/// The first vertex of a camera walk as observers see it.
fn point<'a>(walk: &WeightedWalk<'a>, vertex: &'a Vertex) -> ShadingPoint<'a> {
    ShadingPoint {
        scene: walk.base.scene,
        surface: &vertex.surface,
        frame: vertex.frame,
        bsdf: &vertex.bsdf,
        wo: vertex.local,
        alpha: vertex.alpha,
        alpha_reg: vertex.alpha,
        throughput: vertex.throughput,
        around: &vertex.around,
        panes: 0,
    }
}
