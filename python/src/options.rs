//! Options of a render as keywords: read, described, and named in errors as the library declares them.

use crate::errors::{argument, file};
use crate::table::Table;
use opsr::render::value::TableChoice;
use opsr::render::{Fault, Heading, Names, OPTIONS, Opt, Spec, renamed};
use pyo3::exceptions::{PyMemoryError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyString};
use serde_json::{Value, json};
use std::path::PathBuf;

/// True for the options of `Scene.load`.
pub(crate) fn of_scene(option: &Opt) -> bool {
    matches!(option.heading, Heading::Scene | Heading::Light)
}

/// True for the options of `render`; files are written by `Film.save`.
pub(crate) fn of_render(option: &Opt) -> bool {
    let heading = option.heading;
    let made = matches!(
        heading,
        Heading::Camera | Heading::Stop | Heading::Method | Heading::Research
    );
    made || ["aov", "denoise"].contains(&option.name)
}

/// True for the options of `Film.save`.
pub(crate) fn of_save(option: &Opt) -> bool {
    option.heading == Heading::Files && !of_render(option)
}

/// True for the options of `view`: all but the crop and the options that only files have.
pub(crate) fn of_view(option: &Opt) -> bool {
    let shown = ["denoise", "exposure", "view"].contains(&option.name);
    let files = option.heading == Heading::Files;
    option.name != "crop" && (shown || !files)
}

/// A fault as an exception, with options by their keywords.
pub(crate) fn raised(fault: Fault) -> PyErr {
    match fault {
        Fault::File(error) => file(error),
        Fault::Memory(..) => PyMemoryError::new_err(fault.message(Names::Keys)),
        fault => PyValueError::new_err(fault.message(Names::Keys)),
    }
}

/// Options from the keywords of a function; None counts as not given.
pub(crate) fn read(
    function: &str,
    keywords: Option<&Bound<'_, PyDict>>,
    wanted: fn(&Opt) -> bool,
) -> PyResult<Spec> {
    let mut spec = Spec::default();
    let Some(keywords) = keywords else {
        return Ok(spec);
    };
    for (name, value) in keywords.iter() {
        let name: String = name.extract()?;
        let known = Opt::named(&name).is_some_and(wanted);
        if !known {
            let instead = renamed(&name).map(|new| Fault::usage(format!("; it is {new} now")));
            let instead = instead.map_or(String::new(), |new| new.message(Names::Keys));
            let what = format!("{function}() got an unexpected keyword argument '{name}'{instead}");
            return Err(PyTypeError::new_err(what));
        }
        if value.is_none() {
            continue;
        }
        if let Ok(table) = value.cast::<Table>()
            && name == "table"
        {
            spec.table = Some(TableChoice::Loaded(table.get().file.clone().into(), None));
            continue;
        }
        let typed = Opt::named(&name).map(|option| (option.python)());
        let words = ["str", "Path", "Literal"];
        let text = typed.is_some_and(|typed| words.iter().any(|word| typed.contains(word)));
        if value.is_instance_of::<PyString>() && !text {
            return Err(wrong_type(&name));
        }
        let value = json_of(&value).filter(|value| !value.is_null());
        let value = value.ok_or_else(|| wrong_type(&name))?;
        spec.set(&name, &value).map_err(raised)?;
    }
    Ok(spec)
}

fn wrong_type(name: &str) -> PyErr {
    let expected = Opt::named(name).map_or_else(String::new, |option| (option.python)());
    PyTypeError::new_err(format!("{name}: expected {expected}"))
}

/// JSON of plain Python data; `None` for other values.
fn json_of(value: &Bound<'_, PyAny>) -> Option<Value> {
    if let Ok(truth) = value.cast::<PyBool>() {
        return Some(truth.is_true().into());
    }
    if value.is_instance_of::<PyInt>() {
        let negative = value.extract::<i64>().map(Value::from);
        // A larger number is out of every range.
        return value
            .extract::<u64>()
            .map(Value::from)
            .or(negative)
            .ok()
            .or(Some("a large number".into()));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return text.extract::<String>().ok().map(Value::from);
    }
    if value.is_instance_of::<PyFloat>() {
        let number = value.extract::<f64>().ok()?;
        return Some(serde_json::Number::from_f64(number).map_or("NaN".into(), Value::Number));
    }
    if let Ok(path) = value.extract::<PathBuf>() {
        return path.to_str().map(Value::from);
    }
    if let Ok(list) = value.try_iter() {
        let items = list.map(|item| item.ok().as_ref().and_then(json_of));
        return items.collect::<Option<Vec<Value>>>().map(Value::Array);
    }
    // numpy's numbers and truth values.
    if let Ok(number) = value.extract::<i64>() {
        return Some(number.into());
    }
    let number = value.extract::<f64>().ok()?;
    Some(serde_json::Number::from_f64(number).map_or("NaN".into(), Value::Number))
}

/// A whole number of an argument, at least `least`.
pub(crate) fn count(
    name: &str,
    value: Option<&Bound<'_, PyAny>>,
    least: u32,
) -> PyResult<Option<u32>> {
    let Some(value) = value.filter(|value| !value.is_none()) else {
        return Ok(None);
    };
    let number = value
        .extract::<u32>()
        .ok()
        .filter(|n| *n >= least && !value.is_instance_of::<PyBool>());
    let what = || argument(name, format!("expected a whole number of at least {least}"));
    number.map(Some).ok_or_else(what)
}

/// A number of threads.
pub(crate) fn threads(value: Option<&Bound<'_, PyAny>>) -> PyResult<Option<u16>> {
    let number = count("threads", value, 1)?;
    let small =
        |n: u32| u16::try_from(n).map_err(|_| argument("threads", "expected at most 65535"));
    number.map(small).transpose()
}

/// Names, types, defaults and help of the options of a function, as JSON, for its signature and documentation.
#[pyfunction]
pub(crate) fn _options(function: &str) -> String {
    let wanted = match function {
        "render" => of_render,
        "view" => of_view,
        "save" => of_save,
        _ => of_scene,
    };
    let options = OPTIONS.iter().filter(|option| wanted(option));
    let described = options.map(|option| {
        let default = option.default.and_then(|text| {
            let mut spec = Spec::default();
            spec.set(option.name, &text.into()).ok()?;
            spec.settings().remove(option.name)
        });
        json!({
            "name": option.name,
            "type": (option.python)(),
            "default": default,
            "help": keyword_help(option),
        })
    });
    Value::Array(described.collect()).to_string()
}

/// Help in one line, with other options by their keywords.
fn keyword_help(option: &Opt) -> String {
    let mut help = option.help();
    let mut flags: Vec<&Opt> = OPTIONS.iter().collect();
    // The longest first, because some flags are prefixes of others.
    flags.sort_by_key(|option| std::cmp::Reverse(option.flag().len()));
    for option in flags {
        help = help.replace(&format!("--{}", option.flag()), option.name);
    }
    help
}
