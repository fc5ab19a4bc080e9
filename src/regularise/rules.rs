//! The rule that a user chooses: accumulated roughness, or one of other renderers for comparison.

use super::{
    Accumulated, AccumulatedPath, AttenuationTable, Factors, Lookup, Roughening, Scattered,
};
use crate::files::hex;
use sha2::{Digest, Sha256};

/// A rule that roughens the last vertex of a path.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Rule {
    /// No roughening.
    #[default]
    Plain,
    /// Accumulated roughness with learned factors or one constant `[OPSR]`.
    Accumulated(Accumulated),
    /// pbrt-v4's `regularize`: after any bounce that was not perfectly specular, a lobe below 0.3 is doubled and
    /// clamped to [0.1, 0.3].
    Pbrt,
    /// Cycles' "filter glossy" with filter value F > 0: with p the smallest density sampled so far and b = p/F < 1,
    /// α′ = max(α, ½ √(1 − b)). Larger F filters more.
    FilterGlossy(f32),
    /// Roughness clamp: no lobe is sharper than the roughest one before it.
    RoughnessClamp,
    /// The mollifier of Kaplanyan and Dachsbacher at next-event estimation `[PSR]`, only where no path can be sampled:
    /// at a smooth lobe before a light without area. The value is r₀ over half the diagonal of the scene; sample n uses
    /// a kernel of radius r₀ n^(−1/6), so the bias vanishes.
    Mollifier(f32),
}

/// Default r₀ of [`Rule::Mollifier`].
pub(crate) const MOLLIFIER_RADIUS: f32 = 0.01;

impl Rule {
    /// Accumulated roughness with one factor for all paths: the paper's naive variant.
    pub fn constant(gamma: f32) -> Self {
        Self::Accumulated(Accumulated {
            factors: Factors::Constant(gamma),
            lambda: 0.0,
        })
    }

    /// Accumulated roughness with the factors of a table.
    pub fn with_table(table: AttenuationTable) -> Self {
        Self::Accumulated(Accumulated {
            factors: Factors::Table(table),
            lambda: 0.0,
        })
    }

    /// The table, for a rule that has one.
    pub(crate) fn table(&self) -> Option<&AttenuationTable> {
        match self {
            Self::Accumulated(Accumulated {
                factors: Factors::Table(table),
                ..
            }) => Some(table),
            _ => None,
        }
    }

    /// True for rules whose paths always continue with the roughened lobe, as in the renderers they come from.
    pub(crate) fn roughens_continuation(&self) -> bool {
        matches!(
            self,
            Self::Pbrt | Self::FilterGlossy(_) | Self::RoughnessClamp
        )
    }

    /// Text that is equal for two rules only if they roughen alike; it contains a hash of a table's factors.
    pub(crate) fn fingerprint(&self) -> String {
        let (Some(table), Self::Accumulated(rule)) = (self.table(), self) else {
            return format!("{self:?}");
        };
        let AttenuationTable {
            gammas,
            lookup,
            scale,
        } = table;
        let factors = hex(&Sha256::digest(bytemuck::cast_slice::<f32, u8>(
            &gammas[..],
        )));
        let lookup = match lookup {
            Lookup::Nearest => "nearest",
            Lookup::Linear => "linear",
        };
        format!(
            "table {factors} {lookup} scale {scale} lambda {}",
            rule.lambda
        )
    }
}

/// α′ of [`Rule::FilterGlossy`], given the smallest density of the path so far.
#[inline]
fn filter_glossy(filter: f32, least_pdf_w: f32, alpha: f32) -> f32 {
    let b = least_pdf_w / filter;
    if b < 1.0 {
        alpha.max(0.5 * (1.0 - b).sqrt())
    } else {
        alpha
    }
}

/// State of [`Rule`], the same type for every variant.
#[derive(Clone, Copy, Debug)]
pub struct RulePath {
    accumulated: AccumulatedPath,
    /// The largest own roughness so far.
    roughest: f32,
    /// The smallest density so far.
    least_pdf_w: f32,
    sample: u32,
}

impl Roughening for Rule {
    type Path = RulePath;

    fn start(&self, sample: u32) -> RulePath {
        RulePath {
            accumulated: match self {
                Self::Accumulated(rule) => rule.start(sample),
                _ => AccumulatedPath::default(),
            },
            roughest: 0.0,
            least_pdf_w: f32::INFINITY,
            sample,
        }
    }

    #[inline]
    fn roughen(&self, path: &RulePath, alpha: f32) -> f32 {
        match self {
            Self::Plain | Self::Mollifier(_) => alpha,
            Self::Accumulated(rule) => rule.roughen(&path.accumulated, alpha),
            Self::Pbrt if path.roughest > 0.0 && alpha < 0.3 => (2.0 * alpha).clamp(0.1, 0.3),
            Self::Pbrt => alpha,
            Self::FilterGlossy(filter) => filter_glossy(*filter, path.least_pdf_w, alpha),
            Self::RoughnessClamp => alpha.max(path.roughest),
        }
    }

    #[inline]
    fn scatter(&self, path: &mut RulePath, vertex: Scattered) {
        if let Self::Accumulated(rule) = self {
            rule.scatter(&mut path.accumulated, vertex);
        }
        path.roughest = path.roughest.max(vertex.alpha);
        path.least_pdf_w = path.least_pdf_w.min(vertex.pdf_w);
    }

    fn mollifier_radius(&self, path: &RulePath) -> Option<f32> {
        let &Self::Mollifier(radius) = self else {
            return None;
        };
        let n = f64::from(path.sample) + 1.0;
        Some((f64::from(radius) * n.powf(-1.0 / 6.0)) as f32)
    }
}

#[cfg(test)]
mod tests;
