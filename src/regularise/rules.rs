//! Rules of other renderers, for comparison. All but [`Mollifier`] blur the continuation of the path too, which OPSR
//! does not.

use super::{Regulariser, Scattered};

/// pbrt-v4's `regularize`: after any bounce that was not perfectly specular, a lobe below 0.3 is doubled and clamped
/// to [0.1, 0.3].
#[derive(Clone, Copy, Debug, Default)]
pub struct PbrtRegularize;

impl Regulariser for PbrtRegularize {
    /// Whether a bounce that was not perfectly specular has happened.
    type Path = bool;
    const ACTIVE: bool = true;
    const REUSE: bool = true;

    fn start(&self, _: u32) -> bool {
        false
    }

    #[inline]
    fn roughen(&self, &blurred: &bool, alpha: f32) -> f32 {
        if blurred && alpha < 0.3 {
            (2.0 * alpha).clamp(0.1, 0.3)
        } else {
            alpha
        }
    }

    #[inline]
    fn scatter(&self, blurred: &mut bool, vertex: Scattered) {
        *blurred |= vertex.alpha > 0.0;
    }
}

/// Cycles' "filter glossy" with filter value F: with p the smallest density sampled so far and b = p/F < 1,
/// α′ = max(α, ½ √(1 − b)).
#[derive(Clone, Copy, Debug)]
pub struct FilterGlossy {
    /// F > 0; larger filters more.
    pub filter: f32,
}

impl Regulariser for FilterGlossy {
    /// The smallest density so far.
    type Path = f32;
    const ACTIVE: bool = true;
    const REUSE: bool = true;

    fn start(&self, _: u32) -> f32 {
        f32::INFINITY
    }

    #[inline]
    fn roughen(&self, &smallest: &f32, alpha: f32) -> f32 {
        let b = smallest / self.filter;
        if b < 1.0 {
            alpha.max(0.5 * (1.0 - b).sqrt())
        } else {
            alpha
        }
    }

    #[inline]
    fn scatter(&self, smallest: &mut f32, vertex: Scattered) {
        *smallest = smallest.min(vertex.pdf_w);
    }
}

/// Roughness clamp: no lobe is sharper than the roughest one before it.
#[derive(Clone, Copy, Debug, Default)]
pub struct RoughnessClamp;

impl Regulariser for RoughnessClamp {
    /// The largest roughness so far.
    type Path = f32;
    const ACTIVE: bool = true;
    const REUSE: bool = true;

    fn start(&self, _: u32) -> f32 {
        0.0
    }

    #[inline]
    fn roughen(&self, &largest: &f32, alpha: f32) -> f32 {
        alpha.max(largest)
    }

    #[inline]
    fn scatter(&self, largest: &mut f32, vertex: Scattered) {
        *largest = largest.max(vertex.alpha);
    }
}

/// The mollifier of Kaplanyan and Dachsbacher at next-event estimation `[PSR]`, only where no path could be sampled:
/// a smooth lobe before a light without area. Sample n uses a kernel of radius r₀ n^(−1/6), so the bias vanishes.
#[derive(Clone, Copy, Debug)]
pub struct Mollifier {
    /// r₀ over half the diagonal of the scene.
    pub radius: f32,
}

impl Mollifier {
    /// r₀ if nothing else is said.
    pub const RADIUS: f32 = 0.01;
}

impl Regulariser for Mollifier {
    /// The radius for this sample.
    type Path = f32;
    const ACTIVE: bool = false;
    const REUSE: bool = false;
    const MOLLIFIES: bool = true;

    fn start(&self, sample: u32) -> f32 {
        (f64::from(self.radius) * (f64::from(sample) + 1.0).powf(-1.0 / 6.0)) as f32
    }

    #[inline]
    fn roughen(&self, _: &f32, alpha: f32) -> f32 {
        alpha
    }

    #[inline]
    fn scatter(&self, _: &mut f32, _: Scattered) {}

    #[inline]
    fn bandwidth(&self, &radius: &f32) -> f32 {
        radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn met(alpha: f32, pdf_w: f32) -> Scattered {
        Scattered { alpha, pdf_w }
    }

    #[test]
    fn pbrt_doubles_what_is_sharp_after_a_rough_bounce() {
        let rule = PbrtRegularize;
        let mut path = rule.start(0);
        rule.scatter(&mut path, met(0.0, f32::INFINITY));
        assert_eq!(rule.roughen(&path, 0.01), 0.01);
        rule.scatter(&mut path, met(1e-3, 9.0));
        // Remembered whatever comes after.
        rule.scatter(&mut path, met(0.0, f32::INFINITY));
        for (own, blurred) in [
            (0.0, 0.1),
            (0.01, 0.1),
            (0.1, 0.2),
            (0.2, 0.3),
            (0.295, 0.3),
            (0.3, 0.3),
            (0.305, 0.305),
            (0.7, 0.7),
        ] {
            assert_eq!(rule.roughen(&path, own), blurred);
        }
    }

    #[test]
    fn cycles_filters_by_the_least_density() {
        let rule = FilterGlossy { filter: 4.0 };
        let mut path = rule.start(0);
        assert_eq!(rule.roughen(&path, 0.01), 0.01);
        for (pdf_w, expected) in [(8.0, 0.01), (4.0, 0.01), (3.0, 0.25), (5.0, 0.25)] {
            rule.scatter(&mut path, met(0.0, pdf_w));
            assert_eq!(rule.roughen(&path, 0.01), expected, "{pdf_w}");
        }
        assert_eq!(rule.roughen(&path, 0.6), 0.6);
    }

    #[test]
    fn a_clamp_remembers_the_roughest() {
        let rule = RoughnessClamp;
        let mut path = rule.start(0);
        assert_eq!(rule.roughen(&path, 0.01), 0.01);
        for (own, largest) in [(0.2, 0.2), (0.1, 0.2), (0.5, 0.5)] {
            rule.scatter(&mut path, met(own, 1.0));
            assert_eq!(rule.roughen(&path, 0.01), largest);
            assert_eq!(rule.roughen(&path, 0.9), 0.9);
        }
    }

    #[test]
    fn the_mollifier_leaves_roughness_alone() {
        let rule = Mollifier { radius: 0.1 };
        let mut path = rule.start(0);
        assert_eq!(rule.bandwidth(&path), 0.1);
        rule.scatter(&mut path, met(1.0, 1.0));
        assert_eq!(
            (rule.bandwidth(&path), rule.roughen(&path, 0.3)),
            (0.1, 0.3)
        );
        assert_eq!(PbrtRegularize.bandwidth(&true), 0.0);
    }
}
