//! Frames of an animation, averaged along the surfaces that they share: films with less noise and flicker.
//!
//! Along a surface that two frames see, light changes slowly. The average of a picture and its neighbours divides noise and flicker
//! and costs no ray. The window, 0, 1, 2 or 4 frames to each side, is chosen for every pixel without a reference, as blurs are in
//! `opsr::resolve`: a wider one counts as biased where it differs from a narrower one by more than noise.
//!
//! | file | contents |
//! |---|---|
//! | [`names`] | numbers of frames, and names of their files |
//! | [`frame`] | a frame as it was rendered, and as it is averaged |
//! | [`surfaces`] | the surfaces of a frame, and their places in the next and the last one |
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
