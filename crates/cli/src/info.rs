//! `opsr info`: content of a scene and the features it uses.

use super::exit::{Blame, IntoExit};
use super::expected;
use super::options::{Pixel, SceneOptions, pixel};
use super::output::print;
use anyhow::Context;
use clap::Args;
use opsr::image::film::{Film, Window};
use opsr::integrator::{View, centre};
use opsr::pilot::advise;
use opsr::regularise::{GammaIndex, LEN, Rule, bin};
use opsr::render::open::Opened;
use opsr::scene::{Environment, Material, PunctualLight, Scene, SceneParts, Texels, Texture};
use opsr_formats::FORMATS;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Options of `opsr info`.
#[derive(Args, Debug)]
pub(super) struct InfoArgs {
    /// The scene: glTF 2.0 (.gltf or .glb), pbrt-v4 (.pbrt), Mitsuba (.xml), OBJ or PLY.
    scene: PathBuf,
    #[command(flatten)]
    options: SceneOptions,
    /// Print only what the ray through the centre of this pixel hits.
    #[arg(long, value_name = "X,Y", value_parser = pixel)]
    pixel: Option<Pixel>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
pub(super) fn run(args: &InfoArgs) -> anyhow::Result<()> {
    let spec = &args.options.0;
    let build = match args.pixel {
        Some(_) => Scene::new,
        None => expected::built,
    };
    let opened = spec.open(&args.scene, FORMATS, build).into_exit()?;
    for warning in &opened.warnings {
        tracing::warn!("{}: {warning}", args.scene.display());
    }
    let facts = match args.pixel {
        Some(pixel) => seen(args, &opened, pixel)?,
        None => {
            let mut facts = facts(&opened.scene, &opened.warnings);
            facts["animations"] = (opened.animations.iter())
                .map(|a| serde_json::json!({ "name": a.name, "seconds": a.seconds }))
                .collect();
            facts["time"] = expected::expected(spec, &opened)?;
            facts
        }
    };
    print(match (args.json, args.pixel) {
        (true, _) => format!("{facts:#}\n"),
        (false, None) => described(&facts),
        (false, Some(_)) => lines(&facts),
    })
}

/// The surface at the centre of a pixel as JSON; only the pixel if there is none.
fn seen(args: &InfoArgs, opened: &Opened, Pixel(pixel): Pixel) -> anyhow::Result<Value> {
    let scene = &opened.scene;
    let size = args.options.0.frame(scene).into_exit()?;
    let [x, y] = pixel.to_array();
    let window = Window { x, y, w: 1, h: 1 };
    Film::cropped(size, window).context("--pixel").usage()?;
    let camera = args.options.0.camera(scene, size).into_exit()?;
    let view = View::new(scene, &camera, size, window);
    let mut facts = serde_json::json!({ "pixel": [x, y], "frame": size.to_array() });
    let Some((hit, mut surface)) = centre(&view, pixel) else {
        facts["meets"] = "nothing".into();
        return Ok(facts);
    };
    let of = &scene.parts().materials[surface.material as usize];
    // Small numbers would draw a clear coat instead of its base.
    let u = if of.clearcoat().is_some() { 0.25 } else { 0.0 };
    let alpha = scene.bsdf(&mut surface, u).alpha();
    facts["mesh"] = (scene.geometry().triangle_mesh(surface.triangle) + 1).into();
    facts["material"] = format!("{} ({})", of.name, surface.material + 1).into();
    facts["kind"] = material(of)["kind"].clone();
    facts["alpha"] = short(alpha);
    facts["bin"] = bin(alpha).into();
    facts["distance"] = short(hit.t);
    facts["position"] = shorts(surface.position.to_array());
    facts["normal"] = shorts(surface.ns.to_array());
    facts["geometric_normal"] = shorts(surface.ng.to_array());
    facts["uv"] = shorts(scene.geometry().uv(scene.parts(), &hit).to_array());
    Ok(facts)
}

/// The facts of a flat JSON object, one per line.
fn lines(facts: &Value) -> String {
    let line = |(key, value): (&String, &Value)| {
        let value = value.as_str().map_or_else(|| value.to_string(), Into::into);
        format!("{key:<17} {value}\n")
    };
    facts.as_object().into_iter().flatten().map(line).collect()
}

/// The content of a scene as JSON.
fn facts(scene: &Scene, warnings: &[String]) -> serde_json::Value {
    let parts = scene.parts();
    // Counts do not include the floor of the studio.
    let floor = parts.floor();
    let own = |all: usize| all.saturating_sub(floor.map_or(0, |mesh| mesh.indices.len()));
    let materials: Vec<_> = (parts.materials.iter().enumerate())
        .filter(|(i, _)| floor.is_none_or(|mesh| mesh.material as usize != *i))
        .map(|(_, m)| material(m))
        .collect();
    let count = |f: fn(&PunctualLight) -> bool| parts.lights.iter().filter(|l| f(l)).count();
    let (low, high) = scene.bounds();
    let advice = advise(scene);
    serde_json::json!({
        "triangles": own(scene.geometry().triangle_count()),
        "meshes": parts.meshes.len() - usize::from(parts.has_floor) + scene.geometry().instances(),
        "shared": {
            "meshes": parts.shared.len(),
            "instances": scene.geometry().instances(),
            "triangles_in_memory": own(scene.geometry().stored()),
        },
        "bounds": [shorts(low.to_array()), shorts(high.to_array())],
        "materials": materials,
        "textures": parts.textures.len(),
        "texture_sizes": texture_sizes(parts),
        "memory_mb": memory(scene).div_ceil(1_000_000),
        "lights": {
            "emissive_triangles": scene.lights().emissive_triangles(),
            "point": count(|l| matches!(l, PunctualLight::Point { .. })),
            "spot": count(|l| matches!(l, PunctualLight::Spot { .. })),
            "directional": count(|l| matches!(l, PunctualLight::Directional { .. })),
            "environment": parts.environment.is_some(),
        },
        "cameras": parts.cameras.iter().map(|c| c.name.clone()).collect::<Vec<_>>(),
        "classes": reachable(scene),
        "integrator": { "name": advice.kind.to_string(), "why": advice.why },
        "unused": unused(scene, &Rule::Plain),
        "warnings": warnings,
    })
}

/// A number with the digits of single precision only.
fn short(x: f32) -> Value {
    x.to_string()
        .parse::<f64>()
        .map_or(Value::Null, Value::from)
}

fn shorts<const N: usize>(numbers: [f32; N]) -> Value {
    numbers.into_iter().map(short).collect()
}

/// One texture per image: several textures may share their texels.
fn images(parts: &SceneParts) -> Vec<&Texture> {
    let mut images: Vec<&Texture> = parts.textures.iter().collect();
    let address = |t: &Texture| match &t.texels {
        Texels::Byte(codes) => codes.as_ptr().addr(),
        Texels::Word(codes) => codes.as_ptr().addr(),
    };
    images.sort_by_key(|t| address(t));
    images.dedup_by_key(|t| address(t));
    images
}

/// Sizes of the images, largest first, with the number of images of each size.
fn texture_sizes(parts: &SceneParts) -> Value {
    let mut counts = BTreeMap::<[u32; 2], u32>::new();
    for image in images(parts) {
        *counts.entry([image.width, image.height]).or_default() += 1;
    }
    let entry = |([w, h], n): (&[u32; 2], &u32)| json!({ "width": w, "height": h, "images": n });
    counts.iter().rev().map(entry).collect()
}

/// Most bytes of a scene during a render, without pictures: triangles with their trees, vertices, texels, map.
fn memory(scene: &Scene) -> u64 {
    /// Measured bytes of a triangle with its tree during construction, of an emissive one in addition, and of a vertex.
    const BYTES: [u64; 3] = [270, 290, 60];
    let parts = scene.parts();
    let vertices: usize = parts.all_meshes().map(|mesh| mesh.positions.len()).sum();
    let bytes = |t: &Texture| match &t.texels {
        Texels::Byte(codes) => codes.len() as u64,
        Texels::Word(codes) => 2 * codes.len() as u64,
    };
    // The smaller mip levels add a third.
    let texels: u64 = images(parts).iter().map(|t| bytes(t) * 4 / 3).sum();
    let [triangle, emitter, vertex] = BYTES;
    let lamps = scene.lights().emissive_triangles() as u64;
    let map = parts
        .environment
        .as_ref()
        .map_or(0, Environment::bytes_in_memory);
    scene.geometry().stored() as u64 * triangle
        + lamps * emitter
        + vertices as u64 * vertex
        + texels
        + map
}

fn material(m: &Material) -> serde_json::Value {
    let kind = match (m.transmission > 0.0, m.solid) {
        (true, true) => "solid transmission",
        (true, false) => "thin-walled transmission",
        _ if m.phase.is_some() => "phase function",
        _ if m.metallic >= 1.0 => "metal",
        _ if m.translucency().is_some() => "diffuse transmission",
        _ if m.is_lambert() => "lambert",
        _ => "glossy over lambert",
    };
    let alpha = if m.is_lambert() { 1.0 } else { m.alpha };
    serde_json::json!({
        "name": m.name,
        "kind": kind,
        "alpha": short(alpha),
        "textured_roughness": m.metallic_roughness_texture.is_some(),
        "bin": bin(alpha),
        "anisotropy": m.anisotropy().map(|a| short(a.strength)),
        "clearcoat": m.clearcoat().map(|coat| short(coat.weight)),
        "clearcoat_alpha": m.clearcoat().map(|coat| short(coat.alpha)),
        // The former name of "bin".
        "level": bin(alpha),
        "emits": m.emission != opsr::math::Rgb::ZERO,
    })
}

/// Number of the 1360 roughness classes that the scene's materials can form.
fn reachable(scene: &Scene) -> usize {
    let mut bins = [false; 4];
    for m in &scene.parts().materials {
        let coat = m.clearcoat();
        let brushing = m.anisotropy().and_then(|a| a.texture.as_ref());
        let textured = m.metallic_roughness_texture.is_some() || brushing.is_some();
        if textured || coat.is_some_and(|coat| coat.roughness_texture.is_some()) {
            bins = [true; 4];
        } else {
            coat.iter().for_each(|coat| bins[bin(coat.alpha)] = true);
            bins[bin(m.alpha)] |= !m.is_lambert();
            bins[bin(m.lobe_alpha())] |= m.anisotropy().is_some();
            // A diffuse base scatters, too.
            bins[3] |= m.metallic < 1.0 && m.transmission < 1.0;
        }
    }
    (0..LEN)
        .filter_map(GammaIndex::new)
        .filter(|c| c.bins().iter().all(|&b| bins[b]))
        .count()
}

/// Prefix of a feature that a render leaves out.
const NOT_USED: &str = "not used: ";

/// Features that a render of this scene leaves out, because nothing in the scene needs them.
pub(super) fn unused(scene: &Scene, rule: &Rule) -> Vec<String> {
    let parts = scene.parts();
    let off = [
        ("textures", parts.textures.is_empty()),
        ("environment", parts.environment.is_none()),
        ("absorption", !scene.features().absorption),
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
        .map(|(what, _)| format!("{NOT_USED}{what}"))
        .collect()
}

/// Number and sizes of the textures.
fn textures(facts: &Value) -> String {
    let size = |t: &Value| match t["images"].as_u64() {
        Some(1) => format!("{} x {}", t["width"], t["height"]),
        _ => format!("{} of {} x {}", t["images"], t["width"], t["height"]),
    };
    let sizes: Vec<String> = (facts["texture_sizes"].as_array().into_iter().flatten())
        .map(size)
        .collect();
    match sizes.is_empty() {
        true => "0".into(),
        false => format!("{}, images {}", facts["textures"], sizes.join(", ")),
    }
}

/// The strings of a list.
fn texts(list: &Value) -> Vec<String> {
    let list = list.as_array().into_iter().flatten();
    list.filter_map(Value::as_str).map(str::to_owned).collect()
}

/// Edges of the scene's bounding box, and its lowest corner.
fn bounds(corners: &Value) -> String {
    let at = |corner: usize, axis: usize| corners[corner][axis].as_f64().unwrap_or(0.0) as f32;
    let edge = |axis| at(1, axis) - at(0, axis);
    format!(
        "{} x {} x {}, from ({} {} {})",
        edge(0),
        edge(1),
        edge(2),
        at(0, 0),
        at(0, 1),
        at(0, 2)
    )
}

/// Lights by kind.
fn lights(counts: &Value) -> String {
    let named = |(key, one, many): (&str, &str, &str)| match counts[key].as_u64() {
        None | Some(0) => None,
        Some(1) => Some(format!("1 {one}")),
        Some(n) => Some(format!("{n} {many}")),
    };
    let kinds = [
        (
            "emissive_triangles",
            "triangle that emits",
            "triangles that emit",
        ),
        ("point", "point light", "point lights"),
        ("spot", "spot light", "spot lights"),
        ("directional", "sun", "suns"),
    ];
    let mut found: Vec<String> = kinds.into_iter().filter_map(named).collect();
    if counts["environment"] == true {
        found.push("an environment".into());
    }
    match found.is_empty() {
        true => "none".into(),
        false => found.join(", "),
    }
}

/// Names of the cameras.
fn cameras(names: &Value) -> String {
    match texts(names) {
        names if names.is_empty() => "none: the scene is framed".into(),
        names => names.join(", "),
    }
}

/// The content as text.
fn described(facts: &serde_json::Value) -> String {
    let mut lines = vec![
        format!(
            "triangles   {} in {} meshes",
            facts["triangles"], facts["meshes"]
        ),
        format!("bounds      {}", bounds(&facts["bounds"])),
        format!("textures    {}", textures(facts)),
        format!(
            "memory      about {} MB, and the picture",
            facts["memory_mb"]
        ),
        expected::described(&facts["time"]),
        format!("lights      {}", lights(&facts["lights"])),
        format!("cameras     {}", cameras(&facts["cameras"])),
        format!(
            "classes     {} of {LEN} occur with these materials",
            facts["classes"]
        ),
        format!(
            "integrator  {}: {}",
            facts["integrator"]["name"].as_str().unwrap_or_default(),
            facts["integrator"]["why"].as_str().unwrap_or_default()
        ),
    ];
    let shared = &facts["shared"];
    if let Some(meshes @ 1..) = shared["meshes"].as_u64() {
        lines.insert(
            1,
            format!(
                "shared      {} instances of {meshes} {}, {} triangles in memory",
                shared["instances"],
                if meshes == 1 { "mesh" } else { "meshes" },
                shared["triangles_in_memory"]
            ),
        );
    }
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
        let clear_coat = match m["clearcoat"].as_f64() {
            Some(coat) => format!(", clear coat {coat} of alpha {}", m["clearcoat_alpha"]),
            None => String::new(),
        };
        let brushed = match m["anisotropy"].as_f64() {
            Some(strength) => format!(", anisotropy {strength:.3}"),
            None => String::new(),
        };
        let emits = if m["emits"] == true { ", emits" } else { "" };
        lines.push(format!(
            "  {} {}: alpha {}{textured}, bin {}{brushed}{clear_coat}{emits}",
            m["kind"].as_str().unwrap_or_default(),
            m["name"].as_str().unwrap_or_default(),
            m["alpha"],
            m["bin"]
        ));
    }
    let unused = texts(&facts["unused"]);
    let unused: Vec<&str> = unused
        .iter()
        .filter_map(|line| line.strip_prefix(NOT_USED))
        .collect();
    if !unused.is_empty() {
        lines.push(format!("not used    {}", unused.join(", ")));
    }
    lines.extend(texts(&facts["warnings"]));
    lines.push(String::new());
    lines.join("\n")
}
