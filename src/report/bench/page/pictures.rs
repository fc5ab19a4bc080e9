//! What the pictures look like: each method's part beside the reference, with its FLIP map.

use maud::{Markup, PreEscaped, html};

use super::super::results::{Inset, Results};
use super::super::summary::SceneSummary;
use crate::image::metric::flip;
use crate::image::{Buffer, false_colour};
use crate::report::page::{PageError, data_uri};

/// One method's picture and error map.
struct Shown {
    name: String,
    caption: String,
    picture: String,
    map: Option<(String, f64)>,
}

/// The pictures of a scene; nothing where the results hold none.
pub(super) fn pictures(
    results: &Results,
    scene: &SceneSummary,
    index: usize,
) -> Result<Markup, PageError> {
    let exposure = results
        .suite
        .scenes
        .iter()
        .find(|s| s.name == scene.name)
        .map_or(0.0, |s| s.exposure);
    let Some(reference) = results.inset(&scene.name, None).and_then(Inset::picture) else {
        return Ok(html! {});
    };
    let uri = data_uri(&scene.name, &reference, exposure)?;
    let mut shown = Vec::new();
    for method in &scene.methods {
        let Some(inset) = results.inset(&scene.name, Some(&method.name)) else {
            continue;
        };
        if let Some(picture) = inset.picture() {
            shown.push(show(inset, &method.name, &picture, &reference, exposure)?);
        }
    }
    Ok(document(&scene.name, index, &uri, &shown))
}

fn show(
    inset: &Inset,
    name: &str,
    picture: &Buffer,
    reference: &Buffer,
    exposure: f32,
) -> Result<Shown, PageError> {
    let scale = exposure.exp2();
    let displayed = |b: &Buffer| b.map(|p| p * scale);
    // A picture that cannot be compared is still shown.
    let map = flip::ldr(
        &displayed(picture),
        &displayed(reference),
        flip::DEFAULT_PPD,
    )
    .ok();
    let map = match map {
        Some(map) => {
            let colours = false_colour::map(map.width, map.height, &map.values);
            Some((data_uri(name, &colours, 0.0)?, map.mean))
        }
        None => None,
    };
    Ok(Shown {
        name: name.to_owned(),
        caption: format!("{} spp, {:.3} s", inset.samples, inset.seconds),
        picture: data_uri(name, picture, exposure)?,
        map,
    })
}

fn document(scene: &str, index: usize, reference: &str, shown: &[Shown]) -> Markup {
    // Once in the style, so that it is not repeated under each picture.
    let style = format!(".reference-{index} {{ background-image: url({reference}); }}");
    html! {
        style { (PreEscaped(style)) }
        .pictures {
            figure {
                img src=(reference) alt={ (scene) ", reference" };
                figcaption { b { "reference" } }
            }
            @for s in shown {
                figure {
                    div.flip.{ "reference-" (index) } tabindex="0" {
                        img src=(s.picture) alt={ (scene) ", " (s.name) };
                    }
                    @if let Some((map, mean)) = &s.map {
                        img src=(map) alt={ (scene) ", " (s.name) ", FLIP" };
                        figcaption { b { (s.name) } br; (s.caption) br; "FLIP " (format!("{mean:.4}")) }
                    } @else {
                        figcaption { b { (s.name) } br; (s.caption) br; "not comparable" }
                    }
                }
            }
        }
    }
}
