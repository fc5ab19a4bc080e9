//! One sample of every pixel, cut into pieces: chunks of light paths, and of the camera paths connected to them.
//!
//! All pixels share the light paths. If the first sample is stopped, the splats and photons so far are scaled up to
//! stand for all, and a pixel has a sample if its camera path was traced. The expectation stays the same.

use super::iteration::Iteration;
use super::merge::Densities;
use super::path_features::PathFeatureRecorder;
use super::paths::LightPath;
use super::photons::{LightVertices, PhotonMap};
use super::psr::Ends;
use super::strategies::Strategies;
use crate::image::film::{Film, Window};
use crate::image::level_film::{LevelFilm, PathLevels};
use crate::image::splat::{Splat, SplatLayer};
use crate::integrator::Picture;
use crate::integrator::pieces::{Driver, Pieces};
use crate::integrator::walk::observer::{PathObserver, Recorder};
use crate::math::{Rgb, UVec2};
use std::ops::Range;
use std::sync::Mutex;

/// Paths that a thread takes at a time.
const CHUNK: u32 = 1024;

/// Chunks of light paths that are traced before their vertices are joined; few, since memory holds vertices twice then.
const BATCH: u32 = 32;

/// Light of one sample of the pixels of a window.
pub(super) struct SampleLayer {
    sums: SplatLayer,
    /// True for pixels whose camera path was traced.
    walked: Vec<bool>,
}

impl SampleLayer {
    pub(super) fn new(window: Window) -> Self {
        Self {
            sums: SplatLayer::new(&window),
            walked: vec![false; window.len()],
        }
    }

    /// Adds values of camera paths.
    fn add_camera(&mut self, values: &[Splat]) {
        self.sums.add_in_order(values, 1.0);
        for value in values {
            self.walked[value.index as usize] = true;
        }
    }

    /// Adds the sample to a film and empties the layer.
    fn take(&mut self, film: &mut Film, sample: u32) {
        for (index, value) in self.sums.take().enumerate() {
            if std::mem::take(&mut self.walked[index]) {
                film.push_shared(index, value, sample);
            }
        }
    }
}

/// Light paths of a chunk.
struct LightChunk {
    vertices: LightVertices,
    splats: Vec<Splat>,
}

/// Values of camera paths and splats of light paths, each in order.
#[derive(Default)]
struct PairedChunk {
    camera: Vec<Splat>,
    splats: Vec<Splat>,
}

impl Iteration<'_> {
    /// Adds one sample of every pixel to a picture, using an empty layer; `None` if the render was stopped and the
    /// films are unchanged.
    pub(super) fn add(&self, layer: &mut SampleLayer, picture: &mut Picture) -> Option<()> {
        let Picture { film, aovs, levels } = picture;
        if !self.settings.radii.is_empty() {
            let blank = || LevelFilm::new(film.size, film.window, self.settings.radii.len());
            let levels = levels.get_or_insert_with(blank);
            return match aovs {
                Some(aovs) => self.add_radii(film, levels, aovs),
                None => self.add_radii(film, levels, &mut ()),
            };
        }
        if self.settings.batched {
            let mut recorder = PathFeatureRecorder::new(self.view.window, aovs.take());
            let added = self.run(layer, &mut recorder);
            if added.is_some() {
                let blank = || LevelFilm::new(film.size, film.window, 1);
                let levels = levels.get_or_insert_with(blank);
                recorder.push(self.sample, &layer.sums, levels);
            }
            *aovs = recorder.aovs();
            added?;
        } else {
            match aovs {
                Some(aovs) => self.run(layer, aovs)?,
                None => self.run(layer, &mut ())?,
            }
        }
        layer.take(film, self.sample);
        Some(())
    }

    /// Vertices of the first light paths.
    pub(super) fn some_light_vertices(&self) -> LightVertices {
        self.light_chunk(0..self.paths.min(CHUNK)).vertices
    }

    /// Adds one sample of every pixel to a layer.
    fn run<O: Recorder>(&self, layer: &mut SampleLayer, recorder: &mut O) -> Option<()> {
        match self.settings.merging {
            Some(_) => {
                let map = self.photon_map(self.radius, &mut layer.sums)?;
                self.camera_paths(&map, layer, recorder)
            }
            None => self.paired_paths(layer, recorder),
        }
    }

    /// Traces light paths together with the camera paths connected to them.
    fn paired_paths<O: Recorder>(&self, layer: &mut SampleLayer, recorder: &mut O) -> Option<()> {
        let pieces = Pieces::new(self.paths, CHUNK);
        let driver = self.view.driver();
        let finished = driver.run_recorded(pieces, recorder, |paths, observer| {
            self.paired_chunk(paths, observer)
        })?;
        for (_, chunk) in finished.results {
            layer.add_camera(&chunk.camera);
            layer.sums.add_in_order(&chunk.splats, finished.factor);
        }
        Some(())
    }

    /// Traces a range of light paths and the camera paths connected to them.
    fn paired_chunk<O: PathObserver>(&self, paths: Range<u32>, observer: &mut O) -> PairedChunk {
        let mut chunk = PairedChunk::default();
        let mut light = LightPath::default();
        let [columns, rows] = self.view.sensor.frame.to_array().map(u64::from);
        let pixels = columns * rows;
        for path in paths {
            self.whole_light_path(&mut self.light_stream(path), &mut light, &mut chunk.splats);
            for index in (u64::from(path)..pixels).step_by(self.paths as usize) {
                let pixel = UVec2::new((index % columns) as u32, (index / columns) as u32);
                if let Some(mut splat) = Splat::new(&self.view.window, pixel, Rgb::ZERO) {
                    splat.value = self.camera_path(pixel, &light, None, observer);
                    chunk.camera.push(splat);
                }
            }
        }
        chunk
    }

    /// Traces all light paths: a map of their vertices for merges within a radius. Their splats are added to a layer.
    fn photon_map(&self, radius: f32, layer: &mut SplatLayer) -> Option<PhotonMap> {
        let pieces = Pieces::new(self.paths, CHUNK).in_batches(BATCH);
        self.view.driver().shared(|driver: &Driver<'_>| {
            let mut vertices = LightVertices::default();
            let walk = |paths| self.light_chunk(paths);
            let factor = driver.run_batches(pieces, walk, |_, chunk| {
                layer.add_in_order(&chunk.splats, 1.0);
                vertices.append(chunk.vertices, self.paths);
            })?;
            layer.scale(factor);
            let low = self.view.scene.geometry().bounds().0;
            Some(PhotonMap::new(vertices, low, radius))
        })
    }

    fn light_chunk(&self, paths: Range<u32>) -> LightChunk {
        let mut chunk = LightChunk {
            vertices: LightVertices::default(),
            splats: Vec::new(),
        };
        let scene = self.view.scene;
        for path in paths {
            let keep = |v, summary| (chunk.vertices).push(&v, scene, self.rule.map(|_| summary));
            let stream = &mut self.light_stream(path);
            self.light_path(stream, keep, &mut Ends::default(), &mut chunk.splats);
            chunk.vertices.end();
        }
        chunk
    }

    /// Traces all camera paths of the window.
    fn camera_paths<O: Recorder>(
        &self,
        map: &PhotonMap,
        layer: &mut SampleLayer,
        recorder: &mut O,
    ) -> Option<()> {
        let window = self.view.window;
        let pieces = Pieces::new(window.len() as u32, CHUNK);
        let driver = self.view.driver();
        // Every pixel gets one value: the order of pieces does not matter. The layer of a dropped sample is not used.
        let layer = Mutex::new(layer);
        driver.run_recorded(pieces, recorder, |indices, observer| {
            let mut light = LightPath::default();
            let value = |index: u32| {
                let pixel = window.pixel(index as usize);
                let value = if self.strategies == Strategies::Density {
                    self.density_path(pixel, map, observer)
                } else {
                    if !self.settings.light_sampling_only {
                        self.fetch(pixel, map, &mut light);
                    }
                    self.camera_path(pixel, &light, Some(map), observer)
                };
                Splat { index, value }
            };
            let values: Vec<Splat> = indices.map(value).collect();
            let mut layer = layer.lock().expect("no thread panics");
            layer.add_camera(&values);
        })?;
        Some(())
    }

    /// Adds one sample of every pixel by photon density at several radii: the first to the film, all to its levels.
    fn add_radii<O: Recorder>(
        &self,
        film: &mut Film,
        levels: &mut LevelFilm,
        recorder: &mut O,
    ) -> Option<()> {
        let factors = self.settings.radii.iter();
        let radii: Vec<f32> = factors.map(|factor| self.radius * factor).collect();
        let window = self.view.window;
        // Photon density has no splats.
        let mut unused = SplatLayer::new(&Window { w: 0, ..window });
        let map = self.photon_map(radii[radii.len() - 1], &mut unused)?;
        let pieces = Pieces::new(window.len() as u32, CHUNK);
        let driver = self.view.driver();
        let finished = driver.run_recorded(pieces, recorder, |indices, observer| {
            let path = |index: u32| {
                let pixel = window.pixel(index as usize);
                self.density_paths(pixel, &map, &radii, observer)
            };
            indices.map(path).collect::<Vec<Densities>>()
        })?;
        for (indices, paths) in finished.results {
            for (index, path) in (indices.start as usize..).zip(&paths) {
                film.push_shared(index, path.levels[0], self.sample);
                let values = PathLevels {
                    levels: &path.levels[..radii.len()],
                    shared: path.shared,
                    features: path.features,
                };
                levels.push(index, self.sample, &values);
            }
        }
        Some(())
    }
}
