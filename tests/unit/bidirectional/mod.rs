//! Light paths and connections: densities of the ends, aims, strategies.

mod aim;
mod blurred;
mod density;
mod ends;
mod radii;
#[path = "../../it/bidirectional/scenes.rs"]
#[allow(dead_code)]
pub(crate) mod scenes;
mod split;
mod strategies;
mod ways;

use crate::unit::lab::gallery::{materials, shapes};
