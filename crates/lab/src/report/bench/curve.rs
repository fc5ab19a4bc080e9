//! Reading error curves: at a time, at a number of samples, and where one method overtakes another.

use super::results::{Point, Run};
use super::suite::Clock;

impl Clock {
    /// Seconds of a point by this clock; CPU time is divided by the threads.
    pub fn seconds(self, point: &Point, threads: usize) -> f64 {
        match self {
            Self::Wall => point.wall,
            Self::Cpu => point.cpu / threads.max(1) as f64,
        }
    }
}

/// The error of a run at a time in seconds, interpolated by a power law.
///
/// Passes do not end exactly at the time points: the next record is a little late. The slope from the record before
/// corrects its error. `None` outside of the recorded times.
pub fn at_seconds(run: &Run, metric: &str, t: f64, seconds: &dyn Fn(&Point) -> f64) -> Option<f64> {
    let points = &run.points;
    let late = points.iter().position(|p| seconds(p) >= t)?;
    let (b, error_b) = (seconds(&points[late]), *points[late].errors.get(metric)?);
    if b == t {
        return Some(error_b);
    }
    let early = &points[late.checked_sub(1)?];
    let (a, error_a) = (seconds(early), *early.errors.get(metric)?);
    Some(between((a, error_a), (b, error_b), t))
}

/// A power law through two points; a straight line if an error is zero.
fn between((a, error_a): (f64, f64), (b, error_b): (f64, f64), t: f64) -> f64 {
    let s = (t / a).ln() / (b / a).ln();
    if !s.is_finite() {
        return error_b;
    }
    if error_a > 0.0 && error_b > 0.0 {
        (error_a.ln() * (1.0 - s) + error_b.ln() * s).exp()
    } else {
        error_a * (1.0 - s) + error_b * s
    }
}

/// The error of a run at exactly this number of samples; `None` without such a record.
pub fn at_samples(run: &Run, metric: &str, samples: u32) -> Option<f64> {
    let point = run.points.iter().find(|p| p.samples == samples)?;
    point.errors.get(metric).copied()
}

/// Point from which on the baseline is better than a method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Crossing {
    /// The method is never better: the baseline is ahead from the first time point on.
    Never,
    /// The curves cross at this second, within what was measured.
    Measured(f64),
    /// The curves cross at about this second, if the baseline's error falls as 1/t and the method's stays at its bias.
    Extrapolated(f64),
    /// The method is still better, and no bias was found that the baseline could fall below.
    NotInSight,
    /// Method and baseline are a tie at the last time point, where noise would decide a crossing.
    Undecided,
}

/// Point at which the baseline overtakes a method, from the mean errors of both at `times`.
///
/// `floor` is the part of the method's error that is bias, if one was found.
pub fn crossing(
    times: &[f64],
    ours: &[f64],
    baseline: &[f64],
    floor: Option<f64>,
) -> Option<Crossing> {
    let gap: Vec<f64> = ours
        .iter()
        .zip(baseline)
        .map(|(a, b)| (a / b).ln())
        .collect();
    let last = gap.len().checked_sub(1)?;
    if gap.iter().any(|g| !g.is_finite()) {
        return None;
    }
    if gap[last] < 0.0 {
        // The method's error falls to its floor but not below; the baseline has no floor.
        return Some(match floor {
            Some(floor) if floor > 0.0 => {
                Crossing::Extrapolated(times[last] * (baseline[last] / floor).max(1.0))
            }
            _ => Crossing::NotInSight,
        });
    }
    let Some(before) = (0..last).rev().find(|&i| gap[i] < 0.0) else {
        return Some(Crossing::Never);
    };
    let s = gap[before] / (gap[before] - gap[before + 1]);
    let (a, b) = (times[before].ln(), times[before + 1].ln());
    Some(Crossing::Measured((a + s * (b - a)).exp()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(errors: &[(f64, f64)]) -> Run {
        let point = |(i, &(t, e)): (usize, &(f64, f64))| Point {
            samples: i as u32 + 1,
            wall: t,
            cpu: 2.0 * t,
            errors: [("relMSE".to_owned(), e)].into(),
        };
        Run {
            points: errors.iter().enumerate().map(point).collect(),
            ..Run::default()
        }
    }

    #[test]
    fn curve_interpolation_corrects_a_late_record() {
        let c = run(&[(0.1, 10.0), (1.25, 0.8), (2.5, 0.4)]);
        let at = |t| at_seconds(&c, "relMSE", t, &|p| Clock::Wall.seconds(p, 2));
        for t in [0.1, 1.0, 1.25, 2.0, 2.5] {
            assert!((at(t).unwrap() - 1.0 / t).abs() < 1e-12, "at {t}");
        }
        assert!(at(0.05).is_none() && at(3.0).is_none());
        assert!((Clock::Cpu.seconds(&c.points[0], 2) - 0.1).abs() < 1e-15);
        assert_eq!(at_samples(&c, "relMSE", 2), Some(0.8));
        assert_eq!(at_samples(&c, "MAPE", 2), None);
    }

    #[test]
    fn curve_crossings() {
        let times = [1.0, 2.0, 4.0, 8.0];
        let baseline = times.map(|t| 1.0 / t);
        let biased = |floor: f64| times.map(|t| 0.2 / t + floor);
        // 0.2/t + 0.25 = 1/t at 3.2.
        let Some(Crossing::Measured(t)) = crossing(&times, &biased(0.25), &baseline, Some(0.25))
        else {
            panic!("not measured");
        };
        assert!((t - 3.2).abs() < 0.15, "{t}");
        let Some(Crossing::Extrapolated(t)) =
            crossing(&times, &biased(0.01), &baseline, Some(0.01))
        else {
            panic!("not extrapolated");
        };
        assert!((t - 100.0).abs() < 1e-9, "{t}");
        assert_eq!(
            crossing(&times, &biased(1.0), &baseline, None),
            Some(Crossing::Never)
        );
        assert_eq!(
            crossing(&times, &biased(0.0), &baseline, None),
            Some(Crossing::NotInSight)
        );
        assert_eq!(crossing(&[], &[], &[], None), None);
    }
}
