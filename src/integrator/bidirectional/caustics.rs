//! A measure of caustics that camera paths rarely find.
//!
//! A camera path finds a caustic of a small light by chance alone, in few samples that are much brighter than the
//! picture around. Light paths find it easily. A few of them measure its share of the light of a view.

use super::Bidirectional;
use super::aim::{Brightness, VisibleVertex, candidates, even_aim};
use crate::image::film::Window;
use crate::integrator::View;

/// Number of light paths, and fewest of their vertices that make a caustic.
const PATHS: u32 = 1 << 11;
const VERTICES: usize = 8;

/// Cells per side of the picture; few, so that each has enough paths.
const CELLS: u32 = 8;

/// Most triangles at which the light paths are aimed.
const MAX_ITEMS: usize = 1 << 12;

/// Radiance of a camera path, over that of its place in the picture, above which its light is rare: a place without
/// other light shows it in one sample of this number.
const RARE: f64 = 1000.0;

impl Bidirectional {
    /// Share of the light of a view that comes by way of sharp surfaces and that camera paths rarely find: the mean of
    /// the shares in every place of the picture, from 0 to about 1. It is the same for every window of a frame and
    /// every seed.
    pub(crate) fn rare_caustics(&self, view: &View<'_>) -> f64 {
        let View { sensor, scene, .. } = view;
        let frame = sensor.frame;
        let whole = View::new(scene, sensor.camera, frame, Window::full(frame));
        if scene.lights().is_empty() {
            return 0.0;
        }
        let targets = candidates(&whole, 0.0, MAX_ITEMS);
        let (_, aim) = even_aim(scene, &targets);
        let unseeded = Self {
            seed: 0,
            ..self.clone()
        };
        let found = unseeded.pilot_paths(&whole, &aim, &targets, PATHS);
        let brightness = Brightness::of(&found, CELLS);
        let cells = f64::from(CELLS * CELLS);
        // The contributions to a cell are the radiances of its pixels, times the number of paths.
        let pixels = frame.as_dvec2().element_product() / cells;
        let radiance =
            |vertex: &VisibleVertex| brightness.around(vertex) / (pixels * f64::from(PATHS));
        let visible = found.iter().flat_map(|(_, visible)| visible);
        let rare = visible.filter(|vertex| vertex.sample > RARE * radiance(vertex));
        let shares: Vec<f64> = rare.map(|v| v.value / brightness.around(v)).collect();
        if shares.len() < VERTICES {
            return 0.0;
        }
        shares.iter().sum::<f64>() / cells
    }
}

#[cfg(test)]
mod tests;
