//! Random combinations of options on random scenes.

use opsr::integrator::{Estimator, Settings};
use opsr::scene::Scene;
use opsr_lab::gallery::cornell_box;
use opsr_lab::verify::chaos::{agree, modes, run, trial};
use opsr_lab::verify::modes::MODES;
use std::collections::BTreeSet;
use std::ops::ControlFlow;

/// Trials that take half a minute on two cores.
const COUNT: u64 = 150;

#[test]
fn chaos_finds_no_disagreement() {
    let findings: Vec<_> = run(0, |tried| match tried < COUNT {
        true => ControlFlow::Continue(()),
        false => ControlFlow::Break(()),
    })
    .collect();
    for finding in &findings {
        println!("{}: {}", finding.tried, finding.worst);
    }
    assert!(findings.iter().all(|f| f.holds()));
    assert_eq!(findings.len(), 1);
}

#[test]
fn chaos_draws_every_mode() {
    let drawn = modes(0..2000).expect("scenes");
    let all: BTreeSet<&str> = MODES.iter().map(|mode| mode.name).collect();
    assert_eq!(drawn, all);
}

/// Longer paths are brighter, which must be detected; the seed determines a trial.
#[test]
fn chaos_sees_pictures_that_differ() {
    let scene = Scene::new(cornell_box());
    let settings = |estimator, max_vertices| Settings {
        estimator,
        max_vertices,
        ..Settings::default()
    };
    let short = settings(Estimator::Path { reuse: false }, 2);
    let long = settings(Estimator::Bdpt, 3);
    let what = agree(&scene, &[short.clone(), long]).expect_err("a difference");
    assert!(what.contains("Path") && what.contains("Bdpt"), "{what}");
    assert_eq!(
        agree(&scene, &[short, settings(Estimator::Bdpt, 2)]),
        Ok(())
    );
    assert_eq!(trial(7), trial(7));
}
