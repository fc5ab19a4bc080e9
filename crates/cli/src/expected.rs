//! Estimates the time of a render from a short one.

use super::exit::IntoExit;
use opsr::image::film::Window;
use opsr::integrator::bidirectional::Radius;
use opsr::integrator::{Amounts, Picture, Recorded, Settings, View};
use opsr::math::UVec2;
use opsr::pilot::advise;
use opsr::render::Spec;
use opsr::render::open::Opened;
use opsr::scene::{Scene, SceneParts};
use serde_json::{Value, json};
use std::time::Instant;

/// Samples per pixel of the render that is estimated.
const SAMPLES: u32 = 64;

/// Most pixels in a pass of the short render, and its least duration in seconds.
const PIXELS: f64 = 1e4;
const MIN_SECONDS: f64 = 0.15;

/// Most triangles for the short render: their trees take a second or two.
const TRIANGLES: usize = 1_000_000;

/// The scene, with its trees only if these can be built quickly.
pub(super) fn built(parts: SceneParts) -> Scene {
    let triangles: usize = parts.all_meshes().map(|mesh| mesh.indices.len()).sum();
    match triangles > TRIANGLES {
        true => Scene::without_trees(parts),
        false => Scene::new(parts),
    }
}

/// The estimated time of a render by the integrator chosen for the scene, as JSON: a small picture of the same camera
/// is rendered for a moment. `null` for a scene that is too large.
pub(super) fn expected(spec: &Spec, opened: &Opened) -> anyhow::Result<Value> {
    let scene = &opened.scene;
    if scene.geometry().stored() > TRIANGLES {
        return Ok(Value::Null);
    }
    let frame = spec.frame(scene).into_exit()?;
    let pixels = f64::from(frame.x) * f64::from(frame.y);
    let scale = (PIXELS / pixels).sqrt().min(1.0);
    let size = (frame.as_dvec2() * scale).as_uvec2().max(UVec2::ONE);
    let camera = spec.camera(scene, frame).into_exit()?;
    let window = Window::full(size);
    let view = View::new(scene, &camera, size, window);
    let mut picture = Picture::blank(size, window, &Amounts::Raw, Recorded::default())?;
    let kind = advise(scene).kind;
    let settings = Settings {
        estimator: kind.estimator(Radius::default()),
        ..Settings::default()
    };
    let mut integrator = settings.integrator();
    integrator.prepare(&view);
    // The first pass also allocates memory and starts threads.
    integrator.pass(&view, 0..1, &mut picture);
    let clock = Instant::now();
    let mut samples = 0;
    while clock.elapsed().as_secs_f64() < MIN_SECONDS {
        samples += integrator.pass(&view, samples + 1..samples + 2, &mut picture);
    }
    let pilot = clock.elapsed().as_secs_f64();
    let each = pilot / (f64::from(samples) * window.len() as f64);
    Ok(json!({
        "seconds": rounded(each * pixels * f64::from(SAMPLES)),
        "samples": SAMPLES,
        "frame": frame.to_array(),
        "integrator": kind.to_string(),
        "threads": rayon::current_num_threads(),
        "pilot_seconds": rounded(pilot),
    }))
}

/// A number with two digits, the precision of such an estimate.
fn rounded(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// The estimate as a line of text.
pub(super) fn described(time: &Value) -> String {
    if time.is_null() {
        return format!("time        not tried: more than {TRIANGLES} triangles");
    }
    let [w, h] = [&time["frame"][0], &time["frame"][1]];
    format!(
        "time        about {} s for {SAMPLES} samples of {w}x{h} by {} with {} threads, by a pilot of {} s",
        time["seconds"],
        time["integrator"].as_str().unwrap_or_default(),
        time["threads"],
        time["pilot_seconds"]
    )
}

#[cfg(test)]
mod tests {
    use super::rounded;

    #[test]
    fn times_have_two_digits() {
        for (x, y) in [(123.4, 120.0), (0.1678, 0.17), (9.96, 10.0), (0.0, 0.0)] {
            assert!((rounded(x) - y).abs() < 1e-9, "{x}");
        }
    }
}
