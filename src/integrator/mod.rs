//! The path-tracing loop and its observers. (to come)
