//! The pilots that choose scale and contrast of a table, and the integrator.

use super::support::render::scene;
use opsr::gallery::{builtin, caustic_box};
use opsr::image::film::{Film, Window};
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::method::IntegratorKind::{self, Bdpt, Path, Sppm, Vcm};
use opsr::integrator::{Picture, Settings, View};
use opsr::math::UVec2;
use opsr::pilot::{Contender, Horizon, choose_integrator};
use opsr::regularise::{AttenuationTable, GammaIndex, LEN, Rule, TableTuning};
use opsr::scene::Scene;
use opsr::tune::{CONTRASTS, Candidate, SCALES, choose};

fn settings(gamma: f32) -> Settings {
    Settings {
        rule: Rule::with_table(AttenuationTable::constant(gamma)),
        ..Settings::default()
    }
}

fn view(scene: &Scene) -> View<'_> {
    let frame = UVec2::splat(64);
    View::new(scene, &scene.parts().cameras[0], frame, Window::full(frame))
}

#[test]
fn pilot_of_a_zero_table_finds_no_bias() {
    let scene = scene(caustic_box());
    let pilot = choose(&settings(0.0), &view(&scene), 1).unwrap();
    assert_eq!(pilot.candidates.len(), SCALES.len() * CONTRASTS.len());
    for candidate in &pilot.candidates {
        assert_eq!(candidate.bias2, 0.0, "{candidate:?}");
    }
    assert_eq!((pilot.tuning, pilot.decided), (TableTuning::NONE, false));
}

#[test]
fn pilot_roughens_less_for_more_samples() {
    let scene = scene(caustic_box());
    const SAMPLES: u32 = 60;
    let pilot = choose(&settings(0.1), &view(&scene), SAMPLES).unwrap();
    // What is roughened more has less variance and more bias.
    let (first, last) = (pilot.candidates[0], pilot.candidates[SCALES.len() - 1]);
    assert!(last.variance < 0.5 * first.variance, "{pilot:?}");
    assert!(last.bias2 > 2.0 * first.bias2, "{pilot:?}");
    // So the best scale falls as samples grow, of which the pilot's estimates are independent.
    let best = |samples: f64| {
        let error = |c: &Candidate| c.bias2.max(0.0) + c.variance * f64::from(SAMPLES) / samples;
        let best = (pilot.candidates.iter()).min_by(|a, b| error(a).total_cmp(&error(b)));
        best.unwrap().tuning.scale
    };
    assert!(best(1e6) < best(1.0), "{pilot:?}");
    if pilot.decided {
        assert_eq!(pilot.tuning.scale, best(SAMPLES.into()));
    }
}

#[test]
fn pilot_drops_a_pattern_that_does_not_fit() {
    let scene = scene(caustic_box());
    let mut table = AttenuationTable::constant(1.0);
    // The wrong way round: the more glossy vertices, the less a path is roughened.
    for (gamma, class) in table
        .gammas
        .iter_mut()
        .zip((0..LEN).filter_map(GammaIndex::new))
    {
        let bins = class.bins();
        *gamma = if bins[bins.len() - 1] == 0 { 1e-3 } else { 1.0 };
    }
    let settings = Settings {
        rule: Rule::with_table(table.clone()),
        ..Settings::default()
    };
    let pilot = choose(&settings, &view(&scene), 40).unwrap();
    assert!(pilot.decided && pilot.tuning.contrast < 1.0, "{pilot:?}");
    let changed = table.tuned(pilot.tuning);
    assert!(changed.scale == pilot.tuning.scale && changed.gammas != table.gammas);
}

/// The pilot's estimate of the mean of the picture, against longer renders with other random numbers.
#[test]
fn pilot_keeps_energy_within_the_limit() {
    let scene = scene(caustic_box());
    let view = view(&scene);
    let rough = settings(0.5);
    let pilot = choose(&rough, &view, 1).unwrap();
    let mean = |rule: Rule| {
        let settings = Settings {
            rule,
            seed: 77,
            ..Settings::default()
        };
        let mut picture = Picture {
            film: Film::new(view.sensor.frame),
            aovs: None,
            levels: None,
        };
        (settings.integrator()).pass(&view, 0..400, &mut picture);
        let mean = picture.film.mean();
        let sum: f64 = (mean.pixels.iter())
            .map(|p| f64::from(p.element_sum()))
            .sum();
        sum
    };
    let plain = mean(Rule::Plain);
    let table = rough.rule.table().unwrap();
    let changed = |tuning: TableTuning| mean(Rule::with_table(table.tuned(tuning))) / plain - 1.0;
    let candidate = |tuning: TableTuning| {
        pilot
            .candidates
            .iter()
            .find(|c| c.tuning == tuning)
            .unwrap()
    };
    let (roughest, kept) = (
        pilot.candidates[SCALES.len() - 1].tuning,
        pilot.within(0.005),
    );
    let found = [roughest, kept].map(|tuning| {
        let (said, found) = (candidate(tuning).energy, changed(tuning));
        assert!((said - found).abs() < 0.01, "{tuning:?}: {said} {found}");
        found
    });
    // The smaller of them is little more than the noise of both.
    assert!(
        found[0] < -0.015 && found[1].abs() < 0.75 * found[0].abs(),
        "{found:?}"
    );
    assert!(candidate(kept).energy.abs() <= 0.005 && kept.scale < pilot.within(1.0).scale);
}

/// The suite's scenes at two CPU-seconds, the integrator within a tenth of the least error of each. By a longer chain of
/// renders: docs/lab/integrators.md, "Which scene needs which integrator".
#[test]
fn pilot_chooses_the_integrator_of_the_suite_scenes() {
    let expected = [
        ("cornell-box", Path),
        ("caustic-box", Vcm),
        ("caustic-behind-glass", Vcm),
        ("three-boxes", Vcm),
        ("sun-pool", Vcm),
        ("filament", Vcm),
        ("door-ajar", Bdpt),
        ("glossy_corridor", Vcm),
    ];
    let mut wrong = Vec::new();
    for (name, best) in expected {
        let scene = scene(builtin(name).unwrap());
        for seed in 1..=6 {
            let contender = |kind: IntegratorKind| Contender {
                kind,
                settings: Settings {
                    estimator: kind.estimator(Radius::default()),
                    max_vertices: 12,
                    seed,
                    ..Settings::default()
                },
            };
            let contenders = [Path, Bdpt, Vcm, Sppm].map(contender);
            // Counted paths: the same choice on every machine.
            let horizon = Horizon::Seconds(2.0);
            let choice = choose_integrator(&contenders, &view(&scene), horizon, true, &|| true);
            let choice = choice.unwrap().unwrap();
            if contenders[choice.best].kind != best {
                wrong.push(format!("{name}, seed {seed}: {choice}"));
            }
        }
    }
    // Chance decides where two are close.
    assert!(wrong.len() <= 2, "{wrong:#?}");
}
