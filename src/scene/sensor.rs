//! A camera bound to a frame.

use super::Camera;
use crate::math::{Ray, UVec2, Vec2};

/// A camera that sees a frame of pixels.
#[derive(Clone, Copy, Debug)]
pub struct Sensor<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Columns and rows of the whole frame.
    pub frame: UVec2,
}

impl Sensor<'_> {
    /// The ray through a point of the frame, in pixels from the top left.
    #[inline]
    pub fn ray(&self, point: Vec2) -> Ray {
        let size = self.frame.as_vec2();
        self.camera.ray(point / size, size.x / size.y)
    }
}
