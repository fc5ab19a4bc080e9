//! Numbers, truth values, times, and lists of numbers.

use super::{Field, Range};
use serde_json::Value;
use std::time::Duration;

/// A finite number, or text that contains one.
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

/// The numbers of a list, or of text with commas.
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
        // The rounded value must be in the range, too.
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
        // Its shortest decimal form.
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

/// Sun of the built-in sky.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Height above the horizon and angle to the right of the front, in degrees.
    pub position: [f32; 2],
    /// Turbidity of the air, if it is given.
    pub haze: Option<f32>,
}

impl Field for Sun {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let list = numbers(value).or_else(|| number(value).map(|height| vec![height]));
        let sun = match list.as_deref() {
            Some(&[height]) => Some((height, -40.0, None)),
            Some(&[height, angle]) => Some((height, angle, None)),
            Some(&[height, angle, haze]) => Some((height, angle, Some(haze as f32))),
            _ => None,
        };
        let known = |(height, angle, haze): &(f64, f64, Option<f32>)| {
            let is_sky = haze.is_none_or(|haze| (1.8..=10.0).contains(&haze));
            (0.0..=90.0).contains(height) && (*angle as f32).is_finite() && is_sky
        };
        let sun = sun.filter(known).map(|(height, angle, haze)| Self {
            position: [height as f32, angle as f32],
            haze,
        });
        sun.ok_or("expected a height from 0 to 90, an angle, and a haze from 1.8 to 10".into())
    }

    fn text(&self) -> String {
        let [height, angle] = self.position;
        let haze = self.haze.map_or(String::new(), |haze| format!(",{haze}"));
        format!("{height},{angle}{haze}")
    }

    fn python() -> String {
        "Sequence[float] | str".into()
    }
}

/// Moment of the animations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moment {
    /// Seconds from the start of the animations.
    Seconds(f64),
    /// A frame number from 0, and frames per second.
    Frame(f64, f64),
}

impl Moment {
    /// Seconds from the start of the animations.
    pub(crate) fn seconds(self) -> f64 {
        match self {
            Self::Seconds(seconds) => seconds,
            Self::Frame(frame, fps) => frame / fps,
        }
    }
}

impl Field for Moment {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let real = |text: &str| text.parse().ok().filter(|x: &f64| x.is_finite());
        let text = value.as_str().unwrap_or_default();
        let frame = || {
            let (frame, fps) = text.split_once('@')?;
            let fps = real(fps).filter(|fps| *fps > 0.0)?;
            Some(Self::Frame(real(frame)?, fps))
        };
        let seconds = text.strip_suffix('s').and_then(real).map(Self::Seconds);
        seconds.or_else(frame).ok_or(
            "expected seconds, such as 0.5s, or a frame and frames per second, such as 12@24"
                .into(),
        )
    }

    fn text(&self) -> String {
        match self {
            Self::Seconds(seconds) => format!("{seconds}s"),
            Self::Frame(frame, fps) => format!("{frame}@{fps}"),
        }
    }

    fn python() -> String {
        "str".into()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Levels;
    use super::*;

    #[test]
    fn moment_is_seconds_or_a_frame() {
        let read = |text: &str| Moment::read(&text.into(), &Range::FINITE);
        for (text, seconds) in [
            ("0.5s", 0.5),
            ("-2s", -2.0),
            ("12@24", 0.5),
            ("1.5@30", 0.05),
        ] {
            let moment = read(text).unwrap();
            assert_eq!((moment.seconds(), moment.text().as_str()), (seconds, text));
        }
        for bad in ["12", "0.5", "s", "12@0", "12@-1", "nans", "@24", "1@2@3"] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }

    /// Excluded bounds also exclude values that round to them in single precision; truth values are not numbers.
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
