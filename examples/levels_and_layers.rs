//! A render with levels, which chooses the amount of roughening for every pixel without a reference, and layers beside it.
//!
//! ```sh
//! cargo run --release --example levels_and_layers -- scene.glb out.exr
//! ```

use opsr::{Aov, Render, Scene};
use std::error::Error;

/// Renders a scene into an EXR file with the layers albedo, normal, depth, level and error; returns the share of pixels that
/// got each level.
pub(crate) fn render(scene: &str, output: &str, spp: u32) -> Result<Vec<f64>, Box<dyn Error>> {
    let scene = Scene::open(scene)?;
    let picture = Render::new(&scene)
        .size(160, 120)
        .spp(spp)
        .table("beta-0.001")?
        .aovs(&[Aov::Albedo, Aov::Normal, Aov::Depth])
        .run()?;
    picture.save(output)?;
    let choice = picture
        .shown
        .resolved
        .ok_or("a scene without lobes has one level")?;
    let mut shares = vec![0.0; 5];
    for &level in &choice.level {
        shares[usize::from(level)] += 1.0 / choice.level.len() as f64;
    }
    Ok(shares)
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let mut word = |default: &str| words.next().unwrap_or(default.into());
    let scene = word("training_scenes/swimming_pool.glb");
    for (level, share) in render(&scene, &word("out.exr"), 16)?.iter().enumerate() {
        println!("level {level}: {:.1} % of the pixels", 100.0 * share);
    }
    Ok(())
}
