//! Light paths and connections: densities of the ends, agreement with the path tracer.

mod agreement;
mod determinism;
mod metropolis;
mod photons;
mod psr;
mod scenes;
mod slopes;

use opsr::scene::SceneParts;
use opsr_lab::gallery::{caustic_box, cornell_box, materials, shapes};

/// The boxes of the gallery and every scene of this folder, with the samples per pixel of its comparison.
fn all_scenes() -> Vec<(&'static str, SceneParts, u32)> {
    let mut all = vec![
        ("cornell box", cornell_box(), 64),
        ("caustic box", caustic_box(), 256),
    ];
    all.extend(scenes::all());
    all
}
