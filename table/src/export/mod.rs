//! Export of tables as source code for other renderers.
//!
//! The code of a table has the whole look-up, from the roughness of a path to α′. The header of [`Format::Resolve`] has
//! the choice among levels of roughening.

mod code;

use crate::TableFile;
use std::path::Path;

/// Format of an exported table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Header for C99 and C++.
    C,
    /// Include file for GLSL, HLSL and Slang.
    Shader,
    /// Rust module that depends on `core` only.
    Rust,
    /// Header for C99 and C++ of the choice among levels, the same for every table.
    Resolve,
}

impl Format {
    /// Format by the file name extension; `None` if it is unknown.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match extension.as_str() {
            "h" | "hh" | "hpp" | "hxx" | "c" => Self::C,
            "glsl" | "hlsl" | "slang" | "glsli" | "hlsli" | "slangh" => Self::Shader,
            "rs" => Self::Rust,
            _ => return None,
        })
    }
}

/// Bytes of the table as a file of this format.
pub fn export(file: &TableFile, format: Format) -> Vec<u8> {
    match format {
        Format::C => code::fill(include_str!("table.h.in"), file, "f").into_bytes(),
        Format::Shader => code::fill(include_str!("table.glsl.in"), file, "f").into_bytes(),
        Format::Resolve => include_bytes!("resolve.h").to_vec(),
        Format::Rust => code::fill(include_str!("table.rs.in"), file, "").into_bytes(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn format_by_file_name_extension() {
        for (names, format) in [
            ("t.h T.H t.hh t.hpp t.hxx t.c", Some(Format::C)),
            (
                "t.glsl t.hlsl t.slang t.glsli t.hlsli t.slangh",
                Some(Format::Shader),
            ),
            ("t.rs", Some(Format::Rust)),
            ("t t.json .rs t.rs.gz t.npy", None),
        ] {
            for name in names.split(' ') {
                assert_eq!(Format::of(Path::new(name)), format, "{name}");
            }
        }
    }
}
