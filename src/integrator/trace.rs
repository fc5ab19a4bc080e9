//! Single paths of a render, vertex by vertex, to find the cause of a pixel's value.

use super::walk::observer::{PathObserver, Recorder};
use super::{Settings, ShadingPoint, View};
use crate::bsdf::Lobe;
use crate::image::film::{Film, FilmError, Window};
use crate::math::{Rgb, UVec2, Vec3};
use crate::regularise::{Accumulated, AccumulatedPath, GammaIndex, Roughening, Rule, Scattered};
use std::ops::Range;

/// A sample's path, vertex by vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TracedPath {
    /// Number of the sample in its pixel.
    pub sample: u32,
    /// Radiance that arrives at the camera: a sample of the pixel, that of a raw render if no smooth glass is hit.
    pub radiance: Rgb,
    /// Its part that comes straight from emitters and the environment.
    pub emission: Rgb,
    /// Vertices, camera first.
    pub vertices: Vec<TracedVertex>,
}

/// A vertex of a path.
#[derive(Clone, Debug, PartialEq)]
pub struct TracedVertex {
    /// World position.
    pub position: Vec3,
    /// Distance from the vertex before.
    pub distance: f32,
    /// Index of the mesh; `None` in a medium.
    pub mesh: Option<u32>,
    /// Index of the material.
    pub material: u32,
    /// BSDF that was drawn there.
    pub bsdf: &'static str,
    /// Throughput before the vertex.
    pub throughput: Rgb,
    /// The BSDF's own roughness α.
    pub alpha: f32,
    /// Roughness α′ at next-event estimation.
    pub alpha_reg: f32,
    /// Class of the path that ends here, for a rule with factors.
    pub class: Option<GammaIndex>,
    /// Part of the radiance that was scattered here last.
    pub light: Rgb,
    /// Lobe in which the path continues.
    pub lobe: Option<Lobe>,
}

/// Traces the samples with these numbers of a pixel, with the random numbers and the arithmetic of the path tracer,
/// each along one drawn way through glass.
///
/// Fails for a pixel outside of the frame.
pub fn trace(
    settings: &Settings,
    view: &View<'_>,
    pixel: UVec2,
    samples: Range<u32>,
) -> Result<Vec<TracedPath>, FilmError> {
    let frame = view.sensor.frame;
    let [x, y] = pixel.to_array();
    let window = Window { x, y, w: 1, h: 1 };
    let mut film = Film::cropped(frame, window)?;
    let view = View { window, ..*view };
    let source = settings.source();
    let rule = match &settings.rule {
        Rule::Accumulated(rule) => Some(rule),
        _ => None,
    };
    let mut tracer = Tracer {
        rule,
        memory: None,
        paths: Vec::new(),
    };
    let path_tracer = settings.tracer(settings.rule.clone());
    path_tracer.estimate(&view, &source, samples, &mut film, &mut tracer);
    Ok(tracer.paths)
}

/// Records whole paths.
struct Tracer<'a> {
    rule: Option<&'a Accumulated>,
    memory: Option<AccumulatedPath>,
    paths: Vec<TracedPath>,
}

impl Tracer<'_> {
    fn vertex(&mut self) -> Option<&mut TracedVertex> {
        self.paths.last_mut()?.vertices.last_mut()
    }
}

impl PathObserver for Tracer<'_> {
    fn begin(&mut self, _: UVec2, sample: u32) {
        self.memory = self.rule.map(|rule| rule.start(sample));
        self.paths.push(TracedPath {
            sample,
            ..TracedPath::default()
        });
    }

    fn vertex(&mut self, _: u32, distance: f32, point: &ShadingPoint<'_>) {
        let class = (self.memory).and_then(|memory| memory.roughness().class(point.alpha));
        let vertex = TracedVertex {
            position: point.surface.position,
            distance,
            mesh: (!point.surface.is_in_medium())
                .then(|| (point.scene.geometry()).triangle_mesh(point.surface.triangle)),
            material: point.surface.material,
            bsdf: point.bsdf.name(),
            throughput: point.throughput,
            alpha: point.alpha,
            alpha_reg: point.alpha_reg,
            class,
            light: Rgb::ZERO,
            lobe: None,
        };
        if let Some(path) = self.paths.last_mut() {
            path.vertices.push(vertex);
        }
    }

    fn light(&mut self, scatterings: u32, value: Rgb) {
        let Some(path) = self.paths.last_mut() else {
            return;
        };
        match scatterings.checked_sub(1) {
            None => path.emission += value,
            Some(i) => (path.vertices.get_mut(i as usize))
                .into_iter()
                .for_each(|v| v.light += value),
        }
    }

    fn sampled(&mut self, lobe: Lobe) {
        (self.vertex())
            .into_iter()
            .for_each(|vertex| vertex.lobe = Some(lobe));
    }

    fn scattered(&mut self, alpha: f32) {
        if let Some((rule, memory)) = self.rule.zip(self.memory.as_mut()) {
            // The rules with factors do not use the density.
            rule.scatter(memory, Scattered { alpha, pdf_w: 1.0 });
        }
    }

    fn finish(&mut self, radiance: Rgb) {
        if let Some(path) = self.paths.last_mut() {
            path.radiance = radiance;
        }
    }
}

impl Recorder for Tracer<'_> {
    fn fork(&self) -> Self {
        Self {
            rule: self.rule,
            memory: None,
            paths: Vec::new(),
        }
    }

    fn join(&mut self, tile: Self) {
        self.paths.extend(tile.paths);
    }
}
