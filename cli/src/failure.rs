//! Failures of commands: their exit codes and their text on stderr.

use super::show;
use std::io::{self, Write as _};
use std::path::PathBuf;
use std::process::ExitCode;

/// The reason why a command failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The server refused a call or could not be reached, or a file could not be read or written.
    Client(lightpath::Error),
    /// An error of [`Self::Client`] for one of several targets.
    Target(TargetFailure),
    /// The connection was lost for too long while the command waited for jobs. The text says how to go on.
    Waiting(lightpath::Error, String),
    /// Another failure, and what to do about it.
    Advised(Box<Failure>, String),
    /// Jobs failed or were cancelled. One line for each job says how it ended.
    Jobs(Vec<String>),
    /// The arguments of the command are wrong.
    Usage(String),
    /// A document, a key or a file is not acceptable, or what was asked for does not exist.
    Refused(String),
    /// The user pressed Ctrl-C. The text says what to do next.
    Interrupted(String),
    /// The command has printed what is wrong. The number is the exit code.
    Silent(u8),
    /// The output could not be written.
    Output(io::Error),
}

/// A target whose job could not be submitted.
#[derive(Debug)]
pub(crate) struct TargetFailure {
    pub(crate) target: PathBuf,
    pub(crate) error: lightpath::Error,
    /// Text about the jobs of earlier targets. `None` if there are none.
    pub(crate) earlier_jobs: Option<String>,
}

impl TargetFailure {
    fn text(&self) -> String {
        let Self { target, error, earlier_jobs } = self;
        let error = match error {
            // The server's message names only the digest, so add the file's path.
            lightpath::Error::Refused(_) => format!("{}: {error}", target.display()),
            _ => error.to_string(),
        };
        earlier_jobs.iter().fold(error, |text, jobs| format!("{text}\n  {jobs}"))
    }
}

impl From<lightpath::Error> for Failure {
    fn from(error: lightpath::Error) -> Self {
        Self::Client(error)
    }
}

/// Prints a failure on stderr and returns the exit code.
pub(crate) fn report(failure: &Failure) -> ExitCode {
    let (code, text) = match code_and_text(failure) {
        Ok(described) => described,
        Err(code) => return code,
    };
    // If stderr fails, the error cannot be reported anywhere.
    let _ = writeln!(io::stderr().lock(), "lightpath: {}", show::plain_lines(&text));
    ExitCode::from(code)
}

/// Exit code and text of a failure, or the exit code of one that says nothing.
fn code_and_text(failure: &Failure) -> Result<(u8, String), ExitCode> {
    let (code, text) = match failure {
        Failure::Advised(failure, advice) => {
            let (code, text) = code_and_text(failure)?;
            (code, format!("{text}\n  {advice}"))
        }
        Failure::Client(error) => (code_of(error), error.to_string()),
        Failure::Target(failure) => (code_of(&failure.error), failure.text()),
        Failure::Waiting(error, hint) => (code_of(error), format!("{error}\n  {hint}")),
        Failure::Jobs(endings) => (1, endings.join("\nlightpath: ")),
        Failure::Usage(text) => (2, text.clone()),
        Failure::Refused(text) => (1, text.clone()),
        Failure::Interrupted(text) => (130, text.clone()),
        Failure::Silent(code) => return Err(ExitCode::from(*code)),
        // The reader of the pipe closed it on purpose, as `head` does.
        Failure::Output(error) if error.kind() == io::ErrorKind::BrokenPipe => return Err(ExitCode::SUCCESS),
        Failure::Output(error) => (1, format!("could not write the output: {error}")),
    };
    let hint = match failure {
        Failure::Client(error) | Failure::Target(TargetFailure { error, .. }) | Failure::Waiting(error, _)
            if error.is_unreachable() =>
        {
            "\n  is it running? start it with `lightpathd serve`, or give another address with --server or LIGHTPATH_SERVER"
        }
        _ => "",
    };
    Ok((code, text + hint))
}

fn code_of(error: &lightpath::Error) -> u8 {
    match error {
        lightpath::Error::Unreachable { .. } => 3,
        lightpath::Error::Url { .. } | lightpath::Error::Token | lightpath::Error::File { .. } => 2,
        _ => 1,
    }
}
