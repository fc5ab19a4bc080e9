//! The file of the scene, and files that are dropped onto a page: they lie in a folder of their own as long as their scene is shown.

use opsr::render::{Fault, Names};
use serde::Deserialize;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tempfile::TempDir;

/// Most bytes of the files that are dropped at once, and most files.
pub(super) const MOST_BYTES: usize = 1 << 28;
const MOST_FILES: usize = 1024;

/// Most bytes of a name, and most folders in it.
const MOST_NAME: usize = 512;
const MOST_FOLDERS: usize = 16;

/// The file of a scene.
#[derive(Debug)]
pub(super) struct SceneFile {
    pub(super) path: PathBuf,
    /// Its name in commands and messages.
    pub(super) name: String,
    /// The folder of a dropped file, which is removed with this.
    folder: Option<TempDir>,
}

impl SceneFile {
    /// A file that the command line named.
    pub(super) fn named(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            name: path.display().to_string(),
            folder: None,
        }
    }

    pub(super) fn is_dropped(&self) -> bool {
        self.folder.is_some()
    }

    /// The name without folders and ending.
    pub(super) fn title(&self) -> String {
        let stem = self.path.file_stem();
        stem.map_or(String::new(), |stem| stem.to_string_lossy().into_owned())
    }

    /// A fault without the folder of dropped files, which nobody knows.
    pub(super) fn said(&self, fault: Fault) -> Fault {
        let Some(folder) = &self.folder else {
            return fault;
        };
        let folder = format!("{}{}", folder.path().display(), std::path::MAIN_SEPARATOR);
        let mut what = fault.message(Names::Flags).replace(&folder, "");
        if matches!(&fault, Fault::File(_)) && what.contains("cannot read") {
            what += "; files that a .gltf names are dropped along with it";
        }
        Fault::Input(what)
    }
}

/// A file in a message.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Part {
    /// Its name, with folders below that of the scene.
    name: String,
    size: usize,
}

/// The folder of all dropped files, which is made for the first.
#[derive(Default)]
pub(super) struct Dropped(Mutex<Option<TempDir>>);

impl Dropped {
    /// The scene of a message: the length of a list in four bytes, the list of names and sizes as JSON, the bytes of the files.
    pub(super) fn unpacked(&self, message: &[u8]) -> Result<SceneFile, Fault> {
        let wrong = |what: &str| Fault::usage(format!("dropped files: {what}"));
        let failed = |e: io::Error| Fault::Output(format!("dropped files: {e}"));
        let (length, rest) = message
            .split_first_chunk()
            .ok_or_else(|| wrong("no list of files"))?;
        let length = u32::from_le_bytes(*length) as usize;
        let (list, mut bytes) = rest
            .split_at_checked(length)
            .ok_or_else(|| wrong("no list of files"))?;
        let parts: Vec<Part> =
            serde_json::from_slice(list).map_err(|e| wrong(&format!("no list of files: {e}")))?;
        if parts.len() > MOST_FILES {
            return Err(wrong(&format!("more than {MOST_FILES}")));
        }
        let paths: Option<Vec<PathBuf>> = parts.iter().map(|part| path_of(&part.name)).collect();
        let paths = paths.ok_or_else(|| wrong("a name leads out of their folder"))?;
        let mut scenes = paths.iter().filter(|path| is_scene(path));
        let (Some(scene), None) = (scenes.next(), scenes.next()) else {
            return Err(wrong(
                "expected one scene, .glb or .gltf, and the files that it names",
            ));
        };
        let folder = self.folder().map_err(failed)?;
        for (path, part) in paths.iter().zip(&parts) {
            let (own, others) = bytes
                .split_at_checked(part.size)
                .ok_or_else(|| wrong("shorter than the list says"))?;
            write(&folder.path().join(path), own).map_err(failed)?;
            bytes = others;
        }
        if !bytes.is_empty() {
            return Err(wrong("longer than the list says"));
        }
        Ok(SceneFile {
            path: folder.path().join(scene),
            name: scene.display().to_string(),
            folder: Some(folder),
        })
    }

    /// A new folder, which nobody else may read.
    fn folder(&self) -> io::Result<TempDir> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let all = match &mut *all {
            Some(all) => all,
            none => none.insert(private(&std::env::temp_dir())?),
        };
        private(all.path())
    }

    /// Removes all of them.
    pub(super) fn remove(&self) {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        // What cannot be removed is left to the system.
        let _ = all.map(TempDir::close);
    }
}

/// A folder in another one that its owner alone may read.
fn private(within: &Path) -> io::Result<TempDir> {
    let mut builder = tempfile::Builder::new();
    builder.prefix("opsr-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o700));
    }
    builder.tempdir_in(within)
}

/// Writes a new file.
fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    io::Write::write_all(&mut std::fs::File::create_new(path)?, bytes)
}

fn is_scene(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default();
    ["glb", "gltf"]
        .iter()
        .any(|e| ending.eq_ignore_ascii_case(e))
}

/// The path of a name that stays in its folder on every system.
fn path_of(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(name);
    let parts: Vec<&str> = name.split('/').collect();
    let plain = |part: &&str| {
        !part.is_empty() && *part != "." && *part != ".." && !part.contains(['\\', ':', '\0'])
    };
    let normal = |part: Component<'_>| matches!(part, Component::Normal(_));
    let short = name.len() <= MOST_NAME && parts.len() <= MOST_FOLDERS;
    (short && parts.iter().all(plain) && path.components().all(normal)).then_some(path)
}

#[cfg(test)]
mod tests;
