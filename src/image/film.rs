//! (to come)
/// film
pub struct Film;
