use super::*;
use crate::math::Vec3;
use crate::sampler::{Independent, SampleSource, Sampler, Seed};
use crate::scene::{SceneParts, SharedMesh};
use crate::unit::{materials, shapes};
use glam::{DAffine3, DVec3};

/// Two mirrors and two instances of a third, small and large ones, beside a diffuse quad: all cells of the mirrors
/// get equally many seeds.
#[test]
fn manifold_seeds_chi_square() {
    let mut parts = SceneParts::default();
    let quad = |x: f32, side: f32| shapes::quad(Vec3::X * x, side * Vec3::X, side * Vec3::Y);
    let both = [quad(0.0, 1.0), quad(10.0, 5.0)];
    parts.add(materials::metal("silver", Vec3::ONE, 0.0), both);
    let chalk = materials::diffuse("chalk", Vec3::ONE);
    parts.add(chalk, [quad(20.0, 1.0)]);
    // A mesh of four triangles that differ in area.
    let mut mesh = quad(0.0, 1.0);
    mesh.positions.push(Vec3::new(0.25, 0.25, 0.0));
    mesh.indices = vec![[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let poses = [(30.0, 1.0), (40.0, 5.0)].map(|(x, scale)| {
        let scale = DAffine3::from_scale(DVec3::splat(scale));
        DAffine3::from_translation(DVec3::X * x) * scale
    });
    parts.shared.push(SharedMesh {
        mesh,
        poses: poses.into(),
    });
    let scene = Scene::new(parts);
    let casters = Casters::of(&scene).expect("casters");
    const CELLS: usize = 4;
    const SEEDS: u32 = 64_000;
    let mut counts = [0u32; 4 * CELLS * CELLS];
    let mut stream = Independent { seed: Seed(1) }.stream(crate::math::UVec2::ZERO, 0);
    for _ in 0..SEEDS {
        let pick = stream.next_pick();
        let u = Vec2::new(stream.next_1d(), stream.next_1d());
        let at = scene
            .surface(&casters.point(pick, u).expect("a seed"))
            .position;
        let mirrors = [(0.0, 1.0), (10.0, 5.0), (30.0, 1.0), (40.0, 5.0)];
        let k = mirrors.partition_point(|&(x, _)| x <= at.x) - 1;
        let (x, side) = mirrors[k];
        let at = (at - x * Vec3::X) / side;
        let cell = |x: f32| ((x * CELLS as f32) as usize).min(CELLS - 1);
        counts[(k * CELLS + cell(at.x)) * CELLS + cell(at.y)] += 1;
    }
    let expected = f64::from(SEEDS) / counts.len() as f64;
    let square = |count: &u32| (f64::from(*count) - expected).powi(2) / expected;
    let chi2: f64 = counts.iter().map(square).sum();
    // 63 degrees of freedom, probability 1e-3.
    assert!(chi2 < 103.4, "{chi2}");
}
