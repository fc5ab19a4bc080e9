use super::*;
use rand::{RngExt, SeedableRng};

#[test]
fn grid_steps_lie_near_their_factors() {
    for k in 0..=1000 {
        let gamma = GAMMA_MIN.powf(1.0 - k as f32 / 1000.0);
        let found = GridStep::nearest(gamma).gamma();
        assert!((found / gamma).ln().abs() < 0.51 * spacing() as f32 / STEPS_PER_NODE as f32);
    }
    for bound in [GAMMA_MIN, 1.0] {
        assert!((GridStep::nearest(bound).gamma() / bound - 1.0).abs() < 1e-6);
    }
    assert_eq!(GridStep::nearest(0.0), GridStep::nearest(GAMMA_MIN));
    assert_eq!(GridStep::nearest(7.0), GridStep::nearest(1.0));
}

#[test]
fn cubics_in_ln_gamma_are_interpolated_exactly() {
    let cubic = |x: f64| 1.0 + x * (0.5 + x * (0.2 - 0.03 * x));
    let by_x = |x: f64| 0.5 + x * (0.4 - 0.09 * x);
    for k in 0..=333 {
        let gamma = 0.001f64.powf(1.0 - f64::from(k) / 333.0);
        let weights = HermiteWeights::at(coordinate(gamma));
        let ends = [weights.node, weights.node + 1].map(|k| node(k).ln());
        let knots = [
            cubic(ends[0]),
            by_x(ends[0]) * spacing(),
            cubic(ends[1]),
            by_x(ends[1]) * spacing(),
        ];
        let read = |weights: [f32; 4]| -> f64 {
            let terms = weights.iter().zip(knots);
            terms.map(|(w, k)| f64::from(*w) * k).sum()
        };
        let x = gamma.ln();
        assert!((read(weights.value) - cubic(x)).abs() < 1e-5, "{gamma}");
        let derivative = by_x(x) / gamma;
        let scale = (1.0 / gamma).max(derivative.abs());
        assert!(
            (read(weights.derivative) - derivative).abs() < 1e-4 * scale,
            "{gamma}"
        );
    }
}

#[test]
fn stored_knots_are_within_a_two_thousandth_of_their_scale() {
    let mut rng = rand_pcg::Pcg32::seed_from_u64(11);
    for exponent in [-30, -3, 0, 5, 30] {
        let size = 10f32.powi(exponent);
        let mut knots = [[0.0; 8]; NODES];
        for knot in &mut knots {
            *knot = std::array::from_fn(|_| (rng.random::<f32>() - 0.5) * size);
        }
        // A channel that is zero, and one with an overflow that the scale must leave out.
        knots
            .iter_mut()
            .for_each(|knot| (knot[1], knot[5]) = (0.0, 0.0));
        knots[3][2] = f32::INFINITY;
        let scales = scales(&knots);
        for (k, pair) in knots.windows(2).enumerate() {
            let weights = HermiteWeights::at(k as f64 + rng.random::<f64>()).value;
            let [left, right] = [&pair[0], &pair[1]].map(|knot| store(knot, &scales));
            let found = interpolate(&left, &right, &scales, weights);
            for c in (0..4).filter(|&c| c != 2 || !(2..=3).contains(&k)) {
                let terms = [pair[0][c], pair[0][4 + c], pair[1][c], pair[1][4 + c]];
                let exact: f32 = terms.iter().zip(weights).map(|(t, w)| t * w).sum();
                let most: f32 = weights.iter().map(|w| w.abs()).sum::<f32>() * scales[c];
                assert!(
                    (found[c] - exact).abs() <= most / 2000.0,
                    "{found:?} {exact}"
                );
            }
        }
    }
}
