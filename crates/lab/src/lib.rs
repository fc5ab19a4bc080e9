//! The laboratory of opsr: scenes, comparisons, benches, and hard cases for the current machine.
//!
//! | room | contents |
//! |---|---|
//! | [`stats`] | Student's distribution, agreement of pictures, ratios with intervals |
//! | [`gallery`] | the scenes of this project, glb writer |
//! | [`report`] | comparisons, benches and their pages |
//! | [`verify`] | hard numerical cases, tried on the current machine |

pub mod gallery;
pub mod report;
pub mod stats;
pub mod verify;
