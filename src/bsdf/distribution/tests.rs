use super::*;

#[test]
fn density_and_masking_are_finite_at_the_horizon() {
    for distribution in [Distribution::Beckmann, Distribution::Ggx] {
        for alpha in [1e-3f32, 0.1, 1.0] {
            for tan2 in [f32::INFINITY, f32::NAN] {
                assert_eq!(distribution.d(alpha, tan2), 0.0, "{distribution:?} {alpha}");
            }
            let steep = distribution.d(alpha, f32::MAX);
            assert!(
                steep.is_finite() && steep >= 0.0,
                "{distribution:?} {steep}"
            );
            let grazing = distribution.lambda(alpha, f32::INFINITY);
            assert!(grazing.is_finite() && grazing > 1e10, "{grazing}");
            assert_eq!(distribution.lambda(alpha, 0.0), 0.0);
        }
    }
}

#[test]
fn sample_visible_is_finite_for_every_random_number() {
    let ends = [0.0, f32::MIN_POSITIVE, 1e-8, 0.5, 1.0 - 6e-8, 1.0];
    for distribution in [Distribution::Beckmann, Distribution::Ggx] {
        for wo in [
            Vec3::Z,
            Vec3::new(0.6, -0.48, 0.64),
            Vec3::new(1.0, 0.0, 1e-6),
        ] {
            for u in ends.iter().flat_map(|&u| ends.map(|v| [u, v])) {
                let h = distribution.sample_visible(0.5, wo.normalize(), [0.5, u[0], u[1]]);
                assert!(h.is_finite(), "{distribution:?} {wo} {u:?}: {h}");
            }
        }
    }
}

#[test]
fn beckmann_lambda_of_f32_f64_and_dual_agree() {
    for i in 1..500 {
        let a = 0.01 * f64::from(i);
        let exact = a.beckmann_lambda();
        let dual = Dual::variable(a).beckmann_lambda();
        assert!(
            (f64::from((a as f32).beckmann_lambda()) - exact).abs() < 2e-7 * (1.0 + exact),
            "{a}"
        );
        assert!((dual.v - exact).abs() < 2e-7, "{a}");
        if a < 4.1 {
            let h = 1e-6;
            let numeric = ((a + h).beckmann_lambda() - (a - h).beckmann_lambda()) / (2.0 * h);
            assert!(
                (dual.d - numeric).abs() < 1e-6 * numeric.abs().max(1e-3),
                "{a}: {} {numeric}",
                dual.d
            );
        }
    }
}
