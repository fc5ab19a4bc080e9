//! Media of other renderers: what is on the two sides of a boundary.
//!
//! A shape names the medium inside and the one outside of it. Where the two are one, or none is named, the boundary means nothing to
//! media: what is around it goes on in it. A path tracks the bodies around it, which determine the medium outside of a
//! shape. Only the medium of the whole scene must be found: the one outside of a shape or around the camera that fills no shape.
//! Bodies around the camera decide where a shape has the same medium as the camera.

use super::{Context, Material, Medium};
use crate::build::looks;
use opsr::math::{Rgb, Vec2};
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{Scene, SceneParts};

/// A medium of a file by its number; `None` for nothing.
pub(super) type Named = Option<usize>;

/// Media of a file, and the sides of its boundaries so far.
#[derive(Default)]
pub(super) struct Media {
    all: Vec<Medium>,
    inside: Vec<Named>,
    /// Media outside of shapes, and where the file says so.
    outside: Vec<(Named, String)>,
    /// The same around cameras.
    cameras: Vec<(Named, String)>,
}

impl Media {
    /// Adds a medium whose coefficients are scaled by a factor; its number.
    pub(super) fn add(&mut self, medium: Medium, scale: f64, place: &str) -> Result<usize> {
        let g = medium.mean_cosine;
        if g.is_nan() || g.abs() >= 1.0 {
            let what = format!("g of a medium is {g}, not between -1 and 1");
            return Err(fault(place, what));
        }
        let scaled = Medium {
            absorption: scale as f32 * medium.absorption,
            scattering: scale as f32 * medium.scattering,
            ..medium
        };
        let least = scaled.absorption.min(scaled.scattering).min_element();
        let extinction = scaled.absorption + scaled.scattering;
        if !(least >= 0.0 && extinction.is_finite()) {
            let what = "coefficients of a medium, times its scale, are not numbers from 0 on";
            return Err(fault(place, what));
        }
        self.all.push(scaled);
        Ok(self.all.len() - 1)
    }
}

impl Context {
    /// Notes the medium around a camera.
    pub(super) fn camera_in(&mut self, medium: Named, place: &str) {
        self.media.cameras.push((medium, place.to_owned()));
    }

    /// Makes a material the boundary between media inside and outside of it.
    pub(super) fn bound(
        &mut self,
        material: &mut Material,
        [inside, outside]: [Named; 2],
        place: &str,
    ) -> Result<()> {
        if inside == outside {
            return Ok(());
        }
        if material.opacity == 0.0 {
            if material.emission != Rgb::ZERO {
                self.left_out(place, "light from a boundary of a medium that is not seen")?;
            }
            *material = looks::glass(1.0, looks::Paint::from(1.0), 0.0);
        }
        if !material.bounds_body() {
            // Nothing of a medium is seen behind what is opaque.
            return match material.transmission > 0.0 {
                true => self.left_out(place, "a medium behind a thin wall"),
                false => Ok(()),
            };
        }
        self.media.inside.push(inside);
        self.media.outside.push((outside, place.to_owned()));
        let medium = inside.map_or_else(Medium::default, |i| self.media.all[i]);
        material.medium = Some(Box::new(medium));
        Ok(())
    }

    /// Finds the medium of the whole scene.
    pub(super) fn fill_scene(&mut self, parts: &mut SceneParts) -> Result<()> {
        let media = std::mem::take(&mut self.media);
        let fills = |named: &Named| media.inside.contains(named);
        // The program shows the first camera; of several declarations in a pbrt file the last one counts.
        let shown = media.cameras.len().checked_sub(parts.cameras.len());
        let shown = shown.and_then(|shown| media.cameras.get(shown));
        // A medium that fills some body too may be the outer one as well, which the bodies around the camera tell.
        let around = shown
            .filter(|(named, _)| named.is_some() && fills(named))
            .and_then(|camera| media.beyond(camera, parts));
        let named = media.cameras.iter().chain(&media.outside);
        let outer = named.filter(|(named, _)| !fills(named));
        let mut outer = around.into_iter().chain(outer);
        let Some((first, _)) = outer.next() else {
            return Ok(());
        };
        if let Some((_, place)) = outer.find(|(named, _)| named != first) {
            self.left_out(place, "another medium outside of all bodies than elsewhere")?;
        }
        parts.medium = first.map(|i| media.all[i]);
        Ok(())
    }
}

impl Media {
    /// The medium outside of the outermost body with a medium around the first camera, or that of the camera itself where it is in none.
    fn beyond<'a>(
        &'a self,
        of_camera: &'a (Named, String),
        parts: &SceneParts,
    ) -> Option<&'a (Named, String)> {
        let ray = parts.cameras.first()?.ray(Vec2::splat(0.5), 1.0);
        let around = Scene::new(parts.clone()).bodies_around(&ray);
        let medium = |body: &u32| parts.materials[*body as usize].medium.as_deref();
        let Some(filling) = around.iter().rev().find_map(medium) else {
            return Some(of_camera);
        };
        let fills = |named: &Named| named.is_some_and(|i| self.all[i] == *filling);
        let boundary = self.inside.iter().position(fills)?;
        self.outside.get(boundary)
    }
}
