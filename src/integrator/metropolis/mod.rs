//! Metropolis light transport over primary samples `[Kelemen02]`, over bidirectional path tracing.
//!
//! The state of a chain is the random numbers of a pair of paths, one from the camera and one from a light, with all
//! their connections. After a chain has found a path through a keyhole, it explores similar paths.
//!
//! One sample of the picture is a *pass*, an independent estimate: a bootstrap of fresh pairs, and a number of
//! mutations per pixel. The fresh pairs count like large steps, and all chains of the pass start at them, in proportion
//! to their target. Chains end with their pass. So the expectation of a pass is exact at any chain length (`chain`);
//! resuming, splitting and threads change no bit; variance layers are correct; stuck chains end.
//!
//! The target of the chains is luminance over that of the neighbourhood in the picture, estimated by a first bootstrap
//! `[Hoberock10]`: relative errors of dark and bright pixels are alike. Any positive target is unbiased.

mod chain;

use super::bidirectional::{Bidirectional, Pairs};
use super::{Integrator, Picture, View};
use crate::image::film::{Cause, Film, RejectedSample, Window};
use crate::image::splat::{Splat, SplatLayer};
use crate::integrator::path::PathTracer;
use crate::integrator::pieces::{Driver, Pieces};
use crate::math::{UVec2, luminance};
use crate::regularise::Unregularised;
use crate::sampler::{Domain, Independent, IndependentStream, SampleSource, Sampler, Seed};
use crate::scene::Aim;
use chain::{LARGE, Means, Numbers, Sources, Target};
use std::ops::Range;

/// Mutations per bootstrap sample, and bounds of the number of these: all pixels share the noise of their mean.
const PER_BOOTSTRAP: u64 = 4;
const BOOTSTRAP: (u64, u64) = (1 << 10, 1 << 18);

/// Bootstrap samples per chain.
const PER_CHAIN: u32 = 256;

/// Chains that run before their values are joined.
const BATCH: u32 = 32;

/// Chains that run in the first pass, even if it is stopped: without chains the picture would be dark.
const MIN_CHAINS: u32 = 8;

/// Samples of the bootstrap that a thread takes at a time.
const CHUNK: u32 = 256;

/// Chunks of the bootstrap whose values are joined at a time, which bounds their memory. As many run in the first pass,
/// even if it is stopped.
const BLOCK: u32 = 64;

/// Number of refused states, and pixel and cause of the first.
type Refused = (u64, Option<(UVec2, Cause)>);

/// The refused states of two runs, in this order.
fn joined((count, first): Refused, (more, later): Refused) -> Refused {
    (count + more, first.or(later))
}

/// Most cells per side of the picture, the neighbourhoods of the target.
const CELLS: u32 = 32;

/// Bounds of a neighbourhood's luminance over the mean of the picture.
const CONTRAST: (f64, f64) = (0.05, 20.0);

/// Metropolis light transport.
#[derive(Clone, Debug)]
pub(crate) struct Metropolis {
    /// Path sampler of the chains; no merging.
    pub base: Bidirectional,
    /// Mutations per pixel of a pass, at least 1.
    pub mutations: u32,
    /// Target function, once the first bootstrap has estimated it.
    target: Option<TargetFunction>,
}

/// Target function of the chains of all passes: luminance over that of the pixel's cell `[Hoberock10]`.
#[derive(Clone, Debug)]
struct TargetFunction {
    /// Columns and rows of the frame.
    frame: UVec2,
    /// Cells per side.
    cells: UVec2,
    /// Reciprocal luminance of the cells, row by row.
    weights: Vec<f64>,
    /// Mean of the target.
    mean: f64,
}

impl TargetFunction {
    /// The cell of a pixel of the frame by its index.
    fn cell(&self, index: u32) -> usize {
        let (x, y) = (index % self.frame.x, index / self.frame.x);
        let side = |at: u32, length: u32, cells: u32| {
            (u64::from(at) * u64::from(cells) / u64::from(length)) as u32
        };
        let (x, y) = (
            side(x, self.frame.x, self.cells.x),
            side(y, self.frame.y, self.cells.y),
        );
        (y * self.cells.x + x) as usize
    }

    /// Its value for the splats of a path.
    fn of(&self, splats: &[Splat]) -> f64 {
        splats
            .iter()
            .map(|s| f64::from(luminance(s.value)) * self.weights[self.cell(s.index)])
            .sum()
    }
}

/// Uses of random numbers, each with its own streams.
#[derive(Clone, Copy)]
enum Use {
    LightStart,
    CameraStart,
    LightSteps,
    CameraSteps,
    Choices,
    Starts,
}

struct Pass<'a> {
    settings: &'a Metropolis,
    target: &'a TargetFunction,
    view: &'a View<'a>,
    aim: &'a Aim,
    number: u32,
    source: Independent,
}

/// Pairs of paths as the target of a chain.
struct PairTarget<'a> {
    pairs: Pairs<'a>,
    target: &'a TargetFunction,
    /// States whose target is NaN or infinite.
    refused: Refused,
}

impl Target for PairTarget<'_> {
    fn evaluate(
        &mut self,
        light: &mut Numbers,
        camera: &mut Numbers,
        splats: &mut Vec<Splat>,
    ) -> f64 {
        let pixel = camera.pixel(self.target.frame);
        splats.clear();
        splats.extend_from_slice(self.pairs.trace(light, camera, pixel));
        let target = self.target.of(splats);
        if target.is_finite() {
            return target;
        }
        let cause = if target.is_nan() {
            Cause::Nan
        } else {
            Cause::Infinite
        };
        self.refused.0 += 1;
        self.refused.1.get_or_insert((pixel, cause));
        splats.clear();
        0.0
    }
}

impl Metropolis {
    /// Metropolis light transport with this number of mutations per pixel of a pass.
    pub(crate) fn new(base: Bidirectional, mutations: u32) -> Self {
        Self {
            base,
            mutations,
            target: None,
        }
    }

    fn source(&self, number: u64) -> Independent {
        Independent {
            seed: Seed(self.base.seed).derive(Domain::Chain, number),
        }
    }

    /// Mutations, samples of the bootstrap, and chains of a pass.
    fn counts(&self, frame: UVec2) -> (u64, u32, u32) {
        let pixels = u64::from(frame.x) * u64::from(frame.y);
        let mutations = u64::from(self.mutations) * pixels;
        let bootstrap = (mutations / PER_BOOTSTRAP).clamp(BOOTSTRAP.0, BOOTSTRAP.1) as u32;
        let chains = u64::from(bootstrap / PER_CHAIN).min(mutations) as u32;
        (mutations, bootstrap, chains)
    }

    /// Luminance of the cells from a separate bootstrap, and the mean of the resulting target.
    fn first_bootstrap(&self, view: &View<'_>, aim: &Aim) -> TargetFunction {
        let frame = view.sensor.frame;
        let cells = frame.min(UVec2::splat(CELLS));
        let count = (cells.x * cells.y) as usize;
        let mut target = TargetFunction {
            frame,
            cells,
            weights: vec![1.0; count],
            mean: 1.0,
        };
        // The target affects the variance only, not the expectation: a quarter of the samples is enough.
        let samples = (self.counts(frame).1 / 4).max(BOOTSTRAP.0 as u32);
        let mut found: Vec<Vec<Splat>> = Vec::new();
        Pass {
            settings: self,
            target: &target,
            view,
            aim,
            number: 0,
            source: self.source(1),
        }
        .bootstrap(
            &Driver::default(),
            samples,
            |_, splats| splats.to_vec(),
            |splats| found.push(splats),
        );
        let mut sums = vec![0.0; count];
        for splat in found.iter().flatten() {
            sums[target.cell(splat.index)] += f64::from(luminance(splat.value));
        }
        let total: f64 = sums.iter().sum();
        if total > 0.0 {
            // Cells have equal sizes up to one pixel.
            let mean = total / count as f64;
            let (least, most) = CONTRAST;
            let weight = |sum: &f64| mean / sum.clamp(least * mean, most * mean);
            target.weights = sums.iter().map(weight).collect();
            let sum: f64 = found.iter().map(|splats| target.of(splats)).sum();
            target.mean = sum / f64::from(samples);
        }
        target
    }
}

impl Pass<'_> {
    fn stream(&self, index: u32, of: Use) -> IndependentStream {
        self.source
            .stream(UVec2::new(index, of as u32), self.number)
    }

    fn target(&self) -> PairTarget<'_> {
        PairTarget {
            pairs: Pairs::new(&self.settings.base, self.view, self.aim, self.number),
            target: self.target,
            refused: (0, None),
        }
    }

    fn start(&self, index: u32) -> [IndependentStream; 2] {
        [Use::LightStart, Use::CameraStart].map(|of| self.stream(index, of))
    }

    /// Passes `result` of the target and values of fresh pairs to `add`, in order. Returns the refused states, and the
    /// number of all samples over those that were finished; `None` if the pass was stopped.
    fn bootstrap<T: Send>(
        &self,
        driver: &Driver<'_>,
        samples: u32,
        result: impl Fn(f64, &[Splat]) -> T + Sync,
        mut add: impl FnMut(T),
    ) -> Option<(Refused, f64)> {
        let chunk = |samples: Range<u32>| {
            let mut target = self.target();
            let mut splats = Vec::new();
            let one = |i| {
                let [mut light, mut camera] = self.start(i).map(Numbers::new);
                let value = target.evaluate(&mut light, &mut camera, &mut splats);
                result(value, &splats)
            };
            let results: Vec<T> = samples.map(one).collect();
            (results, target.refused)
        };
        let mut refused = (0, None);
        let pieces = Pieces::new(samples, CHUNK)
            .in_batches(BLOCK)
            .at_least(BLOCK);
        let factor = driver.run_batches(pieces, chunk, |_, (results, more)| {
            results.into_iter().for_each(&mut add);
            refused = joined(refused, more);
        })?;
        Some((refused, factor))
    }

    /// Adds one estimate of every pixel of the frame to the layer; returns the refused states, or `None` if the pass
    /// was stopped. If the first pass is stopped, the estimate is by fewer fresh pairs and chains.
    fn run(&self, layer: &mut SplatLayer) -> Option<Refused> {
        let (mutations, samples, chains) = self.settings.counts(self.target.frame);
        let scale = 1.0 / mutations as f64;
        let mut means = Means {
            pass: 0.0,
            constant: self.target.mean,
            fresh: LARGE + f64::from(samples) * scale,
        };
        let mut weights = Vec::new();
        let weighed = |target: f64, splats: &[Splat]| {
            let factor = (scale / means.density(target)) as f32;
            let counted = |splat: &Splat| Splat {
                value: splat.value * factor,
                ..*splat
            };
            (target, splats.iter().map(counted).collect::<Vec<_>>())
        };
        let driver = self.view.driver();
        let (refused, factor) = driver.shared(|driver| {
            self.bootstrap(driver, samples, weighed, |(target, splats)| {
                weights.push(target);
                layer.add_in_order(&splats, 1.0);
            })
        })?;
        layer.scale(factor);
        let total: f64 = weights.iter().sum();
        means.pass = total / weights.len() as f64;
        let more = self.run_chains(chains, mutations, (&weights, total), means, layer)?;
        Some(joined(refused, more))
    }

    /// Adds the mutations of all chains to the layer. They start at bootstrap samples of these weights and this total.
    fn run_chains(
        &self,
        chains: u32,
        mutations: u64,
        (weights, total): (&[f64], f64),
        means: Means,
        layer: &mut SplatLayer,
    ) -> Option<Refused> {
        let first = self.stream(0, Use::Starts).next_1d();
        let starts = starts(weights, total, chains, first);
        let run = |chain: u32| {
            let mut target = self.target();
            let sources = Sources {
                start: self.start(starts[chain as usize]),
                steps: [Use::LightSteps, Use::CameraSteps, Use::Choices]
                    .map(|of| self.stream(chain, of)),
            };
            // The first chains take one mutation more if there is a remainder.
            let (each, rest) = (mutations / u64::from(chains), mutations % u64::from(chains));
            let length = each + u64::from(u64::from(chain) < rest);
            let scale = 1.0 / mutations as f64;
            let splats = chain::run(&mut target, sources, length as u32, means, scale);
            (splats, target.refused)
        };
        // A separate layer, since it is scaled by the number of chains that have run.
        let mut of_chains = SplatLayer::new(&self.view.window);
        let mut refused = (0, None);
        let pieces = Pieces::new(chains, 1).in_batches(BATCH);
        let pieces = pieces.at_least(MIN_CHAINS);
        let driver = self.view.driver();
        let factor = driver.run_batches(
            pieces,
            |chain| run(chain.start),
            |_, (splats, more)| {
                of_chains.add_in_order(&splats, 1.0);
                refused = joined(refused, more);
            },
        )?;
        layer.add_layer(&of_chains, factor);
        Some(refused)
    }
}

/// Bootstrap samples from which the chains start: in proportion to their weights, by systematic sampling with `u` in
/// [0, 1). If all weights are 0, the last sample.
fn starts(weights: &[f64], total: f64, chains: u32, u: f32) -> Vec<u32> {
    let mut starts = Vec::with_capacity(chains as usize);
    let (mut sum, mut place) = (0.0, 0);
    for chain in 0..chains {
        let wanted = total * (f64::from(chain) + f64::from(u)) / f64::from(chains);
        while place + 1 < weights.len() && sum + weights[place] <= wanted {
            sum += weights[place];
            place += 1;
        }
        starts.push(place as u32);
    }
    starts
}

/// Adds a sample of the whole frame, and its refused states, to a film.
fn push(film: &mut Film, frame: UVec2, layer: &mut SplatLayer, sample: u32, refused: Refused) {
    let window = film.window;
    for (index, value) in layer.take().enumerate() {
        let pixel = UVec2::new(index as u32 % frame.x, index as u32 / frame.x);
        if let Some(place) = Splat::new(&window, pixel, value) {
            film.push_shared(place.index as usize, value, sample);
        }
    }
    let (count, first) = refused;
    if let Some((pixel, cause)) = first {
        for _ in 0..count {
            film.rejected.add(RejectedSample {
                pixel,
                sample,
                cause,
            });
        }
    }
}

/// Bytes that a pass takes beside the film: chains cover the whole frame, whatever the window.
pub(super) fn bytes(frame: UVec2) -> u64 {
    2 * u64::from(frame.x) * u64::from(frame.y) * SplatLayer::PIXEL_BYTES
}

impl Integrator for Metropolis {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32 {
        let frame = view.sensor.frame;
        let window = Window::full(frame);
        let whole = View { window, ..*view };
        let aim = self.base.aim(&whole);
        let target = match self.target.take().filter(|target| target.frame == frame) {
            Some(target) => target,
            None => self.first_bootstrap(&whole, &aim),
        };
        let first = samples.start;
        let added = view.driver().samples(samples, 1, |one| {
            let mut layer = SplatLayer::new(&whole.window);
            let refused = Pass {
                settings: self,
                target: &target,
                view: &whole,
                aim: &aim,
                number: one.start,
                source: self.source(0),
            }
            .run(&mut layer)?;
            push(&mut picture.film, frame, &mut layer, one.start, refused);
            Some(())
        });
        self.target = Some(target);
        if added == 0 {
            return 0;
        }
        let samples = first..first + added;
        // Chains record no AOVs; separate camera paths of one vertex do.
        if let Some(aovs) = &mut picture.aovs {
            let tracer = PathTracer {
                max_vertices: 1,
                roulette_start: 1,
                reuse: false,
                rule: Unregularised,
            };
            let source = Independent {
                seed: Seed(self.base.seed),
            };
            let mut unused = picture.film.clone();
            // Not stopped, so that all samples in the picture have their AOVs.
            let view = &View {
                stop: None,
                ..*view
            };
            tracer.estimate(view, &source, samples, &mut unused, aovs);
        }
        added
    }

    fn shares_light(&self) -> bool {
        true
    }

    fn notes(&self, view: &View<'_>) -> Option<String> {
        let (mutations, bootstrap, chains) = self.counts(view.sensor.frame);
        Some(format!(
            "a sample is {mutations} mutations by {chains} chains, after {bootstrap} fresh paths"
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn metropolis_chains_start_in_proportion() {
        let weights = [0.0, 1.0, 0.0, 2.0, 5.0, 0.0];
        let starts = starts(&weights, 8.0, 16, 0.5);
        let count = |i: u32| starts.iter().filter(|&&s| s == i).count();
        assert_eq!((0..6).map(count).collect::<Vec<_>>(), [0, 2, 0, 4, 10, 0]);
        assert_eq!(super::starts(&[0.0; 3], 0.0, 4, 0.9), [2; 4]);
    }
}
