//! glTF materials, and their BSDF at a surface point.

use super::finish::Finish;
use super::{Medium, Texture};
use crate::bsdf::{
    Bsdf, DELTA_ALPHA, Dielectric, Diffuse, Distribution, Glossy, Phase, ThinDielectric, is_matched,
};
use crate::math::{Rgb, Vec2};

/// A metallic-roughness material with all supported extensions. Factors multiply textures.
#[derive(Clone, Debug)]
pub struct Material {
    /// Name in the file, for messages.
    pub name: String,
    /// Linear base colour.
    pub base_color: Rgb,
    /// Opacity factor (the base colour's fourth channel).
    pub opacity: f32,
    /// Use of opacity.
    pub alpha_mode: AlphaMode,
    /// Metalness in [0, 1].
    pub metallic: f32,
    /// Beckmann (or GGX) roughness in [0, 1]: glTF's perceptual roughness squared.
    pub alpha: f32,
    /// Emitted radiance (strength included).
    pub emission: Rgb,
    /// True if the back side emits too, and is seen by the camera.
    pub double_sided: bool,
    /// True for `KHR_materials_unlit`: the emission shows the file's colour and does not count as light of the file.
    pub unlit: bool,
    /// True if the camera sees the back, whether or not it emits.
    pub shows_back: bool,
    /// True for a thin wall whose two faces reflect by Fresnel's equations, by the index of refraction.
    pub exact_wall: bool,
    /// Share of the light that is transmitted instead of scattered diffusely, in [0, 1].
    pub transmission: f32,
    /// Index of refraction, at the d line (587.56 nm) for a dispersive body.
    pub ior: f32,
    /// 20 over the Abbe number of a solid body; 0 without dispersion.
    pub dispersion: f32,
    /// True if the surface bounds a solid body and refracts; otherwise transmission is thin-walled.
    pub solid: bool,
    /// Priority where bodies overlap: the body with the highest counts; among equals the smaller one.
    pub priority: f32,
    /// Absorption coefficient of the body per unit length.
    pub absorption: Rgb,
    /// Weight in [0, 1] of the reflectance of a dielectric coat or thin wall, at all angles: its reflectance at grazing
    /// incidence. It does not affect solid bodies, whose interfaces have Fresnel's reflectance.
    pub specular: f32,
    /// Factor of the reflectance of a dielectric coat or thin wall at normal incidence.
    pub specular_color: Rgb,
    /// Slope distribution of the glossy lobe.
    pub distribution: Distribution,
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
    /// True if a body's tint is the square root of the base colour, since light passes two of its interfaces.
    pub root_tint: bool,
    /// Medium that fills the body and replaces its absorption. `None` for absorption alone or, with no absorption and
    /// [own boundaries](super::SceneParts::own_boundaries), for the medium around the body.
    pub medium: Option<Box<Medium>>,
    /// Phase function; `None` for all materials but those that a scene adds for its media.
    pub phase: Option<Phase>,
    /// Clear coat, brushing and other rare parts; boxed, since few materials have one and every hit reads a material.
    pub finish: Option<Box<Finish>>,
}

/// Use of a material's opacity.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Ignored.
    #[default]
    Opaque,
    /// Cut-out: the surface exists where opacity is at least the cutoff.
    Mask(f32),
    /// Stochastic: opacity is the probability that a ray hits the surface.
    Blend,
    /// No ray hits the surface, but its emission lights the scene: an invisible lamp.
    Unseen,
}

/// A use of a texture by a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into `SceneParts::textures`.
    pub texture: u32,
    /// `KHR_texture_transform` as an affine map of (u, v, 1).
    pub transform: glam::Affine2,
    /// True if it uses the mesh's second pair of texture coordinates.
    pub second: bool,
}

/// Texture coordinates of a point.
pub(crate) trait Coordinates: Copy {
    /// The coordinates that a texture uses.
    fn of(self, map: &TextureRef) -> Vec2;
}

/// The first pair, for materials whose textures all use it.
impl Coordinates for Vec2 {
    #[inline(always)]
    fn of(self, _: &TextureRef) -> Vec2 {
        self
    }
}

/// Both pairs.
impl Coordinates for [Vec2; 2] {
    #[inline(always)]
    fn of(self, map: &TextureRef) -> Vec2 {
        self[usize::from(map.second)]
    }
}

/// Factors times textures of a material at a point.
pub(super) struct SampledValues {
    pub(super) color: Rgb,
    pub(super) metallic: f32,
    pub(super) alpha: f32,
    pub(super) transmission: f32,
    pub(super) specular: f32,
    pub(super) specular_color: Rgb,
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
            unlit: false,
            shows_back: false,
            exact_wall: false,
            transmission: 0.0,
            ior: 1.5,
            dispersion: 0.0,
            solid: false,
            priority: 0.0,
            absorption: Rgb::ZERO,
            specular: 1.0,
            specular_color: Rgb::ONE,
            distribution: Distribution::Beckmann,
            base_color_texture: None,
            metallic_roughness_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            emissive_texture: None,
            transmission_texture: None,
            root_tint: false,
            medium: None,
            phase: None,
            finish: None,
        }
    }
}

impl Material {
    /// The BSDF without a [`Finish`] at texture coordinates `uv`; `u` in [0, 1) chooses between two where transmission
    /// is partial.
    ///
    /// A partly transmissive dielectric is the mixture t · interface + (1 − t) · coated base; drawing one of the two
    /// with its weight is unbiased and keeps every BSDF small.
    #[inline]
    pub(crate) fn bsdf(&self, textures: &[Texture], uv: Vec2, u: f32) -> Bsdf {
        self.bsdf_of(&self.sampled(textures, uv), u)
    }

    /// Factors times textures.
    #[inline(always)]
    pub(super) fn sampled(&self, textures: &[Texture], uv: impl Coordinates) -> SampledValues {
        self.sampled_over(textures, uv, None)
    }

    /// [`Material::sampled`] with the mean colour over the footprint of these half axes in texture coordinates, if any.
    #[inline(always)]
    pub(super) fn sampled_over(
        &self,
        textures: &[Texture],
        uv: impl Coordinates,
        axes: Option<[Vec2; 2]>,
    ) -> SampledValues {
        let mut color = self.base_color;
        if let Some(map) = &self.base_color_texture {
            let [r, g, b, _] = match axes {
                None => map.sample(textures, uv),
                Some(axes) => map.sample_over(textures, uv, axes),
            };
            color *= Rgb::new(r, g, b);
        }
        let (mut metallic, mut alpha) = (self.metallic, self.alpha);
        if let Some(map) = &self.metallic_roughness_texture {
            let [_, roughness, metal, _] = map.sample(textures, uv);
            metallic *= metal;
            // The texture stores √α, which is filtered before squaring as in other glTF renderers.
            alpha *= roughness * roughness;
        }
        let mut transmission = self.transmission;
        if let Some(map) = &self.transmission_texture {
            transmission *= map.sample(textures, uv)[0];
        }
        SampledValues {
            color,
            metallic,
            alpha,
            transmission,
            specular: self.specular,
            specular_color: self.specular_color,
        }
    }

    /// The BSDF for these values; see [`Material::bsdf`].
    #[inline(always)]
    pub(super) fn bsdf_of(&self, values: &SampledValues, u: f32) -> Bsdf {
        let &SampledValues {
            color,
            metallic,
            alpha,
            transmission,
            specular,
            specular_color,
        } = values;
        let distribution = self.distribution;
        let r0 = (self.ior - 1.0) / (self.ior + 1.0);
        // F = specularFactor · Schlick(min(r0² · specularColorFactor, 1), 1) [KHR_materials_specular].
        let f0 = (specular_color * (r0 * r0)).min(Rgb::ONE) * specular;
        let f90 = specular;
        if u < transmission * (1.0 - metallic) {
            return if self.solid {
                let root = || color.map(f32::sqrt);
                Bsdf::Dielectric(Dielectric {
                    eta: self.ior,
                    tint: if self.root_tint { root() } else { color },
                    alpha,
                    distribution,
                })
            } else {
                Bsdf::Thin(ThinDielectric {
                    f0: if self.exact_wall { specular_color } else { f0 },
                    f90,
                    eta: if self.exact_wall { self.ior } else { 0.0 },
                    tint: color,
                    alpha,
                    distribution,
                })
            };
        }
        if metallic == 0.0 && !self.has_coat() {
            return Bsdf::Diffuse(Diffuse { albedo: color });
        }
        let f0 = f0 + (color - f0) * metallic;
        Bsdf::Glossy(Glossy {
            f0,
            f90: f90 + (1.0 - f90) * metallic,
            albedo: color * (1.0 - metallic),
            alpha,
            distribution,
        })
    }

    /// The BSDF, if it is the same everywhere and for every `u`.
    pub(super) fn constant_bsdf(&self) -> Option<Bsdf> {
        if self.phase.is_some() {
            return self.phase_bsdf();
        }
        let transmission = self.transmission * (1.0 - self.metallic);
        let is_drawn = transmission > 0.0 && transmission < 1.0;
        let varies = self.is_textured() || self.finish.is_some() || is_drawn;
        (!varies).then(|| self.bsdf(&[], Vec2::ZERO, 0.0))
    }

    /// Emitted radiance at texture coordinates `uv`.
    #[inline]
    pub(crate) fn emission_at(&self, textures: &[Texture], uv: Vec2) -> Rgb {
        match &self.emissive_texture {
            None => self.emission,
            Some(map) => {
                let [r, g, b, _] = map.sample(textures, uv);
                self.emission * Rgb::new(r, g, b)
            }
        }
    }

    /// Mean emitted radiance over the whole emissive texture, to weigh lights.
    pub(crate) fn average_emission(&self, textures: &[Texture]) -> Rgb {
        match &self.emissive_texture {
            None => self.emission,
            Some(map) => {
                let [r, g, b, _] = textures[map.texture as usize].average();
                self.emission * Rgb::new(r, g, b)
            }
        }
    }

    /// Probability in [0, 1] that a ray hits the surface at texture coordinates `uv`.
    pub(crate) fn presence(&self, textures: &[Texture], uv: Vec2) -> f32 {
        self.presence_of(textures, uv, 1.0)
    }

    /// [`Material::presence`] of a surface with a further factor `own` of its opacity.
    pub(super) fn presence_of(&self, textures: &[Texture], uv: impl Coordinates, own: f32) -> f32 {
        let opacity = || {
            let texel = (self.base_color_texture.as_ref()).map(|map| map.sample(textures, uv)[3]);
            self.opacity * texel.unwrap_or(1.0) * own
        };
        match self.alpha_mode {
            AlphaMode::Opaque => 1.0,
            AlphaMode::Mask(cutoff) => f32::from(u8::from(opacity() >= cutoff)),
            AlphaMode::Blend => opacity().clamp(0.0, 1.0),
            AlphaMode::Unseen => 0.0,
        }
    }

    /// Factor of the emission at `uv`: the surface's presence, or 1 for an invisible lamp.
    pub(crate) fn emission_presence(&self, textures: &[Texture], uv: Vec2) -> f32 {
        match self.alpha_mode {
            AlphaMode::Unseen => 1.0,
            _ => self.presence(textures, uv),
        }
    }

    /// True if the surface is a pane: a smooth thin wall, which transmits light straight and does not emit.
    pub(crate) fn is_pane(&self) -> bool {
        !self.solid
            && self.transmission > 0.0
            && self.metallic < 1.0
            && self.alpha < DELTA_ALPHA
            && self.emission == Rgb::ZERO
            && self.finish.is_none()
    }

    /// Probability with which [`Material::bsdf`] chooses the transmissive one of two BSDFs.
    pub(crate) fn transmitted(&self, textures: &[Texture], uv: Vec2) -> f32 {
        let sample = |map: &Option<TextureRef>, channel: usize| {
            map.as_ref()
                .map_or(1.0, |map| map.sample(textures, uv)[channel])
        };
        let metallic = self.metallic * sample(&self.metallic_roughness_texture, 2);
        self.transmission * sample(&self.transmission_texture, 0) * (1.0 - metallic)
    }

    /// True if a camera does not see the back `[glTF §3.9.6]`; a camera in a body sees its boundary.
    pub(crate) fn hides_back(&self) -> bool {
        !self.double_sided && !self.shows_back && !self.bounds_body()
    }

    /// True if the surface bounds a body that light enters and leaves.
    pub fn bounds_body(&self) -> bool {
        self.solid && self.transmits()
    }

    /// True if some of the light goes through the surface.
    pub(crate) fn transmits(&self) -> bool {
        self.transmission > 0.0 && self.metallic < 1.0
    }

    /// True if the surface bounds a body and does not change light, provided that `ior` is relative to the outside.
    pub(crate) fn is_null(&self) -> bool {
        self.bounds_body() && is_matched(self.ior) && self.is_clear() && self.emission == Rgb::ZERO
    }

    /// True if [`Scene::bsdf`](crate::scene::Scene::bsdf) chooses between two BSDFs somewhere on the surface.
    pub(crate) fn chooses_bsdf(&self) -> bool {
        let always =
            self.transmission == 1.0 && self.transmission_texture.is_none() && self.metallic == 0.0;
        self.transmits() && !always || self.is_covered()
    }

    /// True if the surface only reflects and refracts light, equally for all colours.
    pub(crate) fn is_clear(&self) -> bool {
        self.transmission == 1.0
            && self.dispersion == 0.0
            && self.transmission_texture.is_none()
            && self.base_color == Rgb::ONE
            && self.base_color_texture.is_none()
            && self.metallic == 0.0
            && self.finish.is_none()
    }

    /// True if the coat of the dielectric reflects anything.
    fn has_coat(&self) -> bool {
        self.specular != 0.0 && self.ior != 1.0
    }

    /// True for a Lambertian material: a dielectric whose coat reflects nothing.
    pub fn is_lambert(&self) -> bool {
        self.metallic == 0.0 && self.transmission == 0.0 && !self.has_coat() && !self.is_covered()
    }

    /// Indices of refraction of red, green and blue: Cauchy's formula by the Abbe number V, n(λ) = n + (n − 1)/V
    /// (523655 nm²/λ² − 1.5168) but at least 1 `[KHR_materials_dispersion]`, at the lines C, d and F (656.27, 587.56
    /// and 486.13 nm) that define V.
    pub(crate) fn iors(&self) -> [f32; 3] {
        [656.27f32, 587.56, 486.13].map(|wavelength| {
            let cauchy = 523_655.0 / (wavelength * wavelength) - 1.5168;
            (self.ior + (self.ior - 1.0) * (self.dispersion / 20.0) * cauchy).max(1.0)
        })
    }

    /// The texture that its mean over a pixel may replace: the base colour's, if the scattered light is linear in it
    /// and no other texture varies with it. The mean of a product is not the product of means: metallic, transparent or
    /// bumped parts often have another colour.
    pub(super) fn filtered(&self, textures: &[Texture]) -> Option<u32> {
        let map = self.base_color_texture.as_ref()?;
        let alone = self.finish.is_none()
            && self.alpha_mode == AlphaMode::Opaque
            && self.transmission == 0.0
            && self.normal_texture.is_none();
        let dielectric = |rough: &TextureRef| {
            let texture = textures.get(rough.texture as usize);
            self.metallic == 0.0 || texture.is_some_and(|t| t.is_black(2))
        };
        let linear = self
            .metallic_roughness_texture
            .as_ref()
            .is_none_or(dielectric);
        (alone && linear).then_some(map.texture)
    }

    /// True if any texture varies over the surface.
    pub fn is_textured(&self) -> bool {
        let maps = [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.normal_texture,
            &self.emissive_texture,
            &self.transmission_texture,
        ];
        let finish = self.finish.as_ref();
        finish.is_some_and(|finish| finish.textures().next().is_some())
            || maps.iter().any(|map| map.is_some())
    }

    /// True if no lobe of the material can be roughened.
    pub(crate) fn is_rough(&self) -> bool {
        self.is_lambert()
            || (self.alpha >= 1.0
                && self.metallic_roughness_texture.is_none()
                && self.clearcoat().is_none()
                && (self.finish.as_ref()).is_none_or(|finish| finish.mix.is_none()))
    }
}

impl TextureRef {
    /// Linear values at texture coordinates `uv`.
    #[inline]
    pub(crate) fn sample(&self, textures: &[Texture], uv: impl Coordinates) -> [f32; 4] {
        textures[self.texture as usize].sample(self.transform.transform_point2(uv.of(self)))
    }

    /// The mean colour over a footprint with these half axes in the mesh's texture coordinates.
    fn sample_over(&self, textures: &[Texture], uv: impl Coordinates, axes: [Vec2; 2]) -> [f32; 4] {
        let uv = self.transform.transform_point2(uv.of(self));
        let axes = axes.map(|axis| self.transform.transform_vector2(axis));
        textures[self.texture as usize].sample_over(uv, axes)
    }
}

/// True if opacity may remove a hit on the material.
pub(super) fn may_vanish(material: &Material) -> bool {
    let painted = (material.finish.as_ref()).is_some_and(|finish| finish.has_colors);
    let textured = material.base_color_texture.is_some() || painted;
    match material.alpha_mode {
        AlphaMode::Opaque => false,
        AlphaMode::Mask(cutoff) => textured || material.opacity < cutoff,
        AlphaMode::Blend => textured || material.opacity < 1.0,
        AlphaMode::Unseen => true,
    }
}
