//! All paths of a film, tile by tile.

use super::PathTracer;
use super::directions::{BsdfAlone, Directions};
use crate::image::film::Film;
use crate::integrator::View;
use crate::integrator::walk::Walk;
use crate::integrator::walk::camera::trace_tile;
use crate::integrator::walk::observer::Recorder;
use crate::regularise::Roughening;
use crate::sampler::SampleSource;
use rayon::prelude::*;
use std::ops::Range;

/// Pixels a side of the tiles that threads take: small enough that all cores stay busy to the end.
const TILE: u32 = 16;

impl<R: Roughening> PathTracer<R> {
    /// Adds the samples with these numbers to every pixel of a film of the view; tiles in parallel, joined in order. Returns how
    /// many were added, fewer than all where the render is stopped.
    pub fn estimate<Q: SampleSource, O: Recorder>(
        &self,
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
        self.estimate_by(|| BsdfAlone, view, source, samples, film, recorder)
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
        let tiles: Vec<(Film, O)> = film
            .tiles(TILE)
            .into_par_iter()
            .filter(|_| !view.stopped())
            .map(|window| {
                let mut tile = film.cut(window);
                let mut observer = recorder.fork();
                let radiance =
                    |walk: Walk<'_>, sample, stream: &mut Q::Stream, observer: &mut O| {
                        self.radiance_by(&mut directions(), walk, sample, stream, observer)
                    };
                let samples = samples.clone();
                trace_tile(view, source, samples, &mut tile, &mut observer, radiance);
                (tile, observer)
            })
            .collect();
        if view.drops_pass() {
            return 0;
        }
        for (tile, observer) in tiles {
            film.paste(&tile);
            recorder.join(observer);
        }
        view.added(&samples)
    }
}
