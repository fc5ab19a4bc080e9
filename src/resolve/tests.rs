use super::coarse::{Caps, Coarse, Missing};
use super::filter::{Size, tent};
use super::guide::{Guide, Inner, Surface};
use super::layer::{
    Batches, Candidate, common, confirmed, is_rare, median, share_of_alike, squared_difference,
    variance_of_mean, without_largest,
};
use super::tiles::{BASE, STEP, rest};
use super::*;
use crate::image::film::Window;
use crate::image::level_film::{BATCHES, FEATURES, Features, PathLevels};
use crate::image::relative::{mean_of, relative_errors};
use crate::sampler::{Independent, IndependentStream, SampleSource, Sampler, Seed};
use std::borrow::Cow;

fn stream(n: u32) -> IndependentStream {
    Independent { seed: Seed(5) }.stream(crate::math::UVec2::ZERO, n)
}

/// A square film with one sample per batch, all of whose light is roughened.
fn levels(size: usize, of: impl Fn(usize, usize, usize) -> Rgb, count: usize) -> LevelFilm {
    film(size, of, count, |_, _| Rgb::ZERO)
}

/// A square film with one sample per batch: light by level, batch and pixel, and light that no level changes.
fn film(
    size: usize,
    of: impl Fn(usize, usize, usize) -> Rgb,
    count: usize,
    shared: impl Fn(usize, usize) -> Rgb,
) -> LevelFilm {
    let frame = crate::math::UVec2::splat(size as u32);
    let mut film = LevelFilm::new(frame, Window::full(frame), count);
    for i in 0..size * size {
        for b in 0..BATCHES {
            let levels: Vec<Rgb> = (0..count).map(|k| of(k, b, i)).collect();
            let path = PathLevels {
                levels: &levels,
                shared: shared(b, i),
                features: [0.0; FEATURES],
            };
            film.push(i, b as u32, &path);
        }
    }
    film
}

const SHARP: Resolve = Resolve::Sharp;

const ALL: [Resolve; 3] = [Resolve::None, Resolve::Sharp, Resolve::Default];

/// Noise of mean 0 and variance 1 that depends on its arguments only.
fn noise(k: usize, b: usize, i: usize) -> f32 {
    let mut stream = stream((i * 64 + k * 8 + b) as u32);
    (0..12).map(|_| stream.next_1d()).sum::<f32>() - 6.0
}

/// Heavy tails: a brightness of 1/p with probability p, whose mean is 1 for every p.
#[test]
fn squared_difference_is_unbiased_under_heavy_tails() {
    let cases = [(0.5f32, 0.0f32), (0.05, 0.0), (0.05, 2.0), (0.01, 0.5)];
    let all = [2, 3, BATCHES]
        .into_iter()
        .flat_map(|batches| cases.map(|case| (batches, case)));
    for (batches, (p, offset)) in all {
        let (mut sum, mut squares, n) = (0.0f64, 0.0f64, 400_000);
        let mut stream = stream(7);
        for _ in 0..n {
            let d: [_; BATCHES] = std::array::from_fn(|_| {
                let hit = if stream.next_1d() < p { 1.0 / p } else { 0.0 };
                Vec3A::splat(hit - 1.0 + offset)
            });
            let u = f64::from(squared_difference(&d[..batches]).x);
            sum += u;
            squares += u * u;
        }
        let mean = sum / f64::from(n);
        let error = ((squares / f64::from(n) - mean * mean) / f64::from(n)).sqrt();
        let expected = f64::from(offset * offset);
        assert!(
            (mean - expected).abs() < 4.0 * error,
            "{p} {offset}: {mean} ± {error}"
        );
    }
}

#[test]
fn noise_free_levels_resolve_to_level_0() {
    let ramp = |k: usize, _, i: usize| Rgb::splat(1.0 + i as f32 / 64.0 + k as f32 * 0.01);
    let levels = levels(8, ramp, 4);
    for settings in ALL {
        let resolved = resolve_film(&levels, settings);
        assert!(resolved.level.iter().all(|&k| k == 0));
        assert_eq!(resolved.picture, levels.mean(0));
        // Hits are expected, and exp(−e) distinguishes their absence from darkness.
        assert!(resolved.statement().root < 1e-6);
    }
}

#[test]
fn white_noise_on_a_constant_resolves_to_the_roughest_level() {
    let value = |k: usize, b, i| Rgb::splat(1.0 + 0.2 * 0.25f32.powi(k as i32) * noise(k, b, i));
    let resolved = resolve_film(&levels(32, value, 3), SHARP);
    let count = |resolved: &Resolved, level| resolved.level.iter().filter(|&&k| k == level).count();
    // The estimated bias is itself noisy: it gives 88 % here.
    let counts = [0, 1, 2].map(|k| count(&resolved, k));
    assert!(counts[2] > 800 && counts[0] < 80, "{counts:?}");
    // A level that adds light everywhere is not taken.
    let bright = |k: usize, b, i| value(k, b, i) + Rgb::splat(if k == 2 { 0.5 } else { 0.0 });
    let resolved = resolve_film(&levels(32, bright, 3), SHARP);
    let counts = [0, 1, 2].map(|k| count(&resolved, k));
    assert!(counts[2] == 0 && counts[1] > 850, "{counts:?}");
}

/// Light that paths find without roughening, in a room under a sky: roughening the last vertex makes it noisier.
#[test]
fn noisier_levels_are_not_chosen() {
    let value = |k: usize, b, i| Rgb::splat(1.0 + [0.05, 0.6, 0.3][k] * noise(k, b, i));
    let resolved = resolve_film(&levels(32, value, 3), SHARP);
    let rough = resolved.level.iter().filter(|&&k| k > 0).count();
    assert!(rough < 20, "{rough}");
}

/// Light that a bright surface lost is not given to the shadow beside it.
#[test]
fn energy_correction_leaves_shadows_dark() {
    let shadow = |i: usize| i % 8 < 4;
    let value = |k: usize, b, i| {
        let bright = [1.0, 0.93][k] + [0.6, 0.05][k] * noise(k, b, i);
        Rgb::splat(bright * if shadow(i) { 0.01 } else { 1.0 })
    };
    let resolved = resolve_film(&levels(48, value, 2), SHARP);
    let pixels = resolved.picture.pixels.iter().enumerate();
    let dark: Vec<f32> = pixels
        .filter(|(i, _)| shadow(*i))
        .map(|(_, p)| p.x)
        .collect();
    let mean = dark.iter().sum::<f32>() / dark.len() as f32;
    assert!((mean - 0.01).abs() < 0.002, "{mean}");
}

/// Equal levels keep their picture, black pixels stay black, and light that a rough level loses is restored.
#[test]
fn energy_correction_keeps_equal_levels_and_black_pixels() {
    let black = |i: usize| i.is_multiple_of(7);
    let equal = |_, b, i| {
        if black(i) {
            Rgb::ZERO
        } else {
            Rgb::splat(1.0 + 0.3 * noise(0, b, i))
        }
    };
    let all = levels(16, equal, 3);
    let resolved = resolve_film(&all, SHARP);
    for (i, (p, q)) in resolved
        .picture
        .pixels
        .iter()
        .zip(&all.mean(0).pixels)
        .enumerate()
    {
        assert!((*p - *q).abs().max_element() < 1e-6, "{i}: {p} {q}");
    }
    let darker = |k: usize, b, i| {
        let spread = [0.6, 0.05][k];
        if black(i) {
            Rgb::ZERO
        } else {
            Rgb::splat([1.0, 0.93][k] + spread * noise(k, b, i))
        }
    };
    let all = levels(48, darker, 2);
    let resolved = resolve_film(&all, SHARP);
    assert!(resolved.level.iter().filter(|&&k| k == 1).count() > 2000);
    let mean = |b: &Buffer| b.pixels.iter().map(|p| p.x).sum::<f32>() / b.pixels.len() as f32;
    let (plain, rough) = (mean(&all.mean(0)), mean(&all.mean(1)));
    let lost = (mean(&resolved.picture) - plain).abs();
    assert!(lost < 0.35 * (plain - rough), "{plain} {rough} {lost}");
    for (i, p) in resolved.picture.pixels.iter().enumerate() {
        assert_eq!(*p == Rgb::ZERO, black(i), "{i}");
    }
}

/// Error of noise on a smooth picture falls by blur, that of a texture does not: neither the texture of the light that
/// all levels share nor a sharp edge of roughened light is blurred.
#[test]
fn blur_lowers_noise_and_keeps_texture_and_edges() {
    let size = 32;
    let texture = |i: usize| {
        if (i + i / size).is_multiple_of(2) {
            2.0
        } else {
            0.2
        }
    };
    let edge = |i: usize| if i % size < 16 { 1.0f32 } else { 0.1 };
    let shared = |_, i: usize| Rgb::splat(texture(i));
    let value = |spread: f32| {
        move |k: usize, b, i| {
            let noise = 1.0 + spread * [4.0, 1.0][k] * noise(k, b, i);
            Rgb::splat(texture(i) + edge(i) * noise)
        }
    };
    let error = |resolved: &Resolved| -> f32 {
        let pixels = resolved.picture.pixels.iter().enumerate();
        let square = |(i, p): (usize, &Rgb)| (p.x / (texture(i) + edge(i)) - 1.0).powi(2);
        pixels.map(square).sum()
    };
    for (spread, most) in [(0.2, 0.7), (0.002, 1.1)] {
        let all = film(size, value(spread), 2, shared);
        let sharp = error(&resolve_film(&all, SHARP));
        let blurred = error(&resolve_film(&all, Resolve::Default));
        assert!(blurred < most * sharp, "{spread}: {blurred} {sharp}");
    }
}

/// Noise of one batch beside dark pixels without noise, which differences of batches do not distinguish from bias.
#[test]
fn blur_leaves_dark_pixels_beside_noise_dark() {
    let (size, bright) = (32, |i: usize| i.is_multiple_of(8));
    let value = |k: usize, b: usize, i: usize| {
        let lit = bright(i) && b == (i / 8) % BATCHES;
        Rgb::splat(if lit { 8.0 - 0.1 * k as f32 } else { 0.01 })
    };
    let resolved = resolve_film(&levels(size, value, 3), Resolve::default());
    let pixels = resolved.picture.pixels.iter().enumerate();
    let dark: Vec<f32> = pixels
        .filter(|(i, _)| !bright(*i))
        .map(|(_, p)| p.x)
        .collect();
    let worst = dark.iter().fold(0.0f32, |most, p| most.max(*p));
    // A twentieth of the light beside it.
    assert!(worst < 0.1, "{worst}");
}

#[test]
fn gaussian_filter_keeps_constants_and_a_pixel_without_light_stays_black() {
    let blurred = |(w, h): (usize, usize), features: &[Features], light: &dyn Fn(usize) -> f32| {
        let light = |i: usize| [Vec3A::splat(light(i)); BATCHES];
        let light: Vec<_> = (0..w * h).map(light).collect();
        let inner = Inner {
            origin: (0, 0),
            size: (w, h),
            width: w,
        };
        let guide = Guide::new((w, h), Surface::Rough, features);
        let blurred = guide.blur::<1>(1.0, &inner, &[&light], BATCHES);
        let first = blurred[0].iter().map(|light| light[0].x);
        first.collect::<Vec<f32>>()
    };
    for (w, h) in [(1, 1), (2, 9), (7, 5)] {
        let ones = blurred((w, h), &vec![[0.0; FEATURES]; w * h], &|_| 1.0);
        assert!(ones.iter().all(|v| (v - 1.0).abs() < 1e-6));
    }
    let one = |i: usize| if i == 60 { 1.0 } else { 0.0 };
    let spread = |features: &dyn Fn(usize) -> [f32; 4]| {
        let whole = |i: usize| {
            let mut whole = [0.0; FEATURES];
            whole[..4].copy_from_slice(&features(i));
            whole
        };
        let features: Vec<Features> = (0..121).map(whole).collect();
        blurred((11, 11), &features, &one)
    };
    let flat = spread(&|_| [0.0, 0.0, 1.0, 5.0]);
    let (beside, far) = (flat[61] / flat[60], flat[62] / flat[60]);
    assert!((beside - (-0.5f32).exp()).abs() < 1e-4, "{beside}");
    assert!((far - (-2.0f32).exp()).abs() < 1e-4, "{far}");
    // A wall at an edge with the floor, and a surface far behind; a tilted plane has no edge.
    let left = |i: usize| i % 11 <= 5;
    let corner = spread(&|i| {
        if left(i) {
            [0.0, 0.0, 1.0, 5.0]
        } else {
            [0.0, 1.0, 0.0, 5.0]
        }
    });
    // The pixel on the edge, with a little more wall than floor, takes light of both, and more of the wall's. Gloss
    // that spreads the normals of a whole region as much is no edge.
    let mixed = [0.0, 0.45, 0.55, 5.0];
    let edge = |x: usize| match x {
        0..5 => [0.0, 0.0, 1.0, 5.0],
        5 => mixed,
        _ => [0.0, 1.0, 0.0, 5.0],
    };
    let from = |x: usize, of: &dyn Fn(usize) -> [f32; 4]| {
        let whole = |i: usize| {
            let mut whole = [0.0; FEATURES];
            whole[..4].copy_from_slice(&of(i % 11));
            whole
        };
        let features: Vec<Features> = (0..121).map(whole).collect();
        blurred((11, 11), &features, &|i| f32::from(u8::from(i % 11 == x)))[60]
    };
    let (wall, floor) = (from(4, &edge), from(6, &edge));
    let gloss = from(6, &|x| if x < 6 { mixed } else { [0.0, 1.0, 0.0, 5.0] });
    assert!(
        wall > 0.2 && (0.03..0.7 * wall).contains(&floor),
        "{wall} {floor}"
    );
    assert!(gloss < 0.01, "{gloss}");
    let behind = spread(&|i| [0.0, 0.0, 1.0, if left(i) { 5.0 } else { 9.0 }]);
    let tilted = spread(&|i| [0.0, 0.0, 1.0, 5.0 + 0.3 * (i % 11) as f32]);
    for (edge, expected) in [(corner, 0.0..0.01), (behind, 0.0..0.1), (tilted, 0.7..1.4)] {
        let ratio = edge[61] / edge[59];
        assert!(expected.contains(&ratio), "{ratio} {expected:?}");
    }
    let value = |k: usize, b, i: usize| {
        let light = if i.is_multiple_of(7) { 0.0 } else { 1.0 };
        Rgb::splat(light * (1.0 + 0.3 * noise(k, b, i)))
    };
    let resolved = resolve_film(&levels(16, value, 3), Resolve::Default);
    for (i, p) in resolved.picture.pixels.iter().enumerate() {
        assert_eq!(*p == Rgb::ZERO, i.is_multiple_of(7), "{i}");
    }
}

#[test]
fn tent_keeps_constants_and_shares_sum_to_one() {
    for (w, h) in [(1, 1), (2, 9), (7, 5)] {
        let mut ones = vec![Rgb::ONE; w * h];
        tent((w, h), 1, &mut ones);
        assert!(
            ones.iter()
                .all(|v| (*v - Rgb::ONE).abs().max_element() < 1e-6)
        );
    }
    let one = |i: usize| if i == 12 { Rgb::ONE } else { Rgb::ZERO };
    let mut spread: Vec<Rgb> = (0..25).map(one).collect();
    tent((5, 5), 1, &mut spread);
    assert!((spread[12].x - 1.0 / 9.0).abs() < 1e-6, "{}", spread[12]);
    assert!(spread.iter().all(|v| v.x > 0.0));
}

/// The batch that differs most confirms nothing, of either sign; of two equal ones, one does. By channel.
#[test]
fn one_batch_confirms_no_difference() {
    let batches = |x: [f32; 4], y: [f32; 4]| {
        let pairs: [Vec3A; 4] = std::array::from_fn(|b| Vec3A::new(x[b], y[b], 0.0));
        without_largest(&pairs)
    };
    let found = batches([1.0, 3.0, 1.0, 1.0], [-1.0, -1.0, -1.0, -3.0]);
    assert_eq!(found, Vec3A::new(1.0, 1.0, 0.0));
    let found = batches([2.0, 2.0, 0.0, 0.0], [4.0, 0.0, 4.0, 4.0]);
    assert_eq!(found, Vec3A::new(0.0, 16.0 / 3.0, 0.0));
    assert_eq!(without_largest(&[Vec3A::ONE; 2]), Vec3A::ZERO);
}

/// A difference is confirmed by an equally large one in one of the eight pixels around, at borders too.
#[test]
fn a_pixel_beside_confirms_a_difference() {
    let (w, h) = (4, 3);
    for (x, y) in (0..h).flat_map(|y| (0..w).map(move |x| (x, y))) {
        for (u, v) in (0..h).flat_map(|v| (0..w).map(move |u| (u, v))) {
            let mut squares = vec![Vec3A::splat(0.25); w * h];
            squares[v * w + u] = Vec3A::splat(0.5);
            squares[y * w + x] = Vec3A::ONE;
            let found = confirmed(w, &squares, |_| Vec3A::ZERO)[y * w + x];
            let beside = (u, v) != (x, y) && u.abs_diff(x) < 2 && v.abs_diff(y) < 2;
            assert_eq!(found.x, if beside { 0.5 } else { 0.25 }, "{x} {y} {u} {v}");
        }
    }
}

/// Each radius has its own loops.
#[test]
fn tent_is_the_mean_of_means_at_any_radius() {
    for (w, h) in [(1, 9), (9, 1), (2, 3), (3, 3), (4, 5), (5, 5), (13, 8)] {
        for radius in 1..5 {
            let mut values: Vec<f32> = (0..w * h).map(|i| noise(0, 0, i)).collect();
            let mut expected = values.clone();
            tent((w, h), radius, &mut values);
            let mean = |values: &[f32], step: usize, at: usize, end: usize, first: usize| {
                let near = at.saturating_sub(radius)..(at + radius + 1).min(end);
                let count = near.len() as f32;
                near.fold(0.0, |sum, i| sum + values[first + i * step]) / count
            };
            for _ in 0..2 {
                let across = |i: usize| mean(&expected, 1, i % w, w, i / w * w);
                let across: Vec<f32> = (0..w * h).map(across).collect();
                let along = |i: usize| mean(&across, w, i / w, h, i % w);
                expected = (0..w * h).map(along).collect();
            }
            assert_eq!(values, expected, "{w} {h} {radius}");
        }
    }
}

/// A row of pixels is blurred at once, with the same result as pixel by pixel.
#[test]
fn blur_of_a_pixel_does_not_depend_on_those_blurred_with_it() {
    let (w, h) = (11, 7);
    let random = |i: usize, k: usize| noise(k, 1, i).abs().min(1.0);
    let features: Vec<Features> = (0..w * h)
        .map(|i| std::array::from_fn(|k| 1.0 + 0.1 * random(i, k)))
        .collect();
    let light = |i: usize| std::array::from_fn(|b| Vec3A::splat(random(i, b)));
    let light: Vec<[Vec3A; BATCHES]> = (0..w * h).map(light).collect();
    for (surface, sigma) in [(Surface::First, 2.0), (Surface::Rough, 0.7)] {
        let guide = Guide::new((w, h), surface, &features);
        let part = |origin, size| Inner {
            origin,
            size,
            width: w,
        };
        let whole = guide.blur::<1>(sigma, &part((0, 0), (w, h)), &[&light, &light], BATCHES);
        for (i, (first, second)) in whole[0].iter().zip(&whole[1]).enumerate() {
            let one = guide.blur::<1>(sigma, &part((i % w, i / w), (1, 1)), &[&light], BATCHES);
            assert!(one[0][0] == *first && first == second, "{i}");
        }
    }
}

/// For any light, noise and features, the margins of a tile contain all data that its pixels depend on.
#[test]
fn resolve_in_tiles_has_the_bytes_of_the_whole() {
    let frame = crate::math::UVec2::new(61, 38);
    let window = Window {
        x: 3,
        y: 5,
        w: 53,
        h: 31,
    };
    let mut film = LevelFilm::new(frame, window, 4);
    let mut one = LevelFilm::new(frame, window, 1);
    for index in 0..window.len() {
        for sample in 0..2 * BATCHES as u32 {
            let mut stream = stream(index as u32 * 16 + sample);
            let mut next = || stream.next_1d();
            let shared = Rgb::new(next(), next(), next());
            let bright = |k: usize, u: f32| (0.5 - 0.1 * k as f32) / (u + 0.01 + 0.2 * k as f32);
            let levels: [Rgb; 4] = std::array::from_fn(|k| shared + bright(k, next()));
            let path = PathLevels {
                levels: &levels,
                shared,
                features: std::array::from_fn(
                    |i| if i == 3 || i == 7 { 3.0 } else { 0.5 } + 0.1 * next(),
                ),
            };
            film.push(index, sample, &path);
            // Even light: the widest blur is taken.
            let levels = &levels[3..];
            one.push(index, sample, &PathLevels { levels, ..path });
        }
    }
    for settings in ALL {
        let limits = Limits::of(settings, film.levels());
        let whole = resolve(&film, limits, 64);
        if settings == Resolve::None {
            assert!(whole.level.iter().all(|&k| k == 0));
            continue;
        }
        assert!((0..4).filter(|k| whole.level.contains(k)).count() > 1);
        for edge in [3, 7, 32] {
            assert_eq!(resolve(&film, limits, edge), whole, "{settings:?} {edge}");
        }
    }
    let limits = Limits::of(Resolve::Default, 1);
    let whole = resolve(&one, limits, 64);
    for edge in [7, 32] {
        assert_eq!(resolve(&one, limits, edge), whole, "one level, {edge}");
    }
}

/// On an even surface a pixel takes values from the cells around it by a Gaussian of five pixels, at borders too.
#[test]
fn values_of_cells_are_a_gaussian_mean_of_those_around() {
    let features = [0.0, 0.0, 1.0, 5.0, 0.0, 0.0, 1.0, 5.0, 0.5, 0.5, 0.5];
    let guide = |size: Size| Guide::new(size, Surface::Rough, &vec![features; size.0 * size.1]);
    let (pixels, cells, edge): (Size, Size, usize) = ((21, 13), (6, 4), 4);
    let mut stream = stream(1);
    let values: Vec<Vec3A> = (0..cells.0 * cells.1)
        .map(|_| Vec3A::new(stream.next_1d(), stream.next_1d(), 1.0))
        .collect();
    let (here, there) = (guide(pixels), guide(cells));
    for y in 0..pixels.1 {
        let found = here.of_cells(y, &there, y, edge, &values);
        assert_eq!(found.len(), pixels.0);
        for (x, found) in found.iter().enumerate() {
            let (mut sum, mut all) = (Vec3A::ZERO, 0.0);
            for v in (0..cells.1).filter(|v| v.abs_diff(y / edge) <= 2) {
                for u in (0..cells.0).filter(|u| u.abs_diff(x / edge) <= 2) {
                    let d = [(u, x), (v, y)].map(|(cell, at)| (4 * cell) as f32 + 1.5 - at as f32);
                    let weight = (-(d[0] * d[0] + d[1] * d[1]) / 50.0).exp();
                    sum += weight * values[v * cells.0 + u];
                    all += weight;
                }
            }
            let apart = (*found - sum / all).abs().max_element();
            assert!(apart < 1e-3, "{x} {y}: {found} for {}", sum / all);
        }
    }
}

/// A point of light on an even surface, blurred by 1.5 pixels and then in steps, is a Gaussian of 6 pixels.
#[test]
fn blur_of_a_blur_in_steps_is_a_wide_gaussian() {
    let (size, centre, sigma) = (61, 30, 6.0f32);
    let inner = Inner {
        origin: (0, 0),
        size: (size, size),
        width: size,
    };
    let features = vec![[0.0, 0.0, 1.0, 5.0, 0.0, 0.0, 1.0, 5.0, 0.5, 0.5, 0.5]; size * size];
    let guide = Guide::new((size, size), Surface::Rough, &features);
    let mut light = vec![[Vec3A::ZERO; BATCHES]; size * size];
    light[centre * size + centre] = [Vec3A::ONE; BATCHES];
    let base = guide.blur::<1>(BASE, &inner, &[&light], BATCHES).remove(0);
    let wide = guide
        .blur::<STEP>(rest(sigma), &inner, &[&base], BATCHES)
        .remove(0);
    let at = |x: usize, y: usize| wide[y * size + x][0].x;
    let (mut sum, mut square) = (0.0, 0.0);
    for y in 0..size {
        for x in 0..size {
            let d = x as f32 - centre as f32;
            sum += at(x, y);
            square += at(x, y) * d * d;
            let mirrored = at(size - 1 - x, size - 1 - y);
            assert!((at(x, y) - mirrored).abs() < 1e-6 * at(x, y).max(1e-9));
        }
    }
    // Filters end at 2.2 standard deviations, and leave out a tenth of the light and a fifth of its second moment.
    let deviation = (square / sum).sqrt();
    assert!((sum - 1.0).abs() < 0.01, "{sum}");
    assert!(
        (0.85 * sigma..0.9 * sigma).contains(&deviation),
        "{deviation}"
    );
    // The steps leave little trace: near the centre it falls as the Gaussian does.
    for d in 0..9 {
        let expected = (-0.5 * ((d * d) as f32) / (sigma * sigma)).exp();
        let ratio = at(centre + d, centre) / at(centre, centre);
        assert!(
            (ratio / expected - 1.0).abs() < 0.12,
            "{d}: {ratio} for {expected}"
        );
    }
}

/// Level 0 finds light in one of 500 batches of a pixel, level 1 a little less light everywhere. In most windows level
/// 0 has found nothing, and looks free of noise.
#[test]
fn light_that_a_level_has_not_met_is_not_dark() {
    let rare = |b: usize, i: usize| {
        let hit = stream((i * 8 + b) as u32 + 90_000).next_1d() < 0.002;
        if hit { 500.0 } else { 0.0 }
    };
    for settings in [SHARP, Resolve::Default] {
        let value = |k: usize, b, i| {
            Rgb::splat(match k {
                0 => rare(b, i),
                _ => 0.95 + 0.3 * noise(k, b, i),
            })
        };
        let resolved = resolve_film(&levels(64, value, 2), settings);
        let dark = resolved.picture.pixels.iter().filter(|p| p.x < 0.3).count();
        assert!(dark < 4096 / 50, "{settings:?}: {dark} dark pixels");
        // No light is added as a shape around a hit: the median of every tile of 16 pixels is near the truth.
        for tile in 0..16 {
            let (x, y) = (tile % 4 * 16, tile / 4 * 16);
            let pixels = (0..256).map(|i| (y + i / 16) * 64 + x + i % 16);
            let mut all: Vec<f32> = pixels.map(|i| resolved.picture.pixels[i].x).collect();
            all.sort_by(f32::total_cmp);
            assert!((0.5..1.9).contains(&all[128]), "{tile}: {}", all[128]);
        }
    }
}

/// Hits of three batches that coincide in one pixel are not light that rougher levels lose. Light in every batch of a
/// pixel is, although no pixel beside it has any.
#[test]
fn coincidences_are_not_taken_for_light() {
    let (size, centre) = (32, 16 * 32 + 16);
    let value = |meets: [f32; BATCHES]| {
        move |k: usize, b: usize, i: usize| {
            let rare = stream((i * 8 + b) as u32 + 90_000).next_1d() < 0.1;
            let sharp = if i == centre {
                meets[b]
            } else if rare {
                10.0
            } else {
                0.0
            };
            Rgb::splat(if k == 0 {
                sharp
            } else {
                1.0 + 0.1 * noise(k, b, i)
            })
        }
    };
    let picture = |meets| resolve_film(&levels(size, value(meets), 2), SHARP).picture;
    let chance = picture([30.0, 0.0, 10.0, 0.0]);
    let around =
        (-2i32..=2).flat_map(|y| (-2i32..=2).map(move |x| (centre as i32 + 32 * y + x) as usize));
    for i in around {
        assert!(
            (0.6..1.5).contains(&chance.pixels[i].x),
            "{}",
            chance.pixels[i].x
        );
    }
    let light = picture([30.0, 31.0, 29.0, 30.0]).pixels[centre].x;
    assert!(light > 15.0, "{light}");
}

/// A shadow that is dark at level 0 and lit at a rough level: where hits are as small as the light beside, darkness at
/// level 0 is evidence.
#[test]
fn darkness_is_believed_where_hits_are_expected() {
    let shadow = |i: usize| i % 32 < 16;
    let value = |k: usize, b, i| {
        let light = match (k, shadow(i)) {
            (0, true) => 0.01,
            (_, true) => 0.1,
            (_, false) => 1.0,
        };
        Rgb::splat(light * (1.0 + 0.2 * noise(k, b, i)))
    };
    let resolved = resolve_film(&levels(32, value, 2), SHARP);
    let pixels = resolved.picture.pixels.iter().enumerate();
    // The edge itself is smoothed.
    let inner = pixels.filter(|(i, _)| (2..14).contains(&(i % 32)));
    let worst = inner.fold(0.0f32, |worst, (_, p)| worst.max(p.x));
    assert!(worst < 0.03, "{worst}");
}

/// A pixel that no level has lit, in a wall whose light comes in rare hits, gets the light around it.
#[test]
fn black_pixels_of_a_lit_wall_are_filled() {
    let value = |k: usize, b: usize, i: usize| {
        let hit = stream((i * 8 + b) as u32 + 70_000).next_1d() < 0.05;
        Rgb::splat(if hit && i != 24 * 49 {
            20.0 - 0.1 * k as f32
        } else {
            0.0
        })
    };
    let film = levels(48, value, 3);
    let black = |p: &&Rgb| **p == Rgb::ZERO;
    let plain = film.mean(0).pixels.iter().filter(black).count();
    let resolved = resolve_film(&film, Resolve::default());
    let left = resolved.picture.pixels.iter().filter(black).count();
    assert!(plain > 1500 && left < plain / 4, "{plain} {left}");
}

/// Light that comes in hits of known size, and the hits that a window expects of it.
#[test]
fn size_of_hits_and_expected_hits_are_known_ones() {
    let value = |k: usize, b: usize, i: usize| {
        let (chance, size) = [(0.01, 100.0), (0.25, 4.0)][k];
        let hit = stream((i * 8 + b) as u32 + 50_000 * k as u32).next_1d() < chance;
        Rgb::splat(if hit { size } else { 0.0 })
    };
    let coarse = Coarse::roughened(&levels(64, value, 2));
    let light = |level: usize| [Vec3A::splat([0.25, 1.0][level]); 2];
    let missing: Vec<Missing> = coarse.missing((31, 30), light).collect();
    // D M / B = 0.75 · 100 / 4, e = 12 · 4 · 1 / 100.
    assert!(
        (missing[0].variance.x - 18.75).abs() < 1e-3,
        "{}",
        missing[0].variance
    );
    assert!(
        (missing[0].expected - 0.48).abs() < 1e-4,
        "{}",
        missing[0].expected
    );
    assert_eq!(missing[1].variance, Vec3A::ZERO);
    assert!(
        (missing[1].expected - 12.0).abs() < 1e-3,
        "{}",
        missing[1].expected
    );
    let [sharp, blurred] = [1.0, 1.5].map(|times| missing[0].noise(times).x);
    assert!((sharp - 18.75 * (-0.48f32).exp()).abs() < 1e-3, "{sharp}");
    assert!(
        (blurred - 18.75 * (-0.72f32).exp()).abs() < 1e-3,
        "{blurred}"
    );
}

#[test]
fn black_picture_states_an_error_of_1() {
    let film = levels(8, |_, _, _| Rgb::ZERO, 2);
    assert_eq!(
        resolve_film(&film, Resolve::default()).statement().root,
        1.0
    );
}

#[test]
fn film_without_a_noise_estimate_shows_level_0() {
    fn path(levels: &[Rgb]) -> PathLevels<'_> {
        PathLevels {
            levels,
            shared: Rgb::ZERO,
            features: [0.0; FEATURES],
        }
    }
    let size = crate::math::UVec2::new(2, 1);
    let mut film = LevelFilm::new(size, crate::image::film::Window::full(size), 2);
    for sample in 0..2 {
        let resolved = resolve_film(&film, SHARP);
        assert_eq!(resolved.picture, film.mean(0));
        assert_eq!(resolved.statement().root, f64::INFINITY);
        let names: Vec<_> = (resolved.channels().into_iter()).map(|c| c.layer).collect();
        assert_eq!(names, ["level"], "an error of which nothing is known");
        for index in 0..2 {
            film.push(index, sample, &path(&[Rgb::ONE, Rgb::splat(0.5)]));
        }
    }
    for sample in 2..5 {
        assert!(resolve_film(&film, SHARP).statement().root < 1e-6);
        assert_eq!(resolve_film(&film, SHARP).channels().len(), 3);
        for index in 0..2 {
            film.push(index, sample, &path(&[Rgb::ONE, Rgb::splat(0.5)]));
        }
    }
    film.push(0, 4, &path(&[Rgb::ONE, Rgb::splat(f32::NAN)]));
    assert_eq!(film.mean(1).pixels[0], Rgb::splat(0.5));
}

/// Two samples are two batches, for means, variances and medians.
#[test]
fn few_batches_are_as_many_as_they_are() {
    let x = [1.0, 5.0, 3.0, 9.0].map(Vec3A::splat);
    assert_eq!(variance_of_mean(&x[..2]).x, 4.0);
    assert!((variance_of_mean(&x[..3]).x - 4.0 / 3.0).abs() < 1e-6);
    assert_eq!([2, 3, 4].map(|n| median(&x[..n]).x), [3.0, 3.0, 4.0]);
}

/// Even light under noise, of one level: from two samples on a choice is less noisy than the mean of the samples, keeps
/// the light and an edge, and states its error.
#[test]
fn two_samples_are_resolved() {
    let size = 64usize;
    let frame = crate::math::UVec2::splat(size as u32);
    let truth = |i: usize| if i % size < size / 2 { 1.0 } else { 0.25 };
    for samples in [2u32, 3, 4] {
        let mut film = LevelFilm::new(frame, Window::full(frame), 1);
        for i in 0..size * size {
            let mut features = [0.0; FEATURES];
            // A wall behind a floor.
            let axis = if truth(i) == 1.0 { 2 } else { 0 };
            (features[axis], features[3]) = (1.0, 4.0);
            (features[4 + axis], features[7]) = (1.0, 4.0);
            for sample in 0..samples {
                let light = truth(i) * (1.0 + 0.4 * noise(0, sample as usize, i));
                let path = PathLevels {
                    levels: &[Rgb::splat(light.max(0.0))],
                    shared: Rgb::ZERO,
                    features,
                };
                film.push(i, sample, &path);
            }
        }
        let resolved = resolve_film(&film, Resolve::default());
        let squared = |picture: &Buffer| -> f64 {
            let pixels = picture.pixels.iter().enumerate();
            (pixels.map(|(i, p)| f64::from(p.x - truth(i)).powi(2))).sum::<f64>()
        };
        let ratio = squared(&resolved.picture) / squared(&film.mean(0));
        assert!(ratio < 0.15, "{samples} samples: {ratio}");
        let light = |picture: &Buffer| picture.pixels.iter().map(|p| f64::from(p.x)).sum::<f64>();
        let energy = light(&resolved.picture) / light(&film.mean(0));
        assert!((energy - 1.0).abs() < 0.01, "{samples} samples: {energy}");
        let column = |x: usize| -> f32 {
            (0..size)
                .map(|y| resolved.picture.pixels[y * size + x].x)
                .sum::<f32>()
                / size as f32
        };
        assert!(column(31) > 0.9 && column(32) < 0.35, "{samples} samples");
        let light = (0..size * size).map(|i| f64::from(3.0 * truth(i)));
        let picture = resolved.picture.pixels.iter();
        let light_of = picture.map(|p| f64::from(p.element_sum()));
        let errors = light_of.zip(light.clone()).map(|(i, f)| (i - f).abs());
        let measured = mean_of(relative_errors(light, errors));
        let stated = resolved.statement().mean / measured;
        assert!((0.67..2.0).contains(&stated), "{samples} samples: {stated}");
    }
}

/// A square film of two levels without roughened light.
fn shared_film(size: usize, of: impl Fn(usize, usize) -> f32) -> LevelFilm {
    shared_samples(size, BATCHES, of)
}

/// [`shared_film`] with `samples` samples.
fn shared_samples(size: usize, samples: usize, of: impl Fn(usize, usize) -> f32) -> LevelFilm {
    let frame = crate::math::UVec2::splat(size as u32);
    let mut film = LevelFilm::new(frame, Window::full(frame), 2);
    for i in 0..size * size {
        for b in 0..samples {
            let light = Rgb::splat(of(b, i));
            let path = PathLevels {
                levels: &[light; 2],
                shared: light,
                features: [1.0; FEATURES],
            };
            film.push(i, b as u32, &path);
        }
    }
    film
}

/// Noise of the light that all levels share falls on an even surface to the remainder of the widest blur: 0.022 of its
/// square, and 0.029 without that blur.
#[test]
fn shared_light_is_blurred() {
    let film = shared_film(48, |b, i| 1.0 + 0.3 * noise(0, b, i));
    let square = |settings| {
        let picture = resolve_film(&film, settings).picture;
        let pixels = picture.pixels.iter().map(|p| (p.x - 1.0).powi(2));
        pixels.sum::<f32>() / 2304.0
    };
    let [none, sharp, blurred] = [Resolve::None, SHARP, Resolve::Default].map(square);
    assert!((none / 0.0225 - 1.0).abs() < 0.2, "{none}");
    assert!((sharp / none - 1.0).abs() < 0.01, "{sharp} {none}");
    assert!(blurred < 0.025 * none, "{blurred} {none}");
}

/// A firefly in even light is not spread to a blob; light that comes as hits everywhere keeps its energy.
#[test]
fn fireflies_are_not_blurred_and_rare_light_is() {
    let even = shared_film(48, |b, i| {
        1.0 + 0.3 * noise(0, b, i) + if (b, i) == (2, 24 * 49) { 4000.0 } else { 0.0 }
    });
    let resolved = resolve_film(&even, Resolve::Default);
    let most = resolved
        .picture
        .pixels
        .iter()
        .fold(0.0f32, |most, p| most.max(p.x));
    assert!(most < 10.0, "{most}");
    let rare = shared_film(64, |b, i| {
        let hit = stream((i * 8 + b) as u32 + 30_000).next_1d() < 0.03;
        if hit { 40.0 } else { 0.0 }
    });
    let mean = |b: &Buffer| b.pixels.iter().map(|p| p.x).sum::<f32>() / 4096.0;
    let resolved = mean(&resolve_film(&rare, Resolve::Default).picture);
    let plain = mean(&rare.mean(0));
    assert!((resolved / plain - 1.0).abs() < 0.1, "{resolved} {plain}");
}

/// Without any smoothing the picture is that of level 0, and states the noise of its film.
#[test]
fn no_smoothing_leaves_the_means_of_level_0() {
    let value = |k: usize, b, i| Rgb::splat(1.0 + [0.4, 0.1][k] * noise(k, b, i));
    let film = film(32, value, 2, |_, _| Rgb::splat(0.5));
    let resolved = resolve_film(&film, Resolve::None);
    assert_eq!(resolved.picture, film.mean(0));
    assert!(resolved.level.iter().all(|&k| k == 0));
    let truth = 0.2 / (1.0 + 0.01 / 0.09f64).sqrt();
    let stated = resolved.statement().root;
    assert!((stated / truth - 1.0).abs() < 0.15, "{stated} {truth}");
}

/// White noise of each level on a ramp, and the ramp.
fn ramp(spread: [f32; 3], bright: [f32; 3]) -> (LevelFilm, Buffer) {
    let size = 48;
    let truth = move |i: usize| 0.5 + (i % size) as f32 / 48.0;
    let value = move |k: usize, b, i| Rgb::splat(truth(i) * bright[k] + spread[k] * noise(k, b, i));
    let truth = Buffer::from_fn(size, size, |x, _| Rgb::splat(truth(x)));
    (levels(size, value, 3), truth)
}

fn mean(picture: &Buffer) -> f32 {
    let pixels = picture.pixels.iter();
    pixels.map(|p| p.x).sum::<f32>() / picture.pixels.len() as f32
}

/// Mean squared error.
fn squared_error(picture: &Buffer, truth: &Buffer) -> f32 {
    let pairs = picture.pixels.iter().zip(&truth.pixels);
    mean(&Buffer {
        pixels: pairs.map(|(p, t)| (*p - *t) * (*p - *t)).collect(),
        ..*picture
    })
}

/// A choice blended with a stand-in for a denoiser.
fn mixed(film: &LevelFilm, filter: impl Fn(&Buffer) -> Buffer) -> Resolved {
    let filter = |picture: &Buffer| Ok::<_, ()>(filter(picture));
    let how = Resolve::Default;
    denoise_film(Cow::Borrowed(film), how, resolve_film(film, how), filter).expect("no failure")
}

/// A half has the means of its batches, in its own batches, and the features of all.
#[test]
fn half_of_a_film_is_a_film_of_two_batches() {
    let (mut film, _) = ramp([0.4, 0.3, 0.3], [1.0, 1.1, 1.2]);
    let whole = film.clone();
    assert!(film.take() == whole && film.levels() == whole.levels());
    assert!(film.window().is_empty());
    let film = whole;
    for (second, first) in [(false, 0), (true, 2)] {
        let half = film.half(second);
        assert_eq!(half.batches(), 2);
        for level in 0..=film.levels() {
            let (all, own) = (film.batch_means(level), half.batch_means(level));
            assert_eq!(own[..2], all[first..first + 2]);
        }
        let pairs = half.features().into_iter().zip(film.features());
        let apart =
            pairs.map(|(a, b)| (0..FEATURES).map(move |k| (a[k] - b[k]).abs()).sum::<f32>());
        assert!(apart.fold(0.0, f32::max) < 1e-4);
    }
}

/// The share of a filter of known error minimises the squared error of the mix, for the noise of all batches.
#[test]
fn share_of_a_filter_is_that_of_the_least_error() {
    const SIZE: usize = 96;
    let film = levels(SIZE, |_, b, i| Rgb::splat(1.0 + 0.4 * noise(0, b, i)), 1);
    let raw = resolve_film(&film, Resolve::None);
    let truth = Buffer::filled(SIZE, SIZE, Rgb::ONE);
    let variance = squared_error(&raw.picture, &truth);
    for ratio in [1.0, 2.5] {
        // A filter whose squared error is this multiple of that of the means.
        let off = truth.map(|p| p + Rgb::splat((ratio * variance).sqrt()));
        let mixed = denoise_film(Cow::Borrowed(&film), Resolve::None, raw.clone(), |_| {
            Ok::<_, ()>(off.clone())
        });
        let mixed = mixed.expect("no failure").picture;
        let pixels = raw.picture.pixels.iter().zip(&mixed.pixels);
        let (mut along, mut square) = (0.0, 0.0);
        for ((raw, mixed), off) in pixels.zip(&off.pixels) {
            along += (mixed.x - raw.x) * (off.x - raw.x);
            square += (off.x - raw.x).powi(2);
        }
        let expected = (1.0 / (1.0 + ratio) - 0.1) * 7.0 / 6.0;
        let found = along / square;
        assert!(
            (found - expected).abs() < 0.05,
            "{ratio}: {found} {expected}"
        );
    }
}

/// A filter that returns the truth helps where there is noise; a wrong one, or one that removes light, hardly counts.
#[test]
fn a_filter_is_believed_as_far_as_it_is_right() {
    let off = |x: usize, y: usize| {
        Rgb::splat(if (x / 6 + y / 6).is_multiple_of(2) {
            0.3
        } else {
            1.8
        })
    };
    let wrong = Buffer::from_fn(48, 48, off);
    for spread in [0.4, 0.02] {
        let (film, truth) = ramp([spread; 3], [1.0; 3]);
        let resolved = resolve_film(&film, Resolve::Default);
        let filters = [truth.clone(), truth.map(|p| 0.4 * p), wrong.clone()];
        for (filter, most) in filters.iter().zip([0.3, 1.05, 1.05]) {
            let mixed = mixed(&film, |_| filter.clone());
            let errors = [&mixed, &resolved].map(|r| squared_error(&r.picture, &truth));
            assert!(errors[0] < most * errors[1], "{spread} {most}: {errors:?}");
            // The stated error follows.
            let stated = [&mixed, &resolved].map(|r| r.statement());
            assert!(
                most > 1.0 || stated[0].mean < 0.6 * stated[1].mean,
                "{stated:?}"
            );
            assert!(most > 1.0 || stated[0].root < stated[1].root, "{stated:?}");
        }
    }
}

/// A filter spreads a lamp: the lamp stays as it is, and the pixels around get none of its light.
#[test]
fn a_lamp_that_a_filter_spreads_stays_as_it_is() {
    const SIZE: usize = 64;
    let lamp = |i: usize| i % SIZE == 32 && (30..34).contains(&(i / SIZE));
    let truth = |i: usize| if lamp(i) { 100.0 } else { 0.5 };
    let value = |_, b, i| {
        let spread = if lamp(i) { 0.0 } else { 0.1 };
        Rgb::splat(truth(i) + spread * noise(0, b, i))
    };
    let film = levels(SIZE, value, 1);
    let resolved = resolve_film(&film, Resolve::Default);
    let spread = Buffer::from_fn(SIZE, SIZE, |x, y| {
        let near = x.abs_diff(32).max(y.abs_diff(32)) < 6;
        Rgb::splat(if near { 5.0 } else { 0.5 })
    });
    let mixed = mixed(&film, |_| spread.clone());
    for (i, pixel) in mixed.picture.pixels.iter().enumerate() {
        let off = (pixel.x / truth(i) - 1.0).abs();
        let before = (resolved.picture.pixels[i].x / truth(i) - 1.0).abs();
        assert!(off < before + 0.02, "{i}: {pixel}, before {before}");
    }
}

#[test]
fn failures_of_a_filter_are_handed_on_and_few_samples_are_filtered_as_they_are() {
    let how = Resolve::Default;
    let (film, _) = ramp([0.1; 3], [1.0; 3]);
    let resolved = resolve_film(&film, how);
    assert_eq!(
        denoise_film(Cow::Borrowed(&film), how, resolved, |_| Err("no")),
        Err("no")
    );
    let frame = crate::math::UVec2::splat(2);
    let empty = LevelFilm::new(frame, Window::full(frame), 3);
    let resolved = mixed(&empty, |picture| picture.map(|p| p + Rgb::ONE));
    assert!(resolved.picture.pixels.iter().all(|p| *p == Rgb::ONE));
    let two = shared_samples(16, 2, |b, i| 1.0 + 0.1 * noise(0, b, i));
    assert!(resolve_film(&two, how).is_known());
    let resolved = mixed(&two, |picture| picture.clone());
    assert_eq!(resolved.picture, two.mean(0));
    assert!(!resolved.is_known() && resolved.error().iter().all(|e| e.is_infinite()));
}

/// One sample: noise falls, edges of light and of surfaces stay where the halves agree; the sharp choice has no halves.
#[test]
fn one_sample_is_resolved_as_two_halves() {
    const SIZE: usize = 64;
    let frame = crate::math::UVec2::splat(SIZE as u32);
    let right = |i: usize| i % SIZE >= SIZE / 2;
    let truth = |i: usize| if right(i) { 2.0 } else { 0.5 };
    let film = |same_surface: bool, noisy: f32| {
        let mut film = LevelFilm::new(frame, Window::full(frame), 1);
        for i in 0..SIZE * SIZE {
            let mut features = [0.0; FEATURES];
            let normal = if right(i) && !same_surface { 0 } else { 1 };
            for first in [0, 4] {
                features[first + normal] = 1.0;
                features[first + 3] = 3.0;
            }
            let path = PathLevels {
                levels: &[Rgb::splat(truth(i) * (1.0 + noisy * noise(0, 0, i)))],
                shared: Rgb::ZERO,
                features,
            };
            film.push(i, 0, &path);
        }
        film
    };
    let error = |picture: &Buffer, wanted: &dyn Fn(usize) -> bool| {
        let pixels = picture
            .pixels
            .iter()
            .enumerate()
            .filter(|(i, _)| wanted(*i));
        let errors: Vec<f32> = pixels.map(|(i, p)| (p.x / truth(i) - 1.0).abs()).collect();
        errors.iter().sum::<f32>() / errors.len() as f32
    };
    let at_edge = |i: usize| (SIZE / 2 - 1..=SIZE / 2).contains(&(i % SIZE));
    for same_surface in [false, true] {
        let film = film(same_surface, 0.3);
        let raw = resolve_film(&film, SHARP);
        assert_eq!(raw.picture, film.mean(0));
        assert!(!raw.is_known());
        let resolved = resolve_film(&film, Resolve::Default);
        assert!(!resolved.is_known() && resolved.error().iter().all(|e| e.is_infinite()));
        let [before, after] = [&raw, &resolved].map(|r| error(&r.picture, &|i| !at_edge(i)));
        assert!(after < 0.3 * before, "{same_surface}: {before} {after}");
        let edge = error(&resolved.picture, &at_edge);
        // A pixel takes an eighth of its light from across an edge of light; a wide blur would take nearly half.
        let most = if same_surface { 0.6 } else { 0.12 };
        assert!(edge < most, "{same_surface}: {edge}");
    }
    // A picture without noise stays as it is on both sides of an edge of surfaces.
    let film = film(false, 0.0);
    let resolved = resolve_film(&film, Resolve::Default);
    assert!(error(&resolved.picture, &|_| true) < 1e-3);
}

/// Rows of guides that are computed at once leave no seam.
#[test]
fn halves_in_bands_are_those_of_the_whole() {
    let frame = crate::math::UVec2::new(9, 2 * super::ROWS + 7);
    let window = Window {
        x: 1,
        y: 3,
        w: 8,
        h: 2 * super::ROWS + 2,
    };
    let mut film = LevelFilm::new(frame, window, 2);
    for i in 0..window.len() {
        let of = |k: usize| noise(k, 0, i);
        let path = PathLevels {
            levels: &[Rgb::splat(of(1)), Rgb::splat(of(2))],
            shared: Rgb::splat(of(3)),
            features: std::array::from_fn(|k| 1.0 + 0.1 * of(k)),
        };
        film.push(i, 0, &path);
    }
    let size = (8, window.h as usize);
    let [first, rough] =
        [Surface::First, Surface::Rough].map(|of| Guide::new(size, of, &film.features()));
    let weights = (0..window.len()).map(|i| {
        let (first, rough) = (first.beside(i), rough.beside(i));
        std::array::from_fn(|k| first[k] * rough[k])
    });
    let weights: Vec<[f32; 4]> = weights.collect();
    assert!(weights.iter().flatten().any(|w| *w > 0.01));
    assert_eq!(super::halves(&film), film.halves(&weights));
}

/// Light of few bright hits in a film of one level is cut as fireflies, and most of it is restored as energy.
#[test]
fn light_of_rare_hits_comes_back_to_one_level() {
    const SIZE: usize = 64;
    let hit = |b: usize, i: usize| {
        let mut stream = stream((b * SIZE * SIZE + i) as u32 + 77);
        f32::from(u8::from(stream.next_1d() < 1.0 / 150.0))
    };
    let light = |_, b, i| Rgb::splat(0.2 + 0.05 * noise(0, b, i) + 120.0 * hit(b, i));
    let film = levels(SIZE, light, 1);
    let (raw, shown) = (
        mean(&film.mean(0)),
        mean(&resolve_film(&film, Resolve::Default).picture),
    );
    assert!(raw > 0.7, "{raw}");
    assert!((0.85..1.1).contains(&(shown / raw)), "{shown} of {raw}");
}

/// Three hits, two of them in one batch, do not brighten the region around them.
#[test]
fn few_hits_do_not_brighten_what_is_around() {
    const SIZE: usize = 64;
    let at = |x: usize, y: usize| y * SIZE + x;
    let hits = [(1, at(30, 31)), (1, at(34, 33)), (2, at(31, 36))];
    let even = |b, i| Rgb::splat(1.0 + 0.05 * noise(0, b, i));
    let bright = |b, i| Rgb::splat(if hits.contains(&(b, i)) { 240.0 } else { 0.0 });
    let [plain, shown] = [0.0, 1.0].map(|share| {
        let film = levels(SIZE, |_, b, i| even(b, i) + bright(b, i) * share, 1);
        resolve_film(&film, Resolve::Default).picture
    });
    let ring = (24..40).flat_map(|x| [at(x, 24), at(x, 40)]);
    let painted = ring.map(|i| shown.pixels[i].x - plain.pixels[i].x);
    let most = painted.fold(0.0, f32::max);
    assert!(most < 0.09, "{most}");
}

/// Far from any light the cap is a number and 0: a cap of NaN would spread in blurs.
#[test]
fn caps_are_finite_in_the_dark() {
    const SIZE: usize = 64;
    let left = |_, i| if i % SIZE < SIZE / 4 { 1.0 } else { 0.0 };
    let film = shared_film(SIZE, left);
    let caps = Caps::of(&film, |pixel, batch| {
        film.batch_mean(pixel, batch, 1).into()
    });
    for x in 0..SIZE {
        let cap = caps.at((x, SIZE / 2));
        assert!(cap.is_finite(), "{cap} at {x}");
        assert!(x < SIZE - 16 || cap == Vec3A::ZERO, "{cap} at {x}");
        assert!(x >= SIZE / 4 || cap.min_element() >= 1.0, "{cap} at {x}");
    }
}

/// Mean of the eight pixels around the middle of a square picture.
fn around_the_middle(picture: &Buffer) -> f32 {
    let (size, middle) = (picture.width, picture.width / 2);
    let rows = middle - 1..=middle + 1;
    let near = rows.flat_map(|y| (middle - 1..=middle + 1).map(move |x| (x, y)));
    let near = near.filter(|place| *place != (middle, middle));
    near.map(|(x, y)| picture.pixels[y * size + x].x)
        .sum::<f32>()
        / 8.0
}

/// With one level a lamp's glint stays in its pixel, and one bright sample in even light makes no disc.
#[test]
fn one_level_makes_no_discs_of_glints_and_fireflies() {
    const SIZE: usize = 48;
    let middle = SIZE / 2 * SIZE + SIZE / 2;
    let even = |b, i| Rgb::splat(1.0 + 0.3 * noise(0, b, i));
    let plain = resolve_film(&levels(SIZE, |_, b, i| even(b, i), 1), Resolve::Default).picture;
    // It is blurred: a third of the noise remains.
    let noise_of = |picture: &Buffer| {
        let squares = picture.pixels.iter().map(|p| (p.x - 1.0).powi(2));
        (squares.sum::<f32>() / picture.pixels.len() as f32).sqrt()
    };
    assert!(noise_of(&plain) < 0.07, "{}", noise_of(&plain));
    // In one of the batches only, as by chance: 80 in the mean.
    let bright = |b, i| Rgb::splat(if i == middle && b == 1 { 320.0 } else { 0.0 });
    let with_bright = |_, b, i| even(b, i) + bright(b, i);
    let glint = film(SIZE, with_bright, 1, bright);
    let shown = resolve_film(&glint, Resolve::Default).picture;
    let (near, at) = (around_the_middle(&shown), shown.pixels[middle].x);
    assert!((near - around_the_middle(&plain)).abs() < 0.02, "{near}");
    assert!((at - 81.0).abs() < 2.0, "{at}");
    let shown = resolve_film(&levels(SIZE, with_bright, 1), Resolve::Default).picture;
    let near = around_the_middle(&shown);
    assert!(near < 1.6, "{near}");
}

/// Reflections of a sky come in samples as bright as the picture, glints of a lamp in brighter ones. With one level the
/// former are blurred, and the latter stay single pixels.
#[test]
fn one_level_blurs_reflections_without_their_glints() {
    const SIZE: usize = 48;
    let hit =
        |b: usize, i: usize, seed: usize, p: f32| stream((seed + i * 8 + b) as u32).next_1d() < p;
    let sky = |b, i| Rgb::splat(if hit(b, i, 0, 0.2) { 1.0 } else { 0.0 });
    let glint = |b, i| if hit(b, i, 40_000, 0.004) { 400.0 } else { 0.0 };
    let show = |seen: &dyn Fn(usize, usize) -> Rgb| {
        let film = film(SIZE, |_, b, i| Rgb::splat(0.5) + seen(b, i), 1, seen);
        (resolve_film(&film, Resolve::Default).picture, film.mean(0))
    };
    let (shown, raw) = show(&sky);
    let error = |picture: &Buffer| {
        let squares = picture.pixels.iter().map(|p| (p.x - 0.7).powi(2));
        (squares.sum::<f32>() / picture.pixels.len() as f32).sqrt()
    };
    assert!(
        error(&shown) < 0.5 * error(&raw),
        "{} {}",
        error(&shown),
        error(&raw)
    );
    let sum = |picture: &Buffer| picture.pixels.iter().map(|p| p.x).sum::<f32>();
    assert!((sum(&shown) / sum(&raw) - 1.0).abs() < 0.01);

    let (shown, raw) = show(&|b, i| sky(b, i) + Rgb::splat(glint(b, i)));
    for (shown, raw) in shown.pixels.iter().zip(&raw.pixels) {
        // The sky is between 0 and 1, so its blur changes a pixel by less.
        assert!(
            (shown.x - raw.x).abs() < 1.0 + 0.01 * raw.x,
            "{shown} {raw}"
        );
    }
}

/// A square film of one level with two surfaces side by side: even light, and rare bright hits on the left one.
fn two_surfaces(size: usize, hits: f32) -> LevelFilm {
    let frame = crate::math::UVec2::splat(size as u32);
    let mut film = LevelFilm::new(frame, Window::full(frame), 1);
    for i in 0..size * size {
        let is_left = i % size < size / 2;
        let mut features = [0.0; FEATURES];
        features[if is_left { 0 } else { 1 }] = 1.0;
        features[3] = 1.0;
        for b in 0..BATCHES {
            let is_hit = stream((i * 8 + b) as u32 + 110_000).next_1d() < hits;
            let hit = if is_left && is_hit { 100.0 } else { 0.0 };
            let path = PathLevels {
                levels: &[Rgb::splat(1.0 + 0.1 * noise(0, b, i) + hit)],
                shared: Rgb::ZERO,
                features,
            };
            film.push(i, b as u32, &path);
        }
    }
    film
}

/// Light of fireflies that was cut is restored on their surface, and not beside it.
#[test]
fn cut_light_is_given_back_on_its_surface() {
    const SIZE: usize = 64;
    let film = two_surfaces(SIZE, 0.01);
    let shown = resolve_film(&film, Resolve::Default).picture;
    let mean = |columns: std::ops::Range<usize>| {
        let rows = (0..SIZE).flat_map(|y| columns.clone().map(move |x| y * SIZE + x));
        let (sum, count) = rows.fold((0.0, 0.0), |(s, n), i| (s + shown.pixels[i].x, n + 1.0));
        sum / count
    };
    // Half of the light on the left is that of hits.
    let [left, beside] = [mean(4..28), mean(34..42)];
    assert!(left > 1.5, "{left}");
    assert!(beside < 1.05, "{beside}");
}

/// Hardly any pixel of an even floor shows its own noise, which is 0.15 here, and a fifth of that where it is blurred.
/// If every difference counted in full, one in twenty would.
#[test]
fn an_even_floor_has_no_pepper() {
    for (samples, most) in [(2, 0.005), (3, 0.0065), (BATCHES, 0.013)] {
        let mut grains = 0;
        // So that the mean of all samples has the same noise.
        let spread = 0.3 * (samples as f32 / BATCHES as f32).sqrt();
        for seed in 1..9 {
            let film = shared_samples(64, samples, |b, i| 1.0 + spread * noise(seed, b, i));
            let picture = resolve_film(&film, Resolve::Default).picture;
            let lone = |p: &Rgb| (p.x - 1.0).abs() > 0.12;
            grains += picture.pixels.iter().filter(|p| lone(p)).count();
        }
        let share = grains as f64 / (8.0 * 64.0 * 64.0);
        assert!(share < most, "{samples} samples: {share}");
    }
}

/// Plain paths find the sky and no sun, and look free of noise. A bias that grows with roughening is no missed light.
#[test]
fn light_that_the_sharpest_level_lacks_comes_back_and_a_bias_does_not() {
    let energy = |suns: [f32; 4]| {
        let light = |k: usize, b: usize, i: usize| {
            let noise = stream((i * 4 + b) as u32).next_1d();
            Rgb::splat(0.5 + suns[k] * (0.5 + noise))
        };
        let resolved = resolve_film(&levels(40, light, 4), Resolve::Default).picture;
        let sum: f32 = resolved.pixels.iter().map(|p| p.x).sum();
        sum / resolved.pixels.len() as f32
    };
    for (suns, expected) in [
        ([0.0, 0.5, 0.5, 0.5], 1.0),
        ([0.0, 0.45, 0.48, 0.5], 0.95),
        ([0.0, 0.02, 0.1, 0.5], 0.5),
        ([0.0, 0.0, 0.0, 0.5], 0.5),
    ] {
        let found = energy(suns);
        assert!((found - expected).abs() < 0.05, "{suns:?}: {found}");
    }
}

/// A choice that a few pixels have by chance is replaced by that of most around. A line and a region keep theirs.
#[test]
fn lone_choices_give_way_and_features_stay() {
    const SIDE: usize = 30;
    let strip = |i: usize| i % SIDE == 25;
    let blurs = |count: usize, levels: usize| -> Vec<Candidate> {
        let of = |k: usize| Candidate {
            level: (k % levels) as u8,
            light: Batches::new(),
            sharper: Vec::new(),
            missing: None,
            blur: k / levels,
            wider: (k + levels < count * levels).then_some(k + levels),
            doubted: false,
            dark_side: false,
        };
        (0..count * levels).map(of).collect()
    };
    let kept =
        |candidates: &[Candidate], narrow: u8, wide: u8, is: &dyn Fn(usize, usize) -> bool| {
            let of = |i: usize| if is(i % SIDE, i / SIDE) { narrow } else { wide };
            let chosen: Vec<u8> = (0..SIDE * SIDE).map(of).collect();
            let taken = common((SIDE, SIDE), candidates, &chosen, |i, [dx, _]| {
                // Two surfaces, the second one a narrow strip.
                f32::from(u8::from(strip(i) == strip(i.wrapping_add_signed(dx))))
            });
            let others = taken.iter().filter(|k| **k != narrow && **k != wide);
            assert_eq!(others.count(), 0, "{narrow}");
            let outside = taken
                .iter()
                .zip(&chosen)
                .filter(|(new, old)| **old == wide && **new != wide);
            assert_eq!(outside.count(), 0, "{narrow}");
            taken.iter().filter(|k| **k == narrow).count()
        };
    let square = |side: usize| {
        move |x: usize, y: usize| (10..10 + side).contains(&x) && (10..10 + side).contains(&y)
    };
    let one_level = blurs(5, 1);
    for narrow in 0..4 {
        assert_eq!(kept(&one_level, narrow, 4, &square(4)), 0, "{narrow}");
        assert_eq!(
            kept(&one_level, narrow, 4, &|x, _| x < 15),
            SIDE * 15,
            "{narrow}"
        );
    }
    for narrow in 0..2 {
        let line = |x: usize, _| (10..13).contains(&x);
        // Pixels at its sides have as many of the same choice around them as those in its middle.
        assert_eq!(kept(&one_level, narrow, 4, &line), 3 * SIDE, "{narrow}");
    }
    // A surface that is one pixel wide keeps its choice.
    for narrow in 0..4 {
        assert_eq!(
            kept(&one_level, narrow, 4, &|x, _| x == 25),
            SIDE,
            "{narrow}"
        );
    }
    // A level takes a blur of its own level's light.
    let levels = blurs(3, 2);
    assert_eq!(kept(&levels, 1, 5, &square(4)), 0);
    // The widest blur has no wider one, and without blurs nothing changes.
    assert_eq!(kept(&one_level, 4, 0, &square(1)), 1);
    assert_eq!(kept(&blurs(1, 2), 1, 0, &square(1)), 1);
}

/// The early exit agrees with the plain mean, also where rounding decides.
#[test]
fn a_rare_choice_is_found_as_by_the_plain_share() {
    const SIZE: Size = (11, 10);
    let (mut random, mut found) = (stream(78), [0; 2]);
    for _ in 0..4000 {
        let pixel = (random.next_1d() * (SIZE.0 * SIZE.1) as f32) as usize;
        let (share, radius) = (random.next_1d(), 3 + usize::from(random.next_1d() < 0.5));
        let mut values = [(); SIZE.0 * SIZE.1].map(|()| f32::from(random.next_1d() < share));
        values[pixel] = 1.0;
        let mut weights = values.map(|_| random.next_1d().powi(4));
        let alike = |weights: &[f32]| {
            let weights = weights.to_vec();
            move |i: usize, [dx, dy]: [isize; 2]| {
                weights[i.wrapping_add_signed(dy * SIZE.0 as isize + dx)]
            }
        };
        // Only shares far from 0 and 1, where remainders are mostly rounding.
        let tie = share_of_alike(SIZE, radius, &values, pixel, alike(&weights));
        if !(0.1..0.9).contains(&tie) {
            continue;
        }
        for around in [
            0.5,
            1.0 - 1e-5,
            1.0 - 6e-8,
            1.0,
            1.0 + 1.2e-7,
            1.0 + 1e-5,
            1.5,
        ] {
            let least = tie * around;
            let plain = tie < least;
            let early = is_rare(SIZE, radius, &values, pixel, least, alike(&weights));
            assert_eq!(early, plain, "{tie} of {least}");
            found[usize::from(plain)] += 1;
        }
        // Without any similar pixel, a choice counts as common.
        weights.fill(0.0);
        weights[pixel] = 1.0;
        assert!(!is_rare(
            SIZE,
            radius,
            &values,
            pixel,
            0.49,
            alike(&weights)
        ));
    }
    assert!(found.iter().all(|count| *count > 5000), "{found:?}");
}

/// Batches without samples are left out of blurs, and black.
#[test]
fn blur_of_few_batches_is_that_of_all() {
    const SIZE: Size = (23, 17);
    let mut random = stream(79);
    let features: Vec<Features> = (0..SIZE.0 * SIZE.1)
        .map(|_| std::array::from_fn(|_| 0.3 + 0.1 * random.next_1d()))
        .collect();
    let inner = Inner {
        origin: (2, 3),
        size: (20, 12),
        width: SIZE.0,
    };
    for batches in 2..=BATCHES {
        let mut light = || -> Batches {
            let of = |b: usize, random: f32| if b < batches { random } else { 0.0 };
            let pixel = |_| std::array::from_fn(|b| Vec3A::splat(of(b, random.next_1d())));
            (0..SIZE.0 * SIZE.1).map(pixel).collect()
        };
        let (one, two) = (light(), light());
        for surface in [Surface::First, Surface::Rough] {
            let guide = Guide::new(SIZE, surface, &features);
            let layers = [&one, &two];
            let few = guide.blur::<1>(1.5, &inner, &layers, batches);
            assert!(
                few == guide.blur::<1>(1.5, &inner, &layers, BATCHES),
                "{batches}"
            );
            let few = guide.blur::<STEP>(4.0, &inner, &layers, batches);
            let all = guide.blur::<STEP>(4.0, &inner, &layers, BATCHES);
            assert!(few == all, "{batches}");
        }
    }
}

/// Textures of the first surface stop the blurs of both layers, each by the same difference of reflectance.
#[test]
fn a_difference_of_reflectance_is_an_edge_of_both_surfaces() {
    let features = [[0.3, 0.3, 0.3], [0.3, 0.4, 0.3], [0.9, 0.4, 0.3]].map(|reflectance| {
        let mut features = [0.0, 0.0, 1.0, 5.0, 0.0, 0.0, 1.0, 5.0, 0.0, 0.0, 0.0];
        features[8..].copy_from_slice(&reflectance);
        features
    });
    for of in [Surface::First, Surface::Rough] {
        let guide = Guide::new((3, 1), of, &features);
        let (near, far) = (guide.alike(0, [1, 0]), guide.alike(1, [1, 0]));
        assert!((near - (-0.5f32).exp()).abs() < 1e-4, "{near}");
        assert!(far < 1e-6, "{far}");
    }
}

/// The weight of a neighbour in a blur is its weight by surface times its weight by distance, along both surfaces.
#[test]
fn alike_is_the_weight_of_a_blur_without_its_distance() {
    const SIZE: Size = (9, 7);
    let mut random = stream(77);
    let features: Vec<Features> = (0..SIZE.0 * SIZE.1)
        .map(|_| std::array::from_fn(|_| 0.3 + 0.1 * random.next_1d()))
        .collect();
    let mut least = 1.0f32;
    for of in [Surface::First, Surface::Rough] {
        let guide = Guide::new(SIZE, of, &features);
        for pixel in (1..8).flat_map(|x| (1..6).map(move |y| y * SIZE.0 + x)) {
            let steps = [[-1, 0], [1, 0], [0, -1], [0, 1]];
            for (weight, step) in guide.beside(pixel).into_iter().zip(steps) {
                let alike = guide.alike(pixel, step);
                let expected = alike * (-0.5f32).exp();
                assert!(
                    (weight - expected).abs() < 1e-3 * expected,
                    "{weight} {expected}"
                );
                least = least.min(alike);
            }
        }
    }
    assert!(least < 0.5, "{least}");
}

#[test]
fn statement_of_a_black_film_is_one() {
    let mut film = crate::image::Film::new(crate::math::UVec2::splat(8));
    for sample in 0..16 {
        (0..64).for_each(|pixel| film.push(pixel, Rgb::ZERO, sample));
    }
    assert_eq!(film_error(&film).mean, 1.0);
}
