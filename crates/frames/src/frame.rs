//! A frame as it was rendered, and as it is averaged.

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
    /// Expected relative error of every pixel, as files hold it; empty where it is not known.
    pub error: Vec<f32>,
    /// Squared relative error of every pixel to be expected, as relMSE counts it, of a picture that was chosen among levels and blurs:
    /// some of its error is bias, which no average reduces. Empty for raw means.
    pub squares: Vec<f32>,
    /// The first surfaces.
    pub surfaces: Surfaces,
    /// Layers that the averaged frame keeps.
    pub layers: Vec<Layer>,
    /// Text of its file.
    pub metadata: Metadata,
}

impl Frame {
    /// An error unless two frames show parts of the same size: only these are averaged.
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
    /// Motion of the surface of every pixel, in pixels: to its place in the last frame, and to that in the next; x to the right, y up.
    /// 0 where it is not known; empty where it was not asked for.
    pub motion: [Vec<Vec2>; 2],
    /// Mean error over that of the frame as it was rendered.
    pub error_ratio: f64,
}
