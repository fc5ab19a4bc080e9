//! The scenes of `training_scenes/`, as code: `opsr scenes write` turns them into files.
//!
//! What they must do together: visit nearly all classes of path roughness whose last vertex can be roughened, hold
//! sharp caustics of every kind (a blunt one forgives any roughening), and stay below a relative noise of about 0.3
//! in a pixel of 1024 samples, because a noisy L1 loss prefers to lose energy.

mod boxes;
mod glass;
mod glossy;
mod rooms;
mod validation;
mod water;

use crate::files;
use crate::gallery::glb::{SaveError, save};
use crate::gallery::manifest::Role;
use crate::scene::SceneParts;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// One scene of the set and where it is looked at.
pub struct Example {
    /// Name; the file is `name.glb`.
    pub name: &'static str,
    /// What it is for.
    pub role: Role,
    /// Scenes of one kind, held out together.
    pub family: &'static str,
    /// Size of the whole picture, in pixels.
    pub frame: [u32; 2],
    /// Upper left corners of the crops.
    pub crops: &'static [[u32; 2]],
    /// Longest path, in scattering vertices.
    pub max_vertices: u32,
    /// Radiance times this has a mean of about 0.5 over the crops.
    pub exposure: f32,
    /// Why it is there.
    pub note: &'static str,
    /// Makes the scene.
    pub build: fn() -> SceneParts,
}

/// All scenes, training ones first.
pub const EXAMPLES: &[Example] = &[
    Example {
        name: "cornell_caustics",
        role: Role::Train,
        family: "box",
        frame: [160, 160],
        crops: &[[26, 76], [94, 92], [62, 48]],
        max_vertices: 12,
        exposure: 2.9,
        note: "Cornell box: glass ball, copper ring and prism, all polished; sharp caustics from diffuse walls",
        build: boxes::cornell_caustics,
    },
    Example {
        name: "cornell_glossy",
        role: Role::Train,
        family: "box",
        frame: [160, 160],
        crops: &[[26, 76], [94, 92], [62, 48]],
        max_vertices: 12,
        exposure: 2.8,
        note: "the same box with metals of roughness 0.05 and 0.15 and a brushed block",
        build: boxes::cornell_glossy,
    },
    Example {
        name: "glass_in_glass",
        role: Role::Train,
        family: "glass",
        frame: [160, 160],
        crops: &[[8, 96], [66, 96], [34, 86], [126, 78]],
        max_vertices: 14,
        exposure: 4.4,
        note: "a ball in a hollow ball, a decanter, frosted balls: caustics through up to six interfaces",
        build: glass::glass_in_glass,
    },
    Example {
        name: "bulb_lamp",
        role: Role::Train,
        family: "lamp",
        frame: [160, 160],
        crops: &[[62, 124], [116, 102]],
        max_vertices: 14,
        exposure: 4.1,
        note: "all light comes through the glass of a bulb; no surface sees the lamp directly",
        build: glass::bulb_lamp,
    },
    Example {
        name: "rings",
        role: Role::Train,
        family: "rings",
        frame: [160, 160],
        crops: &[[2, 96], [112, 72], [64, 52]],
        max_vertices: 12,
        exposure: 2.4,
        note: "rings of six roughnesses before a mirror: their caustics seen directly and reflected",
        build: glossy::rings,
    },
    Example {
        name: "glossy_corridor",
        role: Role::Train,
        family: "glossy",
        frame: [160, 160],
        crops: &[[16, 48], [64, 62]],
        max_vertices: 14,
        exposure: 1.6,
        note: "long chains between glossy metals of roughness 0.03 to 0.35",
        build: glossy::corridor,
    },
    Example {
        name: "basins",
        role: Role::Train,
        family: "water",
        frame: [160, 160],
        crops: &[[24, 66], [88, 62]],
        max_vertices: 12,
        exposure: 2.7,
        note: "shallow and deep water: the floor's caustics seen through the surface that makes them",
        build: water::basins,
    },
    Example {
        name: "many_roughnesses",
        role: Role::Train,
        family: "room",
        frame: [96, 96],
        crops: &[[4, 8], [60, 8], [32, 32], [4, 60], [60, 60]],
        max_vertices: 10,
        exposure: 1.9,
        note: "a room tiled with every roughness, so that chains of all levels are visited",
        build: rooms::many_roughnesses,
    },
    Example {
        name: "frosted_panes",
        role: Role::Train,
        family: "room",
        frame: [96, 96],
        crops: &[[8, 30], [56, 30], [32, 60]],
        max_vertices: 12,
        exposure: 1.4,
        note: "panes and balls of glass from clear to frosted in a tiled room: transmitted chains of all levels",
        build: rooms::frosted_panes,
    },
    Example {
        name: "swimming_pool",
        role: Role::Validation,
        family: "water",
        frame: [160, 160],
        crops: &[[32, 76], [80, 56]],
        max_vertices: 12,
        exposure: 2.4,
        note: "a hall with one long pool, chrome rails and a skylight",
        build: validation::swimming_pool,
    },
    Example {
        name: "figurines",
        role: Role::Validation,
        family: "glass",
        frame: [160, 160],
        crops: &[[36, 92], [92, 88]],
        max_vertices: 14,
        exposure: 2.3,
        note: "turned glass figures on a glossy floor before a curved backdrop",
        build: validation::figurines,
    },
    Example {
        name: "disco",
        role: Role::Validation,
        family: "glossy",
        frame: [160, 160],
        crops: &[[70, 16], [52, 92]],
        max_vertices: 12,
        exposure: 4.4,
        note: "blobs of coloured metal and a faceted ball over a lacquered floor, coloured lights",
        build: validation::disco,
    },
];

/// The text of `manifest.toml`.
pub fn manifest() -> String {
    let mut text =
        String::from("# Written by `opsr scenes write`; the fields are explained in README.md.\n");
    for e in EXAMPLES {
        let crops: Vec<String> = (e.crops.iter())
            .map(|[x, y]| format!("[{x}, {y}]"))
            .collect();
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "\n[[scene]]\nname = \"{0}\"\nfile = \"{0}.glb\"\nrole = \"{1}\"\nfamily = \"{2}\"\ncamera = 0\n\
             frame = [{3}, {4}]\ncrops = [{5}]\nmax_vertices = {6}\nexposure = {7:?}\nnote = \"{8}\"\n",
            e.name,
            e.role.name(),
            e.family,
            e.frame[0],
            e.frame[1],
            crops.join(", "),
            e.max_vertices,
            e.exposure,
            e.note,
        );
    }
    text
}

/// Writes all scenes and their manifest into a folder, which is made if it is not there; returns the files.
pub fn write(folder: &Path) -> Result<Vec<PathBuf>, SaveError> {
    files::create_folder(folder)?;
    let mut files = Vec::new();
    for example in EXAMPLES {
        let path = folder.join(format!("{}.glb", example.name));
        save(&(example.build)(), &path)?;
        files.push(path);
    }
    let path = folder.join("manifest.toml");
    files::write_bytes(&path, manifest())?;
    files.push(path);
    Ok(files)
}
