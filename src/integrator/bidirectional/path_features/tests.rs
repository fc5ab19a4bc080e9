use super::*;
use crate::image::splat::Splat;

/// Light that is not blurred is added to the pixels whose paths were traced.
#[test]
fn guides_of_forks_come_to_their_pixels() {
    let size = UVec2::new(64, 48);
    let window = Window {
        x: 8,
        y: 4,
        w: 40,
        h: 40,
    };
    let seen = |index: usize| Rgb::splat((index % 3) as f32);
    let mut recorder = PathFeatureRecorder::new(window, None);
    for rows in [0..30, 30..39] {
        let mut fork = recorder.fork();
        for index in rows.start * 40..rows.end * 40 {
            fork.begin(window.pixel(index), 5);
            // The first way, with share 0.5, has the light twice; the second has none.
            fork.dirac_only_light(seen(index));
            fork.dirac_only_light(seen(index));
            fork.way(0.5);
            fork.way(0.5);
            fork.finish(Rgb::ONE);
        }
        recorder.join(fork);
    }
    let mut layer = SplatLayer::new(&window);
    let index = 40;
    let value = Rgb::splat(4.0);
    layer.add_in_order(&[Splat { index, value }], 1.0);
    let mut film = LevelFilm::new(size, window, 1);
    recorder.push(5, &layer, &mut film);
    for index in 0..window.len() {
        let walked = index < 39 * 40;
        let expected = if walked { seen(index) } else { Rgb::ZERO };
        assert_eq!(film.batch_mean(index, 1, 1), expected);
        let numbers: Vec<f32> = film.sample(5).skip(17 * index).take(1).collect();
        assert_eq!(numbers[0].is_nan(), !walked);
    }
    assert_eq!(film.batch_mean(40, 1, 0), value);
}
