//! Scenes built piece by piece: meshes at poses, materials, lights. The readers of other renderers' files and Python
//! use it; [`Builder::finish`] returns plain [`SceneParts`], as the reader of glTF does.

pub mod colour;
pub mod looks;
pub mod metals;
pub mod shapes;
pub mod sky;
pub mod subdivision;

use glam::DAffine3;
use opsr::math::{Rgb, Vec3};
use opsr::memory::{self, Shortage};
use opsr::scene::limits::{self, INSTANCE_BYTES, MAX_ELEMENTS, MAX_MESHES, triangle_bytes};
use opsr::scene::{Material, Mesh, SceneParts, SharedMesh};
use std::collections::HashMap;

/// The transform from a mesh's space to the world.
pub type Pose = DAffine3;

/// The pose of a matrix, given by its columns; the last column is the translation.
pub fn pose_of([x, y, z, shift]: [[f64; 3]; 4]) -> Pose {
    Pose::from_cols(x.into(), y.into(), z.into(), shift.into())
}

/// Reasons for which a scene cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// More meshes, vertices or triangles than a scene may have.
    #[error("more than {0}, copies of meshes counted")]
    TooMany(String),
    /// More memory than the machine has free.
    #[error("{0}")]
    Memory(Shortage),
}

/// A mesh at a pose.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Index of the mesh, as returned by [`Builder::mesh`].
    pub mesh: u32,
    /// Index of the material.
    pub material: u32,
    /// The transform from the mesh's space to the world. A mirroring pose leaves the front of the mesh its front.
    pub pose: Pose,
}

/// A scene in progress.
#[derive(Clone, Debug, Default)]
pub struct Builder {
    /// Materials, textures, lights, cameras and environment so far. Its meshes are empty until [`Builder::finish`].
    pub parts: SceneParts,
    meshes: Vec<Mesh>,
    placed: Vec<Placed>,
}

impl Builder {
    /// Adds a mesh in its own space and returns its index. Any number of copies of it may be placed.
    pub fn mesh(&mut self, mesh: Mesh) -> u32 {
        self.meshes.push(mesh);
        self.meshes.len() as u32 - 1
    }

    /// The mesh of this index.
    pub fn mesh_mut(&mut self, mesh: u32) -> &mut Mesh {
        &mut self.meshes[mesh as usize]
    }

    /// Adds a material; returns its index.
    pub fn material(&mut self, material: Material) -> u32 {
        self.parts.materials.push(material);
        self.parts.materials.len() as u32 - 1
    }

    /// Adds a copy of a mesh to the scene. Fails beyond the largest number of meshes.
    pub fn place(&mut self, placed: Placed) -> Result<(), BuildError> {
        if self.placed.len() == MAX_MESHES {
            return Err(BuildError::TooMany(format!("{MAX_MESHES} meshes")));
        }
        self.placed.push(placed);
        Ok(())
    }

    fn emits(&self, material: u32) -> bool {
        let material = self.parts.materials.get(material as usize);
        material.is_some_and(|m| m.emission != Rgb::ZERO)
    }

    fn may_share(&self, placed: &Placed) -> bool {
        !self.emits(placed.material) && SharedMesh::condition(&placed.pose).is_some()
    }

    fn bytes(mesh: &Mesh, emits: bool) -> u64 {
        let all = |n: usize, size: u64| n as u64 * size;
        all(mesh.positions.len() + mesh.normals.len(), 12)
            + all(mesh.uvs.len() + mesh.second_uvs.len(), 8)
            + all(mesh.tangents.len() + mesh.colors.len(), 16)
            + all(mesh.indices.len(), triangle_bytes(emits))
    }

    /// The parts of the scene. Meshes that are placed more than once are shared if copies would take much memory; the
    /// smallest meshes are always copied.
    pub fn finish(mut self) -> Result<SceneParts, BuildError> {
        let may_share = self.placed.iter().filter(|placed| self.may_share(placed));
        let shared = limits::shared(may_share.map(|placed| {
            let mesh = &self.meshes[placed.mesh as usize];
            let key = (placed.mesh, placed.material);
            (key, mesh.indices.len() as u64, Self::bytes(mesh, false))
        }));
        let shares = |b: &Self, placed: &Placed| {
            shared.contains(&(placed.mesh, placed.material)) && b.may_share(placed)
        };
        let (mut stored, mut shown, mut bytes) = (0u64, 0u64, 0u64);
        for placed in &self.placed {
            let mesh = &self.meshes[placed.mesh as usize];
            let triangles = mesh.indices.len() as u64;
            shown += triangles;
            if shares(&self, placed) {
                bytes += INSTANCE_BYTES;
                continue;
            }
            stored += triangles.max(mesh.positions.len() as u64);
            bytes += Self::bytes(mesh, self.emits(placed.material));
        }
        if stored > MAX_ELEMENTS {
            let most = format!("{MAX_ELEMENTS} vertices or triangles");
            return Err(BuildError::TooMany(most));
        }
        memory::check(format!("{shown} triangles, instances counted,"), bytes)
            .map_err(BuildError::Memory)?;
        let mut numbers: HashMap<(u32, u32), usize> = HashMap::new();
        for placed in std::mem::take(&mut self.placed) {
            let mesh = &self.meshes[placed.mesh as usize];
            let material = placed.material;
            if !shares(&self, &placed) {
                let mesh = mesh.at(&placed.pose);
                self.parts.meshes.push(Mesh { material, ..mesh });
                continue;
            }
            let shared = &mut self.parts.shared;
            let number = *numbers.entry((placed.mesh, material)).or_insert_with(|| {
                let mesh = mesh.clone();
                shared.push(SharedMesh {
                    mesh: Mesh { material, ..mesh },
                    poses: Vec::new(),
                });
                shared.len() - 1
            });
            shared[number].poses.push(placed.pose);
        }
        Ok(self.parts)
    }
}

/// SHA-256 over the contents of a scene that has no file, in hexadecimal digits.
pub fn fingerprint(parts: &SceneParts) -> String {
    use sha2::{Digest, Sha256};
    let mut digest = Sha256::new();
    for mesh in parts.all_meshes() {
        digest.update(bytemuck::cast_slice(&mesh.positions));
        digest.update(bytemuck::cast_slice(&mesh.normals));
        digest.update(bytemuck::cast_slice(&mesh.uvs));
        digest.update(bytemuck::cast_slice(&mesh.indices));
        digest.update(mesh.material.to_le_bytes());
    }
    for texture in &parts.textures {
        digest.update(format!(
            "{} {} {:?}",
            texture.width,
            texture.height,
            texture.average()
        ));
    }
    let poses = parts.shared.iter().map(|shared| &shared.poses);
    poses.for_each(|poses| digest.update(format!("{poses:?}")));
    let rest = (
        &parts.materials,
        &parts.lights,
        &parts.cameras,
        parts.own_boundaries,
    );
    digest.update(format!("{rest:?}"));
    let sky = parts
        .environment
        .as_ref()
        .map(|sky| (sky.average(), sky.peak()));
    digest.update(format!("{sky:?}"));
    opsr::files::hex(&digest.finalize())
}

/// Swaps the front and the back of a mesh.
pub fn flip(mesh: &mut Mesh) {
    mesh.indices.iter_mut().for_each(|face| face.swap(1, 2));
    mesh.normals.iter_mut().for_each(|n| *n = -*n);
}

/// Orients each triangle so that its front is the side to which its vertices' normals point.
pub fn face_normals_outwards(mesh: &mut Mesh) {
    if mesh.normals.len() != mesh.positions.len() {
        return;
    }
    for face in &mut mesh.indices {
        let at = |i: u32| mesh.positions.get(i as usize).copied();
        let (Some(a), Some(b), Some(c)) = (at(face[0]), at(face[1]), at(face[2])) else {
            continue;
        };
        let normals: Vec3 = face.iter().map(|&i| mesh.normals[i as usize]).sum();
        if (b - a).cross(c - a).dot(normals) < 0.0 {
            face.swap(1, 2);
        }
    }
}

/// Gives a mesh tangents along u, with a right-handed bitangent: the frame of normal maps in pbrt and Mitsuba.
pub fn right_handed_tangents(mesh: &mut Mesh) {
    mesh.derive_tangents();
    mesh.tangents.iter_mut().for_each(|t| t.w = 1.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DMat3, DVec3};

    /// The front of a sphere stays outside under any pose, also a mirroring one.
    #[test]
    fn builder_keeps_fronts_and_shares_what_is_large() {
        let mut builder = Builder::default();
        let ball = builder.mesh(shapes::sphere(Vec3::ZERO, 1.0));
        let material = builder.material(Material::default());
        let mirror = DAffine3::from_mat3(DMat3::from_diagonal(DVec3::new(-2.0, 1.0, 1.0)));
        let away = DAffine3::from_translation(DVec3::new(0.0, 9.0, 0.0));
        for pose in [mirror, away] {
            let placed = Placed {
                mesh: ball,
                material,
                pose,
            };
            builder.place(placed).unwrap();
        }
        let few = builder.clone().finish().unwrap();
        assert_eq!((few.meshes.len(), few.shared.len()), (2, 0));
        for (mesh, centre) in few.meshes.iter().zip([Vec3::ZERO, 9.0 * Vec3::Y]) {
            for face in &mesh.indices {
                let [a, b, c] = face.map(|i| mesh.positions[i as usize]);
                let across = (b - a).cross(c - a);
                assert!(across.dot(a + b + c - 3.0 * centre) >= -1e-6);
                assert!(across.dot(mesh.normals[face[1] as usize]) >= -1e-6);
            }
        }
        let bytes = Builder::bytes(&builder.meshes[0], false);
        for _ in 0..=(256 << 20) / bytes {
            let placed = Placed {
                mesh: ball,
                material,
                pose: away,
            };
            builder.place(placed).unwrap();
        }
        let many = builder.finish().unwrap();
        assert_eq!((many.meshes.len(), many.shared.len()), (0, 1));
    }
}
