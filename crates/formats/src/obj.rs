//! Wavefront OBJ meshes: positions with colours, texture coordinates, normals, polygons, and the names of materials.

use crate::build::colour::linear;
use opsr::math::{Vec2, Vec3, Vec4};
use opsr::scene::Mesh;
use opsr::scene::load::error::{Result, fault};
use std::borrow::Cow;
use std::collections::HashMap;
use std::str::SplitWhitespace;

/// Most vertices or triangles.
const MAX_ITEMS: usize = 1 << 26;

/// The corner of a face: indices of position, texture coordinates and normal, from 1; 0 if absent.
type Corner = [u32; 3];

/// The contents of a file.
#[derive(Default)]
pub(super) struct Obj {
    /// All faces. With `flip`, v of the texture coordinates grows downwards, as in images.
    pub(super) mesh: Mesh,
    /// First face of each run of one material, and the material's name.
    pub(super) materials: Vec<(usize, String)>,
    /// Names of material files, line by line; a line may contain several, separated by blanks.
    pub(super) libraries: Vec<String>,
}

/// Reads a file. Its texture coordinates have v upwards; with `flip`, v is turned to grow downwards.
pub(super) fn read(bytes: &[u8], place: &str, flip: bool) -> Result<Obj> {
    let text = String::from_utf8_lossy(bytes);
    // A backslash continues a line.
    let joined = match text.contains('\\') {
        true => Cow::Owned(text.replace("\\\r\n", " ").replace("\\\n", " ")),
        false => text,
    };
    let (mut positions, mut uvs, mut normals) = (Vec::new(), Vec::new(), Vec::new());
    let mut colors: Vec<Vec4> = Vec::new();
    let mut corners: Vec<Corner> = Vec::new();
    let mut numbers: HashMap<Corner, u32> = HashMap::new();
    let mut obj = Obj::default();
    let mesh = &mut obj.mesh;
    for (n, line) in joined.lines().enumerate() {
        let bad = |what: &str| fault(format!("{place}:{}", n + 1), what);
        let mut words = line.split_whitespace();
        let vector = |words: &mut SplitWhitespace<'_>, least| vector(words, least).map_err(bad);
        let rest = || {
            line.trim()
                .split_once(char::is_whitespace)
                .map_or("", |(_, rest)| rest.trim())
        };
        match words.next() {
            Some("v") => {
                positions.push(vector(&mut words, 3)?);
                // A single fourth number is a weight, not a colour.
                if words.clone().count() >= 3 {
                    let color = vector(&mut words, 3)?.clamp(Vec3::ZERO, Vec3::ONE);
                    colors.push(color.map(linear).extend(1.0));
                }
            }
            Some("vn") => normals.push(vector(&mut words, 3)?.normalize_or_zero()),
            Some("vt") => {
                let uv = vector(&mut words, 1)?;
                let v = if flip { 1.0 - uv.y } else { uv.y };
                uvs.push(Vec2::new(uv.x, v));
            }
            Some("f") => {
                let counts = [positions.len(), uvs.len(), normals.len()];
                let mut face = Vec::new();
                for word in words {
                    let corner =
                        corner(word, counts).ok_or_else(|| bad("a corner that does not exist"))?;
                    let next = corners.len() as u32;
                    let number = *numbers.entry(corner).or_insert(next);
                    if number == next {
                        corners.push(corner);
                    }
                    face.push(number);
                }
                for pair in face.get(1..).unwrap_or_default().windows(2) {
                    mesh.indices.push([face[0], pair[0], pair[1]]);
                }
            }
            Some("usemtl") => obj.materials.push((mesh.indices.len(), rest().to_owned())),
            Some("mtllib") => obj.libraries.push(rest().to_owned()),
            _ => {}
        }
        if corners.len().max(mesh.indices.len()).max(positions.len()) > MAX_ITEMS {
            return Err(bad("too many vertices or triangles"));
        }
    }
    let at = |i: u32| i as usize - 1;
    mesh.positions = corners.iter().map(|c| positions[at(c[0])]).collect();
    if colors.len() == positions.len() {
        mesh.colors = corners.iter().map(|c| colors[at(c[0])]).collect();
    }
    if corners.iter().all(|c| c[1] > 0) {
        mesh.uvs = corners.iter().map(|c| uvs[at(c[1])]).collect();
    }
    if corners.iter().all(|c| c[2] > 0) {
        mesh.normals = corners.iter().map(|c| normals[at(c[2])]).collect();
    }
    Ok(obj)
}

/// Up to three numbers, at least `least` of them; the others are 0.
fn vector(
    words: &mut SplitWhitespace<'_>,
    least: usize,
) -> std::result::Result<Vec3, &'static str> {
    let mut v = [0.0f32; 3];
    for (i, x) in v.iter_mut().enumerate() {
        match words.next().map(str::parse) {
            Some(Ok(value)) => *x = value,
            None if i >= least => {}
            _ => return Err("a word that is no number, or too few"),
        }
    }
    let v = Vec3::from(v);
    v.is_finite().then_some(v).ok_or("not finite")
}

/// The corner of a word such as `1/2/3`; negative indices count from the end.
fn corner(word: &str, counts: [usize; 3]) -> Option<Corner> {
    let mut out = [0; 3];
    for (i, part) in word.split('/').enumerate() {
        let slot = out.get_mut(i)?;
        if part.is_empty() && i > 0 {
            continue;
        }
        let n: i64 = part.parse().ok()?;
        let count = counts[i] as i64;
        let n = if n < 0 { count + 1 + n } else { n };
        *slot = (1..=count).contains(&n).then_some(n as u32)?;
    }
    Some(out)
}
