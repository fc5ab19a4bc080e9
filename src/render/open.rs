//! The scene of a render: its file and its surroundings.

use super::fault::Fault;
use super::spec::Spec;
use super::value::{Glass, Moment};
use crate::files::{Problem, hex};
use crate::math::{Ray, Vec3};
use crate::scene::light::sky::{Sky, studio};
use crate::scene::lighting::Lighting;
use crate::scene::load::{Animation, FileLight, Formats, LoadOptions, cameras_at, load};
use crate::scene::{Backdrop, Environment, Scene, SceneParts, TriangleId};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};

/// An opened scene.
pub struct Opened {
    /// The scene.
    pub scene: Scene,
    /// SHA-256 over the scene's own files and the environment's.
    pub sha256: String,
    /// Every file that was read.
    pub files: Vec<PathBuf>,
    /// Warnings of the loader and of the scene.
    pub warnings: Vec<String>,
    /// Animations of the file.
    pub animations: Vec<Animation>,
    /// Names of the variants of its materials.
    pub variants: Vec<String>,
    /// True if the built-in studio lights the scene, because nothing else does.
    pub in_studio: bool,
    /// Light of the file's own surfaces relative to the studio's, if it decided whether the studio lights the scene.
    pub lighting: Option<Lighting>,
}

impl Opened {
    /// Moves the cameras to the moment of a spec that differs from this scene's only in its moment. False if that is
    /// not enough, because the animations move other objects too.
    pub fn at(&mut self, spec: &Spec, path: &Path, formats: Formats) -> Result<bool, Fault> {
        if self.animations.is_empty() {
            return Ok(true);
        }
        let of_cameras = self.animations.iter().all(|animation| animation.of_cameras);
        let Some(moment) = spec.at.filter(|_| of_cameras) else {
            return Ok(false);
        };
        self.scene
            .set_cameras(cameras_at(path, moment.seconds(), formats.codecs)?);
        Ok(true)
    }

    /// Message on the light that was chosen, why, and options for another choice; empty if there was no choice.
    pub fn light_chosen(&self) -> String {
        let share = |light: &Lighting| 100.0 * light.share();
        match (&self.lighting, self.in_studio) {
            (None, true) => "lit by the built-in studio, since the file has no light".into(),
            (None, false) => String::new(),
            (Some(light), true) => format!(
                "lit by the built-in studio, beside which the file's own surfaces give {:.2} % of the light (--env none: they alone)",
                share(light)
            ),
            (Some(light), false) if light.enclosed => {
                "lit by its own lamps, in a closed room".into()
            }
            (Some(light), false) => format!(
                "lit by its own lamps, {:.2} % of the light that there would be in the built-in studio (--env studio: both)",
                share(light)
            ),
        }
    }
}

/// Number of warnings of one kind that are printed in full; the rest are counted.
const SHOWN: usize = 3;

/// Characters at the end of a warning that determine its kind; names come before them.
const KIND: usize = 32;

/// The warnings; of one kind, which differ only in names and numbers, the first few and a count of the rest.
fn gathered(warnings: Vec<String>) -> Vec<String> {
    let kind = |warning: &str| -> String {
        let back = warning.chars().rev().filter(|c| !c.is_ascii_digit());
        back.take(KIND).collect()
    };
    let mut kinds = BTreeMap::<String, usize>::new();
    for warning in &warnings {
        *kinds.entry(kind(warning)).or_default() += 1;
    }
    let mut seen = BTreeMap::<String, usize>::new();
    let mut out = Vec::new();
    for warning in warnings {
        let kind = kind(&warning);
        let all = kinds.get(&kind).copied().unwrap_or(1);
        let number = seen.entry(kind).or_default();
        *number += 1;
        match *number {
            n if n <= SHOWN || all == SHOWN + 1 => out.push(warning),
            n if n == SHOWN + 1 => out.push(format!("{} more warnings like the last", all - SHOWN)),
            _ => {}
        }
    }
    out
}

/// Ratio of the scene's own light to that of named surroundings above which the surroundings are too faint to show.
const FAINT: f64 = 200.0;

/// Most triangles of sharp metal and glass whose reflection is tested.
const ASKED: usize = 64;

/// True if a scene has only lights without area, and most of its sharp metal and glass reflects nothing.
fn reflects_nothing(scene: &Scene) -> bool {
    let (lights, geometry, parts) = (scene.lights(), scene.geometry(), scene.parts());
    if lights.is_empty() || lights.emissive_triangles() > 0 || parts.environment.is_some() {
        return false;
    }
    let sharp = |material: u32| {
        let material = &parts.materials[material as usize];
        material.alpha < 0.1 && material.metallic.max(material.transmission) > 0.5
    };
    let asked = geometry.some_of(ASKED, sharp);
    let (low, high) = geometry.bounds();
    let beyond = 2.0 * low.distance(high);
    let faces_nothing = |i: TriangleId| {
        let [a, b, c] = geometry.triangle(i);
        let (middle, out) = ((a + b + c) / 3.0, geometry.triangle_normal(i));
        // A scene built by `Scene::without_trees` has no tree, and rays hit nothing.
        let meets = |from: Vec3, dir: Vec3| scene.intersect(&Ray::new(from, dir)).is_some();
        !meets(middle + 1e-4 * beyond * out, out) && meets(middle + beyond * out, -out)
    };
    2 * asked.iter().filter(|i| faces_nothing(**i)).count() > asked.len()
}

/// Largest radiance of surroundings, so that single precision holds the light of surfaces.
const MAX_RADIANCE: f32 = 1e30;

impl Spec {
    /// Surroundings of the scene.
    pub(super) fn backdrop(&self) -> Backdrop {
        let mut sky = Sky::default();
        if let Some(sun) = self.sun {
            let [height, angle] = sun.position;
            (sky.elevation, sky.azimuth) = (height.to_radians(), angle.to_radians());
            sky.turbidity = sun.haze.unwrap_or(sky.turbidity);
        }
        Backdrop::named(self.env.as_deref(), sky)
    }

    /// Options of the loader that the file does not contain.
    pub fn load_options(&self, formats: Formats) -> LoadOptions {
        LoadOptions {
            distribution: self.distribution,
            unsupported: self.unsupported.unwrap_or_default(),
            solid_glass: self.glass.map(|glass| glass == Glass::Solid),
            time: self.at.map(Moment::seconds),
            variant: self.variant.as_ref().map(|variant| variant.0.clone()),
            formats,
        }
    }

    /// Surroundings by the options, for a scene that is `lit` or not; else those of the file, `own`. Passes bytes that
    /// identify them to `take`.
    pub fn surroundings(
        &self,
        own: Option<Environment>,
        lit: bool,
        take: impl FnMut(&[u8]),
    ) -> Result<Option<Environment>, Fault> {
        let rotation = self.env_rotation.unwrap_or(0.0).to_radians();
        let intensity = self.env_intensity.unwrap_or(1.0);
        let made = (self.backdrop()).environment(lit, intensity, rotation, take)?;
        let name = match self.env_intensity {
            Some(_) => "env_intensity",
            None => "env_rotation",
        };
        let all = made.or(own);
        if all.is_none() && self.has(name) {
            let why = "nothing surrounds the scene: {env} studio, sky or a map would";
            return Err(Fault::option(name, why));
        }
        let brightest = |map: &Environment| map.average().max_element() * map.peak();
        if self.env_intensity.is_some()
            && let Some(radiance) = all.as_ref().map(brightest)
            && (radiance.is_nan() || radiance > MAX_RADIANCE)
        {
            let why =
                format!("makes surroundings of radiance {radiance:e}, above {MAX_RADIANCE:e}");
            return Err(Fault::option("env_intensity", why));
        }
        Ok(all)
    }

    /// A warning if named surroundings are much fainter than the scene's own lamps.
    fn faint(&self, scene: &Scene, around: &Environment) -> Option<String> {
        self.env.as_ref()?;
        let lighting = scene.lighting(around);
        let ratio = lighting.own / lighting.around;
        (lighting.around > 0.0 && ratio > FAINT).then(|| {
            let alike = ratio * f64::from(self.env_intensity.unwrap_or(1.0));
            format!(
                "the surroundings are {ratio:.0} times fainter than the scene's own lamps: --env-intensity {alike:.0} makes both alike"
            )
        })
    }

    /// Opens the scene of a file: glTF, or one of the formats. `build` is [`Scene::new`], or [`Scene::without_trees`]
    /// for a description only.
    pub fn open(
        &self,
        path: &Path,
        formats: Formats,
        build: fn(SceneParts) -> Scene,
    ) -> Result<Opened, Fault> {
        self.check()?;
        expect_scene(path)?;
        let loaded = load(path, &self.load_options(formats))?;
        let (mut parts, mut warnings) = (loaded.parts, loaded.warnings);
        let mut digest = Sha256::new();
        digest.update(loaded.digest);
        let mut surround = |own, lit| self.surroundings(own, lit, |bytes| digest.update(bytes));
        let auto = self.backdrop() == Backdrop::Auto;
        let (mut in_studio, mut lighting) = (auto && loaded.light == FileLight::None, None);
        let unlit = loaded.light == FileLight::None || parts.environment.is_some();
        let mut lit = None;
        if auto && !unlit && loaded.light == FileLight::Surfaces {
            // The light of the file's own lamps is measured without surroundings.
            let scene = Scene::new(parts.clone());
            let measured = scene.lighting(&Environment::from_map(studio(), 0.0));
            in_studio = !measured.is_lit();
            lighting = Some(measured);
            lit = Some(scene).filter(|_| !in_studio);
        }
        let around = surround(parts.environment.take(), !in_studio)?;
        if in_studio || self.backdrop() == Backdrop::Studio {
            parts.lay_floor(loaded.rest.as_ref());
        }
        let scene = match (lit, around) {
            (Some(scene), _) => scene,
            (None, around) if unlit || in_studio => {
                parts.environment = around;
                build(parts)
            }
            (None, around) => {
                let scene = build(parts);
                match around {
                    Some(around) => {
                        warnings.extend(self.faint(&scene, &around));
                        scene.with_environment(around)
                    }
                    None => scene,
                }
            }
        };
        warnings.extend_from_slice(scene.warnings());
        if scene.geometry().triangle_count() == 0 {
            warnings.push("the scene has no surface: its light alone is seen".into());
        }
        if self.env.is_none() && reflects_nothing(&scene) {
            warnings.push(
                "suns and point lights alone, and nothing around: sharp metal and glass reflect black; --env studio, sky or a map \
                 surrounds the scene"
                    .into(),
            );
        }
        let mut files = loaded.files;
        files.extend(self.backdrop().file().cloned());
        Ok(Opened {
            scene,
            sha256: hex(&digest.finalize()),
            files,
            warnings: gathered(warnings),
            animations: loaded.animations,
            variants: loaded.variants,
            in_studio,
            lighting,
        })
    }
}

/// Endings of files of other programs, which no reader supports.
const OTHERS: [&str; 11] = [
    "3ds", "abc", "blend", "c4d", "dae", "fbx", "stl", "usd", "usda", "usdc", "usdz",
];

/// Rejects a folder, or a file of another program, with a hint at what to do.
///
/// Fails for these, and for a missing path. A file with an unknown ending may be a scene.
pub fn expect_scene(path: &Path) -> Result<(), Fault> {
    let wrong = |what: String| Err(Fault::Input(format!("{}: {what}", path.display())));
    let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
    let ending = ending.to_string_lossy();
    match std::fs::metadata(path) {
        // Such a file would not be read if it existed.
        Err(_) if OTHERS.contains(&&*ending) => {}
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let like = scenes_like(path);
            let beside = match like.as_slice() {
                [] => String::new(),
                some => format!("; beside it lie {}", some.join(", ")),
            };
            let error = io::Error::new(error.kind(), format!("{error}{beside}"));
            return Err(Fault::File(Problem::Read(error).at(path)));
        }
        Err(error) => return Err(Fault::File(Problem::Read(error).at(path))),
        Ok(found) if found.is_dir() => {
            let mut scenes = scenes_in(path);
            scenes.truncate(LISTED);
            let within = match scenes.as_slice() {
                [] => String::new(),
                some => format!("; it holds {}", some.join(", ")),
            };
            let what = format!("a folder; expected a scene, a file .glb or .gltf{within}");
            let error = io::Error::new(io::ErrorKind::IsADirectory, what);
            return Err(Fault::File(Problem::Read(error).at(path)));
        }
        Ok(_) => {}
    }
    match &*ending {
        "blend" => wrong(
            "a file of Blender: export it with File > Export > glTF 2.0, or render in Blender with the add-on of opsr \
             (docs/blender.md)"
                .into(),
        ),
        other if OTHERS.contains(&other) => wrong(format!(
            "files .{other} are not read: import it in Blender, export it with File > Export > glTF 2.0, and render the .glb"
        )),
        _ => Ok(()),
    }
}

/// Number of scenes that a message lists.
const LISTED: usize = 3;

/// Scenes beside a missing path, those first whose names begin alike.
fn scenes_like(path: &Path) -> Vec<String> {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
    let mut scenes = scenes_in(folder.unwrap_or(Path::new(".")));
    let alike = |name: &String| {
        let name = Path::new(name).file_name().unwrap_or_default();
        let wanted = path.file_name().unwrap_or_default();
        let pairs = name
            .as_encoded_bytes()
            .iter()
            .zip(wanted.as_encoded_bytes());
        pairs.take_while(|(a, b)| a.eq_ignore_ascii_case(b)).count()
    };
    scenes.sort_by_key(|name| std::cmp::Reverse(alike(name)));
    scenes.truncate(LISTED);
    scenes
}

/// Names of the scenes in a folder, sorted.
fn scenes_in(folder: &Path) -> Vec<String> {
    let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut names: Vec<String> = files
        .map(|file| file.path())
        .filter(|file| {
            let ending = file.extension().unwrap_or_default();
            ["glb", "gltf", "obj", "pbrt", "ply", "xml"]
                .iter()
                .any(|e| ending.eq_ignore_ascii_case(e))
        })
        .map(|file| file.display().to_string())
        .collect();
    names.sort();
    names
}

#[cfg(test)]
mod tests;
