//! Pictures of the methods beside the reference, with their FLIP maps.

use maud::{Markup, PreEscaped, html};

use super::super::results::{Inset, Results};
use super::super::summary::SceneSummary;
use crate::report::html::data_uri;
use opsr::image::Buffer;
use opsr_metric::false_colour;
use opsr_metric::flip;

/// The pictures of a scene; nothing if the results have none.
pub(super) fn pictures(results: &Results, scene: &SceneSummary, index: usize) -> Markup {
    let spec = results.suite.scenes.iter().find(|s| s.name == scene.name);
    let exposure = spec.map_or(0.0, |s| s.exposure);
    let Some(reference) = results.inset(&scene.name, None).and_then(Inset::picture) else {
        return html! {};
    };
    let uri = data_uri(&reference, exposure);
    // The URI is in a style, so that it is not repeated for each picture.
    let style = format!(".reference-{index} {{ background-image: url({uri}); }}");
    html! {
        style { (PreEscaped(style)) }
        .pictures {
            figure {
                img src=(uri) alt={ (scene.name) ", reference" };
                figcaption { b { "reference" } }
            }
            @for method in &scene.methods {
                @let inset = results.inset(&scene.name, Some(&method.name));
                @if let Some((inset, picture)) = inset.and_then(|i| Some((i, i.picture()?))) {
                    figure {
                        div.flip.{ "reference-" (index) } tabindex="0" {
                            img src=(data_uri(&picture, exposure)) alt={ (scene.name) ", " (method.name) };
                        }
                        (difference(scene, inset, &picture, &reference, exposure))
                    }
                }
            }
        }
    }
}

/// The FLIP map and the caption of a method's picture; a picture that cannot be compared is still shown.
fn difference(
    scene: &SceneSummary,
    inset: &Inset,
    picture: &Buffer,
    reference: &Buffer,
    exposure: f32,
) -> Markup {
    let name = inset.method.as_deref().unwrap_or_default();
    let shown = |b: &Buffer| b.map(|p| p * exposure.exp2());
    let map = flip::ldr(&shown(picture), &shown(reference), flip::DEFAULT_PPD).ok();
    let colours = |m: &flip::FlipMap| false_colour::map(m.width, m.height, &m.values);
    let mean = map.as_ref().map_or("not comparable".to_owned(), |m| {
        format!("FLIP {:.4}", m.mean)
    });
    html! {
        @if let Some(map) = &map {
            img src=(data_uri(&colours(map), 0.0)) alt={ (scene.name) ", " (name) ", FLIP" };
        }
        figcaption {
            b { (name) } br;
            (inset.samples) " spp, " (format!("{:.3}", inset.seconds)) " s" br;
            (mean)
        }
    }
}
