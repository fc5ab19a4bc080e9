//! Shading normals: normal maps, and limits on how far a normal leans away from the surface.

use super::Texture;
use super::material::TextureRef;
use super::mesh::mix;
use crate::math::{Vec2, Vec3, Vec4};

/// The normal map's direction in tangent space, not yet normalised `[glTF §3.9.3]`.
pub(super) fn normal_texel(textures: &[Texture], map: &TextureRef, uv: Vec2, scale: f32) -> Vec3 {
    let at = map.transform.transform_point2(uv);
    let [x, y, z, _] =
        (textures.get(map.texture as usize)).map_or([0.5, 0.5, 1.0, 1.0], |t| t.sample(at));
    (2.0 * Vec3::new(x, y, z) - 1.0) * Vec3::new(scale, scale, 1.0)
}

/// Tangent and handedness: the mesh's own, or along u. The map's green channel points up, against v `[glTF §3.9.3]`.
pub(super) fn tangent(
    own: Option<[Vec4; 3]>,
    uvs: Option<[Vec2; 3]>,
    weights: &[f32; 3],
    edges: [Vec3; 2],
    map: &TextureRef,
    ns: Vec3,
) -> Option<(Vec3, f32)> {
    if let Some(t) = own {
        return Some((mix(weights, t).truncate(), t[0].w));
    }
    along_u(uvs?.map(|uv| map.transform.transform_point2(uv)), edges, ns)
}

/// Direction in which u of a triangle's corners grows, and the handedness; `None` where the coordinates span no area.
pub(super) fn along_u([a, b, c]: [Vec2; 3], edges: [Vec3; 2], ns: Vec3) -> Option<(Vec3, f32)> {
    let (d, e) = (b - a, c - a);
    let det = d.perp_dot(e);
    let along_u = (edges[0] * e.y - edges[1] * d.y) * det;
    let along_v = (edges[1] * d.x - edges[0] * e.x) * det;
    let hand = if ns.cross(along_u).dot(along_v) > 0.0 {
        -1.0
    } else {
        1.0
    };
    (det != 0.0).then_some((along_u, hand))
}

/// `ns` perturbed by a normal map's direction `local` in tangent space.
pub(super) fn perturbed(ns: Vec3, tangent: Vec3, hand: f32, local: Vec3) -> Vec3 {
    let Some(t) = (tangent - ns * ns.dot(tangent)).try_normalize() else {
        return ns;
    };
    let b = hand * ns.cross(t);
    let n = local.x * t + local.y * b + local.z * ns;
    n.try_normalize().unwrap_or(ns)
}

/// Lifts a shading normal that points below the surface to just above it.
#[inline]
pub(super) fn lifted(ns: Vec3, ng: Vec3) -> Vec3 {
    let below = ns.dot(ng);
    if below < 0.0 {
        (ns + (1e-3 - below) * ng).try_normalize().unwrap_or(ng)
    } else {
        ns
    }
}

/// Bends a shading normal on the side of `ng` towards `ng`, just so far that `w` sees the same side of both. The same
/// for `w` and `-w`.
#[inline]
pub(super) fn bent(ns: Vec3, ng: Vec3, w: Vec3) -> Vec3 {
    let cos = w.dot(ng);
    let w = if cos < 0.0 { -w } else { w };
    let (cos_g, cos_s) = (cos.abs(), w.dot(ns));
    let least = (0.5 * cos_g).min(1e-3);
    if cos_s >= least {
        return ns;
    }
    // w·(ns + k ng) = least.
    let k = (least - cos_s) / cos_g;
    (ns + k * ng).try_normalize().unwrap_or(ng)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Texture coordinates and edges of a triangle facing +z whose u runs along `u` and whose v runs along `v`.
    fn mapped(u: Vec2, v: Vec2) -> ([Vec2; 3], [Vec3; 2]) {
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::Y].map(|p| Vec2::new(p.dot(u), p.dot(v)));
        (uvs, [Vec3::X, Vec3::Y])
    }

    #[test]
    fn normal_map_red_points_along_u_and_green_against_v() {
        let map = TextureRef {
            texture: 0,
            second: false,
            transform: glam::Affine2::IDENTITY,
        };
        for (u, v) in [
            (Vec2::X, Vec2::NEG_Y),
            (Vec2::NEG_X, Vec2::NEG_Y),
            (Vec2::Y, Vec2::X),
            (Vec2::X, 3.0 * Vec2::Y),
        ] {
            let (uvs, edges) = mapped(u, v);
            let (t, hand) = tangent(None, Some(uvs), &[0.2, 0.3, 0.5], edges, &map, Vec3::Z)
                .expect("the coordinates span an area");
            let red = perturbed(Vec3::Z, t, hand, Vec3::X);
            let green = perturbed(Vec3::Z, t, hand, Vec3::Y);
            assert!(
                (red - u.normalize().extend(0.0)).length() < 1e-6,
                "{u} {v}: {red}"
            );
            assert!(
                (green + v.normalize().extend(0.0)).length() < 1e-6,
                "{u} {v}: {green}"
            );
            assert_eq!(perturbed(Vec3::Z, t, hand, Vec3::Z), Vec3::Z);
        }
        let (flat, edges) = mapped(Vec2::X, Vec2::X);
        assert!(tangent(None, Some(flat), &[1.0, 0.0, 0.0], edges, &map, Vec3::Z).is_none());
    }

    #[test]
    fn normal_map_prefers_tangents_of_the_mesh() {
        let (uvs, edges) = mapped(Vec2::X, Vec2::NEG_Y);
        let own = Some([Vec4::new(0.0, 1.0, 0.0, -1.0); 3]);
        let map = TextureRef {
            texture: 0,
            second: false,
            transform: glam::Affine2::IDENTITY,
        };
        let (t, hand) =
            tangent(own, Some(uvs), &[0.2, 0.3, 0.5], edges, &map, Vec3::Z).expect("given");
        assert_eq!((t, hand), (Vec3::Y, -1.0));
        assert_eq!(perturbed(Vec3::Z, t, hand, Vec3::Y), Vec3::X);
    }

    #[test]
    fn bent_normal_shows_a_direction_the_same_side_as_the_geometric_normal() {
        let (ng, wo) = (Vec3::Z, Vec3::new(1.0, 0.0, 0.2).normalize());
        let ns = Vec3::new(-0.8, 0.0, 0.6);
        for sign in [1.0, -1.0] {
            let n = bent(ns, ng, sign * wo);
            assert!((n.dot(wo) - 1e-3).abs() < 1e-3 && n.dot(wo) > 0.0, "{n}");
            assert!(n.y == 0.0 && n.x < 0.0, "{n}");
        }
        assert_eq!(bent(ns, ng, Vec3::Z), ns, "from above nothing bends");
        assert_eq!(
            bent(ns, ng, Vec3::X),
            ng,
            "edge-on the normal is the geometric one"
        );
    }
}
