//! `opsr render --trace-pixel`: the paths of a pixel, in words.

use super::exit::Blame;
use super::options::Pixel;
use super::output::print;
use super::render_args::RenderArgs;
use anyhow::{Context, anyhow};
use opsr::image::film::Window;
use opsr::integrator::trace::{TracedPath, trace};
use opsr::integrator::{Estimator, View};
use opsr::math::Rgb;
use opsr::render::Request;
use opsr::scene::Scene;
use std::fmt::Write;

/// Samples that are printed unless others are asked for.
const SAMPLES: u32 = 4;

/// Prints the paths of the pixel.
pub(super) fn run(args: &RenderArgs, request: &Request<'_>, pixel: Pixel) -> anyhow::Result<()> {
    let settings = &request.settings;
    let path = matches!(settings.estimator, Estimator::Path { .. });
    let auto = request.spec.kind() != request.kind;
    if auto || !path || settings.amounts.has_choice() {
        let what = "--trace-pixel is for the path tracer with one level, not for --integrator auto";
        return Err(anyhow!(what)).usage();
    }
    let samples = match args.sample {
        Some(sample) => sample..sample.saturating_add(1),
        None => 0..request.spec.spp.unwrap_or(SAMPLES),
    };
    let (frame, scene) = (request.frame, request.subject.scene);
    let view = View::new(scene, &request.camera, frame, Window::full(frame));
    let paths = trace(settings, &view, pixel.0, samples)
        .context("--trace-pixel")
        .usage()?;
    paths
        .iter()
        .try_for_each(|path| print(described(path, scene, pixel)))
}

fn described(path: &TracedPath, scene: &Scene, Pixel(pixel): Pixel) -> String {
    let mut text = format!(
        "pixel {},{} sample {}: radiance {}, {} straight from emitters\n",
        pixel.x,
        pixel.y,
        path.sample,
        rgb(path.radiance),
        rgb(path.emission)
    );
    for (i, v) in path.vertices.iter().enumerate() {
        let class = v.class.map_or(String::new(), |class| {
            let bins = class
                .bins()
                .iter()
                .map(usize::to_string)
                .collect::<Vec<_>>();
            format!(", class {} ({})", class.index(), bins.join(" "))
        });
        let name = &scene.parts().materials[v.material as usize].name;
        let end = v.lobe.map_or("ends".to_owned(), |lobe| {
            format!("continues by {lobe:?}").to_lowercase()
        });
        let mesh = (v.mesh).map_or(String::new(), |mesh| format!(" (mesh {})", mesh + 1));
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "  {}  {} `{name}`{mesh} at {}, distance {}\n     alpha {} -> {}{class}, throughput {}, light {}, {end}",
            i + 1,
            v.bsdf,
            rgb(v.position),
            v.distance,
            v.alpha,
            v.alpha_reg,
            rgb(v.throughput),
            rgb(v.light),
        );
    }
    text
}

/// Three numbers for people.
pub(super) fn rgb(x: Rgb) -> String {
    let [x, y, z] = x
        .to_array()
        .map(|x| opsr_lab::report::compare::number(x.into()));
    format!("({x} {y} {z})")
}
