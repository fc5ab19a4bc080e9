//! Light paths and connections: densities of the ends, aims, strategies.

mod aim;
mod density;
mod ends;
#[path = "../../it/bidirectional/scenes.rs"]
#[allow(dead_code)]
pub(crate) mod scenes;
mod split;
mod strategies;

use crate::unit::lab::gallery::{materials, shapes};
