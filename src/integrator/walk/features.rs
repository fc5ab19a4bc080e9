//! Guides that a path meets, for filters of pictures.

use super::shading_point::ShadingPoint;
use crate::image::level_film::Features;

/// Roughness from which light at a vertex is blurred by its surroundings there, not by those of its mirror image.
const ROUGH: f32 = 0.05;

/// Guides that a path has met so far; of the last vertex where none is rough.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::integrator) struct PathFeatures {
    values: Features,
    /// True if they are those of a rough vertex.
    is_rough: bool,
}

impl PathFeatures {
    /// Notes the path's `distance` to a vertex and what it is, up to the first rough one.
    #[inline]
    pub(in crate::integrator) fn add(&mut self, vertex: &ShadingPoint<'_>, distance: f32) {
        if self.is_rough {
            return;
        }
        let [x, y, z] = vertex.frame.n.to_array();
        let length = self.values[3];
        if length == 0.0 {
            let [r, g, b] = vertex.reflectance().to_array();
            self.values[4..].copy_from_slice(&[x, y, z, distance, r, g, b]);
        }
        self.values[..4].copy_from_slice(&[x, y, z, length + distance]);
        self.is_rough = vertex.alpha >= ROUGH;
    }

    /// Adds a share of the guides of one way of the path.
    pub(in crate::integrator) fn add_share(&mut self, way: &Self, share: f32) {
        let ways = self.values.iter_mut().zip(&way.values);
        ways.for_each(|(sum, value)| *sum += share * value);
    }

    /// The guides.
    #[inline]
    pub(in crate::integrator) fn values(&self) -> Features {
        self.values
    }
}
