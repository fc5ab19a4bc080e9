//! Scenes of Mitsuba 3 (`.xml`), and of Mitsuba 0.5 and 0.6, whose files are upgraded as Mitsuba 3 does.

mod bsdfs;
mod lights;
mod media;
pub(super) mod names;
mod shapes;
mod values;
mod xml;

use super::media::Named;
use super::{Context, Member, ShapeMaterial};
use glam::{DAffine3, DMat4};
use opsr::math::Vec3;
use opsr::scene::load::error::{Result, fault};
use std::collections::HashMap;
use std::rc::Rc;
use xml::{Child, Ids, Link, Object, Reader};

/// A scene in progress.
struct Scene<'a> {
    context: &'a mut Context,
    ids: Ids,
    /// True for a file of version 0.5 or 0.6.
    is_old: bool,
    /// True if the material being read uses the colours of its mesh.
    painted: bool,
    /// Materials by the address of their object.
    materials: HashMap<usize, ShapeMaterial>,
    /// Grey versions of textures, by texture and factor: factor and texture.
    greys: HashMap<(u32, [u32; 3]), (f32, u32)>,
    /// Media by the address of their object.
    media: HashMap<usize, Named>,
    /// Objects being read: a reference to one of them is a cycle.
    open: Vec<usize>,
    /// Members of groups of shapes, by address.
    groups: HashMap<usize, Rc<Vec<Member>>>,
}

/// Reads a scene from the text of its file.
pub(super) fn read(context: &mut Context, text: Vec<u8>) -> Result<()> {
    let mut reader = Reader::new(context);
    let root = reader.file(text, "", 0)?;
    let (ids, is_old) = (std::mem::take(&mut reader.ids), reader.is_old);
    let mut scene = Scene {
        context,
        ids,
        is_old,
        painted: false,
        materials: HashMap::new(),
        greys: HashMap::new(),
        media: HashMap::new(),
        open: Vec::new(),
        groups: HashMap::new(),
    };
    for child in &root.children {
        scene.member(child)?;
    }
    Ok(())
}

impl Scene<'_> {
    fn member(&mut self, child: &Child) -> Result<()> {
        let object = self.resolved(child)?;
        match object.tag.as_str() {
            "sensor" | "camera" => self.sensor(&object),
            "shape" => self.shape(&object),
            "emitter" | "luminaire" => self.emitter(&object),
            "integrator" => self.integrator(&object),
            "subsurface" => self.context.left_out(
                &object.place,
                format!("<{} type=\"{}\">", object.tag, object.plugin),
            ),
            // Materials, textures, media and volumes are read where they are used; samplers and films do not apply.
            _ => Ok(()),
        }
    }

    /// Warns of settings of the integrator that change the picture and are ignored.
    fn integrator(&mut self, integrator: &Object) -> Result<()> {
        let place = &integrator.place;
        // Edges of a path from light to camera, one more than its scattering vertices; −1 is unlimited.
        let depth = integrator.number("max_depth", -1.0)?;
        if depth >= 0.0 {
            self.context
                .warn_of_limit("max_depth", depth, depth - 1.0, place);
        }
        if integrator.flag("hide_emitters", false)? {
            let what = "`hide_emitters` is not taken: lights are seen";
            self.context.approximate(place, what);
        }
        Ok(())
    }

    fn resolved(&self, child: &Child) -> Result<Rc<Object>> {
        match &child.what {
            Link::Object(object) => Ok(object.clone()),
            Link::Id(id) => {
                (self.ids.get(id)).ok_or_else(|| fault(&child.place, format!("no object `{id}`")))
            }
        }
    }

    /// The children of some tags, with their names.
    fn children(&self, object: &Object, tags: &[&str]) -> Result<Vec<(String, Rc<Object>)>> {
        let mut out = Vec::new();
        for child in &object.children {
            let found = self.resolved(child)?;
            if tags.contains(&found.tag.as_str()) {
                out.push((child.name.clone(), found));
            }
        }
        Ok(out)
    }

    /// Runs `act` on an object; fails if the object contains itself.
    fn within<T>(
        &mut self,
        object: &Object,
        act: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        let address = std::ptr::from_ref(object).addr();
        if self.open.contains(&address) || self.open.len() > 64 {
            return Err(fault(&object.place, "refers to itself"));
        }
        self.open.push(address);
        let done = act(self);
        self.open.pop();
        done
    }
}

/// An affine transform; fails if the matrix has a projective part or is not finite.
fn affine(matrix: &DMat4, place: &str) -> Result<DAffine3> {
    let below = matrix.row(3);
    if below.truncate().abs().max_element() > 1e-6 || (below.w - 1.0).abs() > 1e-6 {
        return Err(fault(place, "the last row of its matrix is not 0 0 0 1"));
    }
    let pose = DAffine3::from_mat4(*matrix);
    let here: Vec3 = pose.translation.as_vec3();
    match pose.is_finite() && here.is_finite() {
        true => Ok(pose),
        false => Err(fault(place, "its transform is not finite")),
    }
}
