//! The error that pictures state.

use crate::image::film::Window;
use crate::image::level_film::{FEATURES, LevelFilm, PathLevels};
use crate::image::{Buffer, Film};
use crate::math::{DVec3, Rgb, UVec2};
use crate::regularise::Rule;
use crate::resolve::{Resolve, film_error, film_errors, resolve_film};
use crate::sampler::{Independent, SampleSource, Sampler, Seed};
use crate::unit::lab::gallery::builtin;
use crate::unit::metric::{mean_relative_error, relative_error_map};
use crate::unit::support::render::{film, scene};

/// Stated and true squared error, relative, averaged over films. Without `truth` the mean of all films replaces it.
fn stated_and_true(films: &[Film], truth: Option<DVec3>) -> (f64, f64) {
    let count = films.len() as f64;
    let mean = |pixel: usize| {
        let sum: DVec3 = films.iter().map(|film| film.pixels[pixel].mean).sum();
        truth.unwrap_or(sum / count)
    };
    let truths: Vec<DVec3> = (0..films[0].pixels.len()).map(mean).collect();
    // Each film is part of the mean, and nearer to it than to the truth.
    let near = if truth.is_some() {
        1.0
    } else {
        1.0 - 1.0 / count
    };
    let (mut stated, mut actual) = (0.0, 0.0);
    for film in films {
        stated += film_error(film).root.powi(2) / count;
        let pairs = film.pixels.iter().zip(&truths);
        let errors =
            pairs.map(|(m, f)| ((m.mean - f) * (m.mean - f) / (f * f + 0.01)).element_sum());
        actual += errors.sum::<f64>() / (3.0 * truths.len() as f64 * count * near);
    }
    (stated, actual)
}

/// Hits of probability p and value 1 / p: the relative variance is (1 / p − 1) / n, independent of the hits found.
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

/// Caustics by path tracing: from a picture's own noisy means the stated error would be four times smaller. The stated
/// square is a fifth too small on average, within 0.04 for other seeds.
#[test]
fn stated_error_of_caustics_is_the_true_one() {
    let scene = scene(builtin("cornell_caustics").expect("a scene"));
    let films: Vec<Film> = (0..48)
        .map(|seed| film(&scene, Rule::Plain, 32, 32, seed))
        .collect();
    let (stated, actual) = stated_and_true(&films, None);
    assert!((stated / actual - 0.82).abs() < 0.15, "{stated} {actual}");
}

/// A single bright sample dominates the picture's error, which is therefore uncertain.
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
        statement.doubt > 0.9 && statement.root > 0.5,
        "{statement:?}"
    );
    assert!(statement.bound() > 1.5 * statement.mean);
}

/// Levels of normally distributed samples around a gradient: the difference of halves shows the noise of all samples.
#[test]
fn average_error_of_normal_samples_is_the_true_one_times_a_constant() {
    let size = 48u32;
    let truth = |i: usize| 0.2 + i as f64 / f64::from(size * size);
    for samples in [2u32, 3, 4, 8, 30] {
        let frame = UVec2::splat(size);
        let mut film = LevelFilm::new(frame, Window::full(frame), 2);
        let mut stream = Independent { seed: Seed(9) }.stream(UVec2::ZERO, samples);
        for pixel in 0..(size * size) as usize {
            for sample in 0..samples {
                let noise = (0..12).map(|_| stream.next_1d()).sum::<f32>() - 6.0;
                let light = Rgb::splat(truth(pixel) as f32 + 0.1 * noise);
                let path = PathLevels {
                    levels: &[light; 2],
                    shared: Rgb::ZERO,
                    features: [0.0; FEATURES],
                };
                film.push(pixel, sample, &path);
            }
        }
        let resolved = resolve_film(&film, Resolve::Sharp);
        let actual = resolved.picture.pixels.iter().enumerate();
        let actual = actual.map(|(i, p)| 3.0 * (f64::from(p.x) - truth(i)).abs());
        let stated = resolved.noise.iter().map(|&noise| f64::from(noise));
        let (stated, actual) = (stated.sum::<f64>(), actual.sum::<f64>());
        assert!(
            (stated / actual - 1.0).abs() < 0.05,
            "{samples} samples: {stated} {actual}"
        );
        let reference = Buffer {
            pixels: (0..resolved.picture.pixels.len())
                .map(|i| Rgb::splat(truth(i) as f32))
                .collect(),
            ..resolved.picture.clone()
        };
        let measured = mean_relative_error(&resolved.picture, &reference)
            .unwrap()
            .value;
        let ratio = resolved.statement().mean / measured;
        assert!((1.4..1.8).contains(&ratio), "{samples} samples: {ratio}");
    }
}

/// The average error is independent of exposure, at most 1, and 1 for a black picture.
#[test]
fn mean_relative_error_has_no_scale() {
    let picture = Buffer::from_fn(16, 16, |x, y| Rgb::new(x as f32, 1.0, 0.1 * y as f32));
    let reference = Buffer::from_fn(16, 16, |x, y| Rgb::new(8.0, y as f32, 1.0 + x as f32));
    let error = |test: &Buffer, reference: &Buffer| {
        mean_relative_error(test, reference)
            .expect("one size")
            .value
    };
    let plain = error(&picture, &reference);
    let scaled = |b: &Buffer| Buffer {
        pixels: b.pixels.iter().map(|p| *p * 1024.0).collect(),
        ..b.clone()
    };
    assert!((error(&scaled(&picture), &scaled(&reference)) - plain).abs() < 1e-9);
    assert!(plain > 0.1 && plain < 1.0, "{plain}");
    assert_eq!(error(&reference, &reference), 0.0);
    assert!(error(&scaled(&picture), &reference) <= 1.0);
    let black = Buffer::from_fn(16, 16, |_, _| Rgb::ZERO);
    assert_eq!(error(&black, &black), 0.0);
    assert!(error(&black, &reference) > 0.9);
}

/// The error map is the stated error per pixel: its mean is the average error, for raw means and for the choice of
/// levels, and noisier tiles have larger values.
#[test]
fn error_map_has_the_mean_that_is_stated() {
    let size = UVec2::new(48, 32);
    let truth = |i: usize| 0.2 + (i % 48) as f32 / 48.0;
    // Eight times the noise on the right.
    let spread = |i: usize| if i % 48 < 24 { 0.05 } else { 0.4 };
    let mut levels = LevelFilm::new(size, Window::full(size), 1);
    let mut film = Film::new(size);
    let mut stream = Independent { seed: Seed(3) }.stream(UVec2::ZERO, 0);
    for pixel in 0..(size.x * size.y) as usize {
        for sample in 0..16 {
            let noise = (0..12).map(|_| stream.next_1d()).sum::<f32>() - 6.0;
            let light = Rgb::splat((truth(pixel) + spread(pixel) * noise).max(0.0));
            let path = PathLevels {
                levels: &[light],
                shared: Rgb::ZERO,
                features: [0.0; FEATURES],
            };
            levels.push(pixel, sample, &path);
            film.push(pixel, light, sample);
        }
    }
    let resolved = resolve_film(&levels, Resolve::Sharp);
    let raw = film_errors(&film).expect("16 samples");
    let reference = Buffer {
        pixels: (0..raw.len()).map(|i| Rgb::splat(truth(i))).collect(),
        ..resolved.picture.clone()
    };
    let maps = [
        (raw, film_error(&film).mean, film.mean()),
        (
            resolved.error(),
            resolved.statement().mean,
            resolved.picture,
        ),
    ];
    for (map, stated, picture) in maps {
        let mean = map.iter().sum::<f32>() / map.len() as f32;
        assert!(
            (f64::from(mean) / stated - 1.0).abs() < 0.01,
            "{mean} {stated}"
        );
        let truth = relative_error_map(&picture, &reference).expect("one size");
        for side in [0, 24] {
            let inside = (0..map.len()).filter(|i| (side..side + 24).contains(&(i % 48)));
            let sums = inside.fold((0.0, 0.0), |(m, t), i| {
                (m + f64::from(map[i]), t + truth[i])
            });
            // The estimate also allows for bias, which is 0 here.
            let ratio = sums.0 / sums.1;
            assert!((0.95..1.9).contains(&ratio), "{side}: {ratio}");
        }
    }
    let black = Film::new(size);
    assert_eq!(film_errors(&black), None);
}
