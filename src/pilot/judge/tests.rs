use super::*;
use crate::math::UVec2;

const AREA: bool = false;
const POINT: bool = true;
use IntegratorKind::{Bdpt, Path, Sppm, Vcm};

fn pilot(kind: IntegratorKind, cost: f64, mean: f64, variance: f64) -> PilotPicture {
    PilotPicture {
        kind,
        plain: true,
        levels: false,
        samples: 16.0,
        cost,
        mean: vec![mean; 1024],
        variance: vec![variance; 1024],
    }
}

fn levels(mean: f64, variance: f64) -> PilotPicture {
    PilotPicture {
        plain: false,
        levels: true,
        ..pilot(Path, 1.0, mean, variance)
    }
}

fn trials(pilots: &[PilotPicture], time: f64, punctual: bool) -> Vec<Trial> {
    judged(pilots, Window::full(UVec2::splat(32)), time, punctual)
}

#[test]
fn pilot_weighs_noise_and_cost() {
    let pilots = [pilot(Path, 1.0, 1.0, 4.0), pilot(Bdpt, 2.0, 1.0, 1.0)];
    let found = trials(&pilots, 800.0, AREA);
    // Relative error of a picture of ones.
    assert!((found[0].error.powi(2) - 4.0 / 800.0 / 1.01).abs() < 1e-12);
    assert!((found[1].error.powi(2) - 0.5 * found[0].error.powi(2)).abs() < 1e-12);
    assert!(found.iter().all(|t| t.missed == 0.0));
    // Half is not clearly less, a fifth is.
    assert_eq!(best(&found, 0), Some(0));
    let [path, _] = pilots;
    let found = trials(&[path, pilot(Bdpt, 2.0, 1.0, 0.4)], 800.0, AREA);
    assert_eq!(best(&found, 0), Some(1));
}

#[test]
fn pilot_counts_missing_light() {
    // A path tracer that finds no light is black: it has no noise, and the largest error.
    let pilots = [pilot(Path, 1.0, 0.0, 0.0), pilot(Vcm, 8.0, 1.0, 0.5)];
    for (punctual, missed) in [(POINT, 0.9), (AREA, -0.1)] {
        let found = trials(&pilots, 1600.0, punctual);
        assert!(found[0].error > 10.0 * found[1].error, "{found:?}");
        assert!(found[0].missed > missed);
        assert_eq!(best(&found, 0), Some(1));
    }
    // With enough time, light with area is found, and point light is not.
    let long = |punctual| trials(&pilots, 1e7, punctual)[0].error;
    assert!(long(AREA) < 0.1 && long(POINT) > 0.7);
    // A contender that misses light is not taken, however low its noise.
    let pilots = [pilot(Path, 1.0, 0.7, 1e-3), pilot(Vcm, 8.0, 1.0, 10.0)];
    let found = trials(&pilots, 16.0, POINT);
    assert!(found[0].missed > 0.01);
    assert_eq!(best(&found, 0), Some(1));
}

/// A picture with few of its bright samples looks free of noise. Contenders with more strategies have no more variance
/// and are advised.
#[test]
fn pilot_knows_whose_strategies_are_part_of_others() {
    let pilots = [
        pilot(Path, 1.0, 1.0, 0.001),
        pilot(Bdpt, 1.0, 1.0, 1.0),
        pilot(Vcm, 1.0, 1.0, 1.2),
        pilot(Sppm, 1.0, 1.0, 0.0),
        levels(1.0, 0.01),
    ];
    let found = trials(&pilots, 16.0, AREA);
    for trial in &found[..4] {
        let of_sample = trial.error.powi(2) * trial.samples * 1.01;
        assert!((of_sample - 1.2).abs() < 1e-9, "{trial:?}");
    }
    // Roughened paths have less variance, which does not prove that they find all light.
    assert!(found[4].error < 0.2 * found[2].error);
    assert_eq!(best(&found, 2), Some(2));
    assert_eq!(best(&found, 0), Some(4));
}

/// Ten bright samples of any contender never decide for one with fewer strategies.
#[test]
fn no_ten_fireflies_decide() {
    for kind in [Path, Bdpt, Vcm] {
        let mut pilots = [
            pilot(Path, 1.0, 1.0, 1.0),
            pilot(Bdpt, 2.5, 1.0, 0.6),
            pilot(Vcm, 3.0, 1.0, 0.5),
            levels(1.0, 0.8),
        ];
        for pilot in pilots.iter_mut().filter(|d| d.kind == kind && !d.levels) {
            for pixel in (0..1000).step_by(100) {
                (pilot.mean[pixel], pilot.variance[pixel]) = (1e3, 1e8);
            }
        }
        let found = trials(&pilots, 800.0, AREA);
        assert_eq!(best(&found, 2), Some(2), "{kind:?}: {found:?}");
    }
}

/// A bright sample of one contender must not raise the pixel's radiance and so lower its own error.
#[test]
fn pilot_takes_the_radiance_that_most_contenders_show() {
    let mut bright = pilot(Path, 1.0, 1.0, 1.0);
    bright.mean[5] = 1e3;
    let pilots = [
        bright,
        pilot(Bdpt, 1.0, 1.0, 1.0),
        pilot(Vcm, 1.0, 1.0, 1.0),
    ];
    assert_eq!(radiance(&pilots, AREA)[5], 1.0);
}
