//! Media of Mitsuba.

use super::super::Meant;
use super::super::media::Named;
use super::Scene;
use super::xml::Object;
use opsr::math::Rgb;
use opsr::scene::Medium;
use opsr::scene::load::error::Result;
use std::rc::Rc;

impl Scene<'_> {
    /// Media inside and outside of a shape, or around a sensor.
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
            scene.colour(object, &[name], Rgb::splat(or), Meant::Reflected)
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
            match phase.plugin.as_str() {
                "isotropic" => {}
                "rayleigh" => {
                    let shown = "the isotropic one";
                    (self.context).nearest(&phase.place, "Rayleigh's phase function", shown)?;
                }
                "hg" => mean_cosine = phase.number("g", 0.8)? as f32,
                other => {
                    let what = format!("phase function `{other}`");
                    self.context.left_out(&phase.place, what)?;
                }
            }
        }
        Ok(Some(Medium {
            absorption,
            scattering,
            mean_cosine,
        }))
    }
}
