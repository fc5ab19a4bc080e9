//! Materials of OBJ files: Phong's lobe and the illumination models of Wavefront (1995), and the physical parameters
//! (`Pr`, `Pm`, `norm`) that later programs write.

use super::images::Use;
use super::{Context, ShapeMaterial};
use crate::build::looks::{self, Paint};
use glam::Affine2;
use opsr::math::{Rgb, Vec2, luminance};
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{Material, Wrap};
use std::collections::HashMap;

/// Materials by name.
pub(super) type Library = HashMap<String, Entry>;

/// Keywords that are read.
const READ: &[&str] = &[
    "Kd", "Ks", "Ke", "Ns", "Ni", "d", "Tr", "Tf", "illum", "Pr", "Pm", "map_Kd", "map_Ke",
    "map_d", "map_Pr", "map_bump", "map_Bump", "bump", "norm", "map_Kn",
];

/// Keywords without effect on the surface.
const OF_NO_USE: &[&str] = &["Ka", "map_Ka", "sharpness"];

/// A material as in the file.
#[derive(Clone, Default)]
pub(super) struct Entry {
    place: String,
    /// Lines by their keywords.
    lines: HashMap<String, String>,
}

/// Reads the materials of a file into a library.
pub(super) fn read(bytes: &[u8], place: &str, library: &mut Library) {
    let text = String::from_utf8_lossy(bytes);
    let mut entry: Option<&mut Entry> = None;
    for (n, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        let (word, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        if word == "newmtl" {
            let place = format!("{place}:{} (`{rest}`)", n + 1);
            let fresh = Entry {
                place,
                ..Entry::default()
            };
            entry = Some(
                (library.entry(rest.to_owned()))
                    .insert_entry(fresh)
                    .into_mut(),
            );
        } else if let (Some(entry), false) = (&mut entry, word.is_empty()) {
            entry.lines.insert(word.to_owned(), rest.to_owned());
        }
    }
}

/// A texture line: options, and a file name that may contain blanks.
struct Map<'a> {
    name: &'a str,
    scale: Vec2,
    offset: Vec2,
    clamp: bool,
    height: f32,
}

/// Removes and returns the first word.
fn word<'a>(text: &mut &'a str) -> &'a str {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    *text = rest.trim_start();
    word
}

impl<'a> Map<'a> {
    fn of(mut text: &'a str) -> Self {
        let mut map = Map {
            name: "",
            scale: Vec2::ONE,
            offset: Vec2::ZERO,
            clamp: false,
            height: 1.0,
        };
        while text.starts_with('-') {
            let option = word(&mut text);
            let mut numbers = Vec::new();
            let most = match option {
                "-s" | "-o" | "-t" => 3,
                "-mm" => 2,
                "-bm" | "-boost" | "-texres" => 1,
                _ => 0,
            };
            while numbers.len() < most {
                let mut rest = text;
                let Ok(number) = word(&mut rest).parse::<f32>() else {
                    break;
                };
                numbers.push(number);
                text = rest;
            }
            let pair = |default: f32| {
                let at = |i: usize| numbers.get(i).copied().unwrap_or(default);
                Vec2::new(at(0), at(1))
            };
            match option {
                "-s" => map.scale = pair(1.0),
                "-o" => map.offset = pair(0.0),
                "-bm" => map.height = pair(1.0).x,
                "-clamp" => map.clamp = word(&mut text) == "on",
                _ if most == 0 => drop(word(&mut text)),
                _ => {}
            }
        }
        Self { name: text, ..map }
    }
}

impl Entry {
    fn numbers(&self, name: &str) -> Result<Option<Vec<f32>>> {
        let Some(text) = self.lines.get(name) else {
            return Ok(None);
        };
        let numbers: std::result::Result<Vec<f32>, _> =
            text.split_whitespace().map(str::parse).collect();
        match numbers {
            Ok(numbers) if !numbers.is_empty() && numbers.iter().all(|x| x.is_finite()) => {
                Ok(Some(numbers))
            }
            _ => Err(fault(
                &self.place,
                format!("`{name} {text}`: expected numbers"),
            )),
        }
    }

    fn number(&self, name: &str) -> Result<Option<f32>> {
        Ok(self.numbers(name)?.map(|n| n[0]))
    }

    /// Three numbers, or one for all channels, none negative.
    fn color(&self, name: &str) -> Result<Option<Rgb>> {
        Ok(self.numbers(name)?.map(|n| match n[..] {
            [r, g, b, ..] => Rgb::new(r, g, b).max(Rgb::ZERO),
            _ => Rgb::splat(n[0].max(0.0)),
        }))
    }
}

impl Context {
    /// The texture of the first of these lines, and the scale of its heights; `None` without such a line.
    fn map(&mut self, entry: &Entry, names: &[&str], srgb: bool) -> Result<Option<(Paint, f32)>> {
        let Some(text) = names.iter().find_map(|name| entry.lines.get(*name)) else {
            return Ok(None);
        };
        let map = Map::of(text);
        let wrap = if map.clamp { Wrap::Clamp } else { Wrap::Repeat };
        // The file's origin is the bottom left corner, the image's the top left.
        let shift = Vec2::new(map.offset.x, 1.0 - map.scale.y - map.offset.y);
        let how = Use {
            srgb: Some(srgb),
            wrap: [wrap; 2],
            nearest: false,
            invert: false,
            transform: Affine2::from_scale_angle_translation(map.scale, 0.0, shift),
        };
        let name = map.name.replace('\\', "/");
        Ok(Some((self.texture(&name, how, &entry.place)?, map.height)))
    }

    /// Warns of lines that are not read.
    fn name_unread(&mut self, entry: &Entry) {
        // Exporters write 0 for a feature that a material does not have.
        let is_off = |word: &str| {
            let mut numbers = entry.lines[word].split_whitespace();
            numbers.all(|n| n.parse() == Ok(0.0f32))
        };
        let unread = |word: &&String| {
            let known = READ.contains(&word.as_str()) || OF_NO_USE.contains(&word.as_str());
            !known && !is_off(word)
        };
        let mut unread: Vec<&String> = entry.lines.keys().filter(unread).collect();
        unread.sort();
        for word in unread {
            self.approximate(&entry.place, &format!("`{word}` is not read"));
        }
    }

    /// The diffuse colour, without and with its texture.
    fn colour(&mut self, entry: &Entry) -> Result<(Rgb, Paint)> {
        let kd = entry.color("Kd")?;
        let colour_map = self.map(entry, &["map_Kd"], true)?;
        // Exporters write black next to a texture.
        let kd = match (kd, &colour_map) {
            (None, None) => Rgb::splat(0.8),
            (None, Some(_)) => Rgb::ONE,
            (Some(kd), Some(_)) if kd == Rgb::ZERO => Rgb::ONE,
            (Some(kd), _) => kd.min(Rgb::ONE),
        };
        let base = match colour_map {
            Some((map, _)) => Paint {
                factor: map.factor * kd,
                ..map
            },
            None => Paint::plain(kd),
        };
        Ok((kd, base))
    }

    /// The material of an entry.
    pub(super) fn of_entry(&mut self, name: &str, entry: &Entry) -> Result<ShapeMaterial> {
        self.name_unread(entry);
        let model = entry.number("illum")?.unwrap_or(2.0) as i32;
        let (kd, base) = self.colour(entry)?;
        let ks = entry.color("Ks")?.unwrap_or(Rgb::ZERO);
        let index = entry
            .number("Ni")?
            .filter(|n| *n > 1.0)
            .unwrap_or(1.5)
            .min(4.0);
        let alpha = match (entry.number("Pr")?, entry.number("Ns")?) {
            (Some(roughness), _) => roughness.clamp(0.0, 1.0).powi(2),
            (None, Some(exponent)) => looks::width_of_phong(exponent),
            (None, None) => 0.25,
        };
        let opacity = match (entry.number("d")?, entry.number("Tr")?) {
            (Some(d), _) => d,
            (None, Some(tr)) => 1.0 - tr,
            (None, None) => 1.0,
        };
        let opacity = opacity.clamp(0.0, 1.0);
        let refracts = matches!(model, 4 | 6 | 7 | 9) && opacity < 1.0;
        // Models with reflection are metal if the highlight is brighter than `Kd`, or by Blender's mark of metal.
        let ambient = entry.color("Ka")?.unwrap_or(Rgb::ZERO);
        let mirrors = matches!(model, 3 | 5 | 8);
        let shines = luminance(ks) > luminance(kd) || ambient.min_element() > 0.99;
        let metallic = match entry.number("Pm")? {
            Some(metallic) => metallic.clamp(0.0, 1.0),
            None => f32::from(u8::from(mirrors && shines)),
        };
        let mut material = if refracts {
            let tint = entry
                .color("Tf")?
                .map_or(Rgb::ONE, |tint| tint.min(Rgb::ONE));
            // Smooth unless the file has a roughness: the exponent describes only the highlights of lamps.
            let alpha = entry.number("Pr")?.map_or(0.0, |_| alpha);
            Material {
                root_tint: true,
                ..looks::glass(index, Paint::plain(tint), alpha)
            }
        } else {
            let glossy = model >= 2 && (luminance(ks) > 0.0 || entry.lines.contains_key("Pr"));
            let weight = match entry.lines.contains_key("Pr") {
                true => 1.0,
                // Blender's convention: a half is the reflectance of 4 % of an index of 1.5.
                false => (2.0 * luminance(ks)).min(1.0),
            };
            let of_highlight =
                metallic == 1.0 && luminance(kd) < luminance(ks) && base.map.is_none();
            Material {
                metallic,
                base_color: if of_highlight {
                    ks.min(Rgb::ONE)
                } else {
                    base.factor
                },
                specular: if glossy { weight } else { 0.0 },
                ior: index,
                alpha,
                ..looks::diffuse(base)
            }
        };
        material.name = name.to_owned();
        self.maps(entry, &mut material)?;
        if !refracts {
            self.holes(entry, opacity, &mut material)?;
        }
        let bump = self.map(entry, &["map_bump", "map_Bump", "bump"], false)?;
        Ok(ShapeMaterial {
            material,
            bump: bump.map(|(map, height)| Paint {
                factor: map.factor * height,
                ..map
            }),
        })
    }

    /// Sets the opacity, with its texture.
    fn holes(&mut self, entry: &Entry, opacity: f32, material: &mut Material) -> Result<()> {
        let holes = match self.map(entry, &["map_d"], false)? {
            Some((map, _)) => Paint {
                factor: map.factor * opacity,
                ..map
            },
            None => Paint::from(opacity),
        };
        if holes.map.is_some() || opacity < 1.0 {
            (self.builder.set_opacity(material, holes))
                .map_err(|what| fault(&entry.place, what))?;
        }
        Ok(())
    }

    /// Sets emission, roughness, metalness and normals, with their textures.
    fn maps(&mut self, entry: &Entry, material: &mut Material) -> Result<()> {
        let glow = self.map(entry, &["map_Ke"], true)?;
        material.emission = match (entry.color("Ke")?, &glow) {
            (Some(ke), None) => ke,
            (Some(ke), Some((map, _))) if ke != Rgb::ZERO => map.factor * ke,
            (_, Some((map, _))) => map.factor,
            (None, None) => Rgb::ZERO,
        };
        // In the programs that write these files lamps emit from both sides.
        material.double_sided = material.emission != Rgb::ZERO;
        material.emissive_texture = glow.and_then(|(map, _)| map.map);
        if let Some((map, _)) = self.map(entry, &["map_Pr"], false)?
            && let Some(map) = map.map
        {
            material.alpha = 1.0;
            material.metallic_roughness_texture = Some(self.builder.roughness_map(map, |r| r * r));
        }
        if let Some((map, _)) = self.map(entry, &["norm", "map_Kn"], false)? {
            material.normal_texture = map.map;
        }
        Ok(())
    }
}
