//! Writes scene parts as one binary glTF file: meshes in world space, materials with the supported extensions, lights and
//! cameras. Equal parts give equal bytes.

use opsr::files::{self, FileError};
use opsr::math::{Frame, Rgb, Vec3};
use opsr::scene::{AlphaMode, Camera, Material, Mesh, Projection, PunctualLight, SceneParts};
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::Path;

/// Errors of writing scene parts.
#[derive(Debug, thiserror::Error)]
pub enum SaveError {
    /// A kind of part that this writer does not support.
    #[error("{0} cannot be written to a .glb file")]
    Unsupported(&'static str),
    /// The file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

/// Writes the parts to a file.
pub fn save(parts: &SceneParts, path: &Path) -> Result<(), SaveError> {
    let bytes = to_glb(parts)?;
    Ok(files::write_bytes(path, bytes)?)
}

/// The parts as the bytes of a `.glb` file.
pub fn to_glb(parts: &SceneParts) -> Result<Vec<u8>, SaveError> {
    if !parts.textures.is_empty() {
        return Err(SaveError::Unsupported("a texture"));
    }
    if parts.environment.is_some() {
        return Err(SaveError::Unsupported("an environment"));
    }
    if !parts.shared.is_empty() {
        return Err(SaveError::Unsupported("a shared mesh"));
    }
    let mut file = Writer::default();
    for (i, mesh) in parts.meshes.iter().enumerate() {
        file.mesh(mesh);
        file.nodes.push(json!({ "mesh": i }));
    }
    let mut lights = Vec::new();
    for light in &parts.lights {
        let (value, pose) = punctual(light);
        file.nodes.push(json!({
            "extensions": { "KHR_lights_punctual": { "light": lights.len() } },
            "matrix": pose,
        }));
        file.used.insert("KHR_lights_punctual");
        lights.push(value);
    }
    for (i, camera) in parts.cameras.iter().enumerate() {
        let pose = matrix(&camera.frame, camera.position);
        file.nodes
            .push(json!({ "camera": i, "name": camera.name, "matrix": pose }));
    }
    let materials: Vec<Value> = parts
        .materials
        .iter()
        .map(|m| material(m, &mut file.used))
        .collect();
    let cameras: Vec<Value> = parts.cameras.iter().map(camera).collect();
    Ok(file.finish(materials, cameras, lights))
}

/// An `f32` as the shortest decimal that reads back to it, instead of the seventeen digits of an `f64`.
fn number(x: f32) -> Value {
    x.to_string()
        .parse::<f64>()
        .ok()
        .and_then(serde_json::Number::from_f64)
        .map_or(Value::Null, Value::Number)
}

fn numbers(v: impl IntoIterator<Item = f32>) -> Value {
    v.into_iter().map(number).collect()
}

/// Column-major pose of a node whose axes are the frame's.
fn matrix(frame: &Frame, position: Vec3) -> Value {
    let columns = [
        (frame.s, 0.0),
        (frame.t, 0.0),
        (frame.n, 0.0),
        (position, 1.0),
    ];
    numbers(columns.iter().flat_map(|(c, w)| [c.x, c.y, c.z, *w]))
}

/// A colour in [0, 1] and its factor.
fn split(c: Rgb) -> (Value, f32) {
    let strength = c.max_element();
    if strength <= 0.0 {
        return (numbers([0.0; 3]), 1.0);
    }
    (numbers((c / strength).to_array()), strength)
}

fn punctual(light: &PunctualLight) -> (Value, Value) {
    let pose = |direction: Vec3, position| matrix(&Frame::from_normal(-direction), position);
    let body = |kind: &str, power: Rgb, range: f32| {
        let (color, intensity) = split(power);
        let mut value = json!({ "type": kind, "color": color, "intensity": number(intensity) });
        if range.is_finite() {
            value["range"] = number(range);
        }
        value
    };
    match *light {
        PunctualLight::Point {
            position,
            intensity,
            range,
        } => (body("point", intensity, range), pose(Vec3::NEG_Z, position)),
        PunctualLight::Spot {
            position,
            direction,
            intensity,
            range,
            cos_inner,
            cos_outer,
            falloff: _,
        } => {
            let mut value = body("spot", intensity, range);
            value["spot"] = json!({
                "innerConeAngle": number(cos_inner.acos()),
                "outerConeAngle": number(cos_outer.acos()),
            });
            (value, pose(direction, position))
        }
        PunctualLight::Directional {
            direction,
            irradiance,
        } => (
            body("directional", irradiance, f32::INFINITY),
            pose(direction, Vec3::ZERO),
        ),
    }
}

fn camera(camera: &Camera) -> Value {
    let aspect = camera.aspect;
    // A node's frame is upright, so a mirrored frame is written as a negative magnification.
    let Frame { s, t, n } = camera.frame;
    let mirrored = s.dot(t.cross(n)).signum();
    match camera.projection {
        Projection::Perspective { tan_half_y } => {
            let mut lens =
                json!({ "yfov": number(2.0 * tan_half_y.atan()), "znear": number(0.001) });
            if let Some(aspect) = aspect {
                lens["aspectRatio"] = number(aspect);
            }
            json!({ "name": camera.name, "type": "perspective", "perspective": lens })
        }
        Projection::Orthographic { half_height } => json!({
            "name": camera.name,
            "type": "orthographic",
            "orthographic": {
                "xmag": number(mirrored * half_height * aspect.unwrap_or(1.0)),
                "ymag": number(half_height),
                "znear": number(0.001),
                "zfar": number(1000.0),
            },
        }),
    }
}

fn material(m: &Material, used: &mut BTreeSet<&'static str>) -> Value {
    // In a file the base colour of an unlit material is its emission.
    let base = if m.unlit { m.emission } else { m.base_color };
    let [r, g, b] = base.to_array();
    let mut value = json!({
        "name": m.name,
        "pbrMetallicRoughness": {
            "baseColorFactor": numbers([r, g, b, m.opacity]),
            "metallicFactor": number(m.metallic),
            "roughnessFactor": number(m.alpha.sqrt()),
        },
    });
    match m.alpha_mode {
        AlphaMode::Opaque => {}
        AlphaMode::Mask(cutoff) => {
            value["alphaMode"] = json!("MASK");
            value["alphaCutoff"] = number(cutoff);
        }
        AlphaMode::Blend => value["alphaMode"] = json!("BLEND"),
        AlphaMode::Unseen => value["alphaMode"] = json!("MASK"),
    }
    if m.double_sided {
        value["doubleSided"] = json!(true);
    }
    let mut extensions = Map::new();
    if m.emission != Rgb::ZERO && !m.unlit {
        let (factor, strength) = if m.emission.max_element() > 1.0 {
            split(m.emission)
        } else {
            (numbers(m.emission.to_array()), 1.0)
        };
        value["emissiveFactor"] = factor;
        if strength != 1.0 {
            extensions.insert(
                "KHR_materials_emissive_strength".into(),
                json!({ "emissiveStrength": number(strength) }),
            );
        }
    }
    if m.transmission > 0.0 {
        let body = json!({ "transmissionFactor": number(m.transmission) });
        extensions.insert("KHR_materials_transmission".into(), body);
    }
    if let Some(through) = m.translucency() {
        let body = json!({
            "diffuseTransmissionFactor": number(through.weight),
            "diffuseTransmissionColorFactor": numbers(through.color.to_array()),
        });
        extensions.insert("KHR_materials_diffuse_transmission".into(), body);
    }
    if m.ior != 1.5 {
        extensions.insert("KHR_materials_ior".into(), json!({ "ior": number(m.ior) }));
    }
    if m.dispersion != 0.0 {
        let body = json!({ "dispersion": number(m.dispersion) });
        extensions.insert("KHR_materials_dispersion".into(), body);
    }
    if m.solid {
        extensions.insert("KHR_materials_volume".into(), volume(m.absorption));
    }
    let extras = extras(m);
    if !extras.is_empty() {
        value["extras"] = Value::Object(extras);
    }
    add_finish(m, &mut extensions);
    if m.unlit {
        extensions = Map::from_iter([("KHR_materials_unlit".into(), json!({}))]);
    }
    used.extend(EXTENSIONS.iter().filter(|e| extensions.contains_key(**e)));
    if !extensions.is_empty() {
        value["extensions"] = Value::Object(extensions);
    }
    value
}

/// Values of a material for which no extension exists.
fn extras(m: &Material) -> Map<String, Value> {
    let mut extras = Map::new();
    if m.priority != 0.0 {
        extras.insert("priority".into(), number(m.priority));
    }
    if let Some(lamp) = m.lamp() {
        let mut body = json!({ "hidden": lamp.hidden });
        if let Some(cone) = &lamp.cone {
            body["cone"] = json!({
                "direction": numbers(cone.direction.to_array()),
                "cosInner": number(cone.cos_inner),
                "cosOuter": number(cone.cos_outer),
            });
        }
        extras.insert("lamp".into(), body);
    }
    extras
}

/// Adds the extensions of specular reflection, clear coat, anisotropy, sheen and iridescence.
fn add_finish(m: &Material, extensions: &mut Map<String, Value>) {
    if (m.specular, m.specular_color) != (1.0, Rgb::ONE) {
        extensions.insert("KHR_materials_specular".into(), specular(m));
    }
    if let Some(coat) = m.clearcoat() {
        let body = json!({
            "clearcoatFactor": number(coat.weight),
            "clearcoatRoughnessFactor": number(coat.alpha.sqrt()),
        });
        extensions.insert("KHR_materials_clearcoat".into(), body);
    }
    if let Some(anisotropy) = m.anisotropy() {
        let body = json!({
            "anisotropyStrength": number(anisotropy.strength),
            "anisotropyRotation": number(anisotropy.rotation),
        });
        extensions.insert("KHR_materials_anisotropy".into(), body);
    }
    if let Some(sheen) = m.finish.as_ref().and_then(|f| f.sheen.as_ref()) {
        let body = json!({
            "sheenColorFactor": numbers(sheen.color.to_array()),
            "sheenRoughnessFactor": number(sheen.alpha.sqrt()),
        });
        extensions.insert("KHR_materials_sheen".into(), body);
    }
    if let Some(film) = m.finish.as_ref().and_then(|f| f.film.as_ref()) {
        let [least, most] = film.thickness.map(number);
        let body = json!({
            "iridescenceFactor": number(film.weight),
            "iridescenceIor": number(film.ior),
            "iridescenceThicknessMinimum": least,
            "iridescenceThicknessMaximum": most,
        });
        extensions.insert("KHR_materials_iridescence".into(), body);
    }
}

/// The material extensions that this writer uses.
const EXTENSIONS: [&str; 12] = [
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_emissive_strength",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_materials_ior",
    "KHR_materials_volume",
    "KHR_materials_specular",
];

/// Absorption as the colour after the distance at which the strongest channel falls to 1/e. A positive thickness
/// declares that the surface bounds a body with the shape of the mesh.
fn volume(absorption: Rgb) -> Value {
    let strongest = absorption.max_element();
    if strongest <= 0.0 {
        return json!({ "thicknessFactor": 1 });
    }
    let left = (-absorption / strongest).exp();
    json!({
        "thicknessFactor": 1,
        "attenuationDistance": number(1.0 / strongest),
        "attenuationColor": numbers(left.to_array()),
    })
}

fn specular(m: &Material) -> Value {
    let mut value = json!({ "specularFactor": number(m.specular) });
    if m.specular_color != Rgb::ONE {
        value["specularColorFactor"] = numbers(m.specular_color.to_array());
    }
    value
}

/// The lists and the binary chunk of a file under construction.
#[derive(Default)]
struct Writer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
    used: BTreeSet<&'static str>,
}

impl Writer {
    fn mesh(&mut self, mesh: &Mesh) {
        let mut attributes = Map::new();
        let (low, high) = mesh
            .positions
            .iter()
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(lo, hi), p| {
                (lo.min(*p), hi.max(*p))
            });
        let mut position = self.accessor(bytemuck::cast_slice(&mesh.positions), 5126, 3, 34962);
        position["min"] = numbers(low.to_array());
        position["max"] = numbers(high.to_array());
        self.attribute(&mut attributes, "POSITION", position);
        if !mesh.normals.is_empty() {
            let a = self.accessor(bytemuck::cast_slice(&mesh.normals), 5126, 3, 34962);
            self.attribute(&mut attributes, "NORMAL", a);
        }
        if !mesh.uvs.is_empty() {
            let a = self.accessor(bytemuck::cast_slice(&mesh.uvs), 5126, 2, 34962);
            self.attribute(&mut attributes, "TEXCOORD_0", a);
        }
        if !mesh.colors.is_empty() {
            let flat: Vec<[f32; 4]> = mesh.colors.iter().map(|c| c.to_array()).collect();
            let a = self.accessor(bytemuck::cast_slice(&flat), 5126, 4, 34962);
            self.attribute(&mut attributes, "COLOR_0", a);
        }
        if !mesh.tangents.is_empty() {
            let flat: Vec<[f32; 4]> = mesh.tangents.iter().map(|t| t.to_array()).collect();
            let a = self.accessor(bytemuck::cast_slice(&flat), 5126, 4, 34962);
            self.attribute(&mut attributes, "TANGENT", a);
        }
        let flat = mesh.indices.as_flattened();
        // The largest 16-bit index is the strip-restart value and may not be used.
        let indices = if mesh.positions.len() < 65_535 {
            let short: Vec<u16> = flat.iter().map(|&i| i as u16).collect();
            self.accessor(bytemuck::cast_slice(&short), 5123, 1, 34963)
        } else {
            self.accessor(bytemuck::cast_slice(flat), 5125, 1, 34963)
        };
        self.accessors.push(indices);
        self.meshes.push(json!({ "primitives": [{
            "attributes": attributes,
            "indices": self.accessors.len() - 1,
            "material": mesh.material,
        }]}));
    }

    fn attribute(&mut self, attributes: &mut Map<String, Value>, name: &str, accessor: Value) {
        attributes.insert(name.into(), json!(self.accessors.len()));
        self.accessors.push(accessor);
    }

    /// Appends native bytes (little-endian on all supported platforms) as a buffer view; returns an accessor of it.
    fn accessor(&mut self, bytes: &[u8], component: u32, width: usize, target: u32) -> Value {
        let size = if component == 5123 { 2 } else { 4 };
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        self.views.push(json!({
            "buffer": 0,
            "byteOffset": self.bytes.len(),
            "byteLength": bytes.len(),
            "target": target,
        }));
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        json!({
            "bufferView": self.views.len() - 1,
            "componentType": component,
            "count": bytes.len() / (size * width),
            "type": kind,
        })
    }

    fn finish(self, materials: Vec<Value>, cameras: Vec<Value>, lights: Vec<Value>) -> Vec<u8> {
        let mut root = json!({
            "asset": { "version": "2.0", "generator": "opsr" },
            "scene": 0,
            "scenes": [{ "nodes": (0..self.nodes.len()).collect::<Vec<_>>() }],
            "nodes": self.nodes,
        });
        let lists = [
            ("meshes", self.meshes),
            ("accessors", self.accessors),
            ("bufferViews", self.views),
            ("materials", materials),
            ("cameras", cameras),
        ];
        for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
            root[name] = Value::Array(list);
        }
        if !self.bytes.is_empty() {
            root["buffers"] = json!([{ "byteLength": self.bytes.len() }]);
        }
        if !lights.is_empty() {
            root["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
        }
        if !self.used.is_empty() {
            root["extensionsUsed"] = json!(self.used);
        }
        container(root.to_string().into_bytes(), self.bytes)
    }
}

/// The two chunks of a `.glb` file, each padded to four bytes `[glTF §4.4]`.
fn container(mut text: Vec<u8>, bytes: Vec<u8>) -> Vec<u8> {
    text.resize(text.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + text.len() + if bytes.is_empty() { 0 } else { 8 + bytes.len() };
    let mut file = Vec::with_capacity(total);
    for word in [0x4654_6c67, 2, total as u32, text.len() as u32, 0x4e4f_534a] {
        file.extend(word.to_le_bytes());
    }
    file.extend(text);
    if !bytes.is_empty() {
        file.extend((bytes.len() as u32).to_le_bytes());
        file.extend(0x004e_4942u32.to_le_bytes());
        file.extend(bytes);
    }
    file
}
