//! Exit codes, and what is said on stderr.

use std::io::{self, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

/// Why a command ended without success.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The server refused, could not be reached, or a file could not be read or written.
    Client(lightpath::Error),
    /// The same for one of several targets.
    Target(TargetFailure),
    /// These jobs ended without success; each line says how.
    Jobs(Vec<String>),
    /// The command makes no sense.
    Usage(String),
    /// Ctrl-C; what to do next.
    Interrupted(String),
    /// The terminal or a pipe is gone.
    Output(io::Error),
}

/// A target that no job could be made for.
#[derive(Debug)]
pub(crate) struct TargetFailure {
    pub(crate) target: PathBuf,
    pub(crate) error: lightpath::Error,
    /// What became of the targets before it, where jobs were made for some.
    pub(crate) goes_on: Option<String>,
}

impl TargetFailure {
    fn text(&self) -> String {
        let Self { target, error, goes_on } = self;
        let error = match error {
            // The server knows the file by its digest alone.
            lightpath::Error::Refused(_) => format!("{}: {error}", target.display()),
            _ => error.to_string(),
        };
        goes_on.iter().fold(error, |text, goes_on| format!("{text}\n  {goes_on}"))
    }
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
        Failure::Target(failure) => (code_of(&failure.error), failure.text()),
        Failure::Jobs(endings) => (1, endings.join("\nlightpath: ")),
        Failure::Usage(text) => (2, text.clone()),
        Failure::Interrupted(text) => (130, text.clone()),
        // Whoever read the output has seen enough.
        Failure::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => return ExitCode::SUCCESS,
        Failure::Output(error) => (1, format!("could not write the output: {error}")),
    };
    let hint = match failure {
        Failure::Client(error) | Failure::Target(TargetFailure { error, .. }) if error.is_unreachable() => {
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
