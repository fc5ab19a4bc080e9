use super::*;
use crate::sampler::{Independent, SampleSource, Sampler};

/// Uniform numbers in [0, 1).
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let source = Independent { seed: Seed(seed) };
    let mut stream = source.stream(UVec2::ZERO, 0);
    move || f64::from(stream.next_1d())
}

/// A picture of 40 x 30 pixels with even light and little noise; a part of it in the upper left corner is missing.
fn picture(missing: f32) -> Picture {
    let frame = UVec2::new(40, 30);
    let mut film = Film::new(frame);
    for pixel in 0..film.pixels.len() {
        let corner = pixel % 40 < 20 && pixel / 40 < 15;
        let light = if corner { 1.0 - missing } else { 1.0 };
        for sample in 0..16 {
            let noise = if sample % 2 == 0 { 0.9 } else { 1.1 };
            film.push(pixel, Rgb::splat(light * noise), sample);
        }
    }
    Picture::new(film)
}

/// Light of four by three regions in independent pictures: half of it even, half in rare hits.
fn lights(seed: u64) -> Vec<Vec<f64>> {
    let mut number = numbers(seed);
    let mut region = |_| {
        let hits = (0..20).filter(|_| number() < 0.1).count();
        3.0 * (0.5 + 0.25 * hits as f64)
    };
    (0..PICTURES)
        .map(|_| (0..12).map(&mut region).collect())
        .collect()
}

#[test]
fn regions_are_nearly_square() {
    let of = |x, y, most| grid(UVec2::new(x, y), most);
    assert_eq!(of(64, 48, 12.0), Some(UVec2::new(4, 3)));
    assert_eq!(of(1920, 1080, 192.0), Some(UVec2::new(16, 9)));
    assert_eq!(of(100, 100, 100.0).map(|g| g.x == g.y), Some(true));
    assert_eq!(of(4000, 4, 12.0), None);
    for (x, y) in [(640, 480), (500, 333), (333, 1000), (1024, 436)] {
        for most in [12.0, 40.0, 192.0] {
            let found = of(x, y, most).expect("a grid");
            let uneven = f64::from(found.x * y) / f64::from(found.y * x);
            assert!((uneven - 1.0).abs() < 0.15, "{x}x{y}, {most}: {found}");
        }
    }
}

#[test]
fn means_over_regions_count_every_pixel_once() {
    let (frame, grid) = (UVec2::new(10, 7), UVec2::new(4, 3));
    let ones = means(frame, grid, |_| 1.0);
    assert!(ones.iter().all(|&mean| mean == 1.0), "{ones:?}");
    let columns = means(UVec2::new(8, 3), grid, |i| (i % 8) as f64);
    assert_eq!(columns, [0.5, 2.5, 4.5, 6.5].repeat(3));
}

/// Table values for 15 degrees of freedom.
#[test]
fn student_quantiles_are_those_of_tables() {
    for (z, t) in [(1.959_964, 2.131), (3.090_232, 3.733), (3.719_016, 4.880)] {
        let found = student(z, 15.0);
        assert!((found / t - 1.0).abs() < 0.01, "{found} for {t}");
    }
}

#[test]
fn light_that_small_pictures_have_and_a_picture_misses_is_found() {
    let grid = UVec2::new(4, 3);
    for seed in 0..20 {
        assert_eq!(compared(&lights(seed), &picture(0.0), grid), None, "{seed}");
        let found = compared(&lights(seed), &picture(0.8), grid);
        let found = found.unwrap_or_else(|| panic!("nothing is missing by seed {seed}"));
        // A fifth of all light: 0.8 of a quarter.
        assert!((0.08..0.22).contains(&found.share), "{seed}: {found}");
        let pixel = found.pixel;
        assert!(pixel.x < 20 && pixel.y < 20, "{seed}: {found}");
        // Much light is missing around the first pixel, less around the first of the last row.
        let [first, last_row] = [found.squares[0], found.squares[29 * 40]];
        assert!(first > 0.2 && first > 2.0 * last_row, "{first}, {last_row}");
        assert_eq!(found.squares.last(), Some(&0.0), "{seed}");
        assert_eq!(found.finder, IntegratorKind::Vcm);
    }
}

/// One bright picture of sixteen is one standard error.
#[test]
fn one_bright_picture_is_no_proof() {
    for bright in 0..PICTURES as usize {
        let mut lights = vec![vec![3.0; 12]; PICTURES as usize];
        lights[bright] = vec![300.0; 12];
        assert_eq!(compared(&lights, &picture(0.0), UVec2::new(4, 3)), None);
    }
}

/// A region's light counts at its brightest level, which a choice takes.
#[test]
fn light_of_the_best_level_counts() {
    use crate::image::level_film::{FEATURES, LevelFilm, PathLevels};
    let mut dark = picture(0.8);
    let frame = dark.film.size;
    let mut levels = LevelFilm::new(frame, Window::full(frame), 2);
    for pixel in 0..dark.film.pixels.len() {
        for sample in 0..4 {
            let values = PathLevels {
                levels: &[dark.film.pixels[pixel].mean.as_vec3(), Rgb::ONE],
                shared: Rgb::ZERO,
                features: [0.0; FEATURES],
            };
            levels.push(pixel, sample, &values);
        }
    }
    dark.levels = Some(levels);
    let light = light_in(&dark, UVec2::new(4, 3));
    assert!(light.iter().all(|l| (l - 3.0).abs() < 1e-4), "{light:?}");
    assert_eq!(compared(&lights(0), &dark, UVec2::new(4, 3)), None);
}

/// Pictures of one sample with rare hits are as noisy as they are bright: no evidence, even if most pixels are black.
#[test]
fn one_sample_is_no_proof() {
    let mut film = Film::new(UVec2::new(40, 30));
    for pixel in 0..film.pixels.len() {
        let light = if pixel == 607 { 900.0 } else { 0.0 };
        film.push(pixel, Rgb::splat(light), 0);
    }
    let picture = Picture::new(film);
    for seed in 0..20 {
        assert_eq!(compared(&lights(seed), &picture, UVec2::new(4, 3)), None);
    }
}
