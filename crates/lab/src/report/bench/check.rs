//! Checks of a suite before anything is measured. Messages name the entry and the key.

use std::collections::BTreeSet;

use super::suite::{SceneSpec, Suite};
use opsr::image::film::Window;
use opsr::integrator::method::IntegratorKind;

/// The most seeds of a suite: comparisons take each pair of them.
const MAX_SEEDS: u32 = 1000;

/// The most stops of exposure, within the range of single precision.
const MAX_STOPS: f32 = 64.0;

/// An error with this message unless the condition holds.
fn ensure(holds: bool, message: impl Into<String>) -> Result<(), String> {
    if holds { Ok(()) } else { Err(message.into()) }
}

/// The first fault of a suite.
pub(super) fn suite(suite: &Suite) -> Result<(), String> {
    unique("scene", suite.scenes.iter().map(|s| s.name.as_str()))?;
    unique("method", suite.methods.iter().map(|m| m.name.as_str()))?;
    let seeds = (1..=MAX_SEEDS).contains(&suite.seeds);
    ensure(seeds, format!("seeds: from 1 to {MAX_SEEDS}"))?;
    let any = !suite.times.is_empty() || !suite.samples.is_empty();
    ensure(any, "times or samples: at least one time point")?;
    let samples: Vec<f64> = suite.samples.iter().map(|&n| f64::from(n)).collect();
    for (what, values) in [("times", &suite.times), ("samples", &samples)] {
        let ascending = values.windows(2).all(|w| w[0] < w[1]);
        let positive = values.iter().all(|x| *x > 0.0 && x.is_finite());
        let message = format!("{what}: expected ascending numbers above 0");
        ensure(ascending && positive, message)?;
    }
    let named = |name: &str| {
        let there = suite.methods.iter().any(|m| m.name == name);
        ensure(there, format!("there is no method `{name}`"))
    };
    if let Some(name) = &suite.baseline {
        named(name).map_err(|e| format!("baseline: {e}"))?;
    }
    for scene in &suite.scenes {
        let mut methods = scene.methods.iter().flatten();
        self::scene(scene)
            .and_then(|()| methods.try_for_each(|name| named(name)))
            .map_err(|e| format!("scene `{}`: {e}", scene.name))?;
    }
    for method in &suite.methods {
        let checked = method.check();
        checked.map_err(|e| format!("method `{}`: {e}", method.name))?;
    }
    Ok(())
}

fn unique<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    for name in names {
        ensure(!name.is_empty(), format!("a {what} without a name"))?;
        ensure(
            seen.insert(name),
            format!("two {what}s are called `{name}`"),
        )?;
    }
    ensure(!seen.is_empty(), format!("no {what}"))
}

/// The first fault of a scene.
fn scene(scene: &SceneSpec) -> Result<(), String> {
    ensure(
        scene.file.is_some() != scene.builtin.is_some(),
        "expected either `file` or `builtin`",
    )?;
    ensure(
        scene.reference.is_some() != scene.reference_spp.is_some(),
        "expected either `reference` or `reference_spp`",
    )?;
    ensure(
        scene.reference_integrator != IntegratorKind::Auto,
        "reference_integrator: expected one by name",
    )?;
    let size = scene.size.iter().all(|n| (1..=65536).contains(n));
    ensure(size, "size: from 1 to 65536 each")?;
    let crop = scene.window().inside(&Window::full(scene.frame()));
    ensure(crop, "crop: empty or not inside the frame")?;
    let inset = scene.inset_window().inside(&scene.window());
    ensure(inset, "inset: empty or not inside the rendered part")?;
    ensure(
        (-MAX_STOPS..=MAX_STOPS).contains(&scene.exposure),
        format!("exposure: from -{MAX_STOPS} to {MAX_STOPS} stops"),
    )?;
    ensure(
        scene.max_vertices > 0 && scene.reference_spp != Some(0),
        "max_vertices and reference_spp: at least 1",
    )
}
