//! Exit codes, and what is said on stderr.

use std::io::{self, Write as _};
use std::process::ExitCode;

/// Why a command ended without success.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The server refused, could not be reached, or a file could not be read or written.
    Client(lightpath::Error),
    /// These jobs ended without success; each line says how.
    Jobs(Vec<String>),
    /// The command makes no sense.
    Usage(String),
    /// Ctrl-C; what to do next.
    Interrupted(String),
    /// The terminal or a pipe is gone.
    Output(io::Error),
}

impl From<lightpath::Error> for Failure {
    fn from(error: lightpath::Error) -> Self {
        Self::Client(error)
    }
}

/// Says on stderr what went wrong, and returns the exit code.
pub(crate) fn tell(failure: &Failure) -> ExitCode {
    let (code, text) = match failure {
        Failure::Client(error) => (code_of(error), error.to_string()),
        Failure::Jobs(endings) => (1, endings.join("\nlightpath: ")),
        Failure::Usage(text) => (2, text.clone()),
        Failure::Interrupted(text) => (130, text.clone()),
        // Whoever read the output has seen enough.
        Failure::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => return ExitCode::SUCCESS,
        Failure::Output(error) => (1, format!("could not write the output: {error}")),
    };
    let hint = match failure {
        Failure::Client(error) if error.is_unreachable() => {
            "\n  is it running? start it with `lightpathd serve`, or name another one with --server or LIGHTPATH_SERVER"
        }
        _ => "",
    };
    // Nobody is left to tell when this fails.
    let _ = writeln!(io::stderr().lock(), "lightpath: {text}{hint}");
    ExitCode::from(code)
}

fn code_of(error: &lightpath::Error) -> u8 {
    match error {
        lightpath::Error::Unreachable { .. } => 3,
        lightpath::Error::Url { .. } | lightpath::Error::Token | lightpath::Error::File { .. } => 2,
        _ => 1,
    }
}
