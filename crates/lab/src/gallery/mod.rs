//! The scenes of this project: small ones with known answers for tests and documentation, and the scenes of
//! `training_scenes/`, built by [`training`].
//!
//! ```
//! let parts = opsr_lab::gallery::caustic_box();
//! assert_eq!(parts.cameras.len(), 1);
//! assert!(parts.materials.iter().any(|m| m.solid));
//! ```

mod figures;
pub mod glb;
mod hidden;
mod light;
pub mod lowered;
pub mod materials;
pub mod shapes;
pub mod training;

use figures::Led;
use glb::SaveError;
use materials::{COPPER, diffuse, emitter, glass, metal};
use opsr::files;
use opsr::math::{Rgb, Vec2, Vec3};
use opsr::scene::{Material, Mesh, SceneParts};
use shapes::{Placing, cuboid, cylinder, quad, ring, sphere, torus};
use std::f32::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// A scene's name and its builder.
type Builder = (&'static str, fn() -> SceneParts);

/// Small scenes by name, for suites.
const SMALL: [Builder; 31] = [
    ("ball-on-4-m", || hidden::ball_on_floor(2.0)),
    ("ball-on-40-m", || hidden::ball_on_floor(20.0)),
    ("ball-on-400-m", || hidden::ball_on_floor(200.0)),
    ("caustic-behind-glass", light::caustic_behind_glass),
    ("caustic-box", caustic_box),
    ("cornell-box", cornell_box),
    ("door-ajar", light::door_ajar),
    ("filament", light::filament),
    ("furnace", || furnace_sphere(0.5)),
    ("glass-in-field", hidden::glass_in_field),
    ("lamp-in-glass", hidden::lamp_in_glass),
    ("panel-in-mirror", || figures::panel_in_mirror(Led::Point)),
    ("panel-in-mirror-balls", || {
        figures::panel_in_mirror(Led::Ball)
    }),
    ("panel-over-water", || figures::panel_over_water(Led::Point)),
    ("panel-over-water-balls", || {
        figures::panel_over_water(Led::Ball)
    }),
    ("plane", area_light_over_plane),
    ("plate-under-mesh-sky", hidden::plate_under_mesh_sky),
    ("pool-0.2-m", || light::pool_of(0.2)),
    ("pool-0.4-m", || light::pool_of(0.4)),
    ("pool-0.8-m", || light::pool_of(0.8)),
    ("pool-1.6-m", || light::pool_of(1.6)),
    ("pool-3.2-m", || light::pool_of(3.2)),
    ("pool-in-the-sun", light::pool_in_the_sun),
    ("ring-under-lamp", hidden::ring_under_lamp),
    ("shaded-lamp", light::shaded_lamp),
    ("street-lamp", hidden::street_lamp),
    ("sun-pool", light::sun_pool),
    ("sun-through-pane", hidden::sun_through_pane),
    ("thin-parts", thin_parts),
    ("three-boxes", light::three_boxes),
    ("torus-in-glass", figures::torus_in_glass),
];

/// Names of the builtin scenes.
pub fn names() -> impl Iterator<Item = &'static str> {
    SMALL
        .iter()
        .chain(&training::BUILDERS)
        .map(|(name, _)| *name)
}

/// Builds the builtin scene of a name.
pub fn builtin(name: &str) -> Option<SceneParts> {
    let mut scenes = SMALL.iter().chain(&training::BUILDERS);
    scenes
        .find(|(other, _)| *other == name)
        .map(|(_, build)| build())
}

/// Writes builtin scenes as `NAME.glb` into a folder, which is created if necessary; returns the files. Unknown names
/// are skipped. A scene with an environment, textures or shared meshes is an error.
pub fn write<'a>(
    names: impl IntoIterator<Item = &'a str>,
    folder: &Path,
) -> Result<Vec<PathBuf>, SaveError> {
    files::create_folder(folder)?;
    let mut written = Vec::new();
    for name in names {
        let Some(parts) = builtin(name) else { continue };
        let path = folder.join(format!("{name}.glb"));
        glb::save(&parts, &path)?;
        written.push(path);
    }
    Ok(written)
}

/// A vector from three numbers, for tables of geometry.
pub(crate) const fn v3(x: f32, y: f32, z: f32) -> Vec3 {
    Vec3::new(x, y, z)
}

/// A white furnace: a closed unit sphere seen from its centre, with albedo ρ and emission 1 − ρ inside, so that the
/// radiance is 1 everywhere. Flat shading makes this exact for the polyhedron.
pub fn furnace_sphere(albedo: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    let inside = Mesh {
        normals: Vec::new(),
        ..sphere(Vec3::ZERO, 1.0, 2).inverted()
    };
    let wall = Material {
        emission: Rgb::splat(1.0 - albedo),
        ..diffuse("wall", Rgb::splat(albedo))
    };
    parts.add(wall, [inside]);
    parts.add_camera([0.0, 0.0, 0.0], [0.0, 0.0, -1.0], 60.0);
    parts
}

/// The box x, z ∈ [−1, 1], y ∈ [0, 2], open towards +z, red on the left and green on the right. A square light of the
/// given edge is under the ceiling, and the camera shows all of the box.
pub(crate) fn open_box(light_edge: f32, radiance: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    let [left, right, floor, ceiling, back, _] =
        shapes::room(v3(-1.0, 0.0, -1.0), v3(1.0, 2.0, 1.0));
    parts.add(diffuse("white", Rgb::splat(0.73)), [floor, ceiling, back]);
    parts.add(diffuse("red", v3(0.6, 0.06, 0.05)), [left]);
    parts.add(diffuse("green", v3(0.13, 0.45, 0.1)), [right]);
    parts.add(
        emitter("light", v3(1.0, 0.92, 0.8) * radiance),
        [light_panel(v3(0.0, 1.995, 0.0), light_edge, light_edge)],
    );
    parts.add_camera([0.0, 1.0, 3.9], [0.0, 0.98, 0.0], 38.0);
    parts
}

/// A horizontal rectangle centred at `at` that faces down.
pub(crate) fn light_panel(at: Vec3, width: f32, depth: f32) -> Mesh {
    let (w, d) = (Vec3::X * width, Vec3::Z * depth);
    quad(at - 0.5 * (w + d), w, d)
}

/// A Cornell box with two diffuse blocks: regularisation changes nothing in it.
pub fn cornell_box() -> SceneParts {
    let mut parts = open_box(0.5, 14.0);
    let block = |w: f32, h: f32| cuboid(v3(-w, 0.0, -w), v3(w, h, w));
    parts.add(
        diffuse("blocks", Rgb::splat(0.7)),
        [
            block(0.29, 1.2).placed([0.3, 0.0, 0.0], v3(-0.35, 0.0, -0.35)),
            block(0.28, 0.6).placed([-0.3, 0.0, 0.0], v3(0.38, 0.0, 0.3)),
        ],
    );
    parts
}

/// A Cornell box with a glass ball and a polished copper ring on its floor: caustics seen directly and in the glass.
pub fn caustic_box() -> SceneParts {
    let mut parts = open_box(0.4, 20.0);
    parts.add(
        glass("glass", 1.5, 0.0),
        [sphere(v3(0.4, 0.402, 0.2), 0.4, 3)],
    );
    parts.add(
        metal("copper", COPPER, 0.01),
        [ring(0.34, 0.03, 0.26, 48).moved(v3(-0.45, 0.0, 0.3))],
    );
    parts
}

/// Legs, an arm, a rim and a sheet, mostly a few pixels wide, under a lamp outside of the picture: every visible
/// surface is near an edge.
pub fn thin_parts() -> SceneParts {
    let mut parts = SceneParts::default();
    let legs = (0..4u8).map(|i| {
        let x = -0.9 + 0.35 * f32::from(i);
        let half = 0.012 * f32::from(i + 1);
        cuboid(v3(x - half, 0.0, -half), v3(x + half, 1.0, half))
    });
    let arm = cylinder(0.03, 1.2, 24).placed([0.0, 0.0, -FRAC_PI_2], v3(-0.6, 1.15, 0.0));
    let rim = torus(0.3, 0.02, 64, 16).placed([FRAC_PI_2, 0.0, 0.0], v3(0.75, 0.4, 0.0));
    let sheet = quad(v3(0.7, 0.85, 0.0), v3(0.05, 0.0, 0.0), v3(0.1, 0.5, 0.0));
    let material = diffuse("parts", Rgb::splat(0.6));
    parts.add(material, legs.chain([arm, rim, sheet]));
    let lamp = quad(v3(-1.0, 0.0, 3.6), v3(0.0, 1.5, 0.0), v3(2.0, 0.0, 0.0));
    parts.add(emitter("lamp", Rgb::splat(4.0)), [lamp]);
    parts.add_camera([0.0, 0.7, 3.2], [0.0, 0.65, 0.0], 36.0);
    parts
}

/// A plane y = 0 of albedo 0.5 under a square light of edge 2 and radiance 1 at height 1, facing down. The radiance at
/// the origin is half the light's form factor, ½ · (4/π)·(1/√2)·atan(1/√2) = 0.277.
pub fn area_light_over_plane() -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(
        diffuse("plane", Rgb::splat(0.5)),
        [quad(v3(-20.0, 0.0, -20.0), Vec3::Z * 40.0, Vec3::X * 40.0)],
    );
    parts.add(emitter("light", Rgb::ONE), [light_panel(Vec3::Y, 2.0, 2.0)]);
    parts.add_camera([0.0, 0.5, 4.0], [0.0, 0.0, 0.0], 20.0);
    parts
}

/// A vector from two numbers, for tables of profiles.
pub(crate) const fn v2(x: f32, y: f32) -> Vec2 {
    Vec2::new(x, y)
}
