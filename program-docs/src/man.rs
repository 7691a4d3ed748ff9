//! Man pages: those of `clap_mangen`, with the examples as they are in `--help`.

use clap::Command;
use clap_mangen::Man;
use std::io::{self, Write};
use std::path::Path;

/// Writes the page of a command and those of the commands below it.
pub(crate) fn write_pages(mut command: Command, folder: &Path) -> io::Result<()> {
    command.build();
    write_built(&command, folder)
}

fn write_built(command: &Command, folder: &Path) -> io::Result<()> {
    for sub in command.get_subcommands().filter(|sub| !sub.is_hide_set()) {
        write_built(sub, folder)?;
    }
    let man = Man::new(command.clone());
    let mut page = Vec::new();
    man.render_title(&mut page)?;
    man.render_name_section(&mut page)?;
    man.render_synopsis_section(&mut page)?;
    man.render_description_section(&mut page)?;
    man.render_options_section(&mut page)?;
    if command.has_subcommands() {
        man.render_subcommands_section(&mut page)?;
    }
    if let Some(text) = command.get_after_long_help().or_else(|| command.get_after_help()) {
        write_examples(&text.to_string(), &mut page)?;
    }
    std::fs::write(folder.join(man.get_filename()), page)
}

/// The text after the options. Its lines stay as they are: filled lines would run the commands of examples together.
fn write_examples(text: &str, page: &mut Vec<u8>) -> io::Result<()> {
    writeln!(page, ".SH EXAMPLES AND NOTES")?;
    for line in text.lines() {
        let is_code = line.starts_with(' ');
        writeln!(page, "{}", if is_code { ".nf" } else { ".fi" })?;
        match line {
            "" => writeln!(page, ".PP")?,
            line => writeln!(page, "{}", escaped(line))?,
        }
    }
    writeln!(page, ".fi")
}

/// A line whose signs mean nothing to roff.
fn escaped(line: &str) -> String {
    let line = line.replace('\\', "\\e").replace('-', "\\-");
    // A dot or an apostrophe at its beginning would make the line a request.
    if line.starts_with(['.', '\'']) { format!("\\&{line}") } else { line }
}
