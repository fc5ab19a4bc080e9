//! Checks of a suite before anything is measured. Messages name the entry and the key.

use std::collections::BTreeSet;

use super::suite::{Kind, MethodSpec, SceneSpec, Suite};
use crate::image::film::Window;

/// The most seeds of a suite: comparisons go through all of them again and again.
const MAX_SEEDS: u32 = 1000;

/// The most stops of exposure: beyond, single precision is at its end.
const MAX_STOPS: f32 = 64.0;

/// The first thing that is wrong with a suite.
pub(super) fn suite(suite: &Suite) -> Result<(), String> {
    unique("scene", suite.scenes.iter().map(|s| s.name.as_str()))?;
    unique("method", suite.methods.iter().map(|m| m.name.as_str()))?;
    if !(1..=MAX_SEEDS).contains(&suite.seeds) {
        return Err(format!("seeds: from 1 to {MAX_SEEDS}"));
    }
    if suite.times.is_empty() && suite.samples.is_empty() {
        return Err("times or samples: at least one time point".to_owned());
    }
    let ascending = |v: &[f64]| v.windows(2).all(|w| w[0] < w[1]);
    let samples: Vec<f64> = suite.samples.iter().map(|&n| f64::from(n)).collect();
    let positive = |v: &[f64]| v.iter().all(|x| *x > 0.0 && x.is_finite());
    for (what, values) in [("times", &suite.times), ("samples", &samples)] {
        if !ascending(values) || !positive(values) {
            return Err(format!("{what}: expected ascending numbers above 0"));
        }
    }
    let named = |name: &str| suite.methods.iter().any(|m| m.name == name);
    if let Some(name) = &suite.baseline
        && !named(name)
    {
        return Err(format!("baseline: there is no method `{name}`"));
    }
    for scene in &suite.scenes {
        self::scene(scene).map_err(|e| format!("scene `{}`: {e}", scene.name))?;
        if let Some(name) = scene.methods.iter().flatten().find(|n| !named(n)) {
            return Err(format!(
                "scene `{}`: there is no method `{name}`",
                scene.name
            ));
        }
    }
    for method in &suite.methods {
        self::method(method).map_err(|e| format!("method `{}`: {e}", method.name))?;
    }
    Ok(())
}

fn unique<'a>(what: &str, names: impl Iterator<Item = &'a str>) -> Result<(), String> {
    let mut seen = BTreeSet::new();
    for name in names {
        if name.is_empty() {
            return Err(format!("a {what} without a name"));
        }
        if !seen.insert(name) {
            return Err(format!("two {what}s are called `{name}`"));
        }
    }
    if seen.is_empty() {
        return Err(format!("no {what}"));
    }
    Ok(())
}

/// The first thing that is wrong with a scene.
fn scene(scene: &SceneSpec) -> Result<(), String> {
    let either = |a: bool, b: bool, what: &str| match (a, b) {
        (true, false) | (false, true) => Ok(()),
        _ => Err(format!("expected either {what}")),
    };
    either(
        scene.file.is_some(),
        scene.builtin.is_some(),
        "`file` or `builtin`",
    )?;
    either(
        scene.reference.is_some(),
        scene.reference_spp.is_some(),
        "`reference` or `reference_spp`",
    )?;
    if scene.size.iter().any(|n| !(1..=65536).contains(n)) {
        return Err("size: from 1 to 65536 each".to_owned());
    }
    if !scene.window().inside(&Window::full(scene.frame())) {
        return Err("crop: empty or not inside the frame".to_owned());
    }
    if !scene.inset_window().inside(&scene.window()) {
        return Err("inset: empty or not inside the rendered part".to_owned());
    }
    let scales = [scene.light_scale, scene.roughness_scale];
    if !scales.iter().flatten().all(|s| *s > 0.0 && s.is_finite()) {
        return Err("light_scale and roughness_scale: expected numbers above 0".to_owned());
    }
    if !(-MAX_STOPS..=MAX_STOPS).contains(&scene.exposure) {
        return Err(format!("exposure: from -{MAX_STOPS} to {MAX_STOPS} stops"));
    }
    if scene.max_depth == 0 || scene.reference_spp == Some(0) {
        return Err("max_depth and reference_spp: at least 1".to_owned());
    }
    Ok(())
}

/// The first thing that is wrong with a method.
fn method(method: &MethodSpec) -> Result<(), String> {
    method.refused()?;
    let lambda = method.lambda.unwrap_or(0.0);
    let unit = |x: f32| (0.0..=1.0).contains(&x);
    let only = |given: bool, kind: Kind, what: &str| match given && method.method != kind {
        true => Err(format!("`{what}` does not belong to this method")),
        false => Ok(()),
    };
    only(method.gamma.is_some(), Kind::Constant, "gamma")?;
    only(method.filter.is_some(), Kind::FilterGlossy, "filter")?;
    only(method.table.is_some(), Kind::Table, "table")?;
    only(method.table_scale.is_some(), Kind::Table, "table_scale")?;
    only(method.lookup.is_some(), Kind::Table, "lookup")?;
    if (method.reuse || lambda != 0.0) && !matches!(method.method, Kind::Constant | Kind::Table) {
        return Err("`reuse` and `lambda` belong to `constant` and `table`".to_owned());
    }
    match method.method {
        Kind::Constant if !method.gamma.is_some_and(unit) => {
            Err("gamma: expected from 0 to 1".to_owned())
        }
        Kind::Table if method.table.is_none() => Err("table: expected a file".to_owned()),
        _ if !(0.0..0.5).contains(&lambda) => {
            Err("lambda: expected from 0 to below 0.5".to_owned())
        }
        _ if method
            .table_scale
            .is_some_and(|s| !(s >= 0.0 && s.is_finite())) =>
        {
            Err("table_scale: expected 0 or more".to_owned())
        }
        _ if method.filter.is_some_and(|f| !(f > 0.0 && f.is_finite())) => {
            Err("filter: expected a number above 0".to_owned())
        }
        _ => Ok(()),
    }
}
