//! `opsr convert`: a scene as one binary glTF file.

use super::exit::Blame;
use anyhow::anyhow;
use opsr::render::Spec;
use opsr::scene::load::Unsupported;
use opsr_lab::gallery::{glb, lowered};
use std::path::PathBuf;

/// Options of `opsr convert`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The scene: glTF (.gltf or .glb), pbrt-v4 (.pbrt), Mitsuba (.xml), OBJ or PLY.
    scene: PathBuf,
    /// File to write (.glb).
    #[arg(short, long, value_name = "FILE", default_value = "out.glb")]
    output: PathBuf,
    /// Treatment of parts that are not supported, or that glTF cannot hold: `skip` leaves them out and lists them.
    #[arg(long, value_enum, default_value_t)]
    unsupported: Unsupported,
}

/// Runs the command.
pub(super) fn run(args: &Args) -> anyhow::Result<()> {
    let path = args.scene.display();
    if args.output.extension().is_none_or(|e| e != "glb") {
        let what = anyhow!(
            "{}: expected a name that ends in .glb",
            args.output.display()
        );
        return Err(what).usage();
    }
    let spec = Spec {
        unsupported: Some(args.unsupported),
        ..Spec::default()
    };
    let loaded =
        opsr::scene::load::load(&args.scene, &spec.load_options(opsr_formats::FORMATS)).input()?;
    if loaded.files.contains(&args.output) {
        return Err(anyhow!(
            "{}: is read and would be replaced",
            args.output.display()
        ))
        .usage();
    }
    let made = lowered::lowered(loaded.parts);
    if !made.lost.is_empty() && args.unsupported != Unsupported::Skip {
        let what = made.lost.join(", ");
        let what = anyhow!(
            "{path}: glTF files of this program cannot hold {what}; --unsupported skip leaves them out"
        );
        return Err(what).input();
    }
    for line in loaded.warnings.iter().chain(&made.changed) {
        tracing::warn!("{path}: {line}");
    }
    for line in &made.lost {
        tracing::warn!("{path}: left out: {line}");
    }
    glb::save(&made.parts, &args.output)
        .map_err(|e| anyhow!("{e}"))
        .output()
}
