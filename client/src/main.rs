//! The command line `lightpath`. What each command does is written in its help; `lightpath help` lists them.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
