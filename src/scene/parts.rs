//! The content of a scene, as plain data.

use super::camera::Camera;
use super::light::{Environment, PunctualLight};
use super::material::Material;
use super::medium::Medium;
use super::mesh::{Mesh, SharedMesh};
use super::texture::{self, Texture};
use crate::math::Vec3;
use std::collections::HashMap;

/// Everything a scene is made of, as plain data.
#[derive(Clone, Debug, Default)]
pub struct SceneParts {
    /// Triangle meshes in world space.
    pub meshes: Vec<Mesh>,
    /// Meshes that are stored once and shown at several poses. Loaders share a mesh if copies would take much memory;
    /// see [`load`](super::load).
    pub shared: Vec<SharedMesh>,
    /// Materials; `Mesh::material` is an index into this list.
    pub materials: Vec<Material>,
    /// Textures; materials hold indices into this list.
    pub textures: Vec<Texture>,
    /// Point, spot and directional lights.
    pub lights: Vec<PunctualLight>,
    /// Radiance from infinity.
    pub environment: Option<Environment>,
    /// Medium outside of all bodies; `None` for nothing.
    pub medium: Option<Medium>,
    /// Cameras, in file order.
    pub cameras: Vec<Camera>,
    /// True if each boundary of a body defines both its sides: it refracts by its own index, whatever bodies are
    /// around. Scenes of other renderers use it.
    pub own_boundaries: bool,
    /// True if the last mesh is the floor of the studio.
    pub has_floor: bool,
}

impl SceneParts {
    /// Adds a material.
    pub(crate) fn add_material(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        self.materials.len() as u32 - 1
    }

    /// Adds meshes of one material.
    pub fn add(&mut self, material: Material, meshes: impl IntoIterator<Item = Mesh>) -> u32 {
        let material = self.add_material(material);
        self.meshes
            .extend(meshes.into_iter().map(|mesh| Mesh { material, ..mesh }));
        material
    }

    /// Adds a pinhole camera at `from` that looks at `to`, with a vertical field of view in degrees.
    pub fn add_camera(&mut self, from: [f32; 3], to: [f32; 3], fov_y: f32) {
        let name = "camera".to_owned();
        let fov_y = fov_y.to_radians();
        self.cameras.push(Camera {
            name,
            ..Camera::look_at(from.into(), to.into(), Vec3::Y, fov_y)
        });
    }

    /// All meshes, the shared ones once and in their own space.
    pub fn all_meshes(&self) -> impl Iterator<Item = &Mesh> {
        let shared = self.shared.iter().map(|shared| &shared.mesh);
        self.meshes.iter().chain(shared)
    }

    /// Builds the mip levels of textures that cameras see as means over a pixel's footprint. For each material, true if
    /// it has such a texture; empty if none has.
    pub(super) fn filter_textures(&mut self) -> Vec<bool> {
        let mut shown = vec![false; self.materials.len()];
        for mesh in self.all_meshes() {
            if let Some(shown) = shown.get_mut(mesh.material as usize) {
                *shown = true;
            }
        }
        let texture = |m: &Material| m.filtered(&self.textures);
        let maps: Vec<Option<u32>> = (self.materials.iter().zip(shown))
            .map(|(m, shown)| texture(m).filter(|_| shown))
            .collect();
        texture::build_mips(&mut self.textures, |i| maps.contains(&Some(i as u32)));
        match maps.iter().any(Option::is_some) {
            true => maps.iter().map(Option::is_some).collect(),
            false => Vec::new(),
        }
    }

    /// Gives these meshes, by sorted index among all, thin-walled copies of their materials.
    pub(super) fn make_thin(&mut self, thin: &[usize]) {
        let mut copies = HashMap::new();
        let shared = self.shared.iter_mut().map(|shared| &mut shared.mesh);
        for (_, mesh) in (self.meshes.iter_mut().chain(shared).enumerate())
            .filter(|(i, _)| thin.binary_search(i).is_ok())
        {
            mesh.material = *copies.entry(mesh.material).or_insert_with_key(|&of| {
                let copy = Material {
                    solid: false,
                    ..self.materials[of as usize].clone()
                };
                self.materials.push(copy);
                self.materials.len() as u32 - 1
            });
        }
    }
}
