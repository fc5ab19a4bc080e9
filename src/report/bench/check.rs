//! Checks of a suite before anything is measured. Messages name the entry and the key.

use std::collections::BTreeSet;

use super::suite::{Kind, MethodSpec, SceneSpec, Suite};
use crate::image::film::Window;
use crate::integrator::method::IntegratorKind;
use crate::integrator::{Estimator, Settings};
use crate::regularise::{Accumulated, Factors, Rule};

/// The most seeds of a suite: comparisons go through all of them again and again.
const MAX_SEEDS: u32 = 1000;

/// The most stops of exposure: beyond, single precision is at its end.
const MAX_STOPS: f32 = 64.0;

/// The message unless the condition holds.
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
        self::method(method).map_err(|e| format!("method `{}`: {e}", method.name))?;
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
    let mut scales = [scene.light_scale, scene.roughness_scale].into_iter();
    ensure(
        scales.all(|s| s.is_none_or(|s| s > 0.0 && s.is_finite())),
        "light_scale and roughness_scale: expected numbers above 0",
    )?;
    ensure(
        (-MAX_STOPS..=MAX_STOPS).contains(&scene.exposure),
        format!("exposure: from -{MAX_STOPS} to {MAX_STOPS} stops"),
    )?;
    ensure(
        scene.max_vertices > 0 && scene.reference_spp != Some(0),
        "max_vertices and reference_spp: at least 1",
    )
}

/// The first fault of a method.
fn method(method: &MethodSpec) -> Result<(), String> {
    method.refused()?;
    let lambda = method.lambda.unwrap_or(0.0);
    for (given, kind, what) in [
        (method.gamma.is_some(), Kind::Constant, "gamma"),
        (method.filter.is_some(), Kind::FilterGlossy, "filter"),
        (method.table.is_some(), Kind::Table, "table"),
        (method.table_scale.is_some(), Kind::Table, "table_scale"),
        (method.lookup.is_some(), Kind::Table, "lookup"),
    ] {
        let belongs = !given || method.method == kind;
        ensure(belongs, format!("`{what}` does not belong to this method"))?;
    }
    let accumulated = matches!(method.method, Kind::Constant | Kind::Table);
    ensure(
        accumulated || !(method.reuse || lambda != 0.0),
        "`reuse` and `lambda` belong to `constant` and `table`",
    )?;
    ensure(
        method.method != Kind::Constant || method.gamma.is_some_and(|g| (0.0..=1.0).contains(&g)),
        "gamma: expected from 0 to 1",
    )?;
    ensure(
        method.method != Kind::Table || method.table.is_some(),
        "table: expected a file",
    )?;
    ensure(
        (0.0..0.5).contains(&lambda),
        "lambda: expected from 0 to below 0.5",
    )?;
    let scale = method.table_scale.is_none_or(|s| s > 0.0 && s.is_finite());
    ensure(scale, "table_scale: expected a number above 0")?;
    let filter = method.filter.is_none_or(|f| f > 0.0 && f.is_finite());
    ensure(filter, "filter: expected a number above 0")?;
    let radius = method.radius.is_none_or(|r| r > 0.0 && r.is_finite());
    ensure(radius, "radius: expected a number above 0")?;
    let alpha = method.radius_alpha.is_none_or(|a| a > 0.0 && a <= 1.0);
    ensure(alpha, "radius_alpha: expected above 0 and at most 1")?;
    let pass = method.mlt_pass.is_none_or(|n| (1..=65536).contains(&n));
    ensure(pass, "mlt_pass: expected from 1 to 65536")?;
    ensure(
        method.resolve.is_none() || !method.levels.is_empty(),
        "resolve: there is a choice among several levels",
    )?;
    let factors = Factors::Constant(1.0);
    let settings = Settings {
        estimator: Estimator::Path {
            reuse: method.reuse,
        },
        rule: match method.method {
            Kind::FilterGlossy => Rule::FilterGlossy(1.0),
            Kind::RoughnessClamp => Rule::RoughnessClamp,
            _ if accumulated => Rule::Accumulated(Accumulated { factors, lambda }),
            _ => Rule::Pbrt,
        },
        levels: method.levels.clone(),
        ..Settings::default()
    };
    let levels = settings.check_levels();
    levels.map_err(|e| format!("levels: {e}"))
}
