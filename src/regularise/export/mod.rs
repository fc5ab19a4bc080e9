//! Tables for other programs: arrays for numerical tools, and source code that a renderer can include.
//!
//! Source code carries the whole look-up, from a path's roughness to α′, so that nothing of the method has to be
//! written again. Data formats hold the factors with the table's scale applied, since not all of them have a place to
//! say it.

mod code;
mod data;

use super::file::TableFile;
use std::path::Path;

/// What a table can be written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// NumPy's array file: f32 `[1360]`.
    Npy,
    /// One tensor `gammas`, f32 `[1360]`, with metadata.
    Safetensors,
    /// A line for each class.
    Csv,
    /// A header for C99 and C++.
    C,
    /// An include for GLSL, HLSL and Slang.
    Shader,
    /// A module without dependencies.
    Rust,
}

impl Format {
    /// The format that the ending of a file's name stands for.
    pub fn of(path: &Path) -> Option<Self> {
        let extension = path.extension()?.to_str()?.to_ascii_lowercase();
        Some(match extension.as_str() {
            "npy" => Self::Npy,
            "safetensors" => Self::Safetensors,
            "csv" => Self::Csv,
            "h" | "hh" | "hpp" | "hxx" | "c" => Self::C,
            "glsl" | "hlsl" | "slang" | "glsli" | "hlsli" | "slangh" => Self::Shader,
            "rs" => Self::Rust,
            _ => return None,
        })
    }
}

/// The table as a file of this format.
pub fn export(file: &TableFile, format: Format) -> Vec<u8> {
    match format {
        Format::Npy => data::npy(file),
        Format::Safetensors => data::safetensors(file),
        Format::Csv => data::csv(file).into_bytes(),
        Format::C => code::fill(include_str!("table.h.in"), file, "f").into_bytes(),
        Format::Shader => code::fill(include_str!("table.glsl.in"), file, "f").into_bytes(),
        Format::Rust => code::fill(include_str!("table.rs.in"), file, "").into_bytes(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stand_for_formats() {
        for (names, format) in [
            ("t.npy T.NPY", Some(Format::Npy)),
            ("t.safetensors", Some(Format::Safetensors)),
            ("t.csv", Some(Format::Csv)),
            ("t.h t.hh t.hpp t.hxx t.c", Some(Format::C)),
            (
                "t.glsl t.hlsl t.slang t.glsli t.hlsli t.slangh",
                Some(Format::Shader),
            ),
            ("t.rs", Some(Format::Rust)),
            ("t t.json .rs t.npy.gz", None),
        ] {
            for name in names.split(' ') {
                assert_eq!(Format::of(Path::new(name)), format, "{name}");
            }
        }
    }
}
