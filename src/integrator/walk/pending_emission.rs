//! The weight of emission at the end of a ray.

use super::observer::{Event, PathObserver};
use super::{Carried, MetEmission};
use crate::math::Rgb;
use crate::math::measure::balance;

/// Weight of the emission at the end of the current ray.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct EmissionWeight {
    /// Throughput for the emission: that of the path, unless the BSDF at α′ differs from the one at α. Zero where a
    /// roughened lobe has counted the emission already.
    pub(in crate::integrator) throughput: Rgb,
    /// Density of the direction in the BSDF at α′, to weigh it against light sampling; `None` for camera rays and
    /// Dirac lobes, which count in full.
    pub(in crate::integrator) pdf_w: Option<f32>,
}

impl Carried for EmissionWeight {
    #[inline]
    fn scale(&mut self, factor: Rgb) {
        self.throughput *= factor;
    }

    #[inline]
    fn is_nothing(&self) -> bool {
        self.throughput == Rgb::ZERO
    }
}

impl EmissionWeight {
    /// Emission that counts in full.
    #[inline]
    pub(in crate::integrator) fn full(throughput: Rgb) -> Self {
        Self {
            throughput,
            pdf_w: None,
        }
    }

    /// The contribution of emission.
    #[inline]
    pub(in crate::integrator) fn contribution(&self, met: &MetEmission<'_>) -> Rgb {
        match self.pdf_w {
            Some(pdf_w) => self.throughput * met.radiance * balance(pdf_w, met.pdf_light()),
            None => self.throughput * met.radiance,
        }
    }
}

/// The same with an event to report.
#[derive(Clone, Copy)]
pub(in crate::integrator) struct PendingEmission {
    pub(in crate::integrator) weight: EmissionWeight,
    /// The event to report if the ray meets an emitter, without its light.
    pub(in crate::integrator) event: Option<Event>,
}

impl Carried for PendingEmission {
    #[inline]
    fn scale(&mut self, factor: Rgb) {
        self.weight.scale(factor);
        if let Some(event) = &mut self.event {
            event.radiance *= factor;
        }
    }

    #[inline]
    fn is_nothing(&self) -> bool {
        self.weight.is_nothing() && self.event.is_none()
    }
}

impl PendingEmission {
    /// Emission that was counted already.
    pub(in crate::integrator) const COUNTED: Self = Self {
        weight: EmissionWeight {
            throughput: Rgb::ZERO,
            pdf_w: None,
        },
        event: None,
    };

    /// Emission without an event.
    #[inline]
    pub(in crate::integrator) fn of(weight: EmissionWeight) -> Self {
        Self {
            weight,
            event: None,
        }
    }

    /// The contribution of emission; an event is reported.
    #[inline]
    pub(in crate::integrator) fn contribution<O: PathObserver>(
        &self,
        met: &MetEmission<'_>,
        observer: &mut O,
    ) -> Rgb {
        if O::EVENTS
            && let Some(event) = self.event
        {
            observer.event(&Event {
                radiance: event.radiance * met.radiance,
                pdf_light: met.pdf_light(),
                ..event
            });
        }
        self.weight.contribution(met)
    }
}
