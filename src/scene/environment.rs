//! (to come)

/// Radiance from infinity.
#[derive(Clone, Debug, Default)]
pub struct Environment {}

impl Environment {
    /// Radiance seen when looking along `dir`.
    #[inline]
    pub fn radiance(&self, dir: crate::math::Vec3) -> crate::math::Rgb {
        let _ = dir;
        todo!()
    }
}
