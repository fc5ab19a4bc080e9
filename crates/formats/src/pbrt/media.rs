//! Media of pbrt.

use super::super::Meant;
use super::super::media::Named;
use super::Scene;
use super::tokens::Parameters;
use opsr::math::Rgb;
use opsr::scene::Medium;
use opsr::scene::load::error::{Result, fault};

impl Scene<'_> {
    /// `MakeNamedMedium`.
    pub(super) fn medium(&mut self, name: String, parameters: &Parameters) -> Result<()> {
        let place = &parameters.place;
        let kind = parameters.text("type")?.unwrap_or_default().to_owned();
        if kind != "homogeneous" {
            self.context
                .left_out(place, format!("a medium of type `{kind}`"))?;
            self.media.insert(name, None);
            return Ok(());
        }
        if let Some(preset) = parameters.text("preset")? {
            let what = format!("the preset `{preset}` of a medium");
            self.context.left_out(place, what)?;
        }
        if self.colour(parameters, "Le", Rgb::ZERO, Meant::Reflected)? != Rgb::ZERO {
            self.context
                .left_out(place, "a medium that shines (`Le`)")?;
        }
        // Those of pbrt without a preset, per millimetre of some material.
        let absorption = Rgb::new(0.0011, 0.0024, 0.014);
        let scattering = Rgb::new(2.55, 3.21, 3.77);
        let medium = Medium {
            absorption: self.colour(parameters, "sigma_a", absorption, Meant::Reflected)?,
            scattering: self.colour(parameters, "sigma_s", scattering, Meant::Reflected)?,
            mean_cosine: parameters.number("g", 0.0)? as f32,
        };
        let scale = parameters.number("scale", 1.0)?;
        let number = self.context.media.add(medium, scale, place)?;
        self.media.insert(name, Some(number));
        Ok(())
    }

    /// A medium by its name; an empty one is none.
    pub(super) fn named_medium(&self, name: &str, place: &str) -> Result<Named> {
        if name.is_empty() {
            return Ok(None);
        }
        let known = self.media.get(name).copied();
        known.ok_or_else(|| fault(place, format!("no medium `{name}`")))
    }
}
