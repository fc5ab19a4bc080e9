//! Loop's subdivision: limits, normals, boundaries.

use opsr::math::Vec3;
use opsr::scene::Mesh;
use opsr_formats::build::subdivision::subdivided;
use std::f32::consts::TAU;

fn mesh(positions: &[[f32; 3]], indices: &[[u32; 3]]) -> Mesh {
    Mesh {
        positions: positions.iter().map(|&p| p.into()).collect(),
        indices: indices.to_vec(),
        ..Mesh::default()
    }
}

/// Bipyramids have vertices of valence 4 and of valence 3, 5, 6 or 7. Their vertices are on the limit surface at any
/// level. Normals are those of the surrounding faces, and point inwards as in pbrt.
#[test]
fn vertices_of_any_valence_converge_to_their_limit() {
    for n in [3u32, 5, 6, 7] {
        let ring = (0..n).map(|i| {
            let (sin, cos) = (i as f32 / n as f32 * TAU).sin_cos();
            [cos, sin, 0.1 * i as f32]
        });
        let points: Vec<[f32; 3]> = ring.chain([[0.1, 0.0, 1.0], [0.0, 0.2, -1.5]]).collect();
        let sides = (0..n).flat_map(|i| [[i, (i + 1) % n, n], [(i + 1) % n, i, n + 1]]);
        let pyramids = mesh(&points, &sides.collect::<Vec<_>>());
        let [coarse, finer] = [0, 6].map(|levels| subdivided(&pyramids, levels));
        let (coarse, finer) = (coarse.expect("a surface"), finer.expect("a surface"));
        for (a, b) in coarse.positions.iter().zip(&finer.positions) {
            assert!(a.distance(*b) < 1e-5, "{n}: {a} {b}");
        }
        // γ = 1 / (n + 3 / 8β), where β is 3/16 for three neighbours and 3/8n for others.
        let gamma = if n == 3 { 0.2 } else { 0.5 / n as f32 };
        let around: Vec3 = pyramids.positions[..n as usize].iter().sum();
        let apex = (1.0 - n as f32 * gamma) * pyramids.positions[n as usize] + gamma * around;
        assert!(coarse.positions[n as usize].distance(apex) < 1e-6, "{n}");
        let fine = subdivided(&pyramids, 4).expect("a surface");
        assert_eq!(fine.indices.len() as u32, 2 * n * 256);
        let mut across = vec![Vec3::ZERO; fine.positions.len()];
        for face in &fine.indices {
            let [a, b, c] = face.map(|i| fine.positions[i as usize]);
            face.iter()
                .for_each(|&i| across[i as usize] += (b - a).cross(c - a));
        }
        for (normal, across) in fine.normals.iter().zip(across) {
            assert!(normal.dot(across.normalize()) < -0.99, "{n}");
        }
    }
}

/// The boundary depends only on its own vertices, and a flat mesh remains flat.
#[test]
fn boundaries_follow_their_own_rule() {
    // Corners of two, three, four and five neighbours.
    let fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [5, 4, 6]];
    let points = [
        [0.0, 0.0, 0.0],
        [2.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
        [1.0, 2.0, 0.0],
        [-1.0, 2.0, 0.0],
        [-2.0, 0.0, 0.0],
        [-3.0, 2.0, 0.0],
    ];
    let flat = mesh(&points, &fan);
    let fine = subdivided(&flat, 3).expect("a surface");
    assert!(fine.positions.iter().all(|p| p.z == 0.0));
    assert!(
        fine.normals.iter().all(|n| n.z < -0.9999),
        "{:?}",
        fine.normals
    );
    // A straight boundary does not move.
    assert!(fine.positions[0].length() < 1e-6);
    let bent: Vec<[f32; 3]> = points
        .iter()
        .map(|p| [p[0], p[1], 0.3 * p[0] * p[1]])
        .collect();
    let bent = mesh(&bent, &fan);
    let z = |i: usize| 0.3 * points[i][0] * points[i][1];
    let at = |i: usize| Vec3::new(points[i][0], points[i][1], z(i));
    // At the last level neighbours on the boundary have a weight of 1/5, before it 1/8; edges are split in the middle.
    for (level, own) in [(0, 0.6), (1, 0.65)] {
        let found = subdivided(&bent, level).expect("a surface").positions[2];
        let expected = own * at(2) + 0.5 * (1.0 - own) * (at(1) + at(3));
        assert!(found.distance(expected) < 1e-6, "{level}: {found}");
    }
    assert!(subdivided(&mesh(&points, &[[0, 1, 2], [0, 1, 3]]), 1).is_none());
    assert!(subdivided(&mesh(&points, &[[0, 1, 2], [0, 3, 4]]), 1).is_none());
}
