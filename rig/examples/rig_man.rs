//! Writes the man pages of `lightpath-rig`: `cargo run -p lightpath-rig --example rig_man -- FOLDER`. The program itself does not
//! write them, so that it does not carry the code.

use clap::CommandFactory as _;
use std::path::Path;

fn main() -> std::io::Result<()> {
    let folder = std::env::args().nth(1).expect("the folder for the pages is given");
    lightpath_program_docs::write_man_pages(lightpath_rig::Cli::command(), Path::new(&folder))?;
    Ok(())
}
