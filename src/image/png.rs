//! PNG files: display pictures out, 8- and 16-bit pictures in.
//!
//! Writing only encodes for a display: exposure and view ([`Display`]), sRGB curve, 8 bit. A pixel that is not
//! finite is drawn magenta, so that it is not mistaken for black.

use std::io::{self, Cursor};
use std::path::Path;

use ::image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader, Limits, RgbImage};

use super::Buffer;
use super::display::Display;
use super::film::MAX_PIXELS;
use crate::files::{self, FileError, Problem};
use crate::math::Rgb;

/// The sRGB curve: linear [0, 1] to display [0, 1].
pub(crate) fn srgb_encode(x: f32) -> f32 {
    if x <= 0.003_130_8 {
        12.92 * x
    } else {
        1.055 * x.powf(1.0 / 2.4) - 0.055
    }
}

/// The linear value in [0, 1] of a value encoded in sRGB.
pub fn srgb_decode(y: f32) -> f32 {
    if y <= 0.040_45 {
        y / 12.92
    } else {
        ((y + 0.055) / 1.055).powf(2.4)
    }
}

/// One pixel for a display.
pub fn display(value: Rgb, display: Display) -> [u8; 3] {
    if !value.is_finite() {
        return [255, 0, 255];
    }
    display
        .linear(value)
        .to_array()
        .map(|c| (srgb_encode(c) * 255.0).round() as u8)
}

/// A PNG file in memory. A number for the display is an exposure in stops.
pub fn encode(
    picture: &Buffer,
    display: impl Into<Display>,
) -> Result<Vec<u8>, ::image::ImageError> {
    let shown = display.into();
    let bytes = picture
        .pixels
        .iter()
        .flat_map(|&p| self::display(p, shown))
        .collect();
    let rgb = RgbImage::from_raw(picture.width as u32, picture.height as u32, bytes);
    let rgb = DynamicImage::ImageRgb8(rgb.expect("three bytes a pixel"));
    let mut out = Cursor::new(Vec::new());
    rgb.write_to(&mut out, ImageFormat::Png)?;
    Ok(out.into_inner())
}

/// Writes a PNG file as [`encode`] makes it; the old file stays until the new one is complete.
pub fn write(path: &Path, picture: &Buffer, display: impl Into<Display>) -> Result<(), FileError> {
    let bytes =
        encode(picture, display).map_err(|e| Problem::Write(io::Error::other(e)).at(path))?;
    files::write_bytes(path, bytes)
}

/// Reads a PNG (or JPEG) file as linear RGB in [0, 1]; transparency is dropped.
pub fn read(path: &Path) -> Result<Buffer, FileError> {
    let io = |e| Problem::Read(e).at(path);
    let mut reader = ImageReader::open(path)
        .and_then(ImageReader::with_guessed_format)
        .map_err(io)?;
    let mut limits = Limits::default();
    // Far above any render, and far below the sizes that a header of a few bytes can declare.
    limits.max_alloc = Some(1 << 31);
    reader.limits(limits);
    let content = |e| FileError::content(path, e);
    let decoder = reader.into_decoder().map_err(content)?;
    let (width, height) = decoder.dimensions();
    if width as usize * height as usize > MAX_PIXELS {
        let what = format!("{width}x{height} pixels are more than this program reads");
        return Err(FileError::content(path, what));
    }
    let decoded = DynamicImage::from_decoder(decoder).map_err(content)?;
    let rgb = decoded.into_rgb32f();
    Ok(Buffer {
        width: rgb.width() as usize,
        height: rgb.height() as usize,
        pixels: rgb
            .pixels()
            .map(|p| Rgb::from_array(p.0.map(srgb_decode)))
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_curve_inverts_and_is_continuous() {
        for i in 0..=255u8 {
            let y = f32::from(i) / 255.0;
            assert!((srgb_encode(srgb_decode(y)) - y).abs() < 1e-6);
            assert_eq!(display(Rgb::splat(srgb_decode(y)), 0.0.into()), [i; 3]);
        }
        assert!((srgb_encode(0.003_130_8) - srgb_encode(0.003_130_9)).abs() < 1e-5);
        assert!((srgb_encode(1.0) - 1.0).abs() < 1e-7);
    }

    #[test]
    fn display_exposure_clamp_and_non_finite() {
        assert_eq!(display(Rgb::splat(0.25), 2.0.into()), [255; 3]);
        assert_eq!(display(Rgb::new(-1.0, 0.0, 1e30), 0.0.into()), [0, 0, 255]);
        assert_eq!(
            display(Rgb::new(0.0, f32::NAN, 0.0), 0.0.into()),
            [255, 0, 255]
        );
    }
}
