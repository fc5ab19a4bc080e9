//! `opsr trace`: the paths of a pixel as text.

use super::exit::{Blame, IntoExit};
use super::options::{MORE, Pixel, TraceOptions, pixel};
use super::output::print;
use super::render::{open, request};
use anyhow::anyhow;
use opsr::image::film::Window;
use opsr::integrator::method::IntegratorKind;
use opsr::integrator::trace::{TracedPath, trace};
use opsr::integrator::{Estimator, View};
use opsr::math::Rgb;
use opsr::render::value::ResolveChoice;
use opsr::scene::Scene;
use std::fmt::Write;
use std::path::PathBuf;

/// Default number of printed samples.
const SAMPLES: u32 = 4;

/// Options of `opsr trace`.
#[derive(Debug, clap::Args)]
#[command(after_help = MORE, after_long_help = EXAMPLES)]
pub(super) struct TraceArgs {
    /// The scene: glTF 2.0 (.gltf or .glb), pbrt-v4 (.pbrt), Mitsuba (.xml), OBJ or PLY.
    scene: PathBuf,
    /// The pixel, from the top left.
    #[arg(value_name = "X,Y", value_parser = pixel)]
    pixel: Pixel,
    /// Print only the path of this sample (from 0).
    ///
    /// By default the paths of the first samples: as many as --spp gives, or 4.
    #[arg(long, value_name = "N")]
    sample: Option<u32>,
    #[command(flatten)]
    render: TraceOptions,
}

const EXAMPLES: &str = "The paths are those of --integrator path --resolve raw; at smooth glass each follows one way, a render both.

Examples:
  opsr trace scene.glb 200,150
  opsr trace scene.glb 200,150 --sample 17 --opsr-table beta-0.001";

/// Runs `opsr trace`.
pub(super) fn run(args: &TraceArgs) -> anyhow::Result<()> {
    let pixel = args.pixel;
    let mut spec = args.render.0.clone();
    // Path tracing by default: only its paths belong to one pixel.
    spec.integrator.get_or_insert(IntegratorKind::Path);
    if spec.levels.is_none() {
        spec.resolve.get_or_insert(ResolveChoice::Raw);
    }
    spec.check().into_exit()?;
    let opened = open(&args.scene, &mut spec)?;
    let name = args.scene.display().to_string();
    let request = &request(&spec, &opened, &name)?;
    let settings = &request.settings;
    let path = matches!(settings.estimator, Estimator::Path { .. });
    if request.spec.kind() != request.kind || !path || settings.amounts.films() > 1 {
        let what = "a trace shows paths of --integrator path with one level";
        return Err(anyhow!(what)).usage();
    }
    let samples = match args.sample {
        Some(sample) => sample..sample.saturating_add(1),
        None => 0..request.spec.spp.unwrap_or(SAMPLES),
    };
    let (frame, scene) = (request.frame, request.subject.scene);
    let view = View::new(scene, &request.camera, frame, Window::full(frame));
    let paths = trace(settings, &view, pixel.0, samples).usage()?;
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

/// A colour with six significant digits.
pub(super) fn rgb(x: Rgb) -> String {
    let [x, y, z] = x
        .to_array()
        .map(|x| opsr_lab::report::compare::number(x.into()));
    format!("({x} {y} {z})")
}
