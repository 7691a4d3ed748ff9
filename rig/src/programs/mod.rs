//! What the commands do.

mod check;
mod serve;

use crate::arguments::{Cli, Command};
use crate::settings::{EXAMPLE, Settings};
use crate::state::{Pause, PauseFile, Running};
use crate::{Problem, log};
use clap::Parser as _;
use std::io::Write as _;
use std::path::Path;
use std::process::ExitCode;
use std::thread;
use std::time::{Duration, Instant};

/// Longest wait for the rig to make the bench safe: the photograph that it takes ends first.
const SAFE_LIMIT: Duration = Duration::from_secs(600);
/// Time between two looks.
const LOOK: Duration = Duration::from_millis(100);

/// Parses the command line, does what it asks for and returns the exit code.
#[must_use]
pub fn run() -> ExitCode {
    let done = match Cli::parse().command {
        Command::Init(arguments) => init(&arguments.settings),
        Command::Check(arguments) => check::check(&arguments.settings).and_then(|table| say(&table)),
        Command::Serve(arguments) => serve::serve(&arguments),
        Command::Pause(arguments) => pause(&arguments.settings.settings, &arguments.reason),
        Command::Resume(arguments) => resume(&arguments.settings),
    };
    done.map_or_else(|problem: Problem| problem_code(&problem), |()| ExitCode::SUCCESS)
}

fn problem_code(problem: &Problem) -> ExitCode {
    log::line(format_args!("lightpath-rig: {problem}"));
    problem.exit_code()
}

/// Writes an example of the rig's file.
fn init(path: &Path) -> Result<(), Problem> {
    let place = path.display();
    let made = std::fs::OpenOptions::new().write(true).create_new(true).open(path);
    let written = made.and_then(|mut file| file.write_all(EXAMPLE.as_bytes()));
    written.map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => {
            Problem::Setting(format!("{place} is there already: name another file with --settings"))
        }
        _ => Problem::Setting(format!("{place} cannot be written: {error}")),
    })?;
    say(&format!("{place} describes a simulated bench. Next: lightpath-rig check --settings {place}"))
}

/// Lets requests wait, and returns when the bench is safe.
fn pause(path: &Path, reason: &str) -> Result<(), Problem> {
    let folder = Settings::read(path)?.state_folder;
    let file = PauseFile::in_folder(&folder);
    let wrong = |error| Problem::Setting(format!("state_folder {}: {error}", folder.display()));
    if !Running::is_taken(&folder) {
        // What a rig said that is gone says nothing about the next one.
        file.mark_seen(false);
        file.begin(&Pause::now(reason)).map_err(wrong)?;
        return say("No rig runs with this file, so nothing was made safe. A rig that starts now waits. \
                    `lightpath-rig resume` ends the pause.");
    }
    file.begin(&Pause::now(reason)).map_err(wrong)?;
    let end = Instant::now() + SAFE_LIMIT;
    while !file.is_seen() {
        if Instant::now() > end || !Running::is_taken(&folder) {
            return Err(Problem::Devices(
                "the rig did not say that the bench is safe: look at its log, and at the bench".to_owned(),
            ));
        }
        thread::sleep(LOOK);
    }
    say("The rig has put the bench into its safe state, and waits. `lightpath-rig resume` ends the pause.")
}

/// Ends a pause.
fn resume(path: &Path) -> Result<(), Problem> {
    let folder = Settings::read(path)?.state_folder;
    let ended = PauseFile::in_folder(&folder).end();
    let ended = ended.map_err(|error| Problem::Setting(format!("state_folder {}: {error}", folder.display())))?;
    say(if ended { "The pause has ended." } else { "There was no pause." })
}

/// Prints a line.
fn say(text: &str) -> Result<(), Problem> {
    let written = writeln!(std::io::stdout().lock(), "{text}");
    written.map_err(|error| Problem::Setting(format!("stdout cannot be written: {error}")))
}
