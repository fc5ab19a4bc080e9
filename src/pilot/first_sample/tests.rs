use super::*;
use crate::integrator::bidirectional::Radius;
use crate::integrator::method::IntegratorKind;
use crate::integrator::{Estimator, View};
use crate::math::{Rgb, UVec2, Vec3};
use crate::scene::{Scene, SceneParts};
use crate::unit::{materials, shapes};

/// Plates above each other with a lamp at the top.
fn plates() -> Scene {
    let mut parts = SceneParts::default();
    let plate = |y: f32| shapes::quad(Vec3::new(-1.0, y, -1.0), 2.0 * Vec3::Z, 2.0 * Vec3::X);
    let all = [-0.5, -0.25, 0.0].map(plate);
    parts.add(materials::diffuse("plate", Rgb::splat(0.5)), all);
    let lamp = shapes::quad(Vec3::new(-0.5, 1.0, -0.5), Vec3::X, Vec3::Z);
    parts.add(materials::emitter("lamp", Rgb::ONE), [lamp]);
    parts.add_camera([0.0, 0.7, 3.0], [0.0; 3], 38.0);
    Scene::new(parts)
}

/// The radius contains all photons, so that a sample of `vcm` takes far longer than one of `bdpt`.
#[test]
fn dearest_contender_that_fits_replaces_one_that_does_not() {
    let scene = plates();
    let film = Film::new(UVec2::splat(1280));
    let view = View::of(&scene, &scene.parts().cameras[0], &film);
    let contender = |(kind, estimator)| Contender {
        kind,
        settings: Settings {
            estimator,
            ..Settings::default()
        },
    };
    let radius = Radius {
        first: Some(100.0),
        ..Radius::default()
    };
    let contenders = [
        (IntegratorKind::Path, Estimator::Path { reuse: false }),
        (IntegratorKind::Bdpt, Estimator::Bdpt),
        (IntegratorKind::Vcm, Estimator::Vcm(radius)),
    ]
    .map(contender);
    let choose = |contenders: &[Contender], best: usize, seconds: f64| {
        let choice = Choice {
            best,
            name: contenders[best].name(),
            trials: Vec::new(),
            chosen: None,
            first: 0,
            why: "",
            seconds: 0.0,
        };
        let left = Duration::from_secs_f64(seconds);
        let choice = with_a_first_sample(choice, contenders, &view, left).expect("a window");
        assert_eq!(choice.name, contenders[choice.best].name());
        assert_eq!(choice.why.is_empty(), choice.best == best);
        contenders[choice.best].kind
    };
    // In one thread, so that the ratio of both is that of any machine.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("a thread").install(|| {
        let mut times = (-4..12).map(|k| f64::from(k).exp2());
        let fits = times.find(|time| choose(&contenders, 1, *time) == IntegratorKind::Bdpt);
        let seconds = 3.0 * fits.expect("a time for a sample");
        assert_eq!(choose(&contenders, 2, 1e6), IntegratorKind::Vcm);
        assert_eq!(choose(&contenders, 2, seconds), IntegratorKind::Bdpt);
        assert_eq!(choose(&contenders, 0, seconds), IntegratorKind::Path);
        let two = [contenders[0].clone(), contenders[2].clone()];
        assert_eq!(choose(&two, 1, seconds), IntegratorKind::Path);
    });
}
