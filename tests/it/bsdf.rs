//! Scattering closures: what is drawn, what it is worth, and that it is the same number from every side.

use crate::geometry::rng;
use crate::support::chi2::assert_likely;
use crate::support::slopes::View;
use opsr::bsdf::{
    Bsdf, DELTA_ALPHA, Dielectric, Diffuse, Distribution, Glossy, Lobe, ThinDielectric,
};
use opsr::math::{Rgb, Vec3};
use rand::RngExt;
use rand_pcg::Pcg32;

pub(crate) const DISTRIBUTIONS: [Distribution; 2] = [Distribution::Beckmann, Distribution::Ggx];
const ALPHAS: [f32; 5] = [1e-3, 0.01, 0.1, 0.5, 1.0];
const ANGLES: [f32; 5] = [0.0, 30.0, 60.0, 80.0, 88.0];

/// Direction at `degrees` from the normal, off both axes.
pub(crate) fn at(degrees: f32) -> Vec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (y, x) = 0.7f32.sin_cos();
    Vec3::new(sin * x, sin * y, cos)
}

pub(crate) fn numbers(rng: &mut Pcg32) -> [f32; 3] {
    std::array::from_fn(|_| rng.random())
}

pub(crate) fn metal(alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Glossy(Glossy {
        f0: Rgb::ONE,
        albedo: Rgb::ZERO,
        alpha,
        distribution,
    })
}

pub(crate) fn plastic(alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Glossy(Glossy {
        f0: Rgb::splat(0.04),
        albedo: Rgb::new(0.8, 0.5, 0.2),
        alpha,
        distribution,
    })
}

pub(crate) fn glass(eta: f32, alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Dielectric(Dielectric {
        eta,
        tint: Rgb::ONE,
        alpha,
        distribution,
    })
}

pub(crate) fn pane(alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Thin(ThinDielectric {
        f0: Rgb::new(0.04, 0.2, 0.5),
        tint: Rgb::new(1.0, 0.9, 0.8),
        alpha,
        distribution,
    })
}

/// All closures of one roughness: name, closure, sign of `wo.z`, relative index.
fn closures(alpha: f32, d: Distribution) -> Vec<(&'static str, Bsdf, f32, f64)> {
    vec![
        ("metal", metal(alpha, d), 1.0, 0.0),
        ("plastic", plastic(alpha, d), -1.0, 0.0),
        ("into glass", glass(1.5, alpha, d), 1.0, 1.5),
        (
            "out of glass",
            glass(1.5, alpha, d),
            -1.0,
            f64::from(1.0f32 / 1.5),
        ),
        ("pane", pane(alpha, d), 1.0, 0.0),
    ]
}

#[test]
fn lobes_are_drawn_as_their_density_says() {
    const DRAWS: u32 = 40_000;
    let mut rng = rng(100);
    let mut p_values = Vec::new();
    for distribution in DISTRIBUTIONS {
        for alpha in ALPHAS {
            for degrees in ANGLES {
                for (name, bsdf, side, eta) in closures(alpha, distribution) {
                    let wo = at(degrees) * side;
                    let view = View {
                        bsdf,
                        alpha,
                        wo,
                        eta,
                    };
                    let p = view.test_itself(DRAWS, &mut rng);
                    p_values.push((p, format!("{name} {distribution:?} {alpha} {degrees}")));
                }
            }
        }
    }
    assert_likely(&p_values);
}

#[test]
fn the_test_of_densities_finds_what_is_wrong() {
    let mut rng = rng(110);
    for distribution in DISTRIBUTIONS {
        for alpha in [1e-3, 0.1, 1.0] {
            for (name, bsdf, side, eta) in closures(alpha, distribution) {
                let wo = at(45.0) * side;
                let view = View {
                    bsdf,
                    alpha,
                    wo,
                    eta,
                };
                // A roughness 5 % off; more where nine draws of ten are of the diffuse base.
                let wrong = if name == "plastic" { 1.3 } else { 1.05 };
                let p = view.test(80_000, || {
                    let u = numbers(&mut rng);
                    bsdf.sample(wrong * alpha, wo, u).map(|s| s.wi)
                });
                assert!(p < 1e-7, "{name} {distribution:?} {alpha}: {p}");
            }
        }
    }
    // The textbook's sin = √(1 − cos²) in single precision.
    let (alpha, wo) = (2e-3f32, Vec3::Z);
    let view = View {
        bsdf: metal(alpha, Distribution::Beckmann),
        alpha,
        wo,
        eta: 0.0,
    };
    let p = view.test(40_000, || {
        let [u, v, _] = numbers(&mut rng);
        let cos = 1.0 / (1.0 - alpha * alpha * (1.0 - u).ln()).sqrt();
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (y, x) = (std::f32::consts::TAU * v).sin_cos();
        let m = Vec3::new(sin * x, sin * y, cos);
        Some(2.0 * wo.dot(m) * m - wo)
    });
    assert!(p < 1e-6, "{p}");
}

/// Closures with all that a scene may contain: smooth, matched, weak and strong interfaces.
fn zoo(alpha: f32, distribution: Distribution) -> Vec<Bsdf> {
    let mut all = vec![
        metal(alpha, distribution),
        plastic(alpha, distribution),
        pane(alpha, distribution),
        Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE }),
        Bsdf::Glossy(Glossy {
            f0: Rgb::ZERO,
            albedo: Rgb::ONE,
            alpha,
            distribution,
        }),
        Bsdf::Thin(ThinDielectric {
            f0: Rgb::ONE,
            tint: Rgb::ONE,
            alpha,
            distribution,
        }),
    ];
    all.extend(
        [1.0, 1.0001, 1.001, 1.33, 1.5, 3.0, 0.7].map(|eta| glass(eta, alpha, distribution)),
    );
    all
}

/// Uniform numbers, with the ends of their range far more often than by chance.
fn numbers_and_ends(rng: &mut Pcg32) -> [f32; 3] {
    std::array::from_fn(|_| match rng.random_range(0..40) {
        0 => 0.0,
        1 => 1.0 - f32::EPSILON / 2.0,
        2 => f32::EPSILON / 2.0,
        _ => rng.random(),
    })
}

/// Roughness from zero to one, and an angle up to 89.999 degrees.
fn hard_view(rng: &mut Pcg32) -> (f32, Vec3) {
    let alpha = match rng.random_range(0..8) {
        0 => 0.0,
        1 => 1.0,
        2 => 1e-3,
        3 => 9.9e-4,
        _ => 1e-3f32.powf(rng.random()),
    };
    // Half of them uniform in the angle, half closer and closer to the horizon.
    let degrees = if rng.random() {
        90.0 * rng.random::<f32>()
    } else {
        90.0 - 1e-3f32.powf(rng.random())
    };
    let wo = at(degrees.min(89.999));
    (alpha, if rng.random() { wo } else { -wo })
}

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-3 * a.abs().max(b.abs()) || (a - b).abs() < 1e-30
}

#[test]
fn a_draw_is_worth_what_asking_anew_says() {
    let mut rng = rng(120);
    let mut drawn = 0;
    for i in 0..30_000 {
        let (alpha, wo) = hard_view(&mut rng);
        for bsdf in zoo(alpha, DISTRIBUTIONS[i % 2]) {
            let u = numbers_and_ends(&mut rng);
            let Some(s) = bsdf.sample(alpha, wo, u) else {
                continue;
            };
            drawn += 1;
            let say = || format!("{bsdf:?} at {alpha} from {wo:?} by {u:?}: {s:?}");
            assert!((s.wi.length() - 1.0).abs() < 1e-5, "{}", say());
            assert!(s.weight.is_finite(), "{}", say());
            // 20 is one over the least probability of a lobe.
            let least = s.weight.min_element() >= 0.0;
            assert!(least && s.weight.max_element() <= 20.0, "{}", say());
            let through = wo.z * s.wi.z < 0.0;
            assert_eq!(through, s.lobe == Lobe::Transmission, "{}", say());
            if s.delta {
                assert!(s.pdf_w == 0.0, "{}", say());
                assert!(alpha < DELTA_ALPHA || bsdf.is_delta_at(1.0), "{}", say());
                continue;
            }
            let again = bsdf.eval(alpha, wo, s.wi);
            assert!(again.pdf_w > 0.0 && again.pdf_w.is_finite(), "{}", say());
            assert!(close(again.pdf_w, s.pdf_w), "{} {again:?}", say());
            for c in 0..3 {
                let value = again.value[c] / again.pdf_w;
                assert!(close(value, s.weight[c]), "{} {again:?}", say());
            }
        }
    }
    // Losses below the horizon are a few per cent.
    assert!(drawn > 300_000, "{drawn}");
}

#[test]
fn values_are_finite_everywhere() {
    let mut rng = rng(130);
    for i in 0..40_000 {
        let (alpha, wo) = hard_view(&mut rng);
        let (_, wi) = hard_view(&mut rng);
        // Mirrored, straight on, or anywhere.
        let wi = match i % 4 {
            0 => Vec3::new(-wo.x, -wo.y, wo.z),
            1 => -wo,
            2 => wi,
            _ => Vec3::new(-wi.x, -wi.y, wi.z),
        };
        for bsdf in zoo(alpha, DISTRIBUTIONS[i % 2]) {
            let eval = bsdf.eval(alpha, wo, wi);
            let say = || format!("{bsdf:?} at {alpha}, {wo:?} to {wi:?}: {eval:?}");
            assert!(
                eval.value.is_finite() && eval.pdf_w.is_finite(),
                "{}",
                say()
            );
            assert!(
                eval.value.min_element() >= 0.0 && eval.pdf_w >= 0.0,
                "{}",
                say()
            );
            // A direction that sampling never draws is worth nothing.
            assert!(
                eval.pdf_w > 0.0 || eval.value.max_element() < 1e-6,
                "{}",
                say()
            );
        }
    }
}

#[test]
fn diffuse_draws_are_never_lost() {
    let mut rng = rng(140);
    let albedo = Rgb::new(0.9, 0.5, 0.1);
    let bsdf = Bsdf::Diffuse(Diffuse { albedo });
    for degrees in ANGLES {
        for side in [1.0, -1.0] {
            let wo = at(degrees) * side;
            for _ in 0..100 {
                let s = bsdf.sample(0.0, wo, numbers(&mut rng)).expect("a draw");
                assert_eq!((s.weight, s.lobe, s.delta), (albedo, Lobe::Diffuse, false));
                assert!(s.wi.z * side > 0.0);
                assert!(close(s.pdf_w, s.wi.z.abs() / std::f32::consts::PI));
            }
        }
    }
    assert!(bsdf.sample(0.0, Vec3::X, [0.5; 3]).is_none());
}

#[test]
fn a_coat_is_drawn_as_often_as_it_reflects() {
    // Schlick's reflectance by luminance, against what is left for the base; never below a twentieth.
    for (f0, albedo, degrees) in [
        (0.04f64, 0.8f64, 0.0f32),
        (0.04, 0.8, 60.0),
        (0.04, 0.1, 85.0),
        (0.5, 0.5, 30.0),
        (0.01, 1.0, 0.0),
        (0.9, 0.02, 0.0),
    ] {
        let bsdf = Bsdf::Glossy(Glossy {
            f0: Rgb::splat(f0 as f32),
            albedo: Rgb::splat(albedo as f32),
            alpha: 0.0,
            distribution: Distribution::Beckmann,
        });
        let wo = at(degrees);
        let f = f0 + (1.0 - f0) * (1.0 - f64::from(wo.z)).powi(5);
        let expected = (f / (f + (1.0 - f) * albedo)).clamp(0.05, 0.95);
        let steps = 1000;
        let lobe = |i| bsdf.sample(0.0, wo, [(i as f32 + 0.5) / 1000.0, 0.3, 0.4]);
        let coat = (0..steps).filter(|&i| lobe(i).expect("a draw").lobe == Lobe::Reflection);
        let share = coat.count() as f64 / f64::from(steps);
        assert!(
            (share - expected).abs() < 2e-3,
            "{f0} {albedo} {degrees}: {share} {expected}"
        );
    }
}
