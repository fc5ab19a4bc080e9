//! Lights, cameras and films of pbrt.

use super::super::{Role, film_side};
use super::tokens::Parameters;
use super::{Scene, affine};
use crate::build::sky;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use opsr::math::{Frame, Rgb, UVec2};
use opsr::scene::light::Falloff;
use opsr::scene::load::error::{Result, fault};
use opsr::scene::{Camera, Environment, FilmSize, Lens, Projection, PunctualLight};
use std::f64::consts::PI;

/// Factor that gives a light of scale 1 the power or illuminance of a parameter; 1 without the parameter. `own` is the
/// value for white light of unit intensity, irradiance or radiance. As in pbrt, `scale` and the values of an rgb colour
/// multiply the result, while other spectra are first scaled to a luminance of 1.
pub(super) fn wanted(parameters: &Parameters, name: &str, own: f64) -> Result<f64> {
    let wanted = parameters.number(name, -1.0)?;
    Ok(if wanted > 0.0 { wanted / own } else { 1.0 })
}

/// `scale` if it is a number, else 1.
pub(super) fn plain_scale(parameters: &Parameters) -> Result<f64> {
    match parameters.get("scale") {
        Some(given) if given.kind != "float" => Ok(1.0),
        _ => parameters.number("scale", 1.0),
    }
}

/// Columns of the rotation from Mitsuba's map, with +y at the top and −z at the left edge, to that of version 3, with
/// +z and +x there `[PBRT3 §12.6]`.
const OF_LAT_LONG: DMat3 = DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::NEG_X);

impl Scene<'_> {
    pub(super) fn light(&mut self, kind: &str, parameters: &Parameters) -> Result<()> {
        let place = &parameters.place;
        let pose = self.pose(place)?;
        let scale = plain_scale(parameters)?;
        let vector = |name: &str, or: [f64; 3]| parameters.vector(name, or).map(DVec3::from);
        let axis = |from: DVec3, to: DVec3| {
            let axis = pose.transform_vector3(to - from).try_normalize();
            axis.ok_or_else(|| fault(place, "has no direction"))
        };
        match kind {
            "point" | "goniometric" => {
                let mean = self.of_image(kind, parameters, "a point light of its mean")?;
                let scale = scale * wanted(parameters, "power", 4.0 * PI)?;
                let intensity = self.emitted(parameters, "I", scale)? * mean;
                let position = pose.transform_point3(vector("from", [0.0; 3])?);
                self.context.parts().lights.push(PunctualLight::Point {
                    position: position.as_vec3(),
                    intensity,
                    range: f32::INFINITY,
                });
            }
            "spot" | "projection" => {
                let mean = self.of_image(kind, parameters, "a spot light of its mean")?;
                let half = 0.5 * parameters.number("fov", 90.0)?;
                let cone = if kind == "projection" { half } else { 30.0 };
                let cone = parameters.number("coneangle", cone)?;
                let delta = parameters.number("conedeltaangle", 5.0f64.min(cone))?;
                if !(0.0 < cone && cone < 180.0 && 0.0 <= delta && delta <= cone) {
                    return Err(fault(
                        place,
                        "its angles are not 0 ≤ conedeltaangle ≤ coneangle",
                    ));
                }
                let (inner, outer) = ((cone - delta).to_radians().cos(), cone.to_radians().cos());
                let solid = 2.0 * PI * ((1.0 - inner) + 0.5 * (inner - outer));
                let scale = scale * wanted(parameters, "power", solid)?;
                let intensity = self.emitted(parameters, "I", scale)? * mean;
                let (from, to) = (vector("from", [0.0; 3])?, vector("to", [0.0, 0.0, 1.0])?);
                let direction = axis(from, to)?.as_vec3();
                self.context.parts().lights.push(PunctualLight::Spot {
                    position: pose.transform_point3(from).as_vec3(),
                    direction,
                    intensity,
                    range: f32::INFINITY,
                    cos_inner: inner as f32,
                    cos_outer: outer as f32,
                    falloff: Falloff::Smooth,
                });
            }
            "distant" => {
                let scale = scale * wanted(parameters, "illuminance", 1.0)?;
                let irradiance = self.emitted(parameters, "L", scale)?;
                let (from, to) = (vector("from", [0.0; 3])?, vector("to", [0.0, 0.0, 1.0])?);
                let direction = axis(from, to)?.as_vec3();
                self.context
                    .parts()
                    .lights
                    .push(PunctualLight::Directional {
                        direction,
                        irradiance,
                    });
            }
            "infinite" => return self.infinite(parameters, scale),
            other => return self.context.left_out(place, format!("light `{other}`")),
        }
        Ok(())
    }

    /// The mean of the image of a light that is shown without it; 1 for lights without an image.
    fn of_image(&mut self, kind: &str, parameters: &Parameters, shown: &str) -> Result<Rgb> {
        let place = &parameters.place;
        if kind == "point" || kind == "spot" {
            return Ok(Rgb::ONE);
        }
        (self.context).nearest(place, format!("the image of `{kind}`"), shown)?;
        let name = parameters.text("mapname")?.or(parameters.text("filename")?);
        let Some(name) = name.map(str::to_owned) else {
            return Ok(Rgb::ONE);
        };
        let map = self.context.radiance_map(&name, place)?;
        Ok(map.pixels.iter().sum::<Rgb>() / map.pixels.len().max(1) as f32)
    }

    /// The colour by which version 3 scales a light.
    pub(super) fn tint(&mut self, parameters: &Parameters) -> Result<Rgb> {
        match parameters.get("scale").is_some_and(|p| p.kind != "float") {
            true => self.colour(parameters, "scale", Rgb::ONE, Role::Emitted),
            false => Ok(Rgb::ONE),
        }
    }

    /// Colour of a light times a scale.
    fn emitted(&mut self, parameters: &Parameters, name: &str, scale: f64) -> Result<Rgb> {
        let tint = self.tint(parameters)? * scale as f32;
        let colour = self.colour(parameters, name, Rgb::ONE, Role::Emitted)? * tint;
        match colour.is_finite() {
            true => Ok(colour),
            false => Err(fault(&parameters.place, "a light that is not finite")),
        }
    }

    fn infinite(&mut self, parameters: &Parameters, scale: f64) -> Result<()> {
        let place = &parameters.place;
        let pose = self.pose(place)?;
        if parameters.get("portal").is_some() {
            self.context
                .approximate(place, "a portal only guides samples and is left out");
        }
        let older = parameters.text("mapname")?.map(str::to_owned);
        let file = parameters.text("filename")?.map(str::to_owned);
        let environment = match older.clone().or(file) {
            Some(_) if older.is_none() && parameters.get("L").is_some() => {
                return Err(fault(place, "has both `L` and a map"));
            }
            Some(name) => {
                let map = self.context.radiance_map(&name, place)?;
                let square = older.is_none() && map.width == map.height;
                if older.is_none() && !square {
                    let what = "a map that is not square (of equal areas)";
                    (self.context).nearest(place, what, "one by latitude and longitude")?;
                }
                let (projection, own) = match square {
                    true => (sky::Projection::EqualArea, DMat3::IDENTITY),
                    false => (sky::Projection::LatLongBetween, OF_LAT_LONG),
                };
                let light = match (parameters.get("illuminance"), square) {
                    (None, _) => 1.0,
                    (Some(_), true) => sky::illuminance(&map),
                    (Some(_), false) => 0.0,
                };
                if light <= 0.0 {
                    let what = "`illuminance` of a map that is dark above, or not square";
                    return Err(fault(place, what));
                }
                let scale = scale * wanted(parameters, "illuminance", light)?;
                let factor = self.emitted(parameters, "L", scale)?;
                sky::resampled(&map, projection, pose.matrix3 * own, factor)
            }
            None => {
                // The illuminance of a constant sky of radiance 1 is π.
                let scale = scale * wanted(parameters, "illuminance", PI)?;
                Environment::constant(self.emitted(parameters, "L", scale)?)
            }
        };
        let parts = self.context.parts();
        parts.environment = Some(match &parts.environment {
            Some(first) => first.plus(&environment),
            None => environment,
        });
        Ok(())
    }

    /// Multiplies all light by pbrt's imaging ratio: exposure time × ISO / 100 `[PBRT4 §5.4.2]`.
    pub(super) fn expose(&mut self) -> Result<()> {
        let empty = Parameters::default();
        let camera = self.camera.as_ref().map_or(&empty, |(_, camera, _)| camera);
        // Version 3 has no exposure.
        let open = match self.is_old {
            true => 1.0,
            false => camera.number("shutterclose", 1.0)? - camera.number("shutteropen", 0.0)?,
        };
        let Some(film) = &self.film else {
            return match open == 1.0 {
                true => Ok(()),
                false => self.context.brighten(open, &camera.place),
            };
        };
        let place = &film.place;
        let time = film.number("exposuretime", open)?;
        let ratio = time * film.number("iso", 100.0)? / 100.0;
        let sensor = film.text("sensor")?.unwrap_or("cie1931");
        if sensor != "cie1931" {
            let what = format!("sensor `{sensor}` is taken for the standard observer");
            self.context.approximate(place, &what);
        }
        for (name, or) in [("whitebalance", 0.0), ("maxcomponentvalue", f64::INFINITY)] {
            if film.number(name, or)? != or {
                let what = format!("`{name}` of the film is not taken");
                self.context.approximate(place, &what);
            }
        }
        self.context.brighten(ratio, place)
    }

    /// Adds the camera, with its film.
    pub(super) fn add_camera(&mut self) -> Result<()> {
        let Some((kind, parameters, matrix)) = self.camera.take() else {
            return Ok(());
        };
        let place = &parameters.place;
        let diagonal = match &self.film {
            Some(film) => film.number("diagonal", 35.0)?,
            None => 35.0,
        };
        if !(diagonal > 0.0 && diagonal.is_finite()) {
            let what = format!("the film has a diagonal of {diagonal} mm");
            return Err(fault(place, what));
        }
        let film = self.film_size()?;
        let pose = affine(&matrix, place)?;
        let own = f64::from(film.size.x) / f64::from(film.size.y);
        let [x0, x1, y0, y1] = screen_window(&parameters, own)?;
        let (half_x, half_y) = (0.5 * (x1 - x0), 0.5 * (y1 - y0));
        let shift = DVec2::new(x0 + x1, y0 + y1) / (2.0 * half_y);
        if (half_x / half_y / own - 1.0).abs() > 1e-3 {
            self.context
                .nearest(place, "pixels that are not square", "square ones")?;
        }
        let mut realistic = None;
        let projection = match kind.as_str() {
            "perspective" => {
                // Version 3 accepts half of the angle.
                let fov = match parameters.number("halffov", -1.0)? {
                    half if half > 0.0 => 2.0 * half,
                    _ => parameters.number("fov", 90.0)?,
                };
                if !(0.0 < fov && fov < 180.0) {
                    return Err(fault(place, format!("fov is {fov}, not between 0 and 180")));
                }
                let tan_half_y = ((0.5 * fov.to_radians()).tan() * half_y) as f32;
                Projection::Perspective { tan_half_y }
            }
            "orthographic" => {
                let half_height = (half_y * pose.matrix3.y_axis.length()) as f32;
                Projection::Orthographic { half_height }
            }
            "realistic" => {
                realistic = Some(self.realistic(&parameters)?);
                let [focal, _] = realistic.unwrap_or_default();
                Projection::Perspective {
                    tan_half_y: (0.5 * diagonal / focal / own.hypot(1.0)) as f32,
                }
            }
            other => return self.context.left_out(place, format!("camera `{other}`")),
        };
        let (Projection::Perspective { tan_half_y: height }
        | Projection::Orthographic {
            half_height: height,
        }) = projection;
        let shift = shift.as_vec2();
        if !(height > 0.0 && height.is_finite() && shift.is_finite()) {
            return Err(fault(place, "has no picture of a finite size"));
        }
        let [radius, focus] = match realistic {
            None => [
                parameters.number("lensradius", 0.0)?,
                parameters.number("focaldistance", 1e6)?,
            ],
            // Version 3 gives millimetres; a unit is a metre.
            Some([_, radius]) => [1e-3 * radius, parameters.number("focusdistance", 10.0)?],
        };
        let (radius, focus) = (radius as f32, focus as f32);
        let frame = frame(&pose, place)?;
        self.context.parts().cameras.push(Camera {
            name: "camera".into(),
            position: pose.translation.as_vec3(),
            frame,
            projection,
            shift,
            aspect: Some(own as f32),
            lens: (radius > 0.0 && focus > 0.0).then_some(Lens { radius, focus }),
            film: Some(film),
        });
        Ok(())
    }

    /// Focal length of a lens and radius of its entrance pupil, in millimetres, by a paraxial ray `[PBRT4 §5.4]`.
    fn realistic(&mut self, parameters: &Parameters) -> Result<[f64; 2]> {
        let place = &parameters.place;
        let shown = "a perspective one of its focal length";
        (self.context).nearest(place, "camera `realistic`", shown)?;
        let name = parameters.text("lensfile")?;
        let name = name.ok_or_else(|| fault(place, "has no lensfile"))?;
        let bad = || fault(place, format!("{name}: no lens of rows of four numbers"));
        let (_, bytes) = self.context.files.open(name, place)?;
        let text = String::from_utf8_lossy(&bytes);
        let words = (text.lines()).flat_map(|line| {
            let line = line.split('#').next().unwrap_or_default();
            line.split_whitespace()
        });
        let numbers: Option<Vec<f64>> = words.map(|word| word.parse().ok()).collect();
        let numbers = numbers.filter(|n| n.len() % 4 == 0).ok_or_else(bad)?;
        let (mut height, mut slope, mut index, mut pupil) = (1.0, 0.0, 1.0, f64::INFINITY);
        for row in numbers.chunks_exact(4) {
            let [curvature, thickness, eta, aperture] = [row[0], row[1], row[2], row[3]];
            if curvature == 0.0 {
                // The aperture stop, which the parameter may narrow.
                let open = parameters.number("aperturediameter", 1.0)?.min(aperture);
                pupil = (0.5 * open / height).abs();
            } else {
                let next = if eta == 0.0 { 1.0 } else { eta };
                slope = (index * slope - height * (next - index) / curvature) / next;
                index = next;
            }
            height += thickness * slope;
        }
        let focal = -1.0 / slope;
        match (1e-3..1e6).contains(&focal) && pupil.is_finite() {
            true => Ok([focal, pupil]),
            false => Err(bad()),
        }
    }

    fn film_size(&mut self) -> Result<FilmSize> {
        let Some(film) = self.film.take() else {
            return Ok(FilmSize {
                size: UVec2::new(1280, 720),
                crop: None,
            });
        };
        let place = &film.place;
        let side = |name: &str, or: f64| film_side(name, film.number(name, or)?, place);
        let size = UVec2::new(side("xresolution", 1280.0)?, side("yresolution", 720.0)?);
        let [w, h] = [f64::from(size.x), f64::from(size.y)];
        let part = match (film.numbers("cropwindow")?, film.numbers("pixelbounds")?) {
            (Some([a, b, c, d]), _) => Some([a * w, b * w, c * h, d * h].map(f64::ceil)),
            (_, Some([a, b, c, d])) => Some([*a, *b, *c, *d]),
            (None, None) => None,
            _ => return Err(fault(place, "the crop is not four numbers")),
        };
        let crop = match part {
            None => None,
            Some([x0, x1, y0, y1]) => {
                let inside = 0.0 <= x0 && x0 < x1 && x1 <= w && 0.0 <= y0 && y0 < y1 && y1 <= h;
                if !inside {
                    return Err(fault(place, "the crop is not within the film"));
                }
                let whole = [x0, x1, y0, y1] == [0.0, w, 0.0, h];
                (!whole).then_some([x0, y0, x1 - x0, y1 - y0].map(|n| n as u32))
            }
        };
        Ok(FilmSize { size, crop })
    }
}

/// Left, right, lower and upper bound of the picture on the plane at distance 1, for a frame of aspect `own`.
fn screen_window(parameters: &Parameters, own: f64) -> Result<[f64; 4]> {
    let place = &parameters.place;
    let aspect = parameters.number("frameaspectratio", own)?;
    // The shorter axis has [−1, 1].
    let default = match aspect > 1.0 {
        true => [-aspect, aspect, -1.0, 1.0],
        false => [-1.0, 1.0, -1.0 / aspect, 1.0 / aspect],
    };
    let window = match parameters.numbers("screenwindow")? {
        None => default,
        Some([a, b, c, d]) => [*a, *b, *c, *d],
        Some(_) => return Err(fault(place, "screenwindow is not four numbers")),
    };
    let [x0, x1, y0, y1] = window;
    let is_sized = x0 < x1 && y0 < y1 && aspect > 0.0 && aspect.is_finite();
    if !is_sized {
        return Err(fault(place, "a screen window without area"));
    }
    Ok(window)
}

/// The axes of a camera of this pose; fails if the pose is singular.
fn frame(pose: &DAffine3, place: &str) -> Result<Frame> {
    let m = pose.matrix3;
    let axis = |v: DVec3| {
        v.try_normalize()
            .ok_or_else(|| fault(place, "has no direction"))
    };
    let n = -axis(m.z_axis)?;
    let t = axis(m.y_axis - n * n.dot(m.y_axis))?;
    // +x is to the right, also for mirroring poses.
    let s = t.cross(n);
    let s = s * s.dot(m.x_axis).signum();
    Ok(Frame {
        s: s.as_vec3(),
        t: t.as_vec3(),
        n: n.as_vec3(),
    })
}
