//! The scene that a render asks for: the glTF file, and what surrounds it.

use super::fault::Fault;
use super::spec::Spec;
use crate::files::hex;
use crate::scene::light::sky::Sky;
use crate::scene::load::{Animation, LoadOptions, load};
use crate::scene::{Backdrop, Scene, SceneParts};
use sha2::{Digest, Sha256};
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
    /// True if the studio lights the scene, since nothing else does.
    pub in_studio: bool,
}

impl Spec {
    /// What surrounds the scene.
    fn backdrop(&self) -> Backdrop {
        let mut sky = Sky::default();
        if let Some(sun) = self.sun {
            let [height, angle] = sun.0;
            (sky.elevation, sky.azimuth) = (height.to_radians(), angle.to_radians());
        }
        sky.turbidity = self.turbidity.unwrap_or(sky.turbidity);
        Backdrop::named(self.env.as_deref(), sky)
    }

    /// Moment of the animations in seconds.
    fn moment(&self) -> Option<f64> {
        let fps = self.fps.unwrap_or(24.0);
        let frame = self.frame.map(|frame| frame / f64::from(fps));
        self.time_of_scene.or(frame)
    }

    /// Choices that the file does not contain.
    pub fn load_options(&self) -> LoadOptions {
        LoadOptions {
            distribution: self.distribution,
            skip_unsupported: self.skip_unsupported.unwrap_or_default(),
            solid_glass: self.solid_glass.unwrap_or_default(),
            thin_glass: self.thin_glass.unwrap_or_default(),
            time: self.moment(),
            variant: self.variant.as_ref().map(|variant| variant.0.clone()),
        }
    }

    /// Makes of a scene, which is `lit` or not, what the options ask for; hands over bytes that name its surroundings. True if
    /// the studio was chosen because the scene is not lit.
    pub fn dress(
        &self,
        parts: &mut SceneParts,
        lit: bool,
        take: impl FnMut(&[u8]),
    ) -> Result<bool, Fault> {
        let rotation = self.env_rotation.unwrap_or(0.0).to_radians();
        let intensity = self.env_intensity.unwrap_or(1.0);
        let in_studio = self
            .backdrop()
            .surround(parts, lit, intensity, rotation, take)?;
        let name = match self.env_intensity {
            Some(_) => "env_intensity",
            None => "env_rotation",
        };
        if parts.environment.is_none() && self.has(name) {
            let why = "nothing surrounds the scene: {env} studio, sky or a map would";
            return Err(Fault::option(name, why));
        }
        Ok(in_studio)
    }

    /// Opens the scene of a file; `build` is [`Scene::new`], or [`Scene::outline`] for a scene that is described only.
    pub fn open(&self, path: &Path, build: fn(SceneParts) -> Scene) -> Result<Opened, Fault> {
        self.check()?;
        let loaded = load(path, &self.load_options())?;
        let (mut parts, mut warnings) = (loaded.parts, loaded.warnings);
        let mut digest = Sha256::new();
        digest.update(loaded.digest);
        let in_studio = self.dress(&mut parts, loaded.lit, |bytes| digest.update(bytes))?;
        let scene = build(parts);
        warnings.extend_from_slice(scene.warnings());
        let mut files = loaded.files;
        files.extend(self.backdrop().file().cloned());
        Ok(Opened {
            scene,
            sha256: hex(&digest.finalize()),
            files,
            warnings,
            animations: loaded.animations,
            in_studio,
        })
    }
}
