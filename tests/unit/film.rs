//! Films: moments, rejected samples, tiles, checkpoints.

use crate::image::film::{Cause, Film, RejectedSample, Window};
use crate::math::{DVec3, Rgb, UVec2};
use crate::resolve::film_error;
use crate::unit::support::draws::noise;

/// Pushes the samples `from..to` to every pixel, tile by tile.
fn render(film: &mut Film, edge: u32, from: u32, to: u32) {
    for tile in film.tiles(edge) {
        let mut part = film.cut(tile);
        for i in 0..part.pixels.len() {
            for s in from..to {
                part.push(i, noise(part.window.pixel(i), s, 7), s);
            }
        }
        film.paste(&part);
    }
}

#[test]
fn film_tiles_cover_each_pixel_once() {
    for (size, edge) in [
        ((37, 21), 8),
        ((64, 64), 16),
        ((5, 1), 100),
        ((1, 1), 1),
        ((3, 3), 0),
    ] {
        let film = Film::new(UVec2::from(size));
        let mut seen = vec![0; film.pixels.len()];
        for tile in film.tiles(edge) {
            for i in 0..tile.len() {
                let p = tile.pixel(i);
                seen[(p.y * size.0 + p.x) as usize] += 1;
            }
        }
        assert!(seen.iter().all(|&n| n == 1), "{size:?} in tiles of {edge}");
    }
}

#[test]
fn film_determinism_over_passes_and_tiles() {
    let window = Window {
        x: 3,
        y: 5,
        w: 29,
        h: 17,
    };
    let empty = Film::cropped(UVec2::new(40, 30), window).unwrap();
    let (mut once, mut passes) = (empty.clone(), empty);
    render(&mut once, 64, 0, 12);
    for pass in 0..4 {
        render(&mut passes, 5 + pass, 3 * pass, 3 * pass + 3);
    }
    assert_eq!(once, passes);
}

#[test]
fn film_resume_is_bit_identical() {
    let mut film = Film::new(UVec2::new(9, 4));
    render(&mut film, 4, 0, 5);
    film.push(7, Rgb::new(1.0, f32::NAN, 1.0), 3);
    film.push(8, Rgb::new(f32::INFINITY, 0.0, 0.0), 4);
    let numbers: Vec<f64> = film.numbers().collect();
    let stored = |numbers: &[f64]| Film::from_numbers(film.size, film.window, numbers);
    let mut resumed = stored(&numbers).unwrap();
    resumed.rejected = film.rejected.clone();
    assert_eq!(resumed, film);
    render(&mut resumed, 3, 5, 9);
    let mut whole = film.clone();
    render(&mut whole, 4, 5, 9);
    assert!(resumed.numbers().eq(whole.numbers()));
    for cut in 0..numbers.len() {
        assert!(stored(&numbers[..cut]).is_err(), "cut at {cut}");
    }
    // Numbers that samples cannot give, such as half a sample in the pixel of column 1.
    for (at, absurd) in [
        (7, 0.5),
        (7, 1e10),
        (8, f64::NAN),
        (9, f64::INFINITY),
        (10, -1.0),
        (13, -1e-9),
    ] {
        let mut numbers = numbers.clone();
        numbers[at] = absurd;
        let error = stored(&numbers).unwrap_err().to_string();
        assert!(
            error.contains("pixel 1, 0 of the film"),
            "{at} {absurd}: {error}"
        );
    }
}

#[test]
fn film_refuses_and_names_nan_and_infinite_samples() {
    let window = Window {
        x: 10,
        y: 20,
        w: 4,
        h: 4,
    };
    let mut film = Film::cropped(UVec2::new(100, 100), window).unwrap();
    film.push(6, Rgb::ONE, 0);
    film.push(6, Rgb::new(f32::NAN, f32::INFINITY, 0.0), 1);
    film.push(6, Rgb::new(0.0, f32::NEG_INFINITY, 0.0), 2);
    assert_eq!((film.rejected.nan, film.rejected.infinite), (1, 1));
    assert_eq!(film.pixels[6].n, 1);
    assert_eq!(film.pixels[6].mean, DVec3::ONE);
    let first = RejectedSample {
        pixel: UVec2::new(12, 21),
        sample: 1,
        cause: Cause::Nan,
    };
    assert_eq!(film.rejected.first[0], first);
    for s in 0..100 {
        film.push(0, Rgb::splat(f32::NAN), s);
    }
    assert_eq!(film.rejected.total(), 102);
    assert!(film.rejected.first.len() <= 8);
}

#[test]
fn film_variances_beyond_single_precision_are_clipped_and_counted() {
    let mut film = Film::new(UVec2::new(3, 1));
    for s in 0..8 {
        let on = (s % 2) as f32;
        film.push(0, Rgb::new(1.0, 1e38, 0.0) * on, s);
        film.push(1, Rgb::splat(1e18) * on, s);
        film.push(2, Rgb::splat(f32::MAX), s);
    }
    assert_eq!(film.clipped_variances(), 1);
    for picture in [film.sample_variance(), film.variance_of_mean()] {
        assert_eq!(picture.pixels[0].y, f32::MAX);
        assert!(picture.pixels.iter().all(|p| p.is_finite()));
        assert!(picture.pixels[1].x < f32::MAX && picture.pixels[2] == Rgb::ZERO);
    }
}

#[test]
fn film_estimated_error_is_the_true_error() {
    // Uniform samples have mean ½ and variance 1/12, so the estimate is √(1/12 / n / (¼ + ε)).
    let mut film = Film::new(UVec2::new(32, 32));
    assert_eq!(film_error(&film).root, f64::INFINITY);
    render(&mut film, 32, 0, 64);
    let expected = (1.0 / 12.0 / 64.0 / 0.26f64).sqrt();
    assert!(
        (film_error(&film).root / expected - 1.0).abs() < 0.02,
        "{}",
        film_error(&film).root
    );
    let true_error = film
        .mean()
        .pixels
        .iter()
        .map(|p| (p.as_dvec3() - 0.5).length_squared() / 0.26)
        .sum::<f64>()
        / (3.0 * 1024.0);
    assert!((true_error.sqrt() / expected - 1.0).abs() < 0.05);
}

#[test]
fn film_windows_outside_the_frame_are_refused() {
    let size = UVec2::new(10, 10);
    for (x, y, w, h) in [
        (0, 0, 11, 1),
        (5, 5, 6, 1),
        (0, 0, 0, 4),
        (u32::MAX, 0, 2, 2),
        (1, 0, u32::MAX, 1),
    ] {
        assert!(Film::cropped(size, Window { x, y, w, h }).is_err());
    }
}
