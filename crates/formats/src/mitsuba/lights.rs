//! Emitters and sensors of Mitsuba.

use super::super::{Role, film_side};
use super::Scene;
use super::xml::{Object, Value};
use crate::build::looks::Paint;
use crate::build::sky;
use glam::{DAffine3, DVec3};
use opsr::math::{Frame, Rgb, UVec2, Vec2, Vec3};
use opsr::scene::light::Falloff;
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{Camera, Environment, FilmSize, Lens, Projection, PunctualLight};
use std::f32::consts::PI;

/// Irradiance perpendicular to Mitsuba's sun at scale 1, turbidity 3 and a height of 40° (`skies_by_mitsuba.py`).
const SUN: Rgb = Rgb::new(1.446, 1.175, 0.845);

impl Scene<'_> {
    pub(super) fn emitter(&mut self, emitter: &Object) -> Result<()> {
        let place = &emitter.place;
        let pose = emitter.pose("to_world")?;
        let axis = || {
            let axis = pose.transform_vector3(DVec3::Z).try_normalize();
            axis.ok_or_else(|| fault(place, "has no direction"))
        };
        match emitter.plugin.as_str() {
            "point" => {
                let position = emitter.vector("position", pose.translation)?.as_vec3();
                let intensity = self.colour(emitter, &["intensity"], Rgb::ONE, Role::Emitted)?;
                self.context.parts().lights.push(PunctualLight::Point {
                    position,
                    intensity,
                    range: f32::INFINITY,
                });
            }
            "spot" => {
                let spot = self.spot(emitter, pose.translation, axis()?)?;
                self.context.parts().lights.push(spot);
            }
            "projector" => {
                let projector = self.projector(emitter, pose.translation, axis()?)?;
                self.context.parts().lights.push(projector);
            }
            "directional" | "distant" => {
                let irradiance = self.colour(
                    emitter,
                    &["irradiance", "radiance"],
                    Rgb::ONE,
                    Role::Emitted,
                )?;
                let direction = match emitter.property("direction") {
                    Some(_) => emitter.vector("direction", DVec3::Z)?.try_normalize(),
                    None => Some(axis()?),
                };
                let direction = direction.ok_or_else(|| fault(place, "has no direction"))?;
                self.context
                    .parts()
                    .lights
                    .push(PunctualLight::Directional {
                        direction: direction.as_vec3(),
                        irradiance,
                    });
            }
            "constant" => {
                let radiance = self.colour(emitter, &["radiance"], Rgb::ONE, Role::Emitted)?;
                self.surround(Environment::constant(radiance), place)?;
            }
            "envmap" => {
                let name = emitter.text("filename")?;
                let name = name.ok_or_else(|| fault(place, "has no filename"))?;
                let map = self.context.radiance_map(name, place)?;
                let scale = Rgb::splat(emitter.number("scale", 1.0)? as f32);
                let turn = pose.matrix3;
                let made = sky::resampled(&map, sky::Projection::LatLong, turn, scale);
                self.surround(made, place)?;
            }
            "sunsky" | "sky" | "sun" => self.sky(emitter, &pose)?,
            other => self.context.left_out(place, format!("emitter `{other}`"))?,
        }
        Ok(())
    }

    /// Sun and sky, by this project's model.
    fn sky(&mut self, emitter: &Object, pose: &DAffine3) -> Result<()> {
        let place = &emitter.place;
        let what = format!("`{}` is shown by Preetham's model", emitter.plugin);
        self.context.approximate(place, &what);
        // Mitsuba 3 has the zenith at +z, its predecessor at +y.
        let zenith = if self.is_old { DVec3::Y } else { DVec3::Z };
        let low = DVec3::new(0.5, 0.5, 0.5) + 0.5 * zenith;
        let sun = emitter.vector("sun_direction", low)?.try_normalize();
        let sun = sun.ok_or_else(|| fault(place, "its sun has no direction"))?;
        let [sun, zenith] = [sun, zenith].map(|v| pose.transform_vector3(v).normalize_or(DVec3::Y));
        let turbidity = emitter.number("turbidity", 3.0)?.clamp(1.8, 10.0) as f32;
        let scale = emitter.number("scale", 1.0)?;
        let of_sun = scale * emitter.number("sun_scale", 1.0)?;
        let of_sky = scale * emitter.number("sky_scale", 1.0)?;
        if emitter.plugin == "sun" {
            self.context
                .parts()
                .lights
                .push(PunctualLight::Directional {
                    direction: (-sun).as_vec3(),
                    irradiance: SUN * of_sun as f32,
                });
            return Ok(());
        }
        let of_sun = if emitter.plugin == "sky" { 0.0 } else { of_sun };
        let made = sky::around(sun, zenith, turbidity, [of_sky, of_sun]);
        self.surround(made, place)
    }

    fn spot(
        &mut self,
        emitter: &Object,
        position: DVec3,
        direction: DVec3,
    ) -> Result<PunctualLight> {
        let place = &emitter.place;
        let intensity = self.colour(emitter, &["intensity"], Rgb::ONE, Role::Emitted)?;
        if !self.children(emitter, &["texture"])?.is_empty() {
            self.context
                .nearest(place, "the texture of a spot light", "a spot of one colour")?;
        }
        let cutoff = emitter.number("cutoff_angle", 20.0)?;
        let beam = emitter.number("beam_width", 0.75 * cutoff)?;
        if !(0.0 < cutoff && cutoff < 180.0 && 0.0 <= beam && beam <= cutoff) {
            let what = "its angles are not 0 ≤ beam_width ≤ cutoff_angle";
            return Err(fault(place, what));
        }
        Ok(PunctualLight::Spot {
            position: position.as_vec3(),
            direction: direction.as_vec3(),
            intensity,
            range: f32::INFINITY,
            cos_inner: beam.to_radians().cos() as f32,
            cos_outer: cutoff.to_radians().cos() as f32,
            falloff: Falloff::Linear,
        })
    }

    /// A projector as a spot light of its mean and its image's area: on a plane in front each has π times `irradiance`.
    fn projector(
        &mut self,
        emitter: &Object,
        position: DVec3,
        direction: DVec3,
    ) -> Result<PunctualLight> {
        let shown = "a spot light of its mean";
        (self.context).nearest(&emitter.place, "the image of `projector`", shown)?;
        let white = Paint::plain(Rgb::ONE);
        let paint = self.paint_of(emitter, &["irradiance"], white, Role::Emitted)?;
        let builder = &self.context.builder;
        let aspect = paint.map.map_or(1.0, |map| {
            let image = &builder.parts.textures[map.texture as usize];
            image.width as f32 / image.height as f32
        });
        let scale = PI * emitter.number("scale", 1.0)? as f32;
        let intensity = builder.mean(paint) * scale;
        let half_y = self.fov(emitter, aspect)?;
        let cos = (1.0 + 4.0 / PI * aspect * half_y * half_y).sqrt().recip();
        Ok(PunctualLight::Spot {
            position: position.as_vec3(),
            direction: direction.as_vec3(),
            intensity,
            range: f32::INFINITY,
            cos_inner: cos,
            cos_outer: cos,
            falloff: Falloff::Linear,
        })
    }

    fn surround(&mut self, environment: Environment, place: &str) -> Result<()> {
        if self.context.parts().environment.is_some() {
            return Err(fault(place, "a second environment"));
        }
        self.context.parts().environment = Some(environment);
        Ok(())
    }

    pub(super) fn sensor(&mut self, sensor: &Object) -> Result<()> {
        let place = &sensor.place;
        let matrix = sensor.matrix("to_world")?;
        let pose = super::affine(&matrix, place)?;
        let film = match self.children(sensor, &["film"])?.first() {
            Some((_, film)) => self.film(&film.clone())?,
            None => FilmSize {
                size: UVec2::new(768, 576),
                crop: None,
            },
        };
        let aspect = film.size.x as f32 / film.size.y as f32;
        // Offsets in widths and heights of the film, to the right and down.
        let right = sensor.number("principal_point_offset_x", 0.0)? as f32;
        let down = sensor.number("principal_point_offset_y", 0.0)? as f32;
        let shift = 2.0 * Vec2::new(right * aspect, -down);
        if !shift.is_finite() {
            return Err(fault(place, "a principal point that is not finite"));
        }
        // Mitsuba's defaults are 0.01 and 10,000.
        if sensor.number("near_clip", 0.0)? > 0.01 || sensor.number("far_clip", 1e9)? < 10_000.0 {
            let what = "`near_clip` and `far_clip` are not taken: all is seen";
            self.context.approximate(place, what);
        }
        let (projection, lens) = match sensor.plugin.as_str() {
            "perspective" | "thinlens" => {
                let tan_half_y = self.fov(sensor, aspect)?;
                let lens = (sensor.plugin == "thinlens").then_some(());
                let lens = match lens {
                    None => None,
                    Some(()) => Some(Lens {
                        radius: sensor.number("aperture_radius", 0.0)? as f32,
                        focus: sensor.number("focus_distance", 10_000.0)? as f32,
                    }),
                };
                (Projection::Perspective { tan_half_y }, lens)
            }
            "orthographic" => {
                let [x, y] = [pose.matrix3.x_axis, pose.matrix3.y_axis].map(DVec3::length);
                if (x / y - 1.0).abs() > 1e-3 {
                    let what = "pixels that are not square";
                    self.context.nearest(place, what, "square ones")?;
                }
                let half_height = y as f32 / aspect;
                (Projection::Orthographic { half_height }, None)
            }
            other => {
                return self.context.left_out(place, format!("sensor `{other}`"));
            }
        };
        let [inside, around] = self.sides(sensor)?;
        self.context.camera_in(around.or(inside), place);
        let frame = frame(&pose).ok_or_else(|| fault(place, "has no direction"))?;
        let name = match sensor.id.is_empty() {
            true => format!("camera {}", self.context.parts().cameras.len()),
            false => sensor.id.clone(),
        };
        self.context.parts().cameras.push(Camera {
            name,
            position: pose.translation.as_vec3(),
            frame,
            projection,
            shift,
            aspect: Some(aspect),
            lens: lens.filter(|lens| lens.radius > 0.0 && lens.focus > 0.0),
            film: Some(film),
        });
        Ok(())
    }

    fn film(&mut self, film: &Object) -> Result<FilmSize> {
        let place = &film.place;
        let side = |name: &str, or: f64| film_side(name, film.number(name, or)?, place);
        let size = UVec2::new(side("width", 768.0)?, side("height", 576.0)?);
        let at = |name: &str, or: u32| film.number(name, or.into()).map(|n| n.max(0.0) as u32);
        let crop = [
            at("crop_offset_x", 0)?,
            at("crop_offset_y", 0)?,
            at("crop_width", size.x)?,
            at("crop_height", size.y)?,
        ];
        let inside =
            |at: u32, n: u32, side: u32| n > 0 && at.checked_add(n).is_some_and(|end| end <= side);
        if !inside(crop[0], crop[2], size.x) || !inside(crop[1], crop[3], size.y) {
            return Err(fault(place, "the crop is not within the film"));
        }
        let whole = crop == [0, 0, size.x, size.y];
        Ok(FilmSize {
            size,
            crop: (!whole).then_some(crop),
        })
    }

    /// Tangent of half the vertical field of view.
    fn fov(&mut self, sensor: &Object, aspect: f32) -> Result<f32> {
        let place = &sensor.place;
        let aspect = f64::from(aspect);
        let focal = sensor.property("focal_length").map(|p| &p.value);
        let focal = match focal {
            Some(Value::Text(focal)) => {
                let number: Option<f64> = focal.trim().trim_end_matches("mm").trim().parse().ok();
                let length = number.filter(|f| *f > 0.0);
                Some(length.ok_or_else(|| fault(place, "focal_length is no length"))?)
            }
            // Mitsuba's default, without either property.
            _ => sensor.property("fov").is_none().then_some(50.0),
        };
        if let Some(focal) = focal {
            // Half the diagonal of a film of 36 by 24 mm, over the focal length.
            let half_diagonal = 0.5 * 36f64.hypot(24.0) / focal;
            return Ok((half_diagonal / aspect.hypot(1.0)) as f32);
        }
        let fov = sensor.number("fov", 0.0)?;
        if !(0.0 < fov && fov < 180.0) {
            return Err(fault(place, format!("fov is {fov}, not between 0 and 180")));
        }
        let tan = (0.5 * fov.to_radians()).tan();
        let by = |axis: &str| match axis {
            "x" => Some(tan / aspect),
            "y" => Some(tan),
            "diagonal" => Some(tan / aspect.hypot(1.0)),
            "smaller" => Some(if aspect > 1.0 { tan } else { tan / aspect }),
            "larger" => Some(if aspect > 1.0 { tan / aspect } else { tan }),
            _ => None,
        };
        let axis = sensor.text("fov_axis")?.unwrap_or("x");
        let found = by(axis).ok_or_else(|| fault(place, format!("fov_axis `{axis}`")))?;
        Ok(found as f32)
    }
}

/// The frame of a sensor that looks along +z, with +x to its left. A mirroring pose mirrors the image.
fn frame(pose: &DAffine3) -> Option<Frame> {
    let m = pose.matrix3;
    let n = -m.z_axis.try_normalize()?;
    let t = (m.y_axis - n * n.dot(m.y_axis)).try_normalize()?;
    let s = t.cross(n) * if m.determinant() < 0.0 { -1.0 } else { 1.0 };
    let [s, t, n]: [Vec3; 3] = [s, t, n].map(|v| v.as_vec3());
    Some(Frame { s, t, n })
}
