//! The pilot that chooses the level of a table.

use super::support::render::scene;
use opsr::gallery::caustic_box;
use opsr::image::film::{Film, Window};
use opsr::integrator::{Picture, Settings, View};
use opsr::math::UVec2;
use opsr::regularise::{AttenuationTable, GammaIndex, LEN, Rule};
use opsr::scene::Scene;
use opsr::tune::{CONTRASTS, Change, Level, SCALES, choose};

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
fn a_table_that_does_nothing_is_the_plain_picture_path_by_path() {
    let scene = scene(caustic_box());
    let pilot = choose(&settings(0.0), &view(&scene), 1).unwrap();
    assert_eq!(pilot.levels.len(), SCALES.len() * CONTRASTS.len());
    for level in &pilot.levels {
        assert_eq!(level.bias2, 0.0, "{level:?}");
    }
    assert_eq!((pilot.change, pilot.decided), (Change::NONE, false));
}

#[test]
fn the_more_samples_the_less_roughening() {
    let scene = scene(caustic_box());
    const SAMPLES: u32 = 60;
    let pilot = choose(&settings(0.1), &view(&scene), SAMPLES).unwrap();
    // What is roughened more has less variance and more bias.
    let (first, last) = (pilot.levels[0], pilot.levels[SCALES.len() - 1]);
    assert!(last.variance < 0.5 * first.variance, "{pilot:?}");
    assert!(last.bias2 > 2.0 * first.bias2, "{pilot:?}");
    // So the best level falls as samples grow, of which the pilot's estimates are independent.
    let best = |samples: f64| {
        let error = |l: &Level| l.bias2.max(0.0) + l.variance * f64::from(SAMPLES) / samples;
        let levels = pilot.levels.iter();
        let best = levels.min_by(|a, b| error(a).total_cmp(&error(b)));
        best.unwrap().change.scale
    };
    assert!(best(1e6) < best(1.0), "{pilot:?}");
    if pilot.decided {
        assert_eq!(pilot.change.scale, best(SAMPLES.into()));
    }
}

#[test]
fn a_pattern_that_does_not_fit_is_given_up() {
    let scene = scene(caustic_box());
    let mut table = AttenuationTable::constant(1.0);
    // The wrong way round: the more glossy vertices, the less a path is roughened.
    for (gamma, class) in table
        .gammas
        .iter_mut()
        .zip((0..LEN).filter_map(GammaIndex::new))
    {
        let levels = class.levels();
        *gamma = if levels[levels.len() - 1] == 0 {
            1e-3
        } else {
            1.0
        };
    }
    let settings = Settings {
        rule: Rule::with_table(table.clone()),
        ..Settings::default()
    };
    let pilot = choose(&settings, &view(&scene), 40).unwrap();
    assert!(pilot.decided && pilot.change.contrast < 1.0, "{pilot:?}");
    let changed = pilot.change.of(&table);
    assert!(changed.scale == pilot.change.scale && changed.gammas != table.gammas);
}

/// What a pilot says about the mean of the picture, by longer renders with other random numbers.
#[test]
fn energy_is_kept_where_that_is_asked_for() {
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
    let changed = |change: Change| mean(Rule::with_table(change.of(table))) / plain - 1.0;
    let level = |change: Change| pilot.levels.iter().find(|l| l.change == change).unwrap();
    let (roughest, kept) = (pilot.levels[SCALES.len() - 1].change, pilot.within(0.005));
    let found = [roughest, kept].map(|change| {
        let (said, found) = (level(change).energy, changed(change));
        assert!((said - found).abs() < 0.01, "{change:?}: {said} {found}");
        found
    });
    // The smaller of them is little more than the noise of both.
    assert!(
        found[0] < -0.015 && found[1].abs() < 0.75 * found[0].abs(),
        "{found:?}"
    );
    assert!(level(kept).energy.abs() <= 0.005 && kept.scale < pilot.within(1.0).scale);
}
