//! Textures, and their images, decoded once each.

use super::accessors::Data;
use super::error::{Result, Warnings, fault, place};
use super::extensions::DECODE_TEXTURES;
use super::uris::Files;
use crate::scene::Texture;
use crate::scene::texture::Wrap;
use gltf::json::Root;
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::Checked;
use image::{DynamicImage, ImageDecoder, ImageFormat, ImageReader};
use std::collections::{BTreeMap, HashMap};
use std::io::Cursor;

/// Most texels of one image, and of all images together: a few bytes of PNG can ask for any number.
const MAX_TEXELS: [u64; 2] = [1 << 26, 1 << 28];

/// Identity of a texture: uses with equal keys share one.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Key {
    image: usize,
    srgb: bool,
    wrap: [Wrap; 2],
}

/// The textures that materials ask for.
#[derive(Default)]
pub(super) struct Requests {
    known: HashMap<Key, u32>,
    /// Textures of each image.
    uses: BTreeMap<usize, Vec<(u32, Key)>>,
}

impl Requests {
    /// Requests a texture of the file; returns its index in `SceneParts::textures`.
    pub(super) fn texture(
        &mut self,
        root: &Root,
        index: usize,
        srgb: bool,
        warnings: &mut Warnings,
    ) -> Result<u32> {
        let Some(texture) = root.textures.get(index) else {
            return Err(fault(format!("textures[{index}]"), "does not exist"));
        };
        let at = place("textures", index, texture.name.as_ref());
        let image = source(texture).unwrap_or(texture.source.value());
        if image >= root.images.len() {
            return Err(fault(format!("{at}.source"), "is missing, or no image"));
        }
        let mut wrap = [Wrap::Repeat; 2];
        if let Some(sampler) = texture.sampler {
            let Some(sampler) = root.samplers.get(sampler.value()) else {
                return Err(fault(at, format!("samplers[{sampler}] does not exist")));
            };
            wrap = [mode(&sampler.wrap_s), mode(&sampler.wrap_t)];
            if sampler.mag_filter == Some(Checked::Valid(MagFilter::Nearest)) {
                warnings.say("nearest-texel filtering is not supported: textures are bilinear");
            }
        }
        let key = Key { image, srgb, wrap };
        let next = self.known.len() as u32;
        Ok(*self.known.entry(key).or_insert_with(|| {
            self.uses.entry(image).or_default().push((next, key));
            next
        }))
    }

    /// Reads and decodes the requested images, in file order.
    pub(super) fn textures(self, data: &Data<'_>, files: &mut Files) -> Result<Vec<Texture>> {
        let mut textures = vec![Texture::default(); self.known.len()];
        let mut left = MAX_TEXELS[1];
        for (image, uses) in self.uses {
            let at = place("images", image, data.root.images[image].name.as_ref());
            let picture = decoded(data, image, files, &at, left)?;
            left -= picture.texels.len() as u64;
            for (texture, Key { srgb, wrap, .. }) in uses {
                textures[texture as usize] = Texture {
                    srgb,
                    wrap,
                    ..picture.clone()
                };
            }
        }
        Ok(textures)
    }
}

/// The image that EXT_texture_webp gives.
fn source(texture: &gltf::json::Texture) -> Option<usize> {
    let webp = texture
        .extensions
        .as_ref()?
        .others
        .get("EXT_texture_webp")?;
    Some(usize::try_from(webp.get("source")?.as_u64()?).unwrap_or(usize::MAX))
}

fn mode(wrap: &Checked<WrappingMode>) -> Wrap {
    match wrap {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

/// An image of at most `most` texels. The bytes decide the format, not the MIME type.
fn decoded(
    data: &Data<'_>,
    index: usize,
    files: &mut Files,
    at: &str,
    most: u64,
) -> Result<Texture> {
    let image = &data.root.images[index];
    let owned;
    let bytes = match (&image.uri, image.buffer_view) {
        (Some(uri), _) => {
            owned = files.read(uri, at)?;
            &owned
        }
        (None, Some(view)) => data.view(view.value())?,
        (None, None) => return Err(fault(at, "has neither a uri nor a bufferView")),
    };
    let bad = |e: image::ImageError| fault(at, format!("cannot be decoded: {e}"));
    let format = image::guess_format(bytes).ok();
    if bytes.starts_with(b"\xabKTX 20\xbb") {
        let what = format!("KTX2 is not supported; to decode it: {DECODE_TEXTURES}");
        return Err(fault(at, what));
    }
    if !matches!(
        format,
        Some(ImageFormat::Png | ImageFormat::Jpeg | ImageFormat::WebP)
    ) {
        return Err(fault(at, "is neither PNG nor JPEG nor WebP"));
    }
    let mut reader = ImageReader::new(Cursor::new(bytes));
    if let Some(format) = format {
        reader.set_format(format);
    }
    let decoder = reader.into_decoder().map_err(bad)?;
    let (width, height) = decoder.dimensions();
    let texels = u64::from(width) * u64::from(height);
    if texels == 0 || texels > most.min(MAX_TEXELS[0]) {
        return Err(fault(
            at,
            format!("{width} x {height} texels are none or too many"),
        ));
    }
    let pixels = DynamicImage::from_decoder(decoder)
        .map_err(bad)?
        .into_rgba8();
    let (texels, _) = pixels.as_raw().as_chunks::<4>();
    Ok(Texture {
        width,
        height,
        texels: texels.into(),
        ..Texture::default()
    })
}
