//! Brushed surface: [`Glossy`] whose lobe is rougher along one tangent than across it `[KHR_materials_anisotropy]`.
//!
//! Both distributions of slopes keep their form under stretching `[Heitz14]`. With roughnesses αₓ = α sₓ and
//! α_y = α s_y a lobe is therefore the isotropic one of roughness α in slopes divided by (sₓ, s_y): with
//! h̃ = (hₓ/sₓ, h_y/s_y, h_z) and w̃ = (sₓ wₓ, s_y w_y, w_z),
//!
//! ```text
//! D(h; αₓ, α_y) = D(h̃; α) (|h|/|h̃|)⁴ / (sₓ s_y)          Λ(w; αₓ, α_y) = Λ(w̃; α)
//! ```
//!
//! (sₓ, s_y) does not depend on α. So one [`LobeQuery`] is valid at every roughness here too, rules that raise α raise
//! both roughnesses in proportion, and no other file treats the two separately.

use super::lobes::{above, finish, mirror};
use super::{BsdfSample, DELTA_ALPHA, Distribution, Glossy, Lobe, LobeNumbers, LobeQuery};
use crate::math::frame::tan2_theta;
use crate::math::{Rgb, Vec2, Vec3};

/// Smallest ratio of the roughnesses.
const MIN_RATIO: f32 = 1e-3;
/// Fourth root of [`MIN_RATIO`], rounded up.
const MIN_ROOT: f32 = 0.177_828;
/// Number of steps of the direction in half a turn.
const DIRECTIONS: u32 = 1 << 13;
/// Largest code of the ratio: the code of [`MIN_RATIO`]; 0 is a ratio of 1.
const RATIOS: u32 = (1 << 11) - 1;

/// Glossy lobe of two roughnesses over a Lambertian base.
///
/// Direction and ratio of the roughnesses are coded in three bytes, so that this type is no larger than [`Glossy`].
/// Steps are 5·10⁻⁴ rad in the direction and at most 1 % in the ratio.
#[derive(Clone, Copy, Debug)]
pub struct Anisotropic {
    f0: Rgb,
    f90: f32,
    albedo: Rgb,
    alpha: f32,
    distribution: Distribution,
    code: [u8; 3],
}

/// Direction and ratio as three bytes.
fn encode(direction: Vec2, ratio: f32) -> [u8; 3] {
    // A point of the diamond |x| + |y| = 1 up to its sign.
    let y = direction.y.copysign(direction.x * direction.y) / direction.abs().element_sum();
    let turn = (0.5 * (y + 1.0) * DIRECTIONS as f32).round() as u32 % DIRECTIONS;
    let root = ratio.max(MIN_RATIO).sqrt().sqrt();
    let below = (1.0 - root) / (1.0 - MIN_ROOT) * RATIOS as f32;
    let [a, b, c, _] = (turn * (RATIOS + 1) + below.round() as u32).to_le_bytes();
    [a, b, c]
}

impl Anisotropic {
    /// A lobe of these roughnesses along and across a direction, with `along` at least [`DELTA_ALPHA`].
    pub(super) fn new(lobe: Glossy, along: f32, across: f32, direction: Vec2) -> Self {
        let ratio = across.clamp(DELTA_ALPHA, along) / along;
        let stretched = Self::of(lobe, encode(direction, ratio));
        let [x, _] = stretched.scales();
        Self {
            alpha: along / x,
            ..stretched
        }
    }

    fn of(lobe: Glossy, code: [u8; 3]) -> Self {
        let Glossy {
            f0,
            f90,
            albedo,
            alpha,
            distribution,
        } = lobe;
        Self {
            f0,
            f90,
            albedo,
            alpha,
            distribution,
            code,
        }
    }

    /// The isotropic surface of the same roughness.
    #[inline]
    pub(crate) fn isotropic(&self) -> Glossy {
        Glossy {
            f0: self.f0,
            f90: self.f90,
            albedo: self.albedo,
            alpha: self.alpha,
            distribution: self.distribution,
        }
    }

    pub(super) fn without_diffuse(self) -> Self {
        Self {
            albedo: Rgb::ZERO,
            ..self
        }
    }

    fn number(&self) -> u32 {
        let [a, b, c] = self.code;
        u32::from_le_bytes([a, b, c, 0])
    }

    /// Local unit tangent of the larger roughness; its sign is arbitrary.
    pub(crate) fn direction(&self) -> Vec2 {
        let turn = self.number() / (RATIOS + 1);
        let y = turn as f32 * (2.0 / DIRECTIONS as f32) - 1.0;
        Vec2::new(1.0 - y.abs(), y).normalize()
    }

    /// Factors (sₓ, s_y) from α to the roughnesses along and across [`Self::direction`].
    fn scales(&self) -> [f32; 2] {
        let below = (self.number() % (RATIOS + 1)) as f32 / RATIOS as f32;
        let root = 1.0 - (1.0 - MIN_ROOT) * below;
        let half = root * root;
        [1.0 / half, half]
    }

    /// Roughnesses along and across [`Self::direction`] if the BSDF has roughness `alpha`.
    #[cfg(test)]
    pub(crate) fn alphas(&self, alpha: f32) -> [f32; 2] {
        self.scales().map(|s| alpha * s)
    }

    /// A local direction in coordinates along and across [`Self::direction`].
    #[inline]
    fn turned(direction: Vec2, w: Vec3) -> Vec3 {
        let Vec2 { x, y } = direction;
        Vec3::new(w.x * x + w.y * y, w.y * x - w.x * y, w.z)
    }

    #[cold]
    #[inline(never)]
    pub(super) fn query(&self, wo: Vec3, wi: Vec3) -> Option<LobeQuery> {
        let mut query = self.isotropic().query(wo, wi)?;
        let (direction, [x, y]) = (self.direction(), self.scales());
        let [wo, wi] = [wo, wi].map(|w| Self::turned(direction, w));
        let h = wo + wi;
        let narrow = Vec3::new(h.x / x, h.y / y, h.z);
        let wide = |w: Vec3| Vec3::new(w.x * x, w.y * y, w.z);
        let factor = h.length_squared() / narrow.length_squared();
        let factor = factor * factor / (x * y);
        query.scale *= factor;
        query.pdf_scale *= factor;
        query.tan2_h = tan2_theta(narrow);
        query.tan2_o = tan2_theta(wide(wo));
        query.tan2_i = tan2_theta(wide(wi));
        Some(query)
    }

    #[cold]
    #[inline(never)]
    pub(super) fn sample_along(
        &self,
        alpha: f32,
        wo: Vec3,
        wi: Vec3,
        lobe: Lobe,
    ) -> Option<BsdfSample> {
        if alpha < DELTA_ALPHA {
            return self.isotropic().sample_along(alpha, wo, wi, lobe);
        }
        finish(self.query(wo, wi), alpha, wi, lobe)
    }

    /// Direction and lobe of a sample.
    #[cold]
    #[inline(never)]
    pub(super) fn direction_of(
        &self,
        alpha: f32,
        wo: Vec3,
        u: impl LobeNumbers,
    ) -> Option<(Vec3, Lobe)> {
        let lobe = self.isotropic();
        if alpha < DELTA_ALPHA || u.uniform()[0] >= lobe.glossy_probability(wo.z.abs()) {
            return lobe.direction(alpha, wo, u);
        }
        let side = wo.z;
        let wo = above(side, wo);
        if wo.z <= 0.0 {
            return None;
        }
        let (direction, [x, y]) = (self.direction(), self.scales());
        let turned = Self::turned(direction, wo);
        // Stretching maps normals visible from w̃ in the isotropic distribution to normals visible from w in this one.
        let wide = Vec3::new(turned.x * x, turned.y * y, turned.z);
        let h = self.distribution.sample_visible(alpha, wide, u);
        let back = Vec2::new(direction.x, -direction.y);
        let h = Self::turned(back, Vec3::new(h.x * x, h.y * y, h.z));
        let wi = mirror(wo, h);
        (wi.z > 0.0).then(|| (above(side, wi), Lobe::Reflection))
    }
}
