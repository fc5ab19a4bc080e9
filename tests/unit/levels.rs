//! Several levels of roughening on the same paths.

use crate::image::film::Window;
use crate::image::level_film::LevelFilm;
use crate::image::{Buffer, Film};
use crate::integrator::amounts::SCALES;
use crate::integrator::{Amounts, Estimator, FirstHit, LevelError, Picture, Settings, View};
use crate::math::moments::Moments;
use crate::math::{Rgb, UVec2, Vec3};
use crate::regularise::{Accumulated, AttenuationTable, Factors, GammaIndex, Rule};
use crate::resolve::{Resolve, resolve_film, unseen_share};
use crate::scene::{PunctualLight, Scene, SceneParts};
use crate::unit::lab::gallery::caustic_box;
use crate::unit::lab::gallery::materials::{GOLD, diffuse, emitter, glass, metal};
use crate::unit::lab::gallery::shapes::{quad, room, sphere};
use crate::unit::lab::stats::agreement::agree;
use crate::unit::support::render::{add_passes, film_with, scene};
use crate::unit::support::scenes::{point_light_over_plane, two_mirrors};

/// A table whose factors depend on the bins.
pub(super) fn table() -> Rule {
    let mut table = AttenuationTable::constant(0.0);
    for (i, gamma) in table.gammas.iter_mut().enumerate() {
        let bins = GammaIndex::new(i).expect("a class").bins();
        *gamma = 0.1 + 0.1 * bins.iter().sum::<usize>() as f32 / bins.len() as f32;
    }
    Rule::with_table(table)
}

/// Settings at these scales, or with the raw factors if there are none.
pub(super) fn settings(rule: Rule, scales: &[f32], seed: u64) -> Settings {
    Settings {
        rule,
        amounts: match scales {
            [] => Amounts::Raw,
            _ => Amounts::roughening(scales).expect("ascending scales"),
        },
        seed,
        ..Settings::default()
    }
}

fn blank(size: UVec2, window: Window) -> Picture {
    Picture::new(Film::cropped(size, window).expect("inside"))
}

/// A room with rough metal, glass and a small light.
pub(super) fn metal_room() -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(
        diffuse("walls", Rgb::splat(0.6)),
        room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0)),
    );
    parts.add(
        metal("gold", GOLD, 0.3),
        [sphere(Vec3::new(-0.4, 0.4, 0.0), 0.4, 3)],
    );
    parts.add(
        glass("glass", 1.5, 0.0),
        [sphere(Vec3::new(0.45, 0.35, 0.2), 0.35, 3)],
    );
    parts.add(
        emitter("light", Rgb::splat(12.0)),
        [quad(
            Vec3::new(-0.3, 1.9, -0.3),
            Vec3::X * 0.6,
            Vec3::Z * 0.6,
        )],
    );
    parts.add_camera([0.0, 1.0, 0.95], [0.0, 0.6, 0.0], 70.0);
    parts
}

/// A film of every level, with batches of passes as the samples of pixels.
pub(super) fn level_films(
    scene: &Scene,
    settings: &Settings,
    size: u32,
    passes: u32,
    each: u32,
) -> Vec<Film> {
    let frame = UVec2::splat(size);
    let mut films = vec![Film::new(frame); settings.amounts.films()];
    let view = View::of(scene, &scene.parts().cameras[0], &films[0]);
    let mut integrator = settings.integrator();
    for pass in 0..passes {
        let mut picture = Picture::new(Film::new(frame));
        integrator.pass(&view, pass * each..(pass + 1) * each, &mut picture);
        let levels = picture.levels.expect("levels");
        for (k, film) in films.iter_mut().enumerate() {
            // Light that plain path tracing cannot find is added to level 0 from the next level.
            let level = if k == 0 {
                picture.film.mean()
            } else {
                levels.mean(k)
            };
            for (pixel, value) in film.pixels.iter_mut().zip(&level.pixels) {
                pixel.push(value.as_dvec3());
            }
        }
    }
    films
}

/// A film whose samples are means of `each` samples.
fn grouped(scene: &Scene, settings: &Settings, size: u32, passes: u32, each: u32) -> Film {
    let frame = UVec2::splat(size);
    let mut film = Film::new(frame);
    let view = View::of(scene, &scene.parts().cameras[0], &film);
    let mut integrator = settings.integrator();
    for pass in 0..passes {
        let mut picture = Picture::new(Film::new(frame));
        integrator.pass(&view, pass * each..(pass + 1) * each, &mut picture);
        let pairs = film.pixels.iter_mut().zip(&picture.film.pixels);
        pairs.for_each(|(pixel, m): (&mut Moments, &Moments)| pixel.push(m.mean));
    }
    film
}

#[test]
fn level_0_is_bit_identical_to_plain_path_tracing() {
    for parts in [caustic_box(), metal_room(), two_mirrors(0.9, 0.1)] {
        let scene = scene(parts);
        let plain = film_with(&scene, &settings(Rule::Plain, &[], 3), 24, 16);
        for rule in [table(), Rule::constant(0.4)] {
            assert_eq!(
                film_with(&scene, &settings(rule, &SCALES, 3), 24, 16),
                plain
            );
        }
    }
}

/// Scales of levels.
pub(super) const SCALED: [f32; 4] = [0.0, 0.05, 0.5, 2.0];

/// The rule of a level.
pub(super) fn scaled(rule: &Rule, scale: f32) -> Rule {
    match rule {
        Rule::Accumulated(Accumulated {
            factors: Factors::Constant(gamma),
            ..
        }) => Rule::constant((gamma * scale).min(1.0)),
        _ => {
            let table = rule.table().expect("a table").clone();
            Rule::with_table(AttenuationTable { scale, ..table })
        }
    }
}

/// Every level agrees with a separate render for pixels, tiles and the whole image.
#[test]
fn levels_agree_with_renders_of_their_own() {
    let mut point = metal_room();
    point.lights.push(point_light_over_plane().lights[0]);
    for (parts, rule) in [
        (caustic_box(), table()),
        (metal_room(), table()),
        (metal_room(), Rule::constant(0.5)),
        (point, table()),
    ] {
        let scene = scene(parts);
        let all = level_films(&scene, &settings(rule.clone(), &SCALED, 1), 16, 64, 16);
        for (k, scale) in SCALED.iter().enumerate() {
            let own = scaled(&rule, *scale);
            let own = grouped(&scene, &settings(own, &[], 2), 16, 64, 16);
            let agreement = agree(&all[k], &own).expect("one frame");
            assert!(agreement.passed(), "level {k}: {agreement:?}");
        }
    }
}

/// A point light in a mirror, which only rougher levels find: the first of these is the anchor, and its light is kept.
#[test]
fn energy_conservation_of_lights_that_plain_path_tracing_cannot_see() {
    let mut parts = SceneParts::default();
    parts.add(
        diffuse("floor", Rgb::splat(0.8)),
        [quad(
            Vec3::new(-1.0, 0.0, 1.0),
            Vec3::X * 2.0,
            Vec3::Z * -2.0,
        )],
    );
    parts.add(
        metal("mirror", Rgb::splat(0.9), 0.0),
        [quad(
            Vec3::new(-1.0, 0.0, -1.0),
            Vec3::X * 2.0,
            Vec3::Y * 2.0,
        )],
    );
    // A shade between lamp and floor: light reaches the floor only by the mirror.
    parts.add(
        diffuse("shade", Rgb::ZERO),
        [quad(
            Vec3::new(-1.0, 0.9, 1.0),
            Vec3::X * 2.0,
            Vec3::Z * -1.4,
        )],
    );
    parts.lights.push(PunctualLight::Point {
        position: Vec3::new(0.0, 1.3, 0.2),
        intensity: Rgb::splat(4.0),
        range: f32::INFINITY,
    });
    parts.add_camera([0.0, 0.7, 1.8], [0.0, 0.0, 0.3], 50.0);
    let scene = scene(parts);
    let size = UVec2::splat(24);
    let mut picture = blank(size, Window::full(size));
    let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
    let settings = settings(Rule::constant(0.1), &[0.0, 1.0, 2.0], 4);
    settings.integrator().pass(&view, 0..256, &mut picture);
    let levels = picture.levels.as_ref().expect("levels");
    let mean = |b: &crate::image::Buffer| b.pixels.iter().map(|p| p.x).sum::<f32>();
    let (plain, anchor, first) = (
        mean(&picture.film.mean()),
        mean(&levels.mean(0)),
        mean(&levels.mean(1)),
    );
    assert!(first > 1.2 * plain, "{plain} {first}");
    assert!((anchor / first - 1.0).abs() < 1e-4, "{anchor} {first}");
    let share = unseen_share(&picture);
    assert!((share - f64::from(1.0 - plain / anchor)).abs() < 1e-4);
    let resolved = mean(&resolve_film(levels, Resolve::default()).picture);
    assert!((resolved / first - 1.0).abs() < 0.05, "{resolved} {first}");
}

/// Light that no level roughens is common to all levels; in a diffuse room that is all light. Guides are features of
/// the first rough vertex.
#[test]
fn shared_light_is_a_part_of_every_level() {
    let film = |parts: SceneParts| {
        let scene = scene(parts);
        let size = UVec2::splat(16);
        let mut picture = blank(size, Window::full(size));
        let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
        let settings = settings(Rule::constant(0.3), &[0.0, 0.5, 1.0], 6);
        settings.integrator().pass(&view, 0..16, &mut picture);
        picture.levels.expect("levels")
    };
    let mut parts = metal_room();
    for material in &mut parts.materials {
        if material.name != "light" {
            *material = diffuse("walls", Rgb::splat(0.6));
        }
    }
    let (gray, metal) = (film(parts), film(metal_room()));
    for (levels, all) in [(&gray, true), (&metal, false)] {
        let shared = levels.mean(levels.levels());
        let mut more = 0;
        for k in 0..levels.levels() {
            for (whole, part) in levels.mean(k).pixels.iter().zip(&shared.pixels) {
                let rest = (*whole - *part).min_element();
                assert!(rest >= -1e-5 * whole.max_element(), "{whole} {part}");
                more += usize::from(rest > 1e-4);
            }
        }
        assert_eq!(more == 0, all, "{more}");
    }
    for features in gray.features() {
        // The first vertex is rough except on the lamp, which is black.
        assert_eq!(features[..4], features[4..8]);
        // The mean of unit normals is not longer than 1.
        let [x, y, z, length, .., r, g, b] = features;
        let normal = Vec3::new(x, y, z).length();
        assert!(
            normal <= 1.0 + 1e-5 && length > 0.1 && length < 3.0,
            "{normal} {length}"
        );
        assert!(r == g && g == b && r < 0.6 + 1e-5, "{r} {g} {b}");
    }
    // Behind a mirror the first rough vertex is not the first vertex.
    let differs = |f: &[f32; 11]| f[..4] != f[4..8];
    assert!(metal.features().iter().any(differs));
}

#[test]
fn determinism_of_levels_over_splits_threads_and_crops() {
    let scene = scene(metal_room());
    let settings = settings(table(), &SCALES, 5);
    let size = UVec2::new(21, 18);
    let full = Window::full(size);
    let render = |window: Window, ends: &[u32], threads: usize| {
        let mut picture = blank(size, window);
        picture.aovs = Some(FirstHit::new(window).into());
        add_passes(&scene, &settings, ends, threads, &mut picture);
        picture
    };
    let whole = render(full, &[10], 1);
    assert_eq!(render(full, &[1, 2, 7, 10], 3), whole);
    let window = Window {
        x: 3,
        y: 2,
        w: 17,
        h: 16,
    };
    let part = render(window, &[10], 2);
    assert_eq!(part.film, whole.film.cut(window));
    let levels = whole.levels.as_ref().expect("levels");
    let own = part.levels.as_ref().expect("levels");
    for level in 0..=levels.levels() {
        let inside = levels.batch_means(level).map(|all| {
            let (x, y) = (window.x as usize, window.y as usize);
            Buffer::from_fn(17, 16, |u, v| all.get(x + u, y + v))
        });
        assert_eq!(own.batch_means(level), inside);
    }
    let features = levels.features();
    let pixels = (0..window.len()).map(|i| window.pixel(i));
    let inside = pixels.map(|p| features[p.y as usize * whole.film.size.x as usize + p.x as usize]);
    assert_eq!(own.features(), inside.collect::<Vec<_>>());
    // Written bytes are read back; incomplete ones are an error.
    let mut bytes = Vec::new();
    levels.write(&mut bytes).expect("a vector takes everything");
    let read = |bytes: &[u8]| LevelFilm::read(size, full, &mut &bytes[..]);
    assert_eq!(&read(&bytes).expect("a film"), levels);
    // One sample has no noise estimate, two samples have one.
    let few = |samples| render(full, &[samples], 2).levels.expect("levels");
    assert_eq!(few(1).complete(), None);
    assert!(few(2).complete().is_some());
    assert_eq!(
        bytes.len() as u64,
        12 + LevelFilm::bytes(full.len(), SCALES.len())
    );
    for end in [0, 7, 11, 12, 100, bytes.len() - 1] {
        assert!(read(&bytes[..end]).is_err(), "{end}");
    }
}

/// Samples of a large picture are added in runs of three.
#[test]
fn determinism_of_levels_over_the_runs_of_a_pass() {
    let scene = scene(metal_room());
    let settings = Settings {
        max_vertices: 1,
        ..settings(table(), &SCALES, 5)
    };
    let frame = UVec2::new(421, 379);
    let render = |passes: &[u32]| {
        let mut picture = blank(frame, Window::full(frame));
        let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
        let mut integrator = settings.integrator();
        let mut next = 0;
        for &length in passes {
            let added = integrator.pass(&view, next..next + length, &mut picture);
            assert_eq!(added, length);
            next += length;
        }
        picture
    };
    assert!(render(&[8]) == render(&[1, 2, 5]));
}

#[test]
fn levels_of_other_rules_are_refused_by_name() {
    let refused = |settings: Settings| settings.check_amounts().expect_err("refused");
    // Rules of other renderers roughen the path itself, and so have no factors to scale.
    for rule in [
        Rule::Plain,
        Rule::Pbrt,
        Rule::FilterGlossy(0.5),
        Rule::RoughnessClamp,
    ] {
        assert_eq!(refused(settings(rule, &SCALES, 0)), LevelError::Rule);
    }
    let why = LevelError::Rule.to_string();
    assert!(why.contains("a table or a constant"), "{why}");
    let consistent = Rule::Accumulated(Accumulated {
        factors: Factors::Constant(0.5),
        lambda: 0.1,
    });
    assert_eq!(
        refused(settings(consistent, &SCALES, 0)),
        LevelError::Consistent
    );
    let reuse = Settings {
        estimator: Estimator::Path { reuse: true },
        ..settings(table(), &SCALES, 0)
    };
    assert_eq!(refused(reuse), LevelError::Reuse);
    for scales in [
        &[0.0][..],
        &[0.5, 1.0],
        &[0.0, 2.0, 1.0],
        &[0.0, f32::NAN],
        &[0.0; 9],
    ] {
        assert_eq!(Amounts::roughening(scales), Err(LevelError::Scales));
    }
}
