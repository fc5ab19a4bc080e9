//! The end of a render: the closing line, warnings, and statistics for programs.

use super::bar::Style;
use super::info;
use super::listener::Saved;
use super::output::{command, note, percent};
use super::render_args::RenderArgs;
use crate::outputs::Outputs;
use opsr::image::film::{Film, Window};
use opsr::integrator::drive::RenderProgress;
use opsr::integrator::{View, centre};
use opsr::math::{Rgb, UVec2};
use opsr::render::Request;
use opsr::render::open::Opened;
use opsr::resolve::Statement;

/// A render that has ended.
pub(super) struct FinishedRender<'a> {
    pub(super) args: &'a RenderArgs,
    pub(super) request: &'a Request<'a>,
    pub(super) opened: &'a Opened,
    pub(super) progress: RenderProgress,
    /// Samples of earlier runs, which the time of this run does not include.
    pub(super) start: u32,
    /// Seconds of earlier runs.
    pub(super) spent: f64,
    pub(super) saved: &'a Saved,
}

impl FinishedRender<'_> {
    fn film(&self) -> &Film {
        &self.saved.finished.outcome.picture.film
    }

    /// Number of paths of this run.
    fn paths(&self) -> u64 {
        u64::from(self.progress.samples - self.start) * self.film().pixels.len() as u64
    }

    fn seconds(&self) -> f64 {
        self.progress.elapsed.as_secs_f64()
    }

    /// The closing line: the written files and the statistics of the render.
    fn summary(&self, outputs: &Outputs) -> String {
        let (finished, names) = (&self.saved.finished, outputs.names());
        let seconds = self.seconds();
        let rate = match self.paths() {
            0 if self.progress.samples == 0 => "a part of the first sample".to_owned(),
            0 => "no new samples: the checkpoint has at least that many".to_owned(),
            paths => format!("{:.3} million paths/s", paths as f64 / seconds / 1e6),
        };
        let exposure = match outputs.has_png() {
            true => format!(", exposure {:+}", exposure(finished)),
            false => String::new(),
        };
        let camera = match self.opened.scene.parts().cameras.is_empty() {
            true => format!(
                ", {}, since the file has no camera",
                self.request.camera.name
            ),
            false => String::new(),
        };
        let light = match self.opened.light_chosen() {
            none if none.is_empty() => none,
            light => format!(", {light}"),
        };
        let mut error = average_error(&finished.statement());
        if let Some(mean) = finished.mean_error() {
            error += &format!(", mean ± {:.2} %", 100.0 * mean);
        }
        let unseen = self.saved.unseen;
        if unseen >= 0.0005 {
            let percent = 100.0 * unseen;
            error += &format!(", {percent:.1} % of the light found by roughened lobes alone");
        }
        if let Some(missing) = &finished.outcome.missing {
            error += &format!(", {missing}");
        }
        let truth = self.saved.true_error;
        let truth = truth.map_or(String::new(), |e| format!(", true error {}", percent(e)));
        let Window { w, h, .. } = self.film().window;
        let spp = self.progress.samples;
        format!(
            "{names}: {w}x{h}{exposure}{camera}{light}, {spp} spp in {seconds:.2} s, {rate}{error}{truth}"
        )
    }

    /// Reports the written files and the statistics of the render, unused features, and rejected samples.
    pub(super) fn report(&self, outputs: &Outputs) {
        let summary = self.summary(outputs);
        match self.args.program.progress {
            Style::Auto => note(summary),
            Style::Json | Style::None => tracing::info!("{summary}"),
        }
        for line in info::unused(&self.opened.scene, &self.request.settings.rule) {
            tracing::info!("{line}");
        }
        let clipped = self.film().clipped_variances();
        if clipped > 0 {
            tracing::warn!(
                "{clipped} pixels have a variance above {:e}, which is written in its place: the light is too strong for \
                 error estimates in single precision",
                f32::MAX
            );
        }
        let shown = &self.saved.finished.shown.picture;
        let black = shown.pixels.iter().all(|p| *p == Rgb::ZERO);
        if black && !self.opened.scene.lights().is_empty() {
            let why = match sees_a_surface(&self.request.view()) {
                true => {
                    "no path has found light; `opsr info` names an integrator for the scene's lights and materials"
                }
                false => "the camera sees no surface; --camera chooses another view",
            };
            tracing::warn!("the picture is black: {why}");
        }
        let rejected = &self.film().rejected;
        if rejected.total() > 0 {
            tracing::warn!(
                "{} samples were refused ({} not a number, {} infinite)",
                rejected.total(),
                rejected.nan,
                rejected.infinite,
            );
            for first in &rejected.first {
                // With the earlier samples of its pixel.
                let (command, [x, y]) = (self.request.command(), first.pixel.to_array());
                let end = first.sample.saturating_add(1);
                tracing::warn!("to see one again: {command} --crop {x},{y},1,1 --spp {end}");
            }
        }
    }

    /// Statistics for programs.
    pub(super) fn statistics(&self, outputs: &Outputs) -> serde_json::Value {
        let (film, seconds) = (self.film(), self.seconds());
        let finished = &self.saved.finished;
        let scene = &self.opened.scene;
        let settings = self.request.choices().into_iter();
        let settings = settings.map(|(key, value)| (key.to_owned(), value.into()));
        let Window { x, y, w, h } = film.window;
        let finite = |x: f64| x.is_finite().then_some(x);
        let stated = finished.statement();
        serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "command": command(),
            "settings": serde_json::Map::from_iter(settings),
            "seed": self.request.settings.seed,
            "files": self.args.output,
            "scene": {
                "file": self.request.subject.name,
                "sha256": self.opened.sha256,
                "triangles": scene.geometry().triangle_count(),
                "emissive_triangles": scene.lights().emissive_triangles(),
                "materials": scene.parts().materials.len(),
            },
            "camera": self.request.camera.name,
            "frame": [film.size.x, film.size.y],
            "window": [x, y, w, h],
            "threads": rayon::current_num_threads(),
            "spp": self.progress.samples,
            "seconds": seconds,
            "seconds_of_earlier_runs": self.spent,
            "paths": self.paths(),
            "paths_per_second": finite(self.paths() as f64 / seconds),
            "mean_relative_error": finite(stated.mean),
            "relative_error": finite(stated.root),
            "mean_error": finished.mean_error().and_then(finite),
            "light_missing": finished.outcome.missing.as_ref().map(|m| {
                serde_json::json!({ "share": m.share, "pixel": m.pixel.to_array(), "finder": m.finder.to_string() })
            }),
            "true_error": self.saved.true_error.and_then(finite),
            "exposure": outputs.has_png().then(|| exposure(finished)),
            "refused": { "nan": film.rejected.nan, "infinite": film.rejected.infinite },
            "clipped_variances": film.clipped_variances(),
        })
    }
}

/// The average error for a closing line; empty with too few samples for an estimate.
pub(super) fn average_error(statement: &Statement) -> String {
    match statement.mean {
        mean if mean.is_finite() => format!(", average error {}", percent(mean)),
        _ => String::new(),
    }
}

/// True if a surface is visible at one of a grid of pixels, 32 along the longer side.
fn sees_a_surface(view: &View<'_>) -> bool {
    let Window { x, y, w, h } = view.window;
    let step = (w.max(h) / 32).max(1) as usize;
    let rows = (y..y + h).step_by(step);
    let mut pixels = rows.flat_map(|y| (x..x + w).step_by(step).map(move |x| UVec2::new(x, y)));
    pixels.any(|pixel| centre(view, pixel).is_some())
}

/// Exposure of PNG files in stops.
fn exposure(finished: &opsr::Finished<'_>) -> f32 {
    let outcome = &finished.outcome;
    let display = outcome
        .spec
        .display(&finished.shown.picture, outcome.in_studio);
    display.exposure
}
