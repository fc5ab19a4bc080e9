//! The specular constraint: zero along light paths from one point to another over smooth interfaces.
//!
//! At a vertex xᵢ between xᵢ₋₁ and xᵢ₊₁ the generalised half vector hᵢ = n₀ ω₀ + n₂ ω₂ is parallel to the normal, with
//! ω₀ and ω₂ the directions towards the two and n₀, n₂ the indices on their sides, equal for a reflection
//! `[Walter07 (16)]`. Its tangential part Cᵢ is zero `[SMS §4]`.
//!
//! A chain x₀ … xₖ is traced from x₀ through x₁, so that C₁ … Cₖ₋₁ are zero and x₁ determines all later vertices. By
//! the implicit function theorem, with Dᵢ = ∂xᵢ/∂x₁, D₀ = 0 and D₁ = 1,
//!
//! Dᵢ₊₁ = −(∂Cᵢ/∂xᵢ₊₁)⁻¹ Jᵢ, Jᵢ = ∂Cᵢ/∂xᵢ Dᵢ + ∂Cᵢ/∂xᵢ₋₁ Dᵢ₋₁.
//!
//! Newton's method on Cₖ steps by −Jₖ⁻¹ Cₖ, and x₁ changes with the end of the chain by −Jₖ⁻¹ ∂Cₖ/∂xₖ₊₁, which gives
//! the spread of light.

use crate::math::{DVec2, DVec3};
use glam::DMat2;

/// A triangle with normals at its corners, zero where the mesh has none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub(super) corners: [DVec3; 3],
    pub(super) normals: [DVec3; 3],
}

/// A point of a patch, its normal, and the derivatives of the normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct PatchPoint {
    pub(super) position: DVec3,
    /// Orthonormal vectors in the plane of the triangle.
    pub(super) axes: [DVec3; 2],
    /// Unit normal of the triangle.
    pub(super) facet: DVec3,
    /// Unit interpolated normal, on the side of `facet`.
    pub(super) normal: DVec3,
    /// Derivatives of `normal` along the axes, per length.
    pub(super) bends: [DVec3; 2],
}

/// A vertex of a chain, with the indices of refraction on the sides of the vertices before and after.
#[derive(Clone, Copy, Debug)]
pub(super) struct ChainVertex {
    pub(super) at: PatchPoint,
    pub(super) indices: [f64; 2],
}

/// End of a chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum End {
    Point(DVec3),
    /// Unit direction towards a light at infinity.
    Direction(DVec3),
}

/// A chain that is traced from x₀ towards its end.
#[derive(Clone, Copy, Debug)]
pub(super) struct Chain {
    /// The constraint at the last vertex.
    pub(super) value: DVec2,
    /// Its derivatives along the axes of the first vertex.
    jacobian: DMat2,
    /// Its derivatives by the end along two unit vectors across the last edge: per length, or per angle of a direction.
    by_end: DMat2,
    /// Solid angle at x₀ per area of the first triangle.
    seen: f64,
}

impl Patch {
    /// The point of the triangle's plane nearest to `position`; `None` for a triangle without area.
    pub(super) fn at(&self, position: DVec3) -> Option<PatchPoint> {
        let [p, q, r] = self.corners;
        let (e, f) = (q - p, r - p);
        let facet = e.cross(f).try_normalize()?;
        let axis = e.try_normalize()?;
        let axes = [axis, facet.cross(axis)];
        // Barycentric weights of the second and the third corner, linear in the position.
        let gram = DMat2::from_cols_array(&[e.dot(e), e.dot(f), e.dot(f), f.dot(f)]).inverse();
        let weights = |v: DVec3| gram * DVec2::new(e.dot(v), f.dot(v));
        let [n, m, l] = self.normals;
        let mixed = |w: DVec2| (m - n) * w.x + (l - n) * w.y;
        let raw = n + mixed(weights(position - p));
        let length = raw.length();
        let position = position - facet * facet.dot(position - p);
        if length < 1e-12 {
            return Some(PatchPoint {
                position,
                axes,
                facet,
                normal: facet,
                bends: [DVec3::ZERO; 2],
            });
        }
        let normal = raw / length;
        let turn = if normal.dot(facet) < 0.0 { -1.0 } else { 1.0 };
        let bends = axes.map(|axis| {
            let change = mixed(weights(axis));
            turn * (change - normal * normal.dot(change)) / length
        });
        Some(PatchPoint {
            position,
            axes,
            facet,
            normal: turn * normal,
            bends,
        })
    }
}

impl PatchPoint {
    /// Orthonormal vectors perpendicular to the normal.
    fn tangents(&self) -> [DVec3; 2] {
        let (s, t) = self.normal.any_orthonormal_pair();
        [s, t]
    }
}

impl End {
    /// Direction from a point, and the inverse of the distance: 0 for a direction.
    fn from(&self, at: DVec3) -> (DVec3, f64) {
        match *self {
            Self::Point(point) => {
                let to = point - at;
                let inverse = 1.0 / to.length();
                (to * inverse, inverse)
            }
            Self::Direction(dir) => (dir, 0.0),
        }
    }
}

impl ChainVertex {
    /// Direction in which light from the direction `w0` of the vertex before is refracted; `None` at total reflection.
    pub(super) fn refracted(&self, w0: DVec3) -> Option<DVec3> {
        let [n0, n2] = self.indices;
        let cos = self.at.normal.dot(w0);
        let normal = self.at.normal * cos.signum();
        let ratio = n0 / n2;
        let cos2 = 1.0 - ratio * ratio * (1.0 - cos * cos);
        (cos2 > 0.0).then(|| -ratio * w0 + (ratio * cos.abs() - cos2.sqrt()) * normal)
    }

    /// Derivatives of the constraint along directions of another vertex, `w` the direction to it, `scale` its index
    /// over its distance.
    fn by_other(&self, axes: [DVec3; 2], w: DVec3, scale: f64) -> DMat2 {
        let [s, t] = self.at.tangents();
        let column = |d: DVec3| {
            let change = scale * (d - w * w.dot(d));
            DVec2::new(s.dot(change), t.dot(change))
        };
        DMat2::from_cols(column(axes[0]), column(axes[1]))
    }

    /// The constraint between `from` and `to`, and its derivatives along the axes here.
    fn constraint(&self, from: DVec3, to: End) -> (DVec2, DMat2) {
        let [n0, n2] = self.indices;
        let ((w0, r0), (w2, r2)) = (
            End::Point(from).from(self.at.position),
            to.from(self.at.position),
        );
        let h = n0 * w0 + n2 * w2;
        let [s, t] = self.at.tangents();
        let along = h.dot(self.at.normal);
        let column = |k: usize| {
            let d = self.at.axes[k];
            let change = -n0 * r0 * (d - w0 * w0.dot(d)) - n2 * r2 * (d - w2 * w2.dot(d));
            let change = change - along * self.at.bends[k];
            DVec2::new(s.dot(change), t.dot(change))
        };
        let value = DVec2::new(s.dot(h), t.dot(h));
        (value, DMat2::from_cols(column(0), column(1)))
    }
}

/// Constraint and derivatives of a chain that was traced from `from`; `None` without vertices.
pub(super) fn chain(from: DVec3, vertices: &[ChainVertex], end: End) -> Option<Chain> {
    let first = vertices.first()?;
    let (w0, r0) = End::Point(from).from(first.at.position);
    let seen = w0.dot(first.at.facet).abs() * r0 * r0;
    let (mut before, mut here) = (DMat2::ZERO, DMat2::IDENTITY);
    for (i, vertex) in vertices.iter().enumerate() {
        let position = vertex.at.position;
        let last = match i {
            0 => from,
            _ => vertices[i - 1].at.position,
        };
        let next = vertices.get(i + 1);
        let to = next.map_or(end, |next| End::Point(next.at.position));
        let (value, by_point) = vertex.constraint(last, to);
        let mut jacobian = by_point * here;
        if i > 0 {
            let (w, r) = End::Point(last).from(position);
            let axes = vertices[i - 1].at.axes;
            jacobian += vertex.by_other(axes, w, vertex.indices[0] * r) * before;
        }
        let (w, r) = to.from(position);
        let Some(next) = next else {
            let (u, v) = w.any_orthonormal_pair();
            let scale = if r == 0.0 { 1.0 } else { r };
            return Some(Chain {
                value,
                jacobian,
                by_end: vertex.by_other([u, v], w, vertex.indices[1] * scale),
                seen,
            });
        };
        let by_next = vertex.by_other(next.at.axes, w, vertex.indices[1] * r);
        (before, here) = (here, by_next.inverse() * -jacobian);
    }
    None
}

impl Chain {
    /// Step of Newton's method along the axes of the first vertex; `None` for a singular Jacobian.
    pub(super) fn step(&self) -> Option<DVec2> {
        let step = self.jacobian.inverse() * -self.value;
        step.is_finite().then_some(step)
    }

    /// Solid angle at x₀ per area at the end across the last edge, or per solid angle of a direction, where the
    /// constraint is zero: |∂ω₀/∂xₖ₊₁| `[SMS (9)]`. Not finite where a whole neighbourhood is focused on the end.
    pub(super) fn spread(&self) -> f64 {
        self.seen * (self.by_end.determinant() / self.jacobian.determinant()).abs()
    }
}

#[cfg(test)]
mod tests;
