//! Small scenes, each with one possible fault of a bidirectional estimator.

use super::materials::{coated, diffuse, emitter, glass, metal, tinted_glass, translucent};
use super::shapes::{cuboid, quad, room, sphere};
use opsr::image::Buffer;
use opsr::math::{Frame, Rgb, Vec3};
use opsr::scene::{
    AlphaMode, Environment, Lens, Material, Projection, PunctualLight, SceneParts, Texture,
    TextureRef,
};

const HALF: Rgb = Rgb::splat(0.5);

/// A box of edge 2 around (0, 1, 0) with walls of this material; the camera looks in through the open front.
pub(crate) fn walls(material: Material) -> SceneParts {
    let mut parts = SceneParts::default();
    let all = room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
    let [left, right, floor, ceiling, back, _] = all;
    parts.add(material, [left, right, floor, ceiling, back]);
    parts.add_camera([0.0, 1.0, 3.6], [0.0, 1.0, 0.0], 45.0);
    parts
}

/// A panel below the ceiling that emits downwards.
pub(crate) fn panel(edge: f32) -> opsr::scene::Mesh {
    let corner = Vec3::new(-0.5 * edge, 1.9, -0.5 * edge);
    quad(corner, Vec3::X * edge, Vec3::Z * edge)
}

pub(crate) fn lit(material: Material, radiance: f32) -> SceneParts {
    let mut parts = walls(material);
    parts.add(emitter("light", Rgb::splat(radiance)), [panel(0.8)]);
    parts
}

/// The lit diffuse box with a sphere of this material on its floor.
pub(crate) fn with_sphere(material: Material) -> SceneParts {
    let mut parts = lit(diffuse("walls", Rgb::new(0.7, 0.5, 0.4)), 3.0);
    parts.add(material, [sphere(Vec3::new(0.1, 0.55, 0.0), 0.5, 4)]);
    parts
}

/// Balls of 80 triangles, matt and glossy, that receive light from below their triangles, and a bowl lit from inside.
fn coarse_balls() -> SceneParts {
    let mut parts = lit(diffuse("walls", Rgb::new(0.7, 0.5, 0.4)), 3.0);
    let at = |x| sphere(Vec3::new(x, 0.45, 0.0), 0.4, 1);
    let mut bowl = sphere(Vec3::new(0.0, 0.4, 0.6), 0.35, 1);
    let low = |face: &[u32; 3]| face.iter().all(|&i| bowl.positions[i as usize].y < 0.41);
    bowl.indices = bowl.indices.iter().copied().filter(low).collect();
    parts.add(diffuse("bowl", HALF), [bowl]);
    parts.add(diffuse("ball", HALF), [at(-0.5)]);
    parts.add(coated("gloss", Rgb::new(0.2, 0.5, 0.7), 0.2), [at(0.5)]);
    parts
}

fn blocks() -> [opsr::scene::Mesh; 1] {
    [cuboid(Vec3::new(-0.6, 0.0, -0.5), Vec3::new(0.0, 0.8, 0.1))]
}

pub(crate) fn point_lit(material: Material) -> SceneParts {
    let mut parts = walls(material);
    parts.add(diffuse("block", HALF), blocks());
    parts.lights.push(PunctualLight::Point {
        position: Vec3::new(0.4, 1.5, 0.3),
        intensity: Rgb::new(1.0, 0.8, 0.6),
        range: 3.0,
    });
    parts
}

pub(crate) fn spot() -> SceneParts {
    let mut parts = walls(diffuse("walls", HALF));
    parts.add(diffuse("block", HALF), blocks());
    parts.lights.push(PunctualLight::Spot {
        position: Vec3::new(0.3, 1.8, 0.5),
        direction: Vec3::new(-0.3, -1.0, -0.4).normalize(),
        intensity: Rgb::splat(3.0),
        range: f32::INFINITY,
        cos_inner: 0.95,
        cos_outer: 0.8,
        falloff: Default::default(),
    });
    parts
}

pub(crate) fn sunny(directional: bool) -> SceneParts {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-1.5, 0.0, -1.5), Vec3::Z * 3.0, Vec3::X * 3.0);
    parts.add(diffuse("floor", HALF), [floor]);
    let at = |x| sphere(Vec3::new(x, 0.42, 0.0), 0.4, 3);
    parts.add(diffuse("ball", Rgb::new(0.8, 0.4, 0.3)), [at(-0.5)]);
    parts.add(coated("gloss", Rgb::new(0.2, 0.5, 0.7), 0.2), [at(0.5)]);
    let map = Buffer::from_fn(8, 4, |x, y| {
        Rgb::new(0.2 + 0.1 * x as f32, 0.5, 1.0 - 0.2 * y as f32)
    });
    parts.environment = Some(Environment::from_map(map, 0.4));
    if directional {
        parts.lights.push(PunctualLight::Directional {
            direction: Vec3::new(0.4, -1.0, -0.3).normalize(),
            irradiance: Rgb::splat(2.0),
        });
    }
    parts.add_camera([0.0, 1.4, 3.0], [0.0, 0.3, 0.0], 40.0);
    parts
}

pub(crate) fn parallel_camera() -> SceneParts {
    let mut parts = with_sphere(diffuse("ball", HALF));
    let camera = &mut parts.cameras[0];
    camera.position = Vec3::new(0.0, 1.0, 2.0);
    camera.frame = Frame {
        s: Vec3::X,
        t: Vec3::Y,
        n: Vec3::Z,
    };
    camera.projection = Projection::Orthographic { half_height: 1.2 };
    parts
}

/// The scene with a camera lens: the front of the ball is in focus, the back wall and the floor are not.
pub(crate) fn through_a_lens(mut parts: SceneParts) -> SceneParts {
    parts.cameras[0].lens = Some(Lens {
        radius: 0.15,
        focus: 3.0,
    });
    parts
}

pub(crate) fn two_sided() -> SceneParts {
    let mut parts = walls(diffuse("walls", HALF));
    let sheet = quad(Vec3::new(-0.4, 1.2, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    let material = Material {
        double_sided: true,
        ..emitter("sheet", Rgb::splat(2.0))
    };
    parts.add(material, [sheet]);
    parts
}

/// The lit box with a sheet of paper below the light and a glossy leaf; both transmit light diffusely.
pub(crate) fn sheets() -> SceneParts {
    let mut parts = lit(diffuse("walls", Rgb::new(0.7, 0.5, 0.4)), 3.0);
    let paper = quad(Vec3::new(-0.7, 1.3, -0.6), Vec3::X * 1.2, Vec3::Z * 1.2);
    let white = diffuse("paper", Rgb::splat(0.8));
    parts.add(translucent(white, 0.6, Rgb::new(0.9, 0.8, 0.5)), [paper]);
    let leaf = quad(Vec3::new(0.1, 0.1, 0.6), Vec3::new(0.5, 0.2, -0.9), Vec3::Y);
    let green = coated("leaf", Rgb::new(0.2, 0.6, 0.1), 0.15);
    parts.add(translucent(green, 0.5, Rgb::new(0.5, 0.9, 0.2)), [leaf]);
    parts
}

/// A panel on the back wall whose normal map tilts its normals by up to 40°.
pub(crate) fn normal_map() -> SceneParts {
    let mut parts = lit(diffuse("walls", HALF), 3.0);
    let texel = |i: u8| [60 + 40 * (i % 4), 60 + 40 * (i / 4), 220, 255];
    parts.textures.push(Texture::rgba(4, 4, (0..16).map(texel)));
    let material = Material {
        normal_texture: Some(TextureRef {
            second: false,
            texture: 0,
            transform: Default::default(),
        }),
        ..coated("bumps", Rgb::splat(0.6), 0.3)
    };
    let mut panel = quad(Vec3::new(-0.8, 0.3, -0.9), Vec3::X * 1.6, Vec3::Y * 1.4);
    panel.uvs = vec![
        [0.0, 1.0].into(),
        [1.0, 1.0].into(),
        [1.0, 0.0].into(),
        [0.0, 0.0].into(),
    ];
    parts.add(material, [panel]);
    parts
}

/// A wall and a floor of coloured texels, three per pixel, partly behind a pane.
pub(crate) fn far_texels() -> SceneParts {
    let mut parts = lit(diffuse("walls", HALF), 3.0);
    let texel = |i: u32| {
        let [r, g, b, _] = i.wrapping_mul(2_654_435_761).to_le_bytes();
        [r, g, b.max(g), 255]
    };
    let image = Texture::rgba(96, 96, (0..96 * 96).map(texel));
    parts.textures.push(Texture {
        srgb: true,
        ..image
    });
    let map = Some(TextureRef {
        second: false,
        texture: 0,
        transform: Default::default(),
    });
    let textured = |of: Material| Material {
        base_color_texture: map,
        ..of
    };
    let shown = |corner, u, v| {
        let mut panel = quad(corner, u, v);
        panel.uvs = vec![
            [0.0, 0.5].into(),
            [0.5, 0.5].into(),
            [0.5, 0.0].into(),
            [0.0, 0.0].into(),
        ];
        panel
    };
    let wall = shown(Vec3::new(-0.9, 0.2, -0.9), Vec3::X * 1.8, Vec3::Y * 1.6);
    let floor = shown(Vec3::new(-0.9, 0.05, -0.8), Vec3::Z * 1.7, Vec3::X * 1.8);
    parts.add(textured(diffuse("wall", Rgb::ONE)), [wall]);
    parts.add(textured(coated("floor", Rgb::ONE, 0.3)), [floor]);
    let pane = Material {
        transmission: 1.0,
        ..coated("pane", Rgb::new(0.9, 0.8, 0.5), 0.0)
    };
    parts.add(
        pane,
        [quad(Vec3::new(0.1, 0.1, 0.9), Vec3::X * 0.8, Vec3::Y * 1.7)],
    );
    parts
}

/// A leaf of opacity ½ in front of the light.
fn leaf() -> SceneParts {
    let mut parts = lit(diffuse("walls", HALF), 4.0);
    let leaf = Material {
        alpha_mode: AlphaMode::Blend,
        opacity: 0.5,
        ..diffuse("leaf", Rgb::new(0.3, 0.8, 0.2))
    };
    let sheet = quad(Vec3::new(-0.6, 1.3, -0.6), Vec3::Z * 1.2, Vec3::X * 1.0);
    parts.add(leaf, [sheet]);
    parts
}

/// An absorbing bottle of rough glass with a lamp inside.
fn bottle() -> SceneParts {
    let mut parts = walls(diffuse("walls", HALF));
    let absorption = Rgb::new(0.3, 1.0, 2.0);
    parts.add(
        tinted_glass("bottle", 1.3, 0.4, absorption),
        [sphere(Vec3::new(0.0, 1.0, 0.0), 0.5, 4)],
    );
    parts.add(
        emitter("lamp", Rgb::splat(8.0)),
        [sphere(Vec3::new(0.0, 1.0, 0.0), 0.25, 2)],
    );
    parts
}

/// A camera under water, with a ball on the floor and a light above. The surface has shading normals tilted by 20°. A
/// single refraction between light and camera reveals errors of η², a tilted normal those of the cosines.
pub(crate) fn under_water(alpha: f32) -> SceneParts {
    let mut parts = SceneParts::default();
    let (low, high) = (Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 1.0, 1.0));
    let mut body = cuboid(low, high);
    // Its upper side.
    body.indices.drain(6..8);
    let mut surface = quad(low + Vec3::Y, Vec3::Z * 2.0, Vec3::X * 2.0);
    let (sin, cos) = 20f32.to_radians().sin_cos();
    surface.normals = vec![Vec3::new(sin, cos, 0.0); 4];
    parts.add(glass("water", 1.33, alpha), [body, surface]);
    let floor = quad(Vec3::new(-0.9, 0.1, -0.9), Vec3::Z * 1.8, Vec3::X * 1.8);
    parts.add(diffuse("floor", Rgb::new(0.6, 0.7, 0.5)), [floor]);
    let ball = sphere(Vec3::new(0.2, 0.35, -0.2), 0.25, 3);
    parts.add(coated("ball", Rgb::new(0.3, 0.5, 0.7), 0.3), [ball]);
    let light = quad(Vec3::new(-1.2, 1.9, -0.8), Vec3::X * 1.6, Vec3::Z * 1.6);
    parts.add(emitter("light", Rgb::splat(3.0)), [light]);
    parts.add_camera([0.0, 0.6, 0.9], [0.0, 0.2, -0.2], 60.0);
    parts
}

/// The floor of a wide field with a visible ball of glass in the middle, at which all kinds of lights are aimed.
pub(crate) fn field(light: impl FnOnce(&mut SceneParts)) -> SceneParts {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-15.0, 0.0, -15.0), Vec3::Z * 30.0, Vec3::X * 30.0);
    parts.add(diffuse("floor", HALF), [floor]);
    let ball = sphere(Vec3::new(0.0, 0.501, 0.0), 0.5, 3);
    parts.add(glass("ball", 1.5, 0.0), [ball]);
    parts.add(
        metal("roll", HALF, 0.2),
        [cuboid(Vec3::new(0.7, 0.0, -0.4), Vec3::new(0.9, 0.3, 0.4))],
    );
    light(&mut parts);
    parts.add_camera([1.2, 2.2, 3.0], [0.3, 0.25, -0.1], 36.0);
    parts
}

pub(crate) fn sun_in_field(parts: &mut SceneParts) {
    parts.lights.push(PunctualLight::Directional {
        direction: Vec3::new(0.5, -1.0, -0.2).normalize(),
        irradiance: Rgb::new(3.0, 2.8, 2.5),
    });
}

pub(crate) fn sky_in_field(parts: &mut SceneParts) {
    let sun = |x: usize, y: usize| if (x, y) == (6, 3) { 300.0 } else { 0.3 };
    let map = Buffer::from_fn(24, 12, |x, y| Rgb::splat(sun(x, y)));
    parts.environment = Some(Environment::from_map(map, 0.0));
}

pub(crate) fn lamps_in_field(parts: &mut SceneParts) {
    let lamp = quad(Vec3::new(-2.0, 6.0, 1.0), Vec3::X * 0.5, Vec3::Z * 0.5);
    parts.add(emitter("lamp", Rgb::new(60.0, 50.0, 40.0)), [lamp]);
    let both = Material {
        double_sided: true,
        ..emitter("both", Rgb::new(10.0, 20.0, 30.0))
    };
    let lamp = quad(Vec3::new(3.0, 2.0, 3.0), Vec3::X * 0.5, Vec3::Y * 0.5);
    parts.add(both, [lamp]);
}

pub(crate) fn points_in_field(parts: &mut SceneParts) {
    let (intensity, range) = (Rgb::new(20.0, 25.0, 30.0), 40.0);
    parts.lights.push(PunctualLight::Point {
        position: Vec3::new(-2.0, 4.0, 1.0),
        intensity,
        range,
    });
    parts.lights.push(PunctualLight::Spot {
        position: Vec3::new(2.0, 5.0, 2.0),
        direction: Vec3::new(-2.0, -4.6, -2.0).normalize(),
        intensity: 2.0 * intensity,
        range: f32::INFINITY,
        cos_inner: 0.95,
        cos_outer: 0.8,
        falloff: Default::default(),
    });
}

/// A floor with blocks among two dozen lamps, each of which lights only a part: a case for the light tree.
pub(crate) fn many_lamps() -> SceneParts {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-3.0, 0.0, -3.0), Vec3::Z * 6.0, Vec3::X * 6.0);
    parts.add(diffuse("floor", HALF), [floor]);
    parts.add(metal("block", HALF, 0.25), blocks());
    parts.add(
        glass("ball", 1.5, 0.0),
        [sphere(Vec3::new(0.9, 0.45, 0.6), 0.4, 3)],
    );
    for i in 0..12u32 {
        let (x, z) = ((i % 4) as f32 * 1.5 - 2.4, (i / 4) as f32 * 2.0 - 2.0);
        let lamp = quad(Vec3::new(x, 0.8, z), Vec3::X * 0.2, Vec3::Z * 0.2);
        let power = 4.0 + 8.0 * (i % 3) as f32;
        parts.add(emitter("lamp", Rgb::new(power, 0.8 * power, 12.0)), [lamp]);
    }
    parts.lights.push(PunctualLight::Point {
        position: Vec3::new(0.5, 1.2, 0.2),
        intensity: Rgb::splat(0.3),
        range: f32::INFINITY,
    });
    parts.environment = Some(Environment::constant(Rgb::splat(0.05)));
    parts.add_camera([0.5, 2.5, 4.0], [0.0, 0.2, 0.0], 50.0);
    parts
}

/// A room whose lamp is behind one pane and whose camera is behind another.
pub(crate) fn panes() -> SceneParts {
    let mut parts = lit(diffuse("walls", Rgb::new(0.7, 0.5, 0.4)), 3.0);
    let pane = Material {
        transmission: 1.0,
        ..coated("pane", Rgb::new(0.9, 0.8, 0.5), 0.0)
    };
    let (x, y, z) = (Vec3::X * 1.8, Vec3::Y * 1.4, Vec3::Z * 1.8);
    let all = [
        quad(Vec3::new(-0.9, 1.5, -0.9), z, x),
        quad(Vec3::new(-0.9, 0.0, 0.7), x, y),
    ];
    parts.add(pane, all);
    parts.add(metal("block", HALF, 0.3), blocks());
    parts
}

/// Scenes of every kind, with the samples per pixel of their comparison.
pub(crate) fn all() -> Vec<(&'static str, SceneParts, u32)> {
    let thin = Material {
        transmission: 1.0,
        ..coated("wall", Rgb::new(0.9, 0.8, 0.7), 0.3)
    };
    let half = Material {
        transmission: 0.5,
        ..glass("half", 1.5, 0.2)
    };
    vec![
        ("rough glass", with_sphere(glass("glass", 1.5, 0.3)), 128),
        ("partial glass", with_sphere(half), 128),
        ("thin wall", with_sphere(thin), 64),
        ("sharp coat", with_sphere(coated("coat", HALF, 0.0)), 128),
        ("rough coat", with_sphere(coated("coat", HALF, 0.2)), 64),
        ("metal", with_sphere(metal("metal", HALF, 0.2)), 128),
        ("coarse balls", coarse_balls(), 128),
        ("environment", sunny(false), 64),
        ("sun", sunny(true), 64),
        ("point", point_lit(diffuse("walls", HALF)), 64),
        ("spot", spot(), 64),
        ("parallel camera", parallel_camera(), 64),
        (
            "lens",
            through_a_lens(with_sphere(glass("glass", 1.5, 0.3))),
            128,
        ),
        (
            "lens of a parallel camera",
            through_a_lens(parallel_camera()),
            64,
        ),
        ("two-sided emitter", two_sided(), 64),
        ("normal map", normal_map(), 64),
        ("far texels", far_texels(), 128),
        ("blend leaf", leaf(), 64),
        ("translucent sheets", sheets(), 64),
        ("absorbing bottle", bottle(), 128),
        ("sun in a field", field(sun_in_field), 128),
        ("sky in a field", field(sky_in_field), 128),
        ("lamps in a field", field(lamps_in_field), 128),
        ("points in a field", field(points_in_field), 128),
        ("many lamps", many_lamps(), 64),
        ("panes", panes(), 64),
        ("under water", under_water(0.0), 64),
        ("under rough water", under_water(0.3), 64),
    ]
}
