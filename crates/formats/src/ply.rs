//! PLY meshes: text, or binary of either byte order. Polygons become fans, also quads (bilinear patches in pbrt).

use crate::build::colour::linear;
use opsr::math::{Vec2, Vec3};
use opsr::memory;
use opsr::scene::Mesh;
use opsr::scene::load::error::{Result, fault};

/// Most elements of a kind.
const MAX_ELEMENTS: usize = 1 << 26;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Format {
    Text,
    Little,
    Big,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }
}

struct Property {
    name: String,
    kind: Type,
    /// Type of the length, for a list.
    list: Option<Type>,
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

/// The rest of the body, read value by value.
struct Body<'a> {
    bytes: &'a [u8],
    format: Format,
    place: &'a str,
}

impl Body<'_> {
    fn number(&mut self, kind: Type) -> Result<f64> {
        let ends = || fault(self.place, "ends before its last element");
        if self.format == Format::Text {
            let start = (self.bytes.iter()).position(|b| !b.is_ascii_whitespace());
            let rest = &self.bytes[start.ok_or_else(ends)?..];
            let end = (rest.iter())
                .position(u8::is_ascii_whitespace)
                .unwrap_or(rest.len());
            let word = std::str::from_utf8(&rest[..end]).ok();
            let number = word.and_then(|w| w.parse().ok());
            let number = number.ok_or_else(|| fault(self.place, "a word that is no number"))?;
            self.bytes = &rest[end..];
            return Ok(number);
        }
        macro_rules! take {
            ($type:ty) => {{
                const N: usize = size_of::<$type>();
                let (head, rest) = self.bytes.split_at_checked(N).ok_or_else(ends)?;
                self.bytes = rest;
                let array: [u8; N] = head.try_into().map_err(|_| ends())?;
                match self.format {
                    Format::Big => <$type>::from_be_bytes(array) as f64,
                    _ => <$type>::from_le_bytes(array) as f64,
                }
            }};
        }
        Ok(match kind {
            Type::I8 => take!(i8),
            Type::U8 => take!(u8),
            Type::I16 => take!(i16),
            Type::U16 => take!(u16),
            Type::I32 => take!(i32),
            Type::U32 => take!(u32),
            Type::F32 => take!(f32),
            Type::F64 => take!(f64),
        })
    }
}

/// Reads a mesh.
pub(super) fn read(bytes: &[u8], place: &str) -> Result<Mesh> {
    let (elements, format, body) = header(bytes, place)?;
    let mut body = Body {
        bytes: body,
        format,
        place,
    };
    let mut mesh = Mesh::default();
    for element in &elements {
        let least = element.properties.len().max(1);
        if element.count > MAX_ELEMENTS || element.count.saturating_mul(least) > body.bytes.len() {
            let what = format!(
                "{} elements `{}` are more than the file holds",
                element.count, element.name
            );
            return Err(fault(place, what));
        }
        memory::check(place, 80 * element.count as u64)?;
        match element.name.as_str() {
            "vertex" => vertices(&mut body, element, &mut mesh)?,
            "face" => faces(&mut body, element, &mut mesh)?,
            _ => {
                for _ in 0..element.count {
                    values(&mut body, element, |_, _| ())?;
                }
            }
        }
    }
    let n = mesh.positions.len();
    match mesh.indices.iter().flatten().find(|&&i| i as usize >= n) {
        Some(i) => Err(fault(
            place,
            format!("index {i} is not below the {n} vertices"),
        )),
        None => Ok(mesh),
    }
}

fn header<'a>(bytes: &'a [u8], place: &str) -> Result<(Vec<Element>, Format, &'a [u8])> {
    let bad = |what: String| fault(place, what);
    if !bytes.starts_with(b"ply") {
        return Err(bad("is no PLY file".into()));
    }
    let (mut elements, mut format, mut rest): (Vec<Element>, _, _) = (Vec::new(), None, bytes);
    for number in 1..10_000 {
        let end = rest.iter().position(|&b| b == b'\n');
        let end = end.ok_or_else(|| bad("its header does not end".into()))?;
        let line = String::from_utf8_lossy(&rest[..end]);
        rest = &rest[end + 1..];
        let words: Vec<&str> = line.split_whitespace().collect();
        let wrong = || bad(format!("line {number} of its header: `{}`", line.trim()));
        match words.as_slice() {
            ["end_header"] => {
                let format = format.ok_or_else(|| bad("has no format".into()))?;
                return Ok((elements, format, rest));
            }
            ["format", name, ..] => {
                format = Some(match *name {
                    "ascii" => Format::Text,
                    "binary_little_endian" => Format::Little,
                    "binary_big_endian" => Format::Big,
                    _ => return Err(wrong()),
                });
            }
            ["element", name, count] => elements.push(Element {
                name: (*name).into(),
                count: count.parse().map_err(|_| wrong())?,
                properties: Vec::new(),
            }),
            ["property", "list", length, kind, name] => {
                let property = Property {
                    name: (*name).into(),
                    kind: Type::named(kind).ok_or_else(wrong)?,
                    list: Some(Type::named(length).ok_or_else(wrong)?),
                };
                elements
                    .last_mut()
                    .ok_or_else(wrong)?
                    .properties
                    .push(property);
            }
            ["property", kind, name] => {
                let property = Property {
                    name: (*name).into(),
                    kind: Type::named(kind).ok_or_else(wrong)?,
                    list: None,
                };
                elements
                    .last_mut()
                    .ok_or_else(wrong)?
                    .properties
                    .push(property);
            }
            _ => {}
        }
    }
    Err(bad("its header does not end".into()))
}

/// Passes the values of an element to `take`: index of the property, and a value.
fn values(body: &mut Body<'_>, element: &Element, mut take: impl FnMut(usize, f64)) -> Result<()> {
    for (i, property) in element.properties.iter().enumerate() {
        let count = match property.list {
            None => 1,
            Some(kind) => body.number(kind)? as usize,
        };
        for _ in 0..count {
            take(i, body.number(property.kind)?);
        }
    }
    Ok(())
}

fn vertices(body: &mut Body<'_>, element: &Element, mesh: &mut Mesh) -> Result<()> {
    let find = |names: &[&str]| {
        let named = |p: &Property| names.contains(&p.name.as_str()) && p.list.is_none();
        element.properties.iter().position(named)
    };
    let all = |names: &[&[&str]]| names.iter().map(|n| find(n)).collect::<Option<Vec<_>>>();
    let places = all(&[&["x"], &["y"], &["z"]]);
    let places = places.ok_or_else(|| fault(body.place, "its vertices have no x, y, z"))?;
    let normals = all(&[&["nx"], &["ny"], &["nz"]]);
    let uvs = all(&[
        &["u", "s", "texture_u", "texture_s"],
        &["v", "t", "texture_v", "texture_t"],
    ]);
    let colors = all(&[&["r", "red"], &["g", "green"], &["b", "blue"]]);
    let bytes = colors
        .as_ref()
        .is_some_and(|c| element.properties[c[0]].kind == Type::U8);
    let mut row = vec![0.0f32; element.properties.len()];
    for _ in 0..element.count {
        values(body, element, |i, value| row[i] = value as f32)?;
        let three = |at: &[usize]| Vec3::new(row[at[0]], row[at[1]], row[at[2]]);
        let position = three(&places);
        if !position.is_finite() {
            return Err(fault(
                body.place,
                format!("vertex {} is not finite", mesh.positions.len()),
            ));
        }
        mesh.positions.push(position);
        if let Some(at) = &normals {
            mesh.normals.push(three(at).normalize_or_zero());
        }
        if let Some(at) = &uvs {
            mesh.uvs.push(Vec2::new(row[at[0]], row[at[1]]));
        }
        if let Some(at) = &colors {
            let color = match bytes {
                true => (three(at) / 255.0).map(linear),
                false => three(at),
            };
            mesh.colors.push(color.extend(1.0));
        }
    }
    Ok(())
}

fn faces(body: &mut Body<'_>, element: &Element, mesh: &mut Mesh) -> Result<()> {
    let named = |p: &Property| ["vertex_indices", "vertex_index"].contains(&p.name.as_str());
    let at = element.properties.iter().position(named);
    let at = at.ok_or_else(|| fault(body.place, "its faces have no vertex_indices"))?;
    let mut corners: Vec<u32> = Vec::new();
    for _ in 0..element.count {
        corners.clear();
        values(body, element, |i, value| {
            if i == at {
                corners.push(if value >= 0.0 { value as u32 } else { u32::MAX });
            }
        })?;
        for pair in corners.get(1..).unwrap_or_default().windows(2) {
            mesh.indices.push([corners[0], pair[0], pair[1]]);
        }
        if mesh.indices.len() > MAX_ELEMENTS {
            return Err(fault(body.place, "too many triangles"));
        }
    }
    Ok(())
}
