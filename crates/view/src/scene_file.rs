//! The file of the scene. Files that are dropped onto a page are in a temporary folder while their scene is shown.

use opsr::render::{Fault, Names};
use serde::Deserialize;
use std::io;
use std::path::{Component, Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tempfile::TempDir;

/// Maximum bytes of the files of one drop, and maximum number of files.
pub(super) const MAX_BYTES: usize = 1 << 28;
const MAX_FILES: usize = 1024;

/// Maximum bytes of a name, and maximum number of its folders, the file counted as one.
const MAX_NAME: usize = 512;
const MAX_FOLDERS: usize = 16;

/// The file of a scene.
#[derive(Debug)]
pub(super) struct SceneFile {
    pub(super) path: PathBuf,
    /// Its name in commands and messages.
    pub(super) name: String,
    /// Folder of a dropped file, deleted with this value; `None` for other files.
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

    /// A fault whose message leaves out the temporary folder of dropped files.
    pub(super) fn redacted(&self, fault: Fault) -> Fault {
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
    /// Its path, relative to the folder of the drop.
    name: String,
    size: usize,
}

/// Temporary folder of all dropped files, made for the first drop.
#[derive(Default)]
pub(super) struct Dropped(Mutex<Option<TempDir>>);

impl Dropped {
    /// Unpacks a message: length of a list in four bytes, names and sizes as JSON, bytes of the files. Gives the scene.
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
        if parts.len() > MAX_FILES {
            return Err(wrong(&format!("more than {MAX_FILES}")));
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

    /// A new folder within the temporary one.
    fn folder(&self) -> io::Result<TempDir> {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let all = match &mut *all {
            Some(all) => all,
            none => none.insert(private(&std::env::temp_dir())?),
        };
        private(all.path())
    }

    /// Deletes all dropped files.
    pub(super) fn remove(&self) {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner).take();
        // Files that cannot be deleted stay in the system's temporary folder.
        let _ = all.map(TempDir::close);
    }
}

/// A new folder within another one; on Unix its owner alone can read it.
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

/// The path of a name; `None` for a name that leaves its folder on any system.
fn path_of(name: &str) -> Option<PathBuf> {
    let path = PathBuf::from(name);
    let parts: Vec<&str> = name.split('/').collect();
    let plain = |part: &&str| {
        !part.is_empty() && *part != "." && *part != ".." && !part.contains(['\\', ':', '\0'])
    };
    let normal = |part: Component<'_>| matches!(part, Component::Normal(_));
    let short = name.len() <= MAX_NAME && parts.len() <= MAX_FOLDERS;
    (short && parts.iter().all(plain) && path.components().all(normal)).then_some(path)
}

#[cfg(test)]
mod tests;
