//! A session: scenes are opened and recorded once, then a table is learned for every β.

use crate::files::hex;
use crate::gallery::manifest::Role;
use crate::memory;
use crate::regularise::file::Provenance;
use crate::sampler::{Domain, Seed};
use crate::train::config::{Config, Evaluation, Loss, Optimiser};
use crate::train::evaluate::MomentSource;
use crate::train::evaluate::curves::Curves;
use crate::train::evaluate::fresh::Fresh;
use crate::train::evaluate::replay::Replay;
use crate::train::learn::checkpoint::Checkpoint;
use crate::train::learn::crop_set::CropSet;
use crate::train::learn::outer_loop::{Listener, Outcome, OuterLoop, TrainError};
use crate::train::record::crop::{BRIGHTNESS, Crop, DatasetError, EPSILON};
use crate::train::record::recording::Recording;
use crate::train::record::visits::Visits;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Place of the recordings of a session, and the wishes of whoever waits for them.
pub struct RecordingControl<'a> {
    /// Folder of recordings: those in it are read, others are traced and kept there; `None` for memory alone.
    pub folder: Option<PathBuf>,
    /// Checkpoints that are to be resumed, with their β. One of another training is refused before anything is recorded.
    pub checkpoints: Vec<(f32, PathBuf)>,
    /// Set to end the recording with [`DatasetError::Stopped`].
    pub stop: Arc<AtomicBool>,
    /// Hears of every crop that begins.
    pub listen: &'a (dyn Fn(&RecordingProgress<'_>) + Sync),
}

impl Default for RecordingControl<'_> {
    fn default() -> Self {
        Self {
            folder: None,
            checkpoints: Vec::new(),
            stop: Arc::default(),
            listen: &|_| (),
        }
    }
}

/// State of the recordings of a session.
#[derive(Clone, Copy, Debug)]
pub struct RecordingProgress<'a> {
    /// Name of the crop that begins.
    pub crop: &'a str,
    /// Recordings that are done.
    pub done: usize,
    /// All recordings.
    pub of: usize,
    /// Time left, extrapolated from the recordings that were traced; `None` before the first.
    pub left: Option<Duration>,
}

/// An opened and recorded training.
pub struct Session {
    /// The configuration.
    pub config: Config,
    /// Crops that are learned from.
    pub training: CropSet,
    /// Crops that are only scored.
    pub validation: CropSet,
    /// Wall-clock seconds of recording and baking.
    pub seconds: f64,
}

impl Session {
    /// Opens the scenes of a configuration and records them.
    pub fn open(config: Config, control: &RecordingControl<'_>) -> Result<Self, TrainError> {
        config.check()?;
        let held_out = |family: &str| family == config.hold_out;
        let chosen = |name: &String| config.scenes.is_empty() || config.scenes.contains(name);
        let crops = Crop::open_all(&config.manifest, |e| {
            e.role == Role::Validation || held_out(&e.family) || chosen(&e.name)
        })?;
        let (training, validation): (Vec<Crop>, Vec<Crop>) =
            (crops.into_iter()).partition(|c| c.role == Role::Train && !held_out(&c.family));
        if let Some(missing) =
            (config.scenes.iter()).find(|name| !training.iter().any(|c| c.scene_name == **name))
        {
            return Err(TrainError::Empty(format!(
                "{}: no training scene `{missing}`",
                config.manifest.display()
            )));
        }
        Self::with_crops(config, training, validation, control)
    }

    /// Records these crops.
    pub fn with_crops(
        config: Config,
        training: Vec<Crop>,
        validation: Vec<Crop>,
        control: &RecordingControl<'_>,
    ) -> Result<Self, TrainError> {
        config.check()?;
        if training.is_empty() {
            return Err(TrainError::Empty("no scene to learn from".into()));
        }
        let clock = Instant::now();
        let training = training.into_iter().map(|crop| (crop, true));
        let validation = validation.into_iter().map(|crop| (crop, false));
        let jobs: Vec<RecordingJob> = training
            .chain(validation)
            .flat_map(|(crop, training)| RecordingJob::replicates(crop, training, &config))
            .collect();
        for (beta, path) in &control.checkpoints {
            let crops = jobs.iter().filter(|job| job.training).map(|job| &job.crop);
            Checkpoint::load(path, &Checkpoint::fingerprint(&config, *beta, crops)?)?;
        }
        check_memory(&jobs, &config)?;
        // Before any path is traced: a new recording must not come to lie beside those of other settings.
        if let Some(folder) = &control.folder {
            for (index, job) in jobs.iter().enumerate() {
                job.check_kept(&config, &folder.join(job.file_name(index)))?;
            }
        }
        let mut session = Self {
            training: CropSet::default(),
            validation: CropSet::default(),
            seconds: 0.0,
            config,
        };
        for (job, recorded) in jobs.iter().zip(run_all(&jobs, &session.config, control)) {
            let RecordedCrop { source, visits, .. } = recorded?;
            let target = job.crop.target(session.config.spp);
            let set = match job.training {
                true => &mut session.training,
                false => &mut session.validation,
            };
            set.push(job.crop.clone(), source, target, visits);
        }
        session.seconds = clock.elapsed().as_secs_f64();
        Ok(session)
    }

    /// Learns a table for one β.
    ///
    /// The state is kept in `last.ckpt` of `folder`, from which `resume` continues bit-identically. The listener hears
    /// of every step and can stop the training.
    pub fn learn(
        &mut self,
        beta: f32,
        folder: Option<&Path>,
        resume: bool,
        listen: Listener<'_>,
    ) -> Result<Outcome, TrainError> {
        let (training, validation) = (&mut self.training, &mut self.validation);
        let mut outer = OuterLoop::new(&self.config, training, validation, beta, folder)?;
        if resume {
            outer = outer.resume()?;
        }
        outer.run(listen)
    }

    /// Provenance of a table after `steps` steps, for its file.
    pub fn provenance(&self, beta: f32, start: f32, steps: u32) -> Provenance {
        let config = &self.config;
        let mut scenes: Vec<(String, String)> = Vec::new();
        for crop in self.training.crops() {
            let hash = hex(&crop.digest);
            let scene = (crop.scene_name.clone(), hash);
            if !scenes.contains(&scene) {
                scenes.push(scene);
            }
        }
        let kind = match config.loss {
            Loss::Published => "of the realised mean I of N samples",
            Loss::NoiseFree => "of the mean I of all recorded samples",
        };
        Provenance {
            opsr: env!("CARGO_PKG_VERSION").into(),
            loss: format!(
                "mean |I - f| / (f + {}) {kind} + beta mean N/(N-1) (M2 - M1^2), the sample variance of one path \
                 sample; every crop scaled so that its reference has mean {}",
                EPSILON, BRIGHTNESS
            ),
            beta: f64::from(beta),
            spp: config.spp,
            model: format!("{:?}", config.model).to_lowercase(),
            optimiser: format!(
                "{}, rate {}, beta1 0.9, beta2 0.999, epsilon 1e-8, factors kept in [0.001, 1]",
                match config.optimiser {
                    Optimiser::Adam => "Adam",
                    Optimiser::Log => "Adam on ln gamma",
                },
                config.step_size()
            ),
            method: format!(
                "{:?}, {} recording(s) drawn at gamma {:?}, roulette below {} of the reference",
                config.method, config.replicates, config.record_gammas, config.roulette
            )
            .to_lowercase(),
            steps,
            seed: config.seed,
            scenes,
            start,
            visits: self.training.visits().0,
        }
    }
}

/// A recorded crop.
struct RecordedCrop {
    source: Box<dyn MomentSource>,
    /// Events per class.
    visits: Visits,
    /// True if its paths were traced now, not read from a file.
    traced: bool,
}

type Recorded = Result<RecordedCrop, DatasetError>;

/// A crop to record.
struct RecordingJob {
    crop: Crop,
    /// True if the crop is learned from.
    training: bool,
    seed: Seed,
    spp: u32,
}

impl RecordingJob {
    /// The recordings of a crop: `replicates` of a training crop, one of a validation crop.
    fn replicates(crop: Crop, training: bool, config: &Config) -> Vec<Self> {
        // The noise-free loss has one image of all samples.
        let (replicates, spp) = match config.loss {
            Loss::Published => (config.replicates, config.spp),
            Loss::NoiseFree => (1, config.spp.saturating_mul(config.replicates)),
        };
        let replicates = 0..if training { replicates } else { 1 };
        let domain = if training {
            Domain::Recording
        } else {
            Domain::Validation
        };
        let job = |replicate| Self {
            crop: crop.clone(),
            training,
            seed: Seed(config.seed).derive(domain, u64::from(replicate)),
            spp,
        };
        replicates.map(job).collect()
    }

    /// Records the crop and prepares the configured evaluation.
    fn run(&self, config: &Config, place: Option<&Path>, stop: &Arc<AtomicBool>) -> Recorded {
        let Self { crop, seed, .. } = self;
        let middle = config.constant(config.record_gammas[config.record_gammas.len() / 2]);
        let fresh = self.is_fresh(config);
        let (recording, traced) = self.recording(config, place, stop)?;
        if stop.load(Ordering::Relaxed) {
            return Err(DatasetError::Stopped);
        }
        let mut visits = Visits::default();
        visits.count(&recording, &middle);
        let source: Box<dyn MomentSource> = match config.method {
            Evaluation::Fresh if fresh => Box::new(Fresh::new(crop.clone(), self.spp, *seed)),
            Evaluation::Replay => Box::new(Replay::new(recording)),
            Evaluation::Fresh | Evaluation::Tabulated => {
                Box::new(Curves::bake(&recording, &middle))
            }
        };
        Ok(RecordedCrop {
            source,
            visits,
            traced,
        })
    }

    /// True if the paths are traced again at every step.
    fn is_fresh(&self, config: &Config) -> bool {
        config.method == Evaluation::Fresh && self.training
    }

    /// Samples per pixel of the recording, of which visits are counted with any evaluation.
    fn recorded_spp(&self, config: &Config) -> u32 {
        match self.is_fresh(config) {
            true => self.spp.min(64),
            false => self.spp,
        }
    }

    /// Fingerprint of the recording's file.
    fn fingerprint(&self, config: &Config) -> String {
        let spp = self.recorded_spp(config);
        (self.crop).fingerprint(&config.record_gammas, config.roulette, spp, self.seed)
    }

    /// Refuses a file of another recording in this place.
    fn check_kept(&self, config: &Config, place: &Path) -> Result<(), DatasetError> {
        if place.exists() {
            Recording::check(place, &self.fingerprint(config))?;
        }
        Ok(())
    }

    /// The recording in a file, or else a new one, which is kept there; and whether it is new.
    fn recording(
        &self,
        config: &Config,
        place: Option<&Path>,
        stop: &Arc<AtomicBool>,
    ) -> Result<(Recording, bool), DatasetError> {
        let (crop, gammas, roulette) = (&self.crop, &config.record_gammas, config.roulette);
        let spp = self.recorded_spp(config);
        let Some(place) = place else {
            let recording = crop.record_until(gammas, roulette, spp, self.seed, stop)?;
            return Ok((recording, true));
        };
        let fingerprint = self.fingerprint(config);
        if place.exists() {
            let kept = Recording::load(place, &fingerprint, crop.window.len())?;
            return Ok((kept, false));
        }
        let recording = crop.record_until(gammas, roulette, spp, self.seed, stop)?;
        if let Err(error) = recording.save(place, &fingerprint) {
            // It is of use only if the training is stopped.
            tracing::warn!("a recording is not kept, so that --resume makes it again: {error}");
        }
        Ok((recording, true))
    }

    /// Name of the recording's file.
    fn file_name(&self, index: usize) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
        let name: String = self.crop.name.chars().take(100).map(plain).collect();
        format!("{index:03}-{name}.{RECORDING}")
    }
}

/// Bytes of a recorded path: in curves, which the nine training scenes take with 1024 samples per pixel, and as events.
const CURVE_BYTES: u64 = 50;
const EVENT_BYTES: u64 = 30;

/// Refuses recordings that need more memory than there is. Two are in the making at a time, in up to three copies.
fn check_memory(jobs: &[RecordingJob], config: &Config) -> Result<(), TrainError> {
    let paths = |job: &RecordingJob| u64::from(job.spp) * job.crop.window.len() as u64;
    let each = |job: &RecordingJob| match config.method {
        Evaluation::Replay => EVENT_BYTES,
        // One recording at a time, made and left again.
        Evaluation::Fresh if job.training => 0,
        Evaluation::Fresh | Evaluation::Tabulated => CURVE_BYTES,
    };
    let kept: u64 = jobs.iter().map(|job| each(job) * paths(job)).sum();
    let making = 2 * 3 * EVENT_BYTES * jobs.iter().map(paths).max().unwrap_or(0);
    let what = format!("recordings of {} crops", jobs.len());
    Ok(memory::check(what, kept + making)?)
}

/// Ending of the names of recordings.
pub const RECORDING: &str = "recording";

/// Runs jobs, two at a time: while one thread puts a recording together, the paths of another are traced. Results are
/// in the order of the jobs, up to the first error.
fn run_all(
    jobs: &[RecordingJob],
    config: &Config,
    control: &RecordingControl<'_>,
) -> Vec<Recorded> {
    let clock = Instant::now();
    let (next, done, traced) = (
        AtomicUsize::new(0),
        AtomicUsize::new(0),
        AtomicUsize::new(0),
    );
    let worker = || {
        let mut results = Vec::new();
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(job) = jobs.get(index) else {
                return results;
            };
            let (done_now, traced_now) =
                (done.load(Ordering::Relaxed), traced.load(Ordering::Relaxed));
            let left = jobs.len().saturating_sub(done_now) as f64 / traced_now as f64;
            (control.listen)(&RecordingProgress {
                crop: &job.crop.name,
                done: done_now,
                of: jobs.len(),
                left: Duration::try_from_secs_f64(clock.elapsed().as_secs_f64() * left).ok(),
            });
            let place = control
                .folder
                .as_ref()
                .map(|f| f.join(job.file_name(index)));
            let result = job.run(config, place.as_deref(), &control.stop);
            done.fetch_add(1, Ordering::Relaxed);
            match &result {
                Ok(crop) => drop(traced.fetch_add(usize::from(crop.traced), Ordering::Relaxed)),
                Err(_) => next.store(jobs.len(), Ordering::Relaxed),
            }
            results.push((index, result));
        }
    };
    let (mut results, others) = rayon::join(worker, worker);
    results.extend(others);
    results.sort_unstable_by_key(|(index, _)| *index);
    results.into_iter().map(|(_, result)| result).collect()
}
