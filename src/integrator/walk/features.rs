//! Features of a path (normals, distances, reflectance), which guide filters of pictures.

use super::shading_point::ShadingPoint;
use crate::image::level_film::Features;

/// Roughness from which the features of a vertex itself guide the blur, and not those of the next vertex.
const ROUGH: f32 = 0.05;

/// Reflectance of a diffuse base from which they do at any roughness of the gloss above it, which reflects about as
/// much. Where paths leave from the base, their next vertices are anywhere.
const BASE: f32 = 0.04;

/// Features of a path so far: of its first vertex, and of its first rough vertex, or the last if none is rough. A polished
/// surface with a diffuse base counts as rough.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::integrator) struct PathFeatures {
    values: Features,
    /// True once a rough vertex was added.
    is_rough: bool,
}

impl PathFeatures {
    /// Adds a vertex at this `distance` from the previous one; ignored after the first rough vertex.
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
        self.is_rough = vertex.alpha >= ROUGH || vertex.bsdf.base_albedo().max_element() >= BASE;
    }

    /// Adds a share of the features of one way of the path.
    pub(in crate::integrator) fn add_share(&mut self, way: &Self, share: f32) {
        let ways = self.values.iter_mut().zip(&way.values);
        ways.for_each(|(sum, value)| *sum += share * value);
    }

    #[inline]
    pub(in crate::integrator) fn values(&self) -> Features {
        self.values
    }
}
