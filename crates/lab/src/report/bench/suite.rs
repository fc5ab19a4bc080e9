//! Suites of measurements: scenes × methods × seeds, and the time points of the records. Read from TOML files.
//!
//! ```toml
//! baseline = "plain"
//! seeds = 5
//! times = [0.5, 1, 2, 4]
//! samples = [1, 4, 16]
//!
//! [[scene]]
//! name = "box"
//! builtin = "caustic-box"
//! size = [128, 128]
//! reference_spp = 16384
//!
//! [[method]]
//! name = "plain"
//!
//! [[method]]
//! name = "constant 0.1"
//! table = 0.1
//! ```

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use opsr::bsdf::Distribution;
use opsr::files::{self, FileError};
use opsr::image::film::Window;
use opsr::integrator::method::IntegratorKind;
use opsr::math::UVec2;
use opsr::regularise::file::TableFile;
use opsr::render::value::{ResolveChoice, TableChoice};
use opsr::render::{Fault, Heading, Opt, Spec};
use opsr::sampler::SamplerKind;

/// Most bytes of a suite's file.
const MAX_BYTES: u64 = 1 << 22;

/// A suite of measurements. Relative paths start at the suite's folder; `table` may also name a table that the program
/// contains, such as `beta-0.001`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Suite {
    /// The method that all others are compared with; the first by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baseline: Option<String>,
    /// Number of seeds; a verdict needs at least five.
    #[serde(default = "five")]
    pub seeds: u32,
    /// Seconds after which the errors are recorded, ascending.
    #[serde(default)]
    pub times: Vec<f64>,
    /// Samples per pixel after which the errors are recorded, ascending.
    #[serde(default)]
    pub samples: Vec<u32>,
    /// Clock of `times`.
    #[serde(default)]
    pub clock: Clock,
    /// The scenes.
    #[serde(rename = "scene")]
    pub scenes: Vec<SceneSpec>,
    /// The methods.
    #[serde(rename = "method")]
    pub methods: Vec<MethodSpec>,
}

/// Options of a render that belong to the scene, by their Python keywords.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Entries", into = "Entries")]
pub struct SceneOptions(pub Spec);

impl SceneOptions {
    fn is_empty(&self) -> bool {
        self.0 == Spec::default()
    }
}

impl TryFrom<Entries> for SceneOptions {
    type Error = String;

    fn try_from(entries: Entries) -> Result<Self, String> {
        let mut spec = Spec::default();
        for (key, value) in &entries {
            let of_scene = |option: &Opt| matches!(option.heading, Heading::Scene | Heading::Light);
            if !Opt::named(key).is_some_and(of_scene) {
                return Err(format!("options: `{key}` is no option of a scene"));
            }
            spec.set(key, value)
                .map_err(|fault| format!("options: {fault}"))?;
        }
        let checked = spec.check();
        checked.map_err(|fault| format!("options: {fault}"))?;
        Ok(Self(spec))
    }
}

impl From<SceneOptions> for Entries {
    fn from(options: SceneOptions) -> Self {
        options.0.settings()
    }
}

/// A method: a name and the options of a render, by their Python keywords. Without `levels` it has one level, and
/// without `sampler` independent samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Entries", into = "Entries")]
pub struct MethodSpec {
    /// Its name in the results.
    pub name: String,
    /// The render.
    pub spec: Spec,
}

/// A method as in the file.
type Entries = serde_json::Map<String, Value>;

impl TryFrom<Entries> for MethodSpec {
    type Error = String;

    fn try_from(mut entries: Entries) -> Result<Self, String> {
        let name = entries.remove("name");
        let name = name.as_ref().and_then(Value::as_str);
        let name = name.ok_or("a method without a name")?.to_owned();
        let wrong = |fault: Fault| format!("method `{name}`: {fault}");
        let mut spec = Spec::default();
        for (key, value) in &entries {
            // An empty list is one level, and `consistent = 0` leaves the bias.
            let none = match key.as_str() {
                "levels" => value.as_array().is_some_and(Vec::is_empty),
                "consistent" => value.as_f64() == Some(0.0),
                _ => false,
            };
            if none {
                continue;
            }
            spec.set(key, value).map_err(wrong)?;
        }
        Ok(Self { name, spec })
    }
}

impl From<MethodSpec> for Entries {
    fn from(MethodSpec { name, spec }: MethodSpec) -> Self {
        let mut entries = spec.settings();
        entries.insert("name".into(), name.into());
        entries
    }
}

impl MethodSpec {
    /// The render of a scene by this method with this seed. Omitted options get the defaults of a measurement.
    pub fn render(&self, max_vertices: u32, seed: u64) -> Spec {
        let mut spec = self.spec.clone();
        spec.integrator.get_or_insert(IntegratorKind::Path);
        if spec.levels.is_none() {
            spec.resolve.get_or_insert(ResolveChoice::Raw);
        }
        // Guided paths and chains have no Sobol points, and `auto` chooses as for a user.
        use IntegratorKind::{Auto, Guided, Mlt};
        if !matches!(spec.kind(), Auto | Guided | Mlt) {
            spec.sampler.get_or_insert(SamplerKind::Independent);
        }
        (spec.max_vertices, spec.seed) = (Some(max_vertices), Some(seed));
        spec
    }

    /// An error for an option that does not belong to a method.
    pub(super) fn check(&self) -> Result<(), Fault> {
        let foreign = |option: &Opt| {
            let method = matches!(option.heading, Heading::Method | Heading::Research)
                || option.name == "denoise";
            !method || ["max_vertices", "seed"].contains(&option.name)
        };
        if let Some((option, _)) = self.spec.given().find(|(option, _)| foreign(option)) {
            return Err(Fault::option(
                option.name,
                "is no part of a method in a suite",
            ));
        }
        self.spec.check()
    }
}

fn five() -> u32 {
    5
}

/// Clock of `times`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Clock {
    /// Wall time.
    #[default]
    Wall,
    /// CPU time over the number of threads: the wall time of a machine without other work.
    Cpu,
}

/// A scene, its view, and its reference.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// Name in the results.
    pub name: String,
    /// Group whose scenes reports summarise together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub group: Option<String>,
    /// A glTF file, unless `builtin` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Name of a scene of the program, unless `file` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub builtin: Option<String>,
    /// Environment: an equirectangular map (.hdr or .exr).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<PathBuf>,
    /// Slope distribution of the lobes of a file's materials.
    #[serde(default)]
    pub distribution: Lobes,
    /// Options of a render for the scene and its light.
    #[serde(default, skip_serializing_if = "SceneOptions::is_empty")]
    pub options: SceneOptions,
    /// Full frame in pixels.
    pub size: [u32; 2],
    /// The part that is rendered: x, y, width, height.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub crop: Option<[u32; 4]>,
    /// Camera by name or number; the first if not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub camera: Option<String>,
    /// Largest number of scattering vertices of a path.
    #[serde(default = "sixteen", alias = "max_depth")]
    pub max_vertices: u32,
    /// The converged picture (.exr), unless `reference_spp` is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<PathBuf>,
    /// Samples per pixel of a reference that is rendered and kept beside the results.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference_spp: Option<u32>,
    /// The algorithm that renders the reference: it must find all light of the scene.
    #[serde(default = "path", skip_serializing_if = "IntegratorKind::is_path")]
    pub reference_integrator: IntegratorKind,
    /// The part of the picture that the report shows: x, y, width, height in the full frame; the middle by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inset: Option<[u32; 4]>,
    /// Exposure in stops for FLIP and for the report's pictures.
    #[serde(default)]
    pub exposure: f32,
    /// Names of the methods for this scene; all by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub methods: Option<Vec<String>>,
}

fn path() -> IntegratorKind {
    IntegratorKind::Path
}

fn sixteen() -> u32 {
    16
}

/// [`Distribution`] in a suite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Lobes {
    /// The distribution that tables are learned for.
    #[default]
    Beckmann,
    /// glTF's own.
    Ggx,
}

impl From<Lobes> for Distribution {
    fn from(lobes: Lobes) -> Self {
        match lobes {
            Lobes::Beckmann => Self::Beckmann,
            Lobes::Ggx => Self::Ggx,
        }
    }
}

impl Suite {
    /// Reads a suite; relative paths in it start at its folder.
    pub fn load(path: &Path) -> Result<Self, FileError> {
        let text = files::read_text(path, MAX_BYTES)?;
        let mut suite = Self::parse(&text).map_err(|e| FileError::content(path, e))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let scene_files = suite
            .scenes
            .iter_mut()
            .flat_map(|s| [&mut s.file, &mut s.reference, &mut s.environment]);
        let tables = suite
            .methods
            .iter_mut()
            .filter_map(|m| match &mut m.spec.table {
                Some(TableChoice::File(path)) => Some(path),
                _ => None,
            });
        // The name of a table of the program is a path only if such a file exists.
        let is_file = |t: &&mut PathBuf| !TableFile::is_built_in(t) || folder.join(&**t).exists();
        for file in scene_files.flatten().chain(tables.filter(is_file)) {
            *file = folder.join(&*file);
        }
        Ok(suite)
    }

    /// Reads a suite from text and checks it.
    pub fn parse(text: &str) -> Result<Self, String> {
        let suite: Self = files::toml(text)?;
        super::check::suite(&suite)?;
        Ok(suite)
    }

    /// The method that all others are compared with.
    pub fn baseline(&self) -> &str {
        match &self.baseline {
            Some(name) => name,
            None => self.methods.first().map_or("", |m| &m.name),
        }
    }

    /// The seeds.
    pub fn seeds(&self) -> impl Iterator<Item = u64> + use<> {
        1..=u64::from(self.seeds)
    }

    /// The methods of a scene, in the suite's order.
    pub fn methods_of<'a>(&'a self, scene: &'a SceneSpec) -> impl Iterator<Item = &'a MethodSpec> {
        let wanted = move |m: &&MethodSpec| {
            scene
                .methods
                .as_ref()
                .is_none_or(|names| names.contains(&m.name))
        };
        self.methods.iter().filter(wanted)
    }
}

fn window([x, y, w, h]: [u32; 4]) -> Window {
    Window { x, y, w, h }
}

impl SceneSpec {
    /// Full frame.
    pub fn frame(&self) -> UVec2 {
        UVec2::from_array(self.size)
    }

    /// The part that is rendered.
    pub fn window(&self) -> Window {
        self.crop.map_or(Window::full(self.frame()), window)
    }

    /// The part that is shown: at most 96 pixels a side in the middle, unless the suite gives it.
    pub fn inset_window(&self) -> Window {
        const EDGE: u32 = 96;
        let outer = self.window();
        let (w, h) = (outer.w.min(EDGE), outer.h.min(EDGE));
        self.inset.map_or(
            Window {
                x: outer.x + (outer.w - w) / 2,
                y: outer.y + (outer.h - h) / 2,
                w,
                h,
            },
            window,
        )
    }
}
