//! The loss `[OPSR (16)]` in burn's tensors: moments of all crops in, loss and its derivative out.
//!
//! ```text
//! L = mean |I − f| / (f + ε)  +  β · mean N/(N − 1) (M₂ − M₁²)      ε = 0.01
//! ```
//!
//! over pixels and colour channels of all crops; I = M₁ is the realised mean of N samples, the second term the sample
//! variance of *one* path sample. Every crop is scaled so that its reference has the mean [`BRIGHTNESS`]: the second
//! term has the unit of radiance squared and the first none, and β must mean the same everywhere.

use super::moments::{Adjoint, Moments};
use burn::tensor::{Device, Tensor, TensorData};

/// ε of MAPE.
pub const EPSILON: f32 = 0.01;

/// Mean that the reference of every crop is scaled to.
pub const BRIGHTNESS: f32 = 0.3;

/// The device that tensors live on; burn's successor of this backend is `Device::flex()`.
#[allow(deprecated)]
pub(super) fn device() -> Device {
    Device::ndarray()
}

/// Numbers in a row.
pub(super) fn tensor(values: Vec<f32>, device: &Device) -> Tensor<1> {
    let shape = [values.len()];
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// What a loss compares with.
#[derive(Clone, Debug)]
pub struct Target {
    /// Converged, unregularised radiance, unscaled.
    pub reference: Vec<[f32; 3]>,
    /// Samples per pixel that the table is learned for.
    pub samples: u32,
}

impl Target {
    /// What radiance is multiplied by.
    pub fn scale(&self) -> f32 {
        let sum: f64 = (self.reference.iter().flatten())
            .map(|&v| f64::from(v))
            .sum();
        let mean = sum / (3 * self.reference.len().max(1)) as f64;
        if mean > 0.0 {
            (f64::from(BRIGHTNESS) / mean) as f32
        } else {
            1.0
        }
    }

    /// N/(N − 1).
    fn bessel(&self) -> f32 {
        let n = self.samples.max(2) as f32;
        n / (n - 1.0)
    }

    /// The reference as it is compared.
    fn scaled(&self) -> Vec<f32> {
        let scale = self.scale();
        (self.reference.iter().flatten())
            .map(|v| v * scale)
            .collect()
    }

    /// The loss of a crop with these moments.
    pub fn loss(&self, moments: &Moments) -> CropLoss {
        let references = self.scaled();
        let (mean, second) = scaled(moments, self.scale());
        let mut sums = [0.0f64; 4];
        for ((mean, references), second) in
            (mean.chunks_exact(3).zip(references.chunks_exact(3))).zip(second)
        {
            let mut squares = 0.0;
            for (&i, &f) in mean.iter().zip(references) {
                sums[0] += f64::from((i - f).abs() / (f + EPSILON));
                sums[1] += f64::from(i);
                sums[2] += f64::from(f);
                squares += i * i;
            }
            sums[3] += f64::from((second - squares) * self.bessel());
        }
        let values = references.len() as f64;
        CropLoss {
            mape: (sums[0] / values) as f32,
            variance: (sums[3] / values) as f32,
            energy: (sums[1] / sums[2].max(1e-30)) as f32,
        }
    }
}

/// Moments times a crop's scale, all channels of the means in a row.
fn scaled(moments: &Moments, scale: f32) -> (Vec<f32>, Vec<f32>) {
    (
        moments.mean.iter().flatten().map(|v| v * scale).collect(),
        moments.second.iter().map(|v| v * scale * scale).collect(),
    )
}

/// The loss of one crop.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct CropLoss {
    /// Mean absolute percentage error.
    pub mape: f32,
    /// Mean sample variance of one path sample.
    pub variance: f32,
    /// Rendered mean over reference mean.
    pub energy: f32,
}

impl CropLoss {
    /// Both terms together.
    pub fn total(&self, beta: f32) -> f32 {
        self.mape + beta * self.variance
    }
}

/// The loss of several crops.
pub struct Objective {
    parts: Vec<Part>,
}

/// The loss of one crop as a part of the whole: Σ w |x − r| + Σ x (c − q x) over the numbers x of its moments.
struct Part {
    /// What radiance is multiplied by.
    scale: f32,
    reference: Tensor<1>,
    /// w, of the means.
    errors: Tensor<1>,
    /// q, of the means.
    squares: Tensor<1>,
    /// c, of the second moments.
    linear: Tensor<1>,
}

impl Part {
    fn new(target: &Target, beta: f32, total: usize) -> Self {
        let scale = target.scale();
        let references = target.scaled();
        let share = 1.0 / (3 * total) as f32;
        let bessel = target.bessel();
        let pixels = target.reference.len();
        let weight = beta * bessel * share;
        let errors = references.iter().map(|f| share / (f + EPSILON)).collect();
        let device = device().autodiff();
        // The means, then the second moments.
        let numbers = |mut means: Vec<f32>, second: f32| {
            means.resize(4 * pixels, second);
            tensor(means, &device)
        };
        Self {
            scale,
            errors: numbers(errors, 0.0),
            reference: numbers(references, 0.0),
            squares: numbers(vec![weight; 3 * pixels], 0.0),
            linear: numbers(vec![0.0; 3 * pixels], weight),
        }
    }

    /// The crop's share of the loss, and its derivative by the moments.
    fn evaluate(&self, moments: &Moments) -> (f32, Adjoint) {
        let (mut numbers, second) = scaled(moments, self.scale);
        numbers.extend(second);
        let x = tensor(numbers, &device().autodiff()).require_grad();
        let errors = (x.clone() - self.reference.clone()).abs() * self.errors.clone();
        let rest = (self.linear.clone() - x.clone() * self.squares.clone()) * x.clone();
        let loss = (errors + rest).sum();
        let value: f32 = loss.clone().into_scalar();
        let mut gradients = loss.backward();
        // Taken out: what somebody else still holds would be copied number by number.
        let gradient = x.grad_remove(&mut gradients);
        let values: Vec<f32> =
            (gradient.and_then(|g| g.into_data().try_into_vec().ok())).unwrap_or_default();
        let (means, second) = values.split_at(values.len() / 4 * 3);
        let s = self.scale;
        let adjoint = Adjoint {
            mean: (means.chunks_exact(3))
                .map(|m| [m[0] * s, m[1] * s, m[2] * s])
                .collect(),
            second: second.iter().map(|v| v * s * s).collect(),
        };
        (value, adjoint)
    }
}

impl Objective {
    /// For these crops.
    pub fn new(targets: &[&Target], beta: f32) -> Self {
        let total = targets.iter().map(|t| t.reference.len()).sum();
        Self {
            parts: (targets.iter().map(|t| Part::new(t, beta, total))).collect(),
        }
    }

    /// What one crop adds to the mean loss of all, and its derivative by the moments of that crop.
    pub fn evaluate(&self, crop: usize, moments: &Moments) -> (f32, Adjoint) {
        self.parts[crop].evaluate(moments)
    }
}
