//! The objects of a Mitsuba file, with `default`s, includes and aliases resolved. Names are in Mitsuba 3's style: the
//! `toWorld` of older files is `to_world`.

use super::super::{Context, unpacked};
use glam::{DMat4, DVec3, DVec4};
use opsr::scene::load::error::{Result, fault};
use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

/// Deepest nesting of objects.
const MAX_DEPTH: usize = 64;

/// Most objects and properties of a scene.
const MAX_NODES: usize = 1 << 22;

/// A node of a scene: a shape, a material, a texture.
#[derive(Debug)]
pub(super) struct Object {
    /// Name of the XML element, such as `bsdf`.
    pub(super) tag: String,
    /// Plugin, such as `diffuse`.
    pub(super) plugin: String,
    /// Identifier; may be empty.
    pub(super) id: String,
    /// Place in the file.
    pub(super) place: String,
    pub(super) properties: Vec<Property>,
    pub(super) children: Vec<Child>,
}

#[derive(Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) value: Value,
    pub(super) place: String,
}

#[derive(Clone, Debug)]
pub(super) enum Value {
    Number(f64),
    Bool(bool),
    Text(String),
    Vector(DVec3),
    Rgb([f32; 3]),
    Spectrum(String),
    SpectrumFile(String),
    BlackBody { kelvin: f64, scale: f64 },
    Transform(DMat4),
}

/// An object inside another, or a reference to it.
#[derive(Clone, Debug)]
pub(super) struct Child {
    pub(super) name: String,
    pub(super) what: Link,
    pub(super) place: String,
}

#[derive(Clone, Debug)]
pub(super) enum Link {
    Object(Rc<Object>),
    Id(String),
}

/// A name in Mitsuba 3's snake case.
pub(super) fn snake(name: &str) -> String {
    let mut out = String::new();
    let mut before = '_';
    for c in name.chars() {
        if c.is_ascii_uppercase() && before.is_ascii_lowercase() {
            out.push('_');
        }
        out.push(c.to_ascii_lowercase());
        before = c;
    }
    out
}

/// Objects by their identifiers.
#[derive(Default)]
pub(super) struct Ids(RefCell<HashMap<String, Rc<Object>>>);

impl Ids {
    pub(super) fn get(&self, id: &str) -> Option<Rc<Object>> {
        self.0.borrow().get(id).cloned()
    }
}

/// Reader of a file and of its includes.
pub(super) struct Reader<'a> {
    pub(super) context: &'a mut Context,
    pub(super) ids: Ids,
    /// True for a file of version 0.5 or 0.6.
    pub(super) is_old: bool,
    defaults: HashMap<String, String>,
    nodes: usize,
}

/// The text of a file, and where its lines begin.
struct Text<'a> {
    document: &'a roxmltree::Document<'a>,
    lines: Vec<usize>,
    name: String,
    depth: usize,
}

impl Text<'_> {
    fn place(&self, node: roxmltree::Node<'_, '_>) -> String {
        let at = node.range().start;
        let line = self.lines.partition_point(|&start| start <= at);
        match self.name.is_empty() {
            true => format!("line {line}"),
            false => format!("{} line {line}", self.name),
        }
    }
}

impl<'a> Reader<'a> {
    pub(super) fn new(context: &'a mut Context) -> Self {
        Self {
            context,
            ids: Ids::default(),
            is_old: false,
            defaults: HashMap::new(),
            nodes: 0,
        }
    }

    /// The root object of a file.
    pub(super) fn file(&mut self, bytes: Vec<u8>, name: &str, depth: usize) -> Result<Object> {
        let at = if name.is_empty() { "XML" } else { name };
        let text = String::from_utf8(bytes).map_err(|e| fault(at, e.to_string()))?;
        let options = roxmltree::ParsingOptions {
            nodes_limit: MAX_NODES as u32,
            ..Default::default()
        };
        let document = roxmltree::Document::parse_with_options(&text, options).map_err(|e| {
            let place = format!("{at} line {}", e.pos().row);
            fault(place, format!("no XML: {e}"))
        })?;
        let ends = text.bytes().enumerate().filter(|(_, b)| *b == b'\n');
        let text = Text {
            document: &document,
            lines: std::iter::once(0).chain(ends.map(|(i, _)| i + 1)).collect(),
            name: name.to_owned(),
            depth,
        };
        let root = text.document.root_element();
        let place = text.place(root);
        if root.tag_name().name() != "scene" && depth == 0 {
            return Err(fault(place, "is no Mitsuba scene: its root is not <scene>"));
        }
        if depth == 0 {
            self.is_old = root
                .attribute("version")
                .is_some_and(|v| v.starts_with("0."));
        }
        self.object(&text, root, 0)
    }

    /// The value of an attribute, with each `$name` replaced by its default.
    fn attribute(
        &self,
        node: roxmltree::Node<'_, '_>,
        name: &str,
        place: &str,
    ) -> Result<Option<String>> {
        let Some(raw) = node.attribute(name) else {
            return Ok(None);
        };
        if !raw.contains('$') {
            return Ok(Some(raw.to_owned()));
        }
        let mut out = String::new();
        let mut rest = raw;
        while let Some(i) = rest.find('$') {
            out.push_str(&rest[..i]);
            rest = &rest[i + 1..];
            // The longest known name is replaced, as in Mitsuba.
            let known = self
                .defaults
                .iter()
                .filter(|(name, _)| rest.starts_with(name.as_str()));
            let Some((name, value)) = known.max_by_key(|(name, _)| name.len()) else {
                return Err(fault(place, format!("`${rest}` has no <default>")));
            };
            out.push_str(value);
            rest = &rest[name.len()..];
            if out.len() > 1 << 16 {
                return Err(fault(place, "a value that is too long"));
            }
        }
        out.push_str(rest);
        Ok(Some(out))
    }

    fn needed(&self, node: roxmltree::Node<'_, '_>, name: &str, place: &str) -> Result<String> {
        let value = self.attribute(node, name, place)?;
        value.ok_or_else(|| {
            fault(
                place,
                format!("<{}> has no `{name}`", node.tag_name().name()),
            )
        })
    }

    fn object(
        &mut self,
        text: &Text<'_>,
        node: roxmltree::Node<'_, '_>,
        depth: usize,
    ) -> Result<Object> {
        let place = text.place(node);
        if depth > MAX_DEPTH {
            return Err(fault(place, "objects are nested too deep"));
        }
        let tag = node.tag_name().name().to_owned();
        let plugin = self.attribute(node, "type", &place)?.unwrap_or_default();
        let mut object = Object {
            plugin: plugin.to_ascii_lowercase(),
            id: self.attribute(node, "id", &place)?.unwrap_or_default(),
            tag,
            place,
            properties: Vec::new(),
            children: Vec::new(),
        };
        for child in node.children().filter(|n| n.is_element()) {
            self.nodes += 1;
            if self.nodes > MAX_NODES {
                return Err(fault(text.place(child), "too many elements"));
            }
            self.member(text, child, depth, &mut object)?;
        }
        super::names::check(self.context, &object)?;
        Ok(object)
    }

    /// Adds a child element to an object.
    fn member(
        &mut self,
        text: &Text<'_>,
        node: roxmltree::Node<'_, '_>,
        depth: usize,
        object: &mut Object,
    ) -> Result<()> {
        let place = text.place(node);
        let tag = node.tag_name().name();
        match tag {
            "default" => {
                let name = self.needed(node, "name", &place)?;
                let value = self.needed(node, "value", &place)?;
                self.defaults.entry(name).or_insert(value);
            }
            "include" => {
                let name = self.needed(node, "filename", &place)?;
                self.context.include(text.depth, &place)?;
                let (_, bytes) = self.context.files.open(&name, &place)?;
                let bytes = unpacked(&bytes, &place)?;
                let included = self.file(bytes, &name, text.depth + 1)?;
                if included.tag == "scene" {
                    object.properties.extend(included.properties);
                    object.children.extend(included.children);
                } else {
                    object
                        .children
                        .push(self.keep(included, String::new(), place));
                }
            }
            "alias" => {
                let (id, other) = (
                    self.needed(node, "id", &place)?,
                    self.needed(node, "as", &place)?,
                );
                let known = self
                    .ids
                    .get(&id)
                    .ok_or_else(|| fault(&place, format!("no object `{id}`")))?;
                self.ids.0.borrow_mut().insert(other, known);
            }
            "path" => {}
            "ref" => object.children.push(Child {
                name: snake(&self.attribute(node, "name", &place)?.unwrap_or_default()),
                what: Link::Id(self.needed(node, "id", &place)?),
                place,
            }),
            "scene" | "sensor" | "shape" | "bsdf" | "texture" | "emitter" | "medium" | "film"
            | "sampler" | "integrator" | "rfilter" | "phase" | "volume" | "subsurface"
            | "camera" | "luminaire" => {
                let name = self.attribute(node, "name", &place)?.unwrap_or_default();
                let inner = self.object(text, node, depth + 1)?;
                object.children.push(self.keep(inner, snake(&name), place));
            }
            // A spectrum may be a plugin, as a texture is.
            "spectrum" if node.has_attribute("type") => {
                let name = self.attribute(node, "name", &place)?.unwrap_or_default();
                let inner = self.object(text, node, depth + 1)?;
                object.children.push(self.keep(inner, snake(&name), place));
            }
            _ => {
                let name = match tag {
                    "transform" | "string" | "float" | "integer" | "boolean" | "vector"
                    | "point" | "rgb" | "srgb" | "spectrum" | "blackbody" => {
                        snake(&self.attribute(node, "name", &place)?.unwrap_or_default())
                    }
                    _ => return Err(fault(place, format!("<{tag}> is no element of Mitsuba"))),
                };
                let value = self.value(text, node, &place)?;
                object.properties.push(Property { name, value, place });
            }
        }
        Ok(())
    }

    fn keep(&mut self, object: Object, name: String, place: String) -> Child {
        let object = Rc::new(object);
        if !object.id.is_empty() {
            let mut ids = self.ids.0.borrow_mut();
            ids.entry(object.id.clone())
                .or_insert_with(|| object.clone());
        }
        Child {
            name,
            what: Link::Object(object),
            place,
        }
    }

    fn value(&self, text: &Text<'_>, node: roxmltree::Node<'_, '_>, place: &str) -> Result<Value> {
        let word = || self.needed(node, "value", place);
        let wrong = |what: &str| fault(place, format!("`{what}` is no {}", node.tag_name().name()));
        Ok(match node.tag_name().name() {
            "float" | "integer" => {
                let word = word()?;
                let number = word.trim().parse::<f64>().ok().filter(|x| x.is_finite());
                Value::Number(number.ok_or_else(|| wrong(&word))?)
            }
            "boolean" => {
                let word = word()?;
                match word.trim().to_ascii_lowercase().as_str() {
                    "true" => Value::Bool(true),
                    "false" => Value::Bool(false),
                    _ => return Err(wrong(&word)),
                }
            }
            "string" => Value::Text(word()?),
            "vector" | "point" => Value::Vector(self.vector(node, 0.0, place)?),
            "rgb" | "srgb" => {
                let word = word()?;
                Value::Rgb(rgb(&word).ok_or_else(|| wrong(&word))?)
            }
            "spectrum" => match self.attribute(node, "filename", place)? {
                Some(file) => Value::SpectrumFile(file),
                None => Value::Spectrum(word()?),
            },
            "blackbody" => {
                let number = |name: &str, or: Option<f64>| -> Result<f64> {
                    let Some(word) = self.attribute(node, name, place)? else {
                        return or.ok_or_else(|| fault(place, format!("has no `{name}`")));
                    };
                    let plain = word.trim().trim_end_matches(['K', 'k']);
                    plain.parse().map_err(|_| wrong(&word))
                };
                Value::BlackBody {
                    kelvin: number("temperature", None)?,
                    scale: number("scale", Some(1.0))?,
                }
            }
            _ => Value::Transform(self.transform(text, node)?),
        })
    }

    /// A vector of x, y and z, or of `value`, where a single number stands for all three.
    fn vector(&self, node: roxmltree::Node<'_, '_>, or: f64, place: &str) -> Result<DVec3> {
        let bad = |word: &str| fault(place, format!("`{word}` is no vector"));
        if let Some(word) = self.attribute(node, "value", place)? {
            let numbers = numbers(&word).ok_or_else(|| bad(&word))?;
            return match numbers.as_slice() {
                [x] => Ok(DVec3::splat(*x)),
                [x, y] => Ok(DVec3::new(*x, *y, 0.0)),
                [x, y, z] => Ok(DVec3::new(*x, *y, *z)),
                _ => Err(bad(&word)),
            };
        }
        let mut out = DVec3::splat(or);
        for (i, name) in ["x", "y", "z"].iter().enumerate() {
            if let Some(word) = self.attribute(node, name, place)? {
                let number = word.trim().parse::<f64>().ok().filter(|x| x.is_finite());
                out[i] = number.ok_or_else(|| bad(&word))?;
            }
        }
        Ok(out)
    }

    fn transform(&self, text: &Text<'_>, node: roxmltree::Node<'_, '_>) -> Result<DMat4> {
        let mut out = DMat4::IDENTITY;
        for step in node.children().filter(|n| n.is_element()) {
            let place = &text.place(step);
            let point = |name: &str| -> Result<DVec3> {
                let word = self.needed(step, name, place)?;
                match numbers(&word).as_deref() {
                    Some([x, y, z]) => Ok(DVec3::new(*x, *y, *z)),
                    _ => Err(fault(place, format!("`{word}` is no point"))),
                }
            };
            let matrix = match step.tag_name().name() {
                "translate" => DMat4::from_translation(self.vector(step, 0.0, place)?),
                "scale" => DMat4::from_scale(self.vector(step, 1.0, place)?),
                "rotate" => {
                    let word = self.needed(step, "angle", place)?;
                    let angle: f64 = word
                        .trim()
                        .parse()
                        .map_err(|_| fault(place, "angle is no number"))?;
                    let axis = self.vector(step, 0.0, place)?.try_normalize();
                    let axis = axis.ok_or_else(|| fault(place, "the axis has no direction"))?;
                    DMat4::from_axis_angle(axis, angle.to_radians())
                }
                "lookat" | "lookAt" | "look_at" => {
                    let up = match step.has_attribute("up") {
                        true => point("up")?,
                        false => DVec3::ZERO,
                    };
                    look_at(point("origin")?, point("target")?, up)
                        .ok_or_else(|| fault(place, "looks nowhere"))?
                }
                "matrix" => {
                    let word = self.needed(step, "value", place)?;
                    matrix(&numbers(&word).unwrap_or_default())
                        .ok_or_else(|| fault(place, "a matrix has 16 or 9 numbers"))?
                }
                other => return Err(fault(place, format!("<{other}> is no transform"))),
            };
            out = matrix * out;
            if !out.is_finite() {
                return Err(fault(place, "its transform is not finite"));
            }
        }
        Ok(out)
    }
}

/// Finite numbers separated by commas, semicolons or white space.
pub(super) fn numbers(text: &str) -> Option<Vec<f64>> {
    let words = text
        .split([',', ' ', '\t', '\n', '\r', ';'])
        .filter(|w| !w.is_empty());
    let all: Option<Vec<f64>> = words.map(|w| w.parse().ok()).collect();
    all.filter(|all| all.iter().all(|x| x.is_finite()))
}

/// A colour: three numbers, one for all channels, or six hexadecimal digits, sRGB encoded.
pub(super) fn rgb(text: &str) -> Option<[f32; 3]> {
    if let Some(digits) = text.trim().strip_prefix('#') {
        let code = u32::from_str_radix(digits, 16)
            .ok()
            .filter(|_| digits.len() == 6)?;
        let channel = |shift: u32| (code >> shift & 255) as f32 / 255.0;
        return Some([16, 8, 0].map(|s| crate::build::colour::linear(channel(s))));
    }
    match numbers(text)?.as_slice() {
        [x] => Some([*x as f32; 3]),
        [r, g, b] => Some([*r as f32, *g as f32, *b as f32]),
        _ => None,
    }
}

fn matrix(n: &[f64]) -> Option<DMat4> {
    let row = |i: usize| DVec4::new(n[4 * i], n[4 * i + 1], n[4 * i + 2], n[4 * i + 3]);
    match n.len() {
        16 => Some(DMat4::from_cols(row(0), row(1), row(2), row(3)).transpose()),
        9 => {
            let row = |i: usize| DVec4::new(n[3 * i], n[3 * i + 1], n[3 * i + 2], 0.0);
            Some(DMat4::from_cols(row(0), row(1), row(2), DVec4::W).transpose())
        }
        _ => None,
    }
}

/// The pose of an object at `origin` that looks along +z at `target`, with +x to its left.
fn look_at(origin: DVec3, target: DVec3, up: DVec3) -> Option<DMat4> {
    let dir = (target - origin).try_normalize()?;
    let other = || dir.any_orthonormal_vector();
    let left = up.cross(dir).try_normalize().unwrap_or_else(other);
    let up = dir.cross(left);
    let column = |v: DVec3| v.extend(0.0);
    Some(DMat4::from_cols(
        column(left),
        column(up),
        column(dir),
        origin.extend(1.0),
    ))
}
