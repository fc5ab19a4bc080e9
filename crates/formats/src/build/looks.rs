//! Materials in the terms of other renderers: diffuse, metal, glass, wall, coated; textured where the files are.

use super::Builder;
use glam::Affine2;
use opsr::math::{Rgb, Vec2, luminance};
use opsr::scene::finish::{ExactCover, Mix, Translucency};
use opsr::scene::{AlphaMode, Material, Texels, Texture, TextureRef, Wrap};

/// A colour, or a texture times a factor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Paint {
    /// The colour, or the factor of the texture, in linear Rec. 709.
    pub factor: Rgb,
    /// Texture that the factor multiplies.
    pub map: Option<TextureRef>,
}

impl Paint {
    /// A colour without a texture.
    pub const fn plain(colour: Rgb) -> Self {
        Self {
            factor: colour,
            map: None,
        }
    }
}

impl From<f32> for Paint {
    fn from(grey: f32) -> Self {
        Self::plain(Rgb::splat(grey))
    }
}

/// The base of all materials here: both sides are visible and scatter light.
fn surface(paint: Paint) -> Material {
    Material {
        base_color: paint.factor,
        base_color_texture: paint.map,
        metallic: 0.0,
        specular: 0.0,
        shows_back: true,
        ..Material::default()
    }
}

/// A Lambertian surface.
pub fn diffuse(reflectance: Paint) -> Material {
    surface(reflectance)
}

/// A metal. Its complex index `eta` + i `k` is relative to the outside; `tint` multiplies its reflectance.
pub fn metal(eta: Rgb, k: Rgb, tint: Paint, alpha: f32) -> Material {
    let mut material = Material {
        metallic: 1.0,
        specular: 1.0,
        alpha,
        ..surface(tint)
    };
    material.finish_mut().exact = Some(ExactCover::Metal { eta, k });
    material
}

/// The boundary of a solid body. Its index is relative to the outside; `tint` multiplies transmitted light.
pub fn glass(eta: f32, tint: Paint, alpha: f32) -> Material {
    Material {
        transmission: 1.0,
        solid: true,
        ior: eta,
        specular: 1.0,
        alpha,
        ..surface(tint)
    }
}

/// A thin smooth pane of this index; `tint` multiplies transmitted light, `reflected` reflected light.
pub fn wall(eta: f32, tint: Paint, reflected: Rgb) -> Material {
    Material {
        transmission: 1.0,
        exact_wall: true,
        ior: eta,
        specular: 1.0,
        specular_color: reflected,
        alpha: 0.0,
        ..surface(tint)
    }
}

/// A base under a clear layer of this index and roughness. With `saturates`, the base's colour also multiplies light
/// that the layer reflects back to the base.
pub fn coated(eta: f32, base: Paint, reflected: Rgb, alpha: f32, saturates: bool) -> Material {
    let mut material = Material {
        ior: eta,
        specular: 1.0,
        specular_color: reflected,
        alpha,
        ..surface(base)
    };
    material.finish_mut().exact = Some(ExactCover::coat(eta, saturates));
    material
}

/// A base under a layer of this index, as in glTF: `shine` multiplies Schlick's reflectance of the layer.
pub fn glossy(base: Paint, shine: Rgb, index: f32) -> Material {
    let most = shine.max_element();
    Material {
        specular: most.min(1.0),
        specular_color: shine / most.max(f32::MIN_POSITIVE),
        ior: index,
        ..surface(base)
    }
}

/// Makes a base transmit diffusely: `transmitted` is added to what it reflects.
pub fn transmit(material: &mut Material, transmitted: Paint) {
    material.finish_mut().translucency = Some(Translucency {
        weight: 1.0,
        color: transmitted.factor,
        texture: None,
        color_texture: transmitted.map,
        keeps_base: true,
    });
}

/// Makes a base transmit the share `weight` of its colour diffusely, instead of reflecting it.
pub fn transmit_share(material: &mut Material, weight: f32) {
    if weight > 0.0 {
        material.finish_mut().translucency = Some(Translucency {
            weight: weight.min(1.0),
            color: material.base_color,
            texture: None,
            color_texture: material.base_color_texture,
            keeps_base: false,
        });
    }
}

/// The index of refraction of a layer with this reflectance at normal incidence, at most 0.9.
pub fn index_of(reflected: f32) -> f32 {
    let root = reflected.clamp(0.0, 0.9).sqrt();
    (1.0 + root) / (1.0 - root)
}

/// The Beckmann roughness of the lobe nearest to Phong's with this exponent (Walter et al. 2007, section 5.2).
pub fn width_of_phong(exponent: f32) -> f32 {
    (2.0 / (exponent.max(0.0) + 2.0)).sqrt()
}

/// Absorption of hair with these concentrations of eumelanin and pheomelanin (d'Eon et al. 2011).
pub fn melanin(dark: f32, red: f32) -> Rgb {
    dark * Rgb::new(0.419, 0.697, 1.37) + red * Rgb::new(0.187, 0.4, 1.05)
}

/// Colour of many hairs of this absorption and azimuthal roughness: the inverse of Chiang et al. 2016, equation 9.
pub fn colour_of_hair(absorption: Rgb, rough: f32) -> Rgb {
    let terms = [5.969, -0.215, 2.532, -10.73, 5.574, 0.245];
    let width = terms.iter().rev().fold(0.0, |sum, term| sum * rough + term);
    absorption.map(|a| (-width * a.max(0.0).sqrt()).exp())
}

/// Hair as a glossy surface of its colour, with keratin's index and a highlight of the usual width.
pub fn hair(colour: Rgb) -> Material {
    Material {
        alpha: 0.2,
        ..glossy(Paint::plain(colour), Rgb::ONE, 1.55)
    }
}

/// A surface that only emits, from its front.
pub fn lamp(radiance: Rgb) -> Material {
    Material {
        emission: radiance,
        ..diffuse(Paint::plain(Rgb::ZERO))
    }
}

/// An invisible surface: opacity 0 under an opacity mask.
pub fn nothing() -> Material {
    Material {
        alpha_mode: AlphaMode::Mask(0.5),
        opacity: 0.0,
        ..diffuse(Paint::plain(Rgb::ZERO))
    }
}

/// Most texels along a side of a texture that is computed from others.
const MAX_TEXELS: u32 = 8192;

/// Texels along a side of a blended texture of [`Builder::fields`]: enough for slopes, if it is a bump map.
const BLENDED: u32 = 64;

impl Builder {
    /// Adds a texture; returns its index.
    pub fn add_texture(&mut self, texture: Texture) -> u32 {
        self.parts.textures.push(texture);
        self.parts.textures.len() as u32 - 1
    }

    /// The mean of a colour, or of a texture times its factor.
    pub fn mean(&self, paint: Paint) -> Rgb {
        let Some(map) = paint.map else {
            return paint.factor;
        };
        let [r, g, b, _] = self.parts.textures[map.texture as usize].average();
        paint.factor * Rgb::new(r, g, b)
    }

    /// A 16-bit texture of `colour` at the texel centres, in [0, 1]².
    fn baked(
        &mut self,
        size: [u32; 2],
        channels: u8,
        colour: impl Fn(Vec2) -> [f32; 4],
    ) -> Texture {
        let [width, height] = size;
        let mut words = Vec::with_capacity((width * height) as usize * usize::from(channels));
        for y in 0..height {
            for x in 0..width {
                let uv = Vec2::new(x as f32 + 0.5, y as f32 + 0.5)
                    / Vec2::new(width as f32, height as f32);
                let texel = colour(uv);
                let code = |x: &f32| (x.clamp(0.0, 1.0) * 65535.0 + 0.5) as u16;
                words.extend(texel[..usize::from(channels)].iter().map(code));
            }
        }
        Texture {
            width,
            height,
            channels,
            texels: Texels::Word(words.into()),
            ..Texture::default()
        }
    }

    /// `of` applied to colours and textures, texel by texel. `None` if two textures have different coordinates.
    pub fn combined<const N: usize>(
        &mut self,
        paints: [Paint; N],
        of: impl Fn([Rgb; N]) -> Rgb,
    ) -> Option<Paint> {
        let factors = paints.map(|paint| paint.factor);
        let mut maps = paints.iter().filter_map(|paint| paint.map);
        let Some(map) = maps.next() else {
            return Some(Paint::plain(of(factors)));
        };
        if maps.any(|other| (other.transform, other.second) != (map.transform, map.second)) {
            return None;
        }
        let source = |paint: Paint| Some(self.parts.textures[paint.map?.texture as usize].clone());
        let sources = paints.map(source);
        let all = || sources.iter().flatten();
        let side = |of: fn(&Texture) -> u32| all().map(of).max().unwrap_or(1).min(MAX_TEXELS);
        let at = |i: usize, uv: Vec2| match &sources[i] {
            Some(texture) => {
                let [r, g, b, _] = texture.sample(uv);
                factors[i] * Rgb::new(r, g, b)
            }
            None => factors[i],
        };
        // Sixteen bits hold values up to 1: larger ones go into the factor.
        let most = factors.iter().fold(of(factors), |most, f| most.max(*f));
        let most = most.max_element().max(1.0);
        let texture = self.baked([side(|t| t.width), side(|t| t.height)], 3, |uv| {
            let colour = of(std::array::from_fn(|i| at(i, uv)));
            (colour / most).extend(1.0).to_array()
        });
        let like = all().next().cloned().unwrap_or_default();
        let texture = Texture {
            wrap: like.wrap,
            nearest: like.nearest,
            ..texture
        };
        Some(Paint {
            factor: Rgb::splat(most),
            map: Some(TextureRef {
                texture: self.add_texture(texture),
                ..map
            }),
        })
    }

    /// A grey texture of the luminance of `factor` times a texture, and its factor; a grey texture is reused.
    pub fn grey(&mut self, factor: Rgb, map: TextureRef) -> (f32, u32) {
        let source = &self.parts.textures[map.texture as usize];
        let most = factor.max_element();
        if source.channels < 3 && factor == Rgb::splat(most) {
            return (most, map.texture);
        }
        let source = source.clone();
        let size = [source.width.min(MAX_TEXELS), source.height.min(MAX_TEXELS)];
        let share = factor / most.max(f32::MIN_POSITIVE);
        let texture = self.baked(size, 1, |uv| {
            let [r, g, b, _] = source.sample(uv);
            [luminance(share * Rgb::new(r, g, b)); 4]
        });
        let texture = Texture {
            wrap: source.wrap,
            nearest: source.nearest,
            ..texture
        };
        (most, self.add_texture(texture))
    }

    /// A roughness texture as materials use it. Its green channel is the root of `alpha` of the mean of the map's
    /// channels; the other channels are 1.
    pub fn roughness_map(&mut self, map: TextureRef, alpha: impl Fn(f32) -> f32) -> TextureRef {
        let source = self.parts.textures[map.texture as usize].clone();
        let size = [source.width.min(MAX_TEXELS), source.height.min(MAX_TEXELS)];
        let texture = self.baked(size, 3, |uv| {
            let [r, g, b, _] = source.sample(uv);
            let root = alpha((r + g + b) / 3.0).max(0.0).sqrt();
            [1.0, root, 1.0, 1.0]
        });
        let texture = Texture {
            wrap: source.wrap,
            nearest: source.nearest,
            ..texture
        };
        TextureRef {
            texture: self.add_texture(texture),
            ..map
        }
    }

    /// Gives a material an opacity: a number, or a map, which must have the texture coordinates of the base colour.
    pub fn set_opacity(
        &mut self,
        material: &mut Material,
        opacity: Paint,
    ) -> Result<(), &'static str> {
        material.alpha_mode = AlphaMode::Blend;
        let mean = |c: Rgb| (c.x + c.y + c.z) / 3.0;
        let Some(map) = opacity.map else {
            material.opacity = mean(opacity.factor).clamp(0.0, 1.0);
            return Ok(());
        };
        let holes = self.parts.textures[map.texture as usize].clone();
        let base = match material.base_color_texture {
            Some(base) if (base.transform, base.second) != (map.transform, map.second) => {
                return Err("an opacity map with other coordinates than the colour's");
            }
            Some(base) => Some(self.parts.textures[base.texture as usize].clone()),
            None => None,
        };
        let size = |of: fn(&Texture) -> u32| {
            let other = base.as_ref().map_or(1, of);
            of(&holes).max(other).min(MAX_TEXELS)
        };
        let size = [size(|t| t.width), size(|t| t.height)];
        let texture = self.baked(size, 4, |uv| {
            let [r, g, b, _] = base.as_ref().map_or([1.0; 4], |base| base.sample(uv));
            let [x, y, z, a] = holes.sample(uv);
            let opacity_there = mean(Rgb::new(x, y, z) * opacity.factor) * a;
            [r, g, b, opacity_there]
        });
        let texture = Texture {
            wrap: holes.wrap,
            nearest: holes.nearest,
            ..texture
        };
        material.base_color_texture = Some(TextureRef {
            texture: self.add_texture(texture),
            ..map
        });
        Ok(())
    }

    /// A normal map of heights. `step` is the length on the surface of one unit of u and of v, negative for a v against
    /// the bitangent. The factor of `heights` scales them. `None` without a texture.
    pub fn bump_map(&mut self, heights: Paint, step: [f32; 2]) -> Option<TextureRef> {
        let map = heights.map?;
        let source = self.parts.textures[map.texture as usize].clone();
        let (w, h) = (source.width.min(MAX_TEXELS), source.height.min(MAX_TEXELS));
        let height = |uv: Vec2| {
            let [r, g, b, _] = source.sample(uv);
            (Rgb::new(r, g, b) * heights.factor).element_sum() / 3.0
        };
        let texel = Vec2::new(1.0 / w as f32, 1.0 / h as f32);
        let turn = map.transform.matrix2;
        let texture = self.baked([w, h], 3, |uv| {
            let (dx, dy) = (texel.with_y(0.0), texel.with_x(0.0));
            let by = |d: Vec2, l: f32| (height(uv + d) - height(uv - d)) / (2.0 * l);
            // Derivatives by the texture's coordinates, then by the mesh's coordinates, then by length.
            let slope = turn.transpose() * Vec2::new(by(dx, texel.x), by(dy, texel.y));
            let n = Rgb::new(-slope.x / step[0], -slope.y / step[1], 1.0).normalize();
            let [x, y, z] = (0.5 * n + 0.5).to_array();
            [x, y, z, 1.0]
        });
        let texture = Texture {
            wrap: source.wrap,
            nearest: source.nearest,
            ..texture
        };
        Some(TextureRef {
            texture: self.add_texture(texture),
            ..map
        })
    }

    /// A texture of four colours in the order (0, 0), (1, 0), (0, 1), (1, 1). Sharp ones fill quarters; others are
    /// blended between the corners of [0, 1]².
    pub fn fields(&mut self, colours: [Rgb; 4], sharp: bool, transform: Affine2) -> Paint {
        // Fine enough that interpolation between texels hardly shows at the edges.
        let (side, wrap) = if sharp {
            (512, Wrap::Repeat)
        } else {
            (BLENDED, Wrap::Clamp)
        };
        let most = colours
            .map(|c| c.max_element())
            .into_iter()
            .fold(1.0, f32::max);
        let texture = self.baked([side; 2], 3, |uv| {
            let at = match sharp {
                true => (uv + 0.5).floor().clamp(Vec2::ZERO, Vec2::ONE),
                false => (uv * BLENDED as f32 - 0.5) / (BLENDED - 1) as f32,
            };
            let row = |i: usize| colours[i].lerp(colours[i + 1], at.x);
            (row(0).lerp(row(2), at.y) / most).extend(1.0).to_array()
        });
        // The corners of [0, 1]² are the centres of the outermost texels.
        let texel = 1.0 / BLENDED as f32;
        let (scale, shift) = (Vec2::splat(1.0 - texel), Vec2::splat(0.5 * texel));
        let transform = match sharp {
            true => transform,
            false => Affine2::from_scale_angle_translation(scale, 0.0, shift) * transform,
        };
        let wrap = [wrap; 2];
        let map = TextureRef {
            texture: self.add_texture(Texture { wrap, ..texture }),
            transform,
            second: false,
        };
        Paint {
            factor: Rgb::splat(most),
            map: Some(map),
        }
    }

    /// Gives `other`, the index of a material of the scene, the share `weight` of the surface of `material`.
    pub fn mix(&mut self, material: &mut Material, other: u32, weight: Paint) {
        let textured = self.parts.materials[other as usize].is_textured();
        let mut texture = weight.map;
        if texture.is_none() && textured {
            // A texture in the mixture marks the surface as one with texture coordinates.
            let white = self.add_texture(Texture::rgba(1, 1, [[255; 4]]));
            texture = Some(TextureRef {
                texture: white,
                transform: Affine2::IDENTITY,
                second: false,
            });
        }
        material.finish_mut().mix = Some(Mix {
            other,
            weight: weight.factor.element_sum() / 3.0,
            texture,
        });
    }
}
