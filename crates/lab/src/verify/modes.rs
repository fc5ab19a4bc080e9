//! All modes of rendering, each of which makes small random settings.
//!
//! Checks that pictures do not depend on threads, passes, checkpoints and parts draw from this list, as do tests that a
//! picture can be repeated from its metadata.

use opsr::integrator::bidirectional::{Radius, Strategy};
use opsr::integrator::{Amounts, Estimator, RadiusFactors, Scales, Settings};
use opsr::regularise::{Accumulated, AttenuationTable, Factors, Rule};
use opsr::sampler::SamplerKind;

/// Uniform random numbers in [0, 1).
pub struct Uniform<'a>(pub &'a mut dyn FnMut() -> f32);

impl Uniform<'_> {
    fn next(&mut self) -> f32 {
        (self.0)()
    }

    /// Uniform whole number below `n`.
    fn below(&mut self, n: u32) -> u32 {
        ((self.next() * n as f32) as u32).min(n - 1)
    }

    /// True with this probability.
    fn chance(&mut self, p: f32) -> bool {
        self.next() < p
    }

    /// One factor in [0, 1) as a rule, for all paths or as a table; `lambda` is the exponent of the consistent variant.
    fn factors(&mut self, lambda: f32) -> Rule {
        let gamma = self.next();
        let factors = match self.chance(0.5) {
            true => Factors::Constant(gamma),
            false => Factors::Table(AttenuationTable::constant(gamma)),
        };
        Rule::Accumulated(Accumulated { factors, lambda })
    }

    fn radius(&mut self) -> Radius {
        Radius {
            first: self.chance(0.5).then(|| 0.01 + 0.2 * self.next()),
            ..Radius::default()
        }
    }

    fn connection(&mut self) -> Strategy {
        let t = 1 + self.below(3);
        // s + t ≥ 2: a path has at least two vertices.
        let s = self.below(4).max(2 - t.min(2));
        Strategy::Connection { s, t }
    }

    fn scales(&mut self) -> Amounts {
        let count = 2 + self.below(3) as usize;
        let scales = [0.0, 0.3, 1.0, 4.0];
        match self.chance(0.5) {
            true => Amounts::Roughening(Scales::default()),
            false => Amounts::roughening(&scales[..count]).expect("ascending scales"),
        }
    }
}

/// An estimator with a rule and films.
pub struct Mode {
    /// Name in reports.
    pub name: &'static str,
    /// True if its first film has the expected value of plain path tracing, or converges to it.
    pub is_plain: bool,
    vary: fn(&mut Settings, &mut Uniform<'_>),
}

impl Mode {
    /// Settings of the mode for pictures of few pixels.
    pub fn settings(&self, mut uniform: Uniform<'_>) -> Settings {
        let mut settings = Settings {
            sampler: match uniform.chance(0.3) {
                true => SamplerKind::Sobol,
                false => SamplerKind::Independent,
            },
            max_vertices: 1 + uniform.below(12),
            roulette_start: 1 + uniform.below(8),
            seed: uniform.below(1000).into(),
            ..Settings::default()
        };
        (self.vary)(&mut settings, &mut uniform);
        settings
    }
}

/// A mode whose first film has the expectation or the limit of plain path tracing.
const fn plain(name: &'static str, vary: fn(&mut Settings, &mut Uniform<'_>)) -> Mode {
    Mode {
        name,
        is_plain: true,
        vary,
    }
}

/// A mode with another picture.
const fn other(name: &'static str, vary: fn(&mut Settings, &mut Uniform<'_>)) -> Mode {
    Mode {
        name,
        is_plain: false,
        vary,
    }
}

const MOLLIFIER: Rule = Rule::Mollifier(0.01);

/// All modes.
pub static MODES: &[Mode] = &[
    plain("path, raw", |_, _| {}),
    plain("path, blurred", |s, _| s.amounts = Amounts::Blurred),
    plain("path, levels", |s, u| {
        (s.rule, s.amounts) = (u.factors(0.0), u.scales());
    }),
    other("path, roughened", |s, u| s.rule = u.factors(0.0)),
    other("path, roughened and blurred", |s, u| {
        (s.rule, s.amounts) = (u.factors(0.0), Amounts::Blurred);
    }),
    other("path, reuse", |s, u| {
        s.rule = u.factors(0.0);
        s.estimator = Estimator::Path { reuse: true };
    }),
    other("path, consistent", |s, u| s.rule = u.factors(0.2)),
    other("path, consistent and blurred", |s, u| {
        (s.rule, s.amounts) = (u.factors(0.2), Amounts::Blurred);
    }),
    other("path, pbrt", |s, _| s.rule = Rule::Pbrt),
    other("path, filter glossy", |s, u| {
        s.rule = Rule::FilterGlossy(1.0 + 9.0 * u.next());
    }),
    other("path, roughness clamp", |s, _| {
        s.rule = Rule::RoughnessClamp
    }),
    other("path, mollifier", |s, _| s.rule = MOLLIFIER),
    plain("guided", |s, _| {
        s.estimator = Estimator::Guided { unbiased: false };
    }),
    other("guided, roughened", |s, u| {
        s.estimator = Estimator::Guided { unbiased: false };
        s.rule = u.factors(0.0);
    }),
    plain("guided, unbiased", |s, u| {
        s.estimator = Estimator::Guided { unbiased: true };
        s.rule = u.factors(0.0);
    }),
    plain("manifold", |s, _| {
        s.estimator = Estimator::Manifold { trials: 0 };
    }),
    plain("manifold, trials", |s, u| {
        let trials = 1 + u.below(8);
        s.estimator = Estimator::Manifold { trials };
    }),
    other("light", |s, _| s.estimator = Estimator::Light),
    plain("bdpt, raw", |s, _| s.estimator = Estimator::Bdpt),
    plain("bdpt, blurred", |s, _| {
        (s.estimator, s.amounts) = (Estimator::Bdpt, Amounts::Blurred);
    }),
    other("bdpt, roughened", |s, u| {
        (s.estimator, s.rule) = (Estimator::Bdpt, u.factors(0.0));
    }),
    other("bdpt, roughened and blurred", |s, u| {
        (s.estimator, s.rule) = (Estimator::Bdpt, u.factors(0.0));
        s.amounts = Amounts::Blurred;
    }),
    other("bdpt, mollifier", |s, u| {
        (s.estimator, s.rule) = (Estimator::Bdpt, MOLLIFIER);
        s.amounts = [Amounts::Raw, Amounts::Blurred][u.below(2) as usize].clone();
    }),
    other("bdpt, one strategy", |s, u| {
        s.estimator = Estimator::Bdpt;
        s.strategy = Some(u.connection());
    }),
    plain("vcm, raw", |s, u| s.estimator = Estimator::Vcm(u.radius())),
    plain("vcm, blurred", |s, u| {
        s.estimator = Estimator::Vcm(u.radius());
        s.amounts = Amounts::Blurred;
    }),
    other("vcm, roughened", |s, u| {
        s.estimator = Estimator::Vcm(u.radius());
        s.rule = u.factors(0.0);
    }),
    other("vcm, roughened and blurred", |s, u| {
        s.estimator = Estimator::Vcm(u.radius());
        (s.rule, s.amounts) = (u.factors(0.0), Amounts::Blurred);
    }),
    other("vcm, one strategy", |s, u| {
        s.estimator = Estimator::Vcm(u.radius());
        s.strategy = Some(match u.chance(0.3) {
            true => Strategy::Merges,
            false => u.connection(),
        });
    }),
    plain("vcm, light samples only", |s, u| {
        s.estimator = Estimator::VcmNee(u.radius());
    }),
    plain("vcm, light samples only, blurred", |s, u| {
        s.estimator = Estimator::VcmNee(u.radius());
        s.amounts = Amounts::Blurred;
    }),
    plain("sppm, one radius", |s, u| {
        s.estimator = Estimator::Sppm(u.radius());
    }),
    plain("sppm, radii", |s, u| {
        s.estimator = Estimator::Sppm(u.radius());
        s.amounts = Amounts::Radii(RadiusFactors::default());
    }),
    plain("mlt", |s, u| {
        let mutations = 1 + u.below(4);
        s.estimator = Estimator::Mlt { mutations };
    }),
    other("mlt, roughened", |s, u| {
        let mutations = 1 + u.below(4);
        s.estimator = Estimator::Mlt { mutations };
        s.rule = u.factors(0.0);
    }),
    other("mlt, mollifier", |s, u| {
        let mutations = 1 + u.below(4);
        s.estimator = Estimator::Mlt { mutations };
        s.rule = MOLLIFIER;
    }),
];
