//! Textures, and their images, decoded once each.

use super::accessors::Data;
use super::codecs::{Codec, ImageCodec, Part};
use super::error::{Fault, Result, fault, place};
use super::uris::Files;
use crate::memory;
use crate::scene::Texture;
use crate::scene::texture::{Texels, Wrap};
use gltf::json::Root;
use gltf::json::texture::{MagFilter, WrappingMode};
use gltf::json::validation::Checked;
use image::{ColorType, ImageDecoder, ImageFormat, ImageReader};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::io::Cursor;
use std::sync::Arc;

/// Bound on the texels per byte of a file: a PNG of one bit per texel, compressed to a thousandth, has eight thousand.
const TEXELS_PER_BYTE: u64 = 1 << 14;

/// Number of encoded images in memory at a time, each decoded by one thread.
const BATCH: usize = 8;

/// Identity of a texture: uses with equal keys share one.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Key {
    image: usize,
    srgb: bool,
    wrap: [Wrap; 2],
    nearest: bool,
}

/// The textures that materials request.
pub(super) struct Requests {
    codecs: &'static [Codec],
    known: HashMap<Key, u32>,
    /// Textures of each image.
    uses: BTreeMap<usize, Vec<(u32, Key)>>,
}

impl Requests {
    /// No requests yet; `codecs` decode images of further formats.
    pub(super) fn new(codecs: &'static [Codec]) -> Self {
        Self {
            codecs,
            known: HashMap::new(),
            uses: BTreeMap::new(),
        }
    }

    /// Requests a texture of the file; returns its index in `SceneParts::textures`.
    pub(super) fn texture(&mut self, root: &Root, index: usize, srgb: bool) -> Result<u32> {
        let Some(texture) = root.textures.get(index) else {
            return Err(fault(format!("textures[{index}]"), "does not exist"));
        };
        let at = place("textures", index, texture.name.as_ref());
        let image = self.source(texture).unwrap_or(texture.source.value());
        if image >= root.images.len() {
            return Err(fault(format!("{at}.source"), "is missing, or no image"));
        }
        let (mut wrap, mut nearest) = ([Wrap::Repeat; 2], false);
        if let Some(sampler) = texture.sampler {
            let Some(sampler) = root.samplers.get(sampler.value()) else {
                return Err(fault(at, format!("samplers[{sampler}] does not exist")));
            };
            wrap = [mode(&sampler.wrap_s), mode(&sampler.wrap_t)];
            nearest = sampler.mag_filter == Some(Checked::Valid(MagFilter::Nearest));
        }
        let key = Key {
            image,
            srgb,
            wrap,
            nearest,
        };
        let next = self.known.len() as u32;
        Ok(*self.known.entry(key).or_insert_with(|| {
            self.uses.entry(image).or_default().push((next, key));
            next
        }))
    }

    /// The image that an extension gives in place of the texture's own.
    fn source(&self, texture: &gltf::json::Texture) -> Option<usize> {
        let extensions = &texture.extensions.as_ref()?.others;
        let images = |codec: &&Codec| matches!(codec.part, Part::Images(_));
        let decoded = self
            .codecs
            .iter()
            .filter(images)
            .map(|codec| codec.extension);
        let mut named = decoded.chain(["EXT_texture_webp"]);
        let extension = named.find_map(|name| extensions.get(name))?;
        Some(usize::try_from(extension.get("source")?.as_u64()?).unwrap_or(usize::MAX))
    }

    /// Reads the requested images in file order, and decodes them.
    pub(super) fn textures(self, data: &Data<'_>, files: &mut Files) -> Result<Vec<Texture>> {
        let mut textures = vec![Texture::default(); self.known.len()];
        let all: Vec<_> = self.uses.into_iter().collect();
        for batch in all.chunks(BATCH) {
            let mut sources = Vec::new();
            for (image, _) in batch {
                sources.push(Source::read(data, *image, self.codecs, files)?);
            }
            let bytes = sources.iter().map(Source::bytes_needed);
            let bytes = bytes.sum::<Result<u64>>()?;
            memory::check(format!("textures from {} on", sources[0].at), bytes)?;
            let decoded: Vec<_> = (sources.into_par_iter())
                .map(|source| source.decode())
                .collect();
            for (picture, (_, uses)) in decoded.into_iter().zip(batch) {
                let picture = picture?;
                for (texture, key) in uses {
                    textures[*texture as usize] = Texture {
                        srgb: key.srgb,
                        wrap: key.wrap,
                        nearest: key.nearest,
                        ..picture.clone()
                    };
                }
            }
        }
        Ok(textures)
    }
}

fn mode(wrap: &Checked<WrappingMode>) -> Wrap {
    match wrap {
        Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
        Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
        Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
    }
}

/// Decodes an image in one of these formats, which its bytes decide or, for TGA, its name. Fails for other formats, and
/// if there is no memory for this number of copies.
pub fn decode(
    at: String,
    bytes: Cow<'_, [u8]>,
    formats: &[ImageFormat],
    copies: u64,
) -> Result<Texture> {
    let source = Source::new(at, bytes, formats)?;
    memory::check(&*source.at, copies * source.bytes_needed()?)?;
    source.decode()
}

/// An encoded image.
pub(super) struct Source<'a> {
    at: String,
    bytes: Cow<'a, [u8]>,
    format: Format,
}

/// The format of an image.
#[derive(Clone, Copy)]
enum Format {
    Plain(ImageFormat),
    /// The codec that decodes it, and the size in texels.
    Coded(ImageCodec, [u32; 2]),
}

impl<'a> Source<'a> {
    /// Reads an image, whose bytes decide the format, not the MIME type.
    fn read(data: &'a Data<'_>, index: usize, codecs: &[Codec], files: &mut Files) -> Result<Self> {
        let image = &data.root.images[index];
        let at = place("images", index, image.name.as_ref());
        let bytes = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => Cow::Owned(files.read(uri, &at)?),
            (None, Some(view)) => Cow::Borrowed(data.view(view.value())?),
            (None, None) => return Err(fault(at, "has neither a uri nor a bufferView")),
        };
        let coded = codecs.iter().find_map(|codec| match codec.part {
            Part::Images(image) => Some(Format::Coded(image, (image.size)(&bytes)?)),
            Part::Buffers(_) => None,
        });
        if let Some(format) = coded {
            return Ok(Self { at, bytes, format });
        }
        Self::new(
            at,
            bytes,
            &[ImageFormat::Png, ImageFormat::Jpeg, ImageFormat::WebP],
        )
    }

    /// See [`decode`].
    fn new(at: String, bytes: Cow<'a, [u8]>, formats: &[ImageFormat]) -> Result<Self> {
        let named = at.to_ascii_lowercase().ends_with(".tga");
        let named = named.then_some(ImageFormat::Tga);
        match image::guess_format(&bytes).ok().or(named) {
            Some(plain) if formats.contains(&plain) => Ok(Self {
                at,
                bytes,
                format: Format::Plain(plain),
            }),
            _ => Err(fault(at, "is neither PNG nor JPEG nor WebP")),
        }
    }

    fn bad(&self, error: image::ImageError) -> Fault {
        fault(&self.at, format!("cannot be decoded: {error}"))
    }

    fn decoder(&self, format: ImageFormat) -> Result<impl ImageDecoder + '_> {
        let mut reader = ImageReader::new(Cursor::new(&self.bytes[..]));
        reader.set_format(format);
        // [`Source::bytes_needed`] has been checked against the available memory.
        reader.no_limits();
        reader.into_decoder().map_err(|e| self.bad(e))
    }

    /// Bytes of the decoded image with its mip levels. Fails for more texels than its encoded bytes can contain.
    pub(super) fn bytes_needed(&self) -> Result<u64> {
        let format = match self.format {
            Format::Plain(format) => format,
            // A copy of the texels exists while they are decoded.
            Format::Coded(_, size) => {
                let [width, height] = size.map(u64::from);
                return Ok((9 * width).saturating_mul(height));
            }
        };
        let decoder = self.decoder(format)?;
        let (width, height) = decoder.dimensions();
        let texels = u64::from(width) * u64::from(height);
        let most = TEXELS_PER_BYTE.saturating_mul(self.bytes.len() as u64);
        // WebP stores any number of texels of one colour in a few bytes, but at most 2^14 texels a side.
        if texels == 0 || (texels > most && format != ImageFormat::WebP) {
            let what = format!("{width} x {height} texels are none or too many for its bytes");
            return Err(fault(&self.at, what));
        }
        Ok(decoder.total_bytes().saturating_mul(4) / 3)
    }

    /// Decodes the image.
    pub(super) fn decode(self) -> Result<Texture> {
        let format = match self.format {
            Format::Plain(format) => format,
            Format::Coded(codec, [width, height]) => {
                return Ok(Texture {
                    width,
                    height,
                    channels: 4,
                    texels: Texels::Byte((codec.texels)(&self.bytes, &self.at)?.into()),
                    ..Texture::default()
                });
            }
        };
        let decoder = self.decoder(format)?;
        let (width, height) = decoder.dimensions();
        let length = decoder.total_bytes() as usize;
        let kind = decoder.color_type();
        let texels = match kind {
            ColorType::L16 | ColorType::La16 | ColorType::Rgb16 | ColorType::Rgba16 => {
                let mut words: Arc<[u16]> = std::iter::repeat_n(0, length / 2).collect();
                let room = bytemuck::cast_slice_mut(Arc::make_mut(&mut words));
                decoder.read_image(room).map_err(|e| self.bad(e))?;
                Texels::Word(words)
            }
            _ => {
                let mut bytes: Arc<[u8]> = std::iter::repeat_n(0, length).collect();
                let room = Arc::make_mut(&mut bytes);
                decoder.read_image(room).map_err(|e| self.bad(e))?;
                Texels::Byte(bytes)
            }
        };
        Ok(Texture {
            width,
            height,
            channels: kind.channel_count(),
            texels,
            ..Texture::default()
        })
    }
}
