//! A picture of a glTF file.
//!
//! ```sh
//! cargo run --release --example render -- scene.glb out.exr 64
//! ```

use opsr::{Render, Scene};
use std::error::Error;

/// Renders a scene into a file, EXR or PNG.
pub(crate) fn render(scene: &str, output: &str, spp: u32) -> Result<(), Box<dyn Error>> {
    let scene = Scene::open(scene)?;
    let picture = Render::new(&scene).size(160, 120).spp(spp).run()?;
    picture.save(output)?;
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let mut word = |default: &str| words.next().unwrap_or(default.into());
    let scene = word("training_scenes/figurines.glb");
    render(&scene, &word("out.png"), word("16").parse()?)
}
