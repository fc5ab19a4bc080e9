//! Estimator and rule of a render, and valid combinations of options.

use super::fault::Fault;
use super::spec::{Heading, Opt, Spec};
use super::value::{Levels, ResolveChoice, TableChoice, listed, word};
use crate::files::{FileError, hex};
use crate::integrator::bidirectional::{Radius, Strategy};
use crate::integrator::layers::Aov;
use crate::integrator::method::{Connections, IntegratorKind, Mode};
use crate::integrator::{Estimator, Settings};
use crate::regularise::rules::MOLLIFIER_RADIUS;
use crate::regularise::{Accumulated, Factors, Rule};
use crate::resolve::Resolve;
use crate::sampler::SamplerKind;

/// Options of a method that do not imply path tracing.
const OF_EVERY_METHOD: [&str; 4] = ["integrator", "resolve", "max_vertices", "seed"];

/// Table for levels that [`IntegratorKind::Auto`] tries if none is given.
const DEFAULT_TABLE: &str = "beta-0.001";

/// A method with its table loaded.
#[derive(Clone, Debug)]
pub struct Method {
    /// The algorithm.
    pub estimator: Estimator,
    /// The rule.
    pub rule: Rule,
    /// SHA-256 of the table's file, in hexadecimal digits.
    pub table_sha256: Option<String>,
    /// Number of scenes that the table was learned from, if its file says so.
    pub table_scenes: Option<usize>,
}

/// An error unless the condition holds.
fn ensure(holds: bool, name: &'static str, why: &str) -> Result<(), Fault> {
    match holds {
        true => Ok(()),
        false => Err(Fault::option(name, why)),
    }
}

impl Spec {
    /// The integrator: the given one; else path tracing if another option of the method is given, such as a table; else
    /// the choice of a pilot.
    pub fn kind(&self) -> IntegratorKind {
        let names_paths = |(option, _): (&Opt, String)| {
            let of_method = matches!(option.heading, Heading::Method | Heading::Research);
            of_method && !OF_EVERY_METHOD.contains(&option.name)
        };
        let unnamed = || match self.given().any(names_paths) {
            true => IntegratorKind::Path,
            false => IntegratorKind::Auto,
        };
        self.integrator.unwrap_or_else(unnamed)
    }

    /// True if a table or a factor roughens paths.
    pub(crate) fn has_factors(&self) -> bool {
        self.table.is_some()
    }

    /// Settings of the choice among levels and blurs.
    pub fn resolve(&self) -> Resolve {
        match self.resolve {
            Some(ResolveChoice::Film(resolve)) => resolve,
            Some(ResolveChoice::Raw) | None => Resolve::default(),
        }
    }

    /// True for the means of all samples, without levels or blurs.
    pub fn is_raw(&self) -> bool {
        self.resolve == Some(ResolveChoice::Raw)
    }

    /// The requested layers.
    pub fn aovs(&self) -> &[Aov] {
        self.aov.as_ref().map_or(&[], |layers| &layers.0)
    }

    /// An error for options that exclude each other or have no effect, before any file is read.
    pub fn check(&self) -> Result<(), Fault> {
        let kind = self.kind();
        for (option, value) in self.given_values() {
            let name = option.name;
            // Programs set fields without these checks.
            option
                .check(&value)
                .map_err(|what| Fault::option(name, what))?;
            let braces = |name: &&str| format!("{{{name}}}");
            if !option.needs.is_empty() && !option.needs.iter().any(|n| self.has(n)) {
                let needs: Vec<String> = option.needs.iter().map(braces).collect();
                return Err(Fault::option(name, format!("needs {}", listed(&needs))));
            }
            if let Some(other) = option.excludes.iter().find(|n| self.has(n)) {
                return Err(Fault::option(
                    name,
                    format!("cannot be used with {{{other}}}"),
                ));
            }
            if !option.of.is_empty() && !option.of.contains(&kind) {
                let named = option.of.iter().filter(|of| **of != IntegratorKind::Auto);
                let of: Vec<String> = named.map(word).collect();
                let of = listed(&of);
                let why = match self.integrator {
                    Some(kind) => {
                        let of = of.replace(" or ", " and ");
                        format!("is of {{integrator}} {of}, not of {}", word(&kind))
                    }
                    None => format!("needs {{integrator}} {of}"),
                };
                return Err(Fault::option(name, why));
            }
        }
        if self.aovs().contains(&Aov::Motion) {
            let why = "motion is of the frames of a film: `opsr render --frames`";
            return Err(Fault::option("aov", why));
        }
        self.check_mode()?;
        self.check_table()?;
        self.check_levels()?;
        self.check_sky()
    }

    fn check_mode(&self) -> Result<(), Fault> {
        let mode = self.mode.unwrap_or_default();
        let (kind, factors) = (self.kind(), self.has_factors());
        let own = !matches!(mode, Mode::Default | Mode::Reuse);
        if own && (factors || self.consistent.is_some()) {
            let why = "has a rule of its own: no {table} or {consistent}";
            return Err(Fault::option("mode", format!("{} {why}", word(&mode))));
        }
        ensure(
            factors || mode != Mode::Reuse,
            "mode",
            "reuse needs {table}",
        )?;
        ensure(
            self.filter.is_none() || mode == Mode::FilterGlossy,
            "filter",
            "needs {mode}=filter-glossy",
        )?;
        let modes = kind.row().modes;
        let others = modes.iter().filter(|mode| **mode != Mode::Default);
        let others: Vec<String> = others.map(word).collect();
        let but = match others.as_slice() {
            [] => String::new(),
            others => format!(" but {}", listed(others).replace(" or ", " and ")),
        };
        let why = format!("{{integrator}} {} takes no mode{but}", word(&kind));
        ensure(modes.contains(&mode), "mode", &why)?;
        let merges = self.strategy == Some(Strategy::Merges);
        ensure(
            !merges || kind == IntegratorKind::Vcm,
            "strategy",
            "only {integrator} vcm has merges",
        )?;
        if let Some(Strategy::Connection { s, t }) = self.strategy {
            let most = self
                .max_vertices
                .unwrap_or(Settings::default().max_vertices);
            let scatterings = s.saturating_add(t).saturating_sub(2);
            let why = format!(
                "paths of {scatterings} scattering vertices are longer than {{max_vertices}} {most}"
            );
            ensure(scatterings <= most, "strategy", &why)?;
        }
        let plain = self.strategy.is_none() || mode == Mode::Default;
        ensure(plain, "strategy", "a strategy is shown without {mode}")
    }

    /// An error for options of a table if one factor is given.
    fn check_table(&self) -> Result<(), Fault> {
        let has_classes = self.table.as_ref().is_none_or(TableChoice::has_classes);
        let why = "is of a table, not of one factor";
        ensure(
            has_classes || self.table_scale.is_none(),
            "table_scale",
            why,
        )?;
        ensure(has_classes || self.lookup.is_none(), "lookup", why)
    }

    fn check_levels(&self) -> Result<(), Fault> {
        use IntegratorKind::{Auto, Bdpt, Path, Sppm, Vcm};
        let Some(levels) = &self.levels else {
            return Ok(());
        };
        ensure(!self.is_raw(), "levels", "{resolve} raw has no levels")?;
        if *levels == Levels::None {
            let path = matches!(self.kind(), Auto | Path) && self.has_factors();
            let why = "none is of {integrator} path with {table}";
            return ensure(path, "levels", why);
        }
        ensure(
            self.has_factors() || matches!(self.kind(), Auto | Bdpt | Sppm | Vcm),
            "levels",
            "several levels scale the factors of {table}, and there are none",
        )
    }

    fn check_sky(&self) -> Result<(), Fault> {
        let sky = self
            .env
            .as_ref()
            .is_some_and(|env| env.as_os_str() == "sky");
        ensure(sky || self.sun.is_none(), "sun", "needs {env} sky")
    }

    /// True if layers are requested that sum to the picture without blurs.
    pub(super) fn splits_light(&self) -> bool {
        let parts = [Aov::Emission, Aov::Direct, Aov::Indirect];
        parts.iter().any(|part| self.aovs().contains(part))
    }

    /// An error for options that films in batches, or raw means, do not support.
    pub(super) fn check_resolved(&self, settings: &Settings) -> Result<(), Fault> {
        let levels = settings.amounts.has_batches();
        let wants = |aov: &Aov| self.aovs().contains(aov);
        let path = matches!(
            settings.estimator,
            Estimator::Path { .. } | Estimator::Guided { .. } | Estimator::Manifold { .. }
        );
        let why =
            "emission, direct and indirect are of the path tracer of raw means: {resolve} raw";
        ensure(!self.splits_light() || path && !levels, "aov", why)?;
        for layer in [Aov::Level, Aov::EachLevel] {
            let why = format!("{} needs several levels, and this render has one", layer);
            ensure(levels || !wants(&layer), "aov", &why)?;
        }
        let why = "needs several levels, and this render has one";
        let mut given = self.given_but_raw();
        match given.find(|(option, _)| option.of_levels && !levels) {
            Some((option, _)) => Err(Fault::option(option.name, why)),
            None => Ok(()),
        }
    }

    /// The method, with the table loaded from its file.
    pub(crate) fn method(&self) -> Result<Method, FileError> {
        let (mut table_sha256, mut table_scenes) = (None, None);
        let accumulated = |factors| {
            Rule::Accumulated(Accumulated {
                factors,
                lambda: self.consistent.unwrap_or(0.0),
            })
        };
        let mode = self.mode.unwrap_or_default();
        let mut table = self.table.clone();
        if let Some(choice) = &mut table {
            choice.load()?;
        }
        let rule = match (mode, table) {
            (Mode::Pbrt, ..) => Rule::Pbrt,
            (Mode::FilterGlossy, ..) => Rule::FilterGlossy(self.filter.unwrap_or(1.0)),
            (Mode::RoughnessClamp, ..) => Rule::RoughnessClamp,
            (Mode::Mollifier, ..) => Rule::Mollifier(MOLLIFIER_RADIUS),
            (_, Some(TableChoice::Factor(gamma))) => accumulated(Factors::Constant(gamma)),
            (_, Some(TableChoice::Loaded(file, _))) => {
                table_sha256 = Some(hex(&file.digest()));
                table_scenes = file.provenance.as_ref().map(|p| p.scenes.len());
                let mut table = file.table.clone();
                table.scale = self.table_scale.unwrap_or(table.scale);
                table.lookup = self.lookup.unwrap_or(table.lookup);
                accumulated(Factors::Table(table))
            }
            // Without a table; `load` above has read one given as a file.
            (_, None | Some(TableChoice::File(_))) => Rule::Plain,
        };
        Ok(Method {
            estimator: self.estimator(mode == Mode::Reuse),
            rule,
            table_sha256,
            table_scenes,
        })
    }

    fn estimator(&self, reuse: bool) -> Estimator {
        let radius = Radius {
            first: self.radius,
            alpha: self.radius_alpha.unwrap_or(Radius::default().alpha),
        };
        match self.kind().estimator(radius) {
            Estimator::Path { .. } => Estimator::Path { reuse },
            Estimator::Guided { .. } => Estimator::Guided {
                unbiased: self.unbiased.unwrap_or_default(),
            },
            Estimator::Manifold { .. } => Estimator::Manifold {
                trials: self.trials.unwrap_or_default(),
            },
            Estimator::Vcm(radius) if self.connections == Some(Connections::Nee) => {
                Estimator::VcmNee(radius)
            }
            Estimator::Mlt { mutations } => Estimator::Mlt {
                mutations: self.mlt_pass.unwrap_or(mutations),
            },
            other => other,
        }
    }

    /// The settings of this method for raw means.
    pub(crate) fn with(&self, method: &Method) -> Settings {
        let default = Settings::default();
        Settings {
            estimator: method.estimator,
            rule: method.rule.clone(),
            strategy: self.strategy,
            sampler: self.sampler.unwrap_or(SamplerKind::Sobol),
            max_vertices: self.max_vertices.unwrap_or(default.max_vertices),
            seed: self.seed.unwrap_or(default.seed),
            ..default
        }
    }

    /// The candidates of [`IntegratorKind::Auto`], the plain path tracer first: then the path tracer with the given
    /// options, or with levels of the built-in table if none are given, and other integrators without roughening. So a
    /// table adds no error to those.
    pub(crate) fn contenders(&self) -> Vec<Self> {
        use IntegratorKind::{Bdpt, Path, Vcm};
        let plain = |kind: IntegratorKind| {
            let merges = kind == Vcm;
            let mollifies = self.mode == Some(Mode::Mollifier) && matches!(kind, Path | Bdpt);
            Self {
                integrator: Some(kind),
                mode: mollifies.then_some(Mode::Mollifier),
                radius: self.radius.filter(|_| merges),
                radius_alpha: self.radius_alpha.filter(|_| merges),
                connections: self.connections.filter(|_| kind == Vcm),
                table: None,
                table_scale: None,
                lookup: None,
                consistent: None,
                // Levels are options of the path tracer.
                levels: None,
                ..self.clone()
            }
        };
        let mut contenders = vec![plain(Path)];
        let asked = self.has_factors();
        if asked || self.mode.unwrap_or_default() == Mode::Default {
            let own = || TableChoice::File(DEFAULT_TABLE.into());
            contenders.push(Self {
                integrator: Some(Path),
                radius: None,
                radius_alpha: None,
                connections: None,
                table: self.table.clone().or_else(|| (!asked).then(own)),
                ..self.clone()
            });
        }
        contenders.extend([Bdpt, Vcm].map(plain));
        contenders
    }
}
