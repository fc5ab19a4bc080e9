//! Finds out if a file has a light of its own. Most models have none: viewers add one.

use crate::math::luminance;
use crate::scene::{Mesh, SceneParts};

/// Mean radiance of all surfaces below which emission is decoration. A lamp of 15 units in a box has 0.3 of it, the rear lamps
/// of a car 0.001.
const LAMP: f64 = 0.01;

/// True for lamps without area, or surfaces that are lamps: without an emissive texture, as screens and dials have, and bright
/// enough to light the rest. Unlit materials are pictures, not lamps.
pub(super) fn is_lit(parts: &SceneParts) -> bool {
    if !parts.lights.is_empty() {
        return true;
    }
    let radiance: Vec<f64> = (parts.materials.iter())
        .map(|m| match m.emissive_texture {
            None if !m.is_unlit() => luminance(m.emission).into(),
            _ => 0.0,
        })
        .collect();
    if radiance.iter().all(|r| *r == 0.0) {
        return false;
    }
    let mut sums = [0.0; 2];
    let mut add = |mesh: &Mesh, copies: usize| {
        let area = area(mesh) * copies as f64;
        sums[0] += area;
        sums[1] += area * radiance.get(mesh.material as usize).unwrap_or(&0.0);
    };
    parts.meshes.iter().for_each(|mesh| add(mesh, 1));
    // Sizes of instances are of no matter where most of the area is a guess anyway.
    let shared = parts.shared.iter();
    shared.for_each(|shared| add(&shared.mesh, shared.poses.len()));
    sums[1] > LAMP * sums[0]
}

fn area(mesh: &Mesh) -> f64 {
    let area = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|i| mesh.positions[i as usize].as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    };
    mesh.indices.iter().map(area).sum()
}
