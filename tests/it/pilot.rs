//! The pilot that chooses the integrator.

use super::support::render::scene;
use opsr::gallery::builtin;
use opsr::image::film::Window;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::method::IntegratorKind::{self, Bdpt, Path, Sppm, Vcm};
use opsr::integrator::{Settings, View};
use opsr::math::UVec2;
use opsr::pilot::{Contender, Horizon, choose_integrator};
use opsr::scene::Scene;

fn view(scene: &Scene) -> View<'_> {
    let frame = UVec2::splat(64);
    View::new(scene, &scene.parts().cameras[0], frame, Window::full(frame))
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
