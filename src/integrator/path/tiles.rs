//! All paths of a film, tile by tile.

use super::PathTracer;
use super::directions::{BsdfAlone, Directions};
use crate::image::film::Film;
use crate::integrator::View;
use crate::integrator::pieces::Tile;
use crate::integrator::walk::Walk;
use crate::integrator::walk::camera::trace_tile;
use crate::integrator::walk::observer::Recorder;
use crate::regularise::Roughening;
use crate::sampler::SampleSource;
use std::ops::Range;

/// Pixels per side of the tiles that threads take: small enough that all cores stay busy to the end.
const TILE: u32 = 16;

impl<R: Roughening> PathTracer<R> {
    /// Adds the samples with these numbers to every pixel of a film of the view, each along one drawn way through
    /// glass. Returns how many were added, fewer than all where the render is stopped.
    pub fn estimate<Q: SampleSource, O: Recorder>(
        &self,
        view: &View<'_>,
        source: &Q,
        samples: Range<u32>,
        film: &mut Film,
        recorder: &mut O,
    ) -> u32 {
        self.estimate_by(BsdfAlone::drawn, view, source, samples, film, recorder)
    }

    /// The same with the directions of a policy, which is made anew for each path.
    pub(in crate::integrator) fn estimate_by<D: Directions, Q: SampleSource, O: Recorder>(
        &self,
        directions: impl Fn() -> D + Sync,
        view: &View<'_>,
        source: &Q,
        samples: Range<u32>,
        film: &mut Film,
        recorder: &mut O,
    ) -> u32 {
        debug_assert_eq!(
            (film.size, film.window),
            (view.sensor.frame, view.window),
            "the film of another view"
        );
        let driver = view.driver();
        let tiles = film.tiles(TILE);
        let radiance = |walk: Walk<'_>, sample, stream: &mut Q::Stream, observer: &mut O| {
            self.radiance(directions(), walk, sample, stream, observer)
        };
        driver.samples(samples, Tile::samples_at_once(film), |samples| {
            let trace = |tile: &mut Tile<'_>, observer: &mut O| {
                trace_tile(view, source, samples.clone(), tile, observer, radiance);
            };
            let results = driver.run_tiles(&tiles, &samples, film, recorder, trace);
            results.map(|_| ())
        })
    }
}
