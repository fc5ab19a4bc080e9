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

/// Direction in which u increases over a triangle, and the handedness; `None` if the texture coordinates span no area.
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

/// True if the normals at a triangle's corners are those of a curved surface: they differ, and all are close enough to
/// the triangle's own normal that they do not smooth an edge.
pub(super) fn is_curved([a, b, c]: &[Vec3; 3], ng: Vec3) -> bool {
    let least = [a, b, c].map(|n| n.dot(ng).abs());
    let alike = a.dot(*b).min(b.dot(*c)).min(c.dot(*a));
    least.into_iter().fold(1.0, f32::min) > 0.7 && alike < 0.9999
}

/// Height of the smooth surface over a point of its triangle: the weighted mean of the point's distances below the
/// tangent planes at the corners `[Hanika21]`. `corners` are relative to the point. 0 where the surface is concave.
pub(super) fn rise(weights: &[f32; 3], corners: &[Vec3; 3], normals: &[Vec3; 3], ng: Vec3) -> f32 {
    let mut height = 0.0;
    for ((weight, corner), n) in weights.iter().zip(corners).zip(normals) {
        let side = if n.dot(ng) < 0.0 { -1.0 } else { 1.0 };
        height += weight * (side * corner.dot(*n)).max(0.0);
    }
    height
}

/// Least cosine with the geometric normal of the mirror image of a direction about a bent shading normal, for opaque
/// rough surfaces. With less, a rough lobe about the mirror direction loses half of its light below the surface.
pub(super) const MIN_COS_ROUGH: f32 = 0.08;

/// [`MIN_COS_ROUGH`] for smooth surfaces, whose Fresnel reflectance decreases as the normal bends, and for transmissive
/// ones, where more light would leave on the wrong side.
pub(super) const MIN_COS_SMOOTH: f32 = 0.01;

/// [`MIN_COS_ROUGH`] for diffuse surfaces: the normal bends just so far that `w` is on its side.
pub(super) const MIN_COS_MATT: f32 = -1.0;

/// Bends a shading normal on the side of `ng` towards `ng`, just so far that the mirror image of `w` has a cosine of
/// `least` with `ng`, or 0.9 times that of `w` if this is less. The same for `w` and `-w`.
///
/// A smooth or glossy lobe loses light if its mirror direction is below the surface: coarse meshes get dark rims,
/// normal maps black ripples.
#[inline]
pub(super) fn bent(ns: Vec3, ng: Vec3, w: Vec3, least: f32) -> Vec3 {
    // On flat surfaces both normals are equal.
    if ns == ng {
        return ns;
    }
    let cos = w.dot(ng);
    let side = if cos < 0.0 { -1.0 } else { 1.0 };
    let c = cos.abs();
    let least = least.clamp(-0.9 * c, 0.9 * c);
    let along = ns.dot(ng);
    if 2.0 * side * w.dot(ns) * along >= c + least {
        return ns;
    }
    bent_to(ns, ng, side * w, least)
}

/// The normal in the plane of `ng` and `ns` whose mirror image of `w` has the cosine `least` with `ng`.
#[inline(never)]
fn bent_to(ns: Vec3, ng: Vec3, w: Vec3, least: f32) -> Vec3 {
    let c = w.dot(ng);
    let Some(across) = (ns - ns.dot(ng) * ng).try_normalize() else {
        return ng;
    };
    let s = w.dot(across);
    // The mirror image is (least, high), and the normal bisects its angle with `w`; for s < 0 without cancellation.
    let high = (c * c + s * s - least * least).max(0.0).sqrt();
    let lean = if s > 0.0 {
        s + high
    } else {
        (c - least) * (c + least) / (high - s)
    };
    let n = (c + least) * ng + lean * across;
    n.try_normalize().unwrap_or(ng)
}

#[cfg(test)]
mod tests;
