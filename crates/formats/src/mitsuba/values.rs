//! Properties of Mitsuba's objects: numbers, colours and textures.

use super::super::Role;
use super::super::images::Use;
use super::Scene;
use super::xml::{Object, Property, Value, numbers};
use crate::build::colour::{Spectrum, black_body_radiance};
use crate::build::looks::Paint;
use glam::{Affine2, DAffine3, DMat4, DVec3, Mat2, Vec2};
use opsr::math::{Rgb, luminance};
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{TextureRef, Wrap};

impl Object {
    pub(super) fn property(&self, name: &str) -> Option<&Property> {
        self.properties.iter().find(|p| p.name == name)
    }

    pub(super) fn number(&self, name: &str, or: f64) -> Result<f64> {
        match self.property(name).map(|p| (&p.value, &p.place)) {
            None => Ok(or),
            Some((Value::Number(x), _)) => Ok(*x),
            Some((Value::Text(text), place)) => {
                let number = text.trim().parse().ok();
                number.ok_or_else(|| fault(place, format!("`{name}` is no number")))
            }
            Some((Value::Rgb([x, y, z]), _)) if x == y && y == z => Ok(f64::from(*x)),
            Some((Value::Spectrum(text), place)) => match numbers(text).as_deref() {
                Some([x]) => Ok(*x),
                _ => Err(fault(place, format!("`{name}` is no number"))),
            },
            Some((_, place)) => Err(fault(place, format!("`{name}` is no number"))),
        }
    }

    pub(super) fn flag(&self, name: &str, or: bool) -> Result<bool> {
        match self.property(name).map(|p| (&p.value, &p.place)) {
            None => Ok(or),
            Some((Value::Bool(x), _)) => Ok(*x),
            Some((_, place)) => Err(fault(place, format!("`{name}` is neither true nor false"))),
        }
    }

    pub(super) fn text(&self, name: &str) -> Result<Option<&str>> {
        match self.property(name).map(|p| (&p.value, &p.place)) {
            None => Ok(None),
            Some((Value::Text(x), _)) => Ok(Some(x)),
            Some((_, place)) => Err(fault(place, format!("`{name}` is no string"))),
        }
    }

    pub(super) fn vector(&self, name: &str, or: DVec3) -> Result<DVec3> {
        match self.property(name).map(|p| (&p.value, &p.place)) {
            None => Ok(or),
            Some((Value::Vector(x), _)) => Ok(*x),
            Some((_, place)) => Err(fault(place, format!("`{name}` is no point"))),
        }
    }

    pub(super) fn matrix(&self, name: &str) -> Result<DMat4> {
        match self.property(name).map(|p| (&p.value, &p.place)) {
            None => Ok(DMat4::IDENTITY),
            Some((Value::Transform(x), _)) => Ok(*x),
            Some((_, place)) => Err(fault(place, format!("`{name}` is no transform"))),
        }
    }

    pub(super) fn pose(&self, name: &str) -> Result<DAffine3> {
        super::affine(&self.matrix(name)?, &self.place)
    }
}

impl Scene<'_> {
    /// The spectrum of a text such as `400:0.1, 500:0.2`.
    fn spectrum(text: &str, place: &str) -> Result<Spectrum> {
        let words = text.split([',', ' ', '\t', '\n']).filter(|w| !w.is_empty());
        let pairs: Option<Vec<(f64, f64)>> = words
            .map(|word| {
                let (w, v) = word.split_once(':')?;
                Some((w.trim().parse().ok()?, v.trim().parse().ok()?))
            })
            .collect();
        let spectrum = pairs.and_then(Spectrum::new);
        spectrum.ok_or_else(|| fault(place, format!("`{text}` is no spectrum")))
    }

    fn colour_of(&mut self, value: &Value, meant: Role, place: &str) -> Result<Rgb> {
        let of = |spectrum: Spectrum| match meant {
            Role::Reflected => spectrum.reflected(),
            Role::Emitted => spectrum.emitted(),
        };
        let colour = match value {
            Value::Number(x) => Rgb::splat(*x as f32),
            Value::Rgb(rgb) => Rgb::from_array(*rgb),
            Value::Spectrum(text) => match numbers(text).as_deref() {
                Some([x]) if meant == Role::Reflected => Rgb::splat(*x as f32),
                Some([x]) => Spectrum::new(vec![(300.0, *x), (900.0, *x)]).map_or(Rgb::ZERO, of),
                Some([r, g, b]) => Rgb::new(*r as f32, *g as f32, *b as f32),
                _ => of(Self::spectrum(text, place)?),
            },
            Value::SpectrumFile(name) => of(self.context.spectrum_file(name, place)?),
            Value::BlackBody { kelvin, scale } => black_body_radiance(*kelvin) * *scale as f32,
            _ => return Err(fault(place, "is no colour")),
        };
        match colour.is_finite() {
            true => Ok(colour.max(Rgb::ZERO)),
            false => Err(fault(place, "a colour that is not finite")),
        }
    }

    /// A colour; of a texture, its mean with a warning.
    pub(super) fn colour(
        &mut self,
        object: &Object,
        names: &[&str],
        or: Rgb,
        meant: Role,
    ) -> Result<Rgb> {
        let paint = self.paint_of(object, names, Paint::plain(or), meant)?;
        if paint.map.is_some() {
            self.context.nearest(
                &object.place,
                format!("a texture as `{}`", names[0]),
                "its mean",
            )?;
            return Ok(self.context.builder.mean(paint));
        }
        Ok(paint.factor)
    }

    /// The colour or texture of a surface.
    pub(super) fn paint(&mut self, object: &Object, names: &[&str], or: Paint) -> Result<Paint> {
        self.paint_of(object, names, or, Role::Reflected)
    }

    /// True if an object has a property or a texture with this name.
    pub(super) fn has(&self, object: &Object, name: &str) -> Result<bool> {
        let textures = self.children(object, &["texture", "spectrum", "volume"])?;
        Ok(object.property(name).is_some() || textures.iter().any(|(n, _)| n == name))
    }

    /// A number or a texture of numbers: the luminance of colours.
    pub(super) fn numbers(&mut self, object: &Object, name: &str, or: f32) -> Result<Paint> {
        let paint = self.paint(object, &[name], Paint::from(or))?;
        Ok(self.grey(paint))
    }

    pub(super) fn grey(&mut self, paint: Paint) -> Paint {
        let Some(map) = paint.map else {
            // The weights of the luminance sum to 1 only up to rounding, so grey stays as it is.
            let Rgb { x, y, z } = paint.factor;
            let is_grey = x == y && y == z;
            return Paint::from(if is_grey { x } else { luminance(paint.factor) });
        };
        let key = (map.texture, paint.factor.to_array().map(f32::to_bits));
        let builder = &mut self.context.builder;
        let (factor, texture) =
            *(self.greys.entry(key)).or_insert_with(|| builder.grey(paint.factor, map));
        Paint {
            factor: Rgb::splat(factor),
            map: Some(TextureRef { texture, ..map }),
        }
    }

    pub(super) fn paint_of(
        &mut self,
        object: &Object,
        names: &[&str],
        or: Paint,
        meant: Role,
    ) -> Result<Paint> {
        for name in names {
            if let Some(property) = object.property(name) {
                let colour = self.colour_of(&property.value, meant, &property.place)?;
                return Ok(Paint::plain(colour));
            }
            let all = self.children(object, &["texture", "spectrum", "volume"])?;
            if let Some((_, texture)) = all.iter().find(|(n, _)| n == name) {
                let texture = texture.clone();
                return self.within(&texture.clone(), |scene| scene.texture(&texture, meant));
            }
        }
        Ok(or)
    }

    /// The first texture of an object, whatever its name.
    pub(super) fn any_texture(&mut self, object: &Object) -> Result<Option<Paint>> {
        let all = self.children(object, &["texture"])?;
        let Some((_, texture)) = all.into_iter().next() else {
            return Ok(None);
        };
        self.within(&texture.clone(), |scene| {
            scene.texture(&texture, Role::Reflected)
        })
        .map(Some)
    }

    fn texture(&mut self, texture: &Object, meant: Role) -> Result<Paint> {
        let place = &texture.place;
        match texture.plugin.as_str() {
            "bitmap" | "ldrtexture" => self.bitmap(texture),
            "checkerboard" => {
                let first = self.colour(texture, &["color0"], Rgb::splat(0.4), meant)?;
                let second = self.colour(texture, &["color1"], Rgb::splat(0.2), meant)?;
                let (colours, transform) = ([first, second, second, first], uv_transform(texture)?);
                Ok((self.context.builder).fields(colours, true, transform))
            }
            "mesh_attribute" => {
                let name = texture.text("name")?.unwrap_or_default();
                if name.starts_with("vertex_") {
                    self.painted = true;
                } else {
                    (self.context).nearest(place, format!("mesh attribute `{name}`"), "white")?;
                }
                Ok(Paint::from(texture.number("scale", 1.0)? as f32))
            }
            "vertexcolors" => {
                self.painted = true;
                Ok(Paint::from(1.0))
            }
            "uniform" => Ok(Paint::from(texture.number("value", 1.0)? as f32)),
            "srgb" | "rgb" | "constvolume" => Ok(Paint::plain(self.colour(
                texture,
                &["color", "value"],
                Rgb::ONE,
                meant,
            )?)),
            "d65" => {
                let colour = self.colour(texture, &["color", "value"], Rgb::ONE, meant)?;
                Ok(Paint::plain(colour * texture.number("scale", 1.0)? as f32))
            }
            "blackbody" => {
                let scale = texture.number("scale", 1.0)?;
                let kelvin = texture.number("temperature", 5000.0)?;
                let value = Value::BlackBody { kelvin, scale };
                Ok(Paint::plain(self.colour_of(&value, meant, place)?))
            }
            "regular" | "irregular" => self.sampled_spectrum(texture, meant),
            "scale" => {
                let inner = self.any_texture(texture)?.unwrap_or(Paint::from(1.0));
                let factor = self.colour(texture, &["scale"], Rgb::ONE, meant)?;
                Ok(Paint {
                    factor: inner.factor * factor,
                    ..inner
                })
            }
            other => {
                self.context
                    .nearest(place, format!("texture `{other}`"), "grey")?;
                Ok(Paint::from(0.5))
            }
        }
    }

    fn sampled_spectrum(&mut self, texture: &Object, meant: Role) -> Result<Paint> {
        let place = &texture.place;
        let list = |name: &str| -> Result<Vec<f64>> {
            Ok(texture.text(name)?.and_then(numbers).unwrap_or_default())
        };
        let values = list("values")?;
        let at: Vec<f64> = match texture.plugin.as_str() {
            "irregular" => list("wavelengths")?,
            _ => {
                let low = texture.number("wavelength_min", 360.0)?;
                let high = texture.number("wavelength_max", 830.0)?;
                let step = (high - low) / values.len().saturating_sub(1).max(1) as f64;
                (0..values.len()).map(|i| low + i as f64 * step).collect()
            }
        };
        let pairs = at.into_iter().zip(values).collect();
        let spectrum = Spectrum::new(pairs).ok_or_else(|| fault(place, "is no spectrum"))?;
        Ok(Paint::plain(match meant {
            Role::Reflected => spectrum.reflected(),
            Role::Emitted => spectrum.emitted(),
        }))
    }

    fn bitmap(&mut self, texture: &Object) -> Result<Paint> {
        let place = &texture.place;
        let name = texture.text("filename")?;
        let name = name.ok_or_else(|| fault(place, "a bitmap without a filename"))?;
        let both = texture.text("wrap_mode")?.unwrap_or("repeat");
        let mut wrap = [Wrap::Repeat; 2];
        // Mitsuba 0.6 has one mode for each axis.
        for (axis, name) in ["wrap_mode_u", "wrap_mode_v"].into_iter().enumerate() {
            wrap[axis] = match texture.text(name)?.unwrap_or(both) {
                "repeat" => Wrap::Repeat,
                "mirror" => Wrap::Mirror,
                "clamp" => Wrap::Clamp,
                other => {
                    self.context
                        .nearest(place, format!("wrap mode `{other}`"), "`clamp`")?;
                    Wrap::Clamp
                }
            };
        }
        let gamma = texture.number("gamma", 0.0)?;
        let raw = texture.flag("raw", gamma == 1.0)?;
        let how = Use {
            srgb: if raw { Some(false) } else { None },
            wrap,
            nearest: texture.text("filter_type")? == Some("nearest"),
            invert: false,
            transform: uv_transform(texture)?,
        };
        self.context.texture(name, how, place)
    }
}

/// The transform from a mesh's texture coordinates to a texture's.
fn uv_transform(texture: &Object) -> Result<Affine2> {
    let m = texture.matrix("to_uv")?;
    let own = Affine2::from_mat2_translation(
        Mat2::from_cols(
            Vec2::new(m.x_axis.x as f32, m.x_axis.y as f32),
            Vec2::new(m.y_axis.x as f32, m.y_axis.y as f32),
        ),
        // A 2D transform has its translation in the third column, a 3D one in the fourth.
        Vec2::new(m.w_axis.x as f32, m.w_axis.y as f32),
    );
    // The parameters of Mitsuba 0.6.
    let of = |name: &str, or: f64| texture.number(name, or).map(|x| x as f32);
    let all = of("uvscale", 1.0)?;
    let scale = Vec2::new(of("uscale", all.into())?, of("vscale", all.into())?);
    let offset = Vec2::new(of("uoffset", 0.0)?, of("voffset", 0.0)?);
    Ok(Affine2::from_scale_angle_translation(scale, 0.0, offset) * own)
}
