//! Parameters of the table as a burn module, and Adam.

use crate::config::Optimiser;
use crate::evaluate::GAMMA_MIN;
use crate::learn::loss::{device, tensor};
use burn::module::{Module, Param, ParamId};
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer};
use burn::store::{ModuleRecord, RecordError};
use burn::tensor::{Bytes, Tensor};
use burn_pack::{DType, Reader};
use opsr::regularise::{AttenuationTable, LEN, Lookup};

/// Gradients below this are rounding noise, which Adam would follow: its steps do not depend on the gradient's scale.
const NOISE: f64 = 1e-10;

#[derive(Module, Debug)]
struct Parameters {
    values: Param<Tensor<1>>,
}

/// Parameters and their optimiser.
pub struct Learner {
    optimiser: Optimiser,
    learning_rate: f64,
    lookup: Lookup,
    parameters: Parameters,
    adam: ModuleOptimizer,
}

impl Learner {
    /// Parameters of a table whose factors are all `start`.
    pub fn new(optimiser: Optimiser, learning_rate: f64, lookup: Lookup, start: f32) -> Self {
        let start = start.clamp(GAMMA_MIN, 1.0);
        let value = match optimiser {
            Optimiser::Adam => start,
            Optimiser::Log => start.ln(),
        };
        Self {
            optimiser,
            learning_rate,
            lookup,
            parameters: Parameters {
                // They require no gradient: until a backward pass burn would keep a node of every leaf, 2.4 kB a step.
                values: Param::initialized(
                    ParamId::new(),
                    tensor(vec![value; LEN], &device().autodiff()),
                ),
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

    /// The table of the current parameters, its factors clamped to \[10⁻³, 1\].
    pub fn table(&self) -> AttenuationTable {
        let mut table = AttenuationTable::constant(0.0);
        for (gamma, value) in table.gammas.iter_mut().zip(self.values()) {
            let new = match self.optimiser {
                Optimiser::Adam => value,
                Optimiser::Log => value.exp(),
            };
            *gamma = new.clamp(GAMMA_MIN, 1.0);
        }
        table.lookup = self.lookup;
        table
    }

    /// One step of Adam down the gradient dL/dγ, then projection of γ to \[10⁻³, 1\].
    pub fn step(&mut self, gradient: &[f64]) {
        let gradient = self.chain(gradient);
        let mut gradients = GradientsParams::new();
        gradients.register(self.parameters.values.id, tensor(gradient, &device()));
        self.parameters = self
            .adam
            .step(self.learning_rate, self.parameters.clone(), gradients);
        let (low, high) = match self.optimiser {
            Optimiser::Adam => (GAMMA_MIN, 1.0),
            Optimiser::Log => (GAMMA_MIN.ln(), 0.0),
        };
        let values = self.parameters.values.clone();
        // Without a gradient, see `new`.
        self.parameters.values = values.map(|t| Tensor::from_inner(t.inner().clamp(low, high)));
    }

    /// Gradient by the parameters, from dL/dγ.
    fn chain(&self, gradient: &[f64]) -> Vec<f32> {
        let quiet = |g: f64| if g.abs() < NOISE { 0.0 } else { g };
        match self.optimiser {
            Optimiser::Adam => gradient.iter().map(|&g| quiet(g) as f32).collect(),
            Optimiser::Log => gradient
                .iter()
                .zip(self.table().gammas.iter())
                .map(|(&g, &gamma)| (quiet(g) * f64::from(gamma)) as f32)
                .collect(),
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

    /// Continues from a state. Parameters come first: Adam finds its moments by their identifiers.
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
