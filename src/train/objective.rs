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
    beta: f32,
    scales: Vec<f32>,
    pixels: Vec<usize>,
    reference: Tensor<2>,
    inverse: Tensor<2>,
    /// N/(N − 1) of each pixel.
    bessel: Tensor<2>,
    samples: Vec<f32>,
    references: Vec<f32>,
}

impl Objective {
    /// For these crops.
    pub fn new(targets: &[&Target], beta: f32) -> Self {
        let scales: Vec<f32> = targets.iter().map(|t| t.scale()).collect();
        let references: Vec<f32> = (targets.iter().zip(&scales))
            .flat_map(|(t, s)| t.reference.iter().flatten().map(move |v| v * s))
            .collect();
        let samples: Vec<f32> = (targets.iter())
            .flat_map(|t| {
                let n = t.samples.max(2) as f32;
                vec![n / (n - 1.0); t.reference.len()]
            })
            .collect();
        let device = device().autodiff();
        let rows = samples.len();
        let inverse = references.iter().map(|f| 1.0 / (f + EPSILON)).collect();
        let tensor =
            |v: Vec<f32>, columns| Tensor::from_data(TensorData::new(v, [rows, columns]), &device);
        Self {
            beta,
            scales,
            pixels: targets.iter().map(|t| t.reference.len()).collect(),
            reference: tensor(references.clone(), 3),
            inverse: tensor(inverse, 3),
            bessel: tensor(samples.clone(), 1),
            samples,
            references,
        }
    }

    /// The mean loss of all crops and its derivative by the moments of each.
    pub fn evaluate(&self, moments: &[Moments]) -> (f32, Vec<Adjoint>) {
        let device = device().autodiff();
        let (mean, second) = self.scaled(moments);
        let rows = second.len();
        let mean = Tensor::<2>::from_data(TensorData::new(mean, [rows, 3]), &device).require_grad();
        let second =
            Tensor::<2>::from_data(TensorData::new(second, [rows, 1]), &device).require_grad();
        let mape = ((mean.clone() - self.reference.clone()).abs() * self.inverse.clone()).mean();
        let squares = (mean.clone() * mean.clone()).sum_dim(1);
        let variance = ((second.clone() - squares) * self.bessel.clone()).mean() / 3.0;
        let loss = mape + variance * self.beta;
        let value: f32 = loss.clone().into_scalar();
        let gradients = loss.backward();
        let values = |tensor: &Tensor<2>| -> Vec<f32> {
            tensor
                .grad(&gradients)
                .and_then(|g| g.to_data().try_to_vec().ok())
                .unwrap_or_default()
        };
        (value, self.unscaled(&values(&mean), &values(&second)))
    }

    /// The loss of each crop.
    pub fn by_crop(&self, moments: &[Moments]) -> Vec<CropLoss> {
        let (mean, second) = self.scaled(moments);
        let mut first = 0;
        (self.pixels.iter())
            .map(|&n| {
                let range = first..first + n;
                first += n;
                let mut sums = [0.0f64; 4];
                for p in range {
                    let mut squares = 0.0;
                    let channels = 3 * p..3 * p + 3;
                    let references = &self.references[channels.clone()];
                    for (&i, &f) in mean[channels].iter().zip(references) {
                        sums[0] += f64::from((i - f).abs() / (f + EPSILON));
                        sums[1] += f64::from(i);
                        sums[2] += f64::from(f);
                        squares += i * i;
                    }
                    sums[3] += f64::from((second[p] - squares) * self.samples[p]);
                }
                CropLoss {
                    mape: (sums[0] / (3 * n) as f64) as f32,
                    variance: (sums[3] / (3 * n) as f64) as f32,
                    energy: (sums[1] / sums[2].max(1e-30)) as f32,
                }
            })
            .collect()
    }

    /// Moments of all crops in one row each, times the crops' scales.
    fn scaled(&self, moments: &[Moments]) -> (Vec<f32>, Vec<f32>) {
        let pairs = || moments.iter().zip(&self.scales);
        let mean = pairs().flat_map(|(m, s)| m.mean.iter().flatten().map(move |v| v * s));
        let second = pairs().flat_map(|(m, s)| m.second.iter().map(move |v| v * s * s));
        (mean.collect(), second.collect())
    }

    fn unscaled(&self, mean: &[f32], second: &[f32]) -> Vec<Adjoint> {
        let mut first = 0;
        (self.pixels.iter().zip(&self.scales))
            .map(|(&n, s)| {
                let range = first..first + n;
                first += n;
                Adjoint {
                    mean: (range.clone())
                        .map(|p| [0, 1, 2].map(|c| mean[3 * p + c] * s))
                        .collect(),
                    second: second[range].iter().map(|v| v * s * s).collect(),
                }
            })
            .collect()
    }
}
