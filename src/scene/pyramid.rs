//! Mip levels of a texture: each has half the columns and rows of the level before, and the same mean.
//!
//! Means are of linear values, weighted by the area that an old texel shares with a new one, so that sizes need not be
//! powers of two. Rounding to codes would shift means by up to half a code, or half a per cent in light tones. So the
//! rounding error of a texel is added to the next one of its row, and at the end of a row to the row below.

use super::texture::{Code, Texels, Texture, Wrap, values};
use crate::math::Vec2;
use std::sync::Arc;

/// A mip level of a texture's colour, sRGB encoded if the texture is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Level {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
    /// Channels of a texel: grey, or red, green and blue.
    pub channels: u8,
    /// `width * height * channels` values.
    pub texels: Texels,
}

impl Level {
    /// The colour at `uv`, bilinear.
    #[inline]
    pub(super) fn sample(&self, srgb: bool, wrap: [Wrap; 2], uv: Vec2) -> [f32; 4] {
        let size = [self.width, self.height];
        self.texels.sample(self.channels, size, srgb, wrap, uv)
    }
}

/// The texels of the finer level, at most three, that a new texel covers along an axis, and their weights.
#[derive(Clone, Copy)]
struct FilterTaps {
    first: usize,
    weights: [f32; 3],
}

impl FilterTaps {
    /// Taps of all texels of a row of `n` made half as long.
    fn halved(n: u32) -> Vec<Self> {
        let m = n / 2;
        match (m, n % 2) {
            (0, _) => vec![Self {
                first: 0,
                weights: [1.0, 0.0, 0.0],
            }],
            (_, 0) => (0..m as usize)
                .map(|i| Self {
                    first: 2 * i,
                    weights: [0.5, 0.5, 0.0],
                })
                .collect(),
            // The i-th new texel covers the old ones from i n/m to (i + 1) n/m.
            _ => (0..m)
                .map(|i| Self {
                    first: 2 * i as usize,
                    weights: [m - i, m, i + 1].map(|w| (f64::from(w) / f64::from(n)) as f32),
                })
                .collect(),
        }
    }
}

/// Levels of a texture below the finest, down to a single texel.
pub(super) fn levels(of: &Texture) -> Arc<[Level]> {
    let mut levels: Vec<Level> = Vec::new();
    let (mut size, mut channels) = ([of.width, of.height], of.channels);
    while size != [1, 1] && size[0] > 0 && size[1] > 0 {
        let texels = levels.last().map_or(&of.texels, |level| &level.texels);
        let texels = match texels {
            Texels::Byte(codes) => Texels::Byte(halved(codes, size, channels, of.srgb)),
            Texels::Word(codes) => Texels::Word(halved(codes, size, channels, of.srgb)),
        };
        size = size.map(|n| (n / 2).max(1));
        // Opacity of coarser levels is never looked up.
        channels = if channels < 3 { 1 } else { 3 };
        levels.push(Level {
            width: size[0],
            height: size[1],
            channels,
            texels,
        });
    }
    levels.into()
}

fn halved<C: Code>(codes: &[C], size: [u32; 2], channels: u8, srgb: bool) -> Arc<[C]> {
    match channels {
        1 => halved_of::<C, 1, 1>(codes, size, srgb),
        2 => halved_of::<C, 2, 1>(codes, size, srgb),
        3 => halved_of::<C, 3, 3>(codes, size, srgb),
        _ => halved_of::<C, 4, 3>(codes, size, srgb),
    }
}

/// An image of `N` channels at half the width and height, with the first `M` channels.
fn halved_of<C: Code, const N: usize, const M: usize>(
    codes: &[C],
    size: [u32; 2],
    srgb: bool,
) -> Arc<[C]> {
    let [columns, rows] = size.map(FilterTaps::halved);
    let (width, table) = (size[0] as usize, C::table(srgb));
    let even = size.iter().all(|n| n % 2 == 0);
    let mut out = Vec::with_capacity(columns.len() * rows.len() * M);
    let mut rest = [0.0f32; M];
    for row in &rows {
        for column in &columns {
            let texel = |i: usize, j: usize| {
                let at = N * ((row.first + j) * width + column.first + i);
                values::<C, N>(&codes[at..at + N], table)
            };
            let mean = match even {
                true => {
                    let [a, b, c, d] = [texel(0, 0), texel(1, 0), texel(0, 1), texel(1, 1)];
                    std::array::from_fn(|k| 0.25 * ((a[k] + b[k]) + (c[k] + d[k])))
                }
                false => weighed(row, column, texel),
            };
            for c in 0..M {
                let wanted = mean[c] + rest[c];
                let code = C::nearest(wanted, srgb);
                // The error of a value beyond the last code could never be made up.
                rest[c] = (wanted - code.linear(table)).clamp(-0.01, 0.01);
                out.push(code);
            }
        }
    }
    out.into()
}

/// The mean of up to nine texels.
fn weighed(y: &FilterTaps, x: &FilterTaps, texel: impl Fn(usize, usize) -> [f32; 4]) -> [f32; 4] {
    let mut sum = [0.0f32; 4];
    for j in (0..3).filter(|&j| y.weights[j] > 0.0) {
        for i in (0..3).filter(|&i| x.weights[i] > 0.0) {
            let (weight, texel) = (y.weights[j] * x.weights[i], texel(i, j));
            (0..4).for_each(|c| sum[c] += weight * texel[c]);
        }
    }
    sum
}

#[cfg(test)]
mod tests;
