//! The program `lightpath-agent`. `lightpath-agent --help` explains it.

fn main() -> std::process::ExitCode {
    lightpath_agent::Cli::run()
}
