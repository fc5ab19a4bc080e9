use super::*;

/// Airy's sum with all bounces, integrated over wavelengths against the same sensitivities: an independent computation
/// without a truncated series.
fn integrated(film: &Film, f0: f64, cos: f64) -> DVec3 {
    let found = film.interference(f0, cos).expect("no total reflection");
    let Interference {
        reflectance: [upper, lower],
        shift,
        path,
    } = found;
    let r = (upper * lower).sqrt();
    let mean = (upper + lower - 2.0 * upper * lower) / (1.0 - upper * lower);
    let (mut sum, mut norm) = (DVec3::ZERO, 0.0);
    let n = 40_000;
    for i in 0..n {
        // Wave number 1/λ, from 1/1100 nm to 1/300 nm.
        let k = 0.9e6 + (f64::from(i) + 0.5) * (2.5e6 / f64::from(n));
        let delta = TAU * path * k + shift;
        // Airy's reflectance of two lossless interfaces: 1 − T T / |1 − r e^{iδ}|².
        let denominator = 1.0 - 2.0 * r * delta.cos() + r * r;
        let reflected = 1.0 - (1.0 - upper) * (1.0 - lower) / denominator;
        let eye = EYE.map(|[height, at, variance]| {
            height * 0.5f64.sqrt() * (-(k - at) * (k - at) / (4.0 * variance)).exp()
        });
        let eye = DVec3::new(eye[0] + eye[3], eye[1], eye[2]);
        sum += (reflected - mean) * eye;
        norm += eye.y;
    }
    DVec3::splat(mean) + rec709(sum / norm)
}

/// Four bounces err by at most 0.02 in displayable values. The error is largest where the film reflects strongly.
#[test]
fn film_agrees_with_airys_sum_over_wavelengths() {
    for thickness in [150.0, 300.0, 420.0, 800.0] {
        for ior in [1.3, 1.8] {
            for f0 in [0.04, 0.5] {
                for cos in [0.3, 0.7, 1.0] {
                    let film = Film {
                        weight: 1.0,
                        ior,
                        thickness,
                    };
                    let (here, there) = (film.rgb(f0, cos), integrated(&film, f0, cos));
                    let shown = |c: DVec3| c.clamp(DVec3::ZERO, DVec3::ONE);
                    let error = (shown(here) - shown(there)).abs().max_element();
                    assert!(error < 0.02, "{thickness} {ior} {f0} {cos}: {here} {there}");
                }
            }
        }
    }
}

#[test]
fn film_of_no_thickness_or_of_no_weight_changes_nothing() {
    let plain = Rgb::new(0.3, 0.4, 0.5);
    let none = Film {
        weight: 0.0,
        ior: 1.6,
        thickness: 400.0,
    };
    assert_eq!(none.reflectance(plain, plain, 0.7), plain);
    let thin = Film {
        weight: 1.0,
        ior: 1.6,
        thickness: 0.0,
    };
    for f0 in [0.04f32, 0.3, 0.9] {
        let f = thin.reflectance(Rgb::splat(f0), Rgb::ZERO, 1.0);
        assert!((f - Rgb::splat(f0)).abs().max_element() < 0.02, "{f0}: {f}");
    }
}
