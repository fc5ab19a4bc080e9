//! All frames in one file that browsers play: an animated PNG.

use opsr::files;
use opsr::image::Buffer;
use opsr::image::display::Display;
use opsr::image::png::display as shown;
use png::{BitDepth, ColorType, Encoder, EncodingError, Writer};
use std::fs::File;
use std::io::{self, BufWriter, Seek};
use std::path::{Path, PathBuf};

/// An animated PNG. It is written to a temporary file, and to its own file when all frames are there.
pub(super) struct Movie {
    path: PathBuf,
    frames: usize,
    written: usize,
    made: Option<(File, Writer<BufWriter<File>>)>,
}

impl Movie {
    /// A movie with this number of frames.
    pub(super) fn new(path: &Path, frames: usize) -> Self {
        Self {
            path: path.to_owned(),
            frames,
            written: 0,
            made: None,
        }
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Adds a frame; the first one determines the size and the frames per second.
    pub(super) fn add(
        &mut self,
        picture: &Buffer,
        display: Display,
        fps: f64,
    ) -> anyhow::Result<()> {
        let bytes: Vec<u8> = (picture.pixels.iter())
            .flat_map(|p| shown(*p, display))
            .collect();
        let (_, writer) = match &mut self.made {
            Some(made) => made,
            None => self.made.insert(begin(picture, self.frames, fps)?),
        };
        writer.write_image_data(&bytes)?;
        self.written += 1;
        Ok(())
    }

    /// Writes the file; returns false, without a file, if frames are missing.
    pub(super) fn end(self) -> anyhow::Result<bool> {
        let Some((mut file, writer)) = self.made.filter(|_| self.written == self.frames) else {
            return Ok(false);
        };
        writer.finish()?;
        file.rewind()?;
        files::write(&self.path, |out| io::copy(&mut file, out).map(|_| ()))?;
        Ok(true)
    }
}

/// A temporary file with the header of a movie.
fn begin(
    picture: &Buffer,
    frames: usize,
    fps: f64,
) -> Result<(File, Writer<BufWriter<File>>), EncodingError> {
    let file = tempfile::tempfile()?;
    let (width, height) = (picture.width as u32, picture.height as u32);
    let mut encoder = Encoder::new(BufWriter::new(file.try_clone()?), width, height);
    encoder.set_color(ColorType::Rgb);
    encoder.set_depth(BitDepth::Eight);
    encoder.set_animated(frames as u32, 0)?;
    let hundredths = (100.0 * fps).round().clamp(1.0, f64::from(u16::MAX));
    encoder.set_frame_delay(100, hundredths as u16)?;
    Ok((file, encoder.write_header()?))
}
