//! BSDFs against textbook formulas: values, reciprocity and energy conservation.

use crate::support::draws::{direction, numbers, rng};
use opsr::bsdf::{Bsdf, Distribution, Glossy, Lobe, ThinDielectric};
use opsr::math::{DVec3, Rgb, Vec3};
use opsr_lab::verify::bsdfs::{DISTRIBUTIONS, at, glass, metal, pane, plastic};
use opsr_lab::verify::lobes::polarisations;
use rand::RngExt;
use rand_pcg::Pcg32;
use std::f64::consts::PI;

/// Microfacet formulas as printed, in cosines and double precision.
struct Textbook {
    distribution: Distribution,
    alpha: f64,
}

impl Textbook {
    fn d(&self, cos: f64) -> f64 {
        let a2 = self.alpha * self.alpha;
        let tan2 = (1.0 - cos * cos) / (cos * cos);
        match self.distribution {
            Distribution::Beckmann => (-tan2 / a2).exp() / (PI * a2 * cos.powi(4)),
            Distribution::Ggx => a2 / (PI * (cos * cos * (a2 - 1.0) + 1.0).powi(2)),
            Distribution::HenyeyGreenstein => unreachable!("no slopes"),
        }
    }

    fn lambda(&self, cos: f64) -> f64 {
        let a = cos.abs() / (self.alpha * (1.0 - cos * cos).sqrt());
        match self.distribution {
            Distribution::Beckmann => -0.5 * libm::erfc(a) + (-a * a).exp() / (2.0 * a * PI.sqrt()),
            Distribution::Ggx => 0.5 * ((1.0 + 1.0 / (a * a)).sqrt() - 1.0),
            Distribution::HenyeyGreenstein => unreachable!("no slopes"),
        }
    }

    /// f |cos θ_i| of an interface without its colour: Walter et al. (20) and (21), the latter for radiance, with this
    /// project's height-correlated masking. The index on `wo`'s side is 1.
    fn interface(&self, wo: DVec3, wi: DVec3, eta: f64) -> f64 {
        let through = wi.z < 0.0;
        let h = if through { -(wo + eta * wi) } else { wo + wi };
        let h = h.normalize() * h.z.signum();
        let (oh, ih) = (wo.dot(h), wi.dot(h));
        if oh <= 0.0 || (ih < 0.0) != through {
            return 0.0;
        }
        let g2 = 1.0 / (1.0 + self.lambda(wo.z) + self.lambda(wi.z));
        let f = polarisations(oh, eta);
        if through {
            (1.0 - f) * oh * ih.abs() * self.d(h.z) * g2 / (wo.z * (oh + eta * ih).powi(2))
        } else {
            f * self.d(h.z) * g2 / (4.0 * wo.z)
        }
    }
}

/// A pair of directions: `wi` is a sample of the lobe, or from the whole sphere.
fn pair(rng: &mut Pcg32, bsdf: &Bsdf, alpha: f32) -> (Vec3, Vec3) {
    let wo = at(89.0 * rng.random::<f32>()) * if rng.random() { 1.0 } else { -1.0 };
    let drawn = bsdf.sample(alpha, wo, numbers(rng)).map(|s| s.wi);
    let wi = if rng.random_range(0..8) == 0 {
        direction(rng)
    } else {
        drawn.unwrap_or(-wo)
    };
    (wo, wi)
}

#[test]
fn textbook_values_of_interfaces() {
    let mut rng = rng(200);
    let mut seen = [0; 2];
    for i in 0..40_000 {
        let distribution = DISTRIBUTIONS[i % 2];
        let alpha = 0.01f32.powf(rng.random());
        let textbook = Textbook {
            distribution,
            alpha: alpha.into(),
        };
        let index = [1.5f32, 1.1, 2.4, 0.8][i % 4];
        for (bsdf, mirror) in [
            (glass(index, alpha, distribution), false),
            (metal(alpha, distribution), true),
        ] {
            let (wo, wi) = pair(&mut rng, &bsdf, alpha);
            let value = f64::from(bsdf.eval(alpha, wo, wi).value.x);
            let eta = f64::from(if wo.z > 0.0 { index } else { 1.0 / index });
            let side = f64::from(wo.z.signum());
            let (o, w) = (wo.as_dvec3().normalize(), wi.as_dvec3().normalize());
            let (o, w) = (o * side, w * side);
            let expected = match mirror {
                true if w.z <= 0.0 => 0.0,
                // Total reflection.
                true => textbook.interface(o, w, 1e-9),
                false => textbook.interface(o, w, eta),
            };
            // In single precision tan² has about five digits at α = 0.01.
            assert!(
                (value - expected).abs() <= 2e-3 * expected + 1e-7,
                "{bsdf:?} {wo:?} {wi:?}: {value} {expected}"
            );
            seen[usize::from(w.z < 0.0)] += usize::from(expected > 1e-3);
        }
    }
    assert!(seen.iter().all(|&n| n > 10_000), "{seen:?}");
}

#[test]
fn reciprocity_of_every_bsdf() {
    let mut rng = rng(210);
    let mut seen = 0;
    for i in 0..40_000 {
        let d = DISTRIBUTIONS[i % 2];
        let alpha = 1e-3f32.powf(rng.random());
        for bsdf in [
            metal(alpha, d),
            plastic(alpha, d),
            glass(1.5, alpha, d),
            glass(1.05, alpha, d),
            pane(alpha, d),
        ] {
            let (wo, wi) = pair(&mut rng, &bsdf, alpha);
            // f(o, i) / n_o² = f(i, o) / n_i² [Veach97 (5.14)].
            let ratio = if wo.z * wi.z < 0.0 {
                bsdf.refraction_scale(wo)
            } else {
                1.0
            };
            let there = bsdf.eval(alpha, wo, wi).value / wi.z.abs() * ratio;
            let back = bsdf.eval(alpha, wi, wo).value / wo.z.abs();
            for c in 0..3 {
                // Half vectors of a refraction by 1.05 lose digits.
                let tolerance = 2e-3 * there[c].max(back[c]) + 1e-6;
                assert!(
                    (there[c] - back[c]).abs() <= tolerance,
                    "{bsdf:?} {wo:?} {wi:?}: {there} {back}"
                );
            }
            seen += usize::from(there.x > 1e-3);
        }
    }
    assert!(seen > 100_000, "{seen}");
}

/// Mean energy of a sample (the BSDF's albedo, green), its standard error, and the largest energy of a sample. A
/// refracted weight is a factor of radiance and is scaled back to energy.
fn albedo(rng: &mut Pcg32, bsdf: &Bsdf, alpha: f32, wo: Vec3, draws: u32) -> [f64; 3] {
    let (mut moments, mut largest) = ([0.0; 2], 0.0f64);
    for _ in 0..draws {
        let Some(s) = bsdf.sample(alpha, wo, numbers(rng)) else {
            continue;
        };
        let scale = match s.lobe {
            Lobe::Transmission => bsdf.refraction_scale(wo),
            _ => 1.0,
        };
        let energy = f64::from(s.weight.y * scale);
        moments[0] += energy;
        moments[1] += energy * energy;
        largest = largest.max(energy);
    }
    let [mean, square] = moments.map(|m| m / f64::from(draws));
    let error = ((square - mean * mean).max(0.0) / f64::from(draws)).sqrt();
    [mean, error, largest]
}

#[test]
fn energy_conservation_of_interfaces() {
    const DRAWS: u32 = 4000;
    let mut rng = rng(220);
    for distribution in DISTRIBUTIONS {
        for degrees in [0.0, 30.0, 60.0, 80.0, 89.0, 89.99] {
            for alpha in [0.0, 1e-3, 3e-3, 0.01, 0.1, 0.3, 1.0] {
                for (bsdf, side) in [
                    (metal(alpha, distribution), 1.0),
                    (glass(1.5, alpha, distribution), 1.0),
                    (glass(1.5, alpha, distribution), -1.0),
                    (glass(1.001, alpha, distribution), 1.0),
                ] {
                    let [kept, _, largest] =
                        albedo(&mut rng, &bsdf, alpha, at(degrees) * side, DRAWS);
                    let say = format!("{bsdf:?} {degrees} {side}: {kept}");
                    // With visible normals a single sample has the weight G2/G1, at most 1.
                    assert!(largest <= 1.0 + 1e-4, "{say} {largest}");
                    // Masking loses energy, most at rough and grazing lobes.
                    let masked = f64::from(alpha * degrees.to_radians().tan());
                    let least = if masked < 0.05 {
                        0.999 - f64::from(alpha)
                    } else {
                        0.0
                    };
                    assert!(kept >= least, "{say}");
                }
            }
        }
    }
}

#[test]
fn energy_conservation_of_a_coat_over_its_base() {
    let mut rng = rng(230);
    for distribution in DISTRIBUTIONS {
        for alpha in [0.0, 1e-3, 0.1, 0.2, 0.3, 1.0] {
            for degrees in [0.0, 30.0, 55.0, 70.0, 85.0, 89.9] {
                for (f0, f90) in [
                    (0.0, 1.0),
                    (0.04, 1.0),
                    (0.3, 1.0),
                    (1.0, 1.0),
                    (0.004, 0.1),
                    (0.1, 0.5),
                ] {
                    let white = Bsdf::Glossy(Glossy {
                        f0: Rgb::splat(f0),
                        f90,
                        albedo: Rgb::ONE,
                        alpha,
                        distribution,
                    });
                    let [kept, error, _] = albedo(&mut rng, &white, alpha, at(degrees), 8000);
                    // The base is computed for a smooth coat; around α = 0.2 and 55° a rough coat reflects 0.6 % more.
                    let gain = if alpha < 0.01 { 1e-3 } else { 6e-3 };
                    assert!(
                        kept <= 1.0 + gain + 4.0 * error,
                        "{white:?} {degrees}: {kept}"
                    );
                    // A smooth coat over a white base preserves all energy.
                    assert!(
                        alpha > 0.0 || kept > 1.0 - 4.0 * error - 1e-6,
                        "{f0} {f90} {degrees}: {kept}"
                    );
                }
            }
        }
    }
}

/// Single scattering loses light, a roughened lobe more than the original; the numbers are in section 3 of the method.
#[test]
fn white_furnace_of_roughened_lobes() {
    const ANGLES: [f32; 3] = [0.0, 60.0, 80.0];
    let mut rng = rng(240);
    let beckmann = Distribution::Beckmann;
    // α′, then the albedo at each angle: metal, into glass, out of glass.
    for (alpha_reg, expected) in [
        (
            0.1,
            [[1.00, 1.00, 0.94], [1.00, 1.00, 0.96], [1.00, 1.00, 0.94]],
        ),
        (
            0.3,
            [[1.00, 0.92, 0.92], [1.00, 0.98, 0.95], [1.00, 0.88, 0.92]],
        ),
        (
            0.5,
            [[0.94, 0.87, 0.93], [1.00, 0.96, 0.96], [0.96, 0.77, 0.90]],
        ),
        (
            1.0,
            [[0.46, 0.77, 0.92], [0.97, 0.91, 0.88], [0.54, 0.64, 0.64]],
        ),
    ] {
        let thin = Bsdf::Thin(ThinDielectric {
            f0: Rgb::splat(0.04),
            f90: 1.0,
            eta: 0.0,
            tint: Rgb::ONE,
            alpha: 0.0,
            distribution: beckmann,
        });
        for (bsdf, side, expected) in [
            (metal(0.0, beckmann), 1.0, expected[0]),
            (thin, 1.0, expected[0]),
            (glass(1.5, 0.0, beckmann), 1.0, expected[1]),
            (glass(1.5, 0.0, beckmann), -1.0, expected[2]),
        ] {
            for (degrees, expected) in ANGLES.into_iter().zip(expected) {
                let [kept, error, _] =
                    albedo(&mut rng, &bsdf, alpha_reg, at(degrees) * side, 20_000);
                assert!(
                    (kept - expected).abs() < 0.006 + 4.0 * error,
                    "{bsdf:?} at {alpha_reg}, {degrees}: {kept}, not {expected}"
                );
            }
        }
    }
}
