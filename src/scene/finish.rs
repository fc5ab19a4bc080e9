//! Finish of a material: clear coat and brushing. Few materials have one, so that it stays out of the way of the others.

use super::material::{Material, TextureRef};
use super::{Scene, SceneParts, Surface, Texture};
use crate::bsdf::{Bsdf, Glossy, anisotropic, clearcoated};
use crate::math::{Frame, Vec2};

/// Rare parts of a material, which are not read at every hit.
#[derive(Clone, Debug, Default)]
pub struct Finish {
    /// Clear coat over everything else.
    pub clearcoat: Option<Clearcoat>,
    /// Brushing of the glossy lobe; transmitting surfaces ignore it.
    pub anisotropy: Option<Anisotropy>,
}

/// Clear coat of a material.
#[derive(Clone, Debug, Default)]
pub struct Clearcoat {
    /// Weight in [0, 1].
    pub weight: f32,
    /// Roughness in [0, 1].
    pub alpha: f32,
    /// Weight in red.
    pub texture: Option<TextureRef>,
    /// Perceptual roughness in green.
    pub roughness_texture: Option<TextureRef>,
    /// Tangent-space normal map of the coat, which does not have that of its base.
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal map's x and y.
    pub normal_scale: f32,
}

/// Brushing of a material `[KHR_materials_anisotropy]`.
#[derive(Clone, Debug, Default)]
pub struct Anisotropy {
    /// Strength in [0, 1].
    pub strength: f32,
    /// Angle in radians from the tangent to the direction along which the surface is the rougher, counter-clockwise.
    pub rotation: f32,
    /// Direction in red and green, factor of the strength in blue.
    pub texture: Option<TextureRef>,
}

impl Anisotropy {
    /// Roughnesses along and across the brushing, of a material of roughness `alpha`, where the strength is `strength`.
    #[inline]
    fn alphas(alpha: f32, strength: f32) -> [f32; 2] {
        [alpha + (1.0 - alpha) * strength * strength, alpha]
    }

    /// The BSDF for that of the surface without brushing.
    fn brushed(&self, scene: &Scene, surface: &Surface, lobe: Glossy) -> Bsdf {
        let parts = scene.parts();
        let (mut strength, mut direction) = (self.strength, Vec2::X);
        if let Some(map) = &self.texture {
            let [x, y, b, _] = map.sample(&parts.textures, surface.uv);
            strength *= b;
            direction = 2.0 * Vec2::new(x, y) - 1.0;
        }
        let along = (direction.try_normalize())
            .filter(|_| strength > 0.0)
            .map(|d| Vec2::from_angle(self.rotation).rotate(d))
            .zip((scene.geometry()).tangents(parts, surface, self.texture.as_ref()))
            .map(|(d, [t, b])| Frame::from_normal(surface.ns).to_local(d.x * t + d.y * b))
            .filter(|local| local.x != 0.0 || local.y != 0.0);
        let Some(local) = along else {
            return Bsdf::Glossy(lobe);
        };
        let [along, across] = Self::alphas(lobe.alpha, strength);
        anisotropic(lobe, along, across, local.truncate())
    }
}

impl Material {
    /// The clear coat.
    #[inline]
    pub fn clearcoat(&self) -> Option<&Clearcoat> {
        self.finish.as_ref()?.clearcoat.as_ref()
    }

    /// The brushing.
    #[inline]
    pub fn anisotropy(&self) -> Option<&Anisotropy> {
        self.finish.as_ref()?.anisotropy.as_ref()
    }

    /// Roughness that classes see in the glossy lobe, without textures.
    pub fn lobe_alpha(&self) -> f32 {
        let alphas = |a: &Anisotropy| Anisotropy::alphas(self.alpha, a.strength);
        self.anisotropy().map_or(self.alpha, |a| {
            let [along, across] = alphas(a);
            (along * across).sqrt()
        })
    }

    /// The finish, to be changed.
    pub fn finish_mut(&mut self) -> &mut Finish {
        self.finish.get_or_insert_default()
    }
}

impl Finish {
    /// The textures.
    pub(super) fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        let coat = self
            .clearcoat
            .as_ref()
            .map(|coat| [&coat.texture, &coat.roughness_texture, &coat.normal_texture]);
        let brushing = self.anisotropy.as_ref().map(|a| &a.texture);
        (coat.into_iter().flatten().chain(brushing)).flatten()
    }
}

impl Clearcoat {
    /// Weight and roughness at texture coordinates.
    fn at(&self, textures: &[Texture], uv: Vec2) -> [f32; 2] {
        let (mut weight, mut alpha) = (self.weight, self.alpha);
        if let Some(map) = &self.texture {
            weight *= map.sample(textures, uv)[0];
        }
        if let Some(map) = &self.roughness_texture {
            let roughness = map.sample(textures, uv)[1];
            alpha *= roughness * roughness;
        }
        [weight, alpha]
    }

    /// Gives the surface the coat's normal.
    fn turn(&self, scene: &Scene, base: &Material, surface: &mut Surface) {
        if base.normal_texture.is_some() || self.normal_texture.is_some() {
            let map = (self.normal_texture.as_ref()).map(|map| (map, self.normal_scale));
            surface.ns = (scene.geometry()).mapped_normal(scene.parts(), surface, map);
        }
    }
}

impl Scene {
    /// The BSDF at a point of a material with a finish; the surface gets the normal of the coat if that is drawn.
    #[cold]
    #[inline(never)]
    pub(super) fn finished_bsdf(&self, finish: &Finish, surface: &mut Surface, u: f32) -> Bsdf {
        let SceneParts {
            materials,
            textures,
            ..
        } = self.parts();
        let material = &materials[surface.material as usize];
        let at: &Surface = surface;
        let base = |u| match (material.bsdf(textures, at.uv, u), &finish.anisotropy) {
            (Bsdf::Glossy(lobe), Some(anisotropy)) => anisotropy.brushed(self, at, lobe),
            (base, _) => base,
        };
        let Some(coat) = &finish.clearcoat else {
            return base(u);
        };
        let [weight, alpha] = coat.at(textures, surface.uv);
        let bsdf = clearcoated(weight, alpha, material.distribution, u, base);
        if !matches!(bsdf, Bsdf::Clearcoated(_)) {
            coat.turn(self, material, surface);
        }
        bsdf
    }
}
