//! Blurs of pictures of one level: batches with features of the camera paths.

use crate::image::Buffer;
use crate::image::film::Film;
use crate::image::level_film::LevelFilm;
use crate::integrator::bidirectional::Radius;
use crate::integrator::{Amounts, Aovs, Estimator, FirstHit, LevelError, Picture, Settings, View};
use crate::math::{Rgb, UVec2, Vec3};
use crate::regularise::Rule;
use crate::resolve::{Resolve, resolve_film};
use crate::scene::{Environment, Material, Scene, SceneParts};
use crate::unit::lab::gallery::materials::{coated, diffuse, metal};
use crate::unit::lab::gallery::shapes::quad;
use crate::unit::lab::gallery::{builtin, caustic_box};
use crate::unit::metric::{energy_ratio, mape};
use crate::unit::support::render::scene;
use std::ops::Range;

pub(super) const SIZE: UVec2 = UVec2::new(48, 36);

const RADIUS: Radius = Radius {
    first: None,
    alpha: 2.0 / 3.0,
};

const PATH: Estimator = Estimator::Path { reuse: false };

const ESTIMATORS: [Estimator; 4] = [
    PATH,
    Estimator::Bdpt,
    Estimator::Vcm(RADIUS),
    Estimator::VcmNee(RADIUS),
];

fn settings(estimator: Estimator, amounts: Amounts, seed: u64) -> Settings {
    Settings {
        estimator,
        amounts,
        max_vertices: 8,
        seed,
        ..Settings::default()
    }
}

pub(super) fn add(scene: &Scene, settings: &Settings, samples: Range<u32>, picture: &mut Picture) {
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, samples, picture);
    assert_eq!(picture.film.rejected.total(), 0);
}

pub(super) fn render(scene: &Scene, settings: &Settings, spp: u32) -> Picture {
    let mut picture = Picture::new(Film::new(SIZE));
    add(scene, settings, 0..spp, &mut picture);
    picture
}

pub(super) fn levels(picture: &Picture) -> &LevelFilm {
    picture.levels.as_ref().expect("levels")
}

/// The film and its AOVs are bit-identical to those of a render without guides; the batches have the same light.
#[test]
fn guides_change_no_sample() {
    let scene = scene(caustic_box());
    for estimator in ESTIMATORS {
        let [plain, guided] = [Amounts::Raw, Amounts::Blurred].map(|amounts| {
            let mut picture = Picture::new(Film::new(SIZE));
            let first = FirstHit::new(picture.film.window);
            picture.aovs = Some(Aovs::from(first));
            add(
                &scene,
                &settings(estimator, amounts.clone(), 5),
                0..6,
                &mut picture,
            );
            picture
        });
        assert!(plain.levels.is_none());
        assert_eq!(guided.film, plain.film, "{estimator:?}");
        assert_eq!(guided.aovs, plain.aovs, "{estimator:?}");
        let film = levels(&guided);
        let error = mape(&film.mean(0), &plain.film.mean()).expect("one size");
        assert!(error.value < 1e-5, "{estimator:?}: {}", error.value);
        // Only the lamp is directly visible.
        let (seen, all) = (film.mean(1), film.mean(0));
        let lit = seen.pixels.iter().zip(&all.pixels);
        assert!(lit.clone().any(|(seen, _)| seen.max_element() > 1.0));
        assert!(
            lit.clone()
                .all(|(seen, all)| (*all - *seen).min_element() > -1e-4)
        );
        // The pixels of direct light are those of the lamp and few more.
        let share = seen.pixels.iter().filter(|p| p.max_element() > 0.0).count();
        assert!(share * 5 < seen.pixels.len(), "{share} pixels see a light");
    }
}

#[test]
fn determinism_of_guides_at_any_thread_count_and_split() {
    let scene = scene(caustic_box());
    for estimator in ESTIMATORS {
        let settings = settings(estimator, Amounts::Blurred, 1);
        let whole = render(&scene, &settings, 6);
        for threads in [1, 2] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let split = pool.build().expect("threads").install(|| {
                let mut picture = render(&scene, &settings, 2);
                add(&scene, &settings, 2..6, &mut picture);
                picture
            });
            assert_eq!(split, whole, "{estimator:?}, {threads} threads");
        }
    }
}

#[test]
fn usual_level_of_estimators_with_one_and_refused_ones() {
    for estimator in ESTIMATORS {
        let of = |amounts| settings(estimator, amounts, 0);
        let usual = of(Amounts::Raw).usual_amounts(false);
        assert_eq!(usual, Ok(Amounts::Blurred));
        assert_eq!(of(Amounts::Blurred).check_amounts(), Ok(()));
        let refused = match estimator {
            PATH => LevelError::Rule,
            _ => LevelError::Estimator,
        };
        let scales = Amounts::Roughening(Default::default());
        assert_eq!(of(scales).check_amounts(), Err(refused));
        let radii = of(Amounts::Radii(Default::default()));
        assert_eq!(radii.check_amounts(), Err(LevelError::Estimator));
    }
    // A table roughens nothing in a scene without lobes. Reuse allows one level only.
    let mut settings = settings(PATH, Amounts::Raw, 0);
    settings.rule = Rule::constant(0.5);
    assert_eq!(settings.usual_amounts(false), Ok(Amounts::Blurred));
    let four = Amounts::Roughening(Default::default());
    assert_eq!(settings.usual_amounts(true), Ok(four));
    settings.estimator = Estimator::Path { reuse: true };
    assert_eq!(settings.usual_amounts(false), Ok(Amounts::Raw));
    assert_eq!(settings.usual_amounts(true), Err(LevelError::Reuse));
}

/// A film of one level has the rule's own factors in any scene.
#[test]
fn one_level_is_that_of_the_rule() {
    let scene = scene(caustic_box());
    let [own, kept] = [Amounts::Raw, Amounts::Blurred].map(|amounts| {
        let mut settings = settings(PATH, amounts, 5);
        settings.rule = Rule::constant(0.5);
        render(&scene, &settings, 6).film
    });
    assert_eq!(own, kept);
    assert_ne!(
        own,
        render(&scene, &settings(PATH, Amounts::Raw, 5), 6).film
    );
}

/// Less error than the raw picture and the same light: with and without caustics and textures, at few and many samples.
#[test]
fn blurs_have_less_error_and_keep_the_light() {
    for (name, spp, most) in [
        ("caustic-box", 16, 0.75),
        ("cornell-box", 16, 0.75),
        ("cornell-box", 128, 0.95),
        ("plate-under-mesh-sky", 16, 0.8),
        ("lamp-in-glass", 16, 0.75),
    ] {
        let scene = Scene::new(builtin(name).expect("a scene"));
        let reference = render(
            &scene,
            &settings(Estimator::Vcm(RADIUS), Amounts::Raw, 100),
            512,
        );
        let reference = reference.film.mean();
        let error = |picture: &Buffer| mape(picture, &reference).expect("one size").value;
        for estimator in [PATH, Estimator::Bdpt, Estimator::Vcm(RADIUS)] {
            let picture = render(&scene, &settings(estimator, Amounts::Blurred, 1), spp);
            let resolved = resolve_film(levels(&picture), Resolve::Default).picture;
            let own = picture.film.mean();
            let ratio = error(&resolved) / error(&own);
            let energy = energy_ratio(&resolved, &own).expect("one size").value;
            println!("{name}, {spp}, {estimator:?}: {ratio:.3}, {energy:.3}");
            assert!(ratio < most, "{name}, {estimator:?}: {ratio}");
            // Fireflies are kept only in part; a path tracer finds a lamp in glass only by fireflies.
            let lost = match (estimator == PATH, name) {
                (true, "lamp-in-glass") => 0.15,
                (true, _) => 0.08,
                _ => 0.04,
            };
            assert!((energy - 1.0).abs() < lost, "{name}: {energy}");
        }
    }
}

/// A polished wall with a diffuse base guides blurs by itself, and polished metal by the floor that it reflects.
#[test]
fn guides_of_a_polished_wall_are_its_own() {
    let facing = |material: Material| {
        let mut parts = SceneParts::default();
        let wall = quad(Vec3::new(-3.0, -3.0, 0.0), 6.0 * Vec3::X, 6.0 * Vec3::Y);
        let floor = quad(Vec3::new(-9.0, -1.0, 9.0), 18.0 * Vec3::X, -9.0 * Vec3::Z);
        parts.add(material, [wall]);
        parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
        parts.add_camera([0.0, 1.0, 3.0], [0.0, 0.0, 0.0], 10.0);
        parts.environment = Some(Environment::constant(Rgb::ONE));
        scene(parts)
    };
    let cases = [
        (coated("tiles", Rgb::splat(0.5), 0.01), Vec3::Z),
        (metal("steel", Rgb::splat(0.5), 0.01), Vec3::Y),
    ];
    for (material, normal) in cases {
        let scene = facing(material);
        for estimator in ESTIMATORS {
            let picture = render(&scene, &settings(estimator, Amounts::Blurred, 1), 2);
            for [x, y, z, ..] in levels(&picture).features() {
                let own = Vec3::new(x, y, z);
                assert!(own.distance(normal) < 0.01, "{estimator:?}: {own}");
            }
        }
    }
}
