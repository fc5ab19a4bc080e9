use super::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

/// Tiles of batches that are `mean` plus noise.
fn noisy(rng: &mut Pcg32, mean: f64, noise: f64, tiles: usize) -> Tiles {
    let means = std::array::from_fn(|_| {
        (0..tiles)
            .map(|_| [0, 1, 2].map(|_| mean + noise * (rng.random::<f64>() - 0.5)))
            .collect()
    });
    Tiles {
        means,
        variance: vec![2.0; tiles],
    }
}

#[test]
fn a_pilot_looks_where_the_render_looks() {
    let frame = UVec2::new(160, 90);
    let pilot_of = |window| pilot_window(frame, window);
    let whole = Window::full(frame);
    let crop = Window {
        x: 94,
        y: 30,
        w: 32,
        h: 32,
    };
    let corner = Window {
        x: 159,
        y: 89,
        w: 1,
        h: 1,
    };
    for window in [whole, crop, corner] {
        let (size, pilot) = pilot_of(window);
        assert!(
            pilot.inside(&Window::full(size)),
            "{window:?}: {pilot:?} of {size}"
        );
        assert!(pilot.w % TILE == 0 && pilot.h % TILE == 0);
        // Edges are where they were, to a tile.
        for (a, b, outer, inner) in [
            (window.x, window.w, frame.x, (pilot.x, pilot.w, size.x)),
            (window.y, window.h, frame.y, (pilot.y, pilot.h, size.y)),
        ] {
            let place = |x: u32| f64::from(x) / f64::from(outer);
            let found = |x: u32| f64::from(x) / f64::from(inner.2);
            let slack = 2.0 * f64::from(TILE) / f64::from(inner.2);
            assert!((place(a) - found(inner.0)).abs() < slack);
            assert!((place(a + b) - found(inner.0 + inner.1)).abs() < slack);
        }
    }
    assert_eq!(pilot_of(whole).1, Window::full(pilot_of(whole).0));
}

#[test]
fn squared_bias_is_measured_without_bias() {
    let mut rng = Pcg32::seed_from_u64(3);
    let tiles = 40_000;
    for bias in [0.0, 0.02, 0.1] {
        let plain = noisy(&mut rng, 0.5, 0.4, tiles);
        let level = noisy(&mut rng, 0.5 + bias, 0.4, tiles);
        let level = (Change::NONE, level);
        let found = measure(&plain, &level, &vec![1.0; tiles], 10, &[0, 1, 2, 3]);
        // Noise of d is 0.4 / sqrt(6); that of the square of four batches over 3 tiles is below 2e-4.
        let expected: f64 = bias * bias;
        assert!((found.bias2 - expected).abs() < 2e-4, "{bias}: {found:?}");
        assert!((found.variance - 0.2).abs() < 1e-12);
    }
}

#[test]
fn the_best_and_no_change_are_finalists() {
    let level = |(i, change): (usize, Change)| Level {
        change,
        // The larger the index, the better.
        bias2: -1.0,
        variance: 1.0 / (i + 1) as f64,
        energy: 0.0,
    };
    let levels: Vec<Level> = Change::all().enumerate().map(level).collect();
    let none = Change::all().position(|c| c == Change::NONE).unwrap();
    let last = levels.len() - FINALISTS..levels.len();
    let expected: Vec<usize> = std::iter::once(none).chain(last).collect();
    assert_eq!(finalists(&levels), expected);
}

#[test]
fn energy_goes_before_error() {
    let level = |scale: f32, bias2: f64, energy: f64| Level {
        change: Change {
            contrast: 1.0,
            scale,
        },
        bias2,
        variance: 0.0,
        energy,
    };
    let mut pilot = Pilot {
        change: Change::NONE,
        decided: true,
        levels: vec![
            level(1.0, 0.1, -0.2),
            level(2.0, 0.2, 0.08),
            level(3.0, 0.4, 0.01),
            level(4.0, 0.3, -0.02),
        ],
        paths: 0,
    };
    for (share, best) in [
        (1.0, 1.0),
        (0.2, 1.0),
        (0.1, 2.0),
        (0.05, 4.0),
        (0.015, 3.0),
        (0.0, 3.0),
    ] {
        assert_eq!(pilot.within(share).scale, best, "{share}");
    }
    pilot.levels.clear();
    assert_eq!(pilot.within(0.1), Change::NONE);
}
