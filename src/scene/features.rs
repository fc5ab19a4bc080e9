//! Contents of a scene that require extra work of its paths, which they skip in scenes without them.

use super::{Material, Mesh, SceneParts};
use crate::math::Rgb;

/// Contents of a scene that require extra work of its paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Features {
    /// Bodies that absorb light.
    pub absorption: bool,
    /// Bodies that refract each colour channel by an index of its own.
    pub dispersion: bool,
    /// Bodies that overlap, touch, have priorities or only bound media: boundaries depend on the bodies around them.
    pub overlaps: bool,
    /// Bodies that touch.
    pub(super) touching: bool,
    /// Lobes that a rule can roughen.
    pub lobes: bool,
    /// Surfaces that show the camera only their front, or neither side.
    pub hidden_backs: bool,
}

impl Features {
    /// Features of materials and meshes. `overlaps` and `touching` stay false, since they need the trees.
    pub(super) fn of(parts: &SceneParts) -> Self {
        let materials = &parts.materials;
        let shown = |m: &Mesh| materials.get(m.material as usize);
        let sharp = |m: &Material| m.phase.is_some_and(|phase| phase.alpha() < 1.0);
        let rough = |m: &Mesh| shown(m).is_some_and(Material::is_rough);
        let front_only = |m: &Material| m.hides_back() || m.is_hidden();
        Self {
            absorption: materials.iter().any(|m| m.absorption != Rgb::ZERO),
            dispersion: (materials.iter()).any(|m| m.dispersion > 0.0 && m.bounds_body()),
            overlaps: false,
            touching: false,
            lobes: materials.iter().any(sharp) || parts.all_meshes().any(|m| !rough(m)),
            hidden_backs: parts.all_meshes().any(|m| shown(m).is_some_and(front_only)),
        }
    }
}
