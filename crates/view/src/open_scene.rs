//! An open scene, and queries from a camera: values under the pointer, first surfaces, paths.

use super::options::Options;
use glam::DAffine3;
use opsr::image::Buffer;
use opsr::image::film::Window;
use opsr::integrator::trace::{TracedPath, trace};
use opsr::integrator::{Amounts, Estimator, Picture, Recorded, Settings, View};
use opsr::math::{UVec2, Vec2, Vec3, luminance};
use opsr::render::Fault;
use opsr::render::open::Opened;
use opsr::scene::{Camera, Hit, Mesh, Scene, Sensor, SharedMesh};
use opsr_formats::FORMATS;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex, PoisonError};

/// Samples whose paths are traced, and number of paths that are shown.
const TRACED: u32 = 256;
const SHOWN: usize = 24;

/// An open scene.
pub(super) struct OpenScene {
    pub(super) opened: Opened,
    /// Options that it was opened with.
    pub(super) key: String,
}

impl OpenScene {
    /// Opens the scene of the options.
    pub(super) fn of(options: &Options) -> Result<Self, Fault> {
        let file = &options.file;
        let opened = (options.spec.open(&file.path, FORMATS, Scene::new))
            .map_err(|fault| file.redacted(fault))?;
        if opened.scene.lights().is_empty() {
            let what = "nothing lights the scene: {env} studio, {env} sky or a map would";
            return Err(Fault::Input(format!("{}: {what}", file.name)));
        }
        Ok(Self {
            opened,
            key: options.scene_key(),
        })
    }

    /// Length of the longest animation in seconds; 0 without animations.
    pub(super) fn seconds(&self) -> f64 {
        (self.opened.animations.iter()).fold(0.0, |last, animation| last.max(animation.seconds))
    }
}

#[cfg(test)]
impl OpenScene {
    /// A pool in the sun.
    pub(super) fn sun_pool() -> Self {
        let parts = opsr_lab::gallery::builtin("sun-pool").expect("a scene");
        Self {
            opened: Opened {
                scene: opsr::scene::Scene::new(parts),
                sha256: String::new(),
                files: Vec::new(),
                warnings: Vec::new(),
                animations: Vec::new(),
                variants: Vec::new(),
                in_studio: false,
                lighting: None,
            },
            key: String::new(),
        }
    }
}

/// Albedo, normal and depth of the first surfaces.
pub(super) type First = Arc<[Buffer; 3]>;

/// Settings of the path tracer of one level, by the rule of a render.
pub(super) fn path_settings(render: &Settings) -> Settings {
    Settings {
        estimator: Estimator::Path { reuse: false },
        amounts: Amounts::Raw,
        strategy: None,
        ..render.clone()
    }
}

/// A scene, a camera, and the settings of the path tracer there.
pub(super) struct Viewpoint {
    pub(super) open_scene: Arc<OpenScene>,
    pub(super) camera: Camera,
    /// Size of the whole picture.
    pub(super) frame: UVec2,
    /// Settings of the path tracer of one level, by the rule of the render.
    pub(super) settings: Settings,
    /// Cache of the first surfaces, at the last requested size.
    first: Mutex<Option<(UVec2, First)>>,
}

impl Viewpoint {
    /// The viewpoint of a render.
    pub(super) fn new(
        open_scene: Arc<OpenScene>,
        camera: Camera,
        frame: UVec2,
        render: &Settings,
    ) -> Self {
        Self {
            open_scene,
            camera,
            frame,
            settings: path_settings(render),
            first: Mutex::default(),
        }
    }

    /// The view of a frame of this size.
    pub(super) fn view(&self, size: UVec2) -> View<'_> {
        View::new(
            &self.open_scene.opened.scene,
            &self.camera,
            size,
            Window::full(size),
        )
    }

    /// Hit, position and depth along the view of the surface at the centre of a pixel.
    pub(super) fn point(&self, pixel: UVec2) -> Option<(Hit, Vec3, f32)> {
        let sensor = Sensor {
            camera: &self.camera,
            frame: self.frame,
        };
        let ray = sensor.ray(pixel.as_vec2() + Vec2::splat(0.5));
        let hit = self.open_scene.opened.scene.intersect_seen(&ray)?;
        let position = ray.origin + hit.t * ray.dir;
        let depth = (position - self.camera.position).dot(-self.camera.frame.n);
        Some((hit, position, depth))
    }

    /// Properties of the surface at the centre of a pixel.
    pub(super) fn describe(&self, pixel: UVec2) -> Value {
        let Some((hit, position, depth)) = self.point(pixel) else {
            return Value::Null;
        };
        let scene = &self.open_scene.opened.scene;
        let mut surface = scene.surface(&hit);
        let material = surface.material;
        let alpha = scene.bsdf(&mut surface, 0.25).alpha();
        let mesh = scene.geometry().triangle_mesh(surface.triangle);
        json!({
            "object": self.object(mesh).map(|object| object.name().to_owned()),
            "position": position.to_array(),
            "normal": surface.ns.to_array(),
            "distance": hit.t,
            "depth": depth,
            "material": scene.parts().materials[material as usize].name,
            "mesh": mesh + 1,
            "alpha": alpha,
        })
    }

    /// The object at the centre of a pixel: its name, and the box around it.
    pub(super) fn object_at(&self, pixel: UVec2) -> Value {
        let geometry = self.open_scene.opened.scene.geometry();
        let object = (self.point(pixel))
            .and_then(|(hit, ..)| self.object(geometry.triangle_mesh(hit.triangle)));
        object.map_or(Value::Null, |object| {
            let bounds = object.bounds().map(|p| p.to_array());
            json!({ "name": object.name(), "bounds": bounds })
        })
    }

    /// The mesh or instance of an index; `None` for the floor of the studio.
    fn object(&self, mesh: u32) -> Option<Object<'_>> {
        let parts = self.open_scene.opened.scene.parts();
        let mut index = mesh as usize;
        if let Some(mesh) = parts.meshes.get(index) {
            let is_floor = parts.has_floor && index + 1 == parts.meshes.len();
            return (!is_floor).then_some(Object { mesh, pose: None });
        }
        index -= parts.meshes.len();
        for SharedMesh { mesh, poses } in &parts.shared {
            if let Some(pose) = poses.get(index) {
                return Some(Object {
                    mesh,
                    pose: Some(pose),
                });
            }
            index -= poses.len();
        }
        None
    }

    /// First surfaces at this size, by one sample.
    pub(super) fn first(&self, size: UVec2) -> Option<First> {
        let mut held = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((known, first)) = held.as_ref()
            && *known == size
        {
            return Some(first.clone());
        }
        let view = self.view(size);
        let parts = Recorded {
            first: true,
            ..Recorded::default()
        };
        let mut picture = Picture::blank(size, view.window, &Amounts::Raw, parts).ok()?;
        let settings = Settings {
            max_vertices: 1,
            ..self.settings.clone()
        };
        settings.integrator().pass(&view, 0..1, &mut picture);
        let first = picture.aovs?.first?;
        let made: First = Arc::new([first.albedo(), first.normal(), first.depth()]);
        *held = Some((size, made.clone()));
        Some(made)
    }

    /// Paths of a pixel, the brightest first.
    pub(super) fn paths(&self, pixel: UVec2) -> Value {
        let view = self.view(self.frame);
        let Ok(mut paths) = trace(&self.settings, &view, pixel, 0..TRACED) else {
            return Value::Null;
        };
        let sum: Vec3 = paths.iter().map(|path| path.radiance).sum();
        let lit = paths.iter().filter(|path| luminance(path.radiance) > 0.0);
        let lit = lit.count();
        paths.sort_by(|a, b| luminance(b.radiance).total_cmp(&luminance(a.radiance)));
        let shown: Vec<Value> = (paths.iter().take(SHOWN))
            .map(|path| self.path(path))
            .collect();
        json!({
            "pixel": pixel.to_array(),
            "samples": TRACED,
            "lit": lit,
            "mean": (sum / TRACED as f32).to_array(),
            "paths": shown,
        })
    }

    fn path(&self, path: &TracedPath) -> Value {
        let materials = &self.open_scene.opened.scene.parts().materials;
        let vertices = path.vertices.iter().map(|v| {
            let class = v.class.map(|class| class.index());
            json!({
                "bsdf": v.bsdf,
                "material": materials[v.material as usize].name,
                "mesh": v.mesh.map(|mesh| mesh + 1),
                "position": v.position.to_array(),
                "distance": v.distance,
                "alpha": v.alpha,
                "alpha_reg": v.alpha_reg,
                "class": class,
                "throughput": v.throughput.to_array(),
                "light": v.light.to_array(),
                "lobe": v.lobe.map(|lobe| format!("{lobe:?}").to_lowercase()),
            })
        });
        json!({
            "sample": path.sample,
            "radiance": path.radiance.to_array(),
            "emission": path.emission.to_array(),
            "vertices": vertices.collect::<Vec<_>>(),
        })
    }
}

/// A mesh, or an instance of a shared one.
struct Object<'a> {
    mesh: &'a Mesh,
    pose: Option<&'a DAffine3>,
}

impl Object<'_> {
    /// The name that the file gives it, or its place there.
    fn name(&self) -> &str {
        let place = self.mesh.name.as_str();
        place.split('`').nth(1).unwrap_or(place)
    }

    /// Lowest and highest corner of the box around it.
    fn bounds(&self) -> [Vec3; 2] {
        let none = [Vec3::INFINITY, Vec3::NEG_INFINITY];
        let at = |p: &Vec3| match self.pose {
            Some(pose) => pose.transform_point3(p.as_dvec3()).as_vec3(),
            None => *p,
        };
        (self.mesh.positions.iter().map(at)).fold(none, |[low, high], p| [low.min(p), high.max(p)])
    }
}
