//! The part of a scene's picture that is rendered.

use super::Stop;
use crate::image::film::{Film, Window};
use crate::math::UVec2;
use crate::scene::{Camera, Scene, Sensor};

/// A part of a scene's picture.
#[derive(Clone, Copy)]
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The camera and the size of the whole picture.
    pub sensor: Sensor<'a>,
    /// The part of the frame that is rendered.
    pub window: Window,
    /// The condition that ends its render early, if there is one.
    pub stop: Option<&'a Stop<'a>>,
}

impl<'a> View<'a> {
    /// A window of a frame.
    pub fn new(scene: &'a Scene, camera: &'a Camera, frame: UVec2, window: Window) -> Self {
        Self {
            scene,
            sensor: Sensor { camera, frame },
            window,
            stop: None,
        }
    }

    /// The same with this stop of its render.
    pub fn until(self, stop: &'a Stop<'a>) -> Self {
        let stop = Some(stop);
        Self { stop, ..self }
    }

    /// The part of the frame that a film holds.
    pub fn of(scene: &'a Scene, camera: &'a Camera, film: &Film) -> Self {
        Self::new(scene, camera, film.size, film.window)
    }
}
