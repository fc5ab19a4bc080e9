//! The loss `[OPSR (16)]` and its derivative by the moments of every crop (`docs/method.md` section 6).
//!
//! ```text
//! L = mean |I − f| / (f + ε)  +  β · mean N/(N − 1) (M₂ − M₁²)      ε = 0.01
//! ```
//!
//! The means are over pixels and colour channels of all crops. I = M₁ is the realised mean of N samples; the second
//! term is the sample variance of *one* path sample. Every crop is scaled so that its reference has the mean
//! [`BRIGHTNESS`](crate::record::target::BRIGHTNESS).
//!
//! The loss is written in burn's tensors and differentiated by burn. The tabulated evaluation uses a scalar
//! implementation without a graph, with the same roundings ([`LossBackend`]).

use crate::evaluate::{Adjoint, Moments};
use crate::record::target::{EPSILON, Target};
use burn::tensor::{Device, Tensor, TensorData};

/// Device of all tensors; burn's successor of this backend is `Device::flex()`.
#[allow(deprecated)]
pub(crate) fn device() -> Device {
    Device::ndarray()
}

pub(crate) fn tensor(values: Vec<f32>, device: &Device) -> Tensor<1> {
    let shape = [values.len()];
    Tensor::from_data(TensorData::new(values, shape), device)
}

/// Bessel's correction N/(N − 1).
fn bessel(target: &Target) -> f32 {
    let n = target.samples.max(2) as f32;
    n / (n - 1.0)
}

/// The scaled reference, all channels in a row.
fn scaled_reference(target: &Target) -> Vec<f32> {
    let scale = target.scale();
    target
        .reference
        .iter()
        .flatten()
        .map(|v| v * scale)
        .collect()
}

/// Scaled means, all channels in a row, and scaled second moments.
fn scaled_moments(moments: &Moments, scale: f32) -> (Vec<f32>, Vec<f32>) {
    (
        moments.mean.iter().flatten().map(|v| v * scale).collect(),
        moments.second.iter().map(|v| v * scale * scale).collect(),
    )
}

/// The loss of one crop.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct CropLoss {
    /// Mean absolute percentage error, as a fraction.
    pub mape: f32,
    /// Mean sample variance of one path sample, of the scaled crop.
    pub variance: f32,
    /// Rendered mean over reference mean.
    pub energy: f32,
}

impl CropLoss {
    /// The loss of a crop with these moments.
    pub fn new(target: &Target, moments: &Moments) -> Self {
        let references = scaled_reference(target);
        let (mean, second) = scaled_moments(moments, target.scale());
        let mut sums = [0.0f64; 4];
        for ((mean, references), second) in mean
            .chunks_exact(3)
            .zip(references.chunks_exact(3))
            .zip(second)
        {
            let mut squares = 0.0;
            for (&i, &f) in mean.iter().zip(references) {
                sums[0] += f64::from((i - f).abs() / (f + EPSILON));
                sums[1] += f64::from(i);
                sums[2] += f64::from(f);
                squares += i * i;
            }
            sums[3] += f64::from((second - squares) * bessel(target));
        }
        let values = references.len() as f64;
        Self {
            mape: (sums[0] / values) as f32,
            variance: (sums[3] / values) as f32,
            energy: (sums[1] / sums[2].max(1e-30)) as f32,
        }
    }

    /// MAPE + β · variance.
    pub fn total(&self, beta: f32) -> f32 {
        self.mape + beta * self.variance
    }
}

/// Mean of the crops' losses; `None` without crops.
pub(crate) fn mean_loss(losses: &[CropLoss], beta: f32) -> Option<f32> {
    (!losses.is_empty())
        .then(|| losses.iter().map(|l| l.total(beta)).sum::<f32>() / losses.len() as f32)
}

/// Implementation of loss and derivative. The derivatives of all variants are bit-identical.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LossBackend {
    /// burn's tensors and automatic differentiation.
    Autodiff,
    /// Loops over numbers, differentiated by hand.
    Scalar,
}

/// The loss of several crops.
pub struct Objective {
    crops: Vec<CropObjective>,
}

impl Objective {
    /// The mean loss over all pixels and channels of these crops.
    pub fn new(targets: &[&Target], beta: f32, backend: LossBackend) -> Self {
        let total = targets.iter().map(|t| t.reference.len()).sum();
        let crop = |target: &&Target| CropObjective::new(target, beta, total, backend);
        Self {
            crops: targets.iter().map(crop).collect(),
        }
    }

    /// Share of one crop in the loss, and its derivative by the moments of that crop.
    pub fn evaluate(&self, crop: usize, moments: &Moments) -> (f32, Adjoint) {
        self.crops[crop].differentiate(moments)
    }
}

/// Share of one crop in the loss: Σ w |x − r| + Σ q (y − Σ x²), with means x and second moments y, both scaled.
struct CropObjective {
    /// Factor of all radiance.
    scale: f32,
    /// r, all channels in a row.
    reference: Vec<f32>,
    /// w.
    errors: Vec<f32>,
    /// q.
    variance: f32,
    /// Graph of the loss for [`LossBackend::Autodiff`].
    graph: Option<LossGraph>,
}

impl CropObjective {
    fn new(target: &Target, beta: f32, total: usize, backend: LossBackend) -> Self {
        let reference = scaled_reference(target);
        let share = 1.0 / (3 * total) as f32;
        let mut objective = Self {
            scale: target.scale(),
            errors: reference.iter().map(|f| share / (f + EPSILON)).collect(),
            variance: beta * bessel(target) * share,
            reference,
            graph: None,
        };
        objective.graph = (backend == LossBackend::Autodiff).then(|| LossGraph::new(&objective));
        objective
    }

    /// Value and derivative at scaled moments, with [`LossBackend::Scalar`].
    fn evaluate(&self, mut mean: Vec<f32>, mut second: Vec<f32>) -> (f32, Vec<f32>, Vec<f32>) {
        let mut loss = 0.0;
        let references = self.reference.iter().zip(&self.errors);
        for (x, (reference, weight)) in mean.iter_mut().zip(references) {
            let error = *x - reference;
            let square = -(*x * self.variance);
            loss += f64::from(error.abs() * weight + square * *x);
            let sign = f32::from(u8::from(error > 0.0)) - f32::from(u8::from(error < 0.0));
            *x = 2.0 * square + sign * weight;
        }
        for y in &mut second {
            loss += f64::from(*y * self.variance);
            *y = self.variance;
        }
        (loss as f32, mean, second)
    }

    /// Share of the loss, and its derivative by the moments.
    fn differentiate(&self, moments: &Moments) -> (f32, Adjoint) {
        let s = self.scale;
        let (mean, second) = scaled_moments(moments, s);
        let (value, mean, second) = match &self.graph {
            Some(graph) => graph.evaluate(mean, second),
            None => self.evaluate(mean, second),
        };
        let adjoint = Adjoint {
            mean: mean
                .chunks_exact(3)
                .map(|m| [m[0] * s, m[1] * s, m[2] * s])
                .collect(),
            second: second.iter().map(|v| v * s * s).collect(),
        };
        (value, adjoint)
    }
}

/// Share of a crop as tensors over means and second moments in a row: Σ w |x − r| + Σ x (c − q x).
struct LossGraph {
    reference: Tensor<1>,
    /// w; 0 for second moments.
    errors: Tensor<1>,
    /// q; 0 for second moments.
    squares: Tensor<1>,
    /// c: 0 for means, q for second moments.
    linear: Tensor<1>,
}

impl LossGraph {
    fn new(objective: &CropObjective) -> Self {
        let device = device().autodiff();
        let means = objective.reference.len();
        let numbers = |mut numbers: Vec<f32>, second: f32| {
            numbers.resize(means / 3 * 4, second);
            tensor(numbers, &device)
        };
        Self {
            reference: numbers(objective.reference.clone(), 0.0),
            errors: numbers(objective.errors.clone(), 0.0),
            squares: numbers(vec![objective.variance; means], 0.0),
            linear: numbers(vec![0.0; means], objective.variance),
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
        // Removed from the map, because burn copies a gradient that has a second owner.
        let gradient = x.grad_remove(&mut gradients);
        let mut mean: Vec<f32> = gradient
            .and_then(|g| g.into_data().try_into_vec().ok())
            .unwrap_or_default();
        let second = mean.split_off(means.min(mean.len()));
        (value, mean, second)
    }
}
