//! Scenes of pbrt-v4 (`.pbrt`).

mod lights;
mod mappings;
mod materials;
mod media;
pub(super) mod names;
mod older;
mod shapes;
mod tokens;
mod values;

use super::media::Named;
use super::{Context, Member, ShapeMaterial, unpacked};
use crate::build::looks::Paint;
use glam::{DAffine3, DMat3, DMat4, DVec3, DVec4};
use mappings::Mapping;
use opsr::scene::load::error::{Result, fault};
use std::collections::HashMap;
use std::rc::Rc;
use tokens::{Parameters, Token, Tokens, Values};

/// Deepest nesting of attributes.
const MAX_DEPTH: usize = 1024;

/// Directives that declare something, unlike those of the graphics state and of transforms.
#[rustfmt::skip]
const DECLARATIONS: [&str; 17] = [
    "Shape", "Material", "MakeNamedMaterial", "NamedMaterial", "Texture", "LightSource", "AreaLightSource", "Camera", "Film", "Sampler",
    "Integrator", "PixelFilter", "Accelerator", "ColorSpace", "Option", "MediumInterface", "MakeNamedMedium",
];

/// Graphics state, which applies to later directives.
#[derive(Clone, Default)]
struct State {
    pose: DMat4,
    material: Option<Rc<Declared>>,
    /// Name of the current material if it is not declared yet, and the place of this reference.
    undeclared: Option<(String, String)>,
    /// Kind and parameters of the area light.
    area_light: Option<Rc<Parameters>>,
    reversed: bool,
    /// True from `ActiveTransform EndTime` to the next `ActiveTransform`.
    at_end: bool,
    /// Matrix from the file's colour space to linear Rec. 709.
    space: DMat3,
    /// Media inside and outside.
    sides: [Named; 2],
    /// Parameters of `Attribute` directives, with their targets.
    defaults: Vec<(String, Rc<Parameters>)>,
}

/// A declared material.
struct Declared {
    kind: String,
    parameters: Parameters,
}

/// A scene in progress.
struct Scene<'a> {
    context: &'a mut Context,
    state: State,
    stack: Vec<(State, char)>,
    coordinates: HashMap<String, DMat4>,
    materials: HashMap<String, Rc<Declared>>,
    /// Textures, each with the mapping of its second texture coordinates.
    textures: HashMap<String, (Paint, Option<Mapping>)>,
    spectrum_textures: HashMap<String, (Paint, Option<Mapping>)>,
    /// Mapping of the texture or material being read.
    mapping: Option<Mapping>,
    media: HashMap<String, Named>,
    /// Shapes of objects by name: mesh, material, pose.
    objects: HashMap<String, Rc<Vec<Member>>>,
    object: Option<(String, Vec<Member>)>,
    shape_materials: HashMap<usize, (ShapeMaterial, Option<Mapping>)>,
    /// Declarations and lights whose addresses are keys: they must stay alive.
    kept: Vec<Rc<Declared>>,
    lights_kept: Vec<Rc<Parameters>>,
    /// Shapes whose material is not declared yet, each with the object that it is in, and instances of incomplete
    /// objects. They wait for the end of the file, when `is_read` is true.
    deferred: Vec<(State, String, Parameters, Option<String>)>,
    is_read: bool,
    instances: Vec<(DMat4, String, String)>,
    /// Parameters of the film, and of the camera with its pose.
    film: Option<Parameters>,
    camera: Option<(String, Parameters, DMat4)>,
    in_world: bool,
    /// True for a file of version 3, recognised by its film.
    is_old: bool,
}

/// Reads a scene from the text of its file.
pub(super) fn read(context: &mut Context, text: Vec<u8>) -> Result<()> {
    let mut scene = Scene {
        context,
        state: State::default(),
        stack: Vec::new(),
        coordinates: HashMap::new(),
        materials: HashMap::new(),
        textures: HashMap::new(),
        spectrum_textures: HashMap::new(),
        mapping: None,
        media: HashMap::new(),
        objects: HashMap::new(),
        object: None,
        shape_materials: HashMap::new(),
        kept: Vec::new(),
        lights_kept: Vec::new(),
        deferred: Vec::new(),
        is_read: false,
        instances: Vec::new(),
        film: None,
        camera: None,
        in_world: false,
        is_old: false,
    };
    scene.file(&mut Tokens::new(text, ""), 0)?;
    scene.rest()?;
    scene.expose()?;
    scene.add_camera()
}

/// The matrix of numbers in pbrt's order, column by column.
fn matrix(n: [f64; 16]) -> DMat4 {
    DMat4::from_cols_array(&n)
}

impl Scene<'_> {
    /// Reads the shapes and instances that refer to later declarations.
    fn rest(&mut self) -> Result<()> {
        self.is_read = true;
        for (state, kind, parameters, object) in std::mem::take(&mut self.deferred) {
            if let Some((name, place)) = &state.undeclared {
                self.named_material(name, place)?;
            }
            self.state = state;
            self.object = object.map(|name| {
                let members = self.objects.remove(&name).unwrap_or_default();
                (name, Rc::unwrap_or_clone(members))
            });
            self.shape(&kind, &parameters)?;
            if let Some((name, members)) = self.object.take() {
                self.objects.insert(name, Rc::new(members));
            }
        }
        for (pose, name, place) in std::mem::take(&mut self.instances) {
            self.state.pose = pose;
            self.instance(&name, &place)?;
        }
        Ok(())
    }

    /// True if a mixture has a part that is not yet declared.
    fn awaits(&self, declared: &Declared, depth: usize) -> bool {
        let awaits = |name: &String| match self.materials.get(name) {
            Some(part) => self.awaits(part, depth + 1),
            None => true,
        };
        declared.kind == "mix"
            && depth < 8
            && materials::parts_of(&declared.parameters)
                .is_ok_and(|(all, _)| all.iter().any(awaits))
    }

    fn named_material(&self, name: &str, place: &str) -> Result<Rc<Declared>> {
        let known = self.materials.get(name).cloned();
        known.ok_or_else(|| fault(place, format!("no material `{name}`")))
    }

    fn file(&mut self, tokens: &mut Tokens, depth: usize) -> Result<()> {
        loop {
            tokens.peek()?;
            let place = tokens.place();
            match tokens.next()? {
                None => return Ok(()),
                Some(Token::Word(word)) => self.directive(&word, tokens, place, depth)?,
                Some(_) => return Err(fault(place, "a directive should stand here")),
            }
        }
    }

    fn directive(
        &mut self,
        word: &str,
        tokens: &mut Tokens,
        place: String,
        depth: usize,
    ) -> Result<()> {
        match word {
            "Include" | "Import" => {
                let name = tokens.quoted()?;
                self.context.include(depth, &place)?;
                let (_, bytes) = self.context.files.open(&name, &place)?;
                let text = unpacked(&bytes, &place)?;
                self.file(&mut Tokens::new(text, &name), depth + 1)
            }
            "AttributeBegin" | "TransformBegin" => {
                self.push(if word == "AttributeBegin" { 'a' } else { 't' }, &place)
            }
            "AttributeEnd" | "TransformEnd" => {
                self.pop(if word == "AttributeEnd" { 'a' } else { 't' }, &place)
            }
            "ObjectBegin" => {
                let name = tokens.quoted()?;
                if self.object.is_some() {
                    return Err(fault(place, "an object in an object"));
                }
                self.push('o', &place)?;
                self.object = Some((name, Vec::new()));
                Ok(())
            }
            "ObjectEnd" => {
                let (name, members) = self
                    .object
                    .take()
                    .ok_or_else(|| fault(&place, "no object has begun"))?;
                self.objects.insert(name, Rc::new(members));
                self.pop('o', &place)
            }
            "ObjectInstance" => {
                let name = tokens.quoted()?;
                let is_whole = self.deferred.is_empty() && self.objects.contains_key(&name);
                if self.object.is_none() && !is_whole {
                    self.instances.push((self.state.pose, name, place));
                    return Ok(());
                }
                self.instance(&name, &place)
            }
            "WorldBegin" => {
                self.in_world = true;
                self.state.at_end = false;
                self.state.pose = DMat4::IDENTITY;
                self.coordinates.insert("world".into(), DMat4::IDENTITY);
                Ok(())
            }
            "WorldEnd" => Ok(()),
            "ReverseOrientation" => {
                self.state.reversed = !self.state.reversed;
                Ok(())
            }
            "Attribute" => {
                let target = tokens.quoted()?;
                let parameters = Parameters::read(tokens, place)?;
                self.state.defaults.push((target, Rc::new(parameters)));
                Ok(())
            }
            "Identity" | "Translate" | "Scale" | "Rotate" | "LookAt" | "Transform"
            | "ConcatTransform" | "CoordinateSystem" | "CoordSysTransform" | "ActiveTransform"
            | "TransformTimes" => self.transform(word, tokens, &place),
            _ => self.declaration(word, tokens, place),
        }
    }

    fn push(&mut self, kind: char, place: &str) -> Result<()> {
        if self.stack.len() >= MAX_DEPTH {
            return Err(fault(place, "attributes are nested too deep"));
        }
        self.stack.push((self.state.clone(), kind));
        Ok(())
    }

    fn pop(&mut self, kind: char, place: &str) -> Result<()> {
        match self.stack.pop() {
            Some((state, begun)) if begun == kind => {
                match kind {
                    't' => (self.state.pose, self.state.at_end) = (state.pose, state.at_end),
                    _ => self.state = state,
                }
                Ok(())
            }
            _ => Err(fault(place, "an end without its begin")),
        }
    }

    fn transform(&mut self, word: &str, tokens: &mut Tokens, place: &str) -> Result<()> {
        let before = self.state.pose;
        let pose = &mut self.state.pose;
        match word {
            "Identity" => *pose = DMat4::IDENTITY,
            "Translate" => *pose *= DMat4::from_translation(DVec3::from(tokens.numbers::<3>()?)),
            "Scale" => *pose *= DMat4::from_scale(DVec3::from(tokens.numbers::<3>()?)),
            "Rotate" => {
                let [angle, x, y, z] = tokens.numbers()?;
                let axis = DVec3::new(x, y, z).try_normalize();
                let axis = axis.ok_or_else(|| fault(place, "the axis has no direction"))?;
                *pose *= DMat4::from_axis_angle(axis, angle.to_radians());
            }
            "LookAt" => {
                let n: [f64; 9] = tokens.numbers()?;
                let at = |i: usize| DVec3::new(n[i], n[i + 1], n[i + 2]);
                let camera =
                    look_at(at(0), at(3), at(6)).ok_or_else(|| fault(place, "looks nowhere"))?;
                *pose *= camera.inverse();
            }
            "Transform" => *pose = matrix(tokens.numbers()?),
            "ConcatTransform" => *pose *= matrix(tokens.numbers()?),
            "CoordinateSystem" => {
                let name = tokens.quoted()?;
                self.coordinates.insert(name, *pose);
            }
            "CoordSysTransform" => {
                let name = tokens.quoted()?;
                match self.coordinates.get(&name) {
                    Some(known) => *pose = *known,
                    None => return Err(fault(place, format!("no coordinate system `{name}`"))),
                }
            }
            "ActiveTransform" => {
                let ends = tokens.next()? == Some(Token::Word("EndTime".into()));
                self.state.at_end = ends;
                if ends {
                    let what = "motion blur (`ActiveTransform`)";
                    self.context.nearest(place, what, "its first moment")?;
                }
            }
            _ => {
                tokens.numbers::<2>()?;
            }
        }
        // Transforms for the end of a movement are ignored: a movement is shown at its beginning.
        if self.state.at_end {
            self.state.pose = before;
        }
        match self.state.pose.is_finite() {
            true => Ok(()),
            false => Err(fault(place, "the transform is not finite")),
        }
    }

    fn declaration(&mut self, word: &str, tokens: &mut Tokens, place: String) -> Result<()> {
        if !DECLARATIONS.contains(&word) {
            return Err(fault(place, format!("`{word}` is no directive of pbrt-v4")));
        }
        if word == "Option" {
            return self.option(tokens, &place);
        }
        let name = tokens.quoted()?;
        match word {
            "NamedMaterial" => {
                self.state.material = self.materials.get(&name).cloned();
                let is_known = self.state.material.is_some();
                self.state.undeclared = (!is_known).then_some((name, place));
                return Ok(());
            }
            "Texture" => {
                let (kind, class) = (tokens.quoted()?, tokens.quoted()?);
                let parameters = Parameters::read(tokens, place)?;
                self.check_names(("Texture", &class), &parameters)?;
                let parameters = self.with_defaults("texture", parameters);
                return self.texture(name, &kind, &class, &parameters);
            }
            "MediumInterface" => {
                // One name for both sides, or two.
                let outside = match tokens.peek()? {
                    Some(Token::Quoted(_)) => tokens.quoted()?,
                    _ => name.clone(),
                };
                let inside = self.named_medium(&name, &place)?;
                self.state.sides = [inside, self.named_medium(&outside, &place)?];
                return Ok(());
            }
            _ => {}
        }
        let parameters = Parameters::read(tokens, place.clone())?;
        self.declare(word, name, parameters, &place)
    }

    /// Reads an `Option`: names, each with a value. As in pbrt, case, `-`, `_` and a type before a name are ignored.
    fn option(&mut self, tokens: &mut Tokens, place: &str) -> Result<()> {
        while let Some(Token::Quoted(_)) = tokens.peek()? {
            let name = tokens.quoted()?.to_lowercase().replace(['-', '_'], "");
            let name = name.split_whitespace().last().unwrap_or_default();
            let value = tokens::values(tokens, place)?;
            if value == Values::Numbers(Vec::new()) {
                return Err(fault(place, format!("`{name}` has no value")));
            }
            (self.context).check_names(names::NAMES, ("Option", "Option"), [(name, place)])?;
            if name == "forcediffuse" && value != Values::Flags(vec![false]) {
                let what = "`forcediffuse` is not taken: materials are shown";
                self.context.approximate(place, what);
            }
        }
        Ok(())
    }

    /// Checks the names of an element's own parameters; those of `Attribute` may belong to other kinds.
    fn check_names(&mut self, element: (&str, &str), parameters: &Parameters) -> Result<()> {
        (self.context).check_names(names::NAMES, element, parameters.names())
    }

    fn color_space(&mut self, name: &str, place: &str) -> Result<()> {
        match values::space(name) {
            Some(space) => self.state.space = space,
            None => {
                let what = format!("colour space `{name}`");
                self.context.nearest(place, what, "`srgb`")?;
            }
        }
        Ok(())
    }

    /// Stores or applies a declaration.
    fn declare(
        &mut self,
        word: &str,
        name: String,
        parameters: Parameters,
        place: &str,
    ) -> Result<()> {
        let (element, kind) = match word {
            "MakeNamedMaterial" => ("Material", parameters.text("type")?.unwrap_or_default()),
            "MakeNamedMedium" => (word, parameters.text("type")?.unwrap_or_default()),
            _ => (word, name.as_str()),
        };
        self.check_names((element, kind), &parameters)?;
        match word {
            "Shape" => {
                let parameters = self.with_defaults("shape", parameters);
                self.shape(&name, &parameters)
            }
            "Material" => {
                let parameters = self.with_defaults("material", parameters);
                let declared = Declared {
                    kind: name,
                    parameters,
                };
                self.state.undeclared = None;
                self.state.material = Some(Rc::new(declared));
                Ok(())
            }
            "MakeNamedMaterial" => {
                let parameters = self.with_defaults("material", parameters);
                let kind = parameters.text("type")?.unwrap_or_default().to_owned();
                let declared = Rc::new(Declared { kind, parameters });
                self.materials.insert(name, declared);
                Ok(())
            }
            "LightSource" => {
                let parameters = self.with_defaults("light", parameters);
                self.light(&name, &parameters)
            }
            "AreaLightSource" => {
                if !["diffuse", "area"].contains(&name.as_str()) {
                    return self.context.left_out(place, format!("area light `{name}`"));
                }
                let parameters = self.with_defaults("light", parameters);
                self.state.area_light = Some(Rc::new(parameters));
                Ok(())
            }
            "Camera" => {
                // The current transform is that from the world to the camera.
                self.coordinates
                    .insert("camera".into(), self.state.pose.inverse());
                let [_, around] = self.state.sides;
                self.context.camera_in(around, place);
                self.camera = Some((name, parameters, self.state.pose.inverse()));
                Ok(())
            }
            "Film" => {
                self.is_old = name == "image";
                self.film = Some(parameters);
                Ok(())
            }
            "ColorSpace" => self.color_space(&name, place),
            "MakeNamedMedium" => {
                let parameters = self.with_defaults("medium", parameters);
                self.medium(name, &parameters)
            }
            "Integrator" => {
                if parameters.get("maxdepth").is_some() {
                    let depth = parameters.number("maxdepth", 5.0)?;
                    self.context.warn_of_limit("maxdepth", depth, depth, place);
                }
                Ok(())
            }
            // Samplers, filters and accelerators do not apply here.
            _ => Ok(()),
        }
    }

    /// Parameters, completed by those that `Attribute` set for this target.
    fn with_defaults(&self, target: &str, mut parameters: Parameters) -> Parameters {
        for (kind, defaults) in self.state.defaults.iter().rev() {
            if kind == target {
                let missing = defaults
                    .list
                    .iter()
                    .filter(|p| parameters.get(&p.name).is_none());
                let missing: Vec<_> = missing.cloned().collect();
                parameters.list.extend(missing);
            }
        }
        parameters
    }

    /// The current pose; fails if it has a projective part.
    fn pose(&self, place: &str) -> Result<DAffine3> {
        affine(&self.state.pose, place)
    }

    /// The kind and the first text of a parameter, if it has one.
    fn named<'p>(parameters: &'p Parameters, name: &str) -> Option<(&'p str, &'p str)> {
        let parameter = parameters.get(name)?;
        match &parameter.values {
            Values::Texts(all) => Some((&parameter.kind, all.first()?)),
            _ => None,
        }
    }
}

fn affine(matrix: &DMat4, place: &str) -> Result<DAffine3> {
    let below = matrix.row(3);
    let straight = (below - DVec4::W).abs().max_element() < 1e-6;
    let pose = DAffine3::from_mat4(*matrix);
    match straight && pose.is_finite() && pose.translation.as_vec3().is_finite() {
        true => Ok(pose),
        false => Err(fault(place, "its transform is not finite or not affine")),
    }
}

/// The pose of pbrt's camera at `eye`: +x to the right, +y up, looking along +z.
fn look_at(eye: DVec3, target: DVec3, up: DVec3) -> Option<DMat4> {
    let dir = (target - eye).try_normalize()?;
    let right = up.try_normalize()?.cross(dir).try_normalize()?;
    let up = dir.cross(right);
    let column = |v: DVec3| v.extend(0.0);
    Some(DMat4::from_cols(
        column(right),
        column(up),
        column(dir),
        eye.extend(1.0),
    ))
}
