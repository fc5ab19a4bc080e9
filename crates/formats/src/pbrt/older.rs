//! Materials of pbrt-v3, as the nearest ones of this project.

use super::super::{Role, checked_index};
use super::Scene;
use super::tokens::Parameters;
use crate::build::looks::{self, Paint};
use crate::build::metals;
use opsr::bsdf::Distribution;
use opsr::math::{Rgb, luminance};
use opsr::scene::Material;
use opsr::scene::load::error::Result;

/// Roughness by version 3's scale if `remaproughness` is true: a polynomial of the logarithm `[PBRT3 §8.4.2]`.
fn remapped(roughness: f32, remap: bool) -> f32 {
    if !remap {
        return roughness;
    }
    let x = roughness.max(1e-3).ln();
    1.62142 + x * (0.819_955 + x * (0.1734 + x * (0.017_120_1 + x * 0.000_640_711)))
}

impl Scene<'_> {
    /// The material of a kind that only version 3 has, or that has other defaults there; `None` for other kinds.
    pub(super) fn older(
        &mut self,
        kind: &str,
        parameters: &Parameters,
    ) -> Result<Option<Material>> {
        let white = Paint::from(1.0);
        let material = match kind {
            "mirror" => {
                let tint = self.paint(parameters, "Kr", Paint::from(0.9))?;
                looks::metal(Rgb::ZERO, Rgb::ONE, tint, 0.0)
            }
            "glass" => {
                let tint = self.paint(parameters, "Kt", white)?;
                let mut material = looks::glass(self.index(parameters)?, tint, 0.0);
                // Glass of roughness 0 is smooth, although the scale maps 0 to a positive roughness.
                let smooth = |r, remap| if r == 0.0 { 0.0 } else { remapped(r, remap) };
                self.rough(parameters, "", 0.0, &mut material, smooth)?;
                material
            }
            "metal" => {
                let (eta, k) = metals::metal("Cu").unwrap_or((Rgb::ONE, Rgb::ONE));
                let eta = self.colour(parameters, "eta", eta, Role::Reflected)?;
                let k = self.colour(parameters, "k", k, Role::Reflected)?;
                let mut material = looks::metal(eta, k, white, 0.0);
                self.roughened(parameters, 0.01, &mut material)?;
                material
            }
            "plastic" | "uber" => {
                let base = self.paint(parameters, "Kd", Paint::from(0.25))?;
                let shine = self.colour(parameters, "Ks", Rgb::splat(0.25), Role::Reflected)?;
                let mut material = looks::glossy(base, shine, self.index(parameters)?);
                self.roughened(parameters, 0.1, &mut material)?;
                if kind == "uber" {
                    material = self.uber(parameters, material)?;
                }
                material
            }
            "substrate" => {
                let base = self.paint(parameters, "Kd", Paint::from(0.5))?;
                let shine = self.colour(parameters, "Ks", Rgb::splat(0.5), Role::Reflected)?;
                // The index of a layer that reflects `Ks` at normal incidence.
                let index = looks::index_of(luminance(shine));
                let mut material = looks::glossy(base, Rgb::ONE, index);
                self.roughened(parameters, 0.1, &mut material)?;
                material
            }
            "translucent" => self.translucent(parameters)?,
            "subsurface" | "kdsubsurface" => {
                let place = &parameters.place;
                (self.context).nearest(place, "subsurface scattering", "the surface alone")?;
                let name = ["Kd", "reflectance"]
                    .into_iter()
                    .find(|n| parameters.get(n).is_some());
                let base = self.paint(parameters, name.unwrap_or("Kd"), Paint::from(0.5))?;
                let mut material = looks::glossy(base, Rgb::ONE, self.index(parameters)?);
                self.roughened(parameters, 0.0, &mut material)?;
                material
            }
            "disney" => self.disney(parameters)?,
            _ => return Ok(None),
        };
        Ok(Some(material))
    }

    /// A surface with diffuse reflection and transmission under a glossy layer.
    fn translucent(&mut self, parameters: &Parameters) -> Result<Material> {
        let base = self.paint(parameters, "Kd", Paint::from(0.25))?;
        let shine = self.colour(parameters, "Ks", Rgb::splat(0.25), Role::Reflected)?;
        let mut of = |name: &str| self.colour(parameters, name, Rgb::splat(0.5), Role::Reflected);
        let (reflect, transmit) = (of("reflect")?, of("transmit")?);
        let part = |share: Rgb| Paint {
            factor: base.factor * share,
            ..base
        };
        let mut material = looks::glossy(part(reflect), shine * reflect, 1.5);
        self.roughened(parameters, 0.1, &mut material)?;
        let place = &parameters.place;
        (self.context).transmit(&mut material, part(transmit), place);
        if shine * transmit != Rgb::ZERO {
            let what = "glossy transmission of `translucent` is left out";
            self.context.approximate(place, what);
        }
        Ok(material)
    }

    /// `eta`, or `index` in older files.
    fn index(&mut self, parameters: &Parameters) -> Result<f32> {
        let name = if parameters.get("index").is_some() {
            "index"
        } else {
            "eta"
        };
        self.eta(parameters, name, 1.5)
    }

    /// Sets roughness on version 3's scale, for Trowbridge and Reitz's microfacets.
    fn roughened(
        &mut self,
        parameters: &Parameters,
        or: f32,
        material: &mut Material,
    ) -> Result<()> {
        self.rough(parameters, "", or, material, remapped)
    }

    /// Adds the features of `uber` that `plastic` does not have: mirror, glass, opacity.
    fn uber(&mut self, parameters: &Parameters, mut material: Material) -> Result<Material> {
        let place = &parameters.place;
        let of = |scene: &mut Self, name: &str| {
            scene.colour(parameters, name, Rgb::ZERO, Role::Reflected)
        };
        let (through, mirrored) = (of(self, "Kt")?, of(self, "Kr")?);
        let base = luminance(material.base_color);
        if luminance(through) > base {
            let tint = Paint::plain(through);
            let glass = looks::glass(material.ior, tint, 0.0);
            (self.context).approximate(place, "`uber` with a large `Kt` is shown as glass");
            return Ok(glass);
        }
        if through != Rgb::ZERO {
            let what = "`Kt` of an `uber` material beside its `Kd` is left out";
            self.context.approximate(place, what);
        }
        if mirrored != Rgb::ZERO {
            (material.specular, material.alpha) = (1.0, 0.0);
            (material.ior, material.specular_color) = (1.5, mirrored);
            let what = "`Kr` of an `uber` material is shown as a clear coat";
            self.context.approximate(place, what);
        }
        let opacity = self.paint(parameters, "opacity", Paint::from(1.0))?;
        if opacity != Paint::from(1.0)
            && let Err(what) = self.context.builder.set_opacity(&mut material, opacity)
        {
            self.context.nearest(place, what, "opaque")?;
        }
        Ok(material)
    }

    /// Disney's model, by that of glTF.
    fn disney(&mut self, parameters: &Parameters) -> Result<Material> {
        let place = &parameters.place;
        self.context
            .approximate(place, "`disney` is shown by glTF's model");
        let base = self.paint(parameters, "color", Paint::from(0.5))?;
        let mut of = |name: &str, or: f32| -> Result<f32> {
            let colour = self.colour(parameters, name, Rgb::splat(or), Role::Reflected)?;
            Ok(luminance(colour))
        };
        let (metallic, roughness) = (of("metallic", 0.0)?, of("roughness", 0.5)?);
        let (through, ior) = (of("spectrans", 0.0)?, of("eta", 1.5)?);
        let ior = checked_index(ior, place)?;
        let (coat, gloss) = (of("clearcoat", 0.0)?, of("clearcoatgloss", 1.0)?);
        let scattered = of("difftrans", 1.0)?;
        let thin = parameters.flag("thin", false)?;
        let mut material = Material {
            metallic: metallic.clamp(0.0, 1.0),
            transmission: through.clamp(0.0, 1.0),
            solid: through > 0.0 && !thin,
            ior: ior.max(1.0),
            alpha: roughness.clamp(0.0, 1.0).powi(2),
            distribution: self.context.distribution(Distribution::Ggx),
            ..looks::glossy(base, Rgb::ONE, ior)
        };
        if thin {
            looks::transmit_share(&mut material, 0.5 * scattered);
        }
        if coat > 0.0 {
            let clear = material.finish_mut().clearcoat.get_or_insert_default();
            (clear.weight, clear.alpha) = (coat.min(1.0), 0.1 + (0.001 - 0.1) * gloss);
        }
        Ok(material)
    }
}
