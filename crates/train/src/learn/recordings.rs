//! The recordings of a training: traced by it, or read from files that other processes wrote before.

use crate::config::{Config, Evaluation};
use crate::evaluate::MomentSource;
use crate::evaluate::curves::Curves;
use crate::evaluate::replay::Replay;
use crate::learn::outer_loop::TrainError;
use crate::manifest::Role;
use crate::record::crop::{Crop, DatasetError};
use crate::record::recording::Recording;
use crate::record::visits::Visits;
use opsr::files;
use opsr::memory;
use opsr::sampler::{Domain, Seed};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

/// Folder of a session's recordings, its stop flag, and its progress callback.
pub struct RecordingControl<'a> {
    /// Folder of recordings: files in it are read, missing ones are traced and saved there. `None` writes no files.
    pub folder: Option<PathBuf>,
    /// True if the folder must have all recordings and no others. Then no path is traced.
    pub complete: bool,
    /// Checkpoints to resume, with their β. A checkpoint of another training is an error before any path is traced.
    pub checkpoints: Vec<(f32, PathBuf)>,
    /// Set to end the recording with [`DatasetError::Stopped`].
    pub stop: Arc<AtomicBool>,
    /// Callback at the start of every crop.
    pub listen: &'a (dyn Fn(&RecordingProgress<'_>) + Sync),
}

impl Default for RecordingControl<'_> {
    fn default() -> Self {
        Self {
            folder: None,
            complete: false,
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
    /// Number of finished recordings.
    pub done: usize,
    /// Number of all recordings.
    pub of: usize,
    /// Time left, extrapolated from the recordings that were traced; `None` before the first.
    pub left: Option<Duration>,
}

/// The crops of a training and the settings of their recordings, in order.
pub struct Recordings {
    pub(super) config: Config,
    pub(super) jobs: Vec<RecordingJob>,
}

impl Recordings {
    /// Opens the scenes of a configuration.
    pub fn open(config: Config) -> Result<Self, TrainError> {
        config.check()?;
        let held_out = |family: &str| family == config.hold_out;
        let chosen = |name: &String| config.scenes.is_empty() || config.scenes.contains(name);
        let crops = Crop::open_all(&config.manifest, |e| {
            e.role == Role::Validation || held_out(&e.family) || chosen(&e.name)
        })?;
        let (training, validation): (Vec<Crop>, Vec<Crop>) = crops
            .into_iter()
            .partition(|c| c.role == Role::Train && !held_out(&c.family));
        if let Some(missing) = config
            .scenes
            .iter()
            .find(|name| !training.iter().any(|c| c.scene_name == **name))
        {
            return Err(TrainError::Empty(format!(
                "{}: no training scene `{missing}`",
                config.manifest.display()
            )));
        }
        Self::of(config, training, validation)
    }

    /// The recordings of these crops.
    pub fn of(
        config: Config,
        training: Vec<Crop>,
        validation: Vec<Crop>,
    ) -> Result<Self, TrainError> {
        config.check()?;
        if training.is_empty() {
            return Err(TrainError::Empty("no scene to learn from".into()));
        }
        let training = training.into_iter().map(|crop| (crop, true));
        let validation = validation.into_iter().map(|crop| (crop, false));
        let jobs = training
            .chain(validation)
            .enumerate()
            .map(|(index, (crop, training))| RecordingJob::new(index, crop, training, &config))
            .collect();
        Ok(Self { config, jobs })
    }

    /// Names of the files in a folder of recordings, in order.
    pub fn names(&self) -> Vec<String> {
        self.jobs.iter().map(RecordingJob::file_name).collect()
    }

    /// The crops in the order of [`Recordings::names`]; true for crops that are learned from.
    pub fn crops(&self) -> impl Iterator<Item = (&Crop, bool)> {
        self.jobs.iter().map(|job| (&job.crop, job.training))
    }

    /// Records the crops with these numbers into the folder. Complete files there are kept; damaged files and files of
    /// other settings are errors.
    ///
    /// Panics for numbers that do not exist.
    pub fn record(
        &self,
        numbers: Range<usize>,
        control: &RecordingControl<'_>,
    ) -> Result<(), TrainError> {
        let jobs = &self.jobs[numbers];
        let largest = jobs.iter().map(RecordingJob::paths).max().unwrap_or(0);
        let what = format!("recordings of {} crops", jobs.len());
        memory::check(what, MAKING * largest)?;
        self.check_kept(jobs, control)?;
        let record = |job: &RecordingJob, place: Option<&Path>| {
            if job.kept(&self.config, place)?.is_some() {
                return Ok(((), false));
            }
            let recording = job.trace(&self.config, &control.stop)?;
            let fingerprint = job.fingerprint(&self.config);
            place.map_or(Ok(()), |place| recording.save(place, &fingerprint))?;
            Ok(((), true))
        };
        let done = run_all(jobs, control, &record);
        Ok(done.into_iter().collect::<Result<_, _>>()?)
    }

    /// Records or reads all crops, and prepares the configured evaluation.
    pub(super) fn prepare(
        &self,
        control: &RecordingControl<'_>,
    ) -> Result<Vec<RecordedCrop>, TrainError> {
        check_memory(&self.jobs, &self.config)?;
        self.check_kept(&self.jobs, control)?;
        if control.complete {
            self.check_complete(control.folder.as_deref().unwrap_or(Path::new("")))?;
        }
        let prepare =
            |job: &RecordingJob, place: Option<&Path>| job.run(&self.config, place, &control.stop);
        let done = run_all(&self.jobs, control, &prepare);
        Ok(done.into_iter().collect::<Result<_, _>>()?)
    }

    /// Refuses files of other settings before any path is traced, so that no folder mixes recordings of two settings.
    fn check_kept(
        &self,
        jobs: &[RecordingJob],
        control: &RecordingControl<'_>,
    ) -> Result<(), DatasetError> {
        for (folder, job) in control
            .folder
            .iter()
            .flat_map(|f| jobs.iter().map(move |j| (f, j)))
        {
            let place = folder.join(job.file_name());
            if place.exists() {
                Recording::check(&place, &job.fingerprint(&self.config))?;
            }
        }
        Ok(())
    }

    /// Refuses a folder with recordings of other crops, or without some of these.
    fn check_complete(&self, folder: &Path) -> Result<(), DatasetError> {
        let (names, there) = (self.names(), recordings_in(folder));
        let own = |path: &PathBuf| names.iter().any(|name| path.ends_with(name));
        if let Some(foreign) = there.iter().find(|path| !own(path)) {
            let what = "belongs to no crop of this training";
            return Err(files::FileError::content(foreign, what).into());
        }
        let is_missing = |name: &String| !there.iter().any(|path| path.ends_with(name));
        let missing: Vec<String> = names.into_iter().filter(is_missing).collect();
        match missing.is_empty() {
            true => Ok(()),
            false => Err(DatasetError::Unrecorded {
                folder: folder.into(),
                missing,
            }),
        }
    }
}

/// Paths of the recordings in a folder, sorted; none for a folder that cannot be read.
pub fn recordings_in(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let paths = entries.map(|entry| entry.path());
    let mut paths: Vec<PathBuf> = paths
        .filter(|path| path.extension().is_some_and(|e| e == RECORDING))
        .collect();
    paths.sort();
    paths
}

/// A recorded crop.
pub(super) struct RecordedCrop {
    pub(super) source: Box<dyn MomentSource>,
    /// Events per class.
    pub(super) visits: Visits,
}

/// Result of a job, and true if its paths were traced now, not read from a file.
type Recorded<T> = Result<(T, bool), DatasetError>;

/// A crop to record.
pub(super) struct RecordingJob {
    /// Number among the crops of the training.
    index: usize,
    pub(super) crop: Crop,
    /// True if the crop is learned from.
    pub(super) training: bool,
    seed: Seed,
    spp: u32,
}

impl RecordingJob {
    /// The job of a crop, which is number `index` of the training.
    fn new(index: usize, crop: Crop, training: bool, config: &Config) -> Self {
        let domain = if training {
            Domain::Recording
        } else {
            Domain::Validation
        };
        Self {
            index,
            crop,
            training,
            seed: Seed(config.seed).derive(domain, 0),
            spp: config.spp,
        }
    }

    /// Records the crop, or reads its recording, and prepares the configured evaluation.
    fn run(
        &self,
        config: &Config,
        place: Option<&Path>,
        stop: &Arc<AtomicBool>,
    ) -> Recorded<RecordedCrop> {
        let middle = config.constant(config.record_gammas[config.record_gammas.len() / 2]);
        let kept = self.kept(config, place)?;
        let traced = kept.is_none();
        let recording = match kept {
            Some(recording) => recording,
            None => self.trace(config, stop)?,
        };
        if traced
            && let Some(place) = place
            && let Err(error) = recording.save(place, &self.fingerprint(config))
        {
            // The file only saves time if the training is stopped and resumed.
            tracing::warn!("a recording is not kept, so that --resume makes it again: {error}");
        }
        if stop.load(Ordering::Relaxed) {
            return Err(DatasetError::Stopped);
        }
        let mut visits = Visits::default();
        visits.count(&recording, &middle);
        let source: Box<dyn MomentSource> = match config.method {
            Evaluation::Replay => Box::new(Replay::new(recording)),
            Evaluation::Tabulated => Box::new(Curves::bake(&recording, &middle)),
        };
        Ok((RecordedCrop { source, visits }, traced))
    }

    /// Fingerprint of the recording's file.
    fn fingerprint(&self, config: &Config) -> String {
        self.crop
            .fingerprint(&config.record_gammas, config.roulette, self.spp, self.seed)
    }

    /// The recording in a file, if it is there.
    fn kept(
        &self,
        config: &Config,
        place: Option<&Path>,
    ) -> Result<Option<Recording>, DatasetError> {
        let Some(place) = place.filter(|place| place.exists()) else {
            return Ok(None);
        };
        let pixels = self.crop.window.len();
        Ok(Some(Recording::load(
            place,
            &self.fingerprint(config),
            pixels,
        )?))
    }

    fn trace(&self, config: &Config, stop: &Arc<AtomicBool>) -> Result<Recording, DatasetError> {
        let Config {
            record_gammas,
            roulette,
            ..
        } = config;
        self.crop
            .record_until(record_gammas, *roulette, self.spp, self.seed, stop)
    }

    /// Number of paths of the recording.
    fn paths(&self) -> u64 {
        u64::from(self.spp) * self.crop.window.len() as u64
    }

    /// Name of the recording's file.
    fn file_name(&self) -> String {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
        let name: String = self.crop.name.chars().take(100).map(plain).collect();
        format!("{:03}-{name}.{RECORDING}", self.index)
    }
}

/// Bytes of a recorded path as curves, measured on the nine training scenes at 1024 samples per pixel, and as events.
const CURVE_BYTES: u64 = 50;
const EVENT_BYTES: u64 = 30;

/// Bytes for each path of the largest recording: two are made at a time, in up to three copies.
const MAKING: u64 = 2 * 3 * EVENT_BYTES;

/// Refuses recordings that need more memory than there is.
fn check_memory(jobs: &[RecordingJob], config: &Config) -> Result<(), TrainError> {
    let each = match config.method {
        Evaluation::Replay => EVENT_BYTES,
        Evaluation::Tabulated => CURVE_BYTES,
    };
    let kept: u64 = jobs.iter().map(|job| each * job.paths()).sum();
    let making = MAKING * jobs.iter().map(RecordingJob::paths).max().unwrap_or(0);
    let what = format!("recordings of {} crops", jobs.len());
    Ok(memory::check(what, kept + making)?)
}

/// File name extension of recordings.
pub(crate) const RECORDING: &str = "recording";

/// Runs jobs, two at a time: while one thread assembles a recording, the paths of another are traced. Results are in
/// the order of the jobs, up to the first error.
fn run_all<T: Send>(
    jobs: &[RecordingJob],
    control: &RecordingControl<'_>,
    run: &(dyn Fn(&RecordingJob, Option<&Path>) -> Recorded<T> + Sync),
) -> Vec<Result<T, DatasetError>> {
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
                .map(|folder| folder.join(job.file_name()));
            let result = run(job, place.as_deref());
            done.fetch_add(1, Ordering::Relaxed);
            match &result {
                Ok((_, new)) => drop(traced.fetch_add(usize::from(*new), Ordering::Relaxed)),
                Err(_) => next.store(jobs.len(), Ordering::Relaxed),
            }
            results.push((index, result));
        }
    };
    let (mut results, others) = rayon::join(worker, worker);
    results.extend(others);
    results.sort_unstable_by_key(|(index, _)| *index);
    let results = results.into_iter();
    results.map(|(_, result)| Ok(result?.0)).collect()
}
