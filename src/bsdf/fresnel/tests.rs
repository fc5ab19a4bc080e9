use super::*;

#[test]
fn dielectric_at_normal_incidence_brewster_and_beyond_the_critical_angle() {
    assert!((dielectric(1.0, 1.5) - 0.04).abs() < 1e-7);
    assert!((dielectric(1.0, 1.0 / 1.5) - 0.04).abs() < 1e-7);
    assert_eq!(dielectric(0.1, 1.0 / 1.5), 1.0);
    assert_eq!(dielectric(0.0, 1.5), 1.0);
    // At Brewster's angle only the s polarisation reflects: F = ½ ((1 − η²)/(1 + η²))².
    let eta: f32 = 1.5;
    let brewster = (1.0 / (1.0 + eta * eta)).sqrt();
    let s = (1.0 - eta * eta) / (1.0 + eta * eta);
    assert!((dielectric(brewster, eta) - 0.5 * s * s).abs() < 1e-6);
}

#[test]
fn dielectric_of_equal_indices_does_not_reflect() {
    for i in 1..=100 {
        assert!(dielectric(i as f32 * 0.01, 1.0) < 1e-12);
    }
}

#[test]
fn schlick_average_matches_its_integral() {
    let n = 100_000;
    let sum: f64 = (0..n)
        .map(|i| {
            let c = (f64::from(i) + 0.5) / f64::from(n);
            2.0 * c * f64::from(schlick(Rgb::splat(0.2), 0.7, c as f32).x) / f64::from(n)
        })
        .sum();
    assert!((sum - f64::from(schlick_average(Rgb::splat(0.2), 0.7).x)).abs() < 1e-6);
}

/// Against the equations in complex numbers: r_s = (cos θ − w)/(cos θ + w), r_p = (n² cos θ − w)/(n² cos θ + w) with
/// w² = n² − sin² θ.
#[test]
fn conductor_is_fresnel_of_a_complex_index() {
    type Complex = (f64, f64);
    let mul = |a: Complex, b: Complex| (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0);
    let norm = |a: Complex| a.0 * a.0 + a.1 * a.1;
    let root = |a: Complex| {
        let (r, phi) = (norm(a).sqrt().sqrt(), 0.5 * a.1.atan2(a.0));
        (r * phi.cos(), r * phi.sin())
    };
    let mut seen = 0;
    for (eta, k) in [
        (0.2, 3.91),
        (1.1, 2.14),
        (1.5, 0.0),
        (2.74, 3.79),
        (0.04, 0.1),
    ] {
        for i in 0..=50 {
            let cos = f64::from(i) / 50.0;
            let n2 = mul((eta, k), (eta, k));
            let w = root((n2.0 - (1.0 - cos * cos), n2.1));
            let ratio = |a: Complex| norm((a.0 - w.0, a.1 - w.1)) / norm((a.0 + w.0, a.1 + w.1));
            let expected = 0.5 * (ratio((cos, 0.0)) + ratio((n2.0 * cos, n2.1 * cos)));
            let found = f64::from(conductor(cos as f32, eta as f32, k as f32));
            assert!(
                (found - expected).abs() < 2e-5,
                "{eta} {k} {cos}: {found} {expected}"
            );
            if k == 0.0 {
                let plain = f64::from(dielectric(cos as f32, eta as f32));
                assert!((found - plain).abs() < 2e-5, "{cos}");
            }
            seen += 1;
        }
    }
    assert_eq!(seen, 255);
    assert_eq!(conductor(0.5, 1.0, 0.0), 0.0);
}

/// Against the closed form of the mean (Duntley 1942, as in d'Eon's and Irving's *A Quantized-Diffusion Model*, 2011).
#[test]
fn dielectric_average_matches_known_values() {
    for (eta, known) in [(1.0f32, 0.0), (1.5, 0.091_8), (1.333, 0.065_9)] {
        let found = f64::from(dielectric_average(eta));
        assert!((found - known).abs() < 2e-3, "{eta}: {found}");
    }
    // From inside: 1 − (1 − F)/η².
    let (out, inside) = (dielectric_average(1.5), dielectric_average(1.0 / 1.5));
    assert!(
        (inside - (1.0 - (1.0 - out) / 2.25)).abs() < 1e-3,
        "{inside}"
    );
}
