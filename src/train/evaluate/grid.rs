//! The values of γ that curves are sampled at, cubic interpolation between them, and the levels where training takes
//! their tangents.

/// Values of γ at which curves are sampled, evenly in ln γ.
pub(in crate::train) const NODES: usize = 17;

/// The smallest factor that is learned: at exactly 0 a Dirac lobe stays one, and the gradient is gone for ever.
pub(in crate::train) const GAMMA_MIN: f32 = 1e-3;

/// Levels between two nodes: 5.5 % in γ. Half of that along a tangent leaves an error of at most 0.08 % of a curve that
/// bends as γ² does.
const LEVELS: u32 = 8;

/// Distance of the nodes in ln γ.
pub(in crate::train) fn spacing() -> f64 {
    -f64::from(GAMMA_MIN).ln() / (NODES - 1) as f64
}

/// γ of a node.
pub(in crate::train) fn node(k: usize) -> f64 {
    (f64::from(GAMMA_MIN).ln() + k as f64 * spacing()).exp()
}

/// The place of a factor among the nodes, from 0 to NODES − 1.
fn coordinate(gamma: f64) -> f64 {
    ((gamma / f64::from(GAMMA_MIN)).ln() / spacing()).clamp(0.0, (NODES - 1) as f64)
}

/// Where a curve is read: between which nodes, and with which weights of value and slope on the left, value and slope
/// on the right.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::train) struct HermiteWeights {
    /// The node on the left.
    pub(in crate::train) node: usize,
    /// Weights of the value.
    pub(in crate::train) value: [f32; 4],
    /// Weights of the derivative by γ.
    pub(in crate::train) slope: [f32; 4],
}

impl HermiteWeights {
    /// Where γ is.
    pub(in crate::train) fn of(gamma: f64) -> Self {
        Self::at(coordinate(gamma))
    }

    fn at(coordinate: f64) -> Self {
        let node = (coordinate as usize).min(NODES - 2);
        let t = coordinate - node as f64;
        let per_gamma = 1.0 / (f64::from(GAMMA_MIN) * (coordinate * spacing()).exp() * spacing());
        // Cubic Hermite polynomials.
        let value = [
            (1.0 + 2.0 * t) * (1.0 - t) * (1.0 - t),
            t * (1.0 - t) * (1.0 - t),
            t * t * (3.0 - 2.0 * t),
            t * t * (t - 1.0),
        ];
        let slope = [
            6.0 * t * (t - 1.0),
            (1.0 - t) * (1.0 - 3.0 * t),
            6.0 * t * (1.0 - t),
            t * (3.0 * t - 2.0),
        ];
        Self {
            node,
            value: value.map(|w| w as f32),
            slope: slope.map(|w| (w * per_gamma) as f32),
        }
    }
}

/// One of the values of γ where the tangents of curves are taken.
///
/// A step of Adam moves a factor by little. The curves need not be evaluated again until it has reached the next level,
/// and what is kept depends on nothing but the level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::train) struct GridStep(u32);

impl GridStep {
    /// The level nearest to γ.
    pub(in crate::train) fn of(gamma: f32) -> Self {
        Self((coordinate(gamma.into()) * f64::from(LEVELS)).round() as u32)
    }

    fn coordinate(self) -> f64 {
        f64::from(self.0) / f64::from(LEVELS)
    }

    /// γ.
    pub(in crate::train) fn gamma(self) -> f32 {
        (f64::from(GAMMA_MIN) * (self.coordinate() * spacing()).exp()) as f32
    }

    /// Where it is among the nodes.
    pub(in crate::train) fn place(self) -> HermiteWeights {
        HermiteWeights::at(self.coordinate())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_is_near_its_factor() {
        for k in 0..=1000 {
            let gamma = GAMMA_MIN.powf(1.0 - k as f32 / 1000.0);
            let found = GridStep::of(gamma).gamma();
            assert!((found / gamma).ln().abs() < 0.51 * spacing() as f32 / LEVELS as f32);
        }
        for bound in [GAMMA_MIN, 1.0] {
            assert!((GridStep::of(bound).gamma() / bound - 1.0).abs() < 1e-6);
        }
        assert_eq!(GridStep::of(0.0), GridStep::of(GAMMA_MIN));
        assert_eq!(GridStep::of(7.0), GridStep::of(1.0));
    }

    #[test]
    fn cubics_in_ln_gamma_are_read_exactly() {
        let cubic = |x: f64| 1.0 + x * (0.5 + x * (0.2 - 0.03 * x));
        let by_x = |x: f64| 0.5 + x * (0.4 - 0.09 * x);
        for k in 0..=333 {
            let gamma = 0.001f64.powf(1.0 - f64::from(k) / 333.0);
            let place = HermiteWeights::of(gamma);
            let ends = [place.node, place.node + 1].map(|k| node(k).ln());
            let knots = [
                cubic(ends[0]),
                by_x(ends[0]) * spacing(),
                cubic(ends[1]),
                by_x(ends[1]) * spacing(),
            ];
            let read = |weights: [f32; 4]| -> f64 {
                let terms = weights.iter().zip(knots);
                terms.map(|(w, k)| f64::from(*w) * k).sum()
            };
            let x = gamma.ln();
            assert!((read(place.value) - cubic(x)).abs() < 1e-5, "{gamma}");
            let slope = by_x(x) / gamma;
            let scale = (1.0 / gamma).max(slope.abs());
            assert!((read(place.slope) - slope).abs() < 1e-4 * scale, "{gamma}");
        }
    }
}
