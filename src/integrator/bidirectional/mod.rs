//! Bidirectional transport: every light path is connected to the camera and to every vertex of a camera path, or merges
//! with nearby camera paths.
//!
//! One iteration is one sample a pixel. It walks one light path per pixel of the *full* frame, at most
//! `MAX_LIGHT_PATHS`, and connects the camera path of pixel p to light path p mod N. Light paths depend only on the
//! aim, the seed, their number and the iteration, so that any thread count, split into passes, and crop give
//! bit-identical pixels. Without merging, a light path is traced together with the camera paths connected to it, and
//! its vertices are not stored. With merging, all light vertices of an iteration are stored in a grid before the first
//! camera path. Splats are added in the order of their light paths.
//!
//! | file | contents |
//! |---|---|
//! | `estimator` | the settings |
//! | `aim`, `aim_cache` | targets of light paths: surfaces that throw caustics, and visible surfaces |
//! | `caustics` | a measure of caustics that camera paths rarely find |
//! | `weights` | multiple importance sampling over all strategies: pure recursions |
//! | `vertex` | a scattering vertex: its value, the densities of both walks, and whether its neighbours may merge |
//! | `walk` | one walk from either end: edges, draws, partial sums of the weights |
//! | `path_features` | the features of camera paths that guide blurs of the picture |
//! | `strategies` | strategies, and sums of contributions over them |
//! | `iteration` | scene, settings and random numbers of one iteration |
//! | `paths` | light paths and camera paths, closed by all strategies |
//! | `sample` | one sample of every pixel, cut into pieces |
//! | `connect` | strategies that close a path by an edge: value, then weight, then shadow ray |
//! | `photons` | the stored light vertices, and the grid over them |
//! | `pair` | one light path and one camera path alone, for Markov chains |
//! | `merge` | paths closed by a merge, and photon density estimation |
//! | `radius` | the merge radius |
//! | `psr` | paths that no strategy can sample, regularised |
//! | `split` | learned roughening of paths that no strategy samples well |

mod aim;
mod aim_cache;
#[cfg(test)]
#[path = "../../../tests/unit/audit/mod.rs"]
mod audit;
mod caustics;
mod connect;
mod estimator;
mod iteration;
mod merge;
mod pair;
mod path_features;
mod paths;
mod photons;
mod psr;
mod radius;
mod sample;
mod split;
mod strategies;
mod vertex;
mod walk;
mod weights;

use super::{Integrator, Picture, View};
pub(crate) use aim_cache::AimCache;
pub(crate) use estimator::Bidirectional;
pub(crate) use estimator::MAX_LIGHT_PATHS;
pub(super) use pair::Pairs;
pub use radius::Radius;
use sample::SampleLayer;
use std::ops::Range;
pub(crate) use strategies::Strategies;
pub use strategies::Strategy;

impl Integrator for Bidirectional {
    fn pass(&mut self, view: &View<'_>, samples: Range<u32>, picture: &mut Picture) -> u32 {
        let mut layer = SampleLayer::new(view.window);
        let first = self.merging.map(|radius| radius.first(view));
        let aim = self.aim(view);
        view.driver().samples(samples, 1, |one| {
            let iteration = self.iteration(view, &aim, one.start, first);
            iteration.add(&mut layer, picture)
        })
    }

    fn prepare(&self, view: &View<'_>) {
        self.aim(view);
    }

    fn shares_light(&self) -> bool {
        true
    }

    fn notes(&self, view: &View<'_>) -> Option<String> {
        let first = self.merging?.first(view);
        let aim = self.aim(view);
        let iteration = self.iteration(view, &aim, 0, Some(first));
        let some = iteration.some_light_vertices();
        let bytes = some.bytes_per_path() * iteration.paths as usize;
        Some(format!(
            "first radius {first:e}; light vertices take about {} MB",
            bytes.div_ceil(1_000_000)
        ))
    }
}
