//! The picture of a rule's own factors as the only level, with the features of its paths that guide blurs.

use super::packed::PathSums;
use super::tiles::LevelPaths;
use crate::bsdf::{Lobe, SharedNumbers};
use crate::integrator::path::PathTracer;
use crate::integrator::path::directions::BsdfAlone;
use crate::integrator::walk::Walk;
use crate::integrator::walk::observer::{Event, PathObserver};
use crate::integrator::walk::shading_point::ShadingPoint;
use crate::math::Rgb;
use crate::regularise::Roughening;
use crate::sampler::Sampler;

impl<R: Roughening> LevelPaths<1> for PathTracer<R> {
    fn levels(&self) -> usize {
        1
    }

    fn trace<S: Sampler + Clone, O: PathObserver>(
        &self,
        walk: Walk<'_>,
        sample: u32,
        _turn: u32,
        sampler: &S,
        observer: &mut O,
    ) -> PathSums<1> {
        let mut noted = Noted {
            observer,
            sums: PathSums::new(),
            way: PathSums::new(),
        };
        let light = self.radiance(BsdfAlone::on_all_ways(), walk, sample, sampler, &mut noted);
        PathSums {
            levels: [light],
            ..noted.sums
        }
    }
}

/// Records the features of a path, and forwards its calls to another observer.
struct Noted<'a, O> {
    observer: &'a mut O,
    /// Light found before the path's first draw from a non-Dirac lobe, and features.
    sums: PathSums<1>,
    /// Light and features of the current way.
    way: PathSums<1>,
}

impl<O: PathObserver> PathObserver for Noted<'_, O> {
    const EVENTS: bool = O::EVENTS;

    #[inline]
    fn vertex(&mut self, n: u32, distance: f32, point: &ShadingPoint<'_>) {
        self.way.features.add(point, distance);
        self.observer.vertex(n, distance, point);
    }
    #[inline]
    fn event(&mut self, event: &Event) {
        self.observer.event(event);
    }
    #[inline]
    fn roughened(&mut self, point: &ShadingPoint<'_>, u: &SharedNumbers) {
        self.observer.roughened(point, u);
    }
    #[inline]
    fn sampled(&mut self, lobe: Lobe) {
        self.observer.sampled(lobe);
    }
    #[inline]
    fn scattered(&mut self, alpha: f32) {
        self.observer.scattered(alpha);
    }
    #[inline]
    fn light(&mut self, scatterings: u32, value: Rgb) {
        self.observer.light(scatterings, value);
    }
    #[inline]
    fn dirac_only_light(&mut self, value: Rgb) {
        self.way.shared += value;
        self.observer.dirac_only_light(value);
    }
    #[inline]
    fn way(&mut self, share: f32) {
        let way = std::mem::replace(&mut self.way, PathSums::new());
        self.sums.add_way(&way, share);
        self.observer.way(share);
    }
}
