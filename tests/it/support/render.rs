//! Small renders.

use opsr::image::{Buffer, Film};
use opsr::integrator::{Picture, Settings, View};
use opsr::math::UVec2;
use opsr::regularise::Rule;
use opsr::scene::{Scene, SceneParts};

/// A film through the scene's first camera.
pub(crate) fn film(scene: &Scene, rule: Rule, size: u32, spp: u32, seed: u64) -> Film {
    let settings = Settings {
        rule,
        seed,
        ..Settings::default()
    };
    film_with(scene, &settings, size, spp)
}

/// A square film with these settings.
pub(crate) fn film_with(scene: &Scene, settings: &Settings, size: u32, spp: u32) -> Film {
    let mut picture = Picture {
        film: Film::new(UVec2::splat(size)),
        aovs: None,
        levels: None,
    };
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, 0..spp, &mut picture);
    assert_eq!(picture.film.rejected.total(), 0);
    picture.film
}

/// Adds samples to a picture through the scene's first camera, in passes with these ends, by this number of threads.
pub(crate) fn add_passes(
    scene: &Scene,
    settings: &Settings,
    ends: &[u32],
    threads: usize,
    picture: &mut Picture,
) {
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    let mut integrator = settings.integrator();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads").install(|| {
        let mut start = 0;
        for &end in ends {
            integrator.pass(&view, start..end, picture);
            start = end;
        }
    });
}

/// A scene of these parts; a warning fails the test.
pub(crate) fn scene(parts: SceneParts) -> Scene {
    let scene = Scene::new(parts);
    assert_eq!(scene.warnings(), &[] as &[String]);
    scene
}

/// Mean over pixels and channels, and its standard error.
pub(crate) fn mean(film: &Film) -> (f64, f64) {
    let (means, variances) = (film.mean(), film.variance_of_mean());
    let n = 3.0 * means.pixels.len() as f64;
    let sum = |b: &Buffer| -> f64 {
        (b.pixels.iter())
            .map(|p| f64::from(p.x) + f64::from(p.y) + f64::from(p.z))
            .sum()
    };
    (sum(&means) / n, sum(&variances).sqrt() / n)
}

/// A noiseless film of a picture: two equal samples in every pixel.
pub(crate) fn without_noise(picture: &Buffer) -> Film {
    let mut film = Film::new(UVec2::new(picture.width as u32, picture.height as u32));
    for (i, &value) in picture.pixels.iter().enumerate() {
        (0..2).for_each(|sample| film.push(i, value, sample));
    }
    film
}
