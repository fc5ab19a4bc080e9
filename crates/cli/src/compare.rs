//! `opsr compare`: pictures against a reference.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};

use crate::outputs::check_distinct;
use opsr::files;
use opsr::image::{exr, png};
use opsr_lab::report::compare::{Comparison, Named, Options, compare_with, cut_to_common};
use opsr_lab::report::page;
use opsr_lab::stats::agreement;
use opsr_metric::Metric;
use opsr_metric::flip::DEFAULT_PPD;

use super::exit::{Blame, Exit, IntoExit};
use super::output::{note, print};

/// Compare pictures with a reference: MSE, relMSE, MAPE, FLIP and HDR-FLIP.
#[derive(Args, Debug)]
pub(super) struct CompareArgs {
    /// Pictures (.exr, .png, .jpg); the last is the reference
    #[arg(required = true, num_args = 2.., value_name = "PICTURE")]
    files: Vec<PathBuf>,
    /// Compare this layer of EXR files, such as albedo, or Depth for ViewLayer.Depth
    #[arg(long, value_name = "NAME", conflicts_with = "agree")]
    layer: Option<String>,
    /// Write all numbers as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write error maps in false colours (.png) to this folder
    #[arg(long, value_name = "DIR")]
    maps: Option<PathBuf>,
    /// Write one HTML page to flip between the pictures and zoom in
    #[arg(long, value_name = "FILE")]
    page: Option<PathBuf>,
    /// Exposures of the page in stops
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "0",
        allow_hyphen_values = true,
        value_parser = super::options::finite
    )]
    exposures: Vec<f32>,
    /// Exposure of LDR-FLIP in stops
    #[arg(long, default_value_t = 0.0, allow_hyphen_values = true, value_parser = super::options::finite)]
    exposure: f32,
    /// Pixels per degree of visual angle, for FLIP
    #[arg(long, default_value_t = DEFAULT_PPD, value_parser = pixels_per_degree)]
    ppd: f64,
    /// The pictures are renders of one scene with several seeds: separate bias from variance
    #[arg(long)]
    seeds: bool,
    /// Test whether picture and reference agree up to their noise, which both files must hold; exit with code 6 if not
    #[arg(long)]
    agree: bool,
    /// Exit with code 6 if a metric of any picture is above X, such as relMSE=0.01; may be given several times
    #[arg(long, value_name = "METRIC=X", value_parser = bound)]
    fail_above: Vec<(String, f64)>,
}

/// A number of pixels per degree that FLIP accepts.
fn pixels_per_degree(text: &str) -> Result<f64, String> {
    let ppd = text.parse().ok().filter(|x| (1.0..=1000.0).contains(x));
    ppd.ok_or_else(|| "expected a number from 1 to 1000".into())
}

/// A bound such as `relMSE=0.01`.
fn bound(text: &str) -> Result<(String, f64), String> {
    let number = |x: &str| x.trim().parse().ok().filter(|x: &f64| !x.is_nan());
    let parts = text.rsplit_once('=');
    parts
        .and_then(|(name, x)| Some((name.trim().to_owned(), number(x)?)))
        .ok_or_else(|| "expected METRIC=X, such as relMSE=0.01".into())
}

/// Runs the command: the table goes to standard output.
pub(super) fn run(args: &CompareArgs) -> anyhow::Result<Exit> {
    let outputs: Vec<&Path> = [&args.page, &args.json]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    let inputs: Vec<&Path> = args.files.iter().map(PathBuf::as_path).collect();
    check_distinct(outputs, inputs).into_exit()?;
    let layer = args.layer.as_deref();
    let mut pictures = args
        .files
        .iter()
        .map(|f| Named::load_layer(f, layer))
        .collect::<Result<Vec<_>, _>>()
        .input()?;
    let common = cut_to_common(&mut pictures);
    let reference = pictures.pop().context("no reference")?;
    let options = Options {
        ppd: args.ppd,
        exposure: args.exposure,
        seeds: args.seeds,
    };
    // Indicatif draws the bar only on a terminal.
    let bar = ProgressBar::new(pictures.len() as u64);
    let style = ProgressStyle::with_template("comparing {msg}, {pos} of {len}")?;
    bar.set_style(style);
    let begin = |picture: &Named| {
        bar.inc(1);
        bar.set_message(picture.name.clone());
    };
    let compared = compare_with(&pictures, &reference, &options, begin);
    bar.finish_and_clear();
    let mut comparison = compared.input()?;
    if let Some(window) = common {
        (comparison.notes).push(format!("compared: the {window} that all pictures show"));
    }
    let above = above(&comparison, &args.fail_above)?;
    print(comparison.to_string())?;

    let mut same = above.is_empty();
    if args.agree {
        same &= print_agreement(&args.files)?;
    }
    if let Some(path) = &args.json {
        let json = serde_json::to_string_pretty(&comparison)? + "\n";
        files::write_bytes(path, json).output()?;
    }
    if let Some(folder) = &args.maps {
        write_maps(folder, &comparison)?;
    }
    if let Some(path) = &args.page {
        let html = page::page(&comparison, &pictures, &reference, &args.exposures);
        files::write_bytes(path, html).output()?;
    }
    for line in above {
        note(format_args!("opsr: {line}"));
    }
    Ok(if same { Exit::Done } else { Exit::Differ })
}

/// Metrics above their bounds, one line each.
fn above(comparison: &Comparison, bounds: &[(String, f64)]) -> anyhow::Result<Vec<String>> {
    let mut lines = Vec::new();
    for (wanted, most) in bounds {
        let is = |metric: &&Metric| metric.name.eq_ignore_ascii_case(wanted);
        if !comparison.metrics().iter().any(|metric| is(&metric)) {
            let names = comparison.metrics().iter().map(|metric| metric.name);
            let names = names.collect::<Vec<_>>().join(", ");
            let what = anyhow!("--fail-above: no metric `{wanted}` among {names}");
            return Err(what).usage();
        }
        for entry in &comparison.entries {
            for metric in entry.metrics.iter().filter(is) {
                // NaN counts as above the bound.
                if metric.value.is_nan() || metric.value > *most {
                    let Metric { name, value, .. } = metric;
                    lines.push(format!("{}: {name} {value:.6} is above {most}", entry.name));
                }
            }
        }
    }
    Ok(lines)
}

/// Prints the test of every picture; true if all agree with the reference.
fn print_agreement(files: &[PathBuf]) -> anyhow::Result<bool> {
    let mut same = true;
    let Some((reference, pictures)) = files.split_last() else {
        return Ok(same);
    };
    let wanted = exr::read_film(reference).input()?;
    for path in pictures {
        let mut film = exr::read_film(path).input()?;
        let mut wanted = Cow::Borrowed(&wanted);
        let common = film.window.intersection(&wanted.window);
        let differ = film.window != wanted.window && film.size == wanted.size;
        if let Some(common) = common.filter(|_| differ) {
            film = film.cut(common);
            wanted = Cow::Owned(wanted.cut(common));
        }
        let agreement = agreement::agree(&film, &wanted)
            .with_context(|| format!("{} against {}", path.display(), reference.display()))
            .input()?;
        let names = format!("{} against {}", path.display(), reference.display());
        print(format!("\n{names}\n{agreement}\n"))?;
        if agreement.shared {
            let judged = match agreement.mean_known {
                true => {
                    "tiles are not judged, the image by the error that the files state for its mean"
                }
                false => "only the test of single pixels is judged",
            };
            print(format!("pixels share light paths: {judged}\n"))?;
        }
        same &= agreement.passed();
    }
    Ok(same)
}

/// Writes the error maps. File names begin with numbers, because pictures of different folders may share their name.
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
