//! Parameters: a burn module, the factors that it makes, and Adam.

use crate::regularise::{AttenuationTable, BINS, GammaIndex, LEN, Lookup, MAX_VERTICES};
use crate::train::config::{Model, Optimiser};
use crate::train::evaluate::GAMMA_MIN;
use crate::train::learn::loss::{device, tensor};
use burn::module::{Module, Param};
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
use burn::store::{ModuleRecord, RecordError};
use burn::tensor::{Bytes, Tensor};
use burn_pack::{DType, Reader};

/// Gradients below this are rounding noise, on which Adam would walk, since its steps do not depend on their scale.
const NOISE: f64 = 1e-10;

/// Parameters of the additive model: 5 positions times 4 bins, and 4 lengths.
const ADDITIVE: usize = MAX_VERTICES * BINS + MAX_VERTICES - 1;

#[derive(Module, Debug)]
struct Parameters {
    values: Param<Tensor<1>>,
}

/// Parameters and their optimiser.
pub struct Learner {
    model: Model,
    optimiser: Optimiser,
    learning_rate: f64,
    lookup: Lookup,
    parameters: Parameters,
    adam: ModuleOptimizer,
}

/// Parameters of the additive model whose sum is ln γ of a class.
fn terms(class: usize) -> Vec<usize> {
    let bins = GammaIndex::new(class).map_or(Vec::new(), GammaIndex::bins);
    let length = MAX_VERTICES * BINS + bins.len().saturating_sub(2);
    let positions = (bins.iter().rev().enumerate()).map(|(i, bin)| i * BINS + bin);
    positions.chain([length]).collect()
}

impl Learner {
    /// Parameters of a table whose factors are all `start`.
    pub fn new(
        model: Model,
        optimiser: Optimiser,
        learning_rate: f64,
        lookup: Lookup,
        start: f32,
    ) -> Self {
        let start = start.clamp(GAMMA_MIN, 1.0);
        let values = match (model, optimiser) {
            (Model::Full, Optimiser::Adam) => vec![start; LEN],
            (Model::Full, Optimiser::Log) => vec![start.ln(); LEN],
            (Model::Additive, _) => {
                let mut values = vec![0.0; ADDITIVE];
                values[MAX_VERTICES * BINS..].fill(start.ln());
                values
            }
        };
        Self {
            model,
            optimiser,
            learning_rate,
            lookup,
            parameters: Parameters {
                values: Param::from_tensor(parameters(values)),
            },
            // The ε of Kingma and Ba; burn's default is 1e-5.
            adam: AdamConfig::new().with_epsilon(1e-8).init(),
        }
    }

    fn values(&self) -> Vec<f32> {
        self.parameters
            .values
            .val()
            .to_data()
            .try_to_vec()
            .unwrap_or_default()
    }

    /// The table that the parameters make.
    pub fn table(&self) -> AttenuationTable {
        let values = self.values();
        let gammas: Vec<f32> = (0..LEN)
            .map(|class| {
                let gamma = match (self.model, self.optimiser) {
                    (Model::Full, Optimiser::Adam) => values[class],
                    (Model::Full, Optimiser::Log) => values[class].exp(),
                    (Model::Additive, _) => {
                        let sum: f32 = terms(class).iter().map(|&t| values[t]).sum();
                        sum.exp()
                    }
                };
                gamma.clamp(GAMMA_MIN, 1.0)
            })
            .collect();
        let mut table = AttenuationTable::constant(0.0);
        table.gammas.copy_from_slice(&gammas);
        table.lookup = self.lookup;
        table
    }

    /// One step of Adam down the gradient dL/dγ, then projection of γ to \[10⁻³, 1\].
    pub fn step(&mut self, gradient: &[f64]) {
        let gradient = self.chain(gradient);
        let mut gradients = GradientsParams::new();
        gradients.register(self.parameters.values.id, tensor(gradient, &device()));
        self.parameters = (self.adam).step(self.learning_rate, self.parameters.clone(), gradients);
        let (low, high) = match (self.model, self.optimiser) {
            (Model::Full, Optimiser::Adam) => (GAMMA_MIN, 1.0),
            (Model::Full, Optimiser::Log) => (GAMMA_MIN.ln(), 0.0),
            (Model::Additive, _) => return,
        };
        let values = self.parameters.values.clone();
        // A new leaf; otherwise the parameter would stay on the graph of the step.
        self.parameters.values =
            values.map(|t| Tensor::from_inner(t.inner().clamp(low, high)).require_grad());
    }

    /// Gradient by the parameters, from dL/dγ.
    fn chain(&self, gradient: &[f64]) -> Vec<f32> {
        let quiet = |g: f64| if g.abs() < NOISE { 0.0 } else { g };
        match (self.model, self.optimiser) {
            (Model::Full, Optimiser::Adam) => gradient.iter().map(|&g| quiet(g) as f32).collect(),
            (Model::Full, Optimiser::Log) => (gradient.iter().zip(self.table().gammas.iter()))
                .map(|(&g, &gamma)| (quiet(g) * f64::from(gamma)) as f32)
                .collect(),
            (Model::Additive, _) => {
                let mut sums = vec![0.0; ADDITIVE];
                for (class, (&g, &gamma)) in
                    gradient.iter().zip(self.table().gammas.iter()).enumerate()
                {
                    // At a bound only a step back inside counts.
                    let outward = (gamma <= GAMMA_MIN && g > 0.0) || (gamma >= 1.0 && g < 0.0);
                    if !outward {
                        for term in terms(class) {
                            sums[term] += quiet(g) * f64::from(gamma);
                        }
                    }
                }
                sums.into_iter().map(|g| g as f32).collect()
            }
        }
    }

    /// Parameters and optimiser state, as burn writes them.
    pub fn to_bytes(&self) -> Result<LearnerState, RecordError> {
        let parameters = self.parameters.clone().into_record().into_bytes()?;
        let adam = self.adam.into_bytes()?;
        Ok(LearnerState {
            parameters: parameters.to_vec(),
            adam: adam.to_vec(),
        })
    }

    /// Continues from a state. Parameters first: they carry the identifiers by which Adam finds its moments.
    pub fn restore(self, state: LearnerState) -> Result<Self, RecordError> {
        let numbers = self.values().len();
        let record = ModuleRecord::from_bytes(Bytes::from_bytes_vec(state.parameters))?;
        let parameters = self.parameters.try_load_record(record)?;
        check_moments(&state.adam, numbers)?;
        let adam = self.adam.from_bytes(Bytes::from_bytes_vec(state.adam))?;
        let restored = Self {
            parameters,
            adam,
            ..self
        };
        let values = restored.values();
        if values.len() != numbers || !values.iter().all(|v| v.is_finite()) {
            return Err(invalid(format!("not {numbers} finite parameters")));
        }
        Ok(restored)
    }
}

fn invalid(what: impl Into<String>) -> RecordError {
    RecordError::Validation(what.into())
}

/// Checks that a state of Adam belongs to this many parameters. In the next step burn would panic at moments of another
/// shape, and moments that are not finite would spread to all parameters.
fn check_moments(state: &[u8], numbers: usize) -> Result<(), RecordError> {
    let reader = Reader::from_bytes(Bytes::from_bytes_vec(state.to_vec()))?;
    for (name, &value) in reader.scalars() {
        let most = if name.ends_with("rank") { 1 } else { u32::MAX };
        if !u32::try_from(value).is_ok_and(|v| v <= most) {
            return Err(invalid(format!("{name} out of range")));
        }
    }
    for tensor in reader.into_tensors()? {
        let (name, kind, shape, owner, bytes) = tensor.into_parts()?;
        let (values, rest) = bytes.as_chunks::<4>();
        let least = if name.contains("moment_2") {
            0.0
        } else {
            f32::MIN
        };
        let sane = |v: &[u8; 4]| (least..=f32::MAX).contains(&f32::from_le_bytes(*v));
        let shaped = kind == DType::F32 && shape.as_slice() == [numbers] && rest.is_empty();
        if owner.is_none() || !shaped || !values.iter().all(sane) {
            return Err(invalid(format!("{name} is not one of Adam's moments")));
        }
    }
    Ok(())
}

/// State from which a learner continues bit-identically.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnerState {
    /// The parameters.
    pub parameters: Vec<u8>,
    /// Adam's moments and step count.
    pub adam: Vec<u8>,
}

/// Parameters as a leaf of burn's graph.
fn parameters(values: Vec<f32>) -> Tensor<1> {
    tensor(values, &device().autodiff()).require_grad()
}
