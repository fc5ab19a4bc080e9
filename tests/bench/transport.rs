//! Nanoseconds of a lobe, and of a path: plain, roughened, and with the roughened lobe reused.
//!
//! `cargo bench --bench transport`; times are taken in turns, so that a drifting machine favours none.

use clock::Contestant;
use opsr::bsdf::{Bsdf, Dielectric, Diffuse, Distribution, Glossy};
use opsr::image::Film;
use opsr::integrator::{Estimator, Picture, Settings, View};
use opsr::math::{Rgb, UVec2, Vec3};
use opsr::regularise::Rule;
use opsr::scene::Scene;
use opsr::scene::load::{LoadOptions, load};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg32;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

mod clock;

const ALPHA: f32 = 0.1;

fn bsdfs() -> [(&'static str, Bsdf); 3] {
    let distribution = Distribution::Beckmann;
    [
        (
            "diffuse",
            Bsdf::Diffuse(Diffuse {
                albedo: Rgb::splat(0.5),
            }),
        ),
        (
            "conductor",
            Bsdf::Glossy(Glossy {
                f0: Rgb::new(0.9, 0.6, 0.5),
                f90: 1.0,
                albedo: Rgb::ZERO,
                alpha: ALPHA,
                distribution,
            }),
        ),
        (
            "dielectric",
            Bsdf::Dielectric(Dielectric {
                eta: 1.5,
                tint: Rgb::ONE,
                alpha: ALPHA,
                distribution,
            }),
        ),
    ]
}

fn lobes() {
    let mut rng = Pcg32::seed_from_u64(1);
    let inputs: Vec<(Vec3, [f32; 3])> = (0..1024)
        .map(|_| {
            let mut u = || rng.random::<f32>();
            let wo = Vec3::new(u() - 0.5, u() - 0.5, u() + 0.1).normalize();
            (wo, [u(), u(), u()])
        })
        .collect();
    let mut contestants: Vec<Contestant> = Vec::new();
    for (name, bsdf) in bsdfs() {
        let pairs: Vec<(Vec3, Vec3)> = (inputs.iter())
            .filter_map(|&(wo, u)| Some((wo, bsdf.sample(ALPHA, wo, u)?.wi)))
            .collect();
        let inputs = &inputs;
        let sample = move || {
            for &(wo, u) in inputs {
                black_box(bsdf.sample(ALPHA, wo, u));
            }
        };
        contestants.push((format!("{name} sample"), inputs.len(), Box::new(sample)));
        let count = pairs.len();
        let eval = move || {
            for &(wo, wi) in &pairs {
                black_box(bsdf.eval(ALPHA, wo, wi));
            }
        };
        contestants.push((format!("{name} eval"), count, Box::new(eval)));
    }
    clock::in_turns(&contestants);
}

/// Paths per second of some methods on a training scene, in turns.
fn paths(file: &str) -> Result<(), Box<dyn std::error::Error>> {
    const TURNS: usize = 7;
    const SPP: u32 = 8;
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../training_scenes")
        .join(file);
    let scene = Scene::new(load(&path, &LoadOptions::default())?.parts);
    let camera = &scene.parts().cameras[0];
    let methods = [
        (Rule::Plain, false),
        (Rule::constant(0.1), false),
        (Rule::constant(0.1), true),
    ];
    let mut seconds = [(); 3].map(|()| Vec::new());
    for turn in 0..TURNS {
        for ((rule, reuse), times) in methods.iter().zip(&mut seconds) {
            let settings = Settings {
                estimator: Estimator::Path { reuse: *reuse },
                rule: rule.clone(),
                seed: turn as u64,
                ..Settings::default()
            };
            let mut picture = Picture {
                film: Film::new(UVec2::splat(128)),
                aovs: None,
                levels: None,
            };
            let clock = Instant::now();
            let view = View::of(&scene, camera, &picture.film);
            (settings.integrator()).pass(&view, 0..SPP, &mut picture);
            times.push(clock.elapsed().as_secs_f64());
        }
    }
    let median = |times: &Vec<f64>| {
        let mut sorted = times.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[TURNS / 2]
    };
    let plain = median(&seconds[0]);
    let rate = f64::from(128 * 128 * SPP) / plain / 1e6;
    println!(
        "{file}: plain {rate:.2} million paths per second; a roughened path costs {:.3} of a plain one, in reuse mode \
         {:.3}",
        median(&seconds[1]) / plain,
        median(&seconds[2]) / plain
    );
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for file in [
        "cornell_caustics.glb",
        "cornell_glossy.glb",
        "swimming_pool.glb",
    ] {
        paths(file)?;
    }
    lobes();
    Ok(())
}
