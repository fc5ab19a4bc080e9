//! A path tracer of one's own with a learned table: the two calls that regularise it, in the loop over a path's vertices.
//!
//! ```sh
//! cargo run --release --example look_up
//! ```
//!
//! Such a program needs the crate `opsr-table` alone.

use opsr_table::{AttenuationTable, PathRoughness, TableError, TableFile};

/// What a host knows at a vertex.
struct Vertex {
    surface: &'static str,
    /// Beckmann roughness of the lobe in [0, 1]: 0 is a Dirac lobe, 1 is Lambert.
    alpha: f32,
}

/// Roughness at which light is sampled at each vertex of a path, camera first.
fn regularised(path: &[Vertex], table: &AttenuationTable) -> Vec<f32> {
    let mut roughness = PathRoughness::default();
    let mut all = Vec::new();
    for vertex in path {
        // First call, at next-event estimation: evaluate the lobe at this roughness in place of its own.
        all.push(roughness.accumulate(vertex.alpha, table, 1.0));
        // Second call, after the path's next direction is drawn, from the lobe at its own roughness.
        roughness.push(vertex.alpha, table, 1.0);
    }
    all
}

pub(crate) fn main() -> Result<(), TableError> {
    let table = TableFile::load("beta-0.001".as_ref())?.table;
    let vertex = |surface, alpha| Vertex { surface, alpha };
    let path = [
        vertex("floor", 1.0),
        vertex("brushed metal", 0.2),
        vertex("glass", 0.0),
        vertex("mirror", 0.0),
    ];
    let all = regularised(&path, &table);
    for (vertex, alpha_reg) in path.iter().zip(&all) {
        println!(
            "{:14} {:.2} becomes {alpha_reg:.4}",
            vertex.surface, vertex.alpha
        );
    }
    // A floor cannot be rougher, and smooth glass after it is no longer a Dirac lobe.
    assert!(all[0] == 1.0 && all[1] > 0.2 && all[2] > 0.0);
    Ok(())
}
