//! The error of their mean that films state.

use crate::image::film::{Film, Window};
use crate::integrator::bidirectional::Radius;
use crate::integrator::{Estimator, Picture, Settings, View};
use crate::math::moments::Moments;
use crate::math::{DVec3, UVec2};
use crate::scene::Scene;
use crate::unit::lab::gallery::{builtin, cornell_box};
use crate::unit::support::render::scene;

/// Estimators whose pixels share light paths, and one whose pixels do not.
const ESTIMATORS: [Estimator; 6] = [
    Estimator::Light,
    Estimator::Bdpt,
    Estimator::Vcm(Radius {
        first: None,
        alpha: 1.0,
    }),
    Estimator::Sppm(Radius {
        first: Some(0.2),
        alpha: 1.0,
    }),
    Estimator::Mlt { mutations: 4 },
    Estimator::Path { reuse: false },
];

/// A frame and the part of it that is rendered.
type Place = (UVec2, Window);

fn film(scene: &Scene, estimator: Estimator, (place, samples): (Place, u32), seed: u64) -> Film {
    let settings = Settings {
        estimator,
        max_vertices: 6,
        seed,
        ..Settings::default()
    };
    let film = Film::cropped(place.0, place.1).expect("a part of the frame");
    let mut picture = Picture::new(film);
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, 0..samples, &mut picture);
    picture.film
}

/// Means of pictures over seeds, and the squared errors that the pictures state for them.
fn over_seeds(scene: &Scene, estimator: Estimator, size: (Place, u32)) -> (DVec3, DVec3, DVec3) {
    const SEEDS: u64 = 64;
    let (mut means, mut stated, mut by_pixels) = (Moments::default(), DVec3::ZERO, DVec3::ZERO);
    for seed in 0..SEEDS {
        let mut film = film(scene, estimator, size, seed);
        let sum: DVec3 = film.pixels.iter().map(|m| m.mean).sum();
        means.push(sum / film.pixels.len() as f64);
        let square = |film: &Film| {
            let (error, _) = film.mean_error().expect("enough samples");
            error * error / SEEDS as f64
        };
        stated += square(&film);
        film.sharing = Default::default();
        by_pixels += square(&film);
    }
    (means.sample_variance(), stated, by_pixels)
}

/// 17 samples: one of the 16 batches has two of them.
#[test]
fn stated_error_of_the_mean_is_the_true_one() {
    let frame = UVec2::splat(12);
    let place = (frame, Window::full(frame));
    for (name, parts, samples) in [
        ("box", cornell_box(), 17),
        ("caustics", builtin("cornell_caustics").expect("a scene"), 9),
    ] {
        let scene = scene(parts);
        for estimator in ESTIMATORS {
            let (found, stated, by_pixels) = over_seeds(&scene, estimator, (place, samples));
            let ratio = |of: DVec3| (of.element_sum() / found.element_sum()).sqrt();
            let (whole, pixels) = (ratio(stated), ratio(by_pixels));
            println!("{name}, {estimator:?}: stated over true {whole:.2}, by pixels {pixels:.2}");
            assert!(
                (0.8..1.25).contains(&whole),
                "{name}, {estimator:?}: {whole}"
            );
        }
    }
}

/// A photon of a large radius counts in many pixels of a small window; the pixels alone give a quarter of the error.
#[test]
fn stated_error_of_the_mean_knows_photons_that_pixels_share() {
    let scene = scene(builtin("cornell_caustics").expect("a scene"));
    let window = Window {
        x: 12,
        y: 20,
        w: 8,
        h: 8,
    };
    let place = (UVec2::splat(32), window);
    let radius = Radius {
        first: Some(0.3),
        alpha: 1.0,
    };
    let (found, stated, by_pixels) = over_seeds(&scene, Estimator::Sppm(radius), (place, 8));
    let ratio = |of: DVec3| (of.element_sum() / found.element_sum()).sqrt();
    let (whole, pixels) = (ratio(stated), ratio(by_pixels));
    println!("stated over true {whole:.2}, by pixels {pixels:.2}");
    assert!((0.8..1.25).contains(&whole), "{whole}");
    assert!(pixels < 0.5, "{pixels}: nothing is shared");
}

/// The sums are exact: merged crops have those of the whole picture.
#[test]
fn mean_error_of_crops_is_that_of_the_whole() {
    let scene = scene(cornell_box());
    let settings = Settings {
        estimator: Estimator::Bdpt,
        ..Settings::default()
    };
    let frame = UVec2::new(9, 7);
    let render = |window: Window| {
        let film = Film::cropped(frame, window).expect("a part of the frame");
        let mut picture = Picture::new(film);
        let view = View::of(&scene, &scene.parts().cameras[0], &picture.film);
        settings.integrator().pass(&view, 0..5, &mut picture);
        picture.film
    };
    let whole = render(Window::full(frame));
    let mut joined = Film::new(frame);
    for (i, tile) in joined.tiles(4).into_iter().enumerate() {
        let part = render(tile);
        joined.paste(&part);
        match i {
            0 => joined.sharing = part.sharing,
            _ => joined.sharing.merge(&part.sharing),
        }
    }
    assert_eq!(joined, whole);
    assert!(whole.mean_error().is_some());
    assert_eq!(whole.cut(Window::full(frame)).mean_error(), None);
}
