//! Intel Open Image Denoise, loaded at run time: the only module that calls a library of another language.
//!
//! Nothing is linked. [`Denoiser::open`] searches for the library (version 2) in the folder of the variable `OIDN_DIR`,
//! in its `lib` and `bin`, in the paths of the system's loader, and in the Python package `pyoidn` of the active
//! environment, of the environment that contains the program, and of the user.
//!
//! # Safety
//!
//! The declarations are those of `oidn.h` 2.0. Three facts make the calls sound:
//! - The library is loaded before any of its functions is taken and outlives them: [`Denoiser`] owns it, and no function
//!   leaves this module.
//! - Every handle comes from the device that it is used with, on the thread that made it, and is released once.
//! - Buffers are rows of three `f32` without gaps, of the length that the library receives; inputs are only read, and the
//!   output is borrowed mutably until the filter has run, which `execute` waits for.

#![allow(unsafe_code)]

use super::Buffer;
use crate::math::Rgb;
use libloading::Library;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};

/// Environment variable that names the folder of the library.
const VARIABLE: &str = "OIDN_DIR";

/// File names of the library.
const NAMES: &[&str] = if cfg!(windows) {
    &["OpenImageDenoise.dll"]
} else if cfg!(target_os = "macos") {
    &["libOpenImageDenoise.2.dylib", "libOpenImageDenoise.dylib"]
} else {
    &["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"]
};

/// `OIDN_DEVICE_TYPE_CPU`: the result is the same on all machines of a kind.
const CPU: c_int = 1;

/// Approximate limit of the library's working memory in megabytes. It denoises larger pictures in tiles, which overlap
/// by the network's receptive field, so that the result has the same bytes.
const MAX_MEMORY: c_int = 1000;

/// `OIDN_FORMAT_FLOAT3`.
const FLOAT3: c_int = 3;

/// Failures of the denoiser.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DenoiseError {
    /// The library was not found or cannot be used.
    #[error(
        "Open Image Denoise 2 was not found: `pip install pyoidn` brings it, or set {VARIABLE} to the folder of a download. \
         Looked for: {}",
        .0.join("; ")
    )]
    Missing(Vec<String>),
    /// The library reported an error.
    #[error("Open Image Denoise: {0}")]
    Failed(String),
}

type Handle = *mut c_void;

/// The functions in use, by their names in `oidn.h`.
struct Functions {
    new_device: unsafe extern "C" fn(c_int) -> Handle,
    commit_device: unsafe extern "C" fn(Handle),
    device_error: unsafe extern "C" fn(Handle, *mut *const c_char) -> c_int,
    release_device: unsafe extern "C" fn(Handle),
    new_filter: unsafe extern "C" fn(Handle, *const c_char) -> Handle,
    set_image: unsafe extern "C" fn(
        Handle,
        *const c_char,
        *mut c_void,
        c_int,
        usize,
        usize,
        usize,
        usize,
        usize,
    ),
    set_bool: unsafe extern "C" fn(Handle, *const c_char, bool),
    set_int: unsafe extern "C" fn(Handle, *const c_char, c_int),
    commit_filter: unsafe extern "C" fn(Handle),
    execute: unsafe extern "C" fn(Handle),
    release_filter: unsafe extern "C" fn(Handle),
}

/// The library.
pub struct Denoiser {
    functions: Functions,
    /// Dropped last, because it contains the functions.
    _library: Library,
}

/// Folder of the library in the folder of Python packages.
const PACKAGE: &str = "pyoidn/oidn";

/// Python environments whose packages are searched: the active ones, that of the program, and the user's.
fn environments() -> Vec<PathBuf> {
    let named = |name| std::env::var_os(name).map(PathBuf::from);
    let program = std::env::current_exe().ok();
    let around = program.and_then(|file| Some(file.parent()?.parent()?.to_owned()));
    let user = named("HOME").map(|home| home.join(".local"));
    [named("VIRTUAL_ENV"), named("CONDA_PREFIX"), around, user]
        .into_iter()
        .flatten()
        .collect()
}

/// Folders in which the Python package `pyoidn` of an environment would keep the library.
fn packages(environment: &Path) -> Vec<PathBuf> {
    let versions = std::fs::read_dir(environment.join("lib"));
    let mut folders: Vec<PathBuf> = (versions.into_iter().flatten().flatten())
        .filter(|entry| entry.file_name().to_string_lossy().starts_with("python"))
        .map(|entry| entry.path())
        .collect();
    folders.sort();
    folders.push(environment.join("Lib"));
    (folders.iter())
        .map(|folder| folder.join("site-packages").join(PACKAGE))
        .filter(|folder| folder.is_dir())
        .collect()
}

/// Files that may be the library, in the order of the search.
fn candidates(folder: Option<&Path>, environments: &[PathBuf]) -> Vec<PathBuf> {
    let within = |folder: &Path| {
        let parts = ["lib", "bin", ""].map(|part| folder.join(part));
        parts
            .into_iter()
            .flat_map(|part| NAMES.iter().map(move |name| part.join(name)))
    };
    let mut files: Vec<PathBuf> = folder.into_iter().flat_map(within).collect();
    files.extend(NAMES.iter().map(PathBuf::from));
    let packages = environments.iter().flat_map(|e| packages(e));
    files.extend(packages.flat_map(|folder| within(&folder).collect::<Vec<_>>()));
    files
}

impl Denoiser {
    /// Finds the library; the error lists the places that were searched.
    pub fn open() -> Result<Self, DenoiseError> {
        let folder = std::env::var_os(VARIABLE).map(PathBuf::from);
        let mut looked = Vec::new();
        for file in candidates(folder.as_deref(), &environments()) {
            match Self::load(&file) {
                Ok(denoiser) => return Ok(denoiser),
                // An existing file that cannot be loaded is listed with the reason.
                Err(why) if file.exists() => looked.push(format!("{} ({why})", file.display())),
                Err(_) if file.components().count() == 1 => {
                    looked.push(format!("{} in the system's library path", file.display()));
                }
                Err(_) => looked.push(file.display().to_string()),
            }
        }
        Err(DenoiseError::Missing(looked))
    }

    fn load(file: &Path) -> Result<Self, libloading::Error> {
        // SAFETY: the user names the library or installed it; its initialisers are as trustworthy as the program.
        let library = unsafe { Library::new(file) }?;
        // SAFETY: the types are those of oidn.h.
        let functions = unsafe {
            Functions {
                new_device: *library.get(b"oidnNewDevice\0")?,
                commit_device: *library.get(b"oidnCommitDevice\0")?,
                device_error: *library.get(b"oidnGetDeviceError\0")?,
                release_device: *library.get(b"oidnReleaseDevice\0")?,
                new_filter: *library.get(b"oidnNewFilter\0")?,
                set_image: *library.get(b"oidnSetSharedFilterImage\0")?,
                set_bool: *library.get(b"oidnSetFilterBool\0")?,
                set_int: *library.get(b"oidnSetFilterInt\0")?,
                commit_filter: *library.get(b"oidnCommitFilter\0")?,
                execute: *library.get(b"oidnExecuteFilter\0")?,
                release_filter: *library.get(b"oidnReleaseFilter\0")?,
            }
        };
        Ok(Self {
            functions,
            _library: library,
        })
    }

    /// The denoised picture. `colour` is linear radiance; `albedo` in [0, 1] and the world-space `normal` are those of
    /// the first surface.
    ///
    /// Panics if the sizes differ.
    pub(crate) fn denoise(
        &self,
        colour: &Buffer,
        albedo: &Buffer,
        normal: &Buffer,
    ) -> Result<Buffer, DenoiseError> {
        let size = colour.size();
        assert!(
            [albedo, normal].iter().all(|b| b.size() == size)
                && [colour, albedo, normal]
                    .iter()
                    .all(|b| b.pixels.len() == size.0 * size.1)
        );
        let mut out = vec![Rgb::ZERO; colour.pixels.len()];
        if out.is_empty() {
            return Ok(colour.clone());
        }
        let f = &self.functions;
        // SAFETY: see the head of this module. The library only reads the images that are not `output`.
        let failure = unsafe {
            let device = (f.new_device)(CPU);
            if device.is_null() {
                self.failure(device)
            } else {
                (f.commit_device)(device);
                let filter = (f.new_filter)(device, c"RT".as_ptr());
                let image = |name: &CStr, pixels: *mut Rgb| {
                    let (w, h) = size;
                    (f.set_image)(filter, name.as_ptr(), pixels.cast(), FLOAT3, w, h, 0, 0, 0);
                };
                if !filter.is_null() {
                    image(c"color", colour.pixels.as_ptr().cast_mut());
                    image(c"albedo", albedo.pixels.as_ptr().cast_mut());
                    image(c"normal", normal.pixels.as_ptr().cast_mut());
                    image(c"output", out.as_mut_ptr());
                    (f.set_bool)(filter, c"hdr".as_ptr(), true);
                    (f.set_int)(filter, c"maxMemoryMB".as_ptr(), MAX_MEMORY);
                    (f.commit_filter)(filter);
                    (f.execute)(filter);
                    (f.release_filter)(filter);
                }
                let failure = self.failure(device);
                (f.release_device)(device);
                failure
            }
        };
        match failure {
            Some(what) => Err(DenoiseError::Failed(what)),
            None => Ok(Buffer {
                width: size.0,
                height: size.1,
                pixels: out,
            }),
        }
    }

    /// The first error of a device, or of the thread without one.
    ///
    /// # Safety
    ///
    /// The device is null or one that is not released.
    unsafe fn failure(&self, device: Handle) -> Option<String> {
        let mut message: *const c_char = std::ptr::null();
        // SAFETY: the caller's device; the message is a string that lives until the next call.
        unsafe {
            let code = (self.functions.device_error)(device, &raw mut message);
            (code != 0 || device.is_null()).then(|| {
                if message.is_null() {
                    format!("error {code}")
                } else {
                    CStr::from_ptr(message).to_string_lossy().into_owned()
                }
            })
        }
    }
}

// The library receives three singles without gaps.
const _: () = assert!(size_of::<Rgb>() == 12 && align_of::<Rgb>() == 4);

#[cfg(test)]
mod tests;
