//! Counts of the vertices that a rule roughens.

use super::walk::observer::{PathObserver, Recorder};
use super::{Settings, ShadingPoint, View};
use crate::image::film::Film;
use std::ops::Range;

/// Counts of vertices over traced paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Census {
    /// Vertices at which light was gathered.
    pub vertices: u64,
    /// Vertices among them with a roughened lobe.
    pub regularised: u64,
}

impl Census {
    /// Counts along the paths with these sample numbers through the window of `film`, which is not changed.
    pub fn take(settings: &Settings, view: &View<'_>, samples: Range<u32>, film: &Film) -> Self {
        let tracer = settings.tracer(settings.rule.clone());
        let source = settings.source();
        let mut census = Self::default();
        tracer.estimate(view, &source, samples, &mut film.clone(), &mut census);
        census
    }

    /// Share of the vertices that were regularised; zero without vertices.
    pub fn share(&self) -> f64 {
        self.regularised as f64 / self.vertices.max(1) as f64
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
