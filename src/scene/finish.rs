//! Finish of a material: clear coat, sheen, film, brushing and other properties that few materials have.

use super::lamp::Lamp;
use super::material::{Coordinates, Material, SampledValues, TextureRef};
use super::{Scene, SceneParts, Surface, Texture};
use crate::bsdf::fresnel::{conductor, dielectric_average};
use crate::bsdf::{
    Bsdf, Covers, Diffuse, Film, FresnelGlossy, Glossy, Interface, Sheen, anisotropic, covered,
    iridescent, translucent,
};
use crate::math::{Frame, Rgb, Vec2};

/// Rare parts of a material, which are not read at every hit.
#[derive(Clone, Debug, Default)]
pub struct Finish {
    /// Clear coat over everything else.
    pub clearcoat: Option<Clearcoat>,
    /// Brushing of the glossy lobe; transmitting surfaces ignore it.
    pub anisotropy: Option<Anisotropy>,
    /// Fibres on the surface.
    pub sheen: Option<SheenCover>,
    /// Thin film on the surface.
    pub film: Option<FilmCover>,
    /// Reflection by Fresnel's equations.
    pub exact: Option<ExactCover>,
    /// Light that the base scatters on its other side.
    pub translucency: Option<Translucency>,
    /// Another material that replaces this one on a share of the surface.
    pub mix: Option<Mix>,
    /// Textures of the reflectance of a dielectric.
    pub specular: SpecularMaps,
    /// Properties of a lamp, if it is one.
    pub lamp: Option<Lamp>,
    /// True if meshes of the material have colours, which multiply its own.
    pub has_colors: bool,
    /// True if a texture takes the second pair of coordinates.
    pub has_second_uvs: bool,
}

/// Textures of `KHR_materials_specular`, and of its forerunner `KHR_materials_pbrSpecularGlossiness`.
#[derive(Clone, Debug, Default)]
pub struct SpecularMaps {
    /// Factor of the weight in alpha.
    pub weight: Option<TextureRef>,
    /// Factor of the colour (sRGB).
    pub color: Option<TextureRef>,
    /// Glossiness (1 − perceptual roughness) in alpha, times this factor; replaces the roughness of the material.
    pub gloss: Option<(TextureRef, f32)>,
}

/// Sheen of a material `[KHR_materials_sheen]`.
#[derive(Clone, Debug, Default)]
pub struct SheenCover {
    /// Colour in [0, 1].
    pub color: Rgb,
    /// Roughness in [0, 1].
    pub alpha: f32,
    /// Colour (sRGB).
    pub color_texture: Option<TextureRef>,
    /// Perceptual roughness in alpha.
    pub roughness_texture: Option<TextureRef>,
}

/// Thin film on a material `[KHR_materials_iridescence]`.
#[derive(Clone, Debug, Default)]
pub struct FilmCover {
    /// Weight in [0, 1].
    pub weight: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Thickness in nanometres for texture values of 0 and 1; the latter without a texture.
    pub thickness: [f32; 2],
    /// Weight in red.
    pub texture: Option<TextureRef>,
    /// Thickness in green.
    pub thickness_texture: Option<TextureRef>,
}

/// Diffuse transmission `[KHR_materials_diffuse_transmission]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Translucency {
    /// Share of the base that transmits in place of reflecting, in [0, 1].
    pub weight: f32,
    /// Transmittance of that share.
    pub color: Rgb,
    /// Factor of the weight in alpha.
    pub texture: Option<TextureRef>,
    /// Factor of the colour (sRGB).
    pub color_texture: Option<TextureRef>,
    /// True if the base reflects its whole colour, false if it reflects 1 − weight of it.
    pub keeps_base: bool,
}

/// Reflection by Fresnel's equations; the base colour is the albedo under a coat, or a factor of a metal's reflectance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExactCover {
    /// A metal of index `eta` + i `k` relative to the outside.
    Metal {
        /// Real part.
        eta: Rgb,
        /// Extinction coefficient.
        k: Rgb,
    },
    /// A clear layer of the material's index over a Lambertian base.
    Coat {
        /// Mean reflectance of the layer over the cosine-weighted hemisphere, from outside and from inside; the latter
        /// is 0 if interreflection between base and layer does not saturate the colour.
        averages: [f32; 2],
    },
}

impl ExactCover {
    /// A layer of index `eta`; with `saturates`, interreflection between base and layer saturates the base's colour.
    pub fn coat(eta: f32, saturates: bool) -> Self {
        let outside = dielectric_average(eta);
        let inside = 1.0 - (1.0 - outside) / (eta * eta);
        let inside = if saturates { inside } else { 0.0 };
        Self::Coat {
            averages: [outside, inside],
        }
    }

    /// Effective albedo of a base under the cover, for light that the cover transmits: a + a² r + … by interreflection
    /// with the layer, over the same sum of a white base. Unchanged for a metal.
    pub fn effective_albedo(&self, albedo: Rgb) -> Rgb {
        match *self {
            Self::Metal { .. } => albedo,
            Self::Coat {
                averages: [_, inside],
            } => albedo * (1.0 - inside) / (Rgb::ONE - albedo * inside),
        }
    }
}

/// A second material on a share of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mix {
    /// Index of the other material, which is no mixture itself.
    pub other: u32,
    /// Its share in [0, 1].
    pub weight: f32,
    /// Factor of that share in red.
    pub texture: Option<TextureRef>,
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
    /// Tangent-space normal map of the coat, which does not use the map of its base.
    pub normal_texture: Option<TextureRef>,
    /// Scale of the normal map's x and y.
    pub normal_scale: f32,
}

/// Brushing of a material `[KHR_materials_anisotropy]`.
#[derive(Clone, Debug, Default)]
pub struct Anisotropy {
    /// Strength in [0, 1].
    pub strength: f32,
    /// Angle in radians from the tangent to the rougher direction, counter-clockwise.
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

    /// The glossy BSDF `lobe` with the brushing at this point.
    fn brushed(&self, scene: &Scene, surface: &Surface, uv: [Vec2; 2], lobe: Glossy) -> Bsdf {
        let parts = scene.parts();
        let (mut strength, mut direction) = (self.strength, Vec2::X);
        if let Some(map) = &self.texture {
            let [x, y, b, _] = map.sample(&parts.textures, uv);
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

    /// Light that the base scatters on its other side.
    pub fn translucency(&self) -> Option<&Translucency> {
        self.finish.as_ref()?.translucency.as_ref()
    }

    /// True if the material has a clear coat or a sheen, or is a mixture.
    pub(super) fn is_covered(&self) -> bool {
        let covered = |finish: &Finish| finish.covers() || finish.mix.is_some();
        self.finish.as_deref().is_some_and(covered)
    }

    /// The brushing.
    #[inline]
    pub fn anisotropy(&self) -> Option<&Anisotropy> {
        self.finish.as_ref()?.anisotropy.as_ref()
    }

    /// Roughness by which tables classify the glossy lobe, without textures: the geometric mean of a brushed one's.
    pub fn lobe_alpha(&self) -> f32 {
        let alphas = |a: &Anisotropy| Anisotropy::alphas(self.alpha, a.strength);
        self.anisotropy().map_or(self.alpha, |a| {
            let [along, across] = alphas(a);
            (along * across).sqrt()
        })
    }

    /// The finish, which is added if there is none.
    pub fn finish_mut(&mut self) -> &mut Finish {
        self.finish.get_or_insert_default()
    }
}

impl Finish {
    /// True if a coat or a sheen lies on the base.
    pub(super) fn covers(&self) -> bool {
        self.clearcoat.is_some() || self.sheen.is_some()
    }

    pub(super) fn textures(&self) -> impl Iterator<Item = &TextureRef> {
        let coat = self
            .clearcoat
            .as_ref()
            .map(|coat| [&coat.texture, &coat.roughness_texture, &coat.normal_texture]);
        let brushing = self.anisotropy.as_ref().map(|a| &a.texture);
        let sheen = (self.sheen.as_ref()).map(|s| [&s.color_texture, &s.roughness_texture]);
        let film = (self.film.as_ref()).map(|f| [&f.texture, &f.thickness_texture]);
        let specular = [&self.specular.weight, &self.specular.color];
        let pairs = sheen.into_iter().chain(film).chain([specular]).flatten();
        let gloss = self.specular.gloss.as_ref().map(|(map, _)| map);
        let mix = self.mix.as_ref().and_then(|mix| mix.texture.as_ref());
        let through = (self.translucency.as_ref()).map(|t| [&t.texture, &t.color_texture]);
        let pairs = pairs.chain(through.into_iter().flatten());
        let known = coat.into_iter().flatten().chain(brushing).chain(pairs);
        known.flatten().chain(gloss).chain(mix)
    }

    /// True if a point needs more of its mesh than one pair of texture coordinates.
    pub(super) fn needs_attributes(&self) -> bool {
        self.has_colors || self.has_second_uvs
    }

    /// Replaces Schlick's approximation by Fresnel's equations if the material has [`Finish::exact`]. A brushed metal
    /// keeps the approximation, with its exact reflectance at normal incidence.
    fn exactly(&self, material: &Material, base: Bsdf) -> Bsdf {
        let (tint, lobe) = match (&self.exact, base) {
            (Some(_), Bsdf::Glossy(lobe)) => (material.specular_color, lobe),
            _ => return base,
        };
        let interface = match self.exact {
            Some(ExactCover::Metal { eta, k }) if self.anisotropy.is_some() => {
                let of = |c: usize| conductor(1.0, eta[c], k[c]);
                let f0 = lobe.f0 * Rgb::new(of(0), of(1), of(2));
                return Bsdf::Glossy(Glossy { f0, ..lobe });
            }
            Some(ExactCover::Metal { eta, k }) => Interface::Metal { eta, k },
            Some(
                cover @ ExactCover::Coat {
                    averages: [average, _],
                },
            ) => Interface::Coat {
                eta: material.ior,
                albedo: cover.effective_albedo(lobe.albedo),
                average,
            },
            None => return base,
        };
        Bsdf::FresnelGlossy(FresnelGlossy {
            tint: match interface {
                Interface::Metal { .. } => lobe.f0,
                Interface::Coat { .. } => tint,
            },
            interface,
            alpha: lobe.alpha,
            distribution: lobe.distribution,
        })
    }

    /// Applies the textures of the dielectric's reflectance.
    fn reflect(&self, values: &mut SampledValues, textures: &[Texture], uv: [Vec2; 2]) {
        if let Some(map) = &self.specular.weight {
            values.specular *= map.sample(textures, uv)[3];
        }
        if let Some(map) = &self.specular.color {
            let [r, g, b, _] = map.sample(textures, uv);
            values.specular_color *= Rgb::new(r, g, b);
        }
        if let Some((map, factor)) = &self.specular.gloss {
            let roughness = 1.0 - factor * map.sample(textures, uv)[3];
            values.alpha = roughness * roughness;
        }
    }
}

impl SheenCover {
    fn at(&self, textures: &[Texture], uv: [Vec2; 2]) -> Sheen {
        let (mut color, mut alpha) = (self.color, self.alpha);
        if let Some(map) = &self.color_texture {
            let [r, g, b, _] = map.sample(textures, uv);
            color *= Rgb::new(r, g, b);
        }
        if let Some(map) = &self.roughness_texture {
            let roughness = map.sample(textures, uv)[3];
            alpha *= roughness * roughness;
        }
        Sheen { color, alpha }
    }
}

impl Translucency {
    /// The BSDF `base` of a material of this metalness, with diffuse transmission added.
    fn over(&self, metallic: f32, base: Bsdf, textures: &[Texture], uv: [Vec2; 2]) -> Bsdf {
        let (mut weight, mut color) = (self.weight, self.color);
        if let Some(map) = &self.texture {
            weight *= map.sample(textures, uv)[3];
        }
        if let Some(map) = &self.color_texture {
            let [r, g, b, _] = map.sample(textures, uv);
            color *= Rgb::new(r, g, b);
        }
        let kept = if self.keeps_base { 1.0 } else { 1.0 - weight };
        let base = match base {
            Bsdf::Diffuse(l) => Bsdf::Diffuse(Diffuse {
                albedo: l.albedo * kept,
            }),
            Bsdf::Glossy(l) => Bsdf::Glossy(Glossy {
                albedo: l.albedo * kept,
                ..l
            }),
            other => return other,
        };
        translucent(base, color * (weight * (1.0 - metallic)))
    }
}

impl FilmCover {
    fn at(&self, textures: &[Texture], uv: [Vec2; 2]) -> Film {
        let [least, most] = self.thickness;
        let sample = |map: &Option<TextureRef>, channel: usize| {
            (map.as_ref()).map_or(1.0, |map| map.sample(textures, uv)[channel])
        };
        Film {
            weight: self.weight * sample(&self.texture, 0),
            ior: self.ior,
            thickness: least + (most - least) * sample(&self.thickness_texture, 1),
        }
    }
}

impl Clearcoat {
    /// Weight and roughness at texture coordinates.
    fn at(&self, textures: &[Texture], uv: impl Coordinates) -> [f32; 2] {
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

    /// Sets the shading normal of the surface to the coat's.
    fn set_coat_normal(&self, scene: &Scene, base: &Material, surface: &mut Surface) {
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
        let mut u = u;
        let mut material = &materials[surface.material as usize];
        if let Some(mix) = &finish.mix {
            let share =
                (mix.texture.as_ref()).map_or(1.0, |map| map.sample(textures, [surface.uv; 2])[0]);
            let share = (mix.weight * share).clamp(0.0, 1.0);
            if u < share {
                u = (u / share).min(1.0 - 0.5 * f32::EPSILON);
                material = &materials[mix.other as usize];
            } else {
                u = ((u - share) / (1.0 - share)).min(1.0 - 0.5 * f32::EPSILON);
            }
        }
        let finish = match &material.finish {
            Some(finish) => finish,
            None => return material.bsdf(textures, surface.uv, u),
        };
        let (mut uv, mut painted) = ([surface.uv; 2], None);
        if finish.needs_attributes() {
            let (second, color) = (self.geometry()).further_attributes(self.parts(), surface);
            (uv[1], painted) = (second, finish.has_colors.then(|| color.truncate()));
        }
        let mut values = material.sampled(textures, uv);
        values.color *= painted.unwrap_or(Rgb::ONE);
        finish.reflect(&mut values, textures, uv);
        let film = finish.film.as_ref().map(|film| film.at(textures, uv));
        let at: &Surface = surface;
        let opaque = |u| material.bsdf_of(&values, u);
        let plain = |u| match &finish.translucency {
            None => opaque(u),
            Some(through) => through.over(values.metallic, opaque(u), textures, uv),
        };
        let base = |u| match (plain(u), &finish.anisotropy, film) {
            (base, _, Some(film)) if film.weight > 0.0 => iridescent(base, film),
            (base, Some(anisotropy), _) => match finish.exactly(material, base) {
                Bsdf::Glossy(lobe) => anisotropy.brushed(self, at, uv, lobe),
                base => base,
            },
            (base, ..) => finish.exactly(material, base),
        };
        let sheen = finish.sheen.as_ref();
        let sheen = sheen.map_or(Sheen::NONE, |sheen| sheen.at(textures, uv));
        let Some(coat) = &finish.clearcoat else {
            if sheen.color == Rgb::ZERO {
                return base(u);
            }
            let covers = Covers {
                coat: 0.0,
                alpha: 0.0,
                distribution: material.distribution,
                sheen,
            };
            return covered(&covers, u, base);
        };
        let [weight, alpha] = coat.at(textures, uv);
        let covers = Covers {
            coat: weight,
            alpha,
            distribution: material.distribution,
            sheen,
        };
        let bsdf = covered(&covers, u, base);
        if matches!(bsdf, Bsdf::Glossy(_)) {
            coat.set_coat_normal(self, material, surface);
        }
        bsdf
    }
}
