//! Pictures: films of running moments, files, and relative errors.

pub mod batches;
pub(crate) mod buffer;
pub mod denoise;
pub mod display;
pub mod exr;
pub mod film;
pub mod level_film;
pub mod png;
pub mod relative;
pub(crate) mod splat;

pub use buffer::Buffer;
pub use film::Film;
