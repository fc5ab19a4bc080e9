//! Comparisons as numbers, text and page.

use opsr::image::exr::{self, Metadata};
use opsr::image::{Buffer, png};
use opsr::math::{Rgb, UVec2};
use opsr_lab::report::compare::{Comparison, Named, Options, compare, compare_with};
use opsr_lab::report::page;

use crate::support::draws::noise;

fn shade(x: usize, y: usize) -> Rgb {
    Rgb::new(0.1 + 0.1 * x as f32, 0.2 + 0.05 * y as f32, 1.5)
}

fn named(name: &str, f: impl Fn(usize, usize) -> Rgb) -> Named {
    Named::new(name, Buffer::from_fn(24, 16, f), true)
}

fn noisy(name: &str, seed: u32, amount: f32) -> Named {
    named(name, |x, y| {
        shade(x, y) * (1.0 + amount * (noise(UVec2::new(x as u32, y as u32), 0, seed) - 0.5))
    })
}

fn value(c: &Comparison, entry: usize, metric: &str) -> f64 {
    c.entries[entry]
        .metrics
        .iter()
        .find(|m| m.name == metric)
        .unwrap()
        .value
}

#[test]
fn comparison_ranks_the_better_picture_first() {
    let pictures = [noisy("good.exr", 1, 0.2), noisy("bad <&>.exr", 2, 1.0)];
    let reference = named("reference.exr", shade);
    let c = compare(&pictures, &reference, &Options::default()).unwrap();
    for metric in [
        "MSE",
        "RMSE",
        "relMSE",
        "relMSE trimmed",
        "MAPE",
        "SMAPE",
        "FLIP",
        "HDR-FLIP",
    ] {
        let (good, bad) = (value(&c, 0, metric), value(&c, 1, metric));
        assert!(0.0 < good && good < bad, "{metric}: {good} and {bad}");
    }
    assert!(c.notes.is_empty() && c.seeds.is_none());

    let text = c.to_string();
    let widths: Vec<usize> = text
        .lines()
        .skip(2)
        .take(10)
        .map(|l| l.chars().count())
        .collect();
    assert!(
        widths.windows(2).all(|w| w[0] == w[1]),
        "not aligned:\n{text}"
    );
    assert!(
        text.contains("relMSE: mean (I − f)² / (f² + ε); ε = 0.01"),
        "{text}"
    );
    assert!(text.contains("ppd = 67"), "{text}");

    let json = serde_json::to_value(&c).unwrap();
    assert_eq!(json["entries"][1]["metrics"][2]["name"], "relMSE");
    assert_eq!(json["entries"][1]["metrics"][2]["constants"]["ε"], 0.01);
    assert!(json["entries"][0]["worst"]["x"].is_u64());
}

/// Large pictures take seconds each, so each is announced.
#[test]
fn comparison_names_each_picture_before_it_begins() {
    let pictures = [noisy("a.exr", 1, 0.2), noisy("b.exr", 2, 1.0)];
    let reference = named("reference.exr", shade);
    let mut begun = Vec::new();
    let options = Options::default();
    let c = compare_with(&pictures, &reference, &options, |p| {
        begun.push(p.name.clone())
    });
    let done: Vec<_> = c.unwrap().entries.into_iter().map(|e| e.name).collect();
    assert_eq!(begun, done);
}

#[test]
fn comparison_page_is_self_contained() {
    let pictures = [noisy("good.exr", 1, 0.2), noisy("bad <&>.exr", 2, 1.0)];
    let reference = named("reference.exr", shade);
    let c = compare(&pictures, &reference, &Options::default()).unwrap();
    let html = page::page(&c, &pictures, &reference, &[-1.0, 0.0]);
    assert_eq!(
        html.matches("<figure").count(),
        3 * 2 + 2 * 3,
        "exposures of pictures, maps of two"
    );
    assert_eq!(
        html.matches("<img src=\"data:image/png;base64,").count(),
        12
    );
    assert!(
        !html.contains("http") && !html.contains("bad <&>"),
        "nothing from outside, names escaped"
    );
    assert!(html.contains("bad &lt;&amp;&gt;.exr"));
    assert_eq!(html, page::page(&c, &pictures, &reference, &[-1.0, 0.0]));
}

#[test]
fn comparison_splits_bias_and_variance_over_seeds() {
    let reference = named("reference.exr", shade);
    let pictures: Vec<Named> = (0..4).map(|s| noisy("render.exr", s, 0.5)).collect();
    let options = Options {
        seeds: true,
        ..Options::default()
    };
    let seeds = compare(&pictures, &reference, &options)
        .unwrap()
        .seeds
        .unwrap();
    let (bias, variance) = (
        seeds.relative_bias_squared.value,
        seeds.relative_variance.value,
    );
    // Uniform noise of width ½ has the variance 1/48, slightly less because of ε, and no bias.
    assert!((variance * 48.0 - 0.93).abs() < 0.1, "{variance}");
    assert!(bias.abs() < 0.05 * variance, "{bias}");
    let text = compare(&pictures, &reference, &options)
        .unwrap()
        .to_string();
    assert!(
        text.contains("over 4 renders") && text.contains("rel. bias²"),
        "{text}"
    );
}

#[test]
fn comparison_errors_name_the_file() {
    let reference = named("reference.exr", shade);
    let mut bad = named("bad.exr", shade);
    bad.picture.pixels[24 + 3].x = f32::NAN;
    let error = compare(&[bad], &reference, &Options::default()).unwrap_err();
    let text = format!("{:#}", anyhow::Error::new(error));
    assert!(
        text.contains("bad.exr") && text.contains("(3, 1)"),
        "{text}"
    );

    let small = Named::new("small.exr", Buffer::filled(3, 3, Rgb::ONE), true);
    let error = compare(&[small], &reference, &Options::default())
        .unwrap_err()
        .to_string();
    assert!(error.contains("3x3") && error.contains("24x16"), "{error}");

    let black = named("black.exr", |_, _| Rgb::ZERO);
    let c = compare(
        std::slice::from_ref(&reference),
        &black,
        &Options::default(),
    )
    .unwrap();
    assert!(c.notes[0].contains("black"), "{:?}", c.notes);
    assert!(c.to_string().contains("inf"), "{c}");
}

#[test]
fn pictures_are_read_by_their_extension() {
    let folder = tempfile::tempdir().unwrap();
    let reference = named("reference", shade);
    let (a, b, c) = (
        folder.path().join("a.exr"),
        folder.path().join("b.PNG"),
        folder.path().join("c.tiff"),
    );
    exr::write_rgb(&a, &reference.picture, &Metadata::new()).unwrap();
    png::write(&b, &reference.picture, 0.0).unwrap();
    let (a, b) = (Named::load(&a).unwrap(), Named::load(&b).unwrap());
    assert!(a.hdr && !b.hdr && a.picture == reference.picture);
    assert!(Named::load(&c).unwrap_err().to_string().contains("c.tiff"));
    for ending in ["exr", "png"] {
        let missing = folder.path().join("missing").with_extension(ending);
        let text = format!(
            "{:#}",
            anyhow::Error::new(Named::load(&missing).unwrap_err())
        );
        assert_eq!(text.matches("No such file").count(), 1, "{text}");
    }
    let mixed = compare(&[a], &b, &Options::default()).unwrap();
    assert!(mixed.notes[0].contains("HDR-FLIP"));
    assert_eq!(mixed.entries[0].metrics.len(), 9);
}
