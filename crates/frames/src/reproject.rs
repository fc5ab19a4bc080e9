//! The pixels of another frame that show a surface of this one.

use crate::frame::Frame;
use crate::surfaces::SurfacePoint;
use opsr::math::{Vec2, Vec3};
use opsr::scene::Sensor;

/// Distance, in pixels, at which a surface counts as another one.
const REACH: f32 = 3.0;

/// Factor on squared differences of unit normals.
const NORMAL_WEIGHT: f32 = 10.0;

/// Squared difference of unit normals from which on a pixel shows another surface.
const NORMAL_LIMIT: f32 = 0.1;

/// Difference of reflectances at which a surface counts as another one.
const ALBEDO_STEP: f32 = 0.05;

/// Factor on the squared logarithm of the ratio of two surfaces' glints. Measured in docs/lab/films.md.
const GLINT_WEIGHT: f32 = 3.0;

/// Minimum sum of weights of a visible surface.
const SEEN: f32 = 0.05;

/// Radiance of a surface in another frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reprojected {
    /// Radiance.
    pub(crate) light: Vec3,
    /// Its variance, mean of the channels.
    pub(crate) variance: f32,
    /// Visible share of the surface there, in (0, 1].
    pub(crate) weight: f32,
}

/// A surface that is tracked from its own frame through the earlier or the later ones.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reprojection {
    point: SurfacePoint,
    /// Its pixel in its own frame.
    pixel: usize,
    /// World position in the frame reached so far; `None` once the surface is lost.
    place: Option<Vec3>,
}

/// Edge of a pixel's footprint at a place, in scene units.
fn side(frame: &Frame, place: Vec3) -> f32 {
    let sensor = Sensor {
        camera: &frame.camera,
        frame: frame.size,
    };
    let way = place - frame.camera.position;
    let dir = way.normalize_or(-frame.camera.frame.n);
    let footprint = sensor.cone(dir).footprint(dir, way.length());
    footprint.map_or(0.0, |footprint| 2.0 * footprint.half)
}

/// Projection of a place into a frame, in pixels from the centre of the window's first pixel; it may be outside.
fn seen_at(frame: &Frame, place: Vec3) -> Option<Vec2> {
    let size = frame.size.as_vec2();
    let (film, ..) = frame.camera.project(place, size.x / size.y, Vec2::ZERO)?;
    let first = Vec2::new(frame.window.x as f32, frame.window.y as f32);
    Some(film * size - 0.5 - first)
}

/// [`seen_at`], if the place is in the window or less than a pixel outside.
fn project(frame: &Frame, place: Vec3) -> Option<Vec2> {
    let at = seen_at(frame, place)?;
    let outer = Vec2::new(frame.window.w as f32, frame.window.h as f32);
    (at.cmpgt(Vec2::splat(-1.0)).all() && at.cmplt(outer).all()).then_some(at)
}

/// Pixel of a window, if it is inside.
fn index(frame: &Frame, x: i64, y: i64) -> Option<usize> {
    let (w, h) = (i64::from(frame.window.w), i64::from(frame.window.h));
    ((0..w).contains(&x) && (0..h).contains(&y)).then_some((y * w + x) as usize)
}

impl Reprojection {
    /// The reprojection of a pixel, which begins in its own frame.
    pub(crate) fn new(frame: &Frame, pixel: usize) -> Self {
        let point = frame.surfaces.points[pixel];
        Self {
            point,
            pixel,
            place: point.is_some().then_some(point.position),
        }
    }

    /// Advances from frame `from`, which is `steps` from the surface's own, to the next one in its direction.
    ///
    /// The place does not change if nothing moves in the scene. Otherwise the surface takes the motion of the pixel
    /// that shows it, and is lost where it is hidden.
    pub(crate) fn step(&mut self, from: &Frame, steps: usize, forward: bool) {
        let moved = match forward {
            true => &from.surfaces.after,
            false => &from.surfaces.before,
        };
        if let (Some(moved), Some(place)) = (moved, self.place) {
            self.place = match steps {
                0 => Some(moved[self.pixel]).filter(|place| place.is_finite()),
                _ => self.carried(from, moved, place),
            };
        }
    }

    /// The next place of a surface that is at `place` in a frame, by the motion of the pixel that shows it there.
    fn carried(&self, from: &Frame, moved: &[Vec3], place: Vec3) -> Option<Vec3> {
        let at = project(from, place)?.round();
        let pixel = index(from, at.x as i64, at.y as i64)?;
        let there = &from.surfaces.points[pixel];
        let near = there.position.distance(place) < REACH * side(from, place);
        let alike = self.point.difference(there).0 < NORMAL_LIMIT;
        let next = place + (moved[pixel] - there.position);
        (near && alike && next.is_finite()).then_some(next)
    }

    /// Motion in pixels from the surface's own pixel to its place in the frame reached; y up. 0 for a lost surface.
    pub(crate) fn motion(&self, frame: &Frame) -> Vec2 {
        let width = frame.picture.width;
        let own = Vec2::new((self.pixel % width) as f32, (self.pixel / width) as f32);
        let at = self.place.and_then(|place| seen_at(frame, place));
        at.map_or(Vec2::ZERO, |at| (at - own) * Vec2::new(1.0, -1.0))
    }

    /// Radiance of the surface in the frame reached; `None` if it is not visible there or shows other lamps. `dark`, a
    /// positive number, is the light of the faintest lamp that counts.
    pub(crate) fn light(&self, frame: &Frame, variance: &[f32], dark: f32) -> Option<Reprojected> {
        let place = self.place?;
        let at = project(frame, place)?;
        let corner = at.floor();
        let part = at - corner;
        let reach = (REACH * side(frame, place)).max(f32::MIN_POSITIVE);
        let (mut light, mut noise, mut weight) = (Vec3::ZERO, 0.0, 0.0);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let across = if dx == 1 { part.x } else { 1.0 - part.x };
            let down = if dy == 1 { part.y } else { 1.0 - part.y };
            let Some(pixel) = index(frame, corner.x as i64 + dx, corner.y as i64 + dy) else {
                continue;
            };
            let there = &frame.surfaces.points[pixel];
            if !there.is_some() {
                continue;
            }
            let far = there.position.distance_squared(place) / (reach * reach);
            let (bend, paint) = self.point.difference(there);
            let sum = 0.5 * far + NORMAL_WEIGHT * bend + 0.5 * paint / (ALBEDO_STEP * ALBEDO_STEP);
            let sum = sum + GLINT_WEIGHT * self.point.contrast(there, dark);
            let w = across * down * (-sum).exp();
            light += w * frame.picture.pixels[pixel];
            noise += w * variance[pixel];
            weight += w;
        }
        (weight > SEEN && light.is_finite()).then(|| Reprojected {
            light: light / weight,
            variance: noise / weight,
            weight,
        })
    }
}
