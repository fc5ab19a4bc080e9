//! Hard numerical case 15, in the trainer: non-finite gradients, fireflies, factors at their bounds, black crops.

use crate::train::crop;
use opsr::regularise::{AttenuationTable, LEN};
use opsr::sampler::Seed;
use opsr_lab::verify::learning::quick;
use opsr_train::config::Evaluation;
use opsr_train::evaluate::replay::Replay;
use opsr_train::evaluate::{Adjoint, MomentSource, Moments};
use opsr_train::learn::loss::LossBackend;
use opsr_train::learn::outer_loop::Outcome;
use opsr_train::record::visits::Visits;
use opsr_train::{RecordingControl, Session, TrainError};
use std::ops::ControlFlow;
use std::path::Path;

/// A planted value, and the calls at which it appears.
#[derive(Clone, Copy)]
enum Fault {
    Never,
    Gradient(f64, fn(u32) -> bool),
    Firefly(f32, fn(u32) -> bool),
}

/// A replay with a fault.
struct Faulty {
    good: Replay,
    fault: Fault,
    calls: u32,
}

impl MomentSource for Faulty {
    fn moments(&mut self, table: &AttenuationTable) -> Moments {
        self.calls += 1;
        let mut moments = self.good.moments(table);
        if let Fault::Firefly(value, when) = self.fault
            && when(self.calls)
        {
            moments.mean[0] = [value; 3];
            moments.second[0] = 3.0 * value * value;
        }
        moments
    }

    fn gradient(&self, table: &AttenuationTable, adjoint: &Adjoint) -> Vec<f64> {
        let mut gradient = self.good.gradient(table, adjoint);
        if let Fault::Gradient(value, when) = self.fault
            && when(self.calls)
        {
            gradient[LEN / 2] = value;
        }
        gradient
    }
}

fn learn(steps: u32, fault: Fault, folder: Option<&Path>) -> Result<Outcome, TrainError> {
    let mut config = quick(Evaluation::Replay);
    config.steps = steps;
    // A validation computes the moments, too.
    config.validate_every = 1000;
    let crop = crop(6);
    let recording = crop.record(&config.record_gammas, config.roulette, config.spp, Seed(1))?;
    let target = crop.target(config.spp);
    let mut session = Session::with_crops(
        config,
        vec![crop.clone()],
        vec![],
        &RecordingControl::default(),
    )?;
    session.training.remove(|_| true);
    let source = Faulty {
        good: Replay::new(recording),
        fault,
        calls: 0,
    };
    session
        .training
        .push(crop, Box::new(source), target, Visits::default());
    session.learn(0.001, folder, false, &mut |_, _, _| {
        ControlFlow::Continue(())
    })
}

#[test]
fn case_15_nan_gradients_leave_table_and_optimiser_unchanged() {
    let good = learn(10, Fault::Never, None).unwrap();
    assert_eq!(good.skipped, 0);
    let when = |call| call == 4 || call == 7;
    for fault in [
        Fault::Gradient(f64::NAN, when),
        Fault::Gradient(f64::NEG_INFINITY, when),
        // Its square overflows single precision, and Adam's moment would stay infinite.
        Fault::Gradient(1e30, when),
        Fault::Firefly(f32::NAN, when),
        Fault::Firefly(1e30, when),
    ] {
        let outcome = learn(12, fault, None).unwrap();
        assert_eq!((outcome.steps, outcome.skipped), (12, 2));
        assert_eq!(outcome.table, good.table);
    }
    assert_ne!(learn(12, Fault::Never, None).unwrap().table, good.table);
}

#[test]
fn case_15_too_many_nan_gradients_fail_with_a_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let fault = Fault::Gradient(f64::NAN, |call| call > 3);
    let error = learn(1000, fault, Some(folder.path())).unwrap_err();
    let TrainError::NotFinite { step, skipped } = error else {
        panic!("{error}");
    };
    // The first call belongs to a validation.
    assert_eq!((step, skipped), (102, 100));
    assert!(folder.path().join("last.ckpt").exists());
}

/// A regression: a NaN loss became the best one, and its checkpoint could not be read.
#[test]
fn case_15_nan_loss_is_never_the_best() {
    let folder = tempfile::tempdir().unwrap();
    let crop = crop(6);
    let mut session = Session::with_crops(
        quick(Evaluation::Replay),
        vec![crop.clone()],
        vec![],
        &RecordingControl::default(),
    )
    .expect("a session");
    let recording = crop.record(&[0.05], 0.0, 8, Seed(1)).expect("a recording");
    let source = Faulty {
        good: Replay::new(recording),
        fault: Fault::Firefly(f32::NAN, |_| true),
        calls: 0,
    };
    let target = crop.target(8);
    let visits = Visits::default();
    session
        .validation
        .push(crop, Box::new(source), target, visits);
    for resume in [false, true] {
        let mut listen = |_: u32, _: f32, _: Option<&_>| ControlFlow::Continue(());
        let outcome = session.learn(0.001, Some(folder.path()), resume, &mut listen);
        assert_eq!(outcome.expect("an outcome").best, None);
    }
}

#[test]
fn case_15_gradients_are_finite_at_bounds_and_on_black_crops() {
    for method in [Evaluation::Replay, Evaluation::Tabulated] {
        for black in [false, true] {
            let mut crop = crop(6);
            if black {
                crop.reference.iter_mut().for_each(|p| *p = [0.0; 3]);
            }
            let mut session = Session::with_crops(
                quick(method),
                vec![crop],
                vec![],
                &RecordingControl::default(),
            )
            .expect("a session");
            for backend in [LossBackend::Autodiff, LossBackend::Scalar] {
                let objective = session.training.objective(0.001, backend);
                for gamma in [0.0, 1e-3, 0.5, 1.0] {
                    let table = AttenuationTable::constant(gamma);
                    let (loss, gradient) = session.training.gradient(&objective, &table);
                    let case = format!("{method:?} {backend:?} {black} {gamma}");
                    assert!(loss.is_finite(), "{case}: {loss}");
                    assert_eq!(gradient.iter().position(|g| !g.is_finite()), None, "{case}");
                }
            }
            let outcome = session
                .learn(0.001, None, false, &mut |_, _, _| ControlFlow::Continue(()))
                .unwrap();
            assert_eq!(outcome.skipped, 0);
            let mut gammas = outcome.table.gammas.iter();
            assert!(
                gammas.all(|g| (1e-3..=1.0).contains(g)),
                "{method:?} {black}"
            );
        }
    }
}
