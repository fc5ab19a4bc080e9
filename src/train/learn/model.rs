//! What is learned: a burn module of parameters, Adam, and how parameters make the 1360 factors.

use crate::regularise::{AttenuationTable, GammaIndex, LEN, LEVELS, Lookup, MAX_VERTICES};
use crate::train::evaluate::grid::GAMMA_MIN;
use crate::train::learn::objective::{device, tensor};
use burn::module::{Module, Param};
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
use burn::store::{ModuleRecord, RecordError};
use burn::tensor::{Bytes, Tensor};
use burn_pack::{DType, Reader};
use serde::{Deserialize, Serialize};

/// Gradients below this are noise, on which Adam, which knows no scale, would walk.
const NOISE: f64 = 1e-10;

/// Shape of what is learned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Model {
    /// Every factor by itself.
    #[default]
    Full,
    /// ln γ is a sum of one number for each (position before the last vertex, level) and one for each length.
    Additive,
}

/// In what the optimiser walks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Optimiser {
    /// Adam on γ, as published.
    #[default]
    Adam,
    /// Adam on ln γ: hundreds of steps instead of thousands.
    Log,
}

/// Numbers of the additive model: 5 positions of 4 levels, 4 lengths.
const ADDITIVE: usize = MAX_VERTICES * LEVELS + MAX_VERTICES - 1;

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

/// Which numbers of the additive model a class is the sum of.
fn terms(class: usize) -> Vec<usize> {
    let levels = GammaIndex::new(class).map_or(Vec::new(), GammaIndex::levels);
    let length = MAX_VERTICES * LEVELS + levels.len().saturating_sub(2);
    let positions = (levels.iter().rev().enumerate()).map(|(i, level)| i * LEVELS + level);
    positions.chain([length]).collect()
}

impl Learner {
    /// All factors at `start`.
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
                values[MAX_VERTICES * LEVELS..].fill(start.ln());
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
            // burn's own default is 1e-5; its update divides as Kingma and Ba's does.
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

    /// The factors.
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

    /// One step of Adam down the gradient dL/dγ, and the projection to [10⁻³, 1].
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
        // Without a fresh start the parameter would stay on the graph of the step.
        self.parameters.values =
            values.map(|t| Tensor::from_inner(t.inner().clamp(low, high)).require_grad());
    }

    /// Derivative by the parameters.
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
                    // At a bound only the way back counts.
                    let stuck = (gamma <= GAMMA_MIN && g > 0.0) || (gamma >= 1.0 && g < 0.0);
                    if !stuck {
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

    /// Goes on from a state. Parameters first: they carry the identity by which Adam knows its moments.
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

/// Whether an optimiser's state is one of Adam's for this many parameters. burn would panic at moments of another shape
/// when it makes its next step, and walk to infinity with moments that are no numbers.
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

/// What a learner needs to go on to the bit.
#[derive(Clone, Debug, PartialEq)]
pub struct LearnerState {
    /// The parameters.
    pub parameters: Vec<u8>,
    /// Adam's moments and step.
    pub adam: Vec<u8>,
}

fn parameters(values: Vec<f32>) -> Tensor<1> {
    tensor(values, &device().autodiff()).require_grad()
}
