//! `opsr completions` and `opsr man`: shell completions and manual pages, generated from the options.

use super::exit::Blame;
use super::output::print;
use super::{Args, with_negative_numbers};
use clap::CommandFactory;
use clap_complete::Shell;
use opsr::files;
use std::path::PathBuf;

/// Options of `opsr completions`.
#[derive(clap::Args, Debug)]
pub(super) struct CompletionsArgs {
    /// The shell.
    shell: Shell,
}

/// Options of `opsr man`.
#[derive(clap::Args, Debug)]
pub(super) struct ManArgs {
    /// Folder of the pages, such as ~/.local/share/man/man1.
    folder: PathBuf,
}

/// Prints the completions.
pub(super) fn completions(args: &CompletionsArgs) -> anyhow::Result<()> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut Args::command(), "opsr", &mut text);
    print(text)
}

/// Writes a page for the program and one for every command.
pub(super) fn man(args: &ManArgs) -> anyhow::Result<()> {
    files::create_folder(&args.folder).output()?;
    let mut command = with_negative_numbers(Args::command()).disable_help_subcommand(true);
    command.build();
    pages(&command, args)
}

fn pages(command: &clap::Command, args: &ManArgs) -> anyhow::Result<()> {
    let page = clap_mangen::Man::new(command.clone());
    let mut text = Vec::new();
    page.render(&mut text)?;
    files::write_bytes(&args.folder.join(page.get_filename()), text).output()?;
    command
        .get_subcommands()
        .try_for_each(|command| pages(command, args))
}
