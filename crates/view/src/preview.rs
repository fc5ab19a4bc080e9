//! Previews: pictures of fewer pixels than the frame, while a render begins or the camera turns. A few samples,
//! resolved, have less error than one sample of the whole frame, which takes as long.

use super::finish::Maps;
use super::hub::{Hub, Snapshot};
use super::open_scene::Viewpoint;
use opsr::image::Buffer;
use opsr::integrator::{Amounts, Estimator, Picture, Recorded, Settings, Stop};
use opsr::math::UVec2;
use opsr::render::{Fault, Request, Shown};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// Seconds that the first preview after a change may take, and of a whole frame that needs no preview before it.
const FIRST: f64 = 0.05;
const FAST_FRAME_SECONDS: f64 = 0.25;

/// Edge of a preview's pixel in pixels of the frame: at most, and in the last preview.
pub(super) const MAX_SCALE: u32 = 16;
pub(super) const LAST_SCALE: u32 = 2;

/// Samples after which a preview is shown: the first number for previews before the last one, all for the last one.
const PREVIEW_SAMPLES: [u32; 3] = [2, 4, 8];

/// Seconds per pixel of a preview before one is measured.
pub(super) const COST: f64 = 8e-6;

/// Previews, and their measured cost.
#[derive(Default)]
pub(super) struct Previews {
    /// Estimator of the last previews, and its seconds per pixel.
    pub(super) cost: Option<(Estimator, f64)>,
}

impl Previews {
    /// Shows previews, each of about four times the work of the one before, until whole frames are fast enough.
    ///
    /// `coarsest` is the edge of a pixel of the first preview; without it the first preview takes about [`FIRST`] and
    /// is never interrupted. False if the options have changed.
    pub(super) fn show(
        &mut self,
        hub: &Hub,
        request: &Request<'_>,
        viewpoint: &Arc<Viewpoint>,
        run: u64,
        coarsest: Option<u32>,
    ) -> Result<bool, Fault> {
        let settings = settings(request, &viewpoint.settings);
        let known = self.cost.filter(|(of, _)| *of == settings.estimator);
        let mut cost = known.map_or(COST, |(_, cost)| cost);
        let mut first = coarsest.is_none();
        let pixels = viewpoint.frame.as_dvec2().element_product();
        let least = || (1..MAX_SCALE).find(|s| cost * pixels / f64::from(s * s) <= FIRST);
        let mut scale = coarsest.unwrap_or_else(|| least().unwrap_or(MAX_SCALE));
        let denoiser = request.spec.denoiser()?;
        let clock = Instant::now();
        while first || scale > 1 && cost * pixels > FAST_FRAME_SECONDS {
            let size = (viewpoint.frame / scale).max(UVec2::ONE);
            let stop = Stop::when(&hub.obsolete);
            let mut view = viewpoint.view(size);
            if !first {
                view = view.until(&stop);
            }
            let recorded = Recorded {
                first: denoiser.is_some(),
                ..Recorded::default()
            };
            let blank = Picture::blank(size, view.window, &settings.amounts, recorded);
            let mut picture = blank.map_err(|e| Fault::option("size", e))?;
            let mut integrator = settings.integrator();
            let mut samples = 0;
            let ends = match coarsest {
                // The preview of another method, with more samples, is shown already.
                Some(_) => &PREVIEW_SAMPLES[1..],
                None if scale == LAST_SCALE => &PREVIEW_SAMPLES,
                None => &PREVIEW_SAMPLES[..1],
            };
            for &end in ends {
                let pass = Instant::now();
                if integrator.pass(&view, samples..end, &mut picture) < end - samples {
                    return Ok(false);
                }
                let shown = Shown::of(&picture, &request.spec, denoiser.as_ref())?;
                if samples == 0 {
                    let passes = f64::from(end / PREVIEW_SAMPLES[0]);
                    let took = pass.elapsed().as_secs_f64() / (passes * view.window.len() as f64);
                    // Decreases slowly, since a part of the scene may be empty and fast.
                    cost = took.max(0.8 * cost);
                    self.cost = Some((settings.estimator, cost));
                }
                samples = end;
                let seconds = clock.elapsed().as_secs_f64();
                let snapshot = preview(viewpoint, run, seconds, size, shown.picture);
                hub.show(0, snapshot);
                if hub.obsolete.load(Ordering::Relaxed) {
                    return Ok(false);
                }
            }
            first = false;
            scale = scale.div_ceil(2).min(scale - 1);
        }
        Ok(true)
    }
}

/// Settings of previews: those of the render, or of the path tracer in place of estimators that learn or search before
/// their first sample, or need many samples.
pub(super) fn settings(request: &Request<'_>, path: &Settings) -> Settings {
    use Estimator::{Bdpt, Path, Vcm, VcmNee};
    match request.settings.estimator {
        Path { .. } | Bdpt | Vcm(_) | VcmNee(_) => request.settings.clone(),
        _ => Settings {
            amounts: match request.spec.is_raw() {
                true => Amounts::Raw,
                false => Amounts::Blurred,
            },
            ..path.clone()
        },
    }
}

fn preview(
    viewpoint: &Arc<Viewpoint>,
    run: u64,
    seconds: f64,
    size: UVec2,
    picture: Buffer,
) -> Snapshot {
    Snapshot {
        viewpoint: viewpoint.clone(),
        run,
        preview: true,
        samples: 0,
        seconds,
        size,
        picture,
        maps: Maps::default(),
        flip: None,
    }
}
