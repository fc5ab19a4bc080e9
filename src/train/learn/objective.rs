//! The loss `[OPSR (16)]`: moments of all crops in, loss and its derivative out.
//!
//! ```text
//! L = mean |I − f| / (f + ε)  +  β · mean N/(N − 1) (M₂ − M₁²)      ε = 0.01
//! ```
//!
//! over pixels and colour channels of all crops; I = M₁ is the realised mean of N samples, the second term the sample
//! variance of *one* path sample. Every crop is scaled so that its reference has the mean [`BRIGHTNESS`]: the second
//! term has the unit of radiance squared and the first none, and β must mean the same everywhere.
//!
//! It is written in burn's tensors, and its derivative is burn's. The fast way to train does the same roundings in loops,
//! without a graph ([`LossBackend`]).

use crate::train::evaluate::moments::{Adjoint, Moments};
use burn::tensor::{Device, Tensor, TensorData};

/// ε of MAPE.
pub const EPSILON: f32 = 0.01;

/// Mean that the reference of every crop is scaled to.
pub const BRIGHTNESS: f32 = 0.3;

/// The device that tensors live on; burn's successor of this backend is `Device::flex()`.
#[allow(deprecated)]
pub(in crate::train) fn device() -> Device {
    Device::ndarray()
}

/// Numbers in a row.
pub(in crate::train) fn tensor(values: Vec<f32>, device: &Device) -> Tensor<1> {
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

/// What loss and derivative are evaluated with. The derivatives are the same to the bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LossBackend {
    /// burn's tensors and its graph.
    Autodiff,
    /// Scalar over numbers.
    Scalar,
}

/// The loss of several crops.
pub struct Objective {
    parts: Vec<CropObjective>,
}

/// The loss of one crop as a part of the whole: Σ w |x − r| + Σ q (y − Σ x²), means x and second moments y.
struct CropObjective {
    /// What radiance is multiplied by.
    scale: f32,
    /// r, all channels in a row.
    reference: Vec<f32>,
    /// w.
    errors: Vec<f32>,
    /// q.
    variance: f32,
    graph: Option<LossGraph>,
}

/// The same as Σ w |x − r| + Σ x (c − q x) over means and second moments in a row.
struct LossGraph {
    reference: Tensor<1>,
    /// 0 for second moments.
    errors: Tensor<1>,
    /// q, 0 for second moments.
    squares: Tensor<1>,
    /// c: 0 for means, q for second moments.
    linear: Tensor<1>,
}

impl LossGraph {
    fn new(part: &CropObjective) -> Self {
        let device = device().autodiff();
        let means = part.reference.len();
        let numbers = |mut numbers: Vec<f32>, second: f32| {
            numbers.resize(means / 3 * 4, second);
            tensor(numbers, &device)
        };
        Self {
            reference: numbers(part.reference.clone(), 0.0),
            errors: numbers(part.errors.clone(), 0.0),
            squares: numbers(vec![part.variance; means], 0.0),
            linear: numbers(vec![0.0; means], part.variance),
        }
    }

    /// Value and derivative at scaled moments.
    fn evaluate(&self, mut mean: Vec<f32>, second: Vec<f32>) -> (f32, Vec<f32>, Vec<f32>) {
        let means = mean.len();
        mean.extend(second);
        let x = tensor(mean, &device().autodiff()).require_grad();
        let errors = (x.clone() - self.reference.clone()).abs() * self.errors.clone();
        let rest = (self.linear.clone() - x.clone() * self.squares.clone()) * x.clone();
        let loss = (errors + rest).sum();
        let value: f32 = loss.clone().into_scalar();
        let mut gradients = loss.backward();
        // Taken out: what somebody else still holds would be copied number by number.
        let gradient = x.grad_remove(&mut gradients);
        let mut mean: Vec<f32> =
            (gradient.and_then(|g| g.into_data().try_into_vec().ok())).unwrap_or_default();
        let second = mean.split_off(means.min(mean.len()));
        (value, mean, second)
    }
}

impl CropObjective {
    fn new(target: &Target, beta: f32, total: usize, backend: LossBackend) -> Self {
        let reference = target.scaled();
        let share = 1.0 / (3 * total) as f32;
        let mut part = Self {
            scale: target.scale(),
            errors: reference.iter().map(|f| share / (f + EPSILON)).collect(),
            variance: beta * target.bessel() * share,
            reference,
            graph: None,
        };
        part.graph = (backend == LossBackend::Autodiff).then(|| LossGraph::new(&part));
        part
    }

    /// Value and derivative at scaled moments.
    fn evaluate(&self, mut mean: Vec<f32>, mut second: Vec<f32>) -> (f32, Vec<f32>, Vec<f32>) {
        let mut loss = 0.0;
        let references = self.reference.iter().zip(&self.errors);
        for (x, (reference, weight)) in mean.iter_mut().zip(references) {
            let off = *x - reference;
            let square = -(*x * self.variance);
            loss += f64::from(off.abs() * weight + square * *x);
            let sign = f32::from(u8::from(off > 0.0)) - f32::from(u8::from(off < 0.0));
            *x = 2.0 * square + sign * weight;
        }
        for y in &mut second {
            loss += f64::from(*y * self.variance);
            *y = self.variance;
        }
        (loss as f32, mean, second)
    }

    /// The crop's share of the loss, and its derivative by the moments.
    fn differentiate(&self, moments: &Moments) -> (f32, Adjoint) {
        let s = self.scale;
        let (mean, second) = scaled(moments, s);
        let (value, mean, second) = match &self.graph {
            Some(graph) => graph.evaluate(mean, second),
            None => self.evaluate(mean, second),
        };
        let adjoint = Adjoint {
            mean: (mean.chunks_exact(3))
                .map(|m| [m[0] * s, m[1] * s, m[2] * s])
                .collect(),
            second: second.iter().map(|v| v * s * s).collect(),
        };
        (value, adjoint)
    }
}

impl Objective {
    /// For these crops.
    pub fn new(targets: &[&Target], beta: f32, backend: LossBackend) -> Self {
        let total = targets.iter().map(|t| t.reference.len()).sum();
        let part = |target: &&Target| CropObjective::new(target, beta, total, backend);
        Self {
            parts: targets.iter().map(part).collect(),
        }
    }

    /// What one crop adds to the mean loss of all, and its derivative by the moments of that crop.
    pub fn evaluate(&self, crop: usize, moments: &Moments) -> (f32, Adjoint) {
        self.parts[crop].differentiate(moments)
    }
}
