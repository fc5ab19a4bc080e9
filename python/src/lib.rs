//! The Python package `opsr`: the library's scenes, renders, tables, training and metrics with numpy arrays.
//!
//! Every function checks what it is given, works without the GIL on threads of its own, and turns the library's errors
//! into exceptions with the same messages.

mod array;
mod bench;
mod build;
mod compare;
mod errors;
mod film;
mod options;
mod pickle;
mod render;
mod scene;
mod table;
mod train;
mod view;
mod work;

/// Rust part of the package; `opsr/__init__.py` names what is public.
#[pyo3::pymodule]
mod _opsr {
    #[pymodule_export]
    use super::bench::bench;
    #[pymodule_export]
    use super::compare::compare;
    #[pymodule_export]
    use super::film::{Film, Resolved, resolve};
    #[pymodule_export]
    use super::options::_options;
    #[pymodule_export]
    use super::pickle::_film;
    #[pymodule_export]
    use super::render::{Progress, choose, merge, render};
    #[pymodule_export]
    use super::scene::Scene;
    #[pymodule_export]
    use super::table::Table;
    #[pymodule_export]
    use super::train::{Step, record, train};
    #[pymodule_export]
    use super::view::{View, view};
    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
