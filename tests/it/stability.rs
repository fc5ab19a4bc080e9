//! Hard numerical cases: the checks of `opsr verify` hold, and they find planted faults.
//!
//! Numbers are those of `docs/numerics.md`. Other cases have tests of their own: 13 in `metric`, 14 in `load`, 15 in
//! `stability_train`.

use crate::support::draws::{numbers, rng};
use crate::support::scenes::two_mirrors;
use crate::support::{self, assert_likely};
use opsr::image::Film;
use opsr::integrator::{self, PathObserver, Recorder, Settings, ShadingPoint};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::regularise::{AttenuationTable, MAX_VERTICES, Roughening, Rule};
use opsr::sampler::{Independent, Seed};
use opsr::scene::{Scene, SceneParts};
use opsr_lab::gallery::materials::{diffuse, emitter};
use opsr_lab::gallery::shapes;
use opsr_lab::verify::bsdfs::{DISTRIBUTIONS, at, glass};
use opsr_lab::verify::density::DensityTest;
use opsr_lab::verify::{Finding, NUMERIC, Size, lights, lobes, roughness, transport, weights};

/// Requires that a case of `opsr verify` holds.
fn holds(name: &str) {
    let case = NUMERIC.iter().find(|c| c.name == name).expect(name);
    support::holds(case.run(Size::Tiny));
}

/// Requires that a check fails for the faulty implementation in its argument.
fn found(finding: Finding) {
    eprintln!("planted: {finding:?}");
    assert!(!finding.holds(), "not found: {finding:?}");
}

#[test]
fn nan_never_holds() {
    let finding = Finding {
        tried: "nothing".into(),
        worst: f64::NAN,
        bound: f64::INFINITY,
    };
    assert!(!finding.holds());
    found(weights::sums(&|_, _| f32::NAN));
}

#[test]
fn case_1_the_dirac_bound() {
    holds("Dirac bound");
    found(lobes::dirac_bound(&|bsdf, alpha, wo, u| {
        Some(bsdf.sample(1.05 * alpha, wo, u)?.delta)
    }));
}

/// Records the vertices of paths.
#[derive(Default)]
struct Witness {
    deepest: u32,
    /// Roughness at next-event estimation, by vertex.
    roughened: Vec<(u32, f32)>,
    scattered: Vec<f32>,
}

impl PathObserver for Witness {
    fn vertex(&mut self, n: u32, _: f32, point: &ShadingPoint<'_>) {
        self.deepest = self.deepest.max(n);
        self.roughened.push((n, point.alpha_reg));
    }

    fn scattered(&mut self, alpha: f32) {
        self.scattered.push(alpha);
    }
}

impl Recorder for Witness {
    fn fork(&self) -> Self {
        Self::default()
    }

    fn join(&mut self, tile: Self) {
        self.deepest = self.deepest.max(tile.deepest);
        self.roughened.extend(tile.roughened);
        self.scattered.extend(tile.scattered);
    }
}

fn witness(parts: SceneParts, rule: impl Roughening) -> Witness {
    let scene = Scene::new(parts);
    let (mut film, mut witness) = (Film::new(UVec2::splat(8)), Witness::default());
    let view = integrator::View::of(&scene, &scene.parts().cameras[0], &film);
    Settings::default().tracer(rule).estimate(
        &view,
        &Independent { seed: Seed(1) },
        0..4,
        &mut film,
        &mut witness,
    );
    assert_eq!(film.rejected.total(), 0);
    witness
}

#[test]
fn case_1_delta_lobes_keep_their_roughness_in_the_path() {
    let seen = witness(two_mirrors(1.0, 5e-4), Rule::constant(1.0));
    // The wall at the end of the path is diffuse.
    assert!(seen.scattered.iter().all(|&a| a == 5e-4 || a == 1.0));
    for (n, alpha) in seen.roughened.iter().filter(|(n, a)| *n <= 5 && *a < 1.0) {
        // 1 − (1 − α)ⁿ above the Dirac bound.
        let sum = 1.0 - (1.0f64 - 5e-4).powi(*n as i32);
        let expected = if sum < 1e-3 { 5e-4 } else { sum };
        assert!(
            (f64::from(*alpha) / expected - 1.0).abs() < 1e-5,
            "{n}: {alpha}"
        );
    }
    assert!(seen.roughened.iter().any(|(_, alpha)| *alpha > 1e-3));
}

#[test]
fn case_2_sampling_at_extreme_random_numbers() {
    holds("lobe sampling");
    found(lobes::samples(&|bsdf, alpha, wo, wi| {
        let eval = bsdf.eval(alpha * 1.0005, wo, wi);
        (eval.value, eval.pdf_w)
    }));
}

#[test]
fn cases_3_to_5_path_roughness() {
    holds("path roughness");
}

#[test]
fn case_3_cancellation_in_the_printed_form() {
    let printed = |alphas: &[f32], table: &AttenuationTable| {
        let (last, before) = alphas.split_last().unwrap();
        let gamma = table.gammas[0];
        1.0 - (1.0 - last) * before.iter().map(|a| 1.0 - gamma * a).product::<f32>()
    };
    found(roughness::small_roughness(&printed));
    found(roughness::zeros(&printed));
}

#[test]
fn case_4_bin_edges_off_by_an_ulp() {
    let edges = [0.069_187_2, 0.235_639_2, 0.459_781_5];
    found(roughness::bins(&|alpha| {
        edges.iter().filter(|&&e| alpha >= e).count()
    }));
    found(roughness::bins(&|alpha: f32| {
        (((alpha.max(0.0).sqrt().exp2() - 1.0) * 5.0) as usize).min(3)
    }));
}

#[test]
fn case_5_truncating_instead_of_folding() {
    found(roughness::folding(&|alphas, table| {
        let recent = &alphas[alphas.len().saturating_sub(MAX_VERTICES)..];
        roughness::accumulate(recent, table)
    }));
}

#[test]
fn case_6_mis_weights_of_extreme_densities() {
    holds("MIS weights");
    found(weights::sums(&|p, q| p / (p + q)));
}

#[test]
fn case_7_light_sampling_near_and_far() {
    holds("lights near and far");
    // A shadow ray that ends exactly on the light hits it.
    found(lights::occluded(&|surface, light| {
        let mut ray = surface.spawn_to_light(light);
        ray.t_max = light.distance;
        ray
    }));
}

#[test]
fn case_8_fresnel_and_interfaces() {
    holds("interfaces");
    found(lobes::reflectance(&|cos, eta| {
        // Angle of refraction by inverse trigonometric functions.
        let transmitted = ((1.0 - cos * cos).sqrt() / eta).asin();
        if transmitted.is_nan() {
            return 1.0;
        }
        let cos_t = transmitted.cos();
        let s = (cos - eta * cos_t) / (cos + eta * cos_t);
        let p = (eta * cos - cos_t) / (eta * cos + cos_t);
        0.5 * (s * s + p * p)
    }));
}

#[test]
fn case_8_chi_square_of_weak_and_strong_interfaces() {
    let mut rng = rng(300);
    let mut p_values = Vec::new();
    for distribution in DISTRIBUTIONS {
        for index in [0.7f32, 1.001, 1.01, 1.05, 3.0] {
            for alpha in [1e-3, 0.01, 0.1, 0.5] {
                // A refracted lobe is α |η − 1| wide; single precision resolves directions to 1e-7.
                if alpha * (index - 1.0).abs() < 9e-6 {
                    continue;
                }
                for (degrees, side) in [(0.0, 1.0), (45.0, -1.0), (80.0, 1.0)] {
                    let (bsdf, wo) = (glass(index, alpha, distribution), at(degrees) * side);
                    let p = DensityTest { bsdf, alpha, wo }.p_value(20_000, || numbers(&mut rng));
                    p_values.push((p, format!("{index} {distribution:?} {alpha} {degrees}")));
                }
            }
        }
    }
    assert_likely(&p_values);
}

#[test]
fn cases_9_and_10_light_leaks() {
    holds("closed bodies");
    found(transport::leak(true));
    found(transport::covered(false));
}

#[test]
fn case_10_scale_invariance() {
    holds("scale of the scene");
}

#[test]
fn case_11_russian_roulette_is_unbiased() {
    holds("Russian roulette");
}

#[test]
fn case_11_zero_throughput_ends_the_path() {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, front] =
        shapes::room(Vec3::splat(-1.0), Vec3::splat(1.0));
    parts.add(
        diffuse("black", Rgb::ZERO),
        [left, right, floor, back, front],
    );
    parts.add(emitter("light", Rgb::ONE), [ceiling]);
    parts.add_camera([0.0, 0.0, 0.0], [0.0, 0.0, -1.0], 90.0);
    assert_eq!(witness(parts, Rule::Plain).deepest, 1);
}

#[test]
fn case_12_welford_variance() {
    holds("running moments");
    // Sums of squares in single precision.
    found(weights::spread(&|samples| {
        let (mut sum, mut squares) = (0.0f32, 0.0f32);
        for &x in samples {
            sum += x as f32;
            squares += (x * x) as f32;
        }
        let n = samples.len() as f32;
        let mean = sum / n;
        (f64::from(mean), f64::from(squares / n - mean * mean))
    }));
}

#[test]
fn case_14_empty_scenes_are_black() {
    holds("empty scenes");
}
