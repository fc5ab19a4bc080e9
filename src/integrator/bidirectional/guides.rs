//! Guides of camera paths, by which a picture that light paths share may be blurred.

use crate::image::film::Window;
use crate::image::level_film::{LevelFilm, PathLevels};
use crate::image::splat::SplatLayer;
use crate::integrator::Aovs;
use crate::integrator::walk::features::PathFeatures;
use crate::integrator::walk::observer::{PathObserver, Recorder};
use crate::integrator::walk::shading_point::ShadingPoint;
use crate::math::{Rgb, UVec2};

/// Guides of the camera paths of a sample, beside the AOVs of its render.
pub(super) struct Guides {
    aovs: Option<Aovs>,
    window: Window,
    paths: Vec<Guide>,
    /// The current way of the last path.
    way: Guide,
    /// Guides of each joined fork: nothing is copied while all are there.
    joined: Vec<Vec<Guide>>,
}

/// Guide of one camera path, and the light that its blurs leave as it is.
#[derive(Clone, Copy, Default)]
struct Guide {
    /// Index of its pixel.
    index: u32,
    /// Light that it has met before its first draw from a smooth lobe.
    seen: Rgb,
    features: PathFeatures,
}

impl Guide {
    /// Adds a share of one way of the path.
    fn add(&mut self, way: &Self, share: f32) {
        self.seen += share * way.seen;
        self.features.add_share(&way.features, share);
    }
}

impl Guides {
    pub(super) fn new(window: Window, aovs: Option<Aovs>) -> Self {
        Self {
            aovs,
            window,
            paths: Vec::new(),
            way: Guide::default(),
            joined: Vec::new(),
        }
    }

    /// Adds the sample of a layer to a film of one level, where a fork has a camera path.
    pub(super) fn push(&self, sample: u32, layer: &SplatLayer, film: &mut LevelFilm) {
        for path in self.joined.iter().flatten() {
            let index = path.index as usize;
            let values = PathLevels {
                levels: &[layer.value(index)],
                shared: path.seen,
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

impl PathObserver for Guides {
    fn begin(&mut self, pixel: UVec2, sample: u32) {
        self.aovs.iter_mut().for_each(|o| o.begin(pixel, sample));
        let (x, y) = (pixel.x - self.window.x, pixel.y - self.window.y);
        self.paths.push(Guide {
            index: y * self.window.w + x,
            ..Guide::default()
        });
    }

    fn vertex(&mut self, n: u32, distance: f32, point: &ShadingPoint<'_>) {
        let aovs = self.aovs.iter_mut();
        aovs.for_each(|o| o.vertex(n, distance, point));
        self.way.features.add(point, distance);
    }

    fn seen(&mut self, value: Rgb) {
        self.way.seen += value;
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

impl Recorder for Guides {
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
mod tests {
    use super::*;
    use crate::image::splat::Splat;

    /// Light that blurs leave alone comes to the pixels whose paths were walked.
    #[test]
    fn guides_of_forks_come_to_their_pixels() {
        let size = UVec2::new(64, 48);
        let window = Window {
            x: 8,
            y: 4,
            w: 40,
            h: 40,
        };
        let seen = |index: usize| Rgb::splat((index % 3) as f32);
        let mut guides = Guides::new(window, None);
        for rows in [0..30, 30..39] {
            let mut fork = guides.fork();
            for index in rows.start * 40..rows.end * 40 {
                fork.begin(window.pixel(index), 5);
                // On one way all of it twice, on the other nothing.
                fork.seen(seen(index));
                fork.seen(seen(index));
                fork.way(0.5);
                fork.way(0.5);
                fork.finish(Rgb::ONE);
            }
            guides.join(fork);
        }
        let mut layer = SplatLayer::new(&window);
        let index = 40;
        let value = Rgb::splat(4.0);
        layer.add_in_order(&[Splat { index, value }], 1.0);
        let mut film = LevelFilm::new(size, window, 1);
        guides.push(5, &layer, &mut film);
        for index in 0..window.len() {
            let walked = index < 39 * 40;
            let expected = if walked { seen(index) } else { Rgb::ZERO };
            assert_eq!(film.batch_mean(index, 1, 1), expected);
            let numbers: Vec<f32> = film.sample(5).skip(17 * index).take(1).collect();
            assert_eq!(numbers[0].is_nan(), !walked);
        }
        assert_eq!(film.batch_mean(40, 1, 0), value);
    }
}
