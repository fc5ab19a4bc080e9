//! Counts of the vertices that a rule roughens.

use super::walk::observer::{PathObserver, Recorder};
use super::{Settings, ShadingPoint, View};
use crate::image::film::Film;
use std::ops::Range;

/// Counts of vertices over traced paths.
#[derive(Default)]
struct Census {
    /// Vertices at which light was gathered.
    vertices: u64,
    /// Vertices among them with a roughened lobe.
    regularised: u64,
}

impl Settings {
    /// Share of the vertices that are regularised, along the paths with these sample numbers through the window of `film`,
    /// which is not changed; zero without vertices.
    pub fn regularised_share(&self, view: &View<'_>, samples: Range<u32>, film: &Film) -> f64 {
        let tracer = self.tracer(self.rule.clone());
        let source = self.source();
        let mut census = Census::default();
        tracer.estimate(view, &source, samples, &mut film.clone(), &mut census);
        census.regularised as f64 / census.vertices.max(1) as f64
    }
}

impl PathObserver for Census {
    fn vertex(&mut self, _: u32, _: f32, point: &ShadingPoint<'_>) {
        self.vertices += 1;
        self.regularised += u64::from(point.is_roughened());
    }
}

impl Recorder for Census {
    fn fork(&self) -> Self {
        Self::default()
    }

    fn join(&mut self, tile: Self) {
        self.vertices += tile.vertices;
        self.regularised += tile.regularised;
    }
}
