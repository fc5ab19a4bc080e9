//! Learning tables. (to come)
