//! BSDFs for the checks.

use opsr::bsdf::{
    Bsdf, Covers, Dielectric, Diffuse, Distribution, Film, Glossy, Sheen, ThinDielectric,
    anisotropic, covered, iridescent, translucent,
};
use opsr::bsdf::{FresnelGlossy, Interface};
use opsr::math::{Rgb, Vec2, Vec3};

/// All distributions.
pub const DISTRIBUTIONS: [Distribution; 2] = [Distribution::Beckmann, Distribution::Ggx];

/// Unit direction at `degrees` from the normal, in the plane of neither tangent.
pub fn at(degrees: f32) -> Vec3 {
    let (sin, cos) = degrees.to_radians().sin_cos();
    let (y, x) = 0.7f32.sin_cos();
    Vec3::new(sin * x, sin * y, cos)
}

/// White metal.
pub fn metal(alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Glossy(Glossy {
        f0: Rgb::ONE,
        f90: 1.0,
        albedo: Rgb::ZERO,
        alpha,
        distribution,
    })
}

/// Coat of reflectance 0.04 over a base of this reflectance.
pub fn coat(albedo: Rgb, alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Glossy(Glossy {
        f0: Rgb::splat(0.04),
        f90: 1.0,
        albedo,
        alpha,
        distribution,
    })
}

/// Coat over an orange base.
pub fn plastic(alpha: f32, distribution: Distribution) -> Bsdf {
    coat(Rgb::new(0.8, 0.5, 0.2), alpha, distribution)
}

/// Colourless glass of index `eta`.
pub fn glass(eta: f32, alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Dielectric(Dielectric {
        eta,
        tint: Rgb::ONE,
        alpha,
        distribution,
    })
}

/// Coloured thin wall.
pub fn pane(alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Thin(ThinDielectric {
        f0: Rgb::new(0.04, 0.2, 0.5),
        f90: 1.0,
        eta: 0.0,
        tint: Rgb::new(1.0, 0.9, 0.8),
        alpha,
        distribution,
    })
}

/// BSDF of this base under a clear coat of weight 1.
pub(crate) fn under_clearcoat(base: Bsdf) -> Bsdf {
    covered(&Covers::default(), 0.9, |_| base)
}

/// The lobe of a BSDF made anisotropic, along a direction off both tangents. `ratio` is the ratio of its roughnesses,
/// and their geometric mean is the lobe's roughness.
pub fn brushed(bsdf: Bsdf, ratio: f32) -> Bsdf {
    let Bsdf::Glossy(lobe) = bsdf else {
        return bsdf;
    };
    let along = lobe.alpha / ratio.sqrt();
    anisotropic(lobe, along, along * ratio, Vec2::new(0.3, -0.8))
}

/// Blue sheen fibres.
pub fn fibres(alpha: f32) -> Sheen {
    Sheen {
        color: Rgb::new(0.4, 0.6, 1.0),
        alpha,
    }
}

/// BSDF of this base under white fibres.
pub fn under_sheen(base: Bsdf, alpha: f32) -> Bsdf {
    let covers = Covers {
        coat: 0.0,
        alpha: 0.0,
        distribution: Distribution::Ggx,
        sheen: Sheen {
            color: Rgb::ONE,
            alpha,
        },
    };
    covered(&covers, 0.9, |_| base)
}

/// Copper by its complex indices.
pub fn exact_metal(alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::FresnelGlossy(FresnelGlossy {
        interface: Interface::Metal {
            eta: Rgb::new(0.2, 0.92, 1.1),
            k: Rgb::new(3.91, 2.45, 2.14),
        },
        tint: Rgb::ONE,
        alpha,
        distribution,
    })
}

/// A coloured base under an interface of index 1.5.
pub fn exact_plastic(alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::FresnelGlossy(FresnelGlossy {
        interface: Interface::coat(1.5, Rgb::new(0.9, 0.5, 0.1)),
        tint: Rgb::ONE,
        alpha,
        distribution,
    })
}

/// Clear thin wall by Fresnel's equations, with all reflections between its faces.
pub fn exact_pane(alpha: f32, distribution: Distribution) -> Bsdf {
    Bsdf::Thin(ThinDielectric {
        f0: Rgb::ONE,
        f90: 1.0,
        eta: 1.5,
        tint: Rgb::ONE,
        alpha,
        distribution,
    })
}

/// BSDF of this base under a film.
pub fn under_film(base: Bsdf) -> Bsdf {
    let film = Film {
        weight: 0.9,
        ior: 1.7,
        thickness: 380.0,
    };
    iridescent(base, film)
}

/// Paper: a Lambertian base that reflects and transmits.
pub fn paper() -> Bsdf {
    let albedo = Rgb::new(0.5, 0.4, 0.1);
    translucent(Bsdf::Diffuse(Diffuse { albedo }), Rgb::new(0.3, 0.5, 0.9))
}

/// Coat over an orange base that transmits blue light.
pub fn leaf(alpha: f32, distribution: Distribution) -> Bsdf {
    translucent(plastic(alpha, distribution), Rgb::new(0.1, 0.3, 0.7))
}

/// One BSDF of every kind at this roughness, with its name.
pub fn kinds(alpha: f32, distribution: Distribution) -> [(&'static str, Bsdf); 20] {
    [
        ("metal", metal(alpha, distribution)),
        ("plastic", plastic(alpha, distribution)),
        ("glass", glass(1.5, alpha, distribution)),
        ("pane", pane(alpha, distribution)),
        ("diffuse", Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE })),
        (
            "plastic under clear coat",
            under_clearcoat(plastic(alpha, distribution)),
        ),
        (
            "brushed plastic",
            brushed(plastic(alpha, distribution), 0.1),
        ),
        ("fibres", Bsdf::Sheen(fibres(alpha))),
        (
            "plastic under fibres",
            under_sheen(plastic(alpha, distribution), 0.3),
        ),
        (
            "plastic under a film",
            under_film(plastic(alpha, distribution)),
        ),
        (
            "glass under a film",
            under_film(glass(1.5, alpha, distribution)),
        ),
        ("pane under a film", under_film(pane(alpha, distribution))),
        ("exact metal", exact_metal(alpha, distribution)),
        ("exact plastic", exact_plastic(alpha, distribution)),
        ("exact pane", exact_pane(alpha, distribution)),
        (
            "exact metal under clear coat",
            under_clearcoat(exact_metal(alpha, distribution)),
        ),
        (
            "exact plastic under fibres",
            under_sheen(exact_plastic(alpha, distribution), 0.3),
        ),
        ("paper", paper()),
        ("leaf", leaf(alpha, distribution)),
        (
            "leaf under clear coat",
            under_clearcoat(leaf(alpha, distribution)),
        ),
    ]
}

/// BSDFs with all interfaces that a scene may contain: perfect, index-matched, weak and strong.
pub fn extremes(alpha: f32, distribution: Distribution) -> [Bsdf; 29] {
    let glass = |eta| glass(eta, alpha, distribution);
    [
        Bsdf::Sheen(fibres(alpha)),
        under_sheen(plastic(alpha, distribution), alpha),
        under_film(plastic(alpha, distribution)),
        under_film(super::bsdfs::glass(1.5, alpha, distribution)),
        under_film(pane(alpha, distribution)),
        metal(alpha, distribution),
        plastic(alpha, distribution),
        pane(alpha, distribution),
        Bsdf::Diffuse(Diffuse { albedo: Rgb::ONE }),
        Bsdf::Glossy(Glossy {
            f0: Rgb::ZERO,
            f90: 1.0,
            albedo: Rgb::ONE,
            alpha,
            distribution,
        }),
        Bsdf::Thin(ThinDielectric {
            f0: Rgb::ONE,
            f90: 1.0,
            eta: 0.0,
            tint: Rgb::ONE,
            alpha,
            distribution,
        }),
        glass(1.0),
        glass(1.0001),
        glass(1.001),
        glass(1.33),
        glass(1.5),
        glass(3.0),
        glass(0.7),
        under_clearcoat(metal(alpha, distribution)),
        under_clearcoat(glass(1.5)),
        brushed(metal(alpha, distribution), 0.02),
        under_clearcoat(brushed(plastic(alpha, distribution), 0.3)),
        exact_metal(alpha, distribution),
        exact_plastic(alpha, distribution),
        exact_pane(alpha, distribution),
        under_clearcoat(exact_plastic(alpha, distribution)),
        paper(),
        leaf(alpha, distribution),
        under_clearcoat(leaf(alpha, distribution)),
    ]
}
