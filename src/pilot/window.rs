//! The window of a pilot's small picture.

use crate::image::film::Window;
use crate::math::UVec2;

/// Factor in pixels of the sides of a pilot's window.
pub(crate) const TILE: u32 = 4;

/// Size of the pilot's full frame, and its window of about `pixels` pixels, with sides that are multiples of [`TILE`].
pub(crate) fn pilot_window(frame: UVec2, window: Window, pixels: f32) -> (UVec2, Window) {
    let scale = (pixels / window.len().max(1) as f32).sqrt();
    let side = |x: u32| ((x as f32 * scale / TILE as f32).round() as u32).clamp(2, 256) * TILE;
    let start = |x: u32| (x as f32 * scale).round() as u32;
    let pilot = Window {
        x: start(window.x),
        y: start(window.y),
        w: side(window.w),
        h: side(window.h),
    };
    // A window that ends at the frame's edge still does.
    let edge = |frame: u32, from: u32, length: u32, end: u32| {
        if from + length == frame {
            end
        } else {
            ((frame as f32 * scale).round() as u32).max(end)
        }
    };
    let frame = UVec2::new(
        edge(frame.x, window.x, window.w, pilot.x + pilot.w),
        edge(frame.y, window.y, window.h, pilot.y + pilot.h),
    );
    (frame, pilot)
}

/// Indices of a tile's pixels in the film of a window.
pub(crate) fn inside(w: &Window, outer: &Window) -> impl Iterator<Item = usize> {
    let (x, y, width) = (w.x - outer.x, w.y - outer.y, outer.w);
    let (w, h) = (w.w, w.h);
    (y..y + h).flat_map(move |y| (x..x + w).map(move |x| (y * width + x) as usize))
}

#[cfg(test)]
mod tests {
    use super::*;

    const PIXELS: f32 = 4096.0;

    #[test]
    fn pilot_view_covers_the_window_of_the_render() {
        let frame = UVec2::new(160, 90);
        let pilot_of = |window| pilot_window(frame, window, PIXELS);
        let whole = Window::full(frame);
        let crop = Window {
            x: 94,
            y: 30,
            w: 32,
            h: 32,
        };
        let corner = Window {
            x: 159,
            y: 89,
            w: 1,
            h: 1,
        };
        for window in [whole, crop, corner] {
            let (size, pilot) = pilot_of(window);
            assert!(
                pilot.inside(&Window::full(size)),
                "{window:?}: {pilot:?} of {size}"
            );
            assert!(pilot.w % TILE == 0 && pilot.h % TILE == 0);
            // Edges keep their places to within two tiles.
            for (a, b, outer, inner) in [
                (window.x, window.w, frame.x, (pilot.x, pilot.w, size.x)),
                (window.y, window.h, frame.y, (pilot.y, pilot.h, size.y)),
            ] {
                let place = |x: u32| f64::from(x) / f64::from(outer);
                let found = |x: u32| f64::from(x) / f64::from(inner.2);
                let slack = 2.0 * f64::from(TILE) / f64::from(inner.2);
                assert!((place(a) - found(inner.0)).abs() < slack);
                assert!((place(a + b) - found(inner.0 + inner.1)).abs() < slack);
            }
        }
        let (size, pilot) = pilot_of(whole);
        assert_eq!(pilot, Window::full(size));
    }
}
