//! What pictures state about their error.

use super::support::render::{film, scene};
use opsr::image::Film;
use opsr::math::{DVec3, Rgb, UVec2};
use opsr::regularise::Rule;
use opsr::resolve::film_error;
use opsr::sampler::{Independent, SampleSource, Sampler, Seed};
use opsr_lab::gallery::builtin;

/// Means over films of the stated squared error and of the true one, relative to the mean of all films.
fn stated_and_true(films: &[Film], truth: Option<DVec3>) -> (f64, f64) {
    let count = films.len() as f64;
    let mean = |pixel: usize| {
        let sum: DVec3 = films.iter().map(|film| film.pixels[pixel].mean).sum();
        truth.unwrap_or(sum / count)
    };
    let truths: Vec<DVec3> = (0..films[0].pixels.len()).map(mean).collect();
    // The mean of all films is nearer to each of them than the truth is.
    let near = if truth.is_some() {
        1.0
    } else {
        1.0 - 1.0 / count
    };
    let (mut stated, mut actual) = (0.0, 0.0);
    for film in films {
        stated += film_error(film).error.powi(2) / count;
        let pairs = film.pixels.iter().zip(&truths);
        let errors =
            pairs.map(|(m, f)| ((m.mean - f) * (m.mean - f) / (f * f + 0.01)).element_sum());
        actual += errors.sum::<f64>() / (3.0 * truths.len() as f64 * count * near);
    }
    (stated, actual)
}

/// Light of mean 1 in hits of chance p and size 1 / p: its variance over its square is (1 / p − 1) / n, whatever was met.
#[test]
fn stated_error_of_rare_hits_is_the_true_one() {
    for (chance, most) in [(0.5f32, 0.1), (0.05, 0.15), (0.005, 0.25)] {
        let films: Vec<Film> = (0..24)
            .map(|seed| {
                let mut film = Film::new(UVec2::splat(48));
                for pixel in 0..film.pixels.len() {
                    let source = Independent { seed: Seed(seed) };
                    for sample in 0..16 {
                        let place = UVec2::new(pixel as u32 % 48, pixel as u32 / 48);
                        let mut stream = source.stream(place, sample);
                        let hit = stream.next_1d() < chance;
                        film.push(
                            pixel,
                            Rgb::splat(if hit { 1.0 / chance } else { 0.0 }),
                            sample,
                        );
                    }
                }
                film
            })
            .collect();
        let (stated, actual) = stated_and_true(&films, Some(DVec3::ONE));
        assert!(
            (stated / actual - 1.0).abs() < most,
            "{chance}: {stated} {actual}"
        );
    }
}

/// Caustics by path tracing: a picture's own noisy means make four times less of them.
#[test]
fn stated_error_of_caustics_is_the_true_one() {
    let scene = scene(builtin("cornell_caustics").expect("a scene"));
    let films: Vec<Film> = (0..48)
        .map(|seed| film(&scene, Rule::Plain, 32, 32, seed))
        .collect();
    let (stated, actual) = stated_and_true(&films, None);
    assert!((stated / actual - 1.0).abs() < 0.15, "{stated} {actual}");
}

/// A single bright sample carries the picture's error, which is then in doubt.
#[test]
fn doubt_is_large_where_one_sample_decides() {
    let mut film = Film::new(UVec2::splat(32));
    for sample in 0..16 {
        for pixel in 0..film.pixels.len() {
            let bright = (pixel, sample) == (500, 3);
            let dim = 1.0 + 0.1 * ((pixel + sample as usize) % 3) as f32;
            film.push(pixel, Rgb::splat(if bright { 1000.0 } else { dim }), sample);
        }
    }
    let statement = film_error(&film);
    assert!(
        statement.doubt > 0.9 && statement.error > 0.5,
        "{statement:?}"
    );
    assert!(statement.bound() > 1.5 * statement.error);
}
