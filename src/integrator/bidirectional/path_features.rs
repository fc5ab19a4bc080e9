//! Features of camera paths, which guide the blur of a picture whose pixels share light paths.

use crate::image::film::Window;
use crate::image::level_film::{LevelFilm, PathLevels};
use crate::image::splat::SplatLayer;
use crate::integrator::Aovs;
use crate::integrator::walk::features::PathFeatures;
use crate::integrator::walk::observer::{PathObserver, Recorder};
use crate::integrator::walk::shading_point::ShadingPoint;
use crate::math::{Rgb, UVec2};

/// Features of the camera paths of a sample, and the AOVs of the render.
pub(super) struct PathFeatureRecorder {
    aovs: Option<Aovs>,
    window: Window,
    paths: Vec<PathRecord>,
    /// The current way of the last path.
    way: PathRecord,
    /// Features of each joined fork, moved and not copied.
    joined: Vec<Vec<PathRecord>>,
}

/// Features of one camera path, and its light that is not blurred.
#[derive(Clone, Copy, Default)]
struct PathRecord {
    /// Index of its pixel.
    index: u32,
    /// Light found before the first draw from a non-Dirac lobe.
    dirac_only: Rgb,
    features: PathFeatures,
}

impl PathRecord {
    /// Adds a share of one way of the path.
    fn add(&mut self, way: &Self, share: f32) {
        self.dirac_only += share * way.dirac_only;
        self.features.add_share(&way.features, share);
    }
}

impl PathFeatureRecorder {
    pub(super) fn new(window: Window, aovs: Option<Aovs>) -> Self {
        Self {
            aovs,
            window,
            paths: Vec::new(),
            way: PathRecord::default(),
            joined: Vec::new(),
        }
    }

    /// Adds the sample of a layer to a film of one level, at the pixels whose camera paths were traced.
    pub(super) fn push(&self, sample: u32, layer: &SplatLayer, film: &mut LevelFilm) {
        for path in self.joined.iter().flatten() {
            let index = path.index as usize;
            let values = PathLevels {
                levels: &[layer.value(index)],
                shared: path.dirac_only,
                features: path.features.values(),
            };
            film.push(index, sample, &values);
        }
    }

    /// AOVs of the render.
    pub(super) fn aovs(self) -> Option<Aovs> {
        self.aovs
    }
}

impl PathObserver for PathFeatureRecorder {
    fn begin(&mut self, pixel: UVec2, sample: u32) {
        self.aovs.iter_mut().for_each(|o| o.begin(pixel, sample));
        let (x, y) = (pixel.x - self.window.x, pixel.y - self.window.y);
        self.paths.push(PathRecord {
            index: y * self.window.w + x,
            ..PathRecord::default()
        });
    }

    fn vertex(&mut self, n: u32, distance: f32, point: &ShadingPoint<'_>) {
        let aovs = self.aovs.iter_mut();
        aovs.for_each(|o| o.vertex(n, distance, point));
        self.way.features.add(point, distance);
    }

    fn dirac_only_light(&mut self, value: Rgb) {
        self.way.dirac_only += value;
    }

    fn way(&mut self, share: f32) {
        let way = std::mem::take(&mut self.way);
        if let Some(path) = self.paths.last_mut() {
            path.add(&way, share);
        }
    }

    fn finish(&mut self, radiance: Rgb) {
        self.aovs.iter_mut().for_each(|o| o.finish(radiance));
    }
}

impl Recorder for PathFeatureRecorder {
    fn fork(&self) -> Self {
        Self::new(self.window, self.aovs.as_ref().map(Recorder::fork))
    }

    fn join(&mut self, tile: Self) {
        if let (Some(aovs), Some(tile)) = (&mut self.aovs, tile.aovs) {
            aovs.join(tile);
        }
        self.joined.push(tile.paths);
    }
}

#[cfg(test)]
mod tests;
