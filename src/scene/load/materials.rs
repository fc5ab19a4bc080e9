//! Materials: factors, extensions, and uses of textures.

use super::error::{Result, Warnings, fault, place};
use super::mesh::MaterialInfo;
use super::textures::Requests;
use crate::bsdf::Distribution;
use crate::math::Rgb;
use crate::scene::finish::{Anisotropy, Clearcoat, FilmCover, SheenCover, Translucency};
use crate::scene::material::{AlphaMode, TextureRef};
use crate::scene::{Material, Medium};
use glam::{Affine2, Vec2};
use gltf::json::extensions::material as ext;
use gltf::json::extensions::texture::TextureTransform;
use gltf::json::material::AlphaMode as Alpha;
use gltf::json::texture::Info;
use gltf::json::validation::Checked;
use gltf::json::{self, Root};
use serde::Deserialize;

/// Emitted radiance whose square still fits into single precision, in which pictures store variances.
const LARGEST_EMISSION: f32 = 1e19;

/// Single-scattering albedo of a medium of mean cosine g, from its multiple-scattering colour (Kulla, Conty:
/// *Revisiting Physically Based Shading at Imageworks*, SIGGRAPH 2017 courses).
fn single_albedo(many: f32, g: f32) -> f32 {
    // Rounding must not make black scatter.
    if many <= 0.0 {
        return 0.0;
    }
    let root = (9.592_17 + 41.6808 * many + 17.7126 * many * many).sqrt();
    let s = 4.097_12 + 4.208_63 * many - root;
    ((1.0 - s * s) / (1.0 - g * s * s)).clamp(0.0, 1.0)
}

/// All materials in file order, then the default material of primitives without one.
pub(super) fn materials(
    root: &Root,
    distribution: Distribution,
    requests: &mut Requests,
    warnings: &mut Warnings,
) -> Result<(Vec<Material>, Vec<MaterialInfo>)> {
    let default = json::Material::default();
    let mut materials = Vec::new();
    let mut slots = Vec::new();
    for (i, source) in root.materials.iter().chain([&default]).enumerate() {
        let mut reader = Reader {
            root,
            at: place("materials", i, source.name.as_ref()),
            requests: &mut *requests,
            warnings: &mut *warnings,
            uv_sets: [main_set(source), None],
        };
        let mut material = Material {
            distribution,
            ..reader.material(source)?
        };
        let [first, second] = reader.uv_sets;
        if second.is_some() {
            material.finish_mut().has_second_uvs = true;
        }
        slots.push(MaterialInfo {
            material: i as u32,
            uv_sets: (first.unwrap_or(0), second),
            emits: material.emission != Rgb::ZERO,
            textured: material.is_textured(),
            brushed: material.anisotropy().is_some(),
        });
        materials.push(material);
    }
    Ok((materials, slots))
}

/// The first set of texture coordinates, which light sampling and opacity use: the emissive texture's, else the base
/// colour's.
fn main_set(m: &json::Material) -> Option<u32> {
    let emits = m.emissive_factor.0 != [0.0; 3];
    let unlit = (m.extensions.as_ref()).is_some_and(|e| e.unlit.is_some());
    let emissive = m.emissive_texture.as_ref().filter(|_| emits && !unlit);
    let info = emissive.or(m.pbr_metallic_roughness.base_color_texture.as_ref())?;
    let transform = (info.extensions.as_ref()).and_then(|e| e.texture_transform.as_ref());
    Some(
        transform
            .and_then(|t| t.tex_coord)
            .unwrap_or(info.tex_coord),
    )
}

/// `KHR_materials_sheen`, for which the crate gltf has no type.
#[derive(Default, Deserialize)]
#[serde(default)]
struct SheenExtension {
    #[serde(rename = "sheenColorFactor")]
    color: [f32; 3],
    #[serde(rename = "sheenColorTexture")]
    color_texture: Option<Info>,
    #[serde(rename = "sheenRoughnessFactor")]
    roughness: f32,
    #[serde(rename = "sheenRoughnessTexture")]
    roughness_texture: Option<Info>,
}

/// `KHR_materials_diffuse_transmission`, for which the crate gltf has no type.
#[derive(Deserialize)]
#[serde(default)]
struct TranslucencyExtension {
    #[serde(rename = "diffuseTransmissionFactor")]
    factor: f32,
    #[serde(rename = "diffuseTransmissionTexture")]
    texture: Option<Info>,
    #[serde(rename = "diffuseTransmissionColorFactor")]
    color: [f32; 3],
    #[serde(rename = "diffuseTransmissionColorTexture")]
    color_texture: Option<Info>,
}

impl Default for TranslucencyExtension {
    fn default() -> Self {
        Self {
            factor: 0.0,
            texture: None,
            color: [1.0; 3],
            color_texture: None,
        }
    }
}

/// `KHR_materials_iridescence`, for which the crate gltf has no type.
#[derive(Deserialize)]
#[serde(default)]
struct IridescenceExtension {
    #[serde(rename = "iridescenceFactor")]
    factor: f32,
    #[serde(rename = "iridescenceTexture")]
    texture: Option<Info>,
    #[serde(rename = "iridescenceIor")]
    ior: f32,
    #[serde(rename = "iridescenceThicknessMinimum")]
    least: f32,
    #[serde(rename = "iridescenceThicknessMaximum")]
    most: f32,
    #[serde(rename = "iridescenceThicknessTexture")]
    thickness_texture: Option<Info>,
}

impl Default for IridescenceExtension {
    fn default() -> Self {
        Self {
            factor: 0.0,
            texture: None,
            ior: 1.3,
            least: 100.0,
            most: 400.0,
            thickness_texture: None,
        }
    }
}

/// `KHR_materials_volume_scatter`, a draft, for which the crate gltf has no type.
#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct ScatterExtension {
    multiscatter_color: [f32; 3],
    scatter_anisotropy: f32,
}

/// `KHR_materials_pbrSpecularGlossiness`, archived, whose type in the crate gltf has no texture transforms.
#[derive(Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct GlossinessExtension {
    diffuse_factor: [f32; 4],
    diffuse_texture: Option<Info>,
    specular_factor: [f32; 3],
    glossiness_factor: f32,
    specular_glossiness_texture: Option<Info>,
}

impl Default for GlossinessExtension {
    fn default() -> Self {
        Self {
            diffuse_factor: [1.0; 4],
            diffuse_texture: None,
            specular_factor: [1.0; 3],
            glossiness_factor: 1.0,
            specular_glossiness_texture: None,
        }
    }
}

/// `KHR_materials_clearcoat`, for which the crate gltf has no type.
#[derive(Default, Deserialize)]
#[serde(default)]
struct ClearcoatExtension {
    #[serde(rename = "clearcoatFactor")]
    factor: f32,
    #[serde(rename = "clearcoatTexture")]
    texture: Option<Info>,
    #[serde(rename = "clearcoatRoughnessFactor")]
    roughness_factor: f32,
    #[serde(rename = "clearcoatRoughnessTexture")]
    roughness_texture: Option<Info>,
    #[serde(rename = "clearcoatNormalTexture")]
    normal_texture: Option<json::material::NormalTexture>,
}

/// `KHR_materials_anisotropy`, for which the crate gltf has no type.
#[derive(Default, Deserialize)]
#[serde(default)]
struct AnisotropyExtension {
    #[serde(rename = "anisotropyStrength")]
    strength: f32,
    #[serde(rename = "anisotropyRotation")]
    rotation: f32,
    #[serde(rename = "anisotropyTexture")]
    texture: Option<Info>,
}

/// Reads one material.
struct Reader<'a> {
    root: &'a Root,
    at: String,
    requests: &'a mut Requests,
    warnings: &'a mut Warnings,
    /// Texture coordinate sets of the textures, at most two.
    uv_sets: [Option<u32>; 2],
}

impl Reader<'_> {
    fn material(&mut self, m: &json::Material) -> Result<Material> {
        let pbr = &m.pbr_metallic_roughness;
        let [r, g, b, opacity] = pbr.base_color_factor.0;
        let color = [
            self.fraction("baseColorFactor", r)?,
            self.fraction("baseColorFactor", g)?,
            self.fraction("baseColorFactor", b)?,
        ];
        let roughness = self.fraction("roughnessFactor", pbr.roughness_factor.0)?;
        let mut out = Material {
            name: m.name.clone().unwrap_or_default(),
            base_color: color.into(),
            opacity: self.fraction("baseColorFactor", opacity)?,
            alpha_mode: self.alpha_mode(m)?,
            metallic: self.fraction("metallicFactor", pbr.metallic_factor.0)?,
            // The file's roughness is perceptual [glTF §3.9.2].
            alpha: roughness * roughness,
            emission: self.colour("emissiveFactor", m.emissive_factor.0)?,
            double_sided: m.double_sided,
            base_color_texture: self.info(
                "baseColorTexture",
                pbr.base_color_texture.as_ref(),
                true,
            )?,
            metallic_roughness_texture: self.info(
                "metallicRoughnessTexture",
                pbr.metallic_roughness_texture.as_ref(),
                false,
            )?,
            emissive_texture: self.info("emissiveTexture", m.emissive_texture.as_ref(), true)?,
            ..Material::default()
        };
        if let Some(normal) = &m.normal_texture {
            let (map, scale) = self.normal_map("normalTexture", normal)?;
            (out.normal_texture, out.normal_scale) = (Some(map), scale);
        }
        if let Some(extensions) = &m.extensions {
            self.extensions(extensions, &mut out)?;
        }
        out.priority = self.priority(m);
        if let Some(lamp) = super::lamp::lamp(m, &self.at, self.warnings) {
            out.finish_mut().lamp = Some(lamp);
        }
        Ok(out)
    }

    fn extensions(&mut self, e: &ext::Material, out: &mut Material) -> Result<()> {
        if let Some(strength) = &e.emissive_strength {
            out.emission *= self.positive("emissiveStrength", strength.emissive_strength.0)?;
            self.colour("emission", out.emission.to_array())?;
            if out.emission.max_element() > LARGEST_EMISSION {
                self.warnings.say(format!(
                    "{}: emissiveStrength {:e} is so large that variances in the picture may be cut",
                    self.at, strength.emissive_strength.0
                ));
            }
        }
        self.interface(e, out)?;
        if let Some(value) = e.others.get("KHR_materials_clearcoat") {
            self.clearcoat(value, out)?;
        }
        if let Some(value) = e.others.get("KHR_materials_anisotropy") {
            self.anisotropy(value, out)?;
        }
        if let Some(value) = e.others.get("KHR_materials_sheen") {
            self.sheen(value, out)?;
        }
        if let Some(value) = e.others.get("KHR_materials_diffuse_transmission") {
            self.translucency(value, out)?;
        }
        if let Some(value) = e.others.get("KHR_materials_volume_scatter") {
            self.scatter(value, out)?;
        }
        if let Some(value) = e.others.get("KHR_materials_iridescence") {
            self.iridescence(value, out)?;
        }
        if let Some(value) = e.others.get("KHR_materials_pbrSpecularGlossiness") {
            self.glossiness(value, out)?;
        }
        if let Some(value) = e.others.get("KHR_materials_dispersion") {
            let dispersion = value.get("dispersion").map_or(Some(0.0), |x| x.as_f64());
            let dispersion =
                dispersion.ok_or_else(|| fault(&self.at, "dispersion is no number"))?;
            out.dispersion = self.positive("dispersion", dispersion as f32)?;
        }
        if out.ior == 0.0 {
            // An infinite index: everything is reflected [KHR_materials_ior].
            out.transmission = 0.0;
        }
        if e.unlit.is_some() {
            self.warnings
                .say("KHR_materials_unlit: shown as emission, which also lights the scene");
            *out = Material {
                emission: out.base_color,
                emissive_texture: out.base_color_texture,
                base_color: Rgb::ZERO,
                specular: 0.0,
                metallic: 0.0,
                transmission: 0.0,
                finish: None,
                unlit: true,
                normal_texture: None,
                ..std::mem::take(out)
            };
        }
        Ok(())
    }

    /// Index of refraction, reflectance, transmission and the inside of a body.
    fn interface(&mut self, e: &ext::Material, out: &mut Material) -> Result<()> {
        if let Some(ior) = &e.ior {
            out.ior = ior.ior.0;
            if !(out.ior.is_finite() && (out.ior == 0.0 || out.ior >= 1.0)) {
                let what = format!("ior is {}, neither 0 nor at least 1", out.ior);
                return Err(fault(&self.at, what));
            }
        }
        if let Some(specular) = &e.specular {
            out.specular = self.fraction("specularFactor", specular.specular_factor.0)?;
            out.specular_color =
                self.colour("specularColorFactor", specular.specular_color_factor.0)?;
            let weight = specular.specular_texture.as_ref();
            let color = specular.specular_color_texture.as_ref();
            let weight = self.info("specularTexture", weight, false)?;
            let color = self.info("specularColorTexture", color, true)?;
            if weight.is_some() || color.is_some() {
                let maps = &mut out.finish_mut().specular;
                (maps.weight, maps.color) = (weight, color);
            }
        }
        if let Some(transmission) = &e.transmission {
            out.transmission =
                self.fraction("transmissionFactor", transmission.transmission_factor.0)?;
            out.transmission_texture = self.info(
                "transmissionTexture",
                transmission.transmission_texture.as_ref(),
                false,
            )?;
        }
        if let Some(volume) = &e.volume {
            out.solid = self.positive("thicknessFactor", volume.thickness_factor.0)? > 0.0;
            out.absorption = self.absorption(volume)?;
        }
        Ok(())
    }

    fn sheen(&mut self, value: &json::Value, out: &mut Material) -> Result<()> {
        let read: SheenExtension = self.untyped("KHR_materials_sheen", value)?;
        let roughness = self.fraction("sheenRoughnessFactor", read.roughness)?;
        let color = self.colour("sheenColorFactor", read.color)?.min(Rgb::ONE);
        let cover = SheenCover {
            color,
            alpha: roughness * roughness,
            color_texture: self.info("sheenColorTexture", read.color_texture.as_ref(), true)?,
            roughness_texture: self.info(
                "sheenRoughnessTexture",
                read.roughness_texture.as_ref(),
                false,
            )?,
        };
        if color != Rgb::ZERO {
            out.finish_mut().sheen = Some(cover);
        }
        Ok(())
    }

    fn translucency(&mut self, value: &json::Value, out: &mut Material) -> Result<()> {
        let read: TranslucencyExtension =
            self.untyped("KHR_materials_diffuse_transmission", value)?;
        let color = self.colour("diffuseTransmissionColorFactor", read.color)?;
        let map = read.color_texture.as_ref();
        let through = Translucency {
            weight: self.fraction("diffuseTransmissionFactor", read.factor)?,
            color: color.min(Rgb::ONE),
            texture: self.info("diffuseTransmissionTexture", read.texture.as_ref(), false)?,
            color_texture: self.info("diffuseTransmissionColorTexture", map, true)?,
            keeps_base: false,
        };
        if through.weight == 0.0 {
            return Ok(());
        }
        if out.solid {
            let how = match out.transmission > 0.0 {
                true => "diffuse transmission of glass is left out",
                false => {
                    "diffuse transmission is that of a thin sheet, without the inside of a body"
                }
            };
            self.warnings.say(format!("{}: {how}", self.at));
            if out.transmission > 0.0 {
                return Ok(());
            }
        }
        out.finish_mut().translucency = Some(through);
        Ok(())
    }

    /// Reads a scattering body, whose attenuation is its extinction [KHR_materials_volume_scatter].
    fn scatter(&mut self, value: &json::Value, out: &mut Material) -> Result<()> {
        let read: ScatterExtension = self.untyped("KHR_materials_volume_scatter", value)?;
        let colour = self.colour("multiscatterColor", read.multiscatter_color)?;
        let g = read.scatter_anisotropy;
        if g.is_nan() || g.abs() >= 1.0 {
            let what = format!("scatterAnisotropy is {g}, not between −1 and 1");
            return Err(fault(&self.at, what));
        }
        let albedo = colour.map(|c| single_albedo(c.min(1.0), g));
        if out.solid && albedo != Rgb::ZERO {
            out.medium = Some(Box::new(Medium {
                absorption: out.absorption * (Rgb::ONE - albedo),
                scattering: out.absorption * albedo,
                mean_cosine: g,
            }));
        }
        Ok(())
    }

    fn iridescence(&mut self, value: &json::Value, out: &mut Material) -> Result<()> {
        let read: IridescenceExtension = self.untyped("KHR_materials_iridescence", value)?;
        let ior = self.positive("iridescenceIor", read.ior)?;
        if ior < 1.0 {
            return Err(fault(&self.at, format!("iridescenceIor is {ior}, below 1")));
        }
        let least = self.positive("iridescenceThicknessMinimum", read.least)?;
        let most = self.positive("iridescenceThicknessMaximum", read.most)?;
        let map = read.thickness_texture.as_ref();
        let cover = FilmCover {
            weight: self.fraction("iridescenceFactor", read.factor)?,
            ior,
            thickness: [least, most],
            texture: self.info("iridescenceTexture", read.texture.as_ref(), false)?,
            thickness_texture: self.info("iridescenceThicknessTexture", map, false)?,
        };
        if cover.weight > 0.0 {
            out.finish_mut().film = Some(cover);
        }
        Ok(())
    }

    /// The archived forerunner of metallic-roughness: a base and the colour of its reflectance. An index of 0 makes
    /// that colour the reflectance at normal incidence [KHR_materials_ior].
    fn glossiness(&mut self, value: &json::Value, out: &mut Material) -> Result<()> {
        let name = "KHR_materials_pbrSpecularGlossiness";
        let read: GlossinessExtension = self.untyped(name, value)?;
        let [r, g, b, opacity] = read.diffuse_factor;
        out.base_color = self.colour("diffuseFactor", [r, g, b])?.min(Rgb::ONE);
        out.opacity = self.fraction("diffuseFactor", opacity)?;
        out.base_color_texture =
            self.info("diffuseTexture", read.diffuse_texture.as_ref(), true)?;
        let specular = self.colour("specularFactor", read.specular_factor)?;
        (out.specular, out.specular_color, out.ior) = (1.0, specular.min(Rgb::ONE), 0.0);
        (out.metallic, out.metallic_roughness_texture) = (0.0, None);
        let glossiness = self.fraction("glossinessFactor", read.glossiness_factor)?;
        out.alpha = (1.0 - glossiness) * (1.0 - glossiness);
        let map = read.specular_glossiness_texture.as_ref();
        if let Some(map) = self.info("specularGlossinessTexture", map, true)? {
            let maps = &mut out.finish_mut().specular;
            (maps.color, maps.gloss) = (Some(map), Some((map, glossiness)));
        }
        Ok(())
    }

    fn clearcoat(&mut self, value: &json::Value, out: &mut Material) -> Result<()> {
        let coat: ClearcoatExtension = self.untyped("KHR_materials_clearcoat", value)?;
        let weight = self.fraction("clearcoatFactor", coat.factor)?;
        let roughness = self.fraction("clearcoatRoughnessFactor", coat.roughness_factor)?;
        let map = coat.roughness_texture.as_ref();
        let mut read = Clearcoat {
            weight,
            alpha: roughness * roughness,
            texture: self.info("clearcoatTexture", coat.texture.as_ref(), false)?,
            roughness_texture: self.info("clearcoatRoughnessTexture", map, false)?,
            ..Clearcoat::default()
        };
        if let Some(normal) = &coat.normal_texture {
            let (map, scale) = self.normal_map("clearcoatNormalTexture", normal)?;
            (read.normal_texture, read.normal_scale) = (Some(map), scale);
        }
        if weight > 0.0 {
            out.finish_mut().clearcoat = Some(read);
        }
        Ok(())
    }

    fn anisotropy(&mut self, value: &json::Value, out: &mut Material) -> Result<()> {
        let read: AnisotropyExtension = self.untyped("KHR_materials_anisotropy", value)?;
        let strength = self.fraction("anisotropyStrength", read.strength)?;
        if !read.rotation.is_finite() {
            return Err(fault(&self.at, "anisotropyRotation is not finite"));
        }
        let texture = self.info("anisotropyTexture", read.texture.as_ref(), false)?;
        if strength > 0.0 {
            out.finish_mut().anisotropy = Some(Anisotropy {
                strength,
                rotation: read.rotation,
                texture,
            });
        }
        Ok(())
    }

    /// Parses an extension for which the crate gltf has no type.
    fn untyped<T: serde::de::DeserializeOwned>(
        &self,
        name: &str,
        value: &json::Value,
    ) -> Result<T> {
        json::deserialize::from_value(value.clone())
            .map_err(|e| fault(format!("{}.{name}", self.at), e.to_string()))
    }

    /// The priority among overlapping bodies, a number in the material's `extras`.
    fn priority(&mut self, m: &json::Material) -> f32 {
        let extras = (m.extras.as_ref()).and_then(|e| json::deserialize::from_str(e.get()).ok());
        let Some(value) = extras
            .as_ref()
            .and_then(|e: &json::Value| e.get("priority"))
        else {
            return 0.0;
        };
        match value.as_f64() {
            Some(priority) => priority as f32,
            None => {
                let line = format!("{}: extras.priority is no number, and ignored", self.at);
                self.warnings.say(line);
                0.0
            }
        }
    }

    /// Beer-Lambert absorption: the attenuation colour is the transmittance over the attenuation distance
    /// [KHR_materials_volume].
    fn absorption(&self, volume: &ext::Volume) -> Result<Rgb> {
        let distance = volume.attenuation_distance.0;
        if distance.is_nan() || distance <= 0.0 {
            let what = format!("attenuationDistance is {distance}, not above 0");
            return Err(fault(&self.at, what));
        }
        let mut absorption = Rgb::ZERO;
        for (i, c) in volume.attenuation_color.0.into_iter().enumerate() {
            // Black would absorb infinitely fast, and 0 · ∞ is not a number.
            let left = self.fraction("attenuationColor", c)?.max(f32::MIN_POSITIVE);
            absorption[i] = (-left.ln() / distance).clamp(0.0, f32::MAX);
        }
        Ok(absorption)
    }

    fn alpha_mode(&self, m: &json::Material) -> Result<AlphaMode> {
        match m.alpha_mode {
            Checked::Valid(Alpha::Opaque) => Ok(AlphaMode::Opaque),
            Checked::Valid(Alpha::Blend) => Ok(AlphaMode::Blend),
            Checked::Valid(Alpha::Mask) => {
                let cutoff = m.alpha_cutoff.map_or(0.5, |c| c.0);
                Ok(AlphaMode::Mask(self.positive("alphaCutoff", cutoff)?))
            }
            Checked::Invalid => Err(fault(&self.at, "unknown alphaMode")),
        }
    }

    /// A number from 0 to 1, with a tolerance for rounding.
    fn fraction(&self, name: &str, x: f32) -> Result<f32> {
        if !(-1e-3..=1.001).contains(&x) {
            return Err(fault(&self.at, format!("{name} is {x}, not from 0 to 1")));
        }
        Ok(x.clamp(0.0, 1.0))
    }

    /// A finite number that is not negative.
    fn positive(&self, name: &str, x: f32) -> Result<f32> {
        if !x.is_finite() || x < 0.0 {
            return Err(fault(
                &self.at,
                format!("{name} is {x}, negative or not finite"),
            ));
        }
        Ok(x)
    }

    fn colour(&self, name: &str, c: [f32; 3]) -> Result<Rgb> {
        c.into_iter()
            .try_for_each(|x| self.positive(name, x).map(drop))?;
        Ok(c.into())
    }

    fn info(&mut self, name: &str, info: Option<&Info>, srgb: bool) -> Result<Option<TextureRef>> {
        let Some(info) = info else {
            return Ok(None);
        };
        let transform = (info.extensions.as_ref()).and_then(|e| e.texture_transform.as_ref());
        self.texture(name, info.index.value(), info.tex_coord, transform, srgb)
            .map(Some)
    }

    /// A normal map and its scale.
    fn normal_map(
        &mut self,
        name: &str,
        normal: &json::material::NormalTexture,
    ) -> Result<(TextureRef, f32)> {
        // The crate gltf has no type for this use of the extension.
        let value =
            (normal.extensions.as_ref()).and_then(|e| e.others.get("KHR_texture_transform"));
        let transform = value
            .map(|v| json::deserialize::from_value::<TextureTransform>(v.clone()))
            .transpose()
            .map_err(|e| fault(format!("{}.{name}", self.at), e.to_string()))?;
        let (index, set) = (normal.index.value(), normal.tex_coord);
        if !normal.scale.is_finite() {
            return Err(fault(&self.at, format!("{name}.scale is not finite")));
        }
        let map = self.texture(name, index, set, transform.as_ref(), false)?;
        Ok((map, normal.scale))
    }

    fn texture(
        &mut self,
        name: &str,
        index: usize,
        set: u32,
        transform: Option<&TextureTransform>,
        srgb: bool,
    ) -> Result<TextureRef> {
        let set = transform.and_then(|t| t.tex_coord).unwrap_or(set);
        let [first, second] = &mut self.uv_sets;
        let is_second = *first.get_or_insert(set) != set;
        if is_second && *second.get_or_insert(set) != set {
            let what = "a third TEXCOORD set is in use: the second is shown";
            self.warnings
                .group("textures", format!("{}.{name}", self.at), what);
        }
        let affine = transform.map_or(Affine2::IDENTITY, |t| {
            // Counter-clockwise with v pointing down. The extension's listing turns the other way; its prose, its test
            // model and the viewers agree on this one (KhronosGroup/glTF#1563).
            let angle = -t.rotation.0;
            Affine2::from_scale_angle_translation(
                Vec2::from(t.scale.0),
                angle,
                Vec2::from(t.offset.0),
            )
        });
        if !affine.is_finite() {
            return Err(fault(
                format!("{}.{name}", self.at),
                "KHR_texture_transform is not finite",
            ));
        }
        let texture = self.requests.texture(self.root, index, srgb)?;
        Ok(TextureRef {
            texture,
            transform: affine,
            second: is_second,
        })
    }
}
