//! The pilot that chooses the integrator.

use super::support::render::scene;
use opsr::image::film::Window;
use opsr::integrator::Amounts;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::method::IntegratorKind::{self, Bdpt, Path, Sppm, Vcm};
use opsr::integrator::{Settings, View};
use opsr::math::UVec2;
use opsr::pilot::{Contender, Horizon, choose_integrator};
use opsr::regularise::{AttenuationTable, Rule};
use opsr::scene::Scene;
use opsr_lab::gallery::builtin;

fn view(scene: &Scene) -> View<'_> {
    let frame = UVec2::splat(64);
    View::new(scene, &scene.parts().cameras[0], frame, Window::full(frame))
}

/// Choices for two CPU-seconds, by counted paths: the same on every machine. docs/lab/auto.md has the errors of all.
#[test]
fn pilot_chooses_the_integrator_of_the_suite_scenes() {
    let expected = [
        ("cornell-box", "path"),
        ("plate-under-mesh-sky", "path"),
        ("street-lamp", "levels"),
        ("sun-through-pane", "levels"),
        ("glossy_corridor", "levels"),
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
            let contenders = [path, levels, bdpt, vcm, sppm];
            let horizon = Horizon::Seconds(2.0);
            let choice = choose_integrator(&contenders, &view(&scene), horizon, &|| true);
            let choice = choice.unwrap().unwrap();
            let names = ["path", "levels", "bdpt", "vcm", "sppm"];
            if names[choice.best] != best {
                wrong.push(format!("{name}, seed {seed}: {choice}"));
            }
        }
    }
    // Chance decides where two are close.
    assert!(wrong.len() <= 2, "{wrong:#?}");
}
