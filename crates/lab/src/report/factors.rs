//! The 1,360 classes of paths as a picture: one cell for each.
//!
//! One block of rows for each number of vertices, 2 to 5. A row has all bins of the last three vertices, the last one
//! fastest, for one choice of bins before them. Blocks have 1, 1, 4 and 16 rows, with an empty row in between.

use super::html;
use maud::{Markup, html};
use opsr::image::Buffer;
use opsr::math::Rgb;
use opsr::regularise::{BINS, GammaIndex, LEN};
use opsr_metric::false_colour;
use opsr_train::record::visits::is_live;

/// Cells in a row.
const COLUMNS: usize = BINS * BINS * BINS;

/// First rows of the blocks.
const FIRST: [usize; 4] = [0, 2, 4, 9];

/// Rows of the picture.
const ROWS: usize = FIRST[3] + BINS * BINS;

/// Least factor with a colour of its own: the least one of a recording.
const MIN_FACTOR: f32 = 0.002;

/// Column and row of a class; `None` if the last vertex is in the top bin, which can hardly be roughened.
fn cell(class: GammaIndex) -> Option<(usize, usize)> {
    let bins = class.bins();
    let (before, last) = bins.split_at(bins.len().saturating_sub(3));
    let code = |bins: &[usize]| bins.iter().fold(0, |code, &bin| code * BINS + bin);
    is_live(class).then(|| (code(last), FIRST[bins.len() - 2] + code(before)))
}

/// A picture of a number in [0, 1] for each class; `None` leaves the cell grey.
fn picture(value: impl Fn(usize) -> Option<f32>) -> Buffer {
    let mut values = vec![0.0; COLUMNS * ROWS];
    let mut known = vec![false; COLUMNS * ROWS];
    for index in 0..LEN {
        let place = GammaIndex::new(index).and_then(cell);
        if let (Some((x, y)), Some(value)) = (place, value(index)) {
            values[y * COLUMNS + x] = value;
            known[y * COLUMNS + x] = true;
        }
    }
    let mut picture = false_colour::map(COLUMNS, ROWS, &values);
    let unknown = picture.pixels.iter_mut().zip(known).filter(|(_, k)| !k);
    unknown.for_each(|(pixel, _)| *pixel = Rgb::splat(0.2));
    picture
}

/// A picture of the learned factors of classes with events.
pub(super) fn factors(gammas: &[f32], visits: &[u64]) -> Markup {
    let factor = |gamma: f32| 1.0 - gamma.max(MIN_FACTOR).ln() / MIN_FACTOR.ln();
    let shown = picture(|i| (visits[i] > 0).then(|| factor(gammas[i])));
    let middle = MIN_FACTOR.sqrt();
    let caption = format!(
        "Factors, logarithmically: black is {MIN_FACTOR} or less, red {middle:.3}, light yellow 1."
    );
    figure(&shown, &caption)
}

/// A picture of the number of events of all classes, with an explanation of both pictures.
pub(super) fn events(visits: &[u64]) -> Markup {
    let most = visits.iter().copied().max().unwrap_or(0).max(1);
    let seen = |count: u64| (1.0 + count as f32).ln() / (1.0 + most as f32).ln();
    let shown = picture(|i| (visits[i] > 0).then(|| seen(visits[i])));
    let caption = format!("Events, logarithmically: black is none, light yellow {most}.");
    html! {
        h2 { "Classes" }
        p {
            "A cell is a class of paths: blocks for 2, 3, 4 and 5 vertices. Along a row are the bins of the last three vertices, "
            "the last one fastest; down a block those of the vertices before them. Grey are classes that no event visited, and those whose "
            "last vertex is in the top bin."
        }
        (figure(&shown, &caption))
    }
}

fn figure(picture: &Buffer, caption: &str) -> Markup {
    html! {
        figure.classes { img src=(html::data_uri(picture, 0.0)) alt=(caption); figcaption { (caption) } }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use opsr_train::record::visits::LIVE_CLASSES;
    use std::collections::BTreeSet;

    #[test]
    fn every_live_class_has_a_cell_of_its_own() {
        let all = || (0..LEN).filter_map(|i| GammaIndex::new(i).and_then(cell));
        let cells: BTreeSet<_> = all().collect();
        assert_eq!(all().count(), LIVE_CLASSES);
        assert_eq!(cells.len(), all().count());
        assert!(cells.iter().all(|&(x, y)| x < COLUMNS && y < ROWS));
        // An empty row after each block but the last.
        assert!(
            [1, 3, 8]
                .iter()
                .all(|gap| cells.iter().all(|(_, y)| y != gap))
        );
        let of = |bins: &[usize]| GammaIndex::from_bins(bins).and_then(cell);
        assert_eq!(of(&[1, 2]), Some((6, 0)));
        assert_eq!(of(&[3, 0, 1]), Some((49, 2)));
        assert_eq!(of(&[2, 0, 0, 1]), Some((1, 6)));
        assert_eq!(of(&[3, 3, 3, 3, 2]), Some((62, 24)));
        assert_eq!(of(&[0, 3]), None);
    }

    #[test]
    fn colours_follow_factors_and_unseen_classes_are_grey() {
        let light = |pixel: Rgb| pixel.element_sum();
        let shown = picture(|i| (i != 4).then_some([0.0, 0.5, 1.0][i % 4 % 3]));
        let pixel = |x: usize, y: usize| shown.pixels[y * COLUMNS + x];
        assert!(light(pixel(0, 0)) < light(pixel(1, 0)));
        assert!(light(pixel(1, 0)) < light(pixel(2, 0)));
        assert_eq!(pixel(3, 0), Rgb::splat(0.2), "top bin");
        assert_eq!(pixel(4, 0), Rgb::splat(0.2), "no event");
    }
}
