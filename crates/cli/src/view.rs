//! `opsr view`: renders a scene progressively in the browser.

use super::exit::{Exit, IntoExit};
use super::options::RenderOptions;
use super::output::{note, print};
use super::stop;
use super::threads::set_threads;
use clap::Args;
use opsr::render::open::expect_scene;
use opsr_view::Viewer;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// Options of `opsr view`.
#[derive(Args, Debug)]
#[command(after_help = MORE, after_long_help = KEYS)]
pub(super) struct ViewArgs {
    /// The scene: glTF 2.0 (.gltf or .glb), pbrt-v4 (.pbrt), Mitsuba (.xml), OBJ or PLY.
    scene: PathBuf,
    #[command(flatten)]
    render: RenderOptions,
    /// Port of the page on this machine; 0 takes a free one.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = "Program")]
    port: u16,
    /// Print the address of the page, but do not open a browser.
    #[arg(long, help_heading = "Program")]
    no_open: bool,
    /// Picture to compare with: an EXR file of the same size and camera.
    #[arg(long, value_name = "FILE", help_heading = "Program")]
    reference: Option<PathBuf>,
    /// Number of threads; by default the number of cores. The picture does not depend on it.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), help_heading = "Program", hide_short_help = true)]
    threads: Option<u16>,
}

const MORE: &str = "These are the options that most renders use; --help lists all. The page lists its keys: press `?`.";

const KEYS: &str = "The page is for this machine alone: it listens on 127.0.0.1, and its address holds a token that \
nobody can guess. Ctrl-C ends it.

Examples:
  opsr view scene.glb
  opsr view scene.glb --opsr-table beta-0.05 --env sky --size 1280x720
  opsr view scene.glb --reference reference.exr --no-open --port 8000";

/// Runs the command.
pub(super) fn run(args: &ViewArgs) -> anyhow::Result<Exit> {
    expect_scene(&args.scene).into_exit()?;
    set_threads(args.threads)?;
    let ended = stop::ended();
    let viewer = Viewer::open(
        &args.scene,
        &args.render.0,
        args.port,
        args.reference.as_deref(),
    );
    let viewer = viewer.into_exit()?;
    let address = viewer.address();
    print(format!("{address}\n"))?;
    note("opsr: the page is open until Ctrl-C");
    if !args.no_open {
        open(&address);
    }
    viewer.run(&ended).into_exit()?;
    Ok(Exit::Done)
}

/// Opens the browser, if there is one.
fn open(address: &str) {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        "xdg-open"
    };
    let mut command = Command::new(program);
    command.arg(address).stdin(Stdio::null());
    command.stdout(Stdio::null()).stderr(Stdio::null());
    match command.spawn() {
        // A thread waits for the child, so that it does not become a zombie.
        Ok(mut child) => drop(std::thread::spawn(move || child.wait())),
        Err(_) => note("opsr: no browser was found: open the address above"),
    }
}
