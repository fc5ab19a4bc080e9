//! The floor of the studio, on which the objects of a file without light stand.

use super::light::sky::FLOOR_ALBEDO;
use super::{Material, Mesh, Scene, SceneParts, framing};
use crate::math::{DVec3, Rgb, Vec3};
use std::f64::consts::TAU;

/// Radius of the floor over half the diagonal of the box around the objects: their shadows at the rim are below 0.5 %.
const RADIUS: f64 = 6.0;

/// Gap below the lowest point over the longest edge of that box, which separates the floor from a flat base.
const GAP: f64 = 1e-3;

/// Corners of the rim.
const CORNERS: u32 = 96;

impl SceneParts {
    /// Lays a disc, as the last mesh, below the lowest point of the objects that a camera frames. In the light of the
    /// studio it is as bright as the studio's lower half. Scenes with their own ground or sky stay as they are. Camera
    /// rays from below pass through the single-sided floor. Objects that move keep the floor that they have at `rest`.
    pub(crate) fn lay_floor(&mut self, rest: Option<&Self>) {
        let Some([low, high]) = framing::bounds_on_nothing(rest.unwrap_or(self)) else {
            return;
        };
        let size = high - low;
        let middle = (0.5 * (low + high)).with_y(low.y - GAP * size.max_element());
        let radius = RADIUS * 0.5 * size.length();
        let rim = (0..CORNERS).map(|i| {
            let (sin, cos) = (TAU * f64::from(i) / f64::from(CORNERS)).sin_cos();
            middle + radius * DVec3::new(sin, 0.0, cos)
        });
        let name = "floor of the studio";
        let disc = Mesh {
            positions: std::iter::once(middle)
                .chain(rim)
                .map(|p| p.as_vec3())
                .collect(),
            indices: (0..CORNERS)
                .map(|i| [0, i + 1, (i + 1) % CORNERS + 1])
                .collect(),
            name: name.into(),
            ..Mesh::default()
        };
        let lambertian = Material {
            name: name.into(),
            base_color: Rgb::splat(FLOOR_ALBEDO),
            metallic: 0.0,
            specular: 0.0,
            ..Material::default()
        };
        self.add(lambertian, [disc]);
        self.has_floor = true;
    }

    /// The floor of the studio.
    pub fn floor(&self) -> Option<&Mesh> {
        self.meshes.last().filter(|_| self.has_floor)
    }
}

impl Scene {
    /// Lowest and highest corner of the box around all meshes except the floor of the studio.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let own = (self.parts.has_floor).then(|| framing::bounds(&self.parts));
        match own.flatten() {
            Some([low, high]) => (low.as_vec3(), high.as_vec3()),
            None => self.geometry.bounds(),
        }
    }
}
