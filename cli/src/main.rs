//! The program `lightpath`. `lightpath help` lists its commands, and `lightpath help COMMAND` explains one.
//!
//! Each command has a file or a folder, and each kind of job a file in `jobs`, with the command that submits it. Files that several share:
//!
//! - `arguments`, `words`, `kernel_choice`, `jobs::submission`: command-line arguments.
//! - `session`: the connection and the forms of output. `pages`: lists. `failure`: exit codes and error output. `missing`: what to do about
//!   names that do not exist.
//! - `inputs`, `destination`: input files, and places of output files. `identifiers`: ids of which only the beginning is given.
//! - `terminal`: the width of the terminal. `table`, `show`, `dataset_text`, `whole_dataset`, `metrics_text`, `propagation_text`: text output for people.
//!   `jobs::progress`: waiting for jobs, with progress bars.

#![cfg_attr(test, allow(clippy::unwrap_used))]

/// A group of commands. Each variant has the arguments of a command, which runs itself.
macro_rules! commands {
    ($(#[$help:meta])* $group:ident { $($command:ident($arguments:ty),)+ }) => {
        $(#[$help])*
        // Each variant takes its help from the struct of its arguments. A comment here would hide all but its first line.
        #[derive(Debug, clap::Subcommand)]
        pub(crate) enum $group { $($command($arguments),)+ }

        impl $group {
            pub(crate) async fn run(self, session: &Session) -> Result<(), Failure> {
                match self { $(Self::$command(command) => command.run(session).await,)+ }
            }
        }
    };
}

mod arguments;
mod calibrate;
mod dataset;
mod dataset_text;
mod destination;
mod device;
mod display;
mod doctor;
mod failure;
mod hologram;
mod identifiers;
mod inputs;
mod job;
mod jobs;
mod kernel;
mod kernel_choice;
mod keyring;
mod metrics_text;
mod missing;
mod pages;
mod photo;
mod propagation_text;
mod queue;
mod rig;
mod rollout;
mod session;
mod show;
mod table;
mod terminal;
mod times;
mod webhook;
mod whole_dataset;
mod words;

use clap::{CommandFactory as _, Parser, Subcommand};
use failure::Failure;
use session::{Output, Session};
use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

/// Compute holograms and learn light transport on a Lightpath server.
///
/// Declare a display, send target pictures and get phase holograms. Send photographs of these holograms and get a
/// learned kernel of the display. New holograms that use the kernel look better.
#[derive(Debug, Parser)]
#[command(name = "lightpath", version, max_term_width = 80, after_long_help = EXAMPLES)]
struct Cli {
    /// Use the server at this address
    #[arg(
        long,
        global = true,
        env = "LIGHTPATH_SERVER",
        default_value = "http://127.0.0.1:7070",
        value_name = "URL",
        help_heading = "Global options"
    )]
    server: String,

    /// Read the access token from this file, for a server that requires one
    #[arg(long, global = true, env = "LIGHTPATH_TOKEN_FILE", value_name = "FILE", help_heading = "Global options")]
    token_file: Option<PathBuf>,

    /// Trust the certificate authority in this PEM file, if the system does not trust it already
    #[arg(long, global = true, env = "LIGHTPATH_CA_FILE", value_name = "FILE", help_heading = "Global options")]
    ca_file: Option<PathBuf>,

    /// Send the client certificate in this PEM file, for a server that requires one; needs --client-key
    #[arg(
        long,
        global = true,
        env = "LIGHTPATH_CLIENT_CERT",
        value_name = "FILE",
        requires = "client_key",
        help_heading = "Global options"
    )]
    client_cert: Option<PathBuf>,

    /// Use the private key in this PEM file for --client-cert
    #[arg(
        long,
        global = true,
        env = "LIGHTPATH_CLIENT_KEY",
        value_name = "FILE",
        requires = "client_cert",
        help_heading = "Global options"
    )]
    client_key: Option<PathBuf>,

    /// Send the token unencrypted, over http://, to a server on another machine: only if nobody else is on the network
    #[arg(long, global = true, env = "LIGHTPATH_TOKEN_OVER_HTTP", help_heading = "Global options")]
    token_over_http: bool,

    /// Print tables for people, or the API's messages in protobuf's JSON form: one document, or one line each
    #[arg(long, global = true, default_value = "table", value_name = "FORM", help_heading = "Global options")]
    output: Output,

    #[command(subcommand)]
    command: Command,
}

const EXAMPLES: &str = "\
A first hologram:
  lightpath display create lab-2 --resolution 1920x1080 --pixel-pitch 8um \\
      --wavelength 515nm
  lightpath hologram optimize indian_head.png --display lab-2 --distance 150mm \\
      -o pattern.png

A first kernel, from photographs of holograms (about 8 pairs, better 16):
  lightpath dataset create bench-1 --display lab-2 --distance 150mm
  lightpath dataset add bench-1 --pattern p01.png --photo c01.png
  lightpath dataset add bench-1 --pattern p02.png --photo c02.png
  lightpath dataset finalize bench-1
  lightpath kernel learn --dataset bench-1 --wait
  lightpath kernel promote --display lab-2 --distance 150mm --version 1

If something does not work:
  lightpath doctor

Lengths have units: 150mm, 8um, 515nm, 0.15m; a plain number is in metres. For the id of a job its beginning suffices, as \
long as no other job's id begins with it.

Results go to standard output; progress, notes and errors go to standard error. Colours appear only on terminals, and \
not if NO_COLOR is set.

Exit codes: 0 success, 1 a job failed or the server refused the call, 2 wrong usage, 3 no server could be \
reached, 130 interrupted (submitted jobs continue on the server).";

// Variants without a comment take their help from the struct of their arguments. A comment here would hide all but its
// first line.
#[derive(Debug, Subcommand)]
enum Command {
    #[command(flatten)]
    Call(Box<Call>),
    Completions(Completions),
    Man(Man),
}

/// Commands that call a server.
#[derive(Debug, Subcommand)]
enum Call {
    /// Declare, list, show and delete displays
    #[command(subcommand)]
    Display(display::DisplayCommand),
    /// Compute holograms and save their files
    #[command(subcommand)]
    Hologram(hologram::HologramCommand),
    /// Collect photographs to learn kernels from
    #[command(subcommand)]
    Dataset(dataset::DatasetCommand),
    /// Learn, judge, promote, show, export and import kernels
    #[command(subcommand)]
    Kernel(kernel::KernelCommand),
    /// Bring a version of a kernel to some devices first, and then to all
    #[command(subcommand)]
    Rollout(rollout::RolloutCommand),
    /// Show which devices use which version, and put them into groups
    #[command(subcommand)]
    Device(device::DeviceCommand),
    /// Show the keys that sign manifests of kernels, and sign keyrings
    #[command(subcommand)]
    Keyring(keyring::KeyringCommand),
    Simulate(jobs::simulate_capture::Simulate),
    Capture(jobs::capture_photos::Capture),
    Calibrate(calibrate::Calibrate),
    /// Show the rigs at the benches that are connected
    #[command(subcommand)]
    Rig(rig::RigCommand),
    /// Measure photographs of what displays show
    #[command(subcommand)]
    Photo(photo::PhotoCommand),
    /// List, show, watch, cancel and retry jobs
    #[command(subcommand)]
    Job(job::JobCommand),
    /// Show, pause and resume the queue
    #[command(subcommand)]
    Queue(queue::QueueCommand),
    /// Let an address know when jobs end, and when kernels and rollouts change
    #[command(subcommand)]
    Webhook(webhook::WebhookCommand),
    Doctor(doctor::Doctor),
}

/// Print a completion script for a shell.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Examples:
  lightpath completions bash \\
      > ~/.local/share/bash-completion/completions/lightpath
  lightpath completions zsh > ~/.zfunc/_lightpath
  lightpath completions fish > ~/.config/fish/completions/lightpath.fish")]
struct Completions {
    /// Print the script for this shell
    shell: clap_complete::Shell,
}

/// Write the man pages of lightpath and of all its commands.
///
/// Then man lightpath-hologram-optimize explains a command. `lightpathd man` does the same for the server.
#[derive(Debug, clap::Args)]
#[command(after_long_help = "\
Example:
  lightpath man --out ~/.local/share/man/man1")]
struct Man {
    /// Write the pages into this folder; a missing folder is created
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    terminal::measure();
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
    let outcome = runtime.map_err(Failure::Output).and_then(|runtime| runtime.block_on(run(cli)));
    outcome.map_or_else(|failure| failure::report(&failure), |()| ExitCode::SUCCESS)
}

async fn run(cli: Cli) -> Result<(), Failure> {
    let call = match cli.command {
        Command::Call(call) => call,
        Command::Completions(completions) => return print_completions(completions.shell),
        Command::Man(man) => return man.write(),
    };
    let session = Session::open(
        &cli.server,
        cli.token_file.as_deref(),
        cli.ca_file.as_deref(),
        cli.client_cert.as_deref().zip(cli.client_key.as_deref()),
        cli.token_over_http,
        cli.output,
    )?;
    match call.run(&session).await {
        Err(failure) => Err(missing::explained(&session, failure).await),
        Ok(()) => Ok(()),
    }
}

impl Call {
    async fn run(self, session: &Session) -> Result<(), Failure> {
        match self {
            Self::Display(command) => command.run(session).await,
            Self::Hologram(command) => command.run(session).await,
            Self::Dataset(command) => command.run(session).await,
            Self::Kernel(command) => command.run(session).await,
            Self::Rollout(command) => command.run(session).await,
            Self::Device(command) => command.run(session).await,
            Self::Keyring(command) => command.run(session).await,
            Self::Simulate(command) => command.run(session).await,
            Self::Capture(command) => command.run(session).await,
            Self::Calibrate(command) => command.run(session).await,
            Self::Rig(command) => command.run(session).await,
            Self::Photo(command) => command.run(session).await,
            Self::Job(command) => command.run(session).await,
            Self::Queue(command) => command.run(session).await,
            Self::Webhook(command) => command.run(session).await,
            Self::Doctor(command) => command.run(session).await,
        }
    }
}

impl Man {
    fn write(&self) -> Result<(), Failure> {
        let file_error = |source| lightpath::Error::File { action: "write", path: self.out.clone(), source };
        let pages = lightpath_program_docs::write_man_pages(Cli::command(), &self.out).map_err(file_error)?;
        session::print_note(&format!("wrote {pages} pages to {}", self.out.display()));
        Ok(())
    }
}

fn print_completions(shell: clap_complete::Shell) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(shell, &mut Cli::command(), "lightpath", &mut script);
    std::io::stdout().lock().write_all(&script).map_err(Failure::Output)
}

#[cfg(test)]
mod example_tests;
#[cfg(test)]
mod tests;
