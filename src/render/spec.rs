//! The options of a render, each declared once.
//!
//! A declaration is a field of [`Spec`]: its type, its help, and an [`Opt`] with its names, range, default, heading,
//! requirements, exclusions and effect. The command line, Python's keywords and the methods of a suite are generated
//! from these declarations, and so are the records of a render (`Spec::recorded`).

use super::fault::Fault;
use super::look::{CameraChoice, Look};
use super::value::{
    Crop, Exposure, Field, Glass, Layers, LensChoice, Levels, Moment, NameOrNumber, Range,
    ResolveChoice, Size, Sun, TableChoice,
};
use crate::bsdf::Distribution;
use crate::files::FileError;
use crate::image::display::ViewTransform;
use crate::image::exr::Storage;
use crate::integrator::bidirectional::Strategy;
use crate::integrator::method::IntegratorKind::{
    self, Auto, Bdpt, Guided, Light, Manifold, Mlt, Path, Sppm, Vcm,
};
use crate::integrator::method::{Connections, Mode};
use crate::regularise::Lookup;
use crate::sampler::SamplerKind;
use crate::scene::Camera;
use crate::scene::load::Unsupported;
use serde_json::Value;
use std::path::PathBuf;
use std::time::Duration;

/// Heading of an option in a list of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Heading {
    /// The scene file and its materials and animations.
    Scene,
    /// Surroundings of the scene.
    Light,
    /// The camera and its picture.
    Camera,
    /// The end of a render.
    Stop,
    /// Estimator and table.
    Method,
    /// Details of a method: on the command line the keys of `--set`.
    Research,
    /// Files of the picture.
    Files,
}

impl std::fmt::Display for Heading {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Stop => f.write_str("When to stop"),
            other => write!(f, "{other:?}"),
        }
    }
}

/// Effect of an option.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Pixels: recorded by name.
    Pixels,
    /// Pixels: recorded by this key, which is more precise than the option.
    As(&'static str),
    /// The frame or its crop, which the header of a file contains.
    Frame,
    /// The number of samples, which is recorded.
    Samples,
    /// Files, not the picture in them.
    Files,
}

/// Declaration of an option.
#[derive(Debug)]
pub struct Opt {
    /// Name of the field, of Python's keyword and of a suite's key.
    pub name: &'static str,
    /// Name on the command line, if it differs.
    pub flag: Option<&'static str>,
    /// Heading.
    pub heading: Heading,
    /// Placeholder of its value; empty for a switch.
    pub value: &'static str,
    /// Help of one paragraph.
    pub help: &'static str,
    /// Default value in words.
    pub default: Option<&'static str>,
    /// Value of an option that is given without a value.
    pub bare: Option<&'static str>,
    /// Valid range of numbers.
    pub range: Range,
    /// Effect on the picture and its files.
    pub effect: Effect,
    /// Options of which at least one must be given too.
    pub needs: &'static [&'static str],
    /// Options with which it cannot be combined.
    pub excludes: &'static [&'static str],
    /// Integrators that support it; all if empty.
    pub of: &'static [IntegratorKind],
    /// True if it needs several levels.
    pub of_levels: bool,
    /// True for a choice that is made on a finished film, and can be changed later.
    pub of_film: bool,
    /// True for options of most renders.
    pub common: bool,
    /// Names of the valid choices, for types that have a list.
    pub names: fn() -> Vec<String>,
    /// Python type.
    pub python: fn() -> String,
    /// The choices with their help.
    #[cfg(feature = "clap")]
    pub possible: fn() -> Vec<clap::builder::PossibleValue>,
    /// An error unless a value is valid.
    check: fn(&Value, &Range) -> Result<(), String>,
}

impl Opt {
    const fn new<T: Field>(name: &'static str, heading: Heading, help: &'static str) -> Self {
        Self {
            name,
            flag: None,
            heading,
            value: "",
            help,
            default: None,
            bare: None,
            range: Range::FINITE,
            effect: Effect::Pixels,
            needs: &[],
            excludes: &[],
            of: &[],
            of_levels: false,
            of_film: false,
            common: false,
            names: T::names,
            python: T::python,
            #[cfg(feature = "clap")]
            possible: T::possible,
            check: |value, range| T::read(value, range).map(|_| ()),
        }
    }

    /// Name on the command line, without its dashes; `set NAME` for a key of `--set`.
    pub fn flag(&self) -> String {
        match (self.heading, self.flag) {
            (Heading::Research, _) => format!("set {}", self.name),
            (_, Some(flag)) => flag.to_owned(),
            (_, None) => self.name.replace('_', "-"),
        }
    }

    /// The option with this value on a command line; `value` is quoted.
    pub fn words(&self, value: &str) -> String {
        let flag = self.flag();
        match (self.heading, self.value.is_empty()) {
            (Heading::Research, _) => format!("--{flag}={value}"),
            (_, true) => format!("--{flag}"),
            (_, false) => format!("--{flag} {value}"),
        }
    }

    /// An error unless the option takes this value.
    pub(crate) fn check(&self, value: &Value) -> Result<(), String> {
        (self.check)(value, &self.range)
    }

    /// Help in one line of text.
    pub fn help(&self) -> String {
        self.help.trim().replace("\n ", " ")
    }

    /// First sentence of the help, without its full stop.
    pub fn short_help(&self) -> String {
        let help = self.help();
        let first = help
            .split_once(". ")
            .map_or(help.as_str(), |(first, _)| first);
        first.trim_end_matches('.').to_owned()
    }

    /// The option with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        OPTIONS.iter().find(|option| option.name == name)
    }
}

macro_rules! options {
    ($($(#[doc = $doc:literal])+ $name:ident: $type:ty, $heading:ident { $($key:ident: $value:expr),* $(,)? })+) => {
        /// Options of a render; `None` stands for the default.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Spec {
            $($(#[doc = $doc])+ pub $name: Option<$type>,)+
        }

        /// All options, heading by heading.
        pub static OPTIONS: &[Opt] = &[
            $(Opt {
                $($key: $value,)*
                ..Opt::new::<$type>(stringify!($name), Heading::$heading, concat!($($doc, "\n"),+))
            }),+
        ];

        impl Spec {
            /// Sets an option to a parsed value.
            fn read(&mut self, option: &Opt, value: &Value) -> Result<(), String> {
                match option.name {
                    $(stringify!($name) => self.$name = Some(Field::read(value, &option.range)?),)+
                    _ => {}
                }
                Ok(())
            }

            /// Sets the options of another spec that are given here and not there.
            pub fn fill(&self, other: &mut Self) {
                $(if other.$name.is_none() {
                    other.$name.clone_from(&self.$name);
                })+
            }

            /// The given value of an option as text, and as a value for a file of settings.
            fn written(&self, name: &str) -> Option<(String, Value)> {
                match name {
                    $(stringify!($name) => self.$name.as_ref().map(|x| (x.text(), x.value())),)+
                    _ => None,
                }
            }
        }
    };
}

options! {
    /// Surroundings: a map (.hdr, .exr), `studio`, `sky` or `none`. Maps are equirectangular; `studio` has soft lamps,
    /// grey walls and a floor; `sky` is a clear sky with its sun. By default `studio` for a scene without light, else
    /// `none`.
    env: PathBuf, Light { value: "FILE|NAME", common: true }
    /// Sun of `--env sky`: its height and its angle to the right of the front, in degrees, and the haze. A haze of 2 is a very clear
    /// sky, 3 the default, 10 a hazy one.
    sun: Sun, Light { value: "HEIGHT,ANGLE,HAZE" }
    /// Factor on the radiance of the environment.
    env_intensity: f32, Light { value: "X", range: Range::POSITIVE, default: Some("1") }
    /// Rotation of the environment about the vertical axis, in degrees.
    env_rotation: f32, Light { value: "DEGREES", default: Some("0") }

    /// Microfacet distribution of glossy lobes. Tables are learned for Beckmann; GGX is glTF's own model. By default
    /// that of a pbrt or Mitsuba scene, else `beckmann`.
    distribution: Distribution, Scene { value: "DISTRIBUTION" }
    /// Treatment of unsupported parts of a pbrt or Mitsuba scene. `nearest` replaces surfaces and textures by the
    /// nearest supported ones, with a warning, and refuses to leave out lamps, media and shapes; `skip` leaves them
    /// out; `error` refuses all.
    unsupported: Unsupported, Scene { value: "UNSUPPORTED", default: Some("nearest") }
    /// Show closed meshes that transmit without a thickness, such as glass from Blender, as solid bodies or as thin
    /// walls. By default they are bodies in files from Blender, else walls.
    glass: Glass, Scene { value: "GLASS" }
    /// Material variant, by name or number (from 0).
    variant: NameOrNumber, Scene { value: "NAME" }
    /// Moment of the animations: seconds from their start, such as 0.5s, or a frame (from 0) and frames per second,
    /// such as 12@24. By default the scene is at rest.
    at: Moment, Scene { value: "SECONDS|FRAME@FPS" }

    /// Size of the picture, such as 1280x720, 50% or 1/2. A share is relative to the default size: 512 rows, and a
    /// width that fits the camera.
    size: Size, Camera { value: "WxH|SHARE", effect: Effect::Frame, common: true }
    /// Render only this part of the picture. Each number is in pixels, or a share of width or height such as 25% or
    /// 1/4.
    crop: Crop, Camera { value: "X,Y,W,H", effect: Effect::Frame }
    /// Camera: a name, a number, a file or numbers. Cameras of the scene are numbered from 0. A file is a view that
    /// `opsr view` saved (.json). The ten numbers are X,Y,Z of position, target and up, and the vertical field of view
    /// in degrees. Two more shift the picture, in halves of its height.
    camera: CameraChoice, Camera { value: "NAME|FILE|NUMBERS", common: true }
    /// Lens of the camera: its radius and the distance in focus along the view direction, in units of the scene. The
    /// default distance is that of the file's lens; radius 0 removes the lens of the file.
    lens: LensChoice, Camera { value: "RADIUS,DISTANCE" }

    /// Samples per pixel. 128 if --spp, --time and --target-error are all absent.
    spp: u32, Stop { value: "N", range: Range::COUNT, effect: Effect::Samples, common: true }
    /// Stop after this long, such as 60s or 5min. The first sample may take twice as long.
    time: Duration, Stop { value: "TIME", effect: Effect::Samples, common: true }
    /// Stop when the average error is below this. 0.05 is 5 %: the mean over pixels of the absolute error over the
    /// light. The render continues while a few bright samples dominate the estimate.
    target_error: f32, Stop { value: "X", range: Range::POSITIVE, effect: Effect::Samples, common: true }

    /// The algorithm that estimates the picture. With a table or a detail of a method the default is `path`.
    integrator: IntegratorKind, Method { value: "INTEGRATOR", default: Some("auto"), common: true }
    /// Learned attenuation factors: a table, or one factor. A table is a file, or beta-0.001 or beta-0.05, which the
    /// program contains. One factor in [0, 1] applies to all paths; 0 is plain path tracing.
    table: TableChoice, Method { flag: Some("opsr-table"), value: "TABLE|X", effect: Effect::As("table_sha256"), of: &[Path, Guided, Bdpt, Vcm, Mlt, Auto], common: true }
    /// Smoothing of pictures with several levels, or of plain path tracing, bdpt or vcm. `raw` gives the means of the
    /// samples, with any integrator. If absent, `default`.
    resolve: ResolveChoice, Method { value: "HOW", of_levels: true, of_film: true }
    /// Largest number of scattering vertices of a path.
    max_vertices: u32, Method { value: "N", default: Some("16"), range: Range::from(1.0, 65536.0) }
    /// Seed of all random numbers. The same seed gives a bit-identical picture.
    seed: u64, Method { value: "N", default: Some("0"), common: true }

    /// Levels of roughening on the same paths; every pixel gets the best one. Give their number, or the scales of the
    /// table, such as 0,0.25,1. Level 0 is plain path tracing; `none` renders the table as it is, with blurs. The
    /// default with a table is four, but none with mode, consistent or another integrator. For sppm the numbers are
    /// factors on its radius, by default 1,2,4.
    levels: Levels, Research { value: "N|SCALES|none", effect: Effect::As("levels") }
    /// Factor on all factors of the table, instead of the scale in its file.
    table_scale: f32, Research { value: "X", range: Range::POSITIVE, needs: &["table"] }
    /// Look-up of the factors, instead of the one for which the table was learned.
    lookup: Lookup, Research { value: "LOOKUP", needs: &["table"] }
    /// Rule of regularisation.
    mode: Mode, Research { value: "RULE", default: Some("default") }
    /// Make the bias vanish with the number of samples: sample n roughens by n^-X of the full amount, X in (0, 0.5);
    /// 1/6 without a number.
    consistent: f32, Research { value: "X", bare: Some("0.16666667"), range: Range::between(0.0, 0.5), needs: &["table"] }
    /// Filter value of filter-glossy; 1 if not given.
    filter: f32, Research { value: "X", range: Range::POSITIVE }
    /// Roughen only the paths from which a guide learns, not those of the picture.
    unbiased: bool, Research { needs: &["table"], of: &[Guided] }
    /// Trials of manifold sampling for each light point; 0, the default, for as many as an unbiased picture needs.
    trials: u32, Research { value: "N", range: Range::from(0.0, 65536.0), of: &[Manifold] }
    /// Initial radius within which the photons of vcm and sppm count, in units of the scene; by default twice a pixel's
    /// footprint.
    radius: f32, Research { value: "R", range: Range::POSITIVE, of: &[Vcm, Sppm, Auto] }
    /// Exponent with which that radius shrinks: in sample n it is n^((A − 1)/2) of the initial one, A in (0, 1]; by
    /// default 2/3.
    radius_alpha: f32, Research { value: "A", range: Range::above(0.0, 1.0), of: &[Vcm, Sppm, Auto] }
    /// Connections of vcm; by default all.
    connections: Connections, Research { value: "CONNECTIONS", of: &[Vcm, Auto] }
    /// Mutations per pixel in one sample of mlt; by default 16.
    mlt_pass: u32, Research { value: "N", range: Range::from(1.0, 65536.0), of: &[Mlt] }
    /// Show one strategy of bdpt or vcm with its weights: S vertices from the light and T from the camera, both ends
    /// included, such as 0,3 (a camera path that hits a light), 1,2 (light sampling) or 3,1 (light tracing); or
    /// `merges` of vcm. The pictures of all strategies add up to the whole picture.
    strategy: Strategy, Research { value: "S,T|merges", excludes: &["table"], of: &[Bdpt, Vcm] }
    /// Random numbers of paths. guided and mlt always use independent ones, and a suite does by default.
    sampler: SamplerKind, Research { value: "KIND", default: Some("sobol"), of: &[Path, Manifold, Light, Bdpt, Vcm, Sppm, Auto] }

    /// Add layers to EXR files; by default albedo, normal, depth. `each-level` adds every level as a layer: `level0`,
    /// `level1` and so on.
    aov: Layers, Files { value: "LAYERS", bare: Some(Layers::USUAL), effect: Effect::Files, common: true }
    /// Denoise the picture with Open Image Denoise 2. The library is searched for in the folder OIDN_DIR and in the
    /// system's library path. The denoised picture is blended with the resolved one where samples that it has not seen
    /// show that it helps; `--resolve raw` gives the denoised picture alone. EXR files keep the picture before
    /// denoising as the layer `noisy`.
    denoise: bool, Files { common: true, of_film: true }
    /// Brightness of PNG files in stops. `auto` puts the 90th percentile of the luminance at 65 % of white, but never
    /// brightens the built-in studio; `none` is 0.
    exposure: Exposure, Files { value: "STOPS|auto|none", default: Some("auto"), effect: Effect::Files, of_film: true, common: true }
    /// View transform of PNG files.
    view: ViewTransform, Files { value: "VIEW", default: Some("srgb"), effect: Effect::Files, of_film: true, common: true }
    /// Storage of EXR files: a lossless compression (none, rle, zips, zip, piz), `half`, or both. `half` writes colours and normals
    /// as half floats: half the size, three digits, at most 65504.
    exr: Storage, Files { value: "STORAGE", default: Some("zip"), effect: Effect::Files, of_film: true }
}

/// Names that options had, and the options that replace them.
const RENAMED: [(&str, &str); 16] = [
    ("gamma", "{table} X"),
    ("look", "{camera} FILE|NUMBERS"),
    ("aperture", "{lens} RADIUS,DISTANCE"),
    ("focus", "{lens} RADIUS,DISTANCE"),
    ("turbidity", "{sun} HEIGHT,ANGLE,HAZE"),
    ("skip_unsupported", "{unsupported} skip"),
    ("solid_glass", "{glass} solid"),
    ("thin_glass", "{glass} thin"),
    ("frame", "{at} FRAME@FPS"),
    ("fps", "{at} FRAME@FPS"),
    ("time_of_scene", "{at} SECONDS, such as 0.5s"),
    ("guide", "{integrator} guided"),
    ("manifold", "{integrator} manifold"),
    ("level_layers", "{aov} each-level"),
    ("exr_half", "{exr} half"),
    ("exr_compression", "{exr}"),
];

/// The option that replaces a name of an earlier version, as text for [`Fault`]; `None` for other names.
pub fn renamed(name: &str) -> Option<String> {
    let key = name.replace('-', "_");
    let replaced = RENAMED.iter().find(|(old, _)| *old == key);
    let moved = || Opt::named(&key).filter(|option| option.heading == Heading::Research);
    replaced
        .map(|(_, new)| (*new).to_owned())
        .or_else(|| moved().map(|option| format!("{{{}}}={}", option.name, option.value)))
}

impl Spec {
    /// Sets an option by its name.
    pub fn set(&mut self, name: &str, value: &Value) -> Result<(), Fault> {
        let option = Opt::named(name);
        let option = option.ok_or_else(|| {
            let instead = renamed(name).map_or(String::new(), |new| format!("; it is {new} now"));
            Fault::usage(format!("there is no option `{name}`{instead}"))
        })?;
        let read = self.read(option, value);
        read.map_err(|what| Fault::option(option.name, what))
    }

    /// Given options in declaration order, with their values as text.
    pub fn given(&self) -> impl Iterator<Item = (&'static Opt, String)> {
        self.entries().map(|(option, text, _)| (option, text))
    }

    /// Options that are given, with their values.
    pub(super) fn given_values(&self) -> impl Iterator<Item = (&'static Opt, Value)> {
        self.entries().map(|(option, _, value)| (option, value))
    }

    fn entries(&self) -> impl Iterator<Item = (&'static Opt, String, Value)> {
        OPTIONS.iter().filter_map(|option| {
            let (text, value) = self.written(option.name)?;
            // A switch that is off counts as not given.
            (value != Value::Bool(false)).then_some((option, text, value))
        })
    }

    /// The given options without `--resolve raw`, which is a choice before the render, not on its film.
    pub(crate) fn given_but_raw(&self) -> impl Iterator<Item = (&'static Opt, String)> {
        let raw = self.is_raw();
        self.given()
            .filter(move |(option, _)| !(raw && option.name == "resolve"))
    }

    /// True if the option is given.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.entries().any(|(option, ..)| option.name == name)
    }

    /// The given options and values as a table of settings.
    pub fn settings(&self) -> serde_json::Map<String, Value> {
        let entries = self.entries();
        entries
            .map(|(option, _, value)| (option.name.to_owned(), value))
            .collect()
    }

    /// Given options that change pixels, for metadata; `integrator` may be a pilot's choice.
    pub(crate) fn recorded(
        &self,
        integrator: IntegratorKind,
    ) -> impl Iterator<Item = (&'static str, String)> {
        let known = move |option: &Opt| option.of.is_empty() || option.of.contains(&integrator);
        self.given()
            .filter(move |(option, _)| option.effect == Effect::Pixels && known(option))
            .map(|(option, text)| (option.name, text))
    }

    /// The given options of these headings as text, which is equal only for equal pixels.
    pub fn words(&self, headings: &[Heading]) -> String {
        let words = self
            .given()
            .filter(|(option, _)| headings.contains(&option.heading));
        let words = words.filter(|(option, _)| option.effect == Effect::Pixels);
        words
            .map(|(option, text)| format!(", {} {text}", option.name))
            .collect()
    }
}

impl Spec {
    /// Loads the look, so that it is read once. Its lens is used unless the options give one.
    pub fn load_look(&mut self) -> Result<(), Fault> {
        let Some(look) = self.own_look()? else {
            return Ok(());
        };
        let own = look.aperture.map(|radius| LensChoice {
            radius,
            focus: look.focus.filter(|_| radius > 0.0),
        });
        let lens = self.lens.or(own);
        self.lens = lens.map(|lens| LensChoice {
            focus: lens.focus.or(look.focus).filter(|_| lens.radius > 0.0),
            ..lens
        });
        self.camera = Some(CameraChoice::Numbers(Box::new(look)));
        Ok(())
    }

    /// The look, if the camera is not one of the scene.
    fn own_look(&self) -> Result<Option<Look>, FileError> {
        let look = self.camera.as_ref().map(CameraChoice::look);
        look.transpose().map(Option::flatten)
    }

    /// The camera of the look.
    pub(super) fn looking(&self) -> Result<Option<Camera>, Fault> {
        let camera = self.own_look()?.map(|look| look.camera());
        camera.transpose().map_err(|e| Fault::option("camera", e))
    }
}
