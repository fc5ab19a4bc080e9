use super::*;
use crate::math::Rgb;
use crate::sampler::{Independent, SampleSource, Seed};

/// Sixteen states of very different weight; every second one takes a second number, from the other walk.
struct Bins;

const VALUES: [f32; 16] = [
    0.0, 1.0, 0.01, 3.0, 0.0, 0.0, 40.0, 0.2, 0.5, 0.0, 2.0, 0.0, 0.1, 9.0, 0.3, 1.0,
];

impl Target for Bins {
    fn evaluate(
        &mut self,
        light: &mut Numbers,
        camera: &mut Numbers,
        splats: &mut Vec<Splat>,
    ) -> f64 {
        splats.clear();
        let index = camera.next_bits() >> 28;
        let factor = match index % 2 {
            0 => 1.0,
            _ => 2.0 * light.next_1d(),
        };
        let value = VALUES[index as usize] * factor;
        splats.push(Splat {
            index,
            value: Rgb::splat(value),
        });
        f64::from(value)
    }
}

fn stream(index: u32, part: u32, pass: u32) -> IndependentStream {
    Independent { seed: Seed(11) }.stream(UVec2::new(index, part), pass)
}

/// The integral over every bin from passes of one chain each, whose start is drawn from a bootstrap of so few samples
/// that its mean is far off.
fn passes(constant: f64) -> [(f64, f64); 16] {
    const PASSES: u32 = 4000;
    const BOOTSTRAP: u32 = 24;
    const MUTATIONS: u32 = 60;
    let mut sums = [[0.0; 2]; 16];
    for pass in 0..PASSES {
        let start = |i: u32| [stream(i, 0, pass), stream(i, 1, pass)];
        let (mut splats, mut bootstrap) = (Vec::new(), Vec::new());
        let weights: Vec<f64> = (0..BOOTSTRAP)
            .map(|i| {
                let [light, camera] = start(i).map(Numbers::new);
                let target = Bins.evaluate(&mut { light }, &mut { camera }, &mut splats);
                bootstrap.extend(splats.iter().map(|splat| (*splat, target)));
                target
            })
            .collect();
        let total: f64 = weights.iter().sum();
        let mut left = total * f64::from(stream(0, 2, pass).next_1d());
        let chosen = weights.iter().position(|w| {
            left -= w;
            left < 0.0
        });
        let sources = Sources {
            start: start(chosen.unwrap_or(0) as u32),
            steps: [3, 4, 5].map(|part| stream(0, part, pass)),
        };
        let means = Means {
            pass: total / f64::from(BOOTSTRAP),
            constant,
            fresh: LARGE + f64::from(BOOTSTRAP) / f64::from(MUTATIONS),
        };
        let scale = 1.0 / f64::from(MUTATIONS);
        let mut bins = [0.0; 16];
        for (splat, target) in bootstrap {
            bins[splat.index as usize] += f64::from(splat.value.x) * scale / means.density(target);
        }
        for splat in run(&mut Bins, sources, MUTATIONS, means, scale) {
            bins[splat.index as usize] += f64::from(splat.value.x);
        }
        for (sum, bin) in sums.iter_mut().zip(bins) {
            sum[0] += bin;
            sum[1] += bin * bin;
        }
    }
    let n = f64::from(PASSES);
    sums.map(|[sum, squares]| {
        let mean = sum / n;
        (mean, ((squares / n - mean * mean) / n).sqrt())
    })
}

/// The means are exact for any constant, although the chains start from a small bootstrap.
#[test]
fn metropolis_bootstrap_normalisation_is_unbiased() {
    let exact = |i: usize| f64::from(VALUES[i]) / 16.0;
    let b: f64 = (0..16).map(exact).sum();
    for constant in [b, 0.6 * b, 2.0 * b] {
        for (i, (mean, error)) in passes(constant).into_iter().enumerate() {
            let off = (mean - exact(i)).abs();
            assert!(
                off <= 4.5 * error + 1e-12,
                "bin {i}: {mean} ± {error} for {}",
                exact(i)
            );
        }
    }
}

/// Small steps and acceptance alone keep the density in proportion to the target: flows between bins are balanced.
#[test]
fn metropolis_detailed_balance_of_small_steps() {
    let mut choices = stream(0, 9, 0);
    let mut light = Numbers::new(stream(0, 7, 0));
    let mut camera = Numbers::new(stream(0, 8, 0));
    // All weights are above 0, so that small steps reach every bin, and some states use no number of the light walk.
    let value = |bits: u32| 1.0 + f64::from(bits >> 28);
    let place = |light: &mut Numbers, camera: &mut Numbers| {
        let bits = camera.next_bits();
        if bits >> 31 == 1 {
            light.next_bits();
        }
        bits
    };
    let mut now = place(&mut light, &mut camera);
    light.accept();
    camera.accept();
    let mut flows = [[0u32; 16]; 16];
    let n = 2_000_000;
    for _ in 0..n {
        light.propose(Step::Small);
        camera.propose(Step::Small);
        let next = place(&mut light, &mut camera);
        if f64::from(choices.next_1d()) < value(next) / value(now) {
            flows[(now >> 28) as usize][(next >> 28) as usize] += 1;
            now = next;
            light.accept();
            camera.accept();
        } else {
            flows[(now >> 28) as usize][(now >> 28) as usize] += 1;
        }
    }
    let mut tested = 0;
    for (i, row) in flows.iter().enumerate() {
        for (j, &there) in row[..i].iter().enumerate() {
            let [a, b] = [there, flows[j][i]].map(f64::from);
            // Around a ring flows may differ by the number of turns, which is small.
            assert!(
                (a - b).abs() < 5.0 * (a + b).sqrt() + 1.0,
                "{i} {j}: {a} {b}"
            );
            tested += u32::from(a > 0.0);
        }
    }
    assert!(tested >= 16, "{tested}");
    let visits: Vec<f64> = flows
        .iter()
        .map(|row| row.iter().sum::<u32>().into())
        .collect();
    for (i, visits) in visits.iter().enumerate() {
        let expected = f64::from(n) * (i as f64 + 1.0) / 136.0;
        assert!(
            (visits / expected - 1.0).abs() < 0.1,
            "{i}: {visits} {expected}"
        );
    }
}

/// Steps are symmetric, and their sizes are log-uniform between [`STEPS`].
#[test]
fn metropolis_small_steps_are_symmetric() {
    let mut source = stream(0, 6, 0);
    let (mut positive, mut sum) = (0, 0.0);
    let n = 100_000;
    for _ in 0..n {
        let step = small_step(source.next_bits()) as i32;
        let size = f64::from(step.unsigned_abs()) / 4_294_967_296.0;
        assert!((1.0 / 1024.1..=1.0 / 63.9).contains(&size), "{size}");
        positive += i32::from(step > 0);
        sum += size.log2();
    }
    let even = 0.5 * f64::from(n);
    assert!((f64::from(positive) - even).abs() < 5.0 * (0.5 * even).sqrt());
    assert!((sum / f64::from(n) + 8.0).abs() < 0.02);
}
