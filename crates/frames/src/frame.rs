//! A frame as rendered, and as averaged.

use crate::surfaces::Surfaces;
use opsr::image::Buffer;
use opsr::image::exr::{Layer, Metadata};
use opsr::image::film::Window;
use opsr::math::{UVec2, Vec2};
use opsr::scene::Camera;

/// A frame as it was rendered.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its number.
    pub number: u32,
    /// Columns and rows of the whole picture.
    pub size: UVec2,
    /// The part that was rendered.
    pub window: Window,
    /// The camera.
    pub camera: Camera,
    /// Linear radiance.
    pub picture: Buffer,
    /// Expected relative error of every pixel, as in files; empty where it is not known.
    pub error: Vec<f32>,
    /// Expected squared relative error of every pixel, as in relMSE, of a picture that was chosen among levels and
    /// blurs: part of its error is bias, which averages do not reduce. Empty for raw means.
    pub squares: Vec<f32>,
    /// The first surfaces.
    pub surfaces: Surfaces,
    /// Layers that the averaged frame keeps.
    pub layers: Vec<Layer>,
    /// Metadata of its file.
    pub metadata: Metadata,
}

impl Frame {
    /// An error unless both frames have the same size and window: only such frames are averaged.
    pub fn check(&self, other: &Self) -> Result<(), String> {
        if (self.size, self.window) == (other.size, other.window) {
            return Ok(());
        }
        let show = |frame: &Self| {
            let UVec2 { x, y } = frame.size;
            format!("{} of {x}x{y}", frame.window)
        };
        Err(format!(
            "frame {} shows {}, frame {} {}",
            self.number,
            show(self),
            other.number,
            show(other)
        ))
    }
}

/// A frame that was averaged with its neighbours.
#[derive(Clone, Debug, PartialEq)]
pub struct Averaged {
    /// Linear radiance.
    pub picture: Buffer,
    /// Expected relative error of every pixel; empty where that of the frame was not known.
    pub error: Vec<f32>,
    /// Frames to each side that every pixel was averaged over.
    pub window: Vec<u8>,
    /// Motion of every pixel's surface to its place in the previous and in the next frame, in pixels, x right, y up; 0
    /// where it is not known. Empty where it was not requested.
    pub motion: [Vec<Vec2>; 2],
    /// Mean error over that of the frame as rendered.
    pub error_ratio: f64,
}
