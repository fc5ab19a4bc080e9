//! Microfacet reflection by Fresnel's equations: a metal of complex index, or a dielectric coat over a Lambertian base.
//! Scenes of other renderers use them; glTF uses Schlick's approximation, see [`Glossy`](super::Glossy).

use super::fresnel::{conductor, dielectric, dielectric_average};
use super::lobes::{above, delta, finish, mirror, reflection};
use super::{BsdfSample, DELTA_ALPHA, Distribution, Lobe, LobeNumbers, LobeQuery};
use crate::math::{Rgb, Vec2, Vec3, luminance, warp};
use std::f32::consts::FRAC_1_PI;

/// Optical boundary at a surface's facets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interface {
    /// A metal of index `eta` + i `k`, relative to the outside.
    Metal {
        /// Real part.
        eta: Rgb,
        /// Extinction coefficient.
        k: Rgb,
    },
    /// A clear layer over a Lambertian base.
    Coat {
        /// Index of refraction relative to the outside.
        eta: f32,
        /// Reflectance of the base in [0, 1].
        albedo: Rgb,
        /// Mean of the coat's reflectance over the cosine-weighted hemisphere.
        average: f32,
    },
}

impl Interface {
    /// A coat of this index over a base of this reflectance.
    pub fn coat(eta: f32, albedo: Rgb) -> Self {
        Self::Coat {
            eta,
            albedo,
            average: dielectric_average(eta),
        }
    }
}

/// Microfacet reflection by Fresnel's equations, over a Lambertian base or none.
#[derive(Clone, Copy, Debug)]
pub struct FresnelGlossy {
    /// Boundary at the facets.
    pub interface: Interface,
    /// Factor of the reflected light in [0, 1].
    pub tint: Rgb,
    /// Original roughness in [0, 1].
    pub alpha: f32,
    /// Microfacet distribution.
    pub distribution: Distribution,
}

impl FresnelGlossy {
    /// Reflectance of the base; black for a metal.
    #[inline]
    pub(crate) fn albedo(&self) -> Rgb {
        match self.interface {
            Interface::Metal { .. } => Rgb::ZERO,
            Interface::Coat { albedo, .. } => albedo,
        }
    }

    pub(super) fn without_diffuse(mut self) -> Self {
        if let Interface::Coat { albedo, .. } = &mut self.interface {
            *albedo = Rgb::ZERO;
        }
        self
    }

    /// Reflectance at normal incidence, base included.
    pub(super) fn reflectance(&self) -> Rgb {
        let f = self.fresnel(1.0);
        f * self.tint + self.albedo() * (Rgb::ONE - f)
    }

    /// Reflectance of a facet at this cosine, without the tint.
    #[inline]
    pub(crate) fn fresnel(&self, cos: f32) -> Rgb {
        match self.interface {
            Interface::Metal { eta, k } => {
                let of = |c: usize| conductor(cos, eta[c], k[c]);
                Rgb::new(of(0), of(1), of(2))
            }
            Interface::Coat { eta, .. } => Rgb::splat(dielectric(cos, eta)),
        }
    }

    /// Selection probability of the glossy lobe, as that of [`Glossy`](super::Glossy).
    fn glossy_probability(&self, cos: f32) -> f32 {
        let albedo = self.albedo();
        if albedo == Rgb::ZERO {
            return 1.0;
        }
        self.glossy_share(albedo, self.fresnel(cos))
    }

    /// [`Self::glossy_probability`] over a base of this albedo, not black, for facets of the reflectance `f`.
    #[inline]
    fn glossy_share(&self, albedo: Rgb, f: Rgb) -> f32 {
        let (glossy, base) = (luminance(f * self.tint), luminance(albedo * (Rgb::ONE - f)));
        (glossy / (glossy + base)).clamp(0.05, 0.95)
    }

    /// Query for value and density, or without `VALUE` for the density alone.
    #[cold]
    #[inline(never)]
    pub(super) fn query<const VALUE: bool>(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let (wo, wi) = (above(wo.z, wo), above(wo.z, wi));
        let (mut query, cos_h) = reflection(wo, wi, self.distribution)?;
        if VALUE {
            query.scale *= self.fresnel(cos_h) * self.tint;
        }
        if let Interface::Coat {
            eta,
            albedo,
            average,
        } = self.interface
            && albedo != Rgb::ZERO
        {
            let reflectance = |w: Vec3| dielectric(w.z.min(1.0), eta);
            let of_o = reflectance(wo);
            let p = self.glossy_share(albedo, Rgb::splat(of_o));
            query.pdf_scale *= p;
            query.base_pdf = (1.0 - p) * wi.z * FRAC_1_PI;
            if VALUE {
                // As in `Glossy`: transmittances of a smooth coat inwards and outwards, over their cosine-weighted mean.
                let through = (1.0 - of_o) * (1.0 - reflectance(wi));
                let coupling = through / (1.0 - average).max(1e-6);
                query.base = albedo * (coupling * wi.z * FRAC_1_PI);
            }
        }
        Some(query)
    }

    /// Value and density of a direction that was drawn.
    #[cold]
    #[inline(never)]
    pub(super) fn sample_along(
        &self,
        alpha: f32,
        wo: Vec3,
        wi: Vec3,
        lobe: Lobe,
    ) -> Option<BsdfSample> {
        if alpha < DELTA_ALPHA && lobe == Lobe::Reflection {
            let cos = wo.z.abs().min(1.0);
            let weight = self.fresnel(cos) * self.tint / self.glossy_probability(cos);
            return delta(wi, weight, lobe);
        }
        finish(self.query::<true>(wo, wi), alpha, wi, lobe)
    }

    /// Direction and lobe of a sample.
    #[cold]
    #[inline(never)]
    pub(super) fn direction(
        &self,
        alpha: f32,
        wo: Vec3,
        u: impl LobeNumbers,
    ) -> Option<(Vec3, Lobe)> {
        let [choice, x, y] = u.uniform();
        let side = wo.z;
        let wo = above(side, wo);
        if wo.z <= 0.0 {
            return None;
        }
        if choice >= self.glossy_probability(wo.z.min(1.0)) {
            let wi = warp::cosine_hemisphere(Vec2::new(x, y));
            return Some((above(side, wi), Lobe::Diffuse));
        }
        let wi = mirror(wo, self.distribution.sample_visible(alpha, wo, u));
        (wi.z > 0.0).then(|| (above(side, wi), Lobe::Reflection))
    }
}
