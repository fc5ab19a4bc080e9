//! Command-line options from the declarations in `opsr::render`.

use clap::builder::PossibleValuesParser;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command};
use opsr::math::UVec2;
use opsr::render::{Fault, Heading, Names, OPTIONS, Opt, Spec};
use serde_json::Value;
use std::ops::Range;

/// True for a key of `--set`.
fn is_research(option: &Opt) -> bool {
    option.heading == Heading::Research
}

/// The clap option of a declaration.
fn arg(option: &'static Opt) -> Arg {
    let arg = Arg::new(option.name)
        .long(option.flag())
        .help(option.short_help())
        .long_help(option.help())
        .help_heading(option.heading.to_string())
        .hide_short_help(!option.common);
    if option.value.is_empty() {
        return arg.action(ArgAction::SetTrue);
    }
    let mut arg = arg.value_name(option.value);
    if option.name == "max_vertices" {
        arg = arg.alias("max-depth");
    }
    // Lists of numbers and numbers with units, which can be negative.
    if ["camera", "sun", "at"].contains(&option.name) {
        arg = arg.allow_hyphen_values(true);
    }
    if let Some(bare) = option.bare {
        arg = arg.num_args(0..=1).default_missing_value(bare);
    }
    if let Some(default) = option.default {
        arg = arg.default_value(default);
    }
    let choices = (option.possible)();
    match (choices.is_empty(), option.name) {
        (false, "aov") => arg
            .value_parser(PossibleValuesParser::new(choices))
            .value_delimiter(',')
            .action(ArgAction::Append),
        (false, _) => arg.value_parser(PossibleValuesParser::new(choices)),
        (true, _) => arg.value_parser(move |text: &str| checked(option, text)),
    }
}

/// Help below the options that `-h` lists.
pub(super) const MORE: &str = "These are the options that most renders use; --help lists all.";

/// Limits of a render other than the number of samples.
const BOUNDS: [&str; 2] = ["time", "target_error"];

/// The option for the layers of a finished film: other layers exist only during a render.
fn level_layers(arg: Arg) -> Arg {
    let help = "Add every level to EXR files, as layers level0, level1 and so on";
    arg.help(help)
        .long_help(help)
        .num_args(1)
        .value_parser(["each-level"])
}

/// The text, if it is a valid value of the option.
fn checked(option: &'static Opt, text: &str) -> Result<String, String> {
    let read = Spec::default().set(option.name, &Value::from(text));
    read.map(|()| text.to_owned())
        .map_err(|fault| fault.reason(Names::Flags))
}

/// The option `--set`, whose help lists its keys.
fn details() -> Arg {
    let keys = OPTIONS.iter().filter(|option| is_research(option));
    let keys = keys.map(|option| {
        let names = (option.names)().join("|");
        let value = match (option.value, names.as_str()) {
            ("", _) => "true",
            (value, "") => value,
            (_, names) => names,
        };
        format!("- {}={value}: {}", option.name, option.help())
    });
    let keys = keys.collect::<Vec<_>>().join("\n");
    Arg::new("set")
        .long("set")
        .value_name("KEY=VALUE")
        .help("A detail of the method; --help lists the keys")
        .long_help(format!(
            "A detail of the method; may be given several times.\n\n{keys}"
        ))
        .help_heading(Heading::Research.to_string())
        .action(ArgAction::Append)
        .value_parser(|text: &str| detail(text).map(|_| text.to_owned()))
}

/// A key of `--set` and its value.
fn detail(text: &str) -> Result<(&'static Opt, &str), String> {
    let (key, value) = match text.split_once('=') {
        Some((key, value)) => (key, Some(value)),
        None => (text, None),
    };
    let option = Opt::named(key).filter(|option| is_research(option));
    let option = option.ok_or_else(|| match Opt::named(key) {
        Some(option) => format!("`{key}` is an option of its own, --{}", option.flag()),
        None => {
            let keys = OPTIONS.iter().filter(|option| is_research(option));
            let keys: Vec<&str> = keys.map(|option| option.name).collect();
            format!("no key `{key}`: there are {}", keys.join(", "))
        }
    })?;
    let switch = option.value.is_empty().then_some("true");
    let value = value.or(option.bare).or(switch);
    let value = value.ok_or_else(|| format!("expected {key}={}", option.value))?;
    checked(option, value).map(|_| (option, value))
}

/// Sets the options that `--set` gives.
fn read_details(spec: &mut Spec, matches: &ArgMatches) -> Result<(), Fault> {
    let given = matches.get_many::<String>("set").into_iter().flatten();
    for (option, value) in given.filter_map(|text| detail(text).ok()) {
        if spec.given().any(|(given, _)| given.name == option.name) {
            return Err(Fault::option(option.name, "given twice"));
        }
        spec.set(option.name, &Value::from(value))?;
    }
    Ok(())
}

/// The given options that satisfy `wanted`.
fn read(matches: &ArgMatches, wanted: fn(&Opt) -> bool) -> Result<Spec, clap::Error> {
    let mut spec = Spec::default();
    let fault = |fault: Fault| {
        clap::Error::raw(
            clap::error::ErrorKind::InvalidValue,
            fault.message(Names::Flags) + "\n",
        )
    };
    if OPTIONS
        .iter()
        .any(|option| is_research(option) && wanted(option))
    {
        read_details(&mut spec, matches).map_err(fault)?;
    }
    let flags = OPTIONS.iter().filter(|option| !is_research(option));
    for option in flags.filter(|option| wanted(option)) {
        let name = option.name;
        if matches.value_source(name) != Some(ValueSource::CommandLine) {
            continue;
        }
        let value = if option.value.is_empty() {
            Value::from(matches.get_flag(name))
        } else {
            let values = matches.get_many::<String>(name).into_iter().flatten();
            let words: Vec<&str> = values.map(String::as_str).collect();
            Value::from(words.join(","))
        };
        spec.set(name, &value).map_err(fault)?;
    }
    Ok(spec)
}

macro_rules! groups {
    ($($(#[doc = $doc:literal])+ $name:ident: $wanted:expr;)+) => {
        $(
            $(#[doc = $doc])+
            #[derive(Clone, Debug)]
            pub(super) struct $name(pub(super) Spec);

            impl clap::Args for $name {
                fn augment_args(command: Command) -> Command {
                    let wanted: fn(&Opt) -> bool = $wanted;
                    let (details, flags): (Vec<_>, Vec<_>) = OPTIONS
                        .iter()
                        .filter(|option| wanted(option))
                        .partition(|option| is_research(option));
                    let of_film = flags.iter().all(|option| option.heading == Heading::Files || option.of_film);
                    let flag = |option: &'static Opt| match of_film && option.name == "aov" {
                        true => level_layers(arg(option)),
                        false => arg(option),
                    };
                    let command = command.args(flags.into_iter().map(flag));
                    command.args((!details.is_empty()).then(self::details))
                }

                fn augment_args_for_update(command: Command) -> Command {
                    Self::augment_args(command)
                }
            }

            impl clap::FromArgMatches for $name {
                fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
                    read(matches, $wanted).map(Self)
                }

                fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
                    *self = Self::from_arg_matches(matches)?;
                    Ok(())
                }
            }
        )+
    };
}

groups! {
    /// All options of a render.
    RenderOptions: |_| true;
    /// Options of a part: those of the whole picture are for `opsr merge`.
    PartOptions: |option| {
        (!option.of_film || option.name == "resolve") && !BOUNDS.contains(&option.name)
    };
    /// Options of the paths of a pixel.
    TraceOptions: |option| {
        option.heading != Heading::Files && option.name != "crop" && !BOUNDS.contains(&option.name)
    };
    /// Options of the scene, its light, and a picture of it.
    SceneOptions: |option| {
        matches!(option.heading, Heading::Scene | Heading::Light) || ["size", "camera"].contains(&option.name)
    };
    /// Options of the choice among levels and of files, which are made again from a film.
    FileOptions: |option| option.of_film || option.name == "aov";
    /// Options of files that are written of a picture.
    PictureOptions: |option| ["exposure", "view", "exr"].contains(&option.name);
    /// The part of a picture.
    CropOption: |option| option.name == "crop";
}

/// A pixel of the frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pixel(pub(super) UVec2);

/// A pixel such as `10,20`.
pub(super) fn pixel(text: &str) -> Result<Pixel, String> {
    let numbers = text
        .split_once(',')
        .map(|(x, y)| (x.trim().parse(), y.trim().parse()));
    match numbers {
        Some((Ok(x), Ok(y))) => Ok(Pixel(UVec2::new(x, y))),
        _ => Err("expected X,Y in pixels from the top left".into()),
    }
}

/// A range of numbers such as `64..128`.
pub(super) fn range(text: &str) -> Option<Range<u32>> {
    let (a, b) = text.split_once("..")?;
    let range = a.parse().ok()?..b.parse().ok()?;
    (!range.is_empty()).then_some(range)
}

/// Samples such as `64..128`.
pub(super) fn samples(text: &str) -> Result<Range<u32>, String> {
    let what = "expected A..B, such as 64..128: the samples from number A on (from 0), without B";
    range(text).ok_or(what.into())
}

/// A number above 0.
pub(super) fn positive(text: &str) -> Result<f32, String> {
    let number = text
        .parse()
        .ok()
        .filter(|x: &f32| *x > 0.0 && x.is_finite());
    number.ok_or("expected a number above 0".into())
}

/// A finite number.
pub(super) fn finite(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|x: &f32| x.is_finite());
    number.ok_or("expected a number".into())
}
