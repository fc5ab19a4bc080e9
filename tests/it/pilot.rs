//! The pilot that chooses the level of a table.

use super::support::render::scene;
use opsr::integrator::pilot::{SCALES, choose};
use opsr::integrator::{Method, Settings};
use opsr::regularise::AttenuationTable;
use opsr::scene::builtin::caustic_box;

fn settings(gamma: f32) -> Settings {
    Settings {
        method: Method::Table {
            table: AttenuationTable::constant(gamma),
            reuse: false,
            lambda: 0.0,
        },
        ..Settings::default()
    }
}

#[test]
fn a_table_that_does_nothing_is_the_plain_picture_path_by_path() {
    let scene = scene(caustic_box());
    let camera = scene.parts().cameras[0].clone();
    let pilot = choose(&settings(0.0), &scene, &camera, 1.0, 1);
    assert_eq!(pilot.levels.len(), SCALES.len());
    for level in &pilot.levels {
        assert_eq!(level.bias2, 0.0, "{level:?}");
    }
    assert_eq!((pilot.scale, pilot.decided), (1.0, false));
}

#[test]
fn the_more_samples_the_less_roughening() {
    let scene = scene(caustic_box());
    let camera = scene.parts().cameras[0].clone();
    let few = choose(&settings(0.1), &scene, &camera, 1.0, 1);
    let many = choose(&settings(0.1), &scene, &camera, 1.0, 100);
    assert!(few.scale > many.scale, "{} {}", few.scale, many.scale);
    // What is roughened more has less variance and more bias.
    for levels in [&few.levels, &many.levels] {
        let (first, last) = (levels[0], levels[SCALES.len() - 1]);
        assert!(last.variance < first.variance, "{levels:?}");
        assert!(last.bias2 > first.bias2, "{levels:?}");
    }
}
