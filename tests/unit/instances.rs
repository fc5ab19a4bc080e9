//! Instances that share a mesh, against transformed copies of the mesh.

use super::geometry::bumpy_sphere;
use crate::integrator::Settings;
use crate::integrator::bidirectional::Radius;
use crate::integrator::method::IntegratorKind;
use crate::math::{Ray, Rgb, Vec3};
use crate::scene::{
    AlphaMode, Geometry, Material, Mesh, Scene, SceneParts, SharedMesh, Texture, TextureRef,
    TriangleId,
};
use crate::unit::lab::gallery::materials::{diffuse, emitter, glass, metal};
use crate::unit::lab::gallery::shapes::{quad, room, sphere};
use crate::unit::lab::stats::agreement::agree;
use crate::unit::support::draws::{direction, point, rng};
use crate::unit::support::gltf::{grid, spread};
use crate::unit::support::render::film_with;
use glam::{Affine2, DAffine3, DQuat, DVec3, Vec2, Vec4};
use rand::RngExt;
use rand_pcg::Pcg32;
use serde_json::json;

/// A random pose with rotation and a scale of up to 3 along each axis, mirroring if `mirrored`.
fn pose(rng: &mut Pcg32, size: f32, mirrored: bool) -> DAffine3 {
    let scale = DVec3::from_array([0, 1, 2].map(|_| rng.random_range(0.3..3.0)));
    let turn = DQuat::from_axis_angle(
        direction(rng).as_dvec3().normalize(),
        rng.random_range(0.0..6.0),
    );
    let at = point(rng, size).as_dvec3();
    let sign = if mirrored { -1.0 } else { 1.0 };
    // A rotation before the scale makes the pose shear.
    let shear = DAffine3::from_quat(DQuat::from_rotation_y(0.7));
    DAffine3::from_scale_rotation_translation(scale * DVec3::new(sign, 1.0, 1.0), turn, at) * shear
}

/// The scene of these parts, which may have no light.
fn built(parts: SceneParts) -> Scene {
    let scene = Scene::new(parts);
    let expected = |w: &String| w.starts_with("no light");
    assert!(
        scene.warnings().iter().all(expected),
        "{:?}",
        scene.warnings()
    );
    scene
}

/// A transformed copy of a mesh.
fn copy(mesh: &Mesh, pose: &DAffine3) -> Mesh {
    let mirrored = pose.matrix3.determinant() < 0.0;
    let normals = pose.matrix3.inverse().transpose();
    let mut copy = mesh.clone();
    for p in &mut copy.positions {
        *p = pose.transform_point3(p.as_dvec3()).as_vec3();
    }
    for n in &mut copy.normals {
        *n = (normals * n.as_dvec3()).normalize().as_vec3();
    }
    for t in &mut copy.tangents {
        let along = pose.transform_vector3(t.truncate().as_dvec3()).normalize();
        *t = along.as_vec3().extend(if mirrored { -t.w } else { t.w });
    }
    if mirrored {
        copy.indices.iter_mut().for_each(|face| face.swap(1, 2));
    }
    copy
}

/// The parts without shared meshes: every instance becomes a mesh of its own.
fn copied(parts: &SceneParts) -> SceneParts {
    let mut out = parts.clone();
    for SharedMesh { mesh, poses } in std::mem::take(&mut out.shared) {
        out.meshes
            .extend(poses.iter().map(|pose| copy(&mesh, pose)));
    }
    out
}

/// A bumpy ball with normals, texture coordinates and, optionally, tangents.
fn ball(material: u32, tangents: bool) -> Mesh {
    let mut mesh = bumpy_sphere(24, 48);
    mesh.normals = mesh.positions.iter().map(|p| p.normalize()).collect();
    mesh.uvs = (mesh.positions.iter())
        .map(|p| Vec2::new(p.x + 0.3 * p.z, p.y))
        .collect();
    if tangents {
        let along = |p: &Vec3| Vec3::Y.cross(*p).try_normalize().unwrap_or(Vec3::X);
        mesh.tangents = (mesh.positions.iter())
            .map(|p| along(p).extend(1.0))
            .collect::<Vec<Vec4>>();
    }
    mesh.material = material;
    mesh
}

fn texture(rng: &mut Pcg32) -> Texture {
    let texel = |_| [200, 90, 255, 130].map(|x: u8| x.saturating_sub(rng.random_range(0..60)));
    Texture::rgba(4, 4, (0..16).map(texel))
}

/// Three shared meshes at poses of all kinds in a cube of this half size, one of them with holes, and a wall.
fn crowd(size: f32, instances: usize) -> SceneParts {
    let mut rng = rng(3);
    let map = Some(TextureRef {
        second: false,
        texture: 0,
        transform: Affine2::IDENTITY,
    });
    let mut parts = SceneParts {
        textures: vec![texture(&mut rng)],
        ..SceneParts::default()
    };
    let wall = quad(
        Vec3::new(-size, -size, -size),
        Vec3::X * 2.0 * size,
        Vec3::Y * 2.0 * size,
    );
    parts.add(diffuse("wall", Rgb::splat(0.5)), [wall]);
    let bumps = Material {
        normal_texture: map,
        ..diffuse("bumps", Rgb::splat(0.5))
    };
    let holes = Material {
        base_color_texture: map,
        alpha_mode: AlphaMode::Mask(0.4),
        ..diffuse("holes", Rgb::splat(0.5))
    };
    let materials = [bumps.clone(), bumps, holes].map(|m| parts.add_material(m));
    for (k, material) in materials.into_iter().enumerate() {
        let poses = (0..instances).map(|i| pose(&mut rng, size, i % 3 == 0));
        parts.shared.push(SharedMesh {
            mesh: ball(material, k == 0),
            poses: poses.collect(),
        });
    }
    parts
}

/// Index of a triangle in scene order, if all shared meshes have equal numbers of triangles.
fn number(geometry: &Geometry, id: TriangleId) -> usize {
    let (index, single) = (id.index() as usize, geometry.single());
    match id.instance() as usize {
        0 => index,
        instance => {
            let of_each = (geometry.triangle_count() - single) / geometry.instances();
            single + (instance - 1) * of_each + (index - single) % of_each
        }
    }
}

#[test]
fn instances_are_met_where_their_copies_are() {
    for (size, instances) in [(3.0, 2), (20.0, 60)] {
        let parts = crowd(size, instances);
        let (shared, copies) = (built(parts.clone()), built(copied(&parts)));
        let (a, b) = (shared.geometry(), copies.geometry());
        assert_eq!(
            (a.triangle_count(), a.instances()),
            (b.triangle_count(), 3 * instances)
        );
        assert!(a.stored() * instances < b.stored() + 3 * instances);
        let (low, high) = b.bounds();
        let (least, most) = a.bounds();
        assert!(least.cmple(low).all() && most.cmpge(high).all());
        let mut rng = rng(4);
        let (mut hits, mut differ) = (0, 0);
        for _ in 0..50_000 {
            let origin = point(&mut rng, 1.3 * size);
            let mut ray = Ray::new(origin, (point(&mut rng, 0.8 * size) - origin).normalize());
            if rng.random::<f32>() < 0.3 {
                ray.t_max = rng.random::<f32>() * size;
            }
            let met = (shared.intersect(&ray), copies.intersect(&ray));
            assert_eq!(shared.occluded(&ray), met.0.is_some(), "{ray:?}");
            let (Some(h), Some(k)) = met else {
                differ += usize::from(met.0.is_some() != met.1.is_some());
                continue;
            };
            let (s, c) = (shared.surface(&h), copies.surface(&k));
            // At a silhouette, or at the edge of a texel's hole, rounding may give another result.
            if (h.t - k.t).abs() > 1e-4 * size {
                differ += 1;
                continue;
            }
            hits += 1;
            assert_eq!(s.material, c.material);
            assert_eq!(a.triangle_mesh(s.triangle), b.triangle_mesh(c.triangle));
            let same = number(a, s.triangle) == number(b, c.triangle);
            assert!(s.position.distance(ray.at(h.t)) < 1e-5 * size, "{s:?}");
            assert!(s.position.distance(c.position) < 1e-4 * size, "{s:?} {c:?}");
            assert!(!same || s.ng.distance(c.ng) < 1e-4, "{s:?} {c:?}");
            assert!(!same || s.ns.distance(c.ns) < 2e-2, "{s:?} {c:?}");
            assert!(!same || s.uv.distance(c.uv) < 1e-3, "{s:?} {c:?}");
            assert_eq!(s.ng.dot(ray.dir) < 0.0, c.ng.dot(ray.dir) < 0.0);
            let corners = a.triangle(s.triangle);
            assert!(!same || corners == b.triangle(c.triangle), "{corners:?}");
        }
        assert!(hits > 20_000, "{hits} hits test little");
        assert!(differ < 25, "{differ} rays differ");
    }
}

/// Sheets of 2 · 181² triangles in rows above a floor, more than 2³² in total, and the corner of each sheet.
fn billions() -> (SceneParts, impl Fn(u32) -> DVec3) {
    const EDGE: u32 = 181;
    const INSTANCES: u32 = 70_000;
    let mut parts = SceneParts::default();
    let floor = quad(
        Vec3::new(-1.0, -1.0, -1.0),
        Vec3::Z * 240.0,
        Vec3::X * 310.0,
    );
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
    let at = |i: u32| DVec3::new((i % 300).into(), 0.0, (i / 300).into());
    let scale = DAffine3::from_scale(DVec3::splat(0.8));
    let corner = |x: u32, y: u32| Vec3::new(x as f32, 0.0, y as f32) / EDGE as f32;
    let index = |x: u32, y: u32| y * (EDGE + 1) + x;
    let side = 0..EDGE;
    let mut mesh = Mesh {
        positions: (0..=EDGE)
            .flat_map(|y| (0..=EDGE).map(move |x| corner(x, y)))
            .collect(),
        indices: (side.clone().flat_map(|y| side.clone().map(move |x| (x, y))))
            .flat_map(|(x, y)| {
                let [a, b, c, d] =
                    [(x, y), (x, y + 1), (x + 1, y + 1), (x + 1, y)].map(|(x, y)| index(x, y));
                [[a, b, c], [a, c, d]]
            })
            .collect(),
        ..Mesh::default()
    };
    mesh.material = parts.add_material(metal("sheet", Rgb::splat(0.8), 0.3));
    let poses = (0..INSTANCES).map(|i| DAffine3::from_translation(at(i)) * scale);
    parts.shared.push(SharedMesh {
        mesh,
        poses: poses.collect(),
    });
    (parts, at)
}

#[test]
fn instances_show_more_triangles_than_32_bits_count() {
    let (mut parts, at) = billions();
    let instances = parts.shared[0].poses.len() as u32;
    let last = at(instances - 1).as_vec3();
    let lamp = quad(last + 3.0 * Vec3::Y, Vec3::X, Vec3::Z);
    parts.add(emitter("lamp", Rgb::splat(6.0)), [lamp]);
    let above = last + Vec3::new(0.4, 1.5, 0.4);
    parts.add_camera(
        above.into(),
        (above - Vec3::new(0.0, 1.5, 0.01)).into(),
        15.0,
    );
    // The last sheet alone, as a mesh that is not shared.
    let SharedMesh { mesh, poses } = &parts.shared[0];
    let mut alone = parts.clone();
    alone.shared.clear();
    alone.meshes.push(copy(mesh, &poses[poses.len() - 1]));
    let scene = built(parts);
    let geometry = scene.geometry();
    assert_eq!(geometry.instances(), instances as usize);
    let of_each = geometry.triangle_count() / geometry.instances();
    assert!(of_each * geometry.instances() > 1 << 32, "{of_each}");
    assert!(geometry.stored() < 70_000, "{}", geometry.stored());
    let mut rng = rng(21);
    let meshes = scene.parts().meshes.len() as u32;
    for k in 0..2000 {
        let i = match k % 4 {
            0 => rng.random_range(0..instances),
            1 => k % 8,
            // Triangles beyond number 2³².
            _ => instances - 1 - rng.random_range(0..4000),
        };
        let on = Vec3::new(
            rng.random_range(0.01..0.79),
            0.0,
            rng.random_range(0.01..0.79),
        );
        let on = at(i).as_vec3() + on;
        let ray = Ray::new(on + 0.5 * Vec3::Y, Vec3::NEG_Y);
        let hit = scene.intersect(&ray).expect("a sheet");
        assert!(scene.occluded(&Ray { t_max: 0.6, ..ray }));
        assert_eq!(hit.triangle.instance(), i + 1);
        let surface = scene.surface(&hit);
        assert_eq!(geometry.triangle_mesh(surface.triangle), meshes + i);
        assert!(surface.position.distance(on) < 1e-4, "{i} {surface:?} {on}");
        let [a, b, c] = geometry.triangle(hit.triangle);
        let (low, high) = (a.min(b).min(c) - 1e-4, a.max(b).max(c) + 1e-4);
        assert!(
            low.cmple(on).all() && on.cmple(high).all(),
            "{i} {on} {a} {b} {c}"
        );
    }
    // Light on the last sheet, which only the lamp reaches: by camera paths, and by stored light vertices.
    let alone = built(alone);
    for kind in [IntegratorKind::Path, IntegratorKind::Bdpt] {
        let film = |scene: &Scene, seed| {
            let settings = Settings {
                estimator: kind.estimator(Radius::default()),
                max_vertices: 4,
                seed,
                ..Settings::default()
            };
            film_with(scene, &settings, 8, 64)
        };
        let agreement = agree(&film(&scene, 1), &film(&alone, 2)).unwrap();
        assert!(agreement.passed(), "{kind:?}\n{agreement}");
    }
}

#[test]
fn watertight_no_ray_escapes_a_closed_instance() {
    let mut rng = rng(11);
    for far in [0.0, 1e3] {
        let mut parts = SceneParts::default();
        let material = parts.add_material(diffuse("shell", Rgb::ONE));
        let at = pose(&mut rng, 1.0, far == 0.0);
        let at = DAffine3::from_translation(DVec3::splat(far)) * at;
        parts.shared.push(SharedMesh {
            mesh: Mesh {
                material,
                ..bumpy_sphere(60, 120)
            },
            poses: vec![at],
        });
        let scene = built(parts);
        for _ in 0..200_000 {
            let inside = at.transform_point3(point(&mut rng, 0.3).as_dvec3());
            let ray = Ray::new(inside.as_vec3(), direction(&mut rng));
            assert!(scene.occluded(&ray), "{ray:?}");
        }
    }
}

#[test]
fn self_intersection_of_instances_far_from_the_origin() {
    // A ray that leaves a flat sheet never hits it again, although the sheet is rotated, stretched and far away.
    let mut rng = rng(12);
    for far in [0.0f32, 1.0, 1e4] {
        for mirrored in [false, true] {
            let mut parts = SceneParts::default();
            let material = parts.add_material(diffuse("sheet", Rgb::ONE));
            let at = DAffine3::from_translation(direction(&mut rng).as_dvec3() * f64::from(far))
                * pose(&mut rng, 1.0, mirrored);
            let mut mesh = quad(Vec3::new(-0.7, 0.3, -0.6), Vec3::X, Vec3::Z);
            mesh.material = material;
            parts.shared.push(SharedMesh {
                mesh,
                poses: vec![at],
            });
            let scene = built(parts);
            let mut met = 0;
            for _ in 0..20_000 {
                let on = Vec3::new(rng.random::<f32>() - 0.7, 0.3, rng.random::<f32>() - 0.6);
                let on = at.transform_point3(on.as_dvec3()).as_vec3();
                let dir = direction(&mut rng);
                let Some(hit) = scene.intersect(&Ray::new(on - 3.0 * dir, dir)) else {
                    continue;
                };
                met += 1;
                let surface = scene.surface(&hit);
                let away = surface.spawn(direction(&mut rng));
                let again = scene.intersect(&away);
                assert!(again.is_none(), "{surface:?}, {away:?} meets {again:?}");
            }
            assert!(met > 15_000, "{met}");
        }
    }
}

/// A lit room with bodies of glass, brushed metal and bumps. Each has a plain instance and a mirrored, squeezed one.
fn furnished() -> SceneParts {
    let mut parts = SceneParts::default();
    parts.add(
        diffuse("walls", Rgb::splat(0.6)),
        room(Vec3::splat(-1.0), Vec3::ONE),
    );
    let lamp = quad(Vec3::new(-0.4, 0.95, -0.4), Vec3::X * 0.8, Vec3::Z * 0.8);
    parts.add(emitter("lamp", Rgb::splat(6.0)), [lamp]);
    parts.add_camera([0.0, 0.0, 0.95], [0.0, -0.2, -1.0], 70.0);
    let bodies = [
        glass("glass", 1.5, 0.2),
        metal("metal", Rgb::splat(0.8), 0.2),
        diffuse("clay", Rgb::new(0.7, 0.4, 0.2)),
    ];
    for (k, body) in bodies.into_iter().enumerate() {
        let material = parts.add_material(body);
        let at = |x: f64, scale: DVec3| {
            let turn = DQuat::from_rotation_z(0.4 + k as f64);
            let place = DVec3::new(x, -0.5 + 0.4 * (k as f64 - 1.0), -0.3);
            DAffine3::from_scale_rotation_translation(scale, turn, place)
        };
        parts.shared.push(SharedMesh {
            mesh: Mesh {
                material,
                ..sphere(Vec3::ZERO, 1.0, 3)
            },
            poses: vec![
                at(-0.45, DVec3::splat(0.2)),
                at(0.45, DVec3::new(-0.3, 0.12, 0.2)),
            ],
        });
    }
    parts
}

#[test]
fn agreement_of_instances_and_copies_in_every_integrator() {
    let parts = furnished();
    let (shared, copies) = (built(parts.clone()), built(copied(&parts)));
    assert_eq!(shared.features().overlaps, copies.features().overlaps);
    for kind in [
        IntegratorKind::Path,
        IntegratorKind::Light,
        IntegratorKind::Bdpt,
        IntegratorKind::Vcm,
        IntegratorKind::Sppm,
    ] {
        let film = |scene: &Scene, seed| {
            let settings = Settings {
                estimator: kind.estimator(Radius::default()),
                max_vertices: 6,
                seed,
                ..Settings::default()
            };
            film_with(scene, &settings, 24, 48)
        };
        let agreement = agree(&film(&shared, 1), &film(&copies, 2)).unwrap();
        assert!(agreement.passed(), "{kind:?}\n{agreement}");
    }
}

#[test]
fn bodies_around_a_point_in_nested_instances() {
    // A ball in a ball, both shared. The inner one is the smaller body, by its largest instance.
    let mut parts = SceneParts::default();
    for (name, ior, radius) in [("outer", 1.3, 1.0), ("inner", 1.5, 0.5)] {
        let material = parts.add_material(glass(name, ior, 0.0));
        let at = |x: f64, sign: f64| {
            let scale = DVec3::new(sign, 1.0, 1.0) * radius;
            DAffine3::from_scale_rotation_translation(scale, DQuat::IDENTITY, DVec3::X * x)
        };
        parts.shared.push(SharedMesh {
            mesh: Mesh {
                material,
                ..sphere(Vec3::ZERO, 1.0, 3)
            },
            poses: vec![at(-3.0, 1.0), at(3.0, -1.0)],
        });
    }
    let (shared, copies) = (built(parts.clone()), built(copied(&parts)));
    for scene in [&shared, &copies] {
        assert!(scene.features().overlaps);
        assert!(scene.rank(1) > scene.rank(0));
        let around = |x| scene.bodies_around(&Ray::new(Vec3::new(x, 0.1, 0.1), Vec3::Z));
        for side in [-3.0, 3.0] {
            assert_eq!(around(side), [1, 0]);
            assert_eq!(around(side + 0.8), [0]);
        }
        assert!(around(0.0).is_empty());
    }
}

#[test]
fn instances_that_cannot_be_are_dropped_and_counted() {
    let mut parts = SceneParts::default();
    let material = parts.add_material(emitter("lamp", Rgb::ONE));
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let far = DAffine3::from_translation(DVec3::splat(1e18));
    let huge = DAffine3::from_scale(DVec3::splat(1e7));
    parts.shared.push(SharedMesh {
        mesh: Mesh {
            material,
            ..sphere(Vec3::ZERO, 1.0, 1)
        },
        poses: vec![flat, far, huge, DAffine3::IDENTITY],
    });
    let scene = Scene::new(parts);
    assert_eq!(scene.geometry().instances(), 1);
    assert_eq!(scene.lights().emissive_triangles(), 0);
    let words = scene.warnings().join("\n");
    assert!(
        words.contains("shared mesh 0: its emission is ignored"),
        "{words}"
    );
    assert!(
        words.contains("shared mesh 0: dropped 3 of 4 instances"),
        "{words}"
    );
}

#[test]
fn load_shares_meshes_whose_copies_would_take_much_memory() {
    let mut file = grid(70);
    spread(&mut file, 20);
    // Copies of 20 × 9800 triangles need little memory.
    let parts = file.loaded().parts;
    assert_eq!((parts.meshes.len(), parts.shared.len()), (20, 0));
    spread(&mut file, 1000);
    file.push(
        "nodes",
        json!({ "mesh": 0, "scale": [-1, 2, 1], "translation": [0, 5, 0] }),
    );
    file.push("nodes", json!({ "mesh": 0, "scale": [1, 0, 1] }));
    let parts = file.loaded().parts;
    assert_eq!(parts.shared.len(), 1);
    assert_eq!(parts.shared[0].poses.len(), 1001);
    assert_eq!(parts.meshes.len(), 1, "a pose that flattens is copied");
    let scene = built(parts);
    assert_eq!(scene.geometry().triangle_count(), 1002 * 9800);
    let ray = Ray::new(Vec3::new(-0.5, 9.0, 0.4), Vec3::NEG_Y);
    let surface = scene.surface(&scene.intersect(&ray).expect("the mirrored instance"));
    assert!(
        (surface.ng - Vec3::Y).length() < 1e-6 && surface.position.y == 5.0,
        "{surface:?}"
    );
    // Lamps are copied, because light sampling uses triangles in world space.
    file.primitive()["material"] = json!(1);
    file.json["nodes"] = json!([file.json["nodes"][0]]);
    let parts = file.loaded().parts;
    assert_eq!((parts.meshes.len(), parts.shared.len()), (1000, 0));
}
