use super::*;

fn all(alpha: f32) -> [Bsdf; 5] {
    let distribution = Distribution::Ggx;
    let (f0, tint) = (Rgb::splat(0.04), Rgb::ONE);
    let glossy = |albedo| Glossy {
        f0,
        f90: 1.0,
        albedo,
        alpha,
        distribution,
    };
    let eta = 1.5;
    [
        Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE }),
        Bsdf::Glossy(glossy(Rgb::ZERO)),
        Bsdf::Glossy(glossy(Rgb::new(0.0, 0.0, 0.1))),
        Bsdf::Dielectric(Dielectric {
            eta,
            tint,
            alpha,
            distribution,
        }),
        Bsdf::Thin(ThinDielectric {
            f0,
            f90: 1.0,
            eta: 0.0,
            tint,
            alpha,
            distribution,
        }),
    ]
}

#[test]
fn roughness_kind_and_dirac_bound_of_each_bsdf() {
    let own = all(0.3).map(|b| b.alpha());
    assert_eq!(own, [1.0, 0.3, 0.3, 0.3, 0.3]);
    let solid = all(0.3).map(|b| b.is_solid());
    assert_eq!(solid, [false, false, false, true, false]);
    let below = all(0.3).map(|b| b.is_delta_at(DELTA_ALPHA.next_down()));
    assert_eq!(below, [false, true, false, true, true]);
    assert_eq!(all(0.0).map(|b| b.is_delta_at(DELTA_ALPHA)), [false; 5]);
}

#[test]
fn refraction_scale_is_the_squared_index_ratio() {
    let [diffuse, metal, _, glass, thin] = all(0.1);
    for wo in [Vec3::Z, -Vec3::Z] {
        for other in [diffuse, metal, thin] {
            assert_eq!(other.refraction_scale(wo), 1.0);
        }
    }
    assert_eq!(glass.refraction_scale(Vec3::Z), 2.25);
    assert_eq!(glass.refraction_scale(-Vec3::Z), 1.0 / 2.25);
}

#[test]
fn dielectric_of_equal_indices_is_delta_at_any_roughness() {
    let glass = |eta| {
        Bsdf::Dielectric(Dielectric {
            eta,
            tint: Rgb::ONE,
            alpha: 0.5,
            distribution: Distribution::Beckmann,
        })
    };
    // The bound is a difference of 5e-4 in either direction.
    for (eta, matched) in [(1.0, true), (1.0004, true), (0.9996, true), (1.0006, false)] {
        assert_eq!(glass(eta).is_delta_at(1.0), matched, "{eta}");
        let oblique = Vec3::new(0.6, 0.0, 0.8);
        assert_eq!(
            glass(eta).query(oblique, oblique).is_none(),
            matched,
            "{eta}"
        );
    }
}
