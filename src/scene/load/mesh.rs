//! Converts primitives to meshes: topologies, attributes, poses.

use super::accessors::Data;
use super::deform::{Influences, Skins, blended};
use super::error::{Result, Warnings, fault, place};
use super::nodes::PlacedNode;
use super::variants;
use crate::math::{Vec2, Vec3};
use crate::memory;
use crate::scene::limits::{self, INSTANCE_BYTES, MAX_ELEMENTS, MAX_MESHES, triangle_bytes};
use crate::scene::mesh::{cofactors, unit};
use crate::scene::{Mesh, SharedMesh};
use glam::{DAffine3, DQuat, DVec3, Vec4};
use gltf::json::accessor::ComponentType::{F32, I8, I16, U8, U16};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use std::collections::{HashMap, HashSet};

/// Properties of a material on which meshes depend.
#[derive(Clone, Copy)]
pub(super) struct MaterialInfo {
    /// Index into `SceneParts::materials`.
    pub(super) material: u32,
    /// Texture coordinate sets of its textures: the first pair, and the second if there is one.
    pub(super) uv_sets: (u32, Option<u32>),
    /// True if it emits light.
    pub(super) emits: bool,
    /// True if it has textures, and needs their coordinates.
    pub(super) textured: bool,
    /// True if it is brushed, and needs tangents.
    pub(super) brushed: bool,
}

/// Materials of primitives.
pub(super) struct PrimitiveMaterials<'a> {
    /// One entry per material of the file and, last, the default material's.
    pub(super) slots: &'a [MaterialInfo],
    /// Variant to show.
    pub(super) variant: Option<u64>,
}

impl PrimitiveMaterials<'_> {
    /// Index of a primitive's material.
    fn of(&self, primitive: &Primitive) -> usize {
        let none = self.slots.len() - 1;
        variants::material(primitive, self.variant).unwrap_or(none)
    }
}

/// A primitive of a node.
struct Instance<'a> {
    primitive: &'a Primitive,
    /// Index of the mesh in the file and of the primitive in the mesh.
    source: (usize, usize),
    pose: DAffine3,
    /// Weights of the morph targets.
    weights: &'a [f32],
    /// Matrices of the skin's joints, which then replace the pose.
    joints: Option<&'a [DAffine3]>,
    /// True if the material emits.
    emits: bool,
    /// Place of the node.
    node: &'a str,
}

impl Instance<'_> {
    /// True if the mesh may be shared with other instances: nothing deforms it, it does not emit, and its pose is not
    /// degenerate.
    fn may_share(&self) -> bool {
        let morphs = self.primitive.targets.is_some() && self.weights.iter().any(|&w| w != 0.0);
        let deformed = self.joints.is_some() || morphs;
        !deformed && !self.emits && SharedMesh::condition(&self.pose).is_some()
    }

    /// Place of the primitive, for messages.
    fn place(&self, data: &Data<'_>) -> String {
        let (mesh, primitive) = self.source;
        let name = data.root.meshes[mesh].name.as_ref();
        format!("{}.primitives[{primitive}]", place("meshes", mesh, name))
    }
}

/// All meshes of the nodes: one per primitive and instance, in world space, and those that instances share.
pub(super) fn meshes(
    data: &Data<'_>,
    nodes: &[PlacedNode<'_>],
    looks: &PrimitiveMaterials<'_>,
    warnings: &mut Warnings,
) -> Result<(Vec<Mesh>, Vec<SharedMesh>)> {
    let skins = Skins::new(data, nodes, warnings)?;
    let mut instances = Vec::new();
    for placed in nodes {
        let Some(index) = placed.node.mesh.map(|m| m.value()) else {
            continue;
        };
        let Some(mesh) = data.root.meshes.get(index) else {
            return Err(fault(
                &placed.place,
                format!("meshes[{index}] does not exist"),
            ));
        };
        let weights = placed.node.weights.as_ref().or(mesh.weights.as_ref());
        let poses = poses(data, placed)?;
        let primitives = mesh.primitives.iter().enumerate();
        for ((k, primitive), pose) in primitives.flat_map(|p| poses.iter().map(move |q| (p, *q))) {
            let material = looks.of(primitive);
            let instance = Instance {
                primitive,
                source: (index, k),
                pose,
                weights: weights.map_or(&[], Vec::as_slice),
                joints: (placed.node.skin).and_then(|skin| skins.joints(skin.value())),
                emits: looks.slots.get(material).is_some_and(|slot| slot.emits),
                node: &placed.place,
            };
            if instances.len() == MAX_MESHES {
                let what = format!("more than {MAX_MESHES} meshes, instances counted");
                return Err(fault(instance.place(data), what));
            }
            instances.push(instance);
        }
    }
    let shared = shared(data, &instances);
    check(data, &instances, &shared)?;
    let mut meshes = Vec::new();
    let mut numbers = HashMap::new();
    let mut shares: Vec<SharedMesh> = Vec::new();
    for instance in &instances {
        if !(shared.contains(&instance.source) && instance.may_share()) {
            meshes.extend(mesh(data, instance, looks, warnings)?);
            continue;
        }
        let number = match numbers.get(&instance.source) {
            Some(&number) => number,
            None => {
                let pose = DAffine3::IDENTITY;
                let there = Instance { pose, ..*instance };
                let number = mesh(data, &there, looks, warnings)?.map(|mesh| {
                    shares.push(SharedMesh {
                        mesh,
                        poses: Vec::new(),
                    });
                    shares.len() - 1
                });
                numbers.insert(instance.source, number);
                number
            }
        };
        if let Some(number) = number {
            shares[number].poses.push(instance.pose);
        }
    }
    Ok((meshes, shares))
}

/// The primitives that instances share.
fn shared(data: &Data<'_>, instances: &[Instance<'_>]) -> HashSet<(usize, usize)> {
    let may_share = instances.iter().filter(|instance| instance.may_share());
    limits::shared(may_share.map(|instance| {
        let (vertices, triangles) = size(data, instance.primitive);
        let bytes = bytes_of(instance.primitive, vertices, triangles, false);
        (instance.source, triangles, bytes)
    }))
}

/// Fails if the scene has too many elements or needs more memory than is available.
fn check(
    data: &Data<'_>,
    instances: &[Instance<'_>],
    shared: &HashSet<(usize, usize)>,
) -> Result<()> {
    let mut seen = HashSet::new();
    let (mut vertices, mut stored, mut shown, mut bytes) = (0u64, 0u64, 0u64, 0u64);
    for instance in instances {
        let (v, t) = size(data, instance.primitive);
        shown = shown.saturating_add(t);
        if shared.contains(&instance.source) && instance.may_share() {
            bytes += INSTANCE_BYTES;
            if !seen.insert(instance.source) {
                continue;
            }
        }
        (vertices, stored) = (vertices.saturating_add(v), stored.saturating_add(t));
        bytes = bytes.saturating_add(bytes_of(instance.primitive, v, t, instance.emits));
        if vertices.max(stored) > MAX_ELEMENTS {
            let what =
                format!("more than {MAX_ELEMENTS} vertices or triangles, copies of meshes counted");
            return Err(fault(instance.place(data), what));
        }
    }
    let what = match seen.is_empty() {
        true => format!("{shown} triangles, instances counted,"),
        false => format!("{stored} triangles and {} instances", instances.len()),
    };
    Ok(memory::check(what, bytes)?)
}

/// Bytes that a primitive with these numbers of vertices and triangles takes at most, in the mesh and in the scene.
fn bytes_of(primitive: &Primitive, vertices: u64, triangles: u64, emits: bool) -> u64 {
    let has = |semantic| u64::from(accessor(primitive, semantic).is_some());
    let uvs = has(Semantic::TexCoords(0)) + has(Semantic::TexCoords(1));
    let colors = 16 * has(Semantic::Colors(0));
    let vertex = 12 + 12 * has(Semantic::Normals) + 16 * has(Semantic::Tangents) + 8 * uvs + colors;
    vertices * vertex + triangles * triangle_bytes(emits)
}

/// The poses at which a node shows its mesh: its own, or one for each instance of EXT_mesh_gpu_instancing.
fn poses(data: &Data<'_>, placed: &PlacedNode<'_>) -> Result<Vec<DAffine3>> {
    let extension = (placed.node.extensions.as_ref())
        .and_then(|e| e.others.get("EXT_mesh_gpu_instancing"))
        .and_then(|e| e.get("attributes"));
    let Some(attributes) = extension else {
        return Ok(vec![placed.pose]);
    };
    let index = |name: &str| {
        let index = attributes.get(name)?.as_u64()?;
        Some(usize::try_from(index).unwrap_or(usize::MAX))
    };
    let indices = ["TRANSLATION", "ROTATION", "SCALE"].map(index);
    let count = (indices.iter().flatten().next()).map_or(0, |&i| data.count(i));
    if count > MAX_MESHES as u64 || indices.iter().flatten().any(|&i| data.count(i) != count) {
        let what = "EXT_mesh_gpu_instancing: its attributes differ in length, or are too long";
        return Err(fault(&placed.place, what));
    }
    let vectors = |i: Option<usize>| i.map(|i| data.normalised::<3>(i)).transpose();
    let (translations, scales) = (vectors(indices[0])?, vectors(indices[2])?);
    let rotations = (indices[1].map(|i| data.normalised::<4>(i))).transpose()?;
    let vector = |v: &Option<Vec<[f32; 3]>>, i: usize, or: DVec3| {
        (v.as_ref()).map_or(or, |v| DVec3::from(v[i].map(f64::from)))
    };
    let pose = |i: usize| {
        let rotation = rotations.as_ref().map_or(DQuat::IDENTITY, |q| {
            DQuat::from_array(q[i].map(f64::from)).normalize()
        });
        let local = DAffine3::from_scale_rotation_translation(
            vector(&scales, i, DVec3::ONE),
            rotation,
            vector(&translations, i, DVec3::ZERO),
        );
        match local.is_finite() {
            true => Ok(placed.pose * local),
            false => {
                let what = format!("EXT_mesh_gpu_instancing: instance {i} is not finite");
                Err(fault(&placed.place, what))
            }
        }
    };
    (0..count as usize).map(pose).collect()
}

/// Number of vertices and an upper bound of triangles, from counts alone.
fn size(data: &Data<'_>, primitive: &Primitive) -> (u64, u64) {
    let vertices = accessor(primitive, Semantic::Positions).map_or(0, |i| data.count(i));
    let corners = primitive
        .indices
        .map_or(vertices, |i| data.count(i.value()));
    let triangles = match primitive.mode {
        Checked::Valid(Mode::TriangleStrip | Mode::TriangleFan) => corners,
        _ => corners / 3,
    };
    (vertices, triangles)
}

fn accessor(primitive: &Primitive, semantic: Semantic) -> Option<usize> {
    (primitive.attributes.get(&Checked::Valid(semantic))).map(|i| i.value())
}

fn mesh(
    data: &Data<'_>,
    instance: &Instance<'_>,
    looks: &PrimitiveMaterials<'_>,
    warnings: &mut Warnings,
) -> Result<Option<Mesh>> {
    let Instance { primitive, .. } = instance;
    let place = &instance.place(data);
    let triangular = matches!(
        primitive.mode,
        Checked::Valid(Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)
    );
    if !triangular {
        warnings.group("primitives", place, "points and lines are ignored");
        return Ok(None);
    }
    let slot = looks.of(primitive);
    let Some(&MaterialInfo {
        material,
        uv_sets,
        textured,
        brushed,
        ..
    }) = looks.slots.get(slot)
    else {
        return Err(fault(place, format!("materials[{slot}] does not exist")));
    };
    let mut mesh = attributes(data, instance, uv_sets, warnings)?;
    morph(data, instance, &mut mesh, warnings)?;
    let poses = skinned(data, instance, mesh.positions.len(), warnings)?;
    let corners = match primitive.indices {
        None => (0..mesh.positions.len() as u32).collect(),
        Some(i) => data.indices(i.value())?,
    };
    let count = mesh.positions.len();
    if let Some(index) = corners.iter().find(|&&i| i as usize >= count) {
        let what = format!("index {index} is not below the {count} vertices");
        return Err(fault(format!("{place}.indices"), what));
    }
    mesh.indices = faces(&primitive.mode, &corners, place, warnings);
    mesh.material = material;
    mesh.name.clone_from(place);
    let second = uv_sets.1.filter(|_| mesh.second_uvs.is_empty());
    let first = Some(uv_sets.0).filter(|_| textured && mesh.uvs.is_empty());
    for set in first.into_iter().chain(second) {
        let what = format!("no TEXCOORD_{set}: textures show the texel at (0, 0)");
        warnings.group("primitives", place, &what);
    }
    if brushed && mesh.tangents.is_empty() {
        if mesh.uvs.is_empty() {
            let what = format!(
                "no tangents and no TEXCOORD_{}: anisotropy is ignored",
                uv_sets.0
            );
            warnings.group("primitives", place, &what);
        }
        mesh.derive_tangents();
    }
    put(data, &mut mesh, instance, &poses)?;
    Ok(Some(mesh))
}

/// The colours of the vertices with their opacities, or none where all are white.
fn colors(reader: &mut Optional<'_, '_>, index: usize) -> Result<Vec<Vec4>> {
    let all = match reader.data.components(index)? {
        3 => {
            let colors = reader.normalised::<3>(index, "attributes.COLOR_0")?;
            (colors.into_iter().map(|c| Vec3::from(c).extend(1.0))).collect()
        }
        _ => {
            let colors = reader.normalised::<4>(index, "attributes.COLOR_0")?;
            (colors.into_iter().map(Vec4::from)).collect::<Vec<_>>()
        }
    };
    if all.iter().all(|c| *c == Vec4::ONE) {
        return Ok(Vec::new());
    }
    Ok((all.into_iter().map(|c| c.clamp(Vec4::ZERO, Vec4::ONE))).collect())
}

fn attributes(
    data: &Data<'_>,
    instance: &Instance<'_>,
    (first, second): (u32, Option<u32>),
    warnings: &mut Warnings,
) -> Result<Mesh> {
    let Instance { primitive, .. } = instance;
    let place = &instance.place(data);
    let all = [F32, I8, U8, I16, U16];
    let Some(index) = accessor(primitive, Semantic::Positions) else {
        return Err(fault(place, "has no POSITION"));
    };
    let positions = data.floats::<3>(index, &all)?;
    if let Some(i) = positions
        .iter()
        .position(|p| !p.iter().all(|x| x.is_finite()))
    {
        let what = format!("position {i} is not finite (accessors[{index}])");
        return Err(fault(format!("{place}.attributes.POSITION"), what));
    }
    let mut mesh = Mesh {
        positions: positions.into_iter().map(Vec3::from).collect(),
        ..Mesh::default()
    };
    let mut reader = Optional {
        data,
        place,
        count: mesh.positions.len(),
        warnings,
    };
    if let Some(index) = accessor(primitive, Semantic::Normals) {
        let normals = reader.read::<3>(index, "attributes.NORMAL", &[F32, I8, I16])?;
        mesh.normals = normals.into_iter().map(Vec3::from).collect();
        // Tangents without normals are to be ignored [glTF §3.7.2.1].
        if let Some(index) = accessor(primitive, Semantic::Tangents) {
            let tangents = reader.read::<4>(index, "attributes.TANGENT", &[F32, I8, I16])?;
            mesh.tangents = tangents.into_iter().map(Vec4::from).collect();
        }
    }
    let mut uvs = |set: u32| -> Result<Vec<Vec2>> {
        let Some(index) = accessor(primitive, Semantic::TexCoords(set)) else {
            return Ok(Vec::new());
        };
        let uvs = reader.read::<2>(index, "attributes.TEXCOORD", &all)?;
        Ok(uvs.into_iter().map(Vec2::from).collect())
    };
    mesh.uvs = uvs(first)?;
    mesh.second_uvs = second.map_or(Ok(Vec::new()), uvs)?;
    if let Some(index) = accessor(primitive, Semantic::Colors(0)) {
        mesh.colors = colors(&mut reader, index)?;
    }
    Ok(mesh)
}

/// Adds the morph targets, each times its weight.
fn morph(
    data: &Data<'_>,
    instance: &Instance<'_>,
    mesh: &mut Mesh,
    warnings: &mut Warnings,
) -> Result<()> {
    let targets = instance.primitive.targets.iter().flatten();
    let all = [F32, I8, U8, I16, U16];
    for (k, (target, &weight)) in targets.zip(instance.weights).enumerate() {
        if weight == 0.0 {
            continue;
        }
        let mut reader = Optional {
            data,
            place: &instance.place(data),
            count: mesh.positions.len(),
            warnings,
        };
        let mut read = |index: usize, name: &str| -> Result<Vec<Vec3>> {
            let deltas = reader.read::<3>(index, &format!("targets[{k}].{name}"), &all)?;
            Ok((deltas.into_iter().map(|d| weight * Vec3::from(d))).collect())
        };
        if let Some(index) = target.positions {
            let deltas = read(index.value(), "POSITION")?;
            mesh.positions
                .iter_mut()
                .zip(deltas)
                .for_each(|(p, d)| *p += d);
        }
        if let Some(index) = target.normals {
            let deltas = read(index.value(), "NORMAL")?;
            mesh.normals
                .iter_mut()
                .zip(deltas)
                .for_each(|(n, d)| *n += d);
        }
        if let Some(index) = target.tangents {
            let deltas = read(index.value(), "TANGENT")?;
            (mesh.tangents.iter_mut().zip(deltas)).for_each(|(t, d)| *t += d.extend(0.0));
        }
    }
    Ok(())
}

/// The pose of each vertex of a skinned mesh; empty for a rigid one.
fn skinned(
    data: &Data<'_>,
    instance: &Instance<'_>,
    count: usize,
    warnings: &mut Warnings,
) -> Result<Vec<DAffine3>> {
    let Some(joints) = instance.joints else {
        return Ok(Vec::new());
    };
    let mut sets: Vec<Influences> = Vec::new();
    for set in 0.. {
        let numbers = accessor(instance.primitive, Semantic::Joints(set));
        let weights = accessor(instance.primitive, Semantic::Weights(set));
        let (Some(numbers), Some(weights)) = (numbers, weights) else {
            break;
        };
        let (numbers, weights) = (data.joints(numbers)?, data.normalised::<4>(weights)?);
        if numbers.len() != count || weights.len() != count {
            let what = format!("JOINTS_{set} or WEIGHTS_{set} differs in length from POSITION");
            return Err(fault(instance.place(data), what));
        }
        sets.push((numbers, weights));
    }
    if sets.is_empty() {
        warnings.say(format!(
            "{}: has a skin, but no JOINTS_0 and WEIGHTS_0: shown in its rest pose",
            instance.place(data)
        ));
        return Ok(Vec::new());
    }
    blended(joints, &sets, count, &instance.place(data))
}

/// Reads optional attributes.
struct Optional<'a, 'b> {
    data: &'a Data<'b>,
    place: &'a str,
    count: usize,
    warnings: &'a mut Warnings,
}

impl Optional<'_, '_> {
    fn read<const N: usize>(
        &mut self,
        index: usize,
        name: &str,
        allowed: &[gltf::json::accessor::ComponentType],
    ) -> Result<Vec<[f32; N]>> {
        let values = self.data.floats::<N>(index, allowed)?;
        self.checked(index, name, values)
    }

    /// Floats or normalised integers.
    fn normalised<const N: usize>(&mut self, index: usize, name: &str) -> Result<Vec<[f32; N]>> {
        let values = self.data.normalised::<N>(index)?;
        self.checked(index, name, values)
    }

    fn checked<const N: usize>(
        &mut self,
        index: usize,
        name: &str,
        mut values: Vec<[f32; N]>,
    ) -> Result<Vec<[f32; N]>> {
        if values.len() != self.count {
            let what = format!(
                "{} values for {} vertices (accessors[{index}])",
                values.len(),
                self.count
            );
            return Err(fault(format!("{}.{name}", self.place), what));
        }
        let mut bad = 0;
        for value in values
            .iter_mut()
            .filter(|v| !v.iter().all(|x| x.is_finite()))
        {
            *value = [0.0; N];
            bad += 1;
        }
        if bad > 0 {
            self.warnings.say(format!(
                "accessors[{index}]: {bad} values are not finite; read as 0"
            ));
        }
        Ok(values)
    }
}

/// Triangles of a topology `[glTF §3.7.2.1]`. Corners left over are dropped.
fn faces(
    mode: &Checked<Mode>,
    corners: &[u32],
    place: &str,
    warnings: &mut Warnings,
) -> Vec<[u32; 3]> {
    // Degenerate triangles only join parts of a strip.
    let spans = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
    match mode {
        Checked::Valid(Mode::TriangleStrip) => (corners.windows(3).enumerate())
            .map(|(i, w)| {
                if i % 2 == 0 {
                    [w[0], w[1], w[2]]
                } else {
                    [w[0], w[2], w[1]]
                }
            })
            .filter(spans)
            .collect(),
        Checked::Valid(Mode::TriangleFan) => {
            let Some((&hub, rim)) = corners.split_first() else {
                return Vec::new();
            };
            (rim.windows(2))
                .map(|w| [w[0], w[1], hub])
                .filter(spans)
                .collect()
        }
        _ => {
            let (faces, rest) = corners.as_chunks::<3>();
            if !rest.is_empty() {
                warnings.say(format!(
                    "{place}: {} corners left over are ignored",
                    rest.len()
                ));
            }
            faces.to_vec()
        }
    }
}

/// Transforms a mesh to world space, by `poses` of its vertices if there are any, else by its own. A mirroring pose
/// reverses the winding, so that the front stays the front `[glTF §3.7.4]`.
fn put(
    data: &Data<'_>,
    mesh: &mut Mesh,
    instance: &Instance<'_>,
    poses: &[DAffine3],
) -> Result<()> {
    let pose = |i: usize| poses.get(i).unwrap_or(&instance.pose);
    let mirrored = pose(0).matrix3.determinant() < 0.0;
    let sign = if mirrored { -1.0 } else { 1.0 };
    for (i, p) in mesh.positions.iter_mut().enumerate() {
        *p = pose(i).transform_point3(p.as_dvec3()).as_vec3();
        if !p.is_finite() {
            let what = format!(
                "a position of {} is not finite in the world",
                instance.place(data)
            );
            return Err(fault(instance.node, what));
        }
    }
    for (i, n) in mesh.normals.iter_mut().enumerate() {
        *n = unit(cofactors(&pose(i).matrix3) * sign * n.as_dvec3());
    }
    for (i, t) in mesh.tangents.iter_mut().enumerate() {
        let hand = if (t.w < 0.0) == mirrored { 1.0 } else { -1.0 };
        *t = unit(pose(i).matrix3 * t.truncate().as_dvec3()).extend(hand);
    }
    if mirrored {
        mesh.indices
            .iter_mut()
            .for_each(|[_, b, c]| std::mem::swap(b, c));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_strips_and_fans_keep_their_winding() {
        let faces = |mode, n| {
            let corners: Vec<u32> = (0..n).collect();
            faces(
                &Checked::Valid(mode),
                &corners,
                "p",
                &mut Warnings::default(),
            )
        };
        assert_eq!(
            faces(Mode::TriangleStrip, 5),
            [[0, 1, 2], [1, 3, 2], [2, 3, 4]]
        );
        assert_eq!(faces(Mode::TriangleFan, 4), [[1, 2, 0], [2, 3, 0]]);
        assert_eq!(faces(Mode::Triangles, 7), [[0, 1, 2], [3, 4, 5]]);
        for mode in [Mode::TriangleStrip, Mode::TriangleFan, Mode::Triangles] {
            assert!((0..3).all(|n| faces(mode, n).is_empty()));
        }
    }
}
