//! `EXT_meshopt_compression` and its successor `KHR_meshopt_compression` [Khronos, text of the extension; appendix A
//! has the bit stream, appendix B the filters]. The crate `meshopt` binds the C++ library and so needs more than a Rust
//! toolchain; a port in Rust has no version 1 of the stream.

use super::{bytes, number};
use gltf::json::{Index, Root};
use opsr::scene::load::codecs::Buffers;
use opsr::scene::load::error::{Result, fault};
use serde_json::{Map, Value};
use std::borrow::Cow;

/// Most elements of a view.
const MAX_ITEMS: u64 = 1 << 28;

/// Most bytes of a vertex.
const MAX_STRIDE: usize = 256;

/// Elements in a group of deltas.
const GROUP: usize = 16;

/// Entries of the queues of edges and of vertices.
const QUEUE: usize = 16;

/// Replaces the compressed views of a file by plain ones.
pub(super) fn unpack(root: &mut Root, buffers: &mut Buffers<'_>, extension: &str) -> Result<()> {
    for (i, view) in root.buffer_views.iter_mut().enumerate() {
        let extensions = view.extensions.as_ref().map(|e| &e.others);
        let Some(value) = extensions.and_then(|e| e.get(extension)) else {
            continue;
        };
        let at = format!("bufferViews[{i}].extensions.{extension}");
        let Value::Object(packed) = value else {
            return Err(fault(at, "is no object"));
        };
        let plain = decoded(packed, buffers, &at)?;
        if plain.len() as u64 != view.byte_length.0 {
            let what = format!("{} bytes of a view of {}", plain.len(), view.byte_length.0);
            return Err(fault(at, what));
        }
        view.buffer = Index::new(buffers.len() as u32);
        view.byte_offset = None;
        buffers.push(Cow::Owned(plain));
    }
    Ok(())
}

/// The bytes of a compressed view.
fn decoded(packed: &Map<String, Value>, buffers: &Buffers<'_>, at: &str) -> Result<Vec<u8>> {
    let of = |name| number(packed, name, None, at);
    let (start, length) = (
        number(packed, "byteOffset", Some(0), at)?,
        of("byteLength")?,
    );
    let source = bytes(buffers, of("buffer")?, start, length, at)?;
    let (count, stride) = (of("count")?, of("byteStride")?);
    if count > MAX_ITEMS || stride == 0 || stride > MAX_STRIDE as u64 {
        return Err(fault(at, format!("{count} elements of {stride} bytes")));
    }
    opsr::memory::check(format!("{count} elements of {at}"), 2 * count * stride)?;
    let (count, stride) = (count as usize, stride as usize);
    let text = |name| packed.get(name).and_then(Value::as_str);
    let (mode, filter) = (
        text("mode").unwrap_or_default(),
        text("filter").unwrap_or("NONE"),
    );
    let broken = || fault(at, "the compressed bytes are damaged");
    let indices = |list: Option<Vec<u32>>| {
        let list = list.ok_or_else(broken)?;
        Ok(match stride {
            2 => list
                .iter()
                .flat_map(|i| (*i as u16).to_le_bytes())
                .collect(),
            _ => list.iter().flat_map(|i| i.to_le_bytes()).collect(),
        })
    };
    match (mode, filter, stride) {
        ("TRIANGLES", "NONE", 2 | 4) if count % 3 == 0 => indices(triangles(source, count)),
        ("INDICES", "NONE", 2 | 4) => indices(sequence(source, count)),
        ("ATTRIBUTES", _, _) if stride % 4 == 0 => {
            let mut plain = attributes(source, count, stride).ok_or_else(broken)?;
            match (filter, stride) {
                ("NONE", _) => {}
                ("OCTAHEDRAL", 4) => each::<4>(&mut plain, |v| {
                    octahedral(v.map(byte), 127.0).map(|x| x as u8)
                }),
                ("OCTAHEDRAL", 8) => each_short(&mut plain, |v| octahedral(v, 32_767.0)),
                ("QUATERNION", 8) => each_short(&mut plain, quaternion),
                ("EXPONENTIAL", _) => each::<4>(&mut plain, exponential),
                ("COLOR", 4) => each::<4>(&mut plain, |v| {
                    color([v[0].into(), byte(v[1]), byte(v[2]), v[3].into()], 255.0)
                        .map(|x| x as u8)
                }),
                ("COLOR", 8) => each_short(&mut plain, |[y, orange, green, opacity]| {
                    color([y & 0xffff, orange, green, opacity & 0xffff], 65_535.0)
                }),
                _ => return Err(fault(at, format!("filter `{filter}` of {stride} bytes"))),
            }
            Ok(plain)
        }
        _ => {
            let what =
                format!("mode `{mode}`, filter `{filter}`, {count} elements of {stride} bytes");
            Err(fault(at, what))
        }
    }
}

/// The rest of a byte stream.
struct Stream<'a>(&'a [u8]);

impl<'a> Stream<'a> {
    fn take(&mut self, n: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(n)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        self.take(1).map(|b| b[0])
    }

    /// An unsigned number of one to five bytes, seven bits each (LEB128).
    fn varint(&mut self) -> Option<u32> {
        let mut value = 0u32;
        for i in 0..5 {
            let byte = self.byte()?;
            value |= u32::from(byte & 0x7f) << (7 * i);
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }
}

/// The signed difference encoded by an unsigned number whose lowest bit is the sign.
fn unzigzag(v: u32) -> u32 {
    match v & 1 {
        0 => v >> 1,
        _ => !(v >> 1),
    }
}

/// Attributes (mode 0): `count` elements of `stride` bytes.
pub(super) fn attributes(source: &[u8], count: usize, stride: usize) -> Option<Vec<u8>> {
    let mut stream = Stream(source);
    let is_version_1 = match stream.byte()? {
        0xa0 => false,
        0xa1 => true,
        _ => return None,
    };
    let channels = stride / 4;
    let tail = stride + if is_version_1 { channels } else { 0 };
    let padded = tail.max(if is_version_1 { 24 } else { 32 });
    let start = stream.0.len().checked_sub(padded)?;
    let (data, end) = stream.0.split_at(start);
    let (baseline, modes) = end[padded - tail..].split_at(stride);
    let mut stream = Stream(data);
    let mut last = [0u8; MAX_STRIDE];
    last[..stride].copy_from_slice(baseline);
    let mut out = vec![0; count * stride];
    let most = ((8192 / stride) & !(GROUP - 1)).min(256);
    let mut deltas = vec![[0u8; 256]; stride];
    for block in out.chunks_mut(most * stride) {
        let elements = block.len() / stride;
        let control = stream.take(if is_version_1 { channels } else { 0 })?;
        for (k, deltas) in deltas.iter_mut().enumerate() {
            let control = control.get(k / 4).map(|c| c >> (2 * (k % 4)) & 3);
            match control {
                Some(2) => deltas.fill(0),
                Some(3) => deltas[..elements].copy_from_slice(stream.take(elements)?),
                Some(0) => groups(&mut stream, &mut deltas[..], elements, [0, 1, 2, 4])?,
                Some(_) => groups(&mut stream, &mut deltas[..], elements, [1, 2, 4, 8])?,
                None => groups(&mut stream, &mut deltas[..], elements, [0, 2, 4, 8])?,
            }
        }
        for c in 0..channels {
            let mode = modes.get(c).copied().unwrap_or(0);
            if mode & 15 > 2 || mode & 15 < 2 && mode != mode & 15 {
                return None;
            }
            let mut before = [
                last[4 * c],
                last[4 * c + 1],
                last[4 * c + 2],
                last[4 * c + 3],
            ];
            for (i, element) in block.chunks_exact_mut(stride).enumerate() {
                let delta = [0, 1, 2, 3].map(|b| deltas[4 * c + b][i]);
                before = added(before, delta, mode);
                element[4 * c..4 * c + 4].copy_from_slice(&before);
            }
            last[4 * c..4 * c + 4].copy_from_slice(&before);
        }
    }
    stream.0.is_empty().then_some(out)
}

/// Four bytes of an element: the previous element's plus the differences, decoded by the mode of the channel.
fn added(before: [u8; 4], delta: [u8; 4], mode: u8) -> [u8; 4] {
    match mode & 15 {
        0 => std::array::from_fn(|b| before[b].wrapping_add(unzigzag(delta[b].into()) as u8)),
        1 => {
            let half = |b: usize| {
                let word = |v: [u8; 4]| u16::from_le_bytes([v[b], v[b + 1]]);
                word(before)
                    .wrapping_add(unzigzag(word(delta).into()) as u16)
                    .to_le_bytes()
            };
            let (low, high) = (half(0), half(2));
            [low[0], low[1], high[0], high[1]]
        }
        _ => {
            // The encoder rotates to the left.
            let turned = u32::from_le_bytes(delta).rotate_right((mode >> 4).into());
            (u32::from_le_bytes(before) ^ turned).to_le_bytes()
        }
    }
}

/// Differences of one byte of the elements of a block, in groups. A header gives the bits per difference of each group.
fn groups(
    stream: &mut Stream<'_>,
    out: &mut [u8],
    elements: usize,
    bits: [usize; 4],
) -> Option<()> {
    let count = elements.div_ceil(GROUP);
    let header = stream.take(count.div_ceil(4))?;
    for (g, group) in out.chunks_exact_mut(GROUP).take(count).enumerate() {
        let bits = bits[usize::from(header[g / 4] >> (2 * (g % 4)) & 3)];
        let packed = stream.take(2 * bits)?;
        if bits == 0 || bits == 8 {
            group.fill(0);
            group[..packed.len()].copy_from_slice(packed);
            continue;
        }
        let each = 8 / bits;
        let sentinel = (1u8 << bits) - 1;
        for (i, delta) in group.iter_mut().enumerate() {
            // Single bits are packed from the lowest bit up, pairs and fours from the highest down.
            let shift = match bits {
                1 => i % each,
                _ => (each - 1 - i % each) * bits,
            };
            let small = packed[i / each] >> shift & sentinel;
            *delta = if small == sentinel {
                stream.byte()?
            } else {
                small
            };
        }
    }
    Some(())
}

/// The last entries of a queue; the newest has number 0.
struct Queue<T> {
    entries: [Option<T>; QUEUE],
    next: usize,
}

impl<T: Copy> Queue<T> {
    fn new() -> Self {
        Self {
            entries: [None; QUEUE],
            next: 0,
        }
    }

    fn push(&mut self, entry: T) {
        self.entries[self.next] = Some(entry);
        self.next = (self.next + 1) % QUEUE;
    }

    /// Entry `i`; `None` if it was never written.
    fn get(&self, i: u8) -> Option<T> {
        self.entries[(self.next + QUEUE - 1 - usize::from(i)) % QUEUE]
    }
}

struct Triangles<'a> {
    data: Stream<'a>,
    next: u32,
    last: u32,
    vertices: Queue<u32>,
}

impl Triangles<'_> {
    fn fresh(&mut self) -> u32 {
        let index = self.next;
        self.next = index.wrapping_add(1);
        index
    }

    fn explicit(&mut self) -> Option<u32> {
        self.last = self.last.wrapping_add(unzigzag(self.data.varint()?));
        Some(self.last)
    }

    /// A corner by its four-bit code: 0 is a new vertex, 15 an explicit index if `explicit`, others are queued.
    fn corner(&mut self, code: u8, explicit: bool) -> Option<u32> {
        match code {
            0 => Some(self.fresh()),
            15 if explicit => self.explicit(),
            _ => self.vertices.get(code - 1),
        }
    }
}

/// Triangle indices (mode 1).
pub(super) fn triangles(source: &[u8], count: usize) -> Option<Vec<u32>> {
    let mut stream = Stream(source);
    if stream.byte()? != 0xe1 {
        return None;
    }
    let codes = stream.take(count / 3)?;
    let end = stream.0.len().checked_sub(16)?;
    let table = &stream.0[end..];
    if table.iter().any(|t| t >> 4 == 15 || t & 15 == 15) {
        return None;
    }
    let mut state = Triangles {
        data: Stream(&stream.0[..end]),
        next: 0,
        last: 0,
        vertices: Queue::new(),
    };
    let mut edges: Queue<(u32, u32)> = Queue::new();
    let mut out = Vec::with_capacity(count);
    for &code in codes {
        let (high, low) = (code >> 4, code & 15);
        if high < 15 {
            let (a, b) = edges.get(high)?;
            let c = match low {
                0 => state.fresh(),
                13 | 14 => {
                    state.last = state
                        .last
                        .wrapping_add(if low == 13 { u32::MAX } else { 1 });
                    state.last
                }
                15 => state.explicit()?,
                _ => state.vertices.get(low)?,
            };
            edges.push((c, b));
            edges.push((a, c));
            if low == 0 || low >= 13 {
                state.vertices.push(c);
            }
            out.extend([a, b, c]);
            continue;
        }
        let explicit = low >= 14;
        let corners = match explicit {
            true => state.data.byte()?,
            false => table[usize::from(low)],
        };
        if explicit && corners == 0 {
            state.next = 0;
        }
        let (second, third) = (corners >> 4, corners & 15);
        let a = match low {
            15 => state.explicit()?,
            _ => state.fresh(),
        };
        let b = state.corner(second, explicit)?;
        let c = state.corner(third, explicit)?;
        edges.push((b, a));
        edges.push((c, b));
        edges.push((a, c));
        state.vertices.push(a);
        for (vertex, code) in [(b, second), (c, third)] {
            if code == 0 || code == 15 {
                state.vertices.push(vertex);
            }
        }
        out.extend([a, b, c]);
    }
    state.data.0.is_empty().then_some(out)
}

/// Index sequences (mode 2).
pub(super) fn sequence(source: &[u8], count: usize) -> Option<Vec<u32>> {
    let mut stream = Stream(source.split_last_chunk::<4>()?.0);
    if stream.byte()? != 0xd1 {
        return None;
    }
    let mut last = [0u32; 2];
    let mut out = Vec::with_capacity(count.min(stream.0.len()));
    for _ in 0..count {
        let v = stream.varint()?;
        let baseline = &mut last[(v & 1) as usize];
        *baseline = baseline.wrapping_add(unzigzag(v >> 1));
        out.push(*baseline);
    }
    stream.0.is_empty().then_some(out)
}

/// Replaces elements of `N` bytes.
fn each<const N: usize>(plain: &mut [u8], of: impl Fn([u8; N]) -> [u8; N]) {
    for element in plain.as_chunks_mut::<N>().0 {
        *element = of(*element);
    }
}

/// Replaces elements of four signed shorts.
fn each_short(plain: &mut [u8], of: impl Fn([i32; 4]) -> [i32; 4]) {
    each::<8>(plain, |v| {
        let signed = |i: usize| i32::from(i16::from_le_bytes([v[2 * i], v[2 * i + 1]]));
        words(of([0, 1, 2, 3].map(signed)).map(|x| x as u16))
    });
}

fn words(v: [u16; 4]) -> [u8; 8] {
    let [a, b, c, d] = v.map(u16::to_le_bytes);
    [a[0], a[1], b[0], b[1], c[0], c[1], d[0], d[1]]
}

fn byte(v: u8) -> i32 {
    i32::from(v as i8)
}

/// A unit vector in octahedral form. The third number is 1 at the precision of the first two; the fourth is kept.
fn octahedral(v: [i32; 4], most: f32) -> [i32; 4] {
    let one = v[2] as f32;
    let (x, y) = (v[0] as f32 / one, v[1] as f32 / one);
    let z = 1.0 - x.abs() - y.abs();
    let fold = z.min(0.0);
    let (x, y) = (x - fold.copysign(x), y - fold.copysign(y));
    let scale = most / (x * x + y * y + z * z).sqrt();
    let rounded = |c: f32| (c * scale).round() as i32;
    [rounded(x), rounded(y), rounded(z), v[3]]
}

/// A unit quaternion without its largest component, whose index is `v[3] & 3`; `v[3] | 3` stands for 1.
fn quaternion(v: [i32; 4]) -> [i32; 4] {
    let scale = std::f32::consts::FRAC_1_SQRT_2 / (v[3] | 3) as f32;
    let [x, y, z] = [v[0], v[1], v[2]].map(|c| c as f32 * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = (v[3] & 3) as usize;
    let mut out = [0; 4];
    for (i, c) in [w, x, y, z].into_iter().enumerate() {
        out[(largest + i) % 4] = (c * 32_767.0).round() as i32;
    }
    out
}

/// A float with a mantissa of 24 bits and an exponent of 8 bits.
fn exponential(v: [u8; 4]) -> [u8; 4] {
    let bits = i32::from_le_bytes(v);
    let mantissa = f64::from((bits << 8) >> 8);
    ((mantissa * f64::from(bits >> 24).exp2()) as f32).to_le_bytes()
}

/// RGBA of luma, two chromas and an opacity. The highest set bit of the opacity gives the bits per channel.
fn color([y, orange, green, opacity]: [i32; 4], most: f32) -> [i32; 4] {
    let bits = 32 - opacity.leading_zeros();
    let all = ((1i64 << bits) - 1) as i32;
    let a = opacity & (all >> 1);
    let rgba = [
        y + orange - green,
        y + green,
        y - orange - green,
        a << 1 | a & 1,
    ];
    let scale = most / all as f32;
    rgba.map(|c| (c as f32 * scale).round().clamp(0.0, most) as i32)
}
