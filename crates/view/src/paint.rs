//! Pictures and overlays as pixels for a page. A separate thread paints the newest picture whenever it or its display
//! changes; the code that writes PNG files makes the colours.

use super::hub::{Frame, Hub, Painted, Snapshot};
use super::options::Overlay;
use opsr::image::display::Display;
use opsr::image::{Buffer, png};
use opsr::math::{Rgb, UVec2};
use opsr::render::Spec;
use opsr::render::value::Exposure;
use opsr_metric::false_colour;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;

/// Relative errors at the ends of the colour scale.
const ERRORS: [f32; 2] = [0.003, 1.0];

/// Paints until the viewer ends.
pub(super) fn run(hub: &Hub, pool: &rayon::ThreadPool) {
    let (mut shown, mut updated) = (0, 0);
    let mut exposure = None;
    while !hub.ended() {
        let state = hub.wait(Duration::from_secs(1), |state| {
            state.shown.is_some() && (state.shown_number, state.options_number) != (shown, updated)
        });
        if (state.shown_number, state.options_number) == (shown, updated) {
            continue;
        }
        let Some(picture) = state.shown.clone() else {
            continue;
        };
        (shown, updated) = (state.shown_number, state.options_number);
        let run = state.run;
        let other = state
            .other
            .clone()
            .filter(|_| state.options.other.is_some());
        let reference = state.options.other == Some(super::options::Other::Reference);
        let (spec, overlay) = (state.options.spec.clone(), state.options.overlay);
        drop(state);
        let display = display(&spec, &picture, &mut exposure);
        let size = picture.size;
        let painted = pool.install(|| overlaid(&picture, overlay, display));
        let second = match (&other, reference) {
            (_, true) => (hub.reference.as_ref()).map(|buffer| painted_picture(buffer, display)),
            (Some(other), _) if other.run == run => {
                Some(pool.install(|| overlaid(other, overlay, display)).0)
            }
            _ => None,
        };
        let frame = Frame {
            head: json!({
                "run": picture.run,
                "size": size.to_array(),
                "frame": picture.viewpoint.frame.to_array(),
                "preview": picture.preview,
                "samples": picture.samples,
                "seconds": picture.seconds,
                "exposure": display.exposure,
                "legend": painted.1,
            }),
            picture: painted.0,
            other: second,
        };
        hub.change(|state| {
            state.frame = Some(Arc::new(frame));
            state.frame_number += 1;
        });
    }
}

/// Exposure and view. Previews keep the last automatic exposure, so that they do not flicker while a camera turns.
fn display(spec: &Spec, picture: &Snapshot, held: &mut Option<f32>) -> Display {
    let auto = spec.exposure.unwrap_or_default() == Exposure::Auto;
    let view = spec.view.unwrap_or_default();
    if let (true, true, Some(exposure)) = (auto, picture.preview, *held) {
        return Display { exposure, view };
    }
    let display = spec.display(
        &picture.picture,
        picture.viewpoint.open_scene.opened.in_studio,
    );
    *held = auto.then_some(display.exposure);
    display
}

/// A picture for a page.
pub(super) fn painted_picture(picture: &Buffer, display: Display) -> Painted {
    let pixels = picture.pixels.iter();
    let bytes: Vec<u8> = pixels
        .flat_map(|&p| {
            let [r, g, b] = png::display(p, display);
            [r, g, b, 255]
        })
        .collect();
    Painted {
        size: UVec2::new(picture.width as u32, picture.height as u32),
        bytes: bytes.into(),
    }
}

/// The overlay of a picture, and its legend; the picture itself if it has no such map.
fn overlaid(picture: &Snapshot, overlay: Overlay, display: Display) -> (Painted, Value) {
    let plain = Display::from(0.0);
    let map = |values: &[f32], [low, high]: [f32; 2], what: &str| {
        let scale = |x: f32| ((x / low).ln() / (high / low).ln()).clamp(0.0, 1.0);
        let scaled: Vec<f32> = values
            .iter()
            .map(|&x| if x > 0.0 { scale(x) } else { 0.0 })
            .collect();
        let size = picture.size;
        let shown = false_colour::map(size.x as usize, size.y as usize, &scaled);
        let legend = json!({ "low": low, "high": high, "what": what, "log": true });
        (painted_picture(&shown, plain), legend)
    };
    let errors = |values: &Option<Vec<f32>>, what: &str| {
        values.as_ref().map(|values| map(values, ERRORS, what))
    };
    let made = match overlay {
        Overlay::Picture => None,
        Overlay::Error => errors(&picture.maps.error, "expected relative error"),
        Overlay::Noise => errors(&picture.maps.noise, "noise, relative"),
        Overlay::Bias => errors(&picture.maps.bias, "bias, relative"),
        Overlay::Flip => (picture.maps.flip.as_ref()).map(|map| linear(picture, map, "FLIP")),
        Overlay::Missing => (picture.maps.missing.as_ref())
            .map(|map| linear(picture, map, "light missing at least")),
        Overlay::Level => picture
            .maps
            .level
            .as_ref()
            .map(|levels| levelled(picture, levels)),
        Overlay::Normal | Overlay::Albedo | Overlay::Depth => first(picture, overlay),
    };
    made.unwrap_or_else(|| (painted_picture(&picture.picture, display), Value::Null))
}

/// False colours of values in [0, 1], and their legend.
fn linear(picture: &Snapshot, values: &[f32], what: &str) -> (Painted, Value) {
    let size = picture.size;
    let shown = false_colour::map(size.x as usize, size.y as usize, values);
    let legend = json!({ "low": 0, "high": 1, "what": what, "log": false });
    (painted_picture(&shown, 0.0.into()), legend)
}

fn levelled(picture: &Snapshot, levels: &[u8]) -> (Painted, Value) {
    let most = f32::from(levels.iter().copied().max().unwrap_or(0).max(3));
    let values: Vec<f32> = (levels.iter())
        .map(|&level| 0.08 + 0.84 * f32::from(level) / most)
        .collect();
    let (painted, _) = linear(picture, &values, "");
    let legend = json!({ "low": 0, "high": most, "what": "level of roughening", "log": false });
    (painted, legend)
}

fn first(picture: &Snapshot, overlay: Overlay) -> Option<(Painted, Value)> {
    let first = picture.viewpoint.first(picture.size)?;
    let [albedo, normal, depth] = &*first;
    Some(match overlay {
        Overlay::Normal => {
            let shown = normal
                .map(|n| Rgb::from_array(n.to_array().map(|x| png::srgb_decode(0.5 * x + 0.5))));
            (painted_picture(&shown, 0.0.into()), Value::Null)
        }
        Overlay::Albedo => (painted_picture(albedo, 0.0.into()), Value::Null),
        _ => {
            let values: Vec<f32> = depth.pixels.iter().map(|p| p.x).collect();
            let finite = values.iter().copied().filter(|x| x.is_finite());
            let (low, high) =
                finite.fold((f32::INFINITY, 0.0f32), |(a, b), x| (a.min(x), b.max(x)));
            let span = (high - low).max(f32::MIN_POSITIVE);
            // Near surfaces are bright, the background is black.
            let near = |x: &f32| {
                if x.is_finite() {
                    1.0 - 0.9 * (x - low) / span
                } else {
                    0.0
                }
            };
            let shades: Vec<f32> = values.iter().map(near).collect();
            let (painted, _) = linear(picture, &shades, "");
            let legend = json!({ "low": high, "high": low, "what": "distance", "log": false });
            (painted, legend)
        }
    })
}
