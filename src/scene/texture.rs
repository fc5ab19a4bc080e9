//! Textures: decoded images with wrap modes.

/// A decoded image.
#[derive(Clone, Debug, Default)]
pub struct Texture {
    /// Width in texels.
    pub width: u32,
    /// Height in texels.
    pub height: u32,
}
