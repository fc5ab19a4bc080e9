//! Metrics of a few pixels, worked out by hand.

use opsr::image::Buffer;
use opsr::math::Rgb;
use opsr_metric::{self as metric, flip};

#[test]
fn metric_relative_bias_and_variance_weight_each_pixel() {
    let grey = |values: [f32; 2]| Buffer::from_fn(2, 1, |x, _| Rgb::splat(values[x]));
    let reference = grey([0.5, 2.0]);
    let renders = [grey([0.25, 3.0]), grey([0.75, 5.0]), grey([1.25, 4.0])];
    let renders: Vec<&Buffer> = renders.iter().collect();
    let split = metric::bias_variance(&renders, &reference).unwrap();
    // Means 0.75 and 4, sample variances 0.25 and 1; (M − f)² − s²/3.
    let (variance, bias) = ([0.25, 1.0], [0.0625 - 0.25 / 3.0, 4.0 - 1.0 / 3.0]);
    let scale = [0.25 + 0.01, 4.0 + 0.01];
    let halves = |a: [f64; 2]| 0.5 * (a[0] + a[1]);
    for (metric, expected) in [
        (&split.variance, halves(variance)),
        (&split.bias_squared, halves(bias)),
        (
            &split.relative_variance,
            halves([variance[0] / scale[0], variance[1] / scale[1]]),
        ),
        (
            &split.relative_bias_squared,
            halves([bias[0] / scale[0], bias[1] / scale[1]]),
        ),
    ] {
        assert!(
            (metric.value - expected).abs() < 1e-12,
            "{metric:?} is not {expected}"
        );
    }
    assert_eq!(split.renders, 3);
}

#[test]
fn metric_trims_a_thousandth_and_at_least_a_pixel() {
    // Errors in red only: a third of 1/0.01 each.
    let black = |n| Buffer::filled(n, 1, Rgb::ZERO);
    for (pixels, wrong, left) in [(1000, 2, 1), (1001, 3, 1), (2000, 2, 0), (1, 1, 1)] {
        let test = Buffer::from_fn(pixels, 1, |x, _| Rgb::X * f32::from(u8::from(x < wrong)));
        let value = metric::relmse_trimmed(&test, &black(pixels)).unwrap().value;
        let kept = if pixels == 1 {
            1
        } else {
            pixels - pixels.div_ceil(1000)
        };
        let expected = f64::from(left) * 100.0 / 3.0 / kept as f64;
        assert!(
            (value - expected).abs() < 1e-9,
            "{pixels} {wrong}: {value} {expected}"
        );
    }
}

#[test]
fn metric_worst_pixel_is_the_first_of_equals() {
    let white = Buffer::filled(4, 3, Rgb::ONE);
    let mut test = white.clone();
    for i in [5, 9] {
        test.pixels[i] = Rgb::splat(1.5);
    }
    let worst = metric::worst(&test, &white).unwrap();
    assert_eq!((worst.x, worst.y), (1, 1));
}

#[test]
fn metric_smape_uses_absolute_values() {
    let (test, reference) = (
        Buffer::filled(2, 2, Rgb::splat(-0.5)),
        Buffer::filled(2, 2, Rgb::splat(0.25)),
    );
    let smape = metric::smape(&test, &reference).unwrap().value;
    assert!((smape - 0.75 / 0.76).abs() < 1e-12, "{smape}");
    let smape = metric::smape(&reference, &test).unwrap().value;
    assert!((smape - 0.75 / 0.76).abs() < 1e-12, "{smape}");
}

#[test]
fn flip_range_of_pixels_per_degree() {
    let b = Buffer::filled(3, 3, Rgb::ONE);
    for (ppd, good) in [
        (1.0, true),
        (1000.0, true),
        (0.99, false),
        (1000.1, false),
        (f64::NAN, false),
    ] {
        assert_eq!(flip::ldr(&b, &b, ppd).is_ok(), good, "{ppd}");
        assert_eq!(flip::hdr(&b, &b, ppd).is_ok(), good, "{ppd}");
    }
}
