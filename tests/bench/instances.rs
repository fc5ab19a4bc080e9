//! Times of paths among instances of a ball over those among copies of it, in CPU time of one thread, in turns.
//!
//! `cargo bench --bench instances`

use cpu_time::ThreadTime;
use glam::{DAffine3, DQuat, DVec3};
use opsr::image::Film;
use opsr::integrator::method::IntegratorKind;
use opsr::integrator::{Picture, Settings, View};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::scene::{Mesh, Scene, SceneParts, SharedMesh};
use opsr_lab::gallery::materials::{diffuse, emitter};
use opsr_lab::gallery::shapes::{quad, room, sphere};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;

const BALLS: usize = 200;
const TURNS: usize = 9;

/// A lamp over balls in a room, or on a floor without walls; the balls last, as instances or copies.
fn scene(walls: bool, level: u32, shared: bool) -> Scene {
    let mut rng = Pcg32::seed_from_u64(1);
    let mut parts = SceneParts::default();
    let ground: Vec<Mesh> = match walls {
        true => room(Vec3::splat(-1.0), Vec3::ONE).into(),
        false => vec![quad(
            Vec3::new(-4.0, -1.0, -4.0),
            Vec3::Z * 8.0,
            Vec3::X * 8.0,
        )],
    };
    parts.add(diffuse("ground", Rgb::splat(0.6)), ground);
    let lamp = quad(Vec3::new(-0.4, 0.98, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    parts.add(emitter("lamp", Rgb::splat(6.0)), [lamp]);
    parts.add_camera([0.0, 0.0, 0.98], [0.0, -0.4, -1.0], 70.0);
    let material = parts.add(diffuse("clay", Rgb::splat(0.6)), []);
    let mesh = Mesh {
        material,
        ..sphere(Vec3::ZERO, 1.0, level)
    };
    let poses: Vec<DAffine3> = (0..BALLS)
        .map(|_| {
            let mut at = |reach: f64| rng.random_range(-reach..reach);
            let turn = DQuat::from_rotation_x(at(3.0)) * DQuat::from_rotation_y(at(3.0));
            let radius = 0.12 + at(0.04);
            let height = if walls { at(0.85) } else { radius - 1.0 };
            let place = DVec3::new(at(0.88), height, at(0.88));
            DAffine3::from_scale_rotation_translation(DVec3::splat(radius), turn, place)
        })
        .collect();
    if shared {
        parts.shared.push(SharedMesh { mesh, poses });
    } else {
        let of = |pose: &DAffine3| {
            let point = |p: &Vec3| pose.transform_point3(p.as_dvec3()).as_vec3();
            let turn = |n: &Vec3| pose.transform_vector3(n.as_dvec3()).normalize().as_vec3();
            Mesh {
                positions: mesh.positions.iter().map(point).collect(),
                normals: mesh.normals.iter().map(turn).collect(),
                ..mesh.clone()
            }
        };
        parts.meshes.extend(poses.iter().map(of));
    }
    Scene::new(parts)
}

/// CPU-seconds of a picture.
fn seconds(scene: &Scene, seed: u64) -> f64 {
    let settings = Settings {
        estimator: IntegratorKind::Path.estimator(Default::default()),
        seed,
        ..Settings::default()
    };
    let mut picture = Picture {
        film: Film::new(UVec2::splat(96)),
        aovs: None,
        levels: None,
    };
    let clock = ThreadTime::now();
    let view = View::of(scene, &scene.parts().cameras[0], &picture.film);
    settings.integrator().pass(&view, 0..8, &mut picture);
    clock.elapsed().as_secs_f64()
}

fn main() {
    // One thread, which is timed.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("one thread").install(|| {
        for walls in [true, false] {
            for level in [2, 3, 5] {
                let [shared, copied] = [true, false].map(|shared| scene(walls, level, shared));
                let mut turns: Vec<[f64; 3]> = (0..TURNS as u64)
                    .map(|turn| {
                        let [a, b] = [&shared, &copied].map(|scene| seconds(scene, turn));
                        [a / b, a, b]
                    })
                    .collect();
                turns.sort_by(|a, b| a[0].total_cmp(&b[0]));
                println!(
                    "{} triangles a ball {}: instances over copies {:.3} ({:.3} to {:.3}), {:.3} over {:.3} s",
                    20 << (2 * level),
                    if walls { "in a room" } else { "on a floor" },
                    turns[TURNS / 2][0],
                    turns[0][0],
                    turns[TURNS - 1][0],
                    turns[TURNS / 2][1],
                    turns[TURNS / 2][2],
                );
            }
        }
    });
}
