//! Results of benches with known truth.

use opsr::image::Buffer;
use opsr::math::Rgb;
use opsr_lab::report::bench::Suite;
use opsr_lab::report::bench::errors::error_products;
use opsr_lab::report::bench::machine::Machine;
use opsr_lab::report::bench::results::{Inset, Point, Products, Results, Run, SceneFacts, VERSION};

/// Uniform in [−1, 1), a hash of (seed, salt).
fn wobble(seed: u64, salt: u64) -> f64 {
    let mut x = seed
        .wrapping_mul(0x9e37_79b9_7f4a_7c15)
        .wrapping_add(salt.wrapping_mul(0xd1b5_4a32_d192_ed03));
    for factor in [0xbf58_476d_1ce4_e5b9, 0x94d0_49bb_1331_11eb] {
        x = (x ^ (x >> 30)).wrapping_mul(factor);
    }
    x ^= x >> 31;
    (x >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// A planted method: relMSE(t) = noise/t + floor, seconds per sample, and the ratio of its energy.
pub(crate) struct Planted {
    pub(crate) name: &'static str,
    pub(crate) noise: f64,
    pub(crate) floor: f64,
    pub(crate) cost: f64,
    pub(crate) energy: f64,
}

pub(crate) fn planted(name: &'static str, noise: f64, floor: f64) -> Planted {
    Planted {
        name,
        noise,
        floor,
        cost: 1e-3,
        energy: 1.0,
    }
}

/// Results of a bench with known truth. Most of a seed's noise is common to all methods, as in a render.
pub(crate) fn recorded(methods: &[Planted], seeds: u32) -> Results {
    let list: String = methods
        .iter()
        .map(|m| format!("[[method]]\nname = '{}'\n", m.name))
        .collect();
    let suite = Suite::parse(&format!(
        "seeds = {seeds}\ntimes = [0.5, 1, 2, 4]\nsamples = [1, 64]\n\
         [[scene]]\nname = 'planted <scene>'\nbuiltin = 'plane'\nsize = [32, 32]\nreference_spp = 1\n{list}"
    ))
    .unwrap();
    let mut results = Results {
        version: VERSION,
        program: "0".into(),
        command: "opsr bench suite.toml".into(),
        machine: Machine {
            cpu: "a <processor>".into(),
            cores: 2,
            threads: 2,
            system: "none".into(),
        },
        scenes: vec![SceneFacts {
            name: suite.scenes[0].name.clone(),
            triangles: 2,
            source: "plane".into(),
            reference: "planted".into(),
            reference_noise: 0.0,
        }],
        suite,
        cells: Vec::new(),
        products: Vec::new(),
        insets: Vec::new(),
    };
    for seed in 1..=u64::from(seeds) {
        for (i, m) in methods.iter().enumerate() {
            results.cells.push(cell(m, seed, i as u64));
        }
    }
    let reference = shade(0.0, 0, 0);
    for (i, m) in methods.iter().enumerate() {
        let pictures: Vec<Buffer> = (1..=u64::from(seeds))
            .map(|s| shade(m.energy - 1.0, s, i as u64))
            .collect();
        results.products.push(Products {
            scene: results.suite.scenes[0].name.clone(),
            method: m.name.into(),
            keys: Vec::new(),
            values: error_products(&pictures, &reference),
        });
        results.insets.push(inset(Some(m.name), &pictures[0]));
    }
    results.insets.push(inset(None, &reference));
    results
}

fn cell(m: &Planted, seed: u64, salt: u64) -> Run {
    let point = |samples: u32, t: f64| {
        let luck = 1.0 + 0.2 * wobble(seed, 99) + 0.03 * wobble(seed, salt);
        let error = m.noise / t * luck + m.floor;
        let energy = m.energy + 0.002 * wobble(seed, 50 + salt);
        Point {
            samples,
            wall: t,
            cpu: 2.0 * t,
            errors: [
                ("relMSE".to_owned(), error),
                ("FLIP".to_owned(), error.sqrt()),
                ("energy ratio".to_owned(), energy),
            ]
            .into(),
        }
    };
    let cost = m.cost * (1.0 + 0.05 * wobble(seed, 7) + 0.02 * wobble(seed, 8 + salt));
    let at = |t: f64| point((t / cost) as u32, t);
    Run {
        scene: "planted <scene>".into(),
        method: m.name.into(),
        seed,
        key: format!("{} {seed}", m.name),
        points: vec![
            point(1, cost),
            point(64, 64.0 * cost),
            at(0.51),
            at(1.01),
            at(2.005),
            at(4.0),
        ],
        paths: (4.0 / cost * 1024.0) as u64,
        rejected: 0,
        pilot: 0.0,
        regularised: 0.125,
        memory: Some(100.0),
        refused: None,
    }
}

/// A picture of radiance near ½ with noise of about 0.03, too bright by `bias`; without noise for seed 0.
fn shade(bias: f64, seed: u64, salt: u64) -> Buffer {
    Buffer::from_fn(32, 32, |x, y| {
        let truth = 0.4 + 0.2 * x as f64 / 32.0;
        let noise = if seed == 0 {
            0.0
        } else {
            0.05 * wobble(seed * 7919 + salt, (x * 32 + y) as u64)
        };
        Rgb::splat((truth * (1.0 + bias) + noise) as f32)
    })
}

fn inset(method: Option<&str>, picture: &Buffer) -> Inset {
    Inset {
        scene: "planted <scene>".into(),
        method: method.map(str::to_owned),
        key: String::new(),
        samples: 100,
        seconds: 4.0,
        width: picture.width,
        pixels: Inset::encode(picture),
    }
}
