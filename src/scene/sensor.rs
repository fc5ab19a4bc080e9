//! A camera bound to a frame.

use super::Camera;
use super::camera::Projection;
use crate::math::{Ray, UVec2, Vec2, Vec3};

/// A camera with a frame of pixels.
#[derive(Clone, Copy, Debug)]
pub struct Sensor<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Columns and rows of the whole frame.
    pub frame: UVec2,
}

/// The projection of a point to a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sighting {
    /// Pixel of the full frame.
    pub pixel: UVec2,
    /// Unit direction from the point towards the camera, or the point of its lens.
    pub wo: Vec3,
    /// Distance along `wo` to the camera, or to the plane of a parallel camera.
    pub distance: f32,
    /// Density of the ray to the point among the rays of its pixel; see [`Sensor::pdf`].
    pub pdf: f32,
    /// True if the camera's rays, through one point of a lens, are parallel.
    pub parallel: bool,
}

/// A part of a surface that a pixel covers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Unit direction between the point and the camera.
    pub dir: Vec3,
    /// Half the width of the pixel there, across that direction.
    pub half: f32,
}

/// Half the width of a pixel as a linear function of the distance along a ray; 0 for no pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct PixelCone {
    width: f32,
    spread: f32,
}

impl PixelCone {
    /// The pixel's footprint at a point seen along `dir` at a distance; `None` without a pixel.
    #[inline]
    pub fn footprint(&self, dir: Vec3, distance: f32) -> Option<Footprint> {
        let half = self.width + self.spread * distance;
        (half > 0.0).then_some(Footprint { dir, half })
    }
}

/// Density of a camera ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RayDensity {
    /// Per steradian for a pinhole, per area across the ray if `parallel`.
    pub pdf: f32,
    /// True if the camera's rays, through one point of a lens, are parallel.
    pub parallel: bool,
}

impl Sighting {
    /// The pixel's footprint at the point.
    pub(crate) fn footprint(&self) -> Footprint {
        let distance = if self.parallel { 1.0 } else { self.distance };
        Footprint {
            dir: self.wo,
            half: 0.5 * distance / self.pdf.sqrt(),
        }
    }

    /// Density per area, on a surface whose absolute cosine with `wo` is `cos`, with which the rays of the pixel hit
    /// it. A pixel's response integrates to 1, so this is also the factor that turns radiance into pixel values.
    #[inline]
    pub(crate) fn pdf_area(&self, cos: f32) -> f32 {
        if self.parallel {
            self.pdf * cos
        } else {
            self.pdf * cos / (self.distance * self.distance)
        }
    }
}

impl Sensor<'_> {
    /// The ray through a point of the frame, in pixels from the top left; a lens is ignored.
    #[inline]
    pub fn ray(&self, point: Vec2) -> Ray {
        let size = self.frame.as_vec2();
        self.camera.ray(point / size, size.x / size.y)
    }

    /// A ray through a point of the frame, and with a lens through the point that `u`, uniform in [0, 1)², chooses on
    /// it. Without a lens `u` is not called.
    #[inline]
    pub(crate) fn sample_ray(&self, point: Vec2, u: impl FnOnce() -> Vec2) -> Ray {
        match self.camera.lens {
            None => self.ray(point),
            Some(lens) => {
                let size = self.frame.as_vec2();
                (self.camera).ray_through(lens, point / size, size.x / size.y, u())
            }
        }
    }

    /// The point of the lens that `u`, uniform in [0, 1)², chooses, from its middle. Without a lens `u` is not called.
    #[inline]
    pub(crate) fn lens_point(&self, u: impl FnOnce() -> Vec2) -> Vec2 {
        self.camera.lens.map_or(Vec2::ZERO, |lens| lens.point(u()))
    }

    /// Density of a ray along `dir` among the rays through one pixel and, if there is a lens, one point of it. Its
    /// integral over the pixel is 1.
    #[inline]
    pub(crate) fn pdf(&self, dir: Vec3) -> RayDensity {
        let rows = self.frame.y as f32;
        match self.camera.projection {
            Projection::Perspective { tan_half_y } => {
                let edge = 2.0 * tan_half_y / rows;
                let cos = -dir.dot(self.camera.frame.n);
                RayDensity {
                    pdf: 1.0 / (edge * edge * cos * cos * cos),
                    parallel: false,
                }
            }
            Projection::Orthographic { half_height } => {
                let edge = 2.0 * half_height / rows;
                // Rays through one point of a lens are parallel and oblique.
                let cos = (self.camera.lens).map_or(1.0, |_| -dir.dot(self.camera.frame.n));
                RayDensity {
                    pdf: 1.0 / (edge * edge * cos),
                    parallel: true,
                }
            }
        }
    }

    /// The cone of the pixel about a ray along `dir`: a square of the pixel's solid angle, or area.
    pub fn cone(&self, dir: Vec3) -> PixelCone {
        let RayDensity { pdf, parallel } = self.pdf(dir);
        let half = 0.5 / pdf.sqrt();
        let (width, spread) = if parallel { (half, 0.0) } else { (0.0, half) };
        PixelCone { width, spread }
    }

    /// The pixel that sees a point through a [point of the lens](Self::lens_point), if nothing stands between. `None`
    /// for points outside the frame or behind the camera; pixels are half open.
    #[inline]
    pub(crate) fn see(&self, point: Vec3, through: Vec2) -> Option<Sighting> {
        let size = self.frame.as_vec2();
        let (film, wo, distance) = (self.camera).project(point, size.x / size.y, through)?;
        let place = (film * size).floor();
        let inside = place.cmpge(Vec2::ZERO).all() && place.cmplt(size).all();
        let RayDensity { pdf, parallel } = self.pdf(-wo);
        (inside && pdf.is_finite()).then(|| Sighting {
            pixel: place.as_uvec2(),
            wo,
            distance,
            pdf,
            parallel,
        })
    }
}
