//! Settings of a render, and the integrator that they define.

use super::amounts::{Amounts, LevelError, RadiusFactors, Scales};
use super::bidirectional::{AimCache, Bidirectional, Radius, Strategies, Strategy};
use super::guided::{self, Guided};
use super::levels::{LevelTracer, estimate};
use super::method::Content;
use super::metropolis::{self, Metropolis};
use super::path::PathTracer;
use super::path::directions::BsdfAlone;
use super::path::manifold::Manifold;
use super::{Integrator, Picture, Recorded, View};
use crate::image::exr::Metadata;
use crate::image::film::Window;
use crate::image::level_film::{BATCHES, LevelFilm};
use crate::math::UVec2;
use crate::regularise::{Rule, Unregularised};
use crate::sampler::{CameraSource, SamplerKind, Seed};
use crate::scene::Scene;
use std::ops::Range;

/// The algorithm that estimates the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Estimator {
    /// Unidirectional path tracing with next-event estimation.
    Path {
        /// Continue paths with the roughened lobe ("reuse" of `[OPSR §5.1]`): as fast as plain path tracing,
        /// slightly more bias. Rules that always do ignore it.
        reuse: bool,
    },
    /// Path tracing with directions drawn from the BSDF or from a guide that is learned while rendering.
    Guided {
        /// True to use the rule in the training of the guide only: the picture is that of plain path tracing.
        unbiased: bool,
    },
    /// Path tracing that also connects to lights over smooth interfaces: specular manifold sampling `[SMS]`.
    Manifold {
        /// Trials for a point on a lamp, each solution counted once; 0 for as many as an unbiased estimate takes.
        trials: u32,
    },
    /// Light tracing: light paths connected to the camera, and lights in the camera's view, directly or through Dirac
    /// lobes.
    Light,
    /// Bidirectional path tracing: all connections, weighted by the balance heuristic.
    Bdpt,
    /// Vertex connection and merging `[UPS]`: all connections, and photon density at every vertex.
    Vcm(Radius),
    /// The same with light samples as the only connections.
    VcmNee(Radius),
    /// Progressive photon mapping with one radius for the whole picture.
    Sppm(Radius),
    /// Metropolis light transport over bidirectional path tracing.
    Mlt {
        /// Mutations per pixel of one sample, at least 1.
        mutations: u32,
    },
}

impl Default for Estimator {
    fn default() -> Self {
        Self::Path { reuse: false }
    }
}

/// Least bytes of a pixel that an estimator with light paths takes beside its film.
const LIGHT_PATH_BYTES: u64 = 95;

/// All that a picture depends on, apart from the view and the number of samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// The algorithm.
    pub estimator: Estimator,
    /// The rule that roughens the last vertex of a path.
    pub rule: Rule,
    /// The films that are stored. Estimator and rule decide which are allowed, see [`LevelError`].
    pub amounts: Amounts,
    /// The only strategy of `bdpt` or `vcm` that the picture shows, with its MIS weights; without a rule.
    pub strategy: Option<Strategy>,
    /// Sampler of paths; always independent for `guided`, `mlt`, and camera paths beside light paths in raw means.
    /// Variance estimates are unbiased with independent numbers, the default, and upper bounds with Sobol points.
    pub sampler: SamplerKind,
    /// Scattering vertices of the longest path, at least 1.
    pub max_vertices: u32,
    /// Vertex (from 1) at which Russian roulette begins. Ways through glass have a separate roulette. Camera walks of
    /// `bdpt` and `vcm` have none before their first draw from a lobe that is not Dirac.
    pub roulette_start: u32,
    /// Seed of all random numbers.
    pub seed: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            estimator: Estimator::default(),
            rule: Rule::Plain,
            amounts: Amounts::Raw,
            strategy: None,
            sampler: SamplerKind::default(),
            max_vertices: 16,
            roulette_start: 5,
            seed: 0,
        }
    }
}

impl Settings {
    /// The integrator of these settings.
    ///
    /// Panics for amounts that the estimator or its rule does not support.
    pub fn integrator(&self) -> Box<dyn Integrator> {
        let (strategies, merging) = match self.estimator {
            Estimator::Path { .. } => {
                let source = self.source();
                if let Amounts::Roughening(scales) = &self.amounts {
                    let tracer = self.level_tracer(scales);
                    let tracer = tracer.expect("levels that were checked");
                    return Box::new(LevelIntegrator { tracer, source });
                }
                return Box::new(PathIntegrator {
                    tracer: self.tracer(self.rule.clone()),
                    source,
                    is_blurred: self.amounts.has_batches(),
                });
            }
            Estimator::Guided { unbiased } => {
                let lengths = (self.max_vertices, self.roulette_start);
                return Box::new(Guided::new(self.rule.clone(), unbiased, lengths, self.seed));
            }
            Estimator::Manifold { trials } => {
                return Box::new(ManifoldIntegrator {
                    tracer: self.tracer(Unregularised),
                    source: self.source(),
                    trials,
                    manifold: None,
                });
            }
            Estimator::Light => (Strategies::Light, None),
            Estimator::Bdpt => (self.strategies(), None),
            Estimator::Vcm(radius) => (self.strategies(), Some(radius)),
            Estimator::VcmNee(radius) => (self.strategies(), Some(radius)),
            Estimator::Sppm(radius) => (Strategies::Density, Some(radius)),
            Estimator::Mlt { mutations } => {
                let base = self.bidirectional(Strategies::All);
                return Box::new(Metropolis::new(base, mutations));
            }
        };
        let radii = match &self.amounts {
            Amounts::Radii(factors) => factors.as_slice().to_vec(),
            _ => Vec::new(),
        };
        Box::new(Bidirectional {
            merging,
            radii,
            batched: self.connects() && self.amounts.has_batches(),
            ..self.bidirectional(strategies)
        })
    }

    /// Sampler of camera paths: independent from batch to batch if there are batches.
    pub(crate) fn source(&self) -> CameraSource {
        let batches = match self.amounts.has_batches() {
            true => BATCHES,
            false => 1,
        };
        CameraSource::new(self.sampler, Seed(self.seed), batches as u32)
    }

    /// The strategies of `bdpt` and `vcm` that the picture shows.
    fn strategies(&self) -> Strategies {
        self.strategy.map_or(Strategies::All, Strategies::One)
    }

    /// The bidirectional path tracer of these settings with these strategies, without merging; of the rules it supports
    /// the mollifier and accumulated roughness.
    pub(crate) fn bidirectional(&self, strategies: Strategies) -> Bidirectional {
        Bidirectional {
            strategies,
            merging: None,
            radii: Vec::new(),
            batched: false,
            light_sampling_only: matches!(self.estimator, Estimator::VcmNee(_)),
            mollifier: match self.rule {
                Rule::Mollifier(radius)
                    if matches!(self.estimator, Estimator::Bdpt | Estimator::Mlt { .. }) =>
                {
                    Some(radius)
                }
                _ => None,
            },
            split: match &self.rule {
                Rule::Accumulated(rule) if !rule.factors.are_zero() => Some(rule.clone()),
                _ => None,
            },
            max_vertices: self.max_vertices,
            roulette_start: self.roulette_start,
            seed: self.seed,
            sampler: self.sampler,
            aim_cache: AimCache::default(),
        }
    }

    /// Bytes that a picture of a window of the frame and the state of its integrator take with these settings.
    pub(crate) fn bytes(&self, frame: UVec2, window: Window, recorded: Recorded) -> u64 {
        let beside = match self.estimator {
            Estimator::Guided { .. } => guided::bytes(window.len()),
            Estimator::Mlt { .. } => metropolis::bytes(frame),
            Estimator::Path { .. } | Estimator::Manifold { .. } => 0,
            // Light paths of a sample, whose number of vertices depends on the scene.
            _ => window.len() as u64 * LIGHT_PATH_BYTES,
        };
        Picture::bytes(window, &self.amounts, recorded) + beside
    }

    /// An error unless the estimator and its rule support these amounts.
    pub(crate) fn check_amounts(&self) -> Result<(), LevelError> {
        match (self.estimator, &self.amounts) {
            (_, Amounts::Raw) => Ok(()),
            (Estimator::Sppm(_), Amounts::Radii(_)) => Ok(()),
            (Estimator::Sppm(_), _) => Err(LevelError::Radii),
            (Estimator::Path { reuse: true }, _) => Err(LevelError::Reuse),
            (Estimator::Path { .. }, Amounts::Blurred) => Ok(()),
            (Estimator::Path { .. }, Amounts::Roughening(scales)) => {
                self.level_tracer(scales).map(|_| ())
            }
            (_, Amounts::Blurred) if self.connects() && self.strategy.is_none() => Ok(()),
            _ => Err(LevelError::Estimator),
        }
    }

    /// The amounts of these numbers: scales of the rule's factors in path tracing, factors on the radius of `sppm`.
    pub(crate) fn amounts_at(&self, numbers: &[f32]) -> Result<Amounts, LevelError> {
        if matches!(self.estimator, Estimator::Sppm(_)) {
            return Amounts::radii(numbers);
        }
        // An estimator without levels is an error, whatever the numbers.
        self.at(Amounts::Roughening(Scales::default()))?;
        Amounts::roughening(numbers)
    }

    /// These amounts, if the estimator and its rule support them.
    fn at(&self, amounts: Amounts) -> Result<Amounts, LevelError> {
        let settings = Self {
            amounts,
            ..self.clone()
        };
        settings.check_amounts().map(|()| settings.amounts)
    }

    /// True for bidirectional estimators whose camera paths are connected to light paths.
    fn connects(&self) -> bool {
        matches!(
            self.estimator,
            Estimator::Bdpt | Estimator::Vcm(_) | Estimator::VcmNee(_)
        )
    }

    /// Default amounts: three radii of photon density; blurs of `bdpt` and `vcm`, unless one strategy is shown; in path
    /// tracing four levels if a rule roughens something, blurs in plain path tracing and in scenes without lobes; raw
    /// means for rules of other renderers, as in these. An error if the estimator or the rule allows none of them.
    pub(crate) fn usual_amounts(&self, has_lobes: bool) -> Result<Amounts, LevelError> {
        if matches!(self.estimator, Estimator::Sppm(_)) {
            return Ok(Amounts::Radii(RadiusFactors::default()));
        }
        if self.connects() && self.strategy.is_none() {
            return Ok(Amounts::Blurred);
        }
        if self.rule.roughens_continuation() {
            return Ok(Amounts::Raw);
        }
        let nothing = [Rule::Plain, Rule::constant(0.0)].contains(&self.rule) || !has_lobes;
        match self.estimator {
            Estimator::Path { reuse: false } if nothing => Ok(Amounts::Blurred),
            _ if nothing => Ok(Amounts::Raw),
            _ => self.at(Amounts::Roughening(Scales::default())),
        }
    }

    /// An error if the estimator does not support the contents of the scene.
    pub fn check_scene(&self, scene: &Scene) -> Result<(), String> {
        let kind = self.estimator.kind();
        for content in kind.row().refuses {
            let (is_there, what) = match content {
                Content::Media => (scene.media().is_some(), "media"),
                Content::Scattering => {
                    let what = "media that scatter, which path and bdpt know";
                    (scene.scatters(), what)
                }
                Content::Dispersion => {
                    let what = "dispersion (KHR_materials_dispersion)";
                    (scene.features().dispersion, what)
                }
                Content::Overlaps => (scene.features().overlaps, "bodies that overlap"),
            };
            if is_there {
                return Err(format!("{kind} knows no {what}"));
            }
        }
        Ok(())
    }

    fn level_tracer(&self, scales: &Scales) -> Result<LevelTracer, LevelError> {
        LevelTracer::new(&self.rule, scales, self.max_vertices, self.roulette_start)
    }

    /// The path tracer of these settings with this rule.
    pub fn tracer<R>(&self, rule: R) -> PathTracer<R> {
        let reuse = self.estimator == Estimator::Path { reuse: true };
        PathTracer {
            max_vertices: self.max_vertices,
            roulette_start: self.roulette_start,
            reuse: reuse || self.rule.roughens_continuation(),
            rule,
        }
    }

    /// Text for the file of a picture: version, seed, scene and table.
    pub(crate) fn metadata(
        &self,
        scene: &str,
        scene_sha256: &str,
        table_sha256: Option<&str>,
    ) -> Metadata {
        let mut metadata = Metadata::new();
        let mut set = |key: &str, value: String| {
            metadata.insert(key.to_owned(), value);
        };
        set("version", env!("CARGO_PKG_VERSION").to_owned());
        set("seed", self.seed.to_string());
        set("scene", scene.to_owned());
        set("scene_sha256", scene_sha256.to_owned());
        set("max_vertices", self.max_vertices.to_string());
        if let Some(hash) = table_sha256 {
            set("table_sha256", hash.to_owned());
        }
        if let Some(table) = self.rule.table() {
            set("table_scale", table.scale.to_string());
        }
        if let Some(strategy) = self.strategy {
            set("strategy", strategy.to_string());
        }
        metadata
    }

    /// The settings in words, which are equal only for settings that make the same picture.
    pub fn fingerprint(&self) -> String {
        let Self {
            estimator,
            rule,
            amounts,
            strategy,
            sampler,
            max_vertices,
            roulette_start,
            seed,
        } = self;
        let mut rule = rule.fingerprint();
        if amounts.has_batches() {
            rule += &format!(", {amounts:?}");
        }
        if let Some(strategy) = strategy {
            rule += &format!(", strategy {strategy} alone");
        }
        if !sampler.is_independent() && estimator.kind().row().takes_sobol {
            rule += &format!(", {sampler:?}");
        }
        format!(
            "{estimator:?}, {rule}, {max_vertices} vertices, roulette {roulette_start}, seed {seed}"
        )
    }
}

/// A path tracer at several levels and its sampler.
struct LevelIntegrator {
    tracer: LevelTracer,
    source: CameraSource,
}

impl Integrator for LevelIntegrator {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32 {
        let Self { tracer, source } = self;
        let Picture { film, aovs, levels } = picture;
        let levels =
            levels.get_or_insert_with(|| LevelFilm::new(film.size, film.window, tracer.levels()));
        match aovs {
            Some(aovs) => tracer.estimate(view, source, samples, film, levels, aovs),
            None => tracer.estimate(view, source, samples, film, levels, &mut ()),
        }
    }
}

/// A path tracer with manifold sampling.
struct ManifoldIntegrator {
    tracer: PathTracer<Unregularised>,
    source: CameraSource,
    trials: u32,
    /// Casters of the scene, from the first pass on.
    manifold: Option<Manifold>,
}

impl Integrator for ManifoldIntegrator {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32 {
        let Self {
            tracer,
            source,
            trials,
            manifold,
        } = self;
        let manifold = &*manifold.get_or_insert_with(|| Manifold::of(view.scene, *trials));
        let Picture { film, aovs, .. } = picture;
        let policy = || manifold.policy();
        match aovs {
            Some(aovs) => tracer.estimate_by(policy, view, source, samples, film, aovs),
            None => tracer.estimate_by(policy, view, source, samples, film, &mut ()),
        }
    }
}

/// A path tracer and its sampler.
struct PathIntegrator {
    tracer: PathTracer<Rule>,
    source: CameraSource,
    /// True if the picture is stored in batches, with features that guide its blur.
    is_blurred: bool,
}

impl Integrator for PathIntegrator {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32 {
        let Self {
            tracer,
            source,
            is_blurred,
        } = self;
        let Picture { film, aovs, levels } = picture;
        let is_plain = tracer.rule == Rule::Plain || !view.scene.features().lobes;
        if *is_blurred {
            let levels = levels.get_or_insert_with(|| LevelFilm::new(film.size, film.window, 1));
            let plain = tracer.with(Unregularised);
            return match (aovs, is_plain) {
                (None, true) => estimate(&plain, view, source, samples, film, levels, &mut ()),
                (None, _) => estimate(tracer, view, source, samples, film, levels, &mut ()),
                (Some(aovs), _) => estimate(tracer, view, source, samples, film, levels, aovs),
            };
        }
        // The loops that are run most are compiled for their rule; the others dispatch at every vertex.
        let ways = BsdfAlone::on_all_ways;
        match (aovs, &tracer.rule) {
            (Some(aovs), _) => tracer.estimate_by(ways, view, source, samples, film, aovs),
            // Nothing to roughen: a loop without path state of a rule.
            (None, _) if is_plain => {
                let tracer = tracer.with(Unregularised);
                tracer.estimate_by(ways, view, source, samples, film, &mut ())
            }
            (None, Rule::Accumulated(rule)) => {
                let tracer = tracer.with(rule);
                tracer.estimate_by(ways, view, source, samples, film, &mut ())
            }
            (None, _) => tracer.estimate_by(ways, view, source, samples, film, &mut ()),
        }
    }
}
