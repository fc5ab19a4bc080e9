//! Frames of an animation, averaged along the surfaces that they share: films with less noise and flicker.
//!
//! A surface has nearly the same radiance in neighbouring frames: their average has less noise and flicker, for a few
//! rays per pixel. The window, 0, 1, 2 or 4 frames to each side, is chosen per pixel without a reference, as blurs are
//! in `opsr::resolve`: a wider window counts as biased where it differs from a narrower one by more than noise.
//!
//! | file | contents |
//! |---|---|
//! | [`names`] | numbers of frames, and names of their files |
//! | [`frame`] | a frame as rendered, and as averaged |
//! | [`surfaces`] | the surfaces of a frame, and their positions in the previous and the next one |
//! | `glints` | lamps that mirrors and smooth glass show |
//! | `reproject` | the pixels of another frame that show a surface |
//! | `average` | windows of a pixel and the choice among them |
//! | [`sequence`] | frames in order, each averaged as soon as its neighbours are there |

mod average;
pub mod frame;
mod glints;
pub mod names;
mod reproject;
pub mod sequence;
pub mod surfaces;
#[cfg(test)]
mod tests;

pub use frame::{Averaged, Frame};
pub use names::{FrameNames, FrameRange};
pub use sequence::Sequence;
pub use surfaces::Surfaces;
