//! Exit codes, and the errors that lead to them.

use opsr::files::{FileError, Problem};
use opsr::memory::Shortage;
use opsr::render::{Fault, Names};

/// Exit code of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Exit {
    /// Done.
    Done = 0,
    /// Any other failure.
    Failed = 1,
    /// Wrong usage; clap exits with the same code.
    Usage = 2,
    /// A scene, table, picture or configuration file is missing, damaged or not supported.
    Input = 3,
    /// A result could not be written.
    Output = 4,
    /// Stopped by the user, or by a limit of time within the first sample; the results so far are saved.
    Stopped = 5,
    /// Pictures differ by more than they may.
    Differ = 6,
    /// There is not enough memory.
    Memory = 7,
}

/// An error together with the exit code it leads to.
#[derive(Debug)]
pub(super) struct Failure(pub(super) Exit, pub(super) anyhow::Error);

impl std::fmt::Display for Failure {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:#}", self.1)
    }
}

impl std::error::Error for Failure {}

/// Attaches an exit code to an error.
pub(super) trait Blame<T>: Sized {
    /// The cause is the command line.
    fn usage(self) -> anyhow::Result<T> {
        self.blame(Exit::Usage)
    }

    /// The cause is the user's input.
    fn input(self) -> anyhow::Result<T> {
        self.blame(Exit::Input)
    }

    /// The cause is the place of the output.
    fn output(self) -> anyhow::Result<T> {
        self.blame(Exit::Output)
    }

    /// Attaches this exit code.
    fn blame(self, exit: Exit) -> anyhow::Result<T>;
}

impl<T, E: Into<anyhow::Error>> Blame<T> for Result<T, E> {
    fn blame(self, exit: Exit) -> anyhow::Result<T> {
        self.map_err(|e| {
            let error: anyhow::Error = e.into();
            let exit = if is_shortage(&error) {
                Exit::Memory
            } else {
                exit
            };
            Failure(exit, error).into()
        })
    }
}

/// True if there is not enough memory for the content of a file.
pub(super) fn of_memory(error: &FileError) -> bool {
    matches!(error.problem, Problem::Memory(_))
}

/// True if the cause is a shortage of memory, which has its own exit code.
fn is_shortage(error: &anyhow::Error) -> bool {
    let of_file = error.downcast_ref().is_some_and(of_memory);
    of_file || error.downcast_ref::<Shortage>().is_some()
}

/// Conversion of a fault of a render to an error with an exit code, with options as the command line names them.
pub(super) trait IntoExit<T> {
    /// The error with the exit code of its cause.
    fn into_exit(self) -> anyhow::Result<T>;
}

impl<T> IntoExit<T> for Result<T, Fault> {
    fn into_exit(self) -> anyhow::Result<T> {
        self.map_err(|fault| failure(&fault).into())
    }
}

/// The failure of a fault, with its exit code.
pub(super) fn failure(fault: &Fault) -> Failure {
    let exit = match fault {
        Fault::Option { .. } | Fault::Usage(_) => Exit::Usage,
        Fault::File(error) if of_memory(error) => Exit::Memory,
        Fault::File(error) if error.is_write() => Exit::Output,
        Fault::File(_) | Fault::Input(_) => Exit::Input,
        Fault::Output(_) => Exit::Output,
        Fault::Memory(..) => Exit::Memory,
    };
    Failure(exit, anyhow::Error::msg(fault.message(Names::Flags)))
}
