//! Media of other renderers: a boundary names the media on its two sides.
//!
//! A boundary with the same medium on both sides, or with none, does not concern media. A path tracks the bodies around
//! it, and these determine the medium outside of a shape. So only the medium of the whole scene must be found: one
//! around the camera or outside of a shape that fills no shape. If a shape has the camera's medium too, the bodies
//! around the camera decide.

use super::{Context, Material, Medium};
use crate::build::looks;
use opsr::math::{Rgb, Vec2};
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{Scene, SceneParts};

/// Index of a medium of a file; `None` for a vacuum.
pub(super) type Named = Option<usize>;

/// Media of a file, and the sides of its boundaries so far.
#[derive(Default)]
pub(super) struct Media {
    all: Vec<Medium>,
    inside: Vec<Named>,
    /// Media outside of shapes, each with its place in the file.
    outside: Vec<(Named, String)>,
    /// Media around cameras, each with its place in the file.
    cameras: Vec<(Named, String)>,
}

impl Media {
    /// Adds a medium with its coefficients scaled by a factor; returns its index.
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
    /// Records the medium around a camera.
    pub(super) fn camera_in(&mut self, medium: Named, place: &str) {
        self.media.cameras.push((medium, place.to_owned()));
    }

    /// Makes a material the boundary between a medium inside and one outside.
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
            // A medium behind an opaque surface is invisible.
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
        // The program shows the first camera; of several declarations in a pbrt file only the last one becomes a
        // camera.
        let shown = media.cameras.len().checked_sub(parts.cameras.len());
        let shown = shown.and_then(|shown| media.cameras.get(shown));
        // A medium that fills a body may also be that of the whole scene: the bodies around the camera decide.
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
    /// The medium outside of the outermost body with a medium around the first camera, or else the camera's.
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
