//! Read-only folders, with the program run by another user than root: root may write everywhere.

use super::{RunResult, TestFolder};
use std::fs::{Permissions, set_permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;

/// User and group id of `nobody`.
const NOBODY: u32 = 65534;

/// A place with a folder that is read-only during the lifetime of this value.
pub(super) struct Shut<'a> {
    place: &'a TestFolder,
    folder: PathBuf,
    program: PathBuf,
    /// Copy of the program, if another user cannot reach the build folder.
    copy: Option<TempDir>,
}

impl<'a> Shut<'a> {
    /// Makes a folder read-only. Root gives the whole place to another user, who then runs the program; `None` on a
    /// system where the folder can be written nevertheless.
    pub(super) fn new(place: &'a TestFolder, folder: &str) -> Option<Self> {
        let mut shut = Self {
            place,
            folder: place.path().join(folder),
            program: env!("CARGO_BIN_EXE_opsr").into(),
            copy: None,
        };
        let ready = shut.give_away().is_ok();
        set_permissions(&shut.folder, Permissions::from_mode(0o555)).expect("permissions");
        let script = "\"$0\" --version && ! touch \"$1/probe\"";
        let mut shell = shut.command("sh");
        shell.args(["-c", script]);
        shell.arg(&shut.program).arg(&shut.folder);
        let stopped = shell.output().is_ok_and(|o| o.status.success());
        if ready && stopped {
            return Some(shut);
        }
        eprintln!(
            "skipped: on this system not even another user than root can be kept from writing to a folder"
        );
        let _ = std::fs::remove_file(shut.folder.join("probe"));
        None
    }

    /// Gives the folder and a copy of the program to another user if root runs the tests.
    fn give_away(&mut self) -> std::io::Result<()> {
        let copy = tempfile::tempdir()?;
        // Files belong to the user who creates them.
        if copy.path().metadata()?.uid() != 0 {
            return Ok(());
        }
        chown_all(self.place.path())?;
        set_permissions(copy.path(), Permissions::from_mode(0o755))?;
        let program = copy.path().join("opsr");
        // The program has two hundred megabytes, so a link is preferred.
        std::fs::hard_link(&self.program, &program)
            .or_else(|_| std::fs::copy(&self.program, &program).map(|_| ()))?;
        (self.program, self.copy) = (program, Some(copy));
        Ok(())
    }

    fn command(&self, program: impl AsRef<Path>) -> Command {
        let program = program.as_ref().to_str().expect("UTF-8");
        let mut command = self.place.command(program);
        if self.copy.is_some() {
            command.uid(NOBODY).gid(NOBODY);
        }
        command
    }

    /// Runs the program with the read-only folder.
    pub(super) fn opsr(&self, args: &str) -> RunResult {
        let mut command = self.command(&self.program);
        let command = command.args(args.split_whitespace());
        RunResult::of(command.output().expect("the program"))
    }
}

impl Drop for Shut<'_> {
    /// Makes the folder writable, so that it can be removed.
    fn drop(&mut self) {
        let _ = set_permissions(&self.folder, Permissions::from_mode(0o755));
    }
}

fn chown_all(path: &Path) -> std::io::Result<()> {
    chown(path, Some(NOBODY), Some(NOBODY))?;
    if path.is_dir() {
        for entry in path.read_dir()? {
            chown_all(&entry?.path())?;
        }
    }
    Ok(())
}
