//! Media of Mitsuba.

use super::super::Role;
use super::super::media::Named;
use super::Scene;
use super::xml::{Object, numbers};
use opsr::math::Rgb;
use opsr::scene::Medium;
use opsr::scene::load::error::{Result, fault};
use std::rc::Rc;

/// Mean cosine of a tabulated phase function, linear between even steps of the cosine from −1 to 1. `None` if invalid.
fn mean_of_table(values: &[f64]) -> Option<f64> {
    let step = 2.0 / values.len().checked_sub(1).filter(|n| *n > 0)? as f64;
    let (mut sum, mut all) = (0.0, 0.0);
    for (k, pair) in values.windows(2).enumerate() {
        let (low, mean) = (k as f64 * step - 1.0, 0.5 * (pair[0] + pair[1]));
        all += step * mean;
        sum += step * ((low + 0.5 * step) * mean + step * (pair[1] - pair[0]) / 12.0);
    }
    let good = all > 0.0 && all.is_finite() && values.iter().all(|v| *v >= 0.0);
    good.then_some(sum / all)
}

impl Scene<'_> {
    /// Media inside and outside of a shape; the second is also that around a sensor.
    pub(super) fn sides(&mut self, object: &Object) -> Result<[Named; 2]> {
        let mut sides = [None; 2];
        for (name, medium) in self.children(object, &["medium"])? {
            let side = usize::from(name != "interior");
            sides[side] = self.medium(&medium)?;
        }
        Ok(sides)
    }

    fn medium(&mut self, object: &Rc<Object>) -> Result<Named> {
        let address = Rc::as_ptr(object).addr();
        if let Some(&known) = self.media.get(&address) {
            return Ok(known);
        }
        let named = match self.read_medium(object)? {
            Some(medium) => {
                let scale = object.number("scale", 1.0)?;
                Some((self.context.media).add(medium, scale, &object.place)?)
            }
            None => None,
        };
        self.media.insert(address, named);
        Ok(named)
    }

    /// The mean cosine by which a phase function is approximated.
    fn mean_cosine(&mut self, phase: &Rc<Object>) -> Result<f64> {
        let shown = "Henyey's and Greenstein's of its mean cosine";
        let what = format!("phase function `{}`", phase.plugin);
        match phase.plugin.as_str() {
            "isotropic" => Ok(0.0),
            "hg" => phase.number("g", 0.8),
            "rayleigh" | "sggx" => {
                (self.context).nearest(&phase.place, what, "the isotropic one")?;
                Ok(0.0)
            }
            "tabphase" => {
                (self.context).nearest(&phase.place, what, shown)?;
                let values = phase.text("values")?.and_then(numbers).unwrap_or_default();
                mean_of_table(&values).ok_or_else(|| fault(&phase.place, "is no phase function"))
            }
            "blendphase" => {
                (self.context).nearest(&phase.place, what, shown)?;
                let share = self.numbers(phase, "weight", 0.5)?;
                let share = f64::from(self.context.builder.mean(share).x.clamp(0.0, 1.0));
                let parts = self.children(phase, &["phase"])?;
                let [(_, first), (_, second)] = parts.as_slice() else {
                    return Err(fault(&phase.place, "has not two phase functions"));
                };
                let mut of = |part| self.within(phase, |scene| scene.mean_cosine(part));
                Ok((1.0 - share) * of(first)? + share * of(second)?)
            }
            _ => {
                self.context.left_out(&phase.place, what)?;
                Ok(0.0)
            }
        }
    }

    fn read_medium(&mut self, object: &Object) -> Result<Option<Medium>> {
        let place = &object.place;
        if object.plugin != "homogeneous" {
            let what = format!("a medium of type `{}`", object.plugin);
            self.context.left_out(place, what)?;
            return Ok(None);
        }
        if object.property("material").is_some() {
            self.context
                .left_out(place, "a named material of a medium")?;
        }
        let volumes = self.children(object, &["volume", "texture"])?;
        if let Some((name, _)) = volumes.iter().find(|(_, v)| v.plugin != "constvolume") {
            let what = format!("a volume as `{name}` of a medium");
            self.context.left_out(place, what)?;
            return Ok(None);
        }
        let colour = |scene: &mut Self, name: &str, or: f32| {
            scene.colour(object, &[name], Rgb::splat(or), Role::Reflected)
        };
        let [mut absorption, mut scattering] =
            [colour(self, "sigma_a", 0.0)?, colour(self, "sigma_s", 0.0)?];
        let parts = ["sigma_a", "sigma_s"];
        if !(self.has(object, parts[0])? || self.has(object, parts[1])?) {
            let extinction = colour(self, "sigma_t", 1.0)?;
            let albedo = colour(self, "albedo", 0.75)?.min(Rgb::ONE);
            (absorption, scattering) = (extinction * (Rgb::ONE - albedo), extinction * albedo);
        }
        let mut mean_cosine = 0.0;
        for (_, phase) in self.children(object, &["phase"])? {
            mean_cosine = self.mean_cosine(&phase)? as f32;
        }
        Ok(Some(Medium {
            absorption,
            scattering,
            mean_cosine,
        }))
    }
}
