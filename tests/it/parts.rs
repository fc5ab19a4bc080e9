//! Renders in parts: any split, merged in any order, is bit-identical to the single render.

use crate::fuzz::mutate::Rng;
use crate::support::quick_folder;
use crate::support::render::scene;
use opsr::image::film::Window;
use opsr::image::level_film::PathLevels;
use opsr::integrator::checkpoint::Fingerprint;
use opsr::integrator::part::{MergeError, Part, merge};
use opsr::integrator::{Amounts, Estimator, Integrator, Picture, Recorded, Settings, View};
use opsr::math::{Rgb, UVec2};
use opsr_lab::gallery::caustic_box;
use opsr_lab::verify::modes::{MODES, Uniform};
use std::ops::{ControlFlow, Range};
use std::path::PathBuf;

/// A range of pixels and of samples.
type Piece = (Window, Range<u32>);

const FRAME: UVec2 = UVec2::new(24, 20);
const SPP: u32 = 11;

/// A crop of the frame that the parts make up.
fn window() -> Window {
    Window {
        x: 3,
        y: 2,
        w: 19,
        h: 17,
    }
}

/// Cuts a piece into random pieces, in random order.
fn cut(rng: &mut Rng, piece: Piece, cuts: usize) -> Vec<Piece> {
    let mut pieces = vec![piece];
    for _ in 0..cuts {
        let (window, samples) = pieces.swap_remove(rng.below(pieces.len()));
        let (mut a, mut b) = ((window, samples.clone()), (window, samples.clone()));
        let place = |rng: &mut Rng, length: u32| 1 + rng.below(length as usize - 1) as u32;
        match rng.below(3) {
            0 if window.w > 1 => {
                let at = place(rng, window.w);
                (a.0.w, b.0.x, b.0.w) = (at, window.x + at, window.w - at);
            }
            1 if window.h > 1 => {
                let at = place(rng, window.h);
                (a.0.h, b.0.y, b.0.h) = (at, window.y + at, window.h - at);
            }
            _ if samples.len() > 1 => {
                let at = samples.start + place(rng, samples.len() as u32);
                (a.1.end, b.1.start) = (at, at);
            }
            _ => {
                pieces.push((window, samples));
                continue;
            }
        }
        pieces.extend([a, b]);
    }
    pieces
}

fn fingerprint() -> Fingerprint {
    Fingerprint {
        version: "1".into(),
        scene: "box".into(),
        settings: "any".into(),
    }
}

/// Compares a single render with ten random splits of it.
fn check(
    name: &str,
    integrator: &dyn Fn() -> Box<dyn Integrator>,
    amounts: &Amounts,
    aovs: Recorded,
) {
    let scene = scene(caustic_box());
    let camera = &scene.parts().cameras[0];
    let mut whole = Picture::blank(FRAME, window(), amounts, aovs).expect("inside");
    let view = View::of(&scene, camera, &whole.film);
    integrator().pass(&view, 0..SPP, &mut whole);
    let mut rng = Rng::new(name, 0);
    let folder = quick_folder();
    for round in 0..10 {
        let pieces = cut(&mut rng, (window(), 0..SPP), round);
        let render = |(i, (window, samples)): (usize, Piece)| {
            let path = folder.path().join(format!("{i}.part"));
            let view = View { window, ..view };
            let part = Part::new(fingerprint(), &view, samples, amounts.clone(), aovs);
            let mut integrator = integrator();
            let mut go_on = |_: &_| ControlFlow::Continue(());
            let done = part.render(&path, &mut *integrator, &view, &mut go_on);
            assert!(done.expect("a part"));
            path
        };
        let paths: Vec<PathBuf> = pieces.into_iter().enumerate().map(render).collect();
        let merged = merge(&paths, |_| window(), None, true).expect("all parts");
        assert_eq!(merged.samples, SPP);
        let (a, b) = (&merged.picture, &whole);
        assert!(a.film.pixels == b.film.pixels, "{name}, round {round}");
        let count = |p: &Picture| (p.film.rejected.nan, p.film.rejected.infinite);
        assert_eq!(count(a), count(b), "{name}");
        assert!(
            a.levels == b.levels && a.aovs == b.aovs,
            "{name}, round {round}"
        );
    }
}

#[test]
fn parts_of_any_split_merge_to_the_single_render() {
    let mut drawn = Rng::new("modes", 0);
    for (i, mode) in MODES.iter().enumerate() {
        let settings = mode.settings(Uniform(&mut || drawn.below(1 << 16) as f32 / 65536.0));
        // A guide learns from all earlier samples: it has no parts.
        if matches!(settings.estimator, Estimator::Guided { .. }) {
            continue;
        }
        let aovs = Recorded {
            first: i % 2 == 0,
            light: i % 3 == 0,
            time: false,
        };
        check(
            mode.name,
            &|| settings.integrator(),
            &settings.amounts,
            aovs,
        );
    }
}

/// Returns non-finite values at some pixels, at all levels or at one.
struct Faulty;

impl Integrator for Faulty {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32 {
        let added = samples.end - samples.start;
        for sample in samples {
            for index in 0..view.window.len() {
                let [x, y] = view.window.pixel(index).to_array();
                let hash = (x * 7919 + y * 104_729 + sample * 1_299_709) % 23;
                let value = Rgb::new(hash as f32 * 0.37, 1e6, 0.001);
                let value = match hash {
                    0 => Rgb::new(1.0, f32::NAN, 1.0),
                    1 => Rgb::new(1.0, f32::INFINITY, 1.0),
                    _ => value,
                };
                picture.film.push(index, value, sample);
                if let Some(levels) = &mut picture.levels {
                    let other = if hash == 2 { f32::NAN } else { 0.1 };
                    let values = PathLevels {
                        levels: &[value, value * other],
                        shared: 0.5 * value,
                        features: std::array::from_fn(|i| hash as f32 + i as f32),
                    };
                    levels.push(index, sample, &values);
                }
            }
        }
        added
    }
}

#[test]
fn parts_keep_refused_samples_refused() {
    let levels = Amounts::roughening(&[0.0, 1.0]).expect("scales");
    check("faulty", &|| Box::new(Faulty), &levels, Recorded::default());
}

#[test]
fn parts_that_are_missing_or_there_twice_are_named() {
    let scene = scene(caustic_box());
    let camera = &scene.parts().cameras[0];
    let folder = quick_folder();
    let view = View::new(&scene, camera, FRAME, Window::full(FRAME));
    let part = |name: &str, window: Window, samples: Range<u32>| {
        let path = folder.path().join(name);
        let view = View { window, ..view };
        let part = Part::new(
            fingerprint(),
            &view,
            samples,
            Amounts::Raw,
            Recorded::default(),
        );
        let mut integrator = Settings::default().integrator();
        let mut go_on = |_: &_| ControlFlow::Continue(());
        part.render(&path, &mut *integrator, &view, &mut go_on)
            .expect("a part");
        path
    };
    let full = Window::full(FRAME);
    let left = Window { w: 10, ..full };
    let right = Window {
        x: 10,
        w: 14,
        ..full
    };
    let a = part("a", left, 0..4);
    let b = part("b", right, 0..2);
    let c = part("c", right, 2..4);
    let d = part("d", full, 3..5);
    let e = part("e", full, 6..7);
    let text = |paths: &[&PathBuf], samples| {
        let paths: Vec<PathBuf> = paths.iter().copied().cloned().collect();
        let error = merge(&paths, Window::full, samples, true).err();
        error.map_or(String::new(), |e| {
            e.to_string()
                .replace(&folder.path().display().to_string(), "")
        })
    };
    assert_eq!(text(&[&c, &b, &a], None), "");
    assert_eq!(text(&[&c, &b, &a], Some(4)), "");
    for (paths, samples, words) in [
        (
            vec![&a, &c],
            None,
            "missing samples: 0..2 within 14x20 pixels at (10, 0)",
        ),
        (
            vec![&a, &b],
            None,
            "missing samples: 2..4 within 14x20 pixels at (10, 0)",
        ),
        (
            vec![&b, &c],
            None,
            "missing samples: 0..4 within 10x20 pixels at (0, 0)",
        ),
        (
            vec![&a, &b, &c],
            Some(9),
            "missing samples: 4..9 within 24x20 pixels at (0, 0)",
        ),
        (
            vec![&a, &b, &c, &e],
            None,
            "missing samples: 4..6 within 24x20 pixels at (0, 0)",
        ),
        (
            vec![&b, &d, &a],
            None,
            "/a and /d both have samples 3..4 of 10x20 pixels at (0, 0)",
        ),
        (
            vec![&b, &b],
            None,
            "/b and /b both have samples 0..2 of 14x20 pixels at (10, 0)",
        ),
        (
            vec![&a, &b, &c],
            Some(3),
            "samples 0..4 of 10x20 pixels at (0, 0): more than the 3",
        ),
        (vec![], None, "no parts"),
    ] {
        let found = text(&paths, samples);
        assert!(found.contains(words), "{found}");
    }
    let crop = merge(std::slice::from_ref(&a), |_| right, None, true).expect_err("another window");
    assert!(matches!(crop, MergeError::File(_)), "{crop}");
    assert!(
        crop.to_string()
            .contains("leave the 14x20 pixels at (10, 0)"),
        "{crop}"
    );
    // A stopped part writes no file.
    let path = folder.path().join("stopped");
    for samples in [0..9, 3..9] {
        let part = Part::new(
            fingerprint(),
            &view,
            samples,
            Amounts::Raw,
            Recorded::default(),
        );
        let mut integrator = Settings::default().integrator();
        let mut stop = |_: &_| ControlFlow::Break(());
        let done = part.render(&path, &mut *integrator, &view, &mut stop);
        assert!(!done.expect("no fault") && !path.exists());
    }
}
