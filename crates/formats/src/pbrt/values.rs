//! Colours and textures of pbrt.

use super::super::Role;
use super::super::images::Use;
use super::Scene;
use super::tokens::{Parameter, Parameters, Values};
use crate::build::colour::{Spectrum, black_body, rec709};
use crate::build::looks::Paint;
use crate::build::metals;
use glam::{Affine2, DMat3, DVec3, Vec2};
use opsr::math::Rgb;
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{TextureRef, Wrap};

/// Columns of the matrix from a colour space of pbrt to linear Rec. 709, with white preserved (ITU-R BT.2087 for Rec.
/// 2020; Display P3; ACES primaries 0 by Bradford's adaptation, SMPTE ST 2065-1).
pub(super) fn space(name: &str) -> Option<DMat3> {
    let columns = match name {
        "srgb" => return Some(DMat3::IDENTITY),
        "rec2020" => [
            1.6605, -0.1246, -0.0182, -0.5876, 1.1329, -0.1006, -0.0728, -0.0083, 1.1187,
        ],
        "dci-p3" => [
            1.2249, -0.0420, -0.0197, -0.2247, 1.0419, -0.0786, 0.0, 0.0, 1.0979,
        ],
        "aces2065-1" => [
            2.521_65, -0.276_22, -0.015_32, -1.134_11, 1.372_57, -0.152_99, -0.387_56, -0.096_28,
            1.168_38,
        ],
        _ => return None,
    };
    Some(DMat3::from_cols_array(&columns))
}

/// Means of noise textures with default parameters, negative values taken as 0: by 400,000 points of Perlin's noise.
const MEANS: [(&str, [f32; 3]); 4] = [
    ("fbm", [0.12; 3]),
    ("marble", [0.80, 0.80, 0.84]),
    ("windy", [0.03; 3]),
    ("wrinkled", [0.43; 3]),
];

/// Mean of `dots`: disks of radius 0.35 in two fifths of the cells, those with a positive noise at their centre.
const DOTTED: f32 = 0.15;

impl Scene<'_> {
    /// The colour of a spectrum; pbrt scales those of lamps to a luminance of 1.
    fn of_spectrum(spectrum: &Spectrum, meant: Role) -> Rgb {
        match meant {
            Role::Reflected => spectrum.reflected(),
            Role::Emitted => spectrum.chromaticity(),
        }
    }

    /// The colour of a parameter.
    fn colour_of(&mut self, parameter: &Parameter, meant: Role, place: &str) -> Result<Rgb> {
        let bad = || fault(place, format!("`{}` is no colour", parameter.name));
        let colour = match (parameter.kind.as_str(), &parameter.values) {
            ("rgb" | "color", Values::Numbers(n)) => match n.as_slice() {
                [r, g, b] => (self.state.space * DVec3::new(*r, *g, *b)).as_vec3(),
                [x] => Rgb::splat(*x as f32),
                _ => return Err(bad()),
            },
            ("xyz", Values::Numbers(n)) if n.len() == 3 => rec709(DVec3::new(n[0], n[1], n[2])),
            ("float", Values::Numbers(n)) if n.len() == 1 => Rgb::splat(n[0] as f32),
            // Version 3 has a scale after the temperature.
            ("blackbody", Values::Numbers(n)) if !n.is_empty() => {
                black_body(n[0] as f32) * n.get(1).map_or(1.0, |scale| *scale as f32)
            }
            ("spectrum", Values::Numbers(n)) => {
                let pairs = n.chunks_exact(2).map(|p| (p[0], p[1])).collect();
                Self::of_spectrum(&Spectrum::new(pairs).ok_or_else(bad)?, meant)
            }
            ("spectrum", Values::Texts(names)) if names.len() == 1 => {
                self.named_spectrum(&names[0], meant, place)?
            }
            _ => return Err(bad()),
        };
        match colour.is_finite() {
            true => Ok(colour.max(Rgb::ZERO)),
            false => Err(bad()),
        }
    }

    fn named_spectrum(&mut self, name: &str, meant: Role, place: &str) -> Result<Rgb> {
        if let Some(eta) = metals::glass(name) {
            return Ok(Rgb::splat(eta));
        }
        if let Some((metal, part @ ("eta" | "k"))) = name.rsplit_once('-')
            && metal.starts_with("metal-")
        {
            // The nearest known metal: copper for brass, aluminium for the others.
            let found = metals::metal(metal);
            let other = ["metal-Al", "metal-Cu"][usize::from(metal == "metal-CuZn")];
            if found.is_none() {
                let shown = format!("`{other}-{part}`");
                (self.context).nearest(place, format!("spectrum `{name}`"), &shown)?;
            }
            if let Some((eta, k)) = found.or_else(|| metals::metal(other)) {
                return Ok(if part == "k" { k } else { eta });
            }
        }
        if name.starts_with("stdillum-D65") {
            return Ok(Rgb::ONE);
        }
        if name.contains('.') {
            let spectrum = self.context.spectrum_file(name, place)?;
            return Ok(Self::of_spectrum(&spectrum, meant));
        }
        self.context
            .nearest(place, format!("spectrum `{name}`"), "1 at all wavelengths")?;
        Ok(Rgb::ONE)
    }

    /// A colour; of a texture, its mean with a warning.
    pub(super) fn colour(
        &mut self,
        parameters: &Parameters,
        name: &str,
        or: Rgb,
        meant: Role,
    ) -> Result<Rgb> {
        let paint = self.paint_of(parameters, name, Paint::plain(or), meant)?;
        if paint.map.is_none() {
            return Ok(paint.factor);
        }
        self.context.nearest(
            &parameters.place,
            format!("a texture as `{name}`"),
            "its mean",
        )?;
        Ok(self.context.builder.mean(paint))
    }

    pub(super) fn paint(
        &mut self,
        parameters: &Parameters,
        name: &str,
        or: Paint,
    ) -> Result<Paint> {
        self.paint_of(parameters, name, or, Role::Reflected)
    }

    fn paint_of(
        &mut self,
        parameters: &Parameters,
        name: &str,
        or: Paint,
        meant: Role,
    ) -> Result<Paint> {
        let place = &parameters.place;
        let Some(parameter) = parameters.get(name) else {
            return Ok(or);
        };
        if parameter.kind != "texture" {
            return Ok(Paint::plain(self.colour_of(parameter, meant, place)?));
        }
        let Some((_, texture)) = Self::named(parameters, name) else {
            return Err(fault(place, format!("`{name}` names no texture")));
        };
        let found = (self.spectrum_textures.get(texture)).or_else(|| self.textures.get(texture));
        let Some(&(paint, mapping)) = found else {
            return Err(fault(place, format!("no texture `{texture}`")));
        };
        self.takes(mapping, place)?;
        Ok(paint)
    }

    /// Reads a `Texture`.
    pub(super) fn texture(
        &mut self,
        name: String,
        kind: &str,
        class: &str,
        parameters: &Parameters,
    ) -> Result<()> {
        let place = &parameters.place;
        self.mapping = None;
        let paint = match class {
            "constant" => self.paint(parameters, "value", Paint::from(1.0))?,
            "imagemap" => self.image(parameters)?,
            "checkerboard" => self.checkerboard(parameters)?,
            "scale" => self.product(parameters)?,
            "bilerp" => {
                let mut of = |name: &str, or: f32| {
                    self.colour(parameters, name, Rgb::splat(or), Role::Reflected)
                };
                let colours = [
                    of("v00", 0.0)?,
                    of("v10", 0.0)?,
                    of("v01", 1.0)?,
                    of("v11", 1.0)?,
                ];
                self.fields(parameters, colours, false)?
            }
            "mix" | "directionmix" => {
                if class != "mix" {
                    (self.context).nearest(place, "texture `directionmix`", "an even mixture")?;
                }
                let [a, b] = [
                    self.paint(parameters, "tex1", Paint::from(0.0))?,
                    self.paint(parameters, "tex2", Paint::from(1.0))?,
                ];
                let amount = self.paint(parameters, "amount", Paint::from(0.5))?;
                match (self.context.builder).combined([a, b, amount], |[a, b, t]| a + (b - a) * t) {
                    Some(mixture) => mixture,
                    None => {
                        let what = "a mixture of images of different coordinates";
                        self.context.nearest(place, what, "the first")?;
                        a
                    }
                }
            }
            "dots" => {
                (self.context).nearest(place, "texture `dots`", "its mean")?;
                let inside = self.colour(parameters, "inside", Rgb::ONE, Role::Reflected)?;
                let outside = self.colour(parameters, "outside", Rgb::ZERO, Role::Reflected)?;
                Paint::plain(outside + DOTTED * (inside - outside))
            }
            other => {
                let mean = MEANS.iter().find(|(name, _)| *name == other);
                let shown = if mean.is_some() { "its mean" } else { "grey" };
                (self.context).nearest(place, format!("texture `{other}`"), shown)?;
                Paint::plain(mean.map_or(Rgb::splat(0.5), |(_, mean)| Rgb::from_array(*mean)))
            }
        };
        let mapping = self.mapping.take();
        match kind {
            "float" => self.textures.insert(name, (paint, mapping)),
            _ => self.spectrum_textures.insert(name, (paint, mapping)),
        };
        Ok(())
    }

    /// The product of two textures.
    fn product(&mut self, parameters: &Parameters) -> Result<Paint> {
        let place = &parameters.place;
        let tex = match parameters.get("tex1") {
            // The names of pbrt-v3.
            Some(_) => ["tex1", "tex2"],
            None => ["tex", "scale"],
        };
        let [a, b] = [
            self.paint(parameters, tex[0], Paint::from(1.0))?,
            self.paint(parameters, tex[1], Paint::from(1.0))?,
        ];
        Ok(if a.map.is_none() || b.map.is_none() {
            // The product with a colour only changes the factor of a texture.
            Paint {
                factor: a.factor * b.factor,
                map: a.map.or(b.map),
            }
        } else if let Some(product) = self.context.builder.combined([a, b], |[a, b]| a * b) {
            product
        } else {
            let what = "the product of two images of different coordinates";
            self.context.nearest(place, what, "the first")?;
            a
        })
    }

    fn image(&mut self, parameters: &Parameters) -> Result<Paint> {
        let place = &parameters.place;
        let name = parameters.text("filename")?;
        let name = name.ok_or_else(|| fault(place, "an image without a filename"))?;
        let wrap = match parameters.text("wrap")?.unwrap_or("repeat") {
            "repeat" => Wrap::Repeat,
            "clamp" => Wrap::Clamp,
            other => {
                self.context
                    .nearest(place, format!("wrap `{other}`"), "`clamp`")?;
                Wrap::Clamp
            }
        };
        // Version 3 has a flag instead of the encoding.
        let own = match parameters.flag("gamma", true)? {
            true => "sRGB",
            false => "linear",
        };
        let srgb = match parameters.text("encoding")?.unwrap_or(own) {
            "sRGB" => None,
            "linear" => Some(false),
            other => {
                self.context
                    .approximate(place, &format!("encoding `{other}` is taken for sRGB"));
                None
            }
        };
        let (upward, second) = self.upward(parameters)?;
        let plain = Use::upright(srgb, wrap);
        let how = Use {
            nearest: parameters.text("filter")? == Some("point"),
            invert: parameters.flag("invert", false)?,
            transform: plain.transform * upward,
            ..plain
        };
        let paint = self.context.texture(name, how, place)?;
        Ok(Paint {
            factor: paint.factor * parameters.number("scale", 1.0)? as f32,
            map: paint.map.map(|map| TextureRef { second, ..map }),
        })
    }

    fn checkerboard(&mut self, parameters: &Parameters) -> Result<Paint> {
        let place = &parameters.place;
        if parameters.number("dimension", 2.0)? != 2.0 {
            self.context.nearest(
                place,
                "a checkerboard of three dimensions",
                "one by texture coordinates",
            )?;
        }
        let first = self.colour(parameters, "tex1", Rgb::ONE, Role::Reflected)?;
        let second = self.colour(parameters, "tex2", Rgb::ZERO, Role::Reflected)?;
        self.fields(parameters, [first, second, second, first], true)
    }

    /// Four colours at the corners of [0, 1]², or in unit squares if `sharp`.
    fn fields(&mut self, parameters: &Parameters, colours: [Rgb; 4], sharp: bool) -> Result<Paint> {
        // Two sharp fields span the texture.
        let scale = if sharp { 0.5 } else { 1.0 };
        let own = Affine2::from_scale(Vec2::splat(scale));
        let (upward, second) = self.upward(parameters)?;
        let ends = [Vec2::ZERO, Vec2::ONE].map(|end| upward.transform_point2(end));
        let within = |end: Vec2| end.min_element() >= 0.0 && end.max_element() <= 1.0;
        if !sharp && (second || !ends.into_iter().all(within)) {
            let what = "a `bilerp` is held at its border outside of [0, 1]²";
            self.context.approximate(&parameters.place, what);
        }
        let paint = (self.context.builder).fields(colours, sharp, own * upward);
        let map = paint.map.map(|map| TextureRef { second, ..map });
        Ok(Paint { map, ..paint })
    }
}
