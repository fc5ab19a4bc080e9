//! Parts of HTML pages. A page is one file: style, scripts, plots and pictures are inside.

use base64::prelude::{BASE64_STANDARD, Engine as _};
use maud::{DOCTYPE, Markup, PreEscaped, html};

use opsr::image::{Buffer, png};

/// A page with its title as first heading.
pub(super) fn page(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { (title) }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body { h1 { (title) } (body) }
        }
    };
    page.into_string()
}

/// A table that scrolls sideways in a narrow window. A row is the markup of its cells.
pub(super) fn table<H: AsRef<str>>(
    caption: &str,
    heads: impl IntoIterator<Item = H>,
    rows: impl IntoIterator<Item = Markup>,
) -> Markup {
    html! {
        .scroll { table {
            @if !caption.is_empty() { caption { (caption) } }
            thead { tr { @for head in heads { th { (head.as_ref()) } } } }
            tbody { @for row in rows { tr { (row) } } }
        } }
    }
}

/// A plot with its caption.
pub(super) fn plot(svg: &str, caption: &str) -> Markup {
    html! { figure { (PreEscaped(svg)) figcaption { (caption) } } }
}

/// A picture as a data URI of a PNG file, brightened by `exposure` stops.
pub(super) fn data_uri(picture: &Buffer, exposure: f32) -> String {
    // Only a picture without pixels cannot be encoded.
    let bytes = png::encode(picture, exposure).unwrap_or_default();
    format!("data:image/png;base64,{}", BASE64_STANDARD.encode(bytes))
}

/// Text of a number, or a dash.
pub(super) fn or_dash<T>(value: Option<T>, text: impl Fn(T) -> String) -> String {
    value.map_or_else(|| "–".to_owned(), text)
}
