//! The radius within which photons merge, and how it shrinks.

use crate::integrator::View;
use crate::math::{Rgb, UVec2, Vec2};
use crate::scene::Scene;
use crate::scene::sensor::RayDensity;

/// A radius that shrinks from iteration to iteration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Radius {
    /// Radius of the first iteration in world units, above 0; `None` to choose it for the view.
    pub first: Option<f32>,
    /// Exponent α in (0, 1] of `[UPS (19)–(23)]`: rᵢ = r₁ i^((α − 1)/2). The variance falls as i^−α and the bias as
    /// i^−(1 − α), so that 2/3 is best; 1 keeps the radius and its bias.
    pub alpha: f32,
}

impl Default for Radius {
    fn default() -> Self {
        Self::DEFAULT
    }
}

/// Camera rays per side of the lattice from which the first radius is computed.
const LATTICE: u32 = 64;

/// Most Dirac lobes that a ray of the lattice follows.
const MAX_DIRAC: u32 = 16;

/// Bounds of an automatic radius, over half the diagonal of the scene.
const BOUNDS: [f32; 2] = [1e-5, 1e-2];

impl Radius {
    /// A radius chosen for the view, with the best exponent.
    pub(crate) const DEFAULT: Self = Self {
        first: None,
        alpha: 2.0 / 3.0,
    };

    /// Radius of iteration `sample`, counted from 0, where `first` is that of iteration 0.
    pub(crate) fn at(&self, first: f32, sample: u32) -> f32 {
        let shrink = (f64::from(sample) + 1.0).powf(0.5 * (f64::from(self.alpha) - 1.0));
        (f64::from(first) * shrink) as f32
    }

    /// Radius of the first iteration: twice the median footprint of a pixel on the first surface that is not Dirac.
    pub(crate) fn first(&self, view: &View<'_>) -> f32 {
        if let Some(first) = self.first {
            return first;
        }
        let (low, high) = view.scene.geometry().bounds();
        let extent = 0.5 * low.distance(high);
        if extent == 0.0 {
            return 1.0;
        }
        let frame = view.sensor.frame.as_vec2();
        let mut footprints: Vec<f32> = (0..LATTICE * LATTICE)
            .filter_map(|i| {
                let at = UVec2::new(i % LATTICE, i / LATTICE).as_vec2() + 0.5;
                footprint(view, at / LATTICE as f32 * frame)
            })
            .collect();
        footprints.sort_by(f32::total_cmp);
        let median = footprints.get(footprints.len() / 2);
        let [least, most] = BOUNDS.map(|b| b * extent);
        median.map_or(most, |m| (2.0 * m).clamp(least, most))
    }
}

/// Root of the area that a pixel covers on the first surface that is not Dirac; the stronger Dirac lobe is followed.
fn footprint(view: &View<'_>, film: Vec2) -> Option<f32> {
    let scene: &Scene = view.scene;
    let mut ray = view.sensor.ray(film);
    let RayDensity { pdf, parallel } = view.sensor.pdf(ray.dir);
    let mut distance = 0.0;
    for _ in 0..MAX_DIRAC {
        let hit = scene.intersect(&ray)?;
        distance += hit.t;
        let mut surface = scene.surface(&hit);
        let bsdf = scene.bsdf(&mut surface, 0.5);
        let frame = surface.frame_for(-ray.dir);
        let alpha = bsdf.alpha();
        if !bsdf.is_delta_at(alpha) {
            let cos = surface.ng.dot(ray.dir).abs();
            let area = if parallel { 1.0 } else { distance * distance } / (pdf * cos);
            return area.is_finite().then(|| area.sqrt());
        }
        // A random number of 0.5 selects the stronger lobe.
        let sample = bsdf.sample(alpha, frame.to_local(-ray.dir), [0.5; 3])?;
        if sample.weight == Rgb::ZERO {
            return None;
        }
        ray = surface.spawn(frame.to_world(sample.wi));
    }
    None
}
