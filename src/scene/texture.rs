//! Textures: decoded images with wrap modes, looked up bilinearly in linear values, with mip levels.

use super::pyramid::{self, Level};
use crate::math::Vec2;
use rayon::prelude::*;
use std::sync::{Arc, LazyLock};

/// Continuation of a texture outside [0, 1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The image repeats.
    #[default]
    Repeat,
    /// The image repeats, every other copy mirrored.
    Mirror,
    /// The edge texels continue.
    Clamp,
}

/// Channels of the texels of an image one after another, rows from the top, at the depth that its file has. Clones
/// share them.
#[derive(Clone, Debug, PartialEq)]
pub enum Texels {
    /// Eight bits a channel.
    Byte(Arc<[u8]>),
    /// Sixteen bits a channel.
    Word(Arc<[u16]>),
}

/// A decoded image.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Texture {
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// Channels of a texel: grey; grey and opacity; red, green and blue; all four.
    pub channels: u8,
    /// `width * height * channels` values.
    pub texels: Texels,
    /// True if the colour channels are sRGB encoded; opacity never is.
    pub srgb: bool,
    /// Horizontal and vertical wrap.
    pub wrap: [Wrap; 2],
    /// True if texels have edges: no interpolation between them.
    pub nearest: bool,
    /// Mip levels of the colour, without the finest; empty if no material needs them.
    pub mips: Arc<[Level]>,
}

impl Default for Texels {
    fn default() -> Self {
        Self::Byte(Arc::default())
    }
}

/// A channel of a texel.
pub(super) trait Code: Copy + Send + Sync {
    /// Linear values of the codes.
    type Table: Copy + Sync;
    /// Linear values of codes that are sRGB encoded, or not.
    fn table(srgb: bool) -> Self::Table;
    /// The linear value.
    fn linear(self, table: Self::Table) -> f32;
    /// The code over the largest code, in [0, 1].
    fn fraction(self) -> f32;
    /// The code nearest to a linear value, if that is in [0, 1].
    fn nearest(value: f32, srgb: bool) -> Self;
}

/// Linear value of a fraction that is sRGB encoded (IEC 61966-2-1).
fn linear(y: f64) -> f32 {
    let x = if y <= 0.04045 {
        y / 12.92
    } else {
        ((y + 0.055) / 1.055).powf(2.4)
    };
    x as f32
}

/// Linear values of the 256 sRGB codes.
static SRGB: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| linear(i as f64 / 255.0)));

/// Linear values of the 256 codes that are not encoded.
static PLAIN: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|i| (i as u8).fraction()));

/// Linear values of the 65,536 sRGB codes.
static WIDE_SRGB: LazyLock<Vec<f32>> = LazyLock::new(|| {
    (0..=65535)
        .map(|i| linear(f64::from(i) / 65535.0))
        .collect()
});

/// Number of steps of [`NEAREST`] over [0, 1]: a step is smaller than the difference of any two of the 256 codes.
const STEPS: usize = 4096;

/// For each step, the code nearest to its least value, and the value from which the next code is nearer. For linear and
/// for sRGB codes.
static NEAREST: LazyLock<[Vec<(u8, f32)>; 2]> = LazyLock::new(|| {
    [false, true].map(|srgb| {
        let table = u8::table(srgb);
        let next = |code: usize| match code {
            255 => f32::INFINITY,
            _ => 0.5 * (table[code] + table[code + 1]),
        };
        let mut code = 0;
        let step = |i: usize| {
            while next(code) <= i as f32 / STEPS as f32 {
                code += 1;
            }
            (code as u8, next(code))
        };
        (0..=STEPS).map(step).collect()
    })
});

impl Code for u8 {
    type Table = &'static [f32; 256];

    #[inline(always)]
    fn table(srgb: bool) -> Self::Table {
        if srgb { &SRGB } else { &PLAIN }
    }

    #[inline(always)]
    fn linear(self, table: Self::Table) -> f32 {
        table[usize::from(self)]
    }

    #[inline(always)]
    fn fraction(self) -> f32 {
        f32::from(self) * (1.0 / 255.0)
    }

    #[inline(always)]
    fn nearest(value: f32, srgb: bool) -> Self {
        let value = value.clamp(0.0, 1.0);
        let (code, next) = NEAREST[usize::from(srgb)][(value * STEPS as f32) as usize];
        // Without a branch, since processors could not predict it.
        code + Self::from(value >= next)
    }
}

impl Code for u16 {
    /// `None` if codes are not sRGB encoded.
    type Table = Option<&'static [f32]>;

    #[inline(always)]
    fn table(srgb: bool) -> Self::Table {
        srgb.then(|| &WIDE_SRGB[..])
    }

    #[inline(always)]
    fn linear(self, table: Self::Table) -> f32 {
        table.map_or_else(|| self.fraction(), |table| table[usize::from(self)])
    }

    #[inline(always)]
    fn fraction(self) -> f32 {
        f32::from(self) * (1.0 / 65535.0)
    }

    fn nearest(value: f32, srgb: bool) -> Self {
        let value = value.clamp(0.0, 1.0);
        let fraction = match srgb {
            false => value,
            true if value <= 0.003_130_8 => 12.92 * value,
            true => 1.055 * value.powf(1.0 / 2.4) - 0.055,
        };
        (fraction * 65535.0 + 0.5) as Self
    }
}

/// The largest integer not above a number; without the function call of `f64::floor` on old processors.
#[inline(always)]
fn floor(x: f64) -> i64 {
    let i = x as i64;
    i - i64::from(x < i as f64)
}

impl Wrap {
    /// The two texels of a row of `n` between whose centres a coordinate lies, and the weight of the second.
    #[inline(always)]
    fn place(self, u: f32, n: u32) -> ([usize; 2], f32) {
        let u = f64::from(u);
        // Reduction to one period without a division; exact, so that all copies of an image are equal.
        let u = match self {
            Self::Repeat => u - floor(u) as f64,
            Self::Mirror => u - 2.0 * floor(0.5 * u) as f64,
            Self::Clamp => u.clamp(-1.0, 2.0),
        };
        // Coordinates that are not finite, or so large that they have no fraction, become 0.
        let u = if u.abs() <= 2.0 { u } else { 0.0 };
        let x = u * f64::from(n) - 0.5;
        let (i, n) = (floor(x), i64::from(n));
        let part = (x - i as f64) as f32;
        let index = |i: i64| match self {
            Self::Repeat if i < 0 => n - 1,
            Self::Repeat if i >= n => 0,
            Self::Mirror if i < 0 || i >= 2 * n => 0,
            Self::Mirror => i.min(2 * n - 1 - i),
            _ => i.clamp(0, n - 1),
        } as usize;
        ([index(i), index(i + 1)], part)
    }
}

impl Texels {
    /// Bilinear look-up of an image of these channels and this size.
    #[inline]
    pub(super) fn sample(
        &self,
        channels: u8,
        size: [u32; 2],
        srgb: bool,
        wrap: [Wrap; 2],
        uv: Vec2,
    ) -> [f32; 4] {
        let at = [wrap[0].place(uv.x, size[0]), wrap[1].place(uv.y, size[1])];
        match (self, channels) {
            (Self::Byte(t), 4) => bilinear::<u8, 4>(t, size[0], at, srgb),
            (Self::Byte(t), 3) => bilinear::<u8, 3>(t, size[0], at, srgb),
            (Self::Byte(t), 2) => bilinear::<u8, 2>(t, size[0], at, srgb),
            (Self::Byte(t), _) => bilinear::<u8, 1>(t, size[0], at, srgb),
            (Self::Word(t), 4) => bilinear::<u16, 4>(t, size[0], at, srgb),
            (Self::Word(t), 3) => bilinear::<u16, 3>(t, size[0], at, srgb),
            (Self::Word(t), 2) => bilinear::<u16, 2>(t, size[0], at, srgb),
            (Self::Word(t), _) => bilinear::<u16, 1>(t, size[0], at, srgb),
        }
    }
}

/// Linear values of a texel of `N` channels.
#[inline(always)]
pub(super) fn values<C: Code, const N: usize>(texel: &[C], table: C::Table) -> [f32; 4] {
    match N {
        1 | 2 => {
            let grey = texel[0].linear(table);
            let opacity = if N == 2 { texel[1].fraction() } else { 1.0 };
            [grey, grey, grey, opacity]
        }
        _ => {
            let [r, g, b] = [0, 1, 2].map(|i| texel[i].linear(table));
            let opacity = if N == 4 { texel[3].fraction() } else { 1.0 };
            [r, g, b, opacity]
        }
    }
}

#[inline(always)]
fn bilinear<C: Code, const N: usize>(
    texels: &[C],
    width: u32,
    [([x0, x1], fx), ([y0, y1], fy)]: [([usize; 2], f32); 2],
    srgb: bool,
) -> [f32; 4] {
    let table = C::table(srgb);
    let texel = |x: usize, y: usize| {
        let at = N * (y * width as usize + x);
        values::<C, N>(&texels[at..at + N], table)
    };
    let row = |y| lerp(texel(x0, y), texel(x1, y), fx);
    lerp(row(y0), row(y1), fy)
}

impl Texture {
    /// An image of texels of red, green, blue and opacity, rows from the top; linear, and repeated.
    pub fn rgba(width: u32, height: u32, texels: impl IntoIterator<Item = [u8; 4]>) -> Self {
        Self {
            width,
            height,
            channels: 4,
            texels: Texels::Byte(texels.into_iter().flatten().collect()),
            ..Self::default()
        }
    }

    /// Four linear values at `uv`, bilinear or of the nearest texel; (0, 0) is the top left corner of the image.
    #[inline]
    pub fn sample(&self, uv: Vec2) -> [f32; 4] {
        if self.nearest {
            return self.nearest_to(uv);
        }
        let size = [self.width, self.height];
        (self.texels).sample(self.channels, size, self.srgb, self.wrap, uv)
    }

    fn nearest_to(&self, uv: Vec2) -> [f32; 4] {
        let along = |wrap: Wrap, x: f32, n: u32| {
            let ([low, high], part) = wrap.place(x, n);
            if part < 0.5 { low } else { high }
        };
        let x = along(self.wrap[0], uv.x, self.width);
        let y = along(self.wrap[1], uv.y, self.height);
        self.texel(x as u32, y as u32)
    }

    /// Mean colour over a footprint at `uv`, given by its two half axes in texture coordinates: a few trilinear
    /// look-ups along the longer axis, at the level of the shorter axis, or of a sixteenth of the longer one if that is
    /// more. Equal to [`Texture::sample`] bit for bit if the footprint is no larger than a texel, or without mip
    /// levels.
    ///
    /// The level follows the shorter axis so that nothing outside the footprint is blurred in.
    pub(crate) fn sample_over(&self, uv: Vec2, axes: [Vec2; 2]) -> [f32; 4] {
        /// Largest ratio of the axes; above it the level is coarser.
        const SLENDER: f32 = 16.0;
        /// Largest number of look-ups along the longer axis; further samples of the pixel fill the gaps.
        const MAX_LOOKUPS: f32 = 4.0;
        let size = Vec2::new(self.width as f32, self.height as f32);
        let lengths = axes.map(|axis| (axis * size).length());
        let (longer, long, short) = match lengths[0] > lengths[1] {
            true => (axes[0], lengths[0], lengths[1]),
            false => (axes[1], lengths[1], lengths[0]),
        };
        // The negated comparison also catches NaN.
        if !(long > 1.0 && long.is_finite()) || self.mips.is_empty() {
            return self.sample(uv);
        }
        let texels = short.max(long / SLENDER).max(1.0);
        let lod = texels.log2();
        let number = (long / texels).ceil().clamp(1.0, MAX_LOOKUPS);
        let mut sum = [0.0; 4];
        for i in 0..number as u32 {
            let place = (2 * i + 1) as f32 / number - 1.0;
            let value = self.at_level(uv + place * longer, lod);
            (0..4).for_each(|c| sum[c] += value[c]);
        }
        sum.map(|x| x / number)
    }

    /// The colour at a mip level, interpolated if `lod` is no integer; 0 is the finest.
    fn at_level(&self, uv: Vec2, lod: f32) -> [f32; 4] {
        let lod = lod.min(self.mips.len() as f32);
        let (k, part) = (lod as usize, lod.fract());
        let level = |k: usize| match k.checked_sub(1) {
            None => self.sample(uv),
            Some(k) => self.mips[k].sample(self.srgb, self.wrap, uv),
        };
        match part > 0.0 {
            true => lerp(level(k), level(k + 1), part),
            false => level(k),
        }
    }

    /// The linear values of the texel of a column and a row.
    pub fn texel(&self, x: u32, y: u32) -> [f32; 4] {
        let channels = usize::from(self.channels);
        let at = channels * (y as usize * self.width as usize + x as usize);
        let at = at..at + channels;
        match &self.texels {
            Texels::Byte(codes) => texel_of(&codes[at], self.srgb),
            Texels::Word(codes) => texel_of(&codes[at], self.srgb),
        }
    }

    /// True if a channel (0 to 2 for red to blue) is 0 everywhere.
    pub(super) fn is_black(&self, channel: usize) -> bool {
        let (n, at) = match self.channels {
            n @ 0..3 => (usize::from(n.max(1)), 0),
            n => (usize::from(n), channel),
        };
        match &self.texels {
            Texels::Byte(codes) => codes.iter().skip(at).step_by(n).all(|&c| c == 0),
            Texels::Word(codes) => codes.iter().skip(at).step_by(n).all(|&c| c == 0),
        }
    }

    /// Mean of the linear values.
    pub fn average(&self) -> [f32; 4] {
        let row = |y: u32| {
            (0..self.width).fold([0.0f64; 4], |sum, x| {
                let texel = self.texel(x, y);
                std::array::from_fn(|i| sum[i] + f64::from(texel[i]))
            })
        };
        let rows: Vec<_> = (0..self.height).into_par_iter().map(row).collect();
        let number = f64::from(self.width) * f64::from(self.height);
        std::array::from_fn(|i| (rows.iter().map(|row| row[i]).sum::<f64>() / number) as f32)
    }

    /// Builds the mip levels.
    pub(super) fn build_mips(&mut self) {
        self.mips = pyramid::levels(self);
    }
}

/// Builds the mip levels of wanted textures that have none yet.
pub(super) fn build_mips(textures: &mut [Texture], wanted: impl Fn(usize) -> bool + Sync) {
    let all = textures.par_iter_mut().enumerate();
    all.filter(|(i, texture)| wanted(*i) && texture.mips.is_empty())
        .for_each(|(_, texture)| texture.build_mips());
}

fn texel_of<C: Code>(codes: &[C], srgb: bool) -> [f32; 4] {
    let table = C::table(srgb);
    match codes.len() {
        1 => values::<C, 1>(codes, table),
        2 => values::<C, 2>(codes, table),
        3 => values::<C, 3>(codes, table),
        _ => values::<C, 4>(codes, table),
    }
}

fn lerp(a: [f32; 4], b: [f32; 4], t: f32) -> [f32; 4] {
    std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))
}

#[cfg(test)]
mod tests;
