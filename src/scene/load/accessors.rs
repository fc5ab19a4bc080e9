//! Reads typed numbers from buffers: strides, normalised integers, sparse overrides. Every length is checked before a
//! byte is read or a vector allocated.

use super::error::{Result, fault, place};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Root, accessor};
use std::borrow::Cow;

/// Most elements of an accessor without a buffer view.
const MAX_UNBACKED: u64 = 1 << 20;

/// A file's buffers and the views and accessors into them.
pub(super) struct Data<'a> {
    pub(super) root: &'a Root,
    pub(super) buffers: Vec<Cow<'a, [u8]>>,
    /// True if KHR_mesh_quantization is in use.
    pub(super) quantised: bool,
}

/// An accessor whose lengths have been checked.
struct Layout<'a> {
    place: String,
    component: ComponentType,
    kind: Type,
    normalised: bool,
    count: usize,
    /// Bytes from the first element on, and the stride between elements.
    base: Option<(&'a [u8], usize)>,
    /// Bytes of the indices and their type; bytes of the values.
    sparse: Option<(&'a [u8], ComponentType, &'a [u8])>,
}

impl Data<'_> {
    /// The bytes of a buffer view.
    pub(super) fn view(&self, index: usize) -> Result<&[u8]> {
        let place = format!("bufferViews[{index}]");
        let Some(view) = self.root.buffer_views.get(index) else {
            return Err(fault(place, "does not exist"));
        };
        let number = view.buffer.value();
        let Some(buffer) = self.buffers.get(number) else {
            return Err(fault(
                place,
                format!("names buffer {number}, which does not exist"),
            ));
        };
        let (start, length) = (view.byte_offset.unwrap_or_default().0, view.byte_length.0);
        slice(buffer, start, length).ok_or_else(|| {
            let what = format!(
                "its {length} bytes from {start} pass the end of buffers[{number}], which has {}",
                buffer.len()
            );
            fault(place, what)
        })
    }

    /// Checks every view and accessor of the file, used or not.
    pub(super) fn check(&self) -> Result<()> {
        (0..self.root.buffer_views.len()).try_for_each(|i| self.view(i).map(drop))?;
        (0..self.root.accessors.len()).try_for_each(|i| self.layout(i).map(drop))
    }

    /// Number of elements of an accessor.
    pub(super) fn count(&self, index: usize) -> u64 {
        self.root.accessors.get(index).map_or(0, |a| a.count.0)
    }

    /// Vectors of `N` components.
    pub(super) fn floats<const N: usize>(
        &self,
        index: usize,
        allowed: &[ComponentType],
    ) -> Result<Vec<[f32; N]>> {
        let kind = [Type::Scalar, Type::Vec2, Type::Vec3, Type::Vec4][N - 1];
        let layout = self.layout_of(index, kind)?;
        let component = layout.component;
        let unextended = component == ComponentType::F32
            || N == 2
                && layout.normalised
                && matches!(component, ComponentType::U8 | ComponentType::U16);
        if !allowed.contains(&component) || !(unextended || self.quantised) {
            let what = format!("component type {component:?} is not allowed here");
            let hint = if allowed.contains(&component) {
                " without KHR_mesh_quantization"
            } else {
                ""
            };
            return Err(fault(layout.place, what + hint));
        }
        layout.numbers()
    }

    /// Vectors of `N` components, floats or normalised integers, as animations and weights of joints have them.
    pub(super) fn normalised<const N: usize>(&self, index: usize) -> Result<Vec<[f32; N]>> {
        let kind = [Type::Scalar, Type::Vec2, Type::Vec3, Type::Vec4][N - 1];
        let layout = self.layout_of(index, kind)?;
        let component = layout.component;
        if component == ComponentType::U32 || component != ComponentType::F32 && !layout.normalised
        {
            let what = format!("component type {component:?} is not allowed here");
            return Err(fault(layout.place, what));
        }
        layout.numbers()
    }

    /// Number of components of an accessor's vectors: 3 for VEC3, else 4.
    pub(super) fn components(&self, index: usize) -> Result<usize> {
        Ok(if self.layout(index)?.kind == Type::Vec3 {
            3
        } else {
            4
        })
    }

    /// Column-major matrices of floats.
    pub(super) fn matrices(&self, index: usize) -> Result<Vec<[f32; 16]>> {
        let layout = self.layout_of(index, Type::Mat4)?;
        match layout.component {
            ComponentType::F32 => layout.numbers(),
            other => {
                let what = format!("component type {other:?} is not allowed here");
                Err(fault(layout.place, what))
            }
        }
    }

    /// Indices of joints, four per vertex.
    pub(super) fn joints(&self, index: usize) -> Result<Vec<[u32; 4]>> {
        let layout = self.layout_of(index, Type::Vec4)?;
        let component = layout.component;
        if !matches!(component, ComponentType::U8 | ComponentType::U16) {
            let what = format!("component type {component:?} is not allowed here");
            return Err(fault(layout.place, what));
        }
        let size = component.size();
        layout.read([0; 4], |bytes| {
            std::array::from_fn(|i| unsigned(component, &bytes[i * size..]))
        })
    }

    /// The layout of an accessor that must have this type.
    fn layout_of(&self, index: usize, kind: Type) -> Result<Layout<'_>> {
        let layout = self.layout(index)?;
        if layout.kind != kind {
            let what = format!("is a {:?}, not the {kind:?} its use asks for", layout.kind);
            return Err(fault(layout.place, what));
        }
        Ok(layout)
    }

    /// Indices of triangle corners.
    pub(super) fn indices(&self, index: usize) -> Result<Vec<u32>> {
        let layout = self.layout(index)?;
        let component = layout.component;
        let whole = matches!(
            component,
            ComponentType::U8 | ComponentType::U16 | ComponentType::U32
        );
        if layout.kind != Type::Scalar || !whole {
            let what = format!(
                "indices must be unsigned scalars, not {:?} of {component:?}",
                layout.kind
            );
            return Err(fault(layout.place, what));
        }
        layout.read(0, |bytes| unsigned(component, bytes))
    }

    fn layout(&self, index: usize) -> Result<Layout<'_>> {
        let Some(accessor) = self.root.accessors.get(index) else {
            return Err(fault(format!("accessors[{index}]"), "does not exist"));
        };
        let place = place("accessors", index, accessor.name.as_ref());
        let (Checked::Valid(component), Checked::Valid(kind)) =
            (accessor.component_type, accessor.type_)
        else {
            return Err(fault(place, "unknown type or componentType"));
        };
        let (component, count) = (component.0, accessor.count.0);
        let element = (component.size() * kind.multiplicity()) as u64;
        if accessor.buffer_view.is_none() && count > MAX_UNBACKED {
            return Err(fault(
                place,
                format!("{count} elements without a bufferView are too many"),
            ));
        }
        let base = (accessor.buffer_view.as_ref())
            .map(|view| {
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let stride = self
                    .root
                    .buffer_views
                    .get(view.value())
                    .and_then(|v| v.byte_stride);
                let stride = stride.map_or(element, |s| s.0 as u64);
                self.run(view.value(), offset, count, stride, element, &place)
                    .map(|bytes| (bytes, stride as usize))
            })
            .transpose()?;
        let sparse = (accessor.sparse.as_ref())
            .map(|s| self.sparse(s, count, element, &place))
            .transpose()?;
        Ok(Layout {
            place,
            component,
            kind,
            normalised: accessor.normalized,
            count: count as usize,
            base,
            sparse,
        })
    }

    /// The bytes of `count` elements.
    fn run(
        &self,
        view: usize,
        offset: u64,
        count: u64,
        stride: u64,
        element: u64,
        place: &str,
    ) -> Result<&[u8]> {
        if stride < element {
            return Err(fault(
                place,
                format!("byteStride {stride} is below the {element} bytes of an element"),
            ));
        }
        let bytes = self.view(view)?;
        let length = match count {
            0 => Some(0),
            _ => (count - 1)
                .checked_mul(stride)
                .and_then(|n| n.checked_add(element)),
        };
        length.and_then(|length| slice(bytes, offset, length)).ok_or_else(|| {
            let what = format!(
                "{count} elements from byte {offset} pass the end of bufferViews[{view}], which has {} bytes",
                bytes.len()
            );
            fault(place, what)
        })
    }

    fn sparse(
        &self,
        sparse: &accessor::sparse::Sparse,
        count: u64,
        element: u64,
        place: &str,
    ) -> Result<(&[u8], ComponentType, &[u8])> {
        let number = sparse.count.0;
        if number > count {
            return Err(fault(
                format!("{place}.sparse"),
                format!("{number} overrides of {count} elements"),
            ));
        }
        let Checked::Valid(component) = sparse.indices.component_type else {
            return Err(fault(
                format!("{place}.sparse.indices"),
                "unknown componentType",
            ));
        };
        let size = component.0.size() as u64;
        let at = format!("{place}.sparse.indices");
        let view = sparse.indices.buffer_view.value();
        let indices = self.run(view, sparse.indices.byte_offset.0, number, size, size, &at)?;
        let at = format!("{place}.sparse.values");
        let view = sparse.values.buffer_view.value();
        let values = self.run(
            view,
            sparse.values.byte_offset.0,
            number,
            element,
            element,
            &at,
        )?;
        Ok((indices, component.0, values))
    }
}

impl Layout<'_> {
    /// Elements of `N` components as numbers.
    fn numbers<const N: usize>(&self) -> Result<Vec<[f32; N]>> {
        let (component, normalised) = (self.component, self.normalised);
        let size = component.size();
        self.read([0.0; N], |bytes| {
            std::array::from_fn(|i| number(component, normalised, &bytes[i * size..]))
        })
    }

    fn read<T: Copy>(&self, zero: T, decode: impl Fn(&[u8]) -> T) -> Result<Vec<T>> {
        let mut out: Vec<T> = match self.base {
            Some((bytes, stride)) => (0..self.count)
                .map(|i| decode(&bytes[i * stride..]))
                .collect(),
            None => vec![zero; self.count],
        };
        let Some((indices, component, values)) = self.sparse else {
            return Ok(out);
        };
        let element = self.component.size() * self.kind.multiplicity();
        let indices = indices
            .chunks_exact(component.size())
            .map(|b| unsigned(component, b));
        let mut least = 0;
        for (index, value) in indices.zip(values.chunks_exact(element)) {
            let index = index as usize;
            if index < least || index >= out.len() {
                let what = format!("index {index} is out of order or not below {}", out.len());
                return Err(fault(format!("{}.sparse.indices", self.place), what));
            }
            least = index + 1;
            out[index] = decode(value);
        }
        Ok(out)
    }
}

fn slice(bytes: &[u8], start: u64, length: u64) -> Option<&[u8]> {
    let start = usize::try_from(start).ok()?;
    let end = start.checked_add(usize::try_from(length).ok()?)?;
    bytes.get(start..end)
}

/// The first `N` bytes; the layout guarantees that they exist.
#[inline]
fn first<const N: usize>(bytes: &[u8]) -> [u8; N] {
    bytes.first_chunk().copied().unwrap_or([0; N])
}

fn unsigned(component: ComponentType, bytes: &[u8]) -> u32 {
    match component {
        ComponentType::U8 | ComponentType::I8 => u32::from(bytes[0]),
        ComponentType::U16 | ComponentType::I16 => u32::from(u16::from_le_bytes(first(bytes))),
        ComponentType::U32 | ComponentType::F32 => u32::from_le_bytes(first(bytes)),
    }
}

/// One component as `f32`; normalised integers by `[glTF §3.11]`.
#[inline]
fn number(component: ComponentType, normalised: bool, bytes: &[u8]) -> f32 {
    let (value, one) = match component {
        ComponentType::F32 => return f32::from_le_bytes(first(bytes)),
        ComponentType::I8 => (f32::from(i8::from_le_bytes(first(bytes))), 127.0),
        ComponentType::U8 => (f32::from(bytes[0]), 255.0),
        ComponentType::I16 => (f32::from(i16::from_le_bytes(first(bytes))), 32_767.0),
        ComponentType::U16 => (f32::from(u16::from_le_bytes(first(bytes))), 65_535.0),
        ComponentType::U32 => (u32::from_le_bytes(first(bytes)) as f32, u32::MAX as f32),
    };
    if normalised {
        (value / one).max(-1.0)
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_normalised_integers_reach_both_ends() {
        let of = |c, bytes: &[u8]| number(c, true, bytes);
        assert_eq!(of(ComponentType::I8, &[127]), 1.0);
        assert_eq!(of(ComponentType::I8, &[0x81]), -1.0);
        assert_eq!(of(ComponentType::I8, &[0x80]), -1.0);
        assert_eq!(of(ComponentType::U8, &[255]), 1.0);
        assert_eq!(of(ComponentType::I16, &[0xff, 0x7f]), 1.0);
        assert_eq!(of(ComponentType::I16, &[0x00, 0x80]), -1.0);
        assert_eq!(of(ComponentType::U16, &[0xff, 0xff]), 1.0);
        assert_eq!(number(ComponentType::U16, false, &[0x01, 0x10]), 4097.0);
        assert_eq!(number(ComponentType::I8, false, &[0x80]), -128.0);
    }
}
