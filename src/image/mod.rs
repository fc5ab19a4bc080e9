//! Pictures: films of running moments, files, and the metrics that compare them.

pub mod batches;
pub mod buffer;
pub mod denoise;
pub mod display;
pub mod exr;
pub mod false_colour;
pub mod film;
pub mod level_film;
pub mod metric;
pub mod png;
pub mod splat;

pub use buffer::Buffer;
pub use film::Film;
