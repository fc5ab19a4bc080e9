//! Surface that scatters a part of the light to its other side `[KHR_materials_diffuse_transmission]`: a leaf, paper, a
//! lampshade.
//!
//! [`Glossy`] whose base is Lambertian on both sides. With a the reflectance of the base, t its transmittance and c the
//! coupling of [`Glossy`] between base and coat:
//!
//! ```text
//! f(wo, wi) = coat(wo, wi) + a c(wo, wi) / π      on the side of wo
//! f(wo, wi) = t c(wo, wi) / π                     on the other side
//! ```
//!
//! Both faces have the coat. A smooth coat and its base reflect and transmit F + (1 − F)(a + t) in total.

use super::lobes::{NO_LOBE, above, finish};
use super::{BsdfSample, DELTA_ALPHA, Glossy, Lobe, LobeNumbers, LobeQuery};
use crate::math::{Rgb, Vec2, Vec3, luminance, warp};
use std::f32::consts::FRAC_1_PI;

/// Coat over a base that reflects and transmits by Lambert's law.
#[derive(Clone, Copy, Debug)]
pub struct Translucent {
    /// Coat, and reflectance of the base; `f90` = 0 means no coat.
    gloss: Glossy,
    /// Transmittance of the base in [0, 1], at most 1 minus its reflectance.
    transmitted: Rgb,
}

impl Translucent {
    /// Adds a transmitting base to `gloss`; both albedos are scaled down where they sum to more than 1.
    pub(super) fn new(mut gloss: Glossy, transmitted: Rgb) -> Self {
        let most = (gloss.albedo + transmitted).max_element().max(1.0);
        gloss.albedo /= most;
        Self {
            gloss,
            transmitted: transmitted / most,
        }
    }

    /// The same surface with the transmittance of its base added to the reflectance.
    pub(super) fn folded(&self) -> Glossy {
        Glossy {
            albedo: self.gloss.albedo + self.transmitted,
            ..self.gloss
        }
    }

    /// True if the surface has a coat.
    pub(super) fn is_coated(&self) -> bool {
        self.gloss.f90 > 0.0
    }

    /// The coat alone.
    pub(super) fn coat(&self) -> Glossy {
        Glossy {
            albedo: Rgb::ZERO,
            ..self.gloss
        }
    }

    /// Selection probabilities of coat, reflecting base and transmitting base at cos θo = `cos`.
    fn chances(&self, cos: f32) -> [f32; 3] {
        let glossy = match self.is_coated() {
            true => self.folded().glossy_probability(cos),
            false => 0.0,
        };
        let [reflected, transmitted] = [self.gloss.albedo, self.transmitted].map(luminance);
        let through = transmitted / (reflected + transmitted).max(f32::MIN_POSITIVE);
        let base = 1.0 - glossy;
        [glossy, base * (1.0 - through), base * through]
    }

    #[cold]
    #[inline(never)]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let (wo, wi) = (above(wo.z, wo), above(wo.z, wi));
        let cos = wi.z.abs();
        let [_, reflected, transmitted] = self.chances(wo.z);
        if wo.z <= 0.0 || wi.z == 0.0 {
            return None;
        }
        let (base, chance) = match wi.z > 0.0 {
            true => (self.gloss.albedo, reflected),
            false => (self.transmitted, transmitted),
        };
        let mut query = match wi.z > 0.0 && self.is_coated() {
            true => self.folded().query(wo, wi)?,
            false => NO_LOBE,
        };
        query.base = base * self.gloss.coupling(wo.z, cos) * (cos * FRAC_1_PI);
        query.base_pdf = chance * cos * FRAC_1_PI;
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
            return self.folded().sample_along(alpha, wo, wi, lobe);
        }
        finish(self.query(wo, wi), alpha, wi, lobe)
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
        let [glossy, reflected, _] = self.chances(wo.z.abs());
        if choice < glossy {
            return self.folded().direction(alpha, wo, u);
        }
        let wi = warp::cosine_hemisphere(Vec2::new(x, y));
        let side = match choice < glossy + reflected {
            true => wo.z,
            false => -wo.z,
        };
        (wo.z != 0.0).then(|| (above(side, wi), Lobe::Diffuse))
    }
}
