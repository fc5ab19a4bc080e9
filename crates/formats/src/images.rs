//! Images of other renderers' scenes: textures, and maps of radiance.

use super::Context;
use crate::build::looks::Paint;
use glam::{Affine2, Vec2};
use image::ImageFormat;
use opsr::image::{Buffer, exr};
use opsr::math::Rgb;
use opsr::memory;
use opsr::scene::load::error::{Result, fault};
use opsr::scene::load::textures::decode;
use opsr::scene::{Texels, Texture, TextureRef, Wrap};
use std::borrow::Cow;

/// Key of a texture: file, whether it is sRGB encoded (`None`: if it has eight bits), wrap, nearest texel, inversion.
pub(super) type Key = (String, Option<bool>, [Wrap; 2], bool, bool);

/// Index of a texture, and the factor of its values.
pub(super) type Known = (u32, f32);

/// Formats that are read; those without a signature are recognised by the file's ending.
const FORMATS: [ImageFormat; 5] = [
    ImageFormat::Png,
    ImageFormat::Jpeg,
    ImageFormat::WebP,
    ImageFormat::Tga,
    ImageFormat::Hdr,
];

/// The way in which a scene uses an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Use {
    /// True if the values are sRGB encoded; `None` if only 8-bit values are.
    pub(super) srgb: Option<bool>,
    pub(super) wrap: [Wrap; 2],
    /// True if texels are constant, without interpolation.
    pub(super) nearest: bool,
    /// True if the values are subtracted from 1.
    pub(super) invert: bool,
    /// From the mesh's coordinates to those of the image, whose origin is the top left corner.
    pub(super) transform: Affine2,
}

impl Use {
    /// The use in pbrt, where v = 0 is the bottom of the image.
    pub(super) fn upright(srgb: Option<bool>, wrap: Wrap) -> Self {
        let down = Vec2::new(1.0, -1.0);
        Self {
            srgb,
            wrap: [wrap; 2],
            nearest: false,
            invert: false,
            transform: Affine2::from_scale_angle_translation(down, 0.0, Vec2::Y),
        }
    }
}

impl Context {
    /// The texture of a file, read once for each use.
    pub(super) fn texture(&mut self, name: &str, how: Use, place: &str) -> Result<Paint> {
        let key = (name.to_owned(), how.srgb, how.wrap, how.nearest, how.invert);
        let known = match self.images.get(&key) {
            Some(&known) => known,
            None => {
                let known = self.read_texture(name, how, place)?;
                self.images.insert(key, known);
                known
            }
        };
        let map = TextureRef {
            texture: known.0,
            transform: how.transform,
            second: false,
        };
        Ok(Paint {
            factor: Rgb::splat(known.1),
            map: Some(map),
        })
    }

    fn read_texture(&mut self, name: &str, how: Use, place: &str) -> Result<Known> {
        let lower = name.to_ascii_lowercase();
        let (texture, factor) =
            if lower.ends_with(".exr") || lower.ends_with(".hdr") || lower.ends_with(".pfm") {
                let map = self.radiance_map(name, place)?;
                words(&map, place)?
            } else {
                let (_, bytes) = self.files.open(name, place)?;
                let at = format!("{place}: {name}");
                let texture = decode(at, Cow::Owned(bytes), &FORMATS, 1)?;
                let eight = matches!(texture.texels, Texels::Byte(_));
                let srgb = how.srgb.unwrap_or(eight);
                (Texture { srgb, ..texture }, 1.0)
            };
        let texture = if how.invert {
            inverted(&texture)
        } else {
            texture
        };
        let texture = Texture {
            wrap: how.wrap,
            nearest: how.nearest,
            ..texture
        };
        Ok((self.builder.add_texture(texture), factor))
    }

    /// The linear values of an image file, none negative.
    pub(super) fn radiance_map(&mut self, name: &str, place: &str) -> Result<Buffer> {
        let (path, bytes) = self.files.open(name, place)?;
        let lower = name.to_ascii_lowercase();
        let at = format!("{place}: {name}");
        let map = if lower.ends_with(".exr") {
            exr::read_rgb(&path).map_err(|e| fault(place, e.to_string()))?
        } else if lower.ends_with(".hdr") {
            opsr::scene::light::read_hdr(&path).map_err(|e| fault(place, e.to_string()))?
        } else if lower.ends_with(".pfm") {
            pfm(&bytes, &at)?
        } else {
            let texture = Texture {
                srgb: true,
                ..decode(at.clone(), Cow::Owned(bytes), &FORMATS, 4)?
            };
            let colour = |x: usize, y: usize| {
                let [r, g, b, _] = texture.texel(x as u32, y as u32);
                Rgb::new(r, g, b)
            };
            Buffer::from_fn(texture.width as usize, texture.height as usize, colour)
        };
        if map.pixels.is_empty() {
            return Err(fault(at, "an image without texels"));
        }
        let good = |p: &Rgb| p.is_finite();
        match map.pixels.iter().all(good) {
            true => Ok(map.map(|p| p.max(Rgb::ZERO))),
            false => Err(fault(at, "has values that are not finite")),
        }
    }
}

/// A 16-bit texture of linear values, and the factor that undoes the scaling to at most 1.
fn words(map: &Buffer, place: &str) -> Result<(Texture, f32)> {
    memory::check(place, 6 * map.pixels.len() as u64)?;
    let most = map
        .pixels
        .iter()
        .map(|p| p.max_element())
        .fold(1.0, f32::max);
    let code = |x: f32| (x / most * 65535.0 + 0.5) as u16;
    let words: Vec<u16> = (map.pixels.iter())
        .flat_map(|p| p.to_array().map(code))
        .collect();
    let texture = Texture {
        width: map.width as u32,
        height: map.height as u32,
        channels: 3,
        texels: Texels::Word(words.into()),
        ..Texture::default()
    };
    Ok((texture, most))
}

/// A texture of one minus the linear values.
fn inverted(texture: &Texture) -> Texture {
    let map = Buffer::from_fn(texture.width as usize, texture.height as usize, |x, y| {
        let [r, g, b, _] = texture.texel(x as u32, y as u32);
        Rgb::ONE - Rgb::new(r, g, b)
    });
    words(&map, "").map_or_else(|_| texture.clone(), |(made, _)| made)
}

/// A portable float map.
fn pfm(bytes: &[u8], place: &str) -> Result<Buffer> {
    let bad = || fault(place, "is no PFM file");
    let mut at = 0;
    let mut word = || {
        while bytes.get(at).is_some_and(u8::is_ascii_whitespace) {
            at += 1;
        }
        let start = at;
        while bytes.get(at).is_some_and(|b| !b.is_ascii_whitespace()) {
            at += 1;
        }
        let word = std::str::from_utf8(bytes.get(start..at)?).ok();
        at += 1;
        word.map(|word| (word, at))
    };
    let (kind, _) = word().ok_or_else(bad)?;
    let channels = match kind {
        "PF" => 3,
        "Pf" => 1,
        _ => return Err(bad()),
    };
    let mut number = || word().and_then(|(w, at)| Some((w.parse::<f32>().ok()?, at)));
    let (w, _) = number().ok_or_else(bad)?;
    let (h, _) = number().ok_or_else(bad)?;
    let (scale, data) = number().ok_or_else(bad)?;
    let (w, h) = (w as usize, h as usize);
    let values = bytes.get(data..).ok_or_else(bad)?;
    let needed = w.checked_mul(h).and_then(|n| n.checked_mul(4 * channels));
    if needed.is_none_or(|n| n > values.len() || n == 0) {
        return Err(fault(place, "holds fewer values than its size says"));
    }
    let value = |i: usize| {
        let four = [0, 1, 2, 3].map(|k| values[4 * i + k]);
        match scale < 0.0 {
            true => f32::from_le_bytes(four),
            false => f32::from_be_bytes(four),
        }
    };
    // The first row of the file is the bottom one.
    Ok(Buffer::from_fn(w, h, |x, y| {
        let i = channels * ((h - 1 - y) * w + x);
        match channels {
            3 => Rgb::new(value(i), value(i + 1), value(i + 2)),
            _ => Rgb::splat(value(i)),
        }
    }))
}
