use super::*;
use crate::math::UVec2;
use crate::math::discrete::tests::excess;
use crate::sampler::{Independent, SampleSource, Sampler, Seed};

/// Random numbers in [0, 1).
fn numbers(seed: u64) -> impl FnMut() -> f32 {
    let mut stream = Independent { seed: Seed(seed) }.stream(UVec2::ZERO, 0);
    move || stream.next_1d()
}

/// A density from records of a narrow lamp and of a faint sky, after three iterations, and the sums of the next.
fn learned() -> (Quadtree, Sums) {
    let lamp = square(Vec3::new(0.3, -0.5, 0.8).normalize());
    let (mut sums, mut density) = (Sums::default(), Quadtree::default());
    let mut u = numbers(1);
    for _ in 0..3 {
        for _ in 0..2000 {
            sums.add(
                lamp + 0.08 * Vec2::new(u() - 0.5, u() - 0.5),
                3.0 * u() + 0.1,
            );
            sums.add(Vec2::new(u(), u()), 0.3 * u() + 0.01);
        }
        density = sums.finish();
    }
    (density, sums)
}

#[test]
fn guide_map_of_the_sphere_inverts_and_keeps_areas() {
    let mut u = numbers(2);
    for _ in 0..1000 {
        let p = Vec2::new(u(), u());
        assert!((square(direction(p)) - p).abs().max_element() < 1e-5, "{p}");
    }
    for axis in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
        let p = square(axis);
        assert!(
            p.min_element() >= 0.0 && p.max_element() < 1.0,
            "{axis}: {p}"
        );
        assert!((direction(p) - axis).length() < 1e-3, "{axis}");
    }
    // The area of a strip of z is proportional to its height.
    let n = 100_000;
    let high = (0..n)
        .filter(|_| direction(Vec2::new(u(), u())).z > 0.6)
        .count();
    let share = high as f64 / f64::from(n);
    assert!((share - 0.2).abs() < 0.005, "{share}");
}

#[test]
fn guide_density_integrates_to_one() {
    let (density, _) = learned();
    // No leaf is smaller than a cell.
    const CELLS: usize = 1 << 10;
    let at = |i: usize| (i as f32 + 0.5) / CELLS as f32;
    let cells = (0..CELLS * CELLS).map(|i| Vec2::new(at(i / CELLS), at(i % CELLS)));
    let sum: f64 = cells.map(|p| f64::from(density.pdf(direction(p)))).sum();
    let integral = sum * 4.0 * std::f64::consts::PI / (CELLS * CELLS) as f64;
    assert!((integral - 1.0).abs() < 1e-3, "{integral}");
    assert_eq!(Quadtree::default().pdf(Vec3::Z), 0.0);
}

#[test]
fn chi_square_of_guide_directions() {
    let (density, _) = learned();
    const CELLS: usize = 64;
    const FINE: usize = 16;
    let mut expected = vec![0.0; CELLS * CELLS];
    let at = |i: usize| (i as f32 + 0.5) / (CELLS * FINE) as f32;
    for i in 0..CELLS * FINE {
        for j in 0..CELLS * FINE {
            let pdf = density.pdf(direction(Vec2::new(at(i), at(j))));
            expected[i / FINE * CELLS + j / FINE] += f64::from(pdf);
        }
    }
    let n = 400_000;
    let sum: f64 = expected.iter().sum();
    expected.iter_mut().for_each(|e| *e *= f64::from(n) / sum);
    let mut u = numbers(3);
    let mut counts = vec![0u32; CELLS * CELLS];
    for _ in 0..n {
        let p = CELLS as f32 * square(density.sample(Vec2::new(u(), u())).0);
        counts[p.x as usize * CELLS + p.y as usize] += 1;
    }
    let excess = excess(&counts, &expected);
    assert!(excess < 2.33, "{excess}");
}

#[test]
fn guide_is_refined_where_light_comes_from() {
    let (density, sums) = learned();
    let lamp = Vec3::new(0.3, -0.5, 0.8).normalize();
    let (bright, dark) = (sums.leaf_edge(square(lamp)), sums.leaf_edge(square(-lamp)));
    assert!(bright < 0.02 && dark > 0.1, "{bright} {dark}");
    assert!(density.pdf(lamp) > 100.0 * density.pdf(-lamp));
}
