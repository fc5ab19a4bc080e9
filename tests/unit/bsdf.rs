//! Draws of BSDFs: their densities, and their directions apart from their values.

use crate::bsdf::SharedNumbers;
use crate::unit::lab::verify::bsdfs::{DISTRIBUTIONS, at, extremes, kinds};
use crate::unit::support::draws::{numbers, rng};

const ALPHAS: [f32; 6] = [0.0, 1e-3, 0.01, 0.1, 0.3, 1.0];
const ANGLES: [f32; 5] = [0.0, 30.0, 60.0, 80.0, 88.0];

#[test]
fn pdf_of_a_sample_is_its_density_both_ways() {
    let mut rng = rng(115);
    for distribution in DISTRIBUTIONS {
        for alpha in ALPHAS {
            for (i, bsdf) in extremes(alpha, distribution).into_iter().enumerate() {
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

#[test]
fn sample_is_direction_and_completion_with_the_value_of_eval() {
    let mut rng = rng(116);
    for distribution in DISTRIBUTIONS {
        for alpha in ALPHAS {
            for (name, bsdf) in kinds(alpha, distribution) {
                for k in 0..200 {
                    let wo = at(ANGLES[k % 5]) * if k % 2 == 0 { 1.0 } else { -1.0 };
                    let u = numbers(&mut rng);
                    let sample = bsdf.sample(alpha, wo, u);
                    let drawn = bsdf.direction(alpha, wo, u);
                    // Samples that share their numbers, first at another roughness.
                    let shared = SharedNumbers::new(u);
                    for alpha in [0.3, alpha] {
                        let alone = bsdf.direction(alpha, wo, u);
                        assert_eq!(bsdf.direction(alpha, wo, &shared), alone, "{name}");
                    }
                    let again = drawn.and_then(|(wi, lobe)| bsdf.sample_along(alpha, wo, wi, lobe));
                    assert_eq!(format!("{sample:?}"), format!("{again:?}"), "{name}");
                    let Some(s) = sample.filter(|s| !s.delta) else {
                        continue;
                    };
                    let value = bsdf.eval(alpha, wo, s.wi).value;
                    let far = (s.value - value).abs().max_element();
                    assert!(far <= 1e-5 * value.max_element(), "{name} {value}: {s:?}");
                }
            }
        }
    }
}
