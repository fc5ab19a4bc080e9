//! The look-up in the loop of a host: what a path tracer adds, on a path of a floor, a rough metal and smooth glass.

use opsr_table::{PathRoughness, TableError, TableFile};

fn main() -> Result<(), TableError> {
    let table = TableFile::load("beta-0.001".as_ref())?.table;
    let mut path = PathRoughness::default();
    for (surface, alpha) in [("floor", 1.0), ("metal", 0.2), ("glass", 0.0)] {
        // Where light is sampled: the lobe is evaluated at this roughness, and the path goes on with its own.
        let alpha_reg = path.accumulate(alpha, &table, 1.0);
        println!("{surface}: {alpha} becomes {alpha_reg:.4}");
        path.push(alpha, &table, 1.0);
    }
    Ok(())
}
