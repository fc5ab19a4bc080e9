//! A camera given by the user: numbers that the viewer copies, and the small file that it saves.

use super::value::{Field, NameOrNumber, Range};
use crate::files::{self, FileError};
use crate::math::{Vec2, Vec3};
use crate::scene::camera::Projection;
use crate::scene::{Camera, Lens};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Longest camera file in bytes.
const MAX_BYTES: u64 = 1 << 16;

/// A camera by position and target, in world space and units of the scene. The same numbers always give the same
/// [`Camera`], bit for bit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Look {
    /// Position of the camera.
    pub position: [f32; 3],
    /// Point that the camera looks at and orbits.
    pub target: [f32; 3],
    /// Up direction of the picture, not parallel to the view.
    pub up: [f32; 3],
    /// Vertical field of view in degrees, between 0 and 180; `None` for parallel rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fov: Option<f32>,
    /// Height of the picture in units of the scene, for parallel rays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub height: Option<f32>,
    /// Width over height of the picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aspect: Option<f32>,
    /// Offset of the picture's centre from the view axis, to the right and up, in half heights of the picture.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift: Option<[f32; 2]>,
    /// Radius of the lens.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub aperture: Option<f32>,
    /// Focus distance along the view direction, in units of the scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub focus: Option<f32>,
}

impl Look {
    /// The look of a camera that orbits the point at `distance` along its view.
    pub fn of(camera: &Camera, distance: f32) -> Self {
        let (fov, height) = match camera.projection {
            Projection::Perspective { tan_half_y } => {
                (Some(2.0 * tan_half_y.atan().to_degrees()), None)
            }
            Projection::Orthographic { half_height } => (None, Some(2.0 * half_height)),
        };
        Self {
            position: camera.position.to_array(),
            target: (camera.position - distance * camera.frame.n).to_array(),
            up: camera.frame.t.to_array(),
            fov,
            height,
            aspect: camera.aspect,
            shift: (camera.shift != Vec2::ZERO).then_some(camera.shift.to_array()),
            aperture: camera.lens.map(|lens| lens.radius),
            focus: camera.lens.map(|lens| lens.focus),
        }
    }

    /// The camera, named by its [text](Look::text).
    pub(crate) fn camera(&self) -> Result<Camera, String> {
        self.check()?;
        let [position, target, up] = [self.position, self.target, self.up].map(Vec3::from_array);
        let fov = self.fov.unwrap_or(40.0).to_radians();
        let mut camera = Camera::look_at(position, target, up.normalize(), fov);
        if let Some(height) = self.height {
            let half_height = 0.5 * height;
            camera.projection = Projection::Orthographic { half_height };
        }
        camera.name = self.text();
        camera.aspect = self.aspect;
        camera.shift = self.shift.unwrap_or_default().into();
        camera.lens = (self.aperture.filter(|radius| *radius > 0.0))
            .zip(self.focus)
            .map(|(radius, focus)| Lens { radius, focus });
        Ok(camera)
    }

    /// Position, target, up, field of view (or `h` and a height for parallel rays) and shift, as `--camera` reads them.
    pub(crate) fn text(&self) -> String {
        let numbers = [self.position, self.target, self.up].concat();
        let mut words: Vec<String> = numbers.iter().map(f32::to_string).collect();
        words.push(match (self.height, self.fov) {
            (Some(height), _) => format!("h{height}"),
            (None, fov) => fov.unwrap_or(40.0).to_string(),
        });
        words.extend(self.shift.iter().flatten().map(f32::to_string));
        words.join(",")
    }

    /// A look from its [text](Look::text).
    fn parse(text: &str) -> Option<Self> {
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        let (words, shift) = match words.as_slice() {
            [words @ .., x, y] if words.len() == 10 => {
                (words, Some([x.parse().ok()?, y.parse().ok()?]))
            }
            words => (words, None),
        };
        let [numbers @ .., last] = words else {
            return None;
        };
        let numbers: Option<Vec<f32>> = numbers.iter().map(|word| word.parse().ok()).collect();
        let (height, fov) = match last.strip_prefix('h') {
            Some(height) => (Some(height.parse().ok()?), None),
            None => (None, Some(last.parse().ok()?)),
        };
        let &[a, b, c, d, e, f, g, h, i] = numbers?.as_slice() else {
            return None;
        };
        Some(Self {
            position: [a, b, c],
            target: [d, e, f],
            up: [g, h, i],
            fov,
            height,
            aspect: None,
            shift,
            aperture: None,
            focus: None,
        })
    }

    /// Reads a file that a viewer saved.
    pub(crate) fn load(path: &Path) -> Result<Self, FileError> {
        let text = files::read_text(path, MAX_BYTES)?;
        let look: Self = serde_json::from_str(&text).map_err(|e| FileError::content(path, e))?;
        match look.check() {
            Ok(()) => Ok(look),
            Err(what) => Err(FileError::content(path, what)),
        }
    }

    /// The file that `Look::load` reads.
    pub fn file(&self) -> String {
        // A struct of numbers always serialises.
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// An error for numbers that give no valid camera.
    pub fn check(&self) -> Result<(), String> {
        let [position, target, up] = [self.position, self.target, self.up].map(Vec3::from_array);
        let along = (target - position).normalize_or_zero();
        let across = up.normalize_or_zero().cross(along).length();
        let above = |x: Option<f32>| x.is_none_or(|x| x > 0.0 && x.is_finite());
        let shift = Vec2::from_array(self.shift.unwrap_or_default());
        let wrong =
            if !(shift.is_finite() && position.is_finite() && target.is_finite() && up.is_finite())
            {
                "expected finite numbers"
            } else if along == Vec3::ZERO {
                "position and target of the camera are one point"
            } else if across.is_nan() || across < 1e-4 {
                "the camera's up is along its view"
            } else if self.fov.is_some() == self.height.is_some() {
                "expected either `fov`, a field of view, or `height`, of parallel rays"
            } else if !above(self.fov) || self.fov.is_some_and(|fov| fov >= 179.9) {
                "expected a field of view between 0 and 179.9 degrees"
            } else if !above(self.height) || !above(self.aspect) || !above(self.focus) {
                "height, aspect and focus must be above 0"
            } else if self.aperture.is_some_and(|x| !(x >= 0.0 && x.is_finite())) {
                "aperture must not be below 0"
            } else {
                return Ok(());
            };
        Err(wrong.into())
    }
}

/// A camera: one of the scene, or a look.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraChoice {
    /// Name of a camera of the scene, or its number from 0.
    Named(String),
    /// A file that the viewer saved.
    File(PathBuf),
    /// Numbers, or the content of a file.
    Numbers(Box<Look>),
}

impl CameraChoice {
    /// The look, unless the choice is a camera of the scene.
    pub(crate) fn look(&self) -> Result<Option<Look>, FileError> {
        match self {
            Self::Named(_) => Ok(None),
            Self::File(path) => Look::load(path).map(Some),
            Self::Numbers(look) => Ok(Some(**look)),
        }
    }
}

impl Field for CameraChoice {
    fn read(value: &Value, range: &Range) -> Result<Self, String> {
        if let Some(look) = value.as_str().and_then(Look::parse) {
            return look.check().map(|()| Self::Numbers(Box::new(look)));
        }
        let NameOrNumber(text) = NameOrNumber::read(value, range)?;
        let ending = Path::new(&text).extension();
        if ending.is_some_and(|ending| ending.eq_ignore_ascii_case("json")) {
            return Ok(Self::File(text.into()));
        }
        // Text with a comma may name a camera, but numbers alone are a look with a wrong count.
        let numbers = |text: &str| text.split(',').all(|x| x.trim().parse::<f32>().is_ok());
        match text.contains(',') && numbers(&text) {
            true => {
                Err("expected ten numbers: position, target, up and field of view in degrees; or twelve, with a shift".into())
            }
            false => Ok(Self::Named(text)),
        }
    }

    fn text(&self) -> String {
        match self {
            Self::Named(name) => name.clone(),
            Self::File(path) => path.display().to_string(),
            Self::Numbers(look) => look.text(),
        }
    }

    fn python() -> String {
        "str | int | Path".into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_is_read_back_bit_for_bit_from_text_and_file() {
        let camera = Camera::framing((Vec3::splat(-1.3), Vec3::new(0.1, 7.0, 2.0)), 1.5);
        let look = Look::of(&camera, 3.3);
        let parsed = Look::parse(&look.text()).unwrap();
        assert_eq!((parsed, parsed.camera()), (look, look.camera()));
        let held: Look = serde_json::from_str(&look.file()).unwrap();
        assert_eq!(held, look);
        let again = look.camera().unwrap();
        let near = |a: Vec3, b: Vec3| a.distance(b) < 1e-5;
        assert!(near(again.frame.n, camera.frame.n) && near(again.frame.t, camera.frame.t));
        let shifted = Look {
            shift: Some([0.3, -0.1]),
            ..look
        };
        assert_eq!(Look::parse(&shifted.text()), Some(shifted));
        let camera = shifted.camera().unwrap();
        assert_eq!(Look::of(&camera, 3.3).shift, shifted.shift);
        let held: Look = serde_json::from_str(&shifted.file()).unwrap();
        assert_eq!(held, shifted);
        let parallel = Look {
            fov: None,
            height: Some(2.5),
            ..look
        };
        assert_eq!(Look::parse(&parallel.text()), Some(parallel));
    }

    #[test]
    fn look_that_makes_no_camera_is_refused() {
        let read = |text: &str| CameraChoice::read(&text.into(), &Range::FINITE);
        assert!(read("0,0,1,0,0,0,0,1,0,40").is_ok());
        for bad in [
            "0,0,0,0,0,0,0,1,0,40",
            "0,0,1,0,0,0,0,0,1,40",
            "0,0,1,0,0,0,0,1,0,0",
            "0,0,1,0,0,0,0,1,0,180",
            "0,0,1,0,0,0,0,1,0,h-1",
            "0,0,1,0,0,0,0,1,0,40,0.1",
            "0,0,1,0,0,0,0,1,0,40,0.1,inf",
            "0,0,nan,0,0,0,0,1,0,40",
            "0,0,1",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}
