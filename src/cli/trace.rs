//! `opsr render --trace-pixel`: the paths of a pixel, in words.

use super::output::print;
use super::render_args::RenderArgs;
use super::{Blame, job};
use anyhow::{Context, anyhow};
use opsr::integrator::trace::{TracedPath, trace};
use opsr::integrator::{Estimator, Settings, View};
use opsr::math::Rgb;
use opsr::scene::Scene;
use std::fmt::Write;

/// Samples that are printed unless others are asked for.
const SAMPLES: u32 = 4;

/// Prints the paths of the pixel.
pub(super) fn run(
    args: &RenderArgs,
    settings: &Settings,
    view: &View<'_>,
    pixel: job::Pixel,
) -> anyhow::Result<()> {
    if !matches!(settings.estimator, Estimator::Path { .. }) || !settings.levels.is_empty() {
        let what = "--trace-pixel is for the path tracer with one level";
        return Err(anyhow!(what)).usage();
    }
    let samples = match args.sample {
        Some(sample) => sample..sample.saturating_add(1),
        None => 0..args.spp.unwrap_or(SAMPLES),
    };
    let paths = trace(settings, view, pixel.0, samples)
        .context("--trace-pixel")
        .usage()?;
    paths
        .iter()
        .try_for_each(|path| print(described(path, view.scene, pixel)))
}

fn described(path: &TracedPath, scene: &Scene, job::Pixel(pixel): job::Pixel) -> String {
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
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "  {}  {} `{name}` (mesh {}) at {}, distance {}\n     alpha {} -> {}{class}, throughput {}, light {}, {end}",
            i + 1,
            v.bsdf,
            v.mesh + 1,
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
        .map(|x| opsr::report::compare::number(x.into()));
    format!("({x} {y} {z})")
}
