//! The weight of emission at the end of a ray.

use super::observer::{Event, PathObserver};
use super::{Carried, MetEmission};
use crate::math::Rgb;
use crate::math::measure::balance;

/// Weight of the emission at the end of the current ray.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct PendingEmission {
    /// Throughput for the emission: that of the path, unless the BSDF at α′ differs from the one at α. Zero where a
    /// roughened lobe has counted the emission already.
    pub(in crate::integrator) throughput: Rgb,
    /// Density of the direction in the BSDF at α′, to weigh it against light sampling; `None` for camera rays and
    /// Dirac lobes, which count in full.
    pub(in crate::integrator) pdf_w: Option<f32>,
    /// The event to report if the ray meets an emitter, without its light.
    pub(in crate::integrator) event: Option<Event>,
}

impl Carried for PendingEmission {
    #[inline]
    fn scale(&mut self, factor: Rgb) {
        self.throughput *= factor;
        if let Some(event) = &mut self.event {
            event.radiance *= factor;
        }
    }

    #[inline]
    fn is_nothing(&self) -> bool {
        self.throughput == Rgb::ZERO && self.event.is_none()
    }
}

impl PendingEmission {
    /// Emission that was counted already.
    pub(in crate::integrator) const COUNTED: Self = Self {
        throughput: Rgb::ZERO,
        pdf_w: None,
        event: None,
    };

    /// Emission that counts in full.
    #[inline]
    pub(in crate::integrator) fn full(throughput: Rgb) -> Self {
        Self {
            throughput,
            ..Self::COUNTED
        }
    }

    /// The contribution of emission; an event is reported.
    #[inline]
    pub(in crate::integrator) fn contribution<O: PathObserver>(
        &self,
        met: &MetEmission<'_>,
        observer: &mut O,
    ) -> Rgb {
        let radiance = met.radiance;
        let Some(pdf_w) = self.pdf_w else {
            return self.throughput * radiance;
        };
        let pdf_light = met.pdf_light();
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
