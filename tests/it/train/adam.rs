//! The optimiser beside Algorithm 1 of Kingma and Ba, *Adam: A Method for Stochastic Optimization*, ICLR 2015, in double precision.

use super::learning::learn;
use opsr::regularise::{LEN, Lookup};
use opsr_train::config::{Config, Optimiser};
use opsr_train::learn::model::Learner;

/// Adam of one parameter with the constants of the paper, then projection to an interval.
struct Adam {
    rate: f64,
    interval: [f64; 2],
    moments: [f64; 2],
    step: i32,
}

impl Adam {
    fn step(&mut self, value: f64, gradient: f64) -> f64 {
        let [first, second] = &mut self.moments;
        self.step += 1;
        *first = 0.9 * *first + 0.1 * gradient;
        *second = 0.999 * *second + 0.001 * gradient * gradient;
        let mean = *first / (1.0 - 0.9f64.powi(self.step));
        let square = *second / (1.0 - 0.999f64.powi(self.step));
        let [low, high] = self.interval;
        (value - self.rate * mean / (square.sqrt() + 1e-8)).clamp(low, high)
    }
}

/// Gradient of a class in a step: scales from 1e-7 to 1, changes of size and of sign. The first six steps move half of
/// the classes up, beyond the end of the interval, and later ones move them back.
fn gradient(class: usize, step: usize) -> f64 {
    let scale = 10f64.powi(-((class % 8) as i32));
    let size = [1.0, 0.1, 3.0, 0.01, 2.0, 0.5][step % 6];
    let sign = if (step < 6) == class.is_multiple_of(2) {
        -1.0
    } else {
        1.0
    };
    scale * size * sign
}

#[test]
fn steps_are_those_of_adam() {
    for (optimiser, rate) in [(Optimiser::Adam, 5e-4), (Optimiser::Log, 0.05)] {
        for start in [0.9997f32, 0.5, 0.0011] {
            let mut learner = Learner::new(optimiser, rate, Lookup::Nearest, start);
            let is_log = optimiser == Optimiser::Log;
            let to = |gamma: f64| if is_log { gamma.ln() } else { gamma };
            let from = |value: f64| if is_log { value.exp() } else { value };
            let adam = || Adam {
                rate,
                interval: [to(1e-3), to(1.0)],
                moments: [0.0; 2],
                step: 0,
            };
            let mut oracle: Vec<(Adam, f64)> =
                (0..LEN).map(|_| (adam(), to(start.into()))).collect();
            for step in 0..12 {
                let gradients: Vec<f64> = (0..LEN).map(|class| gradient(class, step)).collect();
                for ((adam, value), gradient) in oracle.iter_mut().zip(&gradients) {
                    let by_value = if is_log { from(*value) } else { 1.0 };
                    *value = adam.step(*value, gradient * by_value);
                }
                learner.step(&gradients);
                for (class, (gamma, (_, value))) in
                    learner.table().gammas.iter().zip(&oracle).enumerate()
                {
                    let expected = from(*value);
                    let apart = (f64::from(*gamma) - expected).abs();
                    let most = if is_log { 2e-5 * expected } else { 1e-6 };
                    assert!(
                        apart <= most,
                        "{optimiser:?} from {start}, class {class}, step {step}: {gamma}, expected {expected}"
                    );
                }
            }
        }
    }
}

/// The first step of Adam equals the learning rate for any gradient: 5·10⁻⁴ by default, as in the paper.
#[test]
fn default_rate_is_that_of_the_paper() {
    let config = Config {
        spp: 8,
        steps: 1,
        optimiser: Optimiser::Adam,
        start: 0.5,
        ..Config::default()
    };
    let outcome = learn(config, None, false, u32::MAX);
    let moved = |gamma: &&f32| (f64::from(**gamma) - 0.5).abs() > 1e-6;
    let gammas = outcome.table.gammas.iter().filter(moved);
    let steps: Vec<f64> = gammas.map(|&g| (f64::from(g) - 0.5).abs()).collect();
    assert!(steps.len() > 5, "{}", steps.len());
    for step in steps {
        assert!((step - 5e-4).abs() < 5e-6, "{step}");
    }
}
