//! `opsr info`: what a scene has and needs.

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
    let facts = facts(&opened.scene, &opened.warnings);
    print(match args.json {
        true => format!("{facts:#}\n"),
        false => described(&facts),
    })
}

/// What a scene has, as JSON.
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
            "emissive_triangles": scene.emitters().area_lights(),
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
        "level": bin(alpha),
        "emits": m.emission != opsr::math::Rgb::ZERO,
    })
}

/// How many of the 1360 classes the scene's materials can form.
fn reachable(scene: &Scene) -> usize {
    let mut levels = [false; 4];
    for m in &scene.parts().materials {
        if m.metallic_roughness_texture.is_some() {
            levels = [true; 4];
        } else {
            levels[bin(m.alpha)] |= !m.is_lambert();
            // A diffuse base scatters too.
            levels[3] |= m.has_base();
        }
    }
    (0..LEN)
        .filter_map(GammaIndex::new)
        .filter(|c| c.levels().iter().all(|&l| levels[l]))
        .count()
}

/// What a render of this scene leaves out, because nothing in it asks for it.
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
        ("light sampling", scene.emitters().is_empty()),
        ("regularisation", *rule == Rule::Plain),
    ];
    off.iter()
        .filter(|(_, off)| *off)
        .map(|(what, _)| format!("switched off: {what}"))
        .collect()
}

/// The facts as text.
fn described(facts: &serde_json::Value) -> String {
    let mut lines = Vec::new();
    let number = |key: &str| facts[key].to_string();
    lines.push(format!(
        "triangles   {} in {} meshes",
        number("triangles"),
        number("meshes")
    ));
    lines.push(format!("bounds      {}", facts["bounds"]));
    lines.push(format!("textures    {}", number("textures")));
    lines.push(format!("lights      {}", facts["lights"]));
    lines.push(format!("cameras     {}", facts["cameras"]));
    lines.push(format!(
        "classes     {} of {LEN} can be formed by the materials",
        number("classes")
    ));
    lines.push("materials".to_owned());
    for m in facts["materials"].as_array().into_iter().flatten() {
        let textured = if m["textured_roughness"] == true {
            " (textured)"
        } else {
            ""
        };
        let emits = if m["emits"] == true { ", emits" } else { "" };
        lines.push(format!(
            "  {} {}: alpha {}{textured}, level {}{emits}",
            m["kind"], m["name"], m["alpha"], m["level"]
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
