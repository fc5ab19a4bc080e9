//! Sizes of pictures and parts of them.

use super::number::numbers;
use super::{Field, Range};
use crate::image::film::Window;
use crate::math::UVec2;
use serde_json::Value;

/// A share such as `25%`, `0.25` or `1/4`; `None` for a number without a point.
fn share(text: &str) -> Option<f64> {
    let text = text.trim();
    let number = |x: &str| x.trim().parse::<f64>().ok();
    let share = if let Some(percent) = text.strip_suffix('%') {
        number(percent)? / 100.0
    } else if let Some((a, b)) = text.split_once('/') {
        number(a)? / number(b)?
    } else {
        number(text).filter(|_| text.contains('.'))?
    };
    (share.is_finite() && share >= 0.0).then_some(share)
}

/// Size of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Size {
    /// Columns and rows.
    Pixels(UVec2),
    /// Share of the default size.
    Share(f64),
}

impl Size {
    /// The size in pixels, for the default size `whole`.
    pub(crate) fn of(self, whole: UVec2) -> UVec2 {
        let scaled =
            |share: f64, side: u32| ((share * f64::from(side)).round() as u32).clamp(1, 65536);
        match self {
            Self::Pixels(size) => size,
            Self::Share(share) => UVec2::new(scaled(share, whole.x), scaled(share, whole.y)),
        }
    }
}

impl Field for Size {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let side = |x: f64| (x.fract() == 0.0 && (1.0..=65536.0).contains(&x)).then_some(x as u32);
        let size = match value {
            Value::String(text) => {
                let pixels = text
                    .split_once('x')
                    .and_then(|(w, h)| Some((w.parse().ok()?, h.parse().ok()?)));
                match share(text).filter(|s| *s > 0.0) {
                    Some(share) => return Ok(Self::Share(share)),
                    None => pixels,
                }
            }
            list => numbers(list).and_then(|list| match *list.as_slice() {
                [w, h] => Some((w, h)),
                _ => None,
            }),
        };
        let size = size.and_then(|(w, h)| Some(UVec2::new(side(w)?, side(h)?)));
        size.map(Self::Pixels).ok_or(
            "expected WIDTHxHEIGHT, such as 640x480, from 1 to 65536 each, or a share such as 50%"
                .into(),
        )
    }

    fn text(&self) -> String {
        match self {
            Self::Pixels(size) => format!("{}x{}", size.x, size.y),
            Self::Share(share) => format!("{}%", 100.0 * share),
        }
    }

    fn python() -> String {
        "tuple[int, int] | str".into()
    }
}

/// A length along one side of a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Length {
    Pixels(u32),
    Share(f64),
}

impl Length {
    fn of(self, side: u32) -> f64 {
        match self {
            Self::Pixels(n) => f64::from(n),
            Self::Share(share) => share * f64::from(side),
        }
    }
}

/// A part of a picture: column, row, width, height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crop([Length; 4]);

impl Crop {
    /// A part in pixels.
    pub fn pixels(x: u32, y: u32, w: u32, h: u32) -> Self {
        Self([x, y, w, h].map(Length::Pixels))
    }

    /// The window in a picture of this size. Edges are rounded, so that adjacent shares give adjacent windows.
    pub fn of(&self, size: UVec2) -> Window {
        let [x, y, w, h] = self.0;
        let edges = |at: Length, length: Length, side: u32| {
            let start = at.of(side);
            let end = (start + length.of(side)).round();
            let start = start.round();
            (start as u32, (end - start) as u32)
        };
        let ((x, w), (y, h)) = (edges(x, w, size.x), edges(y, h, size.y));
        Window { x, y, w, h }
    }
}

impl Field for Crop {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let length = |text: &str| {
            let pixels = text.trim().parse().ok().map(Length::Pixels);
            pixels.or_else(|| share(text).map(Length::Share))
        };
        let pixels = |x: &Value| {
            x.as_u64()
                .and_then(|x| u32::try_from(x).ok())
                .map(Length::Pixels)
        };
        let lengths: Option<Vec<Length>> = match value {
            Value::String(text) => text.split(',').map(length).collect(),
            Value::Array(list) => list.iter().map(pixels).collect(),
            _ => None,
        };
        match lengths.as_deref() {
            Some(&[x, y, w, h]) => Ok(Self([x, y, w, h])),
            _ => Err(
                "expected X,Y,WIDTH,HEIGHT from the top left, in pixels or as shares such as 25%"
                    .into(),
            ),
        }
    }

    fn text(&self) -> String {
        let length = |length: &Length| match length {
            Length::Pixels(n) => n.to_string(),
            Length::Share(share) => format!("{}%", 100.0 * share),
        };
        self.0.iter().map(length).collect::<Vec<_>>().join(",")
    }

    fn python() -> String {
        "tuple[int, int, int, int] | str".into()
    }
}

/// Lens of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensChoice {
    /// Radius in units of the scene; 0 for no lens.
    pub radius: f32,
    /// Distance in focus along the view, in units of the scene; `None` for that of the file's lens.
    pub focus: Option<f32>,
}

impl Field for LensChoice {
    fn read(value: &Value, _: &Range) -> Result<Self, String> {
        let list = match value {
            Value::Number(radius) => radius.as_f64().map(|radius| vec![radius]),
            list => numbers(list),
        };
        let list: Vec<f32> = list.unwrap_or_default().iter().map(|x| *x as f32).collect();
        let (radius, focus) = match *list.as_slice() {
            [radius] => (radius, None),
            [radius, focus] if radius > 0.0 => (radius, Some(focus)),
            _ => (f32::NAN, None),
        };
        let is_lens = radius >= 0.0 && radius.is_finite();
        let is_sharp = focus.is_none_or(|focus| focus > 0.0 && focus.is_finite());
        (is_lens && is_sharp)
            .then_some(Self { radius, focus })
            .ok_or("expected RADIUS,DISTANCE above 0, RADIUS alone, or 0".into())
    }

    fn text(&self) -> String {
        let focus = self
            .focus
            .map_or(String::new(), |focus| format!(",{focus}"));
        format!("{}{focus}", self.radius)
    }

    fn python() -> String {
        "tuple[float, float] | float".into()
    }
}

#[cfg(test)]
mod tests;
