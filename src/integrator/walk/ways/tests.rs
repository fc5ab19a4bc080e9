use super::*;
use crate::bsdf::{Dielectric, Distribution};
use crate::math::Rgb;

/// All ways through interfaces are taken once, whichever is drawn first, and their probabilities add up to 1.
#[test]
fn ways_are_all_leaves_of_a_tree() {
    let glass = Bsdf::Dielectric(Dielectric {
        eta: 1.5,
        tint: Rgb::ONE,
        alpha: 0.0,
        distribution: Distribution::Beckmann,
    });
    let wo = Vec3::new(0.99f32.sqrt(), 0.0, 0.1);
    for drawn in [0.0, 0.999] {
        let (mut ways, mut sum, mut seen) = (Ways::all(), 0.0, Vec::new());
        loop {
            let lobes = [(); MAX_FORKS].map(|()| {
                let [choice, ..] = ways.choose(&glass, 0.0, wo, [drawn; 3]);
                glass.sample(0.0, wo, [choice, 0.5, 0.5]).map(|s| s.lobe)
            });
            assert!(!seen.contains(&lobes), "{lobes:?} twice");
            seen.push(lobes);
            sum += ways.share();
            if !ways.turn() {
                break;
            }
        }
        assert_eq!(seen.len(), 1 << MAX_FORKS);
        assert!((sum - 1.0f32).abs() < 1e-6, "{sum}");
    }
}
