//! A session: scenes are opened and recorded once, then a table is learned for every β.

use crate::config::{Config, Optimiser};
use crate::learn::checkpoint::Checkpoint;
use crate::learn::crop_set::CropSet;
use crate::learn::outer_loop::{Outcome, OuterLoop, StepCallback, TrainError};
use crate::learn::recordings::{RecordedCrop, RecordingControl, Recordings};
use crate::record::crop::Crop;
use crate::record::target::{BRIGHTNESS, EPSILON};
use opsr::files::hex;
use opsr::regularise::file::Provenance;
use std::path::Path;
use std::time::Instant;

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
        Self::with(Recordings::open(config)?, control)
    }

    /// Records these crops.
    pub fn with_crops(
        config: Config,
        training: Vec<Crop>,
        validation: Vec<Crop>,
        control: &RecordingControl<'_>,
    ) -> Result<Self, TrainError> {
        Self::with(Recordings::of(config, training, validation)?, control)
    }

    fn with(recordings: Recordings, control: &RecordingControl<'_>) -> Result<Self, TrainError> {
        let clock = Instant::now();
        for (beta, path) in &control.checkpoints {
            let training = recordings.jobs.iter().filter(|job| job.training);
            let crops = training.map(|job| &job.crop);
            Checkpoint::load(
                path,
                &Checkpoint::fingerprint(&recordings.config, *beta, crops)?,
            )?;
        }
        let recorded = recordings.prepare(control)?;
        let Recordings { config, jobs } = recordings;
        let (mut training, mut validation) = (CropSet::default(), CropSet::default());
        for (job, RecordedCrop { source, visits }) in jobs.into_iter().zip(recorded) {
            let target = job.crop.target(config.spp);
            let set = if job.training {
                &mut training
            } else {
                &mut validation
            };
            set.push(job.crop, source, target, visits);
        }
        Ok(Self {
            config,
            training,
            validation,
            seconds: clock.elapsed().as_secs_f64(),
        })
    }

    /// Learns a table for one β.
    ///
    /// Checkpoints go to `last.ckpt` in `folder`, from which `resume` continues bit-identically. `listen` is called at
    /// every step and can stop the training.
    pub fn learn(
        &mut self,
        beta: f32,
        folder: Option<&Path>,
        resume: bool,
        listen: StepCallback<'_>,
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
        Provenance {
            opsr: env!("CARGO_PKG_VERSION").into(),
            loss: format!(
                "mean |I - f| / (f + {}) of the realised mean I of N samples + beta mean N/(N-1) (M2 - M1^2), the sample \
                 variance of one path sample; every crop scaled so that its reference has mean {}{}",
                EPSILON,
                BRIGHTNESS,
                match config.prior > 0.0 {
                    true => format!(
                        "; + {} mean (ln gamma - ln gamma of the suffix)^2",
                        config.prior
                    ),
                    false => String::new(),
                }
            ),
            beta: f64::from(beta),
            spp: config.spp,
            model: "full".into(),
            optimiser: format!(
                "{}, rate {}, beta1 0.9, beta2 0.999, epsilon 1e-8, factors kept in [0.001, 1]",
                match config.optimiser {
                    Optimiser::Adam => "Adam",
                    Optimiser::Log => "Adam on ln gamma",
                },
                config.step_size()
            ),
            method: format!(
                "{:?}, 1 recording(s) drawn at gamma {:?}, roulette below {} of the reference",
                config.method, config.record_gammas, config.roulette
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
