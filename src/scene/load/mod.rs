//! Loads glTF files (`.gltf`, `.glb`) into scene parts, and files of other formats by a [`Reader`].
//!
//! The crate parses the JSON and checks indices; lengths, types and numbers are checked here, before reads or
//! allocations depend on them. Meshes come out in world space, one per primitive and instance, or shared by the
//! instances where copies would take much memory; materials keep their order.

mod accessors;
mod animation;
mod closed;
pub mod codecs;
mod deform;
pub mod error;
mod extensions;
mod lamp;
mod lights;
mod lit;
mod materials;
mod mesh;
mod nodes;
pub mod textures;
pub mod uris;
mod variants;

use super::{Camera, Material, Mesh, SceneParts};
use crate::bsdf::Distribution;
use crate::files::{self, FileError, Problem};
use accessors::Data;
pub(crate) use animation::Animation;
use codecs::{Buffers, Codec, Part, is_placeholder};
use error::{Result, Warnings, fault, place};
pub use extensions::SUPPORTED;
use gltf::json::Root;
use gltf::json::mesh::Semantic;
use gltf::json::validation::{Checked, Error as Broken, Validate};
pub use lit::FileLight;
use serde::de::IgnoredAny;
use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use uris::{Container, Files};

/// Choices that a file does not contain.
#[derive(Clone, Debug, Default)]
pub struct LoadOptions {
    /// Slope distribution of all glossy lobes; `None` for that of the file or, if it gives none, Beckmann's.
    pub distribution: Option<Distribution>,
    /// Closed meshes that transmit without a thickness are solid bodies if true, and thin walls if false. `None` makes
    /// bodies of them in files of Blender's exporter, which exports glass as Cycles shows it (`docs/lab/models.md`).
    pub solid_glass: Option<bool>,
    /// Moment of the animations, in seconds; `None` for the scene at rest.
    pub time: Option<f64>,
    /// Treatment of unsupported parts of pbrt and Mitsuba scenes.
    pub unsupported: Unsupported,
    /// Variant of the materials by name, or by number from 0; `None` for the default materials.
    pub variant: Option<String>,
    /// Formats that the library itself does not read.
    pub formats: Formats,
}

/// Formats that a program adds to the library.
#[derive(Clone, Copy, Debug, Default)]
pub struct Formats {
    /// Readers of files that are not glTF.
    pub readers: &'static [Reader],
    /// Decoders of compressed glTF files, in the order in which they run.
    pub codecs: &'static [Codec],
}

/// Parts of a scene that are not supported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "clap", derive(clap::ValueEnum))]
pub enum Unsupported {
    /// All are errors.
    Error,
    /// Surfaces and textures are replaced by the nearest supported ones, with a warning. Unsupported lamps, media and
    /// shapes, and unknown names, are errors.
    #[default]
    Nearest,
    /// All are warnings: parts are left out, or replaced by the nearest supported ones.
    Skip,
}

/// A reader of another format.
#[derive(Clone, Copy, Debug)]
pub struct Reader {
    /// True for the path of a file of the format.
    pub knows: fn(&Path) -> bool,
    /// Reads a scene from the path and the bytes of its file. No file makes it panic or allocate without bound.
    pub read: fn(&Path, &[u8], &LoadOptions) -> std::result::Result<Loaded, FileError>,
}

/// A file's scene.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub parts: SceneParts,
    /// Animations of the file.
    pub animations: Vec<Animation>,
    /// Light that the file contains.
    pub light: FileLight,
    /// Meshes and materials at rest, if the file may need a studio and animations move more than cameras at `time`.
    pub rest: Option<SceneParts>,
    /// Names of the variants of the materials.
    pub variants: Vec<String>,
    /// Features of the file that are ignored, one line each.
    pub warnings: Vec<String>,
    /// The file and every external buffer and image that it uses.
    pub files: Vec<PathBuf>,
    /// SHA-256 over the file and every external buffer and image it uses, in that order.
    pub digest: [u8; 32],
}

/// Reads a scene. No file makes it panic or allocate without bound.
pub fn load(path: &Path, options: &LoadOptions) -> std::result::Result<Loaded, FileError> {
    let bytes = uris::read_file(path).map_err(|e| Problem::Read(e).at(path))?;
    let mut readers = options.formats.readers.iter();
    if let Some(reader) = readers.find(|reader| (reader.knows)(path)) {
        return (reader.read)(path, &bytes, options);
    }
    scene(path, &bytes, options).map_err(|fault| fault.of(path))
}

/// The cameras of a glTF file at a moment of its animations, in seconds: all that changes if these move only cameras.
pub fn cameras_at(
    path: &Path,
    seconds: f64,
    codecs: &'static [Codec],
) -> std::result::Result<Vec<Camera>, FileError> {
    let bytes = uris::read_file(path).map_err(|e| Problem::Read(e).at(path))?;
    cameras(path, &bytes, seconds, codecs).map_err(|fault| fault.of(path))
}

fn cameras(
    path: &Path,
    bytes: &[u8],
    seconds: f64,
    codecs: &'static [Codec],
) -> Result<Vec<Camera>> {
    let mut warnings = Warnings::default();
    let mut files = Files::new(path, bytes);
    let (head, root, buffers) = parsed(bytes, codecs, &mut files, &mut warnings)?;
    let data = data(&root, buffers, &head)?;
    let nodes = animation::nodes(&data, seconds, &mut warnings)?;
    lights::cameras(&root, &nodes::placed(&root, &nodes)?, &mut warnings)
}

/// The checked JSON of a file, and its buffers; compressed parts are replaced by those that `codecs` decode.
fn parsed<'a>(
    bytes: &'a [u8],
    codecs: &[Codec],
    files: &mut Files,
    warnings: &mut Warnings,
) -> Result<(Head, Root, Buffers<'a>)> {
    let container = Container::new(bytes)?;
    let head = head(container.json, codecs, warnings)?;
    let mut root: Root = gltf::json::deserialize::from_slice(container.json)
        .map_err(|e| fault("JSON", files::briefly(e)))?;
    validate(&root)?;
    let used = &head.extensions_used;
    let mut buffers = buffers(&root, container.binary, files, codecs, used)?;
    for codec in codecs {
        if let Part::Buffers(decode) = codec.part {
            decode(&mut root, &mut buffers)?;
        }
    }
    Ok((head, root, buffers))
}

/// The buffers of a file with its views and accessors, checked.
fn data<'a>(root: &'a Root, buffers: Buffers<'a>, head: &Head) -> Result<Data<'a>> {
    let data = Data {
        buffers,
        quantised: (head.extensions_used.iter()).any(|e| e == "KHR_mesh_quantization"),
        root,
    };
    data.check()?;
    Ok(data)
}

fn scene(path: &Path, bytes: &[u8], options: &LoadOptions) -> Result<Loaded> {
    let mut warnings = Warnings::default();
    let mut files = Files::new(path, bytes);
    let codecs = options.formats.codecs;
    let (head, root, buffers) = parsed(bytes, codecs, &mut files, &mut warnings)?;
    let data = data(&root, buffers, &head)?;
    let nodes = match options.time {
        Some(seconds) => Cow::Owned(animation::nodes(&data, seconds, &mut warnings)?),
        None => Cow::Borrowed(root.nodes.as_slice()),
    };
    warn_of_time(&root, options.time, &mut warnings);
    head.warn_of_targets(&mut warnings);
    let nodes = nodes::placed(&root, &nodes)?;
    let mut requests = textures::Requests::new(codecs);
    let (mut materials, slots) = materials::materials(
        &root,
        options.distribution.unwrap_or_default(),
        &mut requests,
        &mut warnings,
    )?;
    let variant = variants::chosen(&root, options.variant.as_deref())?;
    let shown = mesh::PrimitiveMaterials {
        slots: &slots,
        variant,
    };
    let (mut meshes, mut shared) = mesh::meshes(&data, &nodes, &shown, &mut warnings)?;
    let default = materials.len() - 1;
    let all = || meshes.iter().chain(shared.iter().map(|s| &s.mesh));
    if !all().any(|m| m.material as usize == default) {
        materials.truncate(default);
    }
    let known: Vec<bool> = (root.materials.iter())
        .map(|m| (m.extensions.as_ref()).is_some_and(|e| e.volume.is_some()))
        .chain([false])
        .collect();
    paint(all(), &mut materials, &mut warnings);
    let glass = glass(&root, options);
    let mut all: Vec<&mut Mesh> = (meshes.iter_mut())
        .chain(shared.iter_mut().map(|s| &mut s.mesh))
        .collect();
    closed::bodies(&mut all, &mut materials, &known, glass, &mut warnings);
    let parts = SceneParts {
        meshes,
        shared,
        materials,
        lights: lights::lights(&root, &nodes, &mut warnings)?,
        cameras: lights::cameras(&root, &nodes, &mut warnings)?,
        textures: requests.textures(&data, &mut files)?,
        environment: None,
        medium: None,
        own_boundaries: false,
        has_floor: false,
    };
    let (light, animations) = (FileLight::of(&parts), animation::list(&root));
    let moves = options.time.is_some() && animations.iter().any(|a| !a.of_cameras);
    let rest = match light {
        FileLight::None | FileLight::Surfaces if moves => {
            let nodes = nodes::placed(&root, &root.nodes)?;
            let (meshes, shared) = mesh::meshes(&data, &nodes, &shown, &mut Warnings::default())?;
            Some(SceneParts {
                meshes,
                shared,
                materials: parts.materials.clone(),
                ..SceneParts::default()
            })
        }
        _ => None,
    };
    let (files, digest) = files.finish();
    Ok(Loaded {
        light,
        parts,
        rest,
        variants: variants::names(&root),
        animations,
        warnings: warnings.into_lines(),
        files,
        digest,
    })
}

/// Warns if the animations of a file and the requested moment do not fit.
fn warn_of_time(root: &Root, time: Option<f64>, warnings: &mut Warnings) {
    match (root.animations.len(), time) {
        (1.., None) => warnings.say("animations: the scene is shown at rest; --at shows a moment"),
        (0, Some(_)) => warnings.say("there are no animations: every moment is the same"),
        (n @ 2.., Some(_)) => warnings.say(format!("animations: all {n} play at once")),
        _ => {}
    }
}

/// Marks the materials of meshes with vertex colours.
fn paint<'a>(
    meshes: impl Iterator<Item = &'a Mesh>,
    materials: &mut [Material],
    warnings: &mut Warnings,
) {
    for mesh in meshes.filter(|mesh| !mesh.colors.is_empty()) {
        let material = &mut materials[mesh.material as usize];
        if material.unlit {
            let at = place("materials", mesh.material as usize, Some(&material.name));
            warnings.group("materials", at, "unlit, so that vertex colours are ignored");
        } else {
            material.finish_mut().has_colors = true;
        }
    }
}

/// Treatment of closed glass without a thickness in this file.
fn glass(root: &Root, options: &LoadOptions) -> closed::Glass {
    let generator = root.asset.generator.as_deref().unwrap_or_default();
    match options.solid_glass {
        Some(true) => closed::Glass::Solid,
        Some(false) => closed::Glass::Thin,
        None if generator.contains("Blender") => closed::Glass::OfBlender,
        None => closed::Glass::Unknown,
    }
}

/// The part of a file that decides if the rest can be read.
#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
struct Head {
    asset: Asset,
    #[serde(default)]
    extensions_used: Vec<String>,
    #[serde(default)]
    extensions_required: Vec<String>,
    #[serde(default)]
    accessors: Vec<IgnoredAny>,
    #[serde(default)]
    buffer_views: Vec<IgnoredAny>,
    #[serde(default)]
    materials: Vec<IgnoredAny>,
    #[serde(default)]
    meshes: Vec<HeadMesh>,
    #[serde(default)]
    nodes: Vec<IgnoredAny>,
}

/// The parts of a mesh whose unknown keys [`Root`] drops.
#[derive(serde::Deserialize)]
#[serde(expecting = "struct Mesh")]
struct HeadMesh {
    #[serde(default)]
    primitives: Vec<HeadPrimitive>,
}

#[derive(serde::Deserialize)]
#[serde(expecting = "struct Primitive")]
struct HeadPrimitive {
    /// Attributes of morph targets.
    #[serde(default)]
    targets: Vec<HashMap<String, IgnoredAny>>,
}

impl Head {
    /// Warns of attributes of morph targets that are not read.
    fn warn_of_targets(&self, warnings: &mut Warnings) {
        for (i, mesh) in self.meshes.iter().enumerate() {
            let names =
                (mesh.primitives.iter()).flat_map(|p| p.targets.iter().flat_map(HashMap::keys));
            let unread =
                |name: &&String| !["POSITION", "NORMAL", "TANGENT"].contains(&name.as_str());
            for name in names.filter(unread).collect::<BTreeSet<_>>() {
                let what = format!("morph targets of {name} are ignored");
                warnings.group("meshes", format!("meshes[{i}]"), &what);
            }
        }
    }

    /// Limits the length of lists, of which an element of two bytes, `{}`, may take a kilobyte of memory.
    fn check_lists(&self) -> Result<()> {
        let lists = [
            ("accessors", self.accessors.len(), 1 << 20),
            ("bufferViews", self.buffer_views.len(), 1 << 20),
            ("materials", self.materials.len(), 1 << 16),
            ("meshes", self.meshes.len(), 1 << 20),
            ("nodes", self.nodes.len(), 1 << 20),
        ];
        match lists.iter().find(|(_, length, most)| length > most) {
            Some((name, length, most)) => {
                Err(fault(*name, format!("{length} are more than {most}")))
            }
            None => Ok(()),
        }
    }
}

#[derive(serde::Deserialize)]
#[serde(rename_all = "camelCase")]
struct Asset {
    version: String,
    min_version: Option<String>,
}

fn head(json: &[u8], codecs: &[Codec], warnings: &mut Warnings) -> Result<Head> {
    let head: Head = serde_json::from_slice(json).map_err(|e| {
        match e.is_syntax() && (e.line(), e.column()) == (1, 1) {
            true => fault("not a glTF file", "it holds no JSON"),
            false => fault("JSON", e.to_string()),
        }
    })?;
    let version = &head.asset.version;
    if !version.starts_with("2.") {
        return Err(fault("asset.version", format!("`{version}` is not 2.0")));
    }
    if let Some(least) = head.asset.min_version.as_ref().filter(|v| *v != "2.0") {
        return Err(fault("asset.minVersion", format!("`{least}` is not 2.0")));
    }
    head.check_lists()?;
    let unknown = |e: &&String| {
        let decoded = codecs.iter().any(|codec| codec.extension == *e);
        !decoded && !SUPPORTED.contains(&e.as_str())
    };
    let needed = |e: &&String| !extensions::is_dispensable(e);
    let required: Vec<&str> = (head.extensions_required.iter().filter(unknown))
        .filter(needed)
        .map(String::as_str)
        .collect();
    if !required.is_empty() {
        return Err(fault("extensionsRequired", extensions::refusal(&required)));
    }
    for name in head.extensions_used.iter().filter(unknown) {
        warnings.group("extensions", name, "not supported and ignored");
    }
    Ok(head)
}

/// Runs the crate's own check: indices in range, known enumerators, properties present.
fn validate(root: &Root) -> Result<()> {
    // The crate's check would panic on this one index.
    for (m, mesh) in root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let position = primitive
                .attributes
                .get(&Checked::Valid(Semantic::Positions));
            if position.is_some_and(|i| i.value() >= root.accessors.len()) {
                let at = place("meshes", m, mesh.name.as_ref());
                let what = "POSITION: index out of range";
                return Err(fault(format!("{at}.primitives[{p}].attributes"), what));
            }
        }
    }
    let mut first = None;
    root.validate(root, gltf::json::Path::new, &mut |path, error| {
        if first.is_some() {
            return;
        }
        let at = path().as_str().to_owned();
        let bounds = at.ends_with(".min") || at.ends_with(".max");
        // An extension may give the image in place of `source`; the reader of textures decides.
        let source = at.starts_with("textures[") && at.ends_with("].source");
        // Without a view all elements are 0.
        let view = at.starts_with("accessors[") && at.ends_with("].bufferView");
        let may_miss = bounds || source || view;
        let judged = error == Broken::Unsupported || may_miss && error == Broken::Missing;
        if !judged {
            first = Some((at, error));
        }
    });
    match first {
        None => Ok(()),
        Some((at, Broken::IndexOutOfBounds)) => Err(fault(at, "index out of range")),
        Some((at, Broken::Missing)) => Err(fault(at, "is missing")),
        Some((at, error)) => Err(fault(at, error.to_string().to_lowercase())),
    }
}

/// The bytes of all buffers; empty for placeholders, whose views a used extension compresses.
fn buffers<'a>(
    root: &Root,
    binary: Option<&'a [u8]>,
    files: &mut Files,
    codecs: &[Codec],
    used: &[String],
) -> Result<Buffers<'a>> {
    let mut buffers = Vec::new();
    for (i, buffer) in root.buffers.iter().enumerate() {
        let at = place("buffers", i, buffer.name.as_ref());
        let has_bytes = buffer.uri.is_some() || i == 0 && binary.is_some();
        if is_placeholder(buffer, has_bytes, codecs, used) {
            buffers.push(Cow::Borrowed(&[][..]));
            continue;
        }
        let bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => Cow::Owned(files.read(uri, &at)?),
            (None, Some(chunk)) if i == 0 => Cow::Borrowed(chunk),
            (None, _) => return Err(fault(at, "has no uri, and the file no binary chunk for it")),
        };
        let length = buffer.byte_length.0;
        if (bytes.len() as u64) < length {
            let what = format!(
                "byteLength is {length}, but there are {} bytes",
                bytes.len()
            );
            return Err(fault(at, what));
        }
        // The rest is padding.
        buffers.push(match bytes {
            Cow::Borrowed(b) => Cow::Borrowed(&b[..length as usize]),
            Cow::Owned(mut b) => {
                b.truncate(length as usize);
                Cow::Owned(b)
            }
        });
    }
    Ok(buffers)
}
