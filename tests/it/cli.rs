//! The program: exit codes, messages, and files that are complete or unchanged.

mod auto;
mod broken;
mod faults;
mod film;
mod long;
#[cfg(target_os = "linux")]
mod memory;
mod outputs;
mod parts;
mod render;
mod repeated;
#[cfg(unix)]
mod shut;
#[cfg(target_os = "linux")]
mod silenced;
#[cfg(unix)]
mod targets;
#[cfg(feature = "train")]
mod train;
#[cfg(feature = "train")]
mod training_report;
mod verify;

use opsr::scene::SceneParts;
use opsr_lab::gallery::{self, glb};
use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use tempfile::TempDir;

/// A folder in which the program runs.
pub(crate) struct TestFolder(TempDir);

/// Exit code and texts of a run.
pub(crate) struct RunResult {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl RunResult {
    fn of(output: Output) -> Self {
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
        let ended = Self {
            code: output.status.code(),
            out: text(output.stdout),
            err: text(output.stderr),
        };
        assert!(!ended.err.contains("panicked"), "{}", ended.err);
        ended
    }

    /// Fails unless the program succeeded.
    pub(crate) fn done(self) -> Self {
        assert_eq!(self.code, Some(0), "{}{}", self.out, self.err);
        self
    }
}

impl TestFolder {
    /// A folder with `scene.glb` in it: a small lamp over a plane.
    pub(crate) fn new() -> Self {
        let place = Self(tempfile::tempdir().expect("a folder"));
        place.save("scene.glb", &gallery::area_light_over_plane());
        place
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn save(&self, name: &str, parts: &SceneParts) {
        self.write(name, glb::to_glb(parts).expect("a scene"));
    }

    pub(crate) fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        std::fs::write(self.path().join(name), bytes).expect("a file");
    }

    pub(crate) fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path().join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// The files with their contents; folders are empty.
    pub(crate) fn files(&self) -> BTreeMap<String, Vec<u8>> {
        self.files_in("")
    }

    /// The files of a folder.
    pub(crate) fn files_in(&self, folder: &str) -> BTreeMap<String, Vec<u8>> {
        let folder = self.path().join(folder);
        let entries = std::fs::read_dir(&folder).expect("a folder");
        let mut out = BTreeMap::new();
        for entry in entries {
            let name = entry.expect("an entry").file_name();
            let name = name.into_string().expect("UTF-8");
            let bytes = std::fs::read(folder.join(&name)).unwrap_or_default();
            out.insert(name, bytes);
        }
        out
    }

    /// Runs the program with a limit on file sizes in bytes, a multiple of 512: writing fails as on a full disk.
    #[cfg(unix)]
    pub(crate) fn opsr_on_a_full_disk(&self, bytes: u64, args: &str) -> RunResult {
        let (program, blocks) = (env!("CARGO_BIN_EXE_opsr"), bytes / 512);
        // Without the trap a signal would end the program.
        let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec {program} {args}");
        let mut shell = self.command("sh");
        RunResult::of(shell.args(["-c", &script]).output().expect("a shell"))
    }

    /// The program in this folder, with few threads and without log settings of the environment.
    pub(crate) fn command(&self, program: &str) -> Command {
        let mut command = Command::new(program);
        command.current_dir(self.path());
        command.env_remove("RUST_LOG").env_remove("RUST_BACKTRACE");
        command.env("RAYON_NUM_THREADS", "2");
        command
    }

    /// Runs the program; arguments are separated by blanks.
    pub(crate) fn opsr(&self, args: &str) -> RunResult {
        let mut command = self.command(env!("CARGO_BIN_EXE_opsr"));
        let command = command.args(args.split_whitespace());
        RunResult::of(command.output().expect("the program"))
    }

    /// Runs the program until a file exists, then interrupts it as Ctrl-C does.
    #[cfg(unix)]
    pub(crate) fn interrupted(&self, args: &str, file: &str) -> RunResult {
        self.signalled("INT", args, file)
    }

    /// Runs the program until a file exists, then sends it a signal.
    #[cfg(unix)]
    pub(crate) fn signalled(&self, signal: &str, args: &str, file: &str) -> RunResult {
        self.meanwhile(signal, args, file, || {})
    }

    /// Runs the program until a file exists, calls `beside`, then sends it a signal.
    #[cfg(unix)]
    pub(crate) fn meanwhile(
        &self,
        signal: &str,
        args: &str,
        file: &str,
        beside: impl FnOnce(),
    ) -> RunResult {
        let mut command = self.command(env!("CARGO_BIN_EXE_opsr"));
        let command = command.args(args.split_whitespace());
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program");
        while !self.path().join(file).exists() {
            let ended = child.try_wait().expect("a status");
            assert!(ended.is_none(), "it ended by itself");
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        beside();
        let id = child.id().to_string();
        let kill = Command::new("kill").args(["-s", signal, &id]).status();
        assert!(kill.expect("kill").success());
        RunResult::of(child.wait_with_output().expect("an end"))
    }

    /// A render of 16 x 16 pixels that can be compared byte for byte.
    pub(crate) fn render(&self, args: &str) -> RunResult {
        let common = "--size 16x16 --reproducible --progress none";
        self.opsr(&format!("render scene.glb {common} {args}"))
    }
}
