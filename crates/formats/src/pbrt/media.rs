//! Media of pbrt.

use super::super::Role;
use super::super::media::Named;
use super::Scene;
use super::tokens::Parameters;
use opsr::math::Rgb;
use opsr::scene::Medium;
use opsr::scene::load::error::{Result, fault};

/// Presets: reduced scattering and absorption per millimetre (Jensen et al. 2001: *A Practical Model for Subsurface Light
/// Transport*), by the names of pbrt-v4's `media.cpp`.
#[rustfmt::skip]
const PRESETS: &[(&str, [f32; 3], [f32; 3])] = &[
    ("Apple", [2.29, 2.39, 1.97], [0.003, 0.0034, 0.046]), ("Chicken1", [0.15, 0.21, 0.38], [0.015, 0.077, 0.19]),
    ("Chicken2", [0.19, 0.25, 0.32], [0.018, 0.088, 0.2]), ("Cream", [7.38, 5.47, 3.15], [0.0002, 0.0028, 0.0163]),
    ("Ketchup", [0.18, 0.07, 0.03], [0.061, 0.97, 1.45]), ("Marble", [2.19, 2.62, 3.0], [0.0021, 0.0041, 0.0071]),
    ("Potato", [0.68, 0.7, 0.55], [0.0024, 0.009, 0.12]), ("Skimmilk", [0.7, 1.22, 1.9], [0.0014, 0.0025, 0.0142]),
    ("Skin1", [0.74, 0.88, 1.01], [0.032, 0.17, 0.48]), ("Skin2", [1.09, 1.59, 1.79], [0.013, 0.07, 0.145]),
    ("Spectralon", [11.6, 20.4, 14.9], [0.0, 0.0, 0.0]), ("Wholemilk", [2.55, 3.21, 3.77], [0.0011, 0.0024, 0.014]),
];

impl Scene<'_> {
    /// Reads a `MakeNamedMedium`.
    pub(super) fn medium(&mut self, name: String, parameters: &Parameters) -> Result<()> {
        let place = &parameters.place;
        let kind = parameters.text("type")?.unwrap_or_default().to_owned();
        if kind != "homogeneous" {
            self.context
                .left_out(place, format!("a medium of type `{kind}`"))?;
            self.media.insert(name, None);
            return Ok(());
        }
        let named = parameters.text("preset")?.filter(|name| !name.is_empty());
        let preset = named.unwrap_or("Wholemilk");
        let known = PRESETS.iter().find(|row| row.0 == preset);
        if known.is_none() {
            let what = format!("the preset `{preset}` of a medium");
            self.context.left_out(place, what)?;
        }
        let (_, scattering, absorption) = known.unwrap_or(&PRESETS[PRESETS.len() - 1]);
        if self.colour(parameters, "Le", Rgb::ZERO, Role::Reflected)? != Rgb::ZERO {
            self.context
                .left_out(place, "a medium that shines (`Le`)")?;
        }
        // Only in version 3 do coefficients replace those of a preset.
        let stands = named.is_some() && known.is_some() && !self.is_old;
        let mut of = |name: &str, preset: [f32; 3]| match stands {
            true => Ok(preset.into()),
            false => self.colour(parameters, name, preset.into(), Role::Reflected),
        };
        let medium = Medium {
            absorption: of("sigma_a", *absorption)?,
            scattering: of("sigma_s", *scattering)?,
            mean_cosine: parameters.number("g", 0.0)? as f32,
        };
        let scale = parameters.number("scale", 1.0)?;
        let number = self.context.media.add(medium, scale, place)?;
        self.media.insert(name, Some(number));
        Ok(())
    }

    /// The medium of a name; the empty name means none.
    pub(super) fn named_medium(&self, name: &str, place: &str) -> Result<Named> {
        if name.is_empty() {
            return Ok(None);
        }
        let known = self.media.get(name).copied();
        known.ok_or_else(|| fault(place, format!("no medium `{name}`")))
    }
}
