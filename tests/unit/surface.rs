//! Points of surfaces: self-intersection of spawned rays, shading frames, opacity.

use super::geometry::{bumpy_sphere, geometry_of, mesh_of, parts_of, square};
use crate::math::{Frame, Ray, Rgb, Vec2, Vec3};
use crate::scene::{
    AlphaMode, Geometry, Hit, Material, Mesh, Scene, SceneParts, Surface, Texture, TextureRef,
    TriangleId,
};
use crate::unit::lab::gallery::{materials, shapes};
use crate::unit::support::draws::{direction, point, rng};
use rand::RngExt;
use rand_pcg::Pcg32;

const SCALES: [f32; 5] = [1e-3, 1.0, 37.0, 1e3, 1e6];

fn transformed(mut mesh: Mesh, scale: f32, shift: Vec3) -> Mesh {
    let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -0.7);
    for p in &mut mesh.positions {
        *p = (turn * *p + shift) * scale;
    }
    mesh
}

/// Direction on the side of `ng` with a cosine above `least`, often grazing.
fn leaving(rng: &mut Pcg32, ng: Vec3, least: f32) -> Vec3 {
    loop {
        let squash = rng.random::<f32>().powi(4).max(1e-3);
        let d = direction(rng);
        let d = (d - (1.0 - squash) * d.dot(ng) * ng).normalize();
        let d = if d.dot(ng) < 0.0 {
            d - 2.0 * d.dot(ng) * ng
        } else {
            d
        };
        if d.dot(ng) > least {
            return d;
        }
    }
}

fn meet(geometry: &Geometry, parts: &SceneParts, ray: &Ray) -> Option<(Hit, Surface)> {
    let hit = geometry.intersect(parts, ray)?;
    Some((hit, geometry.surface(parts, &hit)))
}

#[test]
fn self_intersection_in_a_convex_body_at_every_scale() {
    let mut sphere = bumpy_sphere(60, 120);
    for p in &mut sphere.positions {
        *p = p.normalize();
    }
    for (i, scale) in SCALES.into_iter().enumerate() {
        for shift in [Vec3::ZERO, Vec3::new(5.0, -3.0, 0.5)] {
            let parts = parts_of(vec![transformed(sphere.clone(), scale, shift)]);
            let geometry = geometry_of(&parts);
            let mut rng = rng(40 + i as u64);
            for _ in 0..20_000 {
                let inside = Ray::new((point(&mut rng, 0.3) + shift) * scale, direction(&mut rng));
                let (_, s) = meet(&geometry, &parts, &inside).expect("the sphere is closed");
                let out = s.ng * s.ng.dot(inside.dir).signum();
                let d = leaving(&mut rng, out, 1e-3);
                let hit = geometry.intersect(&parts, &s.spawn(d));
                assert!(
                    hit.is_none(),
                    "scale {scale}: {s:?} towards {d:?} meets {hit:?}"
                );
                let d = leaving(&mut rng, -out, 1e-3);
                let hit = geometry.intersect(&parts, &s.spawn(d));
                assert!(hit.is_some(), "scale {scale}: {s:?} towards {d:?} is lost");
            }
        }
    }
}

#[test]
fn self_intersection_on_flat_ground_of_mixed_triangles() {
    // Adjacent spacings from 1e-3 to 100 units.
    let ticks: Vec<f32> = (0..24).map(|k| 1e-3 * 1.7f32.powi(k)).collect();
    let n = ticks.len() as u32;
    let mesh = Mesh {
        positions: (0..n * n)
            .map(|k| Vec3::new(ticks[(k % n) as usize], 0.0, ticks[(k / n) as usize]))
            .collect(),
        indices: (0..(n - 1) * (n - 1))
            .flat_map(|k| {
                let a = k / (n - 1) * n + k % (n - 1);
                [[a, a + n, a + n + 1], [a, a + n + 1, a + 1]]
            })
            .collect(),
        ..Mesh::default()
    };
    for scale in SCALES {
        let parts = parts_of(vec![transformed(mesh.clone(), scale, Vec3::ZERO)]);
        let geometry = geometry_of(&parts);
        let mut rng = rng(50);
        for _ in 0..20_000 {
            let [a, b, c] = geometry.triangle(TriangleId::single(
                rng.random_range(0..geometry.triangle_count() as u32),
            ));
            let (u, v) = (rng.random::<f32>(), rng.random::<f32>());
            let on = a + u * (b - a) + v * (1.0 - u) * (c - a);
            let up = (b - a).cross(c - a).normalize();
            let from = on + up * scale;
            let Some((_, s)) = meet(&geometry, &parts, &Ray::new(from, (on - from).normalize()))
            else {
                continue;
            };
            for side in [s.ng, -s.ng] {
                let d = leaving(&mut rng, side, 0.05);
                let hit = geometry.intersect(&parts, &s.spawn(d));
                assert!(
                    hit.is_none(),
                    "scale {scale}: {s:?} towards {d:?} meets {hit:?}"
                );
            }
        }
    }
}

#[test]
fn self_intersection_between_thin_shells_at_every_scale() {
    const GAP: f32 = 4e-5;
    let mut shells = square(1.0, 0.0).to_vec();
    shells.extend(square(1.0, -GAP));
    for scale in SCALES {
        let parts = parts_of(vec![transformed(mesh_of(&shells), scale, Vec3::ZERO)]);
        let geometry = geometry_of(&parts);
        let up = geometry.surface(
            &parts,
            &Hit {
                t: 1.0,
                triangle: TriangleId::single(0),
                u: 0.3,
                v: 0.3,
            },
        );
        let mut rng = rng(60);
        for _ in 0..20_000 {
            let d = -leaving(&mut rng, up.ng, 0.02);
            let [a, b, c] = geometry.triangle(TriangleId::single(rng.random_range(0..2)));
            let (u, v) = (rng.random_range(0.1..0.4), rng.random_range(0.1..0.4));
            let on = a + u * (b - a) + v * (c - a);
            let ray = Ray::new(on - d * scale, d);
            let (first, s) = meet(&geometry, &parts, &ray).expect("upper shell");
            assert!(first.triangle.index() < 2, "scale {scale}");
            let (second, s) = meet(&geometry, &parts, &s.spawn(d)).expect("lower shell");
            let expected = GAP * scale / -d.dot(up.ng);
            assert!(second.triangle.index() >= 2, "scale {scale}: {second:?}");
            assert!(
                (second.t / expected - 1.0).abs() < 0.1,
                "{second:?} {expected}"
            );
            assert!(geometry.intersect(&parts, &s.spawn(d)).is_none());
            let (back, _) = meet(&geometry, &parts, &s.spawn(-d)).expect("upper shell again");
            assert!(back.triangle.index() < 2, "scale {scale}: {back:?}");
        }
    }
}

#[test]
fn scale_invariance_by_a_power_of_two_is_bit_identical() {
    let base = transformed(bumpy_sphere(40, 80), 1.0, Vec3::new(0.3, 0.2, -0.4));
    let parts: Vec<_> = [0, -10, 20]
        .map(|e| {
            let mut mesh = base.clone();
            mesh.positions.iter_mut().for_each(|p| *p *= 2.0f32.powi(e));
            (2.0f32.powi(e), parts_of(vec![mesh]))
        })
        .into();
    let scenes: Vec<_> = parts.iter().map(|(s, p)| (s, p, geometry_of(p))).collect();
    let mut rng = rng(70);
    for _ in 0..5000 {
        let (origin, dir) = (point(&mut rng, 2.0), direction(&mut rng));
        let mut seen = scenes.iter().map(|(scale, parts, geometry)| {
            meet(geometry, parts, &Ray::new(origin * **scale, dir)).map(|(hit, s)| {
                (
                    hit.triangle,
                    hit.t / **scale,
                    hit.u,
                    hit.v,
                    s.position / **scale,
                    s.error / **scale,
                )
            })
        });
        let first = seen.next().expect("three scenes");
        assert!(seen.all(|other| other == first));
    }
}

#[test]
fn surface_interpolates_attributes() {
    let mut mesh = mesh_of(&square(1.0, 0.0)[..1]);
    mesh.normals = vec![Vec3::Z, Vec3::new(0.6, 0.0, 0.8), Vec3::Z];
    mesh.uvs = vec![Vec2::ZERO, Vec2::X, Vec2::ONE];
    let parts = parts_of(vec![mesh]);
    let geometry = geometry_of(&parts);
    for (z, dir) in [(1.0, Vec3::NEG_Z), (-1.0, Vec3::Z)] {
        let (hit, s) =
            meet(&geometry, &parts, &Ray::new(Vec3::new(0.5, 0.0, z), dir)).expect("hit");
        assert_eq!(s.ng, Vec3::Z, "by the winding, not by the viewer");
        assert_eq!(s.uv, Vec2::ZERO, "no texture needs them");
        let uv = geometry.uv(&parts, &hit);
        assert!((uv - Vec2::new(0.75, 0.5)).length() < 1e-6, "{uv}");
        assert!((s.position - Vec3::new(0.5, 0.0, 0.0)).length() < 1e-6);
        let n = (0.75 * Vec3::Z + 0.25 * Vec3::new(0.6, 0.0, 0.8)).normalize();
        assert!((s.ns - n).length() < 1e-6, "{s:?} {hit:?}");
    }
    assert_eq!(
        geometry.triangle_uvs(&parts, TriangleId::single(0))[2],
        Vec2::ONE
    );
    assert_eq!(geometry.triangle_area(TriangleId::single(0)), 2.0);
    assert_eq!(
        geometry.bounds(),
        (Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, 1.0, 0.0))
    );
}

#[test]
fn shading_normal_and_geometric_normal_agree_on_sides() {
    let mut rng = rng(80);
    let mut bent = 0;
    for _ in 0..2000 {
        let mut mesh = mesh_of(&square(1.0, 0.0)[..1]);
        // Random normals, some of them zero, NaN or grazing.
        mesh.normals = (0..3)
            .map(|_| match rng.random_range(0..8) {
                0 => Vec3::ZERO,
                1 => Vec3::NAN,
                2 => Vec3::X,
                _ => direction(&mut rng),
            })
            .collect();
        let parts = parts_of(vec![mesh]);
        let geometry = geometry_of(&parts);
        let wo = direction(&mut rng);
        let on = Vec3::new(0.5, -0.2, 0.0);
        let Some((_, s)) = meet(&geometry, &parts, &Ray::new(on + wo, -wo)) else {
            continue;
        };
        let (n, cos) = (s.frame_for(wo).n, wo.dot(s.ng));
        let mirrored = (2.0 * wo.dot(n) * n - wo).dot(s.ng) * cos.signum();
        assert!(s.ns.dot(s.ng) >= 0.0, "{:?}", s.ns);
        assert!((n.length() - 1.0).abs() < 1e-5, "{n:?}");
        assert!(n.dot(s.ng) >= 0.0, "{n:?}");
        assert!(wo.dot(n) * cos >= 0.0, "{n:?} {wo:?}");
        assert!(mirrored >= -1e-6, "{n:?} {wo:?}: {mirrored}");
        bent += usize::from(n != s.ns);
    }
    assert!(bent > 100, "only {bent} normals were bent");
}

/// Triangles of curved surfaces have a `rise` above the facet; others have none, bit for bit as without this feature.
#[test]
fn only_facets_of_curved_opaque_surfaces_rise() {
    let ball = |divisions| shapes::sphere(Vec3::ZERO, 1.0, divisions);
    let faceted = || {
        let of = |[a, b, c]: [u32; 3]| [a, b, c].map(|i| ball(1).positions[i as usize]);
        let corners: Vec<_> = ball(1).indices.iter().map(|face| of(*face)).collect();
        let normal = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a).normalize();
        Mesh {
            normals: corners.iter().flat_map(|c| [normal(c); 3]).collect(),
            indices: (0..corners.len() as u32)
                .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
                .collect(),
            positions: corners.into_iter().flatten().collect(),
            ..Mesh::default()
        }
    };
    let rounded = || {
        let mut cube = shapes::cuboid(Vec3::NEG_ONE, Vec3::ONE);
        cube.normals = cube.positions.iter().map(|p| p.normalize()).collect();
        cube
    };
    let hollow = || {
        let mut ball = ball(1);
        ball.indices.iter_mut().for_each(|face| face.swap(1, 2));
        ball
    };
    // Facets with one normal at all corners, tilted against the facet's own.
    let leaning = || {
        let mut mesh = faceted();
        for normals in mesh.normals.chunks_exact_mut(3) {
            normals.fill((normals[0] + 0.3 * normals[0].any_orthonormal_vector()).normalize());
        }
        mesh
    };
    let matt = || materials::diffuse("matt", Rgb::ONE);
    let cases = [
        ("ball", matt(), ball(1), true),
        ("leaning", matt(), leaning(), false),
        (
            "metal",
            materials::metal("metal", Rgb::ONE, 0.2),
            ball(2),
            true,
        ),
        ("facets", matt(), faceted(), false),
        ("rounded cube", matt(), rounded(), false),
        ("hollow", matt(), hollow(), false),
        ("glass", materials::glass("glass", 1.5, 0.0), ball(1), false),
        ("lamp", materials::emitter("lamp", Rgb::ONE), ball(1), false),
    ];
    for (name, material, mesh, rises) in cases {
        let mut parts = SceneParts::default();
        parts.add(material, [mesh]);
        let scene = Scene::new(parts);
        let mut rng = rng(91);
        let mut passed = 0;
        for _ in 0..2000 {
            let dir = direction(&mut rng);
            let ray = Ray::new(-3.0 * dir + point(&mut rng, 0.3), dir);
            let hit = scene.intersect(&ray).expect("a hit");
            let surface = scene.surface_along(&hit, ray.dir);
            // Light subpaths and directions from behind use the facet alone.
            let others = [scene.surface(&hit), scene.surface_along(&hit, -ray.dir)];
            assert!(others.iter().all(|s| s.curved_height == 0.0), "{name}");
            let p = surface.position;
            assert!(
                rises || surface.curved_height == 0.0,
                "{name}: {}",
                surface.curved_height
            );
            // A ray that the facet alone would block leaves the whole ball.
            let out = (surface.ns - 1.001 * surface.ns.dot(surface.ng) * surface.ng).normalize();
            if rises && surface.ns.dot(out) > 0.1 {
                let height = (p + surface.curved_height * surface.ng).length();
                assert!(height > 0.98 && height < 1.06, "{name}: {height}");
                assert!(!scene.occluded(&surface.spawn_leaving(out)), "{name}: {p}");
                passed += 1;
            }
        }
        assert_eq!(rises, passed > 200, "{name}: {passed}");
    }
}

/// A light subpath evaluates its vertex twice, once towards the camera: the frame is the same.
#[test]
fn shading_frame_is_the_same_however_often_the_surface_is_looked_up() {
    let mut parts = SceneParts::default();
    parts.textures.push(Texture::rgba(1, 1, [[255; 4]]));
    let matt = Material {
        specular: 0.0,
        metallic: 0.0,
        base_color_texture: Some(TextureRef {
            texture: 0,
            second: false,
            transform: glam::Affine2::IDENTITY,
        }),
        ..Material::default()
    };
    let gloss = Material {
        specular: 1.0,
        alpha: 0.2,
        ..matt.clone()
    };
    for (material, least) in [(matt, -1.0), (gloss, 0.08)] {
        let mut parts = parts.clone();
        let mut quad = shapes::quad(Vec3::ZERO, Vec3::X, Vec3::Y);
        quad.uvs = vec![glam::Vec2::ZERO; 4];
        parts.add(material, [quad]);
        let scene = Scene::new(parts);
        let ray = Ray::new(Vec3::new(0.3, 0.3, 1.0), -Vec3::Z);
        let mut surface = scene.surface(&scene.intersect(&ray).expect("a hit"));
        for _ in 0..3 {
            scene.bsdf(&mut surface, 0.5);
            assert_eq!(surface.min_mirror_cos, least);
        }
    }
}

/// The bits of a frame.
fn bits(frame: Frame) -> [[u32; 3]; 3] {
    [frame.s, frame.t, frame.n].map(|v| v.to_array().map(f32::to_bits))
}

#[test]
fn shading_frame_bends_only_where_a_mirror_direction_would_graze() {
    let (base, mut rng) = (meet_square(), rng(81));
    let (mut level, mut bent) = (0, 0);
    for _ in 0..20_000 {
        let ng = direction(&mut rng);
        let ns = (ng + point(&mut rng, 0.5)).normalize();
        let surface = Surface { ng, ns, ..base };
        let w = direction(&mut rng);
        let side = if w.dot(ng) < 0.0 { -w } else { w };
        let frame = surface.frame_for(w);
        assert_eq!(bits(frame), bits(surface.frame_for(-w)), "two sides, {w}");
        // Edge-on, rounding may change the last digit.
        assert!(frame.n.dot(side) > -1e-6, "{ns} {w}");
        let mirrored = 2.0 * ns.dot(side) * ns - side;
        if mirrored.dot(ng) >= surface.min_mirror_cos {
            assert_eq!(bits(frame), bits(Frame::from_normal(ns)), "{ns} {w}");
            level += 1;
        } else {
            // For a grazing view the required cosine is smaller.
            if mirrored.dot(ng) < 0.9 * surface.min_mirror_cos.min(side.dot(ng)) - 1e-6 {
                assert_ne!(frame.n, ns, "{w} is mirrored below the surface");
            }
            bent += usize::from(frame.n != ns);
        }
    }
    assert!(level > 12_000 && bent > 2000, "{level} {bent}");
}

#[test]
fn shading_frame_is_that_of_one_surface_for_camera_rays_and_light_rays() {
    let mut sphere = bumpy_sphere(20, 40);
    sphere.normals = sphere.positions.iter().map(|p| p.normalize()).collect();
    let parts = parts_of(vec![sphere]);
    let geometry = geometry_of(&parts);
    let mut rng = rng(82);
    let (mut met, mut apart) = (0, 0);
    for _ in 0..20_000 {
        let (from, dir) = (3.0 * direction(&mut rng), point(&mut rng, 1.0));
        let Some((hit, camera)) =
            meet(&geometry, &parts, &Ray::new(from, (dir - from).normalize()))
        else {
            continue;
        };
        // Towards the same point from a light at another place.
        let to = leaving(&mut rng, camera.ng, 1e-3);
        let Some((other, light)) = meet(&geometry, &parts, &Ray::new(camera.position + to, -to))
        else {
            continue;
        };
        if other.triangle != hit.triangle {
            continue;
        }
        met += 1;
        assert_eq!(camera.ng, light.ng);
        assert!(
            (camera.ns - light.ns).length() < 1e-4,
            "{camera:?} {light:?}"
        );
        let wo = (from - camera.position).normalize();
        let value = [camera.frame_for(wo), light.frame_for(wo)];
        assert!((value[0].n - value[1].n).length() < 1e-2, "{value:?}");
        // A light subpath with the frame of its own direction would scatter off another surface.
        apart += usize::from((light.frame_for(to).n - value[0].n).length() > 1e-2);
    }
    assert!(met > 5000 && apart > 50, "{met} {apart}");
}

/// A point of a square.
fn meet_square() -> Surface {
    let parts = parts_of(vec![mesh_of(&square(1.0, 0.0))]);
    let ray = Ray::new(Vec3::new(0.3, 0.1, 1.0), Vec3::NEG_Z);
    let (_, surface) = meet(&geometry_of(&parts), &parts, &ray).expect("hit");
    surface
}

/// An opaque square below one with this opacity.
fn veiled(alpha_mode: AlphaMode, opacity: f32) -> SceneParts {
    let mut parts = parts_of(vec![mesh_of(&square(1.0, 0.0)), mesh_of(&square(1.0, 1.0))]);
    parts.meshes[1].material = 1;
    parts.materials.push(Material {
        alpha_mode,
        opacity,
        ..Material::default()
    });
    parts
}

#[test]
fn opacity_mask_cuts_holes() {
    for (mode, opacity, first) in [
        (AlphaMode::Mask(0.5), 0.4, 0),
        (AlphaMode::Mask(0.5), 0.5, 2),
        (AlphaMode::Opaque, 0.0, 2),
        (AlphaMode::Blend, 0.0, 0),
        (AlphaMode::Blend, 1.0, 2),
    ] {
        let parts = veiled(mode, opacity);
        let geometry = geometry_of(&parts);
        let ray = Ray::new(Vec3::new(0.4, 0.1, 2.0), Vec3::NEG_Z);
        let hit = geometry.intersect(&parts, &ray).expect("the ground");
        assert_eq!(hit.triangle.index(), first, "{mode:?} {opacity}");
        let short = Ray { t_max: 1.5, ..ray };
        assert_eq!(
            geometry.occluded(&parts, &short),
            first == 2,
            "{mode:?} {opacity}"
        );
    }
}

#[test]
fn opacity_blend_is_the_probability_of_a_hit() {
    let parts = veiled(AlphaMode::Blend, 0.3);
    let geometry = geometry_of(&parts);
    let mut rng = rng(90);
    let (mut there, n) = (0, 20_000);
    for _ in 0..n {
        let x = Vec3::new(
            rng.random_range(-0.9..0.9),
            rng.random_range(-0.9..0.9),
            2.0,
        );
        let ray = Ray::new(x, Vec3::NEG_Z);
        let hit = geometry.intersect(&parts, &ray).expect("the ground");
        let short = Ray { t_max: 1.5, ..ray };
        assert_eq!(geometry.occluded(&parts, &short), hit.triangle.index() >= 2);
        there += usize::from(hit.triangle.index() >= 2);
    }
    // Five standard deviations of a binomial.
    let sigma = (n as f64 * 0.3 * 0.7).sqrt();
    assert!(
        (there as f64 - 0.3 * n as f64).abs() < 5.0 * sigma,
        "{there} of {n}"
    );
}
