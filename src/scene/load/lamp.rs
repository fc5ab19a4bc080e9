//! Lamps of modelling programs as surfaces, described by the `extras` of a material.

use super::error::Warnings;
use crate::math::Vec3;
use crate::scene::lamp::{Cone, Lamp};
use gltf::json::{self, Material};
use serde::Deserialize;

#[derive(Deserialize)]
struct Extras {
    #[serde(default)]
    lamp: Option<json::Value>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct LampExtras {
    #[serde(default)]
    hidden: bool,
    cone: Option<ConeExtras>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ConeExtras {
    direction: [f32; 3],
    cos_inner: f32,
    cos_outer: f32,
}

/// The property `lamp` of a material's `extras`; an invalid one is ignored with a warning.
pub(super) fn lamp(material: &Material, at: &str, warnings: &mut Warnings) -> Option<Lamp> {
    let extras: Extras = json::deserialize::from_str(material.extras.as_ref()?.get()).ok()?;
    let read = json::deserialize::from_value::<LampExtras>(extras.lamp?);
    let lamp = read.map_err(|e| e.to_string()).and_then(checked);
    lamp.map_err(|what| warnings.say(format!("{at}: extras.lamp is ignored: {what}")))
        .ok()
}

fn checked(read: LampExtras) -> Result<Lamp, String> {
    let cone = read.cone.map(|cone| {
        let direction = Vec3::from(cone.direction).try_normalize();
        let direction = direction.ok_or("cone.direction has no length")?;
        let [outer, inner] = [cone.cos_outer, cone.cos_inner];
        // False also for NaN.
        let ordered = (-1.0..inner).contains(&outer) && inner <= 1.0;
        if !ordered {
            return Err("cosOuter and cosInner are not -1 ≤ cosOuter < cosInner ≤ 1");
        }
        Ok(Cone {
            direction,
            cos_inner: inner,
            cos_outer: outer,
        })
    });
    Ok(Lamp {
        hidden: read.hidden,
        cone: cone.transpose()?,
    })
}
