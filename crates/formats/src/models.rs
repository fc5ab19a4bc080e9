//! OBJ and PLY files as scenes of their own: models without lights or cameras.

use super::{Context, ShapeMaterial, mtl, obj, ply};
use crate::build::looks::{self, Paint};
use crate::build::{Placed, face_normals_outwards};
use glam::DAffine3;
use opsr::math::Rgb;
use opsr::scene::Mesh;
use opsr::scene::load::error::{Result, fault};
use std::collections::HashMap;

const NO_FACES: &str = "has no faces: points alone are not shown";

/// Reads an OBJ file with its materials.
pub(super) fn obj(context: &mut Context, bytes: Vec<u8>) -> Result<()> {
    context.builder.parts.own_boundaries = false;
    let file = obj::read(&bytes, "line", true)?;
    if file.mesh.indices.is_empty() {
        return Err(fault("body", NO_FACES));
    }
    let mut library = mtl::Library::new();
    for names in &file.libraries {
        context.library(names, &mut library);
    }
    // Faces by material, in the order of first use.
    let mut parts: Vec<(&str, Vec<[u32; 3]>)> = Vec::new();
    let mut known: HashMap<&str, usize> = HashMap::new();
    let starts = file
        .materials
        .iter()
        .map(|(start, name)| (*start, name.as_str()));
    let runs: Vec<(usize, &str)> = [(0, "")].into_iter().chain(starts).collect();
    for (i, &(start, name)) in runs.iter().enumerate() {
        let end = runs
            .get(i + 1)
            .map_or(file.mesh.indices.len(), |next| next.0);
        if start == end {
            continue;
        }
        let number = *known.entry(name).or_insert_with(|| {
            parts.push((name, Vec::new()));
            parts.len() - 1
        });
        parts[number].1.extend(&file.mesh.indices[start..end]);
    }
    for (name, faces) in parts {
        let look = match library.get(name) {
            Some(entry) => {
                let entry = entry.clone();
                context.of_entry(name, &entry)?
            }
            None => {
                if !name.is_empty() {
                    context.approximate(name, "is no material of the file's: shown as grey");
                }
                default_material()
            }
        };
        let mesh = part(&file.mesh, &faces, name);
        context.add_mesh(look, name, mesh)?;
    }
    Ok(())
}

/// Reads a PLY file.
pub(super) fn ply(context: &mut Context, bytes: Vec<u8>) -> Result<()> {
    context.builder.parts.own_boundaries = false;
    let mesh = ply::read(&bytes, "body")?;
    if mesh.indices.is_empty() {
        return Err(fault("body", NO_FACES));
    }
    context.add_mesh(default_material(), "", mesh)
}

/// The default material: a grey diffuse surface.
fn default_material() -> ShapeMaterial {
    looks::diffuse(Paint::from(0.8)).into()
}

/// Some faces of a mesh, with only the vertices that they use.
fn part(mesh: &Mesh, faces: &[[u32; 3]], name: &str) -> Mesh {
    let mut numbers = vec![u32::MAX; mesh.positions.len()];
    let mut used = Vec::new();
    let mut number = |old: u32| {
        let new = &mut numbers[old as usize];
        if *new == u32::MAX {
            *new = used.len() as u32;
            used.push(old as usize);
        }
        *new
    };
    let indices = faces.iter().map(|face| face.map(&mut number)).collect();
    fn some<T: Copy>(of: &[T], used: &[usize]) -> Vec<T> {
        match of.is_empty() {
            true => Vec::new(),
            false => used.iter().map(|i| of[*i]).collect(),
        }
    }
    Mesh {
        indices,
        positions: some(&mesh.positions, &used),
        normals: some(&mesh.normals, &used),
        uvs: some(&mesh.uvs, &used),
        colors: some(&mesh.colors, &used),
        name: name.to_owned(),
        ..Mesh::default()
    }
}

impl Context {
    /// Reads one file of materials, or several with blanks between their names. A missing one is common: a warning.
    fn library(&mut self, names: &str, library: &mut mtl::Library) {
        let place = "mtllib";
        let names = names.replace('\\', "/");
        if let Ok((_, bytes)) = self.files.open(&names, place) {
            return mtl::read(&bytes, &names, library);
        }
        for name in names.split_whitespace() {
            match self.files.open(name, place) {
                Ok((_, bytes)) => mtl::read(&bytes, name, library),
                Err(_) => self.approximate(name, "cannot be read: its materials are shown as grey"),
            }
        }
    }

    /// Adds a mesh to the model.
    fn add_mesh(&mut self, mut look: ShapeMaterial, key: &str, mut mesh: Mesh) -> Result<()> {
        face_normals_outwards(&mut mesh);
        if !mesh.colors.is_empty() {
            look.material.finish_mut().has_colors = true;
            if look.material.base_color_texture.is_none() {
                look.material.base_color = Rgb::ONE;
            }
        }
        let pose = DAffine3::IDENTITY;
        let mesh = self.builder.mesh(mesh);
        let (material, mesh) = self.shape_material(look, key.to_owned(), mesh, &pose);
        (self.builder.place(Placed {
            mesh,
            material,
            pose,
        }))
        .map_err(|e| fault("model", e.to_string()))
    }
}
