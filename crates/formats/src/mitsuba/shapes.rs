//! Shapes of Mitsuba.

use super::super::{Member, Role, ShapeMaterial, curves, obj, ply, serialized};
use super::Scene;
use super::xml::Object;
use crate::build::looks::{self, Paint};
use crate::build::{Placed, face_normals_outwards, flip, shapes};
use glam::{DAffine3, DVec3};
use opsr::math::{Frame, Rgb, Vec3};
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{AlphaMode, Material, Mesh};
use std::f32::consts::TAU;
use std::rc::Rc;

/// Most members of a group, those of inner groups counted.
const MAX_MEMBERS: usize = 1 << 20;

impl Scene<'_> {
    /// Places a shape; a group is only placed by its instances.
    pub(super) fn shape(&mut self, shape: &Object) -> Result<()> {
        match shape.plugin.as_str() {
            "shapegroup" => Ok(()),
            "instance" => {
                let pose = shape.pose("to_world")?;
                for (_, group) in self.children(shape, &["shape"])? {
                    let members = self.group(&group)?;
                    for &(mesh, material, inner) in members.iter() {
                        self.place(mesh, material, pose * inner, &shape.place)?;
                    }
                }
                Ok(())
            }
            _ => {
                for (mesh, material, pose) in self.all(shape)? {
                    self.place(mesh, material, pose, &shape.place)?;
                }
                Ok(())
            }
        }
    }

    fn place(&mut self, mesh: u32, material: u32, pose: DAffine3, place: &str) -> Result<()> {
        let placed = Placed {
            mesh,
            material,
            pose,
        };
        (self.context.builder.place(placed)).map_err(|e| fault(place, e.to_string()))
    }

    /// The members of a group.
    fn group(&mut self, group: &Rc<Object>) -> Result<Rc<Vec<Member>>> {
        let address = Rc::as_ptr(group).addr();
        if let Some(known) = self.groups.get(&address) {
            return Ok(known.clone());
        }
        let members = self.within(group, |scene| {
            let mut members = Vec::new();
            for (_, shape) in scene.children(group, &["shape"])? {
                if shape.plugin == "instance" {
                    let pose = shape.pose("to_world")?;
                    for (_, inner) in scene.children(&shape, &["shape"])? {
                        let inner = scene.group(&inner)?;
                        members.extend(inner.iter().map(|&(m, l, p)| (m, l, pose * p)));
                    }
                } else {
                    members.extend(scene.all(&shape)?);
                }
                if members.len() > MAX_MEMBERS {
                    return Err(fault(&shape.place, "a group of too many shapes"));
                }
            }
            Ok(Rc::new(members))
        })?;
        self.groups.insert(address, members.clone());
        Ok(members)
    }

    /// The members of a shape: itself, or the shapes inside `merge`.
    fn all(&mut self, shape: &Object) -> Result<Vec<Member>> {
        if shape.plugin != "merge" {
            return Ok(self.one(shape)?.into_iter().collect());
        }
        let inner = self.children(shape, &["shape"])?;
        let mut members = Vec::new();
        for (_, inner) in inner {
            members.extend(self.within(&inner, |scene| scene.all(&inner))?);
        }
        Ok(members)
    }

    /// Mesh, material and pose of a shape; `None` if it is left out.
    fn one(&mut self, shape: &Object) -> Result<Option<Member>> {
        for (_, subsurface) in self.children(shape, &["subsurface"])? {
            self.context.nearest(
                &subsurface.place,
                "subsurface scattering",
                "the surface alone",
            )?;
        }
        let pose = shape.pose("to_world")?;
        let flipped = shape.flag("flip_normals", false)?;
        let Some((mesh, pose)) = self.mesh(shape, pose, flipped)? else {
            return Ok(None);
        };
        let (material, mesh) = self.shape_material(shape, mesh, &pose)?;
        Ok(Some((mesh, material, pose)))
    }

    fn analytic(&mut self, key: &str, flipped: bool, make: impl FnOnce() -> Mesh) -> u32 {
        let key = format!("{flipped} {key}");
        if let Some(&mesh) = self.context.meshes.get(&key) {
            return mesh;
        }
        let mut mesh = make();
        if flipped {
            flip(&mut mesh);
        }
        let mesh = self.context.builder.mesh(mesh);
        self.context.meshes.insert(key, mesh);
        mesh
    }

    fn mesh(
        &mut self,
        shape: &Object,
        pose: DAffine3,
        flipped: bool,
    ) -> Result<Option<(u32, DAffine3)>> {
        let place = &shape.place;
        Ok(Some(match shape.plugin.as_str() {
            "rectangle" => (self.analytic("rectangle", flipped, shapes::rectangle), pose),
            "cube" => (self.analytic("cube", flipped, shapes::cube), pose),
            "disk" => {
                let make = || shapes::disk(0.0, 1.0, 0.0, TAU);
                (self.analytic("disk", flipped, make), pose)
            }
            "sphere" => {
                let centre = shape.vector("center", DVec3::ZERO)?;
                let radius = shape.number("radius", 1.0)?;
                let own =
                    DAffine3::from_translation(centre) * DAffine3::from_scale(DVec3::splat(radius));
                let make = || shapes::sphere(Vec3::ZERO, 1.0);
                (self.analytic("sphere", flipped, make), pose * own)
            }
            "cylinder" => {
                let (from, to) = (
                    shape.vector("p0", DVec3::ZERO)?,
                    shape.vector("p1", DVec3::Z)?,
                );
                let radius = shape.number("radius", 1.0)?;
                let length = (to - from).length();
                let axis = (to - from)
                    .try_normalize()
                    .ok_or_else(|| fault(place, "has no length"))?;
                // Mitsuba's frame [Duff17], which determines where the texture begins.
                let Frame { s, t, .. } = Frame::from_normal(axis.as_vec3());
                let [s, t] = [s, t].map(|v| radius * v.as_dvec3());
                let own = DAffine3::from_cols(s, t, length * axis, from);
                let make = || shapes::cylinder(1.0, [0.0, 1.0], TAU);
                (self.analytic("cylinder", flipped, make), pose * own)
            }
            "obj" | "ply" | "serialized" => (self.file(shape, &pose, flipped)?, pose),
            "bsplinecurve" | "linearcurve" | "hair" => {
                (self.curves(shape, &pose)?, DAffine3::IDENTITY)
            }
            other => {
                self.context.left_out(place, format!("shape `{other}`"))?;
                return Ok(None);
            }
        }))
    }

    /// Curves as tubes; the pose moves their points but does not scale their radii.
    fn curves(&mut self, shape: &Object, pose: &DAffine3) -> Result<u32> {
        let place = &shape.place;
        let plugin = shape.plugin.as_str();
        let name = shape.text("filename")?;
        let name = name.ok_or_else(|| fault(place, "has no filename"))?;
        (self.context).approximate(place, &format!("`{plugin}` is shown as tubes"));
        let radius = shape.number("radius", 0.025)? as f32;
        let choice = format!("{plugin} {radius} {pose:?}");
        let to_world = |p: Vec3| pose.transform_point3(p.as_dvec3()).as_vec3();
        (self.context).file_mesh(name, &choice, place, |bytes, at| {
            curves::read(bytes, plugin, radius, to_world, at)
        })
    }

    fn file(&mut self, shape: &Object, pose: &DAffine3, flipped: bool) -> Result<u32> {
        let place = &shape.place;
        let name = shape.text("filename")?;
        let name = name.ok_or_else(|| fault(place, "has no filename"))?;
        let flat = shape.flag("face_normals", false)?;
        let plugin = shape.plugin.clone();
        let index = shape.number("shape_index", 0.0)?.max(0.0) as usize;
        let upside = shape.flag("flip_tex_coords", plugin == "obj")?;
        // Mitsuba takes the front of a mesh without normals from its winding, which a mirroring pose reverses.
        let mirrored = pose.matrix3.determinant() < 0.0;
        let choice = format!("{plugin} {index} {upside} {flat} {flipped} {mirrored}");
        self.context.file_mesh(name, &choice, place, |bytes, at| {
            let mut mesh = match plugin.as_str() {
                "obj" => obj::read(bytes, at, upside)?.mesh,
                "ply" => ply::read(bytes, at)?,
                _ => serialized::read(bytes, at, index)?,
            };
            if plugin == "ply" && upside {
                mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
            }
            if flat {
                mesh.normals.clear();
            }
            if mesh.normals.is_empty() {
                if mirrored {
                    flip(&mut mesh);
                }
            } else {
                face_normals_outwards(&mut mesh);
            }
            if flipped {
                flip(&mut mesh);
            }
            Ok(mesh)
        })
    }

    /// Material and mesh of a shape, with its own emission, bump map, and tangents for a normal map.
    fn shape_material(&mut self, shape: &Object, mesh: u32, pose: &DAffine3) -> Result<(u32, u32)> {
        let bsdf = self.children(shape, &["bsdf"])?.into_iter().next();
        let emitters = self.children(shape, &["emitter", "luminaire"])?;
        let mut look = match &bsdf {
            Some((_, bsdf)) => self.look(bsdf)?,
            // Mitsuba's default: a reflectance of one half, and black for a lamp.
            None if emitters.is_empty() => ShapeMaterial::from(looks::diffuse(Paint::from(0.5))),
            None => ShapeMaterial::from(looks::diffuse(Paint::from(0.0))),
        };
        let mut key = bsdf
            .map_or(usize::from(emitters.is_empty()), |(_, bsdf)| {
                Rc::as_ptr(&bsdf).addr()
            })
            .to_string();
        for (_, emitter) in emitters {
            if emitter.plugin != "area" {
                let what = format!("emitter `{}` on a shape", emitter.plugin);
                self.context.left_out(&emitter.place, what)?;
                continue;
            }
            let names = ["radiance", "intensity"];
            let paint = self.paint_of(&emitter, &names, Paint::plain(Rgb::ONE), Role::Emitted)?;
            look.material.emission = paint.factor;
            look.material.emissive_texture = paint.map;
            key += &format!(" emits {}", Rc::as_ptr(&emitter).addr());
        }
        let sides = self.sides(shape)?;
        key += &format!(" between {sides:?}");
        (self.context).bound(&mut look.material, sides, &shape.place)?;
        self.lit_whole(&mut look.material, &shape.place);
        Ok(self.context.shape_material(look, key, mesh, pose))
    }

    /// Restores all light of a lamp with holes: in Mitsuba `null` and `mask` do not dim an emitter.
    fn lit_whole(&mut self, material: &mut Material, place: &str) {
        let holes = ![AlphaMode::Opaque, AlphaMode::Unseen].contains(&material.alpha_mode);
        if material.emission == Rgb::ZERO || !holes {
            return;
        }
        let map = (material.base_color_texture).map(|map| map.texture as usize);
        if map.is_some_and(|map| self.context.builder.parts.textures[map].channels == 4) {
            let what = "a lamp with a map of its opacity shines where it is opaque alone";
            self.context.approximate(place, what);
        } else if material.opacity > 1e-3 {
            material.emission /= material.opacity;
        } else {
            // A wall of index 1 transmits all light unchanged, but blocks shadow rays.
            *material = Material {
                emission: material.emission,
                emissive_texture: material.emissive_texture,
                ..looks::wall(1.0, Paint::from(1.0), Rgb::ONE)
            };
            let what = "a lamp without a surface casts shadows of lights without area";
            self.context.approximate(place, what);
        }
    }
}
