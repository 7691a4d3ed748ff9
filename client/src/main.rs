//! The program `lightpath`. `lightpath help` lists its commands, and `lightpath help COMMAND` explains one.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
