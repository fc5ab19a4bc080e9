//! Cameras: pinholes, parallel projections, and thin lenses in front of either.

use super::framing::corners;
use crate::math::{DVec3, Frame, Ray, UVec2, Vec2, Vec3, warp};

/// Largest coordinate of a scene that a camera can frame.
const LARGE: f64 = 1e30;

/// A camera. Film coordinates are in [0, 1]², `(0, 0)` at the top left.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name in the file, for messages and `--camera`.
    pub name: String,
    /// Position in world space.
    pub position: Vec3,
    /// Right, up, and *backwards* (the camera looks along `-frame.n`).
    pub frame: Frame,
    /// Projection.
    pub projection: Projection,
    /// Offset of the picture's centre from the view axis, to the right and up, in units of half the picture's height.
    pub shift: Vec2,
    /// Width over height, if the file gives one.
    pub aspect: Option<f32>,
    /// Lens; without one everything is in focus.
    pub lens: Option<Lens>,
    /// Size of the picture, if the file gives one.
    pub film: Option<FilmSize>,
}

/// Size of the picture in a scene file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FilmSize {
    /// Columns and rows.
    pub size: UVec2,
    /// Left, top, width and height of the part that is rendered.
    pub crop: Option<[u32; 4]>,
}

/// A thin lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    /// Radius of the aperture in world units, above 0.
    pub radius: f32,
    /// Distance of the plane in focus, along the view direction, above 0.
    pub focus: f32,
}

impl Lens {
    /// A point of the lens from its middle, to the right and up in world units: uniform over the aperture for `u`
    /// uniform in [0, 1)².
    #[inline]
    pub(crate) fn point(&self, u: Vec2) -> Vec2 {
        self.radius * warp::disk(u)
    }
}

/// Projection of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// Search for the nearest camera in a given direction that sees all of some points.
pub(super) struct Fit {
    /// Axes of the camera.
    axes: [DVec3; 3],
    /// Tangents of half the angles across and up.
    tan: [f64; 2],
    /// Greatest value over the points, for both ends of both film axes, of the coordinate along the axis plus the
    /// tangent times the coordinate towards the camera.
    ends: [[f64; 2]; 2],
    /// Greatest coordinate towards the camera.
    nearest: f64,
    name: &'static str,
}

impl Fit {
    /// Direction of the three-quarter view: glTF's front is +Z; a little from the right, and from above.
    pub(super) const VIEW: DVec3 = DVec3::new(0.6, 0.45, 1.0);

    /// Part of the picture that the points fill along the tighter axis.
    const FILLED: f64 = 1.0 / 1.05;

    /// Looks from the three-quarter view, or from a side, at a picture of the given width over height.
    pub(super) fn new(aspect: f32, side: Option<DVec3>) -> Self {
        let aspect = match aspect.is_finite() && aspect > 0.0 {
            true => f64::from(aspect),
            false => 1.0,
        };
        let n = side.unwrap_or(Self::VIEW).normalize();
        let s = DVec3::Y.cross(n).normalize();
        let tan_y = (0.5 * 40f64.to_radians()).tan();
        Self {
            axes: [s, n.cross(s), n],
            tan: [tan_y * aspect, tan_y],
            ends: [[f64::NEG_INFINITY; 2]; 2],
            nearest: f64::NEG_INFINITY,
            name: match side {
                Some(_) => "view through the open side",
                None => "three-quarter view from the front",
            },
        }
    }

    /// Adds a point.
    pub(super) fn add(&mut self, p: DVec3) {
        let [s, t, n] = self.axes.map(|axis| axis.dot(p));
        self.nearest = self.nearest.max(n);
        for ((ends, tan), x) in self.ends.iter_mut().zip(self.tan).zip([s, t]) {
            let towards = Self::FILLED * tan * n;
            ends[0] = ends[0].max(towards + x);
            ends[1] = ends[1].max(towards - x);
        }
    }

    /// The camera; `None` without points, or if they coincide or are too far away.
    pub(super) fn camera(&self) -> Option<Camera> {
        let [s, t, n] = self.axes;
        // A camera at (x, y, z) in these axes sees p if |p.x - x| <= tan (z - p.z), and the same upwards.
        let depth =
            |k: usize| (self.ends[k][0] + self.ends[k][1]) / (2.0 * Self::FILLED * self.tan[k]);
        let [x, y] = self.ends.map(|[a, b]| 0.5 * (a - b));
        let z = depth(0).max(depth(1));
        let position = s * x + t * y + n * z;
        let apart = z - self.nearest;
        let good = apart > 1e-6 * position.abs().max_element()
            && position.abs().max_element() < 100.0 * LARGE;
        good.then(|| Camera {
            position: position.as_vec3(),
            frame: Frame {
                s: s.as_vec3(),
                t: t.as_vec3(),
                n: n.as_vec3(),
            },
            name: self.name.into(),
            projection: Projection::Perspective {
                tan_half_y: self.tan[1] as f32,
            },
            shift: Vec2::ZERO,
            aspect: None,
            lens: None,
            film: None,
        })
    }
}

impl Camera {
    /// The ray through a film position, for a picture of the given width over height.
    #[inline]
    pub fn ray(&self, film: Vec2, aspect: f32) -> Ray {
        let x = (2.0 * film.x - 1.0) * aspect + self.shift.x;
        let y = 1.0 - 2.0 * film.y + self.shift.y;
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

    /// The ray through a film position and a point of the lens, for a picture of the given width over height; `u` is
    /// uniform in [0, 1)². All rays through a film position meet in the plane of focus with equal weights: their mean
    /// over the aperture is Kolb's, Mitchell's and Hanrahan's thin lens (*A Realistic Camera Model for Computer
    /// Graphics*, 1995) without vignetting.
    #[inline]
    pub(crate) fn ray_through(&self, lens: Lens, film: Vec2, aspect: f32, u: Vec2) -> Ray {
        let chief = self.ray(film, aspect);
        let target = chief.origin + chief.dir * (lens.focus / -chief.dir.dot(self.frame.n));
        let point = lens.point(u);
        let origin = chief.origin + self.frame.s * point.x + self.frame.t * point.y;
        Ray::new(origin, (target - origin).normalize())
    }

    /// Film position of a point seen through the point `through` of the lens, unit direction from it to the lens in
    /// world space, and the distance to the lens; the inverse of [`Camera::ray`] for a
    /// camera without a lens or the middle of one. `None` for points that are not in front of the camera.
    #[inline]
    pub fn project(&self, point: Vec3, aspect: f32, through: Vec2) -> Option<(Vec2, Vec3, f32)> {
        // All rays through a film position meet in the plane of focus: those through one point of the lens are the
        // pinhole's, sheared.
        let slope = self.lens.map_or(Vec2::ZERO, |lens| through / lens.focus);
        let Frame { s, t, .. } = self.frame;
        let to = self.position + s * through.x + t * through.y - point;
        let local = self.frame.to_local(-to);
        let depth = -local.z;
        if depth <= 0.0 {
            return None;
        }
        let (scale, wo, distance) = match self.projection {
            Projection::Perspective { tan_half_y } => {
                let distance = to.length();
                (depth * tan_half_y, to / distance, distance)
            }
            Projection::Orthographic { half_height } => {
                let length = (1.0 + slope.length_squared()).sqrt();
                let wo = self.frame.to_world(slope.extend(1.0)) / length;
                (half_height, wo, depth * length)
            }
        };
        let (x, y) = (local.x + depth * slope.x, local.y + depth * slope.y);
        let (x, y) = (x - scale * self.shift.x, y - scale * self.shift.y);
        let film = Vec2::new(0.5 + 0.5 * x / (scale * aspect), 0.5 - 0.5 * y / scale);
        Some((film, wo, distance))
    }

    /// Matrix of the OpenEXR attribute `worldToCamera`, row by row, for points as row vectors: x to the right, y up,
    /// and z along the view.
    pub fn world_to_camera(&self) -> [f32; 16] {
        let Frame { s, t, n } = self.frame;
        let axes = [s, t, -n];
        let [x, y, z] = axes.map(|axis| -axis.dot(self.position));
        let row = |k: usize| axes.map(|axis| axis[k]);
        let [a, b, c] = [row(0), row(1), row(2)];
        [
            a[0], a[1], a[2], 0.0, b[0], b[1], b[2], 0.0, c[0], c[1], c[2], 0.0, x, y, z, 1.0,
        ]
    }

    /// Columns and rows of a picture by default: those of the file, or 512 rows with the camera's aspect ratio.
    pub(crate) fn default_frame(&self) -> UVec2 {
        const ROWS: u32 = 512;
        if let Some(film) = self.film {
            return film.size;
        }
        let columns = (ROWS as f32 * self.aspect.unwrap_or(1.0)).round();
        UVec2::new((columns as u32).clamp(1, 16 * ROWS), ROWS)
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
            shift: Vec2::ZERO,
            aspect: None,
            lens: None,
            film: None,
        }
    }

    /// The nearest camera that sees a whole box in three-quarter view from the front right, for a picture of the given
    /// width over height. A box that is empty, a point or not finite is replaced by the unit cube around its centre, or
    /// around the origin.
    pub(crate) fn framing(bounds: (Vec3, Vec3), aspect: f32) -> Self {
        let (low, high) = (bounds.0.as_dvec3(), bounds.1.as_dvec3());
        let mut centre = 0.5 * (low + high);
        let mut half = 0.5 * (high - low);
        if !centre.is_finite() || centre.abs().max_element() > LARGE {
            (centre, half) = (DVec3::ZERO, DVec3::splat(0.5));
        }
        if !half.is_finite() || half.min_element() < 0.0 || half.max_element() == 0.0 {
            half = DVec3::splat(0.5);
        }
        // A smaller box would coincide with its centre in single precision.
        let least = DVec3::splat(1e-5 * centre.abs().max_element());
        half = half.min(DVec3::splat(LARGE)).max(least);
        let mut fit = Fit::new(aspect, None);
        for corner in corners(centre - half, centre + half) {
            fit.add(corner);
        }
        fit.camera()
            .unwrap_or_else(|| Self::look_at(Vec3::Z, Vec3::ZERO, Vec3::Y, 1.0))
    }
}

#[cfg(test)]
mod tests;
