//! Lobes near the Dirac bound, at extreme random numbers, at the horizon and at the critical angle.

use super::bsdfs::{DISTRIBUTIONS, coat, glass, metal};
use super::{Finding, Numbers, transport};
use opsr::bsdf::{Bsdf, DELTA_ALPHA, Distribution, Lobe, ThinDielectric, fresnel};
use opsr::math::{Rgb, Vec3};

const DRAWS: usize = 100_000;

fn bsdfs(alpha: f32, distribution: Distribution) -> [Bsdf; 5] {
    [
        metal(alpha, distribution),
        coat(Rgb::splat(0.8), alpha, distribution),
        glass(1.5, alpha, distribution),
        glass(3.0, alpha, distribution),
        Bsdf::Thin(ThinDielectric {
            f0: Rgb::splat(0.1),
            f90: 1.0,
            eta: 0.0,
            tint: Rgb::ONE,
            alpha,
            distribution,
        }),
    ]
}

fn distribution(i: usize) -> Distribution {
    DISTRIBUTIONS[i % 2]
}

/// Direction on either side of the surface.
fn direction(numbers: &mut Numbers) -> Vec3 {
    let w = numbers.above();
    if numbers.next() < 0.5 { w } else { -w }
}

pub(super) fn dirac() -> Vec<Finding> {
    vec![
        dirac_bound(&|bsdf, alpha, wo, u| Some(bsdf.sample(alpha, wo, u)?.delta)),
        transport::mean_across_the_dirac_bound(),
    ]
}

/// True if a sample of a BSDF at a roughness is a Dirac delta; `None` where sampling fails.
pub type IsDelta<'a> = &'a dyn Fn(&Bsdf, f32, Vec3, [f32; 3]) -> Option<bool>;

/// Counts violations: below α = 1e-3 every glossy sample is a delta and `eval` is zero, from 1e-3 on neither.
pub fn dirac_bound(is_delta: IsDelta<'_>) -> Finding {
    let mut numbers = Numbers::new(20);
    let mut wrong = 0;
    for (alpha, expected) in [
        (0.0, true),
        (1e-8, true),
        (1e-4, true),
        (9.9e-4, true),
        (DELTA_ALPHA.next_down(), true),
        (DELTA_ALPHA, false),
        (1.01e-3, false),
        (1e-2, false),
    ] {
        for i in 0..2000 {
            let (wo, u) = (numbers.above(), numbers.ends());
            // The BSDFs without a diffuse base.
            for bsdf in [0, 2, 3, 4].map(|k| bsdfs(alpha, distribution(i))[k]) {
                wrong += usize::from(is_delta(&bsdf, alpha, wo, u).is_some_and(|d| d != expected));
                let mirrored = bsdf.eval(alpha, wo, Vec3::new(-wo.x, -wo.y, wo.z));
                wrong += usize::from((mirrored.value == Rgb::ZERO) != expected);
            }
        }
    }
    Finding::new(
        "samples and values on the wrong side of the Dirac bound",
        0.0,
        [wrong as f64],
    )
}

pub(super) fn sampling() -> Vec<Finding> {
    vec![samples(&|bsdf, alpha, wo, wi| {
        let eval = bsdf.eval(alpha, wo, wi);
        (eval.value, eval.pdf_w)
    })]
}

/// Value and density of a BSDF at a roughness for a pair of directions.
pub type Evaluate<'a> = &'a dyn Fn(&Bsdf, f32, Vec3, Vec3) -> (Rgb, f32);

/// Weight and density of samples against an evaluation of the sampled direction. Roughness is from 1e-3 to 1, random
/// numbers are at 0 and just below 1, directions up to 1e-5 from the horizon.
pub fn samples(evaluate: Evaluate<'_>) -> Finding {
    let mut numbers = Numbers::new(21);
    let mut errors = Vec::new();
    for i in 0..DRAWS {
        let alpha = numbers.logarithmic(1e-3, 1.0).max(1e-3) as f32;
        let (wo, u) = (direction(&mut numbers), numbers.ends());
        let bsdf = bsdfs(alpha, distribution(i))[i % 5];
        let Some(sample) = bsdf.sample(alpha, wo, u) else {
            // Small Gaussian slopes never reflect a steep direction below the horizon, so a failure is an error. A
            // diffuse sample may lie on the horizon.
            let glossy = distribution(i) == Distribution::Beckmann && i % 5 != 1;
            if glossy && wo.z > 0.9 && alpha < 0.05 {
                errors.push(f64::NAN);
            }
            continue;
        };
        let (value, pdf_w) = evaluate(&bsdf, alpha, wo, sample.wi);
        let (value, weight) = (f64::from(value.y / pdf_w), f64::from(sample.weight.y));
        errors.push((value - weight).abs() / weight.max(1e-6));
        errors.push((f64::from(pdf_w) / f64::from(sample.pdf_w) - 1.0).abs());
        errors.push((f64::from(sample.wi.length()) - 1.0).abs());
    }
    Finding::new(
        "sample against eval: weight, density, length; none fails",
        1e-4,
        errors,
    )
}

pub(super) fn interfaces() -> Vec<Finding> {
    let mut findings = vec![reflectance(&fresnel::dielectric), smooth(), equal()];
    findings.extend(transport::weak_interfaces());
    findings
}

/// Reflectance of a smooth interface by Fresnel's equations for both polarisations and Snell's law, in double precision.
pub fn polarisations(cos: f64, eta: f64) -> f64 {
    let sin2 = (1.0 - cos * cos) / (eta * eta);
    if sin2 >= 1.0 {
        return 1.0;
    }
    let cos_t = (1.0 - sin2).sqrt();
    let s = (cos - eta * cos_t) / (cos + eta * cos_t);
    let p = (eta * cos - cos_t) / (eta * cos + cos_t);
    0.5 * (s * s + p * p)
}

/// Reflectance at cosines down to 1e-6 and around the critical angle, for indices 1/3 to 3 and 1 ± 1e-4.
///
/// At the critical angle the reflectance has a vertical tangent. Its change over a few bits of the cosine is therefore
/// allowed, too.
pub fn reflectance(fresnel: &dyn Fn(f32, f32) -> f32) -> Finding {
    let mut numbers = Numbers::new(22);
    let errors = (0..DRAWS).map(|i| {
        let eta: f32 = [1.5, 1.0 / 1.5, 3.0, 1.0 / 3.0, 1.0001, 0.9999, 1.33, 1.0][i % 8];
        let edge = (1.0 - f64::from(eta).powi(2)).max(0.0).sqrt();
        let cos = match numbers.below(3) {
            0 => numbers.next(),
            1 => numbers.logarithmic(1e-6, 1.0) as f32,
            _ => (edge * (1.0 + numbers.logarithmic(1e-8, 1e-2))) as f32,
        };
        let cos = cos.clamp(1e-6, 1.0);
        let (c, e) = (f64::from(cos), f64::from(eta));
        let (low, high) = (c * (1.0 - 2.5e-7), (c * (1.0 + 2.5e-7)).min(1.0));
        let change = (polarisations(low, e) - polarisations(high, e)).abs();
        let found = f64::from(fresnel(cos, eta));
        ((found - polarisations(c, e)).abs() - change).max(found - 1.0)
    });
    Finding::new(
        "error of the reflectance beyond its change at cos ± 2.5e-7",
        2e-6,
        errors,
    )
}

/// Energy conservation of a smooth interface: a reflected sample has weight 1, a refracted one (1/η)²; Snell's law.
fn smooth() -> Finding {
    let mut numbers = Numbers::new(23);
    let mut errors = Vec::new();
    for i in 0..DRAWS {
        let eta = [1.5, 3.0, 1.001, 1.33, 0.7][i % 5];
        let (bsdf, wo) = (
            glass(eta, 0.0, Distribution::Beckmann),
            direction(&mut numbers),
        );
        let Some(sample) = bsdf.sample(0.0, wo, numbers.ends()) else {
            errors.push(f64::NAN);
            continue;
        };
        let scale = match sample.lobe {
            Lobe::Transmission => bsdf.refraction_scale(wo),
            _ => 1.0,
        };
        errors.push(f64::from(sample.weight.y * scale - 1.0).abs());
        let sine = |w: Vec3| f64::from(w.x).hypot(f64::from(w.y));
        let bent = sine(sample.wi) * f64::from(scale).sqrt();
        errors.push((bent - sine(wo)).abs());
        errors.push((f64::from(sample.wi.length()) - 1.0).abs());
    }
    Finding::new(
        "smooth interface: energy − 1, Snell's law, length",
        1e-6,
        errors,
    )
}

/// An interface between equal indices transmits light straight on with weight 1, at any roughness and random number.
fn equal() -> Finding {
    let mut numbers = Numbers::new(24);
    let mut errors = Vec::new();
    for i in 0..DRAWS / 10 {
        let (eta, alpha) = ([1.0, 1.0001, 0.9999][i % 3], numbers.next());
        let (bsdf, wo) = (glass(eta, alpha, distribution(i)), direction(&mut numbers));
        match bsdf.sample(alpha, wo, numbers.ends()) {
            Some(s) => {
                errors.push(f64::from((s.wi + wo).length()));
                errors.push(f64::from((s.weight - Rgb::ONE).length()));
            }
            None => errors.push(f64::NAN),
        }
    }
    Finding::new("visibility of an interface of index 1", 0.0, errors)
}
