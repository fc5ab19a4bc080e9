//! Numbers, truth values, times, and lists of numbers.

use super::{Field, Range};
use serde_json::Value;
use std::time::Duration;

/// A finite number, also one that is written as text.
fn number(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => text.trim().parse().ok(),
        _ => None,
    }
}

fn real(value: &Value, range: &Range) -> Result<f64, String> {
    let number = number(value).filter(|&x| range.holds(x));
    number.ok_or_else(|| format!("expected a number{}", range.words()))
}

fn whole(value: &Value, range: &Range, most: u64) -> Result<u64, String> {
    let whole = match value {
        Value::Number(number) => number.as_u64(),
        Value::String(text) => text.trim().parse().ok(),
        _ => None,
    };
    let known = whole.filter(|&n| n <= most && range.holds(n as f64));
    known.ok_or_else(|| {
        let Range {
            least, most: high, ..
        } = *range;
        let (least, high) = (
            least.max(0.0),
            if high == f64::MAX { most } else { high as u64 },
        );
        format!("expected a whole number from {least} to {high}")
    })
}

/// The numbers of a list, or of a text with commas.
pub(super) fn numbers(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Array(list) => list
            .iter()
            .map(|x| number(x).filter(|_| x.is_number()))
            .collect(),
        Value::String(text) => text.split(',').map(|x| x.trim().parse().ok()).collect(),
        _ => None,
    }
}

impl Field for f32 {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        let wide = real(value, range)?;
        // A range holds in single precision too.
        let x = match value {
            Value::String(text) => text.trim().parse().unwrap_or(wide as Self),
            _ => wide as Self,
        };
        match range.holds(x.into()) {
            true => Ok(x),
            false => Err(format!("expected a number{}", range.words())),
        }
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn value(&self) -> Value {
        // As short as it is written.
        self.to_string()
            .parse::<f64>()
            .unwrap_or((*self).into())
            .into()
    }

    fn python() -> String {
        "float".into()
    }
}

impl Field for f64 {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        real(value, range)
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn value(&self) -> Value {
        (*self).into()
    }

    fn python() -> String {
        "float".into()
    }
}

/// Whole numbers from 0.
macro_rules! counts {
    ($($type:ty),+) => {$(
        impl Field for $type {
            fn read(value: &Value, range: &Range) -> Result<Self, String> {
                Ok(whole(value, range, Self::MAX.into())? as Self)
            }

            fn text(&self) -> String {
                self.to_string()
            }

            fn value(&self) -> Value {
                (*self).into()
            }

            fn python() -> String {
                "int".into()
            }
        }
    )+};
}

counts!(u32, u64);

impl Field for bool {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        match value {
            Value::Bool(is) => Ok(*is),
            Value::String(text) if text == "true" => Ok(true),
            Value::String(text) if text == "false" => Ok(false),
            _ => Err("expected true or false".into()),
        }
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn value(&self) -> Value {
        (*self).into()
    }

    fn python() -> String {
        "bool".into()
    }
}

/// A time in seconds, or with its unit, such as `60s` or `5min`.
impl Field for Duration {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        #[cfg(feature = "clap")]
        if let Value::String(text) = value {
            let seconds = text.parse().ok().map(Self::try_from_secs_f64);
            if let Some(Ok(seconds)) = seconds {
                return Ok(seconds);
            }
            let expected = "expected a number of seconds, or a time such as 60s or 5min";
            return humantime::parse_duration(text).map_err(|e| format!("{expected}: {e}"));
        }
        let seconds = number(value).and_then(|s| Self::try_from_secs_f64(s).ok());
        seconds.ok_or("expected a number of seconds, not below 0".into())
    }

    fn text(&self) -> String {
        format!("{}ns", self.as_nanos())
    }

    fn value(&self) -> Value {
        self.as_secs_f64().into()
    }

    fn python() -> String {
        "float".into()
    }
}

/// Height of the sun above the horizon and its angle to the right of the front, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun(pub [f32; 2]);

impl Field for Sun {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let list = numbers(value).or_else(|| number(value).map(|height| vec![height]));
        let sun = match list.as_deref() {
            Some(&[height]) => Some([height, -40.0]),
            Some(&[height, angle]) => Some([height, angle]),
            _ => None,
        };
        let known = |[height, angle]: &[f64; 2]| {
            (0.0..=90.0).contains(height) && angle.is_finite() && (*angle as f32).is_finite()
        };
        let sun = sun.filter(known).map(|sun| Self(sun.map(|x| x as f32)));
        sun.ok_or("expected a height from 0 to 90, and an angle".into())
    }

    fn text(&self) -> String {
        let [height, angle] = self.0;
        format!("{height},{angle}")
    }

    fn python() -> String {
        "tuple[float, float]".into()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Levels;
    use super::*;

    /// Bounds that are left out, in single precision too; and no truth value is a number.
    #[test]
    fn ranges_of_numbers_hold() {
        let share = Range::above(0.0, 1.0);
        for (value, right) in [(1.0, true), (0.0, false), (1e-60, false), (1.1, false)] {
            assert_eq!(f32::read(&value.into(), &share).is_ok(), right, "{value}");
        }
        assert!(f32::read(&true.into(), &share).is_err());
        assert!(Levels::read(&true.into(), &share).is_err());
        assert!(Levels::read(&serde_json::json!([]), &share).is_err());
        let negative = u64::read(&(-1).into(), &Range::FINITE);
        assert_eq!(
            negative.unwrap_err(),
            format!("expected a whole number from 0 to {}", u64::MAX)
        );
    }
}
