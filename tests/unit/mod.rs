//! Tests of several modules that need more than their public items. Scenes and statistics are those of the laboratory.

mod anisotropy;
mod aov;
mod appearance;
pub(crate) mod bidirectional;
mod bsdf;
mod dispersion;
mod drawn;
mod film;
mod geometry;
mod instances;
mod lab;
mod lamps;
mod lens;
mod levels;
mod many_lights;
mod mean_error;
mod media;
#[path = "../../crates/metric/src/lib.rs"]
#[allow(dead_code, unreachable_pub, unused_imports)]
mod metric;
mod own_light;
mod phase;
mod pilot;
mod sampler;
mod statement;
mod stop;
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
