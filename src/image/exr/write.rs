//! Films and pictures into EXR files.

use std::io;
use std::path::Path;

use ::exr::block::lines::LineRefMut;
use ::exr::image::write::samples::{SamplesWriter, WritableSamples};
use ::exr::math::RoundingMode;
use ::exr::meta::attribute::{Chromaticities, LevelMode};
use ::exr::meta::header::Header as FileHeader;
use ::exr::prelude as exrs;
use exrs::WritableImage;

use super::{
    Compression, Header, Layer, MEAN_ERROR, METADATA, Metadata, Plane, Value, join, unsupported,
};
use crate::files::{self, FileError, Problem};
use crate::image::Buffer;
use crate::image::batches::Sharing;
use crate::image::film::{Film, LARGEST, Window};
use crate::math::UVec2;
use crate::math::moments::Moments;

/// Writes a film: the picture, `sample_variance`, `variance_of_mean`, `spp`, and the layers given. Its metadata has the
/// standard error of its mean, if pixels share light paths.
pub fn write_film<'a>(
    path: &Path,
    film: &Film,
    layers: &[Layer],
    header: impl Into<Header<'a>>,
) -> Result<(), FileError> {
    let others = layers.iter().flat_map(Layer::channels);
    write_film_beside(path, film, others.collect(), header)
}

/// [`write_film`] with channels that are computed while they are written.
pub(crate) fn write_film_beside<'a>(
    path: &Path,
    film: &Film,
    others: Vec<Plane<'_>>,
    header: impl Into<Header<'a>>,
) -> Result<(), FileError> {
    let mut header = header.into();
    let mut metadata = header.metadata.clone();
    if film.sharing != Sharing::None
        && let Some((error, _)) = film.mean_error()
    {
        metadata.insert(
            MEAN_ERROR.into(),
            error.as_vec3().to_array().map(|x| x.to_string()).join(" "),
        );
        header.metadata = &metadata;
    }
    let (pixels, count) = (&film.pixels, film.pixels.len());
    let mean = Plane::colour("", count, |i| pixels[i].mean.as_vec3());
    let variance = |m: &Moments| m.sample_variance().min(LARGEST).as_vec3();
    let variance = Plane::colour("sample_variance", count, move |i| variance(&pixels[i]));
    let of_mean = |m: &Moments| m.variance_of_mean().min(LARGEST).as_vec3();
    let of_mean = Plane::colour("variance_of_mean", count, move |i| of_mean(&pixels[i]));
    let spp = Plane::new("spp", "", count, |i| pixels[i].n as f32);
    let own = mean.into_iter().chain(variance).chain(of_mean).chain([spp]);
    write(path, (film.size, film.window), own.chain(others), header)
}

/// Writes a picture of a part of a frame, and the layers given.
pub fn write_layers<'a>(
    path: &Path,
    part: (UVec2, Window),
    picture: &Buffer,
    layers: &[Layer],
    header: impl Into<Header<'a>>,
) -> Result<(), FileError> {
    let main = Plane::colour("", picture.pixels.len(), |i| picture.pixels[i]);
    let channels = main
        .into_iter()
        .chain(layers.iter().flat_map(Layer::channels));
    write(path, part, channels, header.into())
}

/// Writes a picture alone.
pub fn write_rgb(path: &Path, picture: &Buffer, metadata: &Metadata) -> Result<(), FileError> {
    let size = UVec2::new(picture.width as u32, picture.height as u32);
    write_layers(path, (size, Window::full(size)), picture, &[], metadata)
}

/// Writes a picture of the frame and window `part`. Lines are coded while they are written, without a copy in memory.
pub(crate) fn write<'a>(
    path: &Path,
    part: (UVec2, Window),
    channels: impl IntoIterator<Item = Plane<'a>>,
    header: Header<'_>,
) -> Result<(), FileError> {
    let image = image(part, channels, header).map_err(|e| e.at(path))?;
    // On one thread: the crate's thread pool for every file fragmented the heap, by 8 % in an hour of saves.
    files::write(path, |out| {
        let written = image.write().non_parallel().to_buffered(out);
        written.map_err(|error| match error {
            ::exr::error::Error::Io(error) => error,
            error => io::Error::other(error),
        })
    })
}

/// The content of a file.
fn image<'a>(
    (size, window): (UVec2, Window),
    channels: impl IntoIterator<Item = Plane<'a>>,
    header: Header<'_>,
) -> Result<exrs::Image<exrs::Layer<exrs::AnyChannels<Pixels<'a>>>>, Problem> {
    let Header {
        metadata, storage, ..
    } = header;
    let mut list = Vec::new();
    for channel in channels {
        let (layer, count, pixels) = (&channel.layer, channel.count, window.len());
        if count != pixels {
            let what = format!("layer '{layer}' has {count} values, the picture {pixels} pixels");
            return Err(Problem::content(what));
        }
        let half = storage.half && fits_half(layer);
        let name = text(&join(layer, channel.name))?;
        let value = channel.value;
        list.push(exrs::AnyChannel::new(name, Pixels { value, half }));
    }

    let mut attributes = exrs::LayerAttributes {
        layer_position: exrs::Vec2(window.x as i32, window.y as i32),
        world_to_camera: header.world_to_camera,
        software_name: exrs::Text::new_or_none(concat!("opsr ", env!("CARGO_PKG_VERSION"))),
        ..Default::default()
    };
    if !metadata.is_empty() {
        let value = exrs::AttributeValue::Text(text(&ascii_json(metadata))?);
        attributes.other.insert(text(METADATA)?, value);
    }
    let encoding = exrs::Encoding {
        compression: match storage.compression {
            Compression::None => exrs::Compression::Uncompressed,
            Compression::Rle => exrs::Compression::RLE,
            Compression::Zips => exrs::Compression::ZIP1,
            Compression::Zip => exrs::Compression::ZIP16,
            Compression::Piz => exrs::Compression::PIZ,
        },
        blocks: exrs::Blocks::ScanLines,
        // A fixed order of the blocks: the same bytes however many threads compress.
        line_order: exrs::LineOrder::Increasing,
    };
    let part = exrs::Layer::new(
        (window.w as usize, window.h as usize),
        attributes,
        encoding,
        exrs::AnyChannels::sort(list.into_iter().collect()),
    );
    Ok(exrs::Image {
        attributes: exrs::ImageAttributes {
            chromaticities: Some(REC_709),
            ..exrs::ImageAttributes::with_size((size.x as usize, size.y as usize))
        },
        layer_data: part,
    })
}

/// A channel that is computed line by line while it is written, without a copy of the picture.
struct Pixels<'a> {
    value: Value<'a>,
    half: bool,
}

impl<'a> WritableSamples<'a> for Pixels<'_> {
    type Writer = Lines<'a>;

    fn sample_type(&self) -> exrs::SampleType {
        match self.half {
            true => exrs::SampleType::F16,
            false => exrs::SampleType::F32,
        }
    }

    fn infer_level_modes(&self) -> (LevelMode, RoundingMode) {
        (LevelMode::Singular, RoundingMode::Down)
    }

    fn create_samples_writer(&'a self, header: &FileHeader) -> Lines<'a> {
        Lines {
            value: &self.value,
            half: self.half,
            width: header.layer_size.width(),
        }
    }
}

/// Lines of a channel.
struct Lines<'a> {
    value: &'a Value<'a>,
    half: bool,
    width: usize,
}

impl SamplesWriter for Lines<'_> {
    fn extract_line(&self, line: LineRefMut<'_>) {
        let position = line.location.position;
        let first = position.y() * self.width + position.x();
        let value = |x: usize| (self.value)(first + x);
        let half = |x: usize| exrs::f16::from_f32(value(x).clamp(-HALF_MAX, HALF_MAX));
        let done = match self.half {
            true => line.write_samples(half),
            false => line.write_samples(value),
        };
        done.expect("a line has room for its samples");
    }
}

/// Largest half float.
const HALF_MAX: f32 = 65504.0;

/// True for layers that only lose precision as half floats.
fn fits_half(layer: &str) -> bool {
    let level = layer
        .strip_prefix("level")
        .is_some_and(|k| k.parse::<u32>().is_ok());
    ["", "albedo", "normal", "emission", "direct", "indirect"].contains(&layer) || level
}

/// Primaries and white point of all RGB values.
const REC_709: Chromaticities = Chromaticities {
    red: exrs::Vec2(0.64, 0.33),
    green: exrs::Vec2(0.3, 0.6),
    blue: exrs::Vec2(0.15, 0.06),
    white: exrs::Vec2(0.3127, 0.329),
};

fn text(s: &str) -> Result<exrs::Text, Problem> {
    exrs::Text::new_or_none(s).ok_or_else(|| unsupported(format!("name '{s}' is not Latin-1")))
}

/// JSON with everything above ASCII escaped, since EXR text has no encoding.
fn ascii_json(metadata: &Metadata) -> String {
    let json = serde_json::json!(metadata).to_string();
    let mut out = String::with_capacity(json.len());
    for c in json.chars() {
        if c.is_ascii() {
            out.push(c);
        } else {
            for unit in c.encode_utf16(&mut [0; 2]) {
                out.push_str(&format!("\\u{unit:04x}"));
            }
        }
    }
    out
}
