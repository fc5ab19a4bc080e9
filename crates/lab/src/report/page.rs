//! The page of a comparison: numbers, and pictures to alternate between at the same zoom.
//!
//! Without scripts the pictures stand one below the other.

use maud::{Markup, PreEscaped, html};

use super::compare::{Comparison, Named, PictureErrors, definition, number};
use super::html::{self, data_uri};

/// One picture of the viewer.
struct Figure {
    picture: String,
    stops: Option<f32>,
    uri: String,
}

/// The page of `comparison`, with pictures shown at `exposures` in stops.
///
/// `pictures` are those of the comparison, in its order.
pub fn page(
    comparison: &Comparison,
    pictures: &[Named],
    reference: &Named,
    exposures: &[f32],
) -> String {
    let exposures = if exposures.is_empty() {
        &[0.0]
    } else {
        exposures
    };
    let shown = |named: &Named, stops: f32| Figure {
        picture: named.name.clone(),
        stops: Some(stops),
        uri: data_uri(&named.picture, stops),
    };
    let mut figures: Vec<Figure> = (pictures.iter().chain([reference]))
        .flat_map(|named| exposures.iter().map(move |&stops| shown(named, stops)))
        .collect();
    for entry in &comparison.entries {
        for (map, picture) in entry.false_colours(comparison.size) {
            figures.push(Figure {
                picture: format!("{} {map}", entry.name),
                stops: None,
                uri: data_uri(&picture, 0.0),
            });
        }
    }
    let body = html! {
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
                @for f in &figures {
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
        script { (PreEscaped(include_str!("viewer.js"))) }
    };
    html::page("Comparison", &body)
}

fn table(comparison: &Comparison) -> Markup {
    let entries = &comparison.entries;
    let metrics = comparison.metrics().iter().enumerate().map(|(i, metric)| {
        html! {
            th title=(definition(metric)) { (metric.name) }
            @for e in entries { td.best[is_best(entries, e, i)] { (number(e.metrics[i].value)) } }
        }
    });
    let worst = html! {
        th { "worst pixel" }
        @for e in entries { td { "(" (e.worst.x) ", " (e.worst.y) ")" } }
    };
    let heads = [""]
        .into_iter()
        .chain(entries.iter().map(|e| e.name.as_str()));
    html::table("", heads, metrics.chain([worst]))
}

/// True if a picture has the smallest error of several; the best energy ratio is 1.
fn is_best(entries: &[PictureErrors], entry: &PictureErrors, metric: usize) -> bool {
    let error = |e: &PictureErrors| {
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
    html! {
        @if let Some(seeds) = &comparison.seeds {
            h2 { "Over " (seeds.renders) " renders" }
            (html::table("", ["", "value"], seeds.metrics().map(|m| html! {
                th title=(definition(m)) { (m.name) } td { (number(m.value)) }
            })))
        }
        details {
            summary { "Formulas" }
            ul { @for m in comparison.metrics() { li { (definition(m)) } } }
            p { "I is the picture, f the reference; means are over pixels and channels." }
        }
        @for note in &comparison.notes { p { (note) } }
    }
}
