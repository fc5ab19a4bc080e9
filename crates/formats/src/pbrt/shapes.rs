//! Shapes of pbrt.

use super::super::images::Use;
use super::super::{Role, ShapeMaterial, curves, ply};
use super::tokens::Parameters;
use super::{Declared, Scene, lights};
use crate::build::looks::{self, Paint};
use crate::build::{Placed, face_normals_outwards, flip, shapes, subdivision};
use glam::{DAffine3, DVec3};
use opsr::math::{Rgb, Vec2, Vec3, Vec4, luminance};
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{AlphaMode, Mesh, Wrap};
use std::f64::consts::PI;
use std::rc::Rc;

impl Scene<'_> {
    pub(super) fn shape(&mut self, kind: &str, parameters: &Parameters) -> Result<()> {
        let place = &parameters.place;
        if let Some((name, at)) = &self.state.undeclared
            && let Ok(known) = self.named_material(name, at)
        {
            (self.state.material, self.state.undeclared) = (Some(known), None);
        }
        let awaits = self.state.undeclared.is_some()
            || (self.state.material.as_ref()).is_some_and(|declared| self.awaits(declared, 0));
        if awaits && !self.is_read {
            let object = self.object.as_ref().map(|(name, _)| name.clone());
            let (state, parameters) = (self.state.clone(), parameters.clone());
            (self.deferred).push((state, kind.to_owned(), parameters, object));
            return Ok(());
        }
        let pose = self.pose(place)?;
        let reversed = self.state.reversed;
        let Some(mesh) = self.mesh(kind, parameters, reversed)? else {
            return Ok(());
        };
        let (material, mesh) = self.dress(kind, parameters, mesh, &pose)?;
        match &mut self.object {
            Some((_, members)) => {
                if members.len() >= 1 << 20 {
                    return Err(fault(place, "an object of too many shapes"));
                }
                members.push((mesh, material, pose));
                Ok(())
            }
            None => self.place(mesh, material, pose, place),
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

    pub(super) fn instance(&mut self, name: &str, place: &str) -> Result<()> {
        let known = self.objects.get(name).cloned();
        let members = known.ok_or_else(|| fault(place, format!("no object `{name}`")))?;
        if self.object.is_some() {
            return Err(fault(place, "an instance in an object"));
        }
        let pose = self.pose(place)?;
        for &(mesh, material, own) in members.iter() {
            self.place(mesh, material, pose * own, place)?;
        }
        Ok(())
    }

    fn ply_mesh(&mut self, parameters: &Parameters, reversed: bool) -> Result<u32> {
        let place = &parameters.place;
        let name = parameters.text("filename")?;
        let name = name
            .ok_or_else(|| fault(place, "has no filename"))?
            .to_owned();
        if parameters.get("displacement").is_some() {
            self.context
                .nearest(place, "displacement of a mesh", "the mesh without it")?;
        }
        let choice = format!("ply {reversed}");
        self.context.file_mesh(&name, &choice, place, |bytes, at| {
            let mut mesh = ply::read(bytes, at)?;
            mesh.colors.clear();
            turned(&mut mesh, reversed);
            Ok(mesh)
        })
    }

    fn mesh(&mut self, kind: &str, parameters: &Parameters, reversed: bool) -> Result<Option<u32>> {
        let place = &parameters.place;
        if kind == "plymesh" {
            return self.ply_mesh(parameters, reversed).map(Some);
        }
        let of = |name: &str, or: f64| parameters.number(name, or).map(|x| x as f32);
        let turn = of("phimax", 360.0)?.clamp(0.1, 360.0).to_radians();
        let radius = of("radius", 1.0)?;
        let mut mesh = match kind {
            "sphere" => {
                let [low, high] = [("zmin", -radius), ("zmax", radius)];
                let ends = [of(low.0, low.1.into())?, of(high.0, high.1.into())?];
                sphere(radius, ends, turn)
                    .ok_or_else(|| fault(place, "a sphere without a surface"))?
            }
            "disk" => {
                let inner = of("innerradius", 0.0)?;
                let mut mesh = shapes::disk(of("height", 0.0)?, radius, inner, turn);
                let span = 1.0 - inner / radius;
                let swapped = |uv: &mut Vec2| *uv = Vec2::new(uv.y, (1.0 - uv.x) / span);
                mesh.uvs.iter_mut().for_each(swapped);
                mesh
            }
            "cylinder" => shapes::cylinder(radius, [of("zmin", -1.0)?, of("zmax", 1.0)?], turn),
            "cone" => {
                let height = of("height", 1.0)?;
                shapes::revolved(|v| Vec3::new(radius * (1.0 - v), 0.0, v * height), turn)
            }
            "paraboloid" => {
                let (low, high) = (of("zmin", 0.0)?.max(0.0), of("zmax", 1.0)?);
                let at = |z: f32| Vec3::new(radius * (z / high).max(0.0).sqrt(), 0.0, z);
                shapes::revolved(|v| at(low + v * (high - low)), turn)
            }
            "hyperboloid" => {
                let point = |name: &str, or: f64| parameters.vector(name, [or; 3]);
                let (from, to) = (
                    DVec3::from(point("p1", 0.0)?),
                    DVec3::from(point("p2", 1.0)?),
                );
                let (from, to) = (from.as_vec3(), to.as_vec3());
                shapes::revolved(|v| from.lerp(to, v), turn)
            }
            "curve" => {
                self.context
                    .approximate(place, "`curve` is shown as a tube");
                shapes::tube(&curve(parameters)?)
            }
            "trianglemesh" => triangles(parameters)?,
            "heightfield" => heightfield(parameters)?,
            "bilinearmesh" => patches(parameters)?,
            "loopsubdiv" => self.subdivided(parameters)?,
            other => {
                self.context.left_out(place, format!("shape `{other}`"))?;
                return Ok(None);
            }
        };
        if mesh.positions.iter().any(|p| !p.is_finite()) {
            return Err(fault(place, "a point that is not finite"));
        }
        if kind == "bilinearmesh"
            || kind == "trianglemesh"
            || kind == "heightfield"
            || kind == "loopsubdiv"
        {
            turned(&mut mesh, reversed);
        } else if reversed {
            flip(&mut mesh);
        }
        Ok(Some(self.context.builder.mesh(mesh)))
    }

    /// The limit surface of a control mesh by Loop's subdivision.
    fn subdivided(&mut self, parameters: &Parameters) -> Result<Mesh> {
        let place = &parameters.place;
        // The second name is that of version 3.
        let levels = parameters.number("levels", parameters.number("nlevels", 3.0)?)?;
        let mut control = triangles(parameters)?;
        let faces = control.indices.len() as f64 * 4f64.powf(levels);
        if !(levels >= 0.0 && levels.fract() == 0.0 && faces <= f64::from(1 << 24)) {
            return Err(fault(place, format!("a subdivision of {levels} levels")));
        }
        // Memory for edges with third corners, points, and rings of neighbours.
        let what = format!("a subdivision into {faces} triangles");
        opsr::memory::check(what, 300 * faces as u64)?;
        let finite = control.positions.iter().all(|p| p.is_finite());
        if finite && let Some(mesh) = subdivision::subdivided(&control, levels as u32) {
            return Ok(mesh);
        }
        let what = "subdivision of what is no surface of one winding";
        self.context.nearest(place, what, "its control mesh")?;
        control.normals.clear();
        Ok(control)
    }

    /// Material and mesh of a shape.
    fn dress(
        &mut self,
        kind: &str,
        parameters: &Parameters,
        mut mesh: u32,
        pose: &DAffine3,
    ) -> Result<(u32, u32)> {
        let declared = self.state.material.clone();
        self.mapping = None;
        let mut look = match &declared {
            Some(declared) => self.look(declared, 0)?,
            None => ShapeMaterial::from(looks::diffuse(Paint::from(0.5))),
        };
        let mut key = (declared.as_ref())
            .map_or(0, |d| Rc::<Declared>::as_ptr(d).addr())
            .to_string();
        let is_interface = (declared.as_ref())
            .is_some_and(|d| ["interface", "none", ""].contains(&d.kind.as_str()));
        let light = self.state.area_light.clone();
        if let Some(light) = light.as_ref().filter(|_| is_interface) {
            let what =
                "an area light on a shape without a material (`interface`) is ignored, as in pbrt";
            self.context.approximate(&light.place, what);
        }
        let light = light.filter(|_| !is_interface);
        let shines = light.is_some();
        if let Some(light) = light {
            self.emission(kind, &light, mesh, pose, &mut look)?;
            key += &format!(
                " emits {} {:?}",
                Rc::as_ptr(&light).addr(),
                look.material.emission
            );
            self.lights_kept.push(light);
        }
        if parameters.get("alpha").is_some() {
            let opacity = self.paint(parameters, "alpha", Paint::from(1.0))?;
            key += &format!(" alpha {opacity:?}");
            if shines && opacity == Paint::from(0.0) {
                (look.material.alpha_mode, look.material.opacity) = (AlphaMode::Unseen, 0.0);
            } else if opacity != Paint::from(1.0) && !self.context.materials.contains_key(&key) {
                let done = (self.context.builder).set_opacity(&mut look.material, opacity);
                if let Err(what) = done {
                    self.context.nearest(&parameters.place, what, "opaque")?;
                    look.material.alpha_mode = AlphaMode::Opaque;
                }
            }
        }
        if let Some(mapping) = self.mapping.take() {
            look.material.finish_mut().has_second_uvs = true;
            mesh = self.mapped(mesh, mapping, pose, &parameters.place)?;
        }
        let sides = self.state.sides;
        key += &format!(" between {sides:?}");
        (self.context).bound(&mut look.material, sides, &parameters.place)?;
        Ok(self.context.shape_material(look, key, mesh, pose))
    }

    fn emission(
        &mut self,
        kind: &str,
        light: &Parameters,
        mesh: u32,
        pose: &DAffine3,
        look: &mut ShapeMaterial,
    ) -> Result<()> {
        let place = &light.place;
        let mut radiance = self.colour(light, "L", Rgb::ONE, Role::Emitted)? * self.tint(light)?;
        let mut scale = lights::plain_scale(light)?;
        let mut mean = 1.0;
        if let Some(name) = light.text("filename")? {
            if light.get("L").is_some() {
                return Err(fault(place, "has both `L` and an image"));
            }
            let name = name.to_owned();
            let how = Use::upright(None, Wrap::Clamp);
            let paint = self.context.texture(&name, how, place)?;
            radiance *= paint.factor;
            look.material.emissive_texture = paint.map;
            mean = f64::from(luminance(self.context.builder.mean(paint)));
        }
        let both = light.flag("twosided", false)?;
        if light.number("power", -1.0)? > 0.0 {
            let round = ["sphere", "disk", "cylinder"].contains(&kind);
            if !round {
                self.context
                    .approximate(place, "the power of a mesh is that of all its triangles");
            }
            let scene_mesh = self.context.builder.mesh_mut(mesh).at(pose);
            let sides = if both { 2.0 } else { 1.0 };
            let own = PI * area(&scene_mesh) * sides * mean;
            scale *= lights::wanted(light, "power", own)?;
        }
        radiance *= scale as f32;
        if !radiance.is_finite() {
            return Err(fault(place, "a light that is not finite"));
        }
        look.material.emission = radiance;
        look.material.double_sided = both;
        Ok(())
    }
}

/// The zone of a sphere between two heights; `None` if it is empty.
fn sphere(radius: f32, [low, high]: [f32; 2], turn: f32) -> Option<Mesh> {
    let angle = |z: f32| (z / radius).clamp(-1.0, 1.0).acos();
    let span = [angle(low.max(high)), angle(low.min(high))];
    if span[1] - span[0] < 1e-4 {
        return None;
    }
    let mut mesh = shapes::part_of_sphere(Vec3::ZERO, radius, span, turn);
    // pbrt's v is 0 at the lower end.
    mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    Some(mesh)
}

fn area(mesh: &Mesh) -> f64 {
    let of = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|i| mesh.positions[i as usize].as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    };
    mesh.indices.iter().map(of).sum()
}

/// Orients a mesh as pbrt does: by its normals, or else by its winding.
fn turned(mesh: &mut Mesh, reversed: bool) {
    face_normals_outwards(mesh);
    if reversed {
        flip(mesh);
    }
}

/// Vectors of a parameter; fails unless the numbers come in threes.
fn vectors(parameters: &Parameters, name: &str) -> Result<Vec<Vec3>> {
    let numbers = parameters.numbers(name)?.unwrap_or_default();
    if numbers.len() % 3 != 0 {
        return Err(fault(
            &parameters.place,
            format!("`{name}` is not of three numbers each"),
        ));
    }
    let vector = |n: &[f64]| Vec3::new(n[0] as f32, n[1] as f32, n[2] as f32);
    Ok(numbers.chunks_exact(3).map(vector).collect())
}

fn coordinates(parameters: &Parameters) -> Result<Vec<Vec2>> {
    let uv = parameters.numbers("uv")?.or(parameters.numbers("st")?);
    let all = uv.unwrap_or_default().chunks_exact(2);
    Ok(all.map(|n| Vec2::new(n[0] as f32, n[1] as f32)).collect())
}

/// Indices in groups of `N`, each below `count`. Without indices, `N` points are one group.
fn indices<const N: usize>(parameters: &Parameters, count: usize) -> Result<Vec<[u32; N]>> {
    let place = &parameters.place;
    let Some(numbers) = parameters.numbers("indices")? else {
        return match count == N {
            true => Ok(vec![std::array::from_fn(|i| i as u32)]),
            false => Err(fault(place, "has no indices")),
        };
    };
    if numbers.len() % N != 0 {
        return Err(fault(place, format!("indices are not in groups of {N}")));
    }
    if numbers.iter().any(|&i| i < 0.0 || i >= count as f64) {
        return Err(fault(
            place,
            format!("an index is not below the {count} points"),
        ));
    }
    let group = |n: &[f64]| std::array::from_fn(|k| n[k] as u32);
    Ok(numbers.chunks_exact(N).map(group).collect())
}

fn triangles(parameters: &Parameters) -> Result<Mesh> {
    let positions = vectors(parameters, "P")?;
    let count = positions.len();
    let fitting = |n: usize, what: &str| match n == 0 || n == count {
        true => Ok(()),
        false => Err(fault(
            &parameters.place,
            format!("{n} {what} for {count} points"),
        )),
    };
    let normals: Vec<Vec3> = (vectors(parameters, "N")?.into_iter())
        .map(Vec3::normalize_or_zero)
        .collect();
    let uvs = coordinates(parameters)?;
    fitting(normals.len(), "normals")?;
    fitting(uvs.len(), "coordinates")?;
    Ok(Mesh {
        indices: indices::<3>(parameters, count)?,
        positions,
        normals,
        uvs,
        ..Mesh::default()
    })
}

/// Points of a curve, each with half of the width there.
fn curve(parameters: &Parameters) -> Result<Vec<(Vec3, f32)>> {
    let place = &parameters.place;
    let points = vectors(parameters, "P")?;
    let degree = match parameters.number("degree", 3.0)? {
        2.0 => 2,
        3.0 => 3,
        other => return Err(fault(place, format!("a curve of degree {other}"))),
    };
    let basis = parameters.text("basis")?.unwrap_or("bezier");
    if !["bezier", "bspline"].contains(&basis) {
        return Err(fault(place, format!("a curve of basis `{basis}`")));
    }
    let width = parameters.number("width", 1.0)?;
    let from = parameters.number("width0", width)? as f32;
    let to = parameters.number("width1", width)? as f32;
    let control: Vec<Vec4> = points.iter().map(|p| p.extend(0.0)).collect();
    let places = curves::spline(&control, basis, degree).ok_or_else(|| {
        let what = format!("{} points of a curve of degree {degree}", points.len());
        fault(place, what)
    })?;
    let half = |share: f32| 0.5 * (from + (to - from) * share);
    Ok((places.iter().map(|(p, share)| (p.truncate(), half(*share)))).collect())
}

/// A height field of version 3: heights over [0, 1]², row by row along y.
fn heightfield(parameters: &Parameters) -> Result<Mesh> {
    let place = &parameters.place;
    let heights = parameters.numbers("Pz")?.unwrap_or_default();
    let side = |name: &str| parameters.number(name, 0.0).map(|n| n as usize);
    let (columns, rows) = (side("nu")?, side("nv")?);
    if columns < 2 || rows < 2 || columns.checked_mul(rows) != Some(heights.len()) {
        let what = format!("{} heights for {columns} times {rows}", heights.len());
        return Err(fault(place, what));
    }
    let mut mesh = shapes::grid(columns as u32 - 1, rows as u32 - 1, |uv| {
        let at = uv * Vec2::new(columns as f32 - 1.0, rows as f32 - 1.0);
        let (x, y) = (at.x.round() as usize, at.y.round() as usize);
        (uv.extend(heights[y * columns + x] as f32), Vec3::Z)
    });
    mesh.normals.clear();
    Ok(mesh)
}

fn patches(parameters: &Parameters) -> Result<Mesh> {
    let positions = vectors(parameters, "P")?;
    let uvs = coordinates(parameters)?;
    let normals = vectors(parameters, "N")?;
    if !normals.is_empty() && normals.len() != positions.len() {
        let what = format!("{} normals for {} points", normals.len(), positions.len());
        return Err(fault(&parameters.place, what));
    }
    let unit = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
    let mut mesh = Mesh::default();
    for patch in indices::<4>(parameters, positions.len())? {
        let corners = patch.map(|i| positions[i as usize]);
        let own = patch.map(|i| uvs.get(i as usize).copied());
        let uv = std::array::from_fn(|k| own[k].unwrap_or(unit[k]));
        let normals = (!normals.is_empty()).then(|| patch.map(|i| normals[i as usize]));
        shapes::append(&mut mesh, &shapes::patch(corners, uv, normals));
        if mesh.indices.len() > 1 << 26 {
            return Err(fault(&parameters.place, "too many patches"));
        }
    }
    Ok(mesh)
}
