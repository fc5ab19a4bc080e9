//! The pilot that chooses the integrator.

use crate::image::film::Window;
use crate::integrator::Amounts;
use crate::integrator::bidirectional::Radius;
use crate::integrator::method::IntegratorKind::{self, Bdpt, Path, Sppm, Vcm};
use crate::integrator::{Settings, View};
use crate::math::UVec2;
use crate::pilot::stopwatch::Stopwatch;
use crate::pilot::{Contender, Horizon, choose_integrator};
use crate::regularise::{AttenuationTable, Rule};
use crate::scene::Scene;
use crate::unit::lab::gallery::builtin;
use crate::unit::support::render::scene;
use std::sync::atomic::{AtomicU32, Ordering};

fn view(scene: &Scene) -> View<'_> {
    let frame = UVec2::splat(64);
    View::new(scene, &scene.parts().cameras[0], frame, Window::full(frame))
}

/// Path, levels, bdpt, vcm and sppm.
fn contenders(seed: u64) -> [Contender; 5] {
    let contender = |kind: IntegratorKind| Contender {
        kind,
        settings: Settings {
            estimator: kind.estimator(Radius::default()),
            max_vertices: 12,
            seed,
            ..Settings::default()
        },
    };
    let mut levels = contender(Path);
    levels.settings.rule = Rule::with_table(AttenuationTable::constant(0.1));
    levels.settings.amounts = Amounts::Roughening(Default::default());
    let [path, bdpt, vcm, sppm] = [Path, Bdpt, Vcm, Sppm].map(contender);
    [path, levels, bdpt, vcm, sppm]
}

/// Choices for about two CPU-seconds, by counted paths: the same on every machine. docs/lab/auto.md lists all errors.
#[test]
fn pilot_chooses_the_integrator_of_the_suite_scenes() {
    let expected = [
        ("cornell-box", "path"),
        ("plate-under-mesh-sky", "path"),
        ("street-lamp", "levels"),
        ("sun-through-pane", "levels"),
        ("glossy_corridor", "levels"),
        ("ring-under-lamp", "vcm"),
        ("caustic-box", "vcm"),
        ("caustic-behind-glass", "vcm"),
        ("three-boxes", "vcm"),
        ("sun-pool", "vcm"),
        ("filament", "vcm"),
        ("ball-on-400-m", "vcm"),
        ("glass-in-field", "vcm"),
        ("lamp-in-glass", "vcm"),
    ];
    let mut wrong = Vec::new();
    for (name, best) in expected {
        let scene = scene(builtin(name).unwrap());
        for seed in 1..=3 {
            let contenders = contenders(seed);
            let horizon = Horizon::Samples(342);
            let choice = choose_integrator(&contenders, &view(&scene), horizon, &|| true);
            let choice = choice.unwrap().unwrap();
            let names = ["path", "levels", "bdpt", "vcm", "sppm"];
            if names[choice.best] != best {
                wrong.push(format!("{name}, seed {seed}: {choice}"));
            }
        }
    }
    // Noise decides between two of nearly equal error.
    assert!(wrong.len() <= 2, "{wrong:#?}");
}

/// CPU time spent before the first small picture simulates a slow machine. Under a time limit the scene's features then
/// decide without a race; under a limit of samples there is a race.
#[test]
fn race_ends_where_paths_are_slow_and_time_is_short() {
    let scene = scene(builtin("caustic-box").unwrap());
    let contenders = contenders(1);
    for (horizon, races) in [
        (Horizon::Samples(342), true),
        (Horizon::Seconds(2.0), false),
    ] {
        let pictures = AtomicU32::new(0);
        let go_on = || {
            let clock = Stopwatch::start();
            while pictures.load(Ordering::Relaxed) == 0 && clock.seconds().1 < 0.15 {}
            pictures.fetch_add(1, Ordering::Relaxed);
            true
        };
        let choice = choose_integrator(&contenders, &view(&scene), horizon, &go_on);
        let choice = choice.unwrap().unwrap();
        assert_eq!(!choice.trials.is_empty(), races, "{choice}");
        assert_eq!(pictures.into_inner() > 1, races, "{choice}");
        assert_eq!(contenders[choice.best].kind, Vcm, "{choice}");
    }
}
