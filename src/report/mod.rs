//! Comparisons, benches and their pages. (to come)
