//! Orthonormal frames and the trigonometry of local directions, `z` up.

use super::Vec3;

/// An orthonormal basis (`s`, `t`, `n`); local `z` is `n`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// First tangent.
    pub s: Vec3,
    /// Second tangent.
    pub t: Vec3,
    /// Normal.
    pub n: Vec3,
}

impl Frame {
    /// Completes the unit vector `n` to a basis, without branches and without a singular direction `[Duff17]`.
    #[inline]
    pub fn from_normal(n: Vec3) -> Self {
        let sign = 1.0f32.copysign(n.z);
        let a = -1.0 / (sign + n.z);
        let b = n.x * n.y * a;
        Self {
            s: Vec3::new(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x),
            t: Vec3::new(b, sign + n.y * n.y * a, -n.y),
            n,
        }
    }

    /// Transforms a world direction to local coordinates.
    #[inline]
    pub fn to_local(&self, w: Vec3) -> Vec3 {
        Vec3::new(w.dot(self.s), w.dot(self.t), w.dot(self.n))
    }

    /// Transforms a local direction to world coordinates.
    #[inline]
    pub fn to_world(&self, w: Vec3) -> Vec3 {
        w.x * self.s + w.y * self.t + w.z * self.n
    }
}

/// tan² θ of a local direction of any length, from its tangential part: no cancellation near the pole.
#[inline]
pub(crate) fn tan2_theta(w: Vec3) -> f32 {
    (w.x * w.x + w.y * w.y) / (w.z * w.z)
}
