//! Tests of several modules that need more than their public items. Scenes and statistics are those of the laboratory.

mod aov;
pub(crate) mod bidirectional;
mod film;
mod geometry;
mod instances;
mod lab;
mod lens;
mod levels;
mod many_lights;
mod phase;
mod pilot;
mod sampler;
#[path = "../it/support/mod.rs"]
#[allow(dead_code)]
pub(crate) mod support;
mod surface;
mod ways;

pub(crate) use lab::gallery::{materials, shapes};

impl crate::math::Ray {
    /// The point at distance `t`.
    pub(crate) fn at(&self, t: f32) -> crate::math::Vec3 {
        self.origin + t * self.dir
    }
}
