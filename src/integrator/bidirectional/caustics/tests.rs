use crate::image::film::Window;
use crate::integrator::bidirectional::Strategies;
use crate::integrator::{Settings, View};
use crate::math::{Rgb, UVec2, Vec3};
use crate::scene::light::PunctualLight;
use crate::scene::{Camera, Scene, SceneParts};
use crate::unit::{materials, shapes};

/// A floor that the camera sees from above, up to the foot of a mirror 2 m wide and 1 m high.
fn before_a_mirror(light: impl FnOnce(&mut SceneParts)) -> Scene {
    let mut parts = SceneParts::default();
    let floor = shapes::quad(Vec3::new(-2.1, 0.0, 4.2), Vec3::X * 4.2, Vec3::Z * -4.2);
    parts.add(materials::diffuse("floor", Rgb::splat(0.5)), [floor]);
    let mirror = shapes::quad(Vec3::new(-1.0, 0.0, 0.0), Vec3::X * 2.0, Vec3::Y);
    parts.add(materials::metal("mirror", Rgb::splat(0.9), 0.0), [mirror]);
    light(&mut parts);
    let fov = 2.0 * 0.5f32.atan();
    let (above, below) = (Vec3::new(0.0, 4.0, 2.05), Vec3::new(0.0, 0.0, 2.05));
    parts.cameras = vec![Camera::look_at(above, below, Vec3::NEG_Z, fov)];
    Scene::new(parts)
}

fn share(scene: &Scene, window: Window, seed: u64) -> f64 {
    let frame = UVec2::splat(64);
    let view = View::new(scene, &scene.parts().cameras[0], frame, window);
    let settings = Settings {
        max_vertices: 2,
        seed,
        ..Settings::default()
    };
    let estimator = settings.bidirectional(Strategies::All);
    estimator.rare_caustics(&view)
}

/// A sun 45° high throws a patch of 2 m by 1 m, in 4 of the 8 columns of cells and 1.9 of their rows. It has 0.9 of the
/// light that the sun itself gives to all of the floor. A lamp of four square metres is found by any path.
#[test]
fn share_of_a_mirrors_caustic_is_that_of_its_light() {
    let sun = before_a_mirror(|parts| {
        parts.lights.push(PunctualLight::Directional {
            direction: Vec3::new(0.0, -1.0, -1.0).normalize(),
            irradiance: Rgb::ONE,
        });
    });
    let whole = Window::full(UVec2::splat(64));
    let found = share(&sun, whole, 1);
    let of = |part: f64| part * 0.9 / (1.0 + part * 0.9);
    let expected = 4.0 * (of(1.0) + of(0.9)) / 64.0;
    assert!((found / expected - 1.0).abs() < 0.1, "{found} {expected}");

    let crop = Window {
        x: 0,
        y: 48,
        w: 8,
        h: 8,
    };
    assert_eq!(found, share(&sun, crop, 2));

    let lamp = before_a_mirror(|parts| {
        let corner = Vec3::new(-1.0, 2.0, 3.0);
        let quad = shapes::quad(corner, Vec3::X * 2.0, Vec3::new(0.0, -1.4, 1.4));
        parts.add(materials::emitter("lamp", Rgb::ONE), [quad]);
    });
    assert_eq!(share(&lamp, whole, 1), 0.0);
}

/// A square lamp stands 3 m above the floor and 3 m before the mirror, and faces its foot. In the patch of the mirror it
/// gives the floor E = L a (0.77/15 + 0.9 · 0.65/21) directly and by way of the mirror, with a its area in m². A path
/// that finds it in the mirror is 0.9 π L / E = 36/a as bright as the floor: 145 times for a lamp of half a metre, and
/// 3,600 times for one of a tenth.
#[test]
fn caustics_of_small_lamps_are_rare() {
    let lamp = |size: f32| {
        before_a_mirror(|parts| {
            let (right, down) = (Vec3::X * size, Vec3::new(0.0, -size, size) * 0.5f32.sqrt());
            let corner = Vec3::new(0.0, 3.0, 3.0) - 0.5 * (right + down);
            let quad = shapes::quad(corner, right, down);
            parts.add(materials::emitter("lamp", Rgb::ONE), [quad]);
        })
    };
    let whole = Window::full(UVec2::splat(64));
    assert_eq!(share(&lamp(0.5), whole, 1), 0.0);
    let small = share(&lamp(0.1), whole, 1);
    assert!((0.04..0.12).contains(&small), "{small}");
}
