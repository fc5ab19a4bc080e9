//! `opsr compare`: pictures against a reference.

use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;

use opsr::files;
use opsr::image::metric::flip::DEFAULT_PPD;
use opsr::image::{exr, png};
use opsr::report::compare::{Comparison, Named, Options, compare};
use opsr::report::page;
use opsr::stats::agreement;

use super::Blame;
use super::output::print;

/// Compare pictures with a reference: MSE, relMSE, MAPE, FLIP and HDR-FLIP.
#[derive(Args, Debug)]
pub(super) struct CompareArgs {
    /// Pictures (.exr, .png, .jpg); the last is the reference
    #[arg(required = true, num_args = 2.., value_name = "PICTURE")]
    files: Vec<PathBuf>,
    /// Write all numbers as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write error maps in false colours (.png) to this folder
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// Write one HTML file to flip and zoom between the pictures
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Exposures of the page in stops
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "0",
        allow_hyphen_values = true,
        value_parser = super::scene::finite
    )]
    exposures: Vec<f32>,
    /// Exposure of LDR-FLIP in stops
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true, value_parser = super::scene::finite)]
    exposure: f32,
    /// Pixels per degree of sight, for FLIP
    #[arg(long, default_value_t = DEFAULT_PPD)]
    ppd: f64,
    /// The pictures are renders of one scene with several seeds: tell bias and variance apart
    #[arg(long)]
    seeds: bool,
    /// Test whether picture and reference agree up to their noise, which both files must hold
    #[arg(long)]
    agree: bool,
}

/// Runs the command: the table goes to standard output.
pub(super) fn run(args: &CompareArgs) -> anyhow::Result<()> {
    let mut pictures = args
        .files
        .iter()
        .map(|f| Named::load(f))
        .collect::<Result<Vec<_>, _>>()
        .input()?;
    let reference = pictures.pop().context("no reference")?;
    let options = Options {
        ppd: args.ppd,
        exposure: args.exposure,
        seeds: args.seeds,
    };
    let comparison = compare(&pictures, &reference, &options).input()?;
    print(comparison.to_string())?;

    if args.agree {
        print_agreement(&args.files)?;
    }
    if let Some(path) = &args.json {
        let json = serde_json::to_string_pretty(&comparison)? + "\n";
        files::write_bytes(path, json).output()?;
    }
    if let Some(folder) = &args.maps {
        write_maps(folder, &comparison)?;
    }
    if let Some(path) = &args.page {
        let html = page::page(&comparison, &pictures, &reference, &args.exposures)?;
        files::write_bytes(path, html).output()?;
    }
    Ok(())
}

fn print_agreement(files: &[PathBuf]) -> anyhow::Result<()> {
    let Some((reference, pictures)) = files.split_last() else {
        return Ok(());
    };
    let wanted = exr::read_film(reference).input()?;
    for path in pictures {
        let agreement = agreement::agree(&exr::read_film(path).input()?, &wanted)
            .with_context(|| format!("{} against {}", path.display(), reference.display()))
            .input()?;
        let names = format!("{} against {}", path.display(), reference.display());
        print(format!("\n{names}\n{agreement}\n"))?;
    }
    Ok(())
}

/// Files are numbered, since pictures of different folders may share their name.
fn write_maps(folder: &Path, comparison: &Comparison) -> anyhow::Result<()> {
    files::create_folder(folder).output()?;
    for (i, entry) in comparison.entries.iter().enumerate() {
        let stem = Path::new(&entry.name)
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy();
        for (map, picture) in entry.false_colours(comparison.size) {
            let path = folder.join(format!("{}-{stem}-{map}.png", i + 1));
            png::write(&path, &picture, 0.0).output()?;
        }
    }
    Ok(())
}
