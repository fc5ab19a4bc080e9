//! The paper. (to come)
