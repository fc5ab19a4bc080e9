//! Metropolis light transport against path tracing and bidirectional path tracing, at three scales.

use crate::support::render::{film_with, scene};
use opsr::image::Film;
use opsr::integrator::{Estimator, Settings};
use opsr::math::Vec3;
use opsr::regularise::Rule;
use opsr::scene::{PunctualLight, Scene, SceneParts};

const SIZE: u32 = 24;

fn settings(estimator: Estimator, rule: Rule, seed: u64) -> Settings {
    Settings {
        estimator,
        rule,
        max_vertices: 8,
        seed,
        ..Settings::default()
    }
}

/// Means of square tiles of this edge, per channel.
fn tiles(film: &Film, edge: u32) -> Vec<[f64; 3]> {
    let mean = film.mean();
    let tile = |w: &opsr::image::film::Window| {
        let mut sum = [0.0; 3];
        for (x, y) in (w.y..w.y + w.h).flat_map(|y| (w.x..w.x + w.w).map(move |x| (x, y))) {
            for (s, v) in sum
                .iter_mut()
                .zip(mean.pixels[y as usize * mean.width + x as usize].to_array())
            {
                *s += f64::from(v) / w.len() as f64;
            }
        }
        sum
    };
    film.window.tiles(edge).iter().map(tile).collect()
}

/// Mean and standard error over independent pictures, because the pixels of one picture are correlated.
fn over(pictures: &[Vec<[f64; 3]>], tile: usize, channel: usize) -> (f64, f64) {
    let n = pictures.len() as f64;
    let values = pictures.iter().map(|p| p[tile][channel]);
    let mean = values.clone().sum::<f64>() / n;
    let squares: f64 = values.map(|v| (v - mean) * (v - mean)).sum();
    (mean, (squares / (n * (n - 1.0))).sqrt())
}

/// Independent pictures with this number of samples per pixel.
fn pictures(scene: &Scene, settings: &Settings, count: u64, spp: u32) -> Vec<Film> {
    (0..count)
        .map(|i| {
            let seed = settings.seed + 1000 * i;
            let settings = Settings {
                seed,
                ..settings.clone()
            };
            film_with(scene, &settings, SIZE, spp)
        })
        .collect()
}

/// Fails if pixels, tiles or the whole picture differ by more than their noise over independent pictures.
fn assert_agreement(name: &str, a: &[Film], b: &[Film]) {
    for edge in [4, 8, SIZE] {
        let of = |films: &[Film]| -> Vec<_> { films.iter().map(|f| tiles(f, edge)).collect() };
        let (a, b) = (of(a), of(b));
        let count = a[0].len();
        // Student's distribution of few pictures has longer tails than the normal one.
        let most = if count == 1 { 4.0 } else { 6.0 };
        let mut worst = 0.0f64;
        for (tile, channel) in (0..count).flat_map(|t| (0..3).map(move |c| (t, c))) {
            let ((x, dx), (y, dy)) = (over(&a, tile, channel), over(&b, tile, channel));
            let t = (x - y) / dx.hypot(dy).max(1e-9 * x.abs().max(1e-9));
            worst = worst.max(t.abs());
            assert!(
                t.abs() < most,
                "{name}: tile {tile} of edge {edge}, channel {channel}: {x} ± {dx}, {y} ± {dy}"
            );
        }
        println!("{name}: edge {edge}: at most {worst:.2} standard errors");
    }
}

const PATH: Estimator = Estimator::Path { reuse: false };
const MLT: Estimator = Estimator::Mlt { mutations: 8 };

#[test]
fn agreement_of_mlt_with_path() {
    let wanted = [
        "cornell box",
        "rough glass",
        "sharp coat",
        "sun",
        "point",
        "spot",
        "parallel camera",
        "normal map",
        "blend leaf",
        "absorbing bottle",
    ];
    for (name, parts, _) in super::all_scenes() {
        if !wanted.contains(&name) {
            continue;
        }
        let scene = scene(parts);
        let a = pictures(&scene, &settings(PATH, Rule::Plain, 1), 24, 48);
        let b = pictures(&scene, &settings(MLT, Rule::Plain, 2), 24, 1);
        assert_agreement(name, &a, &b);
    }
}

/// A point light beside a mirror, which no strategy can sample: the regularised target, with one radius per pass.
#[test]
fn agreement_of_mollified_mlt_with_bdpt() {
    use opsr_lab::gallery::materials::{diffuse, metal};
    use opsr_lab::gallery::shapes::quad;
    let mut parts = SceneParts::default();
    let floor = quad(Vec3::new(-1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::X * 2.0);
    parts.add(diffuse("floor", Vec3::splat(0.5)), [floor]);
    let beside = quad(Vec3::new(1.0, 0.0, -1.0), Vec3::Z * 2.0, Vec3::Y * 1.5);
    parts.add(metal("mirror", Vec3::ONE, 0.0), [beside]);
    parts.lights.push(PunctualLight::Point {
        position: Vec3::new(0.2, 0.6, 0.1),
        intensity: Vec3::splat(2.0),
        range: f32::INFINITY,
    });
    parts.add_camera([-1.5, 1.0, 0.4], [0.6, 0.3, 0.0], 50.0);
    let scene = scene(parts);
    let rule = || Rule::Mollifier(0.05);
    let a = pictures(&scene, &settings(Estimator::Bdpt, rule(), 1), 24, 4);
    let b = pictures(&scene, &settings(MLT, rule(), 2), 24, 4);
    assert_agreement("mirror", &a, &b);
    // The mollifier adds light.
    let plain = pictures(&scene, &settings(MLT, Rule::Plain, 2), 8, 1);
    let of = |films: &[Film]| -> Vec<_> { films.iter().map(|f| tiles(f, SIZE)).collect() };
    let (more, less) = (over(&of(&b), 0, 0).0, over(&of(&plain), 0, 0).0);
    assert!(more > 1.02 * less, "{more} {less}");
}

/// All pixels of a pass share the noise of its bootstrap, which has a quarter of the mutations, not a sixteenth.
#[test]
fn metropolis_normalisation_has_little_noise_at_one_pass() {
    let (_, parts, _) = super::all_scenes().swap_remove(0);
    let mlt = Estimator::Mlt { mutations: 32 };
    let passes = pictures(&scene(parts), &settings(mlt, Rule::Plain, 3), 64, 1);
    let passes: Vec<_> = passes.iter().map(|film| tiles(film, SIZE)).collect();
    let (mean, error) = over(&passes, 0, 0);
    let deviation = error * 8.0 / mean;
    println!("relative deviation {deviation:.4}");
    assert!(deviation < 0.18, "{deviation}");
}
