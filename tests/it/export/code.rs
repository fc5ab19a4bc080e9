//! The exported code, compiled and run on random paths.

use super::{succeeded, table, tool};
use opsr::regularise::export::{Format, export};
use opsr::regularise::{AttenuationTable, BIN_EDGES, Lookup, PathRoughness, bin_coordinate};
use rand::{Rng, RngExt, SeedableRng};
use std::fs::File;
use std::process::{Command, Stdio};

/// Scale of the surplus of roughness, and roughness of the vertices.
type TestPath = (f32, Vec<f32>);

/// Paths of 1 to 8 vertices; many roughness values are 0, 1, on the edge of a bin or one ulp below it.
fn paths(count: usize) -> Vec<TestPath> {
    let mut random = rand_pcg::Pcg64Mcg::seed_from_u64(5);
    let alpha = |random: &mut dyn Rng| match random.random_range(0..8) {
        0 => 0.0,
        1 => 1.0,
        2 => BIN_EDGES[random.random_range(0..3)],
        3 => BIN_EDGES[random.random_range(0..3)].next_down(),
        4 => random.random::<f32>().powi(20),
        _ => random.random::<f32>(),
    };
    (0..count)
        .map(|i| {
            let length = random.random_range(1..=8);
            let shrink = if i % 2 == 0 { 1.0 } else { random.random() };
            (shrink, (0..length).map(|_| alpha(&mut random)).collect())
        })
        .collect()
}

/// α′ at every vertex, computed by the library.
fn expected(table: &AttenuationTable, paths: &[TestPath]) -> Vec<f32> {
    let mut out = Vec::new();
    for (shrink, alphas) in paths {
        let mut prefix = PathRoughness::default();
        for &alpha in alphas {
            out.push(prefix.accumulate(alpha, table, *shrink));
            prefix.push(alpha, table, *shrink);
        }
    }
    out
}

/// Encodes each path in 32-bit words: number of vertices, `shrink`, roughness of the vertices.
fn encode(paths: &[TestPath]) -> Vec<u8> {
    let mut out = Vec::new();
    for (shrink, alphas) in paths {
        out.extend((alphas.len() as u32).to_ne_bytes());
        out.extend(shrink.to_ne_bytes());
        alphas.iter().for_each(|a| out.extend(a.to_ne_bytes()));
    }
    out
}

const C_DRIVER: &str = r#"
#include "table.h"
#include <stdio.h>
int main(void)
{
    unsigned length;
    while (fread(&length, 4, 1, stdin) == 1) {
        float in[16], out[16];
        unsigned i;
        opsr_path path;
        if (fread(in, 4, length + 1, stdin) != length + 1) return 1;
        path = opsr_begin(in[0]);
        for (i = 0; i < length; ++i) {
            out[i] = opsr_roughen(&path, in[i + 1]);
            opsr_scatter(&path, in[i + 1]);
        }
        fwrite(out, 4, length, stdout);
    }
    return 0;
}
"#;

/// The HLSL dialect of the include file, compiled as C++ with the missing functions.
const SHADER_DRIVER: &str = r#"
#include <algorithm>
#include <cmath>
#include <cstdio>
typedef unsigned uint;
using std::exp2;
using std::min;
using std::sqrt;
static inline float clamp(float x, float low, float high) { return min(std::max(x, low), high); }
#define OPSR_HLSL
#include "table.glsl"
int main()
{
    uint length;
    while (std::fread(&length, 4, 1, stdin) == 1) {
        float in[16], out[16];
        if (std::fread(in, 4, length + 1, stdin) != length + 1) return 1;
        OpsrPath path = opsr_begin(in[0]);
        for (uint i = 0; i < length; ++i) {
            out[i] = opsr_roughen(path, in[i + 1]);
            path = opsr_scatter(path, in[i + 1]);
        }
        std::fwrite(out, 4, length, stdout);
    }
    return 0;
}
"#;

const RUST_DRIVER: &str = r#"
mod table;
use std::io::{Read, Write};
fn main() {
    let (mut input, mut out) = (Vec::new(), Vec::new());
    std::io::stdin().read_to_end(&mut input).unwrap();
    let mut words = input.chunks_exact(4).map(|w| u32::from_ne_bytes([w[0], w[1], w[2], w[3]]));
    while let Some(length) = words.next() {
        let mut path = table::Path::new(f32::from_bits(words.next().unwrap()));
        for alpha in words.by_ref().take(length as usize).map(f32::from_bits) {
            out.extend(path.roughen(alpha).to_ne_bytes());
            path.scatter(alpha);
        }
    }
    std::io::stdout().write_all(&out).unwrap();
}
"#;

/// Compiles `driver` with the exported `include`, runs it on random paths, and compares α′ with the library.
fn compiled_agrees(
    format: Format,
    include: &str,
    driver: (&str, &str),
    compiler: &str,
    flags: &[&str],
) {
    let paths = paths(100_000);
    // The nearest look-up uses only the four basic operations, so it is bit-identical. Roots and powers of two differ
    // in some bits between mathematics libraries, and so does α′. After a fold α′ is an argument of the root, which
    // near 0 turns an error of 1e-7 into 3e-4 of the bin coordinate.
    for (lookup, scale, tolerances) in [
        (Lookup::Nearest, 1.0, [0.0, 0.0]),
        (Lookup::Nearest, 1.25, [0.0, 0.0]),
        (Lookup::Linear, 1.25, [4e-6, 5e-4]),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let file = table(lookup, scale);
        std::fs::write(at(include), export(&file, format)).unwrap();
        std::fs::write(at(driver.0), driver.1).unwrap();
        let mut arguments = flags.to_vec();
        arguments.extend(["-o", "program", driver.0]);
        if compiler != "rustc" {
            arguments.push("-lm");
        }
        let Some(output) = tool(folder.path(), compiler, &arguments) else {
            return;
        };
        succeeded(compiler, &output);

        std::fs::write(at("paths"), encode(&paths)).unwrap();
        let run = Command::new(at("program"))
            .stdin(Stdio::from(File::open(at("paths")).unwrap()))
            .output()
            .unwrap();
        succeeded("the compiled program", &run);
        let found = run.stdout.chunks_exact(4).map(|w| w.try_into().unwrap());
        let found: Vec<f32> = found.map(f32::from_ne_bytes).collect();
        let expected = expected(&file.table, &paths);
        assert_eq!(found.len(), expected.len());
        let (mut all, mut worst) = (found.iter().zip(&expected), [0.0f32; 2]);
        for (_, alphas) in &paths {
            for (i, (found, expected)) in all.by_ref().take(alphas.len()).enumerate() {
                let worst = &mut worst[usize::from(i >= 5)];
                *worst = worst.max((found - expected).abs());
            }
        }
        eprintln!("{include}, {compiler}, {lookup:?}: largest differences {worst:?}");
        for (worst, tolerance) in worst.iter().zip(tolerances) {
            assert!(*worst <= tolerance, "{lookup:?}: {worst:e} > {tolerance:e}");
        }
    }
}

/// Compiles the header in a dialect of C without warnings, and compares α′.
fn header_agrees(dialect: &str, source: &str, compiler: &str) {
    let flags = [
        dialect,
        "-O1",
        "-Wall",
        "-Wextra",
        "-pedantic",
        "-Werror",
        "-ffp-contract=off",
    ];
    compiled_agrees(Format::C, "table.h", (source, C_DRIVER), compiler, &flags);
}

#[test]
fn c_header_matches_the_library() {
    header_agrees("-std=c99", "main.c", "cc");
}

#[test]
fn c_header_matches_the_library_as_cpp() {
    header_agrees("-std=c++11", "main.cpp", "c++");
}

#[test]
fn rust_module_matches_the_library() {
    let flags = ["--edition", "2021", "-O", "-Dwarnings"];
    let driver = ("main.rs", RUST_DRIVER);
    compiled_agrees(Format::Rust, "table.rs", driver, "rustc", &flags);
}

#[test]
fn rust_module_is_no_std() {
    for lookup in [Lookup::Nearest, Lookup::Linear] {
        let folder = tempfile::tempdir().unwrap();
        let library = "#![no_std]\n#![deny(missing_docs)]\n//! A crate.\npub mod table;\n";
        std::fs::write(folder.path().join("lib.rs"), library).unwrap();
        let code = export(&table(lookup, 1.0), Format::Rust);
        std::fs::write(folder.path().join("table.rs"), code).unwrap();
        let arguments = [
            "--crate-type",
            "lib",
            "--edition",
            "2024",
            "-Dwarnings",
            "lib.rs",
        ];
        let Some(output) = tool(folder.path(), "rustc", &arguments) else {
            return;
        };
        succeeded("rustc", &output);
    }
}

#[test]
fn shader_include_matches_the_library() {
    let flags = [
        "-std=c++11",
        "-O1",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-ffp-contract=off",
    ];
    let driver = ("main.cpp", SHADER_DRIVER);
    compiled_agrees(Format::Shader, "table.glsl", driver, "c++", &flags);
}

#[test]
fn shader_include_is_valid_glsl() {
    for lookup in [Lookup::Nearest, Lookup::Linear] {
        let folder = tempfile::tempdir().unwrap();
        let include = String::from_utf8(export(&table(lookup, 1.0), Format::Shader)).unwrap();
        let shader = format!(
            "#version 450\nlayout(local_size_x = 64) in;\n\
             layout(std430, set = 0, binding = 0) buffer Data {{ float data[]; }};\n{include}\n\
             void main() {{\n    OpsrPath path = opsr_begin(1.0);\n    \
             for (uint i = 0u; i < 8u; ++i) {{\n        \
             float alpha = data[8u * gl_GlobalInvocationID.x + i];\n        \
             data[8u * gl_GlobalInvocationID.x + i] = opsr_roughen(path, alpha);\n        \
             path = opsr_scatter(path, alpha);\n    }}\n}}\n"
        );
        std::fs::write(folder.path().join("table.comp"), shader).unwrap();
        let Some(output) = tool(
            folder.path(),
            "naga",
            &[
                "--input-kind",
                "glsl",
                "--shader-stage",
                "compute",
                "table.comp",
            ],
        ) else {
            return;
        };
        succeeded("naga", &output);
    }
}

#[test]
fn shader_include_is_valid_slang_and_hlsl() {
    for lookup in [Lookup::Nearest, Lookup::Linear] {
        let folder = tempfile::tempdir().unwrap();
        let include = String::from_utf8(export(&table(lookup, 1.0), Format::Shader)).unwrap();
        let shader = format!(
            "{include}\nRWStructuredBuffer<float> data;\n\
             [shader(\"compute\")] [numthreads(64, 1, 1)]\n\
             void run(uint3 id : SV_DispatchThreadID) {{\n    OpsrPath path = opsr_begin(1.0);\n    \
             for (uint i = 0u; i < 8u; ++i) {{\n        float alpha = data[8u * id.x + i];\n        \
             data[8u * id.x + i] = opsr_roughen(path, alpha);\n        \
             path = opsr_scatter(path, alpha);\n    }}\n}}\n"
        );
        for name in ["table.slang", "table.hlsl"] {
            std::fs::write(folder.path().join(name), &shader).unwrap();
            let wanted = "-target hlsl -entry run -stage compute -o out.hlsl";
            let arguments: Vec<&str> = [name].into_iter().chain(wanted.split(' ')).collect();
            let Some(output) = tool(folder.path(), "slangc", &arguments) else {
                return;
            };
            succeeded("slangc", &output);
        }
    }
}

#[test]
fn bin_and_bin_coordinate_share_their_edges() {
    // The exported code relies on a coordinate of exactly 3 at the last edge and at most 3 below.
    assert_eq!(bin_coordinate(BIN_EDGES[2]), 3.0);
    assert!(bin_coordinate(BIN_EDGES[2].next_down()) <= 3.0);
}
