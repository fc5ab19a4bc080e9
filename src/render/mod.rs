//! A render: the user's options, their checks against a scene, the run, and its results.
//!
//! | file | contents |
//! |---|---|
//! | `spec` | every option, declared once |
//! | [`value`] | types of options |
//! | `fault` | errors, with options named as the user gave them |
//! | [`look`] | a camera given by the user, as numbers and as a file |
//! | `method` | estimator and rule of a spec; valid combinations of options |
//! | [`open`](mod@open) | the scene of a spec |
//! | `request` | a spec checked against a scene: frame, camera, settings, pilot; [`run`] |
//! | `output` | metadata, checkpoints and parts of a request |
//! | `finished` | the end of a render: choice, denoiser, errors, layers |
//! | `files` | the files of a picture |
//!
//! The command line, the Python package, benches and [`Render`](crate::Render) use this module. None of them has its
//! own list of options, or of their valid combinations.

pub(crate) mod fault;
mod files;
pub(crate) mod finished;
pub mod look;
mod method;
pub mod open;
pub(crate) mod output;
pub(crate) mod request;
pub(crate) mod spec;
pub mod value;

pub use fault::{Fault, Names};
pub use files::can_write;
pub use finished::{Finished, Outcome, STATED, Shown};
pub use request::{Output, PreparedRender, Request, Subject, run};
pub use spec::{Effect, Heading, OPTIONS, Opt, Spec, renamed};
