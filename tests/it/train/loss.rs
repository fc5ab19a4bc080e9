//! The loss and its derivative: automatic differentiation, the formula, and the scalar implementation.

use opsr_train::evaluate::{Adjoint, Moments};
use opsr_train::learn::loss::{LossBackend, Objective};
use opsr_train::record::target::{BRIGHTNESS, EPSILON, Target};
use rand::{RngExt, SeedableRng};

#[test]
fn gradient_of_the_loss_by_autodiff_matches_the_formula() {
    let targets: Vec<Target> = (0..2)
        .map(|k| Target {
            reference: (0..5)
                .map(|p| [0.1 * p as f32 + 0.05, 0.3, 0.7 + k as f32])
                .collect(),
            samples: 64,
        })
        .collect();
    let moments: Vec<Moments> = (0..2)
        .map(|k| Moments {
            mean: (0..5)
                .map(|p| [0.2, 0.07 * p as f32, 0.9 + 0.3 * k as f32])
                .collect(),
            second: (0..5).map(|p| 2.0 + p as f32).collect(),
        })
        .collect();
    let beta = 0.03;
    let targets_of_all: Vec<&Target> = targets.iter().collect();
    let objective = Objective::new(&targets_of_all, beta, LossBackend::Autodiff);
    let (losses, adjoints): (Vec<f32>, Vec<Adjoint>) = (moments.iter().enumerate())
        .map(|(crop, moments)| objective.evaluate(crop, moments))
        .unzip();
    let loss: f32 = losses.iter().sum();
    let n = 30.0;
    let mut expected = 0.0;
    for ((target, moment), adjoint) in targets.iter().zip(&moments).zip(&adjoints) {
        let scale = target.scale();
        let mean: f32 = target.reference.iter().flatten().sum::<f32>() / 15.0;
        assert!((scale * mean - BRIGHTNESS).abs() < 1e-6);
        for p in 0..5 {
            let bessel = 64.0 / 63.0;
            expected += beta * bessel * scale * scale * moment.second[p] / n;
            for c in 0..3 {
                let (i, f) = (scale * moment.mean[p][c], scale * target.reference[p][c]);
                expected += ((i - f).abs() / (f + EPSILON) - beta * bessel * i * i) / n;
                let derivative = (i - f).signum() / (f + EPSILON) - 2.0 * beta * bessel * i;
                assert!((adjoint.mean[p][c] - scale * derivative / n).abs() < 1e-6);
            }
            assert!((adjoint.second[p] - beta * bessel * scale * scale / n).abs() < 1e-8);
        }
    }
    assert!(
        (loss - expected).abs() < 1e-5 * expected,
        "{loss} {expected}"
    );
}

#[test]
fn gradient_of_the_loss_by_scalars_is_bit_identical_to_autodiff() {
    let mut rng = rand_pcg::Pcg32::seed_from_u64(11);
    let mut number = || (rng.random::<f32>() * 12.0 - 10.0).exp();
    for beta in [1e-6, 0.001, 0.05, 3.0] {
        let target = Target {
            reference: (0..1024).map(|_| [0; 3].map(|_| number())).collect(),
            samples: 1024,
        };
        let mut moments = Moments {
            mean: (0..1024).map(|_| [0; 3].map(|_| number())).collect(),
            second: (0..1024).map(|_| number()).collect(),
        };
        // Pixels without error, at the jump of the derivative, and black pixels.
        moments.mean[..32].copy_from_slice(&target.reference[..32]);
        moments.mean[32..64].fill([0.0; 3]);
        moments.second[32..64].fill(0.0);
        let black = Target {
            reference: vec![[0.0; 3]; 1024],
            samples: 2,
        };
        for target in [&target, &black] {
            let evaluate =
                |backend| Objective::new(&[target, target], beta, backend).evaluate(1, &moments);
            let (autodiff_loss, autodiff) = evaluate(LossBackend::Autodiff);
            let (scalar_loss, scalar) = evaluate(LossBackend::Scalar);
            assert!(autodiff.mean.iter().flatten().any(|&d| d != 0.0));
            for (p, pair) in autodiff.mean.iter().zip(&scalar.mean).enumerate() {
                assert_eq!(pair.0, pair.1, "{beta}: pixel {p}");
            }
            assert!(autodiff.second == scalar.second, "{beta}");
            // The order of summation differs.
            assert!(
                (scalar_loss - autodiff_loss).abs() <= 1e-5 * autodiff_loss.abs(),
                "{beta}"
            );
        }
    }
}
