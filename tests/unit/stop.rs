//! Renders that end in the middle of a pass.

use crate::integrator::bidirectional::Radius;
use crate::integrator::drive::{Budget, ErrorBound, Reason, drive};
use crate::integrator::{Amounts, Estimator, Integrator, Picture, Recorded, Settings, Stop, View};
use crate::math::UVec2;
use crate::regularise::Rule;
use crate::scene::Scene;
use crate::unit::lab::gallery::cornell_box;
use crate::unit::support::render::{mean, scene};
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

/// An integrator that requests a stop during one of its passes.
struct Interrupted<'a> {
    own: Box<dyn Integrator>,
    asked: &'a AtomicBool,
    /// The first sample of that pass.
    at: u32,
}

impl Integrator for Interrupted<'_> {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32 {
        if samples.contains(&self.at) {
            self.asked.store(true, Ordering::Relaxed);
        }
        self.own.pass(view, samples, picture)
    }
}

fn all() -> Vec<(&'static str, Settings)> {
    let path = Estimator::Path { reuse: false };
    let radius = Radius {
        first: Some(0.05),
        ..Radius::default()
    };
    let of = |estimator, rule, amounts| Settings {
        estimator,
        rule,
        amounts,
        max_vertices: 4,
        seed: 7,
        ..Settings::default()
    };
    vec![
        ("path", of(path, Rule::Plain, Amounts::Raw)),
        ("rule", of(path, Rule::constant(0.3), Amounts::Raw)),
        (
            "levels",
            of(
                path,
                Rule::constant(0.3),
                Amounts::Roughening(Default::default()),
            ),
        ),
        (
            "guided",
            of(
                Estimator::Guided { unbiased: false },
                Rule::Plain,
                Amounts::Raw,
            ),
        ),
        ("light", of(Estimator::Light, Rule::Plain, Amounts::Raw)),
        ("bdpt", of(Estimator::Bdpt, Rule::Plain, Amounts::Raw)),
        ("vcm", of(Estimator::Vcm(radius), Rule::Plain, Amounts::Raw)),
        (
            "sppm",
            of(Estimator::Sppm(radius), Rule::Plain, Amounts::Raw),
        ),
        (
            "mlt",
            of(Estimator::Mlt { mutations: 4 }, Rule::Plain, Amounts::Raw),
        ),
    ]
}

fn blank(size: u32, settings: &Settings) -> Picture {
    let window = crate::image::film::Window::full(UVec2::splat(size));
    Picture::blank(
        UVec2::splat(size),
        window,
        &settings.amounts,
        Recorded {
            first: true,
            ..Recorded::default()
        },
    )
    .expect("a small picture")
}

/// A square picture of a render that is stopped before its first sample, and the reason of its end.
fn stopped_at_once(scene: &Scene, settings: &Settings, size: u32) -> (Picture, Reason) {
    let asked = AtomicBool::new(true);
    let stop = Stop::when(&asked);
    let mut picture = blank(size, settings);
    let film = picture.film.clone();
    let view = View::of(scene, &scene.parts().cameras[0], &film);
    let view = &view.until(&stop);
    let go_on = &mut |_: &_, _: &_| ControlFlow::Continue(());
    let (integrator, budget) = (&mut *settings.integrator(), Budget::default());
    let (progress, reason) = drive(integrator, view, &budget, 0, &mut picture, go_on);
    assert_eq!(progress.samples, 0);
    (picture, reason)
}

fn whole(scene: &Scene, settings: &Settings, samples: u32) -> Picture {
    let mut picture = blank(24, settings);
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, 0..samples, &mut picture);
    picture
}

/// An interrupted pass leaves no trace: the picture equals that of the samples before it, and a resumed render is
/// bit-identical to a whole one.
#[test]
fn stopped_renders_hold_whole_samples_and_resume_bit_for_bit() {
    let scene = scene(cornell_box());
    for (name, settings) in all() {
        let asked = AtomicBool::new(false);
        let stop = Stop::when(&asked);
        let mut picture = blank(24, &settings);
        let film = picture.film.clone();
        let view = View::of(&scene, &scene.parts().cameras[0], &film);
        let mut integrator = Interrupted {
            own: settings.integrator(),
            asked: &asked,
            at: 4,
        };
        let budget = Budget {
            samples: Some(12),
            ..Budget::default()
        };
        let go_on = &mut |_: &_, _: &_| ControlFlow::Continue(());
        let (progress, reason) = drive(
            &mut integrator,
            &view.until(&stop),
            &budget,
            0,
            &mut picture,
            go_on,
        );
        assert_eq!(reason, Reason::Stopped, "{name}");
        let n = progress.samples;
        assert!((1..=4).contains(&n), "{name}: {n}");
        assert_eq!(picture, whole(&scene, &settings, n), "{name} at {n}");
        let integrator = &mut *settings.integrator();
        let (progress, reason) = drive(integrator, &view, &budget, n, &mut picture, go_on);
        assert_eq!((progress.samples, reason), (12, Reason::Samples), "{name}");
        assert_eq!(picture, whole(&scene, &settings, 12), "{name}");
    }
}

/// An estimate costs as much as some samples, and is rare; a resumed render ends at the same sample as a whole one.
#[test]
fn errors_are_estimated_where_they_may_be_low_enough() {
    static ESTIMATES: AtomicU32 = AtomicU32::new(0);
    /// Error of pure noise, from the number of samples alone.
    fn noise(picture: &Picture) -> f64 {
        ESTIMATES.fetch_add(1, Ordering::Relaxed);
        f64::from(picture.film.pixels[0].n).sqrt().recip()
    }
    let scene = scene(cornell_box());
    let settings = Settings::default();
    let ended = |start: u32, bound: f64| {
        let mut picture = blank(4, &settings);
        let film = picture.film.clone();
        let view = View::of(&scene, &scene.parts().cameras[0], &film);
        settings.integrator().pass(&view, 0..start, &mut picture);
        let budget = Budget {
            samples: Some(2000),
            error: Some(ErrorBound {
                bound,
                estimate: noise,
            }),
            ..Budget::default()
        };
        ESTIMATES.store(0, Ordering::Relaxed);
        let go_on = &mut |_: &_, _: &_| ControlFlow::Continue(());
        let integrator = &mut *settings.integrator();
        let (progress, reason) = drive(integrator, &view, &budget, start, &mut picture, go_on);
        (progress.samples, reason, ESTIMATES.load(Ordering::Relaxed))
    };
    // Estimates at 16, 20, 25 and so on by a quarter: 425 is the first of these with an error of at most 1/20.
    assert_eq!(ended(0, 0.05), (425, Reason::Error, 4));
    assert_eq!(ended(100, 0.05), (425, Reason::Error, 4));
    assert_eq!(ended(425, 0.05), (425, Reason::Error, 1));
    assert_eq!(ended(3, 0.9), (16, Reason::Error, 1));
    assert_eq!(ended(0, 1e-9), (2000, Reason::Samples, 1));
}

/// An interrupted first sample keeps its finished tiles, each as in the whole one.
#[test]
fn stopped_first_pass_keeps_its_finished_tiles() {
    let scene = scene(cornell_box());
    let settings = Settings::default();
    let (asked, mut cut) = (AtomicBool::new(false), false);
    let mut all = blank(768, &settings);
    let view = View::of(&scene, &scene.parts().cameras[0], &all.film);
    settings.integrator().pass(&view, 0..1, &mut all);
    for wait in [1, 4, 16, 64] {
        asked.store(false, Ordering::Relaxed);
        let stop = Stop::when(&asked);
        let mut picture = blank(768, &settings);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                std::thread::sleep(Duration::from_millis(wait));
                asked.store(true, Ordering::Relaxed);
            });
            let budget = Budget {
                samples: Some(1),
                ..Budget::default()
            };
            let go_on = &mut |_: &_, _: &_| ControlFlow::Continue(());
            let integrator = &mut *settings.integrator();
            let (progress, _) = drive(
                integrator,
                &view.until(&stop),
                &budget,
                0,
                &mut picture,
                go_on,
            );
            let kept = picture.film.pixels.iter().filter(|p| p.n == 1).count();
            let number = picture.film.pixels.len();
            assert_eq!(progress.samples, u32::from(kept == number));
            for (of_part, of_all) in picture.film.pixels.iter().zip(&all.film.pixels) {
                assert!(of_part.n == 0 || of_part == of_all);
            }
            cut |= kept > 0 && kept < number;
        });
    }
    assert!(cut, "no wait was in the middle of the pass");
}

/// Finished chains represent all: a first pass of few has the brightness of a whole one.
#[test]
fn stopped_first_pass_of_chains_is_as_bright_as_a_whole_one() {
    let scene = scene(cornell_box());
    let settings = Settings {
        estimator: Estimator::Mlt { mutations: 256 },
        max_vertices: 5,
        ..Settings::default()
    };
    let (picture, reason) = stopped_at_once(&scene, &settings, 16);
    assert_eq!(reason, Reason::Stopped);
    let (found, _) = mean(&picture.film);
    let mut whole = blank(16, &settings);
    let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, 0..4, &mut whole);
    let (expected, _) = mean(&whole.film);
    assert!((found / expected - 1.0).abs() < 0.2, "{found}, {expected}");
}

/// An interrupted first sample has a part of its light paths and of its pixels. The pixels are as bright as in a whole
/// one, and the render ends before it has all, on any machine.
#[test]
fn first_sample_by_shared_light_paths_ends_in_time_and_is_as_bright_as_a_whole_one() {
    const SIDE: usize = 1400;
    const CELL: usize = 20;
    let scene = scene(cornell_box());
    let of = |estimator| Settings {
        estimator,
        max_vertices: 5,
        ..Settings::default()
    };
    let expected = {
        let mut picture = blank((SIDE / CELL) as u32, &of(Estimator::Path { reuse: false }));
        let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
        let settings = of(Estimator::Path { reuse: false });
        settings.integrator().pass(&view, 0..64, &mut picture);
        picture.film
    };
    let radius = Radius {
        first: Some(0.02),
        ..Radius::default()
    };
    for estimator in [
        Estimator::Bdpt,
        Estimator::Vcm(radius),
        Estimator::Sppm(radius),
    ] {
        let settings = of(estimator);
        let mut picture = Picture::new(crate::image::Film::new(UVec2::splat(SIDE as u32)));
        let film = picture.film.clone();
        let view = View::of(&scene, &scene.parts().cameras[0], &film);
        let budget = Budget {
            time: Some(Duration::from_millis(1)),
            ..Budget::default()
        };
        let go_on = &mut |_: &_, _: &_| ControlFlow::Continue(());
        let integrator = &mut *settings.integrator();
        let (progress, _) = drive(integrator, &view, &budget, 0, &mut picture, go_on);
        assert!(progress.elapsed < Duration::from_secs(60), "{progress:?}");
        let (mut found, mut right, mut kept) = (0.0, 0.0, 0);
        for (i, pixel) in picture.film.pixels.iter().enumerate() {
            if pixel.n > 0 {
                let cell = i / SIDE / CELL * (SIDE / CELL) + i % SIDE / CELL;
                found += pixel.mean.element_sum();
                right += expected.pixels[cell].mean.element_sum();
                kept += 1;
            }
        }
        println!("{estimator:?}: {kept} pixels, {:.4}", found / right);
        assert!(kept > 1000, "{estimator:?}: {kept}");
        assert!(kept < SIDE * SIDE, "{estimator:?} was not cut");
        // A busy machine traces few light paths by then; weights of all paths would give a hundredth of this
        // brightness. The first pixels alone are too few to compare.
        assert!(
            kept < 10_000 || (0.3..3.0).contains(&(found / right)),
            "{estimator:?}: {found} {right}"
        );
    }
}

/// Any interrupted first sample contains its first piece of pixels, and with a choice of blurs the film of batches has
/// the same pixels.
#[test]
fn first_sample_that_is_cut_at_once_has_its_first_pixels() {
    let scene = scene(cornell_box());
    let radius = Radius::default();
    for estimator in [
        Estimator::Bdpt,
        Estimator::Vcm(radius),
        Estimator::Sppm(radius),
    ] {
        for batched in [false, true] {
            let mut settings = Settings {
                estimator,
                max_vertices: 4,
                ..Settings::default()
            };
            if batched {
                settings.amounts = settings.usual_amounts(true).expect("amounts");
            }
            let (picture, _) = stopped_at_once(&scene, &settings, 64);
            let met = picture.film.pixels.iter().map(|pixel| pixel.n > 0);
            let met: Vec<bool> = met.collect();
            let count = met.iter().filter(|met| **met).count();
            // One of four pieces of the picture.
            assert_eq!(count, 1024, "{estimator:?}");
            if let Some(levels) = &picture.levels {
                let batch = &levels.batch_means(0)[0].pixels;
                let dark = batch
                    .iter()
                    .zip(&met)
                    .filter(|(light, met)| !**met && **light != crate::math::Rgb::ZERO);
                assert_eq!(dark.count(), 0, "{estimator:?}");
            }
        }
    }
}
