//! Cameras: pinholes and parallel projections.

use crate::math::{Frame, Ray, Vec2, Vec3};

/// A camera. Film coordinates are in [0, 1]², `(0, 0)` at the top left.
#[derive(Clone, Debug)]
pub struct Camera {
    /// Name in the file, for messages and `--camera`.
    pub name: String,
    /// Where it is.
    pub position: Vec3,
    /// Right, up, and *backwards* (the camera looks along `-frame.n`).
    pub frame: Frame,
    /// How rays leave it.
    pub projection: Projection,
    /// Width over height that the file asks for, if it does.
    pub aspect: Option<f32>,
}

/// How a camera projects.
#[derive(Clone, Copy, Debug)]
pub enum Projection {
    /// Pinhole with this vertical field of view.
    Perspective {
        /// Tangent of half the vertical angle.
        tan_half_y: f32,
    },
    /// Parallel rays over a window of this half height in world units.
    Orthographic {
        /// Half the height.
        half_height: f32,
    },
}

impl Camera {
    /// The ray through a film position, for a picture of the given width over height.
    #[inline]
    pub fn ray(&self, film: Vec2, aspect: f32) -> Ray {
        let x = (2.0 * film.x - 1.0) * aspect;
        let y = 1.0 - 2.0 * film.y;
        match self.projection {
            Projection::Perspective { tan_half_y } => {
                let local = Vec3::new(x * tan_half_y, y * tan_half_y, -1.0).normalize();
                Ray::new(self.position, self.frame.to_world(local))
            }
            Projection::Orthographic { half_height } => {
                let shift = self
                    .frame
                    .to_world(Vec3::new(x * half_height, y * half_height, 0.0));
                Ray::new(self.position + shift, -self.frame.n)
            }
        }
    }

    /// A pinhole at `from` that looks at `to`, with a vertical field of view in radians.
    pub fn look_at(from: Vec3, to: Vec3, up: Vec3, fov_y: f32) -> Self {
        let n = (from - to).normalize();
        let s = up.cross(n).normalize();
        Self {
            name: String::new(),
            position: from,
            frame: Frame {
                s,
                t: n.cross(s),
                n,
            },
            projection: Projection::Perspective {
                tan_half_y: (0.5 * fov_y).tan(),
            },
            aspect: None,
        }
    }
}
