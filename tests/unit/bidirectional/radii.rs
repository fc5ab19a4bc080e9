//! Photon density at several radii of the same photons.

use super::blurred::{SIZE, add, levels, render};
use crate::image::Buffer;
use crate::image::film::Window;
use crate::integrator::amounts::RADII;
use crate::integrator::bidirectional::Radius;
use crate::integrator::{Amounts, Estimator, LevelError, Settings, View};
use crate::pilot::witness::missing_light;
use crate::resolve::{Resolve, resolve_film};
use crate::scene::Scene;
use crate::unit::lab::gallery::{builtin, caustic_box};
use crate::unit::metric::{energy_ratio, mape};
use crate::unit::support::render::scene;

/// Settings at radii with these factors; without factors at one radius, as usual.
fn settings(estimator: Estimator, radii: &[f32], seed: u64) -> Settings {
    Settings {
        estimator,
        amounts: match radii {
            [] => Amounts::Raw,
            _ => Amounts::radii(radii).expect("ascending factors"),
        },
        max_vertices: 8,
        seed,
        ..Settings::default()
    }
}

fn first(scene: &Scene) -> f32 {
    let view = View::new(scene, &scene.parts().cameras[0], SIZE, Window::full(SIZE));
    Radius::default().first(&view)
}

fn at(radius: f32) -> Estimator {
    Estimator::Sppm(Radius {
        first: Some(radius),
        ..Radius::default()
    })
}

/// Level 0 is the picture of one radius up to rounding, because only the order of photons differs. The others have the
/// light of renders at their radii; only the probes at edges differ.
#[test]
fn levels_are_pictures_at_their_radii() {
    let scene = scene(caustic_box());
    let radius = first(&scene);
    let all = render(&scene, &settings(at(radius), &RADII, 3), 8);
    for (level, factor) in RADII.iter().enumerate() {
        let one = render(&scene, &settings(at(radius * factor), &[], 3), 8);
        assert!(one.levels.is_none());
        let (ours, theirs) = (levels(&all).mean(level), one.film.mean());
        let error = mape(&ours, &theirs).expect("one size").value;
        println!("{factor}: {error:e}");
        assert!(
            error < if level == 0 { 1e-5 } else { 0.02 },
            "{factor}: {error}"
        );
    }
    let error = mape(&all.film.mean(), &levels(&all).mean(0)).expect("one size");
    assert!(error.value < 1e-5, "{}", error.value);
}

#[test]
fn determinism_of_radii_at_any_thread_count_and_split() {
    let scene = scene(caustic_box());
    let settings = settings(Estimator::Sppm(Radius::default()), &RADII, 1);
    let whole = render(&scene, &settings, 6);
    for threads in [1, 2] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let split = pool.build().expect("threads").install(|| {
            let mut picture = render(&scene, &settings, 2);
            add(&scene, &settings, 2..6, &mut picture);
            picture
        });
        assert_eq!(split, whole, "{threads} threads");
    }
}

#[test]
fn refused_factors_on_the_radius() {
    let sppm = Estimator::Sppm(Radius::default());
    let check = |radii: &[f32]| settings(sppm, radii, 0).check_amounts();
    assert_eq!(check(&RADII), Ok(()));
    assert_eq!(check(&[]), Ok(()));
    for radii in [
        &[1.0][..],
        &[0.0, 1.0],
        &[2.0, 4.0],
        &[1.0, 1.0],
        &[1.0, f32::NAN],
    ] {
        assert_eq!(Amounts::radii(radii), Err(LevelError::Radii), "{radii:?}");
    }
    assert_eq!(
        settings(sppm, &[], 0).usual_amounts(false),
        Amounts::radii(&RADII)
    );
    let vcm = Estimator::Vcm(Radius::default());
    assert_eq!(
        settings(vcm, &RADII, 0).check_amounts(),
        Err(LevelError::Estimator)
    );
}

/// Less error than at one radius, with and without caustics, at about the same light.
#[test]
fn chosen_radii_have_less_error_and_keep_the_light() {
    for (name, most) in [
        ("ball-on-4-m", 0.6),
        ("caustic-box", 0.5),
        ("cornell-box", 0.5),
        ("thin-parts", 0.7),
    ] {
        let scene = Scene::new(builtin(name).expect("a scene"));
        let small = Radius {
            first: Some(0.5 * first(&scene)),
            ..Radius::default()
        };
        let reference = render(&scene, &settings(Estimator::Vcm(small), &[], 100), 150);
        let reference = reference.film.mean();
        let error = |picture: &Buffer| mape(picture, &reference).expect("one size").value;
        let (mut raw, mut chosen, mut energy) = (0.0, 0.0, 0.0);
        for seed in 0..3 {
            let picture = render(
                &scene,
                &settings(Estimator::Sppm(Radius::default()), &RADII, seed),
                16,
            );
            let resolved = resolve_film(levels(&picture), Resolve::Default).picture;
            let own = picture.film.mean();
            raw += error(&own) / 3.0;
            chosen += error(&resolved) / 3.0;
            energy += energy_ratio(&resolved, &own).expect("one size").value / 3.0;
        }
        println!("{name}: {raw:.3}, {chosen:.3}, {energy:.3}");
        assert!(chosen < most * raw, "{name}: {chosen} {raw}");
        // Single pixels dominate thin parts.
        let most = if name == "thin-parts" { 0.1 } else { 0.03 };
        assert!((energy - 1.0).abs() < most, "{name}: {energy}");
    }
}

/// A witness is a path tracer of one level, whatever the picture's levels.
#[test]
fn witness_beside_radii_has_one_level() {
    let scene = scene(caustic_box());
    let picture = render(&scene, &settings(at(first(&scene)), &RADII, 1), 32);
    let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
    let settings = settings(at(first(&scene)), &RADII, 1);
    let missing = missing_light(&view, &settings, &picture, 4000);
    assert!(missing.is_none(), "light is missing");
}
