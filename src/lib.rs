//! **opsr**: optimised path space regularisation.
//!
//! A path tracer that roughens the last surface of a path at next-event estimation, by an amount that depends
//! on the roughness of the path so far, and a trainer that learns how much. A small, known bias buys a large
//! drop in noise: caustics, glossy chains, light seen through glass.
//!
//! ```
//! let scene = opsr::Scene::open("training_scenes/cornell_caustics.glb")?;
//! let picture = opsr::Render::new(&scene).size(64, 64).spp(16).table("beta-0.001")?.run()?;
//! # let folder = tempfile::tempdir()?;
//! # std::env::set_current_dir(&folder)?;
//! picture.save("out.exr")?;
//! # assert!(folder.path().join("out.exr").exists());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! `examples/` has more of them.
//!
//! # The map
//!
//! This crate is the library. A module uses only its own layer and those above it (`tests/it/architecture.rs`).
//!
//! | layer | module | contents |
//! |---|---|---|
//! | 0 | [`math`] | frames, measures, warps, discrete distributions, running moments |
//! | 0 | [`sampler`] | the random numbers of a path, keyed by (seed, pixel, sample) |
//! | 0 | [`files`] | bounded reads, writes that are whole or not made, sealed files, locks, hashes in hex |
//! | 0 | [`memory`] | free memory, refusal of work that needs more |
//! | 1 | [`regularise`] | the paper: path roughness, classes, attenuation tables, look-ups, comparison rules |
//! | 2 | [`bsdf`] | BSDFs that are evaluated *at* a roughness |
//! | 3 | [`image`] | films of running moments, EXR and PNG, relative errors |
//! | 3 | [`scene`] | glTF files, meshes, the tree, materials, lights, cameras |
//! | 4 | [`integrator`] | estimators and the steps they share; budgets, checkpoints, parts |
//! | 5 | [`resolve`] | the level and blur of every pixel, chosen without a reference, and its error |
//! | 5 | [`pilot`] | the integrator of a scene, chosen by small renders |
//! | 6 | [`render`] | options, checked against a scene; the run; the finished picture and its files |
//! | 7 | [`Render`] | a render from another program, in a few lines |
//!
//! Other crates of the workspace:
//!
//! | crate | contents |
//! |---|---|
//! | `opsr-table` (`table/`) | below this crate: tables, look-ups, export, for renderers that need nothing else |
//! | `opsr-formats` | readers of pbrt, Mitsuba, OBJ and PLY files, decoders of compressed glTF |
//! | `opsr-metric` | errors of pictures against references: relMSE, MAPE, FLIP; false colours |
//! | `opsr-train` | learning of tables: record, evaluate, learn; the manifest of training scenes and its references |
//! | `opsr-frames` | frames of an animation, averaged along the surfaces that they share |
//! | `opsr-lab` | scenes of this project, statistics, comparisons, benches and their pages, numerical checks |
//! | `opsr-view` | the viewer in the browser |
//! | `opsr-cli` | the program `opsr` |
//! | `opsr-python` (`python/`) | the Python package |
//!
//! # Notation
//!
//! | paper | code | remark |
//! |---|---|---|
//! | x₀ … x_k | `n = k − 1` scattering vertices | the code counts vertices |
//! | ᾱ, αᵢ | `PathRoughness`, `alpha` | Beckmann roughness in [0, 1]; 0 is Dirac, 1 is diffuse |
//! | α′ | `alpha_reg` | never stored in a material |
//! | γ, γ(ᾱ) | `gamma`, `AttenuationTable` | |
//! | β | `beta` | weight of the variance in the loss; path throughput is `throughput` |
//!
//! Directions leave the surface: `wo` towards the previous vertex, `wi` towards the next. Densities carry their
//! measure: `pdf_w` per steradian, `pdf_a` per area, `pmf` discrete.
//!
//! # Sources
//!
//! - `[OPSR]` Weier, Droske, Hanika, Weidlich, Vorba: *Optimised Path Space Regularisation*, EGSR 2021.
//! - `[PSR]` Kaplanyan, Dachsbacher: *Path Space Regularization for Holistic and Robust Light Transport*, EG 2013.
//! - `[Walter07]` Walter, Marschner, Li, Torrance: *Microfacet Models for Refraction through Rough Surfaces*, EGSR 2007.
//! - `[HeitzDEon14]` Heitz, d'Eon: *Importance Sampling Microfacet-Based BSDFs using the Distribution of Visible Normals*, EGSR 2014.
//! - `[Heitz14]` Heitz: *Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs*, JCGT 2014.
//! - `[Veach97]` Veach: *Robust Monte Carlo Methods for Light Transport Simulation*, 1997.
//! - `[VCM-TR]` Georgiev: *Implementing Vertex Connection and Merging*, technical report, Saarland University, 2012.
//! - `[UPS]` Hachisuka, Pantaleoni, Jensen: *A Path Space Extension for Robust Light Transport Simulation*, SIGGRAPH Asia 2012.
//! - `[Kelemen02]` Kelemen, Szirmay-Kalos, Antal, Csonka: *A Simple and Robust Mutation Strategy for the Metropolis Light Transport Algorithm*, EG 2002.
//! - `[Hoberock10]` Hoberock, Hart: *Arbitrary Importance Functions for Metropolis Light Transport*, CGF 29(6), 2010.
//! - `[Müller17]` Müller, Gross, Novák: *Practical Path Guiding for Efficient Light-Transport Simulation*, EGSR 2017.
//! - `[Müller19]` Müller: *"Practical Path Guiding" in Production*, in: Path Guiding in Production, SIGGRAPH 2019 courses.
//! - `[Hanika21]` Hanika: *Hacking the Shadow Terminator*, in: Ray Tracing Gems II, 2021.
//! - `[SMS]` Zeltner, Georgiev, Jakob: *Specular Manifold Sampling for Rendering High-Frequency Caustics and Glints*, SIGGRAPH 2020.
//! - `[Duff17]` Duff et al.: *Building an Orthonormal Basis, Revisited*, JCGT 2017.
//! - `[Woop13]` Woop, Benthin, Wald: *Watertight Ray/Triangle Intersection*, JCGT 2013.
//! - `[Ylitie17]` Ylitie, Karras, Laine: *Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs*, HPG 2017.
//! - `[PBRT4]` Pharr, Jakob, Humphreys: *Physically Based Rendering*, 4th edition, 2023.
//! - `[ContyKulla18]` Conty Estevez, Kulla: *Importance Sampling of Many Lights with Adaptive Tree Splitting*, HPG 2018.
//! - `[Burley20]` Burley: *Practical Hash-Based Owen Scrambling*, JCGT 2020.
//! - `[FLIP20]` Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild: *FLIP: A Difference Evaluator for Alternating Images*, HPG 2020.
//! - `[FLIP21]` Andersson, Nilsson, Shirley, Akenine-Möller: *Visualizing Errors in Rendered High Dynamic Range Images*, EG 2021 short papers.
//! - `[Hesterberg15]` Hesterberg: *What Teachers Should Know About the Bootstrap*, The American Statistician 69(4), 2015.
//! - `[OkabeIto08]` Okabe, Ito: *Color Universal Design: How to Make Figures and Presentations That Are Friendly to Colorblind People*, 2008.
//! - `[glTF]` Khronos: *glTF 2.0 Specification* and its ratified material extensions.

// Integration tests and unit tests share scenes, which name the crate `opsr`.
#[cfg(test)]
extern crate self as opsr;

pub mod bsdf;
mod facade;
pub mod files;
pub mod image;
pub mod integrator;
pub mod math;
pub mod memory;
pub mod pilot;
pub mod regularise;
pub mod render;
pub mod resolve;
pub mod sampler;
pub mod scene;
#[cfg(test)]
#[path = "../tests/unit/mod.rs"]
mod unit;

pub use facade::Render;
pub use integrator::layers::Aov;
pub use regularise::AttenuationTable;
pub use render::{Fault, Finished};
pub use scene::Scene;
