//! The program `lightpath-rig`. `lightpath-rig --help` explains it.

fn main() -> std::process::ExitCode {
    lightpath_rig::run()
}
