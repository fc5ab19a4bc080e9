//! Statistics: Student's distribution, agreement of pictures, ratios with intervals.

pub mod agreement;
pub mod ratios;
pub(crate) mod student;
