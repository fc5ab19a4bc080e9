//! FLIP of two pictures while they change, over tiles only: a tenth of a second, where the whole pictures take seconds.

use opsr::image::Buffer;
use opsr_metric::flip;

/// Pixels along an edge of a tile, and tiles in a row and a column.
const EDGE: usize = 32;
const TILES: (usize, usize) = (8, 5);

/// Mean FLIP of the first picture against the second, over tiles spread evenly; `None` if they cannot be compared.
pub(super) fn likeness(picture: &Buffer, reference: &Buffer) -> Option<f64> {
    let equal = picture.size() == reference.size();
    let (test, reference) = equal.then(|| (tiles(picture), tiles(reference)))?;
    let (map, _) = flip::hdr(&test, &reference, flip::DEFAULT_PPD).ok()?;
    Some(map.mean)
}

/// Tiles of a picture, side by side; a small picture whole. The seams are in both pictures and change FLIP little.
fn tiles(picture: &Buffer) -> Buffer {
    let (width, height) = picture.size();
    let (columns, rows) = TILES;
    if width <= columns * EDGE || height <= rows * EDGE {
        return picture.clone();
    }
    let place = |at: usize, room: usize, count: usize| {
        (at / EDGE) * (room - EDGE) / (count - 1) + at % EDGE
    };
    Buffer::from_fn(columns * EDGE, rows * EDGE, |x, y| {
        picture.pixels[place(y, height, rows) * width + place(x, width, columns)]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use opsr::math::Rgb;
    use opsr::sampler::{Domain, Seed};

    /// A picture with an edge, a gradient and noise, against the one without noise: tiles have nearly the FLIP of all.
    #[test]
    fn tiles_tell_what_the_whole_tells() {
        let shade = |x: usize, y: usize| {
            let step = if (x / 60).is_multiple_of(2) {
                0.6
            } else {
                0.15
            };
            step + 0.4 * y as f32 / 300.0
        };
        let noise = |x: usize, y: usize, amount: f32| {
            let hash = Seed(7).derive(Domain::Camera, (400 * y + x) as u64).0;
            1.0 + amount * ((hash >> 40) as f32 / (1u64 << 24) as f32 - 0.5)
        };
        let clean = Buffer::from_fn(400, 300, |x, y| Rgb::splat(shade(x, y)));
        assert_eq!(likeness(&clean, &clean), Some(0.0));
        let mut last = 0.0;
        for amount in [0.2, 0.8, 1.6] {
            let noisy = Buffer::from_fn(400, 300, |x, y| {
                Rgb::splat(shade(x, y) * noise(x, y, amount))
            });
            let (whole, _) = flip::hdr(&noisy, &clean, flip::DEFAULT_PPD).expect("FLIP");
            let some = likeness(&noisy, &clean).expect("FLIP");
            assert!(
                (some / whole.mean - 1.0).abs() < 0.08,
                "{some} {}",
                whole.mean
            );
            assert!(some > last);
            last = some;
        }
        assert_eq!(likeness(&clean, &Buffer::filled(9, 9, Rgb::ONE)), None);
    }
}
