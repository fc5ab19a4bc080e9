//! glTF materials, and the closures they become at a surface point.

use super::Texture;
use crate::bsdf::Bsdf;
use crate::math::{Rgb, Vec2};

/// A metallic-roughness material with the extensions we model. Factors multiply textures.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name in the file, for messages.
    pub name: String,
    /// Linear base colour.
    pub base_color: Rgb,
    /// Opacity factor (the base colour's fourth channel).
    pub opacity: f32,
    /// How opacity is used.
    pub alpha_mode: AlphaMode,
    /// Metalness in [0, 1].
    pub metallic: f32,
    /// Beckmann (or GGX) roughness in [0, 1]: glTF's perceptual roughness squared.
    pub alpha: f32,
    /// Emitted radiance (strength included).
    pub emission: Rgb,
    /// Whether the back side emits too.
    pub double_sided: bool,
    /// Part of the light that is transmitted rather than scattered diffusely, in [0, 1].
    pub transmission: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Whether the surface bounds a solid body (refracts); otherwise transmission is thin-walled.
    pub solid: bool,
    /// Absorption coefficient of the body per unit length.
    pub absorption: Rgb,
    /// Specular factor, multiplies f0 of a dielectric coat.
    pub specular: Rgb,
    /// Base colour texture (sRGB), opacity in its fourth channel.
    pub base_color_texture: Option<TextureRef>,
    /// Metalness in blue, perceptual roughness in green.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Tangent-space normal map.
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal map's x and y.
    pub normal_scale: f32,
    /// Emission texture (sRGB).
    pub emissive_texture: Option<TextureRef>,
    /// Transmission in red.
    pub transmission_texture: Option<TextureRef>,
}

/// What opacity means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Ignored.
    #[default]
    Opaque,
    /// Below the cutoff the surface is not there.
    Mask(f32),
    /// Stochastic: the surface is there with that probability.
    Blend,
}

/// A texture as a material uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into `SceneParts::textures`.
    pub texture: u32,
    /// `KHR_texture_transform` as an affine map of (u, v, 1).
    pub transform: glam::Affine2,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: Rgb::ONE,
            opacity: 1.0,
            alpha_mode: AlphaMode::Opaque,
            metallic: 1.0,
            alpha: 1.0,
            emission: Rgb::ZERO,
            double_sided: false,
            transmission: 0.0,
            ior: 1.5,
            solid: false,
            absorption: Rgb::ZERO,
            specular: Rgb::ONE,
            base_color_texture: None,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emissive_texture: None,
            transmission_texture: None,
        }
    }
}

impl Material {
    /// The closure at texture coordinates `uv`; `u` in [0, 1) chooses between closures where transmission is partial.
    #[inline]
    pub fn bsdf(&self, textures: &[Texture], uv: Vec2, u: f32) -> Bsdf {
        let _ = (textures, uv, u);
        todo!()
    }
}
