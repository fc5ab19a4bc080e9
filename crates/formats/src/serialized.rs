//! Mitsuba's `.serialized` meshes: one zlib stream per shape, and a table of their offsets at the end.

use opsr::math::{Vec2, Vec3};
use opsr::memory;
use opsr::scene::Mesh;
use opsr::scene::load::error::{Result, fault};

/// Most vertices or triangles.
const MAX_ITEMS: u64 = 1 << 26;

struct Body<'a> {
    bytes: &'a [u8],
    place: &'a str,
}

impl Body<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N]> {
        let ends = || fault(self.place, "ends before its last value");
        let (head, rest) = self.bytes.split_at_checked(N).ok_or_else(ends)?;
        self.bytes = rest;
        head.try_into().map_err(|_| ends())
    }

    fn floats<const N: usize>(&mut self, double: bool) -> Result<[f32; N]> {
        let mut out = [0.0; N];
        for x in &mut out {
            *x = match double {
                true => f64::from_le_bytes(self.take()?) as f32,
                false => f32::from_le_bytes(self.take()?),
            };
        }
        Ok(out)
    }
}

/// Reads the shape with this index.
pub(super) fn read(bytes: &[u8], place: &str, shape: usize) -> Result<Mesh> {
    let bad = |what: &str| fault(place, what);
    let word = |at: usize| {
        let four = bytes.get(at..at.checked_add(4)?)?;
        Some(u32::from_le_bytes(four.try_into().ok()?) as usize)
    };
    let version = bytes.get(2..4).map(|b| u16::from_le_bytes([b[0], b[1]]));
    if bytes.get(..2) != Some(&[0x1c, 0x04]) {
        return Err(bad("is no serialized mesh"));
    }
    let wide = version == Some(4);
    let last = bytes.len().checked_sub(4).and_then(word);
    let count = last
        .filter(|&n| shape < n)
        .ok_or_else(|| bad("has no shape of this index"))?;
    let entry = if wide { 8 } else { 4 };
    let table = (count.checked_mul(entry)).and_then(|size| (bytes.len() - 4).checked_sub(size));
    let table = table.ok_or_else(|| bad("is cut off"))?;
    let start = word(table + shape * entry).ok_or_else(|| bad("is cut off"))?;
    let packed = bytes
        .get(start.saturating_add(4)..)
        .ok_or_else(|| bad("is cut off"))?;
    let body = super::inflated(flate2::read::ZlibDecoder::new(packed), place)?;
    mesh(
        &mut Body {
            bytes: &body,
            place,
        },
        wide,
    )
}

fn mesh(body: &mut Body<'_>, named: bool) -> Result<Mesh> {
    let flags = u32::from_le_bytes(body.take()?);
    while named && body.take::<1>()? != [0] {}
    let (double, has) = (flags & 0x2000 != 0, |flag: u32| flags & flag != 0);
    let vertices = u64::from_le_bytes(body.take()?);
    let triangles = u64::from_le_bytes(body.take()?);
    if vertices.max(triangles) > MAX_ITEMS || vertices * 12 > body.bytes.len() as u64 {
        return Err(fault(
            body.place,
            "more vertices or triangles than it holds",
        ));
    }
    memory::check(body.place, 48 * vertices + 12 * triangles)?;
    let mut mesh = Mesh::default();
    for _ in 0..vertices {
        mesh.positions.push(Vec3::from(body.floats::<3>(double)?));
    }
    if mesh.positions.iter().any(|p| !p.is_finite()) {
        return Err(fault(body.place, "a vertex is not finite"));
    }
    if has(0x1) {
        for _ in 0..vertices {
            mesh.normals
                .push(Vec3::from(body.floats::<3>(double)?).normalize_or_zero());
        }
    }
    if has(0x2) {
        for _ in 0..vertices {
            mesh.uvs.push(Vec2::from(body.floats::<2>(double)?));
        }
    }
    if has(0x8) {
        for _ in 0..vertices {
            body.floats::<3>(double)?;
        }
    }
    for _ in 0..triangles {
        let mut face = [0; 3];
        for i in &mut face {
            *i = u32::from_le_bytes(body.take()?);
        }
        if face.iter().any(|&i| u64::from(i) >= vertices) {
            return Err(fault(body.place, "an index beyond the vertices"));
        }
        mesh.indices.push(face);
    }
    if has(0x10) {
        mesh.normals.clear();
    }
    Ok(mesh)
}
