//! Textures: decoded images with wrap modes, sampled bilinearly in linear values.

use crate::math::Vec2;
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

/// A decoded image: four bytes a texel. Clones share the texels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Texture {
    /// Width in texels, at least 1.
    pub width: u32,
    /// Height in texels, at least 1.
    pub height: u32,
    /// `width * height` texels, rows from the top.
    pub texels: Arc<[[u8; 4]]>,
    /// True if the colour channels are sRGB encoded; the fourth never is.
    pub srgb: bool,
    /// Horizontal and vertical wrap.
    pub wrap: [Wrap; 2],
}

/// Linear values of the 256 sRGB codes.
static SRGB: LazyLock<[f32; 256]> = LazyLock::new(|| {
    std::array::from_fn(|i| {
        let y = i as f64 / 255.0;
        let x = if y <= 0.04045 {
            y / 12.92
        } else {
            ((y + 0.055) / 1.055).powf(2.4)
        };
        x as f32
    })
});

impl Wrap {
    /// Index of the texel at `i` in a row of `n`.
    #[inline]
    fn index(self, i: i64, n: i64) -> usize {
        let wrapped = match self {
            Self::Repeat => i.rem_euclid(n),
            Self::Mirror => {
                let m = i.rem_euclid(2 * n);
                m.min(2 * n - 1 - m)
            }
            Self::Clamp => i.clamp(0, n - 1),
        };
        wrapped as usize
    }
}

impl Texture {
    /// Four linear values at `uv`, bilinear; (0, 0) is the top left corner of the image.
    pub fn sample(&self, uv: Vec2) -> [f32; 4] {
        // Coordinates that are not finite become 0; `as` saturates, so huge ones are harmless.
        let place = |x: f32, n: u32| {
            if x.is_finite() {
                f64::from(x) * f64::from(n) - 0.5
            } else {
                0.0
            }
        };
        let (x, y) = (place(uv.x, self.width), place(uv.y, self.height));
        let (x0, y0) = (x.floor() as i64, y.floor() as i64);
        let (fx, fy) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
        let row = |j: i64| {
            let y = self.wrap[1].index(y0.saturating_add(j), i64::from(self.height));
            let at = |i: i64| {
                self.texel(
                    self.wrap[0].index(x0.saturating_add(i), i64::from(self.width)),
                    y,
                )
            };
            lerp(at(0), at(1), fx)
        };
        lerp(row(0), row(1), fy)
    }

    #[inline]
    fn texel(&self, x: usize, y: usize) -> [f32; 4] {
        let texel = self.texels[y * self.width as usize + x];
        let plain = texel.map(|c| f32::from(c) * (1.0 / 255.0));
        if self.srgb {
            let decode = |c: u8| SRGB[usize::from(c)];
            [
                decode(texel[0]),
                decode(texel[1]),
                decode(texel[2]),
                plain[3],
            ]
        } else {
            plain
        }
    }

    /// Mean of the linear values.
    pub fn average(&self) -> [f32; 4] {
        let mut sum = [0.0f64; 4];
        for y in 0..self.height as usize {
            for x in 0..self.width as usize {
                let texel = self.texel(x, y);
                sum.iter_mut()
                    .zip(texel)
                    .for_each(|(s, t)| *s += f64::from(t));
            }
        }
        sum.map(|s| (s / (f64::from(self.width) * f64::from(self.height))) as f32)
    }
}

fn lerp(a: [f32; 4], b: [f32; 4], t: f32) -> [f32; 4] {
    std::array::from_fn(|i| a[i] + t * (b[i] - a[i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(wrap: Wrap) -> Texture {
        let texels = [
            [0, 0, 0, 255],
            [100, 0, 0, 255],
            [200, 0, 0, 255],
            [250, 0, 0, 255],
        ];
        Texture {
            width: 4,
            height: 1,
            texels: texels.into(),
            srgb: false,
            wrap: [wrap; 2],
        }
    }

    #[test]
    fn bilinear_sampling_is_exact_at_texel_centres() {
        let t = ramp(Wrap::Clamp);
        let red = |u: f32| t.sample(Vec2::new(u, 0.5))[0] * 255.0;
        assert!((red(0.375) - 100.0).abs() < 1e-3);
        assert!((red(0.5) - 150.0).abs() < 1e-3);
        assert_eq!(red(-3.0), 0.0);
        assert!((red(7.0) - 250.0).abs() < 1e-3);
    }

    #[test]
    fn texture_wrap_modes() {
        let at = |wrap, u: f32| ramp(wrap).sample(Vec2::new(u, 0.5))[0] * 255.0;
        assert!((at(Wrap::Repeat, 1.375) - 100.0).abs() < 1e-3);
        assert!((at(Wrap::Repeat, -0.625) - 100.0).abs() < 1e-3);
        assert!((at(Wrap::Mirror, 1.375) - 200.0).abs() < 1e-3);
        // Between the last texel and the first.
        assert!((at(Wrap::Repeat, 1.0) - 125.0).abs() < 1e-3);
        for bad in [f32::NAN, f32::INFINITY, 1e38, -1e38] {
            assert!(at(Wrap::Repeat, bad).is_finite());
        }
    }

    #[test]
    fn srgb_decodes_colours_but_not_opacity() {
        let t = Texture {
            width: 1,
            height: 1,
            texels: [[188, 0, 255, 128]].into(),
            srgb: true,
            ..Texture::default()
        };
        let [r, g, b, a] = t.sample(Vec2::ZERO);
        // IEC 61966-2-1: code 188 is 0.5029.
        assert!((r - 0.502_886).abs() < 1e-5 && g == 0.0 && b == 1.0);
        assert!((a - 128.0 / 255.0).abs() < 1e-6);
    }
}
