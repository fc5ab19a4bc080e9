//! Readers of scenes of Mitsuba 3 (and its predecessor) and pbrt-v4, of models in OBJ and PLY, and decoders of
//! compressed glTF. The readers translate files into the terms of [`build`]; meshes and images are read in common.

pub mod build;
mod compressed;
mod curves;
mod images;
mod media;
mod mitsuba;
mod models;
mod mtl;
mod names;
mod obj;
mod pbrt;
mod ply;
mod serialized;

use crate::build::colour::Spectrum;
use crate::build::looks::Paint;
use crate::build::{BuildError, Builder, right_handed_tangents};
use glam::DAffine3;
use opsr::bsdf::Distribution;
use opsr::files::FileError;
use opsr::math::Rgb;
use opsr::scene::load::error::{Fault, Result, Warnings, fault};
use opsr::scene::load::uris::Files;
use opsr::scene::load::{FileLight, Formats, LoadOptions, Loaded, Reader, Unsupported};
use opsr::scene::{Material, Medium, Mesh, PunctualLight, SceneParts};
use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

/// Most bytes of a decompressed file or stream.
const MAX_BYTES: u64 = 1 << 32;

/// Most files that a scene may include.
const MAX_INCLUDES: usize = 4096;

/// All formats of this crate, for [`LoadOptions::formats`].
pub const FORMATS: Formats = Formats {
    readers: &[
        Reader {
            knows: |path| has_ending(path, "xml"),
            read: |path, bytes, options| load(path, bytes, options, mitsuba::read),
        },
        Reader {
            knows: |path| has_ending(path, "pbrt"),
            read: |path, bytes, options| load(path, bytes, options, pbrt::read),
        },
        Reader {
            knows: |path| has_ending(path, "obj"),
            read: |path, bytes, options| load(path, bytes, options, models::obj),
        },
        Reader {
            knows: |path| has_ending(path, "ply"),
            read: |path, bytes, options| load(path, bytes, options, models::ply),
        },
    ],
    codecs: compressed::CODECS,
};

/// The default options, with [`FORMATS`].
pub fn options() -> LoadOptions {
    LoadOptions {
        formats: FORMATS,
        ..LoadOptions::default()
    }
}

/// True for a file with this ending, whatever its case; `.gz` may follow.
fn has_ending(path: &Path, ending: &str) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    let name = name.unwrap_or_default().to_ascii_lowercase();
    let name = name.strip_suffix(".gz").unwrap_or(&name);
    name.rsplit_once('.')
        .is_some_and(|(_, found)| found == ending)
}

/// Reads a file with the reader of its format.
fn load(
    path: &Path,
    bytes: &[u8],
    options: &LoadOptions,
    read: fn(&mut Context, Vec<u8>) -> Result<()>,
) -> std::result::Result<Loaded, FileError> {
    let mut context = Context {
        files: Files::new(path, bytes),
        builder: Builder::default(),
        distribution: options.distribution,
        unsupported: options.unsupported,
        warnings: Warnings::default(),
        images: HashMap::new(),
        meshes: HashMap::new(),
        materials: HashMap::new(),
        media: media::Media::default(),
        includes: 0,
    };
    // In scenes every material states its own boundaries; readers of models turn this off.
    context.builder.parts.own_boundaries = true;
    let read = unpacked(bytes, "file").and_then(|text| read(&mut context, text));
    let done = read.and_then(|()| context.finish());
    done.map_err(|fault| fault.of(path))
}

/// The bytes of a file, decompressed if they are gzip.
fn unpacked(bytes: &[u8], place: &str) -> Result<Vec<u8>> {
    if !bytes.starts_with(&[0x1f, 0x8b]) {
        return Ok(bytes.to_vec());
    }
    inflated(flate2::read::MultiGzDecoder::new(bytes), place)
}

/// All bytes of a stream, up to [`MAX_BYTES`].
fn inflated(stream: impl Read, place: &str) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    let mut stream = stream.take(MAX_BYTES + 1);
    let mut piece = vec![0; 1 << 20];
    loop {
        let n = (stream.read(&mut piece))
            .map_err(|e| fault(place, format!("cannot be unpacked: {e}")))?;
        if n == 0 {
            return Ok(out);
        }
        out.extend_from_slice(&piece[..n]);
        if out.len() as u64 > MAX_BYTES {
            return Err(fault(
                place,
                format!("more than {MAX_BYTES} bytes unpacked"),
            ));
        }
        if out.len() % (256 << 20) < n {
            opsr::memory::check(format!("{place}, unpacked,"), 2 * out.len() as u64)?;
        }
    }
}

/// A copy of a shape: the indices of its mesh and its material, and its pose.
type Member = (u32, u32, DAffine3);

/// The use of a colour, which decides how a spectrum becomes RGB.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Role {
    /// A surface, or an index of refraction.
    Reflected,
    /// A lamp.
    Emitted,
}

/// A material that is read once, with the part of it that depends on the mesh.
#[derive(Clone)]
struct ShapeMaterial {
    material: Material,
    /// Heights of a bump map: the normal map depends on the mesh's texture coordinates.
    bump: Option<Paint>,
}

impl From<Material> for ShapeMaterial {
    fn from(material: Material) -> Self {
        Self {
            material,
            bump: None,
        }
    }
}

/// State that all readers share.
struct Context {
    files: Files,
    builder: Builder,
    /// Slope distribution of the options, in place of the file's.
    distribution: Option<Distribution>,
    unsupported: Unsupported,
    warnings: Warnings,
    /// Textures by file, encoding and wrap.
    images: HashMap<images::Key, images::Known>,
    /// Meshes by file and choice of its contents, and derived meshes.
    meshes: HashMap<String, u32>,
    /// Materials by declaration, emission, and the scale of their bump map.
    materials: HashMap<String, u32>,
    media: media::Media,
    includes: usize,
}

/// The parts of a mixture, with their shares.
type Shares = Vec<(f32, Material)>;

/// True if a scene has any light. A file without light is shown as a model.
fn has_light(parts: &SceneParts) -> bool {
    let shared = parts.shared.iter().map(|shared| &shared.mesh);
    let shines = |mesh: &Mesh| {
        let material = parts.materials.get(mesh.material as usize);
        material.is_some_and(|m| m.emission != Rgb::ZERO)
    };
    parts.environment.is_some()
        || !parts.lights.is_empty()
        || parts.meshes.iter().chain(shared).any(shines)
}

impl Context {
    fn finish(mut self) -> Result<Loaded> {
        let builder = std::mem::take(&mut self.builder);
        let mut parts = builder.finish().map_err(|e| match e {
            BuildError::Memory(shortage) => Fault::from(shortage),
            other => fault("scene", other.to_string()),
        })?;
        self.fill_scene(&mut parts)?;
        let (files, digest) = self.files.finish();
        Ok(Loaded {
            light: match parts.own_boundaries {
                true if has_light(&parts) => FileLight::Lamps,
                true => FileLight::None,
                false => FileLight::of(&parts),
            },
            parts,
            animations: Vec::new(),
            variants: Vec::new(),
            rest: None,
            warnings: self.warnings.into_lines(),
            files,
            digest,
        })
    }

    fn parts(&mut self) -> &mut SceneParts {
        &mut self.builder.parts
    }

    /// Reports an element that is left out: an error, or a warning with `--unsupported skip`.
    fn left_out(&mut self, place: &str, what: impl std::fmt::Display) -> Result<()> {
        if self.unsupported == Unsupported::Skip {
            (self.warnings).group("elements", place, &format!("{what} is not supported"));
            return Ok(());
        }
        let what = format!("{what} is not supported; --unsupported skip goes on without it");
        Err(fault(place, what))
    }

    /// Reports an element in whose place the nearest is shown: a warning, or an error with `--unsupported error`.
    fn nearest(&mut self, place: &str, what: impl std::fmt::Display, shown: &str) -> Result<()> {
        if self.unsupported == Unsupported::Error {
            let what = format!("{what} is not supported; --unsupported nearest shows {shown}");
            return Err(fault(place, what));
        }
        let what = format!("{what} is not supported: shown as {shown}");
        self.warnings.group("elements", place, &what);
        Ok(())
    }

    /// Warns of an element that is shown in a simpler way.
    fn approximate(&mut self, place: &str, what: &str) {
        self.warnings.group("elements", place, what);
    }

    /// Warns that a limit on the length of paths is ignored, and names the option that sets it.
    fn warn_of_limit(&mut self, name: &str, value: f64, vertices: f64, place: &str) {
        let option = match vertices >= 1.0 {
            true => format!("; `--max-vertices {vertices}` does the same"),
            false => String::new(),
        };
        self.approximate(place, &format!("`{name}` {value} is not taken{option}"));
    }

    /// Multiplies the radiance of all lights by an exposure.
    fn brighten(&mut self, factor: f64, place: &str) -> Result<()> {
        if !(factor > 0.0 && factor.is_finite()) {
            return Err(fault(place, format!("an exposure of {factor}")));
        }
        if factor == 1.0 {
            return Ok(());
        }
        let (factor, parts) = (factor as f32, self.parts());
        for material in &mut parts.materials {
            material.emission *= factor;
        }
        for light in &mut parts.lights {
            match light {
                PunctualLight::Point { intensity, .. } | PunctualLight::Spot { intensity, .. } => {
                    *intensity *= factor;
                }
                PunctualLight::Directional { irradiance, .. } => *irradiance *= factor,
            }
        }
        if let Some(sky) = &parts.environment {
            parts.environment = Some(sky.brightened(factor));
        }
        Ok(())
    }

    /// Two materials, the second with a share of the surface. Mixtures inside count by their heaviest parts.
    fn mixed(
        &mut self,
        mut first: Material,
        second: Material,
        share: Paint,
        place: &str,
    ) -> Result<Material> {
        let is_mixture = |m: &Material| m.finish.as_ref().is_some_and(|f| f.mix.is_some());
        if !is_mixture(&first) && !is_mixture(&second) {
            let other = self.builder.material(second);
            self.builder.mix(&mut first, other, share);
            return Ok(first);
        }
        let share = (self.builder.mean(share).element_sum() / 3.0).clamp(0.0, 1.0);
        self.heaviest(vec![(1.0 - share, first), (share, second)], place)
    }

    /// A mixture of any number of materials, mixtures among them, reduced to its two heaviest parts.
    fn heaviest(&mut self, shares: Shares, place: &str) -> Result<Material> {
        let mut parts = Shares::new();
        for (share, mut material) in shares {
            let mix = material
                .finish
                .as_mut()
                .and_then(|finish| finish.mix.take());
            let inner = match &mix {
                Some(mix) => {
                    let mean = mix.texture.map_or(1.0, |map| {
                        self.builder.parts.textures[map.texture as usize].average()[0]
                    });
                    (mean * mix.weight).clamp(0.0, 1.0)
                }
                None => 0.0,
            };
            if let Some(mix) = mix {
                let other = self.builder.parts.materials[mix.other as usize].clone();
                parts.push((share * inner, other));
            }
            parts.push((share * (1.0 - inner), material));
        }
        parts.retain(|(share, _)| *share > 0.0);
        parts.sort_by(|a, b| b.0.total_cmp(&a.0));
        if parts.len() > 2 {
            let what = format!("a mixture of {} materials", parts.len());
            self.nearest(place, what, "its two heaviest parts")?;
        }
        let mut parts = parts.into_iter();
        match (parts.next(), parts.next()) {
            (Some((a, mut first)), Some((b, second))) => {
                let other = self.builder.material(second);
                self.builder
                    .mix(&mut first, other, Paint::from(b / (a + b)));
                Ok(first)
            }
            (Some((_, only)), _) => Ok(only),
            _ => Err(fault(place, "a mixture of nothing")),
        }
    }

    fn distribution(&self, own: Distribution) -> Distribution {
        self.distribution.unwrap_or(own)
    }

    /// Counts an include; fails at too many files or too deep nesting.
    fn include(&mut self, depth: usize, place: &str) -> Result<()> {
        self.includes += 1;
        match depth > 32 || self.includes > MAX_INCLUDES {
            true => Err(fault(place, "includes itself, or too many files")),
            false => Ok(()),
        }
    }

    /// The mesh of a file, read once for each `choice` of its contents.
    fn file_mesh(
        &mut self,
        name: &str,
        choice: &str,
        place: &str,
        read: impl FnOnce(&[u8], &str) -> Result<Mesh>,
    ) -> Result<u32> {
        let key = format!("{choice} {name}");
        if let Some(&mesh) = self.meshes.get(&key) {
            return Ok(mesh);
        }
        let (_, bytes) = self.files.open(name, place)?;
        let inside = format!("{place}: {name}");
        let bytes = unpacked(&bytes, &inside)?;
        let mesh = read(&bytes, &inside)?;
        let mesh = self.builder.mesh(Mesh {
            name: name.to_owned(),
            ..mesh
        });
        self.meshes.insert(key, mesh);
        Ok(mesh)
    }

    /// The spectrum of a file with pairs of a wavelength and a value.
    fn spectrum_file(&mut self, name: &str, place: &str) -> Result<Spectrum> {
        let (_, bytes) = self.files.open(name, place)?;
        let text = String::from_utf8_lossy(&bytes);
        let lines = (text.lines()).map(|line| line.split('#').next().unwrap_or_default());
        let words = lines.flat_map(|line| line.split([',', ' ', '\t']));
        let numbers: Option<Vec<f64>> = (words.filter(|word| !word.is_empty()))
            .map(|word| word.parse().ok())
            .collect();
        let pairs = numbers.filter(|n| n.len() % 2 == 0).and_then(|n| {
            Spectrum::new(n.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect())
        });
        pairs.ok_or_else(|| {
            let what = format!("{name}: no list of rising wavelengths and values");
            fault(place, what)
        })
    }

    /// Material and mesh of a shape; shapes of one `key` share a material. Normal maps and bump maps need
    /// tangents, which only a copy of the mesh has.
    fn shape_material(
        &mut self,
        mut look: ShapeMaterial,
        mut key: String,
        mut mesh: u32,
        pose: &DAffine3,
    ) -> (u32, u32) {
        if look.bump.is_some() || look.material.normal_texture.is_some() {
            let heights = look.bump.and_then(|heights| heights.map);
            let second = heights.is_some_and(|map| map.second);
            mesh = self.with_tangents(mesh, second);
            if let Some(heights) = look.bump {
                let scale = pose.matrix3.determinant().abs().cbrt() as f32;
                let steps = uv_steps(self.builder.mesh_mut(mesh), second, scale);
                key += &format!(" bump {steps:?}");
                if !self.materials.contains_key(&key) {
                    self.bump(&mut look.material, heights, &[steps]);
                }
            }
        }
        let Self {
            builder, materials, ..
        } = self;
        let material = (materials.entry(key)).or_insert_with(|| builder.material(look.material));
        (*material, mesh)
    }

    /// A copy of a mesh with tangents by its first or second texture coordinates, made once.
    fn with_tangents(&mut self, mesh: u32, second: bool) -> u32 {
        let key = format!("tangents {mesh} {second}");
        if let Some(&known) = self.meshes.get(&key) {
            return known;
        }
        let mut copy = self.builder.mesh_mut(mesh).clone();
        let first = copy.uvs.clone();
        if second {
            copy.uvs.clone_from(&copy.second_uvs);
        }
        right_handed_tangents(&mut copy);
        copy.uvs = first;
        let copy = self.builder.mesh(copy);
        self.meshes.insert(key, copy);
        copy
    }

    /// Makes a base transmit diffusely, in addition to its reflection.
    fn transmit(&mut self, material: &mut Material, transmitted: Paint, place: &str) {
        let maps = [material.base_color_texture, transmitted.map];
        let sum = material.base_color + transmitted.factor;
        if maps == [None; 2] && sum.max_element() > 1.0 + 1e-5 {
            let what = "reflectance and transmittance of more than 1 together are scaled down";
            self.approximate(place, what);
        }
        build::looks::transmit(material, transmitted);
    }

    /// Gives a material a bump map, by the mean scale of the texture coordinates of meshes.
    fn bump(&mut self, material: &mut Material, heights: Paint, steps: &[[f32; 2]]) {
        let n = steps.len().max(1) as f32;
        let mean = |c: usize| {
            let sum: f32 = steps.iter().map(|s| s[c]).sum();
            if sum != 0.0 { sum / n } else { 1.0 }
        };
        let step = [mean(0), mean(1)];
        material.normal_texture = self.builder.bump_map(heights, step);
        material.normal_scale = 1.0;
    }
}

/// An index of refraction; fails unless it is finite and above 0.
fn checked_index(eta: f32, place: &str) -> Result<f32> {
    match eta.is_finite() && eta > 0.0 {
        true => Ok(eta),
        false => Err(fault(place, format!("index of refraction {eta}"))),
    }
}

/// A side of the film in pixels, from 1 to 65536.
fn film_side(name: &str, n: f64, place: &str) -> Result<u32> {
    match (1.0..=65536.0).contains(&n) {
        true => Ok(n as u32),
        false => Err(fault(place, format!("{name} {n}"))),
    }
}

/// Lengths of a unit step in u and in v on a mesh at a scale: means over its area. The length in v is negative if u, v
/// and the normal are a left-handed frame.
fn uv_steps(mesh: &Mesh, second: bool, scale: f32) -> [f32; 2] {
    let uvs = if second { &mesh.second_uvs } else { &mesh.uvs };
    let mut sums = [0.0f64; 3];
    for face in &mesh.indices {
        let corner = |k: usize| mesh.positions.get(face[k] as usize).copied();
        let uv = |k: usize| uvs.get(face[k] as usize).copied();
        let (Some(a), Some(b), Some(c)) = (corner(0), corner(1), corner(2)) else {
            continue;
        };
        let (Some(ua), Some(ub), Some(uc)) = (uv(0), uv(1), uv(2)) else {
            continue;
        };
        let (e, f, d, g) = (b - a, c - a, ub - ua, uc - ua);
        let det = d.perp_dot(g);
        if det == 0.0 {
            continue;
        }
        let (along_u, along_v) = ((e * g.y - f * d.y) / det, (f * d.x - e * g.x) / det);
        let area = f64::from(e.cross(f).length());
        sums[0] += area * f64::from(along_u.length());
        sums[1] += area * f64::from(along_v.length()).copysign(det.into());
        sums[2] += area;
    }
    if sums[2] == 0.0 {
        return [0.0; 2];
    }
    [0, 1].map(|i| (sums[i] / sums[2]) as f32 * scale)
}
