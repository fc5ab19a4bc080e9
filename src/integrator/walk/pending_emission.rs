//! What emission at the end of a ray is worth.

use crate::integrator::walk::observer::{Event, PathObserver};
use crate::math::Rgb;
use crate::math::measure::balance;

/// How the emission at the end of the current ray counts.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct Arrival {
    /// Throughput for the emission: that of the path, unless the closure at α′ differs from the one at α. Zero
    /// where a regularised sample has counted the emission already.
    pub(in crate::integrator) throughput: Rgb,
    /// Density of the direction in the closure at α′, to weigh it against light sampling; `None` for camera rays and
    /// Dirac lobes, which count in full.
    pub(in crate::integrator) pdf_w: Option<f32>,
    /// What an observer is told if the ray meets an emitter, without its light.
    pub(in crate::integrator) event: Option<Event>,
}

impl Arrival {
    pub(in crate::integrator) const COUNTED: Self = Self {
        throughput: Rgb::ZERO,
        pdf_w: None,
        event: None,
    };

    /// Emission counts in full.
    #[inline]
    pub(in crate::integrator) fn full(throughput: Rgb) -> Self {
        Self {
            throughput,
            ..Self::COUNTED
        }
    }

    /// Whether no emission at the end of the ray would count, at any roughness.
    #[inline]
    pub(in crate::integrator) fn carries_nothing(&self) -> bool {
        self.throughput == Rgb::ZERO && self.event.is_none()
    }

    #[inline]
    pub(in crate::integrator) fn scale(&mut self, factor: Rgb) {
        self.throughput *= factor;
        if let Some(event) = &mut self.event {
            event.radiance *= factor;
        }
    }

    /// What emitted radiance contributes; tells the observer of an event.
    #[inline]
    pub(in crate::integrator) fn weigh<O: PathObserver>(
        &self,
        radiance: Rgb,
        pdf_light: impl FnOnce() -> f32,
        observer: &mut O,
    ) -> Rgb {
        let Some(pdf_w) = self.pdf_w else {
            return self.throughput * radiance;
        };
        let pdf_light = pdf_light();
        if O::EVENTS
            && let Some(event) = self.event
        {
            observer.event(&Event {
                radiance: event.radiance * radiance,
                pdf_light,
                ..event
            });
        }
        self.throughput * radiance * balance(pdf_w, pdf_light)
    }
}
