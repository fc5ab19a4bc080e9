//! Sources of bytes: the container of a `.glb` file, external files, data URIs, and the digest over all of them.

use super::error::{Result, fault};
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};

/// The JSON text and the binary chunk of a file.
pub(super) struct Container<'a> {
    pub(super) json: &'a [u8],
    pub(super) binary: Option<&'a [u8]>,
}

impl<'a> Container<'a> {
    /// Splits a `.glb` file into its chunks; anything else is taken as JSON `[glTF §4.4]`.
    pub(super) fn new(bytes: &'a [u8]) -> Result<Self> {
        if !bytes.starts_with(b"glTF") {
            let json = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
            return Ok(Self { json, binary: None });
        }
        let header = "GLB header";
        let word = |at: usize| {
            let four = bytes.get(at..at + 4)?;
            Some(u32::from_le_bytes(four.try_into().ok()?) as usize)
        };
        let (Some(version), Some(length)) = (word(4), word(8)) else {
            return Err(fault(header, "the file ends within it"));
        };
        if version != 2 {
            return Err(fault(header, format!("version {version}, not 2")));
        }
        if length > bytes.len() {
            let what = format!(
                "truncated: it says {length} bytes, the file has {}",
                bytes.len()
            );
            return Err(fault(header, what));
        }
        let chunk = |at: usize, number: usize| {
            let place = format!("GLB chunk {number}");
            let start = at + 8;
            let (Some(size), Some(kind), true) = (word(at), word(at + 4), start <= length) else {
                return Err(fault(place, "the file ends within its header"));
            };
            match start.checked_add(size).filter(|&end| end <= length) {
                Some(end) => Ok((kind, &bytes[start..end], end.next_multiple_of(4))),
                None => Err(fault(
                    place,
                    format!("its {size} bytes pass the file's end"),
                )),
            }
        };
        let (kind, json, next) = chunk(12, 0)?;
        if kind != 0x4e4f_534a {
            return Err(fault("GLB chunk 0", "is not JSON"));
        }
        let mut binary = None;
        if next + 8 <= length {
            let (kind, data, _) = chunk(next, 1)?;
            // Chunks of unknown kinds are to be ignored.
            binary = (kind == 0x004e_4942).then_some(data);
        }
        Ok(Self { json, binary })
    }
}

/// Most bytes read from external files: a list of buffers may name one file again and again.
const MAX_BESIDE: u64 = 1 << 32;

/// The files a scene is made of.
pub struct Files {
    folder: PathBuf,
    digest: Sha256,
    read: Vec<PathBuf>,
    /// Bytes that may still be read.
    left: u64,
}

impl Files {
    /// Starts with the scene file itself.
    pub fn new(path: &Path, bytes: &[u8]) -> Self {
        Self {
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            digest: Sha256::new_with_prefix(bytes),
            read: vec![path.to_owned()],
            left: MAX_BESIDE,
        }
    }

    /// Every file that was read, and the SHA-256 of all.
    pub fn finish(self) -> (Vec<PathBuf>, [u8; 32]) {
        (self.read, self.digest.finalize().into())
    }

    /// The bytes of a data URI, or of a file in the scene's folder or below.
    pub(super) fn read(&mut self, uri: &str, place: &str) -> Result<Vec<u8>> {
        if uri
            .get(..5)
            .is_some_and(|s| s.eq_ignore_ascii_case("data:"))
        {
            return data(&uri[5..], place);
        }
        let name = percent_decoded(uri, place)?;
        self.open(&name, place).map(|(_, bytes)| bytes)
    }

    /// The path and the bytes of a file in the scene's folder or below.
    pub fn open(&mut self, name: &str, place: &str) -> Result<(PathBuf, Vec<u8>)> {
        let path = self.folder.join(inside(name, place)?);
        let cannot = |e| fault(place, format!("cannot read {}: {e}", path.display()));
        let size = std::fs::metadata(&path).map_err(cannot)?.len();
        let Some(left) = self.left.checked_sub(size) else {
            let what = format!(
                "{}: more than {MAX_BESIDE} bytes of external files",
                path.display()
            );
            return Err(fault(place, what));
        };
        self.left = left;
        let bytes = read_file(&path).map_err(cannot)?;
        self.digest.update(&bytes);
        self.read.push(path.clone());
        Ok((path, bytes))
    }
}

/// Reads a regular file: a pipe or a device could be endless.
pub(super) fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    if !std::fs::metadata(path)?.is_file() {
        return Err(std::io::Error::other("not a regular file"));
    }
    std::fs::read(path)
}

/// The contents of a data URI, after its scheme (RFC 2397).
fn data(rest: &str, place: &str) -> Result<Vec<u8>> {
    let Some((kind, payload)) = rest.split_once(',') else {
        return Err(fault(place, "a data URI without a comma"));
    };
    if !kind.to_ascii_lowercase().ends_with(";base64") {
        return percent_bytes(payload, place);
    }
    let lenient =
        GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent);
    let engine = GeneralPurpose::new(&STANDARD, lenient);
    (engine.decode(payload)).map_err(|e| fault(place, format!("bad base64 in a data URI: {e}")))
}

/// A relative path that stays in its folder: a scene must not read elsewhere.
fn inside(name: &str, place: &str) -> Result<PathBuf> {
    let scheme = name.split_once(':').is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && (scheme.chars()).all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    });
    if scheme {
        return Err(fault(
            place,
            format!("`{name}`: only relative files and data URIs are read"),
        ));
    }
    let outside = || {
        let what = "leaves the scene's folder: only files in it and below are read";
        fault(place, format!("`{name}` {what}"))
    };
    let mut path = PathBuf::new();
    for part in name.split(['/', '\\']) {
        match part {
            "" | "." => {}
            ".." if path.pop() => {}
            ".." => return Err(outside()),
            part => path.push(part),
        }
    }
    if name.starts_with(['/', '\\']) {
        return Err(outside());
    }
    if path.as_os_str().is_empty() || name.contains('\0') {
        return Err(fault(place, format!("`{name}` names no file")));
    }
    Ok(path)
}

fn percent_decoded(uri: &str, place: &str) -> Result<String> {
    // A bare `%` means that the exporter did not encode the name.
    let Ok(bytes) = percent_bytes(uri, place) else {
        return Ok(uri.to_owned());
    };
    String::from_utf8(bytes).map_err(|_| fault(place, format!("`{uri}` is not UTF-8")))
}

fn percent_bytes(text: &str, place: &str) -> Result<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        rest = after;
        if first != b'%' {
            out.push(first);
            continue;
        }
        let digit = |i: usize| rest.get(i).and_then(|&b| char::from(b).to_digit(16));
        let (Some(high), Some(low)) = (digit(0), digit(1)) else {
            return Err(fault(
                place,
                "a `%` without two hexadecimal digits in the URI",
            ));
        };
        out.push((16 * high + low) as u8);
        rest = &rest[2..];
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uri_paths_stay_in_the_folder() {
        let path = |uri: &str| {
            let name = percent_decoded(uri, "p").ok()?;
            inside(&name, "p").ok()?.to_str().map(str::to_owned)
        };
        assert_eq!(path("a%20b/c%C3%A9.bin").as_deref(), Some("a b/cé.bin"));
        assert_eq!(path("./a/../b.png").as_deref(), Some("b.png"));
        assert_eq!(path("10%.png").as_deref(), Some("10%.png"));
        assert_eq!(path("a%20b/10%.png").as_deref(), Some("a%20b/10%.png"));
        for bad in [
            "../10%.png",
            "../a",
            "a/../../b",
            "/etc/passwd",
            "file:///a",
            "http://a/b",
            "%2e%2e/a",
            "%ff",
            "",
            ".",
        ] {
            assert_eq!(path(bad), None, "{bad}");
        }
    }

    #[test]
    fn data_uris_are_decoded() {
        let read = |uri: &str| data(uri, "p").ok();
        assert_eq!(read(";base64,AQID"), Some(vec![1, 2, 3]));
        assert_eq!(
            read("application/octet-stream;base64,AQI="),
            Some(vec![1, 2])
        );
        assert_eq!(read(";base64,AQI"), Some(vec![1, 2]));
        assert_eq!(read("text/plain,a%20b"), Some(b"a b".to_vec()));
        assert_eq!(read(";base64,A*"), None);
        assert_eq!(read(";base64"), None);
    }
}
