//! Writes the man pages of `lightpath-agent`: `cargo run -p lightpath-agent --example man -- FOLDER`. The agent itself cannot
//! do it, so that devices do not carry the code.

use clap::CommandFactory as _;
use std::path::Path;

fn main() -> std::io::Result<()> {
    let folder = std::env::args().nth(1).expect("the folder for the pages is given");
    lightpath_program_docs::write_man_pages(lightpath_agent::Cli::command(), Path::new(&folder))?;
    Ok(())
}
