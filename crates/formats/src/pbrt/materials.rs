//! Materials of pbrt.

use super::super::images::Use;
use super::super::{Role, ShapeMaterial, checked_index};
use super::tokens::{Parameters, Values};
use super::{Declared, Scene};
use crate::build::looks::{self, Paint};
use crate::build::metals;
use opsr::bsdf::Distribution;
use opsr::math::Rgb;
use opsr::scene::finish::Anisotropy;
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{Material, Wrap};
use std::rc::Rc;

/// Roughness below which pbrt treats microfacets as a mirror.
const SMOOTH: f32 = 1e-3;

/// Roughness by version 4's scale √r if `remaproughness` is true.
fn remapped(roughness: f32, remap: bool) -> f32 {
    match remap {
        true => roughness.max(0.0).sqrt(),
        false => roughness,
    }
}

/// Names of a mixture's two parts; true for version 3, which has two parameters and the first part's share as amount.
pub(super) fn parts_of(parameters: &Parameters) -> Result<(Vec<String>, bool)> {
    let apart = [
        parameters.text("namedmaterial1")?,
        parameters.text("namedmaterial2")?,
    ];
    match (parameters.get("materials").map(|p| &p.values), apart) {
        (Some(Values::Texts(names)), _) if names.len() == 2 => Ok((names.clone(), false)),
        (_, [Some(first), Some(second)]) => Ok((vec![second.to_owned(), first.to_owned()], true)),
        _ => Err(fault(&parameters.place, "a mixture names two materials")),
    }
}

impl Scene<'_> {
    /// The material of a declaration, read once.
    pub(super) fn look(&mut self, declared: &Rc<Declared>, depth: usize) -> Result<ShapeMaterial> {
        let address = Rc::as_ptr(declared).addr();
        if let Some((look, mapping)) = self.shape_materials.get(&address).cloned() {
            self.takes(mapping, &declared.parameters.place)?;
            return Ok(look);
        }
        let parameters = &declared.parameters;
        if depth > 16 {
            return Err(fault(&parameters.place, "a mixture that holds itself"));
        }
        let before = self.mapping.take();
        let mut look = ShapeMaterial {
            material: self.material(&declared.kind, parameters, depth)?,
            bump: None,
        };
        // The second name is that of version 3.
        for name in ["displacement", "bumpmap"] {
            if parameters.get(name).is_none() {
                continue;
            }
            let heights = self.paint(parameters, name, Paint::from(0.0))?;
            look.bump = heights.map.map(|_| heights);
        }
        if let Some(name) = parameters.text("normalmap")? {
            let how = Use::upright(Some(false), Wrap::Repeat);
            let name = name.to_owned();
            look.material.normal_texture = self.context.texture(&name, how, &parameters.place)?.map;
        }
        // The declaration stays alive, so its address remains a unique key.
        self.kept.push(declared.clone());
        let own = std::mem::replace(&mut self.mapping, before);
        if own.is_some() {
            look.material.finish_mut().has_second_uvs = true;
        }
        self.takes(own, &parameters.place)?;
        self.shape_materials.insert(address, (look.clone(), own));
        Ok(look)
    }

    fn material(&mut self, kind: &str, parameters: &Parameters, depth: usize) -> Result<Material> {
        let place = &parameters.place;
        Ok(match kind {
            "diffuse" | "matte" => {
                let name = if parameters.get("Kd").is_some() {
                    "Kd"
                } else {
                    "reflectance"
                };
                looks::diffuse(self.paint(parameters, name, Paint::from(0.5))?)
            }
            "conductor" => self.conductor(parameters, "")?,
            "dielectric" => {
                let eta = self.eta(parameters, "eta", 1.5)?;
                let mut material = looks::glass(eta, Paint::from(1.0), 0.0);
                self.rough(parameters, "", 0.0, &mut material, remapped)?;
                material
            }
            "thindielectric" => {
                let eta = self.eta(parameters, "eta", 1.5)?;
                looks::wall(eta, Paint::from(1.0), Rgb::ONE)
            }
            "coateddiffuse" => {
                self.layered(parameters)?;
                let base = self.paint(parameters, "reflectance", Paint::from(0.5))?;
                let eta = self.eta(parameters, "eta", 1.5)?;
                let mut material = looks::coated(eta, base, Rgb::ONE, 0.0, true);
                self.rough(parameters, "", 0.0, &mut material, remapped)?;
                material
            }
            "coatedconductor" => {
                self.layered(parameters)?;
                self.context.approximate(
                    place,
                    "`coatedconductor` is shown as a metal under glTF's clear coat",
                );
                let mut material = self.conductor(parameters, "conductor.")?;
                let mut coat = Material::default();
                self.rough(parameters, "interface.", 0.0, &mut coat, remapped)?;
                let clear = material.finish_mut().clearcoat.get_or_insert_default();
                (clear.weight, clear.alpha) = (1.0, coat.alpha);
                material
            }
            "diffusetransmission" => {
                // The scaled colours are clamped to [0, 1], as in pbrt.
                let scale = parameters.number("scale", 1.0)?.clamp(0.0, 1e6) as f32;
                let mut of = |name: &str| -> Result<Paint> {
                    let paint = self.paint(parameters, name, Paint::from(0.25))?;
                    let most = if paint.map.is_some() { 1e6 } else { 1.0 };
                    let factor = (paint.factor * scale).clamp(Rgb::ZERO, Rgb::splat(most));
                    Ok(Paint { factor, ..paint })
                };
                let (reflected, transmitted) = (of("reflectance")?, of("transmittance")?);
                let mut material = looks::diffuse(reflected);
                (self.context).transmit(&mut material, transmitted, place);
                material
            }
            "hair" => {
                (self.context).nearest(
                    place,
                    "material `hair`",
                    "a glossy surface of its colour",
                )?;
                looks::hair(self.hair(parameters)?)
            }
            "mix" => self.mixture(parameters, depth)?,
            "interface" | "" | "none" => looks::nothing(),
            other => match self.older(other, parameters)? {
                Some(material) => material,
                None => {
                    let what = format!("material `{other}`");
                    (self.context).nearest(place, what, "a grey diffuse surface")?;
                    looks::diffuse(Paint::from(0.5))
                }
            },
        })
    }

    /// The colour of hair: given directly, or by its absorption.
    fn hair(&mut self, parameters: &Parameters) -> Result<Rgb> {
        for name in ["reflectance", "color"] {
            if parameters.get(name).is_some() {
                return self.colour(parameters, name, Rgb::ONE, Role::Reflected);
            }
        }
        let mut of = |name: &str, or: f32| -> Result<Rgb> {
            self.colour(parameters, name, Rgb::splat(or), Role::Reflected)
        };
        let red = of("pheomelanin", 0.0)?.x;
        let dark = of("eumelanin", if red > 0.0 { 0.0 } else { 1.3 })?.x;
        let absorption = match parameters.get("sigma_a") {
            Some(_) => of("sigma_a", 0.0)?,
            None => looks::melanin(dark, red),
        };
        Ok(looks::colour_of_hair(absorption, of("beta_n", 0.3)?.x))
    }

    /// Warns of a scattering medium inside a layer, which is shown as a clear layer.
    fn layered(&mut self, parameters: &Parameters) -> Result<()> {
        let albedo = self.colour(parameters, "albedo", Rgb::ZERO, Role::Reflected)?;
        match albedo == Rgb::ZERO {
            true => Ok(()),
            false => (self.context).nearest(
                &parameters.place,
                "a medium in a layer (`albedo`)",
                "a clear layer",
            ),
        }
    }

    /// An index of refraction: a number, the name of a glass, or a spectrum.
    pub(super) fn eta(&mut self, parameters: &Parameters, name: &str, or: f32) -> Result<f32> {
        let eta = match parameters.get(name).map(|p| &p.values) {
            None => or,
            Some(Values::Texts(names))
                if names.len() == 1 && metals::glass(&names[0]).is_some() =>
            {
                self.context
                    .approximate(&parameters.place, "dispersion of a named glass is left out");
                metals::glass(&names[0]).unwrap_or(or)
            }
            Some(_) => {
                let colour = self.colour(parameters, name, Rgb::splat(or), Role::Reflected)?;
                colour.element_sum() / 3.0
            }
        };
        checked_index(eta, &parameters.place)
    }

    fn conductor(&mut self, parameters: &Parameters, prefix: &str) -> Result<Material> {
        let of = |name: &str| format!("{prefix}{name}");
        let outside = match prefix.is_empty() {
            true => 1.0,
            false => self.eta(parameters, "interface.eta", 1.5)?,
        };
        let (eta, k) = if parameters.get("reflectance").is_some() {
            // The k that gives this reflectance with an index of 1, as in pbrt.
            let r = self.colour(parameters, "reflectance", Rgb::ONE, Role::Reflected)?;
            let r = r.clamp(Rgb::ZERO, Rgb::splat(0.9999));
            let k = 2.0 * r.map(f32::sqrt) / (Rgb::ONE - r).map(f32::sqrt);
            (Rgb::ONE, k)
        } else {
            let (eta, k) = metals::metal("Cu").unwrap_or((Rgb::ONE, Rgb::ONE));
            let eta = self.colour(parameters, &of("eta"), eta, Role::Reflected)?;
            let k = self.colour(parameters, &of("k"), k, Role::Reflected)?;
            (eta, k)
        };
        // Both are relative to the index of the layer above, as in pbrt.
        let mut material = looks::metal(eta / outside, k / outside, Paint::from(1.0), 0.0);
        self.rough(parameters, prefix, 0.0, &mut material, remapped)?;
        Ok(material)
    }

    /// Sets the roughness of Trowbridge and Reitz's microfacets; `remapped` gets a number and `remaproughness`.
    pub(super) fn rough(
        &mut self,
        parameters: &Parameters,
        prefix: &str,
        or: f32,
        material: &mut Material,
        remapped: fn(f32, bool) -> f32,
    ) -> Result<()> {
        let place = &parameters.place;
        material.distribution = self.context.distribution(Distribution::Ggx);
        let remap = parameters.flag("remaproughness", true)?;
        let both = self.paint(parameters, &format!("{prefix}roughness"), Paint::from(or))?;
        let u = self.paint(parameters, &format!("{prefix}uroughness"), both)?;
        let v = self.paint(parameters, &format!("{prefix}vroughness"), both)?;
        if let Some(map) = u.map.or(v.map) {
            if u != v {
                self.context
                    .approximate(place, "two textures of roughness: the first counts");
            }
            let factor = u.factor.x;
            let map =
                (self.context.builder).roughness_map(map, |x| remapped(factor * x, remap).min(1.0));
            (material.alpha, material.metallic_roughness_texture) = (1.0, Some(map));
            return Ok(());
        }
        let [u, v] = [u.factor.x, v.factor.x].map(|r| remapped(r, remap).min(1.0));
        if u.max(v) < SMOOTH {
            material.alpha = 0.0;
            return Ok(());
        }
        let [u, v] = [u, v].map(|a| a.max(SMOOTH));
        material.alpha = u.min(v);
        if u == v {
            return Ok(());
        }
        if material.metallic == 1.0 {
            let least = u.min(v);
            material.finish_mut().anisotropy = Some(Anisotropy {
                strength: ((u.max(v) - least) / (1.0 - least)).sqrt(),
                rotation: if u > v {
                    0.0
                } else {
                    std::f32::consts::FRAC_PI_2
                },
                texture: None,
            });
            self.context
                .approximate(place, "a brushed metal reflects by Schlick's approximation");
        } else {
            material.alpha = (u * v).sqrt();
            self.context
                .approximate(place, "two roughnesses are shown as their geometric mean");
        }
        Ok(())
    }

    fn mixture(&mut self, parameters: &Parameters, depth: usize) -> Result<Material> {
        let place = &parameters.place;
        let (names, older) = parts_of(parameters)?;
        let mut looks = Vec::new();
        for name in &names {
            let known = self.named_material(name, place)?;
            looks.push(self.look(&known, depth + 1)?.material);
        }
        let mut amount = match older {
            true => {
                Paint::plain(self.colour(parameters, "amount", Rgb::splat(0.5), Role::Reflected)?)
            }
            false => self.paint(parameters, "amount", Paint::from(0.5))?,
        };
        if amount.map.is_some_and(|map| map.second) {
            // Shares use the first texture coordinates.
            (self.context).nearest(place, "a mapping of `amount`", "its mean")?;
            amount = Paint::plain(self.context.builder.mean(amount));
        }
        let second = looks.pop().unwrap_or_default();
        let first = looks.pop().unwrap_or_default();
        self.context.mixed(first, second, amount, place)
    }
}
