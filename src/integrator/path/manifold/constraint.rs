//! The specular constraint: where light goes from one point to another by way of smooth interfaces.
//!
//! At a vertex xᵢ between xᵢ₋₁ and xᵢ₊₁ the generalised half vector hᵢ = n₀ ω₀ + n₂ ω₂ is parallel to the normal, with ω₀ and ω₂ the
//! directions towards the two and n₀, n₂ the indices on their sides, equal for a reflection `[Walter07 (16)]`. Its tangential
//! part Cᵢ is zero `[SMS §4]`.
//!
//! A chain x₀ … xₖ is traced from x₀ by way of x₁, so that C₁ … Cₖ₋₁ are zero and x₁ decides all that follow. By the theorem of the implicit
//! function, with Dᵢ = ∂xᵢ/∂x₁, D₀ = 0 and D₁ = 1,
//!
//! Dᵢ₊₁ = −(∂Cᵢ/∂xᵢ₊₁)⁻¹ Jᵢ, Jᵢ = ∂Cᵢ/∂xᵢ Dᵢ + ∂Cᵢ/∂xᵢ₋₁ Dᵢ₋₁.
//!
//! Newton's method on Cₖ steps by −Jₖ⁻¹ Cₖ, and x₁ changes with the end of the chain by −Jₖ⁻¹ ∂Cₖ/∂xₖ₊₁, from which follows how
//! light spreads.

use crate::math::{DVec2, DVec3};
use glam::DMat2;

/// A triangle with normals at its corners, zero where the mesh has none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch {
    pub(super) corners: [DVec3; 3],
    pub(super) normals: [DVec3; 3],
}

/// A point of a patch, its normal, and how that changes.
#[derive(Clone, Copy, Debug)]
pub(super) struct PatchPoint {
    pub(super) position: DVec3,
    /// Unit vectors across one another in the plane of the triangle.
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
    /// Unit vectors across the normal and one another.
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
    /// Direction in which light from the direction `w0` of the vertex before is refracted; `None` where all is reflected.
    pub(super) fn refracted(&self, w0: DVec3) -> Option<DVec3> {
        let [n0, n2] = self.indices;
        let cos = self.at.normal.dot(w0);
        let normal = self.at.normal * cos.signum();
        let ratio = n0 / n2;
        let cos2 = 1.0 - ratio * ratio * (1.0 - cos * cos);
        (cos2 > 0.0).then(|| -ratio * w0 + (ratio * cos.abs() - cos2.sqrt()) * normal)
    }

    /// Derivatives of the constraint along directions of another vertex, `w` the direction to it, `scale` its index over its
    /// distance.
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

/// A chain of at least one vertex that light has been traced along from `from`, and its end.
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
    /// Step of Newton's method along the axes of the first vertex; `None` where the constraint does not tell.
    pub(super) fn step(&self) -> Option<DVec2> {
        let step = self.jacobian.inverse() * -self.value;
        step.is_finite().then_some(step)
    }

    /// Solid angle at x₀ per area at the end across the last edge, or per solid angle of a direction, where the constraint is
    /// zero: |∂ω₀/∂xₖ₊₁| `[SMS (9)]`. Not finite where all of a neighbourhood is in focus.
    pub(super) fn spread(&self) -> f64 {
        self.seen * (self.by_end.determinant() / self.jacobian.determinant()).abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bent(height: f64) -> Patch {
        let up = DVec3::Y * height;
        Patch {
            corners: [
                DVec3::new(-1.0, 0.1, -0.8) + up,
                DVec3::new(1.2, -0.1, -0.7) + up,
                DVec3::new(0.1, 0.2, 1.1) + up,
            ],
            normals: [
                DVec3::new(-0.3, 1.0, -0.2),
                DVec3::new(0.4, 1.0, -0.1),
                DVec3::new(0.1, 1.0, 0.5),
            ]
            .map(DVec3::normalize),
        }
    }

    fn flat(height: f64) -> Patch {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Z];
        Patch {
            corners: corners.map(|p| 10.0 * p - 3.0 * (DVec3::X + DVec3::Z) + height * DVec3::Y),
            normals: [-DVec3::Y; 3],
        }
    }

    fn vertex(patch: &Patch, at: DVec3, indices: [f64; 2]) -> ChainVertex {
        ChainVertex {
            at: patch.at(at).expect("area"),
            indices,
        }
    }

    /// Point at which a ray meets the plane of a patch.
    fn meet(patch: &Patch, from: DVec3, dir: DVec3) -> DVec3 {
        let at = patch.at(from).expect("area");
        from + dir * ((at.position - from).dot(at.facet) / dir.dot(at.facet))
    }

    /// The chain by way of `at`, traced from `from` through all patches.
    fn traced(from: DVec3, at: DVec3, patches: &[Patch], indices: &[[f64; 2]]) -> Vec<ChainVertex> {
        let mut chain = vec![vertex(&patches[0], at, indices[0])];
        let mut before = from;
        for (patch, indices) in patches.iter().zip(indices).skip(1) {
            let last = chain[chain.len() - 1];
            let w0 = (before - last.at.position).normalize();
            let next = last.refracted(w0).expect("a refraction");
            before = last.at.position;
            chain.push(vertex(patch, meet(patch, before, next), *indices));
        }
        chain
    }

    /// The tangential part of the last half vector, in the tangents of `base`.
    fn value(base: &PatchPoint, from: DVec3, chain: &[ChainVertex], end: End) -> DVec2 {
        let last = chain[chain.len() - 1];
        let before = chain
            .len()
            .checked_sub(2)
            .map_or(from, |i| chain[i].at.position);
        let w0 = (before - last.at.position).normalize();
        let h = last.indices[0] * w0 + last.indices[1] * end.from(last.at.position).0;
        let across = h - last.at.normal * last.at.normal.dot(h);
        let [s, t] = base.tangents();
        DVec2::new(s.dot(across), t.dot(across))
    }

    /// Chains of one vertex and of two, to a point and to a direction.
    #[test]
    fn manifold_derivatives_are_finite_differences() {
        let from = DVec3::new(-0.4, 1.5, 0.3);
        let ends = [
            End::Point(DVec3::new(0.3, -2.6, 0.2)),
            End::Direction(DVec3::new(0.3, -1.0, 0.2).normalize()),
        ];
        let one = ([bent(0.0)].to_vec(), [[1.0, 1.5]].to_vec());
        let two = (
            [bent(0.0), bent(-1.1)].to_vec(),
            [[1.0, 1.5], [1.5, 1.2]].to_vec(),
        );
        let step = 1e-6;
        for (patches, indices) in [one, two] {
            for end in ends {
                let at = patches[0].at(DVec3::new(0.2, 0.0, -0.1)).expect("area");
                let vertices = traced(from, at.position, &patches, &indices);
                let found = chain(from, &vertices, end).expect("a chain");
                let last = vertices[vertices.len() - 1].at;
                for k in 0..2 {
                    let [a, b] = [step, -step].map(|d| {
                        let moved = at.position + at.axes[k] * d;
                        let vertices = traced(from, moved, &patches, &indices);
                        value(&last, from, &vertices, end)
                    });
                    let expected = (a - b) / (2.0 * step);
                    let error = (found.jacobian.col(k) - expected).length();
                    assert!(error < 1e-7, "{} {end:?}: {error}", patches.len());
                }
                let w = end.from(last.position).0;
                let (u, v) = w.any_orthonormal_pair();
                for (k, d) in [u, v].into_iter().enumerate() {
                    let [a, b] = [step, -step].map(|x| {
                        let end = match end {
                            End::Point(p) => End::Point(p + d * x),
                            End::Direction(w) => End::Direction((w + d * x).normalize()),
                        };
                        value(&last, from, &vertices, end)
                    });
                    let expected = (a - b) / (2.0 * step);
                    assert!((found.by_end.col(k) - expected).length() < 1e-7);
                }
            }
        }
    }

    /// Newton's method from the middle of a patch, through chains that are traced.
    fn solved(from: DVec3, patches: &[Patch], indices: &[[f64; 2]], end: End) -> Chain {
        let mut at = patches[0].at(DVec3::ZERO).expect("area");
        for _ in 0..50 {
            let vertices = traced(from, at.position, patches, indices);
            let step = chain(from, &vertices, end).and_then(|c| c.step());
            let step = 0.8 * step.expect("a step");
            let moved = at.position + at.axes[0] * step.x + at.axes[1] * step.y;
            at = patches[0].at(moved).expect("area");
        }
        let vertices = traced(from, at.position, patches, indices);
        let found = chain(from, &vertices, end).expect("a chain");
        assert!(found.value.length() < 1e-9, "{found:?}");
        found
    }

    /// A flat mirror shows the point behind it: light spreads as over the unfolded way.
    #[test]
    fn manifold_spread_of_a_flat_mirror_is_that_of_the_mirrored_point() {
        let (from, to) = (DVec3::new(0.0, 1.0, 0.0), DVec3::new(2.0, 3.0, 1.0));
        let found = solved(from, &[flat(0.0)], &[[1.0, 1.0]], End::Point(to));
        let mirrored = DVec3::new(to.x, -to.y, to.z);
        assert!((found.spread() * from.distance_squared(mirrored) - 1.0).abs() < 1e-9);
    }

    /// Light from infinity leaves a plane-parallel plate as it came; through one side n₀² cos θ₀ dω₀ = n₂² cos θ₂ dω₂.
    #[test]
    fn manifold_spread_through_plane_sides_is_that_of_snells_law() {
        let from = DVec3::new(0.1, 1.0, 0.2);
        let towards = DVec3::new(0.3, -1.0, -0.2).normalize();
        let end = End::Direction(towards);
        let plate = solved(
            from,
            &[flat(0.0), flat(-0.7)],
            &[[1.0, 1.5], [1.5, 1.0]],
            end,
        );
        assert!((plate.spread() - 1.0).abs() < 1e-9, "{}", plate.spread());
        let water = solved(from, &[flat(0.0)], &[[1.33, 1.0]], end);
        let sin = (1.0 - towards.y * towards.y).sqrt() / 1.33;
        let expected = -towards.y / (1.33 * 1.33 * (1.0 - sin * sin).sqrt());
        assert!((water.spread() - expected).abs() < 1e-9);
    }

    /// The closed form of light from infinity after a ball that reflects: 1 / ((1 + 2 d / (r cos θ)) (1 + 2 d cos θ / r)).
    #[test]
    fn manifold_spread_of_a_mirror_ball_is_the_closed_form() {
        let (radius, distance) = (0.7, 1.3);
        for angle in [0.2f64, 0.8, 1.3] {
            let normal = DVec3::new(0.4, 0.8, -0.3).normalize();
            let (s, t) = normal.any_orthonormal_pair();
            let sun = angle.cos() * normal + angle.sin() * s;
            let out = angle.cos() * normal - angle.sin() * s;
            let corner = |a: f64, b: f64| (normal + 1e-4 * (a * s + b * t)).normalize();
            let normals = [corner(-1.0, -0.8), corner(1.1, -0.7), corner(0.1, 1.2)];
            let ball = Patch {
                corners: normals.map(|n| n * radius),
                normals,
            };
            let at = ball.at(radius * normal).expect("area");
            let from = at.position + distance * out;
            let found = [vertex(&ball, at.position, [1.0, 1.0])];
            let found = chain(from, &found, End::Direction(sun)).expect("a chain");
            assert!(found.value.length() < 1e-3);
            let curved = 2.0 * distance / radius;
            let expected = 1.0 / ((1.0 + curved / angle.cos()) * (1.0 + curved * angle.cos()));
            let ratio = found.spread() / expected;
            assert!((ratio - 1.0).abs() < 1e-3, "{angle}: {ratio}");
        }
    }
}
