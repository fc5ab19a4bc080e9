//! One HTML file that shows a comparison: numbers, and pictures to flip between at the same zoom.
//!
//! Everything is inside the file, pictures as data URIs. Without scripts the pictures stand one below the other.

use base64::prelude::{BASE64_STANDARD, Engine as _};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::compare::{Comparison, Entry, Named, definition, number};
use crate::image::{Buffer, png};

/// A page that cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("{picture}: cannot be shown in a page: {reason}")]
pub struct PageError {
    picture: String,
    reason: String,
}

/// What stands in one place of the viewer.
struct Figure {
    picture: String,
    stops: Option<f32>,
    uri: String,
}

/// The page of `comparison`, with pictures shown at `exposures` in stops.
///
/// `pictures` are those the comparison was made of, in its order.
pub fn page(
    comparison: &Comparison,
    pictures: &[Named],
    reference: &Named,
    exposures: &[f32],
) -> Result<String, PageError> {
    let exposures = if exposures.is_empty() {
        &[0.0]
    } else {
        exposures
    };
    let mut figures = Vec::new();
    for named in pictures.iter().chain(std::iter::once(reference)) {
        for &stops in exposures {
            figures.push(figure(
                named.name.clone(),
                Some(stops),
                &named.picture,
                stops,
            )?);
        }
    }
    for entry in &comparison.entries {
        for (map, picture) in entry.false_colours(comparison.size) {
            figures.push(figure(
                format!("{} {map}", entry.name),
                None,
                &picture,
                0.0,
            )?);
        }
    }
    Ok(document(comparison, &figures).into_string())
}

fn figure(
    picture: String,
    stops: Option<f32>,
    pixels: &Buffer,
    exposure: f32,
) -> Result<Figure, PageError> {
    let uri = data_uri(&picture, pixels, exposure)?;
    Ok(Figure {
        picture,
        stops,
        uri,
    })
}

/// A picture as a PNG file inside an address; `name` is for the error.
pub(super) fn data_uri(name: &str, pixels: &Buffer, exposure: f32) -> Result<String, PageError> {
    let bytes = png::encode(pixels, exposure).map_err(|e| PageError {
        picture: name.to_owned(),
        reason: e.to_string(),
    })?;
    Ok(format!(
        "data:image/png;base64,{}",
        BASE64_STANDARD.encode(bytes)
    ))
}

fn document(comparison: &Comparison, figures: &[Figure]) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { "Comparison with " (comparison.reference) }
                style { (PreEscaped(include_str!("page.css"))) }
            }
            body {
                h1 { "Comparison" }
                p {
                    "Reference " code { (comparison.reference) } ", "
                    (comparison.size.0) "×" (comparison.size.1) " pixels."
                }
                (table(comparison))
                (notes(comparison))
                section id="viewer" {
                    h2 { "Pictures" }
                    p.hint hidden { "Digits or arrows flip, the wheel zooms, dragging moves, a double click resets." }
                    div.stage {
                        @for f in figures {
                            figure data-picture=(f.picture) data-stops=[f.stops] {
                                figcaption {
                                    (f.picture)
                                    @if let Some(stops) = f.stops { ", " (stops) " stops" }
                                }
                                img src=(f.uri) alt=(f.picture);
                            }
                        }
                    }
                }
                script { (PreEscaped(include_str!("page.js"))) }
            }
        }
    }
}

fn table(comparison: &Comparison) -> Markup {
    let metrics = comparison.entries.first().map_or(&[][..], |e| &e.metrics);
    html! {
        table {
            thead { tr { th { "" } @for e in &comparison.entries { th { (e.name) } } } }
            tbody {
                @for (i, metric) in metrics.iter().enumerate() {
                    tr {
                        th title=(definition(metric)) { (metric.name) }
                        @for e in &comparison.entries {
                            td.best[is_best(&comparison.entries, e, i)] { (number(e.metrics[i].value)) }
                        }
                    }
                }
                tr {
                    th { "worst pixel" }
                    @for e in &comparison.entries { td { "(" (e.worst.x) ", " (e.worst.y) ")" } }
                }
            }
        }
    }
}

/// Whether an entry has the smallest error of several; a ratio has its best at 1.
fn is_best(entries: &[Entry], entry: &Entry, metric: usize) -> bool {
    let error = |e: &Entry| {
        let m = &e.metrics[metric];
        if m.name == "energy ratio" {
            (m.value - 1.0).abs()
        } else {
            m.value
        }
    };
    entries.len() > 1 && entries.iter().all(|other| error(entry) <= error(other))
}

fn notes(comparison: &Comparison) -> Markup {
    let metrics = comparison.entries.first().map_or(&[][..], |e| &e.metrics);
    html! {
        @if let Some(seeds) = &comparison.seeds {
            h2 { "Over " (seeds.renders) " renders" }
            table {
                @for m in [
                    &seeds.bias_squared, &seeds.variance,
                    &seeds.relative_bias_squared, &seeds.relative_variance,
                ] {
                    tr { th title=(definition(m)) { (m.name) } td { (number(m.value)) } }
                }
            }
        }
        details {
            summary { "Formulas" }
            ul { @for m in metrics { li { (definition(m)) } } }
            p { "I is the picture, f the reference; means are over pixels and channels." }
        }
        @for note in &comparison.notes { p { (note) } }
    }
}
