//! Scenes of many lights: the choice among them is right, and good.

use super::support::chi2::{assert_likely, p_value};
use super::support::render::{film, film_with, mean, scene};
use opsr::gallery::materials::{diffuse, emitter};
use opsr::gallery::shapes::{quad, room, sphere};
use opsr::integrator::Settings;
use opsr::math::discrete::{AliasTable, Distribution2D};
use opsr::math::{DVec2, Rgb, UVec2, Vec3};
use opsr::regularise::Rule;
use opsr::sampler::{Independent, IndependentStream, SampleSource, Sampler, Seed};
use opsr::scene::{PunctualLight, SceneParts};
use opsr::stats::agreement::agree;

fn stream(seed: u64) -> IndependentStream {
    Independent { seed: Seed(seed) }.stream(UVec2::ZERO, 0)
}

#[test]
fn chi_square_of_alias_tables_of_many_skewed_outcomes() {
    // One lamp a thousand times as strong as all others together; powers over six decades.
    let beside_a_lamp = |n: usize| {
        let dim = move |i| if i == 0 { 1e3 } else { 1.0 / n as f64 };
        (0..n).map(dim).collect::<Vec<f64>>()
    };
    let mut u = stream(1);
    let spread: Vec<f64> = (0..1_000_000)
        .map(|_| 10f64.powf(-6.0 * f64::from(u.next_1d())))
        .collect();
    let mut found = Vec::new();
    for (name, weights) in [
        ("lamp and 1e5", beside_a_lamp(100_000)),
        ("lamp and 1e6", beside_a_lamp(1_000_000)),
        ("six decades", spread),
    ] {
        let table = AliasTable::new(&weights);
        let draws = 10_000_000;
        let mut counts = vec![0u32; weights.len()];
        for _ in 0..draws {
            let (i, _) = table.sample(u.vertex().light.pick).unwrap();
            counts[i] += 1;
        }
        let total: f64 = weights.iter().sum();
        let expected: Vec<f64> = weights
            .iter()
            .map(|w| w / total * f64::from(draws))
            .collect();
        found.push((p_value(&counts, &expected), name.to_owned()));
        // All dim outcomes together.
        let dim: u32 = counts[1..].iter().sum();
        let pooled = [counts[0], dim];
        let expected = [expected[0], expected[1..].iter().sum()];
        if expected[0] > 10.0 {
            found.push((p_value(&pooled, &expected), format!("{name}, pooled")));
        }
    }
    assert_likely(&found);
}

#[test]
fn chi_square_of_dim_texels_beside_a_sun() {
    // A row of an 8k map: 4096 texels that have a billionth of the sun's probability each, then the sun.
    const N: usize = 8192;
    let weights: Vec<f64> = (0..N).map(|x| if x == N / 2 { 1e9 } else { 1.0 }).collect();
    let map = Distribution2D::new(N, &weights).unwrap();
    let (dim, draws) = (N / 2, 1_000_000);
    let below = dim as f64 / (1e9 + N as f64 - 1.0);
    let mut counts = vec![0u32; dim];
    let mut u = stream(2);
    for _ in 0..draws {
        let (point, pdf) = map.sample(DVec2::new(u.vertex().light.pick * below, 0.5));
        let x = (point.x * N as f32) as usize;
        // The rounding of the sums may move the last draws into the sun.
        if let Some(count) = counts.get_mut(x) {
            *count += 1;
            assert!((pdf * 1e9 / N as f32 - 1.0).abs() < 1e-3, "{pdf}");
        }
    }
    let expected = vec![f64::from(draws) / dim as f64; dim];
    assert_likely(&[(p_value(&counts, &expected), "texels".to_owned())]);
}

/// A floor under an emissive ball of many triangles, seen below the ball.
fn ball_over_floor() -> SceneParts {
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::Z * 8.0, Vec3::X * 8.0);
    parts.add(diffuse("floor", Rgb::splat(0.5)), [floor]);
    parts.add(
        emitter("ball", Rgb::ONE),
        [sphere(Vec3::new(0.0, 2.0, 0.0), 0.5, 6)],
    );
    parts.add_camera([0.0, 0.5, 1.5], [0.0, 0.0, 0.0], 1.0);
    parts
}

#[test]
fn a_lamp_that_lights_nothing_changes_nothing() {
    let settings = Settings {
        max_vertices: 1,
        ..Settings::default()
    };
    let alone = film_with(&scene(ball_over_floor()), &settings, 4, 2048);
    let mut parts = ball_over_floor();
    // A panel below the floor that faces down, with a thousand times the power of the ball.
    let panel = quad(Vec3::new(-0.5, -1.0, -0.5), Vec3::X, Vec3::Z);
    parts.add(emitter("lamp", Rgb::splat(3142.0)), [panel]);
    let beside = film_with(&scene(parts), &settings, 4, 1 << 16);
    let (expected, found) = (mean(&alone), mean(&beside));
    println!("mean without lamp {expected:?}, beside the lamp {found:?}");
    assert!(
        (found.0 / expected.0 - 1.0).abs() < 0.02,
        "{found:?} {expected:?}"
    );
    // The ball as a disk: radiance 1, form factor (r/h)².
    assert!(
        (expected.0 / (0.5 / 16.0) - 1.0).abs() < 0.01,
        "{expected:?}"
    );
}

#[test]
fn a_sun_outside_a_closed_room_changes_nothing() {
    let closed = |sun: bool| {
        let mut parts = SceneParts::default();
        let walls = room(Vec3::new(-1.0, 0.0, -1.0), Vec3::new(1.0, 2.0, 1.0));
        parts.add(diffuse("walls", Rgb::splat(0.6)), walls);
        parts.add(
            emitter("ball", Rgb::ONE),
            [sphere(Vec3::new(0.0, 1.2, 0.0), 0.2, 5)],
        );
        if sun {
            parts.lights.push(PunctualLight::Directional {
                direction: -Vec3::Y,
                irradiance: Rgb::splat(20.0),
            });
        }
        parts.add_camera([0.0, 0.5, 0.9], [0.0, 0.5, -1.0], 60.0);
        scene(parts)
    };
    let dark = film(&closed(false), Rule::Plain, 16, 512, 1);
    let sunny = film(&closed(true), Rule::Plain, 16, 2048, 2);
    let (expected, found) = (mean(&dark), mean(&sunny));
    println!("mean without sun {expected:?}, with {found:?}");
    assert!(
        (found.0 / expected.0 - 1.0).abs() < 0.01,
        "{found:?} {expected:?}"
    );
    let agreement = agree(&dark, &sunny).unwrap();
    assert!(agreement.passed(), "{agreement}");
}
