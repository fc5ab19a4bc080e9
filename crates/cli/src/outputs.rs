//! The files of a picture: checks that they can be written and do not replace an input, and their writing.

use opsr::render::{Fault, Finished, Spec, can_write};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::SystemTime;

/// The files that a picture is written to.
pub(super) struct Outputs {
    files: Vec<PathBuf>,
    /// Version of each file at its last check or write.
    versions: Mutex<Vec<Option<Version>>>,
}

/// Modification time and length of a file in bytes.
type Version = (SystemTime, u64);

/// The version of an existing file.
fn version(file: &Path) -> Option<Version> {
    let metadata = file.metadata().ok().filter(std::fs::Metadata::is_file)?;
    Some((metadata.modified().ok()?, metadata.len()))
}

/// True for a name with this ending, in any case of letters.
pub(super) fn has_ending(file: &Path, ending: &str) -> bool {
    file.extension()
        .is_some_and(|found| found.eq_ignore_ascii_case(ending))
}

/// An error for layers without an EXR file, and for options of file formats that are not written.
pub(super) fn check_layers(spec: &Spec, files: &[PathBuf]) -> Result<(), Fault> {
    let has = |ending| files.iter().any(|file| has_ending(file, ending));
    let (exr, png) = (has("exr"), has("png"));
    let layers = "adds layers to EXR files: add -o with a name that ends in .exr";
    let (of_exr, of_png) = (
        "is of EXR files: add -o with a name that ends in .exr",
        "is of PNG files: add -o with a name that ends in .png",
    );
    for (name, there, what) in [
        ("aov", exr, layers),
        ("exr", exr, of_exr),
        ("exposure", png, of_png),
        ("view", png, of_png),
    ] {
        if !there && spec.given().any(|(given, _)| given.name == name) {
            return Err(Fault::option(name, what));
        }
    }
    Ok(())
}

impl Outputs {
    /// Checks before anything is rendered that the files can be written at all.
    pub(super) fn new(files: &[PathBuf]) -> Result<Self, Fault> {
        for file in files {
            if !(has_ending(file, "exr") || has_ending(file, "png")) {
                let what = "expected a name that ends in .exr or .png";
                return Err(Fault::usage(format!("{}: {what}", file.display())));
            }
            can_write(file)?;
        }
        Ok(Self {
            files: files.to_vec(),
            versions: Mutex::new(files.iter().map(|file| version(file)).collect()),
        })
    }

    /// The file names, for messages.
    pub(super) fn names(&self) -> String {
        let names = self.files.iter().map(|file| file.display().to_string());
        names.collect::<Vec<_>>().join(", ")
    }

    /// True if a PNG file is among them, so that the exposure matters.
    pub(super) fn has_png(&self) -> bool {
        self.files.iter().any(|file| has_ending(file, "png"))
    }

    /// The files that another program has made or changed since the last check or write.
    pub(super) fn changed(&self) -> Vec<PathBuf> {
        let versions = self.versions.lock().unwrap_or_else(|e| e.into_inner());
        let pairs = self.files.iter().zip(versions.iter());
        let changed = pairs.filter(|(file, known)| version(file) != **known);
        changed.map(|(file, _)| file.clone()).collect()
    }

    /// Writes every file, each whole or not at all; fails with the first failure, after the other files are written.
    pub(super) fn write(&self, finished: &Finished<'_>) -> Result<(), Fault> {
        let mut versions = self.versions.lock().unwrap_or_else(|e| e.into_inner());
        let save = |(file, known): (&PathBuf, &mut Option<Version>)| {
            let saved = finished.save(file);
            *known = version(file);
            saved
        };
        let failures = self.files.iter().zip(versions.iter_mut()).map(save);
        // Collected before the first failure is returned, so that every file is written.
        let failures: Vec<_> = failures.filter_map(Result::err).collect();
        failures.into_iter().next().map_or(Ok(()), Err)
    }
}

/// An error if two outputs are one file, or an output is also an input.
pub(super) fn check_distinct<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Fault> {
    let mut seen = HashSet::new();
    let inputs: HashSet<PathBuf> = inputs.into_iter().filter_map(identity).collect();
    for path in outputs {
        let Some(file) = identity(path) else { continue };
        let refused = |what: &str| {
            let problem = "give the output another name";
            Err(Fault::usage(format!(
                "{}: {what}: {problem}",
                path.display()
            )))
        };
        if inputs.contains(&file) {
            return refused("would replace a file that is read");
        }
        if !seen.insert(file) {
            return refused("is the name of two outputs");
        }
    }
    Ok(())
}

/// The file that a path names, whether it exists or not; `None` for pipes and devices.
fn identity(path: &Path) -> Option<PathBuf> {
    if let Ok(file) = path.canonicalize() {
        return file.is_file().then_some(file);
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
    Some(folder.join(path.file_name()?))
}
