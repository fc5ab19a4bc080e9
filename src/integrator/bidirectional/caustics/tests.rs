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
