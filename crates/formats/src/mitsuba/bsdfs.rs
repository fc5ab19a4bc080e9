//! Materials of Mitsuba.

use super::super::{Role, ShapeMaterial, checked_index};
use super::Scene;
use super::xml::{Object, Value};
use crate::build::looks::{self, Paint};
use crate::build::metals;
use opsr::bsdf::Distribution;
use opsr::math::{Rgb, luminance};
use opsr::scene::Material;
use opsr::scene::finish::Anisotropy;
use opsr::scene::load::error::{Result, fault};

/// Least roughness of a rough material: below it Mitsuba's materials are mirrors, too.
const MIN_ALPHA: f64 = 1e-4;

impl Scene<'_> {
    /// The material of an object.
    pub(super) fn look(&mut self, bsdf: &Object) -> Result<ShapeMaterial> {
        let address = std::ptr::from_ref(bsdf).addr();
        if let Some(look) = self.materials.get(&address) {
            return Ok(look.clone());
        }
        let around = std::mem::take(&mut self.painted);
        let mut look = self.within(bsdf, |scene| scene.read_look(bsdf))?;
        if std::mem::replace(&mut self.painted, around) {
            look.material.finish_mut().has_colors = true;
        }
        look.material.name = bsdf.id.clone();
        self.materials.insert(address, look.clone());
        Ok(look)
    }

    fn read_look(&mut self, bsdf: &Object) -> Result<ShapeMaterial> {
        let place = &bsdf.place;
        let material = match bsdf.plugin.as_str() {
            "diffuse" | "lambertian" | "roughdiffuse" => {
                if bsdf.plugin == "roughdiffuse" {
                    self.context
                        .approximate(place, "Oren and Nayar's model is shown as diffuse");
                }
                let names = ["reflectance", "diffuse_reflectance"];
                looks::diffuse(self.paint(bsdf, &names, Paint::from(0.5))?)
            }
            "conductor" | "roughconductor" => self.conductor(bsdf)?,
            "dielectric" | "roughdielectric" => self.dielectric(bsdf)?,
            "thindielectric" => {
                let eta = self.eta(bsdf, "bk7", "air")?;
                let tint = self.paint(bsdf, &["specular_transmittance"], Paint::from(1.0))?;
                let reflected =
                    self.colour(bsdf, &["specular_reflectance"], Rgb::ONE, Role::Reflected)?;
                looks::wall(eta, tint, reflected)
            }
            "plastic" | "roughplastic" => self.plastic(bsdf)?,
            "pplastic" => {
                (self.context).nearest(place, "bsdf `pplastic`", "`roughplastic`")?;
                self.plastic(bsdf)?
            }
            "principled" => self.principled(bsdf)?,
            "principledthin" => {
                let share = self.colour(bsdf, &["diff_trans"], Rgb::ZERO, Role::Reflected)?;
                let share = self.grey(Paint::plain(share)).factor.x;
                let mut material = self.principled(bsdf)?;
                material.solid = false;
                looks::transmit_share(&mut material, 0.5 * share);
                material
            }
            "difftrans" => {
                let mut material = looks::diffuse(Paint::from(0.0));
                let transmitted = self.paint(bsdf, &["transmittance"], Paint::from(0.5))?;
                (self.context).transmit(&mut material, transmitted, place);
                material
            }
            "hair" => {
                (self.context).nearest(place, "bsdf `hair`", "a glossy surface of its colour")?;
                let melanin = |name: &str, or| bsdf.number(name, or).map(|x| x as f32);
                let (dark, red) = (melanin("eumelanin", 1.3)?, melanin("pheomelanin", 0.0)?);
                let own = looks::melanin(dark, red);
                let absorption = self.colour(bsdf, &["sigma_a"], own, Role::Reflected)?;
                let rough = melanin("azimuthal_roughness", 0.3)?;
                looks::hair(looks::colour_of_hair(absorption, rough))
            }
            "phong" | "ward" => self.lobe(bsdf)?,
            "coating" | "roughcoating" => return self.coating(bsdf),
            "null" => looks::nothing(),
            "twosided" => return self.twosided(bsdf),
            "mask" => return self.mask(bsdf),
            "bumpmap" | "bump" | "normalmap" => return self.mapped(bsdf),
            "blendbsdf" | "mixturebsdf" => return self.blend(bsdf),
            other => {
                self.context
                    .nearest(place, format!("bsdf `{other}`"), "a grey diffuse surface")?;
                looks::diffuse(Paint::from(0.5))
            }
        };
        Ok(material.into())
    }

    /// The BSDFs inside a BSDF.
    fn nested(&mut self, bsdf: &Object) -> Result<Vec<ShapeMaterial>> {
        let inner = self.children(bsdf, &["bsdf"])?;
        inner.iter().map(|(_, inner)| self.look(inner)).collect()
    }

    fn only(&mut self, bsdf: &Object) -> Result<ShapeMaterial> {
        let inner = self.nested(bsdf)?.into_iter().next();
        inner.ok_or_else(|| fault(&bsdf.place, "has no BSDF in it"))
    }

    fn twosided(&mut self, bsdf: &Object) -> Result<ShapeMaterial> {
        let inner = self.nested(bsdf)?;
        if inner.len() > 1 {
            self.context.nearest(
                &bsdf.place,
                "another BSDF on the back",
                "the front on both sides",
            )?;
        }
        let first = inner.into_iter().next();
        first.ok_or_else(|| fault(&bsdf.place, "has no BSDF in it"))
    }

    fn mask(&mut self, bsdf: &Object) -> Result<ShapeMaterial> {
        let mut look = self.only(bsdf)?;
        let opacity = self.numbers(bsdf, "opacity", 0.5)?;
        let done = (self.context.builder).set_opacity(&mut look.material, opacity);
        if let Err(what) = done {
            self.context.nearest(&bsdf.place, what, "opaque")?;
        }
        Ok(look)
    }

    fn mapped(&mut self, bsdf: &Object) -> Result<ShapeMaterial> {
        let mut look = self.only(bsdf)?;
        if let Some(map) = self.any_texture(bsdf)? {
            if bsdf.plugin == "normalmap" {
                look.material.normal_texture = map.map;
                look.material.normal_scale = 1.0;
            } else {
                let map = self.grey(map);
                let scale = bsdf.number("scale", 1.0)? as f32;
                look.bump = Some(Paint {
                    factor: map.factor * scale,
                    ..map
                });
            }
        }
        Ok(look)
    }

    fn blend(&mut self, bsdf: &Object) -> Result<ShapeMaterial> {
        let place = &bsdf.place;
        let mut all = self.nested(bsdf)?;
        let weights = match bsdf.property("weights").map(|p| &p.value) {
            Some(Value::Text(text)) => super::xml::numbers(text).unwrap_or_default(),
            _ => Vec::new(),
        };
        if let (true, [first, second]) = (weights.is_empty(), &mut all[..]) {
            let weight = self.numbers(bsdf, "weight", 0.5)?;
            let mut look = first.clone();
            let second = std::mem::take(&mut second.material);
            look.material = (self.context).mixed(look.material, second, weight, place)?;
            return Ok(look);
        }
        if weights.len() != all.len() || weights.iter().any(|w| !(*w >= 0.0 && w.is_finite())) {
            let what = format!("{} weights of {} BSDFs", weights.len(), all.len());
            return Err(fault(place, what));
        }
        let sum: f64 = weights.iter().sum();
        if (sum - 1.0).abs() > 1e-3 {
            let what = format!("weights of a sum of {sum} are scaled to 1");
            self.context.approximate(place, &what);
        }
        let bump = all.first().and_then(|look| look.bump);
        let materials = all.into_iter().map(|look| look.material);
        let weights = weights.into_iter().map(|weight| weight as f32);
        let material = (self.context).heaviest(weights.zip(materials).collect(), place)?;
        Ok(ShapeMaterial { material, bump })
    }

    /// A surface under a clear layer, shown as a clear coat.
    fn coating(&mut self, bsdf: &Object) -> Result<ShapeMaterial> {
        let mut look = self.only(bsdf)?;
        let what = format!("`{}` is shown as glTF's clear coat", bsdf.plugin);
        self.context.approximate(&bsdf.place, &what);
        let mut layer = Material::default();
        if bsdf.plugin == "roughcoating" {
            self.rough(bsdf, &mut layer)?;
        } else {
            layer.alpha = 0.0;
        }
        let coat = look.material.finish_mut().clearcoat.get_or_insert_default();
        (coat.weight, coat.alpha) = (1.0, layer.alpha);
        Ok(look)
    }

    /// Phong's and Ward's lobes over a diffuse surface, as microfacets of the same width.
    fn lobe(&mut self, bsdf: &Object) -> Result<Material> {
        let what = format!(
            "`{}` is shown as microfacets on a diffuse surface",
            bsdf.plugin
        );
        self.context.approximate(&bsdf.place, &what);
        let base = self.paint(bsdf, &["diffuse_reflectance"], Paint::from(0.5))?;
        let shine = self.colour(
            bsdf,
            &["specular_reflectance"],
            Rgb::splat(0.2),
            Role::Reflected,
        )?;
        let width = match bsdf.plugin.as_str() {
            "phong" => looks::width_of_phong(bsdf.number("exponent", 30.0)? as f32),
            _ => {
                let product = bsdf.number("alpha_u", 0.1)? * bsdf.number("alpha_v", 0.1)?;
                product.max(0.0).sqrt() as f32
            }
        };
        Ok(Material {
            alpha: width.min(1.0),
            ..looks::glossy(base, Rgb::ONE, looks::index_of(luminance(shine)))
        })
    }

    /// The index of refraction of a property that is a number or a name.
    fn index(&mut self, bsdf: &Object, name: &str, or: &str) -> Result<f32> {
        let text = match bsdf.property(name).map(|p| &p.value) {
            Some(Value::Text(text)) => text.clone(),
            Some(_) => return checked_index(bsdf.number(name, 1.0)? as f32, &bsdf.place),
            None => or.to_owned(),
        };
        let found = metals::glass(&text).or_else(|| text.trim().parse().ok());
        let found = found.ok_or_else(|| fault(&bsdf.place, format!("no material `{text}`")))?;
        checked_index(found, &bsdf.place)
    }

    fn eta(&mut self, bsdf: &Object, inside: &str, outside: &str) -> Result<f32> {
        if bsdf.property("eta").is_some() {
            return self.index(bsdf, "eta", "");
        }
        let eta = self.index(bsdf, "int_ior", inside)? / self.index(bsdf, "ext_ior", outside)?;
        checked_index(eta, &bsdf.place)
    }

    /// Sets roughness and distribution of a material; a textured roughness becomes its roughness map.
    fn rough(&mut self, bsdf: &Object, material: &mut Material) -> Result<()> {
        if !bsdf.plugin.starts_with("rough") && bsdf.plugin != "pplastic" {
            return Ok(());
        }
        let own = match bsdf.text("distribution")?.unwrap_or("beckmann") {
            "ggx" => Distribution::Ggx,
            "beckmann" => Distribution::Beckmann,
            other => {
                self.context.approximate(
                    &bsdf.place,
                    &format!("distribution `{other}` is shown as Beckmann's"),
                );
                Distribution::Beckmann
            }
        };
        material.distribution = self.context.distribution(own);
        let both = self.numbers(bsdf, "alpha", 0.1)?;
        let of = |scene: &mut Self, name: &str| match scene.has(bsdf, name)? {
            true => scene.numbers(bsdf, name, 0.1),
            false => Ok(both),
        };
        let (u, v) = (of(self, "alpha_u")?, of(self, "alpha_v")?);
        if let Some(map) = u.map.or(v.map) {
            if u != v {
                let what = "two textures of roughness: the first counts";
                self.context.approximate(&bsdf.place, what);
            }
            let factor = if u.map.is_some() {
                u.factor.x
            } else {
                v.factor.x
            };
            let map = (self.context.builder).roughness_map(map, |x| (factor * x).min(1.0));
            (material.alpha, material.metallic_roughness_texture) = (1.0, Some(map));
            return Ok(());
        }
        let [u, v] = [u, v].map(|alpha| f64::from(alpha.factor.x));
        if u.min(v) < 0.0 {
            return Err(fault(&bsdf.place, "a roughness below 0"));
        }
        let [u, v] = [u, v].map(|a| a.clamp(MIN_ALPHA, 1.0));
        material.alpha = u.min(v) as f32;
        if u != v {
            let mean = (u * v).sqrt() as f32;
            if material.metallic == 1.0 {
                // A strength s makes the larger roughness α + (1 − α) s².
                let least = u.min(v);
                material.finish_mut().anisotropy = Some(Anisotropy {
                    strength: ((u.max(v) - least) / (1.0 - least)).sqrt() as f32,
                    rotation: if u > v {
                        0.0
                    } else {
                        std::f32::consts::FRAC_PI_2
                    },
                    texture: None,
                });
                self.context.approximate(
                    &bsdf.place,
                    "a brushed metal reflects by Schlick's approximation",
                );
            } else {
                material.alpha = mean;
                self.context.approximate(
                    &bsdf.place,
                    "two roughnesses are shown as their geometric mean",
                );
            }
        }
        Ok(())
    }

    fn conductor(&mut self, bsdf: &Object) -> Result<Material> {
        let tint = self.paint(bsdf, &["specular_reflectance"], Paint::from(1.0))?;
        let outside = match bsdf.property("ext_eta") {
            Some(_) => self.index(bsdf, "ext_eta", "air")?,
            None => 1.0,
        };
        let name = bsdf.text("material")?;
        let given = bsdf.property("eta").is_some() || bsdf.property("k").is_some();
        let mut material = match name {
            Some("none") => looks::metal(Rgb::ZERO, Rgb::ONE, tint, 0.0),
            None if given || !self.children(bsdf, &["spectrum"])?.is_empty() => {
                let eta = self.colour(bsdf, &["eta"], Rgb::ZERO, Role::Reflected)?;
                let k = self.colour(bsdf, &["k"], Rgb::ONE, Role::Reflected)?;
                looks::metal(eta / outside, k / outside, tint, 0.0)
            }
            name => {
                // Without a name Mitsuba 3 has a perfect mirror; its predecessor had copper.
                let Some(name) = name else {
                    let mut mirror = looks::metal(Rgb::ZERO, Rgb::ONE, tint, 0.0);
                    self.rough(bsdf, &mut mirror)?;
                    return Ok(mirror);
                };
                let (eta, k) = match metals::metal(name) {
                    Some(found) => found,
                    None => {
                        self.context.nearest(
                            &bsdf.place,
                            format!("metal `{name}`"),
                            "a perfect mirror",
                        )?;
                        (Rgb::ZERO, Rgb::ONE)
                    }
                };
                looks::metal(eta / outside, k / outside, tint, 0.0)
            }
        };
        self.rough(bsdf, &mut material)?;
        Ok(material)
    }

    fn dielectric(&mut self, bsdf: &Object) -> Result<Material> {
        let eta = self.eta(bsdf, "bk7", "air")?;
        let tint = self.paint(bsdf, &["specular_transmittance"], Paint::from(1.0))?;
        let reflected = self.colour(bsdf, &["specular_reflectance"], Rgb::ONE, Role::Reflected)?;
        if reflected != Rgb::ONE {
            self.context.approximate(
                &bsdf.place,
                "specular_reflectance of a dielectric is taken for 1",
            );
        }
        let mut material = looks::glass(eta, tint, 0.0);
        self.rough(bsdf, &mut material)?;
        Ok(material)
    }

    fn plastic(&mut self, bsdf: &Object) -> Result<Material> {
        let eta = self.eta(bsdf, "polypropylene", "air")?;
        let base = self.paint(bsdf, &["diffuse_reflectance"], Paint::from(0.5))?;
        let reflected = self.colour(bsdf, &["specular_reflectance"], Rgb::ONE, Role::Reflected)?;
        let saturates = bsdf.flag("nonlinear", false)?;
        let mut material = looks::coated(eta, base, reflected, 0.0, saturates);
        self.rough(bsdf, &mut material)?;
        Ok(material)
    }

    /// Disney's model, by that of glTF, which has most of its parts.
    fn principled(&mut self, bsdf: &Object) -> Result<Material> {
        self.context.approximate(
            &bsdf.place,
            &format!("`{}` is shown by glTF's model", bsdf.plugin),
        );
        let base = self.paint(bsdf, &["base_color"], Paint::from(0.5))?;
        let rough = self.numbers(bsdf, "roughness", 0.5)?;
        let of = |name: &str, or: f64| bsdf.number(name, or).map(|x| x as f32);
        let specular = of("specular", 0.5)?;
        let ior = match bsdf.property("eta") {
            Some(_) => checked_index(of("eta", 1.5)?, &bsdf.place)?,
            // F0 = 0.08 specular.
            None => looks::index_of(0.08 * specular.clamp(0.0, 1.0)),
        };
        let mut share = |name: &str| -> Result<f32> {
            let found = self.colour(bsdf, &[name], Rgb::ZERO, Role::Reflected)?;
            Ok(self.grey(Paint::plain(found)).factor.x.clamp(0.0, 1.0))
        };
        let (metallic, transmission) = (share("metallic")?, share("spec_trans")?);
        let mut material = Material {
            metallic,
            transmission,
            specular: 1.0,
            ior: ior.max(1.0),
            distribution: self.context.distribution(Distribution::Ggx),
            ..looks::diffuse(base)
        };
        material.solid = material.transmission > 0.0;
        match rough.map {
            Some(map) => {
                let factor = rough.factor.x;
                let map =
                    (self.context.builder).roughness_map(map, |x| (factor * x).powi(2).min(1.0));
                (material.alpha, material.metallic_roughness_texture) = (1.0, Some(map));
            }
            None => material.alpha = rough.factor.x.clamp(0.0, 1.0).powi(2),
        }
        let clearcoat = of("clearcoat", 0.0)?.clamp(0.0, 1.0);
        if clearcoat > 0.0 {
            let gloss = of("clearcoat_gloss", 0.0)?;
            let coat = material.finish_mut().clearcoat.get_or_insert_default();
            (coat.weight, coat.alpha) = (clearcoat, 0.1 + (0.001 - 0.1) * gloss);
        }
        Ok(material)
    }
}
