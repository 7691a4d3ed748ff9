//! Documents of a program, from the definition of its command line: what `--help` says, as man pages and in Markdown.
//!
//! # Layout
//!
//! - [`write_man_pages`]: a page for the program and one for each of its commands (`man.rs`).
//! - [`markdown`]: one document with all commands (`markdown.rs`). [`check_document`]: a test that a stored one is up to
//!   date (`up_to_date.rs`).
//! - [`check_help`]: a test that help fits a terminal and is complete (`help.rs`).
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod help;
mod man;
mod markdown;
mod up_to_date;

pub use help::check_help;
pub use markdown::markdown;
pub use up_to_date::check_document;

use clap::Command;
use std::io;
use std::path::Path;

/// Writes the man pages of a program and of its commands into a folder, which is created if it is missing. Returns the
/// number of pages.
///
/// # Errors
///
/// The folder or a page cannot be written.
pub fn write_man_pages(program: Command, folder: &Path) -> io::Result<usize> {
    std::fs::create_dir_all(folder)?;
    let program = program.disable_help_subcommand(true);
    let pages = count(&program);
    man::write_pages(program, folder)?;
    Ok(pages)
}

/// Number of visible commands, with the program itself.
fn count(command: &Command) -> usize {
    1 + command.get_subcommands().filter(|command| !command.is_hide_set()).map(count).sum::<usize>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Arg;

    #[test]
    fn every_command_has_a_page() {
        let examples = "Example:\n  tool show \\\n      1\n\n.dots";
        let show = Command::new("show").about("Show it").arg(Arg::new("id").help("Id of the job"));
        let show = show.after_long_help(examples);
        let hidden = Command::new("secret").hide(true);
        let program = Command::new("tool").about("Do it").subcommand(show).subcommand(hidden);
        let folder = tempfile::tempdir().unwrap();
        let pages = folder.path().join("man1");
        assert_eq!(write_man_pages(program, &pages).unwrap(), 2);
        let mut names: Vec<_> = std::fs::read_dir(&pages).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["tool-show.1", "tool.1"]);
        let page = std::fs::read_to_string(pages.join("tool-show.1")).unwrap();
        assert!(page.contains("Show it") && page.contains("Id of the job"), "{page}");
        assert!(page.contains("Example:\n.nf\n  tool show \\e\n.nf\n      1\n"), "lines of code stay lines: {page}");
        assert!(page.contains("\n\\&.dots\n"), "no line of text is a request: {page}");
    }
}
