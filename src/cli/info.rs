//! `opsr info`: content of a scene and the features it uses.

use super::output::print;
use super::scene::SceneArgs;
use clap::Args;
use opsr::regularise::{GammaIndex, LEN, Rule, bin};
use opsr::scene::{Material, PunctualLight, Scene};

/// Options of `opsr info`.
#[derive(Args, Debug)]
pub(super) struct InfoArgs {
    #[command(flatten)]
    scene: SceneArgs,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(super) fn run(args: &InfoArgs) -> anyhow::Result<()> {
    let opened = args.scene.open()?;
    let mut facts = facts(&opened.scene, &opened.warnings);
    facts["animations"] = (opened.animations.iter())
        .map(|a| serde_json::json!({ "name": a.name, "seconds": a.seconds }))
        .collect();
    print(match args.json {
        true => format!("{facts:#}\n"),
        false => described(&facts),
    })
}

/// The content of a scene as JSON.
fn facts(scene: &Scene, warnings: &[String]) -> serde_json::Value {
    let parts = scene.parts();
    let materials: Vec<_> = parts.materials.iter().map(material).collect();
    let count = |f: fn(&PunctualLight) -> bool| parts.lights.iter().filter(|l| f(l)).count();
    let (low, high) = scene.geometry().bounds();
    serde_json::json!({
        "triangles": scene.geometry().len(),
        "meshes": parts.meshes.len(),
        "bounds": [low.to_array(), high.to_array()],
        "materials": materials,
        "textures": parts.textures.len(),
        "lights": {
            "emissive_triangles": scene.lights().emissive_triangles(),
            "point": count(|l| matches!(l, PunctualLight::Point { .. })),
            "spot": count(|l| matches!(l, PunctualLight::Spot { .. })),
            "directional": count(|l| matches!(l, PunctualLight::Directional { .. })),
            "environment": parts.environment.is_some(),
        },
        "cameras": parts.cameras.iter().map(|c| c.name.clone()).collect::<Vec<_>>(),
        "classes": reachable(scene),
        "unused": unused(scene, &Rule::Plain),
        "warnings": warnings,
    })
}

fn material(m: &Material) -> serde_json::Value {
    let kind = match (m.transmission > 0.0, m.solid) {
        (true, true) => "solid transmission",
        (true, false) => "thin-walled transmission",
        _ if m.metallic >= 1.0 => "metal",
        _ if m.is_lambert() => "lambert",
        _ => "glossy over lambert",
    };
    let alpha = if m.is_lambert() { 1.0 } else { m.alpha };
    serde_json::json!({
        "name": m.name,
        "kind": kind,
        "alpha": alpha,
        "textured_roughness": m.metallic_roughness_texture.is_some(),
        "bin": bin(alpha),
        // The former name of "bin".
        "level": bin(alpha),
        "emits": m.emission != opsr::math::Rgb::ZERO,
    })
}

/// Number of the 1360 roughness classes that the scene's materials can form.
fn reachable(scene: &Scene) -> usize {
    let mut bins = [false; 4];
    for m in &scene.parts().materials {
        if m.metallic_roughness_texture.is_some() {
            bins = [true; 4];
        } else {
            bins[bin(m.alpha)] |= !m.is_lambert();
            // A diffuse base scatters too.
            bins[3] |= m.has_base();
        }
    }
    (0..LEN)
        .filter_map(GammaIndex::new)
        .filter(|c| c.bins().iter().all(|&b| bins[b]))
        .count()
}

/// Features that a render of this scene leaves out, because nothing in the scene asks for them.
pub(super) fn unused(scene: &Scene, rule: &Rule) -> Vec<String> {
    let parts = scene.parts();
    let off = [
        ("textures", parts.textures.is_empty()),
        ("environment", parts.environment.is_none()),
        ("absorption", !scene.has_absorption()),
        ("opacity", !scene.geometry().has_opacity()),
        (
            "transmission",
            parts.materials.iter().all(|m| m.transmission == 0.0),
        ),
        ("light sampling", scene.lights().is_empty()),
        ("regularisation", *rule == Rule::Plain),
    ];
    off.iter()
        .filter(|(_, off)| *off)
        .map(|(what, _)| format!("not used: {what}"))
        .collect()
}

/// The content as text.
fn described(facts: &serde_json::Value) -> String {
    let mut lines = vec![
        format!(
            "triangles   {} in {} meshes",
            facts["triangles"], facts["meshes"]
        ),
        format!("bounds      {}", facts["bounds"]),
        format!("textures    {}", facts["textures"]),
        format!("lights      {}", facts["lights"]),
        format!("cameras     {}", facts["cameras"]),
        format!(
            "classes     {} of {LEN} occur with these materials",
            facts["classes"]
        ),
    ];
    for a in facts["animations"].as_array().into_iter().flatten() {
        lines.push(format!("animation   {}: {} s", a["name"], a["seconds"]));
    }
    lines.push("materials".to_owned());
    for m in facts["materials"].as_array().into_iter().flatten() {
        let textured = if m["textured_roughness"] == true {
            " (textured)"
        } else {
            ""
        };
        let emits = if m["emits"] == true { ", emits" } else { "" };
        lines.push(format!(
            "  {} {}: alpha {}{textured}, bin {}{emits}",
            m["kind"], m["name"], m["alpha"], m["bin"]
        ));
    }
    for key in ["unused", "warnings"] {
        for line in facts[key].as_array().into_iter().flatten() {
            lines.push(line.as_str().unwrap_or_default().to_owned());
        }
    }
    lines.push(String::new());
    lines.join("\n")
}
