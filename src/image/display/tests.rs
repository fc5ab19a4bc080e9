use super::*;

/// Fireflies with nearly all light of a mostly black picture do not change its exposure.
#[test]
fn auto_exposure_is_not_blinded_by_fireflies() {
    let face = |x: usize, y: usize| (40..60).contains(&x) && (40..60).contains(&y);
    let clean = Buffer::from_fn(200, 200, |x, y| match face(x, y) {
        true => Rgb::splat(0.5),
        false => Rgb::ZERO,
    });
    let expected = auto_exposure(&clean);
    assert!(
        (expected - (BRIGHT / 0.5).log2()).abs() < 0.06,
        "{expected}"
    );
    let mut specks = clean.clone();
    for k in 0..100 {
        specks.pixels[(37 + 397 * k) % 40_000] = Rgb::splat(1e5);
    }
    assert_eq!(auto_exposure(&specks), expected);
    // Without other light the fireflies set the exposure.
    let mut alone = Buffer::filled(200, 200, Rgb::ZERO);
    alone.pixels[77] = Rgb::splat(4.0);
    assert!((auto_exposure(&alone) - (BRIGHT / 4.0).log2()).abs() < 0.06);
}

/// Rare paths bring all light, to one of several pixels: the exposure is that of the picture without noise.
#[test]
fn auto_exposure_does_not_depend_on_noise() {
    let room = |x: usize| 0.1 + 0.4 * x as f32 / 299.0;
    let clean = Buffer::from_fn(300, 200, |x, _| Rgb::splat(room(x)));
    for (one_of, apart) in [(2, 0.11), (5, 0.21), (10, 0.41)] {
        let noisy = Buffer::from_fn(300, 200, |x, y| {
            let mixed = (x as u64 * 0x9E37_79B9 + y as u64 * 0x85EB_CA77)
                .wrapping_mul(0xBF58_476D_1CE4_E5B9);
            let lit = (mixed >> 40).is_multiple_of(one_of);
            Rgb::splat(room(x) * if lit { one_of as f32 } else { 0.0 })
        });
        let (a, b) = (auto_exposure(&clean), auto_exposure(&noisy));
        assert!((a - b).abs() < apart, "1 pixel of {one_of}: {a} {b}");
    }
}

#[test]
fn agx_view_keeps_grey_and_whitens_bright_colours() {
    let show = |c: Rgb| {
        let display = Display {
            exposure: 0.0,
            view: ViewTransform::Agx,
        };
        display.linear(c)
    };
    let greys: Vec<Rgb> = (0..300)
        .map(|i| show(Rgb::splat((0.05 * i as f32 - 11.0).exp2())))
        .collect();
    for pair in greys.windows(2) {
        assert!(pair[1].x >= pair[0].x - 1e-4, "{pair:?}");
        assert!((pair[0].x - pair[0].y).abs() < 1e-3 && (pair[0].x - pair[0].z).abs() < 1e-3);
    }
    // Middle grey stays near itself.
    assert!((0.15..0.25).contains(&show(Rgb::splat(0.18)).x));
    let red = |stops: f32| show(Rgb::new(1.0, 0.02, 0.02) * stops.exp2());
    let purity = |c: Rgb| c.y / c.x;
    assert!(purity(red(-2.0)) < 0.25 && purity(red(4.0)) > 2.0 * purity(red(-2.0)));
    for bad in [f32::MAX, 0.0, -1.0] {
        assert!(show(Rgb::splat(bad)).is_finite());
    }
}

#[test]
fn auto_exposure_scales_with_radiance_and_ignores_black_and_non_finite_pixels() {
    let ramp = Buffer::from_fn(100, 2, |x, _| Rgb::splat(x as f32 / 99.0));
    let stops = auto_exposure(&ramp);
    assert!(
        (stops.exp2() * SHARE as f32 - BRIGHT).abs() < 0.06,
        "{stops}"
    );
    for k in [-20, 7, 40] {
        let scaled = ramp.map(|p| p * (k as f32).exp2());
        assert!((auto_exposure(&scaled) - (stops - k as f32)).abs() < 1e-3);
    }
    let mut dark = ramp.clone();
    dark.pixels.extend([Rgb::ZERO; 1000]);
    dark.pixels.extend([Rgb::NAN, Rgb::INFINITY]);
    assert_eq!(auto_exposure(&dark), stops);
    assert_eq!(auto_exposure(&Buffer::filled(2, 2, Rgb::ZERO)), 0.0);
    assert!(
        auto_exposure(&Buffer::filled(2, 2, Rgb::splat(1e-45)))
            .exp2()
            .is_finite()
    );
}

#[test]
fn filmic_view_is_monotone_and_keeps_highlights_apart() {
    let view = ViewTransform::Filmic;
    let show = |x: f32| {
        let display = Display {
            exposure: 0.0,
            view,
        };
        display.linear(Rgb::splat(x)).x
    };
    let steps: Vec<f32> = (0..400)
        .map(|i| show((0.05 * i as f32 - 15.0).exp2()))
        .collect();
    assert!(steps.is_sorted());
    assert_eq!((show(0.0), show(-1.0), show(f32::MAX)), (0.0, 0.0, 1.0));
    // Plain sRGB shows both of these values as white.
    assert!(show(1.0) < 0.7 && show(4.0) > show(1.0) + 0.1 && show(4.0) < 1.0);
}
