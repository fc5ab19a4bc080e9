//! BSDFs: sampling against density, weights against values, reciprocity.

use crate::support::draws::{numbers, rng};
use crate::support::{assert_likely, holds};
use opsr::bsdf::{Bsdf, BsdfSample, DELTA_ALPHA, Diffuse, Distribution, Glossy, Lobe, translucent};
use opsr::math::{DVec3, Rgb, Vec3};
use opsr_lab::verify::bsdfs::{DISTRIBUTIONS, at, kinds, metal};
use opsr_lab::verify::density::DensityTest;
use opsr_lab::verify::{Size, sampling};
use std::f64::consts::{PI, TAU};

const ALPHAS: [f32; 6] = [0.0, 1e-3, 0.01, 0.1, 0.3, 1.0];
const ANGLES: [f32; 5] = [0.0, 30.0, 60.0, 80.0, 88.0];

#[test]
fn chi_square_of_sample_against_pdf() {
    holds(sampling::chi_square(Size::Small));
}

#[test]
fn white_furnace_of_draws_and_values() {
    holds(sampling::furnace(Size::Small));
}

#[test]
fn reciprocity_and_other_invariants() {
    holds(sampling::invariants(Size::Small));
}

/// A walk from the light arrives along a direction as a walk from the camera samples it.
#[test]
fn chi_square_of_the_reverse_draw() {
    let mut rng = rng(105);
    let mut p_values = Vec::new();
    for distribution in DISTRIBUTIONS {
        for &alpha in &ALPHAS[1..] {
            for (name, bsdf) in kinds(alpha, distribution) {
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
                        let p = test.p_value(20_000, || numbers(&mut rng));
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
            for (name, bsdf) in &kinds(alpha, distribution)[..4] {
                for side in [1.0, -1.0] {
                    let (bsdf, wo) = (*bsdf, at(45.0) * side);
                    let test = DensityTest { bsdf, alpha, wo };
                    // A roughness wrong by 5 %, or more where nine of ten samples are from the diffuse base.
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
    // The textbook's sin = √(1 − cos²), which is inaccurate in single precision.
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
        // Sharper lobes need the grid of the chi-square test, which also checks their integral.
        for alpha in [0.0, 0.1, 0.3, 1.0] {
            for (name, bsdf) in kinds(alpha, distribution) {
                for (degrees, side) in [(0.0, 1.0), (45.0, -1.0), (60.0, 1.0), (85.0, -1.0)] {
                    let from = at(degrees) * side;
                    let mut integral = 0.0;
                    for i in 0..THETA * PHI {
                        // Points are denser towards the poles, with a weight that vanishes there, so that the midpoint
                        // rule resolves lobes around the normal.
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
                    let narrow = alpha == 0.1 && degrees == 0.0 && !name.starts_with("brushed");
                    let nearly_all = narrow || ["diffuse", "paper"].contains(&name);
                    assert!(!nearly_all || integral > 0.99, "{}", say());
                    // Fibres have no Dirac lobe at any roughness.
                    let base = ["plastic", "leaf", "diffuse", "paper", "fibres"];
                    let base = base.iter().any(|base| name.contains(base));
                    let all_delta = alpha == 0.0 && !base;
                    assert!(!all_delta || integral == 0.0, "{}", say());
                }
            }
        }
    }
}

/// Relative difference allowed between values of one lobe for swapped directions: half vectors differ in the last bits,
/// which a sharp lobe magnifies by 1/α.
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
            for (name, bsdf) in kinds(alpha, distribution) {
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

/// A walk from the light carries flux, which refraction does not scale. So f(wo, wi) |cos θo| over the density of the
/// reverse sample is the weight of that sample, times (ηₒ/ηᵢ)² for transmission.
#[test]
fn adjoint_weight_of_the_reverse_draw() {
    let mut rng = rng(117);
    for distribution in DISTRIBUTIONS {
        for alpha in ALPHAS {
            for (name, bsdf) in kinds(alpha, distribution) {
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
                        // The delta lobe of the same kind leads back with the same flux.
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

fn close(a: f32, b: f32) -> bool {
    (a - b).abs() <= 1e-3 * a.abs().max(b.abs()) || (a - b).abs() < 1e-30
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

/// Total light that a surface reflects and transmits, from `n` samples.
fn scattered(bsdf: &Bsdf, alpha: f32, wo: Vec3, n: usize) -> [Rgb; 2] {
    let mut rng = rng(150);
    let mut sums = [Rgb::ZERO; 2];
    for _ in 0..n {
        if let Some(s) = bsdf.sample(alpha, wo, numbers(&mut rng)) {
            sums[usize::from(s.wi.z * wo.z < 0.0)] += s.weight / n as f32;
        }
    }
    sums
}

#[test]
fn translucent_surface_reflects_and_transmits_what_it_says() {
    let (albedo, through) = (Rgb::new(0.5, 0.4, 0.1), Rgb::new(0.3, 0.5, 0.9));
    let base = Bsdf::Diffuse(Diffuse { albedo });
    let near = |found: Rgb, expected: Rgb| {
        let far = (found - expected).abs().max_element();
        assert!(far < 4e-3, "{found} {expected}");
    };
    let glossy = |alpha: f32| Glossy {
        f0: Rgb::splat(0.04),
        f90: 1.0,
        albedo,
        alpha,
        distribution: Distribution::Ggx,
    };
    for degrees in [5.0, 50.0, 80.0] {
        for side in [1.0, -1.0] {
            let wo = at(degrees) * side;
            let [back, front] = [through, albedo];
            let [reflected, transmitted] = scattered(&translucent(base, back), 1.0, wo, 200_000);
            near(reflected, front);
            near(transmitted, back);
            // Under a smooth coat of reflectance F the base keeps 1 − F of both.
            let f = 0.04 + 0.96 * (1.0 - wo.z.abs()).powi(5);
            let coated = translucent(Bsdf::Glossy(glossy(0.0)), through);
            let [reflected, transmitted] = scattered(&coated, 0.0, wo, 400_000);
            near(reflected, Rgb::splat(f) + (1.0 - f) * front);
            near(transmitted, (1.0 - f) * back);
        }
    }
    // Without transmission the surface is unchanged; a surface that would gain energy is scaled.
    assert!(matches!(translucent(base, Rgb::ZERO), Bsdf::Diffuse(_)));
    let bright = translucent(base, Rgb::ONE).reflectance();
    assert!((bright.max_element() - 1.0).abs() < 1e-6, "{bright}");
}
