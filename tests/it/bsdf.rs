//! BSDFs: sampling against density, weights against values, reciprocity.

use crate::geometry::rng;
use crate::support::chi2::assert_likely;
use crate::support::slopes::DensityTest;
use opsr::bsdf::{
    Bsdf, BsdfSample, DELTA_ALPHA, Dielectric, Diffuse, Distribution, Glossy, Lobe, ThinDielectric,
};
use opsr::math::{DVec3, Rgb, Vec3};
use rand::RngExt;
use rand_pcg::Pcg32;
use std::f64::consts::{PI, TAU};

pub(crate) const DISTRIBUTIONS: [Distribution; 2] = [Distribution::Beckmann, Distribution::Ggx];
const ALPHAS: [f32; 6] = [0.0, 1e-3, 0.01, 0.1, 0.3, 1.0];
const ANGLES: [f32; 5] = [0.0, 30.0, 60.0, 80.0, 88.0];

/// Direction at `degrees` from the normal, off both tangents.
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
        f90: 1.0,
        albedo: Rgb::ZERO,
        alpha,
        distribution,
    })
}

pub(crate) fn plastic(alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Glossy(Glossy {
        f0: Rgb::splat(0.04),
        f90: 1.0,
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
        f90: 1.0,
        tint: Rgb::new(1.0, 0.9, 0.8),
        alpha,
        distribution,
    })
}

/// A BSDF of every kind at one roughness, with a name.
fn bsdfs(alpha: f32, d: Distribution) -> [(&'static str, Bsdf); 5] {
    [
        ("metal", metal(alpha, d)),
        ("plastic", plastic(alpha, d)),
        ("glass", glass(1.5, alpha, d)),
        ("pane", pane(alpha, d)),
        ("diffuse", Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE })),
    ]
}

#[test]
fn chi_square_of_sample_against_pdf() {
    let mut rng = rng(100);
    let mut p_values = Vec::new();
    for distribution in DISTRIBUTIONS {
        for &alpha in &ALPHAS[1..] {
            for degrees in ANGLES {
                for (name, bsdf) in bsdfs(alpha, distribution) {
                    for side in [1.0, -1.0] {
                        let wo = at(degrees) * side;
                        let test = DensityTest { bsdf, alpha, wo };
                        let p = test.p_value(20_000, &mut rng);
                        let case = format!("{name} {distribution:?} {alpha} {degrees} {side}");
                        p_values.push((p, case));
                    }
                }
            }
        }
    }
    assert_likely(&p_values);
}

/// A walk from the light arrives along a direction that a walk from the camera would have sampled.
#[test]
fn chi_square_of_the_reverse_draw() {
    let mut rng = rng(105);
    let mut p_values = Vec::new();
    for distribution in DISTRIBUTIONS {
        for &alpha in &ALPHAS[1..] {
            for (name, bsdf) in bsdfs(alpha, distribution) {
                for side in [1.0, -1.0] {
                    for lobe in [Lobe::Diffuse, Lobe::Reflection, Lobe::Transmission] {
                        let wo = at(50.0) * side;
                        let sample = (0..100)
                            .filter_map(|_| bsdf.sample(alpha, wo, numbers(&mut rng)))
                            .find(|s| s.lobe == lobe);
                        let Some(BsdfSample { wi, .. }) = sample else {
                            continue;
                        };
                        let test = DensityTest {
                            bsdf,
                            alpha,
                            wo: wi,
                        };
                        let p = test.p_value(20_000, &mut rng);
                        let case = format!("{name} {distribution:?} {alpha} {side} {lobe:?}");
                        p_values.push((p, case));
                    }
                }
            }
        }
    }
    assert_likely(&p_values);
}

#[test]
fn chi_square_rejects_a_wrong_density() {
    let mut rng = rng(110);
    for distribution in DISTRIBUTIONS {
        for alpha in [1e-3, 0.1, 1.0] {
            for (name, bsdf) in &bsdfs(alpha, distribution)[..4] {
                for side in [1.0, -1.0] {
                    let (bsdf, wo) = (*bsdf, at(45.0) * side);
                    let test = DensityTest { bsdf, alpha, wo };
                    // A roughness 5 % off; more where nine samples of ten are of the diffuse base.
                    let wrong = if *name == "plastic" { 1.3 } else { 1.05 };
                    let p = test.p_value_of(80_000, || {
                        let u = numbers(&mut rng);
                        bsdf.sample(wrong * alpha, wo, u).map(|s| s.wi)
                    });
                    assert!(p < 1e-7, "{name} {distribution:?} {alpha} {side}: {p}");
                }
            }
        }
    }
    // The textbook's sin = √(1 − cos²) in single precision.
    let (alpha, wo) = (2e-3f32, Vec3::Z);
    let bsdf = metal(alpha, Distribution::Beckmann);
    let p = DensityTest { bsdf, alpha, wo }.p_value_of(40_000, || {
        let [u, v, _] = numbers(&mut rng);
        let cos = 1.0 / (1.0 - alpha * alpha * (1.0 - u).ln()).sqrt();
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        let (y, x) = (std::f32::consts::TAU * v).sin_cos();
        let m = Vec3::new(sin * x, sin * y, cos);
        Some(2.0 * wo.dot(m) * m - wo)
    });
    assert!(p < 1e-6, "{p}");
}

#[test]
fn pdf_integrates_to_at_most_one() {
    const THETA: usize = 200;
    const PHI: usize = 400;
    for distribution in DISTRIBUTIONS {
        // Sharper lobes need the grid of the chi-square test, which checks their integral too.
        for alpha in [0.0, 0.1, 0.3, 1.0] {
            for (name, bsdf) in bsdfs(alpha, distribution) {
                for (degrees, side) in [(0.0, 1.0), (45.0, -1.0), (60.0, 1.0), (85.0, -1.0)] {
                    let from = at(degrees) * side;
                    let mut integral = 0.0;
                    for i in 0..THETA * PHI {
                        // Denser towards the poles, with a weight that vanishes there: the midpoint rule then
                        // resolves lobes around the normal.
                        let t = ((i / PHI) as f64 + 0.5) / THETA as f64;
                        let theta = PI * t - 0.5 * (TAU * t).sin();
                        let dtheta = PI * (1.0 - (TAU * t).cos()) / THETA as f64;
                        let phi = ((i % PHI) as f64 + 0.5) / PHI as f64 * TAU;
                        let (sin, cos) = theta.sin_cos();
                        let to = DVec3::new(sin * phi.cos(), sin * phi.sin(), cos).as_vec3();
                        let cell = sin * dtheta * TAU / PHI as f64;
                        integral += f64::from(bsdf.pdf(alpha, from, to)) * cell;
                    }
                    let say = || format!("{name} {distribution:?} {alpha} {degrees}: {integral}");
                    assert!(integral < 1.002, "{}", say());
                    // Few of these samples fail below the horizon.
                    let nearly_all = alpha == 0.1 && degrees == 0.0 || name == "diffuse";
                    assert!(!nearly_all || integral > 0.99, "{}", say());
                    let all_delta = alpha == 0.0 && !matches!(name, "plastic" | "diffuse");
                    assert!(!all_delta || integral == 0.0, "{}", say());
                }
            }
        }
    }
}

#[test]
fn pdf_of_a_sample_is_its_density_both_ways() {
    let mut rng = rng(115);
    for distribution in DISTRIBUTIONS {
        for alpha in ALPHAS {
            for (i, bsdf) in zoo(alpha, distribution).into_iter().enumerate() {
                for k in 0..400 {
                    let wo = at(ANGLES[k % 5]) * if k % 2 == 0 { 1.0 } else { -1.0 };
                    let Some(s) = bsdf.sample(alpha, wo, numbers(&mut rng)) else {
                        continue;
                    };
                    let say = || format!("{i} {bsdf:?} at {alpha} from {wo:?}: {s:?}");
                    let pdf = bsdf.pdf(alpha, wo, s.wi);
                    if s.delta {
                        // A delta lobe has no density; a diffuse lobe beside it has.
                        let smooth = bsdf.is_delta_at(alpha) || pdf > 0.0;
                        assert!(
                            smooth && pdf == bsdf.eval(alpha, wo, s.wi).pdf_w,
                            "{}",
                            say()
                        );
                    } else {
                        assert!((pdf / s.pdf_w - 1.0).abs() <= 1e-5, "{pdf} {}", say());
                    }
                    // Bit-identical to a full evaluation, for either walk.
                    for (from, to) in [(wo, s.wi), (s.wi, wo)] {
                        let query = bsdf.query(from, to);
                        let evaluated = query.map_or(0.0, |query| query.at(alpha).pdf_w);
                        assert_eq!(bsdf.pdf(alpha, from, to), evaluated, "{}", say());
                    }
                }
            }
        }
    }
}

/// Relative difference allowed to values of one lobe for swapped directions: half vectors differ in the last bits, which
/// a sharp lobe magnifies by 1/α.
fn reciprocity_tolerance(alpha: f32) -> f32 {
    3e-4 + 3e-6 / alpha
}

/// f(wo, wi)/ηₒ² = f(wi, wo)/ηᵢ², at pairs of directions that the BSDF samples.
#[test]
fn reciprocity_of_eval() {
    let mut rng = rng(116);
    let mut compared = [0, 0];
    for distribution in DISTRIBUTIONS {
        for &alpha in &ALPHAS[1..] {
            for (name, bsdf) in bsdfs(alpha, distribution) {
                for k in 0..2000 {
                    let wo = at(ANGLES[k % 4]) * if k % 2 == 0 { 1.0 } else { -1.0 };
                    let sample = bsdf.sample(alpha, wo, numbers(&mut rng));
                    let Some(BsdfSample { wi, lobe, .. }) = sample else {
                        continue;
                    };
                    let through = lobe == Lobe::Transmission;
                    let scale = if through {
                        bsdf.refraction_scale(wo)
                    } else {
                        1.0
                    };
                    let forward = bsdf.eval(alpha, wo, wi).value / wi.z.abs() * scale;
                    let backward = bsdf.eval(alpha, wi, wo).value / wo.z.abs();
                    let (largest, apart) = (forward.max(backward), (forward - backward).abs());
                    assert!(
                        apart.cmple(reciprocity_tolerance(alpha) * largest).all(),
                        "{name} {distribution:?} {alpha} {wo:?} {wi:?}: {forward} {backward}"
                    );
                    compared[usize::from(through)] += 1;
                }
            }
        }
    }
    assert!(compared[0] > 50_000 && compared[1] > 10_000, "{compared:?}");
}

/// A walk from the light carries flux, which refraction does not scale: f(wo, wi) |cos θo| over the density of the
/// reverse draw is the weight of that draw, times (ηₒ/ηᵢ)² for transmission.
#[test]
fn adjoint_weight_of_the_reverse_draw() {
    let mut rng = rng(117);
    for distribution in DISTRIBUTIONS {
        for alpha in ALPHAS {
            for (name, bsdf) in bsdfs(alpha, distribution) {
                for k in 0..500 {
                    let wi = at(ANGLES[k % 4]) * if k % 2 == 0 { 1.0 } else { -1.0 };
                    let Some(s) = bsdf.sample(alpha, wi, numbers(&mut rng)) else {
                        continue;
                    };
                    let wo = s.wi;
                    let through = s.lobe == Lobe::Transmission;
                    let scale = if through {
                        bsdf.refraction_scale(wi)
                    } else {
                        1.0
                    };
                    let flux = s.weight * scale;
                    let say = || format!("{name} {distribution:?} {alpha} {wi:?} {wo:?}: {flux}");
                    if s.delta {
                        // The delta lobe of the same kind leads back, with the same flux.
                        let back = (0..1000)
                            .filter_map(|i| bsdf.sample(alpha, wo, [i as f32 / 1000.0, 0.5, 0.5]))
                            .find(|back| back.delta && back.lobe == s.lobe)
                            .expect("reversible");
                        assert!((back.wi - wi).length() < 1e-5, "{}", say());
                        let scale = if through {
                            bsdf.refraction_scale(wo)
                        } else {
                            1.0
                        };
                        let apart = (back.weight * scale - flux).abs();
                        assert!(apart.max_element() < 1e-5 * flux.max_element(), "{}", say());
                        assert!(flux.max_element() <= 20.0, "{}", say());
                        continue;
                    }
                    let value = bsdf.eval(alpha, wo, wi).value;
                    let particle = value * wo.z.abs() / wi.z.abs() / bsdf.pdf(alpha, wi, wo);
                    let apart = (particle - flux).abs();
                    let tolerance = reciprocity_tolerance(alpha.max(DELTA_ALPHA));
                    assert!(
                        apart.cmple(tolerance * particle.max(flux)).all(),
                        "{} {particle}",
                        say()
                    );
                }
            }
        }
    }
}

/// BSDFs with all that a scene may contain: perfect, matched, weak and strong interfaces.
fn zoo(alpha: f32, distribution: Distribution) -> Vec<Bsdf> {
    let mut all = vec![
        metal(alpha, distribution),
        plastic(alpha, distribution),
        pane(alpha, distribution),
        Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE }),
        Bsdf::Glossy(Glossy {
            f0: Rgb::ZERO,
            f90: 1.0,
            albedo: Rgb::ONE,
            alpha,
            distribution,
        }),
        Bsdf::Thin(ThinDielectric {
            f0: Rgb::ONE,
            f90: 1.0,
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

/// Uniform numbers, often at the ends of their range.
fn numbers_and_ends(rng: &mut Pcg32) -> [f32; 3] {
    std::array::from_fn(|_| match rng.random_range(0..40) {
        0 => 0.0,
        1 => 1.0 - f32::EPSILON / 2.0,
        2 => f32::EPSILON / 2.0,
        _ => rng.random(),
    })
}

/// Roughness in [0, 1], and a direction up to 89.999 degrees from the normal, on either side.
fn hard_view(rng: &mut Pcg32) -> (f32, Vec3) {
    let alpha = match rng.random_range(0..8) {
        0 => 0.0,
        1 => 1.0,
        2 => 1e-3,
        3 => 9.9e-4,
        _ => 1e-3f32.powf(rng.random()),
    };
    // Half of them uniform in the angle, half logarithmic in the distance to the horizon.
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
fn sample_weight_and_pdf_match_eval() {
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
            // A lobe is selected with probability 1/20 at least.
            let least = s.weight.min_element() >= 0.0;
            assert!(least && s.weight.max_element() <= 20.0, "{}", say());
            let through = wo.z * s.wi.z < 0.0;
            assert_eq!(through, s.lobe == Lobe::Transmission, "{}", say());
            let direction = bsdf.direction(alpha, wo, u);
            assert_eq!(direction, Some((s.wi, s.lobe)), "{}", say());
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
    // A few per cent of the samples fail below the horizon.
    assert!(drawn > 300_000, "{drawn}");
}

#[test]
fn eval_is_finite_and_not_negative_everywhere() {
    let mut rng = rng(130);
    for i in 0..40_000 {
        let (alpha, wo) = hard_view(&mut rng);
        let (_, wi) = hard_view(&mut rng);
        // Mirrored, straight through, or anywhere.
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
            // Sampling reaches every direction with a value.
            assert!(
                eval.pdf_w > 0.0 || eval.value.max_element() < 1e-6,
                "{}",
                say()
            );
        }
    }
}

#[test]
fn diffuse_sample_never_fails() {
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
fn coat_is_selected_by_its_reflectance() {
    // Luminance of the coat's reflectance over that of coat and base together, within [0.05, 0.95].
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
            f90: 1.0,
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
