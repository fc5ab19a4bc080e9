//! Surroundings of a scene: a map, a sky, a studio, or nothing.

use super::Environment;
use super::light::sky::{self, Sky};
use crate::files::FileError;
use std::path::{Path, PathBuf};

/// Surroundings of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) enum Backdrop {
    /// The studio if nothing else lights the scene, see [`FileLight`](super::load::FileLight); else nothing.
    #[default]
    Auto,
    /// Nothing.
    None,
    /// The studio.
    Studio,
    /// A clear sky with its sun.
    Sky(Sky),
    /// An equirectangular map, .hdr or .exr.
    Map(PathBuf),
}

impl Backdrop {
    /// The backdrop named `studio`, `sky` or `none`, or else the map in the file `word`; [`Backdrop::Auto`] for `None`.
    pub(crate) fn named(word: Option<&Path>, sky: Sky) -> Self {
        let Some(word) = word else {
            return Self::Auto;
        };
        match word.to_str() {
            Some("studio") => Self::Studio,
            Some("sky") => Self::Sky(sky),
            Some("none") => Self::None,
            _ => Self::Map(word.into()),
        }
    }

    /// The file of a map.
    pub(crate) fn file(&self) -> Option<&PathBuf> {
        match self {
            Self::Map(path) => Some(path),
            _ => None,
        }
    }

    /// The environment, scaled by `intensity` and turned by `rotation` radians; `lit` says if the scene has other
    /// light. Passes bytes that identify the environment to `take`, for a hash. `None` without surroundings.
    pub(crate) fn environment(
        &self,
        lit: bool,
        intensity: f32,
        rotation: f32,
        mut take: impl FnMut(&[u8]),
    ) -> Result<Option<Environment>, FileError> {
        let made = match self {
            Self::None => return Ok(None),
            Self::Auto if lit => return Ok(None),
            Self::Map(path) => {
                let map = Environment::load(path, intensity, rotation)?;
                Environment::bytes(path, take)?;
                return Ok(Some(map));
            }
            Self::Auto | Self::Studio => {
                take(b"studio 2");
                sky::studio()
            }
            Self::Sky(sky) => {
                let Sky {
                    elevation,
                    azimuth,
                    turbidity,
                } = sky;
                take(format!("sky 1 {elevation} {azimuth} {turbidity}").as_bytes());
                sky.map()
            }
        };
        let made = made.map(|p| p * intensity);
        Ok(Some(Environment::from_map(made, rotation)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backdrop_by_name() {
        let named = |word| Backdrop::named(Some(Path::new(word)), Sky::default());
        assert_eq!(named("studio"), Backdrop::Studio);
        assert_eq!(named("sky"), Backdrop::Sky(Sky::default()));
        assert_eq!(named("none"), Backdrop::None);
        assert_eq!(named("a.hdr").file(), Some(&PathBuf::from("a.hdr")));
        assert_eq!(Backdrop::named(None, Sky::default()), Backdrop::Auto);
    }

    #[test]
    fn studio_only_where_nothing_else_lights() {
        let auto = |lit| {
            let mut name = Vec::new();
            let made = (Backdrop::Auto)
                .environment(lit, 1.0, 0.0, |b| name.extend_from_slice(b))
                .expect("no file");
            (made.is_some(), !name.is_empty())
        };
        assert_eq!(auto(true), (false, false));
        assert_eq!(auto(false), (true, true));
    }
}
