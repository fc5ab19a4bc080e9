//! The list of training and validation scenes: files, cameras, crops, exposures.

use opsr::files::{self, FileError};
use serde::Deserialize;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Edge of a crop in pixels.
pub(crate) const CROP: u32 = 32;

/// Most bytes of a manifest.
const MAX_BYTES: u64 = 1 << 22;

/// Use of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The optimiser trains on it.
    Train,
    /// Held out; only scored.
    Validation,
}

/// One scene of the list, with its view and crops.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneEntry {
    /// Name, unique in the list.
    pub name: String,
    /// The scene's file, relative to the manifest.
    pub file: PathBuf,
    /// Use of the scene.
    pub role: Role,
    /// Scenes of one kind, held out together.
    pub family: String,
    /// Index of the camera in the file.
    #[serde(default)]
    pub camera: usize,
    /// Size of the whole picture, in pixels.
    pub frame: [u32; 2],
    /// Upper left corners of the crops, each `CROP` pixels wide and high.
    pub crops: Vec<[u32; 2]>,
    /// Scattering vertices of the longest path.
    pub max_vertices: u32,
    /// Factor that brings the mean radiance over the crops to about 0.5.
    pub exposure: f32,
    /// Reason for the scene.
    #[serde(default)]
    pub note: String,
}

/// The scenes in the order of their file.
#[derive(Clone, Debug, PartialEq)]
pub struct Manifest {
    /// The folder that the scenes' files are relative to.
    pub folder: PathBuf,
    /// The scenes.
    pub scenes: Vec<SceneEntry>,
}

/// Layout of the TOML file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    scene: Vec<SceneEntry>,
}

impl Manifest {
    /// Reads and checks a manifest; the scenes' own files are not opened.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        Self::parse(&files::read_text(path, MAX_BYTES)?, path)
    }

    /// Parses and checks the text of a manifest. `path` is its file, for messages and relative paths.
    pub fn parse(text: &str, path: &Path) -> Result<Self, FileError> {
        let Text { scene: scenes } = files::toml(text).map_err(|e| FileError::content(path, e))?;
        let mut names = HashSet::new();
        for (i, entry) in scenes.iter().enumerate() {
            let fault = match entry.fault() {
                None if !names.insert(&entry.name) => Some("its name is taken".to_owned()),
                fault => fault,
            };
            if let Some(what) = fault {
                let place = format!("scene {} (\"{}\")", i + 1, entry.name);
                return Err(FileError::content(path, format!("{place}: {what}")));
            }
        }
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { folder, scenes })
    }

    /// The scenes of a role.
    pub fn of(&self, role: Role) -> impl Iterator<Item = &SceneEntry> {
        self.scenes.iter().filter(move |entry| entry.role == role)
    }

    /// Path of an entry's scene.
    pub fn file(&self, entry: &SceneEntry) -> PathBuf {
        self.folder.join(&entry.file)
    }

    /// Path of the reference of an entry's crop, rendered or not.
    pub fn reference(&self, entry: &SceneEntry, [x, y]: [u32; 2]) -> PathBuf {
        let name = format!("{}_{x}_{y}.exr", entry.name);
        self.folder.join("references").join(name)
    }
}

impl SceneEntry {
    /// The first inconsistency, if there is one.
    fn fault(&self) -> Option<String> {
        let [w, h] = self.frame;
        if self.name.is_empty() || self.name.contains(['/', '\\']) {
            return Some("a name is not empty and has no slash".to_owned());
        }
        if self.max_vertices == 0 {
            return Some("max_vertices is 0".to_owned());
        }
        if !(self.exposure.is_finite() && self.exposure > 0.0) {
            return Some(format!("exposure {} is not positive", self.exposure));
        }
        if self.crops.is_empty() {
            return Some("it has no crops".to_owned());
        }
        let outside = |&&[x, y]: &&[u32; 2]| {
            x.checked_add(CROP).is_none_or(|x| x > w) || y.checked_add(CROP).is_none_or(|y| y > h)
        };
        self.crops
            .iter()
            .find(outside)
            .map(|[x, y]| format!("crop [{x}, {y}] leaves the frame of {w}×{h} pixels"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GOOD: &str = "[[scene]]\nname = \"a\"\nfile = \"a.glb\"\nrole = \"train\"\nfamily = \"f\"\n\
                        frame = [64, 48]\ncrops = [[32, 16]]\nmax_vertices = 8\nexposure = 2.0\n";

    fn parse(text: &str) -> Result<Manifest, FileError> {
        Manifest::parse(text, Path::new("set/manifest.toml"))
    }

    #[test]
    fn manifest_fields_are_read() {
        let m = parse(GOOD).unwrap();
        let e = &m.scenes[0];
        assert_eq!((e.camera, e.exposure, e.role), (0, 2.0, Role::Train));
        assert_eq!(m.file(e), Path::new("set/a.glb"));
        assert_eq!(
            m.reference(e, [32, 16]),
            Path::new("set/references/a_32_16.exr")
        );
        assert_eq!(m.of(Role::Validation).count(), 0);
    }

    #[test]
    fn manifest_errors_name_file_and_place() {
        for (from, to, expected) in [
            ("[32, 16]", "[33, 16]", "crop [33, 16] leaves the frame"),
            ("[32, 16]", "[4294967295, 0]", "leaves the frame"),
            ("2.0", "0.0", "exposure 0 is not positive"),
            ("2.0", "nan", "not positive"),
            ("= 8", "= 0", "max_vertices"),
            ("[[32, 16]]", "[]", "no crops"),
            ("\"a\"", "\"../a\"", "slash"),
            ("\"train\"", "\"test\"", "line 4"),
            ("family", "familly", "line 5"),
        ] {
            let error = parse(&GOOD.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.starts_with("set/manifest.toml: "), "{error}");
            assert!(error.contains(expected), "{error}");
        }
        let twice = parse(&GOOD.repeat(2)).unwrap_err().to_string();
        assert!(
            twice.contains("scene 2 (\"a\"): its name is taken"),
            "{twice}"
        );
    }
}
