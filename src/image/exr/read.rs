//! EXR files into pictures, films and channels.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Seek};
use std::path::Path;

use ::exr::prelude as exrs;
use exrs::{ReadChannels, ReadLayers};

use super::{Layers, MEAN_ERROR, METADATA, Metadata, invalid, join, problem, unsupported};
use crate::files::{FileError, Problem};
use crate::image::Buffer;
use crate::image::batches::Sharing;
use crate::image::film::{Film, MAX_PIXELS, Window};
use crate::math::moments::Moments;
use crate::math::{DVec3, UVec2};

/// Reads the [main picture](Layers::main).
pub fn read_rgb(path: &Path) -> Result<Buffer, FileError> {
    read_layers(path)?.main().map_err(|e| e.at(path))
}

/// Reads a film that [`write_film`](super::write_film) wrote, in single precision and without its refused samples.
pub fn read_film(path: &Path) -> Result<Film, FileError> {
    read_layers(path)?.film(path)
}

impl Layers {
    /// The film of a file that was read from `path`, as [`read_film`] gives it.
    pub(crate) fn film(&self, path: &Path) -> Result<Film, FileError> {
        film_of(self).map_err(|e| e.at(path))
    }
}

fn film_of(layers: &Layers) -> Result<Film, Problem> {
    if layers.channel("level").is_ok() && layers.channel("spp").is_err() {
        let what = "a picture of the best levels or blurs, without the statistics of its samples; `--resolve raw` keeps them";
        return Err(Problem::content(what));
    }
    let mean = layers.picture(["R", "G", "B"])?;
    let variance = layers.picture(
        ["R", "G", "B"]
            .map(|c| join("sample_variance", c))
            .each_ref()
            .map(String::as_str),
    )?;
    let spp = layers.channel("spp")?;
    let (x, y) = layers.position;
    let window = Window {
        x: u32::try_from(x).map_err(|_| invalid("data window begins left of the frame"))?,
        y: u32::try_from(y).map_err(|_| invalid("data window begins above the frame"))?,
        w: layers.width as u32,
        h: layers.height as u32,
    };
    let mut film = Film::cropped(layers.size, window).map_err(invalid)?;
    for (i, m) in film.pixels.iter_mut().enumerate() {
        let n = spp[i] as u32;
        let degrees = f64::from(n.saturating_sub(1));
        let m2: DVec3 = variance.pixels[i].as_dvec3() * degrees;
        *m = Moments::from_parts(n, mean.pixels[i].as_dvec3(), m2);
    }
    film.sharing = sharing(&layers.metadata);
    Ok(film)
}

/// Shared noise by the stated error and the integrator. Pixels are independent in files that name no integrator.
fn sharing(metadata: &Metadata) -> Sharing {
    let number = |word: &str| word.parse().ok().filter(|x: &f64| *x >= 0.0);
    let stated = metadata.get(MEAN_ERROR).and_then(|text| {
        let numbers: Option<Vec<f64>> = text.split(' ').map(number).collect();
        let numbers: [f64; 3] = numbers?.try_into().ok()?;
        Some(DVec3::from_array(numbers))
    });
    match (stated, metadata.get("integrator")) {
        (Some(error), _) => Sharing::Stated(error),
        (None, Some(name)) if name != "path" => Sharing::Unknown,
        _ => Sharing::None,
    }
}

/// Reads every channel. Channels of a named part get the part's name as prefix.
pub fn read_layers(path: &Path) -> Result<Layers, FileError> {
    read_channels(path).map_err(|e| e.at(path))
}

fn read_channels(path: &Path) -> Result<Layers, Problem> {
    let mut file = BufReader::new(File::open(path).map_err(Problem::Read)?);
    check_headers(&mut file)?;
    file.rewind().map_err(Problem::Read)?;
    // On one thread: with several, a file with two faults would give one error or the other at random.
    let image = exrs::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(file)
        .map_err(problem)?;

    let display = image.attributes.display_window.size;
    let first = image
        .layer_data
        .first()
        .ok_or_else(|| invalid("no layer"))?;
    let mut layers = Layers {
        size: UVec2::new(display.x() as u32, display.y() as u32),
        position: (
            first.attributes.layer_position.x(),
            first.attributes.layer_position.y(),
        ),
        width: first.size.x(),
        height: first.size.y(),
        channels: BTreeMap::new(),
        metadata: Metadata::new(),
    };
    for part in &image.layer_data {
        if (part.size.x(), part.size.y()) != (layers.width, layers.height) {
            return Err(unsupported("parts of different sizes"));
        }
        let name = part
            .attributes
            .layer_name
            .as_ref()
            .map(ToString::to_string)
            .unwrap_or_default();
        for channel in &part.channel_data.list {
            let values: Vec<f32> = channel.sample_data.values_as_f32().collect();
            if values.len() != layers.width * layers.height {
                let what = format!("channel '{}' is subsampled", channel.name);
                return Err(unsupported(what));
            }
            // Blender repeats the name of the part in those of its channels.
            let channel_name = channel.name.to_string();
            let full = match channel_name.strip_prefix(&name) {
                Some(rest) if rest.starts_with('.') && !name.is_empty() => channel_name,
                _ => join(&name, &channel_name),
            };
            // The main picture of a file whose parts are all named is its first part.
            if std::ptr::eq(part, first) && !name.is_empty() {
                layers
                    .channels
                    .insert(channel.name.to_string(), values.clone());
            }
            layers.channels.insert(full, values);
        }
        for (key, value) in image.attributes.other.iter().chain(&part.attributes.other) {
            if let exrs::AttributeValue::Text(value) = value {
                add_metadata(&mut layers.metadata, &key.to_string(), &value.to_string());
            }
        }
    }
    Ok(layers)
}

/// Splits the attribute of this program into its keys; a text attribute of another program is one key.
fn add_metadata(metadata: &mut Metadata, key: &str, value: &str) {
    match serde_json::from_str::<Metadata>(value) {
        Ok(own) if key == METADATA => metadata.extend(own),
        _ => {
            metadata.insert(key.to_owned(), value.to_owned());
        }
    }
}

/// Most bytes of pixels that a byte of a file can hold: Deflate expands a byte to at most 1032, and the densest coding
/// around it drops every fourth byte.
const MAX_RATIO: u64 = 2048;

/// Checks sizes before pixels are read: a header of a few bytes can declare any size.
fn check_headers(file: &mut BufReader<File>) -> Result<(), Problem> {
    let length = file.get_ref().metadata().map_err(Problem::Read)?.len();
    let meta = ::exr::meta::MetaData::read_from_buffered(file, false).map_err(problem)?;
    let mut values: usize = 0;
    let mut bytes: u64 = 0;
    for header in &meta.headers {
        let (width, height) = (header.layer_size.x(), header.layer_size.y());
        let channels = header.channels.list.len();
        let pixels = width.saturating_mul(height);
        values = values.saturating_add(pixels.saturating_mul(channels));
        if pixels > MAX_PIXELS || values > 4 * MAX_PIXELS {
            let size = format!("{width}x{height} pixels in {channels} channels");
            return Err(Problem::content(format!(
                "{size} are more than this program reads"
            )));
        }
        let samples = header.channels.list.iter();
        let pixel: usize = samples.map(|c| c.sample_type.bytes_per_sample()).sum();
        bytes = bytes.saturating_add((pixels as u64).saturating_mul(pixel as u64));
    }
    if bytes / MAX_RATIO > length {
        let what = format!("{length} bytes cannot hold the {bytes} that the header promises");
        return Err(invalid(what));
    }
    Ok(())
}
