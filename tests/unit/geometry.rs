//! The bounding volume hierarchy: agreement with brute force, watertightness, determinism.

use crate::math::{Ray, Vec3};
use crate::scene::accel::Accel;
use crate::scene::{Geometry, Material, Mesh, SceneParts, TriangleId};
use crate::unit::support::draws::{direction, point, rng};
use rand::RngExt;

/// Small random triangles in a cube of half size `size`, with edges up to `edge`.
fn soup(seed: u64, count: usize, size: f32, edge: f32) -> Vec<[Vec3; 3]> {
    let mut rng = rng(seed);
    (0..count)
        .map(|_| {
            let a = point(&mut rng, size);
            [a, a + point(&mut rng, edge), a + point(&mut rng, edge)]
        })
        .collect()
}

/// A closed sphere whose radius is displaced by up to 20 %.
pub(crate) fn bumpy_sphere(rings: u32, segments: u32) -> Mesh {
    let vertex = |i: u32, j: u32| {
        let theta = std::f32::consts::PI * i as f32 / rings as f32;
        let phi = std::f32::consts::TAU * (j % segments) as f32 / segments as f32;
        let d = Vec3::new(
            theta.sin() * phi.cos(),
            theta.cos(),
            theta.sin() * phi.sin(),
        );
        d * (1.0 + 0.1 * (9.0 * d.x).sin() * (7.0 * d.y).cos() + 0.1 * (31.0 * d.z).sin())
    };
    let mut positions = vec![vertex(0, 0)];
    for i in 1..rings {
        positions.extend((0..segments).map(|j| vertex(i, j)));
    }
    positions.push(vertex(rings, 0));
    let last = positions.len() as u32 - 1;
    let at = |i: u32, j: u32| match i {
        0 => 0,
        i if i == rings => last,
        i => 1 + (i - 1) * segments + j % segments,
    };
    let mut indices = Vec::new();
    for i in 0..rings {
        for j in 0..segments {
            let (a, b, c, d) = (at(i, j), at(i, j + 1), at(i + 1, j), at(i + 1, j + 1));
            if i > 0 {
                indices.push([a, b, d]);
            }
            if i < rings - 1 {
                indices.push([a, d, c]);
            }
        }
    }
    Mesh {
        positions,
        indices,
        ..Mesh::default()
    }
}

pub(crate) fn mesh_of(triangles: &[[Vec3; 3]]) -> Mesh {
    Mesh {
        positions: triangles.iter().flatten().copied().collect(),
        indices: (0..triangles.len() as u32)
            .map(|i| [3 * i, 3 * i + 1, 3 * i + 2])
            .collect(),
        ..Mesh::default()
    }
}

pub(crate) fn parts_of(meshes: Vec<Mesh>) -> SceneParts {
    SceneParts {
        meshes,
        materials: vec![Material::default()],
        ..SceneParts::default()
    }
}

pub(crate) fn geometry_of(parts: &SceneParts) -> Geometry {
    let mut warnings = Vec::new();
    let geometry = Geometry::build(parts, true, &mut warnings);
    assert!(warnings.is_empty(), "{warnings:?}");
    geometry
}

/// A square of half size `half` at height `z`, facing +z.
pub(crate) fn square(half: f32, z: f32) -> [[Vec3; 3]; 2] {
    let p = |x: f32, y: f32| Vec3::new(x * half, y * half, z);
    [
        [p(-1.0, -1.0), p(1.0, -1.0), p(1.0, 1.0)],
        [p(-1.0, -1.0), p(1.0, 1.0), p(-1.0, 1.0)],
    ]
}

/// Möller–Trumbore in double precision over all triangles: distance, and margin inside the triangle.
fn brute_force(triangles: &[[Vec3; 3]], ray: &Ray) -> Option<(f64, f64)> {
    let (o, d) = (ray.origin.as_dvec3(), ray.dir.as_dvec3());
    let mut best: Option<(f64, f64)> = None;
    for t in triangles {
        let [a, b, c] = t.map(|p| p.as_dvec3());
        let (e1, e2) = (b - a, c - a);
        let q = d.cross(e2);
        let det = e1.dot(q);
        let s = o - a;
        let u = s.dot(q) / det;
        let r = s.cross(e1);
        let v = d.dot(r) / det;
        let dist = e2.dot(r) / det;
        let margin = u.min(v).min(1.0 - u - v);
        let near = best.is_none_or(|(t, _)| dist < t);
        if margin >= -1e-5 && dist > 0.0 && dist < f64::from(ray.t_max) && near {
            best = Some((dist, margin.min(det.abs())));
        }
    }
    best
}

fn compare_with_brute_force(triangles: &[[Vec3; 3]], seed: u64, size: f32, rays: usize) {
    let accel = Accel::new(triangles);
    let mut rng = rng(seed);
    let (mut hits, mut unsure) = (0, 0);
    for _ in 0..rays {
        let mut ray = Ray::new(point(&mut rng, 1.5 * size), direction(&mut rng));
        if rng.random::<f32>() < 0.3 {
            let [a, b, c] = triangles[rng.random_range(0..triangles.len())];
            ray.dir = ((a + b + c) / 3.0 - ray.origin).normalize();
        }
        if rng.random::<f32>() < 0.5 {
            ray.t_max = rng.random::<f32>() * 2.0 * size;
        }
        let hit = accel.closest(&ray);
        assert_eq!(accel.any(&ray), hit.is_some(), "{ray:?}");
        match (brute_force(triangles, &ray), hit) {
            (None, None) => {}
            (Some((t, _)), Some(h)) if (f64::from(h.t) - t).abs() <= 1e-4 * t.max(0.01) => {
                hits += 1;
            }
            // On an edge, or nearly edge-on, single precision may give another result.
            (Some((_, margin)), _) if margin < 1e-4 => unsure += 1,
            (expected, got) => panic!("{ray:?}: expected {expected:?}, got {got:?}"),
        }
    }
    assert!(hits * 20 > rays, "{hits} hits of {rays} test little");
    assert!(unsure * 100 < rays, "{unsure} of {rays} undecided");
}

#[test]
fn bvh_agrees_with_brute_force() {
    for (i, &(count, edge)) in [(1, 2.0), (3, 2.0), (17, 1.0), (200, 0.5), (3000, 0.1)]
        .iter()
        .enumerate()
    {
        let triangles = soup(i as u64, count, 1.0, edge);
        compare_with_brute_force(&triangles, 100 + i as u64, 1.0, 1000);
    }
}

#[test]
fn bvh_axis_parallel_rays_meet_axis_parallel_boxes() {
    // Directions with zero components of both signs, and origins on the planes of boxes.
    let triangles: Vec<_> = (0..5).flat_map(|k| square(1.0, k as f32)).collect();
    let accel = Accel::new(&triangles);
    for zero in [0.0, -0.0] {
        for x in [-0.5, 0.0, 0.25] {
            let down = Ray::new(Vec3::new(x, 0.25, 4.5), Vec3::new(zero, zero, -1.0));
            assert_eq!(accel.closest(&down).expect("straight down").t, 0.5);
            let mut short = down;
            short.t_max = 0.5;
            assert!(!accel.any(&short));
            let aside = Ray::new(Vec3::new(x, 0.25, 4.5), Vec3::new(1.0, zero, zero));
            assert!(!accel.any(&aside));
        }
    }
}

#[test]
fn watertight_no_ray_escapes_a_closed_mesh() {
    let mesh = bumpy_sphere(120, 240);
    let corners: Vec<_> = mesh
        .indices
        .iter()
        .map(|t| t.map(|i| mesh.positions[i as usize]))
        .collect();
    let accel = Accel::new(&corners);
    let mut rng = rng(7);
    for k in 0..1_000_000 {
        let origin = point(&mut rng, 0.3);
        let dir = if k % 4 == 0 {
            // Exactly towards a vertex or an edge.
            let t = corners[rng.random_range(0..corners.len())];
            let along = if k % 8 == 0 { 0.0 } else { rng.random() };
            (t[0].lerp(t[1], along) - origin).normalize()
        } else {
            direction(&mut rng)
        };
        assert!(accel.any(&Ray::new(origin, dir)), "{origin:?} {dir:?}");
    }
}

#[test]
fn bvh_of_an_empty_scene_has_no_hits() {
    let parts = parts_of(vec![]);
    let geometry = geometry_of(&parts);
    let ray = Ray::new(Vec3::ZERO, Vec3::Z);
    assert!(geometry.triangle_count() == 0);
    assert!(geometry.intersect(&parts, &ray).is_none());
    assert!(!geometry.occluded(&parts, &ray));
    assert_eq!(geometry.bounds(), (Vec3::ZERO, Vec3::ZERO));
}

#[test]
fn degenerate_triangles_are_dropped_and_counted() {
    let [good, other] = square(1.0, 0.0);
    let a = good[0];
    let mut bad = mesh_of(&[
        good,
        [a, a, other[1]],
        [a, a.lerp(Vec3::ZERO, 0.5), Vec3::ZERO],
        [a, Vec3::NAN, other[1]],
        [a, Vec3::splat(f32::INFINITY), other[1]],
        [a, Vec3::splat(3e30), other[1]],
        other,
    ]);
    bad.indices.push([0, 1, 999]);
    let parts = parts_of(vec![mesh_of(&square(1.0, 1.0)), bad]);
    let mut warnings = Vec::new();
    let geometry = Geometry::build(&parts, true, &mut warnings);
    assert_eq!(geometry.triangle_count(), 4);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0].contains("mesh 1: dropped 6 of 8"),
        "{warnings:?}"
    );
    assert_eq!(geometry.triangle(TriangleId::single(3)), other);
    let ray = Ray::new(Vec3::new(-0.3, 0.3, -1.0), Vec3::Z);
    assert_eq!(
        geometry
            .intersect(&parts, &ray)
            .expect("hit")
            .triangle
            .index(),
        3
    );
}

#[test]
fn bvh_ignores_triangles_that_are_not_finite() {
    let mut triangles = vec![[Vec3::NAN; 3]; 3];
    triangles.extend(square(1.0, 0.0));
    triangles.push([Vec3::INFINITY, Vec3::ZERO, Vec3::ONE]);
    let accel = Accel::new(&triangles);
    let ray = Ray::new(Vec3::new(0.5, 0.0, 1.0), Vec3::NEG_Z);
    assert_eq!(accel.closest(&ray).expect("hit").triangle.index(), 3);
    assert!(!Accel::new(&triangles[..3]).any(&ray));
    let lost = Ray::new(Vec3::NAN, Vec3::Z);
    assert!(accel.closest(&lost).is_none());
}

#[test]
fn bvh_ties_go_to_the_lowest_index() {
    let one = square(1.0, 0.0)[0];
    let mut triangles = soup(3, 50, 1.0, 0.1);
    triangles.extend([one; 40]);
    let accel = Accel::new(&triangles);
    let ray = Ray::new(Vec3::new(0.1, -0.2, 9.0), Vec3::NEG_Z);
    let mut blocked = ray;
    blocked.t_max = 8.0;
    if !accel.any(&blocked) {
        assert_eq!(accel.closest(&ray).expect("hit").triangle.index(), 50);
    }
    let far = Ray::new(Vec3::new(0.1, -0.2, 1e-3), Vec3::NEG_Z);
    assert_eq!(accel.closest(&far).expect("hit").triangle.index(), 50);
}

#[test]
fn bvh_avx2_and_portable_traversal_are_bit_identical() {
    for (seed, count, edge) in [(11, 500, 0.4), (12, 20_000, 0.05), (13, 2000, 2.0)] {
        let triangles = soup(seed, count, 1.0, edge);
        let (fast, plain) = (Accel::new(&triangles), Accel::portable(&triangles));
        let mut rng = rng(seed + 10);
        for _ in 0..5000 {
            let mut ray = Ray::new(point(&mut rng, 1.5), direction(&mut rng));
            if rng.random::<f32>() < 0.5 {
                ray.t_max = rng.random();
            }
            let bits = |hit: Option<crate::scene::Hit>| {
                hit.map(|h| (h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits()))
            };
            assert_eq!(
                bits(fast.closest(&ray)),
                bits(plain.closest(&ray)),
                "{ray:?}"
            );
            assert_eq!(fast.any(&ray), plain.any(&ray), "{ray:?}");
        }
    }
}

#[test]
fn determinism_hits_at_any_thread_count() {
    let triangles = soup(14, 60_000, 1.0, 0.03);
    let trees = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("a few threads")
            .install(|| Accel::new(&triangles))
    });
    let mut rng = rng(15);
    for _ in 0..20_000 {
        let ray = Ray::new(point(&mut rng, 1.5), direction(&mut rng));
        let [a, b] = trees.each_ref().map(|tree| {
            let hit = tree.closest(&ray);
            hit.map(|h| (h.t.to_bits(), h.triangle, h.u.to_bits(), h.v.to_bits()))
        });
        assert_eq!(a, b, "{ray:?}");
    }
}
