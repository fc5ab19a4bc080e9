//! Metrics against plain formulas, and FLIP against the program of its authors.

mod small;

use opsr::image::{Buffer, png};
use opsr::math::Rgb;
use opsr_metric::{self as metric, MetricError, flip};
use serde_json::Value;

// ── the pictures of data/flip/make.py ──

const WIDTH: usize = 48;
const HEIGHT: usize = 40;

fn mix(x: u32, y: u32, c: u32, seed: u32) -> u32 {
    let mut h = x.wrapping_mul(0x8da6_b343)
        ^ y.wrapping_mul(0xd816_3841)
        ^ c.wrapping_mul(0xcb1a_b31f)
        ^ seed.wrapping_mul(0x1656_67b1);
    h = (h ^ h >> 15).wrapping_mul(0x2c1b_3c6d);
    h = (h ^ h >> 12).wrapping_mul(0x297a_2d39);
    h ^ h >> 15
}

fn ramp(x: u32, y: u32, c: u32) -> u32 {
    (x * 5 + y * 3 + c * 40) % 256
}

fn board(x: u32, y: u32, c: u32) -> u32 {
    (if (x / 8 + y / 8).is_multiple_of(2) {
        230
    } else {
        30
    }) - 10 * c
}

fn firefly(x: u32, y: u32, c: u32) -> u32 {
    if mix(x, y, 0, 3).is_multiple_of(61) {
        255 * (1 + c)
    } else {
        0
    }
}

fn spot(x: u32, y: u32, value: u32) -> u32 {
    if x < 4 && y < 4 { value } else { 0 }
}

fn picture(f: impl Fn(u32, u32, u32) -> u32) -> Buffer {
    Buffer::from_fn(WIDTH, HEIGHT, |x, y| {
        Rgb::from_array([0, 1, 2].map(|c| f(x as u32, y as u32, c) as f32 / 256.0))
    })
}

/// (reference, test)
fn ldr_pair(name: &str) -> (Buffer, Buffer) {
    let display = match name {
        "same" => (picture(ramp), picture(ramp)),
        "noise" => {
            let noisy = |x, y, c| {
                (ramp(x, y, c) + mix(x, y, c, 1) % 97)
                    .saturating_sub(48)
                    .min(256)
            };
            (picture(ramp), picture(noisy))
        }
        "edges" => (picture(board), picture(|x, y, c| board(x + 1, y, c))),
        "black" => (
            picture(|_, _, _| 0),
            picture(|x, y, c| firefly(x, y, c).min(256)),
        ),
        "hue" => (
            picture(|_, _, c| 256 * u32::from(c == 1)),
            picture(|_, _, c| 256 * u32::from(c == 2)),
        ),
        other => panic!("no picture '{other}'"),
    };
    let linear = |b: Buffer| b.map(|p| Rgb::from_array(p.to_array().map(png::srgb_decode)));
    (linear(display.0), linear(display.1))
}

/// (reference, test)
fn hdr_pair(name: &str) -> (Buffer, Buffer) {
    match name {
        "noise" => {
            let stops = |x: u32| x / 8 * 2;
            let noisy =
                |x, y, c| (((1 + ramp(x, y, c)) * (mix(x, y, c, 2) % 256)) >> 7) << stops(x);
            (
                picture(|x, y, c| (1 + ramp(x, y, c)) << stops(x)),
                picture(noisy),
            )
        }
        "edges" => (
            picture(|x, y, c| board(x, y, c).pow(2)),
            picture(|x, y, c| board(x, y + 1, c).pow(2) + 40 * x),
        ),
        "spot" => (
            picture(|x, y, _| spot(x, y, 4096)),
            picture(|x, y, c| spot(x, y, 3584) + firefly(x, y, c)),
        ),
        other => panic!("no picture '{other}'"),
    }
}

/// Largest differences of the mean and of the map from the expected values.
fn distance(map: &flip::FlipMap, expected: &Value) -> (f64, f64) {
    let mean = (map.mean - expected["mean"].as_f64().unwrap()).abs();
    let expected: Vec<f64> = expected["map"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect();
    let places = (0..HEIGHT)
        .step_by(5)
        .flat_map(|y| (0..WIDTH).step_by(7).map(move |x| y * WIDTH + x));
    let ours: Vec<f64> = places.map(|i| f64::from(map.values[i])).collect();
    assert_eq!(ours.len(), expected.len());
    let worst = ours
        .iter()
        .zip(&expected)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    (mean, worst)
}

fn expected(kind: &str) -> Vec<(String, Value)> {
    let all: Value = serde_json::from_str(include_str!("../data/flip/expected.json")).unwrap();
    let cases = all[kind].as_object().unwrap();
    assert!(cases.len() >= 3);
    cases.iter().map(|(k, v)| (k.clone(), v.clone())).collect()
}

#[test]
fn flip_ldr_matches_published_values() {
    for (name, expected) in expected("ldr") {
        let (reference, test) = ldr_pair(&name);
        let map = flip::ldr(&test, &reference, flip::DEFAULT_PPD).unwrap();
        let (mean, worst) = distance(&map, &expected);
        println!("{name}: mean {mean:.1e}, worst pixel {worst:.1e}");
        assert!(
            mean < 1e-5 && worst < 1e-4,
            "{name}: mean off by {mean}, a pixel by {worst}"
        );
    }
}

#[test]
fn flip_hdr_matches_published_values() {
    for (name, expected) in expected("hdr") {
        let (reference, test) = hdr_pair(&name);
        let (map, exposures) = flip::hdr(&test, &reference, flip::DEFAULT_PPD).unwrap();
        let wanted = |k: &str| expected[k].as_f64().unwrap();
        assert!(
            (exposures.start - wanted("startExposure")).abs() < 1e-5,
            "{name}: {exposures:?}"
        );
        assert!(
            (exposures.stop - wanted("stopExposure")).abs() < 1e-5,
            "{name}: {exposures:?}"
        );
        assert_eq!(exposures.count as f64, wanted("numExposures"), "{name}");
        let (mean, worst) = distance(&map, &expected);
        println!("{name}: mean {mean:.1e}, worst pixel {worst:.1e}");
        assert!(
            mean < 1e-5 && worst < 1e-4,
            "{name}: mean off by {mean}, a pixel by {worst}"
        );
    }
}

#[test]
fn flip_limits() {
    let (black, lit) = (
        Buffer::filled(5, 3, Rgb::ZERO),
        Buffer::filled(5, 3, Rgb::ONE),
    );
    assert_eq!(
        flip::hdr(&lit, &black, 67.0).unwrap_err(),
        MetricError::BlackReference
    );
    assert!(matches!(
        flip::ldr(&lit, &black, 0.0),
        Err(MetricError::PixelsPerDegree(_))
    ));
    let (same, _) = flip::hdr(&lit, &lit, 67.0).unwrap();
    assert_eq!(same.mean, 0.0);
    // Values whose squares overflow single precision.
    let (map, _) = flip::hdr(&Buffer::filled(5, 3, Rgb::splat(1e38)), &lit, 67.0).unwrap();
    assert!(map.values.iter().all(|v| v.is_finite()) && map.mean > 0.0);
}

// ── plain formulas ──

#[test]
fn metric_values_match_their_formulas() {
    let (reference, test) = hdr_pair("noise");
    let channels = |b: &Buffer| {
        b.pixels
            .iter()
            .flat_map(|p| p.to_array())
            .map(f64::from)
            .collect::<Vec<_>>()
    };
    let (i, f) = (channels(&test), channels(&reference));
    let mean = |g: &dyn Fn(f64, f64) -> f64| {
        i.iter().zip(&f).map(|(&i, &f)| g(i, f)).sum::<f64>() / i.len() as f64
    };
    let mse = mean(&|i, f| (i - f) * (i - f));
    let cases = [
        (metric::mse(&test, &reference), mse),
        (metric::rmse(&test, &reference), mse.sqrt()),
        (
            metric::relmse(&test, &reference),
            mean(&|i, f| (i - f).powi(2) / (f * f + 0.01)),
        ),
        (
            metric::mape(&test, &reference),
            mean(&|i, f| (i - f).abs() / (f + 0.01)),
        ),
        (
            metric::smape(&test, &reference),
            mean(&|i, f| (i - f).abs() / (i + f + 0.01)),
        ),
        (
            metric::energy_ratio(&test, &reference),
            mean(&|i, _| i) / mean(&|_, f| f),
        ),
    ];
    for (metric, expected) in cases {
        let metric = metric.unwrap();
        assert!(
            (metric.value / expected - 1.0).abs() < 1e-12,
            "{metric:?} is not {expected}"
        );
    }
}

#[test]
fn metric_firefly_is_found_and_trimmed() {
    let black = Buffer::filled(30, 20, Rgb::ZERO);
    let mut test = black.clone();
    test.pixels[7 * 30 + 11] = Rgb::new(0.0, 0.0, 3.0);
    let worst = metric::worst(&test, &black).unwrap();
    assert_eq!(
        (worst.x, worst.y, worst.value, worst.reference),
        (11, 7, [0.0, 0.0, 3.0], [0.0; 3])
    );
    assert!((worst.error - 9.0 / 0.01 / 3.0).abs() < 1e-9);
    assert!((metric::relmse(&test, &black).unwrap().value - 0.5).abs() < 1e-12);
    assert_eq!(metric::relmse_trimmed(&test, &black).unwrap().value, 0.0);
    assert_eq!(
        metric::energy_ratio(&test, &black).unwrap().value,
        f64::INFINITY
    );
    assert_eq!(metric::energy_ratio(&black, &black).unwrap().value, 1.0);
}

#[test]
fn pictures_that_cannot_be_compared_are_errors() {
    let good = Buffer::filled(4, 3, Rgb::ONE);
    let mut bad = good.clone();
    bad.pixels[6].y = f32::NAN;
    bad.pixels[9].x = f32::INFINITY;
    type F = fn(&Buffer, &Buffer) -> Result<f64, MetricError>;
    let all: [F; 9] = [
        |a, b| metric::mse(a, b).map(|m| m.value),
        |a, b| metric::relmse(a, b).map(|m| m.value),
        |a, b| metric::relmse_trimmed(a, b).map(|m| m.value),
        |a, b| metric::mape(a, b).map(|m| m.value),
        |a, b| metric::smape(a, b).map(|m| m.value),
        |a, b| metric::worst(a, b).map(|w| w.error),
        |a, b| flip::ldr(a, b, 67.0).map(|m| m.mean),
        |a, b| flip::hdr(a, b, 67.0).map(|m| m.0.mean),
        |a, b| metric::bias_variance(&[a, a], b).map(|m| m.variance.value),
    ];
    let empty = Buffer::default();
    for f in all {
        let refused = |which| MetricError::NotFinite {
            which,
            x: 2,
            y: 1,
            count: 2,
        };
        assert_eq!(f(&bad, &good), Err(refused("picture")));
        assert_eq!(f(&good, &bad), Err(refused("reference")));
        assert!(matches!(
            f(&good, &Buffer::filled(3, 4, Rgb::ONE)),
            Err(MetricError::Sizes { .. })
        ));
        assert_eq!(f(&empty, &empty), Err(MetricError::Empty));
    }
}

#[test]
fn metric_bias_and_variance_split() {
    // Renders are f + b + noise of known variance: uniform ±¼ on a grid of 1/256.
    let reference = picture(|_, _, _| 512);
    let bias = 0.125;
    let renders: Vec<Buffer> = (0..8)
        .map(|seed| picture(|x, y, c| 512 + 32 + mix(x, y, c, 10 + seed) % 128 - 64))
        .collect();
    let renders: Vec<&Buffer> = renders.iter().collect();
    let split = metric::bias_variance(&renders, &reference).unwrap();
    let variance = (128.0f64 * 128.0 - 1.0) / 12.0 / (256.0 * 256.0);
    let bias_with_grid: f64 = bias - 0.5 / 256.0;
    assert!(
        (split.variance.value / variance - 1.0).abs() < 0.02,
        "{split:?}"
    );
    assert!(
        (split.bias_squared.value / bias_with_grid.powi(2) - 1.0).abs() < 0.02,
        "{split:?}"
    );
    let mse = renders
        .iter()
        .map(|r| metric::mse(r, &reference).unwrap().value)
        .sum::<f64>()
        / 8.0;
    assert!((split.bias_squared.value + split.variance.value - mse).abs() < 1e-12);
    assert_eq!(
        metric::bias_variance(&renders[..1], &reference),
        Err(MetricError::TooFew(1))
    );
}
