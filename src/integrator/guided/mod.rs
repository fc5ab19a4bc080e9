//! Guided path tracing: the guide of `[Müller17]`, with filters and learned shares of `[Müller19]`.
//!
//! Iterations have 1, 2, 4, … samples per pixel. The paths of an iteration draw directions from a mixture of the BSDF
//! and the guide of earlier iterations, and the light that they find trains the next guide. Given the guide, every
//! sample is unbiased (its numbers are independent of those before), so the picture is the mean of all samples: no
//! iteration is discarded or reweighted.
//!
//! The guide depends on the samples before it, not on the passes or threads that made them: a sample is complete before
//! the next one begins, and records are added in the order of tiles and pixels. A resumed render trains the guide again
//! with the earlier samples, which it does not add to the film again.

mod directions;
mod field;
mod quadtree;

use super::pieces::{Driver, Tile};
use super::walk::Walk;
use super::walk::camera::trace_tile;
use super::walk::observer::Recorder;
use super::{Integrator, PathTracer, Picture, View};
use crate::image::film::{Film, Window};
use crate::math::UVec2;
use crate::regularise::{Roughening, Rule, Unregularised};
use crate::sampler::{Domain, Independent, IndependentStream, Seed};
use directions::{Guide, TrainingSamples};
use field::Field;
use std::ops::Range;

/// Samples of all training iterations: 1 + 2 + 4 + … The guide does not change after them.
pub(crate) const LEARNING: u32 = 255;

/// Pixels per side of the tiles that threads take.
const TILE: u32 = 16;

/// Tiles whose records are stored at a time.
const BATCH: usize = 256;

/// Bytes of the records of a batch for each of its pixels: five vertices; measured.
const RECORD_BYTES: u64 = 200;

/// A guided path tracer and its seed.
#[derive(Debug)]
pub(super) struct Guided {
    tracer: PathTracer<Rule>,
    /// True if the rule is for training only: the picture is that of plain path tracing.
    unbiased: bool,
    seed: u64,
    state: Option<State>,
}

/// A guide, and the samples from which it was trained.
#[derive(Debug)]
struct State {
    frame: UVec2,
    window: Window,
    /// Number of samples so far.
    samples: u32,
    field: Field,
}

/// Bytes that a guide may take beside the film of a picture with this number of pixels.
pub(crate) fn bytes(pixels: usize) -> u64 {
    let batch = pixels.min(BATCH * (TILE * TILE) as usize) as u64;
    Field::MAX_BYTES + batch * RECORD_BYTES
}

impl Guided {
    pub(super) fn new(
        rule: Rule,
        unbiased: bool,
        (max_vertices, roulette_start): (u32, u32),
        seed: u64,
    ) -> Self {
        let tracer = PathTracer {
            max_vertices,
            roulette_start,
            reuse: false,
            rule,
        };
        Self {
            tracer,
            unbiased,
            seed,
            state: None,
        }
    }
}

impl Integrator for Guided {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32 {
        let Picture { film, aovs, .. } = picture;
        let place = (view.sensor.frame, view.window);
        let state = self.state.take();
        let known = state.filter(|s| (s.frame, s.window) == place && s.samples <= samples.start);
        let mut state = known.unwrap_or_else(|| State {
            frame: place.0,
            window: place.1,
            samples: 0,
            field: Field::new(view.scene.geometry().bounds()),
        });
        let source = Independent {
            seed: Seed(self.seed).derive(Domain::Camera, 0),
        };
        let learning = (self.unbiased && view.scene.features().lobes).then_some(&self.tracer.rule);
        let paths = GuidedPaths {
            view,
            source,
            learning,
        };
        let plain = self.tracer.with(Unregularised);
        let added = match (aovs, &self.tracer.rule) {
            (Some(aovs), _) if self.unbiased => state.pass(&plain, &paths, samples, film, aovs),
            (Some(aovs), _) => state.pass(&self.tracer, &paths, samples, film, aovs),
            (None, rule)
                if self.unbiased || *rule == Rule::Plain || !view.scene.features().lobes =>
            {
                state.pass(&plain, &paths, samples, film, &mut ())
            }
            (None, Rule::Accumulated(rule)) => {
                let tracer = self.tracer.with(rule);
                state.pass(&tracer, &paths, samples, film, &mut ())
            }
            (None, _) => state.pass(&self.tracer, &paths, samples, film, &mut ()),
        };
        self.state = Some(state);
        added
    }

    fn notes(&self, view: &View<'_>) -> Option<String> {
        let megabytes = bytes(view.window.len()) / 1_000_000;
        Some(format!(
            "the guide learns from the first {LEARNING} samples per pixel and takes up to {megabytes} MB"
        ))
    }
}

/// Data that all paths of a pass share, beside tracer and guide.
struct GuidedPaths<'a> {
    view: &'a View<'a>,
    source: Independent,
    /// The rule for the training only.
    learning: Option<&'a Rule>,
}

impl GuidedPaths<'_> {
    /// Adds the samples with these numbers to a tile.
    fn trace<R: Roughening, O: Recorder>(
        &self,
        tracer: &PathTracer<R>,
        (field, mut training): (&Field, Option<&mut TrainingSamples>),
        samples: Range<u32>,
        tile: &mut Tile<'_>,
        observer: &mut O,
    ) {
        let radiance =
            |walk: Walk<'_>, sample, stream: &mut IndependentStream, observer: &mut O| {
                let guide = Guide::new(field, training.as_deref_mut(), self.learning, sample);
                tracer.radiance(guide, walk, sample, stream, observer)
            };
        trace_tile(self.view, &self.source, samples, tile, observer, radiance);
    }
}

impl State {
    /// Adds the samples with these numbers to the film, after training the guide with earlier samples that it has not
    /// had. Returns how many the film got: a stop acts between samples during training, and then between tiles.
    fn pass<R: Roughening, O: Recorder>(
        &mut self,
        tracer: &PathTracer<R>,
        paths: &GuidedPaths<'_>,
        samples: Range<u32>,
        film: &mut Film,
        recorder: &mut O,
    ) -> u32 {
        let before = samples.start.min(LEARNING);
        if self.samples < before {
            // The film already has these samples of an earlier run.
            let unused = &mut film.clone();
            for sample in self.samples..before {
                self.learn(tracer, paths, sample, unused, &mut ());
            }
        }
        let driver = paths.view.driver();
        let learning = samples.start..samples.end.min(LEARNING);
        let learned = driver.samples(learning.clone(), 1, |one| {
            self.learn(tracer, paths, one.start, film, recorder);
            Some(())
        });
        if learned < learning.len() as u32 {
            return learned;
        }
        let tiles = film.tiles(TILE);
        let rest = samples.start.max(LEARNING)..samples.end;
        learned
            + driver.samples(rest, Tile::samples_at_once(film), |rest| {
                let trace = |tile: &mut Tile<'_>, observer: &mut O| {
                    paths.trace(tracer, (&self.field, None), rest.clone(), tile, observer);
                };
                driver.run_tiles(&tiles, &rest, film, recorder, trace)?;
                self.samples = rest.end;
                Some(())
            })
    }

    /// Adds one sample to the film, and its records to the guide. A stop does not interrupt it.
    fn learn<R: Roughening, O: Recorder>(
        &mut self,
        tracer: &PathTracer<R>,
        paths: &GuidedPaths<'_>,
        sample: u32,
        film: &mut Film,
        recorder: &mut O,
    ) {
        let mut records = Vec::new();
        let one = sample..sample + 1;
        for batch in film.tiles(TILE).chunks(BATCH) {
            let trace = |tile: &mut Tile<'_>, observer: &mut O| {
                let mut training = TrainingSamples::default();
                let guide = (&self.field, Some(&mut training));
                paths.trace(tracer, guide, one.clone(), tile, observer);
                training.records
            };
            let found = Driver::default().run_tiles(batch, &one, film, recorder, trace);
            records.clear();
            records.extend(found.into_iter().flatten().flatten());
            self.field.add(&records);
        }
        self.samples += 1;
        if (self.samples + 1).is_power_of_two() {
            self.field.next();
        }
    }
}
