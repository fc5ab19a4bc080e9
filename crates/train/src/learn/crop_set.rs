//! Crops that are learned from, or scored, together.

use crate::config::constant_table;
use crate::evaluate::{GAMMA_MIN, MomentSource, Moments, no_gradient};
use crate::learn::loss::{CropLoss, LossBackend, Objective, mean_loss};
use crate::record::crop::Crop;
use crate::record::target::Target;
use crate::record::visits::Visits;
use opsr::regularise::{AttenuationTable, Lookup};
use rayon::prelude::*;

/// Mean |Δ ln γ|, weighted by the light that depends on each factor, up to which the tangents of folded paths are used.
/// A reach of 0.1 leaves a second-order error of half a per cent of the folded part. Half of it lowers the mean loss
/// over steps 1500 to 3000 by 0.3 %, one and a half times raises it by 0.3 % (`opsr train --beta 0.001 --spp 192
/// --steps 3000 --set validate_every=250`).
const TANGENT_REACH: f64 = 0.1;

/// Crops with their references and the sources of their moments.
#[derive(Default)]
pub struct CropSet {
    crops: Vec<TrainingCrop>,
    /// Table at which the sources are linearised.
    pub(crate) anchor: Option<AttenuationTable>,
    /// Light in the linearised part that depends on each factor.
    weights: Vec<f64>,
}

/// A crop with its moments, its target and its events per class.
struct TrainingCrop {
    /// Order in which crops were added: sums depend on the order of their terms.
    place: usize,
    crop: Crop,
    source: Box<dyn MomentSource>,
    target: Target,
    visits: Visits,
    /// Cached losses of constant factors: the searches for every β evaluate nearly the same factors.
    constants: Vec<((f32, Lookup), CropLoss)>,
}

impl TrainingCrop {
    /// The loss of a constant factor.
    fn constant_loss(&mut self, gamma: f32, lookup: Lookup) -> CropLoss {
        let key = (gamma, lookup);
        if let Some((_, known)) = self.constants.iter().find(|(k, _)| *k == key) {
            return *known;
        }
        let moments = self.source.exact(&constant_table(gamma, lookup));
        let loss = CropLoss::new(&self.target, &moments);
        self.constants.push((key, loss));
        loss
    }
}

impl CropSet {
    /// Adds a crop.
    pub fn push(
        &mut self,
        crop: Crop,
        source: Box<dyn MomentSource>,
        target: Target,
        visits: Visits,
    ) {
        self.crops.push(TrainingCrop {
            place: self.crops.len(),
            crop,
            source,
            target,
            visits,
            constants: Vec::new(),
        });
    }

    /// The crops.
    pub fn crops(&self) -> impl Iterator<Item = &Crop> {
        self.crops.iter().map(|c| &c.crop)
    }

    /// Removes the crops that `chosen` accepts, and returns them.
    pub fn remove(&mut self, chosen: impl Fn(&Crop) -> bool) -> Self {
        let crops = std::mem::take(&mut self.crops);
        let (removed, left) = crops.into_iter().partition(|c| chosen(&c.crop));
        self.crops = left;
        self.anchor = None;
        Self {
            crops: removed,
            ..Self::default()
        }
    }

    /// Puts removed crops back in their places.
    pub fn restore(&mut self, removed: Self) {
        self.crops.extend(removed.crops);
        self.crops.sort_by_key(|crop| crop.place);
        self.anchor = None;
    }

    /// True if there are no crops.
    pub fn is_empty(&self) -> bool {
        self.crops.is_empty()
    }

    /// Events per class.
    pub fn visits(&self) -> Visits {
        let mut sum = Visits::default();
        for crop in &self.crops {
            for (s, v) in sum.0.iter_mut().zip(&crop.visits.0) {
                *s += v;
            }
        }
        sum
    }

    /// Approximate memory of the sources in bytes.
    pub fn bytes(&self) -> usize {
        self.crops.iter().map(|c| c.source.bytes()).sum()
    }

    /// Moments of all crops at a table, without tangents.
    pub fn exact(&mut self, table: &AttenuationTable) -> Vec<Moments> {
        let crops = self.crops.par_iter_mut().with_max_len(1);
        crops.map(|c| c.source.exact(table)).collect()
    }

    /// The loss of each crop with these moments.
    pub fn losses_of(&self, moments: &[Moments]) -> Vec<CropLoss> {
        let pairs = self.crops.iter().zip(moments);
        pairs.map(|(c, m)| CropLoss::new(&c.target, m)).collect()
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

    /// The mean loss of a constant factor; `None` without crops.
    pub(crate) fn constant_loss(&mut self, beta: f32, gamma: f32, lookup: Lookup) -> Option<f32> {
        let crops = self.crops.par_iter_mut().with_max_len(1);
        let losses: Vec<CropLoss> = crops.map(|c| c.constant_loss(gamma, lookup)).collect();
        mean_loss(&losses, beta)
    }

    /// The constant factor with the smallest loss.
    pub fn best_constant(&mut self, beta: f32, lookup: Lookup) -> f32 {
        let ln = minimise(f64::from(GAMMA_MIN).ln(), 0.0, |ln| {
            let loss = self.constant_loss(beta, ln.exp() as f32, lookup);
            f64::from(loss.unwrap_or(0.0))
        });
        ln.exp() as f32
    }

    /// The mean loss of these crops, for [`CropSet::gradient`].
    pub fn objective(&self, beta: f32, backend: LossBackend) -> Objective {
        let targets: Vec<&Target> = self.crops.iter().map(|c| &c.target).collect();
        Objective::new(&targets, beta, backend)
    }

    /// Loss and its gradient dL/dγ at a table.
    pub fn gradient(&mut self, objective: &Objective, table: &AttenuationTable) -> (f32, Vec<f64>) {
        if !self.is_within_reach(table) {
            self.anchor(table.clone());
        }
        // One by one, the longest first: a few crops have most of the work.
        let mut crops: Vec<_> = self.crops.iter_mut().enumerate().collect();
        crops.sort_by_key(|(_, crop)| std::cmp::Reverse(crop.source.work()));
        let mut evaluated: Vec<(usize, f32, Vec<f64>)> = crops
            .into_iter()
            .par_bridge()
            .map(|(index, crop)| {
                let moments = crop.source.moments(table);
                let (loss, adjoint) = objective.evaluate(index, &moments);
                (index, loss, crop.source.gradient(table, &adjoint))
            })
            .collect();
        // Sums depend on the order of their terms.
        evaluated.sort_unstable_by_key(|(index, ..)| *index);
        let (mut loss, mut sum) = (0.0, no_gradient());
        for (_, share, gradient) in evaluated {
            loss += share;
            for (s, g) in sum.iter_mut().zip(gradient) {
                *s += g;
            }
        }
        (loss, sum)
    }

    /// True if the tangents from the anchor hold at a table.
    fn is_within_reach(&self, table: &AttenuationTable) -> bool {
        self.anchor.as_ref().is_some_and(|anchor| {
            let (mut moved, mut weight) = (0.0, 0.0);
            let factors = anchor.gammas.iter().zip(table.gammas.iter());
            for (w, (a, b)) in self.weights.iter().zip(factors) {
                if *w > 0.0 {
                    moved += w * f64::from((b / a).ln().abs());
                    weight += w;
                }
            }
            moved <= TANGENT_REACH * weight
        })
    }

    /// Linearises the sources at a table.
    pub(crate) fn anchor(&mut self, table: AttenuationTable) {
        let crops = self.crops.par_iter_mut().with_max_len(1);
        crops.for_each(|c| c.source.anchor(&table));
        self.anchor = Some(table);
        self.weights = no_gradient();
        for crop in &self.crops {
            crop.source.add_weights(&mut self.weights);
        }
    }
}

/// Position of the smallest `loss` in \[`low`, `high`\]: a scan of 16 intervals, then six steps of golden section
/// search between the neighbours of the best.
pub(crate) fn minimise(low: f64, high: f64, mut loss: impl FnMut(f64) -> f64) -> f64 {
    const SCAN: usize = 16;
    const GOLDEN_STEPS: usize = 6;
    let at = |i: usize| low + (high - low) * i as f64 / SCAN as f64;
    let losses: Vec<f64> = (0..=SCAN).map(|i| loss(at(i))).collect();
    let best = (0..=SCAN)
        .min_by(|&a, &b| losses[a].total_cmp(&losses[b]))
        .unwrap_or(0);
    let (mut a, mut b) = (at(best.saturating_sub(1)), at((best + 1).min(SCAN)));
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let (mut x, mut y) = (b - golden * (b - a), a + golden * (b - a));
    let (mut fx, mut fy) = (loss(x), loss(y));
    for _ in 0..GOLDEN_STEPS {
        if fx < fy {
            (b, y, fy) = (y, x, fx);
            x = b - golden * (b - a);
            fx = loss(x);
        } else {
            (a, x, fx) = (x, y, fy);
            y = a + golden * (b - a);
            fy = loss(y);
        }
    }
    let (value, found) = if fx < fy { (x, fx) } else { (y, fy) };
    if found < losses[best] {
        value
    } else {
        at(best)
    }
}
