//! Homogeneous media that absorb and scatter light.

use super::{Hit, Material, SceneParts, Surface, TriangleId};
use crate::bsdf::phase::MAX_MEAN_COSINE;
use crate::bsdf::{Bsdf, Phase};
use crate::math::{Ray, Rgb, Vec2};

/// Triangle of a point in a medium, which has none.
const NO_TRIANGLE: TriangleId = TriangleId::single(u32::MAX);

/// A homogeneous medium, with the phase function of Henyey and Greenstein.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Medium {
    /// Absorption coefficient σa ≥ 0 per unit length, linear Rec. 709.
    pub absorption: Rgb,
    /// Scattering coefficient σs ≥ 0 per unit length.
    pub scattering: Rgb,
    /// Mean cosine g of the deflection in (−1, 1); clamped to ±0.999.
    pub mean_cosine: f32,
}

impl Medium {
    /// True if the medium neither absorbs nor scatters.
    pub(crate) fn is_vacuum(&self) -> bool {
        self.absorption == Rgb::ZERO && self.scattering == Rgb::ZERO
    }

    /// True if the medium scatters.
    pub(crate) fn scatters(&self) -> bool {
        self.scattering != Rgb::ZERO
    }

    /// The phase function.
    pub(crate) fn phase(&self) -> Phase {
        Phase {
            mean_cosine: (self.mean_cosine).clamp(-MAX_MEAN_COSINE, MAX_MEAN_COSINE),
        }
    }
}

/// A medium in the form that paths use.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MediumValues {
    /// Extinction coefficient σa + σs.
    pub(crate) extinction: Rgb,
    /// Scattering coefficient σs.
    pub(crate) scattering: Rgb,
    /// The material whose constant BSDF is the phase function.
    phase: u32,
}

impl MediumValues {
    /// Transmittance over a distance, which may be infinite (Beer-Lambert).
    #[inline]
    pub(crate) fn transmittance(&self, distance: f32) -> Rgb {
        // Without extinction 0 · ∞ must be 0.
        let of = |s: f32| if s > 0.0 { (-s * distance).exp() } else { 1.0 };
        self.extinction.map(of)
    }

    /// The scattering vertex at a distance along a ray: a surface across the ray whose BSDF is the phase function.
    pub(crate) fn point(&self, ray: &Ray, distance: f32) -> Surface {
        Surface {
            position: ray.origin + distance * ray.dir,
            ng: -ray.dir,
            ns: -ray.dir,
            uv: Vec2::ZERO,
            triangle: NO_TRIANGLE,
            material: self.phase,
            min_mirror_cos: 0.0,
            error: 0.0,
            curved_height: 0.0,
        }
    }
}

impl Hit {
    /// A point of a medium.
    pub(crate) const IN_MEDIUM: Self = Self {
        t: 0.0,
        triangle: NO_TRIANGLE,
        u: 0.0,
        v: 0.0,
    };
}

impl Surface {
    /// True for a point of a medium.
    #[inline]
    pub(crate) fn is_in_medium(&self) -> bool {
        self.triangle.index() == NO_TRIANGLE.index()
    }
}

/// The media of a scene.
#[derive(Clone, Debug)]
pub(crate) struct Media {
    /// Medium that fills the bodies of each material; `None` if they contain the medium around them.
    bodies: Vec<Option<MediumValues>>,
    /// Medium outside of all bodies.
    outside: MediumValues,
    scatters: bool,
    has_lobes: bool,
}

impl Media {
    /// The media of the bodies and of the whole scene; `None` if paths need none beyond the absorption of bodies.
    /// Appends a material for each phase function.
    pub(super) fn of(parts: &mut SceneParts) -> Option<Self> {
        let own = |m: &Material| m.medium.as_deref().filter(|_| m.bounds_body()).copied();
        let whole = parts.medium.filter(|medium| !medium.is_vacuum());
        if whole.is_none() && !parts.materials.iter().any(|m| own(m).is_some()) {
            return None;
        }
        // With own boundaries, a body without a medium or absorption contains the medium around it.
        let inherits = parts.own_boundaries;
        let media: Vec<Option<Medium>> = (parts.materials.iter())
            .map(|m| {
                let plain = || Medium {
                    absorption: m.absorption,
                    ..Medium::default()
                };
                let keeps = inherits && m.absorption == Rgb::ZERO;
                own(m).or_else(|| (m.bounds_body() && !keeps).then(plain))
            })
            .collect();
        let mut fill = |medium: Medium| MediumValues {
            extinction: medium.absorption + medium.scattering,
            scattering: medium.scattering,
            phase: match medium.scatters() {
                true => phase_material(&mut parts.materials, medium.phase()),
                false => 0,
            },
        };
        let bodies: Vec<_> = media.into_iter().map(|m| m.map(&mut fill)).collect();
        let outside = fill(whole.unwrap_or_default());
        let scatters = (bodies.iter().flatten())
            .chain([&outside])
            .any(|filling| filling.scattering != Rgb::ZERO);
        Some(Self {
            bodies,
            outside,
            scatters,
            has_lobes: (parts.materials.iter()).any(|m| m.phase.is_some_and(|p| p.alpha() < 1.0)),
        })
    }

    /// Medium that fills the bodies of a material; `None` if they contain the medium around them.
    #[inline]
    pub(crate) fn of_body(&self, material: u32) -> Option<&MediumValues> {
        self.bodies.get(material as usize)?.as_ref()
    }

    /// Medium outside of all bodies.
    #[inline]
    pub(crate) fn outside(&self) -> &MediumValues {
        &self.outside
    }

    /// True if any medium scatters.
    pub(crate) fn scatters(&self) -> bool {
        self.scatters
    }

    /// True if any medium scatters anisotropically.
    pub(crate) fn has_lobes(&self) -> bool {
        self.has_lobes
    }
}

/// Index of the material of a phase function, which is appended if it is new.
fn phase_material(materials: &mut Vec<Material>, phase: Phase) -> u32 {
    let known = (materials.iter()).position(|m| m.phase == Some(phase));
    let place = known.unwrap_or_else(|| {
        materials.push(Material {
            name: "medium".into(),
            phase: Some(phase),
            ..Material::default()
        });
        materials.len() - 1
    });
    place as u32
}

impl Material {
    /// The phase function, for the material of a medium.
    pub(super) fn phase_bsdf(&self) -> Option<Bsdf> {
        self.phase.map(Bsdf::Phase)
    }
}
