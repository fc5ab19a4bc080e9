//! Cameras and lights without area.

use super::error::{Result, Warnings, fault, place};
use super::nodes::PlacedNode;
use crate::math::{Frame, Rgb, Vec2, Vec3};
use crate::scene::camera::Projection;
use crate::scene::{Camera, Lens, PunctualLight};
use gltf::json::Root;
use gltf::json::camera::Type as CameraType;
use gltf::json::extensions::scene::khr_lights_punctual::{Light, Type as Kind};
use gltf::json::validation::Checked;
use std::f32::consts::{FRAC_PI_2, PI};

/// The cameras of the nodes, in the order of the file's cameras.
pub(super) fn cameras(
    root: &Root,
    nodes: &[PlacedNode<'_>],
    warnings: &mut Warnings,
) -> Result<Vec<Camera>> {
    let mut cameras = Vec::new();
    for placed in nodes {
        let Some(index) = placed.node.camera.map(|c| c.value()) else {
            continue;
        };
        let Some(camera) = root.cameras.get(index) else {
            return Err(fault(
                &placed.place,
                format!("cameras[{index}] does not exist"),
            ));
        };
        let at = place("cameras", index, camera.name.as_ref());
        let (projection, aspect) = projection(camera, &at)?;
        let Some(mut frame) = upright(placed) else {
            warnings.say(format!(
                "{}: its camera has no direction and is ignored",
                placed.place
            ));
            continue;
        };
        // Negative magnifications mirror the picture.
        if let (Projection::Orthographic { .. }, Some(lens)) = (projection, &camera.orthographic) {
            (frame.s, frame.t) = (frame.s * lens.xmag.signum(), frame.t * lens.ymag.signum());
        }
        let name = placed.node.name.clone().or_else(|| camera.name.clone());
        cameras.push((
            index,
            Camera {
                name: name.unwrap_or_else(|| format!("camera {index}")),
                position: placed.pose.translation.as_vec3(),
                frame,
                projection,
                shift: Vec2::ZERO,
                aspect,
                lens: lens(camera, &at, warnings),
                film: None,
            },
        ));
    }
    cameras.sort_by_key(|(index, _)| *index);
    Ok(cameras.into_iter().map(|(_, camera)| camera).collect())
}

fn projection(camera: &gltf::json::Camera, at: &str) -> Result<(Projection, Option<f32>)> {
    let positive = |x: f32, name: &str| match x.is_finite() && x > 0.0 {
        true => Ok(x),
        false => Err(fault(at, format!("{name} is {x}, not a positive number"))),
    };
    match (&camera.type_, &camera.perspective, &camera.orthographic) {
        (Checked::Valid(CameraType::Perspective), Some(lens), _) => {
            let yfov = positive(lens.yfov, "yfov")?;
            if yfov >= PI {
                return Err(fault(at, format!("yfov is {yfov}, not below π")));
            }
            let aspect = lens
                .aspect_ratio
                .map(|a| positive(a, "aspectRatio"))
                .transpose()?;
            let tan_half_y = (0.5 * yfov).tan();
            Ok((Projection::Perspective { tan_half_y }, aspect))
        }
        (Checked::Valid(CameraType::Orthographic), _, Some(lens)) => {
            let half_height = positive(lens.ymag.abs(), "|ymag|")?;
            let half_width = positive(lens.xmag.abs(), "|xmag|")?;
            let aspect = positive(half_width / half_height, "|xmag / ymag|")?;
            Ok((Projection::Orthographic { half_height }, Some(aspect)))
        }
        _ => Err(fault(at, "lacks the properties of its type")),
    }
}

/// Lens in a camera's `extras`: custom properties of the camera's data in Blender.
#[derive(Default, serde::Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct LensExtras {
    /// In world units.
    aperture_radius: Option<f32>,
    fstop: Option<f32>,
    /// In millimetres.
    focal_length: Option<f32>,
    /// In world units.
    focus_distance: Option<f32>,
}

/// Half the height in millimetres of the film assumed for an f-number without a focal length.
const HALF_FILM: f32 = 12.0;

/// The lens of a camera, of the given radius or of radius f/(2 N) by focal length and f-number, with metres as world
/// units. Without a focal length, the film is taken to be 24 mm high.
fn lens(camera: &gltf::json::Camera, at: &str, warnings: &mut Warnings) -> Option<Lens> {
    let extras = camera.extras.as_ref()?;
    let extras: LensExtras = gltf::json::deserialize::from_str(extras.get()).unwrap_or_default();
    let yfov = camera.perspective.as_ref().map(|p| p.yfov);
    let focal_length = extras
        .focal_length
        .or(yfov.map(|yfov| HALF_FILM / (0.5 * yfov).tan()));
    let by_number = || Some(1e-3 * focal_length? / (2.0 * extras.fstop?));
    let radius = extras.aperture_radius.or_else(by_number)?;
    let focus = extras.focus_distance.unwrap_or(0.0);
    let good = |x: f32| x.is_finite() && x > 0.0;
    if good(radius) && good(focus) {
        return Some(Lens { radius, focus });
    }
    if radius != 0.0 {
        warnings.say(format!(
            "{at}.extras: a lens of radius {radius} with focusDistance {focus} is ignored"
        ));
    }
    None
}

/// The axes of a node's pose without scale and mirroring `[glTF §3.10.1]`; `None` if the pose is singular.
fn upright(placed: &PlacedNode<'_>) -> Option<Frame> {
    let m = placed.pose.matrix3;
    let n = m.z_axis.try_normalize()?;
    let s = m.y_axis.cross(n).try_normalize()?;
    Some(Frame {
        s: s.as_vec3(),
        t: n.cross(s).as_vec3(),
        n: n.as_vec3(),
    })
}

/// The lights of the nodes.
pub(super) fn lights(
    root: &Root,
    nodes: &[PlacedNode<'_>],
    warnings: &mut Warnings,
) -> Result<Vec<PunctualLight>> {
    let all = (root.extensions.as_ref()).and_then(|e| e.khr_lights_punctual.as_ref());
    let all = all.map_or(&[][..], |l| &l.lights);
    let mut lights = Vec::new();
    for placed in nodes {
        let light = (placed.node.extensions.as_ref()).and_then(|e| e.khr_lights_punctual.as_ref());
        let Some(index) = light.map(|l| l.light.value()) else {
            continue;
        };
        let Some(light) = all.get(index) else {
            return Err(fault(
                &placed.place,
                format!("light {index} does not exist"),
            ));
        };
        let at = place(
            "extensions.KHR_lights_punctual.lights",
            index,
            light.name.as_ref(),
        );
        let direction = -placed.pose.matrix3.z_axis;
        match direction.try_normalize() {
            None if !matches!(light.type_, Checked::Valid(Kind::Point)) => {
                warnings.say(format!(
                    "{}: its light has no direction and is ignored",
                    placed.place
                ));
            }
            direction => {
                let direction = direction.unwrap_or_default().as_vec3();
                let position = placed.pose.translation.as_vec3();
                lights.push(punctual(light, position, direction, &at)?);
            }
        }
    }
    Ok(lights)
}

/// A light in the world; candela and lux are taken as W/sr and W/m².
fn punctual(light: &Light, position: Vec3, direction: Vec3, at: &str) -> Result<PunctualLight> {
    let power = Rgb::from(light.color) * light.intensity;
    if !power.is_finite() || power.min_element() < 0.0 {
        let what = "color times intensity is negative or not finite";
        return Err(fault(at, what));
    }
    let range = light.range.unwrap_or(f32::INFINITY);
    if range.is_nan() || range <= 0.0 {
        return Err(fault(at, format!("range is {range}, not above 0")));
    }
    match light.type_ {
        Checked::Valid(Kind::Point) => Ok(PunctualLight::Point {
            position,
            intensity: power,
            range,
        }),
        Checked::Valid(Kind::Directional) => Ok(PunctualLight::Directional {
            direction,
            irradiance: power,
        }),
        Checked::Valid(Kind::Spot) => {
            let (inner, outer) = (light.spot.as_ref()).map_or((0.0, PI / 4.0), |s| {
                (s.inner_cone_angle, s.outer_cone_angle)
            });
            // A right angle, rounded by a writer, may come out a bit wider.
            let right = (0.0..=outer).contains(&inner) && outer <= FRAC_PI_2 + 1e-4 && outer > 0.0;
            if !right {
                let what =
                    format!("cone angles {inner} and {outer} are not 0 ≤ inner ≤ outer ≤ π/2");
                return Err(fault(at, what));
            }
            Ok(PunctualLight::Spot {
                position,
                direction,
                intensity: power,
                range,
                cos_inner: inner.cos(),
                cos_outer: outer.cos(),
                falloff: Default::default(),
            })
        }
        Checked::Invalid => Err(fault(at, "unknown type")),
    }
}
