//! Crops that are learned from, or scored, together.

use crate::regularise::{AttenuationTable, Lookup};
use crate::train::evaluate::moments::{MomentSource, Moments, no_gradient};
use crate::train::learn::objective::{CropLoss, LossBackend, Objective, Target};
use crate::train::record::crop::Crop;
use crate::train::record::visits::Visits;
use rayon::prelude::*;

/// Mean |Δ ln γ|, weighted by the light that follows each factor, that the tangents of folded paths are used for: a
/// tenth leaves an error of the second order, half a per cent of the folded part. Of the mean loss over
/// steps 1500 to 3000 (`opsr train --beta 0.001 --spp 192 --steps 3000 --set validate_every=250`) half of it takes
/// 0.3 % away, one and a half times adds 0.3 %.
const REACH: f64 = 0.1;

/// Crops with their sources of moments and what they are compared with.
#[derive(Default)]
pub struct CropSet {
    members: Vec<TrainingCrop>,
    /// The table that sources are linearised at.
    pub(in crate::train) anchor: Option<AttenuationTable>,
    /// The light that follows each factor in what is linearised.
    weights: Vec<f64>,
}

/// A replicate of a crop.
struct TrainingCrop {
    crop: Crop,
    source: Box<dyn MomentSource>,
    target: Target,
    visits: Visits,
    /// Its losses where all factors are the same, as far as they are known: every β asks for much the same factors.
    constants: Vec<((f32, Lookup), CropLoss)>,
}

impl TrainingCrop {
    /// The loss where all factors are the same.
    fn constant(&mut self, gamma: f32, lookup: Lookup) -> CropLoss {
        let key = (gamma, lookup);
        if let Some((_, known)) = self.constants.iter().find(|(k, _)| *k == key) {
            return *known;
        }
        let moments = self.source.exact(&AttenuationTable {
            lookup,
            ..AttenuationTable::constant(gamma)
        });
        let loss = self.target.loss(&moments);
        self.constants.push((key, loss));
        loss
    }
}

impl CropSet {
    /// Adds a replicate of a crop.
    pub fn push(
        &mut self,
        crop: Crop,
        source: Box<dyn MomentSource>,
        target: Target,
        visits: Visits,
    ) {
        self.members.push(TrainingCrop {
            crop,
            source,
            target,
            visits,
            constants: Vec::new(),
        });
    }

    /// The crops; every replicate is one.
    pub fn crops(&self) -> impl Iterator<Item = &Crop> {
        self.members.iter().map(|m| &m.crop)
    }

    /// Takes the crops out that `chosen` says.
    pub fn take(&mut self, chosen: impl Fn(&Crop) -> bool) -> Self {
        let members = std::mem::take(&mut self.members);
        let (taken, left) = members.into_iter().partition(|m| chosen(&m.crop));
        self.members = left;
        self.anchor = None;
        Self {
            members: taken,
            ..Self::default()
        }
    }

    /// Puts crops in, such as those that were taken out.
    pub fn append(&mut self, other: Self) {
        self.members.extend(other.members);
        self.anchor = None;
    }

    /// Whether there are no crops.
    pub fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// Events per class.
    pub fn visits(&self) -> Visits {
        let mut sum = Visits::default();
        for member in &self.members {
            for (s, v) in sum.0.iter_mut().zip(&member.visits.0) {
                *s += v;
            }
        }
        sum
    }

    /// Moments of all crops at a table, without tangents.
    pub fn exact(&mut self, table: &AttenuationTable) -> Vec<Moments> {
        let members = self.members.par_iter_mut().with_max_len(1);
        members.map(|m| m.source.exact(table)).collect()
    }

    /// Moments of every crop at a table of its own, without tangents.
    pub fn exact_each(&mut self, tables: &[AttenuationTable]) -> Vec<Moments> {
        let members = self.members.par_iter_mut().zip(tables);
        members.map(|(m, table)| m.source.exact(table)).collect()
    }

    /// Anchors anew where the tangents no longer hold.
    fn follow(&mut self, table: &AttenuationTable) {
        let holds = |anchor: &AttenuationTable| {
            let (mut moved, mut weight) = (0.0, 0.0);
            let factors = anchor.gammas.iter().zip(table.gammas.iter());
            for (w, (a, b)) in self.weights.iter().zip(factors) {
                if *w > 0.0 {
                    moved += w * f64::from((b / a).ln().abs());
                    weight += w;
                }
            }
            moved <= REACH * weight
        };
        if !self.anchor.as_ref().is_some_and(holds) {
            self.anchor(table.clone());
        }
    }

    /// Linearises what is linearised at this table.
    pub(in crate::train) fn anchor(&mut self, table: AttenuationTable) {
        let members = self.members.par_iter_mut().with_max_len(1);
        members.for_each(|m| m.source.anchor(&table));
        self.anchor = Some(table);
        self.weights = no_gradient();
        for member in &self.members {
            member.source.add_weights(&mut self.weights);
        }
    }

    /// Goes on as if the moments had been asked for this many times.
    pub(in crate::train) fn skip(&mut self, times: u64) {
        for member in &mut self.members {
            member.source.skip(times);
        }
    }

    /// An objective over the crops.
    pub fn objective(&self, beta: f32, backend: LossBackend) -> Objective {
        let targets: Vec<&Target> = self.members.iter().map(|m| &m.target).collect();
        Objective::new(&targets, beta, backend)
    }

    /// The loss of each crop with these moments.
    pub fn losses_of(&self, moments: &[Moments]) -> Vec<CropLoss> {
        let pairs = self.members.iter().zip(moments);
        pairs.map(|(m, moments)| m.target.loss(moments)).collect()
    }

    /// The loss of each crop at a table.
    pub fn losses(&mut self, table: &AttenuationTable) -> Vec<CropLoss> {
        let moments = self.exact(table);
        self.losses_of(&moments)
    }

    /// The mean loss at a table; `None` without crops.
    pub fn loss(&mut self, beta: f32, table: &AttenuationTable) -> Option<f32> {
        mean_loss(&self.losses(table), beta)
    }

    /// The mean loss where all factors are the same; `None` without crops.
    pub fn constant_loss(&mut self, beta: f32, gamma: f32, lookup: Lookup) -> Option<f32> {
        let members = self.members.par_iter_mut().with_max_len(1);
        let losses: Vec<CropLoss> = members.map(|m| m.constant(gamma, lookup)).collect();
        mean_loss(&losses, beta)
    }

    /// Loss and gradient at a table.
    pub fn gradient(&mut self, objective: &Objective, table: &AttenuationTable) -> (f32, Vec<f64>) {
        self.follow(table);
        // One by one, those that take longest first: a few crops have most of the work.
        let mut members: Vec<_> = self.members.iter_mut().enumerate().collect();
        members.sort_by_key(|(_, member)| std::cmp::Reverse(member.source.work()));
        let mut evaluated: Vec<(usize, f32, Vec<f64>)> = (members.into_iter().par_bridge())
            .map(|(crop, member)| {
                let moments = member.source.moments(table);
                let (loss, adjoint) = objective.evaluate(crop, &moments);
                (crop, loss, member.source.gradient(table, &adjoint))
            })
            .collect();
        // A sum depends on the order.
        evaluated.sort_unstable_by_key(|(crop, ..)| *crop);
        let (mut loss, mut sum) = (0.0, no_gradient());
        for (_, share, gradient) in evaluated {
            loss += share;
            for (s, g) in sum.iter_mut().zip(gradient) {
                *s += g;
            }
        }
        (loss, sum)
    }

    /// Bytes held by the sources.
    pub fn bytes(&self) -> usize {
        self.members.iter().map(|m| m.source.bytes()).sum()
    }
}

/// Mean of the crops' losses.
pub fn mean_loss(losses: &[CropLoss], beta: f32) -> Option<f32> {
    (!losses.is_empty())
        .then(|| losses.iter().map(|l| l.total(beta)).sum::<f32>() / losses.len() as f32)
}
