//! Scenes of pbrt-v4.

use super::super::error::{Result, fault};
use super::Context;

/// Reads a scene.
pub(super) fn read(_: &mut Context, _: Vec<u8>) -> Result<()> {
    Err(fault("pbrt", "later"))
}
