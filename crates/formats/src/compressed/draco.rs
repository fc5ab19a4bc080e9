//! `KHR_draco_mesh_compression`: primitives with indices and attributes in a Draco stream.

use super::{append, bytes, number};
use draco_core::{
    DataType, DecodeLimits, DecoderBuffer, Mesh, MeshDecoder, PointAttribute, PointIndex,
};
use gltf::json::accessor::{ComponentType, GenericComponentType};
use gltf::json::mesh::{Mode, Primitive};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{Accessor, Index, Root};
use opsr::scene::load::codecs::Buffers;
use opsr::scene::load::error::{Result, fault};
use serde_json::{Map, Value};
use std::collections::HashMap;

pub(super) const EXTENSION: &str = "KHR_draco_mesh_compression";

/// Most points, and most faces, of a primitive.
const MAX_VALUES: u64 = 1 << 26;

/// Accessors that are already filled, each with the buffer view of its Draco stream.
type Filled = HashMap<usize, u64>;

/// Fills accessors that only a Draco stream has data for. Files may have both; accessors with data stay as they are.
pub(super) fn unpack(root: &mut Root, buffers: &mut Buffers<'_>) -> Result<()> {
    let mut filled = Filled::new();
    for m in 0..root.meshes.len() {
        for p in 0..root.meshes[m].primitives.len() {
            let at = format!("meshes[{m}].primitives[{p}].extensions.{EXTENSION}");
            let primitive = &mut root.meshes[m].primitives[p];
            let extensions = primitive.extensions.as_mut().map(|e| &mut e.others);
            let Some(packed) = extensions.and_then(|e| e.remove(EXTENSION)) else {
                continue;
            };
            let mut primitive = primitive.clone();
            let Value::Object(packed) = packed else {
                return Err(fault(at, "is no object"));
            };
            let stream = number(&packed, "bufferView", None, &at)?;
            let used = (primitive.attributes.values().copied()).chain(primitive.indices);
            // True if it has no data, or another stream's. Primitives with different materials may share a stream.
            let empty = |index: Index<Accessor>| match filled.get(&index.value()) {
                Some(by) => *by != stream,
                None => {
                    let accessor = root.accessors.get(index.value());
                    accessor.is_some_and(|a| a.buffer_view.is_none())
                }
            };
            match used.into_iter().any(empty) {
                true => fill(
                    root,
                    buffers,
                    &mut primitive,
                    &packed,
                    stream,
                    &mut filled,
                    &at,
                )?,
                false if filled.values().any(|by| *by == stream) => {
                    primitive.mode = Checked::Valid(Mode::Triangles);
                }
                false => {}
            }
            root.meshes[m].primitives[p] = primitive;
        }
    }
    Ok(())
}

/// Decodes the stream of a primitive into accessors.
fn fill(
    root: &mut Root,
    buffers: &mut Buffers<'_>,
    primitive: &mut Primitive,
    packed: &Map<String, Value>,
    stream: u64,
    filled: &mut Filled,
    at: &str,
) -> Result<()> {
    if !matches!(
        primitive.mode,
        Checked::Valid(Mode::Triangles | Mode::TriangleStrip)
    ) {
        return Err(fault(at, "only triangles and strips can be compressed"));
    }
    let view = usize::try_from(stream)
        .ok()
        .and_then(|i| root.buffer_views.get(i));
    let Some(view) = view else {
        return Err(fault(at, format!("bufferViews[{stream}] does not exist")));
    };
    let (start, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
    let source = bytes(buffers, view.buffer.value() as u64, start, length, at)?;
    let Some(Value::Object(ids)) = packed.get("attributes") else {
        return Err(fault(at, "`attributes` is missing"));
    };
    let declared = primitive.attributes.values().map(|i| i.value());
    let declared = declared
        .filter_map(|i| root.accessors.get(i))
        .map(|a| a.count.0);
    let corners = primitive
        .indices
        .and_then(|i| root.accessors.get(i.value()));
    let mesh = decoded(
        source,
        declared.max().unwrap_or(0),
        corners.map_or(0, |a| a.count.0),
        ids.len() as u64,
        at,
    )?;
    let points = mesh.num_points();
    if let Some(i) = primitive.indices {
        let corners = (mesh.faces().iter().flatten())
            .flat_map(|p| p.0.to_le_bytes())
            .collect();
        let made = Made {
            bytes: corners,
            count: 3 * mesh.num_faces(),
            component: ComponentType::U32,
        };
        primitive.indices = Some(given(root, buffers, i, made, stream, filled, at)?);
    } else if points > 0 {
        return Err(fault(at, "the primitive has no `indices`"));
    }
    primitive.mode = Checked::Valid(Mode::Triangles);
    for (semantic, index) in &mut primitive.attributes {
        let name = semantic.to_string();
        let Some(id) = ids.get(&name) else {
            continue;
        };
        let made = of_attribute(&mesh, root, *index, id)
            .map_err(|what| fault(at, format!("{name}: {what}")))?;
        *index = given(root, buffers, *index, made, stream, filled, at)?;
    }
    Ok(())
}

/// Decodes a stream, of at most twice the declared points and corners: seams of attributes split points.
fn decoded(source: &[u8], points: u64, corners: u64, attributes: u64, at: &str) -> Result<Mesh> {
    let twice = |n: u64| n.saturating_mul(2).saturating_add(1024);
    let (points, faces) = (twice(points), twice(corners / 3));
    if points > MAX_VALUES || faces > MAX_VALUES {
        return Err(fault(at, format!("more than {MAX_VALUES} points or faces")));
    }
    // Four numbers per attribute, in the output and in the decoder, and tables of corners.
    let needed = points * 32 * (attributes + 1) + faces * 100;
    opsr::memory::check(format!("the points and faces of {at}"), needed)?;
    let limits = DecodeLimits::default()
        .with_max_points(points)
        .with_max_faces(faces)
        .with_max_decoded_bytes(needed);
    let mut mesh = Mesh::new();
    let mut buffer = DecoderBuffer::new(source).with_limits(limits);
    (MeshDecoder::new().decode(&mut buffer, &mut mesh))
        .map_err(|e| fault(at, format!("cannot be decoded: {}", e.message())))?;
    Ok(mesh)
}

/// Data of a stream for an accessor.
struct Made {
    bytes: Vec<u8>,
    count: usize,
    component: ComponentType,
}

/// The attribute `id` of a stream in the type of an accessor.
fn of_attribute(
    mesh: &Mesh,
    root: &Root,
    index: Index<Accessor>,
    id: &Value,
) -> std::result::Result<Made, String> {
    let number = id.as_u64().and_then(|id| u32::try_from(id).ok());
    let attribute = number.and_then(|id| mesh.attribute_by_unique_id(id));
    let attribute = attribute.ok_or_else(|| format!("the stream has no attribute {id}"))?;
    let accessor = root.accessors.get(index.value());
    let types = accessor.map(|a| (a.component_type, a.type_));
    let Some((Checked::Valid(GenericComponentType(component)), Checked::Valid(kind))) = types
    else {
        return Err(format!("accessors[{index}] has no known type"));
    };
    let points = mesh.num_points();
    let bytes = values(attribute, points, component, kind.multiplicity())
        .ok_or_else(|| format!("the stream's attribute {id} is of another shape"))?;
    Ok(Made {
        bytes,
        count: points,
        component,
    })
}

/// Gives an accessor its data and returns its index; copies the accessor if another stream has filled it.
fn given(
    root: &mut Root,
    buffers: &mut Buffers<'_>,
    index: Index<Accessor>,
    made: Made,
    stream: u64,
    filled: &mut Filled,
    at: &str,
) -> Result<Index<Accessor>> {
    let i = index.value();
    if filled.get(&i) == Some(&stream) {
        return Ok(index);
    }
    let Some(accessor) = root.accessors.get(i) else {
        return Err(fault(at, format!("accessors[{i}] does not exist")));
    };
    let mut accessor = accessor.clone();
    let view = append(root, buffers, made.bytes, at)?;
    accessor.buffer_view = Some(Index::new(view as u32));
    accessor.byte_offset = None;
    accessor.sparse = None;
    accessor.count = USize64::from(made.count);
    accessor.component_type = Checked::Valid(GenericComponentType(made.component));
    let to = match filled.contains_key(&i) {
        true => {
            root.accessors.push(accessor);
            root.accessors.len() - 1
        }
        false => {
            root.accessors[i] = accessor;
            i
        }
    };
    filled.insert(to, stream);
    Ok(Index::new(to as u32))
}

/// The values of all points in an accessor's type; `None` with too few components, or a point without value.
fn values(
    attribute: &PointAttribute,
    points: usize,
    component: ComponentType,
    width: usize,
) -> Option<Vec<u8>> {
    let kind = attribute.data_type();
    let size = kind.byte_length();
    let stride = usize::try_from(attribute.byte_stride()).ok()?;
    if usize::from(attribute.num_components()) < width || size == 0 {
        return None;
    }
    let data = attribute.buffer().data();
    let mut out = Vec::with_capacity(points * width * component.size());
    for point in 0..points {
        let value = attribute.mapped_index(PointIndex(point as u32)).0 as usize;
        let start = value.checked_mul(stride)?;
        let element = data.get(start..start.checked_add(width * size)?)?;
        for bytes in element.chunks_exact(size) {
            put(scalar(kind, bytes)?, component, &mut out);
        }
    }
    Some(out)
}

/// A number of a stream. All types are exact except the 64-bit integers, which glTF does not have.
fn scalar(kind: DataType, b: &[u8]) -> Option<f64> {
    Some(match kind {
        DataType::Int8 => f64::from(b[0] as i8),
        DataType::Uint8 | DataType::Bool => f64::from(b[0]),
        DataType::Int16 => f64::from(i16::from_le_bytes(b.try_into().ok()?)),
        DataType::Uint16 => f64::from(u16::from_le_bytes(b.try_into().ok()?)),
        DataType::Int32 => f64::from(i32::from_le_bytes(b.try_into().ok()?)),
        DataType::Uint32 => f64::from(u32::from_le_bytes(b.try_into().ok()?)),
        DataType::Float32 => f64::from(f32::from_le_bytes(b.try_into().ok()?)),
        DataType::Int64 => i64::from_le_bytes(b.try_into().ok()?) as f64,
        DataType::Uint64 => u64::from_le_bytes(b.try_into().ok()?) as f64,
        DataType::Float64 => f64::from_le_bytes(b.try_into().ok()?),
        DataType::Invalid => return None,
    })
}

/// Appends a number, converted to an accessor's type.
fn put(value: f64, component: ComponentType, out: &mut Vec<u8>) {
    match component {
        ComponentType::I8 => out.extend((value as i8).to_le_bytes()),
        ComponentType::U8 => out.push(value as u8),
        ComponentType::I16 => out.extend((value as i16).to_le_bytes()),
        ComponentType::U16 => out.extend((value as u16).to_le_bytes()),
        ComponentType::U32 => out.extend((value as u32).to_le_bytes()),
        ComponentType::F32 => out.extend((value as f32).to_le_bytes()),
    }
}
