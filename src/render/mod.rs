//! A render: what its user chose, the checks of that against a scene, the run, and what comes out.
//!
//! | file | contents |
//! |---|---|
//! | `spec` | every option, declared once |
//! | [`value`] | types of options |
//! | `fault` | refusals and failures, with options by the user's names for them |
//! | [`look`] | a camera of one's own, as numbers and as a file |
//! | `method` | estimator and rule of a spec; which options go together |
//! | [`open`](mod@open) | the scene of a spec |
//! | `request` | a spec checked against a scene: frame, camera, settings, pilot; [`run`] |
//! | `output` | metadata, checkpoints and parts of a request |
//! | `finished` | the end of a render: choice, denoiser, errors, layers |
//! | [`files`] | the files of a picture |
//!
//! The command line, the Python package, benches and [`Render`](crate::Render) are made of this room: none of them has a list of
//! options, or of what goes with what, of its own.

pub(crate) mod fault;
pub mod files;
pub(crate) mod finished;
pub mod look;
mod method;
pub mod open;
pub(crate) mod output;
pub(crate) mod request;
pub(crate) mod spec;
pub mod value;

pub use fault::{Cause, Fault, Names};
pub use finished::{Finished, Outcome, STATED, Shown};
pub use request::{Begun, Output, Request, Subject, run};
pub use spec::{Effect, Heading, OPTIONS, Opt, Spec, renamed};
