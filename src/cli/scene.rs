//! Scenes as commands open them: the glTF file, the environment map, the camera.

use super::{Blame, Exit, Failure};
use anyhow::anyhow;
use clap::Args;
use opsr::bsdf::Distribution;
use opsr::files::hex;
use opsr::integrator::method::{at_least_zero, positive};
use opsr::scene::light::sky::Sky;
use opsr::scene::load::{Animation, LoadOptions, load};
use opsr::scene::{Backdrop, Camera, Lens, Scene, SceneParts};
use sha2::{Digest, Sha256};
use std::path::PathBuf;

/// Options of the scene and its environment.
#[derive(Args, Debug, Clone)]
pub(super) struct SceneArgs {
    /// The scene: a glTF 2.0 file (.gltf or .glb).
    pub(super) scene: PathBuf,
    /// What surrounds the scene: an equirectangular map (.hdr or .exr); `studio`, grey walls with soft lamps; `sky`, a clear
    /// sky with its sun; or `none`. Without it `studio` for a scene that has no light, else `none`.
    #[arg(long, value_name = "FILE|NAME")]
    env: Option<PathBuf>,
    /// Where the sun of `--env sky` stands, in degrees: its height, and how far to the right of the front.
    #[arg(long, value_name = "HEIGHT,ANGLE", allow_hyphen_values = true, value_parser = sun)]
    sun: Option<[f32; 2]>,
    /// Haze of `--env sky`: 2 is a very clear sky, 10 a hazy one.
    #[arg(long, value_name = "X", value_parser = turbidity)]
    turbidity: Option<f32>,
    /// Factor on the radiance of the environment.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = positive)]
    env_intensity: f32,
    /// Rotation of the environment about the vertical axis, in degrees.
    #[arg(
        long,
        value_name = "DEGREES",
        default_value_t = 0.0,
        allow_negative_numbers = true,
        value_parser = finite
    )]
    env_rotation: f32,
    /// Microfacet distribution of glossy lobes. Tables are learned for Beckmann; GGX is glTF's own model.
    #[arg(long, value_enum, default_value_t)]
    distribution: Lobes,
    /// Make solid bodies of closed meshes that transmit without a thickness, such as glass from Blender.
    #[arg(long)]
    solid_glass: bool,
    /// Leave such meshes thin walls also in files from Blender, where they are bodies without this option.
    #[arg(long, conflicts_with = "solid_glass")]
    thin_glass: bool,
    /// Variant of the materials, by name or number (from 0).
    #[arg(long, value_name = "NAME")]
    variant: Option<String>,
    /// Frame of the animations to show, from 0 at their start. Without it the scene is at rest.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = moment)]
    frame: Option<f64>,
    /// Frames per second that --frame counts.
    #[arg(long, value_name = "N", default_value_t = 24.0, requires = "frame", value_parser = positive)]
    fps: f32,
    /// Moment of the animations to show, in seconds from their start.
    #[arg(long, value_name = "SECONDS", conflicts_with = "frame", allow_negative_numbers = true, value_parser = moment)]
    time_of_scene: Option<f64>,
}

/// [`Distribution`] on the command line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
enum Lobes {
    #[default]
    Beckmann,
    Ggx,
}

/// A finite number.
pub(super) fn finite(text: &str) -> Result<f32, String> {
    match text.parse::<f32>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err("expected a number".into()),
    }
}

/// Height and angle of the sun in degrees.
fn sun(text: &str) -> Result<[f32; 2], String> {
    let (height, angle) = text.split_once(',').unwrap_or((text, "-40"));
    let [height, angle] = [finite(height)?, finite(angle)?];
    match (0.0..=90.0).contains(&height) {
        true => Ok([height, angle]),
        false => Err("expected a height from 0 to 90, and an angle".into()),
    }
}

/// A turbidity that the model of the sky knows.
fn turbidity(text: &str) -> Result<f32, String> {
    let known = |x: &f32| (1.8..=10.0).contains(x);
    let wrong = "expected a number from 1.8 to 10";
    finite(text).ok().filter(known).ok_or(wrong.into())
}

/// A finite number of frames or seconds.
fn moment(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        _ => Err("expected a number".into()),
    }
}

/// An opened scene.
pub(super) struct Opened {
    /// The scene.
    pub(super) scene: Scene,
    /// SHA-256 over the scene's own file and the environment's.
    pub(super) hash: String,
    /// Warnings of the loader and of the scene.
    pub(super) warnings: Vec<String>,
    /// Animations of the file.
    pub(super) animations: Vec<Animation>,
    /// True if the studio lights the scene, since nothing else does.
    pub(super) in_studio: bool,
}

impl SceneArgs {
    /// The environment map.
    pub(super) fn environment(&self) -> Option<PathBuf> {
        self.backdrop().ok()?.file().cloned()
    }

    /// What surrounds the scene.
    fn backdrop(&self) -> anyhow::Result<Backdrop> {
        let mut sky = Sky::default();
        if let Some([height, angle]) = self.sun {
            (sky.elevation, sky.azimuth) = (height.to_radians(), angle.to_radians());
        }
        sky.turbidity = self.turbidity.unwrap_or(sky.turbidity);
        let around = Backdrop::named(self.env.as_deref(), sky);
        let of_sky = self.sun.is_some() || self.turbidity.is_some();
        if of_sky && !matches!(around, Backdrop::Sky(_)) {
            return Err(anyhow!("--sun and --turbidity need --env sky")).usage();
        }
        Ok(around)
    }

    /// Opens the scene.
    pub(super) fn open(&self) -> anyhow::Result<Opened> {
        self.open_as(Scene::new)
    }

    /// Opens the scene to be described, which needs no tree.
    pub(super) fn open_outline(&self) -> anyhow::Result<Opened> {
        self.open_as(Scene::outline)
    }

    /// True if glossy lobes have glTF's own distribution.
    pub(super) fn has_ggx_lobes(&self) -> bool {
        matches!(self.distribution, Lobes::Ggx)
    }

    fn open_as(&self, build: fn(SceneParts) -> Scene) -> anyhow::Result<Opened> {
        let distribution = match self.distribution {
            Lobes::Beckmann => Distribution::Beckmann,
            Lobes::Ggx => Distribution::Ggx,
        };
        let options = LoadOptions {
            distribution,
            solid_glass: self.solid_glass,
            thin_glass: self.thin_glass,
            time: self.time(),
            variant: self.variant.clone(),
        };
        let backdrop = self.backdrop()?;
        let loaded = load(&self.scene, &options).input()?;
        let (mut parts, mut warnings) = (loaded.parts, loaded.warnings);
        let mut digest = Sha256::new();
        digest.update(loaded.digest);
        let rotation = self.env_rotation.to_radians();
        let take = |bytes: &[u8]| digest.update(bytes);
        let in_studio = backdrop
            .surround(&mut parts, loaded.lit, self.env_intensity, rotation, take)
            .input()?;
        let scene = build(parts);
        warnings.extend_from_slice(scene.warnings());
        for warning in &warnings {
            tracing::warn!("{}: {warning}", self.scene.display());
        }
        Ok(Opened {
            scene,
            hash: hex(&digest.finalize()),
            warnings,
            animations: loaded.animations,
            in_studio,
        })
    }

    /// Moment of the animations in seconds.
    fn time(&self) -> Option<f64> {
        let frame = self.frame.map(|frame| frame / f64::from(self.fps));
        self.time_of_scene.or(frame)
    }

    /// The options other than files, for a fingerprint.
    pub(super) fn words(&self) -> String {
        let Self {
            env_intensity,
            env_rotation,
            distribution,
            solid_glass,
            thin_glass,
            variant,
            ..
        } = self;
        let glass = match (solid_glass, thin_glass) {
            (true, _) => ", solid glass",
            (false, true) => ", thin glass",
            (false, false) => "",
        };
        let time = self.time().map_or(String::new(), |t| format!(", at {t} s"));
        let variant = (variant.as_ref()).map_or(String::new(), |v| format!(", variant {v}"));
        format!("env {env_intensity} {env_rotation}, {distribution:?}{glass}{time}{variant}")
    }
}

/// Options of the camera's lens.
#[derive(Args, Debug, Clone, Copy)]
pub(super) struct LensArgs {
    /// Radius of the camera's lens, in units of the scene: what is not in focus blurs. 0 leaves a lens of the file out.
    #[arg(long, value_name = "RADIUS", value_parser = at_least_zero)]
    aperture: Option<f32>,
    /// Distance that is in focus, along the view direction, in units of the scene.
    #[arg(long, value_name = "DISTANCE", value_parser = positive)]
    focus: Option<f32>,
}

impl LensArgs {
    /// The camera with the lens asked for.
    pub(super) fn on(self, camera: Camera) -> anyhow::Result<Camera> {
        let lens = self.lens(camera.lens)?;
        Ok(Camera { lens, ..camera })
    }

    /// The lens of a camera whose file says `file`.
    fn lens(self, file: Option<Lens>) -> anyhow::Result<Option<Lens>> {
        let radius = self.aperture.or(file.map(|l| l.radius));
        let focus = self.focus.or(file.map(|l| l.focus));
        match (radius, focus) {
            (Some(0.0), _) | (None, None) => Ok(None),
            (Some(radius), Some(focus)) => Ok(Some(Lens { radius, focus })),
            (Some(_), None) => Err(anyhow!("--aperture needs --focus")).usage(),
            (None, Some(_)) => Err(anyhow!("--focus needs --aperture")).usage(),
        }
    }

    /// The options in words, for a fingerprint.
    pub(super) fn words(self) -> String {
        match (self.aperture, self.focus) {
            (None, None) => String::new(),
            (aperture, focus) => format!(", lens {aperture:?} {focus:?}"),
        }
    }
}

/// The camera with this name or number; without one the first, or a camera that sees the whole scene.
pub(super) fn camera(scene: &Scene, wanted: Option<&str>, aspect: f32) -> anyhow::Result<Camera> {
    let cameras = &scene.parts().cameras;
    let Some(wanted) = wanted else {
        let first = cameras.first().cloned();
        return Ok(first.unwrap_or_else(|| scene.framing_camera(aspect)));
    };
    let by_name = cameras.iter().find(|c| c.name == wanted);
    let by_number = || wanted.parse::<usize>().ok().and_then(|i| cameras.get(i));
    by_name.or_else(by_number).cloned().ok_or_else(|| {
        let names = cameras
            .iter()
            .enumerate()
            .map(|(i, c)| format!("{i} `{}`", c.name));
        let names = names.collect::<Vec<_>>().join(", ");
        let has = if names.is_empty() { "none" } else { &names };
        Failure(
            Exit::Input,
            anyhow!("no camera `{wanted}`: the scene has {has}"),
        )
        .into()
    })
}
